//! Gather points from a list. [`PointList::upload`] takes them to the GL side. [`PointList::in_order`] puts results into the list's order.

use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;

use super::{GBuffer, PointTextures, Points};
use crate::error::Result;
use crate::gpu::Gpu;

/// Texels in a row: the least texture size that OpenGL 3.3 guarantees.
const WIDTH: usize = 1024;

/// A point at which irradiance is gathered, in unit space.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct GatherPoint {
    pub position: Vec3,
    /// Unit shading normal, the axis of the integrated hemisphere.
    pub normal: Vec3,
    /// Unit geometric normal of the surface, on the same side.
    pub surface_normal: Vec3,
}

impl GatherPoint {
    /// A point of a flat surface.
    pub fn flat(position: Vec3, normal: Vec3) -> Self {
        Self { position, normal, surface_normal: normal }
    }

    /// The cosine weight of a unit direction, 0 for directions below the surface. The twin of `cosine` in `glsl/include/points.glsl`.
    pub fn cosine(&self, direction: Vec3) -> f32 {
        if self.surface_normal.dot(direction) > 0.0 { self.normal.dot(direction).max(0.0) } else { 0.0 }
    }

    /// The two texels of [`Points`].
    fn encode(&self) -> [Vec4; 2] {
        let code = octahedral_encode(self.surface_normal);
        [self.position.extend(code.x), self.normal.extend(code.y)]
    }

    /// The point of these texels; `None` if they hold none.
    pub(crate) fn decode(position: Vec4, normal: Vec4) -> Option<Self> {
        let surface_normal = octahedral_decode(Vec2::new(position.w, normal.w));
        let point = Self { position: position.truncate(), normal: normal.truncate(), surface_normal };
        (point.normal != Vec3::ZERO).then_some(point)
    }
}

impl GBuffer {
    /// The points of all pixels that see a surface, row by row from the bottom.
    pub fn gather_points(&self) -> Vec<GatherPoint> {
        self.pixels().into_iter().flatten().collect()
    }

    /// The point of each pixel, row by row from the bottom.
    pub fn pixels(&self) -> Vec<Option<GatherPoint>> {
        self.position.par_iter().zip(&self.normal).map(|(&position, &normal)| GatherPoint::decode(position, normal)).collect()
    }
}

/// Points of a list as textures, row by row.
pub struct PointList(PointTextures);

impl PointList {
    /// Width and height of the textures of `count` points.
    pub fn size(count: usize) -> [u32; 2] {
        let width = count.clamp(1, WIDTH);
        [width as u32, count.div_ceil(width).max(1) as u32]
    }

    /// # Errors
    /// If the list exceeds the device's limits.
    pub fn upload(gpu: &Gpu, points: &[GatherPoint]) -> Result<Self> {
        let size = Self::size(points.len());
        let [width, rows] = size.map(|side| side as usize);
        // Texels after the list keep a zero normal, which means no point.
        let (mut position, mut normal) = (vec![Vec4::ZERO; width * rows], vec![Vec4::ZERO; width * rows]);
        for (i, point) in points.iter().enumerate() {
            [position[i], normal[i]] = point.encode();
        }
        PointTextures::upload(gpu, size, &position, &normal, points.len() as u32).map(Self)
    }

    pub fn points(&self) -> Points<'_> {
        self.0.points()
    }

    /// Puts texels of these points' size into the order of the list.
    pub fn in_order<T>(&self, mut texels: Vec<T>) -> Vec<T> {
        texels.truncate(self.0.count as usize);
        texels
    }
}

/// Encodes a unit vector as a point of the square [-1, 1]². The twin of `octahedral_encode` in `glsl/include/points.glsl`.
pub(super) fn octahedral_encode(n: Vec3) -> Vec2 {
    let p = n.truncate() / n.abs().element_sum();
    let sign = Vec2::select(p.cmplt(Vec2::ZERO), Vec2::NEG_ONE, Vec2::ONE);
    if n.z < 0.0 { (1.0 - Vec2::new(p.y, p.x).abs()) * sign } else { p }
}

/// The twin of `octahedral_decode` in `glsl/include/points.glsl`.
fn octahedral_decode(p: Vec2) -> Vec3 {
    let z = 1.0 - p.abs().element_sum();
    let fold = (-z).max(0.0);
    (p + Vec2::select(p.cmplt(Vec2::ZERO), Vec2::splat(fold), Vec2::splat(-fold))).extend(z).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::direction::Directions;
    use crate::settings::Sequence;

    #[test]
    fn octahedral_codes_lose_nothing_but_rounding() {
        let directions = Directions::new(Sequence::Random, 1);
        let axes = Vec3::AXES.into_iter().flat_map(|axis| [axis, -axis]);
        for n in axes.chain((0..1000).map(|i| directions.get(i).vector)) {
            let code = octahedral_encode(n);
            assert!(code.abs().max_element() <= 1.0, "{n} as {code}");
            // A few roundings of numbers up to 1, each of 6e-8.
            assert!((octahedral_decode(code) - n).length() < 4e-7, "{n} comes back as {}", octahedral_decode(code));
        }
    }
}
