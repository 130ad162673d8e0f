//! A primitive of a glTF mesh as a [`Mesh`]: triangles from lists, strips and fans, and the attributes of their vertices.

use glam::{Affine2, Vec2, Vec3, vec2};
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;

use super::SHOWN_COLOURS;
use super::accessors::AccessorValues;
use super::buffers::Buffers;
use super::document::BROKEN;
use super::draco::Unpacked;
use super::pose::{Pose, Posed};
use crate::error::{Error, Result};
use crate::scene::format::FARTHEST;
use crate::scene::format::warnings::{Fault, Place, Warnings};
use crate::scene::mesh::has_area;
use crate::scene::{Mesh, Source, Triangle};

/// How the material of a primitive is laid on it.
#[derive(Clone, Copy, Default)]
pub struct Look {
    /// Index into the materials of the world.
    pub material: u32,
    /// The set of coordinates of the texture, and what becomes of them. From v down to v up.
    pub coordinates: Option<(u32, Affine2)>,
}

/// What is counted for the warnings about all primitives.
#[derive(Default)]
pub struct Tally {
    pub triangles: usize,
    /// Triangles without area.
    pub flat: usize,
    /// Primitives of points or lines.
    pub lines: usize,
    /// Meshes with morph targets, and with joints.
    pub morphed: usize,
    pub skinned: usize,
}

/// Reads primitives.
pub struct Primitives<'a, 'b> {
    pub buffers: &'a Buffers<'b>,
    pub tally: Tally,
}

/// A primitive that is being read.
struct PrimitiveReading<'a, 'b> {
    buffers: &'a Buffers<'b>,
    primitive: &'a Primitive,
    unpacked: Option<&'a Unpacked>,
    place: &'a str,
}

impl<'a> PrimitiveReading<'a, '_> {
    /// The values of an attribute, if the primitive has it.
    fn values(&self, semantic: Semantic, widths: &[usize]) -> Result<Option<AccessorValues<'a>>> {
        let name = semantic.to_string();
        let Some(accessor) = self.primitive.attributes.get(&Checked::Valid(semantic)) else { return Ok(None) };
        if let Some(unpacked) = self.unpacked
            && let Some(values) = unpacked.values(self.buffers, &name, accessor.value())?
        {
            return Ok(Some(values).filter(|values| widths.contains(&values.width)));
        }
        self.buffers.values(accessor.value(), widths).map(Some)
    }

    /// The same of an attribute without which the primitive can do. It must be there for each of `count` vertices.
    fn spare(
        &self,
        warnings: &mut Warnings,
        semantic: Semantic,
        widths: &[usize],
        count: usize,
    ) -> Result<Option<AccessorValues<'a>>> {
        let name = semantic.to_string();
        let problem = match self.values(semantic, widths) {
            Ok(Some(values)) if values.count < count => {
                format!("{} {name} has {} values for {count} vertices", self.place, values.count)
            }
            Ok(values) => return Ok(values),
            Err(Error::Input { problem, .. }) => format!("{} {name}: {problem}", self.place),
            Err(other) => return Err(other),
        };
        self.mend(warnings, "attribute", &|| problem.clone(), "it is left out")?;
        Ok(None)
    }

    /// Whether the vertex colours are light of a bake.
    fn shows_light(&self) -> bool {
        let index = self.primitive.attributes.get(&Checked::Valid(Semantic::Colors(0)));
        let accessor = index.and_then(|index| self.buffers.document.root.accessors.get(index.value()));
        accessor.is_some_and(|accessor| accessor.name.as_deref() == Some(SHOWN_COLOURS))
    }

    fn mend(&self, warnings: &mut Warnings, kind: &'static str, problem: &dyn Fn() -> String, mend: &str) -> Result<()> {
        let place = Place { path: self.buffers.document.path, line: None };
        warnings.mend(place, &Fault { kind, problem, mend, cure: BROKEN })
    }

    /// The corners of all triangles, as indices of vertices.
    fn triangles(&self, warnings: &mut Warnings, mode: Mode, vertices: usize) -> Result<Vec<[u32; 3]>> {
        if let Some(unpacked) = self.unpacked {
            self.buffers.take(unpacked.count_triangles())?;
            return Ok(unpacked.triangles());
        }
        let indices = self.primitive.indices.map(|index| self.buffers.values(index.value(), &[1])).transpose()?;
        let count = indices.as_ref().map_or(vertices, |indices| indices.count);
        self.buffers.take(count)?;
        if mode == Mode::Triangles && !count.is_multiple_of(3) {
            let problem = || format!("{} has {count} corners, which are no whole triangles", self.place);
            self.mend(warnings, "corners", &problem, "the last are left out")?;
        }
        Ok(triangles_of(mode, indices.as_ref(), count))
    }
}

/// The corners of all triangles of a primitive with `count` corners, as indices of vertices.
pub fn triangles_of(mode: Mode, indices: Option<&AccessorValues>, count: usize) -> Vec<[u32; 3]> {
    let corners = |places: [usize; 3]| places.map(|at| indices.map_or(at as u32, |indices| indices.index(at)));
    let behind = 0..count.saturating_sub(2);
    match mode {
        Mode::TriangleStrip => behind.map(|i| corners([i, i + 1 + i % 2, i + 2 - i % 2])).collect(),
        Mode::TriangleFan => behind.map(|i| corners([i + 1, i + 2, 0])).collect(),
        _ => (0..count / 3).map(|i| corners([3 * i, 3 * i + 1, 3 * i + 2])).collect(),
    }
}

impl Primitives<'_, '_> {
    /// Returns `None` if there is no triangle in it. `place` is its place in the JSON.
    pub fn load(
        &mut self,
        warnings: &mut Warnings,
        primitive: &Primitive,
        place: &str,
        look: Look,
        pose: &Pose,
    ) -> Result<Option<Mesh>> {
        let Checked::Valid(mode) = primitive.mode else { return Err(self.buffers.document.fault(place, "its mode is unknown")) };
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            self.tally.lines += 1;
            return Ok(None);
        }
        let unpacked = Unpacked::of(self.buffers, primitive, place)?;
        let source = PrimitiveReading { buffers: self.buffers, primitive, unpacked: unpacked.as_ref(), place };
        let Some(positions) = source.values(Semantic::Positions, &[3])? else {
            source.mend(warnings, "positions", &|| format!("{place} has no POSITION"), "it is left out")?;
            return Ok(None);
        };
        let count = positions.count;
        let normals = source.spare(warnings, Semantic::Normals, &[3], count)?;
        let mut posed = Posed::new(positions, normals, pose);
        if pose.is_skinned() {
            for set in 0.. {
                let joints = source.spare(warnings, Semantic::Joints(set), &[4], count)?;
                let Some((joints, weights)) = joints.zip(source.spare(warnings, Semantic::Weights(set), &[4], count)?) else {
                    break;
                };
                posed.influences.push((joints, weights));
            }
        }
        for (target, &weight) in primitive.targets.iter().flatten().zip(&pose.weights) {
            let deltas =
                |accessor: Option<gltf::json::Index<_>>| accessor.map(|at| self.buffers.values(at.value(), &[3])).transpose();
            posed.morph(weight, deltas(target.positions)?, deltas(target.normals)?);
        }
        // The work of bending a vertex.
        self.buffers.take(count.saturating_mul(posed.parts()) / 8)?;
        let triangles = source.triangles(warnings, mode, count)?;
        let (triangles, used, positions) = self.sound(warnings, &source, triangles, &posed)?;
        if triangles.is_empty() {
            return Ok(None);
        }
        let coordinates =
            look.coordinates.map(|(set, _)| source.spare(warnings, Semantic::TexCoords(set), &[2], count)).transpose()?;
        let lightmap = source.spare(warnings, Semantic::TexCoords(1), &[2], count)?;
        let colors = source.spare(warnings, Semantic::Colors(0), &[3, 4], count)?.filter(|_| !source.shows_light());
        let vertices = || used.list.iter().map(|&vertex| vertex as usize);
        let uv = |values: &AccessorValues, vertex, transform: Affine2| {
            finite(transform.transform_point2(Vec2::from(values.get(vertex))))
        };
        Ok(Some(Mesh {
            positions,
            normals: vertices().map(|vertex| posed.normal(vertex)).collect(),
            uvs: match (look.coordinates, coordinates.flatten()) {
                (Some((_, transform)), Some(values)) => vertices().map(|vertex| uv(&values, vertex, transform)).collect(),
                _ => vec![Vec2::ZERO; used.list.len()],
            },
            lightmap_uvs: lightmap.map_or_else(Vec::new, |values| vertices().map(|vertex| uv(&values, vertex, V_UP)).collect()),
            colors: colors.map_or_else(Vec::new, |values| vertices().map(|vertex| color(&values, vertex)).collect()),
            sources: used.list.iter().map(|&index| Source { instance: 0, index }).collect(),
            source_count: count as u32,
            triangles: triangles
                .iter()
                .map(|triangle| Triangle { vertices: triangle.map(|vertex| used.index(vertex)), material: look.material })
                .collect(),
        }))
    }

    /// The triangles that can be drawn, the vertices that they use, and the positions of these.
    fn sound(
        &mut self,
        warnings: &mut Warnings,
        source: &PrimitiveReading,
        mut triangles: Vec<[u32; 3]>,
        posed: &Posed,
    ) -> Result<(Vec<[u32; 3]>, UsedVertices, Vec<Vec3>)> {
        let (all, count) = (triangles.len(), posed.count());
        triangles.retain(|triangle| triangle.iter().all(|&vertex| (vertex as usize) < count));
        let outside = all - triangles.len();
        self.buffers.take(count / 64)?;
        let used = UsedVertices::of(&triangles, count);
        self.buffers.take(used.list.len())?;
        let positions: Vec<Vec3> = used.list.iter().map(|&vertex| posed.position(vertex as usize).as_vec3()).collect();
        let (mut infinite, mut flat) = (0, 0);
        triangles.retain(|triangle| {
            let corners = triangle.map(|vertex| positions[used.index(vertex) as usize]);
            let near = corners.iter().all(|corner| f64::from(corner.abs().max_element()) <= FARTHEST && corner.is_finite());
            let sound = near && has_area(corners);
            infinite += usize::from(!near);
            flat += usize::from(near && !sound);
            sound
        });
        self.tally.triangles += all;
        self.tally.flat += flat;
        let place = source.place;
        if outside > 0 {
            let problem = || format!("{outside} of {all} triangles of {place} refer to vertices that it does not have");
            source.mend(warnings, "vertices", &problem, "they are left out")?;
        }
        if infinite > 0 {
            let problem =
                || format!("{infinite} of {all} triangles of {place} have corners that are not finite or beyond {FARTHEST:e}");
            source.mend(warnings, "coordinates", &problem, "they are left out")?;
        }
        if infinite + flat == 0 {
            return Ok((triangles, used, positions));
        }
        let fewer = UsedVertices::of(&triangles, count);
        let positions = fewer.list.iter().map(|&vertex| positions[used.index(vertex) as usize]).collect();
        Ok((triangles, fewer, positions))
    }
}

/// From v down to v up.
pub const V_UP: Affine2 = Affine2::from_cols(vec2(1.0, 0.0), vec2(0.0, -1.0), vec2(0.0, 1.0));

fn finite(uv: Vec2) -> Vec2 {
    if uv.is_finite() { uv } else { Vec2::ZERO }
}

fn color(values: &AccessorValues, vertex: usize) -> Vec3 {
    let color = Vec3::from(values.get(vertex));
    if color.is_finite() { color.clamp(Vec3::ZERO, Vec3::ONE) } else { Vec3::ONE }
}

/// The vertices that triangles use, in the order of the file.
struct UsedVertices {
    list: Vec<u32>,
    /// One bit for each vertex of the file, 64 in a word, and the number of used ones before the word.
    words: Vec<(u64, u32)>,
}

impl UsedVertices {
    fn of(triangles: &[[u32; 3]], count: usize) -> Self {
        let mut words = vec![(0_u64, 0_u32); count.div_ceil(64)];
        for &vertex in triangles.as_flattened() {
            words[vertex as usize / 64].0 |= 1 << (vertex % 64);
        }
        let mut list = Vec::new();
        for (first, (bits, before)) in (0..).step_by(64).zip(&mut words) {
            *before = list.len() as u32;
            list.extend((0..64).filter(|bit| *bits >> bit & 1 == 1).map(|bit| first + bit));
        }
        Self { list, words }
    }

    /// The place of a used vertex in the list.
    fn index(&self, vertex: u32) -> u32 {
        let (bits, before) = self.words[vertex as usize / 64];
        before + (bits & ((1 << (vertex % 64)) - 1)).count_ones()
    }
}
