//! Texture coordinates for light maps: the mesh's own, or an atlas.

use glam::Vec2;

use super::edges::{self, Joint};
use super::{LightMapOptions, Resolution};
use crate::error::{Error, Result};
use crate::scene::Mesh;

/// Coordinates may leave [0, 1] by this much, through rounding.
const RANGE_TOLERANCE: f32 = 1e-5;

/// A triangle has no area if twice its area is less than this fraction of the map: less than a thousandth of a texel in the largest map.
const NO_AREA: f32 = 1e-12;

/// A mesh and its edges.
pub struct UnwrapInput<'a> {
    pub mesh: &'a Mesh,
    /// A number for each vertex, the same for the same position.
    pub welded: &'a [u32],
    /// The edges that charts may cross.
    pub joints: &'a [Joint],
    /// For each triangle, which edges charts may not cross.
    pub cuts: &'a [[bool; 3]],
}

/// A layout of a mesh in the plane.
pub struct UvLayout {
    /// Coordinates of each triangle's corners, in [0, 1], v up.
    pub uvs: Vec<[Vec2; 3]>,
    /// Width and height of the map in texels.
    pub size: [u32; 2],
}

/// The coordinates that a mesh brings for its light map: those for light maps, or else for textures. Empty if it has neither.
pub fn own_uvs(mesh: &Mesh) -> &[Vec2] {
    match (&mesh.lightmap_uvs[..], &mesh.uvs[..]) {
        ([], uvs) if uvs.iter().all(|&uv| uv == Vec2::ZERO) => &[],
        ([], uvs) => uvs,
        (own, _) => own,
    }
}

/// The layout by the mesh's own coordinates.
pub fn own(&UnwrapInput { mesh, joints, .. }: &UnwrapInput, options: &LightMapOptions) -> Result<UvLayout> {
    let own = own_uvs(mesh);
    if own.is_empty() {
        return Err(unusable("the mesh has no texture coordinates"));
    }
    let uvs: Vec<_> = mesh.triangles.iter().map(|triangle| triangle.vertices.map(|vertex| own[vertex as usize])).collect();
    let outside = |uv: &Vec2| (uv - 0.5).abs().max_element() > 0.5 + RANGE_TOLERANCE;
    let strays: Vec<usize> = (0..uvs.len()).filter(|&triangle| uvs[triangle].iter().any(outside)).collect();
    if let [first, ..] = strays[..] {
        let (count, all) = (strays.len(), uvs.len());
        return Err(unusable(&format!("texture coordinates of {count} of {all} triangles leave 0 to 1, first triangle {first}")));
    }
    let (charts, _) = edges::charts(&uvs, joints);
    // The first triangle of each chart in which no triangle has an area.
    let mut flat: Vec<Option<usize>> = Vec::new();
    for (triangle, &chart) in charts.iter().enumerate() {
        flat.resize(flat.len().max(chart as usize + 1), Some(triangle));
        if has_area(uvs[triangle]) {
            flat[chart as usize] = None;
        }
    }
    if let Some(first) = flat.iter().flatten().next() {
        let (count, all) = (flat.iter().flatten().count(), flat.len());
        return Err(unusable(&format!("{count} of {all} charts have no area in the texture, first triangle {first}")));
    }
    let side = match options.resolution {
        Resolution::Pixels(side) => side,
        Resolution::TexelsPerUnit(density) => {
            let surface: f32 = (0..mesh.triangles.len()).map(|triangle| mesh.area(triangle)).sum();
            let map: f32 = uvs.iter().map(|&corners| 0.5 * double_area(corners)).sum();
            (density * (surface / map.max(NO_AREA)).sqrt()).ceil() as u32
        }
    };
    Ok(UvLayout { uvs, size: [side; 2] })
}

/// An atlas by the crate `uvunwrap`. Charts turn by at most 70°. They are flattened conformally, then as rigidly as possible, and packed by
/// their shapes. The crate's direct solver is off, because its bits depend on the processor.
pub fn atlas(&UnwrapInput { mesh, welded, cuts, .. }: &UnwrapInput, options: &LightMapOptions) -> Result<UvLayout> {
    // Welded, so that only cuts bound charts, and not the splits of the mesh's vertices.
    let mut positions = Vec::new();
    for (position, &number) in mesh.positions.iter().zip(welded) {
        if number as usize == positions.len() {
            positions.push(position.to_array());
        }
    }
    let indices: Vec<u32> =
        mesh.triangles.iter().flat_map(|triangle| triangle.vertices).map(|vertex| welded[vertex as usize]).collect();
    let density = match options.resolution {
        Resolution::Pixels(page_size) => uvunwrap::Density::Auto { page_size },
        Resolution::TexelsPerUnit(texels_per_unit) => uvunwrap::Density::Fixed { texels_per_unit, page_size: None },
    };
    let input = uvunwrap::MeshInput { seams: Some(cuts), ..uvunwrap::MeshInput::new(&positions, &indices) };
    let settings = uvunwrap::Options { density, padding: options.padding, ..Default::default() };
    let cure = "ask for a larger map, fewer texels per unit or less padding";
    if let Resolution::Pixels(side) = options.resolution
        && side <= 2 * options.padding
    {
        let problem = format!("a light map of {side} texels a side has no room for charts with a padding of {}", options.padding);
        return Err(Error::usage(problem, cure));
    }
    let atlas = uvunwrap::generate(&[input], &settings).map_err(|error| Error::usage(format!("no atlas: {error}"), cure))?;
    if atlas.page_count > 1 {
        let charts = atlas.chart_count;
        return Err(Error::usage(format!("{charts} charts with their padding do not fit into one map of this size"), cure));
    }
    // The atlas ends with its last chart. A map of so many texels is square all the same, as engines want it.
    let size = match options.resolution {
        Resolution::Pixels(side) => [side; 2],
        Resolution::TexelsPerUnit(_) => [atlas.width, atlas.height],
    };
    let share = Vec2::new(atlas.width as f32, atlas.height as f32) / Vec2::from(size.map(|side| side as f32));
    let output = &atlas.meshes[0];
    let uv = |corner: u32| share * Vec2::from(output.vertices[corner as usize].uv);
    let uvs = output.indices.chunks_exact(3).map(|corners| [0, 1, 2].map(|k| uv(corners[k])));
    Ok(UvLayout { uvs: uvs.collect(), size })
}

/// The error that the mesh's own coordinates are not usable.
pub fn unusable(problem: &str) -> Error {
    Error::usage(problem, "give the mesh texture coordinates that cover it once within 0 to 1, or take an atlas")
}

/// Twice the area of a triangle in the map.
pub fn double_area([a, b, c]: [Vec2; 3]) -> f32 {
    (b - a).perp_dot(c - a).abs()
}

/// Whether a triangle of the map has area, and so samples.
pub fn has_area(corners: [Vec2; 3]) -> bool {
    double_area(corners) > NO_AREA
}
