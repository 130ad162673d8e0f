//! Fills texels without values: texels inside geometry from their chart, and empty texels around a chart from its rim.

use super::{Texel, mean};

/// Means no texel or no chart.
const NONE: u32 = u32::MAX;

/// The order in which texels get the mean of neighbours.
pub struct Fill {
    /// Texels and their sources. A source may be a texel that an earlier step filled.
    steps: Vec<(u32, [u32; 8])>,
    /// The first step whose texel filtering does not read.
    far: usize,
    /// Texels of charts that got a value from their neighbours.
    pub filled: usize,
    /// Texels of charts without any known texel. They keep their values.
    pub hidden: usize,
}

impl Fill {
    /// `texels` are those that the map's charts cover, `known` tells for each whether it has a value, and `padding` rings of texels around charts get values.
    pub fn new([width, height]: [u32; 2], texels: &[Texel], known: &[bool], padding: u32) -> Self {
        let mut chart = vec![NONE; width as usize * height as usize];
        let mut given = vec![false; chart.len()];
        for (texel, &known) in texels.iter().zip(known) {
            chart[texel.index as usize] = texel.chart;
            given[texel.index as usize] = known;
        }
        let around = |texel: u32| {
            let (x, y) = ((texel % width) as i32, (texel / width) as i32);
            let neighbours = [[-1, -1], [0, -1], [1, -1], [-1, 0], [1, 0], [-1, 1], [0, 1], [1, 1]];
            neighbours.map(|[dx, dy]| {
                let inside = (0..width as i32).contains(&(x + dx)) && (0..height as i32).contains(&(y + dy));
                if inside { (y + dy) as u32 * width + (x + dx) as u32 } else { NONE }
            })
        };
        let mut steps = Vec::new();

        // Each call adds one ring. The gaps of charts are closed before rings around charts are added.
        let mut ring: Vec<u32> = texels.iter().map(|texel| texel.index).filter(|&index| given[index as usize]).collect();
        let grow =
            |steps: &mut Vec<(u32, [u32; 8])>, given: &mut [bool], chart: &mut [u32], ring: &mut Vec<u32>, covered: bool| {
                let mut next: Vec<u32> = ring.iter().flat_map(|&texel| around(texel)).filter(|&texel| texel != NONE).collect();
                next.sort_unstable();
                next.dedup();
                let begun = steps.len();
                for texel in next {
                    let own = chart[texel as usize];
                    if given[texel as usize] || (own != NONE) != covered {
                        continue;
                    }
                    let mut sources = around(texel).map(|from| if from != NONE && given[from as usize] { from } else { NONE });
                    // An empty texel between charts belongs to one of them.
                    let chart_of = |from: u32| if from == NONE { NONE } else { chart[from as usize] };
                    let own = if covered { own } else { sources.map(chart_of).into_iter().min().unwrap_or(NONE) };
                    sources = sources.map(|from| if chart_of(from) == own { from } else { NONE });
                    if sources != [NONE; 8] {
                        steps.push((texel, sources));
                    }
                }
                ring.clear();
                for &(texel, sources) in &steps[begun..] {
                    given[texel as usize] = true;
                    let source = sources.into_iter().find(|&from| from != NONE);
                    chart[texel as usize] = source.map_or(NONE, |from| chart[from as usize]);
                    ring.push(texel);
                }
                ring.len()
            };
        while grow(&mut steps, &mut given, &mut chart, &mut ring, true) > 0 {}
        let filled = steps.len();
        let hidden = texels.iter().filter(|texel| !given[texel.index as usize]).count();
        ring = texels.iter().map(|texel| texel.index).collect();
        for &texel in &ring {
            given[texel as usize] = true;
        }
        grow(&mut steps, &mut given, &mut chart, &mut ring, false);
        let far = steps.len();
        for _ in 1..padding {
            grow(&mut steps, &mut given, &mut chart, &mut ring, false);
        }
        Self { steps, far, filled, hidden }
    }

    /// Fills all texels that filtering reads at places on surfaces.
    pub fn near(&self, plane: &mut [f32]) {
        apply(&self.steps[..self.far], plane);
    }

    /// Fills the rest of the padding.
    pub fn far(&self, plane: &mut [f32]) {
        apply(&self.steps[self.far..], plane);
    }
}

fn apply(steps: &[(u32, [u32; 8])], plane: &mut [f32]) {
    for &(texel, sources) in steps {
        plane[texel as usize] = mean(sources.iter().filter(|&&from| from != NONE).map(|&from| plane[from as usize]));
    }
}
