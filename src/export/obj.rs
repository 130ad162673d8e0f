//! Wavefront OBJ with the light map as `map_Kd`, for any viewer. The map is the radiance of a white surface, and `Kd`, the albedo, multiplies it.

use std::fmt::Write;
use std::path::Path;

use glam::{DVec3, Vec3};

use super::Lightmap;
use crate::error::{Error, Result};
use crate::file::{MOST_BYTES, read_file, write_file};
use crate::image::{Image, WriteOptions};

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

pub fn write(path: &Path, lightmap: &Lightmap, irradiance: &Image, options: &WriteOptions) -> Result<()> {
    let surface = &lightmap.surface;
    let (mtl_path, png_path) = (path.with_extension("mtl"), path.with_extension("png"));
    let name = |path: &Path| path.file_name().and_then(|name| name.to_str()).map(str::to_owned);
    let names = name(&mtl_path).zip(name(&png_path));
    let (mtl_name, png_name) = names.ok_or_else(|| {
        let problem = format!("{}: an OBJ cannot name the files beside it by this name", path.display());
        Error::usage(problem, "give a name in UTF-8")
    })?;

    let (mut obj, mut mtl) = (format!("{OURS}\nmtllib {mtl_name}\n"), format!("{OURS}\n"));
    let normals = surface.has_normals().then_some(&surface.mesh.normals);
    let line = |text: &mut String, word: &str, numbers: &[f32]| {
        text.push_str(word);
        // The shortest digits that give back these 32 bits.
        for number in numbers {
            let _ = write!(text, " {number}");
        }
        text.push('\n');
    };
    if surface.positions.are_far() {
        // The shortest digits that give back these 64 bits.
        for DVec3 { x, y, z } in surface.positions.world {
            let _ = writeln!(obj, "v {x} {y} {z}");
        }
    } else {
        surface.positions.local().iter().for_each(|position| line(&mut obj, "v", &position.to_array()));
    }
    lightmap.uvs.iter().for_each(|uv| line(&mut obj, "vt", &uv.to_array()));
    normals.into_iter().flatten().for_each(|normal| line(&mut obj, "vn", &normal.to_array()));
    for (index, indices) in surface.indices_by_material() {
        let material = &surface.materials[index];
        let _ = writeln!(mtl, "newmtl {}", material.name);
        line(&mut mtl, "Kd", &surface.mean_albedo(material).to_array());
        if material.emission != Vec3::ZERO {
            line(&mut mtl, "Ke", &material.emission.to_array());
        }
        let _ = writeln!(mtl, "map_Kd {png_name}");
        let _ = writeln!(obj, "usemtl {}", material.name);
        for corners in indices.as_chunks::<3>().0 {
            let [a, b, c] = corners.map(|vertex| match vertex + 1 {
                i if normals.is_some() => format!("{i}/{i}/{i}"),
                i => format!("{i}/{i}"),
            });
            let _ = writeln!(obj, "f {a} {b} {c}");
        }
    }
    write_file(&png_path, &Lightmap::shown_png(irradiance, options.exposure)?)?;
    write_file(&mtl_path, mtl.as_bytes())?;
    write_file(path, obj.as_bytes())
}
