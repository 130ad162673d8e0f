//! A draw as one value: target, program, geometry and fixed-function state. No state carries over to the next draw.

use std::ops::Range;

use glow::HasContext;

use super::program::{Program, Uniform};
use super::target::Target;
use super::vertices::VertexArray;

/// All inputs of a draw.
pub struct Draw<'a> {
    pub target: &'a Target,
    /// The viewport, [x, y, width, height] in texels; `None` is the whole target.
    pub region: Option<[i32; 4]>,
    pub program: &'a Program,
    pub uniforms: &'a [(&'static str, Uniform<'a>)],
    pub depth: DepthTest,
    pub blend: Blend,
    pub geometry: Shape<'a>,
}

/// Which fragments pass the depth and stencil tests. Fragments that pass write their depth, unless the variant says otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DepthTest {
    /// All fragments pass, and none writes its depth.
    Off,
    Less,
    Greater,
    /// Fragments pass where [`Self::RejectUnmarked`] has not rejected the texel. They write this depth in place of their own. The stencil is only
    /// read, so a driver can test before a shader that discards, and write after it.
    MarkAccepted(f32),
    /// Rejects all texels whose depth is not this one, until the target is cleared. Writes neither depth nor colour. The target needs a stencil.
    RejectUnmarked(f32),
}

/// How a fragment's colour changes the target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Blend {
    Replace,
    Add,
    /// Replaces these channels of two colour textures and leaves the others.
    ReplaceChannels([[bool; 4]; 2]),
}

/// The triangles of a draw.
pub enum Shape<'a> {
    /// One triangle over the whole region, from `glsl/fullscreen.vert`.
    FullScreen,
    /// A range of triangles of a vertex array.
    Triangles(&'a VertexArray, Range<u32>),
    /// A range of triangles of a vertex array, this many times, cut off at the two clip distances of the vertex shader. Each instance must cover pixels of its
    /// own, because the order is not defined.
    Instances(&'a VertexArray, Range<u32>, u32),
}

impl Draw<'_> {
    /// Queues the draw. A long draw is split into parts, and all but a short last part are waited for.
    pub fn run(&self) {
        let gl = self.target.bind();
        self.program.bind(self.uniforms);
        let whole = || [0, 0, self.target.size()[0] as i32, self.target.size()[1] as i32];
        let [x, y, width, height] = self.region.unwrap_or_else(whole);
        unsafe {
            gl.viewport(x, y, width, height);
            let (function, write, range) = match self.depth {
                DepthTest::Off => (None, false, [0.0, 1.0]),
                DepthTest::Less => (Some(glow::LESS), true, [0.0, 1.0]),
                DepthTest::Greater => (Some(glow::GREATER), true, [0.0, 1.0]),
                DepthTest::MarkAccepted(depth) => (Some(glow::ALWAYS), true, [depth; 2]),
                DepthTest::RejectUnmarked(depth) => (Some(glow::NOTEQUAL), false, [depth; 2]),
            };
            // The 32-bit call needs OpenGL 4.1.
            gl.depth_range_f64(range[0].into(), range[1].into());
            gl.depth_mask(write);
            match function {
                None => gl.disable(glow::DEPTH_TEST),
                Some(function) => {
                    gl.enable(glow::DEPTH_TEST);
                    gl.depth_func(function);
                }
            }
            let rejects = matches!(self.depth, DepthTest::RejectUnmarked(_));
            if rejects || matches!(self.depth, DepthTest::MarkAccepted(_)) {
                // Stencil 1: rejected.
                gl.enable(glow::STENCIL_TEST);
                gl.stencil_func(glow::NOTEQUAL, 1, 0xff);
                gl.stencil_op(glow::KEEP, glow::KEEP, glow::REPLACE);
                gl.stencil_mask(if rejects { 0xff } else { 0 });
            } else {
                gl.disable(glow::STENCIL_TEST);
            }
            if rejects {
                gl.color_mask(false, false, false, false);
            }
            match self.blend {
                Blend::Replace => gl.disable(glow::BLEND),
                Blend::ReplaceChannels(channels) => {
                    gl.disable(glow::BLEND);
                    for (buffer, [r, g, b, a]) in (0..).zip(channels) {
                        gl.color_mask_draw_buffer(buffer, r, g, b, a);
                    }
                }
                Blend::Add => {
                    gl.enable(glow::BLEND);
                    gl.blend_equation(glow::FUNC_ADD);
                    gl.blend_func(glow::ONE, glow::ONE);
                }
            }
        }
        let context = self.target.context();
        let vertices = match self.geometry {
            Shape::FullScreen => context.no_vertices,
            Shape::Triangles(vertices, _) | Shape::Instances(vertices, ..) => vertices.array.name(),
        };
        unsafe { gl.bind_vertex_array(Some(vertices)) };
        let cuts = matches!(self.geometry, Shape::Instances(..));
        for distance in [glow::CLIP_DISTANCE0, glow::CLIP_DISTANCE1] {
            unsafe { if cuts { gl.enable(distance) } else { gl.disable(distance) } };
        }
        let pace = &self.program.pace;
        match &self.geometry {
            Shape::FullScreen => pace.run(context, height as u32, width as u32, |rows| unsafe {
                gl.viewport(x, y + rows.start as i32, width, rows.len() as i32);
                gl.draw_arrays(glow::TRIANGLES, 0, 3);
            }),
            Shape::Triangles(_, range) => pace.run(context, range.end - range.start, 1, |part| unsafe {
                gl.draw_arrays(glow::TRIANGLES, 3 * (range.start + part.start) as i32, 3 * part.len() as i32);
            }),
            Shape::Instances(_, range, count) => pace.run(context, range.end - range.start, *count, |part| unsafe {
                let first = 3 * (range.start + part.start) as i32;
                gl.draw_arrays_instanced(glow::TRIANGLES, first, 3 * part.len() as i32, *count as i32);
            }),
        }
    }
}
