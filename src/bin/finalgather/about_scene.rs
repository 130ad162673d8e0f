//! What is in a scene, for `finalgather info SCENE`: as JSON, and as text of at most a screen.

use std::time::Instant;

use finalgather::error::Result;
use finalgather::job::{Estimate, SceneRequest, estimate};
use finalgather::points::Vertices;
use finalgather::prepared::Prepared;
use finalgather::scene::{Environment, Gloss, Loaded, Material, Mesh, PunctualKind, PunctualLight, Surface, World, WorldCamera};
use glam::{DVec3, Vec3};
use serde_json::{Value, json};

use crate::bake::LIGHT_MAP_SIDE;
use crate::report;

/// Lines of a list. Text names how many more there are, JSON has all.
const MOST: usize = 10;
/// The share of a light map that charts usually cover.
const COVERED: f64 = 0.55;
/// Texels along a unit for which the side of a map is told.
const TEXELS: f64 = 10.0;

/// Prints what is in a scene, and the warnings of its load.
pub fn show(request: &SceneRequest, as_json: bool) -> Result<()> {
    let start = Instant::now();
    // Openness needs no light, so a scene may have none.
    let Loaded { mut world, settings, report, .. } = request.load(false)?;
    // A render would add it, and its time depends on it.
    let adds_sky = world.gets_sky(request.strict, request.no_default_light);
    if adds_sky {
        world.environment = Some(Environment::soft_sky());
    }
    let prepared = Prepared::without_glass(&world)?;
    if adds_sky {
        // It is not in the scene.
        world.environment = None;
    }
    let loading = start.elapsed().as_secs_f64();
    let estimate = estimate(&prepared, &settings);
    let warnings = [report.warnings, prepared.warnings()].concat();
    let mut about = about(&world, &prepared, &estimate);
    about["adds_sky"] = json!(adds_sky);
    about["load_seconds"] = json!(loading);
    about["size"] = json!(settings.film.size);
    about["directions"] = json!(settings.directions.count);
    about["warnings"] = json!(warnings);
    if as_json { report::print_json(&about) } else { report::print(&lines(&about).join("\n")) }
}

fn about(world: &World, prepared: &Prepared, estimate: &Estimate) -> Value {
    let scene = &prepared.scene;
    let [min, max] = world.bounds();
    let areas = areas(world);
    // As a light map covers it.
    let scale = f64::from(scene.space.length_to_world(1.0)).powi(2);
    let area = scale * (0..scene.mesh.triangles.len()).map(|index| f64::from(scene.mesh.area(index))).sum::<f64>();
    json!({
        "file": world.file,
        "objects": world.instances.iter().map(|instance| object(&instance.name, &world.meshes[instance.mesh])).collect::<Vec<_>>(),
        "meshes": world.meshes.len(),
        "triangles": scene.mesh.triangles.len(),
        "vertices": world.instances.iter().map(|instance| world.meshes[instance.mesh].positions.len()).sum::<usize>(),
        "vertex_rows": Vertices::new(&scene.mesh, 0.0).points().len(),
        "vertex_colors": !scene.mesh.colors.is_empty(),
        "bounds": [min.to_array(), max.to_array()],
        "area": area,
        "materials": world.materials.iter().zip(&areas).map(|(one, &of)| material(one, of)).collect::<Vec<_>>(),
        "textures": world.textures.iter().map(|texture| json!([texture.width, texture.height])).collect::<Vec<_>>(),
        "cameras": world.cameras.iter().map(|(name, one)| camera(name, one)).collect::<Vec<_>>(),
        "lights": prepared.lights.count().saturating_sub(world.lights.iter().filter(|light| light.shines()).count()),
        "punctual_lights": world.lights.iter().map(punctual).collect::<Vec<_>>(),
        "emitted_power": world.materials.iter().zip(&areas).map(|(one, &(_, area))| emitted(world, one, area)).sum::<Vec3>().to_array(),
        "environment": world.environment.as_ref().map(mean_radiance),
        "light_map": {
            "side": LIGHT_MAP_SIDE,
            "texels_per_unit": f64::from(LIGHT_MAP_SIDE) * (COVERED / area).sqrt(),
            "side_for_10_texels_per_unit": (TEXELS * (area / COVERED).sqrt()).ceil() as u64,
        },
        "estimate": estimate,
    })
}

/// Number of triangles and area of each material.
fn areas(world: &World) -> Vec<(usize, f64)> {
    let mut areas = vec![(0, 0.0); world.materials.len()];
    for instance in &world.instances {
        let mesh = &world.meshes[instance.mesh];
        for (index, triangle) in mesh.triangles.iter().enumerate() {
            let [a, b, c] = mesh.corners(index).map(|corner| instance.transform.transform_point3(corner.as_dvec3()));
            let (count, area) = &mut areas[triangle.material as usize];
            *count += 1;
            *area += 0.5 * (b - a).cross(c - a).length();
        }
    }
    areas
}

fn object(name: &str, mesh: &Mesh) -> Value {
    json!({ "name": name, "triangles": mesh.triangles.len(), "vertices": mesh.positions.len(), "file_vertices": mesh.length_of_source() })
}

fn material(one: &Material, (triangles, area): (usize, f64)) -> Value {
    let surface = match one.surface {
        Surface::Diffuse => "diffuse",
        Surface::Mirror => "mirror",
        Surface::Glass { .. } => "glass",
    };
    json!({
        "name": one.name,
        "albedo": one.albedo.to_array(),
        "emission": one.emission.to_array(),
        "emission_texture": one.emission_texture,
        "two_sided": one.two_sided,
        "texture": one.albedo_texture,
        "surface": surface,
        "gloss": one.gloss.map(|Gloss { roughness, metallic, specular, texture }| {
            json!({ "roughness": roughness, "metallic": metallic, "specular": specular.to_array(), "texture": texture })
        }),
        "normal_map": one.normal_map.map(|map| map.texture),
        "unshaded": one.unshaded,
        "triangles": triangles,
        "area": area,
    })
}

/// Intensity in cd, illuminance in lx, flux in lm.
pub fn punctual(one: &PunctualLight) -> Value {
    let PunctualLight { name, position, direction, strength, .. } = one;
    let (position, direction, strength) = (position.to_array(), direction.to_array(), strength.to_array());
    let flux = one.output().to_array();
    match one.kind {
        PunctualKind::Point { radius } => {
            json!({ "name": name, "kind": "point", "position": position, "intensity": strength, "flux": flux, "radius": radius })
        }
        PunctualKind::Spot { radius, inner, outer } => json!({
            "name": name, "kind": "spot", "position": position, "direction": direction, "intensity": strength, "flux": flux, "radius": radius,
            "inner_degrees": inner.to_degrees(), "outer_degrees": outer.to_degrees(),
        }),
        PunctualKind::Directional { angle } => json!({
            "name": name, "kind": "directional", "direction": direction, "illuminance": strength, "angle_degrees": angle.to_degrees(),
        }),
    }
}

fn camera(name: &str, one: &WorldCamera) -> Value {
    json!({ "name": name, "eye": one.eye.to_array(), "target": one.target.to_array(), "fov_y_degrees": one.fov_y_degrees })
}

/// Flux in W of each channel.
fn emitted(world: &World, one: &Material, area: f64) -> Vec3 {
    let sides = if one.two_sided { 2.0 } else { 1.0 };
    one.mean_emission(&world.textures) * (std::f64::consts::PI * area * sides) as f32
}

/// Mean of the radiance over directions and channels.
fn mean_radiance(environment: &Environment) -> f64 {
    environment.power() / (4.0 * std::f64::consts::PI * 3.0)
}

fn lines(about: &Value) -> Vec<String> {
    let list = |key: &str| about[key].as_array().map_or(&[][..], Vec::as_slice);
    let [min, max] = [0, 1].map(|corner| vector(&about["bounds"][corner]));
    let size = max - min;
    let mut lines = vec![
        format!(
            "{}: {}, {}, {} ({} rows of bake --to vertices){}",
            about["file"].as_str().unwrap_or_default(),
            counted(list("objects").len(), "object"),
            counted(whole(&about["triangles"]), "triangle"),
            counted(whole(&about["vertices"]), "vertex"),
            about["vertex_rows"],
            if about["vertex_colors"] == true { ", with colours" } else { "" },
        ),
        format!("bounds: {} to {}, size {}; area {}", place(min), place(max), place(size), number(&about["area"])),
    ];
    // A single object says no more than the first line.
    let objects = if list("objects").len() > 1 { list("objects") } else { &[] };
    section(&mut lines, "objects", objects, |one| {
        format!(
            "{}: {}, {}",
            text(&one["name"]),
            counted(whole(&one["triangles"]), "triangle"),
            counted(whole(&one["vertices"]), "vertex")
        )
    });
    section(&mut lines, "materials", list("materials"), |one| line_of_material(one, list("textures")));
    section(&mut lines, "cameras, of which the first is used", list("cameras"), |one| {
        let [eye, target] = [&one["eye"], &one["target"]].map(|at| place(vector(at)));
        format!("{}: at {eye}, looks at {target}, {} degrees high", text(&one["name"]), number(&one["fov_y_degrees"]))
    });
    section(&mut lines, "lights without a surface", list("punctual_lights"), line_of_punctual);
    lines.push(line_of_lights(about));
    let map = &about["light_map"];
    lines.push(format!(
        "light map: {side} x {side} texels are about {} to a unit; {TEXELS} to a unit take about {needed} x {needed}",
        number(&map["texels_per_unit"]),
        side = map["side"],
        needed = map["side_for_10_texels_per_unit"],
    ));
    lines.push(line_of_estimate(about));
    lines.extend(list("warnings").iter().map(|warning| format!("warning: {}", text(warning))));
    lines
}

/// Adds a title and a line for each item, or for the first of many.
fn section(lines: &mut Vec<String>, title: &str, items: &[Value], line: impl Fn(&Value) -> String) {
    if items.is_empty() {
        return;
    }
    lines.push(format!("{title}:"));
    lines.extend(items.iter().take(MOST).map(|item| format!("  {}", line(item))));
    if items.len() > MOST {
        lines.push(format!("  and {} more (--json has all)", items.len() - MOST));
    }
}

fn line_of_material(one: &Value, textures: &[Value]) -> String {
    let mut parts = vec![format!("albedo {}", rgb(&one["albedo"]))];
    if let Some(size) = one["texture"].as_u64().and_then(|index| textures.get(index as usize)) {
        parts.push(format!("texture of {} x {}", size[0], size[1]));
    }
    if vector(&one["emission"]) != DVec3::ZERO {
        let sides = if one["two_sided"] == true { " from both sides" } else { "" };
        let picture = if one["emission_texture"].is_null() { "" } else { " times a picture" };
        parts.push(format!("emits {}{picture}{sides}", rgb(&one["emission"])));
    }
    if one["surface"] != "diffuse" {
        parts.push(text(&one["surface"]));
    }
    if let [Some(roughness), Some(metallic)] = ["roughness", "metallic"].map(|key| one["gloss"][key].as_f64()) {
        let texture = if one["gloss"]["texture"].is_null() { "" } else { " times a texture" };
        parts.push(format!("roughness {roughness:.2}, metallic {metallic:.2}{texture}"));
    }
    if !one["normal_map"].is_null() {
        parts.push("normal map".to_owned());
    }
    parts.push(counted(whole(&one["triangles"]), "triangle"));
    let unshaded: Vec<_> = one["unshaded"].as_array().into_iter().flatten().map(text).collect();
    let unshaded = if unshaded.is_empty() { String::new() } else { format!("; not shown: {}", unshaded.join(", ")) };
    format!("{}: {}{unshaded}", text(&one["name"]), parts.join(", "))
}

/// A light of [`punctual`] as a line.
pub fn line_of_punctual(one: &Value) -> String {
    let [position, direction] = ["position", "direction"].map(|key| place(vector(&one[key])));
    let radius = if number(&one["radius"]) == "0" { String::new() } else { format!(", radius {}", number(&one["radius"])) };
    let what = match one["kind"].as_str() {
        Some("point") => format!("point at {position}, {} cd{radius}", rgb(&one["intensity"])),
        Some("spot") => format!(
            "spot at {position} towards {direction}, {} cd, {} to {} degrees from its axis{radius}",
            rgb(&one["intensity"]),
            number(&one["inner_degrees"]),
            number(&one["outer_degrees"]),
        ),
        _ => format!(
            "directional towards {direction}, {} lx, {} degrees wide",
            rgb(&one["illuminance"]),
            number(&one["angle_degrees"])
        ),
    };
    format!("{}: {what}", text(&one["name"]))
}

fn line_of_lights(about: &Value) -> String {
    let mut parts = Vec::new();
    if about["lights"] != 0 {
        let sides = counted(whole(&about["lights"]), "side");
        parts.push(format!("{sides} of triangles emit {} W", rgb(&about["emitted_power"])));
    }
    if let Some(count) = about["punctual_lights"].as_array().map(Vec::len).filter(|&count| count > 0) {
        parts.push(format!("{} without a surface", counted(count, "light")));
    }
    if !about["environment"].is_null() {
        parts.push(format!("an environment of the mean radiance {}", number(&about["environment"])));
    }
    let none = if about["adds_sky"] == true { "none; a render adds a soft sky" } else { "none; a render refuses this scene" };
    format!("lights: {}", if parts.is_empty() { none.to_owned() } else { parts.join(", and ") })
}

fn line_of_estimate(about: &Value) -> String {
    let estimate = &about["estimate"];
    let seconds = estimate["seconds"].as_f64().unwrap_or_default() + about["load_seconds"].as_f64().unwrap_or_default();
    format!(
        "render of {} x {} pixels along {} directions ({}): about {} MiB, and very roughly {} with OpenGL on this CPU; less on a GPU",
        about["size"][0],
        about["size"][1],
        about["directions"],
        text(&estimate["pipeline"]),
        whole(&estimate["memory_bytes"]).div_ceil(1 << 20),
        if seconds < 100.0 { format!("{seconds:.0} s") } else { format!("{:.0} min", seconds / 60.0) },
    )
}

fn text(value: &Value) -> String {
    value.as_str().unwrap_or_default().to_owned()
}

fn whole(value: &Value) -> usize {
    value.as_u64().unwrap_or_default() as usize
}

/// `1 vertex`, `2 vertices`.
fn counted(count: usize, name: &str) -> String {
    match (count, name) {
        (1, _) => format!("1 {name}"),
        (_, "vertex") => format!("{count} vertices"),
        _ => format!("{count} {name}s"),
    }
}

fn vector(value: &Value) -> DVec3 {
    DVec3::from([0, 1, 2].map(|axis| value[axis].as_f64().unwrap_or_default()))
}

fn rgb(value: &Value) -> String {
    vector(value).to_array().map(|channel| short(channel, 3)).join(" ")
}

fn place(at: DVec3) -> String {
    at.to_array().map(|coordinate| short(coordinate, 6)).join(" ")
}

fn number(value: &Value) -> String {
    short(value.as_f64().unwrap_or_default(), 3)
}

/// A number with its first digits, but whole where it is large.
fn short(value: f64, digits: i32) -> String {
    let digits = if value == 0.0 { 0.0 } else { (f64::from(digits - 1) - value.abs().log10().floor()).clamp(0.0, 9.0) };
    let text = format!("{value:.*}", digits as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}
