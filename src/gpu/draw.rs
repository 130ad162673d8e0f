//! A draw as one value: where to, with what, in which fixed-function state. Nothing survives from one draw to the next.

use std::ops::Range;

use glow::HasContext;

use super::context::Gpu;
use super::program::{Program, Uniform};
use super::target::Target;
use super::vertices::VertexArray;

/// Everything that shapes a draw.
pub struct Draw<'a> {
    pub target: &'a Target,
    /// [x, y, width, height] in texels that the projection covers; `None` is the whole target.
    pub region: Option<[i32; 4]>,
    pub program: &'a Program,
    pub uniforms: &'a [(&'static str, Uniform<'a>)],
    pub depth: DepthTest,
    pub blend: Blend,
    pub geometry: Geometry<'a>,
}

/// Which fragments pass the depth test; those that do write their depth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DepthTest {
    /// All of them; depth is not written.
    Off,
    Less,
    Greater,
}

/// What happens to the colour that is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Blend {
    Replace,
    Add,
}

/// What is drawn.
pub enum Geometry<'a> {
    /// One triangle over the whole region, from `glsl/fullscreen.vert`.
    FullScreen,
    /// A range of triangles of a vertex array.
    Triangles(&'a VertexArray, Range<u32>),
}

impl Gpu {
    pub fn draw(&self, draw: &Draw) {
        let gl = draw.target.bind();
        draw.program.bind(draw.uniforms);
        unsafe {
            if let Some([x, y, width, height]) = draw.region {
                gl.viewport(x, y, width, height);
            }
            match draw.depth {
                DepthTest::Off => gl.disable(glow::DEPTH_TEST),
                DepthTest::Less | DepthTest::Greater => {
                    gl.enable(glow::DEPTH_TEST);
                    gl.depth_mask(true);
                    gl.depth_func(if draw.depth == DepthTest::Less { glow::LESS } else { glow::GREATER });
                }
            }
            match draw.blend {
                Blend::Replace => gl.disable(glow::BLEND),
                Blend::Add => {
                    gl.enable(glow::BLEND);
                    gl.blend_equation(glow::FUNC_ADD);
                    gl.blend_func(glow::ONE, glow::ONE);
                }
            }
            match &draw.geometry {
                Geometry::FullScreen => {
                    gl.bind_vertex_array(Some(self.context().no_vertices()));
                    gl.draw_arrays(glow::TRIANGLES, 0, 3);
                }
                Geometry::Triangles(vertices, range) => {
                    gl.bind_vertex_array(Some(vertices.name()));
                    let count = (range.end - range.start) * 3;
                    gl.draw_elements(glow::TRIANGLES, count as i32, glow::UNSIGNED_INT, range.start as i32 * 12);
                }
            }
        }
    }
}
