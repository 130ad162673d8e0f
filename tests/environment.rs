//! Light from outside the scene: directions in the picture, densities of samples, and refusals.

use std::f32::consts::PI;
use std::fs;

use finalgather::Environment;
use finalgather::direction::Directions;
use finalgather::image::{Channel, Image, WriteOptions};
use finalgather::random::{Random, sobol};
use finalgather::settings::Sequence;
use glam::{Vec3, vec3};

/// Texels with a radiance each of their own.
fn motley(width: usize) -> Environment {
    let mut random = Random::new(3, 0);
    let texels = (0..width * width / 2).map(|_| Vec3::from([0; 3].map(|_| random.uniform()))).collect();
    Environment::from_texels([width, width / 2], texels).unwrap()
}

/// The unit vector through a place of a picture, from its upper left corner.
fn direction([u, v]: [f32; 2]) -> Vec3 {
    let (azimuth, polar) = (2.0 * PI * (u - 0.5), PI * v);
    vec3(polar.sin() * azimuth.sin(), polar.cos(), -polar.sin() * azimuth.cos())
}

#[test]
fn axes_are_where_the_convention_has_them() {
    // Four columns about the azimuths of the axes would have their borders there; eight have -z, +x, +z and -x between two.
    let (mut texels, at) = (vec![Vec3::ZERO; 32], |column: usize, row: usize| 8 * row + column);
    texels[at(3, 1)] = vec3(1.0, 0.0, 0.0);
    texels[at(4, 1)] = vec3(3.0, 0.0, 0.0);
    for row in [1, 2] {
        texels[at(5, row)].y = 1.0;
        texels[at(6, row)].y = 3.0;
        texels[at(0, row)].z = 4.0;
    }
    texels[..8].fill(Vec3::splat(7.0));
    texels[24..].fill(Vec3::splat(9.0));
    let environment = Environment::from_texels([8, 4], texels).unwrap();
    let check = |environment: &Environment, direction: Vec3, expected: Vec3| {
        let found = environment.radiance(direction);
        assert!((found - expected).abs().max_element() < 1e-5, "{expected} along {direction}, not {found}");
    };
    // Half of each of two columns, and of each of two rows.
    check(&environment, Vec3::NEG_Z, vec3(1.0, 0.0, 0.0));
    check(&environment, Vec3::X, vec3(0.0, 2.0, 0.0));
    check(&environment, Vec3::Z, vec3(0.0, 0.0, 2.0));
    check(&environment, Vec3::NEG_X, Vec3::ZERO);
    check(&environment, Vec3::Y, Vec3::splat(7.0));
    check(&environment, Vec3::NEG_Y, Vec3::splat(9.0));
    // A quarter of a turn takes -z to -x, +z to +x and leaves the poles; brightness is a factor.
    let turned = environment.turned(90.0).scaled(2.0);
    check(&turned, Vec3::NEG_X, vec3(2.0, 0.0, 0.0));
    check(&turned, Vec3::NEG_Z, vec3(0.0, 4.0, 0.0));
    check(&turned, Vec3::X, vec3(0.0, 0.0, 4.0));
    check(&turned, Vec3::Y, Vec3::splat(14.0));
}

#[test]
fn texels_are_met_at_their_centres_and_blend_between() {
    let (width, environment) = (16, motley(16));
    let texel = |column: usize, row: usize| {
        environment.radiance(direction([(column as f32 + 0.5) / width as f32, (row as f32 + 0.5) / (width / 2) as f32]))
    };
    let mut random = Random::new(3, 0);
    for row in 0..width / 2 {
        for column in 0..width {
            let expected = Vec3::from([0; 3].map(|_| random.uniform()));
            // Places are rounded to a few 1e-7 of a turn, 1e-5 of a texel.
            assert!((texel(column, row) - expected).abs().max_element() < 1e-4, "{column}, {row}");
        }
    }
    // The seam: half way from the last column to the first.
    let found = environment.radiance(direction([0.0, 3.5 / 8.0]));
    assert!((found - texel(15, 3).midpoint(texel(0, 3))).abs().max_element() < 1e-4);
}

/// Samples must have the density that they say: the mean of f / density is the integral of f, for f that looks at any part of the sphere. A picture of
/// light and black texels, turned, so that densities differ and some are zero.
#[test]
fn samples_have_their_density() {
    const SAMPLES: u32 = 1 << 16;
    let mut texels = vec![Vec3::ZERO; 128];
    for (i, texel) in texels.iter_mut().enumerate().filter(|(i, _)| i % 3 != 0 && i % 16 > 4) {
        *texel = vec3(1.0, 2.0, 3.0) * (1.0 + (i % 7) as f32);
    }
    texels[70] = Vec3::splat(900.0);
    let environment = Environment::from_texels([16, 8], texels).unwrap().turned(33.0).scaled(0.5);
    let directions = Directions::new(Sequence::Sobol, 0);
    let mut sums = [[0.0_f64; 2]; 4];
    // What each of four parts of the sphere sends, by samples of the light and by directions without regard to it.
    let part = |d: Vec3| usize::from(d.x > 0.3) + 2 * usize::from(d.y + 0.4 * d.z > 0.1);
    for i in 0..SAMPLES {
        let (d, density) = environment.sample(sobol(i, 7));
        assert!((d.length() - 1.0).abs() < 1e-5 && density > 0.0, "{d} of density {density}");
        sums[part(d)][0] += f64::from(environment.radiance(d).element_sum() / density);
        let d = directions.get(i).vector;
        sums[part(d)][1] += f64::from(environment.radiance(d).element_sum() * 4.0 * PI);
    }
    for [sampled, uniform] in sums {
        eprintln!("{:.2} by samples, {:.2} by directions", sampled / f64::from(SAMPLES), uniform / f64::from(SAMPLES));
        // Measured 0.3 % at most: of the directions, which meet the bright texel some 200 times a hundred.
        assert!((sampled / uniform - 1.0).abs() < 0.01, "{sampled} by samples, {uniform} by directions");
    }
    // The power is the same integral, by the texels.
    let total = sums.iter().map(|sum| sum[0]).sum::<f64>() / f64::from(SAMPLES);
    assert!((environment.power() / total - 1.0).abs() < 0.01, "{} of {total}", environment.power());
}

#[test]
fn a_constant_is_the_same_everywhere() {
    let radiance = vec3(0.2, 0.4, 0.9);
    let environment = Environment::constant(radiance).unwrap();
    let directions = Directions::new(Sequence::R2, 0);
    for i in 0..1000 {
        assert_eq!(environment.radiance(directions.get(i).vector), radiance);
        let (_, density) = environment.sample(sobol(i, 0));
        assert!((density * 4.0 * PI - 1.0).abs() < 1e-5, "{density}");
    }
    assert!((environment.power() / (1.5 * 4.0 * std::f64::consts::PI) - 1.0).abs() < 1e-6);
    assert_eq!(environment.bright_power(), 0.0);
}

#[test]
fn the_soft_sky_lights_upright_surfaces_as_a_sky_of_one() {
    let sky = Environment::soft_sky();
    let directions = Directions::new(Sequence::R2, 0);
    // Over the sphere, irradiance / π is 4 times the mean of radiance times cosine.
    let light_on = |normal: Vec3| {
        let sum: f64 = (0..20_000)
            .map(|i| directions.get(i).vector)
            .map(|direction| f64::from(sky.radiance(direction).x * normal.dot(direction).max(0.0)))
            .sum();
        4.0 * sum / 20_000.0
    };
    for (normal, expected) in [(Vec3::X, 1.0), (Vec3::NEG_Z, 1.0), (Vec3::Y, 4.0 / 3.0), (Vec3::NEG_Y, 2.0 / 3.0)] {
        let found = light_on(normal);
        assert!((found / expected - 1.0).abs() < 0.005, "{normal}: {found}, not {expected}");
    }
}

/// An 8 x 4 picture in Radiance RGBE, not run-length encoded, all texels alike.
fn hdr(header: &str, size: &str, texel: [u8; 4]) -> Vec<u8> {
    [format!("#?RADIANCE\n{header}FORMAT=32-bit_rle_rgbe\n\n{size}\n").as_bytes(), &texel.repeat(32)].concat()
}

#[test]
fn pictures_of_both_kinds_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    // 128/256 × 2^(129 - 128) = 1, over the exposure.
    fs::write(path("a.HDR"), hdr("EXPOSURE=4\n", "-Y 4 +X 8", [128, 64, 32, 129])).unwrap();
    let environment = Environment::load(&path("a.HDR")).unwrap();
    assert_eq!(environment.radiance(Vec3::X), vec3(0.25, 0.125, 0.0625));

    // Rows from the top: 1 above, 0 below.
    let channel = |name: &str, scale: f32| Channel {
        name: name.into(),
        samples: (0..8).map(|i| if i < 4 { scale } else { 0.0 }).collect(),
    };
    let image = Image { width: 4, height: 2, channels: vec![channel("R", 1.0), channel("G", 2.0), channel("B", 3.0)] };
    image.write(&path("b.exr"), &WriteOptions::default()).unwrap();
    let environment = Environment::load(&path("b.exr")).unwrap();
    assert_eq!(environment.radiance(Vec3::Y), vec3(1.0, 2.0, 3.0));
    assert_eq!(environment.radiance(Vec3::NEG_Y), Vec3::ZERO);
}

#[test]
fn what_is_no_environment_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let check = |name: &str, bytes: &[u8], fragment: &str| {
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        let error = Environment::load(&path).expect_err(fragment).to_string();
        assert!(error.contains(name) && error.contains(fragment) && error.contains("\n  cure: "), "{name} {fragment}: {error}");
    };
    let exr = |width: usize, height: usize, names: [&str; 3], sample: f32| {
        let channels = names.map(|name| Channel { name: name.into(), samples: vec![sample; width * height] });
        let path = folder.path().join("made.exr");
        Image { width, height, channels: channels.into() }.write(&path, &WriteOptions::default()).unwrap();
        fs::read(path).unwrap()
    };
    check("a.png", b"", "the ending names no kind");
    check("a.hdr", b"", "not readable as Radiance RGBE");
    check("a.hdr", b"P6 1 1 255\n", "not readable as Radiance RGBE");
    check("a.hdr", &hdr("", "-Y 4 +X 8", [1; 4])[..80], "not readable as Radiance RGBE");
    check("a.hdr", &hdr("", "-Y 8 +X 4", [1; 4]), "4 x 8 texels");
    check("a.hdr", &hdr("", "-Y 0 +X 0", [1; 4]), "0 x 0 texels");
    // A few bytes that ask for 24 exabytes.
    check("a.hdr", &hdr("", "-Y 1000000000 +X 2000000000", [1; 4]), "2000000000 x 1000000000 texels");
    check("a.hdr", &hdr("EXPOSURE=0\n", "-Y 4 +X 8", [128, 0, 0, 129]), "texel 0, 0 is [inf, NaN, NaN]");
    check("a.exr", b"", "not readable as OpenEXR");
    check("a.exr", &exr(3, 2, ["R", "G", "B"], 1.0), "3 x 2 texels");
    check("a.exr", &exr(4, 2, ["X", "Y", "Z"], 1.0), "no channel R");
    check("a.exr", &exr(4, 2, ["R", "G", "B"], -1e-9), "texel 0, 0 is [-");
    check("a.exr", &exr(4, 2, ["R", "G", "B"], f32::NAN), "texel 0, 0 is [NaN");
    // The header's data window, from (0, 0) to (3, 1), made to end at (131071, 65535).
    let mut liar = exr(4, 2, ["R", "G", "B"], 1.0);
    let window: Vec<u8> = [0_i32, 0, 3, 1].iter().flat_map(|corner| corner.to_le_bytes()).collect();
    for at in (0..liar.len() - 16).filter(|&at| liar[at..at + 16] == window[..]).collect::<Vec<_>>() {
        liar[at + 8..at + 12].copy_from_slice(&131_071_i32.to_le_bytes());
        liar[at + 12..at + 16].copy_from_slice(&65_535_i32.to_le_bytes());
    }
    check("a.exr", &liar, "131072 x 65536 texels");
    let missing = Environment::load(&folder.path().join("none.hdr")).unwrap_err().to_string();
    assert!(missing.contains("none.hdr") && missing.contains("no such file"), "{missing}");
}

/// A sky of radiance 1 with a sun of one texel, which fills a share of 1/1304 of the sphere at the equator.
fn with_sun(sun: f32) -> Environment {
    let mut texels = vec![vec3(0.5, 0.3, 0.2); 64 * 32];
    texels[64 * 16 + 20] = vec3(0.5, 0.3, 0.2) * sun;
    Environment::from_texels([64, 32], texels).unwrap().turned(70.0).scaled(2.0)
}

/// What is gathered and what is bright make the whole, and the gathered part is at most four times its own mean.
#[test]
fn a_sun_is_split_from_its_sky() {
    let (environment, directions) = (with_sun(1000.0), Directions::new(Sequence::Sobol, 0));
    // Towards the sun as well, which hardly any direction of a thousand meets.
    let of_sun = |i: u32| environment.sample_bright(sobol(i, 1)).expect("the sun is bright").0;
    let sum = |radiance: Vec3| f64::from(radiance.element_sum());
    let (mut mean, mut brightest, mut seen) = (0.0, 0.0_f64, 0);
    // Interpolation rounds a few times, at up to the sun's 1000.
    for direction in (0..4096).map(|i| directions.get(i).vector).chain((0..256).map(of_sun)) {
        let [whole, gathered, bright] =
            [environment.radiance(direction), environment.gathered_radiance(direction), environment.bright_radiance(direction)];
        assert!((whole - gathered - bright).abs().max_element() < 1e-4, "{whole}: {gathered}, {bright}");
        assert!(gathered.min_element() >= 0.0 && bright.min_element() >= 0.0, "{gathered}, {bright}");
        mean += sum(environment.gathered_radiance(directions.get(seen % 4096).vector)) / 4352.0;
        brightest = brightest.max(sum(gathered));
        seen += 1;
    }
    assert!(brightest < 4.02 * mean && brightest > 3.9 * mean, "{brightest} of {mean}");
    // 999 of the sun's 1000 over the rest of the sky: 1303 texels' worth at radiance 1, and 4 at most of the sun's own.
    let share = environment.bright_power() / environment.power();
    assert!((share - 996.0 / 2303.0).abs() < 0.002, "{share}");
}

#[test]
fn bright_samples_have_their_density() {
    const SAMPLES: u32 = 1 << 10;
    let environment = with_sun(1000.0);
    let mut sum = 0.0;
    for i in 0..SAMPLES {
        let (direction, density) = environment.sample_bright(sobol(i, 7)).unwrap();
        assert!((direction.length() - 1.0).abs() < 1e-5 && density > 0.0, "{direction} of density {density}");
        sum += f64::from(environment.bright_radiance(direction).element_sum() / density) / f64::from(SAMPLES);
    }
    eprintln!("{sum} of {}", environment.bright_power());
    assert!((sum / environment.bright_power() - 1.0).abs() < 2e-3, "{sum} of {}", environment.bright_power());
}

/// Skies whose light the gather finds well have no bright part, and keep their bits.
#[test]
fn smooth_skies_are_gathered_as_a_whole() {
    let of_rows = |radiance: &dyn Fn(f32) -> f32| {
        let row = |row: usize| Vec3::splat(radiance((PI * (row as f32 + 0.5) / 64.0).cos()));
        Environment::from_texels([128, 64], (0..128 * 64).map(|i| row(i / 128)).collect()).unwrap()
    };
    let overcast = of_rows(&|y| if y > 0.0 { (1.0 + 2.0 * y) / 3.0 } else { 0.0 });
    let skies = [of_rows(&|y| 1.0 + y), overcast, with_sun(4.0), Environment::constant(vec3(0.1, 0.7, 0.2)).unwrap()];
    let directions = Directions::new(Sequence::R2, 0);
    for environment in skies {
        assert!(environment.bright_power() == 0.0 && environment.sample_bright([0.5; 2]).is_none());
        for direction in (0..1000).map(|i| directions.get(i).vector) {
            assert_eq!(environment.gathered_radiance(direction), environment.radiance(direction));
            assert_eq!(environment.bright_radiance(direction), Vec3::ZERO);
        }
    }
    // A light in the dark is bright as a whole.
    let mut texels = vec![Vec3::ZERO; 64 * 32];
    texels[1000] = Vec3::ONE;
    let alone = Environment::from_texels([64, 32], texels).unwrap();
    assert!(alone.bright_power() > 0.99 * alone.power(), "{} of {}", alone.bright_power(), alone.power());
}
