//! Texels of layers as quads in space. A quad ends where its surface ends: on a grazing surface it is long, and would stick out as a spike.

use std::collections::HashMap;

use egui::Color32;
use finalgather::render::Layers;
use glam::{Vec2, Vec3};

use super::layers::color;

/// Triangles that meet at an edge are one surface if the cosine of the angle between them is above this.
const SMOOTH: f32 = 0.9;
/// Triangles of fewer quads from end to end are not cut: their neighbours may be in no texel, and gaps would be left.
const LEAST: f32 = 3.0;

/// A square of texels, placed on its surface, or a part of it.
pub struct LayerQuad {
    pub layer: usize,
    pub corners: [Vec3; 4],
    pub color: Color32,
}

/// Splits the texels of a side into runs of `step`, and returns the middle one of each.
pub fn middles(side: u32, step: u32) -> impl DoubleEndedIterator<Item = u32> + ExactSizeIterator {
    (step / 2..side).step_by(step as usize)
}

/// About `most` quads of all layers.
pub fn quads(layers: &Layers, most: f32) -> Vec<LayerQuad> {
    let step = (layers.size as f32 * (layers.layers.len() as f32 / most).sqrt()).ceil().max(1.0) as u32;
    let half = 0.5 * step as f32;
    let ends = surface_ends(layers, step as f32);
    let places = move || middles(layers.size, step);
    let mut quads = Vec::new();
    for (layer, texels) in layers.layers.iter().enumerate() {
        for (y, x) in places().flat_map(|y| places().map(move |x| (y, x))) {
            let Some(texel) = &texels[(y * layers.size + x) as usize] else { continue };
            let middle = Vec2::new(x as f32, y as f32) + 0.5;
            let square =
                |half: f32| [(-half, -half), (half, -half), (half, half), (-half, half)].map(|by| middle + Vec2::from(by));
            let lines = ends.get(&texel.triangle).map_or(&[][..], Vec::as_slice);
            // Near an end, the next texel may miss the surface although a part of it lies there.
            let wide = square(2.0 * half);
            let at_end = lines.iter().any(|&line| wide.iter().any(|&place| side(line, place) < 0.0));
            let outline = if at_end { wide } else { square(half) }.to_vec();
            let outline = lines.iter().fold(outline, |outline, &line| cut(&outline, line));
            let placed = |place: &Vec2| {
                let depth = (texel.depth + texel.slopes.dot(*place - middle)).clamp(0.0, 1.0);
                layers.from_layer.transform_point3(place.extend(depth))
            };
            let corners: Vec<Vec3> = outline.iter().map(placed).collect();
            // A fan of quads; the last may be a triangle.
            for first in (1..corners.len().saturating_sub(1)).step_by(2) {
                let last = corners[(first + 2).min(corners.len() - 1)];
                let corners = [corners[0], corners[first], corners[first + 1], last];
                quads.push(LayerQuad { layer, corners, color: color(texel) });
            }
        }
    }
    quads
}

/// A line of a layer: (x, y, 1) has a positive product with it on the inner side.
type Line = Vec3;

/// For each triangle that is large beside quads of `step` texels, the lines of its edges at which no smooth surface continues.
fn surface_ends(layers: &Layers, step: f32) -> HashMap<u32, Vec<Line>> {
    let bits = |corner: Vec3| corner.to_array().map(f32::to_bits);
    let edges = |corners: [Vec3; 3]| [0, 1, 2].map(|k| [corners[k], corners[(k + 1) % 3]]);
    let key = |[a, b]: [Vec3; 2]| if bits(a) < bits(b) { [bits(a), bits(b)] } else { [bits(b), bits(a)] };
    let normal = |corners: [Vec3; 3]| {
        let [a, b, c] = corners.map(|corner| layers.from_layer.transform_point3(corner));
        (b - a).cross(c - a).normalize_or_zero()
    };
    let mut at_edge: HashMap<_, Vec<(u32, Vec3)>> = HashMap::new();
    for (&triangle, &corners) in &layers.corners {
        let normal = normal(corners);
        edges(corners).into_iter().for_each(|edge| at_edge.entry(key(edge)).or_default().push((triangle, normal)));
    }
    let lines = |(&triangle, &corners): (&u32, &[Vec3; 3])| {
        let [a, b, c] = corners.map(Vec3::truncate);
        let extent = a.max(b).max(c) - a.min(b).min(c);
        if extent.max_element() < LEAST * step {
            return None;
        }
        let own = normal(corners);
        let goes_on =
            |edge| at_edge[&key(edge)].iter().any(|&(other, normal)| other != triangle && own.dot(normal).abs() > SMOOTH);
        let middle = (a + b + c) / 3.0;
        let open = edges(corners).into_iter().filter(|&edge| !goes_on(edge));
        Some((triangle, open.filter_map(|edge| line(edge.map(Vec3::truncate), middle)).collect()))
    };
    layers.corners.iter().filter_map(lines).collect()
}

/// The line through two points, with `inner` on its inner side; `None` if they leave no side to it.
fn line([a, b]: [Vec2; 2], inner: Vec2) -> Option<Line> {
    let across = (b - a).perp();
    let line = across.extend(-across.dot(a));
    let side = side(line, inner);
    (side != 0.0).then(|| line * side.signum())
}

/// The distance of a place from a line, up to a factor. It is negative on the outer side.
fn side(line: Line, place: Vec2) -> f32 {
    line.dot(place.extend(1.0))
}

/// The part of a convex outline on the inner side of a line.
fn cut(outline: &[Vec2], line: Line) -> Vec<Vec2> {
    let mut kept = Vec::with_capacity(outline.len() + 1);
    for (index, &to) in outline.iter().enumerate() {
        let from = outline[(index + outline.len() - 1) % outline.len()];
        let (before, after) = (side(line, from), side(line, to));
        if (before < 0.0) != (after < 0.0) {
            kept.push(from.lerp(to, before / (before - after)));
        }
        if after >= 0.0 {
            kept.push(to);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use finalgather::math::frame;
    use finalgather::render::{End, LayerTexel};
    use glam::{Mat4, vec2, vec3};

    use super::*;

    #[test]
    fn a_line_cuts_a_square() {
        let square = [vec2(0.0, 0.0), vec2(1.0, 0.0), vec2(1.0, 1.0), vec2(0.0, 1.0)];
        let line = line([vec2(0.5, 0.0), vec2(0.5, 1.0)], vec2(0.0, 0.0)).unwrap();
        let left = cut(&square, line);
        assert_eq!(left.len(), 4);
        assert!(left.iter().all(|place| place.x <= 0.5), "{left:?}");
        assert_eq!(cut(&square, super::line([vec2(2.0, 0.0), vec2(2.0, 1.0)], vec2(3.0, 0.0)).unwrap()), [], "all is outside");
    }

    /// A steep wall from x = 2 to x = 6.75 of two triangles. Its depth changes by a tenth a texel.
    #[test]
    fn quads_end_where_their_surface_ends() {
        let corner = |x: f32, y: f32| vec3(x, y, 0.1 * x);
        let wall = [corner(2.0, 0.0), corner(6.75, 0.0), corner(6.75, 8.0), corner(2.0, 8.0)];
        let [a, b, c, d] = wall;
        let texel = |at: u32| {
            let (x, y) = ((at % 8) as f32 + 0.5, (at / 8) as f32 + 0.5);
            let below = (y / 8.0) < (x - 2.0) / 4.75;
            (2.0..6.75).contains(&x).then(|| LayerTexel {
                depth: 0.1 * x,
                slopes: vec2(0.1, 0.0),
                triangle: u32::from(!below),
                albedo: Vec3::ONE,
                emissive: false,
                cosine: 0.1,
            })
        };
        let layers = Layers {
            end: End { number: 0, opposite: false },
            direction: frame(Vec3::Z).z_axis,
            from_layer: Mat4::IDENTITY,
            to_layer: Mat4::IDENTITY,
            size: 8,
            layers: vec![(0..64).map(texel).collect()],
            corners: [(0, [a, b, c]), (1, [a, c, d])].into(),
        };
        let quads = quads(&layers, 1e9);
        let places = || quads.iter().flat_map(|quad| quad.corners);
        let most = places().map(|place| place.x).fold(0.0, f32::max);
        assert!((most - 6.75).abs() < 1e-4, "the last quads are cut at the wall's end: {most}");
        // The diagonal is no end: beside it, quads reach into the other triangle.
        let crosses = |quad: &LayerQuad| {
            let above = quad.corners.map(|corner| corner.y / 8.0 > (corner.x - 2.0) / 4.75);
            above.contains(&true) && above.contains(&false)
        };
        assert!(quads.iter().any(crosses));
    }
}
