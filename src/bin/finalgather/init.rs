//! `finalgather init`: writes a scene file for a model, to edit.

use std::path::{Path, PathBuf};

use finalgather::error::{Error, Result};
use finalgather::file::{check_writable, folder_of, write_file};
use finalgather::job::check_kept;
use finalgather::scene::Loaded;

use crate::args::SceneArgs;
use crate::report;
use crate::scene_file::SceneView;
use crate::streams::STREAM;

/// Write a scene file for a model, with its camera, settings and materials to edit
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("help/init.txt"))]
pub struct InitArgs {
    /// Model (.obj with its .mtl, .glb, .gltf, .ply, .stl)
    model: PathBuf,

    /// Scene file to write, in the model's folder or above it; - is stdout [default: the model's name with .toml, beside it]
    #[arg(short, long = "output", value_name = "FILE")]
    output: Option<PathBuf>,

    /// Replace the scene file if there is one
    #[arg(long)]
    force: bool,

    #[command(flatten)]
    files: SceneArgs,
}

/// Returns the exit code.
pub fn run(args: &InitArgs) -> Result<u8> {
    let source = &args.model;
    if source == Path::new(STREAM) {
        return Err(Error::usage("a scene file names the file of its model, and stdin has none", "give a file"));
    }
    let output = args.output.clone().unwrap_or_else(|| source.with_extension("toml"));
    let to_stdout = output == Path::new(STREAM);
    if source.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml")) {
        return Err(Error::usage(format!("{}: is a scene file already", source.display()), "edit it, or give a model"));
    }
    if !to_stdout && output.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("toml")) {
        return Err(Error::usage(format!("{}: is no name of a scene file", output.display()), "end it in .toml"));
    }
    if !to_stdout {
        check_writable(&output)?;
    }
    if !to_stdout && output.exists() && !args.force {
        return Err(Error::usage(
            format!("{}: is there already", output.display()),
            "edit it, give another -o, or replace it by --force",
        ));
    }
    let request = args.files.scene(source)?;
    if let Some(scene) = &request.scene {
        let problem = format!("--gltf-scene {scene}: a scene file cannot name a scene of a glTF file");
        return Err(Error::usage(problem, "leave it out here, and give it to render"));
    }
    let Loaded { world, settings, report: load, .. } = request.load(true)?;
    if !to_stdout {
        check_kept(std::slice::from_ref(&output), load.files.iter().map(PathBuf::as_path))?;
    }
    load.warnings.iter().for_each(|warning| report::say(&format!("warning: {warning}")));
    let view = SceneView { source, world: &world, camera: world.camera(settings.film.size), settings };
    // The folder of the stream is the current one.
    let text = view.text(folder_of(&output), request.flip, request.smooth_angle)?;
    if to_stdout {
        return report::print(text.trim_end()).map(|()| 0);
    }
    write_file(&output, text.as_bytes())?;
    report::say(&format!("{}: written; edit it, then: finalgather render {0}", output.display()));
    Ok(0)
}
