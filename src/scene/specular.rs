//! The way of light through mirrors and glass, followed from the eye and from the lights alike.
//!
//! Glass is the inside of a closed surface, behind its fronts. By Snell's law n sin θ = n' sin θ'; what is reflected is, for unpolarised light
//! (Fresnel), the mean of ((n cos θ - n' cos θ') / (n cos θ + n' cos θ'))² and ((n' cos θ - n cos θ') / (n' cos θ + n cos θ'))², and all of
//! it where no θ' fulfils Snell's law. A path takes one of the two ways, each with its share as probability, so that nothing is left to weigh.

use glam::Vec3;

use super::{Bvh, RAY_OFFSET, Scene, Surface};

/// Mirrors and faces of glass that a path meets in a row, at most: a mirror that keeps 0.9 would return 3 % after so many.
pub const MOST_SPECULAR: u32 = 32;

/// A ray that goes on from surface to surface.
#[derive(Clone, Copy, Debug)]
pub struct Path {
    pub origin: Vec3,
    /// Of unit length.
    pub direction: Vec3,
    /// The triangle that it is on.
    pub triangle: Option<usize>,
}

impl Path {
    /// Goes to the nearest surface and returns its triangle; `None`, and no step, where there is none.
    pub fn advance(&mut self, bvh: &Bvh) -> Option<usize> {
        let hit = bvh.nearest(self.origin, self.direction, self.triangle)?;
        self.origin += hit.distance * self.direction;
        self.triangle = Some(hit.triangle);
        self.triangle
    }

    /// Starts from the surface, on the side of the unit normal `side`.
    pub fn leave(&mut self, side: Vec3, direction: Vec3) {
        self.origin += RAY_OFFSET * side;
        self.direction = direction;
    }

    /// Goes on from a mirror or from glass and returns the share of light that does; `None`, and no change, on a diffuse surface.
    /// `choice`, uniform in [0, 1), takes one of two ways; what is left of it, as uniform, serves the next surface.
    pub fn scatter(&mut self, scene: &Scene, choice: &mut f32) -> Option<Vec3> {
        let Split { reflectance, reflected, refracted, kept } = self.split(scene)?;
        let reflects = *choice < reflectance;
        *choice = if reflects { *choice / reflectance } else { (*choice - reflectance) / (1.0 - reflectance) };
        *self = if reflects { reflected } else { refracted };
        Some(kept[usize::from(!reflects)])
    }

    /// Both ways on from a mirror or from glass.
    pub fn split(&self, scene: &Scene) -> Option<Split> {
        let (mesh, triangle, incoming) = (&scene.mesh, self.triangle?, self.direction);
        let met = mesh.side_met(triangle, incoming);
        let barycentric = mesh.barycentric(triangle, self.origin);
        let (ratio, kept) = match scene.material(triangle).surface {
            Surface::Diffuse => return None,
            Surface::Mirror => (None, [scene.albedo(triangle, barycentric), Vec3::ZERO]),
            Surface::Glass { index, filter } => {
                let enters = mesh.geometric_normal(triangle).dot(incoming) < 0.0;
                // Two faces make a body.
                (Some(if enters { index.recip() } else { index }), [Vec3::ONE, filter.map(f32::sqrt)])
            }
        };
        let through = |normal: Vec3| ratio.map_or(Vec3::ZERO, |ratio| incoming.refract(normal, ratio));
        // An interpolated normal may send light to the wrong side of the face itself.
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

/// The ways on from a mirror, of which there is one, or from glass.
#[derive(Clone, Copy, Debug)]
pub struct Split {
    /// The share that is reflected.
    pub reflectance: f32,
    pub reflected: Path,
    pub refracted: Path,
    /// What is left of the light that goes the one way and the other.
    pub kept: [Vec3; 2],
}

/// Reflectance of unpolarised light that meets a face of glass at an angle of this cosine; `ratio` is n / n', the index that it comes from
/// over the one behind the face.
pub fn fresnel(cosine: f32, ratio: f32) -> f32 {
    let squared_sine = ratio * ratio * (1.0 - cosine * cosine);
    if squared_sine >= 1.0 {
        return 1.0;
    }
    let refracted = (1.0 - squared_sine).sqrt();
    let share = |a: f32, b: f32| ((a - b) / (a + b)).powi(2);
    (share(ratio * cosine, refracted) + share(cosine, ratio * refracted)) / 2.0
}
