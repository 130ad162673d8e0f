//! Lights without a surface: their photons, the sun and its sky, and how scene files name them.

mod common;

use std::f64::consts::PI;
use std::fs;

use common::Model;
use finalgather::error::Error;
use finalgather::random::Recurrence;
use finalgather::scene::{Bvh, Daylight, Lights, LoadOptions, Loaded, PunctualKind, PunctualLight, Scene, Sky, Sun, World};
use finalgather::settings::Exposure;
use glam::{DVec3, Vec3, dvec3, vec3};
use rayon::prelude::*;

const STRENGTH: Vec3 = vec3(7.0, 3.0, 1.0);

fn light(kind: PunctualKind, position: DVec3, direction: Vec3) -> PunctualLight {
    PunctualLight { name: "light".into(), kind, position, direction, strength: STRENGTH }.check().unwrap()
}

fn spot(inner: f32, outer: f32, radius: f64) -> PunctualKind {
    PunctualKind::Spot { radius, inner: inner.to_radians(), outer: outer.to_radians() }
}

/// Flux in lm that the photons of a scene bring to its surfaces, red over that of the strength.
fn brought(scene: &Scene) -> f64 {
    const PHOTONS: u64 = 1 << 22;
    let (bvh, lights, starts) = (Bvh::new(&scene.mesh), Lights::new(scene), Recurrence::<5>::new(0));
    let flux = |photon| {
        let (mut path, flux) = lights.emit(starts.point(photon));
        path.advance(&bvh).map_or(0.0, |_| {
            let [r, g, b] = (flux / STRENGTH).to_array();
            assert!((r - g).abs() <= 1e-5 * r && (r - b).abs() <= 1e-5 * r, "photons have the colour of their light");
            f64::from(r)
        })
    };
    let unit = f64::from(scene.space.length_to_world(1.0));
    (0..PHOTONS).into_par_iter().map(flux).sum::<f64>() / PHOTONS as f64 * unit * unit
}

/// Photons carry the flux of closed forms, to all of a room and to a disc.
#[test]
fn photons_carry_the_flux_of_their_light() {
    let height = |degrees: f64| 1.0 - degrees.to_radians().cos();
    // Of a cone whose intensity rises by the square of a ramp in the cosine.
    let cone = |inner: f64, outer: f64| 2.0 * PI * (height(inner) + (height(outer) - height(inner)) / 3.0);
    let room = |lights: Vec<PunctualLight>| {
        let mut model = Model::new();
        model.cuboid(vec3(10.0, 0.0, 0.0), vec3(1.0, 2.0, 3.0), 0.3, true, 0);
        World { lights, ..model.world() }.flatten()
    };
    // Of radius 1, a distance below the origin.
    let disc = |distance: f32, lights: Vec<PunctualLight>| {
        let mut model = Model::new();
        model.disc(vec3(0.0, -distance, 0.0), 1.0, Vec3::Y, 64, 0);
        World { lights, ..model.world() }.flatten()
    };
    let inside = dvec3(10.2, 0.5, 0.3);
    let aside = vec3(0.3, -0.8, 0.4);
    let cases = [
        ("point", room(vec![light(PunctualKind::Point { radius: 0.0 }, inside, aside)]), 4.0 * PI),
        ("sphere", room(vec![light(PunctualKind::Point { radius: 0.2 }, inside, aside)]), 4.0 * PI),
        ("spot", room(vec![light(spot(20.0, 40.0, 0.0), inside, aside)]), cone(20.0, 40.0)),
        ("spot with a disc", room(vec![light(spot(0.0, 60.0, 0.1), inside, aside)]), cone(0.0, 60.0)),
        ("hemisphere", room(vec![light(spot(90.0, 90.0, 0.0), inside, aside)]), 2.0 * PI),
        (
            "two spots",
            room(vec![light(spot(20.0, 40.0, 0.0), inside, aside), light(spot(10.0, 20.0, 0.0), inside, -aside)]),
            cone(20.0, 40.0) + cone(10.0, 20.0),
        ),
        (
            "point over a disc",
            disc(1.0, vec![light(PunctualKind::Point { radius: 0.0 }, DVec3::ZERO, aside)]),
            2.0 * PI * height(45.0),
        ),
        // From out of the unit sphere, where few directions lead to the scene.
        (
            "far point",
            disc(30.0, vec![light(PunctualKind::Point { radius: 0.0 }, DVec3::ZERO, aside)]),
            2.0 * PI * height((1.0f64 / 30.0).atan().to_degrees()),
        ),
        (
            "far spot",
            disc(30.0, vec![light(spot(30.0, 40.0, 0.0), DVec3::ZERO, Vec3::NEG_Y)]),
            2.0 * PI * height((1.0f64 / 30.0).atan().to_degrees()),
        ),
        ("far sphere", disc(30.0, vec![light(PunctualKind::Point { radius: 0.5 }, DVec3::ZERO, aside)]), PI / (900.0 + 0.5)),
        (
            "sun",
            disc(0.0, vec![light(PunctualKind::Directional { angle: 0.0 }, DVec3::ZERO, aside)]),
            PI * 0.8 / aside.length() as f64,
        ),
        (
            "wide sun",
            disc(0.0, vec![light(PunctualKind::Directional { angle: 0.5 }, DVec3::ZERO, aside)]),
            PI * 0.8 / aside.length() as f64,
        ),
    ];
    for (name, scene, expected) in cases {
        let found = brought(&scene) / expected;
        eprintln!("{name}: {found:.5} of the closed form");
        // The edge of a cone that has none is 0.001 wide in the cosine. The rest is noise, and that of a disc with 64 sides.
        assert!((found - 1.0).abs() < 2e-3, "{name}: {found} of {expected}");
    }
}

#[test]
fn dark_lights_are_none() {
    let mut model = Model::new();
    model.plate(Vec3::ZERO, Vec3::Z, Vec3::X, 0);
    let mut world = model.world();
    assert!(world.is_dark());
    world.lights = vec![PunctualLight { strength: Vec3::ZERO, ..light(PunctualKind::Point { radius: 0.0 }, DVec3::Y, Vec3::Y) }];
    assert!(world.is_dark() && Lights::new(&world.flatten()).is_dark());
    world.lights.push(light(PunctualKind::Directional { angle: 0.0 }, DVec3::ZERO, Vec3::NEG_Y));
    assert!(!world.is_dark() && world.flatten().lights.len() == 2);
    assert_eq!(Lights::new(&world.flatten()).count(), 1);
    world.clay();
    assert_eq!(world.lights.len(), 2, "clay leaves lamps");
    let digest = |world: &World| world.flatten().digest();
    let before = digest(&world);
    world.lights[1].strength *= 2.0;
    assert_ne!(before, digest(&world));
}

/// The sky by another implementation of the paper, in Python: turbidity, height of the sun, angle from the zenith, azimuth from the sun; luminance, RGB.
#[test]
fn the_sky_is_that_of_its_paper() {
    let table = [
        ([3.0, 45.0, 0.0, 0.0], 7320.4, [4624.7, 7409.6, 14379.6]),
        ([3.0, 45.0, 60.0, 0.0], 21722.4, [18749.9, 21712.1, 30582.4]),
        ([3.0, 45.0, 60.0, 90.0], 7318.7, [4611.0, 7520.6, 13297.6]),
        ([3.0, 45.0, 80.0, 180.0], 7654.6, [6080.4, 7829.7, 10559.0]),
        ([2.0, 70.0, 40.0, 30.0], 9231.0, [6772.8, 9283.8, 15951.5]),
        ([6.0, 10.0, 85.0, 60.0], 5142.2, [7200.8, 4786.9, 2596.5]),
        ([6.0, 10.0, 30.0, 170.0], 3192.3, [2492.1, 3310.0, 4088.7]),
    ];
    for ([turbidity, height, theta, azimuth], luminance, rgb) in table {
        let place = |azimuth: f32, height: f32| Sun::at(azimuth, height).direction;
        let sky = Daylight::new(place(25.0, height), turbidity).unwrap();
        let direction = place(25.0 + azimuth, 90.0 - theta);
        let found = sky.radiance(direction);
        // The numbers have five digits, and f32 makes a thousandth of a degree of the angle between near directions.
        assert!((found / Vec3::from(rgb) - 1.0).abs().max_element() < 1e-3, "{found} for {rgb:?}");
        let weighed = found.dot(vec3(0.2126, 0.7152, 0.0722));
        assert!((weighed / luminance - 1.0).abs() < 2e-3, "{weighed} for {luminance}");
        // The picture has what the model has, where it is smooth.
        if theta > 0.0 && theta < 70.0 {
            let sky = Sky { turbidity, scale: 2.0 }.environment(&Sun::at(25.0, height)).unwrap();
            assert!(
                (sky.radiance(direction) / found - 2.0).abs().max_element() < 0.02,
                "{} for twice {found}",
                sky.radiance(direction)
            );
        }
        assert_eq!(sky.radiance(vec3(0.6, -0.8, 0.0)), Vec3::ZERO);
    }
    for height in [0.0, -10.0] {
        assert!(Daylight::new(Sun::at(0.0, height).direction, 3.0).is_err());
    }
}

/// The sun has some 100 klx at noon, less and redder light when it is low, and more in clear air.
#[test]
fn the_sun_through_the_air() {
    let lux = |height: f32, turbidity: f32| Daylight::new(Sun::at(0.0, height).direction, turbidity).unwrap().illuminance();
    let of = |rgb: Vec3| rgb.dot(vec3(0.2126, 0.7152, 0.0722));
    let heights = [90.0, 60.0, 30.0, 10.0, 3.0].map(|height| lux(height, 3.0));
    eprintln!("{heights:.0?}");
    assert!((85e3..110e3).contains(&of(heights[0])), "{}", heights[0]);
    for pair in heights.windows(2) {
        assert!(of(pair[1]) < of(pair[0]) && pair[1].x / pair[1].z > pair[0].x / pair[0].z, "{pair:?}");
    }
    assert!(of(lux(45.0, 6.0)) < of(lux(45.0, 2.0)));
    // By another implementation, in Python.
    for (height, turbidity, rgb) in [(90.0, 3.0, SUN_90), (30.0, 3.0, SUN_30), (10.0, 6.0, SUN_10)] {
        let found = lux(height, turbidity);
        assert!((found / Vec3::from(rgb) - 1.0).abs().max_element() < 1e-3, "{found} for {rgb:?}");
    }
}

const SUN_90: [f32; 3] = [104_527.7, 89_070.0, 77_094.9];
const SUN_30: [f32; 3] = [80_853.6, 63_772.5, 46_624.0];
const SUN_10: [f32; 3] = [7_889.69, 3_385.71, 694.448];

/// Loads a scene file with these tables and a dark triangle.
fn load(tables: &str, options: LoadOptions) -> Result<Loaded, Error> {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("m.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let scene = folder.path().join("s.toml");
    fs::write(&scene, format!("mesh = \"m.obj\"\n{tables}")).unwrap();
    World::load_with(&scene, LoadOptions { no_default_light: true, ..options })
}

#[test]
fn scene_files_name_lights() {
    let tables = "
        [sun]
        azimuth-degrees = 90
        height_degrees = 0
        illuminance = 7
        [[lights]]
        kind = \"point\"
        position = [1, 2, 3]
        intensity = 5
        [[lights]]
        kind = \"spot\"
        name = \"desk\"
        position = [0, 1e3, 0]
        direction = [0, -2, 0]
        intensity = [1, 2, 3.5]
        radius = 0.1
        inner-degrees = 10
        outer_degrees = 20
        [[lights]]
        kind = \"directional\"
        direction = [1, 0, 0]
        illuminance = 100
        angle_degrees = 2";
    let Loaded { world, settings, .. } = load(tables, LoadOptions::default()).unwrap();
    let [point, spot, distant, sun] = &world.lights[..] else { panic!("{:?}", world.lights) };
    assert_eq!((point.name.as_str(), point.position, point.strength), ("light 0", dvec3(1.0, 2.0, 3.0), Vec3::splat(5.0)));
    assert_eq!(point.kind, PunctualKind::Point { radius: 0.0 });
    assert_eq!((spot.name.as_str(), spot.direction, spot.strength), ("desk", Vec3::NEG_Y, vec3(1.0, 2.0, 3.5)));
    assert_eq!(spot.kind, PunctualKind::Spot { radius: 0.1, inner: 10f32.to_radians(), outer: 20f32.to_radians() });
    assert_eq!((distant.direction, distant.strength), (Vec3::X, Vec3::splat(100.0)));
    assert_eq!(distant.kind, PunctualKind::Directional { angle: 2f32.to_radians() });
    assert!(sun.direction.distance(Vec3::NEG_X) < 1e-6 && sun.strength == Vec3::splat(7.0), "{sun:?}");
    assert_eq!(sun.kind, PunctualKind::Directional { angle: 0.53f32.to_radians() });
    assert!(world.environment.is_none());
    assert_eq!(settings.display.exposure, Exposure::Stops(0.0));
}

#[test]
fn a_sky_and_its_sun() {
    let tables = "[sun]\ndirection = [0, 3, -4]\nangle_degrees = 0\n[sky]\nturbidity = 4\nscale = 0.5\n";
    let Loaded { world, settings, .. } = load(tables, LoadOptions::default()).unwrap();
    let model = Daylight::new(vec3(0.0, 0.6, -0.8), 4.0).unwrap();
    let [sun] = &world.lights[..] else { panic!("{:?}", world.lights) };
    assert!((sun.strength / model.illuminance() - 0.5).abs().max_element() < 1e-5, "{sun:?}");
    assert_eq!(sun.kind, PunctualKind::Directional { angle: 0.0 });
    let sky = world.environment.unwrap();
    assert!((sky.radiance(Vec3::Y) / model.radiance(Vec3::Y) - 0.5).abs().max_element() < 0.01);
    assert_eq!(settings.display.exposure, Exposure::Auto);
    let given = load(&format!("{tables}[settings]\nexposure = -13\n"), LoadOptions::default()).unwrap();
    assert_eq!(given.settings.display.exposure, Exposure::Stops(-13.0));

    // Options take the place of tables.
    let sun = Some(Sun { illuminance: Some(Vec3::ONE), ..Sun::at(180.0, 45.0) });
    let Loaded { world, .. } = load(tables, LoadOptions { sun, ..LoadOptions::default() }).unwrap();
    assert!(world.lights[0].strength == Vec3::ONE && world.environment.is_some_and(|sky| sky.bright_power() > 0.0));
    let options = LoadOptions { sky: Some(Sky::default()), ..LoadOptions::default() };
    let Loaded { world, .. } = load("[sun]\ndirection = [0, 3, -4]\n[environment]\nradiance = 1\n", options).unwrap();
    let model = Daylight::new(vec3(0.0, 0.6, -0.8), 3.0).unwrap();
    assert!((world.environment.unwrap().radiance(Vec3::Y) / model.radiance(Vec3::Y) - 1.0).abs().max_element() < 0.01);
    assert!((world.lights[0].strength / model.illuminance() - 1.0).abs().max_element() < 1e-5);
}

/// Each is refused with its line, problem and cure.
#[test]
fn lights_that_cannot_be() {
    let sun = "[sun]\nheight_degrees = 30\nazimuth_degrees = 1\n";
    for (tables, line, fragment) in [
        ("[sun]\nheight_degrees = 30\n", 2, "a sun has a direction, or an azimuth and a height"),
        ("[sun]\ndirection = [0, 0, 0]\n", 2, "direction is [0, 0, 0]"),
        ("[sun]\nheight_degrees = 95\nazimuth_degrees = 1\n", 2, "height 95"),
        ("[sun]\nheight_degrees = -5\nazimuth_degrees = 1\n", 2, "-5.0 degrees over the horizon"),
        ("[sun]\ndirection = [0, 1, 0]\nilluminance = -1\n", 2, "illuminance is [-1, -1, -1]"),
        ("[sun]\ndirection = [0, 1, 0]\nangle_degrees = 200\n", 2, "angle is 200 degrees"),
        ("[sun]\ndirecton = [0, 1, 0]\n", 3, "there is no key \"directon\""),
        ("[sky]\n", 2, "a sky needs a sun"),
        ("[sky]\nturbidity = 1\n[sun]\ndirection = [0, 1, 0]\n", 2, "turbidity is 1"),
        (&format!("{sun}[sky]\nscale = -1\n"), 5, "scale is -1"),
        (&format!("{sun}[sky]\n[environment]\nradiance = 1\n"), 5, "an environment or a sky"),
        ("[[lights]]\nkind = \"area\"\n", 3, "there is no value \"area\""),
        ("[[lights]]\nposition = [0, 0, 0]\nintensity = 1\n", 2, "kind is missing"),
        ("[[lights]]\nkind = \"point\"\nintensity = 1\n", 2, "this point is not complete"),
        ("[[lights]]\nkind = \"spot\"\nposition = [0, 0, 0]\nintensity = 1\n", 2, "this spot is not complete"),
        ("[[lights]]\nkind = \"directional\"\ndirection = [0, 0, 1]\n", 2, "this directional light is not complete"),
        ("[[lights]]\nkind = \"point\"\nposition = [0, 0, 0]\nilluminance = 1\n", 2, "a point has no illuminance"),
        ("[[lights]]\nkind = \"point\"\nposition = [0, 0, 0]\nintensity = -1\n", 2, "intensity is [-1, -1, -1]"),
        ("[[lights]]\nkind = \"point\"\nposition = [0, 0, 0]\nintensity = 1\nradius = -2\n", 2, "radius is -2"),
        (
            "[[lights]]\nkind = \"spot\"\nposition = [0, 0, 0]\ndirection = [0, 1, 0]\nintensity = 1\nouter_degrees = 100\n",
            2,
            "the cone reaches from 0 to 100 degrees",
        ),
        (
            "[[lights]]\nkind = \"directional\"\ndirection = [0, 0, 1]\nilluminance = 1\n[[lights]]\nkind = \"point\"\nposition = [1, 2, 3, 4]\n",
            8,
            "too many numbers",
        ),
    ] {
        let Err(error) = load(tables, LoadOptions::default()) else { panic!("loaded: {tables}") };
        let Error::Input { line: found, .. } = &error else { panic!("{tables}: {error:?}") };
        let message = error.to_string();
        assert!(message.contains(fragment), "{tables}\nhas no \"{fragment}\": {message}");
        assert!(
            found.is_none_or(|found| found == line) && (found.is_some() || fragment.contains("missing")),
            "{tables}\n{found:?}: {message}"
        );
        assert!(message.split_once("\n  cure: ").unwrap().1.len() > 10, "{message}");
    }
    // What options ask for has no place in a file.
    let options = LoadOptions { sky: Some(Sky::default()), ..LoadOptions::default() };
    assert!(load("", options).unwrap_err().to_string().contains("a sky needs a sun"));
}
