//! The film: sums over blocks of directions at each pixel, and the picture that their means make.
//!
//! Each block has its own sub-pixel offset, so a pixel sums radiance and not irradiance. Over all blocks, each of n directions,
//! Indirect = fraction of directions with a point × Σ albedo (Σ L w) / Σ w. Other quantities are Σ n value / Σ n. [`PairwiseSum`] adds films.

use std::f32::consts::PI;
use std::slice::{from_mut, from_ref};

use bytemuck::{Pod, Zeroable, cast_slice, cast_slice_mut};
use glam::{Vec3, Vec4};
use rayon::prelude::*;

use crate::blocks::{PairwiseSum, Planes, Sum};
use crate::image::{Channel, Image};
use crate::points::GBuffer;
use crate::scene::UnitSpace;

/// The sums of one or more blocks.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    size: [usize; 2],
    directions: u32,
    /// Row by row from the top.
    pixels: Vec<Pixel>,
    /// Sums that few scenes have; else empty.
    rare: Vec<RarePixel>,
    /// Sums of lobes, in scenes with gloss; else empty.
    lobes: Vec<LobePixel>,
}

/// The sums of one pixel, weighted as the module's documentation says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
struct Pixel {
    indirect: Vec3,
    weight: f32,
    /// Directions of blocks in which the pixel has a point. A path of mirrors may end without one.
    gathered: f32,
    direct: Vec3,
    photon_map: Vec3,
    coverage: f32,
    emission: Vec3,
    depth: f32,
    albedo: Vec3,
    normal: Vec3,
    position: Vec3,
}

/// Sums of one pixel that only scenes with caustics, an environment or a ground have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
struct RarePixel {
    caustics: Vec3,
    /// The part of the emission that is the environment behind the scene.
    environment: Vec3,
    /// Of the ground that catches the shadow: its coverage, its light, and the light that it would have without the scene.
    ground: f32,
    light: f32,
    open: f32,
}

/// The sums of the lobes at one pixel, as those of [`Pixel`] for bases.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
struct LobePixel {
    indirect: Vec3,
    /// For each channel: the Fresnel term weighs them differently.
    weight: Vec3,
    /// Directions of blocks in which the pixel has a lobe.
    gathered: f32,
}

/// All sums of one pixel.
#[derive(Clone, Copy, Default)]
struct PixelSums {
    common: Pixel,
    rare: RarePixel,
    lobe: LobePixel,
}

/// What a block brings to its pixels, row by row from the bottom.
pub struct BlockLight<'a> {
    pub directions: u32,
    pub g_buffer: &'a GBuffer,
    /// Irradiance from the lights.
    pub direct: &'a [Vec3],
    /// Irradiance of caustics; empty in a scene without.
    pub caustics: &'a [Vec3],
    /// Irradiance of the photon map.
    pub photon_map: &'a [Vec4],
    /// Whether the scene has one.
    pub environment: bool,
    /// The light of pixels that see the ground, and what it would be without the scene; empty without a ground.
    pub ground: &'a [Option<[f32; 2]>],
    /// The sums of the gather.
    pub gathered: &'a [Vec4],
    /// In scenes with gloss.
    pub lobes: Option<&'a LobeSums<'a>>,
}

/// What the lobes of a block's pixels reflect, row by row from the bottom.
pub struct LobeSums<'a> {
    /// rgb: Σ radiance × weight, over what the lobe reflects of even light.
    pub lobes: Vec<Vec4>,
    /// rgb: Σ weight, over the same.
    pub weights: Vec<Vec4>,
    /// Radiance that comes from lights and caustics, without the path's throughput. That of caustics is empty in a scene without.
    pub direct: [&'a [Vec3]; 2],
}

impl PixelSums {
    fn add(&mut self, later: &Self) {
        add(&mut self.common, &later.common);
        add(&mut self.rare, &later.rare);
        add(&mut self.lobe, &later.lobe);
    }

    /// Indirect light of the pixel's base and lobe; `total` is the number of all directions.
    fn indirect(&self, total: f32) -> Vec3 {
        let (base, lobe) = (&self.common, &self.lobe);
        let mean = Vec3::select(lobe.weight.cmpgt(Vec3::ZERO), lobe.indirect / lobe.weight, Vec3::ZERO);
        quotient(base.indirect, base.weight) * (base.gathered / total) + mean * (lobe.gathered / total)
    }

    /// Radiance without emission. Emission has no error except at edges, and would hide the error of the rest.
    fn reflected(&self, total: f32) -> Vec3 {
        (self.common.direct + self.rare.caustics) / total + self.indirect(total)
    }

    /// How much of the pixel the shadow hides. Noise and far shadows below `UNSEEN` leave no trace.
    fn shadow(&self, total: f32) -> f32 {
        let RarePixel { ground, light, open, .. } = self.rare;
        let taken = if open > 0.0 { 1.0 - light / open } else { 0.0 };
        ground / total * ((taken - UNSEEN) / (1.0 - UNSEEN)).max(0.0)
    }
}

/// Adds the floats of one pixel to those of another.
fn add<T: Pod>(sums: &mut T, more: &T) {
    let (sums, more): (&mut [f32], &[f32]) = (cast_slice_mut(from_mut(sums)), cast_slice(from_ref(more)));
    sums.iter_mut().zip(more).for_each(|(sum, value)| *sum += value);
}

/// The share of the ground's light below which its shadow is not shown.
const UNSEEN: f32 = 0.01;

fn quotient(sum: Vec3, by: f32) -> Vec3 {
    if by > 0.0 { sum / by } else { Vec3::ZERO }
}

impl BlockLight<'_> {
    fn pixel(&self, i: usize) -> Pixel {
        let Self { g_buffer, gathered, .. } = self;
        let n = self.directions as f32;
        let emission = n * g_buffer.emission[i].truncate();
        if g_buffer.emission[i].w == 0.0 {
            return Pixel { emission, ..Pixel::default() };
        }
        let albedo = g_buffer.albedo[i].truncate();
        let gloss = g_buffer.gloss.get(i).copied().unwrap_or_default();
        let all = albedo + gloss.throughput * gloss.lobe_share();
        Pixel {
            indirect: albedo * gathered[i].truncate(),
            weight: gathered[i].w,
            gathered: if g_buffer.normal[i].truncate() == Vec3::ZERO { 0.0 } else { n },
            direct: n * albedo * self.direct[i] / PI + self.of_lobes(0, i),
            photon_map: n * all * self.photon_map[i].truncate() / PI,
            coverage: n,
            emission,
            depth: n * g_buffer.emission[i].w,
            albedo: n * all,
            normal: n * g_buffer.normal[i].truncate(),
            position: n * g_buffer.position[i].truncate(),
        }
    }

    /// What the lobes reflect of lights (0) or caustics (1).
    fn of_lobes(&self, part: usize, i: usize) -> Vec3 {
        let light = self.lobes.and_then(|sums| sums.direct[part].get(i));
        light.map_or(Vec3::ZERO, |&light| self.directions as f32 * self.g_buffer.gloss[i].throughput * light)
    }

    /// Whether the scene has sums of [`RarePixel`].
    fn has_rare(&self) -> bool {
        let caustics = !self.caustics.is_empty() || self.lobes.is_some_and(|sums| !sums.direct[1].is_empty());
        caustics || self.environment || !self.ground.is_empty()
    }

    fn rare_pixel(&self, i: usize) -> RarePixel {
        let (g_buffer, n) = (self.g_buffer, self.directions as f32);
        if g_buffer.emission[i].w == 0.0 {
            let lights = self.ground.get(i).copied().flatten();
            let [light, open] = lights.map_or([0.0; 2], |lights| lights.map(|light| n * light));
            let (ground, environment) = (if open > 0.0 { n } else { 0.0 }, n * g_buffer.emission[i].truncate());
            return RarePixel { environment, ground, light, open, ..RarePixel::default() };
        }
        let irradiance = self.caustics.get(i).copied().unwrap_or_default();
        let caustics = n * g_buffer.albedo[i].truncate() * irradiance / PI + self.of_lobes(1, i);
        RarePixel { caustics, ..RarePixel::default() }
    }

    /// `sums` are those of the block.
    fn lobe_pixel(&self, sums: &LobeSums, i: usize) -> LobePixel {
        let gloss = &self.g_buffer.gloss[i];
        LobePixel {
            indirect: gloss.throughput * gloss.lobe_share() * sums.lobes[i].truncate(),
            weight: if gloss.counts { sums.weights[i].truncate() } else { Vec3::ZERO },
            gathered: if gloss.counts { self.directions as f32 } else { 0.0 },
        }
    }
}

impl Film {
    /// Bytes of so many pixels, in a scene with gloss or without, and with sums that few scenes have or without.
    pub fn bytes(pixels: usize, glossy: bool, rare: bool) -> usize {
        let lobes = if glossy { size_of::<LobePixel>() } else { 0 };
        let rare = if rare { size_of::<RarePixel>() } else { 0 };
        (size_of::<Pixel>() + rare + lobes) * pixels
    }

    /// The sums of one block, in the memory of a `spare` film if there is one: fresh memory costs as much time as its content.
    pub fn of_block(size: [u32; 2], block: &BlockLight, spare: Option<Self>) -> Self {
        let size = size.map(|side| side as usize);
        let (mut pixels, mut rare, mut lobes) = spare.map_or_else(Default::default, |film| (film.pixels, film.rare, film.lobes));
        let all = || (0..size[0] * size[1]).into_par_iter().map(|i| from_below(size, i));
        all().map(|i| block.pixel(i)).collect_into_vec(&mut pixels);
        if block.has_rare() {
            all().map(|i| block.rare_pixel(i)).collect_into_vec(&mut rare);
        }
        if let Some(sums) = block.lobes {
            all().map(|i| block.lobe_pixel(sums, i)).collect_into_vec(&mut lobes);
        }
        Self { size, directions: block.directions, pixels, rare, lobes }
    }

    /// Adds the sums of one block, as [`Sum::add`] adds a film of them.
    pub fn add_block(&mut self, block: &BlockLight) {
        let size = self.size;
        self.directions += block.directions;
        let each = |i: usize| from_below(size, i);
        self.pixels.par_iter_mut().enumerate().for_each(|(i, pixel)| add(pixel, &block.pixel(each(i))));
        self.rare.par_iter_mut().enumerate().for_each(|(i, pixel)| add(pixel, &block.rare_pixel(each(i))));
        if let Some(sums) = block.lobes {
            self.lobes.par_iter_mut().enumerate().for_each(|(i, pixel)| add(pixel, &block.lobe_pixel(sums, each(i))));
        }
    }

    /// The inverse of [`Planes::planes`]; `None` if the number of floats does not fit `size`.
    pub fn of_planes(size: [u32; 2], directions: u32, planes: &[&[f32]]) -> Option<Self> {
        let [pixels, rare, lobes] = planes else { return None };
        let size = size.map(|side| side as usize);
        let pixels: Vec<Pixel> = bytemuck::try_cast_slice(pixels).ok()?.to_vec();
        let rare: Vec<RarePixel> = bytemuck::try_cast_slice(rare).ok()?.to_vec();
        let lobes: Vec<LobePixel> = bytemuck::try_cast_slice(lobes).ok()?.to_vec();
        let fits = |count: usize| [0, pixels.len()].contains(&count);
        let fits = pixels.len() == size[0] * size[1] && fits(rare.len()) && fits(lobes.len());
        fits.then_some(Self { size, directions, pixels, rare, lobes })
    }

    fn at(&self, pixel: usize) -> PixelSums {
        PixelSums {
            common: self.pixels[pixel],
            rare: self.rare.get(pixel).copied().unwrap_or_default(),
            lobe: self.lobes.get(pixel).copied().unwrap_or_default(),
        }
    }
}

/// The GL side counts rows from the bottom: its number of pixel `i`.
fn from_below([width, height]: [usize; 2], i: usize) -> usize {
    (height - 1 - i / width) * width + i % width
}

impl Sum for Film {
    fn add(&mut self, later: &Self) {
        self.directions += later.directions;
        self.pixels.par_iter_mut().zip(&later.pixels).for_each(|(sums, more)| add(sums, more));
        self.rare.par_iter_mut().zip(&later.rare).for_each(|(sums, more)| add(sums, more));
        self.lobes.par_iter_mut().zip(&later.lobes).for_each(|(sums, more)| add(sums, more));
    }
}

impl Planes for Film {
    fn planes(&self) -> Vec<&[f32]> {
        vec![cast_slice(&self.pixels), cast_slice(&self.rare), cast_slice(&self.lobes)]
    }
}

/// The films of all blocks so far.
pub type FilmSum = PairwiseSum<Film>;

/// Pixels that a task takes at a time.
const TASK: usize = 4096;

impl FilmSum {
    /// Adds a block of a picture of this `size`.
    ///
    /// # Panics
    /// If the block is in the sum already.
    pub fn add_block(&mut self, index: u32, size: [u32; 2], block: &BlockLight) {
        self.insert_with(index, |film| film.add_block(block), |spare| Film::of_block(size, block, spare));
    }

    /// The films, each of later blocks than those before it.
    fn films(&self) -> impl DoubleEndedIterator<Item = &Film> {
        self.nodes().iter().map(|node| &node.sum)
    }

    /// The sums of a pixel in two parts: the halves of a complete tree, else its first node and the rest. The sum of all blocks is the first plus the
    /// second, as in [`PairwiseSum::total`].
    fn halves(&self, pixel: usize) -> [PixelSums; 2] {
        let mut films = self.films();
        let Some(earlier) = films.next() else { return [PixelSums::default(); 2] };
        let later = films.rev().map(|film| film.at(pixel)).reduce(|later, mut sums| {
            sums.add(&later);
            sums
        });
        [earlier.at(pixel), later.unwrap_or_default()]
    }

    /// The numbers of directions of [`Self::halves`].
    fn directions(&self) -> [u32; 2] {
        let mut films = self.films().map(|film| film.directions);
        [films.next().unwrap_or_default(), films.sum()]
    }

    /// The picture of all blocks, black before the first. Its channels are means: `R G B` radiance = `Emission` (with the environment) + `Direct` +
    /// `Indirect` + `Caustics`; `A` coverage by surfaces; `Environment` its part of the emission, if there is some; `Shadow` how much of the pixel the
    /// shadow on the ground hides, if there is a ground; `PhotonMap` the radiance of the photon map without emission; `Albedo`; and averaged over the
    /// covered part of the pixel, in world space, the normal `N`, the position `P`, relative to [`UnitSpace::local_origin`], and the distance along the view
    /// axis `Z`. From two blocks on `Error` is the standard error of the mean.
    pub fn image(&self, size: [u32; 2], space: &UnitSpace) -> Image {
        let [width, height] = size.map(|side| side as usize);
        let parts = self.directions();
        let total = parts.iter().sum::<u32>().max(1) as f32;
        let is_any = |is: fn(&RarePixel) -> bool| self.films().any(|film| film.rare.par_iter().any(is));
        let environment = is_any(|pixel| pixel.environment != Vec3::ZERO);
        let (ground, error) = (is_any(|pixel| pixel.ground > 0.0), self.nodes().len() > 1);
        let origin = space.local_origin();
        let local = |position: Vec3| (space.to_world(position) - origin).as_vec3();

        let rgb = |name: &str| ["R", "G", "B"].map(|of| format!("{name}{of}"));
        let xyz = |name: &str| ["X", "Y", "Z"].map(|of| format!("{name}.{of}"));
        let mut names: Vec<String> = ["", "Direct.", "Indirect.", "Caustics.", "Emission."].into_iter().flat_map(rgb).collect();
        names.extend(["Environment."].into_iter().filter(|_| environment).flat_map(rgb));
        names.extend(["PhotonMap.", "Albedo."].into_iter().flat_map(rgb).chain(["N", "P"].into_iter().flat_map(xyz)));
        names.extend(["A", "Shadow", "Z"].into_iter().filter(|&name| ground || name != "Shadow").map(str::to_owned));
        names.extend(["Error."].into_iter().filter(|_| error).flat_map(rgb));

        let channel = |name| Channel { name, samples: vec![0.0; width * height] };
        let mut channels: Vec<Channel> = names.into_iter().map(channel).collect();
        let mut tasks: Vec<Vec<&mut [f32]>> = (0..(width * height).div_ceil(TASK)).map(|_| Vec::new()).collect();
        for channel in &mut channels {
            tasks.iter_mut().zip(channel.samples.chunks_mut(TASK)).for_each(|(task, samples)| task.push(samples));
        }
        let fill = |(task, mut samples): (usize, Vec<&mut [f32]>)| {
            for place in 0..samples[0].len() {
                let halves = self.halves(task * TASK + place);
                let mut sums = halves[0];
                // Not with one block: a zero added to a negative zero would change its sign.
                if error {
                    sums.add(&halves[1]);
                }
                let (p, indirect) = (&sums.common, sums.indirect(total));
                let mut channels = samples.iter_mut();
                let mut put = |value: f32| channels.next().expect("each value has its channel")[place] = value;
                let mut put3 = |value: Vec3| value.to_array().into_iter().for_each(&mut put);
                put3((p.emission + p.direct + sums.rare.caustics) / total + indirect);
                put3(p.direct / total);
                put3(indirect);
                put3(sums.rare.caustics / total);
                put3(p.emission / total);
                if environment {
                    put3(sums.rare.environment / total);
                }
                put3(p.photon_map / total);
                put3(p.albedo / total);
                put3(p.normal.normalize_or_zero());
                put3(if p.coverage > 0.0 { local(quotient(p.position, p.coverage)) } else { Vec3::ZERO });
                put(p.coverage / total);
                if ground {
                    put(sums.shadow(total));
                }
                put(space.length_to_world(quotient(Vec3::splat(p.depth), p.coverage).x));
                if error {
                    standard_error(&halves, parts).to_array().into_iter().for_each(put);
                }
            }
        };
        if self.nodes().is_empty() {
            // Black also where a mean of nothing would not be.
            tasks.clear();
        }
        tasks.into_par_iter().enumerate().for_each(fill);
        Image { width, height, channels }
    }

    /// Standard error of the mean of reflected radiance, root mean square over the pixels, relative to the picture's mean. `None` for fewer than two
    /// blocks or a black picture. It follows from two runs of consecutive directions; low-discrepancy sequences spread each as evenly as the whole.
    pub fn error(&self) -> Option<f64> {
        let (first, parts) = (self.films().next().filter(|_| self.nodes().len() > 1)?, self.directions());
        let of = |pixel: usize| {
            let halves = self.halves(pixel);
            let square = f64::from(standard_error(&halves, parts).length_squared());
            [square, halves[0].reflected(parts[0].max(1) as f32).element_sum().into()].map(|value| value / 3.0)
        };
        let add = |[squares, sum]: [f64; 2], [square, value]: [f64; 2]| [squares + square, sum + value];
        let pixels: Vec<usize> = (0..first.pixels.len()).step_by(TASK).collect();
        let of_task = |&start: &usize| (start..(start + TASK).min(first.pixels.len())).map(of).fold([0.0; 2], add);
        // In order, so that the sum has the same bits on any number of cores.
        let sums: Vec<[f64; 2]> = pixels.par_iter().map(of_task).collect();
        let ([squares, sum], count) = (sums.into_iter().fold([0.0; 2], add), first.pixels.len() as f64);
        (sum > 0.0).then(|| (squares / count).sqrt() / (sum / count))
    }
}

/// Standard error of the reflected radiance of a pixel. If parts of n and m directions have independent errors and differ by δ, the error of the
/// whole is δ √(n m) / (n + m). Low-discrepancy directions have less, because errors of the parts then cancel in part.
fn standard_error([a, b]: &[PixelSums; 2], directions: [u32; 2]) -> Vec3 {
    let [n, m] = directions.map(|directions| directions.max(1) as f32);
    (a.reflected(n) - b.reflected(m)).abs() * (n * m).sqrt() / (n + m)
}
