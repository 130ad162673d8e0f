//! Integrals over the hemispheres of any points of a scene: vertices, texels, pixels, points of a file. The gather does not know which.
//!
//! [`Bake::new`] takes the points of all receivers in a row; each [`Bake::step`] gathers along a few more directions; [`Bake::columns`] gives a
//! value for each point. For each batch of directions the layers are peeled once, hits are found for a tile of points after the other, and one
//! pass over hits adds up whatever is wanted. As many tiles as fit into the memory allowed stay on the GL side together; more points than that
//! take further rounds along all directions.
//!
//! Light by way of other surfaces comes from photons or, without them, from what was gathered at the scene's own vertices before: a round for each
//! bounce ([`Rough::Gathered`]). So does the transfer of [`Quantity::Prt`].

mod carriers;
mod integrals;

use std::ops::Range;
use std::time::Instant;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use self::carriers::{Carried, Carriers};
use self::integrals::{Integrals, Rough as Seen, Seen as Pass, Tile, Values, Wanted};
use crate::direct::Direct;
use crate::direction::{Direction, Directions};
use crate::error::{Error, Result};
use crate::gather::{Beyond, ExactFind, Find, FusedFind, HIT_BYTES, KeptHits, KillFind, KillGather, RayFind};
use crate::gpu::Gpu;
use crate::harmonics::MAX_ORDER;
use crate::image::Channel;
use crate::photon::PhotonCounts;
use crate::points::{GatherPoint, Sums};
use crate::prepared::{Photons, Prepared};
use crate::quantity::Quantity;
use crate::settings::{DIRECTIONS_PER_PHOTON_MAP, Pipeline, Settings};

/// Points of a tile: few enough that its hits, 16 MB, are still at hand for the passes that read them.
const TILE: usize = 1 << 18;

/// What a bake is to find, beside [`Settings`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Plan {
    pub what: Vec<Quantity>,
    /// Bands of spherical harmonics.
    pub order: usize,
    /// Light goes by way of so many surfaces more than those that `rough` knows: for [`Quantity::Prt`], from 0; for [`Rough::Gathered`].
    pub bounces: u32,
    /// In world space; surfaces farther away leave a point open. `None`: none do.
    pub ao_distance: Option<f32>,
    pub rough: Rough,
    /// MiB that points and their sums may take on the GL side at a time.
    pub memory: usize,
}

/// The radiance of surfaces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rough {
    /// The photon map's.
    #[default]
    Photons,
    /// What was gathered at the vertices of the scene.
    Gathered,
}

/// Counts and times of a bake.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Statistics {
    pub points: usize,
    /// Directions that are done, all rounds together, and in all.
    pub directions_done: u64,
    pub directions_total: u64,
    /// Walks along all directions: for each bounce, and for points beyond the memory.
    pub rounds: usize,
    pub layers_max: u32,
    pub photons: PhotonCounts,
    pub seconds: Seconds,
}

/// Wall-clock seconds.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Seconds {
    pub photons: f64,
    pub direct: f64,
    pub gather: f64,
}

/// A bake in progress.
pub struct Bake {
    gpu: Gpu,
    prepared: Prepared,
    settings: Settings,
    plan: Plan,
    points: Vec<GatherPoint>,
    directions: Directions,
    find: Box<dyn Find>,
    direct: Direct,
    photons: Option<Photons>,
    carriers: Option<Carriers>,
    /// Rounds that are left, the next one last.
    left: Vec<Round>,
    now: Option<Walk>,
    /// What carriers hold after the bounces so far: irradiance, and transfer.
    carried: Held,
    kept: Option<Kept>,
    /// Of the points so far.
    values: Values,
    irradiance: Vec<Vec3>,
    statistics: Statistics,
}

#[derive(Default)]
struct Held {
    irradiance: Option<Carried>,
    transfer: Option<Carried>,
}

/// What carriers find in every bounce anew, where there is memory to keep it.
struct Kept {
    /// Of each batch of directions, for each tile.
    hits: Vec<Vec<KeptHits>>,
    /// From the lights.
    irradiance: Vec<Vec3>,
}

/// Some points along all directions.
#[derive(Clone, Debug)]
struct Round {
    whose: Whose,
    points: Range<usize>,
    /// Whether it is the last for all of these.
    ends: bool,
    /// Whether it is about what was asked for, and not about what carriers hand on.
    last: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Whose {
    Carriers,
    Receivers,
}

/// A round in progress.
struct Walk {
    round: Round,
    integrals: Integrals,
    tiles: Vec<Tile>,
    done: u32,
}

impl Plan {
    /// # Errors
    /// [`Error::Usage`] when a number is out of range.
    pub fn validate(&self) -> Result<()> {
        if self.what.is_empty() {
            return Err(Error::usage("nothing is to be baked", "name one quantity or more"));
        }
        if !(1..=MAX_ORDER).contains(&self.order) {
            return Err(Error::usage(format!("order is {}", self.order), format!("give 1 to {MAX_ORDER} bands")));
        }
        if self.rough == Rough::Gathered && self.bounces == 0 && self.needs_radiance() {
            return Err(Error::usage("light gathered in place of photons, and no bounce to gather", "give 1 bounce or more"));
        }
        if self.ao_distance.is_some_and(|distance| !(distance > 0.0 && distance.is_finite())) {
            return Err(Error::usage("ao-distance is not above 0", "give a length in the scene's units"));
        }
        Ok(())
    }

    fn wants(&self, quantity: Quantity) -> bool {
        self.what.contains(&quantity)
    }

    fn needs_radiance(&self) -> bool {
        self.wants(Quantity::Irradiance) || self.wants(Quantity::Sh)
    }

    /// Rounds over the carriers: as many as there are bounces to hand on.
    fn bounces_of_carriers(&self) -> u32 {
        let gathered = self.needs_radiance() && self.rough == Rough::Gathered;
        if gathered || self.wants(Quantity::Prt) { self.bounces } else { 0 }
    }

    /// In a round that is the last or one that carriers hand on.
    fn wanted(&self, last: bool) -> Wanted {
        Wanted {
            radiance: self.needs_radiance() && (last || self.rough == Rough::Gathered),
            sh: self.wants(Quantity::Sh) && last,
            prt: self.wants(Quantity::Prt),
            order: self.order,
        }
    }
}

/// How far from a vertex its gather point lies, in unit space: half a texel of a layer, for nearer to the foot of a wall light is lost.
pub fn vertex_inset(settings: &Settings) -> f32 {
    1.0 / settings.layer_size as f32
}

impl Bake {
    /// Of `points` in the unit space of `prepared`.
    ///
    /// # Errors
    /// [`Error::Usage`] when a setting is out of range, there are no points, or sizes are beyond the device's limits; [`Error::Gl`] when it fails.
    pub fn new(gpu: &Gpu, prepared: Prepared, points: Vec<GatherPoint>, settings: &Settings, plan: &Plan) -> Result<Self> {
        settings.validate()?;
        plan.validate()?;
        if points.is_empty() {
            return Err(Error::usage("there are no points to bake", "give a scene or a file that has some"));
        }
        let start = Instant::now();
        let photons = if plan.needs_radiance() && plan.rough == Rough::Photons {
            Some(Photons::new(gpu, &prepared, settings)?)
        } else {
            None
        };
        let traced = start.elapsed().as_secs_f64();
        let bounces = plan.bounces_of_carriers();
        let carriers = (bounces > 0).then(|| Carriers::new(gpu, &prepared.scene, vertex_inset(settings))).transpose()?;
        let count_of_carriers = carriers.as_ref().map_or(0, |carriers| carriers.vertices().points().len());
        // Who bakes the vertices themselves need not find their hits again.
        let same = carriers.as_ref().is_some_and(|carriers| carriers.vertices().points() == points);
        let whose = if same { Whose::Carriers } else { Whose::Receivers };
        let mut left = Vec::new();
        for _ in 0..bounces {
            left.extend(rounds(Whose::Carriers, false, count_of_carriers, plan));
        }
        left.extend(rounds(whose, true, points.len(), plan));
        let of_carriers = left.iter().filter(|round| round.whose == Whose::Carriers).count();
        let bytes = plan.wanted(true).bytes() + HIT_BYTES * settings.directions as usize;
        let keeps = of_carriers > 1 && count_of_carriers * bytes <= plan.memory << 20;
        left.reverse();

        let largest = TILE.min(points.len().max(count_of_carriers));
        let size = crate::points::PointList::size(largest);
        let layers = settings.layer_size;
        let find: Box<dyn Find> = match settings.pipeline {
            Pipeline::Fused => Box::new(FusedFind::new(gpu, layers, size)?),
            Pipeline::Kill => Box::new(KillFind::new(KillGather::new(gpu, layers, size, settings.stop_fraction)?)),
            Pipeline::EarlyKill => Box::new(KillFind::new(KillGather::early(gpu, layers, size, settings.stop_fraction)?)),
            Pipeline::RaycastGl => Box::new(RayFind::new(gpu, &prepared.scene, size)?),
            Pipeline::Raycast => Box::new(ExactFind::new(gpu, &prepared.scene, prepared.bvh.clone())),
        };
        let statistics = Statistics {
            points: points.len(),
            directions_total: left.len() as u64 * u64::from(settings.directions),
            rounds: left.len(),
            photons: photons.as_ref().map_or(PhotonCounts::default(), |photons| photons.counts),
            seconds: Seconds { photons: traced, ..Seconds::default() },
            ..Statistics::default()
        };
        Ok(Self {
            gpu: gpu.clone(),
            direct: Direct::new(gpu, settings.shadow_size, settings.seed)?,
            directions: Directions::new(settings.sequence, settings.seed),
            settings: settings.clone(),
            plan: plan.clone(),
            prepared,
            points,
            find,
            photons,
            carriers,
            left,
            now: None,
            carried: Held::default(),
            kept: keeps.then(|| Kept { hits: Vec::new(), irradiance: Vec::new() }),
            values: Values::default(),
            irradiance: Vec::new(),
            statistics,
        })
    }

    /// What it is to find.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The scene that it is baked of.
    pub fn prepared(&self) -> &Prepared {
        &self.prepared
    }

    pub fn is_done(&self) -> bool {
        self.left.is_empty() && self.now.is_none()
    }

    pub fn statistics(&self) -> &Statistics {
        &self.statistics
    }

    /// Gathers along the next directions, as many as the pipeline takes at once, if any are left.
    ///
    /// # Errors
    /// [`Error::Gl`] when the device fails.
    pub fn step(&mut self) -> Result<()> {
        let mut walk = match self.now.take() {
            Some(walk) => walk,
            None => match self.left.pop() {
                Some(round) => self.begin(round)?,
                None => return Ok(()),
            },
        };
        self.gather(&mut walk)?;
        if walk.done == self.settings.directions {
            self.end(walk)
        } else {
            self.now = Some(walk);
            Ok(())
        }
    }

    /// Whether each point has a value: from the last round on, though of fewer directions than are asked for.
    pub fn has_values(&self) -> bool {
        self.left.is_empty() && self.now.as_ref().is_none_or(|walk| walk.done > 0)
    }

    /// A value for each point, in their order, of all quantities so far; `None` where [`Self::has_values`] is false. Beside them, for each point, the
    /// share of its hemisphere in which it saw surfaces from behind: where that is most of it, the point lies inside something.
    pub fn columns(&self) -> Option<(Vec<Channel>, Vec<f32>)> {
        if !self.has_values() {
            return None;
        }
        let mut values = self.values.clone();
        if let Some(walk) = &self.now {
            walk.tiles.iter().for_each(|tile| walk.integrals.read(tile, &mut values));
        }
        let columns = |&quantity: &Quantity| values.columns(quantity, self.plan.order, &self.points, &self.irradiance);
        Some((self.plan.what.iter().flat_map(columns).collect(), values.inside()))
    }

    fn points_of(&self, round: &Round) -> &[GatherPoint] {
        let all = match (&self.carriers, round.whose) {
            (Some(carriers), Whose::Carriers) => carriers.vertices().points(),
            _ => &self.points,
        };
        &all[round.points.clone()]
    }

    /// Empty sums, and light straight from the lights.
    fn begin(&mut self, round: Round) -> Result<Walk> {
        let start = Instant::now();
        let (gathered, transfer) = (self.carried.irradiance.is_some(), self.carried.transfer.is_some());
        let mut wanted = self.plan.wanted(round.last);
        let lit = wanted.radiance && self.prepared.lights.count() > 0;
        // Before the first bounce surfaces are black to those who gather without photons.
        wanted.radiance &= gathered || self.photons.is_some();
        let textured = self.prepared.geometry.is_textured();
        let integrals = Integrals::new(&self.gpu, wanted, textured, gathered, transfer)?;
        let points = self.points_of(&round);
        let tiles = points.chunks(TILE).map(|points| integrals.tile(&self.gpu, points)).collect::<Result<Vec<_>>>()?;
        let known = self.kept.as_ref().filter(|_| round.whose == Whose::Carriers).map(|kept| &kept.irradiance);
        let known = known.filter(|irradiance| irradiance.len() == points.len());
        let mut irradiance = match known {
            Some(irradiance) => irradiance.clone(),
            None if lit => Vec::with_capacity(points.len()),
            None => vec![Vec3::ZERO; points.len()],
        };
        if irradiance.is_empty() {
            for tile in &tiles {
                let points = tile.list.points();
                let sums = Sums::new(&self.gpu, points.size())?;
                sums.clear();
                for sample in 0..u64::from(self.settings.light_samples) {
                    self.direct.add(&self.prepared.geometry, &self.prepared.lights, sample, points, &sums);
                }
                let mean = 1.0 / self.settings.light_samples as f32;
                irradiance.extend(tile.list.in_order(sums.read()).iter().map(|sum| mean * sum.truncate()));
            }
        }
        if let Some(kept) = self.kept.as_mut().filter(|_| lit && round.whose == Whose::Carriers) {
            kept.irradiance.clone_from(&irradiance);
        }
        self.irradiance.extend(irradiance);
        self.gpu.finish();
        self.gpu.check("direct light")?;
        self.statistics.seconds.direct += start.elapsed().as_secs_f64();
        Ok(Walk { round, integrals, tiles, done: 0 })
    }

    fn gather(&mut self, walk: &mut Walk) -> Result<()> {
        if let Some(photons) = &mut self.photons {
            let start = Instant::now();
            let number = walk.done / DIRECTIONS_PER_PHOTON_MAP;
            photons.renew(&self.gpu, &self.prepared, &self.settings, number.into())?;
            self.statistics.photons = photons.counts;
            self.statistics.seconds.photons += start.elapsed().as_secs_f64();
        }
        let start = Instant::now();
        let count = (self.find.batch() as u32).min(self.settings.directions - walk.done);
        let batch: Vec<Direction> = (walk.done..walk.done + count).map(|number| self.directions.get(number)).collect();
        let geometry = &self.prepared.geometry;
        let mut kept = self.kept.as_mut().filter(|_| walk.round.whose == Whose::Carriers).map(|kept| &mut kept.hits);
        let number = walk.done as usize / self.find.batch();
        let known = kept.as_ref().is_some_and(|kept| number < kept.len());
        if !known {
            let layers = self.find.begin(geometry, &batch)?;
            self.statistics.layers_max = self.statistics.layers_max.max(layers);
            if let Some(kept) = &mut kept {
                kept.push(Vec::new());
            }
        }
        let of_carriers = self.carriers.as_ref();
        let rough = match (of_carriers.zip(self.carried.irradiance.as_ref()), &self.photons) {
            (Some((carriers, carried)), _) => Seen::Gathered(carriers, carried),
            (None, Some(photons)) => Seen::Photons(&photons.texture),
            (None, None) => Seen::Black,
        };
        let open_distance = self.plan.ao_distance.map_or(f32::MAX, |length| self.prepared.space.length_to_unit(length));
        let beyond = &Beyond::new(&self.prepared.scene, batch.iter().map(|direction| direction.vector));
        let transfer = of_carriers.zip(self.carried.transfer.as_ref());
        for (index, tile) in walk.tiles.iter().enumerate() {
            let points = tile.list.points();
            let hits = match &mut kept {
                None => self.find.find(geometry, points)?,
                Some(kept) => {
                    if !known {
                        self.find.find(geometry, points)?;
                        kept[number].push(self.find.keep()?);
                    }
                    kept[number][index].hits()
                }
            };
            walk.integrals.add(tile, &Pass { geometry, hits, beyond, points, rough, transfer, open_distance });
        }
        self.gpu.finish();
        self.gpu.check("gathering")?;
        self.statistics.seconds.gather += start.elapsed().as_secs_f64();
        self.statistics.directions_done += u64::from(count);
        walk.done += count;
        Ok(())
    }

    /// Reads the sums of a round; those of the last round of carriers are handed on.
    fn end(&mut self, walk: Walk) -> Result<()> {
        let Walk { round, integrals, tiles, .. } = walk;
        tiles.iter().for_each(|tile| integrals.read(tile, &mut self.values));
        drop(tiles);
        let Some(carriers) = self.carriers.as_ref().filter(|_| round.ends && !round.last) else { return Ok(()) };
        let values = std::mem::take(&mut self.values);
        let irradiance = std::mem::take(&mut self.irradiance);
        let inside = values.inside();
        let points = carriers.vertices().points();
        let columns = |quantity| values.columns(quantity, self.plan.order, points, &irradiance);
        if self.plan.wants(Quantity::Prt) {
            self.carried.transfer = Some(carriers.carry(&self.gpu, columns(Quantity::Prt), &inside)?);
        }
        if self.plan.needs_radiance() && self.plan.rough == Rough::Gathered {
            // In all, which comes first.
            let total = columns(Quantity::Irradiance).into_iter().take(3).collect();
            self.carried.irradiance = Some(carriers.carry(&self.gpu, total, &inside)?);
        }
        Ok(())
    }
}

/// The rounds that so many points take in the memory there is.
fn rounds(whose: Whose, last: bool, count: usize, plan: &Plan) -> Vec<Round> {
    let fit = (plan.memory << 20) / plan.wanted(last).bytes();
    // Whole tiles, and one at least.
    let most = (fit / TILE * TILE).max(TILE);
    let round = |first: usize| Round { whose, points: first..count.min(first + most), ends: first + most >= count, last };
    (0..count).step_by(most).map(round).collect()
}
