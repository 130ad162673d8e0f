//! MTL files and pictures as people have them: each opens with the right colours, and one warning names what was mended.

#[path = "common/found.rs"]
mod found;

use std::fs;

use finalgather::scene::WrapMode::{Clamp, Repeat};
use finalgather::scene::{Files, Gloss, LoadOptions, Loaded, World};
use found::{CORNERS, GREY, PICTURE, QUAD, RED, WALL, check, check_files, encoded, open, picture};
use glam::{Vec3, vec3};

#[test]
fn names_of_materials() {
    for (newmtl, usemtl, warning) in [
        ("wall", "wall # the wall", "m.obj:10: \"wall\" is used"),
        ("wall", "\"wall\"", "m.obj:10: \"wall\" is used"),
        ("wall", "'wall' # the wall", "m.obj:10: \"wall\" is used"),
        ("wall # the wall", "wall", "m.obj:10: \"wall # the wall\" is used"),
        ("\"wall\"", "wall", "m.obj:10: is used"),
        ("Wall", "wALL", "m.obj:10: \"Wall\" is used"),
        ("wall #1", "wall #1", ""),
        ("#1", "#1", ""),
        ("my wall", "my wall", ""),
        ("wall", "wall\t ", ""),
        ("", "wall", "m.mtl:1: newmtl without a name"),
    ] {
        let albedo = if newmtl.is_empty() { GREY } else { RED };
        let mtl = format!("newmtl {newmtl}\nKd 0.8 0.2 0.2\n");
        if newmtl.is_empty() {
            let warnings = open(&[("m.obj", QUAD.as_bytes()), ("m.mtl", mtl.as_bytes())]).report.warnings;
            assert!(
                warnings[0].contains("newmtl without a name") && warnings[1].contains("defines material \"wall\""),
                "{warnings:?}"
            );
            continue;
        }
        check(&QUAD.replace("usemtl wall", &format!("usemtl {usemtl}")), &mtl, albedo, 2, warning);
    }
    // Names without definition are counted.
    let obj = format!("{QUAD}usemtl b\nf 1 2 3\nusemtl c\nf 1 2 4\n");
    check(&obj, WALL, RED, 4, "m.obj:12: defines material \"b\"; it is the default material, grey (and 1 more like it)");
}

#[test]
fn textures_that_are_elsewhere() {
    let both = |statement: &str| format!("{WALL}map_Kd {statement}\n");
    let tinted = RED * PICTURE;
    for (statement, albedo, warning) in [
        ("red.png", tinted, ""),
        ("tex\\deep.png", tinted, ""),
        ("", RED, "m.mtl:3: map_Kd without a file"),
        ("-s 2 2 2", RED, "m.mtl:3: map_Kd without a file"),
        ("gone.png", RED, "m.mtl:3: cannot read this texture"),
        ("m.obj", RED, "m.mtl:3: cannot be decoded"),
        ("tex", RED, "m.mtl:3: cannot read this texture"),
        ("C:\\Users\\someone\\Desktop\\red.png", tinted, "m.mtl:3: red.png is used"),
        ("/home/someone/red.png", tinted, "m.mtl:3: red.png is used"),
        ("..\\..\\textures\\deep.png", tinted, "m.mtl:3: tex/deep.png is used"),
        ("Red.PNG", tinted, "m.mtl:3: red.png is used"),
        ("TEX/Deep.png", tinted, "m.mtl:3: tex/deep.png is used"),
        ("deep.png", tinted, "m.mtl:3: tex/deep.png is used"),
        ("\"red.png\"", tinted, "m.mtl:3: red.png is used"),
        ("C:\\tex\\my\\ red.png", RED, "m.mtl:3: cannot read this texture"),
        ("red.png # the wall", tinted, "m.mtl:3: red.png is used"),
        ("\"C:\\my pictures\\RED.png\" # the wall", tinted, "m.mtl:3: red.png is used"),
        ("-clamp on -bm 0.5 red.png", tinted, ""),
        ("red.png -bm 1", tinted, "m.mtl:3: red.png is used"),
        ("-mm 0 2 red.png", tinted, "m.mtl:3: option -mm of map_Kd is ignored"),
    ] {
        let mtl = both(statement);
        let red = picture();
        let files: [(&str, &[u8]); 4] =
            [("m.obj", QUAD.as_bytes()), ("m.mtl", mtl.as_bytes()), ("red.png", &red), ("tex/deep.png", &red)];
        check_files(&files, albedo, 2, warning);
    }
    // Without Kd, a picture shows its own colours, and a missing one leaves grey.
    let red = picture();
    for (name, albedo, warning) in [("red.png", PICTURE, ""), ("gone.png", GREY, "m.mtl:2: cannot read this texture")] {
        let mtl = format!("newmtl wall\nmap_Kd {name}\n");
        check_files(&[("m.obj", QUAD.as_bytes()), ("m.mtl", mtl.as_bytes()), ("red.png", &red)], albedo, 2, warning);
    }
    // Files in memory are found alike.
    let mtl = b"newmtl wall\nmap_Kd C:\\textures\\Red.PNG\n".to_vec();
    let files =
        [("m.obj", QUAD.as_bytes().to_vec()), ("m.mtl", mtl), ("a/b/red.png", picture()), ("a/b/c/red.png", b"?".to_vec())];
    let files = Files::Memory(files.map(|(name, bytes)| (name.into(), bytes)).into());
    let loaded = World::load_with("m.obj".as_ref(), LoadOptions { files, unlit: true, ..LoadOptions::default() }).unwrap();
    assert!(
        loaded.world.textures.len() == 1 && loaded.report.warnings[0].ends_with("a/b/red.png is used"),
        "{:?}",
        loaded.report.warnings
    );
    // A file outside the folder is not read, even where a file of its name could be found there.
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("scene")).unwrap();
    fs::write(folder.path().join("out.png"), picture()).unwrap();
    for (name, text) in [("m.obj", QUAD), ("m.mtl", "newmtl wall\nKd 0.8 0.2 0.2\nmap_Kd ../out.png\n")] {
        fs::write(folder.path().join("scene").join(name), text).unwrap();
    }
    let options = || LoadOptions { unlit: true, ..LoadOptions::default() };
    let loaded = World::load_with(&folder.path().join("scene/m.obj"), options()).unwrap();
    assert!(loaded.world.textures.is_empty() && loaded.report.files.len() == 2, "{:?}", loaded.report.files);
    assert!(loaded.report.warnings[0].contains("outside the scene's folder"), "{:?}", loaded.report.warnings);
}

#[test]
fn textures_lie_as_their_options_say() {
    // One texel in 16 is white: the one from u = 0.25 and v = 0.5.
    let mut texels = image::GrayImage::new(4, 4);
    texels.put_pixel(1, 1, image::Luma([255]));
    let map = encoded(texels.into());
    // The coordinate on the picture is that of the model times -s plus -o. So the white texel's middle lies at (uv - offset) / scale.
    for (options, uv) in [
        ("", [0.375, 0.625]),
        ("-o 0.25 0 0", [0.125, 0.625]),
        ("-s 0.5 1 1 -o 0 -0.25", [0.75, 0.875]),
        ("-o 0.25", [0.125, 0.625]),
    ] {
        let mtl = format!("newmtl wall\nmap_Kd {options} map.png\n");
        let world = open(&[("m.obj", QUAD.as_bytes()), ("m.mtl", mtl.as_bytes()), ("map.png", &map)]).world;
        let [u, v] = uv;
        // The second triangle has the corners (0, 0), (1, 1) and (0, 1) of the square.
        let scene = world.flatten();
        let at = if v > u { scene.albedo(1, vec3(1.0 - v, u, v - u)) } else { scene.albedo(0, vec3(1.0 - u, u - v, v)) };
        assert_eq!(at, Vec3::ONE, "{options}");
    }
    let mtl = "newmtl wall\nmap_Kd -s 2 3 1 -o 0.25 0.5 0 -clamp on map.png\nnewmtl other\nmap_Kd map.png\n";
    let obj = format!("{QUAD}usemtl other\nf 1 2/2 3/3\n");
    let world = open(&[("m.obj", obj.as_bytes()), ("m.mtl", mtl.as_bytes()), ("map.png", &map)]).world;
    assert_eq!(world.meshes[0].uvs[2].to_array(), [2.25, 3.5]);
    // A corner without vt stays at zero, whatever the options.
    assert_eq!(world.meshes[0].uvs[4].to_array(), [0.0, 0.0]);
    assert_eq!(world.textures.iter().map(|texture| texture.sampler.wrap).collect::<Vec<_>>(), [[Clamp; 2], [Repeat; 2]]);
}

#[test]
fn colours_outside_their_range() {
    for (kd, albedo, warning) in [
        ("1.000001 1 1", Vec3::ONE, "Kd has the value 1.000001; it is clamped"),
        ("1.5 0.5 0.5", vec3(1.0, 0.5, 0.5), "Kd has the value 1.5; it is clamped"),
        ("2 2 2", Vec3::ONE, "it is clamped"),
        ("-0.1 0.5 0.5", vec3(0.0, 0.5, 0.5), "Kd has the value -0.1; it is clamped"),
        ("204 51 51", RED, "Kd has the value 204; it is divided by 255"),
        ("51.0 0 255", vec3(0.2, 0.0, 1.0), "it is divided by 255"),
        ("3 0 0", vec3(3.0 / 255.0, 0.0, 0.0), "it is divided by 255"),
        ("300 0 0", vec3(1.0, 0.0, 0.0), "it is clamped"),
        ("nan nan nan", GREY, "Kd has the value nan; it is left out"),
        ("0.5 0.5", GREY, "Kd has 2 numbers; it is left out"),
        ("spectral red.rfl 1", GREY, "Kd has the value spectral; it is left out"),
    ] {
        check(QUAD, &format!("newmtl wall\nKd {kd}\n"), albedo, 2, &format!("m.mtl:2: {warning}"));
    }
    check(QUAD, &format!("Kd 1 1 1\n{WALL}"), RED, 2, "m.mtl:1: Kd before the first newmtl; it is left out");
    check(QUAD, &format!("{WALL}Ke -1 0 0\n"), RED, 2, "m.mtl:3: Ke has the value -1; it is clamped to 0");
    check(QUAD, &format!("{WALL}Ke nan 0 0\n"), RED, 2, "m.mtl:3: Ke has the value nan; it is left out");
}

#[test]
fn what_is_not_shaded_yet_is_told() {
    let note = "highlight (Ks 0.5 0.5 0.5, Ns 250)";
    let mtl = "newmtl wall\nKd 1 1 1\nKs 0.5 0.5 0.5\nNs 250\nillum 2\n";
    let Loaded { world, report, .. } = open(&[("m.obj", QUAD.as_bytes()), ("m.mtl", mtl.as_bytes())]);
    assert_eq!(report.warnings, [format!("1 material has what pictures do not show yet: wall ({note})")]);
    assert_eq!(world.materials[0].unshaded.join(", "), note);
    for statements in ["d 1", "Tr 0", "Ks 0 0 0\nNs 10", "Ks 1 1 1\nillum 1", "Pm 0", "d 0.1\nillum 4"] {
        check(QUAD, &format!("{WALL}{statements}\n"), RED, 2, "");
    }
    let mtl = (0..9).map(|index| format!("newmtl m{index}\nKs 1 1 1\nillum 2\n")).collect::<String>();
    let obj = (0..9).map(|index| format!("usemtl m{index}\nf 1 2 3\n")).collect::<String>();
    let loaded = open(&[("m.obj", format!("mtllib m.mtl\n{CORNERS}{obj}").as_bytes()), ("m.mtl", mtl.as_bytes())]);
    assert!(loaded.report.warnings[0].starts_with("9 materials have") && loaded.report.warnings[0].ends_with("and 4 more"));
}

/// A picture of these texels, row by row.
fn texels(width: u32, texels: &[[u8; 3]]) -> Vec<u8> {
    let bytes = texels.as_flattened().to_vec();
    encoded(image::RgbImage::from_raw(width, texels.len() as u32 / width, bytes).unwrap().into())
}

fn open_glossy(statements: &str) -> Loaded {
    let (rough, metal) = (texels(2, &[[51, 0, 0], [255, 0, 0]]), texels(1, &[[102, 9, 9]]));
    let (blue, grey) = (texels(1, &[[128, 128, 255]]), texels(4, &[[0; 3], [64; 3], [128; 3], [64; 3]]));
    let mtl = format!("newmtl wall\nKd 1 1 1\n{statements}\n");
    let files =
        [("r.png", &rough), ("p.png", &metal), ("blue.png", &blue), ("grey.png", &grey)].map(|(name, bytes)| (name, &bytes[..]));
    open(&[&[("m.obj", QUAD.as_bytes()), ("m.mtl", mtl.as_bytes())], &files[..]].concat())
}

#[test]
fn gloss_is_that_of_the_pbr_extension() {
    let gloss = |statements: &str| {
        let Loaded { world, report, .. } = open_glossy(statements);
        assert_eq!(report.warnings, [""; 0], "{statements}");
        let texels = |gloss: Gloss| gloss.texture.map(|texture| world.textures[texture].texels.clone());
        world.materials[0].gloss.map(|gloss| (gloss.roughness, gloss.metallic, texels(gloss)))
    };
    assert_eq!(gloss("Pr 0.2\nPm 1"), Some((0.2, 1.0, None)));
    assert_eq!(gloss("Pr 0.2"), Some((0.2, 0.0, None)));
    assert_eq!(gloss("Pm 0.5"), Some((1.0, 0.5, None)));
    for none in ["", "Pm 0", "Ks 1 1 1\nNs 250\nillum 1", "Pr 0.2\nillum 3"] {
        assert_eq!(gloss(none), None, "{none}");
    }
    assert_eq!(gloss("map_Pr r.png"), Some((1.0, 0.0, Some(vec![[255, 51, 255, 255], [255, 255, 255, 255]]))));
    let both = vec![[255, 51, 102, 255], [255, 255, 102, 255]];
    assert_eq!(gloss("map_Pr r.png\nmap_Pm p.png\nPr 0.5"), Some((0.5, 1.0, Some(both))));
    // A mirror that is not sharp. cos^n of n = 126 has α = 1/8.
    let (roughness, metallic, _) = gloss("illum 3\nKs 0.9 0.9 0.9\nNs 126").unwrap();
    assert!((roughness * roughness - 0.125).abs() < 1e-6 && metallic == 1.0, "{roughness}");
    assert_eq!(open_glossy("illum 3\nKs 0.9 0.8 0.7\nNs 126").world.materials[0].albedo, vec3(0.9, 0.8, 0.7));
}

#[test]
fn normals_come_from_normal_maps_and_from_heights() {
    let map = |statements: &str| {
        let Loaded { world, report, .. } = open_glossy(statements);
        let map = world.materials[0].normal_map.unwrap();
        (world.textures[map.texture].texels.clone(), map.scale, report.warnings)
    };
    assert_eq!(map("norm blue.png"), (vec![[128, 128, 255, 255]], 1.0, Vec::new()));
    let (texels, scale, warnings) = map("bump -bm 0.3 blue.png");
    assert_eq!((texels, scale), (vec![[128, 128, 255, 255]], 1.0));
    assert!(warnings[0].contains("blue.png is blue as a normal map"), "{warnings:?}");
    let (texels, scale, warnings) = map("map_bump -bm 0.3 grey.png");
    assert_eq!((scale, warnings.len()), (0.3, 0));
    // Heights rise, level out, fall: normals lean against u, stand, lean along it.
    let slope = 0.5 * 0.01 * 4.0 * 128.0 / 255.0_f32;
    let lean = (127.5 * (1.0 - slope / slope.hypot(1.0))).round() as u8;
    assert_eq!([texels[0][0], texels[1][0], texels[2][0], texels[3][0]], [128, lean, 128, 255 - lean]);
    assert!(texels.iter().all(|texel| texel[1] == 128), "{texels:?}");
    let unread = open_glossy("bump gone.png");
    assert!(unread.world.materials[0].normal_map.is_none() && unread.report.warnings[0].contains("gone.png"));
}

#[test]
fn lamps_with_pictures() {
    let mut texels = image::RgbImage::new(2, 1);
    texels.put_pixel(0, 0, image::Rgb([255, 255, 0]));
    let half = encoded(texels.into());
    let black = encoded(image::RgbImage::new(2, 1).into());
    let other = "m.mtl:5: map_Ke has other -s or -o than map_Kd: its mean colour shines";
    for (statements, emission, texture, fragment) in [
        ("Ke 4 2 1\nmap_Ke half.png", vec3(4.0, 2.0, 1.0), Some(0), ""),
        ("map_Ke half.png", Vec3::ONE, Some(0), ""),
        ("map_Ke -s 2 2 half.png", Vec3::ONE, Some(0), ""),
        ("Ke 0 0 0\nmap_Ke half.png", Vec3::ZERO, None, "m.mtl:4: map_Ke has no effect"),
        ("map_Ke black.png", Vec3::ZERO, None, "m.mtl:3: map_Ke has no effect"),
        ("Ke 4 2 1\nmap_Ke gone.png", vec3(4.0, 2.0, 1.0), None, "m.mtl:4: cannot read this texture"),
        ("map_Kd half.png\nKe 4 2 1\nmap_Ke half.png", vec3(4.0, 2.0, 1.0), Some(0), ""),
        ("map_Kd half.png\nKe 4 2 1\nmap_Ke -s 2 2 half.png", vec3(2.0, 1.0, 0.0), None, other),
    ] {
        let mtl = format!("{WALL}{statements}\n");
        let files: [(&str, &[u8]); 4] =
            [("m.obj", QUAD.as_bytes()), ("m.mtl", mtl.as_bytes()), ("half.png", &half), ("black.png", &black)];
        let loaded = open(&files);
        let material = &loaded.world.materials[0];
        assert_eq!((material.emission, material.emission_texture), (emission, texture), "{statements}");
        assert_eq!(material.unshaded.iter().any(|note| note.contains("emission map")), texture.is_none(), "{statements}");
        let warnings = loaded.report.warnings.join("\n");
        match fragment.split_once(' ') {
            None => assert!(warnings.is_empty(), "{statements}: {warnings}"),
            Some((place, told)) => assert!(warnings.contains(place) && warnings.contains(told), "{statements}: {warnings}"),
        }
    }
    // Where it is doubled, so are its coordinates.
    let doubled =
        open(&[("m.obj", QUAD.as_bytes()), ("m.mtl", format!("{WALL}map_Ke -s 2 2 half.png\n").as_bytes()), ("half.png", &half)]);
    let once = open(&[("m.obj", QUAD.as_bytes()), ("m.mtl", format!("{WALL}map_Ke half.png\n").as_bytes()), ("half.png", &half)]);
    let uvs = |loaded: &Loaded| loaded.world.meshes[0].uvs.clone();
    assert!(uvs(&doubled).iter().zip(uvs(&once)).all(|(doubled, once)| *doubled == 2.0 * once));
}
