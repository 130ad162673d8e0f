//! Scenes from files and arrays.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

use finalgather::job::{SceneRequest, SharedScene};
use finalgather::scene::{Files, ImageTexture, LoadOptions, Loaded, Material, MeshArrays, Sampler, Sky, Sun};
use finalgather::{World, error};
use glam::{DVec3, Vec2, Vec3};
use numpy::{PyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use crate::arrays::{bytes, color, colors, environment, indices, numbers, rows_of_3, singles, wrong_shape};
use crate::errors::{begin_work, raised, usage};
use crate::watch::warn;

/// Sums of more do not fit into 32 bits.
const MOST_RADIANCE: f32 = 1e20;

/// Surfaces and lights. It never changes, so threads may share it.
#[pyclass(frozen, module = "finalgather")]
pub struct Scene {
    loaded: Arc<Loaded>,
    /// Empty for arrays.
    path: PathBuf,
}

/// Options that files and arrays share.
struct Lighting<'a, 'py> {
    env: Option<&'a Bound<'py, PyAny>>,
    sun: Option<&'a Bound<'py, PyAny>>,
    sky: bool,
    default_light: bool,
}

impl Lighting<'_, '_> {
    fn options(&self, py: Python) -> PyResult<LoadOptions> {
        if self.sky && self.env.is_some() {
            return Err(usage(py, "there are two skies: env, and sky", "give one of them"));
        }
        Ok(LoadOptions {
            environment: self.env.map(environment).transpose()?,
            sun: self.sun.map(sun_at).transpose()?,
            sky: self.sky.then(Sky::default),
            no_default_light: !self.default_light,
            // Jobs that need light ask for it.
            unlit: true,
            ..LoadOptions::default()
        })
    }
}

#[pymethods]
impl Scene {
    /// A scene of a file: .toml, .obj, .glb, .gltf, .ply or .stl.
    ///
    /// env: a lat-long picture (.hdr, .exr), its texels [height, width, 3] with row 0 at +y, a colour or a grey: radiance in W/(m² sr). sun: azimuth and
    /// height in degrees; sky=True: its clear sky. camera, gltf_scene: by their names. smooth_angle: faces that meet at no more degrees share normals.
    /// flip: fronts become backs. clay: all surfaces grey. strict: refuse what else is mended. allow_outside: the scene may name files outside its
    /// folder. default_light=False: no soft sky for scenes without light.
    #[staticmethod]
    #[pyo3(signature = (path, *, env=None, sun=None, sky=false, camera=None, gltf_scene=None, smooth_angle=None, flip=false, clay=false, strict=false, allow_outside=false, default_light=true))]
    #[allow(clippy::too_many_arguments)]
    fn load(
        py: Python,
        path: PathBuf,
        env: Option<&Bound<PyAny>>,
        sun: Option<&Bound<PyAny>>,
        sky: bool,
        camera: Option<String>,
        gltf_scene: Option<String>,
        smooth_angle: Option<f32>,
        flip: bool,
        clay: bool,
        strict: bool,
        allow_outside: bool,
        default_light: bool,
    ) -> PyResult<Self> {
        let smooth_angle = checked_angle(py, smooth_angle)?;
        let options = LoadOptions {
            camera,
            scene: gltf_scene,
            smooth_angle,
            flip,
            clay,
            strict,
            files: if allow_outside { Files::Anywhere } else { Files::Folder },
            ..Lighting { env, sun, sky, default_light }.options(py)?
        };
        Self::new(py, path.clone(), || World::load_with(&path, options))
    }

    /// A scene of arrays: vertices [v, 3], and faces [f, 3] or [f, 4], counter-clockwise seen from the front.
    ///
    /// normals [v, 3]: else faces are flat. uv [v, 2] and texture [h, w, 3 or 4], uint8 in sRGB, row 0 where v is 1. albedo: linear reflectance from 0 to
    /// 1, a grey, a colour, [v, 3] or [f, 3]; uint8 is sRGB; 0.5 if it is not given. emission: radiance of fronts in W/(m² sr), a grey, a colour or [f, 3].
    /// The others are those of load.
    #[staticmethod]
    #[pyo3(signature = (vertices, faces, *, normals=None, uv=None, albedo=None, texture=None, emission=None, env=None, sun=None, sky=false, smooth_angle=None, flip=false, clay=false, strict=false, default_light=true, name="arrays".to_owned()))]
    #[allow(clippy::too_many_arguments)]
    fn from_arrays(
        py: Python,
        vertices: &Bound<PyAny>,
        faces: &Bound<PyAny>,
        normals: Option<&Bound<PyAny>>,
        uv: Option<&Bound<PyAny>>,
        albedo: Option<&Bound<PyAny>>,
        texture: Option<&Bound<PyAny>>,
        emission: Option<&Bound<PyAny>>,
        env: Option<&Bound<PyAny>>,
        sun: Option<&Bound<PyAny>>,
        sky: bool,
        smooth_angle: Option<f32>,
        flip: bool,
        clay: bool,
        strict: bool,
        default_light: bool,
        name: String,
    ) -> PyResult<Self> {
        let positions: Vec<_> = rows_of_3(vertices, "vertices")?.into_iter().map(DVec3::from_array).collect();
        let (shape, faces) = indices(faces, "faces")?;
        let &[count, corners] = &shape[..] else { return Err(wrong_shape(py, "faces", &shape, "[faces, 3] or [faces, 4]")) };
        let normals = normals.map(|normals| rows_of_3(normals, "normals")).transpose()?;
        let uvs = uv.map(coordinates).transpose()?;
        let rows = [("normals", normals.as_ref().map(Vec::len)), ("uv", uvs.as_ref().map(Vec::len))];
        if let Some((name, Some(rows))) = rows.into_iter().find(|(_, rows)| rows.is_some_and(|rows| rows != positions.len())) {
            let problem = format!("{name}: {rows} rows for {} vertices", positions.len());
            return Err(usage(py, problem, "give one row a vertex, or leave it out"));
        }
        let (normals, uvs) = (normals.unwrap_or_default(), uvs.unwrap_or_default());
        let textures: Vec<_> = texture.map(picture_of_bytes).transpose()?.into_iter().collect();
        if !textures.is_empty() && uvs.is_empty() {
            return Err(usage(py, "texture: there are no coordinates on it", "give uv too, one row a vertex"));
        }
        let reflection = Reflection::new(albedo, !textures.is_empty(), [positions.len(), count])?;
        let has_rows = !reflection.of_vertices.is_empty() || !reflection.of_faces.is_empty();
        if !textures.is_empty() && has_rows {
            return Err(usage(py, "albedo: colours of vertices or faces and a texture do not mix", "give one of them"));
        }
        let (materials, material_of) = emitting(&reflection, emission, count)?;
        let arrays = MeshArrays {
            name,
            positions,
            normals: normals.into_iter().map(DVec3::from_array).collect(),
            uvs,
            colors: reflection.of_vertices,
            faces,
            corners,
            materials,
            material_of,
            textures,
        };
        let smooth_angle = checked_angle(py, smooth_angle)?;
        let options = Lighting { env, sun, sky, default_light }.options(py)?;
        let options = LoadOptions { smooth_angle, flip, clay, strict, ..options };
        Self::new(py, PathBuf::new(), || World::from_arrays(arrays, options))
    }

    /// A scene of a trimesh.Trimesh, or of the meshes of a trimesh.Scene, with its colours or its texture.
    ///
    /// smooth=True takes its normals of vertices; else faces are flat. The others are those of load.
    #[staticmethod]
    #[pyo3(signature = (mesh, *, smooth=false, env=None, sun=None, sky=false, strict=false, default_light=true))]
    #[allow(clippy::too_many_arguments)]
    fn from_trimesh(
        py: Python,
        mesh: &Bound<PyAny>,
        smooth: bool,
        env: Option<&Bound<PyAny>>,
        sun: Option<&Bound<PyAny>>,
        sky: bool,
        strict: bool,
        default_light: bool,
    ) -> PyResult<Self> {
        let joined = if mesh.hasattr("geometry")? { mesh.call_method0("to_mesh")? } else { mesh.clone() };
        if !joined.hasattr("faces")? {
            return Err(PyTypeError::new_err("mesh: give a trimesh.Trimesh or a trimesh.Scene"));
        }
        let attribute = |name: &str| joined.getattr(name);
        let normals = smooth.then(|| attribute("vertex_normals")).transpose()?;
        let visual = attribute("visual")?;
        let kind: Option<String> = visual.getattr("kind")?.extract()?;
        let (mut uv, mut texture, mut albedo) = (None, None, None);
        match kind.as_deref() {
            Some("texture") => match picture_of_visual(&visual)? {
                // trimesh has a colour of its own where a file names none, as a picture too.
                Some((_, picture)) if picture.getattr("size")?.extract::<usize>()? <= 16 && is_default(&picture)? => {}
                Some((coordinates, picture)) => (uv, texture) = (Some(coordinates), Some(picture)),
                None if is_default(&visual.getattr("material")?.getattr("main_color")?)? => {}
                None => albedo = Some(visual.call_method0("to_color")?.getattr("vertex_colors")?),
            },
            // With as many faces as vertices, the rows would be taken for those of vertices.
            Some("face") if attribute("faces")?.len()? != attribute("vertices")?.len()? => {
                albedo = Some(visual.getattr("face_colors")?);
            }
            Some(_) => albedo = Some(visual.getattr("vertex_colors")?),
            None => {}
        }
        let (vertices, faces) = (attribute("vertices")?, attribute("faces")?);
        Self::from_arrays(
            py,
            &vertices,
            &faces,
            normals.as_ref(),
            uv.as_ref(),
            albedo.as_ref(),
            texture.as_ref(),
            None,
            env,
            sun,
            sky,
            None,
            false,
            false,
            strict,
            default_light,
            "trimesh".to_owned(),
        )
    }

    /// Number of vertices of the input.
    #[getter]
    fn vertex_count(&self) -> usize {
        finalgather::scene::SourceLists::of(&self.loaded.world).total()
    }

    /// Number of triangles.
    #[getter]
    fn face_count(&self) -> usize {
        let World { instances, meshes, .. } = &self.loaded.world;
        instances.iter().map(|instance| meshes[instance.mesh].triangles.len()).sum()
    }

    /// The least and the largest coordinates.
    #[getter]
    fn bounds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let corners = self.loaded.world.bounds().map(|corner| corner.to_array().to_vec());
        Ok(PyArray2::from_vec2(py, &corners)?)
    }

    /// What was mended in the input.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.loaded.report.warnings.clone()
    }

    /// The files that were read.
    #[getter]
    fn files(&self) -> Vec<String> {
        self.loaded.report.files.iter().map(|path| path.display().to_string()).collect()
    }

    fn __repr__(&self) -> String {
        let name = if self.path.as_os_str().is_empty() { &self.loaded.world.file } else { &self.path.display().to_string() };
        format!("<finalgather.Scene {name}: {} vertices, {} faces>", self.vertex_count(), self.face_count())
    }

    fn _repr_html_(&self) -> String {
        let [min, max] = self.loaded.world.bounds();
        let rows = [
            ("vertices", self.vertex_count().to_string()),
            ("faces", self.face_count().to_string()),
            ("from", min.to_string()),
            ("to", max.to_string()),
            ("warnings", self.warnings().len().to_string()),
        ];
        table(&["", "scene"], rows.map(|(name, value)| vec![name.to_owned(), value]))
    }
}

impl Scene {
    fn new(py: Python, path: PathBuf, load: impl FnOnce() -> error::Result<Loaded> + Send) -> PyResult<Self> {
        // Some files make their environments by several threads.
        begin_work(py)?;
        let loaded = py.detach(load).map_err(|error| raised(py, &error))?;
        loaded.report.warnings.iter().try_for_each(|warning| warn(py, warning))?;
        Ok(Self { loaded: Arc::new(loaded), path })
    }

    pub fn request(&self) -> SceneRequest {
        SceneRequest { path: self.path.clone(), loaded: Some(SharedScene(self.loaded.clone())), ..SceneRequest::default() }
    }

    pub fn loaded(&self) -> &Loaded {
        &self.loaded
    }
}

/// The sun at an azimuth and a height in degrees, perhaps with its illuminance in lux.
fn sun_at(object: &Bound<PyAny>) -> PyResult<Sun> {
    let given: Vec<f32> = numbers(object)?.into_iter().map(|number| number as f32).collect();
    Sun::of_numbers(&given).ok_or_else(|| {
        let cure = "give an azimuth and a height from -90 to 90 degrees, and perhaps lux: (120, 35)";
        usage(object.py(), format!("sun is {given:?}"), cure)
    })
}

fn checked_angle(py: Python, degrees: Option<f32>) -> PyResult<Option<f32>> {
    match degrees {
        Some(degrees) if !World::SMOOTH_ANGLES.contains(&degrees) => {
            Err(usage(py, format!("smooth_angle is {degrees}"), World::SMOOTH_ANGLE_CURE))
        }
        _ => Ok(degrees),
    }
}

fn coordinates(object: &Bound<PyAny>) -> PyResult<Vec<Vec2>> {
    let array = singles(object, "uv")?;
    match *array.shape() {
        [_, 2] => Ok(array.as_slice()?.as_chunks().0.iter().map(|&uv| Vec2::from_array(uv)).collect()),
        ref shape => Err(wrong_shape(object.py(), "uv", shape, "[vertices, 2]")),
    }
}

/// A texture from bytes in sRGB.
fn picture_of_bytes(object: &Bound<PyAny>) -> PyResult<ImageTexture> {
    let py = object.py();
    let Some(array) = bytes(object, "texture")? else {
        return Err(usage(py, "texture: no bytes", "give uint8 in sRGB, of the shape [height, width, 3]"));
    };
    let &[height, width, channels @ 3..=4] = array.shape() else {
        return Err(wrong_shape(py, "texture", array.shape(), "[height, width, 3] or [height, width, 4]"));
    };
    let side = |length: usize| u32::try_from(length).ok().filter(|length| (1..=16384).contains(length));
    let (Some(width), Some(height)) = (side(width), side(height)) else {
        return Err(usage(py, format!("texture: {width} x {height} texels"), "give 1 to 16384 on a side"));
    };
    let texel = |texel: &[u8]| [texel[0], texel[1], texel[2], texel.get(3).copied().unwrap_or(255)];
    let texels = array.as_slice()?.chunks_exact(channels).map(texel).collect();
    Ok(ImageTexture { width, height, texels, sampler: Sampler::default() })
}

/// Coordinates and picture of a visual of trimesh, if it has both.
fn picture_of_visual<'py>(visual: &Bound<'py, PyAny>) -> PyResult<Option<(Bound<'py, PyAny>, Bound<'py, PyAny>)>> {
    let (uv, material) = (visual.getattr("uv")?, visual.getattr("material")?);
    for name in ["baseColorTexture", "image"] {
        let picture = material.getattr_opt(name)?.filter(|picture| !picture.is_none());
        if let Some(picture) = picture.filter(|_| !uv.is_none()) {
            let rgb = picture.call_method1("convert", ("RGB",))?;
            return Ok(Some((uv, visual.py().import("numpy")?.call_method1("asarray", (rgb,))?)));
        }
    }
    Ok(None)
}

/// Whether a colour or a picture, without its alpha, is that of trimesh where nothing is named: 102 as a material, 100 as texels.
fn is_default(object: &Bound<PyAny>) -> PyResult<bool> {
    let shown = numbers(object)?;
    Ok(shown.iter().all(|&number| number == 100.0) || shown == [102.0, 102.0, 102.0, 255.0])
}

/// What surfaces reflect.
struct Reflection {
    material: Material,
    /// One a vertex, or none.
    of_vertices: Vec<Vec3>,
    /// One a face, or none.
    of_faces: Vec<Vec3>,
}

impl Reflection {
    /// Of a mesh of so many vertices and faces. Rows may be of either; where both are as many, of vertices.
    fn new(albedo: Option<&Bound<PyAny>>, is_textured: bool, [vertices, faces]: [usize; 2]) -> PyResult<Self> {
        let white = Material { albedo: Vec3::ONE, albedo_texture: is_textured.then_some(0), ..Material::default() };
        let even = |material| Self { material, of_vertices: Vec::new(), of_faces: Vec::new() };
        let Some(object) = albedo else { return Ok(even(if is_textured { white } else { Material::default() })) };
        let wrong = |albedo: Vec3| usage(object.py(), format!("albedo is {albedo}"), "give linear reflectance from 0 to 1");
        let is_share = |albedo: &Vec3| albedo.cmpge(Vec3::ZERO).all() && albedo.cmple(Vec3::ONE).all();
        if let Some(albedo) = color(object, "albedo")? {
            return if is_share(&albedo) { Ok(even(Material { albedo, ..white })) } else { Err(wrong(albedo)) };
        }
        let rows = colors(object, "albedo")?;
        match rows.len() {
            count if count == vertices => Ok(Self { of_vertices: rows, ..even(white) }),
            count if count == faces => match rows.iter().find(|albedo| !is_share(albedo)) {
                Some(albedo) => Err(wrong(*albedo)),
                None => Ok(Self { of_faces: rows, ..even(white) }),
            },
            count => {
                let problem = format!("albedo: {count} rows for {vertices} vertices and {faces} faces");
                Err(usage(object.py(), problem, "give one row a vertex or a face, or one colour"))
            }
        }
    }
}

/// Materials with emission, and that of each face if they differ.
fn emitting(reflection: &Reflection, emission: Option<&Bound<PyAny>>, faces: usize) -> PyResult<(Vec<Material>, Vec<u32>)> {
    let Reflection { material, of_faces, .. } = reflection;
    let (mut even, mut rows) = (Vec3::ZERO, Vec::new());
    if let Some(object) = emission {
        match color(object, "emission")? {
            Some(emission) => even = emission,
            None => rows = vectors(object, faces)?,
        }
        let py = object.py();
        if let Some(wrong) = rows.iter().chain([&even]).find(|emission| {
            !(0.0..=MOST_RADIANCE).contains(&emission.min_element()) || !(0.0..=MOST_RADIANCE).contains(&emission.max_element())
        }) {
            return Err(usage(py, format!("emission is {wrong}"), "give radiance from 0 to 1e20, in W/(m² sr)"));
        }
    }
    if rows.is_empty() && of_faces.is_empty() {
        return Ok((vec![Material { emission: even, ..material.clone() }], Vec::new()));
    }
    let (mut materials, mut material_of, mut known) = (Vec::new(), Vec::new(), HashMap::new());
    for face in 0..faces {
        let albedo = of_faces.get(face).copied().unwrap_or(material.albedo);
        let emission = rows.get(face).copied().unwrap_or(even);
        let bits = [albedo, emission].map(|color| color.to_array().map(f32::to_bits));
        material_of.push(*known.entry(bits).or_insert_with(|| {
            materials.push(Material { albedo, emission, ..material.clone() });
            materials.len() as u32 - 1
        }));
    }
    Ok((materials, material_of))
}

/// One vector a face.
fn vectors(object: &Bound<PyAny>, faces: usize) -> PyResult<Vec<Vec3>> {
    let array = singles(object, "emission")?;
    match *array.shape() == [faces, 3] {
        true => Ok(array.as_slice()?.as_chunks().0.iter().map(|&row| Vec3::from_array(row)).collect()),
        false => {
            let wanted = format!("[{faces}, 3], one row a face, or give a colour");
            Err(wrong_shape(object.py(), "emission", array.shape(), &wanted))
        }
    }
}

/// A table in HTML.
pub fn table(head: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let plain = |text: &str| text.replace('&', "&amp;").replace('<', "&lt;");
    let row = |kind: &str, cells: &[String]| -> String {
        let cells: String = cells.iter().map(|cell| format!("<{kind}>{}</{kind}>", plain(cell))).collect();
        format!("<tr>{cells}</tr>")
    };
    let head: Vec<_> = head.iter().map(|&cell| cell.to_owned()).collect();
    let rows: String = rows.into_iter().map(|cells| row("td", &cells)).collect();
    format!("<table>{}{rows}</table>", row("th", &head))
}

/// A picture size: a side, or width and height.
pub fn size_of(object: &Bound<PyAny>) -> PyResult<[u32; 2]> {
    match numbers(object)?[..] {
        [side] => Ok([whole(object, side)?; 2]),
        [width, height] => Ok([whole(object, width)?, whole(object, height)?]),
        _ => Err(not_a_size(object)),
    }
}

fn whole(object: &Bound<PyAny>, side: f64) -> PyResult<u32> {
    if side >= 1.0 && side <= f64::from(u32::MAX) && side.fract() == 0.0 { Ok(side as u32) } else { Err(not_a_size(object)) }
}

fn not_a_size(object: &Bound<PyAny>) -> PyErr {
    let text = object.repr().map_or_else(|_| "?".to_owned(), |text| text.to_string());
    usage(object.py(), format!("size is {text}"), "give a side in pixels, or width and height")
}
