//! Finds the texels that triangles touch, and places samples in them. Coverage is conservative: each texel that a triangle touches has a sample,
//! because filtering reads it at the edge of the chart.

use glam::{DVec2, DVec3, Vec3, dvec2};
use rayon::prelude::*;

use crate::random::Random;

/// The stratum of a sample whose triangle contains no place of a stratum in its texel.
const OUTSIDE_STRATA: u32 = u32::MAX;

/// Two triangles overlap if a place lies inside both by more than this, in texels: far more than 32-bit coordinates round in the largest map.
const OVERLAP_DEPTH: f64 = 0.01;

/// A triangle touches a texel if it covers more than this fraction of the texel's area.
const TOUCH: f64 = 1e-6;

#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Row by row from the bottom.
    pub texel: u32,
    stratum: u32,
    pub triangle: u32,
    pub barycentric: Vec3,
    /// Area of the triangle within the texel, in texels.
    area: f32,
    /// Whether it lies so far inside its triangle that no neighbour can contain it too.
    inner: bool,
}

/// Samples all triangles with these corners, in texels, and sorts by texel and stratum. A texel has `strata`² strata with one place each. A
/// triangle has a sample at each place that it contains. If it contains none, it has one in the middle of its part of the texel.
pub fn cover(corners: &[[DVec2; 3]], size: [u32; 2], strata: u32) -> Vec<Sample> {
    let mut samples: Vec<Sample> = corners
        .par_iter()
        .enumerate()
        .flat_map_iter(|(triangle, &corners)| {
            let mut samples = Vec::new();
            cover_triangle(triangle as u32, corners, size, strata, &mut samples);
            samples
        })
        .collect();
    samples.par_sort_unstable_by_key(|sample| (sample.texel, sample.stratum, sample.triangle));
    samples
}

/// Keeps one sample for each stratum. In texels without such samples, keeps that of the largest part.
pub fn thin(samples: &[Sample]) -> Vec<Sample> {
    let mut kept = Vec::with_capacity(samples.len());
    for texel in samples.chunk_by(|p, q| p.texel == q.texel) {
        let (placed, others) = texel.split_at(texel.partition_point(|sample| sample.stratum != OUTSIDE_STRATA));
        kept.extend(placed.chunk_by(|p, q| p.stratum == q.stratum).map(|place| place[0]));
        if placed.is_empty() {
            kept.extend(others.iter().max_by(|p, q| p.area.total_cmp(&q.area)));
        }
    }
    kept
}

/// Returns the number of places that lie in more than one triangle, and the first two such triangles.
pub fn overlaps(samples: &[Sample]) -> Option<(usize, [u32; 2])> {
    let mut first = None;
    let places = samples.chunk_by(|p, q| (p.texel, p.stratum) == (q.texel, q.stratum)).filter(|place| {
        let mut inner = place.iter().filter(|sample| sample.inner);
        let pair = inner.next().zip(inner.next()).map(|(p, q)| [p.triangle, q.triangle]);
        first = first.into_iter().chain(pair).min();
        pair.is_some()
    });
    let count = places.count();
    first.map(|pair| (count, pair))
}

fn cover_triangle(triangle: u32, corners: [DVec2; 3], size: [u32; 2], strata: u32, samples: &mut Vec<Sample>) {
    let [a, b, c] = corners;
    let double_area = (b - a).perp_dot(c - a);
    let barycentric =
        |at: DVec2| DVec3::new((c - b).perp_dot(at - b), (a - c).perp_dot(at - c), (b - a).perp_dot(at - a)) / double_area;
    let heights = DVec3::new(b.distance(c), c.distance(a), a.distance(b)).recip() * double_area.abs();
    let touch = TOUCH * (0.5 * double_area.abs()).min(1.0);
    for y in span(corners.iter().map(|corner| corner.y), size[1]) {
        let row = clip(&clip(&corners, DVec2::Y, f64::from(y)), DVec2::NEG_Y, -f64::from(y + 1));
        for x in span(row.iter().map(|corner| corner.x), size[0]) {
            let part = clip(&clip(&row, DVec2::X, f64::from(x)), DVec2::NEG_X, -f64::from(x + 1));
            let (area, middle) = area_and_centroid(&part);
            if area <= touch {
                continue;
            }
            let texel = y * size[0] + x;
            let sample = |stratum, at: DVec3| {
                let inner = stratum != OUTSIDE_STRATA && (at * heights).min_element() > OVERLAP_DEPTH;
                Sample { texel, stratum, triangle, barycentric: at.as_vec3(), area: area as f32, inner }
            };
            // Jitter keeps rows of samples off the foot of a wall that runs along the texels. It is the same for all triangles.
            let mut random = Random::new(0, u64::from(texel));
            let before = samples.len();
            samples.extend((0..strata * strata).filter_map(|stratum| {
                let jitter = dvec2(random.uniform().into(), random.uniform().into());
                let place = dvec2((stratum % strata).into(), (stratum / strata).into()) + jitter;
                let at = barycentric(dvec2(x.into(), y.into()) + place / f64::from(strata));
                (at.min_element() >= 0.0).then(|| sample(stratum, at))
            }));
            if samples.len() == before {
                samples.push(sample(OUTSIDE_STRATA, barycentric(middle)));
            }
        }
    }
}

/// The texels along one side of the map between the least and the largest coordinate.
fn span(coordinates: impl Iterator<Item = f64>, side: u32) -> std::ops::Range<u32> {
    let (low, high) = coordinates.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| (low.min(at), high.max(at)));
    (low.floor().max(0.0) as u32)..(high.ceil().max(0.0) as u32).min(side)
}

/// The part of a convex polygon with `axis` · x ≥ `from` (after Sutherland and Hodgman 1974).
fn clip(polygon: &[DVec2], axis: DVec2, from: f64) -> Vec<DVec2> {
    let mut part = Vec::with_capacity(polygon.len() + 1);
    for (i, &p) in polygon.iter().enumerate() {
        let q = polygon[(i + 1) % polygon.len()];
        let [above, beyond] = [p, q].map(|at| axis.dot(at) - from);
        if above >= 0.0 {
            part.push(p);
        }
        if (above >= 0.0) != (beyond >= 0.0) {
            part.push(p + above / (above - beyond) * (q - p));
        }
    }
    part
}

/// Area and centroid of a convex polygon. The mean of its corners stands for the centroid.
fn area_and_centroid(polygon: &[DVec2]) -> (f64, DVec2) {
    let Some(&first) = polygon.first() else { return (0.0, DVec2::ZERO) };
    let double: f64 = polygon.windows(2).map(|pair| (pair[0] - first).perp_dot(pair[1] - first)).sum();
    (0.5 * double.abs(), polygon.iter().sum::<DVec2>() / polygon.len() as f64)
}
