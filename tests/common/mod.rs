//! Shared by several tests: scenes built in code, a gather on the GL side, and the difference between two gathers.
#![allow(dead_code, reason = "each test uses a part")]

pub mod blocks;
pub mod khronos;
pub mod need;
pub mod tool;

use std::env;
use std::f32::consts::{PI, TAU};
use std::path::Path;
use std::rc::Rc;
use std::sync::{Mutex, MutexGuard, PoisonError};

use finalgather::direct::{Direct, STRIDE, SampleShare, direct_light_on_cpu};
use finalgather::direction::{Direction, Directions};
use finalgather::error::Result;
use finalgather::gather::{GatherInputs, IrradianceGather};
use finalgather::geometry::Geometry;
use finalgather::gpu::{Backend, DeviceChoice, Gpu};
use finalgather::photon::{PhotonGrid, PhotonTexture, PhotonTracer};
use finalgather::points::packets::SubsetPackets;
use finalgather::points::{GatherPoint, Interleave, PointList};
use finalgather::random::Random;
use finalgather::reference::Reference;
use finalgather::scene::{
    Bvh, Camera, GlossMeans, ImageTexture, Instance, Lights, Material, Mesh, Rays, Sampler, Scene, SourceLists, Triangle,
    UnitSpace, World, WorldCamera, WrapMode,
};
use finalgather::settings::{GatherSettings, LayerSize, Pipeline, Sequence, Settings};
use glam::{DVec3, Vec2, Vec3, Vec4, vec2, vec3};

thread_local! {
    /// Each test runs on its own thread. Only the thread with this lock may have contexts, until it ends: see [`Gpu::headless`].
    static TURN: MutexGuard<'static, ()> = {
        static GPU: Mutex<()> = Mutex::new(());
        GPU.lock().unwrap_or_else(PoisonError::into_inner)
    };
}

/// A new context for the test.
pub fn gpu() -> Gpu {
    gpu_of(Backend::Auto).unwrap_or_else(|error| panic!("{error}"))
}

/// The same, from a library that may be missing.
pub fn gpu_of(backend: Backend) -> Result<Gpu> {
    // Softpipe's contexts do not disturb each other, and have one thread each.
    if env::var_os("GALLIUM_DRIVER").is_none_or(|driver| driver != "softpipe") {
        TURN.with(|_| ());
    }
    Gpu::headless(backend, DeviceChoice::Auto)
}

/// Returns `usual`, or `small` on Mesa's reference rasteriser, which is about twenty times slower.
pub fn sized<T>(gpu: &Gpu, usual: T, small: T) -> T {
    if gpu.info().renderer.contains("softpipe") { small } else { usual }
}

/// Whether shaders can write to images. On CI every device can, except softpipe. It represents devices that cannot.
pub fn writes_images(gpu: &Gpu) -> bool {
    let renderer = &gpu.info().renderer;
    if renderer.contains("softpipe") {
        assert!(!gpu.writes_images(), "{renderer} writes to images: which device stands for those that do not?");
        return false;
    }
    let found = if gpu.writes_images() { Ok(()) } else { Err(format!("{renderer} has no OpenGL 4.2")) };
    need::need("shaders that write to images", found).is_some()
}

/// A Cornell box of which every surface has a small texture with another sampler, coordinates far outside 0 to 1, and colours at its vertices.
pub fn colorful() -> Scene {
    let mut scene = cornell();
    let wraps = [WrapMode::Repeat, WrapMode::Mirror, WrapMode::Clamp];
    for (index, material) in scene.materials.iter_mut().enumerate() {
        let texels = (0..15u8).map(|i| [17 * i, 255 - 13 * i, 60 + 11 * (i % 4), 255]).collect();
        let sampler = Sampler { wrap: [wraps[index % 3], wraps[(index + 1) % 3]], nearest: index % 2 == 1 };
        scene.textures.push(ImageTexture { width: 5, height: 3, texels, sampler });
        material.albedo_texture = Some(index);
    }
    let mesh = &mut scene.mesh;
    let vertices = mesh.positions.len() as u32;
    mesh.uvs = (0..vertices).map(|i| vec2((i * 7 % 11) as f32 / 6.0 - 0.7, (i * 5 % 13) as f32 / 8.0 - 0.6)).collect();
    mesh.colors = (0..vertices).map(|i| vec3((i % 3) as f32 / 2.0, (i % 5) as f32 / 4.0, (i % 7) as f32 / 6.0)).collect();
    scene
}

/// A scene under construction, in its own coordinates. Fronts wind counter-clockwise. Points lie on fronts.
pub struct Model {
    pub scene: Scene,
}

impl Model {
    /// No surfaces; material 0 reflects all light.
    pub fn new() -> Self {
        let camera = Camera { eye: vec3(0.0, 0.0, 3.0), target: Vec3::ZERO, up: Vec3::Y, fov_y_degrees: 40.0, lens: None };
        let scene = Scene {
            mesh: Mesh::default(),
            materials: Vec::new(),
            textures: Vec::new(),
            environment: None,
            lights: Vec::new(),
            camera: Some(camera),
            space: UnitSpace::around([DVec3::NEG_ONE, DVec3::ONE]),
            instances: Vec::new(),
            gltf: None,
            source_lists: SourceLists::default(),
            file: String::new(),
            gloss_means: GlossMeans::default(),
        };
        let mut model = Self { scene };
        model.material(Vec3::ONE, Vec3::ZERO);
        model
    }

    pub fn material(&mut self, albedo: Vec3, emission: Vec3) -> u32 {
        let name = self.scene.materials.len().to_string();
        self.scene.materials.push(Material { name, albedo, emission, ..Material::default() });
        self.scene.materials.len() as u32 - 1
    }

    pub fn vertex(&mut self, position: Vec3) -> u32 {
        let mesh = &mut self.scene.mesh;
        mesh.positions.push(position);
        mesh.normals.push(Vec3::ZERO);
        mesh.uvs.push(Vec2::ZERO);
        mesh.positions.len() as u32 - 1
    }

    /// A planar or folded quadrilateral, counter-clockwise from the front. If two corners coincide, it is one triangle.
    pub fn quad(&mut self, corners: [Vec3; 4], material: u32) {
        let [a, b, c, d] = corners.map(|corner| self.vertex(corner));
        for (vertices, [p, q, r]) in
            [([a, b, c], [corners[0], corners[1], corners[2]]), ([a, c, d], [corners[0], corners[2], corners[3]])]
        {
            if p != q && q != r && r != p {
                self.scene.mesh.triangles.push(Triangle { vertices, material });
            }
        }
    }

    /// A parallelogram about `center`. Its front is on the side of `half_u` × `half_v`.
    pub fn plate(&mut self, center: Vec3, half_u: Vec3, half_v: Vec3, material: u32) {
        self.quad([-half_u - half_v, half_u - half_v, half_u + half_v, half_v - half_u].map(|corner| center + corner), material);
    }

    /// Six plates, turned about the vertical axis through the center. Fronts face inward (a room) or outward (a block).
    pub fn cuboid(&mut self, center: Vec3, half: Vec3, turn: f32, inward: bool, material: u32) {
        let (sin, cos) = turn.sin_cos();
        let axes = [half.x * vec3(cos, 0.0, -sin), half.y * Vec3::Y, half.z * vec3(sin, 0.0, cos)];
        for k in 0..3 {
            let (out, u, v) = (axes[k], axes[(k + 1) % 3], axes[(k + 2) % 3]);
            for side in [out, -out] {
                let front = if inward { -side } else { side };
                let (u, v) = if u.cross(v).dot(front) > 0.0 { (u, v) } else { (v, u) };
                self.plate(center + side, u, v, material);
            }
        }
    }

    /// A sphere of `2 rings` × `rings` faces. Fronts face inward (a room) or outward (a ball).
    pub fn sphere(&mut self, center: Vec3, radius: f32, rings: u32, inward: bool, material: u32) {
        let at = |ring: u32, segment: u32| {
            if ring == 0 || ring == rings {
                return center + radius * if ring == 0 { Vec3::Y } else { Vec3::NEG_Y };
            }
            let (theta, phi) = (PI * ring as f32 / rings as f32, TAU * (segment % (2 * rings)) as f32 / (2 * rings) as f32);
            center + radius * vec3(theta.sin() * phi.cos(), theta.cos(), -theta.sin() * phi.sin())
        };
        for ring in 0..rings {
            for segment in 0..2 * rings {
                let mut corners = [at(ring, segment), at(ring + 1, segment), at(ring + 1, segment + 1), at(ring, segment + 1)];
                if inward {
                    corners.reverse();
                }
                self.quad(corners, material);
            }
        }
    }

    /// A regular polygon with an even number of `sides` and the area of a disc. Its front is on the side of `normal`.
    pub fn disc(&mut self, center: Vec3, radius: f32, normal: Vec3, sides: u32, material: u32) {
        let step = TAU / sides as f32;
        let reach = radius * (step / step.sin()).sqrt();
        let (u, v) = normal.any_orthonormal_pair();
        let rim = |side: u32| {
            let (sin, cos) = (step * (side % sides) as f32).sin_cos();
            center + reach * (cos * u + sin * v)
        };
        for side in (0..sides).step_by(2) {
            self.quad([center, rim(side), rim(side + 1), rim(side + 2)], material);
        }
    }

    /// An upright cylinder with both ends.
    pub fn cylinder(&mut self, center: Vec3, radius: f32, half: f32, sides: u32, material: u32) {
        let rim = |side: u32, height: f32| {
            let (sin, cos) = (TAU * (side % sides) as f32 / sides as f32).sin_cos();
            center + vec3(radius * cos, height, -radius * sin)
        };
        let (top, bottom) = (center + half * Vec3::Y, center - half * Vec3::Y);
        for side in 0..sides {
            self.quad([rim(side, -half), rim(side + 1, -half), rim(side + 1, half), rim(side, half)], material);
            self.quad([top, rim(side, half), rim(side + 1, half), top], material);
            self.quad([bottom, rim(side + 1, -half), rim(side, -half), bottom], material);
        }
    }

    pub fn world(self) -> World {
        world_of(self.scene)
    }

    /// In unit space.
    pub fn finish(self) -> Scene {
        self.world().flatten()
    }
}

/// The camera with the same coordinates.
fn in_world(Camera { eye, target, up, fov_y_degrees, lens }: Camera) -> WorldCamera {
    WorldCamera { eye: eye.as_dvec3(), target: target.as_dvec3(), up, fov_y_degrees, lens }
}

/// A world with the coordinates of `scene`.
pub fn world_of(scene: Scene) -> World {
    let Scene { mesh, materials, textures, environment, lights, camera, .. } = scene;
    World {
        meshes: vec![mesh],
        instances: vec![Instance::default()],
        materials,
        textures,
        cameras: camera.map(|camera| ("camera".into(), in_world(camera))).into_iter().collect(),
        environment,
        lights,
        ..World::default()
    }
}

/// The Cornell box in unit space.
pub fn cornell() -> Scene {
    World::load(Path::new("scenes/cornell.toml")).unwrap().world.flatten()
}

/// A floor with 50 boxes, balls and cylinders of different sizes, with flat facets, in unit space.
pub fn fifty_objects() -> Scene {
    let mut model = Model::new();
    model.plate(Vec3::ZERO, 10.0 * Vec3::Z, 10.0 * Vec3::X, 0);
    let mut random = Random::new(50, 0);
    for object in 0..50 {
        let size = 0.2 + 0.5 * random.uniform();
        let at = vec3((object % 10) as f32 * 1.9 - 8.5, size, (object / 10) as f32 * 3.8 - 7.6);
        match object % 3 {
            0 => model.cuboid(at, vec3(size, size, 0.2 + 0.5 * random.uniform()), TAU * random.uniform(), false, 0),
            1 => model.sphere(at, size, 16, false, 0),
            _ => model.cylinder(at, 0.7 * size, size, 24, 0),
        }
    }
    model.finish()
}

/// Points evenly distributed over the fronts of all triangles of a scene in unit space.
pub fn points_on(scene: &Scene, count: usize) -> Vec<GatherPoint> {
    let mesh = &scene.mesh;
    let total: f32 = (0..mesh.triangles.len()).map(|triangle| mesh.area(triangle)).sum();
    let mut random = Random::new(1, 0);
    let (mut points, mut area) = (Vec::new(), 0.0);
    for triangle in 0..mesh.triangles.len() {
        area += mesh.area(triangle);
        let [a, b, c] = mesh.corners(triangle);
        while (points.len() as f32) < count as f32 * area / total {
            let (u, v) = (random.uniform(), random.uniform());
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            points.push(GatherPoint::flat(a + u * (b - a) + v * (c - a), mesh.geometric_normal(triangle)));
        }
    }
    points
}

/// The photon grid of a scene in unit space.
pub fn photon_grid(scene: &Scene, bvh: &Bvh, photons: u64) -> PhotonGrid {
    let mut grid = PhotonGrid::new(&scene.mesh, 32);
    PhotonTracer::new(scene, bvh, &Lights::new(scene), 0, 16).trace(0..photons, &mut grid);
    grid.add_area(scene, bvh, 0);
    grid
}

/// The first directions of a sequence.
pub fn directions(sequence: Sequence, count: u32) -> Vec<Direction> {
    let directions = Directions::new(sequence, 0);
    (0..count).map(|index| directions.get(index)).collect()
}

/// GL gather by the 2004 method, peeled to the last layer. For each point: rgb Σ radiance × weight, a Σ weight.
pub fn gather(
    gpu: &Gpu,
    scene: &Scene,
    photons: &PhotonTexture,
    points: &[GatherPoint],
    directions: &[Direction],
    layer_size: u32,
) -> Vec<Vec4> {
    gather_by(Pipeline::Kill, gpu, scene, photons, points, directions, layer_size).0
}

/// The same with early KILL.
pub fn gather_early(
    gpu: &Gpu,
    scene: &Scene,
    photons: &PhotonTexture,
    points: &[GatherPoint],
    directions: &[Direction],
    layer_size: u32,
) -> Vec<Vec4> {
    gather_by(Pipeline::EarlyKill, gpu, scene, photons, points, directions, layer_size).0
}

/// The same by the fused method, with both ends of each direction; also the maximum number of layers.
pub fn gather_fused(
    gpu: &Gpu,
    scene: &Scene,
    photons: &PhotonTexture,
    points: &[GatherPoint],
    directions: &[Direction],
    layer_size: u32,
) -> (Vec<Vec4>, u32) {
    gather_by(Pipeline::Fused, gpu, scene, photons, points, directions, layer_size)
}

/// The same by exact rays, with both ends of each direction.
pub fn gather_rays(
    gpu: &Gpu,
    scene: &Scene,
    photons: &PhotonTexture,
    points: &[GatherPoint],
    directions: &[Direction],
) -> Vec<Vec4> {
    gather_by(Pipeline::RaycastGl, gpu, scene, photons, points, directions, 1).0
}

/// The sums of a GL pipeline, and the maximum number of layers.
fn gather_by(
    pipeline: Pipeline,
    gpu: &Gpu,
    scene: &Scene,
    photons: &PhotonTexture,
    points: &[GatherPoint],
    directions: &[Direction],
    layer_size: u32,
) -> (Vec<Vec4>, u32) {
    let settings = Settings::default().with(|s| {
        s.gather = GatherSettings { pipeline, layer_size: LayerSize::Texels(layer_size), stop_fraction: 0.0 };
        s.photons.map = photons.kind();
    });
    let geometry = &Geometry::upload(gpu, scene).unwrap();
    let list = PointList::upload(gpu, points).unwrap();
    let points = list.points();
    let (bvh, grid) = (Rc::new(Bvh::new(&scene.mesh)), PhotonGrid::new(&scene.mesh, 1));
    // No GL pipeline uses it.
    let oracle = Reference::new(scene, &bvh, &grid);
    let mut gather = IrradianceGather::new(gpu, &settings, scene, &bvh, Interleave::new(1, points.size(), 0)).unwrap();
    gather.begin(&points.read());
    let layers = gather.add(GatherInputs { scene, geometry, photons, oracle, points }, directions).unwrap();
    gpu.check("gathering").unwrap();
    (list.in_order(gather.read()), layers)
}

/// Each direction, followed by its opposite.
pub fn both_ends(directions: &[Direction]) -> Vec<Direction> {
    directions.iter().flat_map(|&direction| [direction, Direction { vector: -direction.vector, ..direction }]).collect()
}

pub fn vectors(directions: &[Direction]) -> Vec<Vec3> {
    directions.iter().map(|direction| direction.vector).collect()
}

/// π Σ L w / Σ w, or 0 if no direction has weight.
pub fn irradiance(sums: &[Vec4]) -> Vec<Vec3> {
    sums.iter().map(|sum| if sum.w > 0.0 { PI * sum.truncate() / sum.w } else { Vec3::ZERO }).collect()
}

/// Form factor from a point to a polygon above its horizon, counter-clockwise as seen from it, by Lambert's formula: 1/2π Σ γ n·Γ over the edges. γ is
/// the angle that an edge subtends, Γ the unit normal of the plane through edge and point.
pub fn form_factor_of_polygon(corners: &[Vec3], position: Vec3, normal: Vec3) -> f64 {
    let corners: Vec<_> = corners.iter().map(|&corner| (corner - position).as_dvec3()).collect();
    let edge = |k: usize| {
        let (from, to) = (corners[k], corners[(k + 1) % corners.len()]);
        from.angle_between(to) * to.cross(from).normalize().dot(normal.as_dvec3())
    };
    (0..corners.len()).map(edge).sum::<f64>() / (2.0 * std::f64::consts::PI)
}

/// Form factor from a point to a disc in a plane parallel to the point's own. The center is at `to_center` from the point (Howell, "A catalog of
/// radiation heat transfer configuration factors", B-13). On the axis it is sin² of the disc's half angle.
pub fn form_factor_of_disc(to_center: Vec3, squared_radius: f64, normal: Vec3) -> f64 {
    let squared_height = to_center.as_dvec3().dot(normal.as_dvec3()).powi(2);
    let squared_offset = to_center.as_dvec3().length_squared() - squared_height;
    let sum = squared_height + squared_offset + squared_radius;
    0.5 * (1.0 - (sum - 2.0 * squared_radius) / (sum * sum - 4.0 * squared_offset * squared_radius).sqrt())
}

/// Form factor between parallel facing squares. `side` is relative to their distance (Howell, C-11, with equal sides).
pub fn form_factor_of_opposed_squares(side: f64) -> f64 {
    let (squared, slant) = (side * side, side.hypot(1.0));
    let logarithm = (slant * slant / (2.0 * squared + 1.0).sqrt()).ln();
    let angles = 2.0 * side * (slant * (side / slant).atan() - side.atan());
    2.0 / (std::f64::consts::PI * squared) * (logarithm + angles)
}

/// Difference of irradiances from a reference, over all points and channels.
#[derive(Clone, Copy, Debug)]
pub struct Difference {
    /// mean |a - b| / mean b
    pub mean: f64,
    /// mean (a - b) / mean b
    pub bias: f64,
}

impl Difference {
    pub fn between(a: &[Vec3], b: &[Vec3]) -> Self {
        assert_eq!(a.len(), b.len());
        let total =
            |of: &dyn Fn(Vec3, Vec3) -> Vec3| -> f64 { a.iter().zip(b).map(|(&a, &b)| of(a, b).as_dvec3().element_sum()).sum() };
        let reference = total(&|_, b| b);
        Self { mean: total(&|a, b| (a - b).abs()) / reference, bias: total(&|a, b| a - b) / reference }
    }
}

/// The irradiance from the lights of a scene at each point, by so many samples.
pub fn direct_light(scene: &Scene, points: &[GatherPoint], samples: u32) -> Vec<Vec3> {
    direct_light_of(&gpu(), scene, points, SampleShare::whole(samples))
}

/// The same by a share of the samples. Rays on the CPU must bring the same light, but for a few that graze an edge, or where a point chooses another lamp.
pub fn direct_light_of(gpu: &Gpu, scene: &Scene, points: &[GatherPoint], share: SampleShare) -> Vec<Vec3> {
    let (geometry, lights) = (Geometry::upload(gpu, scene).unwrap(), Lights::new(scene));
    let list = PointList::upload(gpu, points).unwrap();
    let direct = Direct::new(gpu, 0).unwrap();
    let found = list.in_order(direct.irradiance(&geometry, &lights, share, list.points()).unwrap());
    gpu.check("direct light").unwrap();
    let bvh = Bvh::new(&scene.mesh);
    let packets = SubsetPackets::of_list(&list.points().read(), list.points().size(), STRIDE);
    let [on_cpu, _] = direct_light_on_cpu(Rays::new(scene, &bvh), &lights, (share, 0), &packets, &[]);
    let on_cpu = list.in_order(on_cpu);
    let most = if lights.tree().is_some() { 5e-3 } else { 5e-4 };
    let is_alike = on_cpu == found || Difference::between(&on_cpu, &found).mean <= most;
    assert!(is_alike, "rays on the CPU bring other light: {:?}", Difference::between(&on_cpu, &found));
    found
}
