//! Loading scenes: the meaning of the data, and malformed inputs that are reported with their place.

use std::f32::consts::FRAC_1_SQRT_2;
use std::f64::consts::FRAC_PI_2;
use std::fs;
use std::path::{Path, PathBuf};

use finalgather::Environment;
use finalgather::job::SceneRequest;
use finalgather::scene::{
    ImageTexture, Instance, Lens, LoadOptions, Loaded, Material, Mesh, Sampler, Scene, Surface, Triangle, World, WrapMode,
};
use finalgather::settings::{Pipeline, Settings};
use glam::{DAffine3, DQuat, DVec3, Vec2, Vec3, dvec3, vec2, vec3};
use serde_json::Map;
use tempfile::TempDir;

/// Files in a folder of their own.
struct Folder(TempDir);

impl Folder {
    fn new(files: &[(&str, &[u8])]) -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        for (name, contents) in files {
            fs::write(folder.path(name), contents).unwrap();
        }
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn load(&self, name: &str) -> Loaded {
        World::load(&self.path(name)).unwrap_or_else(|error| panic!("{error}"))
    }
}

const MTL: &str = "newmtl lamp\nKe 5 5 5\nnewmtl wall\nKd 0.2 0.4 0.6\n";

/// A lit triangle; statements that are added after it use material `wall`. The added text starts at line 7.
const LIT: &str = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl lamp\nf 1 2 3\n";

fn load_lit(more: &str) -> Loaded {
    let obj = format!("{LIT}usemtl wall\n{more}");
    Folder::new(&[("m.obj", obj.as_bytes()), ("m.mtl", MTL.as_bytes())]).load("m.obj")
}

/// The mesh of a world of one, with the warnings.
fn load_mesh(more: &str) -> (Mesh, Vec<String>) {
    let Loaded { world, report, .. } = load_lit(more);
    let [mesh] = <[Mesh; 1]>::try_from(world.meshes).unwrap();
    (mesh, report.warnings)
}

fn area(mesh: &Mesh, triangles: std::ops::Range<usize>) -> f32 {
    triangles
        .map(|triangle| {
            let [a, b, c] = mesh.corners(triangle);
            (b - a).cross(c - a).length() / 2.0
        })
        .sum()
}

/// A one-colour PNG, 24 bits a pixel.
fn png(width: u32, height: u32, color: [u8; 3]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let picture = image::RgbImage::from_pixel(width, height, image::Rgb(color));
    picture.write_to(&mut std::io::Cursor::new(&mut bytes), image::ImageFormat::Png).unwrap();
    bytes
}

#[test]
fn cornell_box_loads_exactly() {
    let Loaded { world: scene, settings, report, .. } = World::load(Path::new("scenes/cornell.toml")).unwrap();
    let parts: Vec<_> =
        scene.instances.iter().map(|instance| (instance.name.as_str(), scene.meshes[instance.mesh].triangles.len())).collect();
    let walls = ["floor", "ceiling", "back_wall", "green_wall", "red_wall"].map(|name| (name, 2));
    assert_eq!(parts, [&walls[..], &[("short_block", 10), ("tall_block", 10), ("light", 2)]].concat());
    assert!(scene.instances.iter().all(|instance| instance.transform == DAffine3::IDENTITY));
    let names: Vec<_> = scene.materials.iter().map(|material| material.name.as_str()).collect();
    assert_eq!(names, ["white", "red", "green", "light"]);
    assert_eq!(scene.materials[1].albedo, vec3(0.63, 0.065, 0.05));
    let (_, camera) = scene.cameras[0];
    assert_eq!(camera.eye, dvec3(278.0, 273.0, -800.0));
    assert_eq!(camera.fov_y_degrees, 39.3077);
    assert_eq!(settings, Settings::default());
    assert_eq!(report.warnings, [""; 0]);
    assert_eq!(report.files.len(), 3);

    assert_eq!(scene.materials[3].emission, vec3(17.0, 12.0, 4.0));
    let light = &scene.meshes[7];
    assert_eq!(area(light, 0..2), 130.0 * 105.0);
    for triangle in 0..2 {
        assert_eq!(light.triangles[triangle].material, 3);
        assert_eq!(light.geometric_normal(triangle), Vec3::NEG_Y);
        assert!(light.corners(triangle).iter().all(|corner| corner.y == 548.7));
    }
    assert_eq!(scene.bounds()[1].as_vec3(), vec3(556.0, 548.8, 559.2));
    assert!(scene.meshes.iter().flat_map(|mesh| &mesh.normals).all(|normal| *normal == Vec3::ZERO));
    // Each material's corners are shared: the floor has 4, not 6.
    let floor = &scene.meshes[0];
    assert_eq!((floor.triangles[0].vertices, floor.triangles[1].vertices), ([0, 1, 2], [0, 2, 3]));
}

#[test]
fn textured_demo_multiplies_colour_and_tile() {
    let Loaded { world, settings, report, .. } = World::load(Path::new("scenes/cornell_textured.toml")).unwrap();
    assert_eq!((settings.directions.count, world.textures.len()), (2000, 1));
    assert_eq!(report.warnings, [""; 0]);
    let scene = world.flatten();
    // The second tile from the left, nearest to the viewer, in front of the short block: red, (226, 52, 36) in sRGB. The
    // floor's first triangle runs along the front edge: from corner 2 at the origin, 3/8 of the way to corner 1, 1/8 to
    // corner 3.
    let corner_1 = 0.375 / 0.994245;
    let corner_3 = 0.125 / 1.00576;
    let albedo = scene.albedo(0, vec3(corner_1, 1.0 - corner_1 - corner_3, corner_3));
    assert!((albedo - vec3(0.7605, 0.0343, 0.0176)).abs().max_element() < 1e-4, "{albedo}");
    // White walls have no texture.
    assert_eq!(scene.albedo(2, Vec3::X), vec3(0.725, 0.71, 0.68));
}

#[test]
fn polygons_of_any_shape_keep_area_and_winding() {
    // Each with its doubled area about its normal, times the normal.
    let cases = [
        // An arrowhead whose reflex corner is the third, so that a fan from the first turns over; facing +z, then -z.
        ("v 0 0 5\nv 4 0 5\nv 1 1 5\nv 0 4 5\nf -4 -3 -2 -1", vec3(0.0, 0.0, 8.0)),
        ("v 4 0 5\nv 1 1 5\nv 0 4 5\nv 0 0 5\nf -4 -3 -2 -1", vec3(0.0, 0.0, 8.0)),
        ("v 4 0 5\nv 1 1 5\nv 0 4 5\nv 0 0 5\nf -1 -2 -3 -4", vec3(0.0, 0.0, -8.0)),
        // A U of eight corners in the plane x = 2, and the same seen from behind.
        (
            "v 2 0 0\nv 2 3 0\nv 2 3 3\nv 2 2 3\nv 2 2 1\nv 2 1 1\nv 2 1 3\nv 2 0 3\nf -8 -7 -6 -5 -4 -3 -2 -1",
            vec3(14.0, 0.0, 0.0),
        ),
        (
            "v 2 0 0\nv 2 3 0\nv 2 3 3\nv 2 2 3\nv 2 2 1\nv 2 1 1\nv 2 1 3\nv 2 0 3\nf -1 -2 -3 -4 -5 -6 -7 -8",
            vec3(-14.0, 0.0, 0.0),
        ),
        // A straight corner.
        ("v 0 0 1\nv 1 0 1\nv 2 0 1\nv 2 2 1\nv 0 2 1\nf -5 -4 -3 -2 -1", vec3(0.0, 0.0, 8.0)),
        // Small and far away.
        ("v 1e6 1e6 0\nv 1000001 1e6 0\nv 1000001 1000001 0\nv 1e6 1000001 0\nf -4 -3 -2 -1", vec3(0.0, 0.0, 2.0)),
    ];
    for (polygon, expected) in cases {
        let (mesh, warnings) = load_mesh(polygon);
        assert_eq!(warnings, [""; 0], "{polygon}");
        let mut sum = Vec3::ZERO;
        for triangle in 1..mesh.triangles.len() {
            assert!(
                mesh.geometric_normal(triangle).dot(expected.normalize()) > 0.999,
                "{polygon}: triangle {triangle} turned over"
            );
            let [a, b, c] = mesh.corners(triangle);
            sum += (b - a).cross(c - a);
        }
        assert!((sum - expected).length() < 1e-4, "{polygon}: {sum}");
    }
}

#[test]
fn faces_refer_back_forward_and_absolutely() {
    // The middle face comes before its vertices; polylines of three points are not faces; numbers may precede a comment.
    let more = "s 1\nv 0 0 7\nv 1 0 7 # comment\nv 0 1 7\nf -3 -2 -1\ns 2\nf 7 8 9 # comment\nv 0 0 8\nv 1 0 8\nv 0 1 8\n\
                s off\nl 1 2 3\nf 4 5 6 \n";
    let (mesh, _) = load_mesh(more);
    let heights: Vec<_> = (0..mesh.triangles.len()).map(|triangle| mesh.corners(triangle).map(|corner| corner.z)).collect();
    assert_eq!(heights, [[0.0; 3], [7.0; 3], [8.0; 3], [7.0; 3]]);
    // The last face repeats the second, and shares its vertices though it is in another smoothing group.
    assert_eq!(mesh.triangles[1], mesh.triangles[3]);
    assert_eq!(mesh.positions.len(), 9);
}

#[test]
fn normals_and_texture_coordinates_stay_with_their_corners() {
    let more = "vn 0 0 3\nvn 0 0 0\nvn nan 0 0\nvn 0 1e30 0\nvt 0.25 0.5\nvt 0.75\ns 1\n\
                f 1/1/1 2/2/2 3//3\nf 1//4 2/2 3\nf 1//1 2//1 3//1";
    let (mesh, _) = load_mesh(more);
    let normals = |triangle: usize| mesh.triangles[triangle].vertices.map(|vertex| mesh.normals[vertex as usize]);
    let uvs = |triangle: usize| mesh.triangles[triangle].vertices.map(|vertex| mesh.uvs[vertex as usize]);
    assert_eq!(normals(0), [Vec3::ZERO; 3]);
    assert_eq!(normals(1), [Vec3::Z, Vec3::ZERO, Vec3::ZERO]);
    assert_eq!(normals(2), [Vec3::Y, Vec3::ZERO, Vec3::ZERO]);
    assert_eq!(normals(3), [Vec3::Z; 3]);
    assert_eq!(uvs(1), [vec2(0.25, 0.5), vec2(0.75, 0.0), Vec2::ZERO]);
    assert_eq!(uvs(2), [Vec2::ZERO, vec2(0.75, 0.0), Vec2::ZERO]);
    // The lamp has 3 vertices. Of the wall's 9 corners, two meet: 2/2 with the first face's 2/2/2 does not, as the normals'
    // indices differ.
    assert_eq!(mesh.positions.len(), 12);
}

#[test]
fn triangles_without_area_are_skipped_and_counted() {
    let degenerate = "v 5 5 5\nv 6 6 6\nv 7 7 7\nv 7 7 7.0000005\nf 4 5 7\nf 1 1 2\nf 4 6 5 4\nf 1 2 4\n";
    let (mesh, warnings) = load_mesh(degenerate);
    assert!(warnings[0].ends_with("m.obj: 4 of 6 triangles have no area and were skipped"), "{warnings:?}");
    assert_eq!(mesh.triangles.len(), 2);
    assert!(load_mesh("f 1 1 1").1[0].ends_with("m.obj: 1 of 2 triangles has no area and was skipped"));
    assert!(mesh.bounds().max.max_element() == 5.0, "vertices of skipped triangles stay out");
}

/// Two-sided exports write each face twice; light would be shared between the two. Lamps may shine both ways.
#[test]
fn doubled_faces_are_dropped_unless_they_emit() {
    let doubled = "v 0 0 5\nv 1 0 5\nv 0 1 5\nf 4 5 6\nf 6 5 4\nf 5 6 4\nf 1 2 3\nusemtl lamp\nf 3 2 1\n";
    let Scene { mesh, materials, .. } = load_lit(doubled).world.flatten();
    let lit = mesh.triangles.iter().filter(|triangle| materials[triangle.material as usize].is_emissive()).count();
    assert_eq!((mesh.triangles.len(), lit), (3, 2));
}

/// What has an area in the world may have none beside the whole scene; its normals would not be numbers.
#[test]
fn unit_space_has_no_triangle_without_area() {
    let world = load_lit("v 9e8 0 0\nv 9e8 9e8 0\nv 0 9e8 9e8\nf 4 5 6\n").world;
    let unit = world.flatten();
    assert_eq!((world.meshes[0].triangles.len(), unit.mesh.triangles.len()), (2, 1));
    assert!((0..unit.mesh.triangles.len()).all(|triangle| unit.mesh.geometric_normal(triangle).is_finite()));
}

#[test]
fn textures_decode_srgb_and_interpolate_linearly() {
    // Top row black and white, bottom row mid-grey and red.
    let texels = vec![[0, 0, 0, 255], [255, 255, 255, 0], [188, 188, 188, 255], [255, 0, 10, 255]];
    let texture = ImageTexture { width: 2, height: 2, texels, sampler: Sampler::default() };
    let grey = Vec3::splat(0.502_886_5);
    let red = vec3(1.0, 0.0, 0.003_035_27);
    for (uv, expected) in [
        // Texel centres, v up.
        (vec2(0.25, 0.75), Vec3::ZERO),
        (vec2(0.75, 0.75), Vec3::ONE),
        (vec2(0.25, 0.25), grey),
        (vec2(0.75, 0.25), red),
        // Between them, on linear values.
        (vec2(0.5, 0.75), Vec3::splat(0.5)),
        (vec2(0.375, 0.25), grey.lerp(red, 0.25)),
        (vec2(0.5, 0.5), (Vec3::ONE + grey + red) / 4.0),
        // Over the edges, to the opposite side.
        (vec2(0.0, 0.75), Vec3::splat(0.5)),
        (vec2(0.75, 1.0), (Vec3::ONE + red) / 2.0),
        (vec2(-2.75, 7.25), grey),
        (vec2(1e30, -1e30), (Vec3::ONE + grey + red) / 4.0),
    ] {
        let sample = texture.sample_linear(uv);
        assert!((sample - expected).abs().max_element() < 1e-6, "{uv}: {sample}, not {expected}");
    }
}

#[test]
fn samplers_choose_texels_beyond_the_edge() {
    use WrapMode::{Clamp, Mirror, Repeat};
    // Of one row: black, grey of 1/5, white.
    let texels = vec![[0, 0, 0, 255], [124, 124, 124, 255], [255, 255, 255, 255]];
    let dark = 0.201_556_4;
    for (wrap, nearest, u, expected) in [
        (Repeat, false, 1.5 / 3.0, dark),
        (Repeat, false, 0.0, 0.5),
        (Repeat, false, 1.25 / 3.0, 0.75 * dark),
        (Repeat, true, 1.25 / 3.0, dark),
        (Repeat, true, 0.95 / 3.0, 0.0),
        (Repeat, true, -0.1, 1.0),
        (Clamp, false, -7.0, 0.0),
        (Clamp, false, 0.0, 0.0),
        (Clamp, false, 40.0, 1.0),
        (Clamp, true, 1.0, 1.0),
        (Mirror, false, 1.0, 1.0),
        (Mirror, false, 1.0 + 1.5 / 3.0, dark),
        (Mirror, false, 1.0 + 1.75 / 3.0, 0.75 * dark),
        (Mirror, false, -0.5 / 3.0, 0.0),
        (Mirror, false, -2.5 / 3.0, 1.0),
        (Mirror, true, 2.9 / 3.0 + 2.0, 1.0),
    ] {
        let sampler = Sampler { wrap: [wrap, Repeat], nearest };
        let sample = ImageTexture { width: 3, height: 1, texels: texels.clone(), sampler }.sample_linear(vec2(u, 0.5));
        assert!((sample.x - expected).abs() < 1e-4, "{wrap:?}, nearest {nearest}, {u}: {sample}, not {expected}");
    }
}

#[test]
fn texture_files_of_any_depth_are_loaded_once() {
    let mtl = "newmtl a\nmap_Kd -clamp on -s 1 1 -o 0.5 my tiles\\red one.png\nKe 1 1 1\n\
               newmtl b\nmap_Kd my tiles/red one.png\nKd 0.5 0.5 0.5\nnewmtl c\nmap_Kd grey.png\n\
               map_Ke glow.png\nnewmtl d\nKd 0 0 0\nmap_Kd my tiles/red one.png\n";
    let obj =
        "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nv 0 0 1\nusemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1 2 4\n";
    let folder = Folder::new(&[("m.obj", obj.as_bytes()), ("m.mtl", mtl.as_bytes())]);
    fs::create_dir(folder.path("my tiles")).unwrap();
    fs::write(folder.path("my tiles/red one.png"), png(3, 2, [255, 0, 0])).unwrap();
    image::ImageBuffer::from_pixel(1, 1, image::Luma([0x8000_u16])).save(folder.path("grey.png")).unwrap();

    let Loaded { world: scene, report, .. } = folder.load("m.obj");
    let used: Vec<_> = scene.materials.iter().map(|material| (material.albedo, material.albedo_texture)).collect();
    assert_eq!(used, [(Vec3::ONE, Some(0)), (Vec3::splat(0.5), Some(1)), (Vec3::ONE, Some(2)), (Vec3::ZERO, Some(1))]);
    // Other options make another texture.
    let red = |sampler| ImageTexture { width: 3, height: 2, texels: vec![[255, 0, 0, 255]; 6], sampler };
    assert_eq!(scene.textures[..2], [red(Sampler { wrap: [WrapMode::Clamp; 2], nearest: false }), red(Sampler::default())]);
    assert_eq!(scene.textures.len(), 3);
    assert_eq!(scene.textures[2].texels, [[128, 128, 128, 255]]);
    assert_eq!(scene.flatten().albedo(1, Vec3::X), vec3(0.5, 0.0, 0.0));
    let warnings = report.warnings.join("\n");
    for part in ["glow.png: cannot read this texture, named at ", "m.mtl:9: there is no", "1 triangle with a texture has no"] {
        assert!(warnings.contains(part), "{warnings}");
    }
    assert_eq!(report.warnings.len(), 2);
}

#[test]
fn scene_files_override_the_model() {
    let obj = format!("{LIT}usemtl wall\nv 0 0 1\nf 1 2 4");
    let toml = b"mesh = 'm.obj'\n[materials.lamp]\nemission = [0, 0, 0]\nalbedo = [0.1, 0.2, 0.3]\n\
                 [materials.wall]\nemission = [7, 8, 9]\nalbedo_texture = 'red.png'\n[settings]\nseed = 4\npipeline = 'kill'\n";
    let red = png(1, 1, [255, 0, 0]);
    let files: [(&str, &[u8]); 4] = [("m.obj", obj.as_bytes()), ("m.mtl", MTL.as_bytes()), ("s.TOML", toml), ("red.png", &red)];
    let Loaded { world: scene, settings, .. } = Folder::new(&files).load("s.TOML");
    assert_eq!(settings, Settings::default().with(|s| (s.seed, s.gather.pipeline) = (4, Pipeline::Kill)));
    assert_eq!((scene.materials[0].albedo, scene.materials[0].emission), (vec3(0.1, 0.2, 0.3), Vec3::ZERO));
    assert_eq!((scene.materials[1].albedo, scene.materials[1].emission), (vec3(0.2, 0.4, 0.6), vec3(7.0, 8.0, 9.0)));
    assert_eq!(scene.flatten().albedo(1, Vec3::X), vec3(0.2, 0.0, 0.0));
}

/// A key that changed shadow maps, of which there are none any more.
#[test]
fn keys_without_effect_are_told() {
    let toml = b"mesh = 'm.obj'\n[settings]\nshadow_size = 64\nseed = 7\n";
    let folder = Folder::new(&[("m.obj", LIT.as_bytes()), ("m.mtl", MTL.as_bytes()), ("s.toml", toml)]);
    let Loaded { settings, report, .. } = folder.load("s.toml");
    assert_eq!(settings, Settings::default().with(|s| s.seed = 7));
    assert!(
        report.warnings.len() == 1 && report.warnings[0].contains("s.toml:3: shadow_size has no effect"),
        "{:?}",
        report.warnings
    );
    assert!(!toml::to_string(&settings).unwrap().contains("shadow_size"));
}

/// Settings that were renamed are read by their old keys too: from a scene file, and from a request.
#[test]
fn old_keys_of_settings() {
    let toml = b"mesh = 'm.obj'\n[settings]\nbounces = 3\nuntil = 0.5\n";
    let folder = Folder::new(&[("m.obj", LIT.as_bytes()), ("m.mtl", MTL.as_bytes()), ("s.toml", toml)]);
    let expected = Settings::default().with(|s| (s.photons.depth, s.directions.target_error) = (3, 0.5));
    assert_eq!(folder.load("s.toml").settings, expected);
    let flat = serde_json::to_value(expected).unwrap();
    assert_eq!((&flat["photon_depth"], &flat["target_error"]), (&3.into(), &0.5.into()));
    let settings = Map::from_iter([("bounces".into(), 3.into()), ("until".into(), 0.5.into())]);
    let request = SceneRequest { settings, ..SceneRequest::default() };
    let of_scene = Settings::default().with(|s| s.photons.depth = 7);
    assert_eq!(request.settings(&of_scene).unwrap(), expected);
}

/// What counts is what `illum` makes of it; numbers that exporters write beside are not looked at.
#[test]
fn mirrors_and_glass_from_either_file() {
    let mtl = "newmtl lamp\nKe 5 5 5\nKs spectral gold.rfl\nNi 0\nillum 2\n\
               newmtl mirror\nillum 3\nKd 0.1 0.1 0.1\nKs 0.9 0.8 0.7 # silver\nNs 1000\n\
               newmtl fresnel\nillum 5\nnewmtl window\nillum 4\nnewmtl amber\nTf 1 0.6 0.2\nNi 1.55\nillum 7\n\
               newmtl brushed\nKd 0.3 0.3 0.3\nKs 1 1 1\nillum 3\nNs 30\nnewmtl turned\nillum 7\n";
    let toml = b"mesh = 'm.obj'\n[materials.turned]\nsurface = 'mirror'\nalbedo = [0.5, 0.5, 0.5]\n\
                 [materials.fresnel]\nsurface = 'diffuse'\n[materials.window]\nsurface = { glass = { filter = [0, 1, 0] } }\n\
                 [camera]\neye = [0, 0, 5]\ntarget = [0, 0, 1]\naperture = 0.5";
    let folder = Folder::new(&[("m.obj", LIT.as_bytes()), ("m.mtl", mtl.as_bytes()), ("s.toml", toml)]);
    let Loaded { world: scene, report, .. } = folder.load("m.obj");
    let surfaces = |scene: &World| scene.materials.iter().map(|material| material.surface).collect::<Vec<_>>();
    let glass = |index, filter| Surface::Glass { index, filter };
    let (clear, amber) = (glass(1.5, Vec3::ONE), glass(1.55, vec3(1.0, 0.6, 0.2)));
    use Surface::{Diffuse, Mirror};
    assert_eq!(surfaces(&scene), [Diffuse, Mirror, Mirror, clear, amber, Diffuse, clear]);
    assert_eq!((scene.materials[1].albedo, scene.materials[2].albedo), (vec3(0.9, 0.8, 0.7), Vec3::ONE));
    // A mirror that is not sharp is a metal with gloss: cos^30 has the width α = 1/4.
    let gloss = scene.materials[5].gloss.map(|gloss| (gloss.roughness, gloss.metallic));
    assert_eq!((scene.materials[5].albedo, gloss, report.warnings.len()), (Vec3::ONE, Some((0.5, 1.0)), 0));
    let flat = scene.flatten();
    assert!(!flat.is_specular() && flat.without_glass().is_none(), "what no triangle uses");

    let over = folder.load("s.toml").world;
    assert_eq!(surfaces(&over), [Diffuse, Mirror, Diffuse, glass(1.5, Vec3::Y), amber, Diffuse, Mirror]);
    assert_eq!(over.materials[6].albedo, Vec3::splat(0.5));
    assert_eq!(over.cameras[0].1.lens, Some(Lens { radius: 0.5, focus_distance: 4.0 }));
    // In unit space all lengths are divided alike.
    let unit = over.flatten();
    let lens = unit.camera.unwrap().lens.unwrap();
    assert!(
        (unit.space.length_to_world(lens.radius) - 0.5).abs() < 1e-6 && (lens.focus_distance / lens.radius - 8.0).abs() < 1e-5
    );
}

/// A triangle that faces +z, with a shading normal that leans to +x, a corner of its own and a lamp for a material.
fn leaning_triangle() -> World {
    let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
    let normals = vec![vec3(1.0, 0.0, 1.0).normalize(); 3];
    let uvs = vec![Vec2::ZERO, Vec2::X, Vec2::Y];
    let mesh =
        Mesh { positions, normals, uvs, triangles: vec![Triangle { vertices: [0, 1, 2], material: 0 }], ..Mesh::default() };
    let (name, surface) = ("lamp".into(), Surface::Diffuse);
    let lamp = Material { name, albedo: Vec3::ONE, emission: Vec3::ONE, surface, ..Material::default() };
    World { meshes: vec![mesh], materials: vec![lamp], ..World::default() }
}

/// Positions go by the transform, normals by its inverse transpose, and the front stays the front in mirror images.
#[test]
fn instances_are_flattened_by_their_transforms() {
    let scaled = DAffine3::from_scale(dvec3(2.0, 1.0, 1.0));
    let mirrored = DAffine3::from_scale_rotation_translation(dvec3(-2.0, 1.0, 1.0), DQuat::IDENTITY, dvec3(0.0, 0.0, 5.0));
    let upside_down = DAffine3::from_scale(dvec3(1.0, 1.0, -1.0));
    let turned = DAffine3::from_rotation_y(FRAC_PI_2);
    let mut world = leaning_triangle();
    world.instances = [DAffine3::IDENTITY, scaled, mirrored, upside_down, turned]
        .map(|transform| Instance { transform, ..Instance::default() })
        .to_vec();
    assert_eq!(world.bounds(), [dvec3(-2.0, 0.0, -1.0), dvec3(2.0, 1.0, 5.0)]);
    let Scene { mesh, space, .. } = world.flatten();
    assert_eq!((mesh.triangles.len(), mesh.positions.len(), mesh.uvs.len()), (5, 15, 15));
    let half = FRAC_1_SQRT_2;
    let (far, leaning) = (vec3(1.0, 0.0, 2.0).normalize(), vec3(half, 0.0, half));
    for (triangle, corner, front, normal) in [
        (0, Vec3::X, Vec3::Z, leaning),
        (1, 2.0 * Vec3::X, Vec3::Z, far),
        (2, vec3(-2.0, 0.0, 5.0), Vec3::Z, vec3(-far.x, 0.0, far.z)),
        (3, Vec3::X, Vec3::NEG_Z, vec3(half, 0.0, -half)),
        (4, Vec3::NEG_Z, Vec3::X, vec3(half, 0.0, -half)),
    ] {
        let near = |found: Vec3, expected: Vec3, what: &str| {
            assert!(found.distance(expected) < 1e-6, "instance {triangle}: {what} {found}, not {expected}");
        };
        // The second vertex of each instance.
        let vertex = 3 * triangle + 1;
        near(space.to_world(mesh.positions[vertex]).as_vec3(), corner, "corner");
        near(mesh.normals[vertex], normal, "normal");
        assert_eq!(mesh.uvs[vertex], Vec2::X, "instance {triangle}");
        near(mesh.geometric_normal(triangle), front, "front");
    }
}

/// Positions are f64 until the origin has moved: what lies a billion of its lengths away keeps its shape to the bit.
#[test]
fn a_world_far_away_is_flattened_without_rounding() {
    let mut world = leaning_triangle();
    world.instances.push(Instance::default());
    let here = world.flatten();
    world.instances[0].transform = DAffine3::from_translation(DVec3::splat(1e9));
    let there = world.flatten();
    assert_eq!(there.mesh.positions, here.mesh.positions);
    assert_eq!(there.mesh.normals, here.mesh.normals);
    assert!(there.space.to_world(there.mesh.positions[1]).distance(DVec3::splat(1e9) + DVec3::X) < 2e-7);
}

#[test]
fn missing_cameras_frame_the_model_and_partial_ones_are_completed() {
    let obj = format!("{LIT}v -8 3 900\nf 1 2 -1");
    let folder = Folder::new(&[
        ("m.obj", obj.as_bytes()),
        ("m.mtl", MTL.as_bytes()),
        ("tall.toml", b"mesh = 'm.obj'\nsettings.size = [100, 300]"),
        ("own.toml", b"mesh = 'm.obj'\ncamera = { eye = [0, 0, 5], target = [0, 0, 0], up = [0, 1e-30, 0] }"),
    ]);
    for (name, aspect) in [("m.obj", 1.0), ("tall.toml", 1.0 / 3.0)] {
        let Loaded { world, settings, .. } = folder.load(name);
        let camera = world.camera(settings.film.size);
        let forward = (camera.target - camera.eye).normalize();
        let right = forward.cross(camera.up.as_dvec3()).normalize();
        let up = right.cross(forward);
        let tan = f64::from(camera.fov_y_degrees / 2.0).to_radians().tan();
        assert!(forward.z < -0.8 && forward.y < 0.0 && forward.x < 0.0, "{camera:?}");
        let inside = |point: &Vec3| {
            let d = point.as_dvec3() - camera.eye;
            let depth = d.dot(forward);
            d.dot(right).abs() < depth * tan * aspect && d.dot(up).abs() < depth * tan
        };
        assert!(world.meshes[0].positions.iter().all(inside), "{name}: {camera:?}");
    }
    let (_, camera) = folder.load("own.toml").world.cameras[0];
    assert_eq!((camera.up, camera.fov_y_degrees), (Vec3::Y, 40.0));
}

/// A model without a light is a scene under a sky, its own or another's; a turned one is seen turned.
#[test]
fn environments_light_what_does_not_shine() {
    let sky = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\x80\0\0\x82\0\x80\0\x82";
    let folder = Folder::new(&[
        ("m.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        ("sky.hdr", sky),
        ("s.toml", b"mesh = 'm.obj'\n[environment]\nfile = 'sky.hdr'\nscale = 0.5\nturn_degrees = 180\n"),
        ("c.toml", b"mesh = 'm.obj'\nenvironment = { radiance = [1, 2, 3] }\n"),
        ("gone.toml", b"mesh = 'm.obj'\nenvironment = { file = 'gone.hdr' }\n"),
    ]);
    // The left half of the picture, of centre -x, is red and 2 bright.
    let scene = folder.load("s.toml").world.flatten();
    assert!(
        (scene.miss_radiance(Vec3::X) - Vec3::X).length() < 1e-6 && (scene.miss_radiance(Vec3::NEG_X) - Vec3::Y).length() < 1e-6
    );
    assert_eq!(folder.load("c.toml").world.flatten().miss_radiance(Vec3::Y), vec3(1.0, 2.0, 3.0));
    let own = Environment::load(&folder.path("sky.hdr")).unwrap();
    for name in ["m.obj", "c.toml", "gone.toml"] {
        let scene =
            World::load_with(&folder.path(name), LoadOptions { environment: Some(own.clone()), ..LoadOptions::default() })
                .unwrap()
                .world
                .flatten();
        assert!((scene.miss_radiance(Vec3::NEG_X) - 2.0 * Vec3::X).length() < 1e-6, "{name}");
    }
}
