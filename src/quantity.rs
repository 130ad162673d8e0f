//! The quantities of a gather point, and the names of their columns: one for each number, as in EXR.

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
