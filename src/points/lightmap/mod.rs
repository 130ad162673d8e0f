//! Light maps: irradiance or other gathered values as a texture of the scene's surfaces. [`LightMap::new`] lays out the surfaces in the plane
//! and places gather points in all texels that they touch. [`LightMap::image`] makes the map from the values at these points.
//!
//! The layout is the mesh's own coordinates for light maps ([`Mesh::lightmap_uvs`]), or its texture coordinates ([`Mesh::uvs`]), if they cover the
//! surface once within 0 to 1, or an atlas. Charts of an atlas do not cross creases, because filtering would blur them.
//!
//! From values to the map:
//! 1. A texel is the mean of its samples. Samples inside geometry, which see mostly back faces, do not count.
//! 2. Texels that have only such samples are filled from their chart (`fill`).
//! 3. Texels along seams change until both sides agree (`seams`).
//! 4. Charts grow into the padding around them, so that filtering reads no empty texel and none of another chart.

mod cover;
mod edges;
mod fill;
mod seams;
mod unwrap;

use std::collections::HashMap;

use glam::{DVec2, Vec2, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use self::fill::Fill;
use self::seams::Seams;
use self::unwrap::{UnwrapInput, UvLayout, double_area, has_area, unusable};
use super::{GatherPoint, INSIDE};
use crate::error::{Error, Result};
use crate::image::{Channel, Image};
use crate::scene::{Mesh, Triangle};

/// The most texels along a side. Most devices take textures of this size.
const MAX_SIDE: u32 = 16_384;

/// The most samples of a map. Making it takes 68 bytes for each, 4.5 GB.
const MAX_SAMPLES: f64 = (1 << 26) as f64;

/// Least distance of points from creases and borders, for a scene of radius 1. Nearer to the foot of a wall, a gather would lose some of the
/// wall's light. On an edge, it could see either side.
const INSET: f32 = 1e-3;

/// Least distance of points from joints. It is small because both sides are one smooth surface, and points of thin triangles should not move far.
const JOINT_INSET: f32 = 1e-5;

/// The most that both distances may be, as a fraction of the triangle's height.
const MAX_INSET: f32 = 0.1;

/// What to do about a map that is too large.
const SMALLER: &str = "ask for a smaller map, fewer texels per unit or fewer samples per texel";

/// Options of a light map.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LightMapOptions {
    pub resolution: Resolution,
    pub uvs: UvSource,
    /// Rings of texels around each chart that get its values, at least 1. Charts of an atlas are twice as far apart.
    pub padding: u32,
    /// Samples in a texel, rounded up to a square number. They share the directions of a bake.
    pub samples_per_texel: u32,
}

/// Fewest directions for each sample of a texel, if the samples are to share them. Where other samples lie inside geometry, all that is left of a texel is
/// one of them. With fewer directions, such texels beside each other show the error of these few.
const LEAST_DIRECTIONS: u32 = 64;
/// Most samples of a texel.
const MOST_IN_TEXEL: u32 = 256;

impl LightMapOptions {
    /// Samples along each side of a texel.
    fn strata(&self) -> u32 {
        f64::from(self.samples_per_texel).sqrt().ceil() as u32
    }

    /// In how many turns, at most `most`, the samples of a texel share so many directions. Each turn has equally many samples.
    pub fn turns(&self, directions: u32, most: u32) -> u32 {
        let samples = self.strata().saturating_mul(self.strata());
        let most = most.min(directions / LEAST_DIRECTIONS).min(samples);
        (1..=most).rev().find(|turns| samples.is_multiple_of(*turns)).unwrap_or(1)
    }
}

impl Default for LightMapOptions {
    fn default() -> Self {
        Self { resolution: Resolution::Pixels(1024), uvs: UvSource::Auto, padding: 2, samples_per_texel: 4 }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Resolution {
    /// Width and height of the map.
    Pixels(u32),
    /// Texels for each unit of length of the mesh. For texels for each world unit, multiply by the world
    /// [length](crate::scene::UnitSpace::length_to_world) of 1.
    TexelsPerUnit(f32),
}

/// The source of texture coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum UvSource {
    /// The mesh's own coordinates if they are usable, else an atlas.
    Auto,
    Own,
    Atlas,
}

/// Size and contents of a light map.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct LightMapCounts {
    pub width: u32,
    pub height: u32,
    /// `own` or `atlas`.
    pub layout: &'static str,
    pub charts: u32,
    /// Texels that a surface touches.
    pub texels: usize,
    /// Texels that two charts touch. Their light mixes there. An atlas has none.
    pub shared: usize,
    pub samples: usize,
    /// Edges at which the surface continues elsewhere in the map.
    pub seams: usize,
    /// Triangles without area in the map. They have no samples.
    pub lost: usize,
}

/// Repairs of a light map's image.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Mended {
    /// Texels inside geometry that were filled from their chart.
    pub filled: usize,
    /// Texels of charts that lie wholly inside geometry.
    pub hidden: usize,
    /// Root mean square of the steps across seams, relative to the values there, before the repair.
    pub steps_before: f64,
    /// The same after the repair.
    pub steps: f64,
}

/// A texel that a surface touches.
#[derive(Clone, Debug)]
struct Texel {
    /// Row by row from the bottom.
    index: u32,
    chart: u32,
}

/// A layout of surfaces, and gather points in its texels.
pub struct LightMap {
    mesh: Mesh,
    origins: Vec<u32>,
    /// The first sample of each texel, then the second of each, and so on.
    points: Vec<GatherPoint>,
    texels: Vec<Texel>,
    seams: Seams,
    padding: u32,
    counts: LightMapCounts,
    warnings: Vec<String>,
}

impl LightMap {
    /// `mesh` is in unit space.
    ///
    /// # Errors
    /// If `options` ask for the mesh's own texture coordinates and these are not usable, or if the map would be too large.
    pub fn new(mesh: &Mesh, options: &LightMapOptions) -> Result<Self> {
        if let Resolution::Pixels(side) = options.resolution {
            check_size(&[], [side; 2], 1)?;
        }
        match options.uvs {
            UvSource::Own => Self::with_layout("own", mesh, options),
            UvSource::Auto if !unwrap::own_uvs(mesh).is_empty() => Self::with_layout("own", mesh, options).or_else(|error| {
                let mut map = Self::with_layout("atlas", mesh, options)?;
                if let Error::Usage { problem, .. } = error {
                    map.warnings.push(format!("an atlas in place of the mesh's own texture coordinates: {problem}"));
                }
                Ok(map)
            }),
            UvSource::Atlas | UvSource::Auto => Self::with_layout("atlas", mesh, options),
        }
    }

    fn with_layout(layout: &'static str, mesh: &Mesh, options: &LightMapOptions) -> Result<Self> {
        if options.padding == 0 || options.samples_per_texel == 0 {
            return Err(Error::usage("a light map without padding or samples", "give at least 1 of each"));
        }
        if options.samples_per_texel > MOST_IN_TEXEL {
            let problem = format!("{} samples per texel, where {MOST_IN_TEXEL} are possible", options.samples_per_texel);
            return Err(Error::usage(problem, "ask for a larger map; more directions make less noise"));
        }
        let welded = edges::weld(mesh);
        let joints = edges::joints(mesh, &welded);
        let cuts = edges::cuts(mesh, &joints);
        let unwrap = if layout == "own" { unwrap::own } else { unwrap::atlas };
        let UvLayout { uvs, size } = unwrap(&UnwrapInput { mesh, welded: &welded, joints: &joints, cuts: &cuts }, options)?;
        let strata = options.strata();
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

        let of_texels: Vec<&[cover::Sample]> = samples.chunk_by(|p, q| p.texel == q.texel).collect();
        let texels = of_texels.iter().map(|own| Texel { index: own[0].texel, chart: chart(&own[0]) }).collect::<Vec<_>>();
        // Charts with long borders touch more texels than their area tells.
        check_samples(of_texels.len() as f64 * f64::from(strata).powi(2))?;
        // A texel with fewer samples, at the border of a chart, repeats them.
        let nth = |number: usize| of_texels.par_iter().map(move |own| &own[number % own.len()]);
        let point = |sample: &cover::Sample| point(mesh, sample, cuts[sample.triangle as usize]);
        let points = (0..(strata * strata) as usize).flat_map(|number| nth(number).map(point).collect::<Vec<_>>()).collect();
        let counts = LightMapCounts {
            width: size[0],
            height: size[1],
            layout,
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

    /// The gather points: the first sample of each texel, then the second of each, and so on.
    pub fn points(&self) -> &[GatherPoint] {
        &self.points
    }

    /// The mesh with the map's texture coordinates. Vertices are split where charts end, and triangles keep their order.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// The original vertex of each vertex of [`Self::mesh`], to look up other attributes.
    pub fn origins(&self) -> &[u32] {
        &self.origins
    }

    pub fn counts(&self) -> &LightMapCounts {
        &self.counts
    }

    /// Warnings for the user.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The map of these values at the points, with `A`, 1 where a surface is. `inside` is the fraction of back-face hits at each point.
    pub fn image(&self, columns: &[Channel], inside: &[f32]) -> (Image, Mended) {
        let [width, height] = [self.counts.width, self.counts.height].map(|side| side as usize);
        let samples_of = |number: usize| (number..self.points.len()).step_by(self.texels.len());
        let known: Vec<bool> =
            (0..self.texels.len()).map(|texel| samples_of(texel).any(|sample| inside[sample] <= INSIDE)).collect();
        let fill = Fill::new([self.counts.width, self.counts.height], &self.texels, &known, self.padding);
        let map = |column: &Channel| {
            let mut plane = vec![0.0; width * height];
            for (number, (texel, known)) in self.texels.iter().zip(&known).enumerate() {
                let samples = samples_of(number).filter(|&sample| !known || inside[sample] <= INSIDE);
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
    let [width, height] = size;
    if width.min(height) == 0 || width.max(height) > MAX_SIDE {
        return Err(Error::usage(
            format!("a light map of {width} x {height} texels, where 1 to {MAX_SIDE} a side are possible"),
            SMALLER,
        ));
    }
    let share: f64 = uvs.iter().map(|&corners| 0.5 * f64::from(double_area(corners))).sum();
    check_samples(share * f64::from(width) * f64::from(height) * f64::from(strata).powi(2))
}

fn check_samples(samples: f64) -> Result<()> {
    match samples > MAX_SAMPLES {
        true => Err(Error::usage(format!("a light map of {samples:.0} samples, where {MAX_SAMPLES:.0} are possible"), SMALLER)),
        false => Ok(()),
    }
}

/// The gather point of a sample, on the front of its triangle. The flags tell which edges of the triangle are cuts.
fn point(mesh: &Mesh, sample: &cover::Sample, [ab, bc, ca]: [bool; 3]) -> GatherPoint {
    let triangle = sample.triangle as usize;
    let corners @ [a, b, c] = mesh.corners(triangle);
    let surface_normal = mesh.geometric_normal(triangle);
    let heights = 2.0 * mesh.area(triangle) / Vec3::new(b.distance(c), c.distance(a), a.distance(b));
    let inset = Vec3::from([bc, ca, ab].map(|cut| if cut { INSET } else { JOINT_INSET }));
    let least = (inset / heights).min(Vec3::splat(MAX_INSET));
    // Move away from edges that are too near, twice, because moving away from one edge may bring the point near another.
    let mut position = mix(corners, sample.barycentric);
    for edge in [0, 1, 2, 0, 1, 2] {
        let [from, to] = [1, 2].map(|k| corners[(edge + k) % 3]);
        let inward = surface_normal.cross(to - from).normalize();
        position += inward * (least[edge] * heights[edge] - inward.dot(position - from)).max(0.0);
    }
    // In sharp corners this is not enough. There, raise barycentric weights to `least` and scale down the others.
    let above = (mesh.barycentric(triangle, position) - least).max(Vec3::ZERO);
    let weights = least + above * ((1.0 - least.element_sum()) / above.element_sum());
    let normals = mesh.triangles[triangle].vertices.map(|vertex| mesh.normals[vertex as usize]);
    let normal = mix(normals, weights).normalize_or(surface_normal);
    GatherPoint { position: mix(corners, weights), normal, surface_normal }
}

fn mix([a, b, c]: [Vec3; 3], weights: Vec3) -> Vec3 {
    a * weights.x + b * weights.y + c * weights.z
}

/// Splits vertices so that triangles have these texture coordinates at their corners. Also returns the original vertex of each vertex.
fn split(mesh: &Mesh, uvs: &[[Vec2; 3]]) -> (Mesh, Vec<u32>) {
    let (mut new, mut origins, mut numbers) = (Mesh::default(), Vec::new(), HashMap::new());
    for (&Triangle { vertices, material }, uvs) in mesh.triangles.iter().zip(uvs) {
        let vertices = [0, 1, 2].map(|k| {
            let (origin, uv) = (vertices[k], uvs[k]);
            *numbers.entry((origin, uv.to_array().map(f32::to_bits))).or_insert_with(|| {
                origins.push(origin);
                let index = new.push_vertex_of(mesh, origin);
                new.lightmap_uvs.truncate(index as usize);
                new.lightmap_uvs.push(uv);
                index
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

/// Reverses the order of rows, from bottom first to top first.
fn from_top(plane: &[f32], width: usize) -> Vec<f32> {
    plane.chunks_exact(width).rev().flatten().copied().collect()
}
