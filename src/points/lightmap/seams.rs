//! Seams: edges at which a chart ends and the surface continues elsewhere in the map. Bilinear filtering reads different texels on the two sides,
//! and a step shows. Least squares change the texels along both sides a little (after Iwanicki 2013, "Lighting technology of The Last of Us").
//! With the texels x, the gathered values x₀, and one row of A for each place along a seam, the difference of the two filtered values there:
//!
//! minimise W |A x|² + |x - x₀|²,
//!
//! by conjugate gradients on (1 + W AᵀA) d = -W AᵀA x₀ with x = x₀ + d. Texels stay between the least and the greatest gathered value: filtering
//! extrapolates where a seam lies beside the centres of texels, and openness above 1 or light below 0 would follow. Texels that would leave that range
//! are held at its end, and the others are solved for again.

use glam::{DVec2, Vec2, dvec2};

use super::edges::Joint;

/// W, the weight of a step across a seam against a change of a texel.
const WEIGHT: f64 = 32.0;

/// Places along a seam for each texel of its length. Between two of them, a bilinear function changes little.
const PLACES: f64 = 3.0;

/// The solver ends when the residual is this fraction of the first.
const SETTLED: f64 = 1e-4;

/// Most times that the equations are solved. Each holds the texels that left the range. What leaves it in the last one ends at its end too.
const ROUNDS: usize = 8;

/// A row of A: the texels that bilinear filtering reads on both sides of a place, with the weights of the difference.
type SeamEquation = [(u32, f64); 8];

/// The equations of a map's seams.
pub struct Seams {
    rows: Vec<SeamEquation>,
    /// The texels of the equations. Equations hold indices into this list.
    texels: Vec<u32>,
}

impl Seams {
    /// `seams` are the joints that are seams, `uvs` the coordinates of each triangle's corners, `size` the texels of the map.
    pub fn new(seams: &[Joint], uvs: &[[Vec2; 3]], size: [u32; 2]) -> Self {
        let scale = dvec2(size[0].into(), size[1].into());
        let mut rows = Vec::new();
        for Joint { sides } in seams {
            let ends = sides.map(|(triangle, ends)| ends.map(|corner| uvs[triangle][corner].as_dvec2() * scale));
            let length = ends.map(|[a, b]| a.distance(b)).into_iter().fold(0.0, f64::max);
            let places = (PLACES * length).ceil().max(2.0) as u32;
            for place in 0..places {
                let t = (f64::from(place) + 0.5) / f64::from(places);
                let [[a, b, c, d], q] = ends.map(|[a, b]| taps(a.lerp(b, t), size));
                let [e, f, g, h] = q.map(|(texel, weight)| (texel, -weight));
                rows.push([a, b, c, d, e, f, g, h]);
            }
        }
        let mut texels: Vec<u32> = rows.iter().flatten().map(|&(texel, _)| texel).collect();
        texels.sort_unstable();
        texels.dedup();
        for (texel, _) in rows.iter_mut().flatten() {
            *texel = texels.partition_point(|known| known < texel) as u32;
        }
        Self { rows, texels }
    }

    /// Changes the texels along seams in one channel. Returns sums over all places of the squared step before and after, and the squared value.
    pub fn close(&self, plane: &mut [f32]) -> [f64; 3] {
        let start: Vec<f64> = self.texels.iter().map(|&texel| plane[texel as usize].into()).collect();
        let [least, most] = [(f64::INFINITY, f64::min as fn(f64, f64) -> f64), (f64::NEG_INFINITY, f64::max)]
            .map(|(none, of)| start.iter().copied().fold(none, of));
        let mut end = start.clone();
        let mut held = vec![false; start.len()];
        for _ in 0..ROUNDS {
            self.solve(&start, &mut end, &held);
            let mut leaves = false;
            for (value, held) in end.iter_mut().zip(&mut held) {
                let inside = value.max(least).min(most);
                *held |= inside != *value;
                leaves |= inside != *value;
                *value = inside;
            }
            if !leaves {
                break;
            }
        }
        for (&texel, &value) in self.texels.iter().zip(&end) {
            plane[texel as usize] = value as f32;
        }
        let steps = |values: &[f64]| self.rows.iter().map(|row| step(row, values).powi(2)).sum();
        let side = |row: &SeamEquation| row[..4].iter().map(|&(texel, weight)| weight * start[texel as usize]).sum::<f64>();
        [steps(&start), steps(&end), self.rows.iter().map(|row| side(row).powi(2)).sum()]
    }

    /// Changes all values that are not held to the minimum.
    fn solve(&self, start: &[f64], values: &mut [f64], held: &[bool]) {
        let free = |mut all: Vec<f64>| {
            all.iter_mut().zip(held).filter(|(_, held)| **held).for_each(|(value, _)| *value = 0.0);
            all
        };
        let downhill = |((step, value), start): ((&f64, &f64), &f64)| start - value - WEIGHT * step;
        let mut residual = free(self.normal(values).iter().zip(&*values).zip(start).map(downhill).collect());
        let mut direction = residual.clone();
        let first = dot(&residual, &residual);
        let mut square = first;
        while square > SETTLED * SETTLED * first {
            let ahead = self.normal(&direction).into_iter().zip(&direction).map(|(step, d)| d + WEIGHT * step);
            let ahead = free(ahead.collect());
            let length = square / dot(&direction, &ahead);
            let before = square;
            for ((value, residual), (d, ahead)) in values.iter_mut().zip(&mut residual).zip(direction.iter().zip(&ahead)) {
                *value += length * d;
                *residual -= length * ahead;
            }
            square = dot(&residual, &residual);
            for (d, residual) in direction.iter_mut().zip(&residual) {
                *d = residual + square / before * *d;
            }
        }
    }

    /// AᵀA x.
    fn normal(&self, x: &[f64]) -> Vec<f64> {
        let mut sums = vec![0.0; x.len()];
        for row in &self.rows {
            let step = step(row, x);
            for &(texel, weight) in row {
                sums[texel as usize] += weight * step;
            }
        }
        sums
    }
}

/// One element of A x.
fn step(row: &SeamEquation, x: &[f64]) -> f64 {
    row.iter().map(|&(texel, weight)| weight * x[texel as usize]).sum()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The texels that bilinear filtering reads at a place of the map (in texels), with their weights.
fn taps(at: DVec2, [width, height]: [u32; 2]) -> [(u32, f64); 4] {
    let (low, part) = ((at - 0.5).floor(), (at - 0.5) - (at - 0.5).floor());
    [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[x, y]| {
        let column = (low.x as i64 + x).clamp(0, i64::from(width) - 1) as u32;
        let row = (low.y as i64 + y).clamp(0, i64::from(height) - 1) as u32;
        let along = |part: f64, far: i64| if far == 1 { part } else { 1.0 - part };
        (row * width + column, along(part.x, x) * along(part.y, y))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texels_stay_in_the_gathered_range_and_seams_close() {
        // The mean of texels 0 and 1 lies on one side, and texel 2 on the other.
        let none = (0, 0.0);
        let row = [(0, 0.5), (1, 0.5), none, none, (2, -1.0), none, none, none];
        let seams = Seams { rows: vec![row], texels: vec![0, 1, 2] };
        let mut plane = [1.0, 0.0, 1.0];
        seams.close(&mut plane);
        // Without the range, texel 0 would be 1.16.
        assert_eq!(plane[0], 1.0);
        let step = 0.5 * plane[0] + 0.5 * plane[1] - plane[2];
        assert!(step.abs() < 0.02 && plane[1] > 0.1 && plane[2] < 0.9, "{plane:?}");
    }
}
