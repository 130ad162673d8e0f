//! Other readers load exported files: ply-rs for PLY, a byte comparison for NumPy, the scene loader for OBJ, glTF's crate and the Khronos validator.

mod common;

use std::collections::BTreeMap;
use std::f32::consts::{FRAC_1_PI, PI};
use std::fs;
use std::path::Path;

use common::khronos;
use finalgather::blocks::sha256;
use finalgather::error::Error;
use finalgather::export::{ExportMesh, Lightmap, PointValues, Positions, check_writable, read_prt};
use finalgather::image::{Channel, Image, WriteOptions};
use finalgather::points::file::{self, OrientedPoint};
use finalgather::scene::{ImageTexture, Material, Mesh, Sampler, Triangle, World};
use glam::{DVec3, Vec2, Vec3, vec2, vec3};
use gltf::Semantic;
use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{DefaultElement, Property};
use serde_json::Value;

/// A tent of three plates, each of a material of its own: grey, textured, a lamp.
struct Tent {
    mesh: Mesh,
    /// Of its vertices.
    world: Vec<DVec3>,
    normals: Vec<Vec3>,
    materials: Vec<Material>,
    textures: Vec<ImageTexture>,
}

impl Tent {
    fn new() -> Self {
        let (mut mesh, mut normals) = (Mesh::default(), Vec::new());
        for plate in 0..3_u32 {
            let (angle, first) = (plate as f32 * 1.1 + 0.3, 4 * plate);
            let normal = vec3(angle.sin(), angle.cos(), 0.0);
            let along = vec3(angle.cos(), -angle.sin(), 0.0);
            for (u, v) in [(0.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, 0.0)] {
                mesh.positions.push(normal * 1.7 + along * (u - 0.5) + Vec3::Z * v);
                mesh.normals.push(normal);
                mesh.uvs.push(vec2(u, v));
                normals.push(normal);
            }
            for corners in [[0, 1, 2], [0, 2, 3]] {
                mesh.triangles.push(Triangle { vertices: corners.map(|corner| first + corner), material: plate });
            }
        }
        let material = |name: &str, albedo, emission, albedo_texture| Material {
            name: name.into(),
            albedo,
            emission,
            albedo_texture,
            ..Material::default()
        };
        let materials = vec![
            material("grey", Vec3::splat(0.5), Vec3::ZERO, None),
            material("checked", vec3(0.9, 0.8, 0.7), Vec3::ZERO, Some(0)),
            material("lamp", Vec3::splat(0.25), vec3(12.0, 8.0, 2.0), None),
        ];
        // Half of it reflects all, half nothing.
        let textures = vec![ImageTexture {
            width: 2,
            height: 1,
            texels: vec![[255, 255, 255, 255], [0, 0, 0, 255]],
            sampler: Sampler::default(),
        }];
        let world = mesh.positions.iter().map(|position| position.as_dvec3()).collect();
        Self { mesh, world, normals, materials, textures }
    }

    fn surface(&self) -> ExportMesh<'_> {
        ExportMesh {
            mesh: &self.mesh,
            positions: Positions::near(&self.world),
            materials: &self.materials,
            textures: &self.textures,
            source: None,
        }
    }

    fn values<'a>(&'a self, columns: &'a [Channel]) -> PointValues<'a> {
        PointValues {
            positions: Positions::near(&self.world),
            normals: &self.normals,
            columns,
            surface: Some(self.surface()),
            sources: None,
        }
    }

    /// Each plate has a third of the map.
    fn lightmap_uvs(&self) -> Vec<Vec2> {
        self.mesh.uvs.iter().enumerate().map(|(i, uv)| vec2((uv.x * 0.8 + 0.1 + (i / 4) as f32) / 3.0, uv.y * 0.5)).collect()
    }
}

/// Numbers that are not round, no two alike, for the tent's twelve vertices.
fn columns(names: &[&str]) -> Vec<Channel> {
    let sample = |column: usize, i: usize| ((column * 12 + i) as f32 * 0.37 + 0.01).sin() + 1.0;
    let channel = |(column, name): (usize, &&str)| Channel {
        name: name.to_string(),
        samples: (0..12).map(|i| sample(column, i)).collect(),
    };
    names.iter().enumerate().map(channel).collect()
}

const IRRADIANCE: [&str; 3] = ["Irradiance.R", "Irradiance.G", "Irradiance.B"];
const MIXED: [&str; 7] = ["AO", "Irradiance.R", "Irradiance.G", "Irradiance.B", "BentNormal.X", "BentNormal.Y", "BentNormal.Z"];

fn prt(coefficients: usize) -> Vec<Channel> {
    let names: Vec<_> = (0..coefficients).flat_map(|i| ["R", "G", "B"].map(|channel| format!("PRT.{i:02}.{channel}"))).collect();
    columns(&names.iter().map(String::as_str).collect::<Vec<_>>())
}

/// A picture that says where it is, and is brighter than white.
fn lightmap_image() -> Image {
    let (width, height) = (24, 8);
    let channel = |(index, name): (usize, &str)| Channel {
        name: name.into(),
        samples: (0..width * height)
            .map(|i| ((i % width) as f32 + 3.0 * (i / width) as f32) * 0.2 / (index + 1) as f32)
            .collect(),
    };
    Image { width, height, channels: ["R", "G", "B"].into_iter().enumerate().map(channel).collect() }
}

/// As a PNG of this exposure in stops shows the light that white surfaces of these irradiances send back.
fn shown(exposure: f32, irradiance: [&[f32]; 3]) -> Vec<u8> {
    let channels = ["R", "G", "B"]
        .into_iter()
        .zip(irradiance)
        .map(|(name, samples)| Channel { name: name.into(), samples: samples.iter().map(|value| value * FRAC_1_PI).collect() });
    let image = Image { width: irradiance[0].len(), height: 1, channels: channels.collect() };
    image.to_srgb8(exposure).unwrap()
}

#[test]
fn ply_keeps_every_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    let tent = Tent::new();
    let mut columns = columns(&MIXED);
    columns.extend(prt(1));
    columns[0].samples[3] = f32::NAN;
    let options = WriteOptions { exposure: -1.0, metadata: Some("{\n\"a\": 1}"), ..WriteOptions::default() };
    tent.values(&columns).write(&path, &options).unwrap();

    let ply = Parser::<DefaultElement>::new().read_ply(&mut fs::File::open(&path).unwrap()).unwrap();
    let bytes = fs::read(&path).unwrap();
    let end = bytes.windows(11).position(|window| window == b"end_header\n").unwrap() + 11;
    assert_eq!(ply.header.comments, ["finalgather { \"a\": 1}".to_owned(), format!("sha256 {}", sha256(&bytes[end..]))]);
    let bits = |name: &str| -> Vec<u32> {
        let float = |vertex: &DefaultElement| match vertex[name] {
            Property::Float(value) => value.to_bits(),
            ref other => panic!("{name} is {other:?}"),
        };
        ply.payload["vertex"].iter().map(float).collect()
    };
    let names = ["ao", "irradiance_r", "irradiance_g", "irradiance_b", "bent_normal_x", "bent_normal_y", "bent_normal_z"];
    for (column, name) in columns.iter().zip(names.into_iter().chain(["prt_00_r", "prt_00_g", "prt_00_b"])) {
        assert_eq!(bits(name), column.samples.iter().map(|sample| sample.to_bits()).collect::<Vec<_>>(), "{name}");
    }
    let colours: Vec<u8> = ply.payload["vertex"]
        .iter()
        .flat_map(|vertex| ["red", "green", "blue"].map(|name| vertex[name].to_u8_color_lossy().unwrap()))
        .collect();
    assert_eq!(colours, shown(-1.0, [1, 2, 3].map(|i| columns[i].samples.as_slice())));
    let faces: Vec<_> = ply.payload["face"].iter().map(|face| face["vertex_indices"].to_u32_list().unwrap()).collect();
    assert_eq!(faces, tent.mesh.triangles.iter().map(|triangle| triangle.vertices.to_vec()).collect::<Vec<_>>());

    // What was baked can be baked again.
    let points: Vec<_> =
        tent.world.iter().zip(&tent.normals).map(|(&position, &normal)| OrientedPoint { position, normal }).collect();
    assert_eq!(file::read(&path).unwrap(), points);
}

#[test]
fn without_light_colours_show_what_there_is() {
    let folder = tempfile::tempdir().unwrap();
    let tent = Tent::new();
    let colours = |columns: &[Channel]| -> Vec<[u8; 3]> {
        let path = folder.path().join("a.ply");
        tent.values(columns).write(&path, &WriteOptions::default()).unwrap();
        let ply = Parser::<DefaultElement>::new().read_ply(&mut fs::File::open(&path).unwrap()).unwrap();
        let colour = |vertex: &DefaultElement| ["red", "green", "blue"].map(|name| vertex[name].to_u8_color_lossy().unwrap());
        ply.payload["vertex"].iter().map(colour).collect()
    };
    let constant = |name: &str, value| Channel { name: name.into(), samples: vec![value; 12] };
    // sRGB of 0.5 is 188, of 0.25 is 137.
    assert_eq!(colours(&[constant("AO", 0.5)]), [[188; 3]; 12]);
    let transfer = ["PRT.00.R", "PRT.00.G", "PRT.00.B"].map(|name| constant(name, 0.25 / (2.0 * PI.sqrt())));
    assert_eq!(colours(&transfer), [[137; 3]; 12]);
    let radiance = ["SH.00.R", "SH.00.G", "SH.00.B"].map(|name| constant(name, 0.25 * 2.0 * PI.sqrt()));
    assert_eq!(colours(&radiance), [[137; 3]; 12]);
    let directions = colours(&[]);
    assert!((1..12).all(|i| (directions[i] == directions[i - 1]) == (i % 4 != 0)), "{directions:?}");
}

/// What a file says of its shape, its numbers, and the JSON beside it.
fn read_npy(path: &Path) -> (String, Vec<f32>, Value) {
    let bytes = fs::read(path).unwrap();
    assert_eq!(bytes[..8], *b"\x93NUMPY\x01\x00");
    let (header, data) = bytes[10..].split_at(u16::from_le_bytes([bytes[8], bytes[9]]).into());
    // Numbers begin where memory may be mapped.
    assert_eq!((header.len() + 10) % 64, 0);
    let header = str::from_utf8(header).unwrap();
    let shape = header.strip_prefix("{'descr': '<f4', 'fortran_order': False, 'shape': (").unwrap();
    let shape = shape.strip_suffix('\n').unwrap().trim_end().strip_suffix("), }").unwrap();
    let about = serde_json::from_slice(&fs::read(path.with_extension("json")).unwrap()).unwrap();
    (shape.to_owned(), data.as_chunks().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect(), about)
}

#[test]
fn numpy_gets_the_shape_of_the_quantity() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npy");
    let tent = Tent::new();
    let several = [columns(&IRRADIANCE), prt(4)].concat();
    let cases = [
        (columns(&["AO"]), vec![12], vec!["AO"], false),
        (columns(&IRRADIANCE), vec![12, 3], vec!["Irradiance"], false),
        (columns(&["SH.00.R", "SH.00.G", "SH.00.B"]), vec![12, 1, 3], vec!["SH"], true),
        (prt(9), vec![12, 9, 3], vec!["PRT"], true),
        (several, vec![12, 15], vec!["Irradiance", "PRT"], true),
        // No order has two coefficients.
        (prt(2), vec![12, 6], vec!["PRT"], true),
    ];
    for (columns, expected_shape, quantities, has_basis) in cases {
        let options = WriteOptions { metadata: Some("{\"directions\": 64}"), ..Default::default() };
        tent.values(&columns).write(&path, &options).unwrap();
        let (shape, numbers, about) = read_npy(&path);
        assert_eq!(shape, expected_shape.iter().map(|side| format!("{side}, ")).collect::<String>());
        let rows: Vec<f32> = (0..12).flat_map(|i| columns.iter().map(move |column| column.samples[i])).collect();
        assert_eq!(numbers, rows);
        assert_eq!(about["shape"], Value::from(expected_shape));
        assert_eq!(about["columns"], columns.iter().map(|column| column.name.as_str()).collect::<Value>());
        assert_eq!(about["quantities"].as_object().unwrap().keys().collect::<Vec<_>>(), quantities);
        assert_eq!(about["basis"].as_str().is_some_and(|basis| basis.contains("l (l + 1) + m")), has_basis);
        assert_eq!(about["finalgather"]["directions"], 64);
    }
}

#[test]
fn transfer_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npy");
    let tent = Tent::new();
    for (columns, expected) in [(prt(9), prt(9)), ([columns(&IRRADIANCE), prt(4)].concat(), prt(4)), (prt(1), prt(1))] {
        tent.values(&columns).write(&path, &WriteOptions::default()).unwrap();
        assert_eq!(read_prt(&path).unwrap(), expected);
    }

    let refused = |fragment: &str| {
        let error = read_prt(&path).unwrap_err();
        assert!(matches!(error, Error::Input { .. }) && error.to_string().contains(fragment), "has no \"{fragment}\": {error}");
    };
    tent.values(&prt(2)).write(&path, &WriteOptions::default()).unwrap();
    refused("not the coefficients");
    tent.values(&columns(&IRRADIANCE)).write(&path, &WriteOptions::default()).unwrap();
    refused("not the coefficients");
    let mut broken = prt(4);
    broken[5].samples[7] = f32::INFINITY;
    tent.values(&broken).write(&path, &WriteOptions::default()).unwrap();
    refused("PRT.01.B of point 8 is inf");
    fs::write(path.with_extension("json"), "{\"columns\": [\"PRT.00.R\"]}").unwrap();
    refused("1 columns are named for an array of the shape [12, 4, 3]");
    fs::write(path.with_extension("json"), "{").unwrap();
    refused("not JSON");
    fs::remove_file(path.with_extension("json")).unwrap();
    refused("not readable");
}

#[test]
fn obj_with_a_light_map_is_a_scene() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("baked.obj");
    let (tent, irradiance) = (Tent::new(), lightmap_image());
    let lightmap = Lightmap { surface: tent.surface(), uvs: &tent.lightmap_uvs(), irradiance: Some(&irradiance), openness: None };
    lightmap.write(&path, &WriteOptions { exposure: 1.0, ..WriteOptions::default() }).unwrap();

    let scene = World::load(&path).unwrap().world;
    let [mesh] = &scene.meshes[..] else { panic!("more than one mesh") };
    assert_eq!(mesh.triangles.len(), 6);
    for (i, triangle) in mesh.triangles.iter().enumerate() {
        for (was, is) in tent.mesh.triangles[i].vertices.into_iter().zip(triangle.vertices) {
            let (was, is) = (was as usize, is as usize);
            assert_eq!(mesh.positions[is], tent.mesh.positions[was]);
            assert_eq!(mesh.uvs[is], lightmap.uvs[was]);
            assert!((mesh.normals[is] - tent.mesh.normals[was]).length() < 1e-6);
        }
        let (was, is) = (&tent.materials[i / 2], &scene.materials[triangle.material as usize]);
        assert_eq!((&is.name, is.emission, is.albedo_texture), (&was.name, was.emission, Some(0)));
        let mean = if was.albedo_texture.is_some() { 0.5 } else { 1.0 };
        assert!((is.albedo - was.albedo * mean).length() < 1e-6, "{} is {}", is.name, is.albedo);
    }
    let texels: Vec<u8> = scene.textures[0].texels.iter().flat_map(|&[r, g, b, _]| [r, g, b]).collect();
    assert_eq!(texels, shown(1.0, irradiance.rgb().unwrap()));
}

/// A GLB that the Khronos validator passes.
struct Glb {
    root: Value,
    blob: Vec<u8>,
}

impl Glb {
    fn read(path: &Path) -> Self {
        khronos::check(path);
        let gltf::Glb { json, bin, .. } = gltf::Glb::from_reader(fs::File::open(path).unwrap()).unwrap();
        Self { root: serde_json::from_slice(&json).unwrap(), blob: bin.unwrap().into_owned() }
    }

    fn floats(&self, accessor: usize) -> Vec<f32> {
        assert_eq!(self.root["accessors"][accessor]["componentType"], 5126);
        let view = self.root["accessors"][accessor]["bufferView"].as_u64().unwrap();
        self.view(view).as_chunks::<4>().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect()
    }

    fn view(&self, index: u64) -> &[u8] {
        let view = &self.root["bufferViews"][index as usize];
        let offset = view["byteOffset"].as_u64().unwrap() as usize;
        &self.blob[offset..offset + view["byteLength"].as_u64().unwrap() as usize]
    }

    /// A picture's pixels.
    fn picture(&self, texture: &Value) -> Vec<u8> {
        let image = &self.root["textures"][texture["index"].as_u64().unwrap() as usize]["source"];
        let view = &self.root["images"][image.as_u64().unwrap() as usize]["bufferView"];
        let png = self.view(view.as_u64().unwrap());
        ::image::load_from_memory_with_format(png, ::image::ImageFormat::Png).unwrap().into_rgb8().into_raw()
    }
}

/// The validator looks: a file that says of an accessor what is not so does not pass.
#[test]
fn wrong_gltf_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    let (tent, columns) = (Tent::new(), columns(&["AO"]));
    tent.values(&columns).write(&path, &WriteOptions::default()).unwrap();
    let mut bytes = fs::read(&path).unwrap();
    let (right, wrong) = (br#""count":12"#, br#""count":13"#);
    let place = bytes.windows(right.len()).position(|window| window == right).expect("it has twelve vertices");
    bytes[place..place + wrong.len()].copy_from_slice(wrong);
    fs::write(&path, &bytes).unwrap();
    if let Some(issues) = khronos::issues(&path) {
        assert!(issues["numErrors"].as_u64().unwrap() > 0, "{issues:#}");
    }
}

#[test]
fn gltf_of_vertices() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    let tent = Tent::new();
    let columns = [columns(&MIXED), prt(4)].concat();
    let options = WriteOptions { exposure: -2.0, metadata: Some("{\"directions\": 64}"), ..WriteOptions::default() };
    tent.values(&columns).write(&path, &options).unwrap();
    let glb = Glb::read(&path);
    assert_eq!(glb.root["asset"]["extras"]["directions"], 64);

    let document = gltf::Gltf::from_slice(&fs::read(&path).unwrap()).unwrap();
    let mesh = document.meshes().next().unwrap();
    let irradiance = [1, 2, 3].map(|i| columns[i].samples.as_slice());
    let expected_colours = shown(-2.0, irradiance);
    for (plate, primitive) in mesh.primitives().enumerate() {
        let reader = primitive.reader(|_| Some(&glb.blob));
        let vec3s = |values: &mut dyn Iterator<Item = [f32; 3]>| values.map(Vec3::from).collect::<Vec<_>>();
        assert_eq!(vec3s(&mut reader.read_positions().unwrap()), tent.mesh.positions);
        assert_eq!(vec3s(&mut reader.read_normals().unwrap()), tent.normals);
        let uvs: Vec<_> = reader.read_tex_coords(0).unwrap().into_f32().map(|[u, v]| vec2(u, 1.0 - v)).collect();
        assert_eq!(uvs, tent.mesh.uvs);
        let indices: Vec<u32> = reader.read_indices().unwrap().into_u32().collect();
        assert_eq!(indices, tent.mesh.triangles[2 * plate..][..2].iter().flat_map(|t| t.vertices).collect::<Vec<_>>());
        // Linear, where the PNG's are sRGB.
        let colours = reader.read_colors(0).unwrap().into_rgb_f32().flatten();
        for (linear, expected) in colours.zip(&expected_colours) {
            let srgb = finalgather::image::encode_srgb(linear) * 255.0;
            assert!((srgb - f32::from(*expected)).abs() < 0.51, "{srgb}, not {expected}");
        }
        let material = primitive.material();
        let surface = material.pbr_metallic_roughness();
        assert_eq!(surface.base_color_factor()[..3], tent.materials[plate].albedo.to_array());
        assert_eq!(surface.base_color_texture().is_some(), plate == 1);
        assert!(material.unlit() && material.double_sided());

        let custom: BTreeMap<_, _> = primitive
            .attributes()
            .filter_map(|(semantic, accessor)| match semantic {
                Semantic::Extras(name) => Some((name, glb.floats(accessor.index()))),
                _ => None,
            })
            .collect();
        let names: Vec<_> = custom.keys().map(String::as_str).collect();
        assert_eq!(names, ["AO", "BENT_NORMAL", "IRRADIANCE", "PRT_00", "PRT_01", "PRT_02", "PRT_03"]);
        let rows = |first: usize, width: usize| -> Vec<f32> {
            (0..12).flat_map(|i| columns[first..first + width].iter().map(move |column| column.samples[i])).collect()
        };
        assert_eq!((&custom["AO"], &custom["IRRADIANCE"]), (&rows(0, 1), &rows(1, 3)));
        assert_eq!((&custom["BENT_NORMAL"], &custom["PRT_02"]), (&rows(4, 3), &rows(13, 3)));
    }
    assert_eq!(mesh.primitives().len(), 3);
}

#[test]
fn gltf_of_points_alone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    let (tent, columns) = (Tent::new(), columns(&["AO"]));
    PointValues { surface: None, ..tent.values(&columns) }.write(&path, &WriteOptions::default()).unwrap();
    let glb = Glb::read(&path);
    let primitives = &glb.root["meshes"][0]["primitives"];
    assert_eq!((primitives[0]["mode"].as_u64(), primitives[0].get("indices")), (Some(0), None));
    assert_eq!(glb.floats(primitives[0]["attributes"]["_AO"].as_u64().unwrap() as usize), columns[0].samples);
}

#[test]
fn gltf_with_a_light_map() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    let (tent, irradiance) = (Tent::new(), lightmap_image());
    let uvs = tent.lightmap_uvs();
    let lightmap = Lightmap { surface: tent.surface(), uvs: &uvs, irradiance: Some(&irradiance), openness: None };
    lightmap.write(&path, &WriteOptions { exposure: 1.0, ..WriteOptions::default() }).unwrap();
    let glb = Glb::read(&path);
    let blob = glb.blob.as_slice();
    let document = gltf::Gltf::from_slice(&fs::read(&path).unwrap()).unwrap();
    assert_eq!(document.variants().unwrap().map(|variant| variant.name().to_owned()).collect::<Vec<_>>(), ["shown", "lightmap"]);
    let brightest = irradiance.channels[0].samples[24 * 8 - 1];
    for (plate, primitive) in document.meshes().next().unwrap().primitives().enumerate() {
        let reader = primitive.reader(|_| Some(blob));
        let read: Vec<_> = reader.read_tex_coords(1).unwrap().into_f32().map(|[u, v]| vec2(u, 1.0 - v)).collect();
        assert!(read.iter().zip(&uvs).all(|(is, was)| (*is - *was).length() < 1e-6));
        let [shown_as, engine] = [0, 1].map(|variant| {
            let mapping = primitive.mappings().find(|mapping| mapping.variants() == [variant]).unwrap();
            &glb.root["materials"][mapping.material().index().unwrap()]
        });
        assert_eq!(shown_as["name"], tent.materials[plate].name);
        assert_eq!(primitive.material().index(), Some(2 * plate));
        assert!(primitive.material().unlit());
        let picture = &shown_as["pbrMetallicRoughness"]["baseColorTexture"];
        match plate {
            // A lamp shows its own light, here beyond white.
            2 => assert!(picture.is_null() && shown_as["pbrMetallicRoughness"]["baseColorFactor"][0].as_f64().unwrap() > 0.99),
            _ => {
                assert_eq!(picture["texCoord"], 1);
                let texture = primitive.material().pbr_metallic_roughness().base_color_texture().unwrap().texture();
                assert_eq!(texture.sampler().min_filter(), Some(gltf::texture::MinFilter::Linear));
                assert_eq!(texture.sampler().wrap_s(), gltf::texture::WrappingMode::ClampToEdge);
                assert_eq!(glb.picture(picture), shown(1.0, irradiance.rgb().unwrap()));
            }
        }
        let map = &engine["extensions"]["MOZ_lightmap"];
        assert_eq!((map["texCoord"].as_u64(), map["intensity"].as_f64().unwrap() as f32), (Some(1), brightest));
        let texels = glb.picture(map);
        for (i, texel) in texels.as_chunks::<3>().0.iter().enumerate() {
            for (channel, sample) in irradiance.channels.iter().zip(texel) {
                let value = f32::from(*sample) / 255.0 * brightest;
                assert!((value - channel.samples[i]).abs() <= brightest / 255.0 * 0.501, "{value}, not {}", channel.samples[i]);
            }
        }
        assert_eq!(engine["pbrMetallicRoughness"]["baseColorTexture"]["index"].is_u64(), plate == 1);
    }
    // Where some shading is flat there are no normals, which means flat in glTF.
    let mut flat = Tent::new();
    flat.mesh.normals[0] = Vec3::ZERO;
    Lightmap { surface: flat.surface(), ..lightmap }.write(&path, &WriteOptions::default()).unwrap();
    assert!(Glb::read(&path).root["meshes"][0]["primitives"][0]["attributes"]["NORMAL"].is_null());
}

#[test]
fn what_cannot_be_written_is_said_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (tent, irradiance) = (Tent::new(), lightmap_image());
    let refused = |name: &str, columns: &[Channel], fragment: &str| {
        let error = tent.values(columns).write(&folder.path().join(name), &WriteOptions::default()).unwrap_err();
        assert!(matches!(error, Error::Usage { .. }) && error.to_string().contains(fragment), "has no \"{fragment}\": {error}");
    };
    refused("a.stl", &[], "end the path in .ply, .npy, .npz, .glb, .obj");
    refused("a.ply", &columns(&["AO", "AO"]), "two columns AO");
    let mut short = columns(&["AO"]);
    short[0].samples.pop();
    refused("a.npy", &short, "AO: 11 values for 12 points");
    let mut broken = columns(&["AO"]);
    broken[0].samples[3] = f32::NAN;
    refused("a.glb", &broken, "AO is not finite");
    let none = PointValues { positions: Positions::near(&[]), normals: &[], columns: &[], surface: None, sources: None };
    assert!(none.write(&folder.path().join("a.ply"), &WriteOptions::default()).unwrap_err().to_string().contains("no points"));
    let lightmap = Lightmap { surface: tent.surface(), uvs: &[], irradiance: Some(&irradiance), openness: None };
    let error = lightmap.write(&folder.path().join("a.glb"), &WriteOptions::default()).unwrap_err();
    assert!(error.to_string().contains("0 coordinates on the light map for 12 vertices"), "{error}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);

    check_writable(&folder.path().join("a.NPY"), PointValues::ENDINGS).unwrap();
    assert!(check_writable(&folder.path().join("a.ply"), Lightmap::ENDINGS).is_err());
    assert!(check_writable(&folder.path().join("absent/a.glb"), Lightmap::ENDINGS).is_err());
}
