//! Unit space: the scene moved and scaled so that its bounding box is centred on the origin and its corners lie on the unit sphere.
//!
//! All stages work there. A box one millimetre wide and one ten kilometres wide are then the same numbers, and one set of
//! tolerances, derived from float precision at 1, serves every scene. Radiance and irradiance do not change with scale.

use std::collections::HashSet;

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::{Camera, Lens, Material, Mesh, Scene, Triangle, has_area};

/// The way back from unit space.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct UnitSpace {
    /// World position of the origin.
    center: DVec3,
    /// World length of one unit.
    scale: f64,
}

impl UnitSpace {
    /// `scene` in unit space, and the way back.
    pub fn enter(scene: &Scene) -> (Scene, Self) {
        let bounds = scene.mesh.bounds();
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let space = Self { center: 0.5 * (min + max), scale: 0.5 * (max - min).length() };
        let mut scene = scene.clone();
        for position in &mut scene.mesh.positions {
            *position = space.enter_point(*position);
        }
        // What is too small beside the whole to keep an area in 32 bits would give normals that are not numbers.
        let Mesh { positions, triangles, .. } = &mut scene.mesh;
        triangles.retain(|triangle| has_area(triangle.vertices.map(|vertex| positions[vertex as usize])));
        drop_doubles(&mut scene.mesh, &scene.materials);
        scene.camera = space.enter_camera(scene.camera);
        (scene, space)
    }

    /// A camera in world space as unit space has it.
    pub fn enter_camera(self, camera: Camera) -> Camera {
        // The direction is kept, and not the target, which may fall together with the eye.
        let forward = (camera.target.as_dvec3() - camera.eye.as_dvec3()).normalize().as_vec3();
        let eye = self.enter_point(camera.eye);
        let length = |length: f32| (f64::from(length) / self.scale) as f32;
        let lens = camera
            .lens
            .map(|Lens { radius, focus_distance }| Lens { radius: length(radius), focus_distance: length(focus_distance) });
        Camera { eye, target: eye + forward, lens, ..camera }
    }

    /// Position in unit space of a point of the world.
    pub fn enter_point(self, position: Vec3) -> Vec3 {
        ((position.as_dvec3() - self.center) / self.scale).as_vec3()
    }

    /// World position of a point in unit space.
    pub fn to_world(self, position: Vec3) -> Vec3 {
        (position.as_dvec3() * self.scale + self.center).as_vec3()
    }

    /// Length in unit space of a world length.
    pub fn length_to_unit(self, length: f32) -> f32 {
        (f64::from(length) / self.scale) as f32
    }

    /// World length of a length in unit space.
    pub fn length_to_world(self, length: f32) -> f32 {
        (f64::from(length) * self.scale) as f32
    }
}

/// Drops triangles that lie exactly on another, however wound, as exports with two-sided faces have them: surfaces are two-sided anyway, and
/// light would be shared between the doubles. Emissive ones all stay, for back to back they are a lamp that shines both ways.
fn drop_doubles(mesh: &mut Mesh, materials: &[Material]) {
    let Mesh { positions, triangles, .. } = mesh;
    let emissive = |triangle: &Triangle| materials[triangle.material as usize].is_emissive();
    let place = |triangle: &Triangle| {
        let mut corners = triangle.vertices.map(|vertex| positions[vertex as usize].to_array().map(f32::to_bits));
        corners.sort_unstable();
        corners
    };
    let mut taken: HashSet<_> = triangles.iter().filter(|&triangle| emissive(triangle)).map(place).collect();
    triangles.retain(|triangle| emissive(triangle) || taken.insert(place(triangle)));
}
