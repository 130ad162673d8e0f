//! The Cornell box in unit space: its photon grids, points on its surfaces, and exact gathers.

use std::ops::Range;

use finalgather::bench::irradiance;
use finalgather::geometry::Geometry;
use finalgather::math::dominant_axis;
use finalgather::photon::PhotonTracer;
use finalgather::points::CameraPoints;
use finalgather::random::sobol;
use finalgather::reference::Reference;
use finalgather::scene::{Bvh, Lights, RAY_OFFSET, Scene};
use finalgather::{Directions, World};
use glam::{DVec3, DVec4, Vec2, Vec3};
use rayon::prelude::*;

use crate::figure::Result;
use crate::lab::library::{GatherPoint, Sequence, Settings, gpu, in_repository};
use crate::lab::procedural::points_on;

pub use finalgather::photon::PhotonGrid;

/// The scene in unit space.
pub fn cornell() -> Result<Scene> {
    Ok(World::load(&in_repository("scenes/cornell.toml"))?.world.flatten())
}

pub struct Cornell {
    pub scene: Scene,
    bvh: Bvh,
    lights: Lights,
}

impl Cornell {
    pub fn load() -> Result<Self> {
        let scene = cornell()?;
        Ok(Self { bvh: Bvh::new(&scene.mesh), lights: Lights::new(&scene), scene })
    }

    /// The photon grid that a render of these settings uses, of the photons with these numbers.
    pub fn photon_grid(&self, settings: &Settings, photons: Range<u64>) -> PhotonGrid {
        self.probed(self.traced(settings, photons), settings.seed)
    }

    pub fn empty_grid(&self, cells: u32) -> PhotonGrid {
        PhotonGrid::new(&self.scene.mesh, cells)
    }

    /// The flux of [`Self::photon_grid`] alone.
    pub fn traced(&self, settings: &Settings, photons: Range<u64>) -> PhotonGrid {
        let mut grid = self.empty_grid(settings.photons.grid_cells);
        PhotonTracer::new(&self.scene, &self.bvh, &self.lights, settings.seed, settings.photons.depth).trace(photons, &mut grid);
        grid
    }

    /// A grid with the area that light reaches, by the probes of this seed.
    pub fn probed(&self, mut grid: PhotonGrid, seed: u64) -> PhotonGrid {
        grid.add_area(&self.scene, &self.bvh, seed);
        grid
    }

    /// What the camera sees in the middles of `side` × `side` pixels.
    pub fn camera_points(&self, side: u32) -> Result<Vec<GatherPoint>> {
        let gpu = gpu()?;
        let geometry = Geometry::upload(&gpu, &self.scene)?;
        let camera = CameraPoints::new(&gpu, [side; 2])?;
        Ok(camera.see(&geometry, &self.scene.camera([side; 2]), Vec2::splat(0.5), 0).gather_points())
    }

    /// Triangles that are no lamps.
    fn reflecting(&self) -> impl Iterator<Item = usize> {
        (0..self.scene.mesh.triangles.len()).filter(|&triangle| !self.scene.material(triangle).is_emissive())
    }

    /// Points spread evenly over the fronts of all triangles but the lamp's.
    pub fn surface_points(&self, count: u32) -> Vec<GatherPoint> {
        points_on(&self.scene, count, false, &self.reflecting().collect::<Vec<_>>())
    }

    /// Irradiance at points by exact rays along these directions, which look at the grid.
    pub fn gather(&self, grid: &PhotonGrid, points: &[GatherPoint], directions: &[Vec3]) -> Vec<DVec3> {
        Reference::new(&self.scene, &self.bvh, grid).gather(points, directions).into_iter().map(irradiance).collect()
    }

    /// Σ L w and Σ w at each point over the first directions of a sequence, once for each of the growing `counts`.
    pub fn sums(
        &self,
        grid: &PhotonGrid,
        points: &[GatherPoint],
        (sequence, seed): (Sequence, u64),
        counts: &[u32],
    ) -> Vec<Vec<DVec4>> {
        /// The oracle adds up in 32 bits. Longer sums are put together here.
        const CHUNK: usize = 1 << 12;
        let oracle = Reference::new(&self.scene, &self.bvh, grid);
        let mut sums = vec![DVec4::ZERO; points.len()];
        let mut done = 0;
        let mut up_to = |&count: &u32| {
            for chunk in directions(sequence, seed, done..count).chunks(CHUNK) {
                for (sum, more) in sums.iter_mut().zip(oracle.gather(points, chunk)) {
                    *sum += more.as_dvec4();
                }
            }
            done = count;
            sums.clone()
        };
        counts.iter().map(&mut up_to).collect()
    }

    /// Irradiance at points from the lamp, by shadow rays to `samples` points of it.
    pub fn direct(&self, points: &[GatherPoint], samples: u32) -> Vec<DVec3> {
        let sample = |point: &GatherPoint, sample: [f32; 2]| {
            let origin = point.position + RAY_OFFSET * point.normal;
            let (direction, distance, facing) = self.lights.sample(sample).seen_from(origin);
            let received = point.cosine(direction) * facing;
            let reaches = || self.bvh.nearest(origin, direction, None).is_none_or(|hit| hit.distance >= distance);
            if received != Vec3::ZERO && reaches() { received.as_dvec3() } else { DVec3::ZERO }
        };
        let at = |(index, point): (usize, &GatherPoint)| {
            (0..samples).map(|i| sample(point, sobol(i, index as u64))).sum::<DVec3>() / f64::from(samples)
        };
        points.par_iter().enumerate().map(at).collect()
    }

    /// Distance of each point from the nearest edge, where reflecting surfaces meet or end: an edge of a triangle that is not between two
    /// triangles in one plane.
    pub fn to_edges(&self, points: &[GatherPoint]) -> Vec<f32> {
        let mesh = &self.scene.mesh;
        let of_triangle = |triangle| {
            let [a, b, c] = mesh.corners(triangle);
            [[a, b], [b, c], [c, a]].map(|edge| (edge, mesh.geometric_normal(triangle)))
        };
        let all: Vec<_> = self.reflecting().flat_map(of_triangle).collect();
        // The neighbour in the plane has the same winding, and so has the edge the other way round.
        let goes_on = |[a, b]: [Vec3; 2], normal: Vec3| all.iter().any(|&(other, n)| other == [b, a] && n.dot(normal) > 0.9999);
        let edges: Vec<_> = all.iter().filter(|(edge, normal)| !goes_on(*edge, *normal)).map(|(edge, _)| *edge).collect();
        let distance = |position: Vec3, [a, b]: [Vec3; 2]| {
            let share = ((position - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
            position.distance(a.lerp(b, share))
        };
        let nearest =
            |point: &GatherPoint| edges.iter().map(|&edge| distance(point.position, edge)).fold(f32::INFINITY, f32::min);
        points.par_iter().map(nearest).collect()
    }
}

/// Those with these numbers.
pub fn directions(sequence: Sequence, seed: u64, numbers: Range<u32>) -> Vec<Vec3> {
    let directions = Directions::new(sequence, seed);
    numbers.map(|number| directions.get(number).vector).collect()
}

/// Irradiance that the grid has at points.
pub fn look_up(grid: &PhotonGrid, points: &[GatherPoint]) -> Vec<DVec3> {
    let at = |point: &GatherPoint| {
        let axis = dominant_axis(point.normal);
        grid.irradiance(point.position, axis, point.normal[axis] > 0.0).as_dvec3()
    };
    points.iter().map(at).collect()
}
