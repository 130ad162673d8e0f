//! `finalgather compare`: measures with known answers, refusals with their exit codes, and difference maps.

mod common;

use std::fs;
use std::process::Command;

use common::tool::{json, names_in, refusal, success, text, tool};
use finalgather::image::{Channel, Image, WriteOptions};
use serde_json::Value;
use tempfile::TempDir;

/// Pictures of one value each, but for what the tests put into them.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn write(&self, name: &str, image: &Image) {
        image.write(&self.0.path().join(name), &WriteOptions::default()).unwrap();
    }

    fn read(&self, name: &str) -> Image {
        Image::read(&self.0.path().join(name)).unwrap()
    }

    fn names(&self) -> Vec<String> {
        names_in(&self.0)
    }

    /// The arguments are the words of this line.
    fn compare(&self, line: &str) -> Command {
        let mut command = tool(&self.0);
        command.arg("compare").args(line.split_whitespace());
        command
    }

    fn json(&self, line: &str) -> Value {
        json(&mut self.compare(&format!("{line} --json")))
    }

    fn table(&self, line: &str) -> String {
        text(&success(&mut self.compare(line)).stdout)
    }

    fn refusal(&self, line: &str, code: i32) -> String {
        let said = refusal(&mut self.compare(line), code);
        assert!(said.starts_with("error: "), "{line}: {said}");
        said
    }
}

fn plain(width: usize, height: usize, value: f32) -> Image {
    let channel = |name: &str| Channel { name: name.into(), samples: vec![value; width * height] };
    Image { width, height, channels: ["R", "G", "B"].map(channel).into() }
}

/// `plain`, with `value` in all channels of one pixel.
fn spotted(mut image: Image, pixel: usize, value: f32) -> Image {
    image.channels.iter_mut().for_each(|channel| channel.samples[pixel] = value);
    image
}

fn close(value: &Value, expected: f64) -> bool {
    value.as_f64().is_some_and(|value| (value - expected).abs() < 1e-6)
}

#[test]
fn numbers_with_known_answers() {
    let folder = Folder::new();
    folder.write("a.exr", &plain(8, 4, 0.5));
    folder.write("b.exr", &plain(8, 4, 0.25));
    let found = folder.json("a.exr b.exr");
    let keys: Vec<_> = found.as_object().unwrap().keys().map(String::as_str).collect();
    assert_eq!(keys.join(" "), "pixels mean_a mean_b bias mae rmse relative_rmse relative_mse psnr flip");
    assert_eq!(found["pixels"], 32);
    for (name, value) in [
        ("mean_a", 0.5),
        ("mean_b", 0.25),
        ("bias", 1.0),
        ("mae", 0.25),
        ("rmse", 0.25),
        ("relative_rmse", 1.0),
        ("relative_mse", 0.0625 / 0.0725),
        ("psnr", 20.0 * f64::log10(4.0)),
    ] {
        assert!(close(&found[name], value), "{name} is {}, not {value}", found[name]);
    }
    assert!((found["flip"].as_f64().unwrap() - 0.4545).abs() < 1e-3, "{found}");

    // The second is the reference.
    assert!(close(&folder.json("b.exr a.exr")["bias"], -0.5));
}

#[test]
fn a_person_gets_a_table() {
    let folder = Folder::new();
    folder.write("a.exr", &plain(8, 4, 0.5));
    folder.write("b.exr", &plain(8, 4, 0.25));
    let table = "\
pixels         32 of 32
mean of A      0.500000
mean of B      0.250000
bias           +100.000 %
MAE            0.250000
RMSE           0.250000
relative RMSE  100.000 %
relative MSE   0.862069
PSNR           12.04 dB
FLIP           0.4546
";
    assert_eq!(folder.table("a.exr b.exr"), table);

    folder.write("c.exr", &plain(8, 4, 0.250_001));
    let tiny = folder.table("c.exr b.exr");
    assert!(tiny.contains("RMSE           1.01328e-6\n"), "{tiny}");
}

#[test]
fn mask_and_trim_leave_pixels_out() {
    let folder = Folder::new();
    // One pixel that is far off and one that is no number.
    folder.write("a.exr", &spotted(spotted(plain(8, 4, 0.5), 5, 9.0), 6, f32::NAN));
    folder.write("b.exr", &plain(8, 4, 0.5));
    folder.write("mask.png", &spotted(plain(8, 4, 1.0), 6, 0.0));
    folder.write("mask.exr", &spotted(spotted(plain(8, 4, 1.0), 6, 0.0), 5, 0.5));

    let found = folder.json("a.exr b.exr --mask mask.png");
    assert_eq!(found["pixels"], 31);
    assert!(close(&found["mae"], 8.5 / 31.0), "{found}");
    assert!(found["flip"].as_f64().unwrap() > 0.0, "{found}");
    for (line, pixels) in [("--mask mask.png --trim 0.04", 30), ("--mask mask.exr", 30)] {
        let found = folder.json(&format!("a.exr b.exr {line}"));
        assert_eq!((found["pixels"].as_u64(), &found["mae"], &found["flip"]), (Some(pixels), &0.0.into(), &0.0.into()));
    }
}

#[test]
fn flip_sees_the_exposed_pictures() {
    let folder = Folder::new();
    folder.write("a.exr", &plain(8, 8, 50.0));
    folder.write("b.exr", &plain(8, 8, 60.0));
    assert_eq!(folder.json("a.exr b.exr")["flip"], 0.0);
    assert!(folder.json("a.exr b.exr --exposure -7")["flip"].as_f64().unwrap() > 0.05);
    // The tone curve is behind a PNG already.
    let image = plain(8, 8, 1.5);
    folder.write("c.exr", &image);
    folder.write("c.PNG", &image);
    assert_eq!(folder.json("c.exr c.PNG")["flip"], 0.0);
    assert_eq!(folder.json("c.PNG c.exr")["flip"], 0.0);
}

#[test]
fn a_picture_equals_itself() {
    let folder = Folder::new();
    folder.write("a.png", &spotted(plain(8, 4, 0.5), 9, 3.0));
    let found = folder.json("a.png a.png");
    for name in ["bias", "mae", "rmse", "relative_rmse", "relative_mse", "flip"] {
        assert_eq!(found[name], 0.0, "{name}");
    }
    assert_eq!(found["psnr"], Value::Null, "infinite");
    assert!(folder.table("a.png a.png").contains("PSNR           inf dB\n"));
}

#[test]
fn maps_show_where() {
    let folder = Folder::new();
    folder.write("a.exr", &spotted(plain(8, 4, 0.5), 5, 0.75));
    folder.write("b.exr", &plain(8, 4, 0.5));
    folder.write("mask.png", &spotted(plain(8, 4, 1.0), 31, 0.0));
    folder.json("a.exr b.exr --mask mask.png -o map.exr --output map.png");
    assert_eq!(folder.names(), ["a.exr", "b.exr", "map.exr", "map.png", "mask.png"]);

    let map = folder.read("map.exr");
    let names: Vec<_> = map.channels.iter().map(|channel| channel.name.as_str()).collect();
    assert_eq!(names.join(" "), "A B FLIP G R");
    assert_eq!(map.rgb().unwrap().map(|samples| (samples[4], samples[5])), [(0.0, 0.25); 3]);
    let flip = map.channel("FLIP").unwrap();
    assert!(flip[5] > flip[8] && flip[8] > 0.0 && flip[31] == 0.0, "{flip:?}");

    let picture = folder.read("map.png");
    let [red, green, blue] = picture.rgb().unwrap();
    assert!(red[5] > red[8], "brighter where they differ");
    assert!(red[31] > 0.0 && red[31] == green[31] && green[31] == blue[31], "grey where they are not compared");
}

#[test]
fn pictures_that_do_not_match_are_bad_data() {
    let folder = Folder::new();
    folder.write("a.exr", &plain(8, 4, 0.5));
    folder.write("b.exr", &plain(4, 8, 0.5));
    folder.write("small.png", &plain(2, 2, 1.0));
    folder.write("black.png", &plain(8, 4, 0.0));
    let mut one_channel = plain(8, 4, 0.5);
    one_channel.channels.truncate(1);
    folder.write("red.exr", &one_channel);
    folder.write("nan.exr", &spotted(plain(8, 4, 0.5), 11, f32::NAN));
    folder.write("inf.exr", &spotted(plain(8, 4, 0.5), 0, f32::INFINITY));
    fs::write(folder.0.path().join("broken.exr"), "not a picture").unwrap();
    let before = folder.names();
    for (line, problem) in [
        ("a.exr b.exr", "a.exr: compared with b.exr: the pictures are 8 x 4 and 4 x 8"),
        ("a.exr red.exr", "red.exr: the picture has no channel G, only R"),
        ("nan.exr a.exr", "nan.exr: compared with a.exr: pixel (3, 1) of the picture has a sample NaN"),
        ("a.exr inf.exr", "a.exr: compared with inf.exr: pixel (0, 0) of the reference has a sample inf"),
        ("a.exr a.exr --mask small.png", "small.png: is 2 x 2, the picture 8 x 4"),
        ("a.exr a.exr --mask black.png", "a.exr: compared with a.exr: no pixel is left"),
        ("a.exr absent.exr", "absent.exr: not readable"),
        ("a.exr broken.exr", "broken.exr: not readable as OpenEXR"),
        ("a.exr a.exr --mask absent.png", "absent.png: not readable"),
    ] {
        let said = folder.refusal(&format!("{line} -o map.png"), 65);
        assert!(said.starts_with(&format!("error: {problem}")) && said.contains("\n  cure: "), "{line}: {said}");
    }
    assert_eq!(folder.names(), before);
}

#[test]
fn what_cannot_be_met_is_refused_before_reading() {
    let folder = Folder::new();
    // No picture is there, which nothing gets to see.
    for line in
        ["--trim 1", "--trim -0.1", "--trim nan", "--exposure inf", "--exposure bright", "-o map.jpg", "-o absent/map.png"]
    {
        folder.refusal(&format!("a.exr b.exr {line}"), 2);
    }
    folder.refusal("a.exr", 2);
    assert!(folder.refusal("a.exr b.exr -o absent/map.png", 2).contains("mkdir -p absent"));
    assert!(folder.names().is_empty());
}
