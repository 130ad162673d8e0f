//! Light of a clear or hazy day, after A. J. Preetham, P. Shirley and B. Smits 1999, "A practical analytic model for daylight": the luminance and colour
//! of the sky by their fits to Perez' formula, and the sun's light by their model of the atmosphere's transmittance, in the appendix.
//!
//! The colour of the sun's spectrum is that of the 1931 standard observer, by the fits of C. Wyman, P. Sloan and P. Shirley 2013, "Simple analytic
//! approximations to the CIE XYZ color matching functions". The paper's solar spectrum has 127 klx outside the atmosphere.
//!
//! Radiance 1 in red, green and blue is one nit, white of 6500 K.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{DMat3, DVec3, Vec3, dvec3};
use serde::{Deserialize, Serialize};

use super::environment::Environment;
use super::punctual::{PunctualKind, PunctualLight};

/// Texels of the sky's picture along its height. The sky is smooth but for a few degrees about the sun.
const HEIGHT: usize = 256;

/// The sun as a light.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sun {
    /// Unit vector towards the sun; +y is up.
    pub direction: Vec3,
    /// In lux on a surface that faces the sun, RGB. `None`: as the sun is at this height.
    pub illuminance: Option<Vec3>,
    /// Diameter as seen from the scene. 0: sharp shadows.
    pub angle_degrees: f32,
}

impl Sun {
    /// Its mean diameter.
    pub const ANGLE_DEGREES: f32 = 0.53;

    /// The real sun at an azimuth, clockwise from -z as seen from above (90 degrees is +x), and a height over the horizon.
    pub fn at(azimuth_degrees: f32, height_degrees: f32) -> Self {
        let [(sin_a, cos_a), (sin_h, cos_h)] = [azimuth_degrees, height_degrees].map(|angle| angle.to_radians().sin_cos());
        let direction = Vec3::new(sin_a * cos_h, sin_h, -cos_a * cos_h);
        Self { direction, illuminance: None, angle_degrees: Self::ANGLE_DEGREES }
    }

    /// The sun at an azimuth and a height as in [`Self::at`], and perhaps with an illuminance in lux. `None` if the numbers are no such.
    pub fn of_numbers(numbers: &[f32]) -> Option<Self> {
        let (azimuth, height, illuminance) = match *numbers {
            [azimuth, height] => (azimuth, height, None),
            [azimuth, height, lux] if (0.0..f32::INFINITY).contains(&lux) => (azimuth, height, Some(Vec3::splat(lux))),
            _ => return None,
        };
        let is_place = azimuth.is_finite() && (-90.0..=90.0).contains(&height);
        is_place.then(|| Self { illuminance, ..Self::at(azimuth, height) })
    }

    /// Its azimuth and height in degrees, as in [`Self::at`].
    pub fn place(&self) -> [f32; 2] {
        let Vec3 { x, y, z } = self.direction;
        [x.atan2(-z), y.atan2(x.hypot(z))].map(f32::to_degrees)
    }
}

/// The clear sky of a sun.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sky {
    /// How hazy the air is: 2 is very clear, 3 clear, 6 a light haze, 10 haze.
    pub turbidity: f32,
    /// Multiplies its light, and that of a sun without an illuminance of its own.
    pub scale: f32,
}

impl Default for Sky {
    fn default() -> Self {
        Self { turbidity: 3.0, scale: 1.0 }
    }
}

impl Sky {
    /// Returns itself, or the problem and its cure.
    pub fn check(self) -> Result<Self, (String, &'static str)> {
        match self {
            Self { turbidity, .. } if !(2.0..=10.0).contains(&turbidity) => {
                Err((format!("turbidity is {turbidity}"), "give a number from 2, very clear air, to 10, haze"))
            }
            Self { scale, .. } if !(0.0..=f32::MAX).contains(&scale) => {
                Err((format!("scale is {scale}"), "give a finite factor of 0 or more"))
            }
            _ => Ok(self),
        }
    }

    /// Its picture, without the sun's disc and black below the horizon: a model has a ground of its own.
    ///
    /// # Errors
    /// The problem and its cure, when the sun is not above the horizon.
    pub fn environment(self, sun: &Sun) -> Result<Environment, (String, &'static str)> {
        let daylight = Daylight::new(sun.direction, self.turbidity)?;
        let radiance = |texel: usize| {
            let (column, row) = (texel % (2 * HEIGHT), texel / (2 * HEIGHT));
            let azimuth = PI * ((column as f32 + 0.5) / HEIGHT as f32 - 1.0);
            let (sin, cos) = (PI * (row as f32 + 0.5) / HEIGHT as f32).sin_cos();
            daylight.radiance(Vec3::new(sin * azimuth.sin(), cos, -sin * azimuth.cos()))
        };
        let texels = (0..2 * HEIGHT * HEIGHT).map(radiance).collect();
        let environment = Environment::from_texels([2 * HEIGHT, HEIGHT], texels);
        Ok(environment.unwrap_or_else(|error| unreachable!("{error}")).scaled(self.scale))
    }

    /// The sun as a light, with this sky's air before it if it has no illuminance of its own.
    ///
    /// # Errors
    /// As [`PunctualLight::check`], and as [`Self::environment`] for a sun without an illuminance.
    pub fn light(self, sun: &Sun) -> Result<PunctualLight, (String, &'static str)> {
        let strength = match sun.illuminance {
            Some(illuminance) => illuminance,
            None => self.scale * Daylight::new(sun.direction, self.turbidity)?.illuminance(),
        };
        let kind = PunctualKind::Directional { angle: sun.angle_degrees.to_radians() };
        let light = PunctualLight { name: "sun".to_owned(), kind, position: DVec3::ZERO, direction: -sun.direction, strength };
        light.check()
    }
}

/// The sky of a sun above the horizon.
pub struct Daylight {
    to_sun: Vec3,
    turbidity: f64,
    /// Angle of the sun from the zenith.
    theta_sun: f64,
    /// Luminance in cd/m² and chromaticities x and y at the zenith, each over Perez' formula there.
    zenith: DVec3,
    /// Perez' coefficients of luminance, x and y.
    perez: [[f64; 5]; 3],
}

impl Daylight {
    /// `to_sun` points to the sun, in any length.
    ///
    /// # Errors
    /// The problem and its cure, when the sun is not above the horizon.
    pub fn new(to_sun: Vec3, turbidity: f32) -> Result<Self, (String, &'static str)> {
        let to_sun = to_sun.normalize_or_zero();
        let height = FRAC_PI_2 - to_sun.angle_between(Vec3::Y);
        if to_sun.y.is_nan() || to_sun.y <= 0.0 {
            let problem = format!("the sun is {:.1} degrees over the horizon", height.to_degrees());
            return Err((problem, "raise it above the horizon, or give its illuminance and leave out the sky"));
        }
        let (t, theta_sun) = (f64::from(turbidity), f64::from(to_sun.y).min(1.0).acos());
        let perez = [
            [0.1787 * t - 1.4630, -0.3554 * t + 0.4275, -0.0227 * t + 5.3251, 0.1206 * t - 2.5771, -0.0670 * t + 0.3703],
            [-0.0193 * t - 0.2592, -0.0665 * t + 0.0008, -0.0004 * t + 0.2125, -0.0641 * t - 0.8989, -0.0033 * t + 0.0452],
            [-0.0167 * t - 0.2608, -0.0950 * t + 0.0092, -0.0079 * t + 0.2102, -0.0441 * t - 1.6537, -0.0109 * t + 0.0529],
        ];
        let chi = (4.0 / 9.0 - t / 120.0) * (std::f64::consts::PI - 2.0 * theta_sun);
        let luminance = 1000.0 * ((4.0453 * t - 4.9710) * chi.tan() - 0.2155 * t + 2.4192);
        let chromaticity = |rows: [[f64; 4]; 3]| {
            let cubic = rows.map(|[a, b, c, d]| ((a * theta_sun + b) * theta_sun + c) * theta_sun + d);
            (cubic[0] * t + cubic[1]) * t + cubic[2]
        };
        let x = chromaticity([
            [0.00166, -0.00375, 0.00209, 0.0],
            [-0.02903, 0.06377, -0.03202, 0.00394],
            [0.11693, -0.21196, 0.06052, 0.25886],
        ]);
        let y = chromaticity([
            [0.00275, -0.00610, 0.00317, 0.0],
            [-0.04214, 0.08970, -0.04153, 0.00516],
            [0.15346, -0.26756, 0.06670, 0.26688],
        ]);
        let at_zenith = DVec3::from(perez.map(|coefficients| perez_formula(coefficients, 1.0, theta_sun)));
        Ok(Self { to_sun, turbidity: t, theta_sun, zenith: dvec3(luminance, x, y) / at_zenith, perez })
    }

    /// Radiance in nits from the direction of a unit vector, RGB. 0 below the horizon.
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        if direction.y <= 0.0 {
            return Vec3::ZERO;
        }
        let gamma = direction.as_dvec3().dot(self.to_sun.as_dvec3()).clamp(-1.0, 1.0).acos();
        let values = self.perez.map(|coefficients| perez_formula(coefficients, direction.y.into(), gamma));
        let DVec3 { x: luminance, y: x, z: y } = self.zenith * DVec3::from(values);
        rgb(luminance / y * dvec3(x, y, 1.0 - x - y))
    }

    /// Illuminance in lux on a surface that faces the sun, RGB.
    pub fn illuminance(&self) -> Vec3 {
        /// Lumen of a watt at 555 nm.
        const EFFICACY: f64 = 683.0;
        /// Of a disc of 1.39e6 km at 1.5e8 km.
        const SOLID_ANGLE: f64 = 6.744e-5;
        const STEP: f64 = 10.0;
        // Relative mass of air on the way.
        let air = 1.0 / (self.theta_sun.cos() + 0.15 * (93.885 - self.theta_sun.to_degrees()).powf(-1.253));
        let haze = 0.046_08 * self.turbidity - 0.045_86;
        let of_wavelength = |(index, &[sun, ozone, vapour]): (usize, &[f64; 3])| {
            let wavelength = 380.0 + STEP * index as f64;
            let micrometres = wavelength / 1000.0;
            // Molecules, haze, 0.35 cm of ozone, and 2 cm of water vapour.
            let depth = air * (0.008_735 * micrometres.powf(-4.08) + haze * micrometres.powf(-1.3) + 0.35 * ozone);
            let vapour = 2.0 * vapour * air;
            let transmittance = (-depth - 0.2385 * vapour / (1.0 + 20.07 * vapour).powf(0.45)).exp();
            sun * transmittance * matching(wavelength)
        };
        let sum: DVec3 = SUN.iter().enumerate().map(of_wavelength).sum();
        rgb(EFFICACY * SOLID_ANGLE * STEP * sum)
    }
}

/// Perez' formula of luminance: by the cosine of the angle from the zenith, and the angle from the sun.
fn perez_formula([a, b, c, d, e]: [f64; 5], cosine: f64, gamma: f64) -> f64 {
    (1.0 + a * (b / cosine).exp()) * (1.0 + c * (d * gamma).exp() + e * gamma.cos().powi(2))
}

/// The colour matching functions x, y and z at a wavelength in nm.
fn matching(wavelength: f64) -> DVec3 {
    let lobe = |mean: f64, below: f64, above: f64| {
        let width = if wavelength < mean { below } else { above };
        (-0.5 * ((wavelength - mean) / width).powi(2)).exp()
    };
    dvec3(
        1.056 * lobe(599.8, 37.9, 31.0) + 0.362 * lobe(442.0, 16.0, 26.7) - 0.065 * lobe(501.1, 20.4, 26.2),
        0.821 * lobe(568.8, 46.9, 40.5) + 0.286 * lobe(530.9, 16.3, 31.1),
        1.217 * lobe(437.0, 11.8, 36.0) + 0.681 * lobe(459.0, 26.0, 13.8),
    )
}

/// Linear sRGB of CIE XYZ. Colours that it cannot show lose their negative part.
fn rgb(xyz: DVec3) -> Vec3 {
    const TO_RGB: DMat3 = DMat3::from_cols(
        dvec3(3.240_454_2, -0.969_266_0, 0.055_643_4),
        dvec3(-1.537_138_5, 1.876_010_8, -0.204_025_9),
        dvec3(-0.498_531_4, 0.041_556_0, 1.057_225_2),
    );
    (TO_RGB * xyz).max(DVec3::ZERO).as_vec3()
}

/// From 380 nm in steps of 10 nm: radiance of the sun in W/(m² sr nm), and absorption of ozone and of water vapour, each for a centimetre.
const SUN: [[f64; 3]; 38] = [
    [16559.0, 0.0, 0.0],
    [16233.7, 0.0, 0.0],
    [21127.5, 0.0, 0.0],
    [25888.2, 0.0, 0.0],
    [25829.1, 0.0, 0.0],
    [24232.3, 0.0, 0.0],
    [26760.5, 0.0, 0.0],
    [29658.3, 0.003, 0.0],
    [30545.4, 0.006, 0.0],
    [30057.5, 0.009, 0.0],
    [30663.7, 0.014, 0.0],
    [28830.4, 0.021, 0.0],
    [28712.1, 0.030, 0.0],
    [27825.0, 0.040, 0.0],
    [27100.6, 0.048, 0.0],
    [27233.6, 0.063, 0.0],
    [26361.3, 0.075, 0.0],
    [25503.8, 0.085, 0.0],
    [25060.2, 0.103, 0.0],
    [25311.6, 0.120, 0.0],
    [25355.9, 0.120, 0.0],
    [25134.2, 0.115, 0.0],
    [24631.5, 0.125, 0.0],
    [24173.2, 0.120, 0.0],
    [23685.3, 0.105, 0.0],
    [23212.1, 0.090, 0.0],
    [22827.7, 0.079, 0.0],
    [22339.8, 0.067, 0.0],
    [21970.2, 0.057, 0.0],
    [21526.7, 0.048, 0.0],
    [21097.9, 0.036, 0.0],
    [20728.3, 0.028, 0.016],
    [20240.4, 0.023, 0.024],
    [19870.8, 0.018, 0.0125],
    [19427.2, 0.014, 1.0],
    [19072.4, 0.011, 0.87],
    [18628.9, 0.010, 0.061],
    [18259.2, 0.009, 0.001],
];
