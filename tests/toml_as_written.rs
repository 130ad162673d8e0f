//! Scene files as people write them: accepted as options are, or refused with the place and the name that was meant.

use std::fs;
use std::path::Path;

use finalgather::error::Error;
use finalgather::scene::{LoadOptions, Loaded, World};
use glam::Vec3;

const MODEL: &str = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl lamp\nf 1 2 3\n";

fn load(scene: &str) -> Result<Loaded, Error> {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in [("m.obj", MODEL), ("m.mtl", "newmtl lamp\nKe 5 5 5\n"), ("s.toml", scene)] {
        fs::write(folder.path().join(name), text).unwrap();
    }
    World::load_with(&folder.path().join("s.toml"), LoadOptions::default())
}

fn refused(scene: &str) -> String {
    let error = load(scene).map(|loaded| panic!("{:?}", loaded.settings)).unwrap_err();
    let Error::Input { path, line, problem, cure, .. } = error else { panic!("{error}") };
    assert_eq!(path.file_name(), Some("s.toml".as_ref()));
    format!("{}: {problem}\n  cure: {cure}", line.unwrap_or_default())
}

#[test]
fn values_as_of_options() {
    let plain = "mesh = \"m.obj\"\n[camera]\neye = [0, 0, 3]\ntarget = [0, 0, 0]\nfov_y_degrees = 30\n[settings]\nsize = [256, 256]\nphotons = 100000\n\
                 layer_size = 96\nlight_samples = 64\ntarget_error = 0.01\nseed = 18446744073709551615\n[environment]\nradiance = [2, 2, 2]\n\
                 [materials.lamp]\nalbedo = [0.25, 0.25, 0.25]\nemission = [1, 1, 1]\n";
    let loose = "mesh = \"m.obj\"\n[camera]\neye = [0, 0, 3]\ntarget = [0, 0, 0]\nfov-y-degrees = 30\n[settings]\nsize = 256\nphotons = 1e5\n\
                 layer-size = \"96\"\nlight_samples = 64.0\ntarget-error = \"1e-2\"\nseed = 18446744073709551615\n[environment]\nradiance = 2\n\
                 [materials.lamp]\nalbedo = 0.25\nemission = 1.0\n";
    let [plain, loose] = [plain, loose].map(|text| load(text).unwrap());
    assert_eq!(plain.settings, loose.settings);
    assert_eq!((plain.settings.photons.count, plain.settings.film.size), (100_000, [256, 256]));
    assert_eq!(plain.world.cameras[0].1, loose.world.cameras[0].1);
    assert_eq!(loose.world.materials[0].albedo, Vec3::splat(0.25));
    assert_eq!(loose.world.materials[0].emission, Vec3::ONE);
    let radiance = |loaded: &Loaded| loaded.world.environment.as_ref().unwrap().radiance(Vec3::Y);
    assert_eq!(radiance(&loose), radiance(&plain));
    let wide = load("mesh = \"m.obj\"\n[settings]\nsize = \"640x480\"\n").unwrap();
    assert_eq!(wide.settings.film.size, [640, 480]);
    // A material may have the name of a table.
    assert!(refused("mesh = \"m.obj\"\n[materials.settings]\nalbedo = 1\n").contains("no material \"settings\""));
    // Names of materials stay as they are.
    assert!(refused("mesh = \"m.obj\"\n[materials.la-mp]\nalbedo = 1\n").contains("no material \"la-mp\""));
}

#[test]
fn faults_are_shown_with_what_was_meant() {
    for (scene, message) in [
        (
            "mesh = \"m.obj\"\n[settings]\n  photon = 5\n",
            "3: there is no key \"photon\"\n  3 |   photon = 5\n    |   ^^^^^^\n  cure: write photons in its place",
        ),
        (
            "mesh = \"m.obj\"\n[setings]\nsize = 5\n",
            "2: there is no key \"setings\"\n  2 | [setings]\n    |  ^^^^^^^\n  cure: write settings in its place",
        ),
        (
            "mesh = \"m.obj\"\n[settings]\npipeline = \"fusd\"\n",
            "3: there is no value \"fusd\"\n  3 | pipeline = \"fusd\"\n    |            ^^^^^^\n  cure: write fused in its place",
        ),
        (
            "mesh = \"m.obj\"\n[settings]\nphotons = \"many\"\n",
            "3: a value of the wrong kind: string \"many\"\n  3 | photons = \"many\"\n    |           ^^^^^^\n  \
             cure: give a whole number, such as 1000 or 1e3 here",
        ),
        (
            "mesh = \"m.obj\"\n[settings]\ndirections = 0\n",
            "3: directions is 0\n  3 | directions = 0\n    | ^^^^^^^^^^\n  cure: give directions of 1 or more",
        ),
        (
            "mesh = \"m.obj\"\n[settings]\nsize = [16, 16, 16]\n",
            "3: a list with too many numbers\n  3 | size = [16, 16, 16]\n    |        ^^^^^^^^^^^^\n  cure: give 2 numbers",
        ),
        (
            "mesh = \"m.obj\"\n[settings]\nphotons = -1\n",
            "3: a value of the wrong kind: integer `-1`\n  3 | photons = -1\n    |           ^^\n  \
             cure: give a whole number, such as 1000 or 1e3 here",
        ),
        (
            "mesh = \"n.obj\"\n",
            "1: n.obj: cannot read this model: there is no such file; like it: m.obj\n  1 | mesh = \"n.obj\"\n    |        ^^^^^^^\n  \
             cure: put it there, or correct its name",
        ),
    ] {
        let folder_free = |text: String| {
            text.split(' ')
                .map(|word| {
                    Path::new(word).file_name().filter(|_| word.starts_with('/')).map_or(word, |name| name.to_str().unwrap())
                })
                .collect::<Vec<_>>()
                .join(" ")
        };
        assert_eq!(folder_free(refused(scene)), message);
    }
    assert!(refused("[settings]\n").contains("it names no model\n  cure: begin it with mesh"), "{}", refused("[settings]\n"));
    // A long line is shown around the fault, and control characters do not reach a terminal.
    let long = refused(&format!("mesh = \"m.obj\"\n# {0}\n[settings]\nname = \"{0}\"\n", "\u{1b}x".repeat(500)));
    assert!(long.lines().all(|line| line.chars().count() < 200), "{long}");
}
