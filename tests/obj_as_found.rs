//! OBJ files as people have them: each opens as meant, and one warning names what was mended.

#[path = "common/found.rs"]
mod found;

use finalgather::error::Error;
use finalgather::scene::{Loaded, World};
use found::{CORNERS, GREY, PICTURE, QUAD, RED, WALL, check, check_files, load, open, picture};
use glam::{Vec3, vec3};

#[test]
fn continued_lines() {
    for face in ["f 1 2 \\\n 3 4\n", "f 1 2 3 \\  \r\n4\n", "f \\\n1 \\\n2 \\\n3 \\\n4", "f 1 2 3 4 \\\n"] {
        check(&format!("mtllib \\\nm.mtl\n{CORNERS}usemtl wall\n{face}"), "newmtl wall\nKd 0.8 \\\n 0.2 0.2\n", RED, 2, "");
    }
    // A comment does not go on.
    check(&format!("# C:\\models\\\nmtllib m.mtl\n{CORNERS}usemtl wall\nf 1 2 3 4"), WALL, RED, 2, "");
    // Lines keep their numbers.
    check(&format!("{QUAD}f 1 \\\n2 \\\n3\nf 1 2\n"), WALL, RED, 3, "m.obj:15: a face with 2 corners");
}

#[test]
fn libraries_that_are_missing() {
    let quad = |top: &str, material: &str| format!("{top}\n{CORNERS}{material}\nf 1 2 3 4\n");
    for (obj, albedo, warning) in [
        (quad("mtllib gone.mtl", "usemtl wall"), GREY, "m.obj:1: cannot read material library"),
        (quad("mtllib", "usemtl wall"), GREY, "m.obj:1: mtllib without a name"),
        (quad("", "usemtl wall"), GREY, "m.obj:6: no material library defines material \"wall\""),
        (quad("mtllib a.mtl", "usemtl other"), GREY, "m.obj:6: no material library defines material \"other\""),
        (quad("mtllib a.mtl", "usemtl"), GREY, "m.obj:6: usemtl without a name"),
        (quad("mtllib gone.mtl a.mtl", "usemtl wall"), RED, "m.obj:1: gone.mtl"),
        (quad("mtllib a.mtl gone.mtl", "usemtl wall"), RED, "m.obj:1: gone.mtl"),
        (quad("mtllib C:\\work\\my_gone.mtl a.mtl", "usemtl wall"), RED, "m.obj:1: my_gone.mtl"),
        (quad("mtllib gone.mtl\nmtllib a.mtl", "usemtl wall"), RED, "m.obj:1: gone.mtl"),
        (quad("mtllib folder", "usemtl wall"), GREY, "m.obj:1: cannot read material library"),
        // Found by its name alone.
        (quad("mtllib C:\\work\\A.MTL", "usemtl wall"), RED, "m.obj:1: a.mtl is used"),
        (quad("mtllib ../elsewhere/a.mtl", "usemtl wall"), RED, "m.obj:1: outside the scene's folder"),
        (quad("mtllib b.mtl", "usemtl wall"), RED, "m.obj:1: folder/b.mtl is used"),
        (quad("mtllib \"a.mtl\"", "usemtl wall"), RED, "m.obj:1: it is read as a.mtl"),
        (quad("mtllib 'a.mtl' # the library", "usemtl wall"), RED, "m.obj:1: it is read as a.mtl"),
        (quad("mtllib \"my mat.mtl\"", "usemtl blue"), Vec3::Z, "m.obj:1: it is read as my mat.mtl"),
        (quad("mtllib a.mtl my mat.mtl", "usemtl blue"), Vec3::Z, "m.obj:1: it is read as a.mtl and my mat.mtl"),
        (quad("mtllib my mat.mtl a.mtl", "usemtl wall"), RED, "m.obj:1: it is read as my mat.mtl and a.mtl"),
        (quad("mtllib a.mtl my\\ mat.mtl", "usemtl blue"), Vec3::Z, "m.obj:1: it is read as a.mtl and my mat.mtl"),
        (quad("mtllib my mat.mtl", "usemtl blue"), Vec3::Z, ""),
    ] {
        let files = [("a.mtl", WALL), ("my mat.mtl", "newmtl blue\nKd 0 0 1\n"), ("folder/b.mtl", WALL), ("m.obj", obj.as_str())];
        check_files(&files.map(|(name, text)| (name, text.as_bytes())), albedo, 2, warning);
    }
    // The library of the model's own name.
    check(&quad("mtllib gone.mtl", "usemtl wall"), WALL, RED, 2, "m.obj:1: m.mtl is used");
    check(&quad("mtllib", "usemtl wall"), WALL, RED, 2, "m.obj:1: m.mtl is used");
    check(&quad("", "usemtl wall"), WALL, RED, 2, "m.obj:6: m.mtl is used");
    // No library is asked for.
    check(&quad("", ""), WALL, GREY, 2, "");
    // A name without definition can still be changed by a scene file.
    let obj = quad("mtllib gone.mtl", "usemtl wall");
    assert_eq!(open(&[("m.obj", obj.as_bytes())]).world.materials[0].name, "wall");
}

#[test]
fn numbers_that_are_none() {
    let nan = ["nan", "-nan(ind)", "1.#IND", "-1.#IND00", "1.#QNAN", "1.#INF", "inf", "-inf", "1e39", "x"];
    for word in nan {
        let vt = QUAD.replace("vt 1 0", &format!("vt {word} 0"));
        check(&vt, WALL, RED, 2, "m.obj:7: vt has");
        let v = format!("{QUAD}v 5 {word} 5\nf 1 2 5\nf 5 2 3 4\n");
        check(&v, WALL, RED, 2, "m.obj:12: v has");
        let vn = format!("{QUAD}vn 0 {word} 1\nf 1//1 2//1 3//1\n");
        if word != "1e39" {
            check(&vn, WALL, RED, 3, "m.obj:12: vn has");
        }
        let kd = format!("newmtl wall\nKd 0.8 {word} 0.2\n");
        check(QUAD, &kd, GREY, 2, "m.mtl:2: Kd has");
    }
    check(
        &format!("{QUAD}v 1 2\nf 1 2 5\n"),
        WALL,
        RED,
        2,
        "m.obj:12: v has 2 of 3 numbers; the faces that use this v are left out",
    );
    check(&format!("{QUAD}vn 1\nf 1//1 2//1 3//1\n"), WALL, RED, 3, "m.obj:12: vn has 1 of 3 numbers");
    check(&format!("{QUAD}vt # none\n"), WALL, RED, 2, "m.obj:12: vt has 0 of 1 numbers");
    check(&format!("{QUAD}v 2e9 0 0\nf 1 2 5\n"), WALL, RED, 2, "m.obj:12: farther than");
    check(
        &QUAD.replace('1', "1,0").replace("usemtl", "#").replace("f 1,0/1,0", "f 1/1"),
        WALL,
        GREY,
        2,
        "m.obj:2: v has \"-1,0\" for a number",
    );
    check(QUAD, "newmtl wall\nKd 0,8 0,2 0,2\n", RED, 2, "m.mtl:2: Kd has the value 0,8");
    // The bad number changes no numbering.
    let world = open(&[("m.obj", format!("v nan 0 0\n{CORNERS}f 2 3 4 5\n").as_bytes())]).world;
    assert_eq!(world.meshes[0].positions[0], vec3(-1.0, -1.0, 0.0));
    // If nothing is left, the error follows the warnings.
    let Err(Error::Input { warnings, problem, .. }) = load(&[("m.obj", b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")], false) else {
        panic!("loaded")
    };
    assert!(problem.contains("no face"), "{problem}");
    assert!(warnings.len() == 1 && warnings[0].contains("m.obj:1: v has the value NaN"), "{warnings:?}");
}

#[test]
fn faces_that_refer_to_nothing() {
    for (face, triangles, warning) in [
        ("f 1 2", 2, "m.obj:12: a face with 2 corners; the face is left out"),
        ("f 1", 2, "m.obj:12: a face with 1 corner;"),
        ("f", 2, "m.obj:12: a face with 0 corners"),
        ("f 1 2 9", 2, "m.obj:12: face refers to v 9, but the file has 4"),
        ("f 1 2 9\nf 9 2 1\nf 1 2 3\n", 3, "m.obj:12: (and 1 more like it)"),
        ("f 0 1 2", 2, "m.obj:12: index 0"),
        ("f 1 2 -5", 2, "m.obj:12: 5 v back"),
        ("f 1 2 99999999999999999999", 2, "m.obj:12: not a face corner"),
        ("f 1 2 4000000000", 2, "m.obj:12: face refers to v 4000000000"),
        ("f 1 2 three", 2, "m.obj:12: \"three\" is not a face corner"),
        ("f 1 2 3.0", 3, "m.obj:12: taken for whole numbers"),
        ("f 1 2 3/1//1", 3, "m.obj:12: not a face corner"),
        ("f 1/9 2/9 3/9", 3, "m.obj:12: face refers to vt 9"),
        ("f 1/0 2 3", 3, "m.obj:12: index 0 of vt"),
        ("f 1//0 2//0 3//0", 3, "m.obj:12: index 0 of vn"),
        ("f 1/-7 2 3", 3, "m.obj:12: 7 vt back"),
        ("f 1//-1 2 3", 3, "m.obj:12: 1 vn back"),
        ("f 1//1 2//1 3//1", 3, "m.obj:12: face refers to vn 1"),
        ("f 1/x 2 3", 3, "m.obj:12: the corner has no texture coordinate"),
        ("f 1//x 2 3", 3, "m.obj:12: the corner has no normal"),
        ("f 1/ 2/ 3/", 3, ""),
        ("f 1// 2// 3//", 3, ""),
        ("fo 1 2 3", 3, ""),
        ("f 1 2 3 # 4", 3, ""),
        ("l 1 2\np 1", 2, ""),
    ] {
        check(&format!("{QUAD}{face}\n"), WALL, RED, triangles, warning);
    }
    // A texture coordinate or normal alone is dropped, and the corner keeps the rest.
    let (v_vt, zero) = ("vn 0 0 1\nf 1/1 2/2 3/3 4/4\n", "vn 0 0 1\nf 1/0/1 2/0/1 3/0/1 4/0/1\n");
    for (face, normal, warning) in
        [(v_vt, Vec3::ZERO, "face refers to vt 1, but the file has 0"), (zero, Vec3::Z, "index 0 of vt")]
    {
        let obj = format!("mtllib m.mtl\n{CORNERS}usemtl wall\n{face}");
        check(&obj, WALL, RED, 2, &format!("m.obj:8: {warning}"));
        assert_eq!(open(&[("m.obj", obj.as_bytes()), ("m.mtl", WALL.as_bytes())]).world.meshes[0].normals[0], normal);
    }
    let corners = " 1".repeat(5001);
    check(&format!("{QUAD}f{corners}\n"), WALL, RED, 2, "m.obj:12: a face with 5001 corners");
}

#[test]
fn encodings_and_line_ends() {
    let latin = |text: &str| text.chars().map(|character| character as u8).collect::<Vec<u8>>();
    let obj = format!(
        "mtllib m.mtl\n{CORNERS}v 1 -1 0\nv 3 -1 0\nv 3 1 0\nv 1 1 0\nusemtl wand_ä\nf 1 2 3 4\nusemtl wand_ö\nf 5 6 7 8\n"
    );
    let mtl = "newmtl wand_ä\nKd 0.8 0 0\nnewmtl wand_ö\nKd 0 0 0.8\n";
    let [obj_latin, mtl_latin] = [&obj, mtl].map(latin);
    let files: [(&[u8], &[u8], &str); 4] = [
        (&obj_latin, &mtl_latin, "m.obj:10: not UTF-8; it is read as Windows-1252"),
        (obj.as_bytes(), &mtl_latin, "m.mtl:1: not UTF-8"),
        (&obj_latin, mtl.as_bytes(), "m.obj:10: not UTF-8"),
        (obj.as_bytes(), mtl.as_bytes(), ""),
    ];
    for (obj, mtl, warning) in files {
        let files = [("m.obj", obj), ("m.mtl", mtl)];
        check_files(&files, vec3(0.8, 0.0, 0.0), 4, warning);
        let world = open(&files).world;
        assert_eq!(world.flatten().albedo(2, Vec3::X), vec3(0.0, 0.0, 0.8));
        assert_eq!(world.materials[1].name, "wand_ö");
    }
    // A comment in another encoding is nobody's business.
    check_files(&[("m.obj", &[b"# \xE9\n", QUAD.as_bytes()].concat()), ("m.mtl", WALL.as_bytes())], RED, 2, "");

    let wide = |text: &str, mark: &str, big: bool| -> Vec<u8> {
        let units = mark.encode_utf16().chain(text.encode_utf16());
        units.flat_map(|unit| if big { unit.to_be_bytes() } else { unit.to_le_bytes() }).collect()
    };
    for (mark, big) in [("\u{feff}", false), ("\u{feff}", true), ("", false), ("", true)] {
        let [obj, mtl] = [QUAD, WALL].map(|text| wide(text, mark, big));
        check_files(&[("m.obj", &obj), ("m.mtl", &mtl)], RED, 2, "m.obj:1: UTF-16");
        check_files(&[("m.obj", QUAD.as_bytes()), ("m.mtl", &mtl)], RED, 2, "m.mtl:1: UTF-16");
    }
    for (end, warning) in [("\r\n", ""), ("\r", "m.obj:1: carriage return")] {
        let [obj, mtl] = [QUAD, WALL].map(|text| text.replace('\n', end));
        check(&obj, &mtl, RED, 2, warning);
        check(&format!("\u{feff}{obj}"), &mtl, RED, 2, warning);
    }
    check_files(&[("m.obj", &[QUAD.as_bytes(), &[0; 100]].concat()), ("m.mtl", WALL.as_bytes())], RED, 2, "");
}

#[test]
fn text_of_other_encodings_and_systems_loads() {
    // UTF-8 with its mark, Windows line ends, Latin-1 in a comment and in a group, a material name with a space and a `#`.
    let obj = b"\xEF\xBB\xBFmtllib my lib.mtl\r\n# \xE9\r\nmtllib m.mtl\r\nv 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\ng caf\xE9\r\n\
                usemtl\tbig #1\r\nf 1 2 3\r\n";
    let mtl = b"\xEF\xBB\xBFnewmtl big #1\r\n\tKd 0.5 # grey\r\n\tKs spectral gold.rfl\r\n\tKa 1\r\n\tKe 1 2 3\r\n";
    let scene = open(&[("m.obj", obj), ("my lib.mtl", mtl), ("m.mtl", WALL.as_bytes())]).world;
    assert_eq!(scene.materials[0].name, "big #1");
    assert_eq!(scene.materials[0].albedo, Vec3::splat(0.5));
    assert_eq!(scene.materials[0].emission, vec3(1.0, 2.0, 3.0));
}

#[test]
fn several_libraries_and_the_default_material() {
    let obj = b"mtllib a.mtl b.mtl\nmtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nusemtl lamp\nf 1 2 3\n";
    let scene = open(&[
        ("m.obj", obj),
        ("a.mtl", b"newmtl lamp\nKd 1 1 1\nnewmtl twice\nKd 0 0 0"),
        ("b.mtl", b"newmtl twice\nKd 1 0 1\nnewmtl lamp\nKe 2 2 2"),
    ])
    .world;
    let materials: Vec<_> = scene.materials.iter().map(|m| (m.name.as_str(), m.albedo, m.emission)).collect();
    // The repeated library is read once, so that b.mtl's definitions are the later ones, and hold.
    let grey = Vec3::splat(0.5);
    let (purple, light) = (vec3(1.0, 0.0, 1.0), Vec3::splat(2.0));
    assert_eq!(materials, [("lamp", grey, light), ("twice", purple, Vec3::ZERO), ("default", grey, Vec3::ZERO)]);
    assert_eq!(scene.meshes[0].triangles.iter().map(|triangle| triangle.material).collect::<Vec<_>>(), [2, 0]);
}

#[test]
fn keywords_in_other_case() {
    let upper =
        "MTLLIB m.mtl\nV -1 -1 0\nV 1 -1 0\nV 1 1 0\nV -1 1 0\nVT 0 0\nVT 1 0\nVT 1 1\nVT 0 1\nUseMtl wall\nF 1/1 2/2 3/3 4/4\n";
    check(upper, WALL, RED, 2, "m.obj:1: keyword MTLLIB is not spelt mtllib");
    let red = picture();
    let mtl = "newmtl wall\nkd 1 1 1\nmap_kd red.png\n";
    check_files(
        &[("m.obj", QUAD.as_bytes()), ("m.mtl", mtl.as_bytes()), ("red.png", &red)],
        PICTURE,
        2,
        "m.mtl:2: keyword kd is not spelt Kd",
    );
    check(QUAD, "NEWMTL wall\nKD 0.8 0.2 0.2\n", RED, 2, "m.mtl:1: keyword NEWMTL");
}

#[test]
fn vertex_colours() {
    let quad = |colours: [&str; 4], more: &str| {
        let corners: String = CORNERS.lines().zip(colours).map(|(corner, colour)| format!("{corner} {colour}\n")).collect();
        format!("{corners}{more}f 1 2 3 4\n")
    };
    let colors = |obj: &str| {
        let Loaded { world, report, .. } = open(&[("m.obj", obj.as_bytes()), ("m.mtl", WALL.as_bytes())]);
        (world.meshes[0].colors.clone(), world.materials[world.meshes[0].triangles[0].material as usize].albedo, report.warnings)
    };
    assert_eq!(colors(&quad(["1 0 0"; 4], "")), (vec![Vec3::X; 4], Vec3::ONE, vec![]));
    // sRGB, as scanners and modellers write them.
    let (decoded, ..) = colors(&quad(["0.5 0.25 1", "0 0 0", "1 1 1", "0.5 0.5 0.5"], ""));
    assert!((decoded[0] - vec3(0.214_041, 0.050_876, 1.0)).abs().max_element() < 1e-5 && decoded[2] == Vec3::ONE, "{decoded:?}");
    let (bytes, _, warnings) = colors(&quad(["255 0 0", "0 255 0", "0 0 255", "0 0 0"], ""));
    assert_eq!(bytes, [Vec3::X, Vec3::Y, Vec3::Z, Vec3::ZERO]);
    assert!(warnings.len() == 1 && warnings[0].contains("divided by 255"), "{warnings:?}");
    let (clamped, _, warnings) = colors(&quad(["1.0001 0 0", "-0.1 1 0", "0 0 1", "0 0 0"], ""));
    assert_eq!(clamped, [Vec3::X, Vec3::Y, Vec3::Z, Vec3::ZERO]);
    assert!(warnings.len() == 1 && warnings[0].contains("clamped"), "{warnings:?}");
    // One odd number does not darken the others.
    for odd in ["inf 0 0", "1.6 0 0", "300 0 0"] {
        let (clamped, _, warnings) = colors(&quad([odd, "0 1 0", "0 0 1", "1 1 1"], ""));
        assert_eq!(clamped[1..], [Vec3::Y, Vec3::Z, Vec3::ONE], "{odd}: {warnings:?}");
    }
    // A material with Kd multiplies them, and a vertex without colour is as without colours.
    let (_, albedo, _) = colors(&quad(["1 0 0"; 4], "mtllib m.mtl\nusemtl wall\n"));
    assert_eq!(albedo, RED);
    assert_eq!(colors(&quad(["1 0 0", "1 0 0", "1 0 0", ""], "mtllib m.mtl\nusemtl wall\n")).0[3], Vec3::ONE);
    assert_eq!(colors(&quad(["", "", "1 0 0", "1 0 0"], "")).0, [GREY, GREY, Vec3::X, Vec3::X]);
    // A fourth number alone is a weight, and a seventh may be alpha.
    assert_eq!(colors(&quad(["1.0"; 4], "")).0, []);
    assert_eq!(colors(&quad(["0 1 0 0.5"; 4], "")).0, [Vec3::Y; 4]);
    assert_eq!(colors(&quad(["nan 0 0", "1 0 0", "1 0 0", "1 0 0"], "")).0[0], GREY);
}

#[test]
fn objects_are_instances() {
    let faces = "f 1 2 3\no front\nusemtl wall\nf 1 2 4\no back\ng part\nf 2 3 4\no front\nf 1 3 4\nf 1 2 3\n";
    let world = open(&[("m.obj", format!("{CORNERS}{faces}").as_bytes())]).world;
    let named = |world: &World| {
        let count = |mesh: usize| world.meshes[mesh].triangles.len();
        world.instances.iter().map(|instance| (instance.name.clone(), count(instance.mesh))).collect::<Vec<_>>()
    };
    let expected = |list: &[(&str, usize)]| list.iter().map(|&(name, count)| (name.to_owned(), count)).collect::<Vec<_>>();
    assert_eq!(named(&world), expected(&[("m", 1), ("front", 3), ("back", 1)]));
    // Vertices know their place in the file.
    let sources = |mesh: usize| world.meshes[mesh].sources.iter().map(|source| source.index).collect::<Vec<_>>();
    assert_eq!((sources(0), sources(1), sources(2)), (vec![0, 1, 2], vec![0, 1, 3, 0, 2, 3, 1], vec![1, 2, 3]));
    assert!(world.meshes.iter().all(|mesh| mesh.source_count == 4));
    // Groups count in a file without objects. An object without faces is none.
    let groups = open(&[("m.obj", format!("{CORNERS}g a b\nf 1 2 3\ng\nf 1 2 4\ng none\n").as_bytes())]).world;
    assert_eq!(named(&groups), expected(&[("a b", 1), ("m", 1)]));
    // An object far from the origin of the world keeps its shape.
    let far =
        open(&[("m.obj", b"o a\nv 500000.25 0 0\nv 500001.5 0 0\nv 500000 1 0\nf 1 2 3\no b\nv 500000.25 0 1\nf 4 2 3\n")]).world;
    assert_eq!(far.instances[0].transform, far.instances[1].transform);
    assert_eq!(far.meshes[0].positions[1] - far.meshes[1].positions[1], Vec3::ZERO);
}

#[test]
fn strict_refuses_what_was_mended() {
    let quad = |top: &str, more: &str| format!("{top}\n{CORNERS}usemtl wall\nf 1 2 3 4\n{more}\n");
    for (obj, mtl, fragment) in [
        (quad("mtllib gone.mtl", ""), WALL, "gone.mtl"),
        (quad("mtllib", ""), WALL, "mtllib without a name"),
        (quad("", ""), WALL, "defines material \"wall\""),
        (quad("mtllib \"m.mtl\"", ""), WALL, "m.mtl"),
        (quad("mtllib m.mtl", "f 1 2"), WALL, "2 corners"),
        (quad("mtllib m.mtl", "usemtl WALL"), WALL, "defines material \"WALL\""),
        (quad("mtllib m.mtl", "F 1 2 3"), WALL, "keyword F"),
        (quad("mtllib m.mtl", "f 1 2 3/0"), WALL, "index 0"),
        (quad("mtllib m.mtl", ""), "newmtl wall\nKd 2 1 1\n", "Kd has the value 2"),
        (quad("mtllib m.mtl", ""), "newmtl wall\nmap_Kd RED.png\n", "RED.png"),
        (quad("mtllib m.mtl", "").replace('\n', "\r"), WALL, "carriage return"),
    ] {
        let red = picture();
        let files: [(&str, &[u8]); 3] = [("m.obj", obj.as_bytes()), ("m.mtl", mtl.as_bytes()), ("red.png", &red)];
        open(&files);
        let Err(error) = load(&files, true) else { panic!("loaded: {obj}\n{mtl}") };
        assert!(error.to_string().contains(fragment), "{error}");
    }
}
