//! Normal maps turn shading normals.

use glam::Vec3;

use super::{Mesh, Scene};

impl Scene {
    /// The unit shading `normal` of a point of a triangle, turned by the normal map of its material, if it has one. `side` is the face normal on the same
    /// side. The map is of the front; the back has its negative.
    pub fn mapped_normal(&self, triangle: usize, barycentric: Vec3, normal: Vec3, side: Vec3) -> Vec3 {
        let Some(map) = self.material(triangle).normal_map else { return normal };
        let Some([along_u, along_v]) = self.mesh.tangents(triangle) else { return normal };
        let sign = if side.dot(self.mesh.geometric_normal(triangle)) < 0.0 { -1.0 } else { 1.0 };
        let up = sign * normal;
        let tangent = (along_u - up * up.dot(along_u)).normalize_or_zero();
        let bitangent = up.cross(tangent);
        let bitangent = if bitangent.dot(along_v) < 0.0 { -bitangent } else { bitangent };
        let texel = 2.0 * self.textures[map.texture].sample_data(self.mesh.uv(triangle, barycentric)).truncate() - 1.0;
        let turned = (map.scale * (texel.x * tangent + texel.y * bitangent) + texel.z.max(0.0) * up).normalize_or_zero();
        if turned == Vec3::ZERO { normal } else { sign * turned }
    }
}

impl Mesh {
    /// How the position changes with the texture coordinates u and v on a triangle. `None` if it is a point or a line of the texture.
    fn tangents(&self, triangle: usize) -> Option<[Vec3; 2]> {
        let [a, b, c] = self.corners(triangle);
        let [at, bt, ct] = self.triangles[triangle].vertices.map(|vertex| self.uvs[vertex as usize]);
        let ([first, second], [one, two]) = ([b - a, c - a], [bt - at, ct - at]);
        let area = one.perp_dot(two);
        let along = [(first * two.y - second * one.y) / area, (second * one.x - first * two.x) / area];
        along.iter().all(|along| along.is_finite() && *along != Vec3::ZERO).then_some(along)
    }
}
