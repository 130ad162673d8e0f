//! All layers of a batch of directions sampled in one pass over the points, at both ends. Mirrors `glsl/fused.frag`.

use glam::{Mat4, Vec4};

use super::hit_pass::HitPass;
use super::{Bundle, LayerStore, Work};
use crate::error::Result;
use crate::gpu::{Gpu, Uniform};
use crate::shaders;

/// Samples layers and adds what is seen to sums.
pub struct Fused {
    pass: HitPass,
}

impl Fused {
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { pass: HitPass::new(gpu, &shaders::FUSED, &shaders::FUSED_TEXTURED)? })
    }

    /// Adds what the points see in the layers of `store`, peeled along the directions of `bundles`, to the sums.
    pub fn add(&self, work: Work, bundles: &[Bundle], store: &LayerStore) {
        let directions: Vec<Vec4> = bundles.iter().map(|bundle| bundle.direction.extend(bundle.clearance)).collect();
        let to_layer: Vec<Mat4> = bundles.iter().map(|bundle| bundle.to_layer).collect();
        let from_layer: Vec<Mat4> = to_layer.iter().map(Mat4::inverse).collect();
        let [beyond, behind] = work.beyond(bundles.iter().map(|bundle| bundle.direction));
        let own = [
            ("direction_count", Uniform::Int(bundles.len() as i32)),
            ("directions", Uniform::Vec4s(&directions)),
            ("to_layer", Uniform::Mat4s(&to_layer)),
            ("from_layer", Uniform::Mat4s(&from_layer)),
            ("beyond", Uniform::Vec4s(&beyond)),
            ("behind", Uniform::Vec4s(&behind)),
        ];
        self.pass.run(work, &[&own[..], &store.uniforms()].concat());
    }
}
