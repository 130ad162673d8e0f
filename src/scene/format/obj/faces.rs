//! Faces of an OBJ file: their corners, the mending of bad ones, and their text for tobj.

use std::path::Path;

use super::number::words;
use super::scan::{MATERIAL, VertexLists};
use crate::error::Result;
use crate::scene::format::polygon::MOST_CORNERS;
use crate::scene::format::warnings::{Fault, Place, Warnings};

const STATEMENTS: [&str; 3] = ["v", "vt", "vn"];

/// Kinds of faults, by list.
const OUTSIDE: [&str; 3] = ["v outside", "vt outside", "vn outside"];
const ZERO: [&str; 3] = ["v 0", "vt 0", "vn 0"];
const BEFORE: [&str; 3] = ["v before", "vt before", "vn before"];
const LEFT_OUT: &str = "the face is left out";
const MENDS: [&str; 3] = [LEFT_OUT, "the corner has no texture coordinate", "the corner has no normal"];

const EXPORT: &str = "correct the index, or export the model again";

/// The faces of a file, in order.
#[derive(Default)]
pub struct Faces {
    /// Indices of each corner in the lists of `v`, `vt` and `vn`, from 1. 0 is none.
    corners: Vec<[u32; 3]>,
    faces: Vec<Face>,
    /// The first face after each statement `usemtl`, `o` or `g`, with its kind and the index of its name.
    starts: Vec<(usize, usize, usize)>,
    /// The largest index used in each list. A face may come before its vertices.
    largest: [u32; 3],
    /// Number of faces that were left out.
    pub dropped: usize,
    /// Whether some positions cannot be used.
    pub has_bad_positions: bool,
}

#[derive(Clone, Copy)]
struct Face {
    /// Index behind its last corner.
    end: usize,
    line: u32,
}

impl Faces {
    pub fn is_empty(&self) -> bool {
        self.faces.is_empty()
    }

    /// Starts a material, object or group.
    pub fn start(&mut self, kind: usize, index: usize) {
        self.starts.push((self.faces.len(), kind, index));
    }

    /// Adds a face whose statement stands after `counts` vertices, coordinates and normals.
    pub fn add(&mut self, warnings: &mut Warnings, place: Place, text: &str, counts: [usize; 3]) -> Result<()> {
        let first = self.corners.len();
        let mut is_sound = true;
        for word in words(text).take(MOST_CORNERS + 1) {
            let corner = match plain_corner(word, counts) {
                Some(corner) => Some(corner),
                None => odd_corner(warnings, place, word, counts)?,
            };
            let Some(corner) = corner else {
                is_sound = false;
                break;
            };
            self.corners.push(corner);
        }
        let count = self.corners.len() - first;
        if is_sound && !(3..=MOST_CORNERS).contains(&count) {
            is_sound = false;
            let problem = || match count {
                1 => "a face with 1 corner".to_owned(),
                _ if count > MOST_CORNERS => format!("a face with {} corners", words(text).count()),
                _ => format!("a face with {count} corners"),
            };
            let cure = format!("give 3 or more, at most {MOST_CORNERS}, or remove the line");
            warnings.mend(place, &Fault { kind: "corners", problem: &problem, mend: LEFT_OUT, cure: &cure })?;
        }
        if is_sound {
            for corner in &self.corners[first..] {
                self.largest = std::array::from_fn(|list| self.largest[list].max(corner[list]));
            }
            self.faces.push(Face { end: self.corners.len(), line: place.line.unwrap_or(0) as u32 });
        } else {
            self.corners.truncate(first);
            self.dropped += 1;
        }
        Ok(())
    }

    /// Leaves out faces whose vertices do not exist or cannot be used, and takes such coordinates and normals from corners.
    pub fn check(&mut self, warnings: &mut Warnings, path: &Path, vertices: &VertexLists) -> Result<()> {
        let counts = vertices.counts();
        if !self.has_bad_positions && (0..3).all(|list| self.largest[list] as usize <= counts[list]) {
            return Ok(());
        }
        let Self { corners, faces, starts, .. } = std::mem::take(self);
        let mut starts = starts.into_iter().peekable();
        let mut first = 0;
        for (index, face) in faces.into_iter().enumerate() {
            while let Some((_, kind, name)) = starts.next_if(|start| start.0 <= index) {
                self.start(kind, name);
            }
            let place = Place { path, line: Some(face.line as usize) };
            let mut is_sound = true;
            let kept = self.corners.len();
            for &(mut corner) in &corners[first..face.end] {
                for list in 0..3 {
                    let index = corner[list] as usize;
                    if index > counts[list] {
                        let count = counts[list];
                        let problem = || format!("face refers to {} {index}, but the file has {count}", STATEMENTS[list]);
                        let fault = Fault { kind: OUTSIDE[list], problem: &problem, mend: MENDS[list], cure: EXPORT };
                        warnings.mend(place, &fault)?;
                        corner[list] = 0;
                    }
                }
                is_sound &= corner[0] > 0 && vertices.positions[corner[0] as usize - 1].is_finite();
                self.corners.push(corner);
                if !is_sound {
                    break;
                }
            }
            first = face.end;
            if is_sound {
                self.faces.push(Face { end: self.corners.len(), ..face });
            } else {
                self.corners.truncate(kept);
            }
        }
        Ok(())
    }

    /// The faces for tobj. A vertex, coordinate or normal has its number, from 1, in place of its values; 0 is none. Objects or groups are `parts`.
    pub fn write(self, vertices: &VertexLists, parts: usize) -> String {
        let mut text = Text(String::from("mtllib all\nvt 0 0\nvn 0 0 0\n"));
        for (list, &count) in vertices.counts().iter().enumerate() {
            for index in 1..=count as u32 {
                text.0 += ["v ", "vt ", "vn "][list];
                text.number(index);
                text.0 += [" 0 0\n", " 0\n", " 0 0\n"][list];
            }
        }
        let mut starts = self.starts.into_iter().peekable();
        let mut first = 0;
        for (index, face) in self.faces.iter().enumerate() {
            while let Some((_, kind, name)) = starts.next_if(|start| start.0 <= index) {
                if kind == MATERIAL || kind == parts {
                    text.0 += if kind == MATERIAL { "usemtl " } else { "o " };
                    text.number(name as u32);
                    text.0.push('\n');
                }
            }
            text.0.push('f');
            for &[position, uv, normal] in &self.corners[first..face.end] {
                for (before, index) in [(' ', position), ('/', uv + 1), ('/', normal + 1)] {
                    text.0.push(before);
                    text.number(index);
                }
            }
            text.0.push('\n');
            first = face.end;
        }
        text.0
    }
}

/// A text to which numbers are added fast.
struct Text(String);

impl Text {
    fn number(&mut self, number: u32) {
        self.0 += itoa::Buffer::new().format(number);
    }
}

/// Reads a corner in one of the forms v, v/vt, v//vn and v/vt/vn. `None` if something is wrong in it.
fn plain_corner(word: &str, counts: [usize; 3]) -> Option<[u32; 3]> {
    let mut corner = [0; 3];
    let bytes = word.as_bytes();
    let mut at = 0;
    for list in 0..3 {
        let negative = bytes.get(at) == Some(&b'-');
        at += usize::from(negative);
        let start = at;
        let mut value: u64 = 0;
        // 9 digits, so that the index fits.
        while at - start < 9 && bytes.get(at).is_some_and(u8::is_ascii_digit) {
            value = 10 * value + u64::from(bytes[at] - b'0');
            at += 1;
        }
        corner[list] = match (at - start, negative, value) {
            (0, false, _) if list > 0 => 0,
            (0, ..) | (_, _, 0) => return None,
            (_, false, _) => value as u32,
            (_, true, _) => (counts[list] as u64 + 1).checked_sub(value).filter(|&index| index > 0)? as u32,
        };
        match bytes.get(at) {
            None => return Some(corner),
            Some(b'/') => at += 1,
            Some(_) => return None,
        }
    }
    None
}

/// Reads a corner with faults. `None` if it has no usable vertex.
fn odd_corner(warnings: &mut Warnings, place: Place, word: &str, counts: [usize; 3]) -> Result<Option<[u32; 3]>> {
    let mut mend = |kind, problem: &dyn Fn() -> String, mend, cure| warnings.mend(place, &Fault { kind, problem, mend, cure });
    const FORMS: &str = "write v, v/vt, v//vn or v/vt/vn, with whole numbers";
    let malformed = || format!("\"{word}\" is not a face corner");
    let mut corner = [0; 3];
    for (list, part) in word.split('/').enumerate() {
        if list == 3 {
            mend("long corner", &malformed, "only its first three indices are used", FORMS)?;
            break;
        }
        if part.is_empty() && list > 0 {
            continue;
        }
        let (statement, count) = (STATEMENTS[list], counts[list]);
        let index = match part.parse::<i64>() {
            Ok(index) => index,
            // A whole number with a fraction of zeros.
            Err(_) => match part.parse::<f64>() {
                Ok(value) if value.fract() == 0.0 && value.abs() < 4e9 => {
                    mend("fraction", &malformed, "its indices are taken for whole numbers", FORMS)?;
                    value as i64
                }
                _ => {
                    mend(["v malformed", "vt malformed", "vn malformed"][list], &malformed, MENDS[list], FORMS)?;
                    0
                }
            },
        };
        corner[list] = match index {
            0 if part.parse::<i64>().is_ok() => {
                let problem = || format!("index 0 of {statement} in face corner {word}");
                mend(ZERO[list], &problem, MENDS[list], "count from 1, as OBJ does")?;
                0
            }
            0 => 0,
            1.. if index <= i64::from(u32::MAX - 1) => index as u32,
            1.. => {
                let problem = || format!("face refers to {statement} {index}, more than a file can have");
                mend(OUTSIDE[list], &problem, MENDS[list], EXPORT)?;
                0
            }
            _ => match (count as i64).checked_add(index) {
                Some(before @ 0..) => before as u32 + 1,
                _ => {
                    let back = index.unsigned_abs();
                    let problem = || format!("face corner {word} refers {back} {statement} back, but there are {count}");
                    mend(BEFORE[list], &problem, MENDS[list], EXPORT)?;
                    0
                }
            },
        };
        if list == 0 && corner[0] == 0 {
            return Ok(None);
        }
    }
    Ok((corner[0] > 0).then_some(corner))
}

impl VertexLists {
    /// Numbers of `v`, `vt` and `vn`.
    fn counts(&self) -> [usize; 3] {
        [self.positions.len(), self.uvs.len(), self.normals.len()]
    }
}
