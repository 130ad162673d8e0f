//! The film: sums over blocks of directions at each pixel, and the picture that their means make.
//!
//! Each block has its own sub-pixel offset, so a pixel sums radiance and not irradiance. Over all blocks, each of n directions,
//! Indirect = fraction of directions with a point × Σ albedo (Σ L w) / Σ w. Other quantities are Σ n value / Σ n. [`PairwiseSum`] adds films.

use std::f32::consts::PI;

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
    caustics: Vec3,
    photon_map: Vec3,
    coverage: f32,
    emission: Vec3,
    /// The part of the emission that is the environment behind the scene.
    environment: Vec3,
    /// Of the ground that catches the shadow: its coverage, its light, and the light that it would have without the scene.
    ground: f32,
    light: f32,
    open: f32,
    depth: f32,
    albedo: Vec3,
    normal: Vec3,
    position: Vec3,
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

/// What the lobes of a block's pixels reflect, row by row from the bottom.
pub struct LobeSums {
    /// rgb: Σ radiance × weight, over what the lobe reflects of even light.
    pub lobes: Vec<Vec4>,
    /// rgb: Σ weight, over the same.
    pub weights: Vec<Vec4>,
    /// Radiance that comes from lights and caustics, without the path's throughput.
    pub direct: [Vec<Vec3>; 2],
}

impl LobePixel {
    fn indirect(&self, total: f32) -> Vec3 {
        let mean = Vec3::select(self.weight.cmpgt(Vec3::ZERO), self.indirect / self.weight, Vec3::ZERO);
        mean * (self.gathered / total)
    }
}

impl Pixel {
    fn indirect(&self, total: f32) -> Vec3 {
        quotient(self.indirect, self.weight) * (self.gathered / total)
    }

    /// How much of the pixel the shadow hides. Noise and far shadows below `UNSEEN` leave no trace.
    fn shadow(&self, total: f32) -> f32 {
        let taken = if self.open > 0.0 { 1.0 - self.light / self.open } else { 0.0 };
        self.ground / total * ((taken - UNSEEN) / (1.0 - UNSEEN)).max(0.0)
    }
}

/// The share of the ground's light below which its shadow is not shown.
const UNSEEN: f32 = 0.01;

fn quotient(sum: Vec3, by: f32) -> Vec3 {
    if by > 0.0 { sum / by } else { Vec3::ZERO }
}

impl Film {
    /// Bytes of so many pixels, in a scene with gloss or without.
    pub fn bytes(pixels: usize, glossy: bool) -> usize {
        (size_of::<Pixel>() + if glossy { size_of::<LobePixel>() } else { 0 }) * pixels
    }

    /// A film of no blocks.
    pub fn empty(size: [u32; 2]) -> Self {
        let [width, height] = size.map(|side| side as usize);
        Self { size: [width, height], directions: 0, pixels: vec![Pixel::default(); width * height], lobes: Vec::new() }
    }

    /// The sums of one block of `directions`. `direct` is the irradiance from the lights, `photon_map` that of the photon map, `caustics` that of
    /// caustics, and `gathered` the sums of the gather. `ground`: the light of pixels that see the ground, and what it would be without the scene.
    /// `lobes`: in scenes with gloss.
    pub fn of_block(
        size: [u32; 2],
        g_buffer: &GBuffer,
        [direct, caustics]: [&[Vec3]; 2],
        photon_map: &[Vec4],
        ground: &[Option<[f32; 2]>],
        (gathered, directions): (&[Vec4], u32),
        lobes: Option<&LobeSums>,
    ) -> Self {
        let [width, height] = size.map(|side| side as usize);
        let n = directions as f32;
        // The GL side counts rows from the bottom.
        let from_below = |i: usize| (height - 1 - i / width) * width + i % width;
        let lobe_pixel = |sums: &LobeSums, i: usize| {
            let gloss = &g_buffer.gloss[i];
            LobePixel {
                indirect: gloss.throughput * gloss.lobe_share() * sums.lobes[i].truncate(),
                weight: if gloss.counts { sums.weights[i].truncate() } else { Vec3::ZERO },
                gathered: if gloss.counts { n } else { 0.0 },
            }
        };
        let pixel = |i: usize| {
            let i = from_below(i);
            let emission = n * g_buffer.emission[i].truncate();
            if g_buffer.emission[i].w == 0.0 {
                let [light, open] = ground.get(i).copied().flatten().map_or([0.0; 2], |lights| lights.map(|light| n * light));
                let ground = if open > 0.0 { n } else { 0.0 };
                return Pixel { emission, environment: emission, ground, light, open, ..Pixel::default() };
            }
            let albedo = g_buffer.albedo[i].truncate();
            let gloss = g_buffer.gloss.get(i).copied().unwrap_or_default();
            let all = albedo + gloss.throughput * gloss.lobe_share();
            let [lights, focused] =
                lobes.map_or([Vec3::ZERO; 2], |sums| [0, 1].map(|part| n * gloss.throughput * sums.direct[part][i]));
            Pixel {
                indirect: albedo * gathered[i].truncate(),
                weight: gathered[i].w,
                gathered: if g_buffer.normal[i].truncate() == Vec3::ZERO { 0.0 } else { n },
                direct: n * albedo * direct[i] / PI + lights,
                caustics: n * albedo * caustics[i] / PI + focused,
                photon_map: n * all * photon_map[i].truncate() / PI,
                coverage: n,
                emission,
                depth: n * g_buffer.emission[i].w,
                albedo: n * all,
                normal: n * g_buffer.normal[i].truncate(),
                position: n * g_buffer.position[i].truncate(),
                ..Pixel::default()
            }
        };
        let all = || (0..width * height).into_par_iter();
        let lobes = lobes.map_or_else(Vec::new, |sums| all().map(|i| lobe_pixel(sums, from_below(i))).collect());
        Self { size: [width, height], directions, pixels: all().map(pixel).collect(), lobes }
    }

    /// The inverse of [`Planes::planes`]; `None` if the number of floats does not fit `size`.
    pub fn of_planes(size: [u32; 2], directions: u32, planes: &[&[f32]]) -> Option<Self> {
        let (pixels, lobes): (&[f32], &[f32]) = match planes {
            [pixels] => (pixels, &[]),
            [pixels, lobes] => (pixels, lobes),
            _ => return None,
        };
        let [width, height] = size.map(|side| side as usize);
        let pixels: Vec<Pixel> = bytemuck::try_cast_slice(pixels).ok()?.to_vec();
        let lobes: Vec<LobePixel> = bytemuck::try_cast_slice(lobes).ok()?.to_vec();
        let fits = pixels.len() == width * height && [0, pixels.len()].contains(&lobes.len());
        fits.then_some(Self { size: [width, height], directions, pixels, lobes })
    }

    /// Radiance of a pixel without emission. Emission has no error except at edges, and would hide the error of the rest.
    fn reflected(&self, pixel: usize) -> Vec3 {
        let p = &self.pixels[pixel];
        let total = self.directions.max(1) as f32;
        (p.direct + p.caustics) / total + self.indirect(pixel, total)
    }

    /// Indirect light of a pixel's base and lobe.
    fn indirect(&self, pixel: usize, total: f32) -> Vec3 {
        let base = self.pixels[pixel].indirect(total);
        self.lobes.get(pixel).map_or(base, |lobe| base + lobe.indirect(total))
    }

    /// The means, as channels: `R G B` radiance = `Emission` (with the environment) + `Direct` + `Indirect` + `Caustics`; `A` coverage by
    /// surfaces; `Environment` its part of the emission, if there is some; `Shadow` how much of the pixel the shadow on the ground hides, if there is a
    /// ground; `PhotonMap` the radiance of the photon map without emission; `Albedo`; and averaged over the covered part of the pixel, in world
    /// space, the normal `N`, the position `P`, relative to [`UnitSpace::local_origin`], and the distance along the view axis `Z`.
    pub fn image(&self, space: &UnitSpace) -> Image {
        let total = self.directions.max(1) as f32;
        let indirect: Vec<Vec3> = (0..self.pixels.len()).into_par_iter().map(|pixel| self.indirect(pixel, total)).collect();
        let seen = |p: &Pixel, value: Vec3| if p.coverage > 0.0 { value } else { Vec3::ZERO };
        let origin = space.local_origin();
        let local = |position: Vec3| (space.to_world(position) - origin).as_vec3();

        let [width, height] = self.size;
        let mut image = Image { width, height, channels: Vec::new() };
        let mut push = |name: &str, value: &(dyn Fn(usize, &Pixel) -> f32 + Sync)| {
            let samples = self.pixels.par_iter().enumerate().map(|(i, p)| value(i, p)).collect();
            image.channels.push(Channel { name: name.to_owned(), samples });
        };
        let mut push3 = |names: [&str; 3], value: &(dyn Fn(usize, &Pixel) -> Vec3 + Sync)| {
            for (k, name) in names.into_iter().enumerate() {
                push(name, &|i, p| value(i, p)[k]);
            }
        };
        push3(["R", "G", "B"], &|i, p| (p.emission + p.direct + p.caustics) / total + indirect[i]);
        push3(["Direct.R", "Direct.G", "Direct.B"], &|_, p| p.direct / total);
        push3(["Indirect.R", "Indirect.G", "Indirect.B"], &|i, _| indirect[i]);
        push3(["Caustics.R", "Caustics.G", "Caustics.B"], &|_, p| p.caustics / total);
        push3(["Emission.R", "Emission.G", "Emission.B"], &|_, p| p.emission / total);
        if self.pixels.par_iter().any(|p| p.environment != Vec3::ZERO) {
            push3(["Environment.R", "Environment.G", "Environment.B"], &|_, p| p.environment / total);
        }
        push3(["PhotonMap.R", "PhotonMap.G", "PhotonMap.B"], &|_, p| p.photon_map / total);
        push3(["Albedo.R", "Albedo.G", "Albedo.B"], &|_, p| p.albedo / total);
        push3(["N.X", "N.Y", "N.Z"], &|_, p| p.normal.normalize_or_zero());
        push3(["P.X", "P.Y", "P.Z"], &|_, p| seen(p, local(quotient(p.position, p.coverage))));
        push("A", &|_, p| p.coverage / total);
        if self.pixels.par_iter().any(|p| p.ground > 0.0) {
            push("Shadow", &|_, p| p.shadow(total));
        }
        push("Z", &|_, p| space.length_to_world(quotient(Vec3::splat(p.depth), p.coverage).x));
        image
    }
}

impl Sum for Film {
    fn add(&mut self, later: &Self) {
        self.directions += later.directions;
        let add = |sums: &mut [f32], more: &[f32]| sums.par_iter_mut().zip(more).for_each(|(sum, value)| *sum += value);
        add(cast_slice_mut(&mut self.pixels), cast_slice(&later.pixels));
        add(cast_slice_mut(&mut self.lobes), cast_slice(&later.lobes));
    }
}

impl Planes for Film {
    fn planes(&self) -> Vec<&[f32]> {
        let lobes = (!self.lobes.is_empty()).then(|| cast_slice(&self.lobes));
        [cast_slice(&self.pixels)].into_iter().chain(lobes).collect()
    }
}

/// The films of all blocks so far.
pub type FilmSum = PairwiseSum<Film>;

impl FilmSum {
    /// The picture of all blocks, black before the first. From two blocks on it has the channel `Error`, the standard error of the mean.
    pub fn image(&self, size: [u32; 2], space: &UnitSpace) -> Image {
        let mut image = self.total().unwrap_or_else(|| Film::empty(size)).image(space);
        let Some((earlier, later)) = self.halves() else { return image };
        for (k, name) in ["Error.R", "Error.G", "Error.B"].into_iter().enumerate() {
            let error = |pixel| standard_error(earlier, &later, pixel)[k];
            let samples = (0..earlier.pixels.len()).into_par_iter().map(error).collect();
            image.channels.push(Channel { name: name.to_owned(), samples });
        }
        image
    }

    /// Standard error of the mean of reflected radiance, root mean square over the pixels, relative to the picture's mean. `None` for fewer than two
    /// blocks or a black picture. It follows from two runs of consecutive directions; low-discrepancy sequences spread each as evenly as the whole.
    pub fn error(&self) -> Option<f64> {
        let (earlier, later) = self.halves()?;
        let (mut squares, mut sum) = (0.0, 0.0);
        for pixel in 0..earlier.pixels.len() {
            squares += f64::from(standard_error(earlier, &later, pixel).length_squared()) / 3.0;
            sum += f64::from(earlier.reflected(pixel).element_sum()) / 3.0;
        }
        let count = earlier.pixels.len() as f64;
        (sum > 0.0).then(|| (squares / count).sqrt() / (sum / count))
    }
}

/// Standard error of the reflected radiance of a pixel. If parts of n and m directions have independent errors and differ by δ, the error of the
/// whole is δ √(n m) / (n + m). Low-discrepancy directions have less, because errors of the parts then cancel in part.
fn standard_error(a: &Film, b: &Film, pixel: usize) -> Vec3 {
    let (n, m) = (a.directions as f32, b.directions as f32);
    (a.reflected(pixel) - b.reflected(pixel)).abs() * (n * m).sqrt() / (n + m)
}
