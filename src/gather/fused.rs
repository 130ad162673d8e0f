//! All layers of a batch of directions sampled in one pass over the points, at both ends. Mirrors `glsl/fused.frag`.

use glam::{Mat4, Vec4};

use super::hit_pass::HitPass;
use super::hits::{FoundHits, KeptHits};
use super::{Beyond, Bundle, LayerStore, Work};
use crate::error::Result;
use crate::gpu::{Gpu, Program, Texture, Uniform};
use crate::points::Points;
use crate::shaders;

/// Samples layers and adds what is seen to sums.
pub struct Fused {
    pass: HitPass,
}

/// Samples layers and writes down what is seen.
pub struct FusedFind {
    program: Program,
    hits: FoundHits,
}

/// What shaders of the fused method read of `bundles` and of the layers peeled along them.
struct Uniforms {
    directions: Vec<Vec4>,
    to_layer: Vec<Mat4>,
    metric: Vec<Vec4>,
}

impl Fused {
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { pass: HitPass::new(gpu, &shaders::FUSED, &shaders::FUSED_TEXTURED)? })
    }

    /// Adds what the points see in the layers of `store`, peeled along the directions of `bundles`, to the sums.
    pub fn add(&self, work: Work, bundles: &[Bundle], store: &LayerStore) {
        let uniforms = Uniforms::of(bundles);
        let beyond = Beyond::new(work.scene, bundles.iter().map(|bundle| bundle.direction));
        self.pass.run(work, &[&uniforms.list()[..], &beyond.uniforms(), &store.uniforms()].concat());
    }
}

impl FusedFind {
    /// For points in textures of one size.
    pub fn new(gpu: &Gpu, points: [u32; 2]) -> Result<Self> {
        Ok(Self { program: Program::new(gpu, &shaders::FUSED_FIND)?, hits: FoundHits::new(gpu, points)? })
    }

    /// What the points see in the layers of `store`, peeled along the directions of `bundles`.
    pub fn find(&self, points: Points, bundles: &[Bundle], store: &LayerStore) -> &Texture {
        let uniforms = Uniforms::of(bundles);
        self.hits.write(points, &self.program, &[&uniforms.list()[..], &store.uniforms()].concat());
        self.hits.texture()
    }

    /// What was found last, along `directions`, for good.
    pub fn keep(&mut self, gpu: &Gpu, directions: &[Vec4]) -> Result<KeptHits> {
        self.hits.keep(gpu, directions)
    }
}

impl Uniforms {
    fn of(bundles: &[Bundle]) -> Self {
        let to_layer: Vec<Mat4> = bundles.iter().map(|bundle| bundle.to_layer).collect();
        Self {
            directions: bundles.iter().map(|bundle| bundle.direction.extend(bundle.clearance)).collect(),
            metric: bundles.iter().map(|bundle| bundle.metric().extend(0.0)).collect(),
            to_layer,
        }
    }

    fn list(&self) -> [(&'static str, Uniform<'_>); 4] {
        [
            ("direction_count", Uniform::Int(self.directions.len() as i32)),
            ("directions", Uniform::Vec4s(&self.directions)),
            ("to_layer", Uniform::Mat4s(&self.to_layer)),
            ("metric", Uniform::Vec4s(&self.metric)),
        ]
    }
}
