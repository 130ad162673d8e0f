//! Renders a picture of a scene, from photons to pixels. The tool, the tests and the figures run this job.
//!
//! [`Render::new`] prepares the scene; each [`Render::step`] gathers along a few more directions; [`Render::picture`] is the mean so far.
//!
//! Directions come in blocks; a block has a power of two of them. Each block has its own sub-pixel offset and its own samples on the lights, so
//! anti-aliasing and soft shadows need no extra gather work. The sums of a block are independent of all other blocks: several machines may do a
//! shard each ([`Render::only`]), and a render that ended early can go on from its finished blocks ([`Render::save`], [`Render::resume`]).
//! Long renders trace fresh photons now and then, so that photon noise averages out as the noise of the directions does.

mod gloss;
mod ground;
mod layer_view;
mod merge;
mod method;
mod restart;
mod source;
mod statistics;
mod sums;

use std::ops::Range;
use std::path::Path;
use std::rc::Rc;
use std::time::Instant;

use glam::{Vec3, Vec4};
use rayon::prelude::*;
use serde_json::{Value, json};

use crate::blocks::Part;
use crate::direct::{Direct, STRIDE, SampleShare, direct_light_on_cpu};
use crate::direction::{Direction, Directions};
use crate::error::Result;
use crate::film::FilmSum;
use crate::gather::{GatherInputs, IrradianceGather};
use crate::geometry::Geometry;
use crate::gpu::Gpu;
use crate::photon::CausticMap;
use crate::photon_map::PhotonMap;
use crate::points::packets::SubsetPackets;
use crate::points::{GBuffer, GatherPoint, Interleave, sides};
use crate::prepared::{Photons, Prepared};
use crate::random::sobol;
use crate::reference::Reference;
use crate::scene::{Camera, Rays, World};
use crate::settings::{DIRECTIONS_PER_PHOTON_MAP, PhotonMapKind, Settings};

use self::gloss::caustic_light;
use self::ground::ShadowCatcher;
use self::merge::{FILM, film_of_part};
use self::method::{method, seen, view_of};
use self::source::{PixelSource, View};
use self::statistics::layer_size;

pub use crate::memory::of_render as memory_of;
pub use layer_view::{End, LayerTexel, Layers, Probe, SeenSurface};
pub use merge::{RenderMerge, blocks_of};
pub use statistics::{GatherCounts, RenderStatistics, SceneCounts, StageSeconds};

/// A render in progress.
pub struct Render {
    gpu: Gpu,
    /// With the pipeline that `auto` stands for, and as they were given.
    settings: Settings,
    asked: Settings,
    all: Rc<Prepared>,
    /// The scene without glass, for gather rays.
    gathered: Rc<Prepared>,
    /// The GL side of `all`, and below of `gathered`.
    geometry: Rc<Geometry>,
    gathered_geometry: Rc<Geometry>,
    /// In unit space.
    camera: Camera,
    catcher: Option<ShadowCatcher>,
    photons: Photons,
    passes: Passes,
    directions: Directions,
    /// Checksums of the scene.
    digest: Value,
    /// The view to which the photons are guided: the first one, also after a restart elsewhere.
    guided: String,
    /// The blocks to do; `None`: all.
    shard: Option<Range<u32>>,
    /// The block in progress.
    block: Option<Block>,
    /// Directions gathered so far, with those of the block in progress.
    done: u32,
    film: FilmSum,
    /// Whether the target error is reached.
    reached: bool,
    statistics: RenderStatistics,
}

/// All passes and their targets. Other settings need new ones.
struct Passes {
    source: PixelSource,
    direct: Direct,
    photon_map: PhotonMap,
    interleave: Interleave,
    /// Holds the sums of the block in progress.
    gather: IrradianceGather,
    /// The passes of the layer view, once it is used.
    shown: Option<layer_view::Apart>,
}

/// A run of consecutive directions with one sub-pixel offset.
struct Block {
    index: u32,
    g_buffer: GBuffer,
    /// Irradiance from the lights at the visible points.
    direct: Vec<Vec3>,
    /// Irradiance of the photon map at the visible points.
    photon_map: Vec<Vec4>,
    /// Irradiance of caustics at the visible points; empty in scenes without.
    caustics: Vec<Vec3>,
    /// In scenes with gloss what lobes reflect of lights, and in those with caustics of caustics; else empty.
    lobes: [Vec<Vec3>; 2],
    /// The directions left, grouped by subset of the pixels, so that a batch has one subset. The last one is next.
    left: Vec<u32>,
    /// Number of directions gathered so far at each subset of the pixels.
    taken: Vec<u32>,
}

impl Render {
    /// Traces the photons and prepares the GL side.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] when a setting is out of range or beyond the device's limits; [`crate::Error::Gl`] when the device
    /// fails.
    pub fn new(gpu: &Gpu, world: &World, settings: &Settings) -> Result<Self> {
        let begun = Instant::now();
        settings.validate()?;
        let [all, gathered] = Prepared::both(world)?;
        let geometry = Rc::new(Geometry::upload(gpu, &all.scene)?);
        let gathered_geometry = match Rc::ptr_eq(&all, &gathered) {
            true => Rc::clone(&geometry),
            false => Rc::new(Geometry::upload(gpu, &gathered.scene)?),
        };
        let (scene, camera) = (&all.scene, all.scene.camera(settings.film.size));
        let seen = seen(&gathered, &camera, settings.film.size);
        let asked = *settings;
        let (settings, interleave) = &method(gpu.is_software(), [&all, &gathered], (&camera, &seen), settings);
        let mut passes = Passes::new(gpu, &gathered, settings, *interleave)?;

        let start = Instant::now();
        let of = (&settings.photons, settings.seed);
        let photons = Photons::new(gpu, [&all, &gathered], of, &sides(&seen), || passes.gather.shrink())?;
        let mut statistics = RenderStatistics {
            scene: SceneCounts { triangles: scene.mesh.triangles.len(), lights: all.lights.count() },
            photons: photons.counts,
            ..RenderStatistics::default()
        };
        gpu.finish();
        gpu.check("preparing a render")?;
        statistics.seconds.photons = start.elapsed().as_secs_f64();
        statistics.gather.layer_size = layer_size(settings);
        let mut render = Self {
            gpu: gpu.clone(),
            directions: Directions::new(settings.directions.sequence, settings.seed),
            settings: *settings,
            asked,
            digest: scene.digest(),
            guided: view_of(&camera, settings),
            catcher: ShadowCatcher::new(scene, &camera, settings.film.ground),
            all,
            gathered,
            geometry,
            gathered_geometry,
            camera,
            photons,
            passes,
            shard: None,
            block: None,
            done: 0,
            film: FilmSum::default(),
            reached: false,
            statistics,
        };
        let StageSeconds { prepare, photons, .. } = &mut render.statistics.seconds;
        *prepare = begun.elapsed().as_secs_f64() - *photons;
        Ok(render)
    }

    /// Warnings for the user.
    pub fn warnings(&self) -> Vec<String> {
        self.gathered.warnings()
    }

    /// The settings of the render, with the pipeline that `auto` stands for.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Whether the GL context is lost. Then the render cannot go on.
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

    /// Restricts the render to a shard: these blocks, of [`blocks_of`] its settings.
    pub fn only(&mut self, blocks: Range<u32>) {
        self.shard = Some(blocks);
    }

    /// Identifies the sums of this render: everything that changes their bits.
    pub fn job(&self) -> Value {
        json!({
            "what": "render",
            "version": env!("CARGO_PKG_VERSION"),
            "gl": self.gpu.identity(),
            "scene": self.digest,
            "space": self.all.scene.space,
            "camera": format!("{:?}", self.camera),
            "settings": self.settings.of_sums(),
            "interleave": self.passes.interleave,
            "guided": (self.settings.photons.map == PhotonMapKind::Surface).then_some(&self.guided),
        })
    }

    /// The finished blocks.
    pub fn save(&self) -> Part<'_> {
        let mut part = Part::new(self.job(), json!({ "display": self.settings.display }));
        part.put_tree(FILM, &self.film);
        part
    }

    /// Replaces all gathered sums by the finished blocks of `part`, read from `path`, and goes on from there.
    ///
    /// # Errors
    /// [`crate::Error::Input`] when `part` belongs to another job or is damaged.
    pub fn resume(&mut self, path: &Path, part: &Part) -> Result<()> {
        part.check(path, &self.job())?;
        let film = film_of_part(path, part, &self.settings, blocks_of(&self.settings))?;
        self.forget();
        self.film = film;
        self.done = blocks_of(&self.settings).summed(&self.film);
        self.estimate_error();
        Ok(())
    }

    /// Whether no block is in progress. A render that ends here loses nothing.
    pub fn is_between_blocks(&self) -> bool {
        self.block.is_none()
    }

    /// The first block of the shard that is not done.
    fn next_block(&self) -> Option<u32> {
        let mine = self.shard.clone().unwrap_or(0..blocks_of(&self.settings).count());
        Some(self.film.missing(mine).first()?.start)
    }

    pub fn statistics(&self) -> &RenderStatistics {
        &self.statistics
    }

    /// Gathers along the next batch of directions, if any are left. When memory runs out, the block begins again with smaller batches.
    ///
    /// # Errors
    /// [`crate::Error::Gl`] when the device fails; finished blocks stay.
    pub fn step(&mut self) -> Result<()> {
        if self.is_done() {
            return Ok(());
        }
        let before = self.done - self.block.as_ref().map_or(0, |block| self.taken(block));
        self.gather_some().or_else(|error| {
            // After a failure the sums of the block are lost or not to be trusted.
            self.done = before;
            if self.gpu.goes_on(&error) && self.passes.gather.shrink() { Ok(()) } else { Err(error) }
        })
    }

    fn gather_some(&mut self) -> Result<()> {
        let mut block = match (self.block.take(), self.next_block()) {
            (Some(block), _) => block,
            (None, Some(index)) => self.begin_block(index)?,
            (None, None) => return Ok(()),
        };
        self.gather_directions(&mut block)?;
        if !block.left.is_empty() {
            self.block = Some(block);
            return Ok(());
        }
        self.end_block(block)
    }

    /// Prepares block `index`: photons, visible points, direct light and caustics.
    fn begin_block(&mut self, index: u32) -> Result<Block> {
        let blocks = blocks_of(&self.settings);
        let directions = blocks.directions(index..index + 1);

        let map = u64::from(directions.start / DIRECTIONS_PER_PHOTON_MAP);
        if map != self.photons.number {
            let start = Instant::now();
            self.photons.renew(&self.gpu, &self.all, map)?;
            self.statistics.photons = self.photons.counts;
            self.statistics.seconds.photons += self.finish("uploading photons", start)?;
        }

        let start = Instant::now();
        let offset = sobol(index, self.settings.seed);
        let view =
            View { gpu: &self.gpu, all: &self.all, geometry: &self.geometry, camera: &self.camera, settings: &self.settings };
        let ground = self.catcher.as_ref().map(|catcher| catcher.ground);
        let g_buffer = self.passes.source.see(view, ground, offset.into(), index)?;
        let points = self.passes.source.points(&g_buffer);
        let photon_map = self.passes.photon_map.see(&self.photons, &self.all.scene, points, &g_buffer);
        self.statistics.seconds.visible_points += self.finish("finding visible points", start)?;

        let start = Instant::now();
        let share = SampleShare { samples: self.settings.direct.light_samples, part: index, parts: blocks.count() };
        let (pixels, mut packets) = (g_buffer.pixels(), None);
        let Prepared { scene, bvh, lights } = &*self.all;
        let [mut direct, lobes] = if self.gpu.is_software() && lights.are_sampled() {
            let of_squares = SubsetPackets::of_picture(&pixels, self.settings.film.size, STRIDE);
            let packets = packets.insert(of_squares);
            direct_light_on_cpu(Rays::new(scene, bvh), lights, (share, self.settings.seed), packets, &g_buffer.gloss)
        } else {
            self.passes.direct.light(&self.geometry, lights, share, points)?
        };
        self::gloss::even_out(&mut direct, &g_buffer.gloss);
        self.statistics.seconds.direct += self.finish("direct light", start)?;
        let start = Instant::now();
        let [caustics, focused] = self.caustics(index, &g_buffer);
        self.statistics.seconds.caustics += start.elapsed().as_secs_f64();

        let start = Instant::now();
        self.passes.gather.begin_glossy(&pixels, &g_buffer.gloss, packets);
        self.statistics.seconds.gather += start.elapsed().as_secs_f64();
        self.statistics.gather.points = g_buffer.count;
        self.statistics.gather.cut += u64::from(g_buffer.cut);
        let mut left: Vec<u32> = self.passes.interleave.numbers(directions).rev().collect();
        left.sort_by_key(|&direction| self.passes.interleave.subset(direction, index).index());
        let taken = vec![0; self.passes.interleave.subsets()];
        Ok(Block { index, g_buffer, direct, photon_map, caustics, lobes: [lobes, focused], left, taken })
    }

    /// Irradiance by way of mirrors, glass and narrow lobes at the points of a block, and what their lobes reflect of it. Each block has its own caustic
    /// photons. Both are empty in a scene without caustics.
    fn caustics(&self, block: u32, g_buffer: &GBuffer) -> [Vec<Vec3>; 2] {
        if !self.all.scene.has_caustics() {
            return [Vec::new(), Vec::new()];
        }
        let (settings, seed) = (&self.settings.photons, self.settings.seed);
        let photons = self.all.photons(settings, seed).caustics(settings.numbers(block.into()));
        let map = CausticMap::new(photons, block);
        let gloss = |pixel: usize| g_buffer.gloss.get(pixel);
        let see = |(pixel, point): (usize, Option<GatherPoint>)| {
            point.map_or([Vec3::ZERO; 2], |point| caustic_light(&map, &point, gloss(pixel)))
        };
        let (bases, mut lobes): (Vec<_>, Vec<_>) =
            g_buffer.pixels().into_par_iter().enumerate().map(see).map(|[base, lobe]| (base, lobe)).unzip();
        lobes.truncate(g_buffer.gloss.len());
        [bases, lobes]
    }

    fn gather_directions(&mut self, block: &mut Block) -> Result<()> {
        let start = Instant::now();
        let batch = self.passes.gather.batch();
        let subset_of = |&direction: &u32| self.passes.interleave.subset(direction, block.index);
        let Some(subset) = block.left.last().map(subset_of) else { return Ok(()) };
        let numbers: Vec<u32> =
            block.left.iter().rev().take(batch).take_while(|&direction| subset_of(direction) == subset).copied().collect();
        let directions: Vec<Direction> = numbers.iter().map(|&number| self.direction(number)).collect();
        let points = self.passes.source.points(&block.g_buffer).only(subset);
        let Prepared { scene, bvh, .. } = &*self.gathered;
        let oracle = Reference::new(scene, bvh, self.photons.map.store());
        let (geometry, photons) = (&*self.gathered_geometry, &self.photons.texture);
        let layers = self.passes.gather.add(GatherInputs { scene, geometry, photons, oracle, points }, &directions)?;
        self.statistics.seconds.gather += self.finish("final gathering", start)?;
        let before = self.taken(block);
        block.left.truncate(block.left.len() - numbers.len());
        block.taken[subset.index()] += numbers.len() as u32;
        self.done += self.taken(block) - before;
        let interleave = &self.passes.interleave;
        self.statistics.gather.add(points.count, numbers.len() as u32, interleave, layers, self.statistics.seconds.gather);
        Ok(())
    }

    /// Directions are in the camera's frame, so that a scene turned together with its camera gives the same picture.
    fn direction(&self, number: u32) -> Direction {
        let direction = self.directions.get(number);
        Direction { vector: self.camera.axes() * direction.vector, ..direction }
    }

    /// Directions of a block so far, as the settings count them.
    fn taken(&self, block: &Block) -> u32 {
        self.passes.interleave.directions(block.taken.iter().sum())
    }

    /// Waits for the device and returns the seconds since `start`.
    fn finish(&self, stage: &str, start: Instant) -> Result<f64> {
        self.gpu.finish();
        self.gpu.check(stage)?;
        Ok(start.elapsed().as_secs_f64())
    }
}

impl Passes {
    /// `gathered` is the scene without glass, for gather rays.
    fn new(gpu: &Gpu, gathered: &Prepared, settings: &Settings, interleave: Interleave) -> Result<Self> {
        let points = settings.film.size;
        let source = PixelSource::new(gpu, settings)?;
        let glossy = gathered.scene.is_glossy();
        let direct = Direct::new(gpu, settings.seed)?;
        let photon_map = PhotonMap::new(gpu, settings.photons.map, points)?;
        // The gather comes last: it adapts to the memory that is left.
        let gather = IrradianceGather::with(gpu, settings, (&gathered.scene, &gathered.bvh), interleave, glossy)?;
        Ok(Self { source, direct, photon_map, interleave, gather, shown: None })
    }
}
