//! Finds the points of a picture by rays, through a lens, mirrors and glass, to the first diffuse surface. Pixels are those of `camera`, and
//! without specular surfaces and a lens the points are too.
//!
//! At glass, a ray is either reflected or refracted, and it starts at one place on the lens. Low-discrepancy numbers over the blocks of a
//! picture choose, with a random shift for each pixel. Lights seen through glass are so bright that a choice would show as specks, so emission
//! follows all paths. The path's transmittance multiplies the albedo of its end point, so gathering needs no knowledge of mirrors and glass.

use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;

use super::list::octahedral_encode;
use super::{GBuffer, Ground};
use crate::random::{Random, Recurrence};
use crate::scene::{Bvh, Camera, MOST_SPECULAR, Path, Scene, Split};

/// Paths to emission end where their transmittance falls below this.
const LEAST: f32 = 1e-3;

/// Casts eye rays through one scene.
#[derive(Clone, Copy)]
pub struct EyeRays<'a> {
    pub scene: &'a Scene,
    pub bvh: &'a Bvh,
    pub camera: &'a Camera,
    /// Width and height of the picture in pixels.
    pub size: [u32; 2],
    pub seed: u64,
    /// Catches the shadow where a ray meets no surface.
    pub ground: Option<Ground>,
}

/// One pixel of a [`GBuffer`].
#[derive(Clone, Copy, Default)]
struct GBufferTexel {
    position: Vec4,
    normal: Vec4,
    albedo: Vec4,
    emission: Vec4,
    cut: bool,
}

impl EyeRays<'_> {
    /// Traces one ray a pixel, at `offset`, in [0, 1)², from its lower left corner. `block` numbers the rays of a pixel.
    pub fn see(&self, offset: Vec2, block: u32) -> GBuffer {
        let numbers: [f32; 3] = Recurrence::new(self.seed ^ 0x1e25).point(block.into());
        let [width, height] = self.size;
        let texels: Vec<GBufferTexel> = (0..width * height)
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
        let column = |of: fn(&GBufferTexel) -> Vec4| texels.iter().map(of).collect();
        let count = |is: fn(&GBufferTexel) -> bool| texels.iter().filter(|texel| is(texel)).count() as u32;
        GBuffer {
            position: column(|texel| texel.position),
            normal: column(|texel| texel.normal),
            albedo: column(|texel| texel.albedo),
            emission: column(|texel| texel.emission),
            count: count(|texel| texel.normal.truncate() != Vec3::ZERO),
            cut: count(|texel| texel.cut),
        }
    }

    fn follow(&self, mut path: Path, mut choice: f32) -> GBufferTexel {
        let (mesh, forward) = (&self.scene.mesh, -self.camera.axes().z_axis);
        let mut seen = GBufferTexel::default();
        let mut throughput = Vec3::ONE;
        for surfaces in 0.. {
            let Some(triangle) = path.advance(self.bvh) else {
                // Behind glass and mirrors, `emitted` has added the environment already.
                if surfaces == 0 {
                    seen.emission = self.scene.miss_radiance(path.direction).extend(0.0);
                    let place = self.ground.as_ref().and_then(|ground| Some((ground, ground.met(path.origin, path.direction)?)));
                    [seen.position, seen.normal] = place.map_or([Vec4::ZERO; 2], |(ground, place)| ground.point(place));
                }
                break;
            };
            if surfaces == 0 {
                seen.emission = self.emitted(&path, Vec3::ONE, 0).extend(forward.dot(path.origin - self.camera.eye));
            }
            let side = mesh.side_met(triangle, path.direction);
            let barycentric = mesh.barycentric(triangle, path.origin);
            // Stored also if the path ends without a point.
            let code = octahedral_encode(side);
            seen.position = path.origin.extend(code.x);
            let Some(share) = path.scatter(self.scene, &mut choice) else {
                seen.normal = mesh.shading_normal(triangle, barycentric, side).extend(code.y);
                seen.albedo = (throughput * self.scene.albedo(triangle, barycentric)).extend((triangle + 1) as f32);
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

    /// The radiance that surfaces and environment emit along all paths that continue this one, times `throughput`.
    fn emitted(&self, path: &Path, throughput: Vec3, surfaces: u32) -> Vec3 {
        let Some(triangle) = path.triangle else { return Vec3::ZERO };
        let front = self.scene.mesh.meets_front(triangle, path.direction);
        let own = throughput * self.scene.emission(triangle, self.scene.mesh.barycentric(triangle, path.origin), front);
        let Some(Split { reflectance, reflected, refracted, kept }) = path.split(self.scene) else { return own };
        let beyond = |(mut way, share): (Path, Vec3)| {
            if share.max_element() <= LEAST || surfaces >= MOST_SPECULAR {
                return Vec3::ZERO;
            }
            match way.advance(self.bvh) {
                Some(_) => self.emitted(&way, share, surfaces + 1),
                None => share * self.scene.miss_radiance(way.direction),
            }
        };
        let ways = [(reflected, reflectance * kept[0]), (refracted, (1.0 - reflectance) * kept[1])];
        own + ways.map(|(way, share)| beyond((way, throughput * share))).into_iter().sum::<Vec3>()
    }
}
