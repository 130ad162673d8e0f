//! Checks the text of an OBJ file line by line and rewrites it for tobj. [`scan`] is the entry point.
//!
//! The errors of tobj name no line. It also takes a polyline for a face, fails at a comment after a number, and gives a corner without `vn` the
//! normal of another corner. So [`scan`] reports each error with its line. It keeps only vertices and faces, with absolute indices, and gives each
//! corner a position, a texture coordinate and a normal.

use std::collections::HashSet;
use std::fmt::Write;
use std::path::Path;

use glam::DVec3;

use crate::error::{Error, Result};
use crate::scene::format::polygon::MOST_CORNERS;

/// Maximum coordinate. The length of a triangle's normal needs the fourth power of an edge, which must stay finite in f32.
const FARTHEST: f32 = 1e9;

/// Contents of an OBJ file. `text` is the text for tobj. One `mtllib` line at its top stands for all material libraries.
pub struct Scan {
    pub text: String,
    /// The `mtllib` statements.
    pub libraries: Vec<Named>,
    /// The first `usemtl` statement of each material.
    pub materials: Vec<Named>,
}

/// A name and the line that uses it.
pub struct Named {
    pub name: String,
    pub line: usize,
}

pub fn scan(path: &Path, bytes: &[u8]) -> Result<Scan> {
    let error = |problem, cure| Err(Error::input(path, None, problem, cure));
    if bytes.contains(&0) {
        return error("this is a binary file, not a Wavefront OBJ", "export the model as OBJ");
    }
    // Names and comments may have another encoding than UTF-8. The geometry loads anyway.
    let text = String::from_utf8_lossy(bytes);
    let mut scanner = ObjScanner::new(path);
    for (index, statement) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        scanner.line = index + 1;
        scanner.statement(statement)?;
    }
    if scanner.faces.is_empty() {
        return match scanner.counts[POSITION] {
            0 => error("there is no vertex (v) and no face (f): this is not a Wavefront OBJ", "export the model as OBJ"),
            _ => error("there is no face (f), so there is nothing to render", "export the model with its faces, as a mesh"),
        };
    }
    scanner.check_farthest()?;
    Ok(scanner.finish())
}

const POSITION: usize = 0;
const UV: usize = 1;
const NORMAL: usize = 2;
const STATEMENTS: [&str; 3] = ["v", "vt", "vn"];

struct ObjScanner<'a> {
    path: &'a Path,
    line: usize,
    /// Number of `v`, `vt` and `vn` so far.
    counts: [usize; 3],
    /// The largest index used of each, and its line. A face may come before its vertices.
    farthest: [(usize, usize); 3],
    vertices: String,
    faces: String,
    libraries: Vec<Named>,
    materials: Vec<Named>,
    /// Names of `materials`.
    seen: HashSet<String>,
}

impl<'a> ObjScanner<'a> {
    fn new(path: &'a Path) -> Self {
        Self {
            path,
            line: 0,
            counts: [0; 3],
            farthest: [(0, 0); 3],
            vertices: String::new(),
            faces: String::new(),
            libraries: Vec::new(),
            materials: Vec::new(),
            seen: HashSet::new(),
        }
    }

    fn statement(&mut self, statement: &str) -> Result<()> {
        let (keyword, rest) = split_word(statement);
        match keyword {
            "v" => {
                let [x, y, z] = self.numbers(keyword, rest, 3)?;
                if let Some(far) = [x, y, z].iter().map(|&value| value as f32).find(|value| value.abs() > FARTHEST) {
                    let problem = format!("coordinate {far:e} is farther than {FARTHEST:e} from the origin");
                    return self.error(problem, "scale the model down");
                }
                self.vertex(POSITION, format_args!("{x:e} {y:e} {z:e}"));
            }
            "vt" => {
                // The second coordinate is optional.
                let dimensions = uncomment(rest).split_whitespace().count().clamp(1, 2);
                let [u, v, _] = self.numbers(keyword, rest, dimensions)?.map(|value| value as f32);
                self.vertex(UV, format_args!("{u} {v}"));
            }
            "vn" => {
                let normal = self.numbers_or_nan(keyword, rest, 3)?;
                let [x, y, z] = DVec3::from(normal.map(|value| f64::from(value as f32))).normalize_or_zero().to_array();
                self.vertex(NORMAL, format_args!("{} {} {}", x as f32, y as f32, z as f32));
            }
            "f" => self.face(uncomment(rest))?,
            "usemtl" | "mtllib" if rest.is_empty() => {
                return self.error(format!("{keyword} without a name"), "name it, or remove the line");
            }
            "usemtl" => {
                _ = writeln!(self.faces, "usemtl {rest}");
                if self.seen.insert(rest.to_owned()) {
                    self.materials.push(Named { name: rest.to_owned(), line: self.line });
                }
            }
            "mtllib" => self.libraries.push(Named { name: rest.to_owned(), line: self.line }),
            _ => {}
        }
        Ok(())
    }

    fn vertex(&mut self, kind: usize, values: std::fmt::Arguments) {
        self.counts[kind] += 1;
        _ = writeln!(self.vertices, "{} {values}", STATEMENTS[kind]);
    }

    fn face(&mut self, corners: &str) -> Result<()> {
        let count = corners.split_whitespace().count();
        if !(3..=MOST_CORNERS).contains(&count) {
            let cure = format!("give 3 or more, at most {MOST_CORNERS}, or remove the line");
            return self.error(format!("a face with {count} corners"), cure);
        }
        self.faces.push('f');
        for corner in corners.split_whitespace() {
            let mut parts = corner.split('/');
            let position = self.index(POSITION, corner, parts.next())?;
            let uv = self.index(UV, corner, parts.next())?;
            let normal = self.index(NORMAL, corner, parts.next())?;
            if position == 0 || parts.next().is_some() {
                return self.malformed(corner);
            }
            // `finish` puts an entry that means "none" before the first vt and vn.
            _ = write!(self.faces, " {position}/{}/{}", uv + 1, normal + 1);
        }
        self.faces.push('\n');
        Ok(())
    }

    /// The index of a corner, from 1. It is 0 if the corner has none of this kind.
    fn index(&mut self, kind: usize, corner: &str, part: Option<&str>) -> Result<usize> {
        let Some(part) = part.filter(|part| !part.is_empty()) else { return Ok(0) };
        let Ok(index) = part.parse::<i64>() else { return self.malformed(corner) };
        let statement = STATEMENTS[kind];
        let count = self.counts[kind];
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
        Ok(absolute)
    }

    fn check_farthest(&mut self) -> Result<()> {
        for (kind, statement) in STATEMENTS.iter().enumerate() {
            let (index, line) = self.farthest[kind];
            let count = self.counts[kind];
            if index > count {
                self.line = line;
                let problem = format!("face refers to {statement} {index}, but the file has {count}");
                return self.error(problem, "correct the index, or export the model again");
            }
        }
        Ok(())
    }

    /// The first `count` numbers of `text`, which must be finite in f32 too. The rest of the three are 0.
    fn numbers(&self, keyword: &str, text: &str, count: usize) -> Result<[f64; 3]> {
        let values = self.numbers_or_nan(keyword, text, count)?;
        match values.iter().map(|&value| value as f32).find(|value| !value.is_finite()) {
            Some(value) => self.error(format!("{keyword} has the value {value}"), "give finite numbers"),
            None => Ok(values),
        }
    }

    fn numbers_or_nan(&self, keyword: &str, text: &str, count: usize) -> Result<[f64; 3]> {
        let mut words = uncomment(text).split_whitespace();
        let mut values = [0.0; 3];
        for (found, value) in values[..count].iter_mut().enumerate() {
            let Some(word) = words.next() else {
                return self.error(format!("{keyword} has {found} of {count} numbers"), "give the missing ones");
            };
            let Some(number) = number(word) else {
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

    fn finish(self) -> Scan {
        let text = format!("mtllib all\nvt 0 0\nvn 0 0 0\n{}{}", self.vertices, self.faces);
        Scan { text, libraries: self.libraries, materials: self.materials }
    }
}

/// Parses a number in f64 so that its rounding to f32 is that of the text. Rounding twice differs where the f64 lies between two f32.
fn number(word: &str) -> Option<f64> {
    let (exact, near): (f64, f32) = (word.parse().ok()?, word.parse().ok()?);
    Some(match f64::from(near) - f64::from(exact as f32) {
        above if above > 0.0 => exact.next_up(),
        below if below < 0.0 => exact.next_down(),
        _ => exact,
    })
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
