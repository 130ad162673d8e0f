//! PLY meshes, as scanners write them. They become one mesh, one instance and one material. [`load`] is the entry point.
//!
//! Read are positions, normals, texture coordinates and colours of vertices; faces and strips of triangles; the name of a texture and texture
//! coordinates of corners, as MeshLab writes them. Integer colours are encoded in sRGB, float colours are linear.

use std::path::Path;

use glam::{DVec3, Vec2, Vec3};

use super::indexed::{Indexed, RawVertex};
use super::warnings::{Fault, Place};
use super::{Loader, beside};
use crate::error::{Error, Result};
use crate::image::decode_srgb;
use crate::ply::{self, Element, ElementRow, Rows, Scalar};
use crate::scene::{Material, World};

const CURE: &str = "export the model again, as PLY with vertices and faces";

pub fn load(loader: &mut Loader, path: &Path) -> Result<World> {
    let bytes = loader.read_model(path, "PLY")?;
    let (header, rows) = ply::parse(&bytes).map_err(|fault| broken(path, fault))?;
    check(path, &header.elements)?;
    let mut reader = PlyReader { loader, path, rows, row: ElementRow::default(), model: Indexed::default(), is_clear: false };
    for ply::PlyFault { line, problem } in &header.unknown {
        reader.row.line = *line;
        reader.mend("header", &|| problem.clone(), "the line is ignored")?;
    }
    // What comes after may be broken.
    let last = header.elements.iter().rposition(|element| ["vertex", "face", "tristrips"].contains(&element.name.as_str()));
    for element in header.elements.iter().take(last.map_or(0, |last| last + 1)) {
        match element.name.as_str() {
            "vertex" => reader.vertices(element)?,
            "face" => reader.faces(element)?,
            "tristrips" => reader.strips(element)?,
            _ => reader.rows.skip(element).map_err(|fault| broken(path, fault))?,
        }
    }
    let material = reader.material(&header.comments)?;
    reader.model.into_world(loader, path, vec![material])
}

fn broken(path: &Path, ply::PlyFault { line, problem }: ply::PlyFault) -> Error {
    Error::input(path, line, format!("this is not a sound PLY: {problem}"), CURE)
}

/// Refuses a file that is no mesh.
fn check(path: &Path, elements: &[Element]) -> Result<()> {
    let count = |name: &str| elements.iter().find(|element| element.name == name).map_or(0, |element| element.count);
    if count("vertex") == 0 {
        return Err(Error::input(path, None, "there is no vertex", CURE));
    }
    if count("face") == 0 && count("tristrips") == 0 {
        let problem = "there is no face: this is a cloud of points, which shows no surface";
        let cure = "make a mesh of it, as by MeshLab's surface reconstruction; or bake at its points, with --to points:FILE";
        return Err(Error::input(path, None, problem, cure));
    }
    Ok(())
}

/// The places of a vertex's attributes in its row.
struct Columns {
    position: [usize; 3],
    normal: Option<[usize; 3]>,
    uv: Option<[usize; 2]>,
    color: Option<[usize; 3]>,
    /// Makes a colour linear.
    decode: fn(f64) -> f32,
    alpha: Option<usize>,
    /// The alpha of what is opaque.
    opaque: f64,
}

impl Columns {
    fn of(element: &Element) -> Option<Self> {
        fn all<const N: usize>(element: &Element, names: [&str; N]) -> Option<[usize; N]> {
            let found = names.map(|name| element.number(name));
            found.iter().all(Option::is_some).then(|| found.map(Option::unwrap_or_default))
        }
        let uvs = [["s", "t"], ["u", "v"], ["texture_u", "texture_v"]];
        let colors = [["red", "green", "blue"], ["diffuse_red", "diffuse_green", "diffuse_blue"], ["r", "g", "b"]];
        let color = colors.into_iter().find_map(|names| all(element, names));
        let alpha = ["alpha", "diffuse_alpha", "a"].iter().find_map(|name| element.number(name));
        Some(Self {
            position: all(element, ["x", "y", "z"])?,
            normal: all(element, ["nx", "ny", "nz"]),
            uv: uvs.into_iter().find_map(|names| all(element, names)),
            color,
            decode: match color.map(|[red, ..]| element.properties[red].kind) {
                None | Some(Scalar::Float | Scalar::Double) => |linear| linear as f32,
                Some(Scalar::Short | Scalar::UShort) => |word| decode_srgb((word / 65535.0) as f32),
                Some(_) => |byte| decode_srgb((byte / 255.0) as f32),
            },
            alpha,
            opaque: match alpha.map(|alpha| element.properties[alpha].kind) {
                None | Some(Scalar::Float | Scalar::Double) => 1.0,
                Some(Scalar::Short | Scalar::UShort) => 65535.0,
                Some(_) => 255.0,
            },
        })
    }
}

/// Reads the rows of a PLY into a model.
struct PlyReader<'a, 'b> {
    loader: &'a mut Loader<'b>,
    path: &'a Path,
    rows: Rows<'a>,
    row: ElementRow,
    model: Indexed,
    /// Whether a vertex has an alpha of less than 1.
    is_clear: bool,
}

impl PlyReader<'_, '_> {
    /// Reads a row. False if it is broken and left out, and the next ones can be read. Data in binary cannot go on after one.
    fn next(&mut self, element: &Element) -> Result<bool> {
        match self.rows.read(element, &mut self.row) {
            Ok(()) if self.row.is_longer => {
                self.mend("longer", &|| "there are more numbers than the header says".to_owned(), "they are ignored")?;
                Ok(true)
            }
            Ok(()) => Ok(true),
            Err(fault) if self.row.line.is_some() && !self.rows.are_done() => {
                self.mend("row", &|| fault.problem.clone(), "the line is left out")?;
                Ok(false)
            }
            Err(fault) => Err(broken(self.path, fault)),
        }
    }

    /// As [`Self::next`] for the `number`th row of a list of faces. Without faces at its end, a model still shows something.
    fn next_face(&mut self, element: &Element, number: usize) -> Result<Option<bool>> {
        match self.next(element) {
            Ok(read) => Ok(Some(read)),
            Err(Error::Input { problem, .. }) if number > 0 => {
                let problem = || format!("{problem}, after {number} of {} rows", element.count);
                self.mend("end", &problem, "the others are missing")?;
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }

    /// Tells of a fault in the row.
    fn mend(&mut self, kind: &'static str, problem: &dyn Fn() -> String, mend: &str) -> Result<()> {
        let place = Place { path: self.path, line: self.row.line };
        self.loader.warnings.mend(place, &Fault { kind, problem, mend, cure: "correct it, or export the model again" })
    }

    fn vertices(&mut self, element: &Element) -> Result<()> {
        let columns = Columns::of(element).ok_or_else(|| Error::input(self.path, None, "vertex has no x, y and z", CURE))?;
        for _ in 0..element.count {
            // Others keep their numbers beside one that is broken.
            if !self.next(element)? {
                self.row.numbers.fill(f64::NAN);
            }
            self.vertex(&columns)?;
        }
        Ok(())
    }

    fn vertex(&mut self, columns: &Columns) -> Result<()> {
        let numbers = |columns: [usize; 3]| columns.map(|column| self.row.numbers[column]);
        let (position, normal) = (DVec3::from(numbers(columns.position)), columns.normal.map(|normal| numbers(normal).into()));
        let color = columns.color.map(|color| Vec3::from(numbers(color).map(columns.decode)));
        let uv = columns.uv.map(|uv| Vec2::from(uv.map(|column| self.row.numbers[column] as f32)));
        self.is_clear |= columns.alpha.is_some_and(|alpha| self.row.numbers[alpha] < columns.opaque);
        let place = Place { path: self.path, line: self.row.line };
        self.model.push_vertex(RawVertex { position, normal, uv, color }, place, &mut self.loader.warnings)
    }

    /// The list of a face's vertices.
    fn corners_of(&self, element: &Element) -> Result<usize> {
        let found = ["vertex_indices", "vertex_index"].iter().find_map(|name| element.find(name));
        let found = found.filter(|&index| element.properties[index].length.is_some());
        found.ok_or_else(|| Error::input(self.path, None, format!("{} has no list vertex_indices", element.name), CURE))
    }

    fn faces(&mut self, element: &Element) -> Result<()> {
        let corners = self.corners_of(element)?;
        let uvs = element.find("texcoord").filter(|&index| element.properties[index].length.is_some());
        for face in 0..element.count {
            match self.next_face(element, face)? {
                None => break,
                Some(false) => continue,
                Some(true) => {}
            }
            let first = self.model.corners.len();
            self.model.corners.extend(self.row.lists[corners].iter().map(|&number| index(number)));
            if let Some(uvs) = uvs {
                // Strips before this element have none.
                self.model.corner_uvs.resize(first, Vec2::ZERO);
                let uv = |&[u, v]: &[f64; 2]| Some(Vec2::new(u as f32, v as f32)).filter(|uv| uv.is_finite()).unwrap_or_default();
                self.model.corner_uvs.extend(self.row.lists[uvs].as_chunks().0.iter().map(uv));
                // A face may have none.
                self.model.corner_uvs.resize(self.model.corners.len(), Vec2::ZERO);
            }
            self.model.end_face(self.row.line);
        }
        Ok(())
    }

    /// Strips of triangles. -1 ends a strip.
    fn strips(&mut self, element: &Element) -> Result<()> {
        let corners = self.corners_of(element)?;
        for strip in 0..element.count {
            match self.next_face(element, strip)? {
                None => break,
                Some(false) => continue,
                Some(true) => {}
            }
            let list = std::mem::take(&mut self.row.lists[corners]);
            for strip in list.split(|&number| number < 0.0) {
                for (number, triangle) in strip.windows(3).enumerate() {
                    let [a, b, c] = [triangle[0], triangle[1], triangle[2]].map(index);
                    // Every second triangle of a strip winds the other way.
                    self.model.corners.extend(if number % 2 == 0 { [a, b, c] } else { [b, a, c] });
                    self.model.end_face(self.row.line);
                }
            }
        }
        Ok(())
    }

    /// White where colours or a texture say more, else grey.
    fn material(&mut self, comments: &[String]) -> Result<Material> {
        let mut material = Material::default();
        let mut textures = comments.iter().filter_map(|comment| comment.strip_prefix("TextureFile"));
        self.row.line = None;
        if let Some(name) = textures.next() {
            let named_at = self.path.display().to_string();
            match self.loader.textures.load(&beside(self.path, name.trim()), &named_at) {
                Ok(texture) => material.albedo_texture = Some(texture),
                Err(error) => self.loader.warnings.mend_error(self.path, "texture", error, "the model shows none")?,
            }
        }
        if textures.next().is_some() {
            self.mend("textures", &|| "there are several textures".to_owned(), "the first is used for all faces")?;
        }
        if material.albedo_texture.is_some() && !self.model.colors.is_empty() {
            self.model.colors.clear();
            self.loader.warnings.say(format!("{}: the texture is shown, the colours of vertices are not", self.path.display()));
        }
        if material.albedo_texture.is_some() || !self.model.colors.is_empty() {
            material.albedo = Vec3::ONE;
        }
        if self.is_clear {
            material.unshaded.push("alpha of vertices".to_owned());
        }
        Ok(material)
    }
}

/// A vertex as an index. `u32::MAX` stands for what is no index.
fn index(number: f64) -> u32 {
    let index = number as u32;
    if f64::from(index) == number { index } else { u32::MAX }
}
