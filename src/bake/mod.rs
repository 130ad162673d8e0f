//! Bakes: integrals over the hemispheres of points. Points can be vertices, texels, pixels or points of a file.
//!
//! [`Bake::new`] takes the points of all receivers in order. [`Bake::step`] gathers along a few more directions. [`Bake::columns`] gives a value for
//! each point. In a step, `schedule` selects points and directions, `vertex_cache` holds earlier results at the scene's vertices (for bounces
//! without photons and for [`Quantity::Prt`](crate::quantity::Quantity::Prt)), `hits` finds hits, passes over them (`integrals`) add up, and `accumulation` keeps the sums.
//! Packets of rays find hits and add up at once (`on_cpu`). `points` tells which part of the directions a point takes.
//!
//! Block sums merge exactly. So machines can share a bake ([`Bake::only`], [`Merge`]), and a bake can go on later ([`Bake::save`], [`Bake::resume`]).

mod accumulation;
mod hits;
mod integrals;
mod lights;
mod memory;
mod merge;
mod on_cpu;
mod plan;
mod points;
mod schedule;
mod vertex_cache;

use std::ops::Range;
use std::path::Path;
use std::rc::Rc;
use std::time::Instant;

use glam::Vec3;
use serde::Serialize;
use serde_json::{Value, json};

use self::accumulation::{Accumulation, BlockSums, RoundSums};
use self::hits::{BatchHits, HitSource, VertexHits};
use self::integrals::{IntegralInputs, Integrals, SurfaceRadiance};
use self::memory::stores_hits;
use self::schedule::{BlockInProgress, PointSet, Round, Schedule};
use self::vertex_cache::VertexCache;
use crate::blocks::{Part, sha256};
use crate::direct::{Direct, STRIDE, SampleShare, direct_light_on_cpu};
use crate::error::{Error, Result};
use crate::gather::{MissRadiance, chosen_for_bake};
use crate::geometry::Geometry;
use crate::gpu::Gpu;
use crate::image::Channel;
use crate::photon::PhotonCounts;
use crate::points::packets::SubsetPackets;
use crate::points::{GatherPoint, sides};
use crate::prepared::{Photons, Prepared};
use crate::scene::{Rays, Scene};
use crate::settings::{DIRECTIONS_PER_PHOTON_MAP, Pipeline, Settings};
use crate::shaders::{BATCH, HitRadiance, RadianceSource};

pub use merge::Merge;
pub use plan::{Plan, RadianceCache, blocks_of, vertex_inset};
pub use points::{BakePoints, MOST_TURNS, PointRun, Turn};

/// Counts and times of a bake.
#[derive(Clone, Debug, Default, Serialize)]
pub struct BakeStatistics {
    pub points: usize,
    /// Directions done and in total, summed over all rounds.
    pub directions_done: u64,
    pub directions_total: u64,
    /// Passes through all directions: one for each bounce, and more if memory cannot hold all points.
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
    prepared: Rc<Prepared>,
    geometry: Rc<Geometry>,
    settings: Settings,
    plan: Plan,
    points: Vec<GatherPoint>,
    /// Checksums of scene and points.
    digest: [Value; 2],
    schedule: Schedule,
    photons: Option<Photons>,
    direct: Direct,
    cache: VertexCache,
    /// `None` before the first gather.
    hit_source: Option<HitSource>,
    sums: Accumulation,
    /// MiB for the whole bake, if [`Self::fit`] limits them.
    limit: Option<usize>,
    layers_max: u32,
    seconds: Seconds,
}

impl Bake {
    /// `geometry` is uploaded from the scene of `prepared`, and `points` are in its unit space. A render may share both.
    ///
    /// # Errors
    /// [`Error::Usage`] when a setting is out of range or not for bakes, or there are no points; [`Error::Gl`] when the device fails.
    pub fn new(
        gpu: &Gpu,
        prepared: impl Into<Rc<Prepared>>,
        geometry: impl Into<Rc<Geometry>>,
        points: impl Into<BakePoints>,
        settings: &Settings,
        plan: &Plan,
    ) -> Result<Self> {
        let (prepared, geometry) = (prepared.into(), geometry.into());
        let BakePoints { points, runs } = points.into();
        settings.validate()?;
        plan.validate()?;
        if settings.directions.target_error > 0.0 {
            return Err(Error::usage("a bake does not tell the error at which it is to stop", "let target_error be 0"));
        }
        if points.is_empty() {
            return Err(Error::usage("there are no points to bake", "give a scene or a file that has some"));
        }
        if PointRun::count(&runs) != Some(points.len()) {
            return Err(Error::usage(
                "the runs of points are not those of the points",
                "give each point to one run with a possible turn",
            ));
        }
        let mut settings = *settings;
        if settings.gather.pipeline == Pipeline::Auto {
            settings.gather.pipeline =
                chosen_for_bake(gpu.is_software(), &settings, &prepared.scene.mesh, &prepared.bvh, &points);
        }
        let settings = &settings;
        let start = Instant::now();
        let of = (&settings.photons, settings.seed);
        let traced = || Photons::new(gpu, [&prepared, &prepared], of, &sides(&points), || false);
        let photons = plan.needs_photons().then(traced).transpose()?;
        let seconds = Seconds { photons: start.elapsed().as_secs_f64(), ..Seconds::default() };
        let cache = (plan.stages() > 0).then(|| VertexCache::new(gpu, &prepared.scene, vertex_inset(settings)));
        let cache = cache.transpose()?.unwrap_or_default();
        // If the receivers are the vertices themselves, they use the stored hits too.
        let receivers = if cache.points() == points { PointSet::Vertices } else { PointSet::Receivers };
        let mut bake = Self {
            gpu: gpu.clone(),
            digest: digest(&prepared.scene, &points),
            schedule: Schedule::new(&settings.directions, settings.seed, cache.points().len(), runs, receivers),
            direct: Direct::new(gpu, settings.seed)?,
            settings: *settings,
            plan: plan.clone(),
            prepared,
            geometry,
            points,
            photons,
            cache,
            hit_source: None,
            sums: Accumulation::default(),
            limit: None,
            layers_max: 0,
            seconds,
        };
        bake.begin_rounds();
        Ok(bake)
    }

    /// The settings of the bake, with the pipeline that `auto` stands for.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The quantities and options of the bake.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The scene of the bake.
    pub fn prepared(&self) -> &Prepared {
        &self.prepared
    }

    /// The scene alone, once the work is done.
    pub fn into_scene(self) -> Scene {
        let prepared = { self }.prepared;
        Rc::try_unwrap(prepared).map_or_else(|shared| shared.scene.clone(), |own| own.scene)
    }

    pub fn is_done(&self) -> bool {
        self.schedule.next(&self.sums.rounds).is_none()
    }

    pub fn statistics(&self) -> BakeStatistics {
        let (directions_done, directions_total) = self.schedule.progress(&self.sums.rounds);
        BakeStatistics {
            points: self.points.len(),
            directions_done,
            directions_total,
            rounds: self.schedule.rounds.len(),
            layers_max: self.layers_max,
            photons: self.photons.as_ref().map_or(PhotonCounts::default(), |photons| photons.counts),
            seconds: self.seconds,
        }
    }

    /// Limits the last stage to these blocks of [`blocks_of`]. Earlier stages keep all blocks, because every block of the last stage needs them.
    pub fn only(&mut self, blocks: Range<u32>) {
        self.schedule.shard = blocks;
    }

    /// Limits the memory of the whole bake in MiB, GL side and CPU together. Fewer points gather at a time to fit.
    ///
    /// # Errors
    /// [`Error::Usage`] when the limit is too small. It names a sufficient one.
    pub fn fit(&mut self, limit: usize) -> Result<()> {
        self.plan.fit(limit, &self.prepared.scene, &self.settings, &self.schedule)?;
        self.limit = Some(limit);
        self.begin_rounds();
        Ok(())
    }

    /// Everything that determines the bits of the sums.
    pub fn job(&self) -> Value {
        let [scene, points] = &self.digest;
        json!({
            "what": "bake",
            "version": env!("CARGO_PKG_VERSION"),
            "gl": self.gpu.identity(),
            "scene": scene,
            "space": self.prepared.scene.space,
            "points": points,
            "turns": PointRun::turns(&self.schedule.receivers),
            "settings": self.settings.of_sums(),
            "plan": self.plan,
        })
    }

    /// The complete blocks that [`Self::resume`] needs, of all rounds.
    pub fn save(&self) -> Part<'_> {
        let state = json!({ "stage": self.schedule.stage, "memory": self.plan.memory, "runs": self.schedule.receivers });
        let mut part = Part::new(self.job(), state);
        self.schedule.rounds.iter().zip(&self.sums.rounds).for_each(|(round, sums)| sums.put(&mut part, round));
        part
    }

    /// Replaces all sums by the blocks in `part`, a file at `path`. Points then form the same rounds as in the part.
    ///
    /// # Errors
    /// [`Error::Input`] when the part is of another job, is damaged, or has larger rounds than [`Self::fit`] allows.
    pub fn resume(&mut self, path: &Path, part: &Part) -> Result<()> {
        part.check(path, &self.job())?;
        let theirs = self.plan.by(path, part)?;
        // Equal rounds need no more memory than here.
        if self.schedule.rounds_by(&theirs) != self.schedule.rounds {
            if let Some(limit) = self.limit.filter(|_| theirs.memory > self.plan.memory) {
                let needed = limit + theirs.memory - self.plan.memory;
                let problem = format!("more points were gathered at a time than --memory {limit} allows");
                return Err(Error::input(path, None, problem, format!("give --memory {needed}, or begin anew")));
            }
            self.plan = theirs;
        }
        self.begin_rounds();
        let blocks = self.schedule.blocks;
        for (round, sums) in self.schedule.rounds.iter().zip(&mut self.sums.rounds) {
            *sums = RoundSums::read(path, part, round, &self.plan.wanted(round.last), blocks)?;
        }
        // A stage needs all blocks of the stage before.
        let stage: u32 = Part::parse_value(path, &part.state["stage"])?;
        let mut before = stage.checked_sub(1).map_or(0..0, |before| self.schedule.of_stage(before));
        let is_whole = |round: usize| self.sums.rounds[round].values.missing(0..blocks.count()).is_empty();
        if stage > self.plan.stages() || !before.all(is_whole) {
            return Err(Error::input(path, None, "damaged: bounces are missing", "make it again"));
        }
        self.schedule.stage = stage;
        Ok(())
    }

    /// Whether no block is in progress. Then stopping loses nothing.
    pub fn is_between_blocks(&self) -> bool {
        self.schedule.current.is_none()
    }

    /// Gathers along the next batch of directions, if any are left. When memory runs out, the block begins again with smaller batches or fewer points.
    ///
    /// # Errors
    /// [`Error::Usage`] when layers exceed the device's limits (in the first step); [`Error::Gl`] when the device fails. Complete blocks stay.
    pub fn step(&mut self) -> Result<()> {
        let gathered = self.gather();
        if gathered.is_err() {
            // The data on the device are lost or unreliable.
            (self.schedule.current, self.sums.block) = (None, None);
        }
        gathered.or_else(|error| if self.gpu.goes_on(&error) && self.shrink() { Ok(()) } else { Err(error) })
    }

    fn gather(&mut self) -> Result<()> {
        let Some(mut at) = self.schedule.next(&self.sums.rounds) else { return Ok(()) };
        let round = self.schedule.rounds[at.round].clone();
        self.fill_cache(round.stage)?;
        if self.sums.block.is_none() {
            self.begin_round(at.round, &round)?;
        }
        let taken = self.schedule.runs(&round).any(|(_, turn)| self.schedule.takes(&at, turn));
        at.left.start += match taken {
            true => {
                self.trace_photons(at.left.start)?;
                self.gather_batch(&at, &round)?
            }
            // All points of the round have other turns.
            false => self.schedule.directions(&at, usize::MAX).len() as u32,
        };
        if at.left.is_empty() {
            self.sums.end_block(&self.gpu, at.block)?;
            self.schedule.current = None;
            // The next block of the same round has the same points.
            let next = self.schedule.next(&self.sums.rounds).filter(|next| next.round == at.round);
            self.sums.block.take_if(|_| next.is_none());
        } else {
            self.schedule.current = Some(at);
        }
        Ok(())
    }

    /// Fills the vertex cache with the results of the stage before.
    fn fill_cache(&mut self, stage: u32) -> Result<()> {
        if stage == 0 || self.schedule.stage == stage && self.cache.is_filled() {
            return Ok(());
        }
        let before = self.schedule.of_stage(stage - 1);
        let (values, direct) = self.sums.total(before.clone(), false);
        self.cache.fill(&self.gpu, &self.plan, &values, &direct)?;
        self.schedule.stage = stage;
        self.sums.rounds[..before.start].fill_with(RoundSums::default);
        Ok(())
    }

    /// Uploads the points of a round and computes their direct light.
    fn begin_round(&mut self, number: usize, round: &Round) -> Result<()> {
        let start = Instant::now();
        self.cache.hits.take_if(|_| round.set == PointSet::Receivers);
        let (radiance, transfer) = (self.cache.radiance.is_some(), self.cache.transfer.is_some());
        let mut wanted = self.plan.wanted(round.last);
        // Without photons, surfaces are black until the first stage is complete.
        wanted.radiance &= radiance || self.photons.is_some();
        let source = if radiance { RadianceSource::VertexCache } else { self.settings.photons.map.into() };
        let scene = &self.prepared.scene;
        let textured = scene.is_textured() || wanted.sh && scene.has_pictures_of_emission();
        let integrals = match self.plan.is_on_cpu(self.settings.gather.pipeline) {
            true => Integrals::of_packets(),
            false => Integrals::new(&self.gpu, wanted, HitRadiance { source, textured }, transfer)?,
        };
        let points = if round.set == PointSet::Vertices { self.cache.points() } else { &self.points };
        let runs = self.schedule.runs(round).map(|(run, turn)| (&points[run], turn));
        let block = BlockSums::new(&self.gpu, number, integrals, runs)?;
        let direct = self.direct_light(round, &block)?;
        self.gpu.finish();
        self.gpu.check("direct light")?;
        self.sums.rounds[number].direct = direct;
        self.sums.block = Some(block);
        self.seconds.direct += start.elapsed().as_secs_f64();
        Ok(())
    }

    /// Irradiance from the lights at the points of a round. Zero if it is not wanted.
    fn direct_light(&self, round: &Round, block: &BlockSums) -> Result<Vec<Vec3>> {
        let (geometry, lights) = (&self.geometry, &self.prepared.lights);
        let lit = |round: &Round| self.plan.wanted(round.last).radiance && lights.are_sampled();
        if !lit(round) {
            return Ok(vec![Vec3::ZERO; round.points.len()]);
        }
        let same = |(other, sums): &(&Round, &RoundSums)| {
            lit(other) && (other.set, &other.points) == (round.set, &round.points) && !sums.direct.is_empty()
        };
        if let Some((_, sums)) = self.schedule.rounds.iter().zip(&self.sums.rounds).find(same) {
            return Ok(sums.direct.clone());
        }
        let mut direct = Vec::with_capacity(round.points.len());
        let share = SampleShare::whole(self.settings.direct.light_samples);
        for (tile, _) in &block.tiles {
            let points = tile.list.points();
            let lit = if self.gpu.is_software() {
                let rays = Rays::new(&self.prepared.scene, &self.prepared.bvh);
                let packets = SubsetPackets::of_list(&points.read(), points.size(), STRIDE);
                let [lit, _] = direct_light_on_cpu(rays, lights, (share, self.settings.seed), &packets, &[]);
                lit
            } else {
                self.direct.irradiance(geometry, lights, share, points)?
            };
            direct.extend(tile.list.in_order(lit));
        }
        Ok(direct)
    }

    /// Makes the photon map for a direction.
    fn trace_photons(&mut self, direction: u32) -> Result<()> {
        let Some(photons) = &mut self.photons else { return Ok(()) };
        let start = Instant::now();
        photons.renew(&self.gpu, &self.prepared, (direction / DIRECTIONS_PER_PHOTON_MAP).into())?;
        self.seconds.photons += start.elapsed().as_secs_f64();
        Ok(())
    }

    /// Adds the hits of the points of a round along the next directions of a block. Returns the number of directions.
    fn gather_batch(&mut self, at: &BlockInProgress, round: &Round) -> Result<u32> {
        let start = Instant::now();
        let Some(block) = &self.sums.block else { return Ok(0) };
        if block.integrals.are_of_packets() {
            let directions = self.schedule.directions(at, BATCH);
            self.add_packets(at, round, &directions);
            self.seconds.gather += start.elapsed().as_secs_f64();
            return Ok(directions.len() as u32);
        }
        let source = match &mut self.hit_source {
            Some(source) => source,
            none => {
                let (layers, points) = (self.settings.layers(), self.schedule.largest_round());
                none.insert(HitSource::new(&self.gpu, &self.settings.gather, layers, &self.prepared, points)?)
            }
        };
        source.fit(round.set, if round.set == PointSet::Vertices { self.cache.points() } else { &self.points });
        let mut directions = self.schedule.directions(at, source.batch());
        let (scene, geometry) = (&self.prepared.scene, &self.geometry);
        let VertexCache { hits, radiance, transfer, .. } = &mut self.cache;
        let (radiance, transfer) = (radiance.as_ref(), transfer.as_ref());
        let radiance = match (radiance, &self.photons) {
            (Some(cached), _) => SurfaceRadiance::Cached(cached),
            (None, Some(photons)) => SurfaceRadiance::Photons(&photons.texture),
            (None, None) => SurfaceRadiance::Black,
        };
        let stored = hits.as_mut().filter(|_| round.set == PointSet::Vertices);
        let stored = stored.map(|stored| stored.entry(at.left.start).or_default());
        let mut hits = BatchHits::begin(source, stored, geometry, &directions)?;
        directions.truncate(hits.directions);
        let (miss, whole_miss) = (&MissRadiance::new(scene, &directions), &MissRadiance::whole(scene, &directions));
        let open_distance = self.plan.open_distance(scene);
        for (index, (tile, _)) in block.tiles.iter().enumerate().filter(|(_, (_, turn))| self.schedule.takes(at, *turn)) {
            let points = tile.list.points();
            let found = hits.of_tile(geometry, index, points)?;
            self.layers_max = self.layers_max.max(found.layers);
            let hits = IntegralInputs { geometry, found, miss, whole_miss, points, radiance, transfer, open_distance };
            block.integrals.add(tile, &hits);
        }
        self.gpu.finish();
        self.gpu.check("gathering")?;
        self.seconds.gather += start.elapsed().as_secs_f64();
        Ok(directions.len() as u32)
    }

    /// Frees some memory. Returns false if nothing can be freed.
    fn shrink(&mut self) -> bool {
        if self.cache.hits.take().is_some() || self.hit_source.as_mut().is_some_and(HitSource::shrink) {
            return true;
        }
        // Halves the number of points at a time. This is too late once a block is complete: a block holds all points of a round.
        let begun = self.sums.rounds.iter().any(|sums| sums.values.blocks() > 0);
        let fewer = !begun && self.plan.halve(self.schedule.blocks, self.schedule.largest_round());
        if fewer {
            self.begin_rounds();
        }
        fewer
    }

    /// Begins the rounds of the plan, with empty sums.
    fn begin_rounds(&mut self) {
        self.schedule.restart(&self.plan);
        self.sums = Accumulation::new(self.schedule.rounds.len());
        (self.cache.radiance, self.cache.transfer) = (None, None);
        self.cache.hits = stores_hits(&self.plan, &self.schedule).then(VertexHits::new);
        self.hit_source = None;
    }

    /// Directions along which the points of the last stage have gathered, each in its turn.
    pub fn directions_done(&self) -> u32 {
        self.schedule.directions_done(&self.sums.rounds)
    }

    /// Whether each point has a value. Values exist from the last round on, at first from fewer directions.
    pub fn has_values(&self) -> bool {
        self.sums.have_values(self.schedule.last(), self.counts_block())
    }

    /// Whether the block in progress counts for values. Where points take turns, it has sums of some of them alone.
    fn counts_block(&self) -> bool {
        !self.schedule.takes_turns()
    }

    /// All quantities so far, with a value for each point in order; `None` if [`Self::has_values`] is false. Also, for each point, the share of its
    /// hemisphere in which it saw back sides of surfaces. If this is most of it, the point lies inside an object.
    pub fn columns(&self) -> Option<(Vec<Channel>, Vec<f32>)> {
        let columns = || {
            let (values, direct) = self.sums.total(self.schedule.last(), self.counts_block());
            self.plan.columns(&values, &direct, &self.points, &self.prepared, &self.settings)
        };
        self.has_values().then(columns)
    }
}

fn digest(scene: &Scene, points: &[GatherPoint]) -> [Value; 2] {
    let vectors: Vec<_> = points.iter().flat_map(|point| [point.position, point.normal, point.surface_normal]).collect();
    [scene.digest(), sha256(bytemuck::cast_slice(&vectors)).into()]
}
