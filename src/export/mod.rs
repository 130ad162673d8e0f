//! Writes bakes for other programs: values at points as PLY, NumPy or glTF, a light map with its model as OBJ or glTF.
//! The path's ending selects the format ([`PointValues::write`], [`Lightmap::write`]). Every file is written whole or not at all.

use std::collections::HashSet;
use std::f32::consts::{FRAC_1_PI, PI};
use std::iter;
use std::path::{Path, PathBuf};

use glam::{DVec3, Vec2, Vec3};
use serde_json::Value;

use crate::error::{Error, Result};
use crate::file::{MOST_BYTES, read_file};
use crate::image::{Channel, Image, WriteOptions, encode_png, encode_srgb, tone};
use crate::scene::gltf::PlainGltf;
use crate::scene::{GltfFile, ImageTexture, Instance, Material, Mesh, Scene, Source, Triangle};

mod glb;
mod npy;
mod npz;
mod obj;
mod ply;
mod round_trip;

pub use npy::{is_of, parse_prt, read_prt};
pub use npz::MapValues;

/// Positions in world space.
#[derive(Clone, Copy)]
pub struct Positions<'a> {
    pub world: &'a [DVec3],
    /// See [`UnitSpace::local_origin`](crate::scene::UnitSpace::local_origin). Zero: files hold positions in 32 bits. Else they hold 64, or 32 and
    /// this origin.
    pub origin: DVec3,
}

/// Baked values at points, in world space.
#[derive(Clone, Copy)]
pub struct PointValues<'a> {
    pub positions: Positions<'a>,
    /// Unit normals, one a point.
    pub normals: &'a [Vec3],
    /// Columns with one sample a point, named as in an EXR: `Irradiance.R`, `AO`, `PRT.04.G`.
    pub columns: &'a [Channel],
    /// The mesh whose vertices the points are, if there is one; both have one order.
    pub surface: Option<ExportMesh<'a>>,
    /// Where the points come from, if a file numbers them.
    pub sources: Option<SourceMap<'a>>,
}

/// The vertices of a model's file that points belong to. glTF files leave it out, which have no place for whole numbers of 32 bits.
#[derive(Clone, Copy)]
pub struct SourceMap<'a> {
    /// Name of the model's file.
    pub file: &'a str,
    pub instances: &'a [Instance],
    /// One a point.
    pub points: &'a [Source],
}

/// A mesh with its materials and their textures.
#[derive(Clone, Copy)]
pub struct ExportMesh<'a> {
    /// Its own positions are not used.
    pub mesh: &'a Mesh,
    /// One for each vertex.
    pub positions: Positions<'a>,
    pub materials: &'a [Material],
    pub textures: &'a [ImageTexture],
    /// The glTF file of the mesh, if a `.glb` is to be that file with the results in it.
    pub source: Option<ExportSource<'a>>,
}

/// The glTF file that a mesh is of.
#[derive(Clone, Copy)]
pub struct ExportSource<'a> {
    pub file: &'a GltfFile,
    /// The world's instances, for [`Source`].
    pub instances: &'a [Instance],
    /// The mesh of the scene, with the vertices of all triangles, also of those that it has left out as doubles of others.
    pub mesh: &'a Mesh,
}

impl<'a> ExportSource<'a> {
    /// The file of a scene that is a glTF file.
    pub fn of(scene: &'a Scene) -> Option<Self> {
        Some(Self { file: scene.gltf.as_deref()?, instances: &scene.instances, mesh: &scene.mesh })
    }

    /// Checks before the work that results can be added to the file. `path` is the file to write. Returns all files that will be read for it.
    ///
    /// # Errors
    /// [`Error::Usage`] when copies share what is stored, [`Error::Input`] when a part of the file cannot be read, also one that nothing shows.
    pub fn check(&self, path: &Path) -> Result<Vec<PathBuf>> {
        self.check_copies(path)?;
        PlainGltf::read(self.file).map(|plain| plain.files)
    }

    fn check_copies(&self, path: &Path) -> Result<()> {
        let is_copy = |instance: &&Instance| instance.part.is_some_and(|part| part.copy > 0);
        let of = |triangle: &Triangle| self.mesh.sources.get(triangle.vertices[0] as usize);
        let mut instances = self.mesh.triangles.iter().filter_map(of).filter_map(|of| self.instances.get(of.instance as usize));
        let Some(Instance { name, .. }) = instances.find(is_copy) else { return Ok(()) };
        let problem = format!(
            "{}: {name} is placed several times, by EXT_mesh_gpu_instancing or as a child of several nodes, and its copies share what is stored",
            path.display()
        );
        Err(Error::usage(problem, "write another format, or make nodes of the copies: `gltf-transform uninstance`"))
    }
}

/// A light map and its mesh.
#[derive(Clone, Copy)]
pub struct Lightmap<'a> {
    pub surface: ExportMesh<'a>,
    /// Map coordinates of each vertex, v up.
    pub uvs: &'a [Vec2],
    /// Irradiance in `R`, `G` and `B`. A file needs this or the openness.
    pub irradiance: Option<&'a Image>,
    /// Openness (ambient occlusion) in one channel.
    pub openness: Option<&'a Image>,
}

impl SourceMap<'_> {
    /// The names of the objects in few characters, none of which ends a line.
    fn names(&self) -> impl Iterator<Item = String> {
        const MOST: usize = 100;
        let plain = |letter: char| if letter.is_control() { ' ' } else { letter };
        self.instances.iter().map(move |instance| instance.name.chars().take(MOST).map(plain).collect())
    }
}

impl<'a> Positions<'a> {
    /// Positions for 32 bits.
    pub fn near(world: &'a [DVec3]) -> Self {
        Self { world, origin: DVec3::ZERO }
    }

    /// Whether files hold 64 bits.
    fn are_far(&self) -> bool {
        self.origin != DVec3::ZERO
    }

    /// Positions relative to the origin.
    fn local(&self) -> Vec<Vec3> {
        self.world.iter().map(|&position| (position - self.origin).as_vec3()).collect()
    }
}

impl PointValues<'_> {
    pub const ENDINGS: &'static [&'static str] = &["ply", "npy", "npz", "glb", "obj"];

    /// Writes the format of the path's ending. Vertex colours are for display, with the exposure and tone curve of a PNG; columns stay as they
    /// are. A `.json` beside a NumPy file describes its numbers.
    pub fn write(&self, path: &Path, options: &WriteOptions) -> Result<()> {
        let ending = ending(path, Self::ENDINGS)?;
        self.check()?;
        match ending {
            "ply" => ply::write(path, self, options),
            "npy" => npy::write(path, self, options),
            "npz" => npz::write(path, self, options),
            "obj" => obj::write_values(path, self, options),
            _ => glb::write_values(path, self, options),
        }
    }

    /// Checks what the encoders rely on, because the fields are public.
    fn check(&self) -> Result<()> {
        let count = self.positions.world.len();
        if count == 0 {
            return Err(Error::usage("there are no points to write", "bake some"));
        }
        let mut names = HashSet::new();
        if let Some(twice) = self.columns.iter().find(|column| !names.insert(&column.name)) {
            return Err(Error::usage(format!("there are two columns {}", twice.name), "name each quantity once"));
        }
        let lengths = self.columns.iter().map(|column| (column.name.as_str(), column.samples.len()));
        let vertices = self.surface.map(|surface| ("the mesh", surface.mesh.normals.len()));
        let sources = self.sources.map(|sources| ("sources", sources.points.len()));
        match lengths.chain([("normals", self.normals.len())]).chain(vertices).chain(sources).find(|&(_, length)| length != count)
        {
            None => Ok(()),
            Some((name, length)) => Err(Error::usage(format!("{name}: {length} values for {count} points"), "give one a point")),
        }
    }

    /// Whether the colours for display are light, which the albedo of a surface multiplies. Otherwise they are data.
    fn shows_light(&self) -> bool {
        let is_light = |name: &str| ["Irradiance", "SH.00"].iter().any(|light| name.starts_with(light));
        self.columns.iter().any(|column| is_light(&column.name))
    }

    /// The colour of each point for display, linear, from 0 to 1: the radiance of a white surface under the baked light, with the exposure and
    /// tone curve of a PNG. Without light, the openness as grey; without that, the normal.
    fn shown(&self, exposure: f32) -> Vec<Vec3> {
        let column = |name: &str| self.columns.iter().find(|column| column.name == name).map(|column| column.samples.as_slice());
        let rgb = |name: &str| {
            let [r, g, b] = ["R", "G", "B"].map(|channel| column(&format!("{name}.{channel}")));
            Some(
                (0..self.positions.world.len())
                    .zip(std::iter::repeat((r?, g?, b?)))
                    .map(|(i, (r, g, b))| Vec3::new(r[i], g[i], b[i])),
            )
        };
        let toned = |value: Vec3| (value * exposure.exp2()).map(tone);
        // The mean radiance over the sphere is the first coefficient times the first basis function, 1 / sqrt(4π).
        let light = [
            ("Irradiance", FRAC_1_PI),
            ("IrradianceIndirect", FRAC_1_PI),
            ("IrradianceDirect", FRAC_1_PI),
            ("SH.00", 0.5 / PI.sqrt()),
        ];
        for (name, scale) in light {
            if let Some(values) = rgb(name) {
                return values.map(|value| toned(value * scale)).collect();
            }
        }
        if let Some(open) = column("AO").or(column("Sky")) {
            return open.iter().map(|&open| Vec3::splat(open.clamp(0.0, 1.0))).collect();
        }
        // The light is a sky of radiance 1 everywhere. Its only coefficient is sqrt(4π).
        if let Some(transfer) = rgb("PRT.00") {
            return transfer.map(|value| toned(value * 2.0 * PI.sqrt())).collect();
        }
        self.normals.iter().map(|normal| 0.5 * *normal + 0.5).collect()
    }
}

impl Lightmap<'_> {
    pub const ENDINGS: &'static [&'static str] = &["obj", "glb"];

    /// Writes the format of the path's ending. An OBJ gets a `.mtl` and a `.png` beside it.
    pub fn write(&self, path: &Path, options: &WriteOptions) -> Result<()> {
        let ending = ending(path, Self::ENDINGS)?;
        let (uvs, vertices) = (self.uvs.len(), self.surface.positions.world.len());
        if uvs != vertices {
            return Err(Error::usage(format!("{uvs} coordinates on the light map for {vertices} vertices"), "give one a vertex"));
        }
        if self.irradiance.is_none() && self.openness.is_none() {
            let problem = format!("{}: the light map has neither irradiance nor openness", path.display());
            return Err(Error::usage(problem, "bake one of them"));
        }
        if ending == "obj" { obj::write(path, self, options) } else { glb::write_lightmap(path, self, options) }
    }

    /// Encodes irradiance as a PNG for display: the radiance of a white surface.
    fn shown_png(irradiance: &Image, exposure: f32) -> Result<Vec<u8>> {
        let radiance = irradiance.rgb()?.map(|samples| samples.iter().map(|value| value * FRAC_1_PI).collect::<Vec<_>>());
        let channels = ["R", "G", "B"].into_iter().zip(radiance).map(|(name, samples)| Channel { name: name.into(), samples });
        let Image { width, height, .. } = *irradiance;
        let picture = Image { width, height, channels: channels.collect() };
        encode_png(width, height, &picture.to_srgb8(exposure)?)
    }

    /// Encodes the map as a PNG for display: the radiance of a white surface, or else the openness in the sRGB curve.
    fn display_png(&self, exposure: f32) -> Result<Vec<u8>> {
        match self.irradiance {
            Some(irradiance) => Self::shown_png(irradiance, exposure),
            None => self.openness_png(encode_srgb).map(Option::unwrap_or_default),
        }
    }

    /// Encodes the openness as grey, by this curve.
    fn openness_png(&self, curve: fn(f32) -> f32) -> Result<Option<Vec<u8>>> {
        let Some(&Image { width, height, ref channels }) = self.openness else { return Ok(None) };
        let grey = |value: &f32| [(curve(value.clamp(0.0, 1.0)) * 255.0).round() as u8; 3];
        let bytes: Vec<u8> = channels.iter().take(1).flat_map(|channel| channel.samples.iter().flat_map(grey)).collect();
        encode_png(width, height, &bytes).map(Some)
    }
}

impl ExportMesh<'_> {
    /// Whether every vertex has a normal. Other meshes are shaded flat.
    fn has_normals(&self) -> bool {
        self.mesh.normals.iter().all(|normal| normal.is_normalized())
    }

    /// Returns the vertices of each material's triangles, without materials that have none.
    fn indices_by_material(&self) -> Vec<(usize, Vec<u32>)> {
        let mut indices = vec![Vec::new(); self.materials.len()];
        for triangle in &self.mesh.triangles {
            indices[triangle.material as usize].extend(triangle.vertices);
        }
        indices.into_iter().enumerate().filter(|(_, indices)| !indices.is_empty()).collect()
    }

    /// A material's albedo times the mean of its texture, for files in which the light map takes the texture's place.
    fn mean_albedo(&self, material: &Material) -> Vec3 {
        material.albedo * material.albedo_texture.map_or(Vec3::ONE, |texture| self.textures[texture].mean_linear())
    }
}

/// Reads [`WriteOptions::metadata`] from a file of a format that stores it: OpenEXR, NumPy, PLY.
pub fn metadata_of(path: &Path) -> Option<Value> {
    match ending(path, &["exr", "npy", "npz", "ply"]).ok()? {
        "exr" => {
            let about = Image::exr_metadata(path, &read_file(path, MOST_BYTES).ok()?)?;
            // Read all of it, because the file may be cut short.
            Image::read(path).ok().and_then(|_| serde_json::from_str(&about).ok())
        }
        "npy" => npy::metadata(path),
        "npz" => npz::metadata(path),
        _ => ply::metadata(&read_file(path, MOST_BYTES).ok()?),
    }
}

/// All files that writing `path` makes: itself, and the files beside it that a format adds.
pub fn written_with(path: &Path) -> Vec<PathBuf> {
    let beside: &[&str] = match ending(path, &["npy", "obj"]) {
        Ok("npy") => &["json", npy::SOURCES],
        Ok(_) => &["mtl", "png"],
        Err(_) => &[],
    };
    iter::once(path.to_owned()).chain(beside.iter().map(|ending| path.with_extension(ending))).collect()
}

/// Checks before the work that writing `path` should succeed and that its ending is one of these.
pub fn check_writable(path: &Path, endings: &[&'static str]) -> Result<()> {
    match ending(path, endings)? {
        "obj" => obj::check_ours(path)?,
        "npy" => npy::check_ours(path)?,
        _ => {}
    }
    written_with(path).iter().try_for_each(|path| crate::file::check_writable(path))
}

/// Returns the path's ending if it is one of these.
fn ending(path: &Path, endings: &[&'static str]) -> Result<&'static str> {
    let ending = path.extension().unwrap_or_default();
    endings.iter().copied().find(|known| ending.eq_ignore_ascii_case(known)).ok_or_else(|| {
        let problem = format!("{}: the ending names no format for this", path.display());
        Error::usage(problem, format!("end the path in .{}", endings.join(", .")))
    })
}

/// `PRT.04.G` as `prt_04_g` and `BentNormal.X` as `bent_normal_x`.
fn snake_case(name: &str) -> String {
    let mut snake = String::new();
    let mut after_lower = false;
    for letter in name.chars() {
        if letter.is_uppercase() && after_lower {
            snake.push('_');
        }
        after_lower = letter.is_lowercase();
        snake.push(if letter == '.' { '_' } else { letter.to_ascii_lowercase() });
    }
    snake
}
