//! Picture files. All bits come back, the bytes are deterministic, and a file is complete or absent.

mod common;

use std::fs;
use std::path::Path;
use std::process::Command;

use common::tool::{folder, names_in};
use finalgather::error::Error;
use finalgather::image::{Channel, Image, WriteOptions, check_writable};

/// A picture of several EXR blocks whose samples are no round numbers.
fn picture() -> Image {
    let (width, height) = (61, 83);
    let channel = |(index, name): (usize, &str)| Channel {
        name: name.into(),
        samples: (0..width * height).map(|pixel| ((pixel * 37 + index * 101) % 997) as f32 / 331.0).collect(),
    };
    let names = ["R", "G", "B", "A", "Direct.R", "Direct.G", "Direct.B", "Z"];
    Image { width, height, channels: names.into_iter().enumerate().map(channel).collect() }
}

#[test]
fn exr_keeps_every_bit() {
    let folder = folder();
    let path = folder.path().join("a.EXR");
    let mut image = picture();
    image.channels[7].samples[..4].copy_from_slice(&[f32::INFINITY, f32::NEG_INFINITY, f32::MIN_POSITIVE / 8.0, -0.0]);
    image.write(&path, &WriteOptions { metadata: Some("{}"), ..Default::default() }).unwrap();

    let back = Image::read(&path).unwrap();
    assert_eq!((back.width, back.height, back.channels.len()), (61, 83, 8));
    for channel in &image.channels {
        let bits = |samples: &[f32]| samples.iter().map(|sample| sample.to_bits()).collect::<Vec<_>>();
        let samples = back.channel(&channel.name).unwrap_or_else(|| panic!("no channel {}", channel.name));
        assert!(bits(samples) == bits(&channel.samples), "channel {} has changed", channel.name);
    }
}

#[test]
fn png_is_what_the_tone_curve_says() {
    let folder = folder();
    let path = folder.path().join("a.png");
    let image = picture();
    image.write(&path, &WriteOptions { exposure: -1.0, ..WriteOptions::default() }).unwrap();
    let back = Image::read(&path).unwrap();
    for (was, is) in image.rgb().unwrap().iter().zip(back.rgb().unwrap()) {
        for (was, is) in was.iter().map(|sample| sample / 2.0).zip(is) {
            let toned = if was > 0.8 { 1.0 - 0.2 * f32::exp((0.8 - was) / 0.2) } else { was };
            // Half a step of 8-bit sRGB is widest in the lights.
            assert!((toned - is).abs() < 0.005, "{was} came back as {is}, not {toned}");
        }
    }
}

/// The writer's thread pool reads its size from the environment, so each size takes a process: this one, called by
/// [`exr_bytes_do_not_depend_on_the_threads`].
#[test]
#[ignore = "a part of exr_bytes_do_not_depend_on_the_threads"]
fn write_one_exr() {
    let path = std::env::var_os("FINALGATHER_TEST_OUTPUT").expect("the test that calls this one names a file");
    let options = WriteOptions { metadata: Some("{\"a\":1}"), ..Default::default() };
    picture().write(Path::new(&path), &options).unwrap();
}

#[test]
fn exr_bytes_do_not_depend_on_the_threads() {
    let folder = folder();
    let written = |threads: usize, run: usize| {
        let path = folder.path().join(format!("{threads}-{run}.exr"));
        let status = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "write_one_exr", "--ignored", "--quiet"])
            .env("RAYON_NUM_THREADS", threads.to_string())
            .env("FINALGATHER_TEST_OUTPUT", &path)
            .output()
            .unwrap()
            .status;
        assert!(status.success());
        fs::read(path).unwrap()
    };
    let first = written(1, 0);
    for (threads, run) in [(1, 1), (2, 0), (2, 1), (7, 0), (7, 1), (7, 2), (7, 3)] {
        assert!(written(threads, run) == first, "other bytes with {threads} threads, run {run}");
    }
}

#[cfg(unix)]
#[test]
fn a_new_file_has_the_permissions_of_any_new_file() {
    use std::os::unix::fs::PermissionsExt;
    let folder = folder();
    let mode = |name: &str| fs::metadata(folder.path().join(name)).unwrap().permissions().mode();
    fs::write(folder.path().join("plain"), "").unwrap();
    picture().write(&folder.path().join("a.png"), &WriteOptions::default()).unwrap();
    assert_eq!(mode("a.png"), mode("plain"));
}

#[test]
fn writing_replaces_and_leaves_nothing_else() {
    let folder = folder();
    let path = folder.path().join("a.png");
    fs::write(&path, "an older file").unwrap();
    picture().write(&path, &WriteOptions::default()).unwrap();
    assert!(Image::read(&path).is_ok());
    assert_eq!(names_in(&folder), ["a.png"]);
}

#[test]
fn failing_leaves_nothing() {
    let folder = folder();
    // A rename cannot replace a folder, which makes the last of all steps fail.
    fs::create_dir(folder.path().join("a.png")).unwrap();
    let error = picture().write(&folder.path().join("a.png"), &WriteOptions::default()).unwrap_err();
    assert!(matches!(error, Error::Output { .. }), "{error}");
    // A picture that cannot be encoded.
    let mut broken = picture();
    broken.channels[0].samples.pop();
    let error = broken.write(&folder.path().join("b.exr"), &WriteOptions::default()).unwrap_err();
    assert!(error.to_string().contains("channel R has 5062 samples"), "{error}");
    assert_eq!(names_in(&folder), ["a.png"]);
}

#[test]
fn unwritable_paths_are_known_before() {
    let folder = folder();
    fs::create_dir(folder.path().join("folder.png")).unwrap();
    let says = |path: &Path| match check_writable(path) {
        Err(error @ Error::Usage { .. }) => error.to_string(),
        other => panic!("{}: {other:?}", path.display()),
    };
    assert!(says(&folder.path().join("a.jpg")).contains(".exr"));
    assert!(says(&folder.path().join("folder.png")).contains("is a folder"));
    assert!(says(&folder.path().join("absent/a.png")).contains("mkdir -p"));
    // Refuses new files even to root, whom permissions do not bind.
    if cfg!(target_os = "linux") {
        assert!(says(Path::new("/proc/a.png")).contains("/proc: no file can be made"));
    }
    check_writable(&folder.path().join("a.png")).unwrap();
    check_writable(Path::new("a.exr")).unwrap();
    assert_eq!(names_in(&folder), ["folder.png"]);
}

#[test]
fn unreadable_files_are_bad_input() {
    let folder = folder();
    for name in ["a.exr", "a.png"] {
        let path = folder.path().join(name);
        assert!(matches!(Image::read(&path), Err(Error::Input { .. })), "{name} absent");
        fs::write(&path, "not a picture").unwrap();
        assert!(matches!(Image::read(&path), Err(Error::Input { .. })), "{name} not a picture");
    }
}
