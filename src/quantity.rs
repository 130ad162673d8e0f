//! The quantities of a gather point, and the names of their columns: one for each number, as in EXR.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::harmonics::MAX_ORDER;

/// An integral over the hemisphere of a point with unit normal n. w is the cosine max(n·d, 0), and means are weighted by it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Quantity {
    /// ∫ L w dd: total (`Irradiance`), from lights and environment (`IrradianceDirect`), from other surfaces (`IrradianceIndirect`). RGB.
    Irradiance,
    /// `AO`: fraction of directions that meet no surface within a distance, 1 where all are open.
    Ao,
    /// `BentNormal`: unit vector along the mean of the directions that `AO` counts as open, weighted by w; n if there are none. XYZ.
    BentNormal,
    /// `Sky`: fraction of directions that leave the scene.
    Sky,
    /// `SH`: ∫ L Y dd over the hemisphere of the surface, with light from lights, for each basis function Y of [`crate::harmonics`]. RGB.
    Sh,
    /// `PRT`: ∫ (V w + R) Y dd / π with V = 1 for directions that leave the scene, and R the light that other surfaces reflect by their albedo. It is
    /// the point's radiosity over its albedo under an environment of radiance Y. RGB.
    Prt,
    /// `PRTUnshadowed`: ∫ w Y dd / π, without other surfaces. RGB, all three equal.
    PrtUnshadowed,
}

impl Quantity {
    pub const ALL: [Self; 7] =
        [Self::Irradiance, Self::Ao, Self::BentNormal, Self::Sky, Self::Sh, Self::Prt, Self::PrtUnshadowed];

    /// Names of its columns, with `order` bands of spherical harmonics.
    ///
    /// # Panics
    /// If `order` exceeds [`MAX_ORDER`].
    pub fn columns(self, order: usize) -> Vec<String> {
        assert!(order <= MAX_ORDER, "order {order}");
        let of = |name: &str, parts: [&str; 3]| parts.map(|part| format!("{name}.{part}")).to_vec();
        let rgb = |name: &str| of(name, ["R", "G", "B"]);
        let harmonics = |name: &str| (0..order * order).flat_map(|k| rgb(&format!("{name}.{k:02}"))).collect();
        match self {
            Self::Irradiance => ["Irradiance", "IrradianceDirect", "IrradianceIndirect"].into_iter().flat_map(rgb).collect(),
            Self::Ao => vec!["AO".to_owned()],
            Self::BentNormal => of("BentNormal", ["X", "Y", "Z"]),
            Self::Sky => vec!["Sky".to_owned()],
            Self::Sh => harmonics("SH"),
            Self::Prt => harmonics("PRT"),
            Self::PrtUnshadowed => harmonics("PRTUnshadowed"),
        }
    }
}

/// The name of each array of values, its name in programs, its meaning and unit. Users read the texts.
const MEANINGS: [(&str, &str, &str); 9] = [
    ("Irradiance", "irradiance", "W/m² in each channel, direct and indirect"),
    ("IrradianceDirect", "irradiance_direct", "W/m² in each channel, straight from lights and from beyond the scene"),
    ("IrradianceIndirect", "irradiance_indirect", "W/m² in each channel, by way of other surfaces"),
    ("AO", "ao", "share of the cosine-weighted hemisphere that is open: 1 where nothing is near"),
    ("BentNormal", "bent_normal", "mean direction that is open, of unit length"),
    ("Sky", "sky", "share of the cosine-weighted hemisphere that leaves the scene"),
    ("SH", "sh", "coefficients of the incident radiance, W/(m² sr) in each channel"),
    ("PRTUnshadowed", "prt_unshadowed", "the same as PRT with nothing around"),
    (
        "PRT",
        "prt",
        "coefficients of the transfer from incident radiance to irradiance / π: cosine and 1/π are in, the albedo is not",
    ),
];

/// Neighbouring columns of one quantity, as one array.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ValueArray {
    /// The part of the columns' names before the first dot: `PRT`.
    pub name: String,
    /// Its columns among all.
    pub columns: Range<usize>,
    /// Lengths behind those of points or pixels: none, `[3]`, or `[coefficients, 3]`.
    sides: Vec<usize>,
}

impl ValueArray {
    /// The arrays of columns with these names, in order.
    pub fn of(names: &[&str]) -> Vec<Self> {
        let quantity = |name: &str| name.split('.').next().unwrap_or_default().to_owned();
        let mut first = 0;
        let run = |run: &[&str]| {
            let (name, columns) = (quantity(run[0]), first..first + run.len());
            first = columns.end;
            let sides = match *run {
                [one] if one == name => vec![],
                _ if are_coefficients(&name, run) => vec![run.len() / 3, 3],
                _ => vec![run.len()],
            };
            Self { name, columns, sides }
        };
        names.chunk_by(|a, b| quantity(a) == quantity(b)).map(run).collect()
    }

    /// The name as variables have it: `bent_normal`.
    pub fn key(&self) -> String {
        MEANINGS
            .iter()
            .find(|(name, ..)| *name == self.name)
            .map_or_else(|| self.name.to_lowercase(), |(_, key, _)| (*key).to_owned())
    }

    /// The shape of an array of points, or of rows of pixels.
    pub fn shape(&self, of_points: &[usize]) -> Vec<usize> {
        [of_points, &self.sides].concat()
    }

    /// Meaning and unit, for users.
    pub fn meaning(&self) -> &'static str {
        MEANINGS.iter().find(|(name, ..)| *name == self.name).map_or("", |(.., meaning)| meaning)
    }

    /// Whether it has all coefficients of some order.
    pub fn is_of_coefficients(&self) -> bool {
        self.sides.len() == 2
    }
}

/// Whether the columns are all coefficients of some order, each with R, G and B, in their order.
fn are_coefficients(quantity: &str, names: &[&str]) -> bool {
    let order = (names.len() / 3).isqrt();
    let name = |i: usize| format!("{quantity}.{:02}.{}", i / 3, ["R", "G", "B"][i % 3]);
    (1..=MAX_ORDER).contains(&order)
        && 3 * order * order == names.len()
        && names.iter().enumerate().all(|(i, known)| *known == name(i))
}
