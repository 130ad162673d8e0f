//! The photon texture against its CPU twin: `photon_irradiance` of the shaders, by a program of this test's own, and `PhotonGrid::irradiance`
//! give one irradiance at one place, for any number of cells and every bin.

mod common;

use common::{Model, gpu, sized};
use finalgather::gpu::{Blend, DepthTest, Draw, Filter, Format, Geometry, Program, ShaderSource, Target, Texture, Uniform, Wrap};
use finalgather::photon::{PhotonGrid, PhotonTexture};
use finalgather::random::Random;
use glam::{Vec3, Vec4, vec3};

/// Writes what the photon map says at the position in each texel of `places`; w is twice the axis, and 1 more for its negative side.
const LOOK_UP: ShaderSource = ShaderSource {
    name: "look_up",
    vertex: include_str!("../glsl/fullscreen.vert"),
    fragment: "#version 330 core
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
    defines: &[],
    includes: &[("photon_grid.glsl", include_str!("../glsl/include/photon_grid.glsl"))],
};

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

#[test]
fn both_sides_look_up_the_same() {
    let gpu = gpu();
    let software = ["llvmpipe", "softpipe"].iter().any(|name| gpu.info().renderer.contains(name));
    let limit = if software { IN_FLOAT } else { IN_8_BITS };
    let program = Program::new(&gpu, &LOOK_UP).unwrap();
    let size = [256, sized(&gpu, 96, 24)];
    let target = Target::new(&gpu, size, &[Format::Rgba32F], false).unwrap();
    // Softpipe keeps textures in tiles of 32 texels and filters with wrong ones from one tile to the next: there, only grids within a tile.
    let counts: &[u32] = sized(&gpu, &[1, 2, 3, 8, 31, 32, 64], &[1, 2, 3, 8]);
    for &cells in counts {
        let grid = grid(cells);
        let photons = PhotonTexture::upload(&gpu, &grid).unwrap();
        let places = places(&grid, (size[0] * size[1]) as usize);
        let texture = Texture::from_texels(&gpu, Format::Rgba32F, size, Filter::Nearest, Wrap::Clamp, &places).unwrap();
        Draw {
            target: &target,
            region: None,
            program: &program,
            uniforms: &[&[("places", Uniform::Texture(&texture))], &photons.uniforms()[..]].concat(),
            depth: DepthTest::Off,
            blend: Blend::Replace,
            geometry: Geometry::FullScreen,
        }
        .run();
        gpu.check("looking photons up").unwrap();
        let found: Vec<Vec4> = target.color(0).read();
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
