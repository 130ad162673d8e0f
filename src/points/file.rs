//! Reads points from a file: positions and normals in world space, from PLY (`x y z nx ny nz` of the element `vertex`), NumPy (`[n, 6]`) or CSV
//! (one column each, by name or in this order). For any file, [`read`] returns valid points or an error that tells what is wrong and where.
//! CSV is read without a crate, because lines of numbers need no quoting, and the crate `csv` miscounts lines after blank ones.

use std::path::Path;

use glam::{DVec3, Vec3};

use crate::error::{Error, Result};
use crate::file::{MOST_BYTES, read_file};
use crate::{npy, ply};

/// Names of the columns, in the order of a CSV without names.
const COLUMNS: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];

/// Rounding to 32 bits changes the length of a unit normal by less than this.
const UNIT: f64 = 1e-6;

/// A point on a surface, in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrientedPoint {
    pub position: DVec3,
    /// Unit normal. A unit normal in the file keeps its bits.
    pub normal: Vec3,
}

/// Reads all points of a `.ply`, `.npy` or `.csv` file in its order: at least one, with finite numbers and unit normals.
pub fn read(path: &Path) -> Result<Vec<OrientedPoint>> {
    parser_of(path)?;
    let bytes = read_file(path, MOST_BYTES).map_err(|error| {
        Error::input(path, None, format!("cannot read these points: {error}"), "name an existing file that you may read")
    })?;
    parse(path, &bytes)
}

/// As [`read`], from the `bytes` of the file at `path`.
pub fn parse(path: &Path, bytes: &[u8]) -> Result<Vec<OrientedPoint>> {
    let parse = parser_of(path)?;
    let mut rows = PointReader { path, points: Vec::new(), without_normal: 0, first_without_normal: (0, None) };
    if bytes.is_empty() {
        return Err(rows.refused(None, "the file is empty"));
    }
    parse(bytes, &mut rows)?;
    rows.finish()
}

/// The same of rows x, y, z, nx, ny, nz in memory. `name` stands for the file in errors.
pub fn of_rows(name: &Path, all: impl Iterator<Item = [f64; 6]>) -> Result<Vec<OrientedPoint>> {
    let mut rows = PointReader { path: name, points: Vec::new(), without_normal: 0, first_without_normal: (0, None) };
    { all }.try_for_each(|row| rows.push(None, row))?;
    rows.finish()
}

type Parse = fn(&[u8], &mut PointReader) -> Result<()>;

/// Selects a parser by the path's ending.
fn parser_of(path: &Path) -> Result<Parse> {
    match path.extension().unwrap_or_default().to_ascii_lowercase().to_str() {
        Some("ply") => Ok(read_ply),
        Some("npy") => Ok(read_npy),
        Some("csv") => Ok(read_csv),
        _ => {
            let problem = format!("{}: the ending names no known format of points", path.display());
            Err(Error::usage(problem, "give a .ply, .npy or .csv file"))
        }
    }
}

/// Checks and collects points.
struct PointReader<'a> {
    path: &'a Path,
    points: Vec<OrientedPoint>,
    without_normal: usize,
    /// The point's number, from 1, and its line.
    first_without_normal: (usize, Option<usize>),
}

impl PointReader<'_> {
    fn refused(&self, line: Option<usize>, problem: impl Into<String>) -> Error {
        Error::input(self.path, line, problem, "give one x, y, z, nx, ny, nz a point")
    }

    fn no_normals(&self) -> Error {
        Error::input(
            self.path,
            None,
            "there are positions but no normals",
            "give nx, ny, nz beside x, y, z: the way the surface faces",
        )
    }

    fn push(&mut self, line: Option<usize>, row: [f64; 6]) -> Result<()> {
        let number = self.points.len() + 1;
        if let Some((name, value)) = COLUMNS.iter().zip(row).find(|(_, value)| !value.is_finite()) {
            return Err(self.refused(line, format!("{name} of point {number} is {value}")));
        }
        let [position, normal] = [DVec3::from_slice(&row[..3]), DVec3::from_slice(&row[3..])];
        if !position.as_vec3().is_finite() {
            return Err(self.refused(line, format!("point {number} is at {position}, which 32 bits cannot hold")));
        }
        let longest = normal.abs().max_element();
        let normal = if longest == 0.0 {
            self.without_normal += 1;
            if self.without_normal == 1 {
                self.first_without_normal = (number, line);
            }
            normal
        } else if (normal.length() - 1.0).abs() < UNIT {
            normal
        } else {
            // Divided first, because squares of very large or small numbers overflow or underflow.
            (normal / longest).normalize()
        };
        self.points.push(OrientedPoint { position, normal: normal.as_vec3() });
        Ok(())
    }

    fn finish(self) -> Result<Vec<OrientedPoint>> {
        match (self.points.len(), self.without_normal) {
            (0, _) => Err(self.refused(None, "there are no points in this file")),
            (_, 0) => Ok(self.points),
            (count, without) => {
                let (first, line) = self.first_without_normal;
                let problem = format!("the normal is zero at {without} of {count} points, first at point {first}");
                Err(Error::input(self.path, line, problem, "leave these points out, or give them the way the surface faces"))
            }
        }
    }
}

fn read_npy(bytes: &[u8], rows: &mut PointReader) -> Result<()> {
    let array = npy::Array::parse(rows.path, bytes)?;
    match *array.shape {
        [count, 6] => (0..count).try_for_each(|i| rows.push(None, std::array::from_fn(|k| array.at(&[i, k])))),
        [_, 3] => Err(rows.no_normals()),
        _ => Err(rows.refused(None, format!("the array has the shape {:?}, not [points, 6]", array.shape))),
    }
}

fn read_csv(bytes: &[u8], rows: &mut PointReader) -> Result<()> {
    let text = String::from_utf8_lossy(bytes);
    let lines = (1..).zip(text.trim_start_matches('\u{feff}').lines());
    let lines = lines.filter(|(_, text)| !text.trim().is_empty() && !text.starts_with('#'));
    let fields = |text: &'_ str| text.split(',').map(|field| field.trim().trim_matches('"').to_owned()).collect::<Vec<_>>();
    let mut lines = lines.map(|(line, text)| (line, fields(text))).peekable();

    let Some((line, first)) = lines.peek() else { return Ok(()) };
    let columns = if first.iter().all(|field| field.parse::<f64>().is_ok()) {
        counted_columns(first, *line, rows)?
    } else {
        let columns = named_columns(first, *line, rows)?;
        lines.next();
        columns
    };
    for (line, fields) in lines {
        let mut row = [0.0; 6];
        for (value, (column, name)) in row.iter_mut().zip(columns.into_iter().zip(COLUMNS)) {
            let refused = |problem| rows.refused(Some(line), format!("{name} is {problem}"));
            let field = fields.get(column).ok_or_else(|| refused(format!("missing, with {} fields", fields.len())))?;
            *value = field.parse().map_err(|_| refused(format!("\"{field}\", not a number")))?;
        }
        rows.push(Some(line), row)?;
    }
    Ok(())
}

/// The places of [`COLUMNS`] among the names in a CSV's first line.
fn named_columns(names: &[String], line: usize, rows: &PointReader) -> Result<[usize; 6]> {
    let find = |column: &str| names.iter().position(|name| name.eq_ignore_ascii_case(column));
    if let Some(missing) = COLUMNS[..3].iter().find(|column| find(column).is_none()) {
        return Err(rows.refused(Some(line), format!("the first line has neither numbers nor the name {missing}")));
    }
    let mut columns = [0; 6];
    for (column, name) in columns.iter_mut().zip(COLUMNS) {
        *column = find(name).ok_or_else(|| rows.no_normals())?;
    }
    Ok(columns)
}

/// The places of [`COLUMNS`] in a CSV without names.
fn counted_columns(fields: &[String], line: usize, rows: &PointReader) -> Result<[usize; 6]> {
    match fields.len() {
        6 => Ok([0, 1, 2, 3, 4, 5]),
        3 => Err(rows.no_normals()),
        count => Err(rows.refused(Some(line), format!("the first line has {count} numbers and no names say which are meant"))),
    }
}

fn read_ply(bytes: &[u8], rows: &mut PointReader) -> Result<()> {
    let path = rows.path;
    let broken = |ply::PlyFault { line, problem }| {
        let cure = "export it again, as PLY with x, y, z, nx, ny, nz";
        Error::input(path, line, format!("this is not a sound PLY: {problem}"), cure)
    };
    let (header, mut data) = ply::parse(bytes).map_err(broken)?;
    if let Some(fault) = header.unknown.into_iter().next() {
        return Err(broken(fault));
    }
    for element in &header.elements {
        data.holds(element).map_err(broken)?;
        if element.name != "vertex" {
            data.skip(element).map_err(broken)?;
            continue;
        }
        let columns = COLUMNS.map(|column| element.number(column));
        let [Some(x), Some(y), Some(z), normal @ ..] = columns else {
            return Err(rows.refused(None, "vertex has no x, y and z"));
        };
        let [Some(nx), Some(ny), Some(nz)] = normal else { return Err(rows.no_normals()) };
        let mut row = ply::ElementRow::default();
        for _ in 0..element.count {
            data.read(element, &mut row).map_err(broken)?;
            if row.is_longer {
                return Err(rows.refused(row.line, "this line has more numbers than the header says"));
            }
            rows.push(row.line, [x, y, z, nx, ny, nz].map(|column| row.numbers[column]))?;
        }
        break;
    }
    Ok(())
}
