//! Who receives: each makes points of a scene, and files of the values found there.

use std::f32::consts::FRAC_1_PI;
use std::path::{Path, PathBuf};

use finalgather::bake::vertex_inset;
use finalgather::error::{Error, Result};
use finalgather::export::{self, ExportMesh, Lightmap, PointValues};
use finalgather::gpu::Gpu;
use finalgather::image::{self, Channel, Image, WriteOptions};
use finalgather::points::{
    CameraPoints, GatherPoint, LightMap, LightMapCounts, LightMapOptions, Mended, Resolution, VertexCounts, Vertices, file,
};
use finalgather::prepared::Prepared;
use finalgather::quantity::Quantity;
use finalgather::scene::{Camera, Mesh, Scene};
use finalgather::settings::Settings;
use glam::{Vec2, Vec3};
use serde::Serialize;

use crate::args::{BakeArgs, To};

/// Endings of pictures.
const PICTURES: [&str; 2] = ["exr", "png"];

/// A source of points, with the way back to what it is made of.
pub enum Receiver {
    Vertices(Vertices),
    LightMap(Box<LightMap>),
    /// One point through the middle of each pixel that sees a surface, and which pixel that is, row by row from the top.
    Camera {
        size: [u32; 2],
        points: Vec<GatherPoint>,
        pixels: Vec<usize>,
    },
    /// And positions as they are in the file.
    Points {
        points: Vec<GatherPoint>,
        world: Vec<Vec3>,
    },
}

/// What became of a receiver's points.
#[derive(Serialize)]
#[serde(untagged)]
pub enum Counts {
    Vertices(VertexCounts),
    LightMap {
        #[serde(flatten)]
        layout: LightMapCounts,
        #[serde(flatten)]
        mended: Mended,
    },
    Camera {
        pixels: usize,
    },
    Points {
        points: usize,
    },
}

impl Receiver {
    pub fn new(to: &To, args: &BakeArgs, gpu: &Gpu, prepared: &Prepared, settings: &Settings) -> Result<Self> {
        let mesh = &prepared.scene.mesh;
        Ok(match to {
            To::Vertices => Self::Vertices(Vertices::new(mesh, vertex_inset(settings))),
            To::LightMap => {
                let world = prepared.space.length_to_world(1.0);
                let resolution = match (args.texels_per_unit, args.resolution) {
                    (Some(texels), _) => Resolution::TexelsPerUnit(texels * world),
                    (None, side) => Resolution::Pixels(side),
                };
                let options = LightMapOptions {
                    resolution,
                    uvs: args.uvs,
                    padding: args.padding,
                    samples_per_texel: args.samples_per_texel,
                };
                Self::LightMap(Box::new(LightMap::new(mesh, &options)?))
            }
            To::Camera => {
                let size = settings.size;
                let mut camera = prepared.scene.camera;
                if prepared.scene.framed {
                    camera = Camera::framing(mesh.bounds(), size);
                }
                let visible = CameraPoints::new(gpu, size)?.see(&prepared.geometry, &camera, Vec2::splat(0.5));
                // As they would be written and read again, so that the same points in a file give the same values to the bit.
                let through_world = |point: GatherPoint| GatherPoint {
                    position: prepared.space.enter_point(prepared.space.to_world(point.position)),
                    ..point
                };
                let [width, height] = size.map(|side| side as usize);
                let from_top = |i: usize| (height - 1 - i / width) * width + i % width;
                let seen = visible.pixels().into_iter().enumerate().filter_map(|(i, point)| Some((from_top(i), point?)));
                let (pixels, points): (Vec<_>, Vec<_>) = seen.map(|(pixel, point)| (pixel, through_world(point))).unzip();
                if points.is_empty() {
                    return Err(Error::usage("the camera sees no surface", "turn it in the scene file"));
                }
                Self::Camera { size, points, pixels }
            }
            To::Points(path) => {
                let read = file::read(path)?;
                let world = read.iter().map(|point| point.position).collect();
                let enter =
                    |point: &file::OrientedPoint| GatherPoint::flat(prepared.space.enter_point(point.position), point.normal);
                Self::Points { points: read.iter().map(enter).collect(), world }
            }
        })
    }

    pub fn name(&self) -> &'static str {
        match self {
            Self::Vertices(_) => To::VERTICES,
            Self::LightMap(_) => To::LIGHT_MAP,
            Self::Camera { .. } => To::CAMERA,
            Self::Points { .. } => To::POINTS,
        }
    }

    /// In unit space.
    pub fn points(&self) -> &[GatherPoint] {
        match self {
            Self::Vertices(vertices) => vertices.points(),
            Self::LightMap(map) => map.points(),
            Self::Camera { points, .. } | Self::Points { points, .. } => points,
        }
    }

    /// In sentences for a person.
    pub fn warnings(&self) -> &[String] {
        match self {
            Self::LightMap(map) => map.warnings(),
            _ => &[],
        }
    }

    /// Writes `columns`, a value for each of the points, to all files that take them. Returns what became of the points, and what could not be
    /// written.
    pub fn write(
        &self,
        mut columns: Vec<Channel>,
        inside: &[f32],
        paths: &[PathBuf],
        scene: &Scene,
        prepared: &Prepared,
        options: &WriteOptions,
    ) -> (Counts, Vec<Error>) {
        let normals: Vec<Vec3> = self.points().iter().map(|point| point.normal).collect();
        let world_of = |mesh: &Mesh| Mesh {
            positions: mesh.positions.iter().map(|&position| prepared.space.to_world(position)).collect(),
            ..mesh.clone()
        };
        let surface_of = |mesh| ExportMesh { mesh, materials: &scene.materials, textures: &scene.textures };
        let write_all = |write: &dyn Fn(&Path) -> Result<()>| paths.iter().filter_map(|path| write(path).err()).collect();
        match self {
            Self::Vertices(vertices) => {
                let counts = vertices.fill(&mut columns, inside);
                let mesh = &world_of(vertices.mesh());
                let surface = Some(surface_of(mesh));
                let values = PointValues { positions: &mesh.positions, normals: &normals, columns: &columns, surface };
                (Counts::Vertices(counts), write_all(&|path| values.write(path, options)))
            }
            Self::LightMap(map) => {
                let (image, mended) = map.image(&columns, inside);
                let mesh = &world_of(map.mesh());
                let light = irradiance_of(&image);
                let write = |path: &Path| match &light {
                    _ if is_picture(path) => write_picture(&image, path, options),
                    Some(irradiance) => Lightmap { surface: surface_of(mesh), uvs: &mesh.uvs, irradiance }.write(path, options),
                    None => Err(no_light(path)),
                };
                (Counts::LightMap { layout: map.counts().clone(), mended }, write_all(&write))
            }
            Self::Camera { size, points, pixels } => {
                let image = || {
                    let [width, height] = size.map(|side| side as usize);
                    let spread = |samples: &[f32]| {
                        let mut plane = vec![0.0; width * height];
                        pixels.iter().zip(samples).for_each(|(&pixel, &sample)| plane[pixel] = sample);
                        plane
                    };
                    let named = |column: &Channel| Channel { name: column.name.clone(), samples: spread(&column.samples) };
                    let mut channels: Vec<_> = columns.iter().map(named).collect();
                    channels.push(Channel { name: "A".into(), samples: spread(&vec![1.0; pixels.len()]) });
                    Image { width, height, channels }
                };
                let world: Vec<Vec3> = points.iter().map(|point| prepared.space.to_world(point.position)).collect();
                let values = PointValues { positions: &world, normals: &normals, columns: &columns, surface: None };
                let write = |path: &Path| match is_picture(path) {
                    true => write_picture(&image(), path, options),
                    false => values.write(path, options),
                };
                (Counts::Camera { pixels: pixels.len() }, write_all(&write))
            }
            Self::Points { world, .. } => {
                let values = PointValues { positions: world, normals: &normals, columns: &columns, surface: None };
                (Counts::Points { points: world.len() }, write_all(&|path| values.write(path, options)))
            }
        }
    }
}

/// Whether what is baked to this receiver can be expected to be written there, for asking before the work.
pub fn check_writable(to: &To, path: &Path, what: &[Quantity]) -> Result<()> {
    let shown =
        |quantity: &Quantity| matches!(quantity, Quantity::Irradiance | Quantity::Ao | Quantity::BentNormal | Quantity::Sky);
    if is_png(path) && !what.iter().any(shown) {
        let problem = format!("{}: coefficients make no picture", path.display());
        return Err(Error::usage(
            problem,
            "write .exr or .npy, or add what a picture can show: irradiance, ao, bent-normal or sky",
        ));
    }
    match to {
        To::Vertices => export::check_writable(path, PointValues::ENDINGS),
        // Without a mesh there is nothing that glTF could hold but points, which PLY does.
        To::Points(_) => export::check_writable(path, &["ply", "npy"]),
        To::Camera if is_picture(path) => image::check_writable(path),
        To::Camera => export::check_writable(path, &["exr", "png", "ply", "npy"]),
        To::LightMap if is_picture(path) => image::check_writable(path),
        To::LightMap => {
            export::check_writable(path, &["exr", "png", "obj", "glb"])?;
            what.contains(&Quantity::Irradiance).then_some(()).ok_or_else(|| no_light(path))
        }
    }
}

fn is_picture(path: &Path) -> bool {
    path.extension().and_then(|ending| ending.to_str()).is_some_and(|ending| PICTURES.contains(&ending.to_lowercase().as_str()))
}

/// The irradiance of a map as a picture of its own.
fn irradiance_of(image: &Image) -> Option<Image> {
    let channel =
        |name: &str| Some(Channel { name: name.into(), samples: image.channel(&format!("Irradiance.{name}"))?.to_vec() });
    let channels = vec![channel("R")?, channel("G")?, channel("B")?];
    Some(Image { channels, ..*image })
}

/// With the channels that make a picture: irradiance as it is; in a PNG what a white surface sends back of it, as a display shows light. Without irradiance,
/// what there is first, in a PNG as data: a direction as colour, else one number as grey.
fn write_picture(image: &Image, path: &Path, options: &WriteOptions) -> Result<()> {
    let exr = !is_png(path);
    let mut picture = image.clone();
    let mut shown = irradiance_of(image).map(|image| image.channels).unwrap_or_default();
    if shown.is_empty() {
        // Never empty: something is baked, and has one column or three at least.
        let name = |k: usize| ["R", "G", "B"][k].to_owned();
        let named = |name: &str| image.channels.iter().position(|channel| channel.name == name);
        let first = ["AO", "BentNormal.X", "Sky"].into_iter().filter_map(named).min().unwrap_or(0);
        let is_direction = image.channels[first].name == "BentNormal.X";
        let of = |k: usize| first + if image.channels[first].name.contains('.') { k } else { 0 };
        let value = |x: &f32| if is_direction { 0.5 * x + 0.5 } else { *x };
        shown = (0..3)
            .map(|k| Channel { name: name(k), samples: image.channels[of(k)].samples.iter().map(value).collect() })
            .collect();
    } else if !exr {
        shown.iter_mut().flat_map(|channel| &mut channel.samples).for_each(|sample| *sample *= FRAC_1_PI);
    }
    let light = irradiance_of(image).is_some();
    picture.channels.extend(shown);
    if exr || light { picture.write(path, options) } else { picture.write_data_png(path) }
}

fn is_png(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("png"))
}

fn no_light(path: &Path) -> Error {
    Error::usage(
        format!("{}: a model with its light map shows irradiance, and none was baked", path.display()),
        "add irradiance to --what, or write .exr or .png",
    )
}
