//! Programs that draw surfaces with cut-outs. Only scenes that have some make them, and only these surfaces are drawn by them.

use std::ops::Range;

use crate::error::Result;
use crate::gpu::{Gpu, Program};
use crate::shaders;

/// The triangles that may be cut, and the programs that discard what is.
pub struct CutOuts {
    /// In the table of triangles.
    pub(super) triangles: Range<u32>,
    pub visible_points: Program,
    pub peel: Program,
    /// For the farthest layer, and for the others.
    pub store_peel: [Program; 2],
    /// `None` where shaders cannot write to images.
    pub store_append: Option<Program>,
}

impl CutOuts {
    pub(super) fn new(gpu: &Gpu, triangles: Range<u32>) -> Result<Self> {
        Ok(Self {
            triangles,
            visible_points: Program::new(gpu, &shaders::VISIBLE_POINTS_CUT)?,
            peel: Program::new(gpu, &shaders::PEEL_CUT)?,
            store_peel: [Program::new(gpu, &shaders::STORE_PEEL_FARTHEST_CUT)?, Program::new(gpu, &shaders::STORE_PEEL_CUT)?],
            store_append: gpu.writes_images().then(|| Program::new(gpu, &shaders::STORE_APPEND_CUT)).transpose()?,
        })
    }
}
