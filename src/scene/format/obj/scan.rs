//! The statements of an OBJ file. Each error names its line. [`Scan::new`] is the entry point.

use std::collections::HashMap;
use std::ops::Range;
use std::path::Path;

use glam::{DVec3, Vec2, Vec3};

use crate::error::{Error, Result};

/// Maximum coordinate. The length of a triangle's normal needs the fourth power of an edge, which must stay finite in f32.
const FARTHEST: f32 = 1e9;

/// The test for a self-crossing polygon takes quadratic time in its corners.
const MOST_CORNERS: usize = 5000;

/// Contents of an OBJ file.
pub struct Scan<'a> {
    path: &'a Path,
    line: usize,
    /// Numbered from 1, as in OBJ. Entry 0 is zero, and means "none" for texture coordinates and normals.
    pub positions: Vec<Vec3>,
    pub uvs: Vec<Vec2>,
    pub normals: Vec<Vec3>,
    /// Corners of all faces: indices of position, texture coordinate and normal.
    pub corners: Vec<[u32; 3]>,
    pub runs: Vec<Run>,
    pub libraries: Vec<Named>,
    /// The first `usemtl` statement of each material.
    pub materials: Vec<Named>,
    /// Index into the materials, by name.
    by_name: HashMap<String, usize>,
    /// The largest index used of `v`, `vt` and `vn`, and its line. A face may come before its vertices.
    farthest: [(usize, usize); 3],
}

/// Consecutive faces with one material.
#[derive(Default)]
pub struct Run {
    /// Index into [`Scan::materials`]; `None` before the first `usemtl`.
    pub material: Option<usize>,
    /// Ranges of [`Scan::corners`].
    pub faces: Vec<Range<usize>>,
}

/// A name and the line that uses it.
pub struct Named {
    pub name: String,
    pub line: usize,
}

/// The kinds of indices, in the order in which a corner has them.
const STATEMENTS: [&str; 3] = ["v", "vt", "vn"];
const POSITION: usize = 0;

impl<'a> Scan<'a> {
    pub fn new(path: &'a Path, bytes: &[u8]) -> Result<Self> {
        let error = |problem, cure| Err(Error::input(path, None, problem, cure));
        if bytes.contains(&0) {
            return error("this is a binary file, not a Wavefront OBJ", "export the model as OBJ");
        }
        let mut scan = Self {
            path,
            line: 0,
            positions: vec![Vec3::ZERO],
            uvs: vec![Vec2::ZERO],
            normals: vec![Vec3::ZERO],
            corners: Vec::new(),
            runs: vec![Run::default()],
            libraries: Vec::new(),
            materials: Vec::new(),
            by_name: HashMap::new(),
            farthest: [(0, 0); 3],
        };
        // Names and comments may have another encoding than UTF-8. The geometry loads anyway.
        let text = String::from_utf8_lossy(bytes);
        for (line, statement) in (1..).zip(text.trim_start_matches('\u{feff}').lines()) {
            scan.line = line;
            scan.statement(statement)?;
        }
        if scan.corners.is_empty() {
            return match scan.count(POSITION) {
                0 => error("there is no vertex (v) and no face (f): this is not a Wavefront OBJ", "export the model as OBJ"),
                _ => error("there is no face (f), so there is nothing to render", "export the model with its faces, as a mesh"),
            };
        }
        for (kind, statement) in STATEMENTS.iter().enumerate() {
            let ((index, line), count) = (scan.farthest[kind], scan.count(kind));
            if index > count {
                scan.line = line;
                let problem = format!("face refers to {statement} {index}, but the file has {count}");
                return scan.error(problem, "correct the index, or export the model again");
            }
        }
        Ok(scan)
    }

    fn statement(&mut self, statement: &str) -> Result<()> {
        let (keyword, rest) = split_word(statement);
        match keyword {
            "v" => {
                let position = self.numbers(keyword, rest, 3)?;
                if let Some(far) = position.iter().find(|value| value.abs() > FARTHEST) {
                    let problem = format!("coordinate {far:e} is farther than {FARTHEST:e} from the origin");
                    return self.error(problem, "scale the model down");
                }
                self.positions.push(position.into());
            }
            "vt" => {
                // The second coordinate is optional.
                let dimensions = uncomment(rest).split_whitespace().count().clamp(1, 2);
                let [u, v, _] = self.numbers(keyword, rest, dimensions)?;
                self.uvs.push(Vec2::new(u, v));
            }
            "vn" => {
                let normal = self.numbers_or_nan(keyword, rest, 3)?;
                self.normals.push(DVec3::from(normal.map(f64::from)).normalize_or_zero().as_vec3());
            }
            "f" => self.face(uncomment(rest))?,
            "usemtl" | "mtllib" if rest.is_empty() => {
                return self.error(format!("{keyword} without a name"), "name it, or remove the line");
            }
            "usemtl" => self.use_material(rest),
            "mtllib" => self.libraries.push(Named { name: rest.to_owned(), line: self.line }),
            _ => {}
        }
        Ok(())
    }

    fn use_material(&mut self, name: &str) {
        let material = *self.by_name.entry(name.to_owned()).or_insert_with(|| {
            self.materials.push(Named { name: name.to_owned(), line: self.line });
            self.materials.len() - 1
        });
        match self.runs.last_mut() {
            Some(run) if run.material == Some(material) => {}
            Some(run) if run.faces.is_empty() => run.material = Some(material),
            _ => self.runs.push(Run { material: Some(material), faces: Vec::new() }),
        }
    }

    fn face(&mut self, corners: &str) -> Result<()> {
        let count = corners.split_whitespace().count();
        if !(3..=MOST_CORNERS).contains(&count) {
            let cure = format!("give 3 or more, at most {MOST_CORNERS}, or remove the line");
            return self.error(format!("a face with {count} corners"), cure);
        }
        let first = self.corners.len();
        for corner in corners.split_whitespace() {
            let mut parts = corner.split('/');
            let mut indices = [0; 3];
            for (kind, index) in indices.iter_mut().enumerate() {
                *index = self.index(kind, corner, parts.next())?;
            }
            if indices[POSITION] == 0 || parts.next().is_some() {
                return self.malformed(corner);
            }
            self.corners.push(indices);
        }
        if let Some(run) = self.runs.last_mut() {
            run.faces.push(first..self.corners.len());
        }
        Ok(())
    }

    /// Number of statements of this kind so far.
    fn count(&self, kind: usize) -> usize {
        [self.positions.len(), self.uvs.len(), self.normals.len()][kind] - 1
    }

    /// The index of a corner, from 1. It is 0 if the corner has none of this kind.
    fn index(&mut self, kind: usize, corner: &str, part: Option<&str>) -> Result<u32> {
        let Some(part) = part.filter(|part| !part.is_empty()) else { return Ok(0) };
        let Ok(index) = part.parse::<i64>() else { return self.malformed(corner) };
        let (statement, count) = (STATEMENTS[kind], self.count(kind));
        let absolute = match index {
            0 => return self.error(format!("index 0 in face corner {corner}"), "count from 1, as OBJ does"),
            1.. => index as usize,
            _ if index.unsigned_abs() > count as u64 => {
                let back = index.unsigned_abs();
                let problem = format!("face corner {corner} refers {back} {statement} back, but there are {count}");
                return self.error(problem, "correct the index, or export the model again");
            }
            _ => count + 1 - index.unsigned_abs() as usize,
        };
        self.farthest[kind] = self.farthest[kind].max((absolute, self.line));
        // An index that does not fit into u32 is above the count, and `new` refuses it.
        Ok(absolute as u32)
    }

    /// The first `count` numbers of `text`, which must be finite. The rest of the three are 0.
    fn numbers(&self, keyword: &str, text: &str, count: usize) -> Result<[f32; 3]> {
        let values = self.numbers_or_nan(keyword, text, count)?;
        match values.iter().find(|value| !value.is_finite()) {
            Some(value) => self.error(format!("{keyword} has the value {value}"), "give finite numbers"),
            None => Ok(values),
        }
    }

    fn numbers_or_nan(&self, keyword: &str, text: &str, count: usize) -> Result<[f32; 3]> {
        let mut words = uncomment(text).split_whitespace();
        let mut values = [0.0; 3];
        for (found, value) in values[..count].iter_mut().enumerate() {
            *value = match words.next().map(|word| (word, word.parse())) {
                Some((_, Ok(number))) => number,
                Some((word, Err(_))) => {
                    return self.error(format!("{keyword} has \"{word}\" for a number"), "give finite numbers");
                }
                None => return self.error(format!("{keyword} has {found} of {count} numbers"), "give the missing ones"),
            };
        }
        Ok(values)
    }

    fn malformed<T>(&self, corner: &str) -> Result<T> {
        self.error(format!("\"{corner}\" is not a face corner"), "write v, v/vt, v//vn or v/vt/vn, with whole numbers")
    }

    fn error<T>(&self, problem: impl Into<String>, cure: impl Into<String>) -> Result<T> {
        Err(Error::input(self.path, Some(self.line), problem, cure))
    }
}

/// The first word and the rest of the text, both trimmed.
pub fn split_word(text: &str) -> (&str, &str) {
    let text = text.trim();
    let (word, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
    (word, rest.trim_start())
}

/// Removes a comment. Only for numbers, because a name may contain `#`.
pub fn uncomment(text: &str) -> &str {
    text.split_once('#').map_or(text, |(before, _)| before)
}
