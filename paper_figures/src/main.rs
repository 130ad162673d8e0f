//! Measures and draws the figures: `cargo run --release --bin paper_figures -- --help`.
//!
//! Each figure writes its numbers as `out/<name>.json`, and its plot `out/<name>.svg` is drawn from that file alone. A figure is a type
//! that implements [`figure::Figure`]: a name, a function that measures, a function that draws. To add one, write a file in
//! `src/figures/` (`src/figures/stop_fraction.rs` is the shortest) and name it in `src/figures/mod.rs`.

mod contestants;
mod cornell;
mod figure;
mod figures;
mod machine;
mod picture;
mod plot;
mod procedural;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use clap::builder::{PossibleValue, PossibleValuesParser};

use crate::figure::{Document, Entry, Result, Scale};
use crate::figures::FIGURES;

/// Measures and draws the figures of finalgather, to paper_figures/out/NAME.json and NAME.svg
#[derive(Debug, Parser)]
#[command(version)]
struct Args {
    /// Do this figure alone; may be given several times
    #[arg(long, value_name = "NAME", value_parser = names())]
    only: Vec<String>,

    /// Share of the points, directions and seeds, for a look while editing
    #[arg(long, value_name = "F", default_value = "1")]
    scale: Scale,

    /// Draw anew what was measured before
    #[arg(long, conflicts_with = "scale")]
    redraw: bool,

    /// Keep JSON and SVG in paper_figures/runs/DATE-MACHINE/ too; of whole runs only
    #[arg(long, conflicts_with = "scale")]
    record: bool,
}

fn names() -> PossibleValuesParser {
    PossibleValuesParser::new(FIGURES.iter().map(|figure| PossibleValue::new(figure.name).help(figure.about)))
}

fn main() -> ExitCode {
    let args = Args::parse();
    let wanted = |figure: &&Entry| args.only.is_empty() || args.only.iter().any(|name| name == figure.name);
    for figure in FIGURES.iter().filter(wanted) {
        if let Err(error) = make(figure, &args) {
            eprintln!("error: {}: {error}", figure.name);
            return ExitCode::FAILURE;
        }
    }
    ExitCode::SUCCESS
}

fn make(figure: &Entry, args: &Args) -> Result<()> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let file = |folder: &Path, ending: &str| folder.join(format!("{}.{ending}", figure.name));
    let out = folder.join("out");
    let [json, svg] = ["json", "svg"].map(|ending| file(&out, ending));
    if !args.redraw {
        let document = figure.measure(args.scale)?;
        write(&json, &document.to_json()?)?;
    }

    let text = fs::read_to_string(&json).map_err(|error| format!("{}: {error}", json.display()))?;
    let document: Document = serde_json::from_str(&text)?;
    let drawing = figure.draw(&document)?;
    write(&svg, &drawing)?;
    if args.record {
        if !document.scale.is_whole() {
            return Err("what was measured is not a whole run; measure it without --scale first".into());
        }
        let run: PathBuf = folder.join("runs").join(document.machine.run_name(&document.date));
        write(&file(&run, "json"), &text)?;
        write(&file(&run, "svg"), &drawing)?;
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
