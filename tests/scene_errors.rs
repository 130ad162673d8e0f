//! Each malformed scene is refused with its file, line, problem and cure, if its files are to be exact. `obj_as_found.rs` tests what is mended.

use std::fs;
use std::path::Path;

use finalgather::error::Error;
use finalgather::scene::{LoadOptions, Loaded, World};

const MTL: &str = "newmtl lamp\nKe 5 5 5\n";
const TRIANGLE: &str = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl lamp\nf 1 2 3\n";

/// A place such as `m.obj:7`, without a number where the whole file is meant.
fn place(error: &Error) -> String {
    let Error::Input { path, line, .. } = error else { panic!("not an input error: {error:?}") };
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    line.map_or(name.to_string(), |line| format!("{name}:{line}"))
}

fn load_strictly(path: &Path) -> Result<Loaded, Error> {
    World::load_with(path, LoadOptions { strict: true, ..LoadOptions::default() })
}

/// Loads `entry` from a folder that holds a sound m.obj and m.mtl beside, or replaced by, the given file.
fn check(entry: &str, name: &str, contents: &[u8], expected_place: &str, fragment: &str) {
    let folder = tempfile::tempdir().unwrap();
    for (name, contents) in [("m.obj", TRIANGLE.as_bytes()), ("m.mtl", MTL.as_bytes()), (name, contents)] {
        fs::write(folder.path().join(name), contents).unwrap();
    }
    let shown = String::from_utf8_lossy(&contents[..contents.len().min(200)]);
    let Err(error) = load_strictly(&folder.path().join(entry)) else { panic!("loaded: {shown}") };
    assert_eq!(place(&error), expected_place, "{shown}\n{error}");
    let message = error.to_string();
    assert!(message.contains(fragment), "{shown}\nhas no \"{fragment}\": {message}");
    let (_, cure) = message.split_once("\n  cure: ").unwrap();
    assert!(cure.len() > 10, "{message}");
}

#[test]
fn models() {
    let whole_files: [(&[u8], &str, &str); 7] = [
        (b"", "m.obj", "not a Wavefront OBJ"),
        (b"solid cube\nfacet normal 0 0 1\n", "m.obj", "not a Wavefront OBJ"),
        (b"v 0 0 0\0\x01", "m.obj", "binary"),
        (b"v 0 0 0\nv 1 0 0\nl 1 2\n", "m.obj", "no face"),
        (b"v 0 0 0\nv 1 1 1\nv 2 2 2\nf 1 2 3\nf 1 1 1\n", "m.obj", "none of the 2 triangles has an area"),
        (b"v 0 0 0\nv 1e-30 0 0\nv 0 1e-30 0\nf 1 2 3", "m.obj", "none of the 1 triangles has an area"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "m.obj", "no light"),
    ];
    for (contents, place, fragment) in whole_files {
        check("m.obj", "m.obj", contents, place, fragment);
    }
    // Appended to a sound model of six lines.
    for (statements, place, fragment) in [
        ("v 0 nan 0", "m.obj:7", "NaN"),
        ("v 0 0 -inf", "m.obj:7", "-inf"),
        ("v 1e39 0 0", "m.obj:7", "inf"),
        ("v 0 2e9 0", "m.obj:7", "farther than"),
        ("v 0 0", "m.obj:7", "v has 2 of 3 numbers"),
        ("v 0 0 # 0", "m.obj:7", "v has 2 of 3 numbers"),
        ("# comment\nv 0 0 zero", "m.obj:8", "\"zero\""),
        ("vt", "m.obj:7", "vt has 0 of 1 numbers"),
        ("vt nan", "m.obj:7", "NaN"),
        ("vt 0 inf", "m.obj:7", "vt has the value inf"),
        ("vn 0 1", "m.obj:7", "vn has 2 of 3 numbers"),
        ("vn 0 1 x", "m.obj:7", "\"x\""),
        ("f 0 1 2", "m.obj:7", "index 0"),
        ("f 1 2 4\nf 1 2 3", "m.obj:7", "refers to v 4, but the file has 3"),
        ("f 1 2 3/1", "m.obj:7", "refers to vt 1, but the file has 0"),
        ("vn 0 0 1\nf 1//1 2//2 3//1", "m.obj:8", "refers to vn 2, but the file has 1"),
        ("f 1 2 -4", "m.obj:7", "4 v back"),
        ("f 1 2 -9223372036854775808", "m.obj:7", "v back"),
        ("f 1/-1 2 3", "m.obj:7", "1 vt back"),
        ("f 1 2 99999999999999999999", "m.obj:7", "not a face corner"),
        ("f 1 2 9223372036854775807", "m.obj:7", "refers to v 9223372036854775807"),
        ("f 1 2 3.0", "m.obj:7", "\"3.0\" is not a face corner"),
        ("f 1 2 3/1/1/1", "m.obj:7", "not a face corner"),
        ("f 1 2 /1", "m.obj:7", "not a face corner"),
        ("f 1 2", "m.obj:7", "a face with 2 corners"),
        ("f", "m.obj:7", "a face with 0 corners"),
        (
            "\nusemtl gold",
            "m.obj:8",
            "defines material \"gold\"\n  cure: define it in a file that mtllib names, or use a defined one: lamp",
        ),
        ("usemtl", "m.obj:7", "usemtl without a name"),
        ("mtllib other.mtl", "m.obj:7", "other.mtl"),
        ("mtllib m.mtl other.mtl", "m.obj:7", "other.mtl"),
    ] {
        check("m.obj", "m.obj", format!("{TRIANGLE}{statements}\n").as_bytes(), place, fragment);
    }
}

#[test]
fn material_libraries() {
    // Appended to a sound library of two lines.
    for (statements, place, fragment) in [
        ("Kd 0.5 1.01 0.5", "m.mtl:3", "Kd has the value 1.01"),
        ("Kd -0.1 0 0", "m.mtl:3", "-0.1"),
        ("Kd nan 0 0", "m.mtl:3", "nan"),
        ("Kd 0.5 0.5", "m.mtl:3", "Kd has 2 numbers"),
        ("Kd", "m.mtl:3", "Kd has 0 numbers"),
        ("Kd spectral red.rfl 1", "m.mtl:3", "spectral"),
        ("Ke -1 0 0", "m.mtl:3", "Ke has the value -1"),
        ("Ke 0 inf 0", "m.mtl:3", "inf"),
        ("Ke 0 1e39 0", "m.mtl:3", "1e39"),
        ("newmtl", "m.mtl:3", "newmtl without a name"),
        ("map_Kd", "m.mtl:3", "map_Kd without a file"),
        ("map_Kd -clamp on", "m.mtl:3", "map_Kd without a file"),
        ("\nmap_Kd none.png", "none.png", "m.mtl:4"),
        ("map_Kd m.obj", "m.obj", "m.mtl:3, cannot be decoded"),
    ] {
        check("m.obj", "m.mtl", format!("{MTL}{statements}\n").as_bytes(), place, fragment);
    }
    check("m.obj", "m.mtl", b"# none\nKd 1 1 1\n", "m.mtl:2", "Kd before the first newmtl");
    check("m.obj", "m.mtl", b"", "m.obj:5", "(there are none)");
}

#[test]
fn textures() {
    let load = |name: &str, contents: &[u8], fragment: &str| {
        let toml = format!("mesh = 'm.obj'\nmaterials.lamp.albedo_texture = '{name}'\n");
        let folder = tempfile::tempdir().unwrap();
        for (name, contents) in
            [("m.obj", TRIANGLE.as_bytes()), ("m.mtl", MTL.as_bytes()), ("s.toml", toml.as_bytes()), (name, contents)]
        {
            fs::write(folder.path().join(name), contents).unwrap();
        }
        let error = World::load(&folder.path().join("s.toml")).unwrap_err();
        assert_eq!(place(&error), name);
        let message = error.to_string();
        assert!(message.contains(fragment) && message.contains("s.toml:2"), "{message}");
    };
    let mut png = Vec::new();
    image::GrayImage::new(16385, 1).write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png).unwrap();
    load("wide.png", &png, "is too large");
    load("cut.png", &png[..20], "cannot be decoded");
    // A BMP header that promises 16384 x 16384 texels of 4 bytes, and nothing behind it.
    let mut bmp = b"BM".to_vec();
    for value in [54_u32, 0, 54, 40, 16384, 16384, 1 | 32 << 16, 0, 0, 0, 0, 0, 0] {
        bmp.extend(value.to_le_bytes());
    }
    load("bomb.bmp", &bmp, "this texture, named at");
}

#[test]
fn scene_files() {
    let camera = |fields: &str| format!("mesh = 'm.obj'\n\n[camera]\n{fields}\n");
    let owned = [
        (camera("eye = [0, 0, 1]\ntarget = [0, 0, 1]"), "s.toml:3", "eye and target are both"),
        (camera("eye = [0, 0, nan]\ntarget = [0, 0, 1]"), "s.toml:3", "camera eye is"),
        (camera("eye = [0, 0, 0]\ntarget = [0, 1e40, 1]"), "s.toml:3", "camera target is"),
        (camera("eye = [0, 5, 0]\ntarget = [0, 0, 0]"), "s.toml:3", "parallel"),
        (camera("eye = [0, 5, 0]\ntarget = [0, 0, 0]\nup = [0, 0, 0]"), "s.toml:3", "up is zero"),
        (camera("eye = [0, 0, 5]\ntarget = [0, 0, 0]\nfov_y_degrees = 0"), "s.toml:3", "fov_y_degrees is 0"),
        (camera("eye = [0, 0, 5]\ntarget = [0, 0, 0]\nfov_y_degrees = 180"), "s.toml:3", "fov_y_degrees is 180"),
        (camera("eye = [0, 0, 5]\ntarget = [0, 0, 0]\nfov_y_degrees = nan"), "s.toml:3", "fov_y_degrees is NaN"),
        (camera("eye = [0, 0, 5]\ntarget = [0, 0, 0]\naperture = -1"), "s.toml:3", "aperture is -1"),
        (camera("eye = [0, 0, 5]\ntarget = [0, 0, 0]\naperture = nan"), "s.toml:3", "aperture is NaN"),
        (camera("eye = [0, 0, 5]\ntarget = [0, 0, 0]\naperture = 1\nfocus_distance = 0"), "s.toml:3", "focus_distance is 0"),
        (camera("eye = [0, 0, 5]"), "s.toml:3", "target"),
        (camera("eye = [0, 0]\ntarget = [0, 0, 1]"), "s.toml:4", "length"),
        (camera("eye = [0, 0, 1]\ntarget = [0, 0, 0]\nroll = 3"), "s.toml:6", "roll"),
    ];
    for (toml, place, fragment) in &owned {
        check("s.toml", "s.toml", toml.as_bytes(), place, fragment);
    }
    let cases: [(&[u8], &str, &str); 35] = [
        (b"", "s.toml:1", "mesh"),
        (b"mesh = \n", "s.toml:1", ""),
        ("mesh = 'm.obj'\n# \u{e9}\u{1f4a1}\n\u{e9} = 1".as_bytes(), "s.toml:3", ""),
        (b"mesh = 'm.obj'\nmash = 1", "s.toml:2", "mash"),
        (b"mesh = 'none.obj'\n", "s.toml:1", "none.obj: cannot read this model: there is no such file"),
        (b"mesh = '\xff'", "s.toml", "UTF-8"),
        (b"mesh = 'm.obj'\n[settings]\nphotons = 'many'", "s.toml:3", "many"),
        (b"mesh = 'm.obj'\n[settings]\nwrong = 1", "s.toml:3", "wrong"),
        (b"mesh = 'm.obj'\n[settings]\nseed = 1\ndirections = 0", "s.toml:4", "directions is 0"),
        (b"mesh = 'm.obj'\n[settings]\nseed = 1\ntarget_error = 2", "s.toml:4", "target-error is 2"),
        (b"mesh = 'm.obj'\n[settings]\nseed = 1\nuntil = 2", "s.toml:4", "target-error is 2"),
        (b"mesh = 'm.obj'\n[settings]\nphoton_depth = 1\nbounces = 1", "s.toml:2", "duplicate field `photon_depth`"),
        (b"mesh = 'm.obj'\n[settings]\nlayer_size = 64\nlayer-size = 96", "s.toml:4", "\"layer-size\" stands here twice"),
        (b"mesh = 'm.obj'\n[settings]\nlayer_size = 0", "s.toml:3", "layer-size is 0"),
        (b"mesh = 'm.obj'\n[settings]\ninterleave = 3", "s.toml:3", "interleave is 3"),
        (b"mesh = 'm.obj'\n[settings]\ninterleave = 'fine'", "s.toml:3", "is no square: give 1, 2 or 4 pixels, or \"auto\""),
        (b"mesh = 'm.obj'\n[settings]\nsize = [512, 0]", "s.toml:3", "size (height) is 0"),
        (b"mesh = 'm.obj'\n[settings]\nstop_fraction = nan", "s.toml:3", "stop-fraction is NaN"),
        (
            b"mesh = 'm.obj'\n\n[materials.lump]\nalbedo = [0, 0, 0]",
            "s.toml:3",
            "no material \"lump\"\n  3 | [materials.lump]\n    |            ^^^^\n  cure: name one that it has: lamp",
        ),
        (b"mesh = 'm.obj'\n[materials.lamp]\nalbedo = [0, 1.5, 0]", "s.toml:3", "albedo is"),
        (b"mesh = 'm.obj'\n[materials.lamp]\nemission = [0, -1, inf]", "s.toml:3", "emission is"),
        (b"mesh = 'm.obj'\n[materials.lamp]\nemission = [0, 0, 0]", "s.toml", "no light"),
        (b"mesh = 'm.obj'\nmaterials.lamp.emission = [0, 0, 0]\nenvironment.radiance = [0, 0, 0]", "s.toml", "no light"),
        (b"mesh = 'm.obj'\n\n[environment]\nscale = 1", "s.toml:3", "a file or a radiance"),
        (b"mesh = 'm.obj'\n\n[environment]\nfile = 'a.hdr'\nradiance = [1, 1, 1]", "s.toml:3", "a file or a radiance"),
        (b"mesh = 'm.obj'\n[environment]\nradiance = [1, -1, 1]", "s.toml:3", "radiance is [1, -1, 1]"),
        (b"mesh = 'm.obj'\n[environment]\nradiance = [1, 1, 1]\nscale = -1", "s.toml:4", "scale is -1"),
        (b"mesh = 'm.obj'\n[environment]\nradiance = [1, 1, 1]\nscale = inf", "s.toml:4", "scale is inf"),
        (b"mesh = 'm.obj'\n[environment]\nradiance = [1, 1, 1]\nturn_degrees = nan", "s.toml:4", "turn_degrees is NaN"),
        (b"mesh = 'm.obj'\n[environment]\nfile = 'm.obj'", "m.obj", "the ending names no kind of environment"),
        (b"mesh = 'm.obj'\n[environment]\nfile = 'none.hdr'", "none.hdr", "cannot read this environment"),
        (b"mesh = 'm.obj'\n[environment]\nradience = [1, 1, 1]", "s.toml:3", "radience"),
        (b"mesh = 'm.obj'\n[materials.lamp]\nsurface = 'wood'", "s.toml:3", "wood"),
        (b"mesh = 'm.obj'\n[materials.lamp]\nsurface = { glass = { index = 0.5 } }", "s.toml:3", "index of refraction is 0.5"),
        (b"mesh = 'm.obj'\n[materials.lamp]\nsurface.glass.filter = [1, 2, 1]", "s.toml:3", "filter is"),
    ];
    for (toml, place, fragment) in cases {
        check("s.toml", "s.toml", toml, place, fragment);
    }
    check("none.toml", "other", b"", "none.toml", "there is no such file");
    check("none.obj", "other", b"", "none.obj", "there is no such file");
    check("m.xyz", "other", b"", "m.xyz", "scene file (.toml) or a model (.obj");
}

/// Whatever bytes change, loading ends in a scene or an error.
#[test]
fn damaged_files_never_panic() {
    let folder = tempfile::tempdir().unwrap();
    let names = ["cornell_textured.toml", "cornell_textured.obj", "cornell_textured.mtl", "tiles.png"];
    let originals = names.map(|name| fs::read(format!("scenes/{name}")).unwrap());
    for (name, original) in names.iter().zip(&originals) {
        fs::write(folder.path().join(name), original).unwrap();
    }
    let (mut state, mut refused) = (1_u64, 0);
    let mut random = |below: usize| {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 33) as usize % below
    };
    for round in 0..400 {
        let which = round % names.len();
        let mut damaged = originals[which].clone();
        for _ in 0..1 + random(4) {
            let at = random(damaged.len());
            match random(3) {
                0 => damaged[at] = b"0-/\n .e9#\xff\0"[random(11)],
                1 => damaged.truncate(at + 1),
                _ => drop(damaged.drain(at..(at + random(9)).min(damaged.len() - 1).max(at))),
            }
        }
        fs::write(folder.path().join(names[which]), &damaged).unwrap();
        if let Err(error) = World::load(&folder.path().join(names[0])) {
            place(&error);
        }
        if let Err(error) = load_strictly(&folder.path().join(names[0])) {
            place(&error);
            refused += 1;
        }
        fs::write(folder.path().join(names[which]), &originals[which]).unwrap();
    }
    assert!((100..400).contains(&refused), "{refused} of 400 damaged files are refused");
}
