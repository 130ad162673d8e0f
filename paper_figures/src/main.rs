//! Measures and draws the figures: `cargo run --release --bin paper_figures -- --help`.
//!
//! A figure is declared in `figures/<name>.toml` and has its place in `page.toml`. It writes its numbers as `out/<name>.json`, and what is
//! drawn, `out/<name>.svg` or a part of the page, is drawn from that file alone. The page, `out/index.html`, shows all that there is.
//! How a figure is measured and drawn is its kind, a type that implements [`figure::Figure`]. To add one, write a file in
//! `src/figures/` (`src/figures/stop_fraction.rs` is the shortest) and name it in `src/figures/mod.rs`.

mod claims;
mod contestants;
mod cornell;
mod figure;
mod figures;
mod html;
mod machine;
mod page;
mod path_tracer;
mod picture;
mod plot;
mod procedural;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;

use crate::figure::{Declaration, Document, Format, Result, Scale, folder};
use crate::page::Page;

/// Measures and draws the figures of finalgather, to paper_figures/out/NAME.json and NAME.svg, and all in one page, index.html
#[derive(Debug, Parser)]
#[command(version)]
struct Args {
    /// Do this figure alone; may be given several times
    #[arg(long, value_name = "NAME")]
    only: Vec<String>,

    /// Share of the points, directions and seeds, for a look while editing
    #[arg(long, value_name = "F", default_value = "1")]
    scale: Scale,

    /// Draw anew what was measured before
    #[arg(long, conflicts_with = "scale")]
    redraw: bool,

    /// Keep JSON, SVG and small PNG in paper_figures/runs/DATE-MACHINE/ too; of whole runs only
    #[arg(long, conflicts_with = "scale")]
    record: bool,

    /// Write to this folder instead of paper_figures/out
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

fn main() -> ExitCode {
    match run(&Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(args: &Args) -> Result<()> {
    let page = Page::load()?;
    if let Some(unknown) = args.only.iter().find(|name| page.figure(name).is_none()) {
        let names: Vec<_> = page.figures().map(|figure| figure.name.as_str()).collect();
        return Err(format!("no figure {unknown}, only {}", names.join(", ")).into());
    }
    let out = args.out.clone().unwrap_or_else(|| folder().join("out"));
    fs::create_dir_all(&out).map_err(|error| format!("{}: {error}", out.display()))?;
    let wanted = |figure: &&Declaration| args.only.is_empty() || args.only.contains(&figure.name);
    for figure in page.figures().filter(wanted) {
        make(figure, args, &out).map_err(|error| format!("{}: {error}", figure.name))?;
    }
    write(&out.join("index.html"), &page.html(&out)?)
}

fn make(figure: &Declaration, args: &Args, out: &Path) -> Result<()> {
    let file = |folder: &Path, ending: &str| folder.join(format!("{}.{ending}", figure.name));
    let json = file(out, "json");
    if !args.redraw {
        write(&json, &figure.measure(args.scale, out)?.to_json()?)?;
    }

    let document = Document::read(&json)?;
    let drawing = document.draw()?;
    let is_svg = document.format()? == Format::Svg;
    if is_svg {
        write(&file(out, "svg"), &drawing)?;
    }
    if args.record {
        if !document.scale.is_whole() {
            return Err("what was measured is not a whole run; measure it without --scale first".into());
        }
        let run = folder().join("runs").join(document.machine.run_name(&document.date));
        write(&file(&run, "json"), &document.to_json()?)?;
        if is_svg {
            write(&file(&run, "svg"), &drawing)?;
        }
        for picture in document.pictures(out)? {
            picture::write_small(&picture, &run.join(picture.file_name().unwrap_or_default()))?;
        }
    }
    Ok(())
}

fn write(path: &Path, text: &str) -> Result<()> {
    let problem = |error| format!("{}: {error}", path.display());
    path.parent().map_or(Ok(()), fs::create_dir_all).map_err(problem)?;
    fs::write(path, text).map_err(problem)?;
    eprintln!("  {}", path.display());
    Ok(())
}
