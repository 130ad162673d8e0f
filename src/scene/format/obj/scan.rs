//! Reads the statements of an OBJ file and mends what is wrong in them. [`scan`] is the entry point.
//!
//! The errors of tobj name no line. It also takes a polyline for a face, fails at a comment after a number, and gives a corner without `vn` the
//! normal of another corner. So [`scan`] reads all numbers and tells each fault with its line. `faces.rs` checks faces and writes them for tobj.

use std::collections::HashMap;
use std::path::Path;

use glam::{DVec3, Vec2, Vec3};

use super::faces::Faces;
use super::number::{Word, read, words};
use super::text::{Decoder, Lines, split_word};
use crate::error::{Error, Result};
use crate::scene::format::FARTHEST;
use crate::scene::format::warnings::{Fault, Place, Warnings};

/// Contents of an OBJ file.
#[derive(Default)]
pub struct Scan {
    pub vertices: VertexLists,
    /// Faces, materials and objects for tobj. It names a vertex, coordinate or normal by its number, and a material or object by its index here.
    pub text: String,
    /// The `mtllib` statements.
    pub libraries: Vec<Named>,
    /// The first `usemtl` statement of each material.
    pub materials: Vec<Named>,
    /// Names of objects (`o`), or of groups (`g`) in a file without objects.
    pub objects: Vec<String>,
}

/// The lists to which corners of faces refer.
#[derive(Default)]
pub struct VertexLists {
    /// Not finite where the file has no usable numbers.
    pub positions: Vec<DVec3>,
    /// As in the file; none (NaN) for a vertex without colour. Empty if no vertex has one.
    pub colors: Vec<Vec3>,
    /// None (NaN) where the file has no usable numbers.
    pub uvs: Vec<Vec2>,
    /// Of unit length. Zero where the file has no usable numbers.
    pub normals: Vec<Vec3>,
}

/// A name and the line that uses it.
pub struct Named {
    pub name: String,
    pub line: usize,
}

pub fn scan(warnings: &mut Warnings, decoder: &mut Decoder, path: &Path, text: &str) -> Result<Scan> {
    let mut scanner =
        ObjScanner { path, warnings, line: 0, scan: Scan::default(), faces: Faces::default(), names: Default::default() };
    let mut lines = Lines::new(text);
    for (line, statement) in lines.by_ref() {
        scanner.line = line;
        scanner.statement(&statement)?;
    }
    decoder.check_ends(scanner.warnings, path, &lines)?;
    scanner.finish()
}

/// Kinds of names, as indices.
pub const MATERIAL: usize = 0;
pub const OBJECT: usize = 1;
pub const GROUP: usize = 2;

struct ObjScanner<'a> {
    path: &'a Path,
    warnings: &'a mut Warnings,
    line: usize,
    scan: Scan,
    faces: Faces,
    /// Names of materials, objects and groups.
    names: [NameList; 3],
}

/// Different names in the order of their first use.
#[derive(Default)]
struct NameList {
    indices: HashMap<String, usize>,
    list: Vec<Named>,
}

impl<'a> ObjScanner<'a> {
    fn statement(&mut self, statement: &str) -> Result<()> {
        let statement = statement.trim_ascii();
        let end = statement.bytes().position(|byte| byte.is_ascii_whitespace()).unwrap_or(statement.len());
        let (word, rest) = statement.split_at(end);
        match word {
            "v" => self.position(rest),
            "vt" => self.uv(rest),
            "vn" => self.normal(rest),
            "f" => self.face(rest),
            _ => self.other_statement(statement),
        }
    }

    fn other_statement(&mut self, statement: &str) -> Result<()> {
        const KNOWN: [&str; 9] = ["v", "vt", "vn", "f", "fo", "usemtl", "mtllib", "o", "g"];
        let (word, rest) = split_word(statement);
        let Some(keyword) = KNOWN.into_iter().find(|known| word.eq_ignore_ascii_case(known)) else { return Ok(()) };
        if word != keyword {
            self.mend_keyword(word, keyword)?;
        }
        match keyword {
            "v" => self.position(rest),
            "vt" => self.uv(rest),
            "vn" => self.normal(rest),
            // The older form of `f`.
            "f" | "fo" => self.face(rest),
            "usemtl" => {
                if rest.is_empty() {
                    let mend = "the faces after it have the default material, grey";
                    self.mend("usemtl", &|| "usemtl without a name".into(), mend, "name it, or remove the line")?;
                }
                self.name(MATERIAL, rest);
                Ok(())
            }
            "mtllib" => {
                self.scan.libraries.push(Named { name: rest.to_owned(), line: self.line });
                Ok(())
            }
            "o" => {
                self.name(OBJECT, rest);
                Ok(())
            }
            _ => {
                self.name(GROUP, rest);
                Ok(())
            }
        }
    }

    fn mend_keyword(&mut self, word: &str, keyword: &str) -> Result<()> {
        let problem = || format!("keyword {word} is not spelt {keyword}");
        self.mend("keyword", &problem, "it is read all the same", "correct the spelling")
    }

    /// Starts the faces of this material, object or group.
    fn name(&mut self, kind: usize, name: &str) {
        let NameList { indices, list } = &mut self.names[kind];
        let index = match indices.get(name) {
            Some(&index) => index,
            None => {
                indices.insert(name.to_owned(), list.len());
                list.push(Named { name: name.to_owned(), line: self.line });
                list.len() - 1
            }
        };
        self.faces.start(kind, index);
    }

    fn position(&mut self, text: &str) -> Result<()> {
        let row = self.row::<6>("v", text, 3)?;
        let position = DVec3::from_slice(&row.values[..3]);
        let far = position.as_vec3().abs().max_element();
        let is_near = f64::from(far) <= FARTHEST;
        if row.is_sound && !is_near {
            let problem = || format!("coordinate {far:e} is farther than {FARTHEST:e} from the origin");
            self.mend("far", &problem, "the faces that use this v are left out", "scale the model down")?;
        }
        let usable = row.is_sound && is_near;
        self.scan.vertices.positions.push(if usable { position } else { DVec3::NAN });
        self.faces.has_bad_positions |= !usable;
        let colors = &mut self.scan.vertices.colors;
        // A fourth number alone is a weight, which only curves use.
        if row.found == 6 || !colors.is_empty() {
            colors.resize(self.scan.vertices.positions.len() - 1, Vec3::NAN);
            let color = DVec3::from_slice(&row.values[3..]).as_vec3();
            colors.push(if row.found == 6 { color } else { Vec3::NAN });
        }
        Ok(())
    }

    fn uv(&mut self, text: &str) -> Result<()> {
        // The second coordinate is optional.
        let row = self.row::<2>("vt", text, 1)?;
        let uv = Vec2::from(row.values.map(|value| value as f32));
        self.scan.vertices.uvs.push(if row.is_sound { uv } else { Vec2::NAN });
        Ok(())
    }

    fn normal(&mut self, text: &str) -> Result<()> {
        let row = self.row::<3>("vn", text, 3)?;
        // Rounded before, so that a normal is that of its text in f32.
        let normal = DVec3::from(row.values.map(|value| f64::from(value as f32)));
        self.scan.vertices.normals.push(if row.is_sound { normal.normalize_or_zero().as_vec3() } else { Vec3::ZERO });
        Ok(())
    }

    /// Reads the numbers of a statement, at most `N` and at least `least`. Tells of what is wrong.
    fn row<const N: usize>(&mut self, statement: &'static str, text: &str, least: usize) -> Result<NumberRow<N>> {
        let mut row = NumberRow { values: [0.0; N], found: 0, is_sound: true };
        for word in words(text).take(N) {
            let value = match read(word) {
                Word::Number(value) => value,
                Word::Odd(value) => {
                    let problem = || format!("{statement} has \"{word}\" for a number");
                    self.mend("odd number", &problem, "it is taken for a number", "write numbers such as 1.5")?;
                    value
                }
                Word::Other if row.found < least => {
                    row.is_sound = false;
                    self.bad_row(statement, &|| format!("{statement} has \"{word}\" for a number"))?;
                    f64::NAN
                }
                Word::Other => break,
            };
            row.values[row.found] = value;
            row.found += 1;
        }
        if row.found < least {
            let found = row.found;
            row.is_sound = false;
            self.bad_row(statement, &|| format!("{statement} has {found} of {least} numbers"))?;
        }
        // A `v` may have a colour, which is checked apart.
        let needed = if N == 2 { &row.values[..] } else { &row.values[..3] };
        if let Some(value) = needed.iter().map(|&value| value as f32).find(|value| !value.is_finite()).filter(|_| row.is_sound) {
            row.is_sound = false;
            let problem = || format!("{statement} has the value {value}");
            if statement == "vn" {
                // A degenerate face has such a normal in good exports too.
                self.warnings.tell(self.place(), "vn", &|| format!("{}; {NO_NORMAL}", problem()));
            } else {
                self.bad_row(statement, &problem)?;
            }
        }
        Ok(row)
    }

    fn bad_row(&mut self, statement: &'static str, problem: &dyn Fn() -> String) -> Result<()> {
        let mend = match statement {
            "v" => "the faces that use this v are left out",
            "vt" => "corners with it have no texture coordinate",
            _ => NO_NORMAL,
        };
        self.mend(statement, problem, mend, "give finite numbers, or export the model again")
    }

    fn face(&mut self, text: &str) -> Result<()> {
        let Self { faces, scan, warnings, .. } = self;
        let VertexLists { positions, uvs, normals, .. } = &scan.vertices;
        let place = Place { path: self.path, line: Some(self.line) };
        faces.add(warnings, place, text, [positions.len(), uvs.len(), normals.len()])
    }

    fn mend(&mut self, kind: &'static str, problem: &dyn Fn() -> String, mend: &str, cure: &str) -> Result<()> {
        self.warnings.mend(self.place(), &Fault { kind, problem, mend, cure })
    }

    fn place(&self) -> Place<'a> {
        Place { path: self.path, line: Some(self.line) }
    }

    fn finish(self) -> Result<Scan> {
        let Self { path, warnings, mut scan, mut faces, names, .. } = self;
        let error = |problem, cure| Err(Error::input(path, None, problem, cure));
        if faces.is_empty() {
            return match (faces.dropped, scan.vertices.positions.len()) {
                (0, 0) => error("there is no vertex (v) and no face (f): this is not a Wavefront OBJ", "export the model as OBJ"),
                (0, _) => {
                    error("there is no face (f), so there is nothing to render", "export the model with its faces, as a mesh")
                }
                _ => error("no face (f) can be used", "correct the faces, or export the model again"),
            };
        }
        faces.check(warnings, path, &scan.vertices)?;
        if faces.is_empty() {
            return error("no face (f) can be used", "correct the faces, or export the model again");
        }
        let [materials, objects, groups] = names.map(|names| names.list);
        let (parts, objects) = if objects.is_empty() { (GROUP, groups) } else { (OBJECT, objects) };
        scan.text = faces.write(&scan.vertices, parts);
        scan.objects = objects.into_iter().map(|object| object.name).collect();
        scan.materials = materials;
        Ok(scan)
    }
}

const NO_NORMAL: &str = "corners with it have no normal";

/// The numbers of a statement.
struct NumberRow<const N: usize> {
    /// 0 where there is none.
    values: [f64; N],
    found: usize,
    /// Whether all needed numbers are there and finite in f32.
    is_sound: bool,
}
