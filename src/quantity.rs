//! What can be asked of a gather point, and how its values are named: a column for each number, as in EXR.

use serde::{Deserialize, Serialize};

use crate::harmonics::MAX_ORDER;

/// An integral over the hemisphere of a point with unit normal n. w is the cosine max(n·d, 0), and means are over it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Quantity {
    /// ∫ L w dd, in all (`Irradiance`), from lights and environment themselves (`IrradianceDirect`) and by way of surfaces (`IrradianceIndirect`); RGB.
    Irradiance,
    /// `AO`: mean of what meets no surface within a distance, 1 where all is open.
    Ao,
    /// `BentNormal`: unit vector along the mean of the directions that `ao` counts as open, weighed by w; n where none are. XYZ.
    BentNormal,
    /// `Sky`: mean of what leaves the scene.
    Sky,
    /// `SH`: ∫ L Y dd over the hemisphere of the surface, lights and all, for each basis function Y of [`crate::harmonics`]; RGB.
    Sh,
    /// `PRT`: ∫ (V w + reflected) Y dd / π, where V is what leaves the scene: radiosity of the point, over its albedo, under an environment of
    /// radiance Y. Reflected is what other surfaces send back of it, by their albedo; RGB.
    Prt,
    /// `PRTUnshadowed`: ∫ w Y dd / π, as if there were no other surface; RGB, all alike.
    PrtUnshadowed,
}

impl Quantity {
    pub const ALL: [Self; 7] =
        [Self::Irradiance, Self::Ao, Self::BentNormal, Self::Sky, Self::Sh, Self::Prt, Self::PrtUnshadowed];

    /// Names of its columns, with `order` bands of spherical harmonics.
    ///
    /// # Panics
    /// When `order` is beyond [`MAX_ORDER`].
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
