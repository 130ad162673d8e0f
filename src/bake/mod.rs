//! Integrals over the hemispheres of any points of a scene: vertices, texels, pixels, points of a file. The gather does not know which.
//!
//! [`Bake::new`] takes the points of all receivers in a row; each [`Bake::step`] gathers along a few more directions; [`Bake::columns`] gives a
//! value for each point. For each batch of directions the layers are peeled once, hits are found for a tile of points after the other, and one
//! pass over hits adds up whatever is wanted. As many tiles as fit into the memory allowed stay on the GL side together; more points than that
//! take further rounds along all directions.
//!
//! Directions come in blocks, sums of which merge exactly: they may be done on several machines ([`Bake::only`]), and a bake that ends early goes on from
//! those that were done ([`Bake::save`], [`Bake::resume`]).
//!
//! Light by way of other surfaces comes from photons or, without them, from what was gathered at the scene's own vertices before: a round for each
//! bounce ([`Rough::Gathered`]). So does the transfer of [`Quantity::Prt`].

mod carriers;
mod integrals;
mod rounds;

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;
use std::time::Instant;

use glam::Vec3;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use self::carriers::{Carried, Carriers};
use self::integrals::{IntegralInputs, Integrals, SurfaceRadiance, Tile, Values, Wanted};
use self::rounds::{Round, Whose, all_rounds, keeps, largest};
use crate::blocks::{Blocks, Node, PairwiseSum, Part, Sum, sha256};
use crate::direct::Direct;
use crate::direction::{Direction, Directions};
use crate::error::{Error, Result};
use crate::gather::{HitFinder, MissRadiance, Recorder, StoredHits, hit_finder};
use crate::gpu::Gpu;
use crate::harmonics::MAX_ORDER;
use crate::image::Channel;
use crate::photon::PhotonCounts;
use crate::points::{Accumulator, GatherPoint, PointList};
use crate::prepared::{Photons, Prepared};
use crate::quantity::Quantity;
use crate::settings::{DIRECTIONS_PER_PHOTON_MAP, Settings};
use crate::shaders::BATCH;

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
    /// MiB that points and their sums may take on the GL side at a time. Of each point the sum is the same, however many others there are.
    #[serde(skip)]
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
    /// For the most points at a time, once there are some.
    finder: Option<(Recorder, Box<dyn HitFinder>)>,
    direct: Direct,
    photons: Option<Photons>,
    carriers: Option<Carriers>,
    /// All of them, in order, and what each has summed so far.
    rounds: Vec<Round>,
    summed: Vec<Summed>,
    /// The blocks that it is to do of the last stage, of all there are.
    shard: Option<Range<u32>>,
    now: Option<Walk>,
    carried: Held,
    kept: Option<Kept>,
    /// MiB that all may take, if that is bounded.
    most: Option<usize>,
    /// The driver of parts that are merged.
    merged: Option<Value>,
    /// Checksums of scene and points.
    digest: Value,
    statistics: Statistics,
}

/// What carriers hold when a stage begins: irradiance, and transfer.
#[derive(Default)]
struct Held {
    stage: u32,
    irradiance: Option<Carried>,
    transfer: Option<Carried>,
}

/// What carriers find in every bounce anew, where there is memory to keep it.
#[derive(Default)]
struct Kept {
    /// Of each batch of directions, by its first, for each tile.
    hits: BTreeMap<u32, Vec<StoredHits>>,
    /// From the lights.
    irradiance: Vec<Vec3>,
}

/// What a round has found.
#[derive(Default)]
struct Summed {
    /// From the lights; empty before the round begins.
    irradiance: Vec<Vec3>,
    values: PairwiseSum<Values>,
}

/// A round in progress.
struct Walk {
    /// Which it is.
    round: usize,
    integrals: Integrals,
    tiles: Vec<Tile>,
    /// The block in progress, and its directions that are left.
    block: u32,
    left: Range<u32>,
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
            return Err(Error::usage(
                "ao-distance is no length above 0",
                "give one in the scene's units, or leave it out for any distance",
            ));
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

/// How far from a vertex its gather point lies in a bake, in unit space: half a texel of a layer, for nearer to the foot of a wall light is lost.
pub fn vertex_inset(settings: &Settings) -> f32 {
    1.0 / settings.layers() as f32
}

impl Bake {
    /// Of `points` in the unit space of `prepared`.
    ///
    /// # Errors
    /// [`Error::Usage`] when a setting is out of range or none of a bake's, or there are no points; [`Error::Gl`] when the device fails.
    pub fn new(gpu: &Gpu, prepared: Prepared, points: Vec<GatherPoint>, settings: &Settings, plan: &Plan) -> Result<Self> {
        settings.validate()?;
        plan.validate()?;
        if settings.until > 0.0 {
            return Err(Error::usage("a bake does not tell the error at which it is to stop", "let until be 0"));
        }
        if points.is_empty() {
            return Err(Error::usage("there are no points to bake", "give a scene or a file that has some"));
        }
        let start = Instant::now();
        let photons = if plan.needs_radiance() && plan.rough == Rough::Photons {
            Some(Photons::new(gpu, [&prepared, &prepared], settings, || false)?)
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
        let all = all_rounds(plan, settings, whose, [count_of_carriers, points.len()]);
        let kept = keeps(plan, settings, &all).then(Kept::default);
        let statistics = Statistics {
            points: points.len(),
            directions_total: all.len() as u64 * u64::from(settings.directions),
            rounds: all.len(),
            photons: photons.as_ref().map_or(PhotonCounts::default(), |photons| photons.counts),
            seconds: Seconds { photons: traced, ..Seconds::default() },
            ..Statistics::default()
        };
        let places: Vec<_> = points.iter().flat_map(|point| [point.position, point.normal, point.surface_normal]).collect();
        let digest = json!({ "scene": prepared.scene.digest(), "points": sha256(bytemuck::cast_slice(&places)) });
        Ok(Self {
            gpu: gpu.clone(),
            direct: Direct::new(gpu, settings.shadow_size, settings.seed)?,
            directions: Directions::new(settings.sequence, settings.seed),
            settings: settings.clone(),
            plan: plan.clone(),
            prepared,
            points,
            finder: None,
            photons,
            carriers,
            summed: all.iter().map(|_| Summed::default()).collect(),
            rounds: all,
            shard: None,
            now: None,
            carried: Held::default(),
            kept,
            most: None,
            merged: None,
            digest,
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
        self.now.is_none() && self.next().is_none()
    }

    pub fn statistics(&self) -> &Statistics {
        &self.statistics
    }

    /// Does these blocks alone, of [`blocks_of`] its settings; but bounces, which all blocks need, along all directions.
    pub fn only(&mut self, blocks: Range<u32>) {
        self.shard = Some(blocks);
        self.count();
    }

    /// Makes do with so many MiB in all, on the GL side and here: the points at a time are those for which there is room beside all else.
    ///
    /// # Errors
    /// [`Error::Usage`] when that is not enough, with what would be.
    pub fn fit(&mut self, most: usize) -> Result<()> {
        let blocks = self.shard.clone().unwrap_or(0..blocks_of(&self.settings).count());
        let points = [self.count_of_carriers(), self.points.len()];
        self.plan.fit(most, &self.prepared.scene, &self.settings, points, blocks)?;
        self.most = Some(most);
        self.begin_rounds();
        self.count();
        Ok(())
    }

    /// What it sums, by all that shapes the bits.
    pub fn job(&self) -> Value {
        let settings = Settings { exposure: 0.0, ..self.settings.clone() };
        json!({
            "what": "bake",
            "version": env!("CARGO_PKG_VERSION"),
            "gl": self.merged.as_ref().unwrap_or(&self.gpu.identity()),
            "scene": self.digest["scene"],
            "space": self.prepared.space,
            "points": self.digest["points"],
            "settings": settings,
            "plan": self.plan,
        })
    }

    /// The blocks that are done, of all rounds that are needed to go on.
    pub fn save(&self) -> Part<'_> {
        let mut part = Part::new(self.job(), json!({ "stage": self.carried.stage, "memory": self.plan.memory }));
        for (number, summed) in self.summed.iter().enumerate() {
            part.put_tree(&tree(number), &summed.values);
            if !summed.irradiance.is_empty() {
                part.put(light(number), bytemuck::cast_slice(&summed.irradiance));
            }
        }
        part
    }

    /// Goes on from the blocks that are done in `part`, read from `path`, in the place of what was gathered here; points take the turns that they took.
    ///
    /// # Errors
    /// [`Error::Input`] when it is of another job, damaged, or its turns take more than [`Self::fit`] allows.
    pub fn resume(&mut self, path: &Path, part: &Part) -> Result<()> {
        part.check(path, &self.job())?;
        let theirs = Plan { memory: memory_of(path, part)?, ..self.plan.clone() };
        let points = |rounds: &[Round]| rounds.iter().map(|round| round.points.clone()).collect::<Vec<_>>();
        // Where points take the same turns there is no need for as much.
        if points(&self.all_rounds(&theirs)) != points(&self.rounds) {
            if let Some(most) = self.most.filter(|_| theirs.memory > self.plan.memory) {
                let needed = most + theirs.memory - self.plan.memory;
                let problem = format!("more points were gathered at a time than --memory {most} allows");
                return Err(Error::input(path, None, problem, format!("give --memory {needed}, or begin anew")));
            }
            self.plan = theirs;
        }
        self.now = None;
        self.carried = Held { stage: part.state["stage"].as_u64().unwrap_or(0).min(u32::MAX.into()) as u32, ..Held::default() };
        self.begin_rounds();
        let blocks = blocks_of(&self.settings);
        for (number, (round, summed)) in self.rounds.iter().zip(&mut self.summed).enumerate() {
            *summed = summed_in(path, part, number, round.points.len(), &self.plan.wanted(round.last), blocks)?;
            // From what was found in the stage before, this one begins.
            let needed = round.stage + 1 == self.carried.stage;
            if round.stage == 0 && self.carried.stage > self.rounds.last().map_or(0, |last| last.stage)
                || needed && !summed.values.missing(0..blocks.count()).is_empty()
            {
                return Err(Error::input(path, None, "damaged: bounces are missing", "make it again"));
            }
        }
        self.count();
        Ok(())
    }

    /// Adds the blocks of a part of the same job to those of the last stage; all that are merged are of one driver, whichever.
    ///
    /// # Errors
    /// [`Error::Input`] when it is of another job or damaged, or has blocks that are there already.
    pub fn merge(&mut self, path: &Path, part: &Part) -> Result<()> {
        if self.merged.is_none() {
            self.merged = Some(part.job["gl"].clone());
            // All points at once, for nothing is left to gather.
            self.rounds.retain(|round| round.last);
            self.rounds.truncate(1);
            self.rounds.iter_mut().for_each(|round| round.points = 0..self.points.len());
            self.summed = self.rounds.iter().map(|_| Summed::default()).collect();
        }
        part.check(path, &self.job())?;
        let plan = Plan { memory: memory_of(path, part)?, ..self.plan.clone() };
        let blocks = blocks_of(&self.settings);
        let (mut values, mut irradiance): (Vec<Node<Values>>, _) = (Vec::new(), Vec::new());
        for (number, round) in self.all_rounds(&plan).iter().enumerate().filter(|(_, round)| round.last) {
            let own = summed_in(path, part, number, round.points.len(), &plan.wanted(true), blocks)?;
            let same = values.iter().map(Node::range).eq(own.values.nodes().iter().map(Node::range));
            if irradiance.is_empty() {
                values = own.values.into_nodes();
            } else if same {
                values.iter_mut().zip(own.values.nodes()).for_each(|(node, further)| node.sum.append(&further.sum));
            } else {
                let problem = "not complete: some points are further than others";
                return Err(Error::input(path, None, problem, "run its shard again with --resume"));
            }
            irradiance.extend(own.irradiance);
        }
        let mut sum = PairwiseSum::default();
        values.into_iter().for_each(|node| sum.insert(node).unwrap_or_else(|_| unreachable!("nodes of a tree")));
        blocks.merge(path, &mut self.summed[0].values, sum)?;
        self.summed[0].irradiance = irradiance;
        self.count();
        Ok(())
    }

    /// Whose bits they are, as the driver calls it.
    pub fn renderer(&self) -> &str {
        let merged = self.merged.as_ref().and_then(|gl| gl["renderer"].as_str());
        merged.unwrap_or(&self.gpu.info().renderer)
    }

    /// # Errors
    /// [`Error::Usage`] that names the directions along which not all points have gathered.
    pub fn check_whole(&self) -> Result<()> {
        let mut last = self.rounds.iter().zip(&self.summed).filter(|(round, _)| round.last);
        last.try_for_each(|(_, summed)| blocks_of(&self.settings).check_whole(&summed.values))
    }

    /// Whether no block is in progress, so that nothing is lost by ending here.
    pub fn is_between_blocks(&self) -> bool {
        let blocks = blocks_of(&self.settings);
        self.now.as_ref().is_none_or(|walk| walk.done(blocks) == 0)
    }

    /// The blocks that a round is to do.
    fn mine(&self, round: &Round) -> Range<u32> {
        self.shard.clone().filter(|_| round.last).unwrap_or(0..blocks_of(&self.settings).count())
    }

    /// Of the first round that has some left, the first block.
    fn next(&self) -> Option<(usize, u32)> {
        let of_stage = |last: bool| {
            let rounds = self.rounds.iter().zip(&self.summed).enumerate();
            // What was handed on and handed on again is there no more.
            let rounds = rounds.filter(move |(_, (round, _))| round.last == last && round.stage + 1 >= self.carried.stage);
            rounds.filter_map(|(number, (round, summed))| Some((number, summed.values.missing(self.mine(round)).first()?.start)))
        };
        let last = of_stage(true).next()?;
        Some(of_stage(false).next().unwrap_or(last))
    }

    /// Counts directions, those done elsewhere among them.
    fn count(&mut self) {
        let blocks = blocks_of(&self.settings);
        let (mut done, mut total) = (0, 0);
        for (round, summed) in self.rounds.iter().zip(&self.summed) {
            let mine = blocks.directions(self.mine(round)).len() as u64;
            total += mine;
            done += if round.stage + 1 < self.carried.stage { mine } else { blocks.summed(&summed.values).into() };
        }
        done += self.now.as_ref().map_or(0, |walk| walk.done(blocks).into());
        (self.statistics.directions_done, self.statistics.directions_total) = (done, total);
    }

    /// Gathers along the next directions, as many as the pipeline takes at once, if any are left. Where memory ends the block begins again, with less
    /// at a time.
    ///
    /// # Errors
    /// [`Error::Usage`] when layers are beyond the device's limits, in the first step; [`Error::Gl`] when the device fails; the blocks that were done before stay.
    pub fn step(&mut self) -> Result<()> {
        let stepped = self.gather_some();
        self.count();
        // What a device did that failed is gone, or not to be trusted.
        stepped.or_else(|error| if self.gpu.goes_on(&error) && self.shrink() { Ok(()) } else { Err(error) })
    }

    /// Gives memory back that it can do without, if any.
    fn shrink(&mut self) -> bool {
        self.kept.take().is_some() || self.finder.as_mut().is_some_and(|(_, finder)| finder.shrink()) || self.take_fewer_points()
    }

    /// Half as many at a time. But a block is of all points of a round: where some are done it is too late.
    fn take_fewer_points(&mut self) -> bool {
        let begun = self.summed.iter().any(|summed| summed.values.blocks() > 0);
        let fewer = !begun && self.plan.halve(&self.settings, &self.rounds);
        if fewer {
            self.begin_rounds();
            self.count();
        }
        fewer
    }

    /// Those of the plan, from the first on.
    fn begin_rounds(&mut self) {
        self.rounds = self.all_rounds(&self.plan);
        self.summed = self.rounds.iter().map(|_| Summed::default()).collect();
        self.kept = keeps(&self.plan, &self.settings, &self.rounds).then(Kept::default);
        self.finder = None;
        self.statistics.rounds = self.rounds.len();
    }

    fn all_rounds(&self, plan: &Plan) -> Vec<Round> {
        let whose = self.rounds.last().map_or(Whose::Receivers, |round| round.whose);
        all_rounds(plan, &self.settings, whose, [self.count_of_carriers(), self.points.len()])
    }

    fn count_of_carriers(&self) -> usize {
        self.carriers.as_ref().map_or(0, |carriers| carriers.vertices().points().len())
    }

    fn gather_some(&mut self) -> Result<()> {
        let mut walk = match (self.now.take(), self.next()) {
            (Some(walk), _) => walk,
            (None, Some((round, block))) => self.begin(round, block)?,
            (None, None) => return Ok(()),
        };
        self.gather(&mut walk)?;
        self.now = if walk.left.is_empty() { self.end_block(walk)? } else { Some(walk) };
        Ok(())
    }

    /// Directions along which every point has gathered, of those asked for.
    pub fn directions_done(&self) -> u32 {
        let blocks = blocks_of(&self.settings);
        let last = self.rounds.iter().zip(&self.summed).enumerate().filter(|(_, (round, _))| round.last);
        let done = |(number, (_, summed)): (usize, (_, &Summed))| {
            let walk = self.now.as_ref().filter(|walk| walk.round == number);
            blocks.summed(&summed.values) + walk.map_or(0, |walk| walk.done(blocks))
        };
        last.map(done).min().unwrap_or(0)
    }

    /// Whether each point has a value: from the last round on, though of fewer directions than are asked for.
    pub fn has_values(&self) -> bool {
        let begun = |number| self.now.as_ref().is_some_and(|walk| walk.round == number);
        let mut rounds = self.rounds.iter().zip(&self.summed).enumerate();
        rounds.all(|(number, (round, summed))| !round.last || summed.values.blocks() > 0 || begun(number))
    }

    /// A value for each point, in their order, of all quantities so far; `None` where [`Self::has_values`] is false. Beside them, for each point, the
    /// share of its hemisphere in which it saw surfaces from behind: where that is most of it, the point lies inside something.
    pub fn columns(&self) -> Option<(Vec<Channel>, Vec<f32>)> {
        if !self.has_values() {
            return None;
        }
        let (values, irradiance) = self.found(|round| round.last);
        let columns = |&quantity: &Quantity| values.columns(quantity, self.plan.order, &self.points, &irradiance);
        Some((self.plan.what.iter().flat_map(columns).collect(), values.inside()))
    }

    /// Sums of some rounds so far, and light straight from the lights, in the order of their points.
    fn found(&self, wanted: impl Fn(&Round) -> bool) -> (Values, Vec<Vec3>) {
        let (mut values, mut irradiance) = (Values::default(), Vec::new());
        for (number, (round, summed)) in self.rounds.iter().zip(&self.summed).enumerate() {
            if !wanted(round) {
                continue;
            }
            let mut sums = summed.values.total();
            if let Some(walk) = self.now.as_ref().filter(|walk| walk.round == number) {
                let latest = walk.values();
                match &mut sums {
                    Some(sums) => sums.add(&latest),
                    None => sums = Some(latest),
                }
            }
            values.append(&sums.unwrap_or_default());
            irradiance.extend(&summed.irradiance);
        }
        (values, irradiance)
    }

    fn points_of(&self, round: &Round) -> &[GatherPoint] {
        let all = match (&self.carriers, round.whose) {
            (Some(carriers), Whose::Carriers) => carriers.vertices().points(),
            _ => &self.points,
        };
        &all[round.points.clone()]
    }

    /// Empty sums, and light straight from the lights.
    fn begin(&mut self, number: usize, block: u32) -> Result<Walk> {
        let round = self.rounds[number].clone();
        self.hand_on(round.stage)?;
        if round.whose == Whose::Receivers {
            // Carriers are done.
            self.kept = None;
        }
        let start = Instant::now();
        let (gathered, transfer) = (self.carried.irradiance.is_some(), self.carried.transfer.is_some());
        let mut wanted = self.plan.wanted(round.last);
        let lit = wanted.radiance && self.prepared.lights.count() > 0;
        // Before the first bounce surfaces are black to those who gather without photons.
        wanted.radiance &= gathered || self.photons.is_some();
        let textured = self.prepared.geometry.is_textured();
        let integrals = Integrals::new(&self.gpu, wanted, textured, gathered, transfer)?;
        let points = self.points_of(&round);
        let count = points.len();
        let tiles = points.chunks(TILE).map(|points| integrals.tile(&self.gpu, points)).collect::<Result<Vec<_>>>()?;
        tiles.iter().for_each(Tile::clear);
        let of_carriers = round.whose == Whose::Carriers;
        let known = self.kept.as_ref().filter(|kept| of_carriers && kept.irradiance.len() == count).map(|kept| &kept.irradiance);
        let mut irradiance = known.unwrap_or(&self.summed[number].irradiance).clone();
        if irradiance.is_empty() && !lit {
            irradiance = vec![Vec3::ZERO; count];
        } else if irradiance.is_empty() {
            for tile in &tiles {
                let points = tile.list.points();
                let sums = Accumulator::new(&self.gpu, points.size())?;
                sums.clear();
                for sample in 0..u64::from(self.settings.light_samples) {
                    self.direct.add(&self.prepared.geometry, &self.prepared.lights, sample, points, &sums);
                }
                let mean = 1.0 / self.settings.light_samples as f32;
                irradiance.extend(tile.list.in_order(sums.read()).iter().map(|sum| mean * sum.truncate()));
            }
        }
        self.gpu.finish();
        self.gpu.check("direct light")?;
        if let Some(kept) = self.kept.as_mut().filter(|_| lit && of_carriers) {
            kept.irradiance.clone_from(&irradiance);
        }
        self.summed[number].irradiance = irradiance;
        self.statistics.seconds.direct += start.elapsed().as_secs_f64();
        Ok(Walk { round: number, integrals, tiles, block, left: blocks_of(&self.settings).directions(block..block + 1) })
    }

    fn gather(&mut self, walk: &mut Walk) -> Result<()> {
        let first = walk.left.start;
        if let Some(photons) = &mut self.photons {
            let start = Instant::now();
            let number = first / DIRECTIONS_PER_PHOTON_MAP;
            photons.renew(&self.gpu, &self.prepared, &self.settings, number.into())?;
            self.statistics.photons = photons.counts;
            self.statistics.seconds.photons += start.elapsed().as_secs_f64();
        }
        let start = Instant::now();
        let Prepared { scene, geometry, bvh, .. } = &self.prepared;
        let (recorder, finder) = match &mut self.finder {
            Some(finder) => finder,
            none => {
                let size = PointList::size(largest(&self.rounds).min(TILE));
                // Layers make do with what memory hits leave.
                let recorder = Recorder::new(&self.gpu, self.settings.pipeline, size)?;
                none.insert((recorder, hit_finder(&self.gpu, &self.settings, scene, bvh, size)?))
            }
        };
        let count = (finder.batch() as u32).min(walk.left.len() as u32);
        let mut batch: Vec<Direction> = (first..first + count).map(|number| self.directions.get(number)).collect();
        let of_carriers = self.rounds[walk.round].whose == Whose::Carriers;
        let mut kept = self.kept.as_mut().filter(|_| of_carriers).map(|kept| &mut kept.hits);
        let known = kept.as_ref().and_then(|kept| kept.get(&first)?.first()).map(StoredHits::directions);
        let taken = match known {
            Some(taken) => taken,
            None => finder.begin(geometry, &batch)?,
        };
        batch.truncate(taken);
        let carriers = self.carriers.as_ref();
        let radiance = match (carriers.zip(self.carried.irradiance.as_ref()), &self.photons) {
            (Some((carriers, carried)), _) => SurfaceRadiance::Cached(carriers, carried),
            (None, Some(photons)) => SurfaceRadiance::Photons(&photons.texture),
            (None, None) => SurfaceRadiance::Black,
        };
        let open_distance = self.plan.ao_distance.map_or(f32::MAX, |length| self.prepared.space.length_to_unit(length));
        let miss = &MissRadiance::new(scene, &batch);
        let transfer = carriers.zip(self.carried.transfer.as_ref());
        for (index, tile) in walk.tiles.iter().enumerate() {
            let points = tile.list.points();
            let found = match &mut kept {
                None => recorder.record(finder.find(geometry, points)?, points),
                Some(kept) => {
                    let kept = kept.entry(first).or_default();
                    if known.is_none() {
                        kept.push(recorder.keep(&finder.find(geometry, points)?, points)?);
                    }
                    kept[index].found()
                }
            };
            self.statistics.layers_max = self.statistics.layers_max.max(found.layers);
            walk.integrals.add(tile, &IntegralInputs { geometry, found, miss, points, radiance, transfer, open_distance });
        }
        self.gpu.finish();
        self.gpu.check("gathering")?;
        self.statistics.seconds.gather += start.elapsed().as_secs_f64();
        walk.left.start += taken as u32;
        Ok(())
    }

    /// Adds the sums of a block to those of its round. The next block of the round, if there is one.
    fn end_block(&mut self, mut walk: Walk) -> Result<Option<Walk>> {
        let values = walk.values();
        self.gpu.check("reading sums")?;
        self.summed[walk.round].values.insert_block(walk.block, values);
        let Some((_, block)) = self.next().filter(|&(round, _)| round == walk.round) else { return Ok(None) };
        walk.tiles.iter().for_each(Tile::clear);
        walk.block = block;
        walk.left = blocks_of(&self.settings).directions(block..block + 1);
        Ok(Some(walk))
    }

    /// Gives carriers what was found in the stage before this one.
    fn hand_on(&mut self, stage: u32) -> Result<()> {
        let Some(carriers) = self.carriers.as_ref().filter(|_| stage > 0) else { return Ok(()) };
        if self.carried.stage == stage && (self.carried.irradiance.is_some() || self.carried.transfer.is_some()) {
            return Ok(());
        }
        let (values, irradiance) = self.found(|round| round.stage + 1 == stage);
        let inside = values.inside();
        let points = carriers.vertices().points();
        let columns = |quantity| values.columns(quantity, self.plan.order, points, &irradiance);
        let mut carried = Held { stage, ..Held::default() };
        if self.plan.wants(Quantity::Prt) {
            carried.transfer = Some(carriers.carry(&self.gpu, columns(Quantity::Prt), &inside)?);
        }
        if self.plan.needs_radiance() && self.plan.rough == Rough::Gathered {
            // In all, which comes first.
            let total = columns(Quantity::Irradiance).into_iter().take(3).collect();
            carried.irradiance = Some(carriers.carry(&self.gpu, total, &inside)?);
        }
        self.carried = carried;
        for (round, summed) in self.rounds.iter().zip(&mut self.summed) {
            if round.stage + 1 < stage {
                *summed = Summed::default();
            }
        }
        Ok(())
    }
}

impl Walk {
    /// Directions of the block in progress that are done.
    fn done(&self, blocks: Blocks) -> u32 {
        self.left.start - blocks.directions(self.block..self.block + 1).start
    }

    /// What the block in progress has summed.
    fn values(&self) -> Values {
        let mut values = Values::default();
        self.tiles.iter().for_each(|tile| self.integrals.read(tile, &mut values));
        values
    }
}

/// The blocks of a bake by these settings: whole batches.
pub fn blocks_of(settings: &Settings) -> Blocks {
    Blocks::new(settings.directions, BATCH as u32)
}

/// The name in a [`Part`] of a round's sums,
fn tree(round: usize) -> String {
    format!("round{round}")
}

/// and of its direct light.
fn light(round: usize) -> String {
    format!("light{round}")
}

/// MiB that a part was made with.
fn memory_of(path: &Path, part: &Part) -> Result<usize> {
    let memory = part.state["memory"].as_u64().and_then(|memory| usize::try_from(memory).ok()).filter(|&memory| memory < 1 << 24);
    memory.ok_or_else(|| Error::input(path, None, "damaged: it does not say with how much memory it was made", "make it again"))
}

/// What a part has of a round.
fn summed_in(path: &Path, part: &Part, round: usize, points: usize, wanted: &Wanted, blocks: Blocks) -> Result<Summed> {
    let values = |_, floats: Vec<&[f32]>| Values::of_planes(wanted, points, &floats);
    let values = part.tree(path, &tree(round), blocks, values)?;
    let irradiance: Vec<Vec3> =
        part.get(&light(round)).and_then(|floats| bytemuck::try_cast_slice(floats).ok()).unwrap_or_default().to_vec();
    if irradiance.len() == points || irradiance.is_empty() && values.blocks() == 0 {
        return Ok(Summed { irradiance, values });
    }
    Err(Error::input(path, None, "damaged: its direct light is not that of its points", "make it again"))
}
