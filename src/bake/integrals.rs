//! The consumers of a bake, and the values that come from their sums. Mirrors `glsl/consumer/hemisphere.glsl` and `glsl/consumer/harmonics.glsl`.

use std::f32::consts::{PI, TAU};

use glam::{Vec3, Vec4};
use rayon::prelude::*;

use super::on_cpu::PacketTile;
use super::vertex_cache::CachedValues;
use crate::blocks::{Planes, Sum};
use crate::error::Result;
use crate::gather::{Found, GatherPass, MissRadiance};
use crate::geometry::Geometry;
use crate::gpu::{Gpu, Uniform};
use crate::harmonics::cosine_lobe;
use crate::image::Channel;
use crate::photon::PhotonTexture;
use crate::points::{Accumulator, GatherPoint, PointList, Points};
use crate::quantity::Quantity;
use crate::shaders::{Consumer, Finder, HarmonicsPass, HitRadiance};

/// Number of outputs of `glsl/consumer/hemisphere.glsl`: reflected, sky, open, counts.
pub const HEMISPHERE: usize = 4;

/// Which sums are needed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wanted {
    /// Radiance of surfaces.
    pub radiance: bool,
    /// Incident radiance (`sh`) and transfer (`prt`) as spherical harmonics.
    pub sh: bool,
    pub prt: bool,
    /// Bands of `sh` and `prt`.
    pub order: usize,
}

impl Wanted {
    fn planes(&self) -> usize {
        HEMISPHERE + HarmonicsPass::targets(self.order) * (usize::from(self.sh) + usize::from(self.prt))
    }
}

/// Source of the radiance that hits send back.
#[derive(Clone, Copy)]
pub enum SurfaceRadiance<'a> {
    Black,
    Photons(&'a PhotonTexture),
    Cached(&'a CachedValues),
}

pub struct IntegralInputs<'a> {
    pub geometry: &'a Geometry,
    /// Hits for [`Finder::Stored`].
    pub found: Found<'a>,
    pub miss: &'a MissRadiance,
    /// [`MissRadiance::whole`].
    pub whole_miss: &'a MissRadiance,
    pub points: Points<'a>,
    pub radiance: SurfaceRadiance<'a>,
    /// Transfer at hits. `None` is black.
    pub transfer: Option<&'a CachedValues>,
    /// In unit space. Hits beyond this distance leave a point open.
    pub open_distance: f32,
}

/// How sums are made, for one kind of radiance and transfer.
pub struct Integrals {
    /// Passes over stored hits. None if packets of rays make the sums.
    passes: Vec<IntegralPass>,
}

struct IntegralPass {
    pass: GatherPass,
    /// Number of outputs, of four floats each, that it adds to.
    outputs: usize,
    reads: PassInput,
}

/// What a pass takes from hits and misses.
#[derive(Clone, Copy)]
enum PassInput {
    /// Radiance. Direct light has the bright parts of the environment.
    Gathered,
    /// Radiance with all of the environment.
    Whole,
    Transfer,
}

/// Some of the points, with their sums.
pub struct Tile {
    pub list: PointList,
    pub packets: Option<PacketTile>,
    /// One accumulator for each pass.
    sums: Vec<Accumulator>,
}

impl Tile {
    pub fn clear(&mut self) {
        self.packets.iter_mut().for_each(PacketTile::clear);
        self.sums.iter().for_each(Accumulator::clear);
    }
}

/// Sums of points, in the order of the points.
#[derive(Clone, Debug, Default)]
pub struct Values {
    /// All outputs, for each point:
    /// - reflected (rgb: Σ radiance of surfaces × w; a: Σ w),
    /// - sky (rgb: Σ radiance of the environment × w; a: Σ w of misses),
    /// - open (xyz: Σ direction × w of open directions; a: their Σ w),
    /// - counts (Σ w of hits on back sides; number of directions in the hemisphere),
    /// - coefficients of incident radiance, if wanted, padded to whole outputs,
    /// - coefficients of transfer, in the same way.
    planes: Vec<Vec<Vec4>>,
}

impl Integrals {
    /// Sums that packets of rays make: see [`Plan::is_on_cpu`](super::Plan::is_on_cpu).
    pub fn of_packets() -> Self {
        Self { passes: Vec::new() }
    }

    /// Passes. `radiance`: of hits. `transfer`: hits have transfer.
    pub fn new(gpu: &Gpu, wanted: Wanted, radiance: HitRadiance, transfer: bool) -> Result<Self> {
        let pass =
            |consumer, outputs, reads| Ok(IntegralPass { pass: GatherPass::new(gpu, Finder::Stored, consumer)?, outputs, reads });
        let harmonics = |wanted_so: bool| HarmonicsPass::all(wanted.order).filter(move |_| wanted_so);
        let hemisphere = pass(Consumer::Hemisphere(wanted.radiance.then_some(radiance)), HEMISPHERE, PassInput::Gathered);
        let incident = |part| Consumer::IncidentHarmonics(radiance, part);
        let sh = harmonics(wanted.sh).map(|part| pass(incident(part), part.outputs(), PassInput::Whole));
        let textured = transfer.then_some(radiance.textured);
        let transfer = |part| Consumer::TransferHarmonics(textured, part);
        let prt = harmonics(wanted.prt).map(|part| pass(transfer(part), part.outputs(), PassInput::Transfer));
        Ok(Self { passes: [hemisphere].into_iter().chain(sh).chain(prt).collect::<Result<_>>()? })
    }

    /// Whether packets of rays make the sums.
    pub fn are_of_packets(&self) -> bool {
        self.passes.is_empty()
    }

    /// Sums for `points`. Clear them before use.
    pub fn tile(&self, gpu: &Gpu, points: &[GatherPoint]) -> Result<Tile> {
        let list = PointList::upload(gpu, points)?;
        let sums = self.passes.iter().map(|pass| Accumulator::several(gpu, list.points().size(), pass.outputs));
        Ok(Tile { sums: sums.collect::<Result<_>>()?, packets: self.are_of_packets().then(|| PacketTile::new(points)), list })
    }

    /// Adds hits by the passes.
    pub fn add(&self, tile: &Tile, inputs: &IntegralInputs) {
        let own = [("open_distance", Uniform::Float(inputs.open_distance))];
        let radiance = match inputs.radiance {
            SurfaceRadiance::Photons(photons) => photons.uniforms(),
            SurfaceRadiance::Cached(cached) => cached.uniforms().to_vec(),
            SurfaceRadiance::Black => Vec::new(),
        };
        let transfer = inputs.transfer.map_or(Vec::new(), |cached| cached.uniforms().to_vec());
        let common = [&own[..], &inputs.geometry.uniforms()].concat();
        for (IntegralPass { pass, reads, .. }, sums) in self.passes.iter().zip(&tile.sums) {
            let (of_hits, miss) = match reads {
                PassInput::Gathered => (&radiance, &inputs.miss),
                PassInput::Whole => (&radiance, &inputs.whole_miss),
                PassInput::Transfer => (&transfer, &inputs.miss),
            };
            pass.add(&inputs.found, inputs.points, sums, &[&common[..], of_hits, &miss.uniforms()].concat());
        }
    }

    /// Reads the sums of a tile and appends them to `values`.
    pub fn read(tile: &Tile, values: &mut Values) {
        let of_passes = tile.sums.iter().flat_map(Accumulator::read_all).map(|sums| tile.list.in_order(sums));
        let sums: Vec<Vec<Vec4>> = tile.packets.iter().flat_map(PacketTile::read).chain(of_passes).collect();
        values.planes.resize(sums.len(), Vec::new());
        values.planes.iter_mut().zip(sums).for_each(|(plane, sums)| plane.extend(sums));
    }
}

impl Sum for Values {
    fn add(&mut self, later: &Self) {
        for (plane, later) in self.planes.iter_mut().zip(&later.planes) {
            plane.par_iter_mut().zip(later).for_each(|(sum, later)| *sum += *later);
        }
    }
}

impl Planes for Values {
    fn planes(&self) -> Vec<&[f32]> {
        self.planes.iter().map(|plane| bytemuck::cast_slice(plane)).collect()
    }
}

impl Values {
    /// Bytes of the sums of one point.
    pub fn bytes(wanted: &Wanted) -> usize {
        wanted.planes() * size_of::<Vec4>()
    }

    /// Inverse of [`Planes::planes`] for this number of points. `None` if the planes do not fit `wanted`.
    pub fn of_planes(wanted: &Wanted, points: usize, planes: &[&[f32]]) -> Option<Self> {
        let whole = planes.len() == wanted.planes() && planes.iter().all(|floats| floats.len() == 4 * points);
        // Copied, because vectors need a stricter alignment than floats.
        whole.then(|| Self { planes: planes.iter().map(|floats| bytemuck::pod_collect_to_vec(floats)).collect() })
    }

    /// Appends the sums of further points.
    pub fn append(&mut self, further: &Self) {
        self.planes.resize(further.planes.len(), Vec::new());
        for (plane, further) in self.planes.iter_mut().zip(&further.planes) {
            // There are few rounds with many points each, so spare capacity would waste memory.
            plane.reserve_exact(further.len());
            plane.extend(further);
        }
    }

    /// For each point, the share of its hemisphere in which it saw back sides of surfaces.
    pub fn inside(&self) -> Vec<f32> {
        let [reflected, _, _, counts, ..] = &self.planes[..] else { return Vec::new() };
        counts.iter().zip(reflected).map(|(counts, reflected)| counts.x / reflected.w.max(f32::MIN_POSITIVE)).collect()
    }

    /// The columns of a quantity. `direct` is the irradiance from the lights at each point.
    pub fn columns(&self, quantity: Quantity, order: usize, points: &[GatherPoint], direct: &[Vec3]) -> Vec<Channel> {
        let [reflected, sky, open, counts, harmonics @ ..] = &self.planes[..] else { unreachable!("points have sums") };
        let prt = &harmonics[harmonics.len().saturating_sub(HarmonicsPass::targets(order))..];
        let weight = |i: usize| reflected[i].w;
        let share = |sum: f32, i: usize| if weight(i) > 0.0 { sum / weight(i) } else { 0.0 };
        let names = quantity.columns(order);
        let value: Box<dyn Fn(usize) -> Vec<f32>> = match quantity {
            Quantity::Irradiance => {
                let mean = move |sum: Vec4, i| if weight(i) > 0.0 { PI * sum.truncate() / weight(i) } else { Vec3::ZERO };
                Box::new(move |i| {
                    let [indirect, sky] = [mean(reflected[i], i), mean(sky[i], i)];
                    let direct = direct[i] + sky;
                    [direct + indirect, direct, indirect].iter().flat_map(Vec3::to_array).collect()
                })
            }
            Quantity::Ao => Box::new(|i| vec![share(open[i].w, i)]),
            Quantity::BentNormal => Box::new(|i| open[i].truncate().normalize_or(points[i].normal).to_array().to_vec()),
            Quantity::Sky => Box::new(|i| vec![share(sky[i].w, i)]),
            Quantity::Sh => Box::new(|i| {
                let solid_angle = if counts[i].y > 0.0 { TAU / counts[i].y } else { 0.0 };
                (0..names.len()).map(|k| harmonics[k / 4][i][k % 4] * solid_angle).collect()
            }),
            Quantity::Prt => Box::new(|i| (0..names.len()).map(|k| share(prt[k / 4][i][k % 4], i)).collect()),
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
