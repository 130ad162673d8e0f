//! Receivers of a bake. A receiver places points in a scene, and makes files of the values at these points.

use std::f32::consts::FRAC_1_PI;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::per_source::normalize_directions;
use crate::bake::{BakePoints, MOST_TURNS, PointRun, Turn, vertex_inset};
use crate::blocks::Part;
use crate::error::{Error, Result};
use crate::export::{self, ExportMesh, ExportSource, Lightmap, MapValues, PointValues, Positions, SourceMap};
use crate::image::{self, Channel, Image, WriteOptions};
use crate::points::{GBuffer, GatherPoint, LightMap, LightMapOptions, Resolution, Vertices, file};
use crate::quantity::Quantity;
use crate::scene::{Mesh, Scene, UnitSpace};
use crate::settings::Settings;

/// File endings of pictures.
const PICTURES: [&str; 2] = ["exr", "png"];
/// Tensors in a part: pixels and points that the camera sees.
const CAMERA_PIXELS: &str = "camera/pixels";
const CAMERA_POINTS: &str = "camera/points";

/// Where a bake computes values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ReceiverKind {
    /// The scene's vertices.
    Vertices,
    /// Texels of a light map over the scene's surfaces.
    LightMap,
    /// The surface at the centre of each pixel.
    Camera,
    /// Points of a `.ply`, `.npy` or `.csv` file, in world space.
    Points(PathBuf),
    /// The same in memory. A part cannot name them.
    #[serde(skip)]
    PointList(Arc<[file::OrientedPoint]>),
}

/// The points of a receiver, with the data to map their values back.
pub enum Receiver {
    Vertices(Vertices),
    LightMap(Box<LightMap>),
    /// One point for each pixel that sees a surface, with the index of the pixel, row by row from the top.
    Camera {
        size: [u32; 2],
        points: Vec<GatherPoint>,
        pixels: Vec<u32>,
    },
    Points {
        points: Vec<GatherPoint>,
        /// Positions in world space, as in the file.
        world: Vec<DVec3>,
    },
}

/// Values of a receiver in world space, for files.
#[derive(Debug)]
pub struct ReceiverValues {
    /// Statistics of the points.
    pub counts: Value,
    /// Of the points, or of the vertices of `mesh`.
    pub positions: Vec<DVec3>,
    /// See [`UnitSpace::local_origin`].
    pub origin: DVec3,
    pub normals: Vec<Vec3>,
    /// Empty for a light map.
    pub columns: Vec<Channel>,
    /// The surface of vertices and light maps. Its own positions are in unit space. For a light map, its texture coordinates are those in the map.
    pub mesh: Option<Mesh>,
    /// For light maps, and for the camera if pictures are wanted: one channel for each column.
    pub image: Option<Image>,
}

impl ReceiverKind {
    pub const NAMES: [&str; 4] = ["vertices", "lightmap", "camera", "points"];

    pub fn name(&self) -> &'static str {
        let index = match self {
            Self::Vertices => 0,
            Self::LightMap => 1,
            Self::Camera => 2,
            Self::Points(_) | Self::PointList(_) => 3,
        };
        Self::NAMES[index]
    }

    /// Number of parts of the directions that the points take in turns: see [`Turn`].
    pub(super) fn turns(&self, light_map: &LightMapOptions, settings: &Settings) -> u32 {
        if *self == Self::LightMap { light_map.turns(settings.directions.count, MOST_TURNS) } else { 1 }
    }

    /// Refuses a file that cannot hold the quantities `what` of this receiver. Call it before the work.
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub fn check_writable(&self, path: &Path, what: &[Quantity]) -> Result<()> {
        let shown =
            |quantity: &Quantity| matches!(quantity, Quantity::Irradiance | Quantity::Ao | Quantity::BentNormal | Quantity::Sky);
        if is_png(path) && !what.iter().any(shown) {
            let problem = format!("{}: coefficients make no picture", path.display());
            let cure = "write .exr or .npy, or add what a picture can show: irradiance, ao, bent-normal or sky";
            return Err(Error::usage(problem, cure));
        }
        match self {
            Self::LightMap | Self::Camera if is_picture(path) => image::check_writable(path),
            Self::Vertices => export::check_writable(path, PointValues::ENDINGS),
            // PLY serves points without a mesh as well as glTF would.
            Self::Points(_) | Self::PointList(_) => export::check_writable(path, &["ply", "npy", "npz"]),
            Self::Camera => export::check_writable(path, &["exr", "png", "ply", "npy", "npz"]),
            Self::LightMap => {
                export::check_writable(path, &["exr", "png", "obj", "glb", "npz"])?;
                let serves = |quantity: &Quantity| match quantity {
                    Quantity::Irradiance => true,
                    Quantity::Ao => !is_picture(path),
                    _ => is_npz(path),
                };
                what.iter().any(serves).then_some(()).ok_or_else(|| no_light(path))
            }
        }
    }
}

impl FromStr for ReceiverKind {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match (text, text.split_once(':')) {
            ("vertices", _) => Ok(Self::Vertices),
            ("lightmap", _) => Ok(Self::LightMap),
            ("camera", _) => Ok(Self::Camera),
            (_, Some(("points", path))) if !path.is_empty() => Ok(Self::Points(path.into())),
            _ => Err("give vertices, lightmap, camera or points:FILE".to_owned()),
        }
    }
}

impl Receiver {
    /// Places points in `scene`, which is in unit space and without glass. `camera` makes the camera's receiver on demand.
    ///
    /// # Errors
    /// [`Error::Usage`] when there is no room for the points; [`Error::Input`] when their file cannot be used.
    pub fn new(
        kind: &ReceiverKind,
        light_map: &LightMapOptions,
        scene: &Scene,
        settings: &Settings,
        camera: impl FnOnce() -> Result<Self>,
    ) -> Result<Self> {
        Ok(match kind {
            ReceiverKind::Vertices => Self::Vertices(Vertices::new(&scene.mesh, vertex_inset(settings))),
            ReceiverKind::LightMap => {
                let resolution = match light_map.resolution {
                    Resolution::TexelsPerUnit(texels) => Resolution::TexelsPerUnit(texels * scene.space.length_to_world(1.0)),
                    pixels @ Resolution::Pixels(_) => pixels,
                };
                Self::LightMap(Box::new(LightMap::new(&scene.mesh, &LightMapOptions { resolution, ..*light_map })?))
            }
            ReceiverKind::Camera => camera()?,
            ReceiverKind::Points(path) => Self::of_points(&file::read(path)?, &scene.space),
            ReceiverKind::PointList(points) => Self::of_points(points, &scene.space),
        })
    }

    fn of_points(read: &[file::OrientedPoint], space: &UnitSpace) -> Self {
        let enter = |point: &file::OrientedPoint| GatherPoint::flat(space.enter_point(point.position), point.normal);
        Self::Points { points: read.iter().map(enter).collect(), world: read.iter().map(|point| point.position).collect() }
    }

    /// The receiver for the surfaces that the camera sees.
    ///
    /// # Errors
    /// [`Error::Usage`] when it sees none.
    pub(super) fn of_camera(visible: &GBuffer, size: [u32; 2], space: &UnitSpace) -> Result<Self> {
        // Rounds positions as in a file in world space. So the same points from a file give the same bits.
        let is_far = space.local_origin() != DVec3::ZERO;
        let in_file = |position: DVec3| if is_far { position } else { position.as_vec3().as_dvec3() };
        let through_world =
            |point: GatherPoint| GatherPoint { position: space.enter_point(in_file(space.to_world(point.position))), ..point };
        let [width, height] = size.map(|side| side as usize);
        let from_top = |i: usize| ((height - 1 - i / width) * width + i % width) as u32;
        let seen = visible.pixels().into_iter().enumerate().filter_map(|(i, point)| Some((from_top(i), through_world(point?))));
        let (pixels, points): (Vec<_>, Vec<_>) = seen.unzip();
        if points.is_empty() {
            return Err(Error::usage("the camera sees no surface", "turn it in the scene file"));
        }
        Ok(Self::Camera { size, points, pixels })
    }

    /// The same from a part, without a device.
    ///
    /// # Errors
    /// [`Error::Input`] when the part does not contain it.
    pub(super) fn of_part(path: &Path, part: &Part, size: [u32; 2]) -> Result<Self> {
        let read = || {
            let pixels: &[u32] = bytemuck::cast_slice(part.get(CAMERA_PIXELS)?);
            let points: &[GatherPoint] = bytemuck::try_cast_slice(part.get(CAMERA_POINTS)?).ok()?;
            let fits = pixels.len() == points.len() && pixels.iter().all(|pixel| u64::from(*pixel) < size_of_picture(size));
            fits.then(|| Self::Camera { size, points: points.to_vec(), pixels: pixels.to_vec() })
        };
        read().ok_or_else(|| Error::input(path, None, "damaged: it does not say what the camera saw", "make it again"))
    }

    /// Adds the data for [`Self::of_part`] to a part.
    pub(super) fn save<'a>(&'a self, part: &mut Part<'a>) {
        if let Self::Camera { points, pixels, .. } = self {
            part.put(CAMERA_PIXELS, bytemuck::cast_slice(pixels));
            part.put(CAMERA_POINTS, bytemuck::cast_slice(points));
        }
    }

    /// The points in unit space.
    pub fn points(&self) -> &[GatherPoint] {
        match self {
            Self::Vertices(vertices) => vertices.points(),
            Self::LightMap(map) => map.points(),
            Self::Camera { points, .. } | Self::Points { points, .. } => points,
        }
    }

    /// The points with their turns. `turns`: [`ReceiverKind::turns`].
    pub(super) fn with_turns(&self, turns: u32) -> BakePoints {
        let points = self.points().to_vec();
        // A light map has the first sample of each texel, then the second, and so on. So a run has whole samples.
        let run = |index: u32| PointRun { count: points.len() / turns as usize, turn: Turn { index, of: turns } };
        BakePoints { runs: (0..turns).map(run).collect(), points }
    }

    /// Warnings for the user.
    pub fn warnings(&self) -> &[String] {
        match self {
            Self::LightMap(map) => map.warnings(),
            _ => &[],
        }
    }

    /// Contents of files. `columns`: a value for each point. `inside`: see [`crate::bake::Bake::columns`]. `picture`: also make the camera's picture.
    pub fn values(&self, mut columns: Vec<Channel>, inside: &[f32], space: &UnitSpace, picture: bool) -> ReceiverValues {
        let world_of = |mesh: &Mesh| mesh.positions.iter().map(|&position| space.to_world(position)).collect::<Vec<_>>();
        let (mut mesh, mut image) = (None, None);
        let (counts, positions) = match self {
            Self::Vertices(vertices) => {
                let counts = vertices.fill(&mut columns, inside);
                mesh = Some(vertices.mesh().clone());
                (json!(counts), world_of(vertices.mesh()))
            }
            Self::LightMap(map) => {
                let (mut map_image, mended) = map.image(&columns, inside);
                normalize_directions(&mut map_image.channels);
                image = Some(map_image);
                // Those of samples are in the map.
                columns.clear();
                mesh = Some(map.mesh().clone());
                let mut counts = json!(map.counts());
                counts
                    .as_object_mut()
                    .into_iter()
                    .for_each(|all| all.extend(json!(mended).as_object().cloned().unwrap_or_default()));
                (counts, world_of(map.mesh()))
            }
            Self::Camera { size, points, pixels } => {
                image = picture.then(|| spread(&columns, pixels, *size));
                let positions = points.iter().map(|point| space.to_world(point.position)).collect();
                (json!({ "pixels": pixels.len() }), positions)
            }
            Self::Points { world, .. } => (json!({ "points": world.len() }), world.clone()),
        };
        let normals = match (self, &mesh) {
            (Self::LightMap(_), Some(mesh)) => mesh.normals.clone(),
            _ => self.points().iter().map(|point| point.normal).collect(),
        };
        ReceiverValues { counts, positions, origin: space.local_origin(), normals, columns, mesh, image }
    }
}

impl ReceiverValues {
    /// Whether they are of pixels, and what lies behind the surfaces may show.
    pub(super) fn is_of_camera(&self) -> bool {
        self.image.is_some() && self.mesh.is_none()
    }

    /// Writes the values. The file ending selects the format. `scene` has the materials of the mesh.
    ///
    /// # Errors
    /// [`Error::Output`] when the file cannot be written.
    pub fn write(&self, path: &Path, scene: &Scene, options: &WriteOptions) -> Result<()> {
        let positions = Positions { world: &self.positions, origin: self.origin };
        let of_scene = |mesh| ExportMesh {
            mesh,
            positions,
            materials: &scene.materials,
            textures: &scene.textures,
            source: ExportSource::of(scene),
        };
        let surface = self.mesh.as_ref().map(of_scene);
        match (&self.image, surface) {
            (Some(image), _) if is_picture(path) => write_picture(image, self.mesh.is_none(), path, options),
            (Some(image), Some(surface)) if is_npz(path) => MapValues { surface, image }.write(path, options),
            (Some(image), Some(surface)) => {
                let openness = image.channel("AO").map(|samples| vec![Channel { name: "AO".into(), samples: samples.to_vec() }]);
                let openness = openness.map(|channels| Image { channels, ..*image });
                let irradiance = irradiance_of(image);
                let uvs = &surface.mesh.lightmap_uvs;
                Lightmap { surface, uvs, irradiance: irradiance.as_ref(), openness: openness.as_ref() }.write(path, options)
            }
            _ => {
                let Self { normals, columns, .. } = self;
                let points = self.mesh.as_ref().map(|mesh| &mesh.sources).filter(|sources| !sources.is_empty());
                let sources = points.map(|points| SourceMap { file: &scene.file, instances: &scene.instances, points });
                PointValues { positions, normals, columns, surface, sources }.write(path, options)
            }
        }
    }
}

/// The files of each receiver. `outputs` have names as in `vertices:box.ply`. A single receiver needs no name.
///
/// # Errors
/// [`Error::Usage`] when a file belongs to no receiver, or a receiver has no file.
pub fn outputs_of(receivers: &[ReceiverKind], outputs: &[String]) -> Result<Vec<Vec<PathBuf>>> {
    check_kinds(receivers)?;
    let mut files = vec![Vec::new(); receivers.len()];
    for output in outputs {
        let refused = |problem: String, cure: String| Err(Error::usage(format!("-o {output}{problem}"), cure));
        let named = output.split_once(':').filter(|(name, _)| is_word(name));
        let (name, path) = named.map_or((None, output.as_str()), |(name, path)| (Some(name), path));
        let index = receivers.iter().position(|receiver| name.map_or(receivers.len() == 1, |name| name == receiver.name()));
        match (index, name) {
            (Some(_), _) if path.is_empty() => return refused(" names no file".into(), "put one after the colon".into()),
            (Some(index), _) => files[index].push(path.into()),
            (None, Some(name)) if ReceiverKind::NAMES.contains(&name) => {
                let cure = format!("add --to {name}, or give a file of what is baked");
                return refused(format!(": {name} was not asked for"), cure);
            }
            (None, Some(name)) => {
                let cure = format!("put {} before the colon, or ./ before a file of this name", ReceiverKind::NAMES.join(", "));
                return refused(format!(": there is no receiver {name:?}"), cure);
            }
            (None, None) => {
                let names: Vec<_> = receivers.iter().map(|receiver| format!("{}:{output}", receiver.name())).collect();
                return refused(": of which receiver?".into(), format!("put its name before the file: {}", names.join(" or ")));
            }
        }
    }
    match receivers.iter().zip(&files).find(|(_, files)| files.is_empty()) {
        None => Ok(files),
        Some((receiver, _)) => {
            let problem = format!("no file is named for {}", receiver.name());
            Err(Error::usage(problem, "name one with -o, or leave the receiver out"))
        }
    }
}

/// # Errors
/// [`Error::Usage`] when a kind of receiver is there twice: files could not tell which is meant.
pub(super) fn check_kinds(receivers: &[ReceiverKind]) -> Result<()> {
    let before = |index: usize, kind: &ReceiverKind| receivers[..index].iter().any(|other| other.name() == kind.name());
    match receivers.iter().enumerate().find(|&(index, kind)| before(index, kind)) {
        None => Ok(()),
        Some((_, kind)) => Err(Error::usage(format!("{} is asked for twice", kind.name()), "bake one after the other")),
    }
}

/// Whether it can be a receiver's name. A single letter names a drive.
fn is_word(name: &str) -> bool {
    name.len() != 1 && name.chars().all(|letter| letter.is_ascii_alphabetic() || letter == '-')
}

pub(super) fn is_picture(path: &Path) -> bool {
    path.extension().and_then(|ending| ending.to_str()).is_some_and(|ending| PICTURES.contains(&ending.to_lowercase().as_str()))
}

fn is_npz(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("npz"))
}

pub(super) fn is_png(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("png"))
}

fn size_of_picture([width, height]: [u32; 2]) -> u64 {
    u64::from(width) * u64::from(height)
}

/// A picture with values at these pixels, black elsewhere. Channel `A` is 1 at these pixels.
fn spread(columns: &[Channel], pixels: &[u32], size: [u32; 2]) -> Image {
    let spread = |name: &str, samples: &[f32]| {
        let mut plane = vec![0.0; size_of_picture(size) as usize];
        pixels.iter().zip(samples).for_each(|(&pixel, &sample)| plane[pixel as usize] = sample);
        Channel { name: name.to_owned(), samples: plane }
    };
    let mut channels: Vec<_> = columns.iter().map(|column| spread(&column.name, &column.samples)).collect();
    channels.push(spread("A", &vec![1.0; pixels.len()]));
    let [width, height] = size.map(|side| side as usize);
    Image { width, height, channels }
}

/// The irradiance of a light map as a separate picture.
fn irradiance_of(image: &Image) -> Option<Image> {
    let channel =
        |name: &str| Some(Channel { name: name.into(), samples: image.channel(&format!("Irradiance.{name}"))?.to_vec() });
    let channels = vec![channel("R")?, channel("G")?, channel("B")?];
    Some(Image { channels, ..*image })
}

/// Adds channels R, G and B and writes the picture. They are the irradiance in an EXR, and in a PNG the radiance that a white surface reflects. Without
/// irradiance they are the first quantity. A PNG then holds data: a direction as colour, a number as grey.
fn write_picture(image: &Image, is_camera: bool, path: &Path, options: &WriteOptions) -> Result<()> {
    let (exr, irradiance) = (!is_png(path), irradiance_of(image));
    let (light, cover) = (irradiance.is_some(), image.channel("A").unwrap_or_default());
    let mut picture = image.clone();
    let mut shown = irradiance.map(|image| image.channels).unwrap_or_default();
    if !light {
        // There is always a quantity, with one or at least three columns.
        let named = |name: &str| image.channels.iter().position(|channel| channel.name == name);
        let first = ["AO", "BentNormal.X", "Sky"].into_iter().filter_map(named).min().unwrap_or(0);
        let is_direction = image.channels[first].name == "BentNormal.X";
        let of = |k: usize| first + if image.channels[first].name.contains('.') { k } else { 0 };
        // Nothing hides the sky from pixels that see nothing.
        let is_open = |pixel: usize| !exr && is_camera && !is_direction && cover[pixel] == 0.0;
        let value = |(pixel, x): (usize, &f32)| match is_direction {
            true => 0.5 * x + 0.5,
            false if is_open(pixel) => 1.0,
            false => *x,
        };
        let samples = |k: usize| image.channels[of(k)].samples.iter().enumerate().map(value).collect();
        shown = (0..3).map(|k| Channel { name: ["R", "G", "B"][k].into(), samples: samples(k) }).collect();
    } else if !exr {
        shown.iter_mut().flat_map(|channel| &mut channel.samples).for_each(|sample| *sample *= FRAC_1_PI);
    }
    picture.channels.extend(shown);
    if exr || light { picture.write(path, options) } else { picture.write_data_png(path) }
}

fn no_light(path: &Path) -> Error {
    Error::usage(
        format!("{}: a model with its light map shows irradiance or openness, and neither was baked", path.display()),
        "add irradiance or ao to --what, or write .exr or .png",
    )
}
