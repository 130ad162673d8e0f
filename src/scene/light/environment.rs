//! Light from outside the scene. Its radiance depends on direction only, as in a lat-long picture of the whole sphere.
//!
//! Direction (x, y, z) is at u = 1/2 + atan2(x, -z) / 2π of the picture's width, from the left, and at v = acos(y) / π of its height, from the top. The
//! top row is straight up (+y), the middle of the picture is -z, and +x is to its right. Radiance is interpolated between the centres of texels. u
//! wraps round. Beyond the centres of the outermost rows radiance is constant.
//!
//! Rays that hit no surface bring this light. All rays of a bundle have one direction, so one look-up serves all points. No shader samples the picture,
//! and a scene without one is no slower. But few directions, or none, hit a small bright part such as the sun, and they hit it from all points at once.
//! So radiance above a cap is not gathered ([`Environment::gathered_radiance`]). Direct light samples it ([`Environment::sample_bright`]).
//! A texel's colour is split in one ratio, and interpolation is linear, so the two parts sum to the whole.

use std::f32::consts::{PI, TAU};
use std::io::Cursor;
use std::path::Path;
use std::sync::Arc;

use glam::Vec3;
use image::codecs::hdr::HdrDecoder;
use image::{DynamicImage, ImageDecoder, ImageError};
use rayon::prelude::*;

use super::super::Path as LightPath;
use super::focus::Focus;
use crate::blocks::sha256;
use crate::error::{Error, Result};
use crate::file::{MOST_BYTES, can_hold, read_file};
use crate::image::Image;
use crate::math::neighbours;
use crate::random::Distribution;

/// Maximum width. The texels then take 400 MB, and are a thousand times as many as the directions of most renders.
const WIDEST: usize = 8192;

/// Radiance from every direction. Clones share the picture.
#[derive(Clone, Debug)]
pub struct Environment {
    picture: Arc<Picture>,
    scale: f32,
    /// Rotation about +y, in whole turns.
    turn: f32,
}

/// A problem and its cure.
type Refusal = (String, &'static str);

#[derive(Debug)]
struct Picture {
    width: usize,
    height: usize,
    /// Row by row from the top.
    texels: Vec<Vec3>,
    by_power: TexelChoice,
    /// The most that the gather brings of a texel's radiance, sum of the channels. Infinite if no part is bright.
    cap: f32,
    /// Chooses texels by the power above the cap. `None` if no part is bright.
    bright: Option<TexelChoice>,
}

/// Chooses a row, and then a texel of the row, by the power from there.
#[derive(Debug)]
struct TexelChoice {
    rows: Distribution,
    /// `None` for rows without power.
    columns: Vec<Option<Distribution>>,
    /// Integral of radiance over the sphere, sum of the channels.
    power: f64,
}

impl Environment {
    /// Memory in bytes: the texels with their tables of samples, and the same again during reading.
    pub fn bytes(&self) -> usize {
        self.picture.texels.len() * (2 * size_of::<Vec3>() + 2 * size_of::<f32>())
    }

    /// A checksum of picture, scale and turn.
    pub fn digest(&self) -> String {
        let Picture { width, height, texels, .. } = &*self.picture;
        let size = format!("{width}x{height}, scale {}, turn {}:", self.scale, self.turn);
        sha256(&[size.as_bytes(), bytemuck::cast_slice(texels)].concat())
    }

    /// Reads a lat-long picture: `.hdr` (Radiance) or `.exr` (channels R, G and B).
    ///
    /// # Errors
    /// [`Error::Input`] when the file cannot be read, its width is not twice its height, it is too large, or a texel is negative or not finite.
    pub fn load(path: &Path) -> Result<Self> {
        let cure = "name an existing picture that you may read";
        let unread = |error| Error::input(path, None, format!("cannot read this environment: {error}"), cure);
        Self::decode(path, &read_file(path, MOST_BYTES).map_err(unread)?)
    }

    /// The same from `bytes` of a file. `path` is their origin.
    pub fn decode(path: &Path, bytes: &[u8]) -> Result<Self> {
        let bad = |(problem, cure): Refusal| Error::input(path, None, problem, cure);
        let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
        let (size, texels) = match ending.to_str() {
            Some("hdr") => read_hdr(bytes).map_err(bad)?,
            Some("exr") => read_exr(path, bytes)?,
            _ => {
                let problem = "the ending names no kind of environment that can be read".to_owned();
                return Err(bad((problem, "give a lat-long picture in linear floats, .hdr or .exr")));
            }
        };
        Self::checked(size, texels).map_err(bad)
    }

    /// An environment of `width` × `height` texels, row by row from the top.
    ///
    /// # Errors
    /// [`Error::Usage`], as [`Self::load`].
    pub fn from_texels(size: [usize; 2], texels: Vec<Vec3>) -> Result<Self> {
        Self::checked(size, texels).map_err(|(problem, cure)| Error::usage(problem, cure))
    }

    /// Constant radiance from all directions.
    ///
    /// # Errors
    /// [`Error::Usage`] when the radiance is negative or not finite.
    pub fn constant(radiance: Vec3) -> Result<Self> {
        Self::from_texels([2, 1], vec![radiance; 2])
    }

    /// The sky of scenes without light: grey, of radiance 1 + y/2 in the direction (x, y, z). So shapes of white models show, and an open upright
    /// surface has the irradiance of a sky of radiance 1.
    pub fn soft_sky() -> Self {
        const HEIGHT: usize = 32;
        let radiance = |row: usize| 1.0 + 0.5 * (PI * (row as f32 + 0.5) / HEIGHT as f32).cos();
        let texels = (0..HEIGHT).flat_map(|row| [Vec3::splat(radiance(row)); 2 * HEIGHT]).collect();
        Self { picture: Arc::new(Picture::new(2 * HEIGHT, HEIGHT, texels)), scale: 1.0, turn: 0.0 }
    }

    fn checked([width, height]: [usize; 2], texels: Vec<Vec3>) -> Result<Self, Refusal> {
        check_size([width, height])?;
        assert_eq!(texels.len(), width * height, "texels fill the picture");
        if let Some(texel) = texels.iter().position(|texel| !(texel.is_finite() && texel.min_element() >= 0.0)) {
            let problem = format!("texel {}, {} is {}", texel % width, texel / width, texels[texel]);
            return Err((problem, "give a finite radiance of 0 or more everywhere, for each of red, green and blue"));
        }
        Ok(Self { picture: Arc::new(Picture::new(width, height, texels)), scale: 1.0, turn: 0.0 })
    }

    /// Multiplies the radiance by `factor`, which is finite and not negative.
    pub fn scaled(self, factor: f32) -> Self {
        Self { scale: self.scale * factor, ..self }
    }

    /// Turns it about +y, counter-clockwise seen from above. A turn of 90 degrees moves the light from -z to -x.
    pub fn turned(self, degrees: f32) -> Self {
        Self { turn: self.turn + degrees / 360.0, ..self }
    }

    /// Radiance that arrives from the direction to which the unit vector `direction` points.
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        self.scale * self.interpolated(direction, |_, texel| texel)
    }

    /// The part of the radiance up to the cap. Without bright parts it is all of it.
    pub fn gathered_radiance(&self, direction: Vec3) -> Vec3 {
        let cap = self.picture.cap;
        self.scale * self.interpolated(direction, |_, texel| texel * gathered_share(texel, cap))
    }

    /// The part of the radiance above the cap.
    pub fn bright_radiance(&self, direction: Vec3) -> Vec3 {
        let cap = self.picture.cap;
        self.scale * self.interpolated(direction, |_, texel| above(texel, cap))
    }

    /// Interpolates a value of texels, each given by its row and radiance.
    fn interpolated(&self, direction: Vec3, value: impl Fn(usize, Vec3) -> Vec3) -> Vec3 {
        let Picture { width, height, texels, .. } = &*self.picture;
        let u = 0.5 + direction.x.atan2(-direction.z) / TAU + self.turn;
        let (left, right, across) = neighbours(u, *width);
        let v = direction.x.hypot(direction.z).atan2(direction.y) / PI;
        let y = (v * *height as f32 - 0.5).clamp(0.0, (height - 1) as f32);
        let row = |row: usize| {
            let [left, right] = [left, right].map(|column| value(row, texels[row * width + column]));
            left + across * (right - left)
        };
        let (above, below) = (row(y as usize), row((y as usize + 1).min(height - 1)));
        above + y.fract() * (below - above)
    }

    /// Maps a uniform point of the unit square to a unit vector towards the light and its density per steradian, which follows radiance and is positive
    /// wherever radiance is. If all is black, both are meaningless.
    pub fn sample(&self, square: [f32; 2]) -> (Vec3, f32) {
        let Picture { width, height, by_power, .. } = &*self.picture;
        let ([row, column], [down, across], of_texel) = by_power.pick(square);
        // Uniform in solid angle within the texel.
        let (top, bottom) = band(row, *height);
        let y = top + down * (bottom - top);
        let density = of_texel * *width as f32 / (TAU * (top - bottom));
        (self.towards(column as f32 + across, [(1.0 - y * y).max(0.0).sqrt(), y]), density)
    }

    /// The same by the part above the cap. Its sum of channels over the density is nearly constant: noise is left to colour and to what the light meets.
    /// `None` if no part is bright.
    pub fn sample_bright(&self, square: [f32; 2]) -> Option<(Vec3, f32)> {
        let Picture { width, height, cap, bright, .. } = &*self.picture;
        let choice = bright.as_ref()?;
        let ([row, column], place, _) = choice.pick(square);
        // Interpolation spreads a texel over a tent about its centre. Tents of the outermost rows fold at the poles: beyond their centres radiance is
        // constant.
        let [down, across] =
            place.map(|number| if number < 0.5 { (2.0 * number).sqrt() - 1.0 } else { 1.0 - (2.0 - 2.0 * number).sqrt() });
        let y = (row as f32 + 0.5 + down).abs();
        let (sin, cos) = (PI * y.min(2.0 * *height as f32 - y) / *height as f32).sin_cos();
        let direction = self.towards(column as f32 + 0.5 + across, [sin.abs(), cos]);
        let probability = |row: usize, texel: Vec3| {
            let power = f64::from(above(texel, *cap).element_sum()) * solid_angle(row, [*width, *height]);
            Vec3::splat((power / choice.power) as f32)
        };
        let texel = sin.abs() * PI / *height as f32 * TAU / *width as f32;
        Some((direction, self.interpolated(direction, probability).x / texel))
    }

    /// The unit vector to a place across the picture, in texels, with this sine and cosine of the angle to +y.
    fn towards(&self, x: f32, [sin, cos]: [f32; 2]) -> Vec3 {
        let azimuth = TAU * (x / self.picture.width as f32 - 0.5 - self.turn);
        Vec3::new(sin * azimuth.sin(), cos, -sin * azimuth.cos())
    }

    /// A photon from a direction chosen by radiance, through a sphere of `focus`; as [`super::Lights::emit_at`]. The first number selects the sphere.
    pub(super) fn emit(&self, probability: f32, [pick, u, v, s, t]: [f32; 5], focus: &Focus) -> (LightPath, Vec3) {
        let (to_light, density) = self.sample([u, v]);
        let (path, of_path) = focus.ray(to_light, [pick, s, t]);
        (path, self.radiance(to_light) * (PI / (density * probability * of_path)))
    }

    /// Integral of radiance over the sphere, sum of the channels: 4π times the mean of this sum.
    pub fn power(&self) -> f64 {
        self.picture.by_power.power * f64::from(self.scale)
    }

    /// The part of [`Self::power`] that is above the cap.
    pub fn bright_power(&self) -> f64 {
        self.picture.bright.as_ref().map_or(0.0, |choice| choice.power * f64::from(self.scale))
    }

    /// Whether radiance is 0 in all directions.
    pub fn is_black(&self) -> bool {
        self.power() == 0.0
    }
}

impl Picture {
    fn new(width: usize, height: usize, texels: Vec<Vec3>) -> Self {
        // The weight of a texel is the mean of the interpolated radiance on it. So a black texel beside a bright one has weight too.
        let mean = |row: usize, column: usize| {
            let mut sum = 0.0;
            for (above, weight) in [(row.saturating_sub(1), 0.125), (row, 0.75), ((row + 1).min(height - 1), 0.125)] {
                let at = |column: usize| f64::from(texels[above * width + column % width].element_sum());
                sum += weight * (0.75 * at(column) + 0.125 * (at(column + 1) + at(column + width - 1)));
            }
            sum
        };
        let by_power = TexelChoice::new([width, height], mean);
        let cap = cap_of(&texels, width);
        let bright = |row: usize, column: usize| f64::from(above(texels[row * width + column], cap).element_sum());
        let bright = cap.is_finite().then(|| TexelChoice::new([width, height], bright));
        Self { by_power, cap, bright, texels, width, height }
    }
}

impl TexelChoice {
    /// `radiance`: of a row and column, sum of the channels.
    fn new([width, height]: [usize; 2], radiance: impl Fn(usize, usize) -> f64 + Sync) -> Self {
        let weights_of = |row: usize| -> Vec<f64> { (0..width).map(|column| radiance(row, column)).collect() };
        let (columns, sums): (Vec<_>, Vec<f64>) = (0..height)
            .into_par_iter()
            .map(|row| {
                let weights = weights_of(row);
                let sum = weights.iter().sum::<f64>() * solid_angle(row, [width, height]);
                ((sum > 0.0).then(|| Distribution::new(weights)), sum)
            })
            .unzip();
        let power = sums.iter().sum();
        Self { rows: Distribution::new(sums), columns, power }
    }

    /// Maps a uniform point of the unit square to a texel (row, column), a uniform point of it (down, across), and the texel's probability.
    fn pick(&self, [u, v]: [f32; 2]) -> ([usize; 2], [f32; 2], f32) {
        let (row, down, of_row) = self.rows.pick(v);
        let Some(columns) = &self.columns[row] else { return ([row, 0], [down, u], 0.0) };
        let (column, across, of_texel) = columns.pick(u);
        ([row, column], [down, across], of_row * of_texel)
    }
}

/// The part of a texel's radiance that the gather leaves to direct light.
fn above(texel: Vec3, cap: f32) -> Vec3 {
    texel - texel * gathered_share(texel, cap)
}

/// The share of a texel's radiance that the gather brings.
fn gathered_share(texel: Vec3, cap: f32) -> f32 {
    let radiance = texel.element_sum();
    if radiance > cap { cap / radiance } else { 1.0 }
}

/// The most radiance of a texel, sum of the channels, that shared directions are left to find. Infinite if they find all of it well.
///
/// With radiance of at most k times the mean, N random directions have a relative error of at most √(k/N): 12 % with k = 4 and N = 256, and evenly
/// spread directions a small part of that. The mean is that of the gathered part itself, because in the shade of the sun it is all the light there is.
/// So a light that fills less than 1/k of a black sphere is left to direct light as a whole.
fn cap_of(texels: &[Vec3], width: usize) -> f32 {
    const TIMES_MEAN: f64 = 4.0;
    /// A bright part that adds less than this to N × the variance of N random directions is not worth its shadow rays.
    const LEAST: f64 = 0.01;
    let height = texels.len() / width;
    let shares: Vec<f64> = (0..height).map(|row| solid_angle(row, [width, height]) / (4.0 * std::f64::consts::PI)).collect();
    // The mean over the sphere of a function of the radiance. Rows are summed in order, so threads do not change its bits.
    let mean = |of: &(dyn Fn(f64) -> f64 + Sync)| -> f64 {
        let row = |row: usize| texels[row * width..][..width].iter().map(|texel| of(texel.element_sum().into())).sum::<f64>();
        let rows: Vec<f64> = (0..height).into_par_iter().map(row).collect();
        rows.iter().zip(&shares).map(|(sum, share)| sum * share).sum()
    };
    let whole = mean(&|radiance| radiance);
    let mut cap = TIMES_MEAN * whole;
    // Each step lowers the cap, at last by less than a part in a thousand.
    loop {
        let next = TIMES_MEAN * mean(&|radiance| radiance.min(cap));
        if next > 0.999 * cap || cap <= 1e-3 * whole {
            break;
        }
        cap = next;
    }
    let excess = mean(&|radiance| radiance.powi(2) - radiance.min(cap).powi(2));
    if excess > LEAST * whole.powi(2) { cap as f32 } else { f32::INFINITY }
}

/// Solid angle of a texel of a row.
fn solid_angle(row: usize, [width, height]: [usize; 2]) -> f64 {
    let (top, bottom) = band(row, height);
    f64::from(TAU * (top - bottom)) / width as f64
}

/// Heights y of the upper and the lower border of a row, on the unit sphere.
fn band(row: usize, height: usize) -> (f32, f32) {
    let at = |row: usize| (PI * row as f32 / height as f32).cos();
    (at(row), at(row + 1))
}

fn check_size([width, height]: [usize; 2]) -> Result<(), Refusal> {
    if height == 0 || width != 2 * height {
        return Err((
            format!("is {width} x {height} texels"),
            "give a lat-long picture of the whole sphere, twice as wide as high",
        ));
    }
    if width > WIDEST {
        return Err((format!("is {width} x {height} texels"), "shrink it to at most 8192 x 4096"));
    }
    Ok(())
}

fn read_hdr(bytes: &[u8]) -> Result<([usize; 2], Vec<Vec3>), Refusal> {
    let cure = "save it again as Radiance RGBE, or give an .exr";
    let unreadable = |error: ImageError| (format!("not readable as Radiance RGBE: {error}"), cure);
    let decoder = HdrDecoder::new(Cursor::new(bytes)).map_err(unreadable)?;
    let size = [decoder.metadata().width as usize, decoder.metadata().height as usize];
    // Checked before memory is allocated for the size in the header.
    check_size(size)?;
    if !can_hold(bytes, decoder.total_bytes()) {
        return Err((format!("is too short for {} x {} texels", size[0], size[1]), cure));
    }
    // The file stores radiance multiplied by this.
    let exposure = decoder.metadata().exposure.unwrap_or(1.0);
    let picture = DynamicImage::from_decoder(decoder).map_err(unreadable)?.into_rgb32f();
    Ok((size, picture.pixels().map(|pixel| Vec3::from(pixel.0) / exposure).collect()))
}

fn read_exr(path: &Path, bytes: &[u8]) -> Result<([usize; 2], Vec<Vec3>)> {
    let bad = |(problem, cure): Refusal| Error::input(path, None, problem, cure);
    check_size(Image::exr_size(path, bytes)?).map_err(bad)?;
    let picture = Image::decode(path, bytes)?;
    let [r, g, b] =
        picture.rgb().map_err(|error| bad((error.to_string(), "give an OpenEXR picture with channels R, G and B")))?;
    let texels = (0..r.len()).map(|texel| Vec3::new(r[texel], g[texel], b[texel])).collect();
    Ok(([picture.width, picture.height], texels))
}
