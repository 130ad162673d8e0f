//! Light from radiance transfer and an environment, at points and as a picture of the model.
//!
//! With the coefficients T of the transfer at a point and c of the environment, the irradiance is E = π Σ T c: the product of their series.

use std::f32::consts::{FRAC_1_PI, PI};

use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;

use crate::harmonics::project;
use crate::image::{Channel, Image};
use crate::points::Vertices;
use crate::scene::{Bvh, Chance, Environment, Mesh, Rays, Scene, World, WorldCamera};

/// Rings of sample directions for the projection of the environment.
const RINGS: usize = 512;
/// Rays along each side of a pixel.
const SUBPIXELS: usize = 4;

/// Irradiance of each point in W/m², from the columns `PRT.00.R`, `PRT.00.G` and so on.
pub fn irradiance(transfer: &[Channel], environment: &Environment) -> Vec<Vec3> {
    let coefficients = project(RINGS, |direction| environment.radiance(direction));
    let point = |i: usize| {
        let term = |(k, column): (usize, &Channel)| column.samples[i] * coefficients[k / 3][k % 3];
        let color = |c: usize| transfer.iter().enumerate().skip(c).step_by(3).map(term).sum::<f32>();
        // A truncated series can give negative values. They become 0.
        (PI * Vec3::new(color(0), color(1), color(2))).max(Vec3::ZERO)
    };
    let points = transfer.first().map_or(0, |column| column.samples.len());
    (0..points).into_par_iter().map(point).collect()
}

/// A model with the vertices of a bake, to be seen under light at them.
pub struct RelitModel {
    /// In unit space. Its triangles are those of the tree.
    pub mesh: Mesh,
    /// Of the vertices, in world space.
    pub positions: Vec<DVec3>,
    /// Without glass, in unit space.
    pub scene: Scene,
    bvh: Bvh,
}

impl RelitModel {
    pub fn new(world: &World) -> Self {
        let scene = world.flatten();
        // Bakes leave glass out too.
        let scene = scene.without_glass().unwrap_or(scene);
        // The number of vertices does not depend on the inset.
        let mesh = Vertices::new(&scene.mesh, 0.0).mesh().clone();
        let positions = mesh.positions.iter().map(|&position| scene.space.to_world(position)).collect();
        Self { bvh: Bvh::new(&scene.mesh), mesh, positions, scene }
    }

    /// The view of a camera. Front sides show albedo × irradiance / π, interpolated between vertices. Misses show the environment.
    ///
    /// # Panics
    /// Unless there is one irradiance a vertex.
    pub fn picture(&self, irradiance: &[Vec3], environment: &Environment, camera: WorldCamera, size: [u32; 2]) -> Image {
        assert_eq!(irradiance.len(), self.mesh.positions.len(), "one irradiance a vertex");
        let [width, height] = size.map(|side| side as usize);
        let camera = self.scene.space.enter_camera(camera);
        let rays = Rays::new(&self.scene, &self.bvh);
        let radiance = |direction: Vec3, chance: Chance| {
            let Some(hit) = rays.nearest(camera.eye, direction, None, chance) else { return environment.radiance(direction) };
            if !self.scene.mesh.meets_front(hit.triangle, direction) {
                return Vec3::ZERO;
            }
            let weights = self.scene.mesh.barycentric(hit.triangle, camera.eye + hit.distance * direction);
            let vertices = self.mesh.triangles[hit.triangle].vertices;
            let light: Vec3 = (0..3).map(|k| weights[k] * irradiance[vertices[k] as usize]).sum();
            self.scene.albedo(hit.triangle, weights) * light * FRAC_1_PI
        };
        let pixel = |i: usize| {
            let at = |step: usize| (step as f32 + 0.5) / SUBPIXELS as f32;
            let places = (0..SUBPIXELS * SUBPIXELS).map(|k| (k, Vec2::new(at(k % SUBPIXELS), at(k / SUBPIXELS))));
            let corner = Vec2::new((i % width) as f32, (i / width) as f32);
            let size = Vec2::new(width as f32, height as f32);
            let seen = places.map(|(k, place)| {
                let ray = camera.ray((corner + place) / size, size.x / size.y);
                radiance(ray, Chance::of_pixel(i as u32, k as u32, 0))
            });
            seen.sum::<Vec3>() / (SUBPIXELS * SUBPIXELS) as f32
        };
        let pixels: Vec<Vec3> = (0..width * height).into_par_iter().map(pixel).collect();
        let channel =
            |(c, name): (usize, &str)| Channel { name: name.into(), samples: pixels.iter().map(|pixel| pixel[c]).collect() };
        Image { width, height, channels: ["R", "G", "B"].into_iter().enumerate().map(channel).collect() }
    }
}
