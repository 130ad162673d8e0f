//! Gather points given as data: the source for points that are known on the CPU. [`PointList::upload`] takes them to the GL side, and
//! [`PointList::in_order`] brings what passes over points found back to the order of the list.

use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3, Vec4};

use super::{Points, Subset, Visible};
use crate::error::Result;
use crate::gpu::{Filter, Format, Gpu, Texture, Wrap};

/// Texels in a row, within the least that 3.3 promises for textures.
const WIDTH: usize = 1024;

/// Where irradiance is wanted, in unit space.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct GatherPoint {
    pub position: Vec3,
    /// Unit shading normal: the hemisphere that is integrated.
    pub normal: Vec3,
    /// Unit geometric normal on the same side: the surface that the point lies on.
    pub surface_normal: Vec3,
}

impl GatherPoint {
    /// A point of a flat surface.
    pub fn flat(position: Vec3, normal: Vec3) -> Self {
        Self { position, normal, surface_normal: normal }
    }

    /// The cosine weight of a unit direction, 0 where it leaves through the surface itself. The twin of `cosine` in
    /// `glsl/include/points.glsl`.
    pub fn cosine(&self, direction: Vec3) -> f32 {
        if self.surface_normal.dot(direction) > 0.0 { self.normal.dot(direction).max(0.0) } else { 0.0 }
    }

    /// The two texels of [`Points`].
    fn encode(&self) -> [Vec4; 2] {
        let code = octahedral_encode(self.surface_normal);
        [self.position.extend(code.x), self.normal.extend(code.y)]
    }

    /// Back from these texels; `None` where there is no point.
    pub(crate) fn decode(position: Vec4, normal: Vec4) -> Option<Self> {
        let surface_normal = octahedral_decode(Vec2::new(position.w, normal.w));
        let point = Self { position: position.truncate(), normal: normal.truncate(), surface_normal };
        (point.normal != Vec3::ZERO).then_some(point)
    }
}

impl Visible {
    /// The points of all pixels that see a surface, row by row from the bottom.
    pub fn gather_points(&self) -> Vec<GatherPoint> {
        self.pixels().into_iter().flatten().collect()
    }

    /// What each pixel sees, row by row from the bottom.
    pub fn pixels(&self) -> Vec<Option<GatherPoint>> {
        self.position.iter().zip(&self.normal).map(|(&position, &normal)| GatherPoint::decode(position, normal)).collect()
    }
}

/// Points of a list as textures, row by row.
pub struct PointList {
    position: Texture,
    normal: Texture,
    count: usize,
}

impl PointList {
    /// Width and height of the textures of so many points.
    pub fn size(count: usize) -> [u32; 2] {
        let width = count.clamp(1, WIDTH);
        [width as u32, count.div_ceil(width).max(1) as u32]
    }

    /// # Errors
    /// When the list is beyond the device's limits.
    pub fn upload(gpu: &Gpu, points: &[GatherPoint]) -> Result<Self> {
        let size = Self::size(points.len());
        let [width, rows] = size.map(|side| side as usize);
        // Texels beyond the list keep a zero normal: no point.
        let mut texels = [vec![Vec4::ZERO; width * rows], vec![Vec4::ZERO; width * rows]];
        for (i, point) in points.iter().enumerate() {
            [texels[0][i], texels[1][i]] = point.encode();
        }
        let upload = |texels: &[Vec4]| Texture::from_texels(gpu, Format::Rgba32F, size, Filter::Nearest, Wrap::Clamp, texels);
        Ok(Self { position: upload(&texels[0])?, normal: upload(&texels[1])?, count: points.len() })
    }

    pub fn points(&self) -> Points<'_> {
        Points { position: &self.position, normal: &self.normal, subset: Subset::ALL, count: self.count as u32 }
    }

    pub fn len(&self) -> usize {
        self.count
    }

    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// What was read from textures of these points' size, in the order of the list.
    pub fn in_order<T>(&self, mut texels: Vec<T>) -> Vec<T> {
        texels.truncate(self.count);
        texels
    }
}

/// A unit vector as a point of the square [-1, 1]²; the twin of `octahedral_encode` in `glsl/include/points.glsl`.
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
            // A few roundings of numbers up to 1, 6e-8 each.
            assert!((octahedral_decode(code) - n).length() < 4e-7, "{n} comes back as {}", octahedral_decode(code));
        }
    }
}
