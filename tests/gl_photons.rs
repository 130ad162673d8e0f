//! Photons in shaders, compared with their CPU twins. Programs of this test read the photon textures by `photon_irradiance`. They give the same
//! irradiance as `PhotonGrid::irradiance` at the same place, for any number of cells and every bin, and as `PhotonAtlas::irradiance` on every
//! triangle. Also the channel `PhotonMap` of a picture.

mod common;

use std::f32::consts::PI;
use std::path::Path;

use common::{Model, gpu, sized};
use finalgather::gpu::{
    Blend, DepthTest, Draw, Filter, Format, Gpu, Program, ShaderSource, Shape, Target, Texture, Uniform, Wrap,
};
use finalgather::image::Image;
use finalgather::math::dominant_axis;
use finalgather::photon::{PhotonAtlas, PhotonGrid, PhotonStore, PhotonTexture, PhotonTracer};
use finalgather::random::Random;
use finalgather::render::Render;
use finalgather::scene::{Bvh, Lights, World};
use finalgather::settings::{PhotonMapKind, Pipeline, Settings};
use glam::{Vec3, Vec4, vec3};

/// Writes what the photon map says at the position in each texel of `places`; w is twice the axis, and 1 more for its negative side.
const LOOK_UP: ShaderSource = look_up(
    "look_up",
    "#version 330 core
#include \"photon_grid.glsl\"
uniform sampler2D places;
layout(location = 0) out vec4 irradiance;
void main()
{
    vec4 place = texelFetch(places, ivec2(gl_FragCoord.xy), 0);
    int bin = int(place.w);
    irradiance = vec4(photon_irradiance(place.xyz, bin / 2, bin % 2 == 0), 1.0);
}
",
    &[("photon_grid.glsl", include_str!("../glsl/include/photon_grid.glsl"))],
);

const fn look_up(name: &'static str, fragment: &'static str, includes: &'static [(&str, &str)]) -> ShaderSource {
    ShaderSource { name, vertex: include_str!("../glsl/fullscreen.vert"), fragment, defines: Vec::new(), includes }
}

/// The same from an atlas: w is the triangle's place in the table, negative and 1 less for its back.
const LOOK_UP_ATLAS: ShaderSource = look_up(
    "look_up_atlas",
    "#version 330 core
#include \"include/surface.glsl\"
#include \"include/photon_atlas.glsl\"
uniform sampler2D places;
layout(location = 0) out vec4 irradiance;
void main()
{
    vec4 place = texelFetch(places, ivec2(gl_FragCoord.xy), 0);
    bool front = place.w >= 0.0;
    irradiance = vec4(photon_irradiance(int(front ? place.w : -place.w - 1.0), place.xyz, front), 1.0);
}
",
    &[
        ("include/surface.glsl", include_str!("../glsl/include/surface.glsl")),
        ("include/photon_atlas.glsl", include_str!("../glsl/include/photon_atlas.glsl")),
    ],
);

/// The bin that holds nothing, among others full of light.
const EMPTY: usize = 2;
const BINS: usize = 6;

/// A grid over a scene that is longer than it is wide and wider than it is deep, with sums that differ in all cells. Bins differ tenfold
/// each, so that what leaks from one tile of the texture into another shows.
fn grid(cells: u32) -> PhotonGrid {
    let mut model = Model::new();
    model.cuboid(vec3(0.1, 0.2, 0.3), vec3(1.0, 0.61, 0.37), 0.0, true, 0);
    let mut grid = PhotonGrid::new(&model.finish().mesh, cells);
    let (per_bin, face) = (grid.sums.len() / BINS, grid.cell_size.powi(2));
    let mut random = Random::new(7, 0);
    for (i, sums) in grid.sums.iter_mut().enumerate().filter(|(i, _)| i / per_bin != EMPTY) {
        // About the area of a surface across the cell, and 0.2 to 1.2 of the bin's irradiance.
        let area = face * (0.5 + random.uniform());
        let [r, g, b] = [0; 3].map(|_| area * 10f32.powi((i / per_bin) as i32 - 3) * (0.2 + random.uniform()));
        *sums = [r, g, b, area];
    }
    grid
}

/// Places in every bin, as [`LOOK_UP`] reads them: on the scene's bounds, a quarter of a cell beyond, at the centres and borders of cells,
/// and anywhere.
fn places(grid: &PhotonGrid, count: usize) -> Vec<Vec4> {
    let mut random = Random::new(8, 0);
    let mut place = |bin: usize| {
        let coordinate = |cells: u32| {
            let (low, high) = (0.75, cells as f32 - 0.75);
            let anywhere = low + (high - low) * random.uniform();
            let choices = [low, 1.0, high, high - 0.25, anywhere.floor(), anywhere.floor() + 0.5, anywhere, anywhere];
            choices[(random.uniform() * choices.len() as f32) as usize].clamp(low, high)
        };
        let cell = Vec3::from(grid.cells.to_array().map(coordinate));
        (grid.origin + grid.cell_size * cell).extend(bin as f32)
    };
    (0..count).map(|i| place(i % BINS)).collect()
}

/// Weights are those of 32-bit coordinates: in a row of three tiles of 66 cells, one is rounded to 3 × 66 × 6e-8 = 1.2e-5 of a cell, between
/// cells that differ sixfold (measured at most 2.4e-5). GPUs filter with weights of 8 bits, which are off by 1/512 of a cell along each axis.
const IN_FLOAT: f32 = 1e-4;
const IN_8_BITS: f32 = 0.03;

fn limit(gpu: &Gpu) -> f32 {
    let software = ["llvmpipe", "softpipe"].iter().any(|name| gpu.info().renderer.contains(name));
    if software { IN_FLOAT } else { IN_8_BITS }
}

/// Runs a look-up at `places` and returns what it writes.
fn looked_up(gpu: &Gpu, source: &ShaderSource, size: [u32; 2], photons: &PhotonTexture, places: &[Vec4]) -> Vec<Vec4> {
    let program = Program::new(gpu, source).unwrap();
    let target = Target::new(gpu, size, &[Format::Rgba32F], false).unwrap();
    let texture = Texture::from_texels(gpu, Format::Rgba32F, size, Filter::Nearest, Wrap::CLAMP, places).unwrap();
    Draw {
        target: &target,
        region: None,
        program: &program,
        uniforms: &[&[("places", Uniform::Texture(&texture))], &photons.uniforms()[..]].concat(),
        depth: DepthTest::Off,
        blend: Blend::Replace,
        geometry: Shape::FullScreen,
    }
    .run();
    gpu.check("looking photons up").unwrap();
    target.color(0).read()
}

/// Flat and bent surfaces, contacts, and triangles whose places in the table are not those in the mesh.
#[test]
fn both_sides_look_up_the_same_in_an_atlas() {
    let gpu = gpu();
    let mut model = Model::new();
    model.cuboid(vec3(0.1, 0.2, 0.3), vec3(1.0, 0.61, 0.37), 0.0, true, 0);
    model.cuboid(vec3(0.3, -0.2, 0.3), vec3(0.2, 0.21, 0.1), 0.3, false, 0);
    model.sphere(vec3(-0.4, 0.1, 0.3), 0.2, 16, false, 0);
    let scene = model.finish();
    let bvh = Bvh::new(&scene.mesh);
    let mut atlas = PhotonAtlas::new(&scene, &bvh, None, |_, charts| vec![2000.0; charts]);
    let size = [256, sized(&gpu, 96, 24)];
    let mut random = Random::new(9, 0);
    let count = scene.mesh.triangles.len();
    let places: Vec<(usize, bool, Vec3)> = (0..(size[0] * size[1]) as usize)
        .map(|i| {
            let [a, b, c] = scene.mesh.corners(i % count);
            let (u, v) = (random.uniform(), random.uniform());
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            (i % count, random.uniform() < 0.5, a + u * (b - a) + v * (c - a))
        })
        .collect();
    for &(triangle, front, position) in &places {
        let normal = scene.mesh.geometric_normal(triangle);
        let direction = if front { -normal } else { normal };
        let index = atlas.index_of_hit(&scene.mesh, triangle, position, direction);
        atlas.add_flux(index, Vec3::new(random.uniform(), random.uniform(), random.uniform()));
    }
    atlas.settle();
    let order: Vec<usize> = (0..count).rev().collect();
    let photons = PhotonTexture::of_atlas(&gpu, &atlas, &order).unwrap();
    let texel = |&(triangle, front, position): &(usize, bool, Vec3)| {
        let slot = (count - 1 - triangle) as f32;
        position.extend(if front { slot } else { -slot - 1.0 })
    };
    let found = looked_up(&gpu, &LOOK_UP_ATLAS, size, &photons, &places.iter().map(texel).collect::<Vec<_>>());
    let (mut lit, mut other) = (0, 0);
    for (&(triangle, front, position), found) in places.iter().zip(found) {
        let normal = scene.mesh.geometric_normal(triangle);
        let expected = atlas.irradiance(&scene.mesh, triangle, position, if front { normal } else { -normal });
        lit += u32::from(expected.min_element() > 0.0);
        other += u32::from(found.truncate() != expected);
    }
    eprintln!("{lit} lit, {other} in another cell, of {}", places.len());
    assert!(lit as usize > places.len() / 2);
    // Rounding may put a place on the border of two cells into the other.
    assert!(other as usize <= places.len() / 2000, "{other} of {}", places.len());
}

#[test]
fn both_sides_look_up_the_same() {
    let gpu = gpu();
    let limit = limit(&gpu);
    let size = [256, sized(&gpu, 96, 24)];
    // Softpipe keeps textures in tiles of 32 texels and filters with wrong ones from one tile to the next: there, only grids within a tile.
    let counts: &[u32] = sized(&gpu, &[1, 2, 3, 8, 31, 32, 64], &[1, 2, 3, 8]);
    for &cells in counts {
        let grid = grid(cells);
        let photons = PhotonTexture::upload(&gpu, &grid).unwrap();
        let places = places(&grid, (size[0] * size[1]) as usize);
        let found = looked_up(&gpu, &LOOK_UP, size, &photons, &places);
        let mut worst = [0f32; BINS];
        for (place, found) in places.iter().zip(found) {
            let bin = place.w as usize;
            let (found, expected) = (found.truncate(), grid.irradiance(place.truncate(), bin / 2, bin.is_multiple_of(2)));
            if bin == EMPTY {
                assert_eq!((found, expected), (Vec3::ZERO, Vec3::ZERO), "{cells} cells, the empty bin at {place}");
                continue;
            }
            let error = (found / expected - 1.0).abs().max_element();
            worst[bin] = worst[bin].max(error);
            assert!(error < limit, "{cells} cells, bin {bin} at {place}: {found} for {expected}");
        }
        eprintln!("{cells} cells, {:?} in all: differences of up to {worst:?}", grid.cells.to_array());
    }
}

#[test]
fn a_picture_shows_the_photon_map() {
    // A picture of one block has one point a pixel, which its own position, normal and albedo tell. In unit space already, where the grid is.
    let gpu = gpu();
    for file in ["scenes/cornell.toml", "scenes/cornell_textured.toml"] {
        let scene = World::load(Path::new(file)).unwrap().world.flatten();
        let world = common::world_of(scene.clone());
        // Cells that stay within a tile of softpipe's, see above.
        let mut settings = Settings::default();
        (settings.film.size, settings.directions.count, settings.direct.light_samples) = ([48, 40], 1, 1);
        (settings.photons.count, settings.photons.grid_cells) = (50_000, 8);
        settings.photons.map = PhotonMapKind::Grid;

        let (bvh, lights) = (Bvh::new(&scene.mesh), Lights::new(&scene));
        let mut grid = PhotonGrid::new(&scene.mesh, settings.photons.grid_cells);
        PhotonTracer::new(&scene, &bvh, &lights, settings.seed, settings.photons.depth)
            .trace(0..settings.photons.count, &mut grid);
        grid.add_area(&scene, &bvh, settings.seed);

        for pipeline in [Pipeline::Fused, Pipeline::Kill, Pipeline::EarlyKill, Pipeline::Raycast, Pipeline::RaycastGl] {
            let mut render = Render::new(&gpu, &world, &settings.with(|s| s.gather.pipeline = pipeline)).unwrap();
            render.step().unwrap();
            let picture = render.picture();
            let [photon_map, albedo] = ["PhotonMap", "Albedo"].map(|name| vectors(&picture, name, ["R", "G", "B"]));
            let [positions, normals] = ["P", "N"].map(|name| vectors(&picture, name, ["X", "Y", "Z"]));
            let (mut seen, mut worst) = (0, 0f32);
            for pixel in (0..photon_map.len()).filter(|&pixel| normals[pixel] != Vec3::ZERO) {
                let axis = dominant_axis(normals[pixel]);
                let expected = albedo[pixel] / PI * grid.irradiance(positions[pixel], axis, normals[pixel][axis] > 0.0);
                let difference = (photon_map[pixel] - expected).abs().max_element();
                assert!(
                    difference <= limit(&gpu) * expected.max_element(),
                    "{file}, {pipeline:?}, pixel {pixel}: {} for {expected}",
                    photon_map[pixel]
                );
                worst = worst.max(difference / expected.max_element().max(1e-9));
                seen += u32::from(expected != Vec3::ZERO);
            }
            eprintln!("{file}, {pipeline:?}: {seen} pixels, differences of up to {worst}");
            assert!(seen > 1000, "{file}, {pipeline:?}: only {seen} pixels show photons");
        }
    }
}

/// Three channels of a picture.
fn vectors(picture: &Image, name: &str, parts: [&str; 3]) -> Vec<Vec3> {
    let [x, y, z] = parts.map(|part| picture.channel(&format!("{name}.{part}")).unwrap());
    x.iter().zip(y).zip(z).map(|((&x, &y), &z)| vec3(x, y, z)).collect()
}
