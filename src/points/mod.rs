//! Gather points: where irradiance is wanted, and on which side of which surface. Whatever they come from (camera pixels, vertices,
//! texels), the gather sees the same pair of textures, laid out as `glsl/include/points.glsl` says.

mod accumulator;
mod camera;
pub mod file;
mod interleave;
mod lightmap;
mod list;
mod traced;
mod vertices;

pub use accumulator::Accumulator;
pub use camera::{CameraPoints, Visible};
pub use interleave::{Interleave, Subset};
pub use lightmap::{LightMap, LightMapCounts, LightMapOptions, Mended, Resolution, UvSource};
pub use list::{GatherPoint, PointList};
pub use traced::{EyeRays, TracedPoints};
pub use vertices::{VertexCounts, Vertices};

use glam::Vec4;
use rayon::prelude::*;

use crate::gpu::{Blend, DepthTest, Draw, Geometry, Program, Target, Texture, Uniform};

/// Borrowed point textures, a texel a point.
#[derive(Clone, Copy)]
pub struct Points<'a> {
    /// xyz: position in unit space; w: geometric normal, octahedral x.
    pub position: &'a Texture,
    /// xyz: unit shading normal, zero where there is no point; w: octahedral y.
    pub normal: &'a Texture,
    /// Which of them are meant.
    pub subset: Subset,
    /// How many these are, or about as many.
    pub count: u32,
}

impl<'a> Points<'a> {
    /// Of all points those in `subset`.
    pub fn only(self, subset: Subset) -> Self {
        Self { subset, count: self.count.div_ceil(subset.stride * subset.stride), ..self }
    }

    /// Width and height of what holds one value for each point.
    pub fn size(&self) -> [u32; 2] {
        self.subset.size([self.position.width(), self.position.height()])
    }

    /// All points, whatever the subset, row by row from the bottom.
    pub fn read(&self) -> Vec<Option<GatherPoint>> {
        let (position, normal) = (self.position.read::<Vec4>(), self.normal.read::<Vec4>());
        position.par_iter().zip(&normal).map(|(&position, &normal)| GatherPoint::decode(position, normal)).collect()
    }

    /// Runs a full-screen pass of `program` over the points. Each subset of points has a tile of its own in the target.
    pub(crate) fn draw(&self, (target, blend): (&Target, Blend), program: &Program, uniforms: &[(&'static str, Uniform)]) {
        let [width, height] = self.size().map(|side| side as i32);
        let [x, y] = [self.subset.offset[0] as i32 * width, self.subset.offset[1] as i32 * height];
        Draw {
            target,
            region: Some([x, y, width, height]),
            program,
            uniforms: &[uniforms, &self.uniforms(), &[("first_texel", Uniform::IVec2([x, y]))]].concat(),
            depth: DepthTest::Off,
            blend,
            geometry: Geometry::FullScreen,
        }
        .run();
    }

    /// The uniforms that the shaders read.
    pub fn uniforms(&self) -> [(&'static str, Uniform<'a>); 4] {
        [
            ("point_position", Uniform::Texture(self.position)),
            ("point_normal", Uniform::Texture(self.normal)),
            ("point_stride", Uniform::Int(self.subset.stride as i32)),
            ("point_offset", Uniform::IVec2(self.subset.offset.map(|o| o as i32))),
        ]
    }
}
