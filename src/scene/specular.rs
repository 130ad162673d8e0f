//! Light paths through mirrors, glass and lobes. Eye rays and photons use them alike.
//!
//! Glass fills a closed surface, behind its fronts. Snell's law is n sin θ = n' sin θ'. The reflectance for unpolarised light (Fresnel) is the mean of
//! ((n cos θ - n' cos θ') / (n cos θ + n' cos θ'))² and ((n' cos θ - n cos θ') / (n' cos θ + n cos θ'))². It is 1 if no θ' satisfies Snell's law. A
//! path takes one way at random, with its share of light as probability, so it needs no further weight.

use glam::Vec3;

use super::{Brdf, Bvh, RAY_OFFSET, Scene, Surface, facing};

/// Maximum number of consecutive mirrors and glass faces on a path. A mirror of reflectance 0.9 returns 3 % after this number.
pub const MOST_SPECULAR: u32 = 32;

/// A ray that continues from surface to surface.
#[derive(Clone, Copy, Debug)]
pub struct Path {
    pub origin: Vec3,
    /// Unit vector.
    pub direction: Vec3,
    /// The triangle that the origin lies on.
    pub triangle: Option<usize>,
}

impl Path {
    /// Moves to the nearest surface and returns its triangle. Without a hit it returns `None` and does not move.
    pub fn advance(&mut self, bvh: &Bvh) -> Option<usize> {
        let hit = bvh.nearest(self.origin, self.direction, self.triangle)?;
        self.origin += hit.distance * self.direction;
        self.triangle = Some(hit.triangle);
        self.triangle
    }

    /// Leaves the surface on the side of the unit normal `side`.
    pub fn leave(&mut self, side: Vec3, direction: Vec3) {
        self.origin += RAY_OFFSET * side;
        self.direction = direction;
    }

    /// Leaves a mirror or glass and returns the remaining share of the light (RGB). On a diffuse surface it returns `None` and changes nothing.
    /// `choice`, uniform in [0, 1), selects one of two ways. Its remainder is uniform again and serves the next surface.
    pub fn scatter(&mut self, scene: &Scene, choice: &mut f32) -> Option<Vec3> {
        let Split { reflectance, reflected, refracted, kept } = self.split(scene)?;
        let reflects = *choice < reflectance;
        *choice = if reflects { *choice / reflectance } else { (*choice - reflectance) / (1.0 - reflectance) };
        *self = if reflects { reflected } else { refracted };
        Some(kept[usize::from(!reflects)])
    }

    /// The reflection of a glossy surface that the path has met, and the unit shading normal there, on its side. `None` on other surfaces.
    pub fn gloss(&self, scene: &Scene) -> Option<(Brdf, Vec3)> {
        let triangle = self.triangle?;
        scene.material(triangle).shaded_gloss()?;
        let barycentric = scene.mesh.barycentric(triangle, self.origin);
        let brdf = scene.brdf(triangle, barycentric, scene.base_color(triangle, barycentric))?;
        let side = scene.mesh.side_met(triangle, self.direction);
        let normal = scene.mesh.shading_normal(triangle, barycentric, side);
        Some((brdf, facing(scene.mapped_normal(triangle, barycentric, normal, side), -self.direction)))
    }

    /// Leaves a glossy surface by its lobe, with a direction by a uniform point of the unit square. Returns the weight: what the lobe reflects, over the
    /// density. `None` if the lobe reflects nothing there.
    pub fn leave_by_lobe(&mut self, scene: &Scene, (brdf, normal): (&Brdf, Vec3), square: [f32; 2]) -> Option<Vec3> {
        let side = scene.mesh.side_met(self.triangle?, self.direction);
        let (light, weight) = brdf.sample_lobe(normal, -self.direction, square)?;
        // A shading normal may send light through the face. It goes on above it, as if the face were bent.
        let above = light.dot(side);
        self.leave(side, if above < 0.0 { light - 2.0 * above * side } else { light });
        Some(weight)
    }

    /// Both ways from a mirror or glass: reflection and refraction.
    pub fn split(&self, scene: &Scene) -> Option<Split> {
        let (mesh, triangle, incoming) = (&scene.mesh, self.triangle?, self.direction);
        let met = mesh.side_met(triangle, incoming);
        let barycentric = mesh.barycentric(triangle, self.origin);
        let (ratio, kept) = match scene.material(triangle).surface {
            Surface::Diffuse => return None,
            Surface::Mirror => (None, [scene.albedo(triangle, barycentric), Vec3::ZERO]),
            Surface::Glass { index, filter } => {
                let enters = mesh.meets_front(triangle, incoming);
                // A body has two faces, so each takes the square root.
                (Some(if enters { index.recip() } else { index }), [Vec3::ONE, filter.map(f32::sqrt)])
            }
        };
        let through = |normal: Vec3| ratio.map_or(Vec3::ZERO, |ratio| incoming.refract(normal, ratio));
        // An interpolated normal may send light through the face.
        let smooth = mesh.shading_normal(triangle, barycentric, met);
        let fits = |normal: Vec3| {
            normal.dot(incoming) < 0.0 && incoming.reflect(normal).dot(met) > 0.0 && through(normal).dot(met) <= 0.0
        };
        let normal = if fits(smooth) { smooth } else { met };
        let leaving = |side: Vec3, direction: Vec3| Self {
            origin: self.origin + RAY_OFFSET * side,
            direction: direction.normalize_or_zero(),
            ..*self
        };
        Some(Split {
            reflectance: ratio.map_or(1.0, |ratio| fresnel(-normal.dot(incoming), ratio)),
            reflected: leaving(met, incoming.reflect(normal)),
            refracted: leaving(-met, through(normal)),
            kept,
        })
    }
}

/// The ways from glass, or the one way from a mirror.
#[derive(Clone, Copy, Debug)]
pub struct Split {
    /// Share of light that is reflected.
    pub reflectance: f32,
    pub reflected: Path,
    pub refracted: Path,
    /// Remaining share (RGB) of the reflected light and of the refracted light.
    pub kept: [Vec3; 2],
}

/// Reflectance of a glass face for unpolarised light, by the cosine of the angle of incidence. `ratio`: index before the face over index behind.
pub fn fresnel(cosine: f32, ratio: f32) -> f32 {
    let squared_sine = ratio * ratio * (1.0 - cosine * cosine);
    if squared_sine >= 1.0 {
        return 1.0;
    }
    let refracted = (1.0 - squared_sine).sqrt();
    let share = |a: f32, b: f32| ((a - b) / (a + b)).powi(2);
    (share(ratio * cosine, refracted) + share(cosine, ratio * refracted)) / 2.0
}
