//! The gloss of a picture's points. Mirrors `glsl/include/gloss.glsl`.

use glam::{Vec3, Vec4};
use rayon::prelude::*;

use super::{GBuffer, GatherPoint};
use crate::error::Result;
use crate::gpu::{Filter, Format, Gpu, Target, Texture, Wrap};
use crate::scene::{Brdf, LobeShares, LobeWeights, Scene, facing};

/// How a point reflects light towards the eye. The default is a Lambertian point, of which the G-buffer's albedo says all.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PointGloss {
    /// With a width of 0 the point is Lambertian.
    pub brdf: Brdf,
    /// Unit vector to the eye, or to the surface before on the path from it.
    pub eye: Vec3,
    /// Of the light towards `eye`, with this normal.
    pub shares: LobeShares,
    /// Share of the light that the path to the eye lets pass.
    pub throughput: Vec3,
    /// Whether the lobe counts here. If not, eye rays follow it.
    pub counts: bool,
}

impl PointGloss {
    /// At a point with this unit normal, which faces the `eye`.
    pub fn new(brdf: Brdf, normal: Vec3, eye: Vec3, throughput: Vec3, counts: bool) -> Self {
        Self { brdf, eye, shares: brdf.shares(normal.dot(eye)), throughput, counts }
    }

    pub fn is_glossy(&self) -> bool {
        self.brdf.alpha > 0.0
    }

    /// The weights of light from the unit vector `light`, above a point with this shading normal. The twin of `lobe_weights` in `glsl/include/gloss.glsl`.
    pub fn weights(&self, normal: Vec3, light: Vec3) -> LobeWeights {
        self.weights_if(self.counts, normal, light)
    }

    /// The same; `counts`: whether the lobe does, for this light.
    pub fn weights_if(&self, counts: bool, normal: Vec3, light: Vec3) -> LobeWeights {
        if !self.is_glossy() {
            return LobeWeights { base: 1.0, lobe: Vec3::ZERO };
        }
        let weights = self.brdf.weights(normal, self.eye, light);
        if counts { weights } else { LobeWeights { lobe: Vec3::ZERO, ..weights } }
    }

    /// What the lobe reflects of light that is the same from all directions; 0 where it does not count.
    pub fn lobe_share(&self) -> Vec3 {
        if self.counts { self.shares.lobe } else { Vec3::ZERO }
    }

    fn encode(&self) -> [Vec4; 2] {
        [self.eye.extend(self.brdf.alpha), self.brdf.straight.extend(f32::from(u8::from(self.counts)))]
    }
}

/// The two textures of points' gloss, one texel for each point.
pub struct GlossTextures([Texture; 2]);

impl GlossTextures {
    /// # Errors
    /// If `size` exceeds the device's limits.
    pub fn upload(gpu: &Gpu, size: [u32; 2], gloss: &[PointGloss]) -> Result<Self> {
        let upload = |part: usize| {
            let texels: Vec<Vec4> = gloss.iter().map(|gloss| gloss.encode()[part]).collect();
            Texture::from_texels(gpu, Format::Rgba32F, size, Filter::Nearest, Wrap::CLAMP, &texels)
        };
        Ok(Self([upload(0)?, upload(1)?]))
    }

    /// Bytes that [`Self::upload`] takes.
    pub fn bytes(size: [u32; 2]) -> usize {
        Target::bytes(size, &[Format::Rgba32F; 2], false)
    }

    pub(super) fn textures(&self) -> [&Texture; 2] {
        let [view, straight] = &self.0;
        [view, straight]
    }
}

impl GBuffer {
    /// Finds the gloss of all pixels, in a scene with gloss, that `eye` sees through a pinhole, and turns their normals by normal maps. Albedo is then what
    /// the base reflects.
    pub fn add_gloss(&mut self, scene: &Scene, eye: Vec3) {
        let Self { position, normal, albedo, .. } = self;
        let look = |((position, normal), albedo): ((&Vec4, &mut Vec4), &mut Vec4)| {
            // Pixels without a surface have no triangle.
            let Some(point) = GatherPoint::decode(*position, *normal).filter(|_| albedo.w > 0.0) else {
                return PointGloss::default();
            };
            let triangle = albedo.w as usize - 1;
            let to_eye = (eye - point.position).normalize();
            let seen = SeenReflection::new(scene, triangle, &point, albedo.truncate(), to_eye);
            *normal = seen.normal.extend(normal.w);
            let Some(brdf) = seen.brdf else { return PointGloss::default() };
            let gloss = PointGloss::new(brdf, seen.normal, to_eye, Vec3::ONE, true);
            *albedo = gloss.shares.base.extend(albedo.w);
            gloss
        };
        self.gloss = position.par_iter().zip(normal).zip(albedo).map(look).collect();
        if !scene.is_glossy() {
            self.gloss.clear();
        }
    }
}

/// The shading normal and the reflection of a surface that is seen.
pub(super) struct SeenReflection {
    pub normal: Vec3,
    /// `None`: Lambertian, a mirror or glass.
    pub brdf: Option<Brdf>,
}

impl SeenReflection {
    /// At `point` of a triangle, which has its interpolated normal and this base colour, seen from the unit vector `to_eye`.
    pub fn new(scene: &Scene, triangle: usize, point: &GatherPoint, base: Vec3, to_eye: Vec3) -> Self {
        let material = scene.material(triangle);
        if material.normal_map.is_none() && material.gloss.is_none() {
            return Self { normal: point.normal, brdf: None };
        }
        let barycentric = scene.mesh.barycentric(triangle, point.position);
        let mapped = scene.mapped_normal(triangle, barycentric, point.normal, point.surface_normal);
        Self { normal: facing(mapped, to_eye), brdf: scene.brdf(triangle, barycentric, base) }
    }
}
