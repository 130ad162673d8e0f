//! Real spherical harmonics: orthonormal over the sphere, without the Condon-Shortley phase, in the axes of the scene (Y₁ is √(3/4π) (y, z, x)).
//! Band l has the coefficients l(l+1)+m for -l ≤ m ≤ l. Order n has n bands and n² coefficients. The twin of `glsl/include/harmonics.glsl`.

use std::f32::consts::PI;

use glam::Vec3;

/// The highest order.
pub const MAX_ORDER: usize = 5;
const MOST: usize = MAX_ORDER * MAX_ORDER;

/// All basis functions at a unit vector.
pub fn basis(direction: Vec3) -> [f32; MOST] {
    let Vec3 { x, y, z } = direction;
    let (xx, yy, zz) = (x * x, y * y, z * z);
    [
        0.282_094_8,
        0.488_602_5 * y,
        0.488_602_5 * z,
        0.488_602_5 * x,
        1.092_548_4 * x * y,
        1.092_548_4 * y * z,
        0.315_391_57 * (3.0 * zz - 1.0),
        1.092_548_4 * x * z,
        0.546_274_2 * (xx - yy),
        0.590_043_6 * y * (3.0 * xx - yy),
        2.890_611_4 * x * y * z,
        0.457_045_8 * y * (5.0 * zz - 1.0),
        0.373_176_33 * z * (5.0 * zz - 3.0),
        0.457_045_8 * x * (5.0 * zz - 1.0),
        1.445_305_7 * z * (xx - yy),
        0.590_043_6 * x * (xx - 3.0 * yy),
        2.503_342_9 * x * y * (xx - yy),
        1.770_130_8 * y * z * (3.0 * xx - yy),
        0.946_174_7 * x * y * (7.0 * zz - 1.0),
        0.669_046_5 * y * z * (7.0 * zz - 3.0),
        0.105_785_55 * (35.0 * zz * zz - 30.0 * zz + 3.0),
        0.669_046_5 * x * z * (7.0 * zz - 3.0),
        0.473_087_35 * (xx - yy) * (7.0 * zz - 1.0),
        1.770_130_8 * x * z * (xx - 3.0 * yy),
        0.625_835_7 * (xx * (xx - 3.0 * yy) - yy * (3.0 * xx - yy)),
    ]
}

/// Coefficients of max(n·d, 0) / π, the transfer of an unshadowed diffuse surface of albedo 1.
pub fn cosine_lobe(normal: Vec3) -> [f32; MOST] {
    // Ramamoorthi and Hanrahan 2001, "An efficient representation for irradiance environment maps", over π.
    let bands = [1.0, 2.0 / 3.0, 0.25, 0.0, -1.0 / 24.0];
    let mut lobe = basis(normal);
    for (k, value) in lobe.iter_mut().enumerate() {
        *value *= bands[k.isqrt()];
    }
    lobe
}

/// Coefficients of a function over the sphere, by quadrature with `rings` rings. The function should be smooth at the width of a ring.
pub fn project(rings: usize, function: impl Fn(Vec3) -> Vec3) -> [Vec3; MOST] {
    let mut coefficients = [[0.0f64; 3]; MOST];
    for ring in 0..rings {
        // Rings have equal solid angles and equal numbers of points.
        let z = (2 * ring + 1) as f32 / rings as f32 - 1.0;
        let radius = (1.0 - z * z).max(0.0).sqrt();
        for step in 0..2 * rings {
            let (sin, cos) = ((step as f32 + 0.5) * PI / rings as f32).sin_cos();
            let direction = Vec3::new(radius * cos, radius * sin, z);
            let value = function(direction).as_dvec3();
            for (sum, weight) in coefficients.iter_mut().zip(basis(direction)) {
                (0..3).for_each(|c| sum[c] += value[c] * f64::from(weight));
            }
        }
    }
    let solid_angle = 4.0 * std::f64::consts::PI / (2 * rings * rings) as f64;
    coefficients.map(|sum| Vec3::from(sum.map(|c| (c * solid_angle) as f32)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_basis_is_orthonormal() {
        for k in 0..MOST {
            let row = project(200, |direction| Vec3::splat(basis(direction)[k]));
            for (j, value) in row.iter().enumerate() {
                let expected = f32::from(u8::from(j == k));
                // The error of the midpoint rule in z is about 1e-3 for polynomials of degree 8 and 200 rings.
                assert!((value.x - expected).abs() < 2e-3, "<{j}, {k}> = {}", value.x);
            }
        }
    }

    #[test]
    fn the_cosine_lobe_is_the_projection_of_the_cosine() {
        for normal in [Vec3::X, Vec3::new(0.36, 0.48, 0.8), Vec3::new(-0.6, 0.0, -0.8)] {
            let projected = project(200, |direction| Vec3::splat(normal.dot(direction).max(0.0) / PI));
            for (k, (a, b)) in projected.iter().zip(cosine_lobe(normal)).enumerate() {
                assert!((a.x - b).abs() < 1e-3, "coefficient {k} along {normal}: {} and {b}", a.x);
            }
        }
    }
}
