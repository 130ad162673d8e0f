//! Light maps: irradiance, or whatever else is gathered, as a texture of the scene's surfaces. [`LightMap::new`] lays the surfaces out in the
//! plane and takes gather points in all texels that they touch; [`LightMap::image`] makes the map of the values found at them.
//!
//! Layout: the mesh's own texture coordinates ([`Mesh::uvs`]; an OBJ has one set, there is no second) where they cover the surface once
//! within 0 to 1, or an atlas. No chart of an atlas goes over a crease, for filtering would blur it.
//!
//! From values to the map: the mean of each texel's samples; samples inside geometry, which see mostly backs, do not count, and texels
//! without others are filled from their chart; texels along seams are moved until both sides agree; last, charts grow into the
//! padding around them, so that filtering reads nothing empty and nothing of another chart.

mod cover;
mod edges;
mod fill;
mod seams;
mod unwrap;

use std::collections::HashMap;
use std::ops::Range;

use glam::{DVec2, Vec2, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use self::fill::Fill;
use self::seams::Seams;
use self::unwrap::{Atlas, Own, Surface, Unwrap, Unwrapped, double_area, has_area, unusable};
use super::GatherPoint;
use crate::error::{Error, Result};
use crate::image::{Channel, Image};
use crate::scene::{Mesh, Triangle};

/// Texels along a side: what most devices take as a texture.
const MAX_SIDE: u32 = 16_384;

/// Samples of a map, 68 bytes each while it is made: 4.5 GB.
const MAX_SAMPLES: f64 = (1 << 26) as f64;

/// Distance of points from creases and borders, of the scene's radius: nearer to the foot of a wall a gather would lose some of what the
/// wall sends, and on an edge see either side of it.
const INSET: f32 = 1e-3;

/// Distance from edges over which a surface is smooth: either side will do, so that points of thin triangles need not move far.
const JOINT_INSET: f32 = 1e-5;

/// The same at most, of the triangle's height.
const MAX_INSET: f32 = 0.1;

/// Share of back-face hits from which on a point lies inside something. There all hits are, but for leaks; outside none, but for surfaces
/// without thickness, as leaves, of which about half show their backs.
const INSIDE: f32 = 0.5;

/// How a light map is made.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LightMapOptions {
    pub resolution: Resolution,
    pub uvs: UvSource,
    /// Texels around each chart that get values from it; charts of an atlas are twice as far apart. At least 1.
    pub padding: u32,
    /// In texels that lie within a surface: a square number, or the next is taken.
    pub samples_per_texel: u32,
}

impl Default for LightMapOptions {
    fn default() -> Self {
        Self { resolution: Resolution::Pixels(1024), uvs: UvSource::Auto, padding: 2, samples_per_texel: 4 }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Resolution {
    /// Width of the map; its height too, but that an atlas ends where its charts do.
    Pixels(u32),
    /// In the mesh's units of length: for texels in a unit of the world, times the
    /// [length](crate::scene::UnitSpace::length_to_world) of 1 there.
    TexelsPerUnit(f32),
}

/// Where texture coordinates come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum UvSource {
    /// The mesh's own if they serve, else an atlas.
    Auto,
    Own,
    Atlas,
}

/// What was made.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct LightMapCounts {
    pub width: u32,
    pub height: u32,
    /// `own` or `atlas`.
    pub layout: &'static str,
    pub charts: u32,
    /// Texels that a surface touches.
    pub texels: usize,
    /// Texels that two charts touch: their light mixes there. An atlas has none.
    pub shared: usize,
    pub samples: usize,
    /// Edges where the surface goes on elsewhere in the map.
    pub seams: usize,
    /// Triangles without area in the map, which have no samples.
    pub lost: usize,
}

/// What was mended in a picture of the map.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Mended {
    /// Texels inside geometry that have their value from their chart.
    pub filled: usize,
    /// Texels of charts wholly inside geometry.
    pub hidden: usize,
    /// Root mean square of the steps across seams, of the values there, as they were.
    pub steps_before: f64,
    /// The same, as they are.
    pub steps: f64,
}

/// A texel that a surface touches.
#[derive(Clone, Debug)]
struct Texel {
    /// Row by row from the bottom.
    index: u32,
    chart: u32,
    /// Into the points.
    samples: Range<usize>,
}

/// A layout of surfaces and the gather points in its texels.
pub struct LightMap {
    mesh: Mesh,
    origins: Vec<u32>,
    points: Vec<GatherPoint>,
    texels: Vec<Texel>,
    seams: Seams,
    padding: u32,
    counts: LightMapCounts,
    warnings: Vec<String>,
}

impl LightMap {
    /// Of a mesh in unit space.
    ///
    /// # Errors
    /// When the mesh's own texture coordinates are asked for and cannot serve, or when the map would be too large.
    pub fn new(mesh: &Mesh, options: &LightMapOptions) -> Result<Self> {
        if let Resolution::Pixels(side) = options.resolution {
            check_size(&[], [side; 2], 1)?;
        }
        match options.uvs {
            UvSource::Own => Self::by(&Own, mesh, options),
            UvSource::Atlas => Self::by(&Atlas, mesh, options),
            UvSource::Auto if mesh.uvs.iter().all(|&uv| uv == Vec2::ZERO) => Self::by(&Atlas, mesh, options),
            UvSource::Auto => Self::by(&Own, mesh, options).or_else(|error| {
                let mut map = Self::by(&Atlas, mesh, options)?;
                if let Error::Usage { problem, .. } = error {
                    map.warnings.push(format!("an atlas in place of the mesh's own texture coordinates: {problem}"));
                }
                Ok(map)
            }),
        }
    }

    fn by(layout: &impl Unwrap, mesh: &Mesh, options: &LightMapOptions) -> Result<Self> {
        if options.padding == 0 || options.samples_per_texel == 0 {
            return Err(Error::usage("a light map without padding or samples", "give at least 1 of each"));
        }
        let welded = edges::weld(mesh);
        let joints = edges::joints(mesh, &welded);
        let cuts = edges::cuts(mesh, &joints);
        let Unwrapped { uvs, size } = layout.unwrap(&Surface { mesh, welded: &welded, joints: &joints, cuts: &cuts }, options)?;
        let strata = f64::from(options.samples_per_texel).sqrt().ceil() as u32;
        check_size(&uvs, size, strata)?;
        let (charts, seams) = edges::charts(&uvs, &joints);

        let scale = DVec2::new(size[0].into(), size[1].into());
        let corners: Vec<_> = uvs.iter().map(|corners| corners.map(|uv| uv.as_dvec2() * scale)).collect();
        let all = cover::cover(&corners, size, strata);
        if let Some((places, [p, q])) = cover::overlaps(&all) {
            let share = 100.0 * places as f64 / all.len() as f64;
            return Err(unusable(&format!(
                "texture coordinates overlap in {share:.3} % of the map, first those of triangles {p} and {q}"
            )));
        }
        let chart = |sample: &cover::Sample| charts[sample.triangle as usize];
        let shared =
            all.chunk_by(|p, q| p.texel == q.texel).filter(|texel| texel.iter().any(|sample| chart(sample) != chart(&texel[0])));
        let shared = shared.count();
        let samples = cover::thin(&all);
        drop(all);

        let mut texels: Vec<Texel> = Vec::new();
        for (index, sample) in samples.iter().enumerate() {
            match texels.last_mut() {
                Some(texel) if texel.index == sample.texel => texel.samples.end = index + 1,
                _ => texels.push(Texel { index: sample.texel, chart: chart(sample), samples: index..index + 1 }),
            }
        }
        let points = samples.par_iter().map(|sample| point(mesh, sample, cuts[sample.triangle as usize])).collect();
        let counts = LightMapCounts {
            width: size[0],
            height: size[1],
            layout: layout.name(),
            charts: charts.iter().max().map_or(0, |last| last + 1),
            texels: texels.len(),
            shared,
            samples: samples.len(),
            seams: seams.len(),
            lost: uvs.iter().filter(|&&corners| !has_area(corners)).count(),
        };
        let seams = Seams::new(&seams, &uvs, size);
        let (mesh, origins) = split(mesh, &uvs);
        Ok(Self { mesh, origins, points, texels, seams, padding: options.padding, counts, warnings: Vec::new() })
    }

    /// Where values are wanted, several points a texel.
    pub fn points(&self) -> &[GatherPoint] {
        &self.points
    }

    /// The mesh with the map's texture coordinates, its vertices split where charts end; triangles as they were.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// Of each vertex of [`Self::mesh`], the one that it was, to find other attributes by.
    pub fn origins(&self) -> &[u32] {
        &self.origins
    }

    pub fn counts(&self) -> &LightMapCounts {
        &self.counts
    }

    /// In sentences for a person.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The map of these values at the points, and `A`, 1 where a surface is. `inside` is the share of back-face hits at each point.
    pub fn image(&self, columns: &[Channel], inside: &[f32]) -> (Image, Mended) {
        let [width, height] = [self.counts.width, self.counts.height].map(|side| side as usize);
        let counts = |texel: &Texel| inside[texel.samples.clone()].iter().any(|&share| share <= INSIDE);
        let fill = Fill::new([self.counts.width, self.counts.height], &self.texels, counts, self.padding);
        let map = |column: &Channel| {
            let mut plane = vec![0.0; width * height];
            for texel in &self.texels {
                let outside = counts(texel);
                let samples = texel.samples.clone().filter(|&sample| !outside || inside[sample] <= INSIDE);
                plane[texel.index as usize] = mean(samples.map(|sample| column.samples[sample]));
            }
            fill.near(&mut plane);
            let steps = self.seams.close(&mut plane);
            fill.far(&mut plane);
            (Channel { name: column.name.clone(), samples: from_top(&plane, width) }, steps)
        };
        let (mut channels, steps): (Vec<_>, Vec<_>) = columns.par_iter().map(map).collect();
        let mut coverage = vec![0.0; width * height];
        for texel in &self.texels {
            coverage[texel.index as usize] = 1.0;
        }
        channels.push(Channel { name: "A".into(), samples: from_top(&coverage, width) });
        let [before, after, value] = [0, 1, 2].map(|k| steps.iter().map(|sums| sums[k]).sum::<f64>());
        let relative = |sum: f64| if value > 0.0 { (sum / value).sqrt() } else { 0.0 };
        let mended = Mended { filled: fill.filled, hidden: fill.hidden, steps_before: relative(before), steps: relative(after) };
        (Image { width, height, channels }, mended)
    }
}

fn check_size(uvs: &[[Vec2; 3]], size: [u32; 2], strata: u32) -> Result<()> {
    let cure = "ask for a smaller map, fewer texels per unit or fewer samples per texel";
    let [width, height] = size;
    if width.min(height) == 0 || width.max(height) > MAX_SIDE {
        return Err(Error::usage(
            format!("a light map of {width} x {height} texels, where 1 to {MAX_SIDE} a side are possible"),
            cure,
        ));
    }
    let share: f64 = uvs.iter().map(|&corners| 0.5 * f64::from(double_area(corners))).sum();
    let samples = share * f64::from(width) * f64::from(height) * f64::from(strata * strata);
    if samples > MAX_SAMPLES {
        return Err(Error::usage(format!("a light map of {samples:.0} samples, where {MAX_SAMPLES:.0} are possible"), cure));
    }
    Ok(())
}

/// The gather point of a sample, on the front of its triangle, of whose edges some are cuts.
fn point(mesh: &Mesh, sample: &cover::Sample, [ab, bc, ca]: [bool; 3]) -> GatherPoint {
    let triangle = sample.triangle as usize;
    let corners @ [a, b, c] = mesh.corners(triangle);
    let surface_normal = mesh.geometric_normal(triangle);
    let heights = 2.0 * mesh.area(triangle) / Vec3::new(b.distance(c), c.distance(a), a.distance(b));
    let inset = Vec3::from([bc, ca, ab].map(|cut| if cut { INSET } else { JOINT_INSET }));
    let least = (inset / heights).min(Vec3::splat(MAX_INSET));
    // Straight away from edges that are too near, the second time from what the first came near to.
    let mut position = mix(corners, sample.barycentric);
    for edge in [0, 1, 2, 0, 1, 2] {
        let [from, to] = [1, 2].map(|k| corners[(edge + k) % 3]);
        let inward = surface_normal.cross(to - from).normalize();
        position += inward * (least[edge] * heights[edge] - inward.dot(position - from)).max(0.0);
    }
    // In sharp corners that is not enough: weights of at least `least` there, and all others stay.
    let above = (mesh.barycentric(triangle, position) - least).max(Vec3::ZERO);
    let weights = least + above * ((1.0 - least.element_sum()) / above.element_sum());
    let normals = mesh.triangles[triangle].vertices.map(|vertex| mesh.normals[vertex as usize]);
    let normal = mix(normals, weights).normalize_or(surface_normal);
    GatherPoint { position: mix(corners, weights), normal, surface_normal }
}

fn mix([a, b, c]: [Vec3; 3], weights: Vec3) -> Vec3 {
    a * weights.x + b * weights.y + c * weights.z
}

/// The mesh with these texture coordinates of its triangles' corners; and of each vertex the one that it was.
fn split(mesh: &Mesh, uvs: &[[Vec2; 3]]) -> (Mesh, Vec<u32>) {
    let (mut new, mut origins, mut numbers) = (Mesh::default(), Vec::new(), HashMap::new());
    for (&Triangle { vertices, material }, uvs) in mesh.triangles.iter().zip(uvs) {
        let vertices = [0, 1, 2].map(|k| {
            let (origin, uv) = (vertices[k], uvs[k]);
            *numbers.entry((origin, uv.to_array().map(f32::to_bits))).or_insert_with(|| {
                new.positions.push(mesh.positions[origin as usize]);
                new.normals.push(mesh.normals[origin as usize]);
                new.uvs.push(uv);
                origins.push(origin);
                origins.len() as u32 - 1
            })
        });
        new.triangles.push(Triangle { vertices, material });
    }
    (new, origins)
}

fn mean(values: impl Iterator<Item = f32>) -> f32 {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
    sum / count as f32
}

/// Rows from the top of what has rows from the bottom.
fn from_top(plane: &[f32], width: usize) -> Vec<f32> {
    plane.chunks_exact(width).rev().flatten().copied().collect()
}
