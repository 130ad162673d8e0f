//! The job that renders a picture.

use std::iter::successors;
use std::ops::Range;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::outputs::{are_finished, metadata};
use super::report::{TaskReport, TaskSeconds};
use super::{DeviceRequest, Request, SceneRequest, Task, Watch};
use crate::blocks::{Blocks, Part};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::image::{Image, WriteOptions, check_writable};
use crate::render::{Render, Statistics, blocks_of, memory_of};
use crate::scene::Scene;
use crate::settings::{PointSource, Settings};

/// A picture of a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RenderRequest {
    pub scene: SceneRequest,
    /// `.png` or `.exr`.
    pub outputs: Vec<PathBuf>,
    /// MiB that the render may take.
    pub memory: Option<usize>,
    pub device: DeviceRequest,
}

struct RenderTask<'a> {
    render: Render,
    outputs: &'a [PathBuf],
    /// Directions of this run: all, or those of the shard.
    directions: u32,
}

impl Request for RenderRequest {
    fn scene(&self) -> &SceneRequest {
        &self.scene
    }

    fn device(&self) -> DeviceRequest {
        self.device
    }

    fn outputs(&self) -> Vec<PathBuf> {
        self.outputs.clone()
    }

    fn check_outputs(&self) -> Result<()> {
        self.outputs.iter().try_for_each(|path| check_writable(path))
    }

    fn needs_light(&self) -> bool {
        true
    }

    fn settings(&self, of_scene: &Settings) -> Result<Settings> {
        let settings = self.scene.settings(of_scene)?;
        settings.validate()?;
        Ok(settings)
    }

    fn blocks(&self, settings: &Settings) -> Blocks {
        blocks_of(settings)
    }

    fn check(&self, scene: &Scene, settings: &Settings, shard: Option<&Range<u32>>, watch: &mut dyn Watch) -> Result<()> {
        if settings.points == PointSource::Camera && (scene.is_specular() || scene.camera.lens.is_some()) {
            watch.say("warning: mirrors and glass are drawn as diffuse, through a pinhole; --points traced shows what they are");
        }
        if shard.is_some() && settings.until > 0.0 {
            return Err(Error::usage("a shard cannot tell the error of the whole picture", "give --target-error 0"));
        }
        self.memory.map_or(Ok(()), |allowed| check_memory(allowed as u64, scene, settings, shard))
    }

    fn begin<'a>(
        &'a self,
        gpu: &Gpu,
        scene: &'a Scene,
        settings: &Settings,
        shard: Option<Range<u32>>,
        watch: &mut dyn Watch,
    ) -> Result<Box<dyn Task + 'a>> {
        watch.stage("tracing photons");
        let mut render = Render::new(gpu, scene, settings)?;
        let blocks = blocks_of(settings);
        let directions = blocks.directions(shard.clone().unwrap_or(0..blocks.count())).len() as u32;
        if let Some(shard) = shard {
            render.only(shard);
        }
        Ok(Box::new(RenderTask { render, outputs: &self.outputs, directions }))
    }
}

impl Task for RenderTask<'_> {
    fn step(&mut self) -> Result<()> {
        self.render.step()
    }

    fn is_done(&self) -> bool {
        self.render.is_done()
    }

    fn is_between_blocks(&self) -> bool {
        self.render.is_between_blocks()
    }

    fn directions(&self) -> [u64; 2] {
        [self.render.directions_done().into(), self.directions.into()]
    }

    fn has_values(&self) -> bool {
        self.render.directions_done() > 0
    }

    fn save(&self) -> Part<'_> {
        self.render.save()
    }

    fn resume(&mut self, path: &Path, part: &Part) -> Result<()> {
        self.render.resume(path, part)
    }

    fn is_written(&self) -> bool {
        let exposure = self.render.settings().exposure;
        are_finished(self.outputs, &metadata(&self.render.job(), exposure, Value::Null, (self.directions, true)))
    }

    fn write(&mut self, watch: &mut dyn Watch) -> Vec<Error> {
        let image = self.render.picture();
        if is_black(&image) {
            watch.say("warning: the picture is black: the camera sees no surface that light reaches; turn it or the lights");
        }
        let done = (self.render.directions_done(), self.render.is_done());
        write_picture(&image, self.outputs, &self.render.job(), self.render.settings().exposure, done)
    }

    fn kind(&self) -> &'static str {
        "picture"
    }

    fn report(&self, _: bool, outputs: Vec<String>) -> (TaskReport, TaskSeconds) {
        let Statistics { scene, seconds, gather, photons, error } = *self.render.statistics();
        (TaskReport::Render { scene, gather, photons, error, outputs }, TaskSeconds::Render(seconds))
    }
}

/// Writes every file that can be written: a render may have taken long. Returns why the others cannot.
pub(super) fn write_picture(image: &Image, outputs: &[PathBuf], job: &Value, exposure: f32, done: (u32, bool)) -> Vec<Error> {
    let metadata = metadata(job, exposure, Value::Null, done);
    let options = WriteOptions { exposure, metadata: Some(&metadata) };
    outputs.iter().filter_map(|path| image.write(path, &options).err()).collect()
}

/// Whether nothing is brighter than a millionth of what the brightest light would show.
fn is_black(image: &Image) -> bool {
    image.rgb().is_ok_and(|channels| channels.iter().all(|channel| channel.iter().all(|&sample| sample < 1e-6)))
}

/// Whether the render, or a shard of these blocks, fits into so many MiB.
fn check_memory(allowed: u64, scene: &Scene, settings: &Settings, shard: Option<&Range<u32>>) -> Result<()> {
    let blocks = |settings: &Settings| shard.map_or(blocks_of(settings).count(), |shard| shard.len() as u32);
    let of = |settings: &Settings| memory_of(scene, settings, blocks(settings), shard.is_some()).div_ceil(1 << 20);
    let (needed, fits) = (of(settings), |settings: &Settings| of(settings) <= allowed);
    if needed <= allowed {
        return Ok(());
    }
    let smaller = successors(Some(settings.size), |size| Some(size.map(|side| side * 15 / 16)));
    let smaller = smaller.take_while(|size| !size.contains(&0)).find(|&size| fits(&Settings { size, ..settings.clone() }));
    let fewer = successors(Some(settings.directions).filter(|_| shard.is_none()), |directions| Some(directions / 2));
    let fewer = fewer.take_while(|&directions| directions > 0);
    let fewer = { fewer }.find(|&directions| fits(&Settings { directions, ..settings.clone() }));
    let smaller = smaller.map(|[width, height]| format!("--size {width}x{height}"));
    let cures = smaller.into_iter().chain(fewer.map(|directions| format!("--directions {directions}")));
    let cure = cures.chain([format!("--memory {needed}")]).collect::<Vec<_>>().join(" or ");
    Err(Error::usage(format!("the render may take {needed} MiB, and --memory allows {allowed}"), format!("give {cure}")))
}
