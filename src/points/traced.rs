//! The points of a picture by rays: through mirrors and glass, and through a lens, to the first diffuse surface. Same pixels as `camera`, and
//! where nothing is specular the same points.
//!
//! At glass a ray takes one of two ways, on the lens it has one place: numbers of low discrepancy over the blocks of a picture choose, shifted
//! for each pixel. Lights that are seen by way of glass are so bright that to choose would show as specks: there all ways are followed. What the path lets pass multiplies the albedo of the point at its end, so that whoever gathers there knows nothing of it.

use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;

use super::list::octahedral_encode;
use super::{Points, Subset, Visible};
use crate::error::Result;
use crate::gpu::{Filter, Format, Gpu, Target, Texture, Wrap};
use crate::random::{Random, Recurrence};
use crate::scene::{Bvh, Camera, MOST_SPECULAR, Path, Scene, Split};

/// The least share of a light that a way is followed for.
const LEAST: f32 = 1e-3;

/// Casts eye rays through one scene.
#[derive(Clone, Copy)]
pub struct EyeRays<'a> {
    pub scene: &'a Scene,
    pub bvh: &'a Bvh,
    pub camera: &'a Camera,
    /// Of the picture in pixels.
    pub size: [u32; 2],
    pub seed: u64,
}

/// What one ray found, as in [`Visible`].
#[derive(Clone, Copy, Default)]
struct Seen {
    position: Vec4,
    normal: Vec4,
    albedo: Vec4,
    emission: Vec4,
    cut: bool,
}

impl EyeRays<'_> {
    /// Looks through every pixel at `offset`, in [0, 1)², from its lower left corner; `block` numbers the rays of a pixel.
    pub fn see(&self, offset: Vec2, block: u32) -> Visible {
        let numbers: [f32; 3] = Recurrence::new(self.seed ^ 0x1e25).point(block.into());
        let [width, height] = self.size;
        let seen: Vec<Seen> = (0..width * height)
            .into_par_iter()
            .map(|pixel| {
                let corner = Vec2::new((pixel % width) as f32, (pixel / width) as f32);
                let place = (corner + offset) / Vec2::new(width as f32, height as f32);
                let mut random = Random::new(self.seed ^ 0x1e25, pixel.into());
                let [u, v, choice] = numbers.map(|number| (number + random.uniform()).fract());
                let (eye, direction) =
                    self.camera.ray_by_lens(Vec2::new(place.x, 1.0 - place.y), width as f32 / height as f32, [u, v]);
                self.follow(Path { origin: eye, direction, triangle: None }, choice)
            })
            .collect();
        let column = |of: fn(&Seen) -> Vec4| seen.iter().map(of).collect();
        Visible {
            position: column(|seen| seen.position),
            normal: column(|seen| seen.normal),
            albedo: column(|seen| seen.albedo),
            emission: column(|seen| seen.emission),
            count: seen.iter().filter(|seen| seen.normal.truncate() != Vec3::ZERO).count() as u32,
            cut: seen.iter().filter(|seen| seen.cut).count() as u32,
        }
    }

    fn follow(&self, mut path: Path, mut choice: f32) -> Seen {
        let (mesh, forward) = (&self.scene.mesh, -self.camera.axes().z_axis);
        let mut seen = Seen::default();
        let mut throughput = Vec3::ONE;
        for surfaces in 0.. {
            let Some(triangle) = path.advance(self.bvh) else {
                // Past glass and mirrors, what lies beyond is seen by all ways already.
                if surfaces == 0 {
                    seen.emission = self.scene.beyond(path.direction).extend(0.0);
                }
                break;
            };
            if surfaces == 0 {
                seen.emission = self.emitted(&path, Vec3::ONE, 0).extend(forward.dot(path.origin - self.camera.eye));
            }
            let side = mesh.side_met(triangle, path.direction);
            let barycentric = mesh.barycentric(triangle, path.origin);
            // Where the path ends without a point, this is still where the surface is.
            let code = octahedral_encode(side);
            seen.position = path.origin.extend(code.x);
            let Some(share) = path.scatter(self.scene, &mut choice) else {
                seen.normal = mesh.shading_normal(triangle, barycentric, side).extend(code.y);
                seen.albedo = (throughput * self.scene.albedo(triangle, barycentric)).extend(1.0);
                break;
            };
            throughput *= share;
            seen.cut = surfaces == MOST_SPECULAR;
            if seen.cut {
                break;
            }
        }
        seen
    }

    /// Emitted radiance from where a path is on a surface, by all ways on, and from beyond all surfaces.
    fn emitted(&self, path: &Path, throughput: Vec3, surfaces: u32) -> Vec3 {
        let Some(triangle) = path.triangle else { return Vec3::ZERO };
        let front = self.scene.mesh.geometric_normal(triangle).dot(path.direction) < 0.0;
        let own = if front { throughput * self.scene.material(triangle).emission } else { Vec3::ZERO };
        let Some(Split { reflectance, reflected, refracted, kept }) = path.split(self.scene) else { return own };
        let beyond = |(mut way, share): (Path, Vec3)| {
            if share.max_element() <= LEAST || surfaces >= MOST_SPECULAR {
                return Vec3::ZERO;
            }
            match way.advance(self.bvh) {
                Some(_) => self.emitted(&way, share, surfaces + 1),
                None => share * self.scene.beyond(way.direction),
            }
        };
        let ways = [(reflected, reflectance * kept[0]), (refracted, (1.0 - reflectance) * kept[1])];
        own + ways.map(|(way, share)| beyond((way, throughput * share))).into_iter().sum::<Vec3>()
    }
}

/// The points that rays found last, on the GL side.
pub struct TracedPoints {
    position: Texture,
    normal: Texture,
    count: u32,
}

impl TracedPoints {
    /// # Errors
    /// When the picture is beyond the device's limits.
    pub fn upload(gpu: &Gpu, size: [u32; 2], visible: &Visible) -> Result<Self> {
        let upload = |texels: &[Vec4]| Texture::from_texels(gpu, Format::Rgba32F, size, Filter::Nearest, Wrap::Clamp, texels);
        Ok(Self { position: upload(&visible.position)?, normal: upload(&visible.normal)?, count: visible.count })
    }

    /// Bytes that [`Self::upload`] takes.
    pub fn bytes(size: [u32; 2]) -> usize {
        Target::bytes(size, &[Format::Rgba32F; 2], false)
    }

    pub fn points(&self) -> Points<'_> {
        Points { position: &self.position, normal: &self.normal, subset: Subset::ALL, count: self.count }
    }
}
