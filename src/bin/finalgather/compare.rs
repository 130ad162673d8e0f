//! `finalgather compare`: the difference between a picture and its reference.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::{Path, PathBuf};

use finalgather::error::{Error, Result};
use finalgather::image::compare::{Comparison, Selection, ViewingConditions, compare_as, mask_of};
use finalgather::image::{Image, check_writable};
use finalgather::job::check_kept;
use finalgather::nearest::nearest;

use crate::args::{checked, stops};
use crate::report;

/// Compare a picture with a reference: mean, bias, MAE, RMSE, relative MSE, PSNR, FLIP
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("help/compare.txt"), args_override_self = true, allow_negative_numbers = true)]
pub struct CompareArgs {
    /// Picture to judge, .png or .exr
    #[arg(value_name = "A")]
    picture: PathBuf,

    /// Reference, .png or .exr, of the same size
    #[arg(value_name = "B")]
    reference: PathBuf,

    /// Count only the pixels where R of this picture, or its first channel if it has no R, is above 0.5
    #[arg(long, value_name = "M")]
    mask: Option<PathBuf>,

    /// Compare this layer of EXR files, such as PhotonMap, Indirect or Direct, in place of the picture. A,B: A of the first with B of the second, where an
    /// empty name is the picture
    #[arg(long, value_name = "NAME|A,B")]
    layer: Option<String>,

    /// Leave out this fraction of the counted pixels: those with the largest squared error
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, value_parser = share)]
    trim: f32,

    /// Exposure in stops of the pictures that FLIP compares
    #[arg(long, value_name = "EV", default_value_t = 0.0, value_parser = stops)]
    exposure: f32,

    /// Print one JSON object on stdout
    #[arg(long)]
    json: bool,

    /// Map of the differences to write; can be given several times. A .png shows FLIP, from black over purple and orange to pale yellow. An .exr
    /// holds A - B as R, G and B, and FLIP. Pixels that do not count are grey or 0
    #[arg(short, long = "output", value_name = "FILE")]
    outputs: Vec<PathBuf>,
}

/// Returns the exit code.
pub fn run(args: &CompareArgs) -> Result<u8> {
    args.outputs.iter().try_for_each(|path| check_writable(path))?;
    check_kept(&args.outputs, [&args.picture, &args.reference].into_iter().chain(&args.mask).map(PathBuf::as_path))?;

    let layers = args.layer.as_deref().unwrap_or_default();
    let [of_picture, of_reference] = layers.split_once(',').map_or([layers, layers], |(a, b)| [a, b]);
    let (picture, reference) = (read(&args.picture, of_picture)?, read(&args.reference, of_reference)?);
    if is_png(&args.picture) != is_png(&args.reference) {
        report::say(
            "warning: one is a PNG, with the exposure and the tone curve of a picture to look at, and the other an EXR with linear values: \
             their numbers differ even where they show the same",
        );
    }
    let mask = args.mask.as_deref().map(|path| read_mask(path, &picture)).transpose()?;
    let selection = Selection { mask: mask.as_deref(), trim: args.trim };
    let view = ViewingConditions { exposure: args.exposure, toned: [is_png(&args.picture), is_png(&args.reference)] };
    // The options are valid, so the files cause any error.
    let (comparison, map) = compare_as(&picture, &reference, selection, view).map_err(|error| match error {
        Error::Usage { problem, cure } => {
            let problem = format!("compared with {}: {problem}", args.reference.display());
            Error::input(&args.picture, None, problem, cure)
        }
        other => other,
    })?;
    for path in &args.outputs {
        map.write(path)?;
        report::say(&format!("{}: map of the differences written", path.display()));
    }

    if args.json {
        report::print_json(&comparison)?;
    } else {
        report::print(table(&comparison, picture.width * picture.height).trim_end())?;
    }
    Ok(0)
}

/// A fraction below 1.
fn share(text: &str) -> Result<f32, String> {
    checked(text, |share| (0.0..1.0).contains(share), "not a share from 0 up to, not including, 1")
}

/// A picture with R, G and B: its own or, with a name, those of a layer.
fn read(path: &Path, layer: &str) -> Result<Image> {
    let mut image = Image::read(path)?;
    let layers: BTreeSet<_> =
        image.channels.iter().filter_map(|channel| Some(channel.name.split_once('.')?.0.to_owned())).collect();
    if !layer.is_empty() {
        image.channels.retain_mut(|channel| match channel.name.split_once('.') {
            Some((name, component)) if name == layer => {
                channel.name = component.to_owned();
                true
            }
            _ => false,
        });
    }
    if !layer.is_empty() && image.channels.is_empty() {
        let all = || layers.iter().cloned().collect::<Vec<_>>().join(", ");
        let cure = match nearest(layer, &layers) {
            Some(meant) => format!("write {meant} in its place"),
            None if layers.is_empty() => "give an .exr of a render, which has all layers".to_owned(),
            None => format!("name one that it has: {}", all()),
        };
        return Err(Error::input(path, None, format!("it has no layer {layer:?}"), cure));
    }
    match image.rgb() {
        Err(Error::Usage { problem, cure }) => Err(Error::input(path, None, problem, cure)),
        _ => Ok(image),
    }
}

fn read_mask(path: &Path, picture: &Image) -> Result<Vec<bool>> {
    let mask = Image::read(path)?;
    if (mask.width, mask.height) != (picture.width, picture.height) {
        let problem = format!("is {} x {}, the picture {} x {}", mask.width, mask.height, picture.width, picture.height);
        return Err(Error::input(path, None, problem, "give a mask of the picture's size"));
    }
    Ok(mask_of(&mask))
}

fn is_png(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("png"))
}

fn table(comparison: &Comparison, all_pixels: usize) -> String {
    let Comparison { pixels, mean_a, mean_b, bias, mae, rmse, relative_rmse, relative_mse, psnr, flip } = comparison;
    let rows = [
        ("pixels", format!("{pixels} of {all_pixels}")),
        ("mean of A", number(*mean_a)),
        ("mean of B", number(*mean_b)),
        ("bias", format!("{:+.3} %", 100.0 * bias)),
        ("MAE", number(*mae)),
        ("RMSE", number(*rmse)),
        ("relative RMSE", format!("{:.3} %", 100.0 * relative_rmse)),
        ("relative MSE", number(*relative_mse)),
        ("PSNR", format!("{psnr:.2} dB")),
        ("FLIP", format!("{flip:.4}")),
    ];
    rows.iter().fold(String::new(), |mut text, (name, value)| {
        let _ = writeln!(text, "{name:<14} {value}");
        text
    })
}

/// Six digits, also for small values.
fn number(value: f64) -> String {
    if value == 0.0 || value.abs() >= 0.001 { format!("{value:.6}") } else { format!("{value:.5e}") }
}
