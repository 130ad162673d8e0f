//! Pictures against means of path-traced ones over squares of pixels, whose noise is small.

use std::path::{Path, PathBuf};

use finalgather::image::Image;
use finalgather::image::compare::{Selection, compare, mask_of};
use finalgather::render::Render;
use finalgather::scene::{Loaded, World};
use finalgather::settings::Settings;

/// Scenes `NAME.toml` in a folder of `tests/reference`, with `NAME.exr` and `NAME_mask.png`.
pub struct Blocks(pub &'static str);

impl Blocks {
    fn file(&self, name: &str) -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference").join(self.0).join(name)
    }

    /// A view with the settings of its file.
    pub fn picture(&self, view: &str, change: impl FnOnce(&mut Settings)) -> Image {
        let Loaded { world, settings, .. } = World::load(&self.file(&format!("{view}.toml"))).unwrap();
        let settings = settings.with(change);
        let mut render = Render::new(&super::gpu(), &world, &settings).unwrap();
        while !render.is_done() {
            render.step().unwrap();
        }
        render.picture()
    }

    /// Bias and RMSE of the means against path tracing, as shares of its mean.
    pub fn error_of(&self, view: &str, picture: &Image) -> [f64; 2] {
        let reference = Image::read(&self.file(&format!("{view}.exr"))).unwrap();
        let mask = mask_of(&Image::read(&self.file(&format!("{view}_mask.png"))).unwrap());
        let result = compare(&averaged(picture, &reference), &reference, Selection { mask: Some(&mask), trim: 0.0 }).unwrap();
        println!("{view}: bias {:+.2} %, RMSE {:.2} %", 100.0 * result.bias, 100.0 * result.relative_rmse);
        [result.bias, result.relative_rmse]
    }

    /// Fails unless the picture of a view with the settings of its file has at most this bias and RMSE.
    pub fn agrees(&self, view: &str, most: [f64; 2]) {
        let [bias, rmse] = self.error_of(view, &self.picture(view, |_| ()));
        assert!(bias.abs() < most[0], "{view}: bias {bias}, at most {}", most[0]);
        assert!(rmse < most[1], "{view}: RMSE {rmse}, at most {}", most[1]);
    }
}

/// Red, green and blue, averaged over squares of pixels to the size of `like`.
fn averaged(picture: &Image, like: &Image) -> Image {
    let side = picture.width / like.width;
    assert_eq!([picture.width, picture.height], [side * like.width, side * like.height]);
    let mut means = like.clone();
    means.channels.retain(|channel| ["R", "G", "B"].contains(&channel.name.as_str()));
    for channel in &mut means.channels {
        let samples = picture.channel(&channel.name).unwrap();
        for (i, mean) in channel.samples.iter_mut().enumerate() {
            let (x, y) = (i % like.width * side, i / like.width * side);
            let square = (0..side * side).map(|k| samples[(y + k / side) * picture.width + x + k % side]);
            *mean = square.sum::<f32>() / (side * side) as f32;
        }
    }
    means
}
