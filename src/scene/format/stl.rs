//! STL meshes, in text and in binary. They become one mesh, one instance and one material. [`load`] is the entry point.
//!
//! Corners at one position become one vertex. An STL has no list of vertices, so these are it, in the order in which they come first. The normals of the
//! file are not used, which are those of the faces, nor its colours, of which there are two contradicting encodings.
//!
//! The crate `stl_io` is not used: it refuses files of several solids, and binary files that begin with the word `solid`.

use std::collections::HashMap;
use std::path::Path;

use glam::DVec3;

use super::Loader;
use super::indexed::{Indexed, unusable};
use super::warnings::{Fault, Place};
use crate::error::{Error, Result};
use crate::scene::{Material, World};

const CURE: &str = "export the model again, as STL";
/// Bytes before the triangles of a binary file: a text, and the number of triangles.
const HEADER: usize = 84;
/// Bytes of a triangle: normal and corners in 32 bits, and two bytes that mean different things to different programs.
const TRIANGLE: usize = 50;

pub fn load(loader: &mut Loader, path: &Path) -> Result<World> {
    let bytes = loader.read_model(path, "STL")?;
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes);
    let mut reader = StlReader { loader, path, model: Indexed::default(), vertices: HashMap::new() };
    if is_binary(bytes) {
        reader.binary(bytes)?
    } else {
        reader.text(bytes)?
    }
    if reader.model.ends.is_empty() {
        return Err(Error::input(path, None, "there is no triangle: this is not an STL", CURE));
    }
    let model = reader.model;
    model.into_world(loader, path, vec![Material::default()])
}

/// Whether the size is that of a binary file, or it has bytes that no text has. Binary files may begin with `solid` too.
fn is_binary(bytes: &[u8]) -> bool {
    claimed(bytes).is_some_and(|count| HEADER + TRIANGLE * count == bytes.len())
        || !bytes.trim_ascii_start().get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"))
        || bytes.contains(&0)
}

/// The number of triangles in the header of a binary file.
fn claimed(bytes: &[u8]) -> Option<usize> {
    let count = bytes.get(HEADER - 4..HEADER)?;
    Some(u32::from_le_bytes(count.try_into().ok()?) as usize)
}

struct StlReader<'a, 'b> {
    loader: &'a mut Loader<'b>,
    path: &'a Path,
    model: Indexed,
    /// Vertices by the bits of their positions.
    vertices: HashMap<[u64; 3], u32>,
}

impl StlReader<'_, '_> {
    fn mend(&mut self, line: Option<usize>, kind: &'static str, problem: &dyn Fn() -> String, mend: &str) -> Result<()> {
        self.loader.warnings.mend(Place { path: self.path, line }, &Fault { kind, problem, mend, cure: CURE })
    }

    fn binary(&mut self, bytes: &[u8]) -> Result<()> {
        let Some(claimed) = claimed(bytes) else {
            return Err(Error::input(self.path, None, "this is not an STL: it is neither text nor long enough", CURE));
        };
        // Numbers of a mesh have bytes that text has not.
        if !bytes.contains(&0) && std::str::from_utf8(bytes).is_ok() {
            let cure = "name the file by its kind, or export the model again, as STL";
            return Err(Error::input(self.path, None, "this is a text that does not begin with \"solid\": it is no STL", cure));
        }
        let triangles = bytes[HEADER..].as_chunks::<TRIANGLE>().0;
        // Some programs leave the number at 0.
        let count = if claimed == 0 { triangles.len() } else { claimed.min(triangles.len()) };
        if HEADER + TRIANGLE * claimed != bytes.len() {
            let problem = || format!("the header says {claimed} triangles, and there are bytes for {}", triangles.len());
            self.mend(None, "count", &problem, &format!("{count} are read"))?;
        }
        // A closed surface has half as many vertices as triangles.
        self.vertices.reserve(count / 2);
        for (index, triangle) in triangles[..count].iter().enumerate() {
            let float = |at: usize| f64::from(f32::from_le_bytes([0, 1, 2, 3].map(|byte| triangle[at + byte])));
            for corner in 0..3 {
                let position = [0, 4, 8].map(|at| float(12 + 12 * corner + at));
                self.corner(None, 3 * index + corner, position.into())?;
            }
            self.model.end_face(None);
        }
        Ok(())
    }

    /// Reads the corners of each loop. All else in a text repeats them, or is a name.
    fn text(&mut self, bytes: &[u8]) -> Result<()> {
        let text = String::from_utf8_lossy(bytes);
        let (mut first, mut is_ended) = (0, false);
        for (index, statement) in text.lines().enumerate() {
            let line = Some(index + 1);
            let mut words = statement.split_ascii_whitespace();
            let keyword = words.next().unwrap_or_default().to_ascii_lowercase();
            is_ended = keyword == "endsolid" || is_ended && keyword.is_empty();
            match keyword.as_str() {
                "vertex" => {
                    let numbers: [f64; 3] =
                        std::array::from_fn(|_| words.next().and_then(|word| word.parse().ok()).unwrap_or(f64::NAN));
                    let number = self.model.corners.len();
                    self.corner(line, number, numbers.into())?;
                }
                "endloop" | "endfacet" | "facet" | "endsolid" if self.model.corners.len() > first => {
                    first = self.model.corners.len();
                    self.model.end_face(line);
                }
                _ => {}
            }
        }
        if self.model.corners.len() > first {
            self.mend(None, "end", &|| "the file ends within a facet".to_owned(), "it is left out")?;
            self.model.corners.truncate(first);
        } else if !is_ended {
            self.mend(None, "end", &|| "the file ends before endsolid".to_owned(), "the facets that are there are read")?;
        }
        Ok(())
    }

    /// Adds a corner to the face. `number` counts the corners of the file.
    fn corner(&mut self, line: Option<usize>, number: usize, position: DVec3) -> Result<()> {
        let problem = unusable(position);
        // Zero has two signs.
        let vertex = self.vertex_at(if problem.is_some() { DVec3::NAN } else { position + 0.0 });
        self.model.corners.push(vertex);
        match problem {
            None => Ok(()),
            Some(problem) => self.mend(line, "position", &|| format!("corner {number} is {problem}"), "its face is left out"),
        }
    }

    fn vertex_at(&mut self, position: DVec3) -> u32 {
        let model = &mut self.model;
        *self.vertices.entry(position.to_array().map(f64::to_bits)).or_insert_with(|| {
            model.positions.push(position);
            model.positions.len() as u32 - 1
        })
    }
}
