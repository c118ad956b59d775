//! Reflectance of the sea's surface.

use rustfft::num_traits::Float;

/// Refractive index of sea water against air, visible light.
pub const SEA_WATER_INDEX: f64 = 1.34;

/// Reflectance of unpolarised light that meets a surface of refractive index `n` from the air at an angle whose cosine is `cos`: the
/// exact Fresnel equations (Born and Wolf 1999, section 1.5, eq. 21), the mean of both polarisations. Cosines are clamped to 0 to 1.
pub fn fresnel<F: Float>(cos: F, n: F) -> F {
    let one = F::one();
    let c = cos.max(F::zero()).min(one);
    // g = n cos(refraction), by Snell's law.
    let g = (n * n - one + c * c).sqrt();
    let s = (c - g) / (c + g);
    let p = (n * n * c - g) / (n * n * c + g);
    (s * s + p * p) / (one + one)
}

/// [`fresnel`] of sea water in single precision.
pub fn reflectance(cos: f32) -> f32 {
    fresnel(cos, SEA_WATER_INDEX as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ocean::table;

    #[test]
    fn agrees_with_the_reference_table() {
        let text = include_str!("../../data/fresnel_seawater.csv");
        let mut rows = 0;
        for columns in table::rows(text) {
            let got = f64::from(reflectance(columns[0].to_radians().cos() as f32));
            assert!((got - columns[3]).abs() < 3e-6, "{} deg: {got} is not {}", columns[0], columns[3]);
            rows += 1;
        }
        assert!(rows > 15, "only {rows} rows in the table");
    }
}
