//! The statements of an OBJ, each error with its line. [`Scan::new`] is the entry point.

use std::collections::HashMap;
use std::ops::Range;
use std::path::Path;

use glam::{DVec3, Vec2, Vec3};

use crate::error::{Error, Result};

/// The fourth power of a triangle's edge, which the length of its normal needs, stays finite in f32 up to here.
const FARTHEST: f32 = 1e9;

/// Whether a polygon crosses itself takes the square of its corners in time.
const MOST_CORNERS: usize = 5000;

/// What an OBJ says.
pub struct Scan {
    /// From index 1 on, as OBJ counts. Index 0 is zero, and means "none" for texture coordinates and normals.
    pub positions: Vec<Vec3>,
    pub uvs: Vec<Vec2>,
    pub normals: Vec<Vec3>,
    /// Of all faces: indices of position, texture coordinate and normal.
    pub corners: Vec<[u32; 3]>,
    pub runs: Vec<Run>,
    /// The `mtllib` statements.
    pub libraries: Vec<Named>,
    /// The `usemtl` statements, the first of each material.
    pub materials: Vec<Named>,
}

/// Consecutive faces of one material.
#[derive(Default)]
pub struct Run {
    /// Into [`Scan::materials`]; none before the first `usemtl`.
    pub material: Option<usize>,
    /// Into [`Scan::corners`].
    pub faces: Vec<Range<usize>>,
}

/// A name and the line that uses it.
pub struct Named {
    pub name: String,
    pub line: usize,
}

impl Scan {
    pub fn new(path: &Path, bytes: &[u8]) -> Result<Self> {
        let error = |problem, cure| Err(Error::input(path, None, problem, cure));
        if bytes.contains(&0) {
            return error("this is a binary file, not a Wavefront OBJ", "export the model as OBJ");
        }
        let found = Self {
            positions: vec![Vec3::ZERO],
            uvs: vec![Vec2::ZERO],
            normals: vec![Vec3::ZERO],
            corners: Vec::new(),
            runs: vec![Run::default()],
            libraries: Vec::new(),
            materials: Vec::new(),
        };
        let mut scanner = Scanner { path, line: 0, found, farthest: [(0, 0); 3], seen: HashMap::new() };
        // Names and comments in another encoding than UTF-8 must not keep the geometry from loading.
        let text = String::from_utf8_lossy(bytes);
        for (index, statement) in text.trim_start_matches('\u{feff}').lines().enumerate() {
            scanner.line = index + 1;
            scanner.statement(statement)?;
        }
        if scanner.found.corners.is_empty() {
            return match scanner.count(POSITION) {
                0 => error("there is no vertex (v) and no face (f): this is not a Wavefront OBJ", "export the model as OBJ"),
                _ => error("there is no face (f), so there is nothing to render", "export the model with its faces, as a mesh"),
            };
        }
        scanner.check_farthest()?;
        Ok(scanner.found)
    }
}

/// The kinds of indices, in the order of a corner's.
const STATEMENTS: [&str; 3] = ["v", "vt", "vn"];
const POSITION: usize = 0;

struct Scanner<'a> {
    path: &'a Path,
    line: usize,
    found: Scan,
    /// The greatest index used of `v`, `vt` and `vn`, and the line of its use: a face may come before its vertices.
    farthest: [(usize, usize); 3],
    /// Names of the materials.
    seen: HashMap<String, usize>,
}

impl Scanner<'_> {
    fn statement(&mut self, statement: &str) -> Result<()> {
        let (keyword, rest) = split_word(statement);
        match keyword {
            "v" => {
                let position = self.numbers(keyword, rest, 3)?;
                if let Some(far) = position.iter().find(|value| value.abs() > FARTHEST) {
                    let problem = format!("coordinate {far:e} is farther than {FARTHEST:e} from the origin");
                    return self.error(problem, "scale the model down");
                }
                self.found.positions.push(position.into());
            }
            "vt" => {
                // The second coordinate is optional.
                let dimensions = uncomment(rest).split_whitespace().count().clamp(1, 2);
                let [u, v, _] = self.numbers(keyword, rest, dimensions)?;
                self.found.uvs.push(Vec2::new(u, v));
            }
            "vn" => {
                let normal = self.numbers_or_nan(keyword, rest, 3)?;
                self.found.normals.push(DVec3::from(normal.map(f64::from)).normalize_or_zero().as_vec3());
            }
            "f" => self.face(uncomment(rest))?,
            "usemtl" | "mtllib" if rest.is_empty() => {
                return self.error(format!("{keyword} without a name"), "name it, or remove the line");
            }
            "usemtl" => self.use_material(rest),
            "mtllib" => self.found.libraries.push(Named { name: rest.to_owned(), line: self.line }),
            _ => {}
        }
        Ok(())
    }

    fn use_material(&mut self, name: &str) {
        let Scan { runs, materials, .. } = &mut self.found;
        let material = *self.seen.entry(name.to_owned()).or_insert_with(|| {
            materials.push(Named { name: name.to_owned(), line: self.line });
            materials.len() - 1
        });
        match runs.last_mut() {
            Some(run) if run.material == Some(material) => {}
            Some(run) if run.faces.is_empty() => run.material = Some(material),
            _ => runs.push(Run { material: Some(material), faces: Vec::new() }),
        }
    }

    fn face(&mut self, corners: &str) -> Result<()> {
        let count = corners.split_whitespace().count();
        if !(3..=MOST_CORNERS).contains(&count) {
            let cure = format!("give 3 or more, at most {MOST_CORNERS}, or remove the line");
            return self.error(format!("a face with {count} corners"), cure);
        }
        let first = self.found.corners.len();
        for corner in corners.split_whitespace() {
            let mut parts = corner.split('/');
            let mut indices = [0; 3];
            for (kind, index) in indices.iter_mut().enumerate() {
                *index = self.index(kind, corner, parts.next())?;
            }
            if indices[POSITION] == 0 || parts.next().is_some() {
                return self.malformed(corner);
            }
            self.found.corners.push(indices);
        }
        if let Some(run) = self.found.runs.last_mut() {
            run.faces.push(first..self.found.corners.len());
        }
        Ok(())
    }

    /// How many of a kind there are so far.
    fn count(&self, kind: usize) -> usize {
        [self.found.positions.len(), self.found.uvs.len(), self.found.normals.len()][kind] - 1
    }

    /// Counts from 1; 0 means that the corner has none of this kind.
    fn index(&mut self, kind: usize, corner: &str, part: Option<&str>) -> Result<u32> {
        let Some(part) = part.filter(|part| !part.is_empty()) else { return Ok(0) };
        let Ok(index) = part.parse::<i64>() else { return self.malformed(corner) };
        let statement = STATEMENTS[kind];
        let count = self.count(kind);
        let absolute = match index {
            0 => return self.error(format!("index 0 in face corner {corner}"), "count from 1, as OBJ does"),
            1.. => index as usize,
            _ => match count.checked_add_signed(index as isize) {
                Some(before) => before + 1,
                None => {
                    let problem =
                        format!("face corner {corner} refers {} {statement} back, but there are {count}", index.unsigned_abs());
                    return self.error(problem, "correct the index, or export the model again");
                }
            },
        };
        self.farthest[kind] = self.farthest[kind].max((absolute, self.line));
        // What does not fit is beyond the vertices, and refused for that.
        Ok(absolute as u32)
    }

    fn check_farthest(&mut self) -> Result<()> {
        for (kind, statement) in STATEMENTS.iter().enumerate() {
            let (index, line) = self.farthest[kind];
            let count = self.count(kind);
            if index > count {
                self.line = line;
                let problem = format!("face refers to {statement} {index}, but the file has {count}");
                return self.error(problem, "correct the index, or export the model again");
            }
        }
        Ok(())
    }

    /// The first `count` numbers of `text`; the others of the three are 0.
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
            let Some(word) = words.next() else {
                return self.error(format!("{keyword} has {found} of {count} numbers"), "give the missing ones");
            };
            let Ok(number) = word.parse() else {
                return self.error(format!("{keyword} has \"{word}\" for a number"), "give finite numbers");
            };
            *value = number;
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

/// The first word and the rest, both trimmed.
pub fn split_word(text: &str) -> (&str, &str) {
    let text = text.trim();
    let (word, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
    (word, rest.trim_start())
}

/// For numbers only: a name may contain `#`.
pub fn uncomment(text: &str) -> &str {
    text.split_once('#').map_or(text, |(before, _)| before)
}
