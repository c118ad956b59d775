//! Where the rounds of one weapon scatter.

use std::f64::consts::TAU;

use glam::DVec3;
use rand::RngExt;
use rand_pcg::Pcg64;

/// Direction of round `shot_number` of a weapon that points along the unit vector `bore`: a circular normal scatter of
/// `sigma_mrad` milliradians standard deviation along each of two axes. The same seed and number give the same direction.
///
/// Each shot has a stream of its own, so that a round's scatter does not depend on which rounds were fired before it.
pub fn dispersed(bore: DVec3, sigma_mrad: f64, seed: u64, shot_number: u64) -> DVec3 {
    if sigma_mrad.is_nan() || sigma_mrad <= 0.0 {
        return bore;
    }
    let mut rng = Pcg64::new(u128::from(seed), u128::from(shot_number));
    // Box and Muller 1958; 1 - u keeps the logarithm finite.
    let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt() * sigma_mrad * 1e-3;
    let (sin, cos) = (rng.random::<f64>() * TAU).sin_cos();
    let (right, up) = bore.any_orthonormal_pair();
    (bore + radius * (cos * right + sin * up)).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scatters_as_stated_about_the_bore() {
        let bore = DVec3::new(0.3, 0.9, -0.05).normalize();
        let (right, up) = bore.any_orthonormal_pair();
        let n = 20_000_u32;
        let (mut mean, mut square, mut cross) = ([0.0; 2], [0.0; 2], 0.0);
        for shot in 0..n {
            let d = dispersed(bore, 0.6, 1, u64::from(shot));
            assert!((d.length() - 1.0).abs() < 1e-12);
            let xy = [d.dot(right) / d.dot(bore) * 1e3, d.dot(up) / d.dot(bore) * 1e3];
            for axis in 0..2 {
                mean[axis] += xy[axis] / f64::from(n);
                square[axis] += xy[axis] * xy[axis] / f64::from(n);
            }
            cross += xy[0] * xy[1] / f64::from(n);
        }
        // Five standard errors of each estimate.
        let tolerance = 5.0 * 0.6 / f64::from(n).sqrt();
        for axis in 0..2 {
            assert!(mean[axis].abs() < tolerance, "mean {mean:?} mrad");
            assert!((square[axis].sqrt() - 0.6).abs() < tolerance, "sigma^2 {square:?} mrad^2");
        }
        assert!(cross.abs() < 0.6 * tolerance, "axes are correlated: {cross} mrad^2");
    }

    #[test]
    fn the_same_seed_and_shot_give_the_same_direction_and_others_do_not() {
        let d = dispersed(DVec3::Y, 0.6, 7, 3);
        assert_eq!(d, dispersed(DVec3::Y, 0.6, 7, 3));
        assert_ne!(d, dispersed(DVec3::Y, 0.6, 7, 4));
        assert_ne!(d, dispersed(DVec3::Y, 0.6, 8, 3));
    }

    #[test]
    fn no_dispersion_is_the_bore_itself() {
        for sigma in [0.0, -1.0, f64::NAN] {
            assert_eq!(dispersed(DVec3::Y, sigma, 1, 1), DVec3::Y);
        }
    }
}
