//! The emissive triangles of a scene, as one light.

use std::collections::HashMap;
use std::f32::consts;
use std::f64::consts::PI;

use glam::{Vec2, Vec3};

use super::super::{ImageTexture, Path, RAY_OFFSET, Scene};
use super::LIGHT_OFFSET;
use super::pieces::{Piece, pieces};
use super::tree::Branch;
use crate::math::{Aabb, cosine_direction};
use crate::random::Distribution;

/// All emissive triangles of a scene.
pub struct AreaLight {
    /// The sides that emit: a two-sided triangle has two. A triangle with a picture of emission has a side for each of its pieces.
    pub sides: Vec<Emitter>,
    /// Pictures of emission.
    glows: Vec<ImageTexture>,
    /// Chooses a side by power.
    by_power: Distribution,
    /// Flux of all triangles, sum of the channels. A surface of radiance L emits πL per unit of area.
    pub power: f64,
}

/// A side of a triangle, or of a piece of it.
pub struct Emitter {
    /// Index into [`super::super::Mesh::triangles`].
    triangle: usize,
    corners: [Vec3; 3],
    normal: Vec3,
    /// See [`LightPoint::radiance_area`]; a picture multiplies it.
    radiance_area: Vec3,
    /// Radiance times area; a picture multiplies it.
    pub flux: Vec3,
    /// About in proportion to the flux with its picture. Shares of all of them are too small for f32 beside great lamps.
    power: f64,
    /// Index of the picture of emission, and the coordinates of the corners on it.
    glow: Option<(usize, [Vec2; 3])>,
}

/// A point on a light.
#[derive(Clone, Copy, Debug)]
pub struct LightPoint {
    /// Index into [`super::super::Mesh::triangles`].
    pub triangle: usize,
    pub position: Vec3,
    /// Unit normal on the emitting side.
    pub normal: Vec3,
    /// Emitted radiance over point density per area. The mean of f(point) × `radiance_area` is the integral of f × radiance over the lights.
    pub radiance_area: Vec3,
}

/// A side of a triangle or of a piece of it, as shaders sample it.
pub struct Lamp {
    /// Index into [`super::super::Mesh::triangles`].
    pub triangle: usize,
    /// Where shadow rays end.
    pub corners: [Vec3; 3],
    /// Unit normal on the emitting side.
    pub normal: Vec3,
    /// Radiance times area; a picture multiplies it.
    pub flux: Vec3,
    pub is_pictured: bool,
}

/// A triangle, or a piece of it that emits nearly evenly.
struct EvenPart {
    triangle: usize,
    corners: [Vec3; 3],
    glow: Option<(usize, [Vec2; 3])>,
    area: f32,
    /// About in proportion to the flux of a side.
    weight: f64,
}

impl AreaLight {
    pub fn new(scene: &Scene) -> Self {
        let mut glows = Vec::new();
        let parts = parts(scene, &mut glows);
        let sides = |part: &EvenPart| [1.0, -1.0].into_iter().take(1 + usize::from(scene.material(part.triangle).two_sided));
        let emissive = || parts.iter().flat_map(|part| sides(part).map(move |side| (part, side)));
        let total: f64 = emissive().map(|(part, _)| part.weight).sum();
        let emitter = |(part, side): (&EvenPart, f32)| {
            let probability = (part.weight / total) as f32;
            Emitter {
                triangle: part.triangle,
                corners: part.corners,
                normal: side * scene.mesh.geometric_normal(part.triangle),
                radiance_area: scene.material(part.triangle).emission * (part.area / probability),
                flux: scene.material(part.triangle).emission * part.area,
                power: part.weight,
                glow: part.glow,
            }
        };
        let by_power = Distribution::new(emissive().map(|(part, _)| part.weight).collect());
        Self { sides: emissive().map(emitter).collect(), glows, by_power, power: PI * total }
    }

    /// A point by a uniform number, which selects the triangle, and a uniform point of the unit square. The density is nearly proportional to emitted
    /// power.
    fn point(&self, pick: f32, [u, v]: [f32; 2]) -> LightPoint {
        let (slot, ..) = self.by_power.pick(pick);
        self.point_on(slot, self.sides[slot].radiance_area, [u, v])
    }

    /// A point of a side by a uniform point of the unit square.
    pub fn point_on(&self, side: usize, radiance_area: Vec3, [u, v]: [f32; 2]) -> LightPoint {
        let &Emitter { triangle, corners: [a, b, c], normal, glow, .. } = &self.sides[side];
        // Shrinks one side of the square to a corner. Neighbours in the square stay neighbours in the triangle, and no two parts of it overlap there: so
        // 512 even points have a twentieth of the error that they have in a square folded along its diagonal.
        let along = u.sqrt();
        let [to_b, to_c] = [1.0 - along, v * along];
        let radiance_area = glow.map_or(radiance_area, |(picture, [a, b, c])| {
            radiance_area * self.glows[picture].sample_linear(a + to_b * (b - a) + to_c * (c - a))
        });
        LightPoint { triangle, position: a + to_b * (b - a) + to_c * (c - a), normal, radiance_area }
    }

    /// As [`Self::point`]. `u` selects the triangle, its remainder the point: an even distribution in the square is even on the lights.
    pub fn point_of_square(&self, [u, v]: [f32; 2]) -> LightPoint {
        let (_, rest, _) = self.by_power.pick(u);
        self.point(u, [rest, v])
    }

    /// A photon from a point of the light, with a cosine distribution about the normal of the emitting side; see [`super::Lights::emit`].
    pub fn emit(&self, probability: f32, [pick, u, v, s, t]: [f32; 5]) -> (Path, Vec3) {
        let LightPoint { triangle, position, normal, radiance_area } = self.point(pick, [u, v]);
        let direction = cosine_direction(normal, s, t);
        let path = Path { origin: position + RAY_OFFSET * normal, direction, triangle: Some(triangle) };
        // A diffuse emitter of radiance L emits πL per unit of area.
        (path, radiance_area * (consts::PI / probability))
    }

    /// What a tree over the sides needs to know of each.
    pub fn branches(&self) -> Vec<Branch> {
        let branch = |side: &Emitter| Branch {
            bounds: Aabb::from_points(side.corners),
            axis: side.normal,
            spread: 0.0,
            power: side.power,
        };
        self.sides.iter().map(branch).collect()
    }

    /// The sides as shaders read them.
    pub fn lamps(&self) -> impl Iterator<Item = Lamp> {
        self.sides.iter().map(|side| Lamp {
            triangle: side.triangle,
            corners: side.corners.map(|corner| corner + LIGHT_OFFSET * side.normal),
            normal: side.normal,
            flux: side.flux,
            is_pictured: side.glow.is_some(),
        })
    }

    /// Number of sides of whole triangles.
    pub fn triangle_sides(&self) -> usize {
        let mut normals: Vec<_> =
            self.sides.iter().map(|side| (side.triangle, side.normal.to_array().map(f32::to_bits))).collect();
        normals.sort_unstable();
        normals.dedup();
        normals.len()
    }
}

/// The parts of all emissive triangles, in their order. `glows` gets their pictures.
fn parts(scene: &Scene, glows: &mut Vec<ImageTexture>) -> Vec<EvenPart> {
    let mesh = &scene.mesh;
    let power = |triangle: usize| f64::from(scene.material(triangle).emission.element_sum()) * f64::from(mesh.area(triangle));
    let emissive: Vec<usize> = (0..mesh.triangles.len()).filter(|&triangle| power(triangle) > 0.0).collect();
    let picture_of = |triangle: &usize| scene.material(*triangle).emission_texture;
    let with_pictures: Vec<usize> = emissive.iter().copied().filter(|triangle| picture_of(triangle).is_some()).collect();
    let mut pieces = pieces(scene, &with_pictures).into_iter().peekable();
    let mut copies: HashMap<usize, usize> = HashMap::new();
    let mut parts = Vec::with_capacity(emissive.len());
    for triangle in emissive {
        let (corners, area) = (mesh.corners(triangle), mesh.area(triangle));
        let Some(picture) = picture_of(&triangle) else {
            parts.push(EvenPart { triangle, corners, glow: None, area, weight: power(triangle) });
            continue;
        };
        let copy = *copies.entry(picture).or_insert_with(|| {
            glows.push(scene.textures[picture].clone());
            glows.len() - 1
        });
        while let Some(Piece { corners: within, radiance, share, .. }) = pieces.next_if(|piece| piece.triangle == triangle) {
            let [a, b, c] = corners;
            let area = share * area;
            parts.push(EvenPart {
                triangle,
                corners: within.map(|at| a * at.x + b * at.y + c * at.z),
                glow: Some((copy, within.map(|at| mesh.uv(triangle, at)))),
                area,
                weight: radiance * f64::from(area),
            });
        }
    }
    parts
}
