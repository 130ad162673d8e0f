//! The passes over hits that a bake adds up, and what their sums make. Mirrors `glsl/hemisphere.frag` and `glsl/harmonics.frag`.

use std::f32::consts::{PI, TAU};

use glam::{Vec3, Vec4};
use rayon::prelude::*;

use super::vertex_cache::CachedValues;
use crate::blocks::{Planes, Sum};
use crate::error::Result;
use crate::gather::{Beyond, Hits};
use crate::geometry::Geometry;
use crate::gpu::{Gpu, Program, Uniform};
use crate::harmonics::cosine_lobe;
use crate::image::Channel;
use crate::photon::PhotonTexture;
use crate::points::{GatherPoint, PointList, Points, Sums};
use crate::quantity::Quantity;
use crate::shaders;

/// Four floats each; the least number of targets that OpenGL 3.3 promises.
const TARGETS: usize = 8;
/// Of `glsl/hemisphere.frag`: reflected, sky, open, counts.
const HEMISPHERE: usize = 4;

/// What to add up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wanted {
    /// Radiance of surfaces.
    pub radiance: bool,
    /// Incident radiance and transfer as spherical harmonics.
    pub sh: bool,
    pub prt: bool,
    /// Bands of both.
    pub order: usize,
}

impl Wanted {
    fn targets(&self) -> usize {
        (3 * self.order * self.order).div_ceil(4)
    }

    fn planes(&self) -> usize {
        HEMISPHERE + self.targets() * (usize::from(self.sh) + usize::from(self.prt))
    }

    /// Bytes for a point and so many copies of its sums.
    pub fn bytes(&self, copies: usize) -> usize {
        size_of::<[Vec4; 2]>() + copies * self.planes() * size_of::<Vec4>()
    }
}

/// What hits send back.
#[derive(Clone, Copy)]
pub enum Rough<'a> {
    /// Nothing.
    Black,
    Photons(&'a PhotonTexture),
    Gathered(&'a CachedValues),
}

/// What a pass over hits reads.
#[derive(Clone, Copy)]
pub struct Seen<'a> {
    pub geometry: &'a Geometry,
    pub hits: Hits<'a>,
    pub beyond: &'a Beyond,
    pub points: Points<'a>,
    /// Radiance of hits.
    pub rough: Rough<'a>,
    /// Transfer of hits; black without.
    pub transfer: Option<&'a CachedValues>,
    /// In unit space, beyond which a hit leaves a point open.
    pub open_distance: f32,
}

/// The programs, for one kind of radiance and transfer.
pub struct Integrals {
    wanted: Wanted,
    hemisphere: Program,
    sh: Vec<Program>,
    prt: Vec<Program>,
}

/// Some of the points, with their sums.
pub struct Tile {
    pub list: PointList,
    hemisphere: Sums,
    sh: Vec<Sums>,
    prt: Vec<Sums>,
}

impl Tile {
    pub fn clear(&self) {
        [&self.hemisphere].into_iter().chain(&self.sh).chain(&self.prt).for_each(Sums::clear);
    }
}

/// Sums of points, in their order.
#[derive(Clone, Debug, Default)]
pub struct Values {
    /// rgb: Σ radiance of surfaces × w; a: Σ w.
    reflected: Vec<Vec4>,
    /// rgb: Σ radiance of the environment × w; a: Σ w of what leaves the scene.
    sky: Vec<Vec4>,
    /// xyz: Σ direction × w of what is open; a: Σ w.
    open: Vec<Vec4>,
    /// Σ w of hits from behind, number of directions in the hemisphere.
    counts: Vec<Vec4>,
    /// Coefficients of each point, padded to whole targets.
    sh: Vec<Vec<Vec4>>,
    prt: Vec<Vec<Vec4>>,
}

impl Integrals {
    /// With albedo textures or without, and for the kinds of radiance and transfer that will be given.
    pub fn new(gpu: &Gpu, wanted: Wanted, textured: bool, gathered: bool, transfer: bool) -> Result<Self> {
        let textured = textured.then(|| "TEXTURED".to_owned());
        let gathered = gathered.then(|| "GATHERED".to_owned());
        let radiance = wanted.radiance.then(|| "RADIANCE".to_owned());
        let harmonics = |defines: Vec<String>| {
            let passes = wanted.targets().div_ceil(TARGETS);
            let program = |pass| {
                let own = [format!("ORDER {}", wanted.order), format!("PASS {pass}")];
                Program::with(gpu, &shaders::HARMONICS, &[&own[..], &defines].concat())
            };
            (0..passes).map(program).collect::<Result<Vec<_>>>()
        };
        let of_radiance: Vec<String> = textured.iter().chain(&gathered).cloned().collect();
        let of_transfer = ["TRANSFER".to_owned()].into_iter().chain(textured.clone());
        let of_transfer: Vec<String> = of_transfer.chain(transfer.then(|| "GATHERED".to_owned())).collect();
        Ok(Self {
            wanted,
            hemisphere: Program::with(gpu, &shaders::HEMISPHERE, &[&of_radiance[..], radiance.as_slice()].concat())?,
            sh: if wanted.sh { harmonics(of_radiance)? } else { Vec::new() },
            prt: if wanted.prt { harmonics(of_transfer)? } else { Vec::new() },
        })
    }

    /// Sums for `points`, to be cleared first.
    pub fn tile(&self, gpu: &Gpu, points: &[GatherPoint]) -> Result<Tile> {
        let list = PointList::upload(gpu, points)?;
        let size = list.points().size();
        let sums = |programs: &[Program]| {
            let targets = |pass: usize| (self.wanted.targets() - TARGETS * pass).min(TARGETS);
            (0..programs.len()).map(|pass| Sums::several(gpu, size, targets(pass))).collect::<Result<Vec<_>>>()
        };
        Ok(Tile { hemisphere: Sums::several(gpu, size, HEMISPHERE)?, sh: sums(&self.sh)?, prt: sums(&self.prt)?, list })
    }

    /// Adds what the points of a tile see.
    pub fn add(&self, tile: &Tile, seen: &Seen) {
        let own = [("open_distance", Uniform::Float(seen.open_distance))];
        let photons = match seen.rough {
            Rough::Photons(photons) => photons.uniforms().to_vec(),
            Rough::Gathered(cached) => cached.uniforms().to_vec(),
            Rough::Black => Vec::new(),
        };
        let transfer = seen.transfer.map_or(Vec::new(), |cached| cached.uniforms().to_vec());
        let common = [&own[..], &seen.geometry.uniforms(), &seen.hits.uniforms(), &seen.beyond.uniforms()].concat();
        let of_radiance = [&common[..], &photons].concat();
        let of_transfer = [&common[..], &transfer].concat();
        tile.hemisphere.add(seen.points, &self.hemisphere, &of_radiance);
        let passes = |programs: &[Program], sums: &[Sums], uniforms: &[_]| {
            programs.iter().zip(sums).for_each(|(program, sums)| sums.add(seen.points, program, uniforms));
        };
        passes(&self.sh, &tile.sh, &of_radiance);
        passes(&self.prt, &tile.prt, &of_transfer);
    }

    /// Reads the sums of a tile and puts them behind `values`.
    pub fn read(&self, tile: &Tile, values: &mut Values) {
        let read = |sums: &Sums, index| tile.list.in_order(sums.read_one(index));
        let all = [&mut values.reflected, &mut values.sky, &mut values.open, &mut values.counts];
        for (index, values) in all.into_iter().enumerate() {
            values.extend(read(&tile.hemisphere, index));
        }
        let harmonics = |sums: &[Sums], values: &mut Vec<Vec<Vec4>>| {
            if !sums.is_empty() {
                values.resize(self.wanted.targets(), Vec::new());
                for (target, values) in values.iter_mut().enumerate() {
                    values.extend(read(&sums[target / TARGETS], target % TARGETS));
                }
            }
        };
        harmonics(&tile.sh, &mut values.sh);
        harmonics(&tile.prt, &mut values.prt);
    }
}

impl Sum for Values {
    fn add(&mut self, later: &Self) {
        for (plane, later) in self.all_mut().zip(later.all()) {
            plane.par_iter_mut().zip(later).for_each(|(sum, later)| *sum += *later);
        }
    }
}

impl Planes for Values {
    fn planes(&self) -> Vec<&[f32]> {
        self.all().map(|plane| bytemuck::cast_slice(plane)).collect()
    }
}

impl Values {
    /// Bytes of the sums of a point.
    pub fn bytes(wanted: &Wanted) -> usize {
        wanted.planes() * size_of::<Vec4>()
    }

    /// Of the floats of [`Planes::planes`] for so many points; `None` where they are others than were wanted.
    pub fn of_planes(wanted: &Wanted, points: usize, planes: &[&[f32]]) -> Option<Self> {
        let harmonics = |wanted_so: bool| vec![Vec::new(); if wanted_so { wanted.targets() } else { 0 }];
        let mut values = Self { sh: harmonics(wanted.sh), prt: harmonics(wanted.prt), ..Self::default() };
        if planes.len() != wanted.planes() {
            return None;
        }
        for (plane, floats) in values.all_mut().zip(planes) {
            // Floats lie more loosely than vectors.
            *plane = floats.len().is_multiple_of(4).then(|| bytemuck::pod_collect_to_vec(floats))?;
        }
        let whole = values.all().all(|plane| plane.len() == points);
        whole.then_some(values)
    }

    /// Puts those of further points behind.
    pub fn append(&mut self, further: &Self) {
        self.sh.resize(further.sh.len(), Vec::new());
        self.prt.resize(further.prt.len(), Vec::new());
        for (plane, further) in self.all_mut().zip(further.all()) {
            // There are few rounds, and much in each.
            plane.reserve_exact(further.len());
            plane.extend(further);
        }
    }

    fn all(&self) -> impl Iterator<Item = &Vec<Vec4>> {
        [&self.reflected, &self.sky, &self.open, &self.counts].into_iter().chain(&self.sh).chain(&self.prt)
    }

    fn all_mut(&mut self) -> impl Iterator<Item = &mut Vec<Vec4>> {
        let Self { reflected, sky, open, counts, sh, prt } = self;
        [reflected, sky, open, counts].into_iter().chain(sh).chain(prt)
    }

    /// For each point the share of its hemisphere in which it saw surfaces from behind.
    pub fn inside(&self) -> Vec<f32> {
        let share = |i: usize| self.counts[i].x / self.reflected[i].w.max(f32::MIN_POSITIVE);
        (0..self.reflected.len()).map(share).collect()
    }

    /// Irradiance by way of surfaces, and from the environment.
    pub fn irradiance(&self) -> impl Iterator<Item = [Vec3; 2]> {
        let mean = |sum: &Vec4, weight: f32| if weight > 0.0 { PI * sum.truncate() / weight } else { Vec3::ZERO };
        self.reflected.iter().zip(&self.sky).map(move |(reflected, sky)| [mean(reflected, reflected.w), mean(sky, reflected.w)])
    }

    /// The columns of a quantity; `direct` is irradiance from the lights.
    pub fn columns(&self, quantity: Quantity, order: usize, points: &[GatherPoint], direct: &[Vec3]) -> Vec<Channel> {
        let weight = |i: usize| self.reflected[i].w;
        let share = |sum: f32, i: usize| if weight(i) > 0.0 { sum / weight(i) } else { 0.0 };
        let names = quantity.columns(order);
        let value: Box<dyn Fn(usize) -> Vec<f32>> = match quantity {
            Quantity::Irradiance => {
                let parts: Vec<_> = self.irradiance().collect();
                Box::new(move |i| {
                    let [indirect, sky] = parts[i];
                    let direct = direct[i] + sky;
                    [direct + indirect, direct, indirect].iter().flat_map(Vec3::to_array).collect()
                })
            }
            Quantity::Ao => Box::new(|i| vec![share(self.open[i].w, i)]),
            Quantity::BentNormal => Box::new(|i| self.open[i].truncate().normalize_or(points[i].normal).to_array().to_vec()),
            Quantity::Sky => Box::new(|i| vec![share(self.sky[i].w, i)]),
            Quantity::Sh => Box::new(|i| {
                let solid_angle = if self.counts[i].y > 0.0 { TAU / self.counts[i].y } else { 0.0 };
                (0..names.len()).map(|k| self.sh[k / 4][i][k % 4] * solid_angle).collect()
            }),
            Quantity::Prt => Box::new(|i| (0..names.len()).map(|k| share(self.prt[k / 4][i][k % 4], i)).collect()),
            Quantity::PrtUnshadowed => {
                let coefficients = names.len() / 3;
                Box::new(move |i| cosine_lobe(points[i].normal).into_iter().take(coefficients).flat_map(|c| [c; 3]).collect())
            }
        };
        let mut columns: Vec<Channel> =
            names.iter().map(|name| Channel { name: name.clone(), samples: Vec::with_capacity(points.len()) }).collect();
        for i in 0..points.len() {
            columns.iter_mut().zip(value(i)).for_each(|(column, value)| column.samples.push(value));
        }
        columns
    }
}
