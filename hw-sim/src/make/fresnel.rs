//! How much light the sea's surface mirrors.

/// Refractive index of sea water against air, visible light.
pub const SEA_WATER_INDEX: f32 = 1.34;

/// Reflectance of unpolarised light that meets sea water from the air at an angle whose cosine is `cos_incidence`: the exact
/// Fresnel equations (Born and Wolf 1999, section 1.5, eq. 21), the mean of both polarisations. Clamped to 0 to 1 cosines.
pub fn reflectance(cos_incidence: f32) -> f32 {
    let cos_i = cos_incidence.clamp(0.0, 1.0);
    let n = SEA_WATER_INDEX;
    // g = n cos(refraction), by Snell's law.
    let g = (n * n - 1.0 + cos_i * cos_i).sqrt();
    let rs = (cos_i - g) / (cos_i + g);
    let rp = (n * n * cos_i - g) / (n * n * cos_i + g);
    0.5 * (rs * rs + rp * rp)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_the_reference_table() {
        let table = include_str!("../../data/fresnel_seawater.csv");
        let mut rows = 0;
        for line in table.lines().skip(2) {
            let columns: Vec<f64> = line.split(',').map(|c| c.trim().parse().unwrap()).collect();
            let got = f64::from(reflectance(columns[0].to_radians().cos() as f32));
            assert!((got - columns[3]).abs() < 3e-6, "{} deg: {got} is not {}", columns[0], columns[3]);
            rows += 1;
        }
        assert!(rows > 15, "only {rows} rows in the table");
    }
}
