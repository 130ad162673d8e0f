//! Gather points: where irradiance is wanted, and on which side of which surface. Whatever they come from (camera pixels, vertices,
//! texels), the gather sees the same pair of textures, laid out as `glsl/include/points.glsl` says.

mod camera;
mod list;
mod sums;

pub use camera::{CameraPoints, Visible};
pub use list::{GatherPoint, PointList};
pub use sums::Sums;

use crate::gpu::{Texture, Uniform};

/// Borrowed point textures, a texel a point.
#[derive(Clone, Copy)]
pub struct Points<'a> {
    /// xyz: position in unit space; w: geometric normal, octahedral x.
    pub position: &'a Texture,
    /// xyz: unit shading normal, zero where there is no point; w: octahedral y.
    pub normal: &'a Texture,
    /// How many texels hold a point.
    pub count: u32,
}

impl<'a> Points<'a> {
    /// Width and height of the textures.
    pub fn size(&self) -> [u32; 2] {
        [self.position.width(), self.position.height()]
    }

    /// The uniforms that the shaders read.
    pub fn uniforms(&self) -> [(&'static str, Uniform<'a>); 2] {
        [("point_position", Uniform::Texture(self.position)), ("point_normal", Uniform::Texture(self.normal))]
    }
}
