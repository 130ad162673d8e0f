//! Materials and textures.

use finalgather::scene::{Gloss, NormalMap, Opacity, Sampler, Surface, World, WrapMode};
use glam::{Vec2, Vec3, vec3};
use image::ImageFormat;
use serde_json::{Value, json};

use crate::build::{Model, albedo_at, encoded, only, png};

/// Four tiles: red, green; blue, white.
const TILES: [[u8; 3]; 4] = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255]];

/// A square with four tiles, each of two by two texels so that their middles have one colour.
fn tiled(texture: &Value, sampler: Value) -> Model {
    let base = json!({ "baseColorTexture": texture, "metallicFactor": 0 });
    let mut model = Model::square(json!({ "pbrMetallicRoughness": base }));
    let tile = |x: usize, y: usize| TILES[x / 4 + y / 4 * 2];
    let pixels: Vec<[u8; 3]> = (0..64).map(|i| tile(i % 8, i / 8)).collect();
    model.texture(&png(8, &pixels), sampler);
    model
}

/// Colours in the middle of the four tiles: top left, top right, bottom left, bottom right.
fn tiles_of(world: &World) -> [Vec3; 4] {
    let scene = world.flatten();
    [[0.25, 0.75], [0.75, 0.75], [0.25, 0.25], [0.75, 0.25]].map(|[x, y]| albedo_at(&scene, [x, y, 0.0]))
}

/// As the samples `SimpleTexture` and `BoxTextured`.
#[test]
fn texture_multiplies_the_factor() {
    let mut model = tiled(&json!({ "index": 0 }), json!({}));
    assert_eq!(tiles_of(&model.world()), [Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE]);
    model.json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = json!([0.5, 0.25, 1.0, 0.3]);
    let found = tiles_of(&model.world());
    assert_eq!(found, [vec3(0.5, 0.0, 0.0), vec3(0.0, 0.25, 0.0), Vec3::Z, vec3(0.5, 0.25, 1.0)]);
}

/// As the sample `TextureTransformTest`: the transform acts where v points down.
#[test]
fn texture_transforms() {
    let quarter = std::f32::consts::FRAC_PI_2;
    let (red, green, blue, white) = (Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE);
    let cases = [
        // Half a picture to the left, then up: v grows downwards.
        (json!({ "offset": [0.5, 0.0] }), [green, red, white, blue]),
        (json!({ "offset": [0.0, 0.5] }), [blue, white, red, green]),
        // The coordinates turn counter-clockwise about the top left corner, so the picture turns clockwise.
        (json!({ "rotation": quarter, "offset": [0.0, 1.0] }), [blue, red, white, green]),
        // The top left quarter of the square shows the whole picture, and so do the others.
        (json!({ "scale": [0.5, 0.5] }), [red, red, red, red]),
        (json!({ "scale": [0.5, 0.5], "offset": [0.5, 0.5] }), [white; 4]),
        // Scaled first, then turned.
        (json!({ "scale": [1.0, 0.0], "rotation": quarter, "offset": [0.25, 1.0] }), [blue, red, blue, red]),
    ];
    for (transform, expected) in cases {
        let texture = json!({ "index": 0, "extensions": { "KHR_texture_transform": transform } });
        let found = tiles_of(&tiled(&texture, json!({})).world());
        let near = found.iter().zip(expected).all(|(&found, expected)| found.distance(expected) < 1e-3);
        assert!(near, "{transform}: {found:?} is not {expected:?}");
    }
    // The extension may choose another set, which this square does not have.
    let texture = json!({ "index": 0, "extensions": { "KHR_texture_transform": { "texCoord": 1 } } });
    let (world, warnings) = tiled(&texture, json!({})).load();
    assert_eq!(only(&world).uvs, [Vec2::ZERO; 4]);
    assert_eq!(warnings, ["2 triangles with a texture have no texture coordinates and show one colour"]);
}

/// As the sample `TextureSettingsTest`.
#[test]
fn samplers() {
    let (repeat, mirror, clamp) = (WrapMode::Repeat, WrapMode::Mirror, WrapMode::Clamp);
    let cases = [
        (json!({}), [repeat, repeat], false),
        (json!({ "wrapS": 10497, "wrapT": 33071, "magFilter": 9729 }), [repeat, clamp], false),
        (json!({ "wrapS": 33648, "wrapT": 10497, "magFilter": 9728 }), [mirror, repeat], true),
        // Minification alone does not make edges hard.
        (json!({ "wrapS": 33071, "wrapT": 33648, "minFilter": 9728 }), [clamp, mirror], false),
    ];
    for (sampler, wrap, nearest) in cases {
        let world = tiled(&json!({ "index": 0 }), sampler).world();
        assert_eq!(world.textures[0].sampler, Sampler { wrap, nearest });
    }
    // One picture with two samplers makes two textures, with the same sampler one.
    let mut model = tiled(&json!({ "index": 0 }), json!({}));
    model.push("samplers", json!({ "magFilter": 9728 }));
    model.push("textures", json!({ "source": 0, "sampler": 1 }));
    model.push("textures", json!({ "source": 0 }));
    for texture in [1, 2] {
        model.push("materials", json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": texture } } }));
    }
    let world = model.world();
    assert_eq!(world.materials.iter().map(|material| material.albedo_texture).collect::<Vec<_>>(), [Some(0), Some(1), Some(0)]);
    assert_eq!(world.textures.len(), 2);
}

/// As the sample `EmissiveStrengthTest`, and as those with emissive textures.
#[test]
fn emission() {
    let mut model = Model::square(json!({
        "emissiveFactor": [1.0, 0.5, 0.25],
        "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 8.0 } },
        "doubleSided": true,
    }));
    let world = model.world();
    assert_eq!((world.materials[0].emission, world.materials[0].two_sided), (vec3(8.0, 4.0, 2.0), true));
    assert!(!world.is_dark());
    // Half black, half white: the mean of the linear colours is a half.
    model.texture(&png(2, &[[0; 3], [255; 3]]), json!({}));
    model.json["materials"][0]["emissiveTexture"] = json!({ "index": 0 });
    model.json["images"][0]["name"] = json!("glow");
    let world = model.world();
    let shines = |world: &World| (world.materials[0].emission, world.materials[0].emission_texture);
    assert_eq!(shines(&world), (vec3(8.0, 4.0, 2.0), Some(0)));
    assert_eq!((world.textures.len(), world.materials[0].albedo_texture), (1, None), "a texture that shines is no albedo");
    assert!(world.has_lamps() && !world.materials[0].unshaded.iter().any(|note| note.contains("emission")));
    // Under the base colour's coordinates it stays; beside others it shines with its mean.
    model.json["materials"][0]["pbrMetallicRoughness"] = json!({ "baseColorTexture": { "index": 0 }, "metallicFactor": 0.0 });
    assert_eq!(shines(&model.world()), (vec3(8.0, 4.0, 2.0), Some(0)));
    let scaled = json!({ "index": 0, "extensions": { "KHR_texture_transform": { "scale": [2.0, 2.0] } } });
    model.json["materials"][0]["emissiveTexture"] = scaled;
    let world = model.world();
    assert_eq!(shines(&world), (vec3(4.0, 2.0, 1.0), None));
    let note = "emission texture glow, with other coordinates than the base colour: the mean colour shines";
    assert!(world.materials[0].unshaded.contains(&note.to_owned()));
    // A few lights on black show, and are no lamp.
    model.json["materials"][0]["emissiveTexture"] = json!({ "index": 0 });
    model.json["materials"][0]["emissiveFactor"] = json!([0.01, 0.01, 0.01]);
    let world = model.world();
    assert!(shines(&world).1.is_some() && !world.has_lamps() && !world.is_dark());
    assert!(world.gets_sky(false, false) && !world.gets_sky(true, false));
    model.json["materials"][0]["emissiveFactor"] = json!([1.0, 0.5, 0.25]);
    // A back that shines not is a lamp of one side; a material that does not shine has none.
    model.json["materials"][0]["doubleSided"] = json!(false);
    assert!(!model.world().materials[0].two_sided);
}

fn material(material: Value) -> finalgather::scene::Material {
    Model::square(material).world().materials.swap_remove(0)
}

/// As the samples `MetalRoughSpheres` and `TransmissionTest`: what of them can be shown.
#[test]
fn mirrors_and_glass() {
    let metal = |metallic: f32, roughness: f32| {
        let base = json!({ "baseColorFactor": [0.9, 0.8, 0.7, 1.0], "metallicFactor": metallic, "roughnessFactor": roughness });
        material(json!({ "pbrMetallicRoughness": base }))
    };
    let mirror = metal(1.0, 0.0);
    assert_eq!((mirror.surface, mirror.albedo, mirror.unshaded.len()), (Surface::Mirror, vec3(0.9, 0.8, 0.7), 0));
    let dull = metal(1.0, 0.3);
    assert_eq!((dull.surface, dull.albedo), (Surface::Diffuse, vec3(0.9, 0.8, 0.7)));
    let gloss = |metal: &finalgather::scene::Material| metal.gloss.map(|gloss| (gloss.metallic, gloss.roughness, gloss.specular));
    assert_eq!((gloss(&dull), dull.unshaded.len()), (Some((1.0, 0.3, Vec3::splat(0.04))), 0));
    assert_eq!(gloss(&metal(0.0, 1.0)), Some((0.0, 1.0, Vec3::splat(0.04))));
    // Without keys a material is a rough metal.
    assert_eq!(gloss(&material(json!({ "pbrMetallicRoughness": {} }))), Some((1.0, 1.0, Vec3::splat(0.04))));
    let glass = |extensions: Value, roughness: f32| {
        let base = json!({ "baseColorFactor": [1.0, 0.5, 0.25, 1.0], "metallicFactor": 0, "roughnessFactor": roughness });
        material(json!({ "pbrMetallicRoughness": base, "extensions": extensions }))
    };
    let clear = json!({ "transmissionFactor": 1.0 });
    // A sheet bends nothing. It is one face, which applies the root of the filter.
    let sheet = glass(json!({ "KHR_materials_transmission": clear, "KHR_materials_ior": { "ior": 1.4 } }), 0.0);
    assert_eq!(sheet.surface, Surface::Glass { index: 1.0, filter: vec3(1.0, 0.25, 0.0625) });
    let body = json!({ "thicknessFactor": 2.0, "attenuationDistance": 1.0, "attenuationColor": [0.5, 1.0, 1.0] });
    let extensions =
        json!({ "KHR_materials_transmission": clear, "KHR_materials_ior": { "ior": 1.4 }, "KHR_materials_volume": body });
    let Surface::Glass { index, filter } = glass(extensions.clone(), 0.0).surface else { panic!("no glass") };
    assert!(index == 1.4 && filter.distance(vec3(0.25, 0.5, 0.25)) < 1e-6, "{index} {filter}");
    let frosted = glass(extensions, 0.4);
    assert_eq!((frosted.surface, &frosted.unshaded[..]), (Surface::Diffuse, &["transmission 1".to_owned()][..]));
    // ((1.4 - 1) / (1.4 + 1))²
    assert!((frosted.gloss.unwrap().specular - Vec3::splat(1.0 / 36.0)).length() < 1e-6, "{:?}", frosted.gloss);
}

/// As the samples `UnlitTest`, `AlphaBlendModeTest`, `NormalTangentTest`, `SpecularTest`, `ClearCoatTest`: noted for a later version.
#[test]
fn what_is_not_shown_is_noted() {
    let mut model = Model::square(json!({
        "name": "all",
        "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.5, 0.5, 0.25], "metallicFactor": 0.5, "metallicRoughnessTexture": { "index": 0 } },
        "normalTexture": { "index": 0 },
        "occlusionTexture": { "index": 0 },
        "doubleSided": true,
        "extensions": {
            "KHR_materials_unlit": {},
            "KHR_materials_specular": { "specularFactor": 0.5 },
            "KHR_materials_ior": { "ior": 1.8 },
            "KHR_materials_clearcoat": { "clearcoatFactor": 1.0 },
        },
    }));
    model.texture(&png(1, &[[255; 3]]), json!({}));
    model.json["images"][0]["name"] = json!("bumps");
    let material = model.world().materials.swap_remove(0);
    let expected = ["unlit", "clearcoat"];
    assert_eq!(material.unshaded, expected);
    assert_eq!((material.name.as_str(), material.albedo, material.surface), ("all", Vec3::splat(0.5), Surface::Diffuse));
    let warnings = model.load_with(crate::build::options()).unwrap().report.warnings;
    assert_eq!(warnings.len(), 1);
    assert!(warnings[0].contains("what pictures do not show yet: all (unlit, "), "{warnings:?}");
}

/// As the samples `AlphaBlendModeTest` and `AlphaBlendLitTest`: the factor's alpha multiplies that of the texture, which an opaque material ignores.
#[test]
fn alpha_modes() {
    for (mode, cutoff, alpha, texel, expected) in [
        ("OPAQUE", None, 0.25, 9, Opacity::default()),
        ("BLEND", None, 0.25, 255, Opacity { share: 0.25, texture: None, cutoff: None }),
        ("BLEND", None, 1.0, 9, Opacity { share: 1.0, texture: Some(0), cutoff: None }),
        ("BLEND", None, 1.0, 255, Opacity::default()),
        ("MASK", None, 0.75, 9, Opacity { share: 0.75, texture: Some(0), cutoff: Some(0.5) }),
        ("MASK", Some(0.25), 1.0, 9, Opacity { share: 1.0, texture: Some(0), cutoff: Some(0.25) }),
        ("MASK", Some(0.25), 0.5, 255, Opacity::default()),
        ("MASK", None, 0.25, 255, Opacity { share: 0.25, texture: None, cutoff: Some(0.5) }),
    ] {
        let base = json!({ "baseColorFactor": [1, 1, 1, alpha], "baseColorTexture": { "index": 0 } });
        let mut model = Model::square(json!({ "pbrMetallicRoughness": base, "alphaMode": mode }));
        if let Some(cutoff) = cutoff {
            model.json["materials"][0]["alphaCutoff"] = json!(cutoff);
        }
        let mut picture = Vec::new();
        let texels = image::RgbaImage::from_pixel(1, 1, image::Rgba([255, 255, 255, texel]));
        texels.write_to(&mut std::io::Cursor::new(&mut picture), ImageFormat::Png).unwrap();
        model.texture(&picture, json!({}));
        let world = model.world();
        assert_eq!(world.materials[0].opacity, expected, "{mode}, cutoff {cutoff:?}, alpha {alpha} x {texel}");
        assert!(!world.materials[0].unshaded.iter().any(|note| note.contains("alpha")), "{:?}", world.materials[0].unshaded);
    }
}

/// As the sample `SpecGlossVsMetalRough`.
#[test]
fn specular_glossiness() {
    let mut model = tiled(&json!({ "index": 0 }), json!({}));
    model.json["extensionsRequired"] = json!(["KHR_materials_pbrSpecularGlossiness"]);
    let old = json!({ "diffuseFactor": [0.5, 0.5, 0.5, 1.0], "diffuseTexture": { "index": 0 }, "glossinessFactor": 0.75 });
    model.json["materials"][0] = json!({ "extensions": { "KHR_materials_pbrSpecularGlossiness": old } });
    let world = model.world();
    assert_eq!(tiles_of(&world), [Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE].map(|color| 0.5 * color));
    let material = &world.materials[0];
    assert_eq!(
        (material.gloss, material.unshaded.len()),
        (Some(Gloss { roughness: 0.25, specular: Vec3::ONE, ..Gloss::default() }), 0)
    );
}

/// As the samples `NormalTangentTest` and `SpecularTest`.
#[test]
fn gloss_and_normal_maps_share_the_coordinates_of_the_base_colour() {
    let transform = json!({ "KHR_texture_transform": { "scale": [2.0, 2.0] } });
    let build = |of_base: Value, of_gloss: Value, of_normal: Value| {
        let info = |extensions: Value| json!({ "index": 0, "extensions": extensions });
        let mut model = Model::square(json!({
            "pbrMetallicRoughness": {
                "baseColorTexture": info(of_base), "metallicRoughnessTexture": info(of_gloss), "metallicFactor": 0.25, "roughnessFactor": 0.5,
            },
            "normalTexture": { "index": 0, "scale": 0.75, "extensions": of_normal },
            "extensions": { "KHR_materials_specular": { "specularFactor": 0.5, "specularColorFactor": [1.0, 0.5, 30.0] } },
        }));
        model.texture(&png(1, &[[255; 3]]), json!({}));
        model.world().materials.swap_remove(0)
    };
    for same in [json!({}), transform.clone()] {
        let material = build(same.clone(), same.clone(), same);
        let expected =
            Gloss { roughness: 0.5, metallic: 0.25, specular: vec3(0.02, 0.01, 0.5), texture: material.albedo_texture };
        let gloss = material.gloss.unwrap();
        assert!((gloss.specular - expected.specular).length() < 1e-6, "{gloss:?}");
        assert_eq!(Gloss { specular: expected.specular, ..gloss }, expected);
        assert_eq!(material.normal_map, Some(NormalMap { texture: 0, scale: 0.75 }));
        assert!(material.unshaded.is_empty(), "{:?}", material.unshaded);
    }
    let material = build(json!({}), transform.clone(), transform);
    assert_eq!((material.gloss, material.normal_map, material.unshaded.len()), (None, None, 2));
}

/// As the sample `TextureEncodingTest` and `EXT_texture_webp`: PNG, JPEG and WebP, told by their bytes.
#[test]
fn picture_formats() {
    for format in [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::WebP] {
        let mut model = Model::square(json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }));
        model.texture(&encoded(8, &[[0, 0, 255]; 64], format), json!({}));
        if format == ImageFormat::WebP {
            model.json["textures"][0] = json!({ "extensions": { "EXT_texture_webp": { "source": 0 } } });
            model.json["extensionsRequired"] = json!(["EXT_texture_webp"]);
        }
        let albedo = albedo_at(&model.world().flatten(), [0.5, 0.4, 0.0]);
        assert!(albedo.distance(Vec3::Z) < 0.02, "{format:?}: {albedo}");
    }
    // A large WebP of one colour is a short file.
    let mut model = Model::square(json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }));
    let flat = encoded(2048, &vec![[9, 9, 9]; 2048 * 2048], ImageFormat::WebP);
    assert!(flat.len() < 2048 * 2048 * 3 / 2048, "{} bytes would do without an exception", flat.len());
    model.texture(&flat, json!({}));
    assert_eq!(model.world().textures[0].width, 2048);
}

#[test]
fn basis_pictures_are_refused_by_name() {
    let mut model = tiled(&json!({ "index": 0 }), json!({}));
    model.json["textures"][0]["extensions"] = json!({ "KHR_texture_basisu": { "source": 7 } });
    // With another picture to fall back on.
    assert_eq!(tiles_of(&model.world())[0], Vec3::X);
    model.json["textures"][0].as_object_mut().unwrap().remove("source");
    let (world, warnings) = model.load();
    assert_eq!((world.materials[0].albedo_texture, warnings.len()), (None, 1));
    assert!(warnings[0].contains("KTX2 (KHR_texture_basisu) alone"), "{warnings:?}");
    model.json["extensionsRequired"] = json!(["KHR_texture_basisu"]);
    let refusal = model.refusal();
    assert!(refusal.contains("requires the extension KHR_texture_basisu") && refusal.contains("gltf-transform png"), "{refusal}");
}

#[test]
fn a_bad_picture_leaves_the_colour() {
    let base = json!({ "baseColorFactor": [0.5, 0.25, 0.125, 1.0], "baseColorTexture": { "index": 0 } });
    let mut model = Model::square(json!({ "pbrMetallicRoughness": base }));
    model.texture(b"no picture", json!({}));
    let (world, warnings) = model.load();
    assert_eq!((world.materials[0].albedo, world.materials[0].albedo_texture), (vec3(0.5, 0.25, 0.125), None));
    assert_eq!(only(&world).uvs, [Vec2::ZERO; 4]);
    assert_eq!(warnings.len(), 1);
    let told = "m.glb: m.glb#images[0]: this texture, named at images[0] of m.glb, cannot be decoded";
    assert!(warnings[0].starts_with(told) && warnings[0].ends_with("its material has its colour alone"), "{warnings:?}");
    // A picture is told once, however often it is named.
    model.push("textures", json!({ "source": 0 }));
    let base = json!({ "baseColorTexture": { "index": 1 } });
    model.push(
        "materials",
        json!({ "pbrMetallicRoughness": base, "emissiveFactor": [1, 1, 1], "emissiveTexture": { "index": 0 } }),
    );
    let (world, again) = model.load();
    assert_eq!((&again, world.materials[1].emission), (&warnings, Vec3::ONE));
    model.json["images"][0] = json!({ "uri": "my%20tiles.png" });
    let (_, warnings) = model.load();
    assert!(warnings[0].contains("my tiles.png: cannot read this file, named at images[0] of m.glb"), "{warnings:?}");
    let strict = finalgather::scene::LoadOptions { strict: true, ..crate::build::options() };
    assert!(model.load_with(strict).unwrap_err().to_string().contains("my tiles.png"));
}

/// Factors out of range are brought into it: albedo is a share, and emission is finite.
#[test]
fn factors_are_in_range() {
    let found = material(json!({
        "pbrMetallicRoughness": { "baseColorFactor": [2.0, -1.0, 0.5, 1.0] },
        "emissiveFactor": [1e38, -1.0, 0.5],
        "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 10.0 } },
    }));
    assert_eq!((found.albedo, found.emission), (vec3(1.0, 0.0, 0.5), vec3(f32::MAX, 0.0, 5.0)));
}
