//! Triangle meshes.

use glam::{Vec2, Vec3};

use crate::math::Aabb;

/// Triangles with shared vertices.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    pub positions: Vec<Vec3>,
    /// Unit shading normals, one for each vertex. Zero means flat shading, by the normal of the face.
    pub normals: Vec<Vec3>,
    /// Coordinates on the albedo texture, one for each vertex, v up. Zero if the file has none. Loaders choose the set of the material, and apply its
    /// transform.
    pub uvs: Vec<Vec2>,
    /// Coordinates on a light map, one for each vertex, v up. Empty if there are none.
    pub lightmap_uvs: Vec<Vec2>,
    /// Linear colours that multiply the albedo, one for each vertex, in [0, 1]. Empty: white.
    pub colors: Vec<Vec3>,
    /// The place of each vertex in the file. Empty if the mesh is of no file.
    pub sources: Vec<Source>,
    /// Length of the file's own list of vertices, which may have some that no triangle uses.
    pub source_count: u32,
    pub triangles: Vec<Triangle>,
}

/// The place of a vertex in a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Source {
    /// Index into the instances of the world. 0 in the meshes of a world, which may be placed several times.
    pub instance: u32,
    /// Index into the file's own list of vertices: of an OBJ its `v` from 0, of a glTF primitive its accessors.
    pub index: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Triangle {
    /// Indices into [`Mesh::positions`], [`Mesh::normals`] and [`Mesh::uvs`], counter-clockwise seen from the front.
    pub vertices: [u32; 3],
    /// Index into the materials of the world or scene.
    pub material: u32,
}

impl Mesh {
    /// Adds a copy of a vertex of `other`, and returns its index. Meshes with and without colours, light-map coordinates or sources do not mix.
    pub fn push_vertex_of(&mut self, other: &Self, vertex: u32) -> u32 {
        let vertex = vertex as usize;
        self.positions.push(other.positions[vertex]);
        self.normals.push(other.normals[vertex]);
        self.uvs.push(other.uvs[vertex]);
        self.lightmap_uvs.extend(other.lightmap_uvs.get(vertex));
        self.colors.extend(other.colors.get(vertex));
        self.sources.extend(other.sources.get(vertex));
        self.positions.len() as u32 - 1
    }

    /// Adds a copy of a vertex, and returns its index.
    pub fn copy_vertex(&mut self, vertex: u32) -> u32 {
        fn again<T: Copy>(list: &mut Vec<T>, vertex: u32) {
            list.extend(list.get(vertex as usize).copied());
        }
        again(&mut self.positions, vertex);
        again(&mut self.normals, vertex);
        again(&mut self.uvs, vertex);
        again(&mut self.lightmap_uvs, vertex);
        again(&mut self.colors, vertex);
        again(&mut self.sources, vertex);
        self.positions.len() as u32 - 1
    }

    /// The colour at a point of a triangle, from its barycentric coordinates.
    pub fn color(&self, triangle: usize, barycentric: Vec3) -> Vec3 {
        if self.colors.is_empty() {
            return Vec3::ONE;
        }
        let [a, b, c] = self.triangles[triangle].vertices.map(|vertex| self.colors[vertex as usize]);
        a * barycentric.x + b * barycentric.y + c * barycentric.z
    }

    /// The texture coordinates at a point of a triangle, from its barycentric coordinates.
    pub fn uv(&self, triangle: usize, barycentric: Vec3) -> Vec2 {
        let [a, b, c] = self.triangles[triangle].vertices.map(|vertex| self.uvs[vertex as usize]);
        a * barycentric.x + b * barycentric.y + c * barycentric.z
    }

    /// [`Self::source_count`], or what the vertices say if that is less.
    pub fn length_of_source(&self) -> u32 {
        self.sources.iter().map(|source| source.index.saturating_add(1)).fold(self.source_count, u32::max)
    }

    pub fn bounds(&self) -> Aabb {
        Aabb::from_points(self.positions.iter().copied())
    }

    /// Positions of the three corners.
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.triangles[triangle].vertices.map(|vertex| self.positions[vertex as usize])
    }

    /// Unit normal on the front side of the face. It is computed in f64, because thin triangles need that.
    pub fn geometric_normal(&self, triangle: usize) -> Vec3 {
        let [a, b, c] = self.corners(triangle).map(|corner| corner.as_dvec3());
        (b - a).cross(c - a).normalize().as_vec3()
    }

    /// The same normal, or its opposite, on the side that a ray along `direction` hits.
    pub fn side_met(&self, triangle: usize, direction: Vec3) -> Vec3 {
        let normal = self.geometric_normal(triangle);
        if normal.dot(direction) < 0.0 { normal } else { -normal }
    }

    /// Whether a ray along `direction` meets the front side of the face.
    pub fn meets_front(&self, triangle: usize, direction: Vec3) -> bool {
        self.geometric_normal(triangle).dot(direction) < 0.0
    }

    /// The unit shading normal at a point of the triangle. `side` is the face normal on the side of interest; the result is on that side too.
    pub fn shading_normal(&self, triangle: usize, barycentric: Vec3, side: Vec3) -> Vec3 {
        let [a, b, c] = self.triangles[triangle].vertices.map(|vertex| self.normals[vertex as usize]);
        let normal = a * barycentric.x + b * barycentric.y + c * barycentric.z;
        // As in glsl/visible_points.frag.
        if normal.length_squared() < 1e-12 {
            return side;
        }
        let normal = normal.normalize();
        if normal.dot(side) < 0.0 { -normal } else { normal }
    }

    /// The angle of a triangle at one of its corners, in radians.
    pub fn angle(&self, triangle: usize, corner: usize) -> f32 {
        let corners = self.corners(triangle);
        let [here, next, last] = [0, 1, 2].map(|step| corners[(corner + step) % 3]);
        (next - here).angle_between(last - here)
    }

    pub fn area(&self, triangle: usize) -> f32 {
        let [a, b, c] = self.corners(triangle);
        0.5 * (b - a).cross(c - a).length()
    }

    /// Barycentric coordinates of a point of the triangle.
    pub fn barycentric(&self, triangle: usize, position: Vec3) -> Vec3 {
        let [a, b, c] = self.corners(triangle);
        let normal = (b - a).cross(c - a);
        let weight = |from: Vec3, to: Vec3| (to - from).cross(position - from).dot(normal) / normal.length_squared();
        let (u, v) = (weight(c, a), weight(a, b));
        Vec3::new(1.0 - u - v, u, v)
    }
}

/// Whether f32 can hold a normal: the edges' cross product must exceed the rounding of its terms, and its square must not underflow.
pub(super) fn has_area(corners: [Vec3; 3]) -> bool {
    let [a, b, c] = corners.map(|corner| corner.as_dvec3());
    let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
    (b - a).cross(c - a).length() > (longest * 1e-6).max(1e-18)
}
