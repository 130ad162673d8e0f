//! Reflection of glossy surfaces: metallic-roughness, as appendix B of glTF 2.0 defines it. `tests/reference/gltf_bsdf.py` is the same for Mitsuba.
//!
//! A lobe of microfacets lies over a diffuse base:
//!
//! f = (1 - F) c/π + F D V, with F = F₀ + (1 - F₀) s, s = (1 - v·h)⁵, c = (1 - metallic) base and F₀ = mix(specular, base, metallic)
//!
//! D is GGX with α = roughness², and V the separable Smith term. F is that of Schlick. So each integral of the lobe is linear in F₀: over directions of
//! light it is F₀ A + B, with A and B from [`LobeTable`]. What several microfacets reflect is lost.

use std::collections::BTreeMap;
use std::f32::consts::{FRAC_1_PI, TAU};
use std::sync::{LazyLock, OnceLock};

use glam::{DVec2, Vec2, Vec3};
use rayon::prelude::*;

use super::{Gloss, Material, Scene, Surface};
use crate::math::{cosine_direction, frame};
use crate::random::sobol;

/// Least width of a lobe. A sharper one is as good as a mirror, and f32 holds this one.
const LEAST_ALPHA: f32 = 1e-3;
/// Least cosine of the eye to a shading normal.
const LEAST_COSINE: f32 = 1e-2;

/// The reflection of a point of a glossy surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Brdf {
    /// Reflectance of the base, below the lobe.
    pub base: Vec3,
    /// F₀, the reflectance of the lobe straight on.
    pub straight: Vec3,
    /// Width of the lobe.
    pub alpha: f32,
}

/// How a direction of light weighs at a glossy point, as seen from the eye.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LobeWeights {
    /// 1 - s: the base reflects (1 - F₀) c/π times that.
    pub base: f32,
    /// F D V.
    pub lobe: Vec3,
}

/// Shares of even light that a glossy point reflects towards the eye.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LobeShares {
    pub base: Vec3,
    /// The mean of [`LobeWeights::base`], weighted by the cosine.
    pub passing: f32,
    pub lobe: Vec3,
}

impl Brdf {
    /// Lobes of this width or wider are rough: bundles of directions sample them. Eye rays and photons follow narrower ones. 0.25 is roughness 0.5.
    pub const ROUGH: f32 = 0.25;

    /// All but `base` are shares of light from 0 to 1.
    pub fn new(base: Vec3, metallic: f32, roughness: f32, specular: Vec3) -> Self {
        Self {
            base: (1.0 - metallic) * base,
            straight: specular.lerp(base, metallic),
            alpha: (roughness * roughness).max(LEAST_ALPHA),
        }
    }

    pub fn is_rough(&self) -> bool {
        self.alpha >= Self::ROUGH
    }

    /// The weights of light from the unit vector `light`, seen from the unit vector `eye`; both lie above the unit `normal`. The twin of `lobe_weights` in
    /// `glsl/include/gloss.glsl`.
    pub fn weights(&self, normal: Vec3, eye: Vec3, light: Vec3) -> LobeWeights {
        let half = (eye + light).normalize();
        let [seen, lit] = [eye, light].map(|direction| normal.dot(direction));
        let s = schlick(eye.dot(half));
        let lobe = distribution(normal, half, self.alpha) * smith(seen, self.alpha) * smith(lit, self.alpha) / (4.0 * seen * lit);
        LobeWeights { base: 1.0 - s, lobe: self.fresnel(s) * lobe }
    }

    /// What the base reflects of light from a direction with the density cos θ / π.
    pub fn base_weight(&self, eye: Vec3, light: Vec3) -> Vec3 {
        (1.0 - schlick(eye.dot((eye + light).normalize()))) * self.under()
    }

    /// f, without the cosine.
    pub fn evaluate(&self, normal: Vec3, eye: Vec3, light: Vec3) -> Vec3 {
        let LobeWeights { base, lobe } = self.weights(normal, eye, light);
        base * FRAC_1_PI * self.under() + lobe
    }

    /// A direction of light for an `eye` above the unit `normal`, by a uniform point of the unit square, and the weight of the lobe there: f cos θ over the
    /// density. `None` if the light comes from below. The microfacets are those that the eye sees (Dupuy and Benyoub 2023, "Sampling visible GGX normals
    /// with spherical caps").
    pub fn sample_lobe(&self, normal: Vec3, eye: Vec3, [u, v]: [f32; 2]) -> Option<(Vec3, Vec3)> {
        let local = frame(normal);
        let seen = local.transpose() * eye;
        let (light, half) = sample_visible(seen, self.alpha, [u, v])?;
        Some((local * light, self.fresnel(schlick(seen.dot(half))) * smith(light.z, self.alpha)))
    }

    /// Density of [`Self::sample_lobe`] per solid angle.
    pub fn lobe_density(&self, normal: Vec3, eye: Vec3, light: Vec3) -> f32 {
        let half = (eye + light).normalize();
        let seen = normal.dot(eye);
        smith(seen, self.alpha) * distribution(normal, half, self.alpha) / (4.0 * seen)
    }

    /// Shares of even light that reach an eye at this cosine. By reciprocity also those of light from there that leave.
    pub fn shares(&self, cosine: f32) -> LobeShares {
        let table = &*TABLE;
        let ([straight, grazing], passing) = (table.lobe(cosine, self.alpha), table.passing(cosine));
        LobeShares { base: passing * self.under(), passing, lobe: self.straight * straight + Vec3::splat(grazing) }
    }

    /// The shares of even light that leave in all directions.
    pub fn reflectance(&self) -> Vec3 {
        let table = &*TABLE;
        let [straight, grazing] = table.hemispherical(self.alpha);
        table.passing_mean * self.under() + self.straight * straight + Vec3::splat(grazing)
    }

    /// What the base would reflect straight on.
    fn under(&self) -> Vec3 {
        (Vec3::ONE - self.straight) * self.base
    }

    fn fresnel(&self, s: f32) -> Vec3 {
        self.straight + (Vec3::ONE - self.straight) * s
    }
}

/// The unit `normal`, turned so far to the unit vector `eye` that the eye sees its side. An interpolated or mapped normal may face away.
pub fn facing(normal: Vec3, eye: Vec3) -> Vec3 {
    let cosine = normal.dot(eye);
    if cosine >= LEAST_COSINE { normal } else { (normal + (LEAST_COSINE - cosine) * eye).normalize() }
}

/// The Fresnel term's s by v·h.
fn schlick(cosine: f32) -> f32 {
    (1.0 - cosine).clamp(0.0, 1.0).powi(5)
}

/// GGX: density of microfacets' normals. The sine comes from the cross product, because the cosine near 1 has lost it.
fn distribution(normal: Vec3, half: Vec3, alpha: f32) -> f32 {
    let (sine, cosine) = (normal.cross(half).length(), normal.dot(half));
    let spread = sine * sine + alpha * alpha * cosine * cosine;
    FRAC_1_PI * alpha * alpha / (spread * spread)
}

/// Share of microfacets that are seen from a direction at this cosine.
fn smith(cosine: f32, alpha: f32) -> f32 {
    2.0 * cosine / (cosine + (alpha * alpha + (1.0 - alpha * alpha) * cosine * cosine).sqrt())
}

/// The direction of light and the half vector of a visible microfacet. The normal is +z.
fn sample_visible(seen: Vec3, alpha: f32, [u, v]: [f32; 2]) -> Option<(Vec3, Vec3)> {
    let stretched = Vec3::new(alpha * seen.x, alpha * seen.y, seen.z).normalize();
    let z = (1.0 - v) * (1.0 + stretched.z) - stretched.z;
    let sine = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = (TAU * u).sin_cos();
    let cap = Vec3::new(sine * cos, sine * sin, z) + stretched;
    let half = Vec3::new(alpha * cap.x, alpha * cap.y, cap.z.max(1e-9)).normalize();
    let light = 2.0 * seen.dot(half) * half - seen;
    (light.z > 0.0).then_some((light, half))
}

/// Integrals of lobes by roughness and by the square root of the eye's cosine, which has more steps where they change fast.
struct LobeTable {
    /// A and B, by columns of one roughness each.
    lobes: Vec<[f32; 2]>,
    /// Means of A and B over the hemisphere, weighted by the cosine.
    means: Vec<[f32; 2]>,
    /// Mean of 1 - s over the base's light.
    passing: Vec<f32>,
    passing_mean: f32,
}

static TABLE: LazyLock<LobeTable> = LazyLock::new(LobeTable::new);

impl LobeTable {
    const COSINES: usize = 64;
    const WIDTHS: usize = 32;
    const SAMPLES: u32 = 1024;

    fn new() -> Self {
        let eye = |row: usize| {
            let cosine = (row as f32 / (Self::COSINES - 1) as f32).powi(2).max(1e-4);
            Vec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine)
        };
        let mean = |of: &dyn Fn([f32; 2]) -> Vec2| {
            ((0..Self::SAMPLES).map(|sample| of(sobol(sample, 0)).as_dvec2()).sum::<DVec2>() / f64::from(Self::SAMPLES)).as_vec2()
        };
        let lobe = |place: usize| {
            let (alpha, seen) = (alpha_of(place / Self::COSINES), eye(place % Self::COSINES));
            let of = |square: [f32; 2]| {
                sample_visible(seen, alpha, square).map_or(Vec2::ZERO, |(light, half)| {
                    let s = schlick(seen.dot(half));
                    smith(light.z, alpha) * Vec2::new(1.0 - s, s)
                })
            };
            mean(&of).to_array()
        };
        let passing = |row: usize| {
            let seen = eye(row);
            let of =
                |[u, v]: [f32; 2]| Vec2::splat(1.0 - schlick(seen.dot((seen + cosine_direction(Vec3::Z, u, v)).normalize())));
            mean(&of).x
        };
        let lobes: Vec<[f32; 2]> = (0..Self::WIDTHS * Self::COSINES).into_par_iter().map(lobe).collect();
        let passing: Vec<f32> = (0..Self::COSINES).into_par_iter().map(passing).collect();
        // Over μ = t², 2 ∫ g μ dμ is 4 ∫ g t³ dt. The sum is divided by that of 1, so that a constant stays.
        let weight = |row: usize| (row as f32).powi(3) * if row == Self::COSINES - 1 { 0.5 } else { 1.0 };
        let all: f32 = (0..Self::COSINES).map(weight).sum();
        let over_hemisphere =
            |value: &dyn Fn(usize) -> Vec2| (0..Self::COSINES).map(|row| weight(row) / all * value(row)).sum::<Vec2>();
        let means = (0..Self::WIDTHS)
            .map(|width| over_hemisphere(&|row| Vec2::from(lobes[width * Self::COSINES + row])).to_array())
            .collect();
        let passing_mean = over_hemisphere(&|row| Vec2::splat(passing[row])).x;
        Self { lobes, means, passing, passing_mean }
    }

    /// A and B of an eye at this cosine.
    fn lobe(&self, cosine: f32, alpha: f32) -> [f32; 2] {
        let ([left, right], across) = width_of(alpha);
        let ([low, high], along) = row_of(cosine);
        let at = |column: usize, row: usize| Vec2::from(self.lobes[column * Self::COSINES + row]);
        let column = |column: usize| at(column, low).lerp(at(column, high), along);
        column(left).lerp(column(right), across).to_array()
    }

    fn hemispherical(&self, alpha: f32) -> [f32; 2] {
        let ([left, right], across) = width_of(alpha);
        Vec2::from(self.means[left]).lerp(Vec2::from(self.means[right]), across).to_array()
    }

    fn passing(&self, cosine: f32) -> f32 {
        let ([low, high], along) = row_of(cosine);
        self.passing[low] + along * (self.passing[high] - self.passing[low])
    }
}

fn alpha_of(width: usize) -> f32 {
    (width as f32 / (LobeTable::WIDTHS - 1) as f32).powi(2).max(LEAST_ALPHA)
}

/// The columns on either side of a width, and the weight of the second.
fn width_of(alpha: f32) -> ([usize; 2], f32) {
    steps(alpha.sqrt(), LobeTable::WIDTHS)
}

/// The rows on either side of a cosine, and the weight of the second.
fn row_of(cosine: f32) -> ([usize; 2], f32) {
    steps(cosine.max(0.0).sqrt(), LobeTable::COSINES)
}

fn steps(share: f32, count: usize) -> ([usize; 2], f32) {
    let place = share.clamp(0.0, 1.0) * (count - 1) as f32;
    let low = (place as usize).min(count - 2);
    ([low, low + 1], place - low as f32)
}

/// Of each material with gloss, (R, S): what it reflects of even light is R times the base colour, plus S. Made when it is first asked for.
#[derive(Clone, Debug, Default)]
pub struct GlossMeans(OnceLock<Vec<Option<[Vec3; 2]>>>);

impl Scene {
    /// The reflection at a point of a triangle, if the surface is glossy. `base` is the colour there.
    pub fn brdf(&self, triangle: usize, barycentric: Vec3, base: Vec3) -> Option<Brdf> {
        let gloss = self.material(triangle).shaded_gloss()?;
        let (mut roughness, mut metallic) = (gloss.roughness, gloss.metallic);
        if let Some(texture) = gloss.texture {
            let [_, green, blue, _] = self.textures[texture].sample_data(self.mesh.uv(triangle, barycentric)).to_array();
            (roughness, metallic) = (roughness * green, metallic * blue);
        }
        Some(Brdf::new(base, metallic, roughness, gloss.specular))
    }

    /// (R, S) of a material, see [`GlossMeans`].
    pub fn gloss_mean(&self, material: usize) -> Option<[Vec3; 2]> {
        let means = || self.materials.iter().map(|material| self.mean_of(material)).collect();
        self.gloss_means.0.get_or_init(means)[material]
    }

    fn mean_of(&self, material: &Material) -> Option<[Vec3; 2]> {
        let gloss = material.shaded_gloss()?;
        // The colour in which a fraction of metal is linearised. For all or none it is linear.
        let color = material.albedo * material.albedo_texture.map_or(Vec3::ONE, |texture| self.textures[texture].mean_linear());
        let color = color.max(Vec3::splat(1e-3));
        let of = |green: f32, blue: f32| {
            let of = |base| Brdf::new(base, gloss.metallic * blue, gloss.roughness * green, gloss.specular).reflectance();
            let black = of(Vec3::ZERO);
            [(of(color) - black) / color, black]
        };
        let Some(texture) = gloss.texture else { return Some(of(1.0, 1.0)) };
        // Of the many texels most are alike, so each pair of values is asked once.
        let mut counts = BTreeMap::<[u8; 2], f64>::new();
        let texels = &self.textures[texture].texels;
        texels.iter().for_each(|&[_, green, blue, _]| *counts.entry([green, blue]).or_default() += 1.0);
        let share = |[green, blue]: [u8; 2]| of(f32::from(green) / 255.0, f32::from(blue) / 255.0);
        let mut sum = [Vec3::ZERO; 2];
        for (&pair, &count) in &counts {
            let weight = (count / texels.len() as f64) as f32;
            let of_pair = share(pair);
            sum = [0, 1].map(|part| sum[part] + weight * of_pair[part]);
        }
        Some(sum)
    }
}

impl Material {
    /// Whether its lobe is too narrow for bundles of directions, somewhere.
    pub fn may_be_narrow(&self) -> bool {
        // Of a texture all values may occur.
        let least = |gloss: &Gloss| if gloss.texture.is_some() { 0.0 } else { gloss.roughness };
        self.shaded_gloss().is_some_and(|gloss| !Brdf::new(Vec3::ZERO, 0.0, least(gloss), Vec3::ZERO).is_rough())
    }

    /// The gloss, unless it is a mirror or glass.
    pub fn shaded_gloss(&self) -> Option<&Gloss> {
        self.gloss.as_ref().filter(|_| self.surface == Surface::Diffuse)
    }
}
