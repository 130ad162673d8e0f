//! Finds the points of a picture by rays, through a lens, mirrors, glass and narrow lobes, to the first diffuse surface. Pixels are those of `camera`, and
//! without specular surfaces and a lens the points are too.
//!
//! At glass, a ray is either reflected or refracted, and it starts at one place on the lens. Low-discrepancy numbers over the blocks of a
//! picture choose, with a random shift for each pixel. Lights seen through glass are so bright that a choice would show as specks, so emission
//! follows all paths. The path's transmittance multiplies the albedo of its end point, so gathering needs no knowledge of mirrors and glass.
//!
//! At a glossy surface with a narrow lobe a path takes the lobe, or ends at the base, with what each reflects as probability. Emission follows several
//! directions of the lobe. A wide lobe ends the path; the gather samples it.

use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;

use super::gloss::SeenReflection;
use super::list::octahedral_encode;
use super::{GBuffer, GatherPoint, Ground, PointGloss};
use crate::random::{Random, Recurrence};
use crate::scene::{Bvh, Camera, Chance, LobeShares, MOST_SPECULAR, Path, Rays, Scene, Split};

/// Paths to emission end where their transmittance falls below this.
const LEAST: f32 = 1e-3;
/// Greatest probability of the lobe in a scene with lights that no ray meets. The paths that end at the surface have their highlights.
const MOST_BY_LOBE: f32 = 0.75;
/// Directions of the first lobe along which a pixel's path looks for emission.
const LOBE_RAYS: u64 = 4;

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
    gloss: PointGloss,
    cut: bool,
}

/// The numbers by which a pixel's path takes directions of lobes, and passes cut-outs.
struct LobeNumbers<'a> {
    even: &'a Recurrence<2>,
    /// Of the pixel.
    shift: [f32; 2],
    block: u64,
    random: Random,
    rays: &'a Rays<'a>,
    pixel: u32,
}

impl LobeNumbers<'_> {
    /// For the first lobe of a pixel's path: direction `ray` of `rays` in each block. All blocks together spread them evenly.
    fn first(&self, ray: u64, rays: u64) -> [f32; 2] {
        let even = self.even.point(self.block * rays + ray);
        [0, 1].map(|axis| (even[axis] + self.shift[axis]).fract())
    }

    fn next(&mut self) -> [f32; 2] {
        [self.random.uniform(), self.random.uniform()]
    }

    /// As [`Path::advance`], after so many surfaces.
    fn advance(&self, path: &mut Path, surfaces: u32) -> Option<usize> {
        path.advance(self.rays, Chance::of_pixel(self.pixel, self.block as u32, surfaces))
    }
}

impl EyeRays<'_> {
    /// Traces one ray a pixel, at `offset`, in [0, 1)², from its lower left corner. `block` numbers the rays of a pixel.
    pub fn see(&self, offset: Vec2, block: u32) -> GBuffer {
        let numbers: [f32; 3] = Recurrence::new(self.seed ^ 0x1e25).point(block.into());
        let even = Recurrence::new(self.seed ^ 0x106e);
        let [width, height] = self.size;
        let rays = Rays::new(self.scene, self.bvh);
        let texels: Vec<GBufferTexel> = (0..width * height)
            .into_par_iter()
            .map(|pixel| {
                let corner = Vec2::new((pixel % width) as f32, (pixel / width) as f32);
                let place = (corner + offset) / Vec2::new(width as f32, height as f32);
                let mut random = Random::new(self.seed ^ 0x1e25, pixel.into());
                let [u, v, choice] = numbers.map(|number| (number + random.uniform()).fract());
                let (eye, direction) =
                    self.camera.ray_by_lens(Vec2::new(place.x, 1.0 - place.y), width as f32 / height as f32, [u, v]);
                let shift = [random.uniform(), random.uniform()];
                let lobes = LobeNumbers { even: &even, shift, block: block.into(), random, rays: &rays, pixel };
                self.follow(Path { origin: eye, direction, triangle: None }, choice, lobes)
            })
            .collect();
        let column = |of: fn(&GBufferTexel) -> Vec4| texels.iter().map(of).collect();
        let count = |is: fn(&GBufferTexel) -> bool| texels.iter().filter(|texel| is(texel)).count() as u32;
        let glossy = self.scene.is_glossy();
        GBuffer {
            gloss: texels.iter().filter(|_| glossy).map(|texel| texel.gloss).collect(),
            position: column(|texel| texel.position),
            normal: column(|texel| texel.normal),
            albedo: column(|texel| texel.albedo),
            emission: column(|texel| texel.emission),
            count: count(|texel| texel.normal.truncate() != Vec3::ZERO),
            cut: count(|texel| texel.cut),
        }
    }

    fn follow(&self, mut path: Path, mut choice: f32, mut lobes: LobeNumbers) -> GBufferTexel {
        let (mesh, forward) = (&self.scene.mesh, -self.camera.axes().z_axis);
        let mut seen = GBufferTexel::default();
        let (mut throughput, mut followed) = (Vec3::ONE, 0);
        for surfaces in 0.. {
            let Some(triangle) = lobes.advance(&mut path, surfaces) else {
                // Behind glass and mirrors, `emitted` has added the environment already.
                if surfaces == 0 {
                    seen.emission = self.scene.miss_radiance(path.direction).extend(0.0);
                    let place = self.ground.as_ref().and_then(|ground| Some((ground, ground.met(path.origin, path.direction)?)));
                    [seen.position, seen.normal] = place.map_or([Vec4::ZERO; 2], |(ground, place)| ground.point(place));
                }
                break;
            };
            if surfaces == 0 {
                seen.emission = self.emitted(&path, Vec3::ONE, 0, &mut lobes).extend(forward.dot(path.origin - self.camera.eye));
            }
            // Stored also if the path ends without a point.
            let code = octahedral_encode(mesh.side_met(triangle, path.direction));
            seen.position = path.origin.extend(code.x);
            let share = path.scatter(self.scene, &mut choice).or_else(|| {
                followed += 1;
                let numbers = if followed == 1 { lobes.first(0, 1) } else { lobes.next() };
                self.end_or_follow(&mut path, &mut seen, throughput, &mut choice, numbers)
            });
            let Some(share) = share else { break };
            throughput *= share;
            seen.cut = surfaces == MOST_SPECULAR;
            if seen.cut {
                break;
            }
        }
        seen
    }

    /// Ends a path at the surface that it has met, which is no mirror or glass, and makes it the pixel's point. Or leaves it by its narrow lobe, with a
    /// direction by `numbers`, and returns the share of light that is left.
    fn end_or_follow(
        &self,
        path: &mut Path,
        seen: &mut GBufferTexel,
        mut throughput: Vec3,
        choice: &mut f32,
        numbers: [f32; 2],
    ) -> Option<Vec3> {
        let (mesh, triangle, eye) = (&self.scene.mesh, path.triangle?, -path.direction);
        let (side, barycentric) = (mesh.side_met(triangle, path.direction), mesh.barycentric(triangle, path.origin));
        let normal = mesh.shading_normal(triangle, barycentric, side);
        let point = GatherPoint { position: path.origin, normal, surface_normal: side };
        let mut albedo = self.scene.base_color(triangle, barycentric);
        let SeenReflection { normal, brdf } = SeenReflection::new(self.scene, triangle, &point, albedo, eye);
        if let Some(brdf) = brdf {
            let LobeShares { base, lobe, .. } = brdf.shares(normal.dot(eye));
            if !brdf.is_rough() {
                let most = if self.scene.lights.is_empty() { 1.0 } else { MOST_BY_LOBE };
                let share = (throughput * lobe).element_sum() / (throughput * (base + lobe)).element_sum();
                let probability = share.min(most);
                if *choice < probability || probability >= 1.0 {
                    *choice /= probability;
                    return path.leave_by_lobe(self.scene, (&brdf, normal), numbers).map(|weight| weight / probability);
                }
                *choice = (*choice - probability) / (1.0 - probability);
                throughput /= 1.0 - probability;
            }
            seen.gloss = PointGloss::new(brdf, normal, eye, throughput, brdf.is_rough());
            albedo = base;
        }
        seen.normal = normal.extend(octahedral_encode(side).y);
        seen.albedo = (throughput * albedo).extend((triangle + 1) as f32);
        None
    }

    /// The radiance that surfaces and environment emit along all paths that continue this one, times `throughput`.
    fn emitted(&self, path: &Path, throughput: Vec3, surfaces: u32, lobes: &mut LobeNumbers) -> Vec3 {
        let Some(triangle) = path.triangle else { return Vec3::ZERO };
        let front = self.scene.mesh.meets_front(triangle, path.direction);
        let own = throughput * self.scene.emission(triangle, self.scene.mesh.barycentric(triangle, path.origin), front);
        let Some(Split { reflectance, reflected, refracted, kept }) = path.split(self.scene) else {
            return own + self.emitted_by_lobe(path, throughput, surfaces, lobes);
        };
        let ways = [(reflected, reflectance * kept[0]), (refracted, (1.0 - reflectance) * kept[1])];
        own + ways.map(|(way, share)| self.emitted_beyond(way, throughput * share, surfaces, lobes)).into_iter().sum::<Vec3>()
    }

    /// The same of the narrow lobe of a glossy surface, the mean of several directions. Other surfaces bring nothing.
    fn emitted_by_lobe(&self, path: &Path, throughput: Vec3, surfaces: u32, lobes: &mut LobeNumbers) -> Vec3 {
        let Some((brdf, normal)) = path.gloss(self.scene).filter(|(brdf, _)| !brdf.is_rough()) else { return Vec3::ZERO };
        let rays = if surfaces == 0 { LOBE_RAYS } else { 1 };
        let mut sum = Vec3::ZERO;
        for ray in 0..rays {
            let (mut way, numbers) = (*path, if surfaces == 0 { lobes.first(ray, rays) } else { lobes.next() });
            if let Some(weight) = way.leave_by_lobe(self.scene, (&brdf, normal), numbers) {
                sum += self.emitted_beyond(way, throughput * weight, surfaces, lobes);
            }
        }
        sum / rays as f32
    }

    /// The same of a path that leaves a surface.
    fn emitted_beyond(&self, mut way: Path, throughput: Vec3, surfaces: u32, lobes: &mut LobeNumbers) -> Vec3 {
        if throughput.max_element() <= LEAST || surfaces >= MOST_SPECULAR {
            return Vec3::ZERO;
        }
        match lobes.advance(&mut way, surfaces + 1) {
            Some(_) => self.emitted(&way, throughput, surfaces + 1, lobes),
            None => throughput * self.scene.miss_radiance(way.direction),
        }
    }
}
