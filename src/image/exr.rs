//! OpenEXR, lossless. The bytes depend on the picture and its metadata alone.

use std::io::Cursor;
use std::path::Path;

use ::exr::block::lines::LineRefMut;
use ::exr::image::write::samples::{SamplesWriter, WritableSamples};
use ::exr::image::{self, AnyChannel, AnyChannels, Encoding, FlatSamples, Layer};
use ::exr::math::{RoundingMode, Vec2};
use ::exr::meta::MetaData;
use ::exr::meta::attribute::{AttributeValue, Chromaticities, LevelMode, SampleType, Text};
use ::exr::meta::header::{Header, LayerAttributes};
use ::exr::prelude::{ReadChannels, ReadLayers, WritableImage};

use super::{Channel, Image, MOST_SAMPLES};
use crate::error::{Error, Result};
use crate::file::can_hold;

/// Rec. 709 primaries and the D65 white, which sRGB shares.
const CHROMATICITIES: Chromaticities =
    Chromaticities { red: Vec2(0.64, 0.33), green: Vec2(0.30, 0.60), blue: Vec2(0.15, 0.06), white: Vec2(0.3127, 0.3290) };

/// The only attribute that OpenEXR does not define. A second one would make bytes vary between runs: the crate orders them by a hash map.
const METADATA: &str = "finalgather";

const CURE: &str = "give a flat OpenEXR picture";

/// The samples of a channel, row by row. The crate's own type would own a copy.
#[derive(Clone, Copy)]
struct Samples<'a> {
    samples: &'a [f32],
    width: usize,
}

impl WritableSamples<'_> for Samples<'_> {
    type Writer = Self;

    fn sample_type(&self) -> SampleType {
        SampleType::F32
    }

    fn infer_level_modes(&self) -> (LevelMode, RoundingMode) {
        (LevelMode::Singular, RoundingMode::Down)
    }

    fn create_samples_writer(&self, _: &Header) -> Self::Writer {
        *self
    }
}

impl SamplesWriter for Samples<'_> {
    fn extract_line(&self, line: LineRefMut<'_>) {
        let first = line.location.position.y() * self.width + line.location.position.x();
        let samples = &self.samples[first..first + line.location.sample_count];
        line.write_samples_from_slice(samples).expect("the line is as long as its samples");
    }
}

fn metadata(path: &Path, bytes: &[u8]) -> Result<MetaData> {
    MetaData::read_from_buffered(Cursor::new(bytes), false)
        .map_err(|error| Error::input(path, None, format!("not readable as OpenEXR: {error}"), CURE))
}

impl Image {
    /// Encodes one flat part with 32-bit float channels, ZIP-compressed in blocks of 16 lines. `metadata` is JSON.
    pub(super) fn to_exr(&self, metadata: Option<&str>) -> Result<Vec<u8>> {
        self.check()?;
        // Unchecked, because Text checks for Latin-1. The format takes any bytes, and these are UTF-8.
        let text = |utf8: &str| Text::from_slice_unchecked(utf8.as_bytes());
        let channels = self
            .channels
            .iter()
            .map(|channel| AnyChannel::new(text(&channel.name), Samples { samples: &channel.samples, width: self.width }))
            .collect();
        let layer = Layer::new(
            (self.width, self.height),
            LayerAttributes::default(),
            // This encoding has the line order `Increasing`, with which the parallel compressor writes blocks in order.
            Encoding::SMALL_LOSSLESS,
            AnyChannels::sort(channels),
        );
        let mut image = image::Image::from_layer(layer);
        image.attributes.chromaticities = Some(CHROMATICITIES);
        image.attributes.other.extend(metadata.map(|json| (text(METADATA), AttributeValue::Text(text(json)))));

        let mut bytes = Cursor::new(Vec::new());
        image.write().to_buffered(&mut bytes).map_err(|error| {
            Error::usage(format!("OpenEXR cannot hold this picture: {error}"), "check its size and channel names")
        })?;
        Ok(bytes.into_inner())
    }

    /// Reads the metadata of [`Self::to_exr`] from the file's `bytes`.
    pub(crate) fn exr_metadata(path: &Path, bytes: &[u8]) -> Option<String> {
        let meta = metadata(path, bytes).ok()?;
        match meta.headers.first()?.own_attributes.other.get(METADATA.as_bytes())? {
            AttributeValue::Text(json) => String::from_utf8(json.as_slice().to_vec()).ok(),
            _ => None,
        }
    }

    /// Reads width and height from the header of the file's `bytes`.
    pub(crate) fn exr_size(path: &Path, bytes: &[u8]) -> Result<[usize; 2]> {
        let meta = metadata(path, bytes)?;
        let largest = meta.headers.iter().map(|header| header.layer_size).max_by_key(|size| size.area());
        Ok(largest.map_or([0; 2], |size| [size.x(), size.y()]))
    }

    /// Decodes the first flat part at full resolution, with samples of any type. Channels keep the file's (alphabetical) order.
    pub(super) fn from_exr(path: &Path, bytes: &[u8]) -> Result<Self> {
        let bad = |problem: String| Error::input(path, None, problem, CURE);
        // Checked before any memory is reserved for it.
        for header in metadata(path, bytes)?.headers {
            let [width, height] = [header.layer_size.x(), header.layer_size.y()];
            let samples = width.checked_mul(height).and_then(|area| area.checked_mul(header.channels.list.len()));
            // A sample takes 2 bytes or more.
            if samples.is_none_or(|samples| samples as u64 > MOST_SAMPLES || !can_hold(bytes, 2 * samples as u64)) {
                let count = header.channels.list.len();
                return Err(bad(format!(
                    "{width} x {height} pixels of {count} channels are too many, or too many for a file of its length"
                )));
            }
        }
        let layer = image::read::read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes()
            .from_buffered(Cursor::new(bytes))
            .map_err(|error| bad(format!("not readable as OpenEXR: {error}")))?
            .layer_data;

        let subsampled = layer.channel_data.list.iter().find(|channel| channel.sampling != Vec2(1, 1));
        if let Some(channel) = subsampled {
            return Err(bad(format!("channel {} is subsampled", channel.name)));
        }
        let channels = layer.channel_data.list.into_iter().map(|channel| Channel {
            name: String::from_utf8_lossy(channel.name.as_slice()).into_owned(),
            samples: match channel.sample_data {
                FlatSamples::F32(samples) => samples,
                other => other.values_as_f32().collect(),
            },
        });
        Ok(Self { width: layer.size.x(), height: layer.size.y(), channels: channels.collect() })
    }
}

#[cfg(test)]
mod tests {
    use ::exr::prelude::f16;

    use super::*;

    /// A file of another writer has half, float and unsigned channels in a named part.
    #[test]
    fn reads_every_sample_type() {
        let list = [
            AnyChannel::new("Direct.R", FlatSamples::F16(vec![f16::from_f32(0.5), f16::from_f32(-2.0)])),
            AnyChannel::new("R", FlatSamples::F32(vec![0.1, f32::INFINITY])),
            AnyChannel::new("id", FlatSamples::U32(vec![7, 70_000])),
        ];
        let layer = Layer::new(
            (2, 1),
            LayerAttributes::named("beauty"),
            Encoding::FAST_LOSSLESS,
            AnyChannels::sort(list.into_iter().collect()),
        );
        let mut bytes = Cursor::new(Vec::new());
        image::Image::from_layer(layer).write().to_buffered(&mut bytes).unwrap();

        let image = Image::from_exr(Path::new("other.exr"), &bytes.into_inner()).unwrap();
        assert_eq!((image.width, image.height), (2, 1));
        assert_eq!(image.channel("Direct.R"), Some([0.5, -2.0].as_slice()));
        assert_eq!(image.channel("R"), Some([0.1, f32::INFINITY].as_slice()));
        assert_eq!(image.channel("id"), Some([7.0, 70_000.0].as_slice()));
    }

    #[test]
    fn states_colour_space_and_metadata() {
        let image = Image { width: 1, height: 1, channels: vec![Channel { name: "R".into(), samples: vec![1.0] }] };
        let bytes = image.to_exr(Some("{\"scene\":\"Bär\"}")).unwrap();
        let meta = ::exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), true).unwrap();
        let (shared, own) = (&meta.headers[0].shared_attributes, &meta.headers[0].own_attributes);
        assert_eq!(shared.chromaticities, Some(CHROMATICITIES));
        // The reader finds the file's attribute among the part's own. With one part, that is the same.
        assert_eq!((shared.other.len(), own.other.len()), (0, 1));
        let Some(AttributeValue::Text(json)) = own.other.get(METADATA.as_bytes()) else { panic!("no metadata") };
        assert_eq!(json.as_slice(), "{\"scene\":\"Bär\"}".as_bytes());
    }
}
