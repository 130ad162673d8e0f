//! Values at the vertices of a model's file, one row for each, from those at the vertices of a bake, of which a vertex of the file may have several.

use glam::Vec3;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::{BakeRequest, ReceiverKind, ReceiverValues};
use crate::error::{Error, Result};
use crate::image::Channel;
use crate::scene::{Mesh, Scene};

/// What the rows of a bake of vertices stand for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Per {
    /// A position with one normal, texture coordinate and colour.
    #[default]
    Row,
    /// A vertex of the model's file, as an OBJ's `v`, in the file's order, also those that no triangle uses. Objects with lists of their own follow each
    /// other.
    Source,
}

/// Files in which many primitives share one list of vertices could ask for any number.
const MOST_ROWS: usize = 1 << 26;

/// Columns of unit vectors begin with this.
const DIRECTION: &str = "BentNormal";

/// Gives means of unit vectors unit length again.
pub(super) fn normalize_directions(columns: &mut [Channel]) {
    for vector in columns.chunk_by_mut(|a, b| [a, b].iter().all(|column| column.name.starts_with(DIRECTION))) {
        let [x, y, z] = vector else { continue };
        for ((x, y), z) in x.samples.iter_mut().zip(&mut y.samples).zip(&mut z.samples) {
            let mean = Vec3::new(*x, *y, *z);
            [*x, *y, *z] = mean.try_normalize().unwrap_or(mean).to_array();
        }
    }
}

/// # Errors
/// [`Error::Usage`] when rows are to be vertices of a file, and the scene has none.
pub(super) fn check(request: &BakeRequest, scene: &Scene) -> Result<()> {
    let asked = request.per == Per::Source && request.receivers.contains(&ReceiverKind::Vertices);
    if asked && scene.mesh.sources.is_empty() {
        let problem = "--per source: the vertices of this scene are numbered by no file";
        return Err(Error::usage(problem, "leave it out, or bake a scene whose models are files"));
    }
    if asked && scene.source_lists.total() > MOST_ROWS {
        let problem = format!("--per source: the lists of vertices have {} rows together", scene.source_lists.total());
        return Err(Error::usage(problem, "leave it out: then there are rows for used vertices alone"));
    }
    Ok(())
}

impl ReceiverValues {
    /// The mean of the rows of each vertex of the file, weighted by the angles of their corners. A vertex that no triangle uses has the value NaN, no
    /// normal, and lies at the origin of its object.
    ///
    /// The values must be those of vertices with sources.
    pub(super) fn per_source(mut self, scene: &Scene) -> Self {
        let Some(mesh) = self.mesh.take() else { return self };
        let lists = &scene.source_lists;
        let targets: Vec<usize> = mesh.sources.iter().map(|&source| lists.place(source)).collect();
        let means = Means { weights: &weights(&mesh), targets: &targets, count: lists.total() };

        let mut columns: Vec<Channel> = self
            .columns
            .iter()
            .map(|Channel { name, samples }| Channel { name: name.clone(), samples: means.of(samples) })
            .collect();
        normalize_directions(&mut columns);
        let normal = |axis: usize| means.of(&self.normals.iter().map(|normal| normal[axis]).collect::<Vec<_>>());
        let [x, y, z] = [normal(0), normal(1), normal(2)];

        // The first row of each. All of them have one position.
        let mut rows = vec![None; lists.total()];
        targets.iter().enumerate().rev().for_each(|(row, &target)| rows[target] = Some(row as u32));
        let mut joined = Mesh { source_count: mesh.source_count, ..Mesh::default() };
        let (mut positions, mut normals, mut sources) = (Vec::new(), Vec::new(), Vec::new());
        for (i, row) in rows.iter().enumerate() {
            // A vertex with several texture coordinates keeps the first.
            joined.push_vertex_of(&mesh, row.unwrap_or(0));
            let source = row.map_or_else(|| lists.at(i), |row| mesh.sources[row as usize]);
            let origin = scene.instances[source.instance as usize].transform.translation;
            sources.push(source);
            positions.push(row.map_or(origin, |row| self.positions[row as usize]));
            let first = row.map_or(Vec3::ZERO, |row| self.normals[row as usize]);
            normals.push(Vec3::new(x[i], y[i], z[i]).try_normalize().unwrap_or(first));
        }
        joined.normals.clone_from(&normals);
        joined.triangles = mesh.triangles;
        for triangle in &mut joined.triangles {
            triangle.vertices = triangle.vertices.map(|row| targets[row as usize] as u32);
        }
        self.counts["sources"] = json!(lists.total());
        self.counts["unused"] = json!(rows.iter().filter(|row| row.is_none()).count());
        joined.sources = sources;
        Self { positions, normals, columns, mesh: Some(joined), ..self }
    }
}

/// Means of the rows that have one target.
struct Means<'a> {
    weights: &'a [f64],
    /// One a row.
    targets: &'a [usize],
    /// Number of targets.
    count: usize,
}

impl Means<'_> {
    /// NaN for targets without rows.
    fn of(&self, samples: &[f32]) -> Vec<f32> {
        let mut sums = vec![(0.0, 0.0); self.count];
        for (row, &sample) in samples.iter().enumerate() {
            let (sum, weight) = &mut sums[self.targets[row]];
            *sum += self.weights[row] * f64::from(sample);
            *weight += self.weights[row];
        }
        sums.into_iter().map(|(sum, weight)| (sum / weight) as f32).collect()
    }
}

/// The angles of the corners at each vertex together.
fn weights(mesh: &Mesh) -> Vec<f64> {
    // The angle of a sliver may round to 0, and the vertex still needs its value.
    let mut weights = vec![1e-9; mesh.positions.len()];
    for (triangle, vertices) in mesh.triangles.iter().map(|triangle| triangle.vertices).enumerate() {
        for (corner, vertex) in vertices.into_iter().enumerate() {
            weights[vertex as usize] += f64::from(mesh.angle(triangle, corner).max(0.0));
        }
    }
    weights
}
