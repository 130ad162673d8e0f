//! Measures and draws the figures: `cargo run --release --bin paper_figures -- --help`.
//!
//! A figure is declared in `figures/NAME.toml` and has its place in `page.toml`. It writes its numbers as `out/NAME.json`, and its
//! drawing, `out/NAME.svg` or a part of the page, is made from that file alone. The page, `out/index.html`, shows all figures.
//! A figure's kind is a type that implements [`figure::Figure`], which measures and draws. To add one, write a file in
//! `src/figures/` (`src/figures/stop_fraction.rs` is the shortest) and name it in `src/figures/mod.rs`.
//!
//! Modules are on floors, and a module imports only from lower floors. `tests/floors.rs` reads this table and checks it. Only `lab` calls
//! the `finalgather` library. `lab` and `draw` are imported as a whole from above.
//!
//! | floor | modules | |
//! |---|---|---|
//! | 13 | `main` | command line |
//! | 12 | `page` | the page with all figures |
//! | 11 | `page::claims` | the poster's claims and their verdicts |
//! | 10 | `document` | files of declarations and of measurements |
//! | 9 | `figures` | list of kinds |
//! | 8 | `figures::*` | a kind of figure each |
//! | 7 | `figures::slices` | drawings of a slice, for two kinds |
//! | 6 | `lab`, `draw` | names of the floors below |
//! | 5 | `lab::one_direction` | one direction at the pixels of a camera |
//! | 4 | `lab::blocks`, `lab::path_tracer`, `lab::slice` | measurements |
//! | 3 | `lab::cornell`, `lab::pictures` | gathers, and renders against path tracing |
//! | 2 | `lab::machine`, `lab::procedural`, `draw::plot` | date and hardware, scenes made in code, plots |
//! | 1 | `lab::library`, `lab::numeric`, `draw::*` | names of the library, numbers and HTML |
//! | 0 | `figure` | what a figure is |

mod document;
mod draw;
mod figure;
mod figures;
mod lab;
mod page;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;

use crate::document::{Declaration, Document};
use crate::figure::{Format, Result, Scale, caught, folder, of_file};
use crate::lab::write_small;
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

    /// Draw earlier measurements anew
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
    let names: Vec<_> = page.figures().map(|figure| figure.name.as_str()).collect();
    if let Some(unknown) = args.only.iter().find(|name| !names.contains(&name.as_str())) {
        return Err(format!("no figure {unknown}, only {}", names.join(", ")).into());
    }
    let out = args.out.clone().unwrap_or_else(|| folder().join("out"));
    of_file(&out, fs::create_dir_all(&out))?;
    let wanted = |figure: &&Declaration| {
        let measured = !args.redraw || figure.json(&out).exists();
        if args.only.is_empty() { measured } else { args.only.contains(&figure.name) }
    };
    let mut failed = Vec::new();
    for figure in page.figures().filter(wanted) {
        let failure = figure.failure(&out);
        if failure.exists() {
            of_file(&failure, fs::remove_file(&failure))?;
        }
        if let Err(error) = caught(|| make(figure, args, &out)) {
            let at_scale = if args.scale.is_whole() { String::new() } else { format!(" (at a scale of {})", args.scale.0) };
            eprintln!("  {} failed: {error}{at_scale}", figure.name);
            of_file(&failure, fs::write(&failure, format!("{error}{at_scale}\n")))?;
            failed.push(figure.name.as_str());
        }
    }
    let index = out.join("index.html");
    write(&index, &page.html(&out)?)?;
    if failed.is_empty() { Ok(()) } else { Err(format!("failed: {}; {} says why", failed.join(", "), index.display()).into()) }
}

fn make(figure: &Declaration, args: &Args, out: &Path) -> Result<()> {
    let file = |folder: &Path, ending: &str| folder.join(format!("{}.{ending}", figure.name));
    let json = figure.json(out);
    if !args.redraw {
        write(&json, &figure.measure(args.scale, out)?.to_json()?)?;
    } else if !json.exists() {
        return Err("there are no earlier measurements; measure it first, without --redraw".into());
    }

    let document = Document::read(&json)?;
    let drawing = document.draw()?;
    let is_svg = document.format()? == Format::Svg;
    if is_svg {
        write(&file(out, "svg"), &drawing)?;
    }
    if args.record {
        if !document.scale.is_whole() {
            return Err("the measurement is not of full scale; measure it without --scale first".into());
        }
        let run = folder().join("runs").join(document.machine.run_name(&document.date));
        write(&file(&run, "json"), &document.to_json()?)?;
        if is_svg {
            write(&file(&run, "svg"), &drawing)?;
        }
        for picture in document.pictures(out)? {
            write_small(&picture, &run.join(picture.file_name().unwrap_or_default()))?;
        }
    }
    Ok(())
}

fn write(path: &Path, text: &str) -> Result<()> {
    of_file(path, path.parent().map_or(Ok(()), fs::create_dir_all))?;
    of_file(path, fs::write(path, text))?;
    eprintln!("  {}", path.display());
    Ok(())
}
