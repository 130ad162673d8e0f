//! `finalgather bench`: compares all pipelines, as a table or as JSON.

use std::path::{Path, PathBuf};
use std::thread::available_parallelism;

use clap::builder::{PossibleValue, PossibleValuesParser};
use finalgather::bench::{Bench, BenchPlan, CONTESTANTS, Contestant, FUSED, Row, Where};
use finalgather::error::{Error, Result};
use finalgather::job::Watch;
use finalgather::scene::Loaded;
use finalgather::settings::{LayerSize, Squares};
use serde_json::{Value, json};

use crate::args::{CameraArgs, DeviceArgs, SceneArgs, auto_or, count, size};
use crate::report;
use crate::terminal::Terminal;

/// Directions of the converged reference. Both ends count.
const CONVERGED: u32 = 4096;
/// Heads of the table's columns, after the column of names.
const HEADS: &str = ",ends,ms/dir,ms/sample,Msamples/s,xFUSED,peel,gather,wait,idle,diff,bias,RMSE,offset";

/// Measure all pipelines, and rays on the CPU, side by side: total time, time of stages, error
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("help/bench.txt"), args_override_self = true)]
pub struct BenchArgs {
    /// Scene file (.toml) or model (.obj with its .mtl, .glb, .gltf, .ply, .stl) [default: scenes/cornell.toml, if it exists]
    scene: Option<PathBuf>,

    #[command(flatten)]
    files: SceneArgs,

    /// Picture size in pixels; N is N by N
    #[arg(long, value_name = "WxH|N", default_value = "512", value_parser = size)]
    size: [u32; 2],

    /// Directions of a round
    #[arg(long, value_name = "N", default_value = "32", value_parser = count::<u32>)]
    directions: u32,

    /// Rounds. Each pipeline runs once in a round
    #[arg(long, value_name = "N", default_value = "5", value_parser = count::<u32>)]
    rounds: u32,

    /// Side of the depth layers in texels. auto: as a render of the scene has it [default: the scene file's, else auto]
    #[arg(long, value_name = "auto|N", value_parser = |text: &str| auto_or(text, LayerSize::Texels))]
    layer_size: Option<LayerSize>,

    /// Photons emitted from the lights [default: the scene file's, else 1000000]
    #[arg(long, value_name = "N", value_parser = count::<u64>)]
    photons: Option<u64>,

    /// Measure only these, separated by commas
    #[arg(long, alias = "pipeline", value_name = "NAMES", value_delimiter = ',', value_parser = contestants())]
    pipelines: Vec<String>,

    /// Print one JSON object on stdout
    #[arg(long)]
    json: bool,

    #[command(flatten)]
    view: CameraArgs,

    #[command(flatten)]
    device: DeviceArgs,
}

/// Returns the exit code.
pub fn run(args: &BenchArgs) -> Result<u8> {
    let mut terminal = Terminal::new(Vec::new())?;
    let file = args.scene.clone().map_or_else(default_scene, Ok)?;
    let mut request = args.view.choose(args.files.scene(&file)?)?;
    request.settings.insert("size".to_owned(), json!(args.size));
    let Loaded { world, mut settings, report, .. } = request.load(true)?;
    report.warnings.iter().for_each(|warning| terminal.say(&format!("warning: {warning}")));
    // A round has few directions. But its layers must be as large as in a render.
    settings.gather.layer_size = args.layer_size.unwrap_or(settings.gather.layer_size);
    settings.gather.layer_size = LayerSize::Texels(settings.layers());
    (settings.film.size, settings.film.interleave, settings.directions.count) = (args.size, Squares::Pixels(1), args.directions);
    settings.photons.count = args.photons.unwrap_or(settings.photons.count);
    settings.validate()?;
    if args.rounds == 0 {
        return Err(Error::usage("rounds is 0", "give rounds of 1 or more"));
    }

    terminal.stage("starting OpenGL");
    let gpu = args.device.request().open()?;
    terminal.stage("tracing photons");
    let bench = Bench::new(&gpu, world.flatten(), &settings, Where::Camera)?;
    terminal.stage("measuring");
    let asked = |contestant: &&Contestant| args.pipelines.is_empty() || args.pipelines.iter().any(|name| name == contestant.name);
    let contestants: Vec<_> = CONTESTANTS.iter().filter(asked).collect();
    let plan = BenchPlan { directions: args.directions, rounds: args.rounds, stages: true, converged: CONVERGED };
    let rows = bench.measure(&contestants, plan)?;
    terminal.clear();

    let cores = available_parallelism().map_or(1, usize::from);
    let fused = rows.iter().find(|row| row.name == FUSED).map(|row| row.ms_per_sample);
    let others = rows.iter().filter(|row| row.name != FUSED);
    // Time per sample of each other pipeline, relative to fused. Empty without fused.
    let against = fused.map(|fused| others.map(|row| (row.name.clone(), (row.ms_per_sample / fused).into())).collect());
    let report = json!({
        "gl": gpu.identity(),
        "cores": cores,
        "scene": { "file": file.display().to_string(), "triangles": bench.triangle_count() },
        // Settings that affect points, directions and photons. The others are the scene's.
        "settings": {
            "size": settings.film.size,
            "points": bench.point_count(),
            "directions": settings.directions.count,
            "layer_size": settings.layers(),
            "photons": settings.photons.count,
            "rounds": args.rounds,
            "converged_directions": CONVERGED,
        },
        "rows": rows,
        "fused_against": Value::Object(against.unwrap_or_default()),
    });
    if args.json { report::print_json(&report) } else { report::print(&table(&report, &rows, fused)) }.map(|()| 0)
}

fn contestants() -> PossibleValuesParser {
    PossibleValuesParser::new(CONTESTANTS.iter().map(|contestant| PossibleValue::new(contestant.name).help(contestant.about)))
}

fn default_scene() -> Result<PathBuf> {
    let default = Path::new("scenes/cornell.toml");
    if default.is_file() {
        return Ok(default.to_owned());
    }
    Err(Error::usage(
        "no scene is given, and there is no scenes/cornell.toml here",
        "name a scene: finalgather bench SCENE.toml, or a model",
    ))
}

fn table(report: &Value, rows: &[Row], fused: Option<f64>) -> String {
    let (scene, settings, cores) = (&report["scene"], &report["settings"], &report["cores"]);
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let number = |name: &str| settings[name].to_string();
    let mut lines = vec![
        format!("{}, {cores} core{}", text(&report["gl"]["renderer"]), if *cores == 1 { "" } else { "s" }),
        format!(
            "{}: {} triangles, {} points ({}x{}), {} directions, {layers}x{layers} layers, medians of {} rounds",
            text(&scene["file"]),
            scene["triangles"],
            number("points"),
            settings["size"][0],
            settings["size"][1],
            number("directions"),
            number("rounds"),
            layers = number("layer_size"),
        ),
        String::new(),
    ];
    let mut cells = vec![HEADS.split(',').map(str::to_owned).collect::<Vec<_>>()];
    cells.extend(rows.iter().map(|row| cells_of(row, fused)));
    let widths: Vec<_> =
        (0..cells[0].len()).map(|column| cells.iter().map(|row| row[column].chars().count()).max().unwrap_or(0)).collect();
    for row in &cells {
        let line = row.iter().zip(&widths).enumerate().map(|(column, (cell, &width))| match column {
            0 => format!("{cell:<width$}"),
            _ => format!("  {cell:>width$}"),
        });
        lines.push(line.collect::<String>().trim_end().to_owned());
    }
    lines.extend([
        String::new(),
        "ms/sample: every point gets one ray that counts; xFUSED: how many times as fast fused is.".into(),
        "diff and bias: against exact rays along the same directions; own rays have no such oracle.".into(),
        format!("RMSE and offset of the mean: against exact rays along {} other directions. More: --help", CONVERGED),
    ]);
    lines.join("\n")
}

fn cells_of(row: &Row, fused: Option<f64>) -> Vec<String> {
    let or = |value: Option<String>, none: &str| value.unwrap_or_else(|| none.to_owned());
    let percent = |share: f64, digits: usize| format!("{:.digits$} %", 100.0 * share);
    let signed = |share: f64| format!("{:+.2} %", 100.0 * share);
    let stage = |name: &str| {
        let Some(device) = &row.device else { return "-".to_owned() };
        let stage = device.stages.iter().find(|stage| stage.name == name);
        stage.map_or("-".to_owned(), |stage| or(stage.ms_per_direction.map(|ms| format!("{ms:.2}")), "n/a"))
    };
    let device = row.device.as_ref();
    vec![
        row.name.clone(),
        or(row.ends.map(|ends| ends.to_string()), "own"),
        format!("{:.2}", row.ms_per_direction),
        format!("{:.2}", row.ms_per_sample),
        format!("{:.2}", 1e-6 * row.samples_per_second),
        or(fused.map(|fused| format!("{:.2}", row.ms_per_sample / fused)), "-"),
        stage("peel"),
        stage("gather"),
        or(device.map(|device| percent(device.waits, 0)), "-"),
        or(device.map(|device| or(device.idle.map(|idle| percent(idle, 0)), "n/a")), "-"),
        or(row.same_rays.map(|same| percent(same.mean_difference, 2)), "-"),
        or(row.same_rays.map(|same| signed(same.bias)), "-"),
        or(row.converged.map(|converged| percent(converged.rmse, 1)), "-"),
        or(row.converged.map(|converged| signed(converged.bias)), "-"),
    ]
}
