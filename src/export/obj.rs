//! Wavefront OBJ, for any viewer: a light map as `map_Kd`, or values as vertex colours. Light is the radiance of a white surface, and `Kd`, the albedo,
//! multiplies it. Openness and other data are on white.

use std::fmt::Write;
use std::path::Path;

use glam::{DVec3, Vec3};

use super::{ExportMesh, Lightmap, PointValues};
use crate::error::{Error, Result};
use crate::file::{MOST_BYTES, read_file, write_file};
use crate::image::{WriteOptions, encode_srgb};

/// The first characters of our files. Other files are not replaced.
const OURS: &str = "# by finalgather bake";

/// Fails if the model or its materials file, which the user does not name, would replace a file of another program.
pub fn check_ours(path: &Path) -> Result<()> {
    for path in [path, &path.with_extension("mtl")] {
        if path.exists() && !read_file(path, MOST_BYTES).is_ok_and(|bytes| bytes.starts_with(OURS.as_bytes())) {
            let problem = format!("{}: is there already, and not from a bake", path.display());
            return Err(Error::usage(problem, "give another name, also for what goes beside it (.mtl, .png)"));
        }
    }
    Ok(())
}

/// Writes a light map, its model, and the materials that show it.
pub fn write(path: &Path, lightmap: &Lightmap, options: &WriteOptions) -> Result<()> {
    let surface = &lightmap.surface;
    let png_path = path.with_extension("png");
    let [mtl_name, png_name] = [name_beside(path, "mtl")?, name_beside(path, "png")?];
    let mut obj = format!("{OURS}\nmtllib {mtl_name}\n");
    positions(&mut obj, surface, &[]);
    lightmap.uvs.iter().for_each(|uv| line(&mut obj, "vt", &uv.to_array()));
    faces(&mut obj, surface, true);

    let mut mtl = format!("{OURS}\n");
    for (index, _) in surface.indices_by_material() {
        let material = &surface.materials[index];
        let _ = writeln!(mtl, "newmtl {}", material.name);
        if lightmap.irradiance.is_some() {
            line(&mut mtl, "Kd", &surface.mean_albedo(material).to_array());
        } else {
            line(&mut mtl, "Kd", &[1.0; 3]);
        }
        if material.emission != Vec3::ZERO && lightmap.irradiance.is_some() {
            line(&mut mtl, "Ke", &material.mean_emission(surface.textures).to_array());
        }
        let _ = writeln!(mtl, "map_Kd {png_name}");
    }
    write_file(&png_path, &lightmap.display_png(options.exposure)?)?;
    write_file(&path.with_extension("mtl"), mtl.as_bytes())?;
    write_file(path, obj.as_bytes())
}

/// Writes values as vertex colours in sRGB, `v x y z r g b`. Light is for the albedo of the materials to multiply, and data are on white.
pub fn write_values(path: &Path, values: &PointValues, options: &WriteOptions) -> Result<()> {
    let Some(surface) = &values.surface else {
        let problem = format!("{}: these points are of no model", path.display());
        return Err(Error::usage(problem, "write .ply or .npy"));
    };
    let mut obj = format!("{OURS}\nmtllib {}\n", name_beside(path, "mtl")?);
    positions(&mut obj, surface, &values.shown(options.exposure));
    faces(&mut obj, surface, false);
    let mut mtl = format!("{OURS}\n");
    for (index, _) in surface.indices_by_material() {
        let material = &surface.materials[index];
        let albedo = if values.shows_light() { surface.mean_albedo(material) } else { Vec3::ONE };
        let _ = writeln!(mtl, "newmtl {}", material.name);
        line(&mut mtl, "Kd", &albedo.to_array());
    }
    write_file(&path.with_extension("mtl"), mtl.as_bytes())?;
    write_file(path, obj.as_bytes())
}

/// The name of the file beside `path` with this ending.
fn name_beside(path: &Path, ending: &str) -> Result<String> {
    let name = path.with_extension(ending).file_name().and_then(|name| name.to_str()).map(str::to_owned);
    name.ok_or_else(|| {
        let problem = format!("{}: an OBJ cannot name the files beside it by this name", path.display());
        Error::usage(problem, "give a name in UTF-8")
    })
}

fn line(text: &mut String, word: &str, numbers: &[f32]) {
    text.push_str(word);
    add(text, numbers);
    text.push('\n');
}

/// Adds the shortest digits that give back these 32 bits.
fn add(text: &mut String, numbers: &[f32]) {
    for number in numbers {
        let _ = write!(text, " {number}");
    }
}

/// Vertices, with these linear colours or with none.
fn positions(obj: &mut String, surface: &ExportMesh, colors: &[Vec3]) {
    for (vertex, (DVec3 { x, y, z }, local)) in surface.positions.world.iter().zip(surface.positions.local()).enumerate() {
        if surface.positions.are_far() {
            // The shortest digits that give back these 64 bits.
            let _ = write!(obj, "v {x} {y} {z}");
        } else {
            obj.push('v');
            add(obj, &local.to_array());
        }
        if let Some(color) = colors.get(vertex) {
            add(obj, &color.to_array().map(|value| encode_srgb(value.max(0.0))));
        }
        obj.push('\n');
    }
}

/// Normals, if there are some, and faces by material. Coordinates on the map have the numbers of the vertices.
fn faces(obj: &mut String, surface: &ExportMesh, mapped: bool) {
    let normals = surface.has_normals().then_some(&surface.mesh.normals);
    normals.into_iter().flatten().for_each(|normal| line(obj, "vn", &normal.to_array()));
    for (index, indices) in surface.indices_by_material() {
        let _ = writeln!(obj, "usemtl {}", surface.materials[index].name);
        for corners in indices.as_chunks::<3>().0 {
            let [a, b, c] = corners.map(|vertex| match (vertex + 1, mapped, normals.is_some()) {
                (i, true, true) => format!("{i}/{i}/{i}"),
                (i, true, false) => format!("{i}/{i}"),
                (i, false, true) => format!("{i}//{i}"),
                (i, false, false) => i.to_string(),
            });
            let _ = writeln!(obj, "f {a} {b} {c}");
        }
    }
}
