//! A picture of a scene, from photons to pixels: the job that the tool, the tests and the figures run.
//!
//! [`Render::new`] prepares the scene; each [`Render::step`] gathers along a few more directions; [`Render::picture`] is the mean so far.
//!
//! Directions come in blocks of a power of two. A block has its own sub-pixel offset and its own samples on the lights, which makes
//! anti-aliasing and soft shadows free of extra gather work, and its sums are independent of all other blocks: they may be done on several machines
//! ([`Render::only`]), and a render that ends early goes on from those that were done ([`Render::save`], [`Render::resume`]). Photons are
//! traced afresh now and then, so that their noise averages out in long renders as the directions' does.

mod layers;
mod memory;

use std::ops::Range;
use std::path::Path;
use std::rc::Rc;
use std::time::Instant;

use glam::{Vec3, Vec4};
use rayon::prelude::*;
use serde::Serialize;
use serde_json::{Value, json};

use crate::blocks::{Blocks, Part};
use crate::direct::Direct;
use crate::direction::{Direction, Directions};
use crate::error::{Error, Result};
use crate::film::{Film, FilmSum};
use crate::gather::{FusedGather, Gather, KillGather, RayGather, Work};
use crate::gpu::Gpu;
use crate::image::Image;
use crate::photon::{CausticMap, PhotonCounts};
use crate::photon_map::PhotonMap;
use crate::points::{CameraPoints, EyeRays, GBuffer, GatherPoint, Interleave, PointTextures, Points, Sums};
use crate::prepared::{Photons, Prepared};
use crate::random::sobol;
use crate::reference::Reference;
use crate::scene::{Camera, Scene, UnitSpace};
use crate::settings::{DIRECTIONS_PER_PHOTON_MAP, Estimator, Pipeline, PointSource, Settings};

pub use layers::{End, LayerTexel, Layers, Probe};
pub use memory::memory_of;

/// A render in progress.
pub struct Render {
    gpu: Gpu,
    settings: Settings,
    all: Rc<Prepared>,
    /// What gather rays see.
    gathered: Rc<Prepared>,
    /// In unit space.
    camera: Camera,
    photons: Photons,
    passes: Passes,
    directions: Directions,
    /// Checksums of the scene.
    digest: Value,
    /// The blocks that it is to do, of all there are.
    shard: Option<Range<u32>>,
    /// The block in progress.
    block: Option<Block>,
    /// Directions gathered so far, those of the block in progress among them.
    done: u32,
    film: FilmSum,
    /// Whether the error that was asked for is reached.
    reached: bool,
    statistics: Statistics,
}

/// All passes and what they draw into: what a render at other settings makes anew.
struct Passes {
    source: Source,
    direct: Direct,
    direct_sums: Sums,
    rough: PhotonMap,
    interleave: Interleave,
    method: Method,
    /// Of the layer view, once there is one.
    shown: Option<layers::Apart>,
}

/// Where the points of a block come from.
enum Source {
    Camera(CameraPoints),
    /// Those of the block in progress, once there is one.
    Traced(Option<PointTextures>),
}

/// Who gathers, and the sums of the block in progress.
enum Method {
    /// On the GL side.
    Gl { gather: Box<dyn Gather>, sums: Sums },
    /// [`Pipeline::Raycast`]; points and sums row by row from the bottom, as the GL side has them.
    Rays { points: Vec<Option<GatherPoint>>, sums: Vec<Vec4> },
}

/// A run of consecutive directions with one sub-pixel offset.
struct Block {
    index: u32,
    visible: GBuffer,
    /// Irradiance of the photon map at the visible points.
    rough: Vec<Vec4>,
    /// Irradiance of the caustics there.
    caustics: Vec<Vec3>,
    /// The directions left, those of one subset of the pixels after those of another, so that a batch has one subset; the next one last.
    left: Vec<u32>,
    /// Directions that each subset of the pixels took so far.
    taken: Vec<u32>,
    light_samples: u32,
}

/// Counts and times of a render. Times of GL stages are of finished work.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Statistics {
    pub scene: SceneCounts,
    pub seconds: StageSeconds,
    pub gather: GatherCounts,
    pub photons: PhotonCounts,
    /// Relative standard error of the picture, see [`Settings::until`]; estimated now and then.
    pub error: Option<f64>,
}

#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct SceneCounts {
    pub triangles: usize,
    /// Emissive triangles.
    pub lights: usize,
}

/// Wall-clock seconds.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct StageSeconds {
    pub photons: f64,
    pub visible_points: f64,
    pub direct: f64,
    pub caustics: f64,
    pub gather: f64,
}

#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct GatherCounts {
    /// Points of one block: pixels that see a surface.
    pub points: u32,
    /// Eye rays that were given up among mirrors and glass, of all blocks.
    pub cut: u64,
    pub directions: u32,
    pub layer_size: u32,
    /// Peeled for a direction; where a pipeline takes several at once, all of them count as the deepest.
    pub layers_mean: f64,
    pub layers_max: u32,
    pub ms_per_direction: f64,
    /// Points × directions over the seconds of the gather.
    pub samples_per_second: f64,
    #[serde(skip)]
    layers_sum: u64,
    #[serde(skip)]
    samples: u64,
}

impl Render {
    /// Traces the photons and prepares the GL side.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] when a setting is out of range or beyond the device's limits; [`crate::Error::Gl`] when the device
    /// fails.
    pub fn new(gpu: &Gpu, scene: &Scene, settings: &Settings) -> Result<Self> {
        settings.validate()?;
        let [all, gathered] = Prepared::both(gpu, scene)?;
        let scene = &all.scene;
        let camera = if scene.framed { Camera::framing(scene.mesh.bounds(), settings.size) } else { scene.camera };
        let mut passes = Passes::new(gpu, &gathered.scene, settings)?;

        let start = Instant::now();
        let photons = Photons::new(gpu, [&all, &gathered], settings, || passes.shrink())?;
        let mut statistics = Statistics {
            scene: SceneCounts { triangles: scene.mesh.triangles.len(), lights: all.lights.count() },
            photons: photons.counts,
            ..Statistics::default()
        };
        statistics.seconds.photons = start.elapsed().as_secs_f64();
        statistics.gather.layer_size = settings.layers();
        gpu.finish();
        gpu.check("preparing a render")?;
        Ok(Self {
            gpu: gpu.clone(),
            directions: Directions::new(settings.sequence, settings.seed),
            settings: settings.clone(),
            digest: scene.digest(),
            all,
            gathered,
            camera,
            photons,
            passes,
            shard: None,
            block: None,
            done: 0,
            film: FilmSum::default(),
            reached: false,
            statistics,
        })
    }

    /// Begins again: what `camera`, in world space, sees by other `settings`. Surfaces stay, and passes where the settings let them. So do the
    /// first photons; a render that had gone on to others traces them again.
    ///
    /// # Errors
    /// As [`Self::new`], and when `settings` ask for other photons; then nothing has changed.
    pub fn restart(&mut self, camera: Camera, settings: &Settings) -> Result<()> {
        let photons = |of: &Settings| (of.seed, of.photons, of.bounces, of.grid_cells);
        if photons(settings) != photons(&self.settings) {
            return Err(Error::usage("the photons of a render in progress cannot change", "open the scene again"));
        }
        settings.validate()?;
        let passes =
            |of: &Settings| (of.size, of.points, of.layers(), of.pipeline, of.interleave, of.stop_fraction, of.shadow_size);
        if passes(settings) != passes(&self.settings) {
            self.passes = Passes::new(&self.gpu, &self.gathered.scene, settings)?;
        }
        self.directions = Directions::new(settings.sequence, settings.seed);
        self.settings = settings.clone();
        self.camera = self.all.space.enter_camera(camera);
        self.forget();
        Ok(())
    }

    /// Compiles all programs again, after [`crate::shaders::reload`], and begins again.
    ///
    /// # Errors
    /// When one does not compile; then nothing has changed.
    pub fn reload(&mut self) -> Result<()> {
        self.passes = Passes::new(&self.gpu, &self.gathered.scene, &self.settings)?;
        self.forget();
        Ok(())
    }

    /// All that was gathered.
    fn forget(&mut self) {
        self.block = None;
        self.done = 0;
        self.film = FilmSum::default();
        self.reached = false;
        // Later photons go, and the first ones count when they are traced again.
        if self.photons.number > 0 {
            self.photons.counts = PhotonCounts::default();
        }
        self.statistics = Statistics { scene: self.statistics.scene, photons: self.photons.counts, ..Statistics::default() };
        self.statistics.gather.layer_size = self.settings.layers();
    }

    /// What it is rendered by.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Whether its context is lost, so that it cannot go on.
    pub fn is_lost(&self) -> bool {
        self.gpu.is_lost()
    }

    /// Directions gathered so far.
    pub fn directions_done(&self) -> u32 {
        self.done
    }

    pub fn is_done(&self) -> bool {
        self.reached || self.block.is_none() && self.next_block().is_none()
    }

    /// Does these blocks alone, of [`blocks_of`] its settings.
    pub fn only(&mut self, blocks: Range<u32>) {
        self.shard = Some(blocks);
    }

    /// What it sums, by all that shapes the bits.
    pub fn job(&self) -> Value {
        // Exposure is for pictures; sums have none.
        let settings = Settings { exposure: 0.0, ..self.settings.clone() };
        json!({
            "what": "render",
            "version": env!("CARGO_PKG_VERSION"),
            "gl": self.gpu.identity(),
            "scene": self.digest,
            "space": self.all.space,
            "camera": format!("{:?}", self.camera),
            "settings": settings,
        })
    }

    /// The blocks that are done.
    pub fn save(&self) -> Part<'_> {
        let mut part = Part::new(self.job(), json!({ "exposure": self.settings.exposure }));
        part.put_tree(FILM, &self.film);
        part
    }

    /// Goes on from the blocks that are done in `part`, read from `path`, in the place of what was gathered here.
    ///
    /// # Errors
    /// [`Error::Input`] when it is of another job, or damaged.
    pub fn resume(&mut self, path: &Path, part: &Part) -> Result<()> {
        part.check(path, &self.job())?;
        let film = film_of_part(path, part, &self.settings, blocks_of(&self.settings))?;
        self.forget();
        self.film = film;
        self.done = blocks_of(&self.settings).summed(&self.film);
        self.estimate_error();
        Ok(())
    }

    /// Whether no block is in progress, so that nothing is lost by ending here.
    pub fn is_between_blocks(&self) -> bool {
        self.block.is_none()
    }

    /// The first of its blocks that is not done.
    fn next_block(&self) -> Option<u32> {
        let mine = self.shard.clone().unwrap_or(0..blocks_of(&self.settings).count());
        Some(self.film.missing(mine).first()?.start)
    }

    pub fn statistics(&self) -> &Statistics {
        &self.statistics
    }

    /// Gathers along the next directions, as many as the pipeline takes at once, if any are left. Where memory ends the block begins again, with fewer
    /// directions at a time.
    ///
    /// # Errors
    /// [`crate::Error::Gl`] when the device fails; the blocks that were done before stay.
    pub fn step(&mut self) -> Result<()> {
        if self.is_done() {
            return Ok(());
        }
        let before = self.done - self.block.as_ref().map_or(0, |block| block.taken.iter().sum());
        self.gather_some().or_else(|error| {
            // What a device did that failed is gone, or not to be trusted.
            self.done = before;
            if self.gpu.goes_on(&error) && self.passes.shrink() { Ok(()) } else { Err(error) }
        })
    }

    fn gather_some(&mut self) -> Result<()> {
        let mut block = match (self.block.take(), self.next_block()) {
            (Some(block), _) => block,
            (None, Some(index)) => self.begin_block(index)?,
            (None, None) => return Ok(()),
        };
        self.gather_directions(&mut block)?;
        if block.left.is_empty() {
            let film = self.film_of(&block);
            self.gpu.check("reading sums")?;
            self.film.insert_block(block.index, film);
            self.estimate_error();
        } else {
            self.block = Some(block);
        }
        Ok(())
    }

    /// The mean of what is gathered so far, with the channels of `Film::image`; black before the first direction.
    pub fn picture(&self) -> Image {
        let Some(block) = &self.block else { return self.film.image(self.settings.size, &self.all.space) };
        let mut film = self.film.clone();
        film.insert_block(block.index, self.film_of(block));
        film.image(self.settings.size, &self.all.space)
    }

    /// Photons, visible points and direct light for the next block.
    fn begin_block(&mut self, index: u32) -> Result<Block> {
        let blocks = blocks_of(&self.settings);
        let directions = blocks.directions(index..index + 1);

        let map = u64::from(directions.start / DIRECTIONS_PER_PHOTON_MAP);
        if map != self.photons.number {
            let start = Instant::now();
            self.photons.renew(&self.gpu, &self.all, &self.settings, map)?;
            self.statistics.photons = self.photons.counts;
            self.statistics.seconds.photons += self.finish("uploading photons", start)?;
        }

        let start = Instant::now();
        let offset = sobol(index, self.settings.seed);
        let visible = match &mut self.passes.source {
            Source::Camera(points) => {
                let mut visible = points.see(&self.all.geometry, &self.camera, offset.into());
                visible.add_environment(&self.all.scene, &self.camera, self.settings.size, offset.into());
                visible
            }
            Source::Traced(points) => {
                let Prepared { scene, bvh, .. } = &*self.all;
                let rays = EyeRays { scene, bvh, camera: &self.camera, size: self.settings.size, seed: self.settings.seed };
                let visible = rays.see(offset.into(), index);
                let GBuffer { position, normal, count, .. } = &visible;
                *points = Some(PointTextures::upload(&self.gpu, self.settings.size, position, normal, *count)?);
                visible
            }
        };
        let points = self.passes.source.points(&visible);
        let rough = self.passes.rough.see(&self.photons.texture, points);
        self.statistics.seconds.visible_points += self.finish("finding visible points", start)?;

        // Each block takes its share of one sequence of light samples, so that together they cover the lights evenly.
        let start = Instant::now();
        let light_samples = u64::from(self.settings.light_samples).div_ceil(blocks.count().into());
        self.passes.direct_sums.clear();
        let first = u64::from(index) * light_samples;
        let samples = if self.all.lights.count() > 0 { first..first + light_samples } else { first..first };
        for sample in samples {
            self.passes.direct.add(&self.all.geometry, &self.all.lights, sample, points, &self.passes.direct_sums);
        }
        self.statistics.seconds.direct += self.finish("direct light", start)?;
        let start = Instant::now();
        let caustics = self.caustics(index, &visible);
        self.statistics.seconds.caustics += start.elapsed().as_secs_f64();

        match &mut self.passes.method {
            Method::Gl { sums, .. } => sums.clear(),
            Method::Rays { points, sums } => {
                *points = visible.pixels();
                *sums = vec![Vec4::ZERO; points.len()];
            }
        }
        self.statistics.gather.points = visible.count;
        self.statistics.gather.cut += u64::from(visible.cut);
        let mut left: Vec<u32> = directions.rev().collect();
        left.sort_by_key(|&direction| self.passes.interleave.subset(direction, index).index());
        let taken = vec![0; self.passes.interleave.subsets()];
        Ok(Block { index, visible, rough, caustics, left, taken, light_samples: light_samples as u32 })
    }

    /// Irradiance at the points of a block by way of mirrors and glass, from photons of its own.
    fn caustics(&self, block: u32, visible: &GBuffer) -> Vec<Vec3> {
        if !self.all.scene.is_specular() {
            return vec![Vec3::ZERO; visible.normal.len()];
        }
        let photons = self.settings.photons;
        let numbers = u64::from(block) * photons..(u64::from(block) + 1) * photons;
        let map = CausticMap::new(self.all.photons(&self.settings).caustics(numbers), block);
        let see = |point: Option<GatherPoint>| point.map_or(Vec3::ZERO, |p| map.irradiance(p.position, p.surface_normal));
        visible.pixels().into_par_iter().map(see).collect()
    }

    fn gather_directions(&mut self, block: &mut Block) -> Result<()> {
        let start = Instant::now();
        let batch = match &self.passes.method {
            Method::Gl { gather, .. } => gather.batch(),
            Method::Rays { .. } => 1,
        };
        let subset_of = |&direction: &u32| self.passes.interleave.subset(direction, block.index);
        let Some(subset) = block.left.last().map(subset_of) else { return Ok(()) };
        let numbers: Vec<u32> =
            block.left.iter().rev().take(batch).take_while(|&direction| subset_of(direction) == subset).copied().collect();
        // As the camera sees them, so that a scene turned together with its camera makes the same picture.
        let axes = self.camera.axes();
        let turned = |&number: &u32| {
            let direction = self.directions.get(number);
            Direction { vector: axes * direction.vector, ..direction }
        };
        let directions: Vec<Direction> = numbers.iter().map(turned).collect();
        let points = self.passes.source.points(&block.visible).only(subset);
        let layers = match &mut self.passes.method {
            Method::Gl { gather, sums } => {
                let Prepared { scene, geometry, .. } = &*self.gathered;
                gather.add(Work { scene, geometry, photons: &self.photons.texture, points, sums }, &directions)?
            }
            Method::Rays { points, sums } => {
                let rays = Reference::new(&self.gathered.scene, &self.gathered.bvh, &self.photons.grid);
                let interleave = self.passes.interleave;
                let cast = |(i, (point, sum)): (usize, (&Option<GatherPoint>, &mut Vec4))| match point {
                    Some(point) if interleave.subset_of(i) == subset => {
                        directions.iter().for_each(|direction| *sum += rays.sample(point, direction.vector).as_vec4());
                    }
                    _ => {}
                };
                points.par_iter().zip(sums).enumerate().for_each(cast);
                0
            }
        };
        self.statistics.seconds.gather += self.finish("final gathering", start)?;
        block.left.truncate(block.left.len() - numbers.len());
        block.taken[subset.index()] += numbers.len() as u32;
        self.done += numbers.len() as u32;
        self.statistics.gather.add(points.count, numbers.len() as u32, layers, self.statistics.seconds.gather);
        Ok(())
    }

    fn film_of(&self, block: &Block) -> Film {
        let mut gathered = match &self.passes.method {
            Method::Gl { sums, .. } => self.passes.interleave.in_order(sums.read()),
            Method::Rays { sums, .. } => sums.clone(),
        };
        if self.settings.estimator == Estimator::Plain {
            // The weights' expected sum in place of their own: over the sphere, the mean of max(n·d, 0) is 1/4, that of |n·d| 1/2.
            let both_ends = matches!(&self.passes.method, Method::Gl { gather, .. } if gather.both_ends());
            let mean = if both_ends { 0.5 } else { 0.25 };
            let taken = |pixel| block.taken[self.passes.interleave.subset_of(pixel).index()];
            gathered.iter_mut().enumerate().for_each(|(pixel, sum)| sum.w = mean * taken(pixel) as f32);
        }
        let gathered = self.passes.interleave.share(gathered, &block.taken, &block.visible);
        let directions = block.taken.iter().sum();
        let direct = self.passes.direct_sums.read();
        let direct = (&direct[..], block.light_samples);
        Film::of_block(self.settings.size, &block.visible, direct, &block.rough, &block.caustics, (&gathered, directions))
    }

    /// Once in a while, for the report and to stop a render that is good enough.
    fn estimate_error(&mut self) {
        let blocks = self.film.blocks();
        if blocks.is_multiple_of(8) || self.next_block().is_none() {
            self.statistics.error = self.film.error();
            self.reached = self.settings.until > 0.0 && self.statistics.error.is_some_and(|error| error <= self.settings.until);
        }
    }

    /// Waits for the device and returns the seconds since `start`.
    fn finish(&self, stage: &str, start: Instant) -> Result<f64> {
        self.gpu.finish();
        self.gpu.check(stage)?;
        Ok(start.elapsed().as_secs_f64())
    }
}

/// The name of its tree in a [`Part`].
const FILM: &str = "film";

/// Parts of one render put together, from their files alone.
pub struct Merge {
    job: Value,
    settings: Settings,
    space: UnitSpace,
    film: FilmSum,
}

impl Merge {
    /// Of the render that `part`, read from `path`, is of; nothing yet.
    ///
    /// # Errors
    /// [`Error::Input`] when it is damaged.
    pub fn new(path: &Path, part: &Part) -> Result<Self> {
        let damaged = || Error::input(path, None, "damaged: it does not say what it is of", "make it again");
        let mut settings: Settings = serde_json::from_value(part.job["settings"].clone()).map_err(|_| damaged())?;
        settings.exposure = serde_json::from_value(part.state["exposure"].clone()).map_err(|_| damaged())?;
        let space = serde_json::from_value(part.job["space"].clone()).map_err(|_| damaged())?;
        if part.job["version"] != env!("CARGO_PKG_VERSION") {
            let problem = format!("of version {}, and this is {}", part.job["version"], env!("CARGO_PKG_VERSION"));
            return Err(Error::input(path, None, problem, "merge with the version that made it"));
        }
        settings.validate().map_err(|_| damaged())?;
        Ok(Self { job: part.job.clone(), settings, space, film: FilmSum::default() })
    }

    /// # Errors
    /// [`Error::Input`] when it is of another render, damaged, or has blocks that are there already.
    pub fn add(&mut self, path: &Path, part: &Part) -> Result<()> {
        part.check(path, &self.job)?;
        let blocks = blocks_of(&self.settings);
        blocks.merge(path, &mut self.film, film_of_part(path, part, &self.settings, blocks)?)
    }

    /// # Errors
    /// [`Error::Usage`] when directions are missing.
    pub fn picture(&self) -> Result<Image> {
        blocks_of(&self.settings).check_whole(&self.film)?;
        Ok(self.film.image(self.settings.size, &self.space))
    }

    /// As [`Render::job`].
    pub fn job(&self) -> &Value {
        &self.job
    }

    /// What it was rendered by.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Whose bits they are, as the driver calls it.
    pub fn renderer(&self) -> &str {
        self.job["gl"]["renderer"].as_str().unwrap_or_default()
    }
}

fn film_of_part(path: &Path, part: &Part, settings: &Settings, blocks: Blocks) -> Result<FilmSum> {
    let film = |range, planes: Vec<&[f32]>| Film::of_planes(settings.size, blocks.directions(range).len() as u32, &planes);
    part.tree(path, FILM, blocks, film)
}

/// The blocks of a render by these settings: each has its own sub-pixel offset, and at least one direction for each interleaved subset.
pub fn blocks_of(settings: &Settings) -> Blocks {
    Blocks::new(settings.directions, settings.interleave * settings.interleave)
}

impl Passes {
    fn new(gpu: &Gpu, scene: &Scene, settings: &Settings) -> Result<Self> {
        let points = settings.size;
        let source = match settings.points {
            PointSource::Camera => Source::Camera(CameraPoints::new(gpu, points)?),
            PointSource::Traced => Source::Traced(None),
        };
        let direct = Direct::new(gpu, settings.shadow_size, settings.seed)?;
        let direct_sums = Sums::new(gpu, points)?;
        let rough = PhotonMap::new(gpu, points)?;
        let interleave = Interleave::new(settings.interleave, points, settings.seed);
        let sums = || Sums::new(gpu, interleave.sums_size());
        // Sums first: what gathers makes do with the memory that is left.
        let gl = |sums, gather: Box<dyn Gather>| Method::Gl { gather, sums };
        let (layers, tile, stop) = (settings.layers(), interleave.tile(), settings.stop_fraction);
        let method = match settings.pipeline {
            Pipeline::Kill => gl(sums()?, Box::new(KillGather::new(gpu, layers, tile, stop)?)),
            Pipeline::EarlyKill => gl(sums()?, Box::new(KillGather::early(gpu, layers, tile, stop)?)),
            Pipeline::Fused => gl(sums()?, Box::new(FusedGather::new(gpu, layers)?)),
            Pipeline::RaycastGl => gl(sums()?, Box::new(RayGather::new(gpu, scene)?)),
            Pipeline::Raycast => Method::Rays { points: Vec::new(), sums: Vec::new() },
        };
        Ok(Self { source, direct, direct_sums, rough, interleave, method, shown: None })
    }

    /// Gives memory back that gathering can do without, if any.
    fn shrink(&mut self) -> bool {
        match &mut self.method {
            Method::Gl { gather, .. } => gather.shrink(),
            Method::Rays { .. } => false,
        }
    }
}

impl Source {
    /// The points of the block in progress.
    fn points<'a>(&'a self, visible: &GBuffer) -> Points<'a> {
        match self {
            Self::Camera(points) => points.points(visible),
            Self::Traced(points) => points.as_ref().expect("a block begins with its points").points(),
        }
    }
}

impl GatherCounts {
    fn add(&mut self, points: u32, directions: u32, layers: u32, seconds: f64) {
        self.directions += directions;
        self.layers_sum += u64::from(layers) * u64::from(directions);
        self.samples += u64::from(points) * u64::from(directions);
        self.layers_max = self.layers_max.max(layers);
        self.layers_mean = self.layers_sum as f64 / f64::from(self.directions);
        self.ms_per_direction = 1e3 * seconds / f64::from(self.directions);
        self.samples_per_second = self.samples as f64 / seconds;
    }
}
