//! Contrast that human eyes need, and the chance that a glimpse is enough.
//!
//! Thresholds are Blackwell's of 1946 (Tiffany data: 450,000 answers, even discs on an even background, both eyes, half of the answers right), in the
//! closed form of Crumey (2014, Monthly Notices of the Royal Astronomical Society 442, 2600; equations 25, 28 and 39 to 44).

use std::f64::consts::{PI, TAU};

use crate::statistics::normal_share;

/// Backgrounds below that are as good as black to an eye, cd/m^2 (Crumey 2014, 2.1): what an eye needs on top no longer falls.
pub const DARKEST_CD_M2: f64 = 1e-5;
/// Brightest background that was measured, cd/m^2: 1000 foot-lamberts. Beyond it contrast alone counts (Weber).
pub const BRIGHTEST_CD_M2: f64 = 3426.0;
/// Factor between thresholds of trained people in a laboratory and of people who say that they see something (Crumey 2014, 1.6: 1.4 to 2.4).
pub const FIELD: f64 = 2.0;
/// Deviation of the contrasts at which people begin to see, as a share of the threshold (Blackwell 1946: a normal ogive).
pub const SPREAD: f64 = 0.48;
/// Chance of a glimpse from which on something counts as seen by somebody who looks at it.
pub const SEEN: f64 = 0.5;

/// Crumey's law at one background.
#[derive(Clone, Copy, Debug)]
struct Law {
    /// Threshold contrast times solid angle of what is small, steradians (Ricco's law).
    small_sr: f64,
    /// Threshold contrast of what is large.
    large: f64,
    /// Exponent that joins both.
    join: f64,
}

impl Law {
    fn at(background_cd_m2: f64) -> Self {
        let fourth = background_cd_m2.powf(-0.25);
        // A hyperbola of that root: rods at its one end, cones at the other.
        let hyperbola =
            |[a, b, c, d, e]: [f64; 5]| ((a * fourth + b) * fourth + c).max(0.0).sqrt() + d * fourth + e;
        let small = hyperbola([5.949e-8, -2.389e-7, 2.459e-7, 4.120e-4, -4.225e-4]);
        let large = hyperbola([9.606e-6, -4.112e-5, 5.019e-5, 4.837e-3, -4.884e-3]);
        let log = background_cd_m2.log10();
        let join = match background_cd_m2 {
            b if b >= 3.40 => 1.146 - 0.0885 * log,
            b if b >= 0.193 => 0.8861 + 0.4 * log,
            _ => 0.6,
        };
        Self { small_sr: small * small, large, join }
    }

    fn contrast(&self, solid_angle_sr: f64) -> f64 {
        let small = (self.small_sr / solid_angle_sr).powf(self.join);
        (small + self.large.powf(self.join)).powf(self.join.recip())
    }
}

/// Background that thresholds are taken at, and what they are to be multiplied with for the one that there is.
fn measured(background_cd_m2: f64) -> (f64, f64) {
    let measured = background_cd_m2.clamp(DARKEST_CD_M2, BRIGHTEST_CD_M2);
    (measured, measured.min(DARKEST_CD_M2) / background_cd_m2.clamp(f64::MIN_POSITIVE, DARKEST_CD_M2))
}

/// Contrast over a background at which half of the glimpses show a disc of that solid angle, steradians. It is luminance over or under the
/// background's, as a share of that.
pub fn contrast(background_cd_m2: f64, solid_angle_sr: f64) -> f64 {
    let (measured, times) = measured(background_cd_m2);
    times * Law::at(measured).contrast(solid_angle_sr.clamp(1e-300, TAU))
}

/// Illuminance at the eye at which half of the glimpses show a point of light before a background, lux.
pub fn illuminance(background_cd_m2: f64) -> f64 {
    let (measured, times) = measured(background_cd_m2);
    Law::at(measured).small_sr * times * background_cd_m2.max(f64::MIN_POSITIVE)
}

/// Chance that a glimpse shows what has so many times the contrast that half of the glimpses need; none for what has no contrast.
pub fn chance(times_threshold: f64) -> f64 {
    let none = normal_share(-SPREAD.recip());
    ((normal_share((times_threshold.max(0.0) - 1.0) / SPREAD) - none) / (1.0 - none)).max(0.0)
}

/// Luminance that a light spreads over all that an eye looks at, cd/m^2: `lux` at the eye, `off` radians from where it looks
/// (Stiles and Holladay; CIE 146:2002 for people of 25 to 30 years, for 1 to 30 degrees; nearer it is as at one).
pub fn veil_cd_m2(lux: f64, off: f64) -> f64 {
    const LEAST_DEG: f64 = 1.0;
    const AGE: f64 = 1.03;
    let off = off.clamp(0.0, PI).to_degrees().max(LEAST_DEG);
    10.0 * AGE * lux.max(0.0) / (off * off)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Solid angle of a disc, steradians.
    fn disc(minutes: f64) -> f64 {
        PI / 4.0 * (minutes * PI / 10_800.0).powi(2)
    }

    #[test]
    fn thresholds_are_those_that_blackwell_measured() {
        // Log threshold contrasts of table VIII for discs of .595, 3.60, 9.68, 18.2, 55.2 and 121 minutes, by sky magnitudes a square second as
        // Clark (1990) gives them. The fit is the paper's: its errors are a sixth of a decade at most.
        const ROWS: [(f64, [f64; 6]); 5] = [
            (4.0, [-0.3769, -1.8064, -2.3368, -2.4601, -2.5469, -2.5610]),
            (10.0, [0.0498, -1.4655, -2.1659, -2.3763, -2.5047, -2.5269]),
            (16.0, [1.1558, -0.3952, -1.1264, -1.4176, -1.7300, -1.8727]),
            (20.0, [2.6760, 1.0880, 0.2060, -0.3210, -0.8800, -1.1370]),
            (27.0, [4.6100, 3.0660, 2.1320, 1.5850, 0.6520, 0.2410]),
        ];
        for (magnitude, row) in ROWS {
            let background = 10f64.powf(0.4 * (12.58 - magnitude));
            for (minutes, log) in [0.595, 3.60, 9.68, 18.2, 55.2, 121.0].into_iter().zip(row) {
                let off = contrast(background, disc(minutes)).log10() - log;
                assert!(off.abs() < 0.2, "{magnitude} {minutes}: {off}");
            }
        }
    }

    #[test]
    fn small_dark_and_faint_is_never_easier() {
        let backgrounds = || (-200..=200).map(|i| 10f64.powf(f64::from(i) / 20.0));
        for (darker, brighter) in backgrounds().zip(backgrounds().skip(1)) {
            for minutes in [0.01, 0.6, 3.0, 20.0, 300.0, 1e4] {
                let sr = disc(minutes);
                assert!(contrast(darker, sr) >= contrast(brighter, sr) * (1.0 - 1e-9), "{darker} {minutes}");
                assert!(contrast(darker, sr) >= contrast(darker, disc(minutes * 1.1)), "{darker} {minutes}");
            }
            // Where rods give way to cones the published fit falls by a few hundredths.
            assert!(illuminance(darker) <= 1.1 * illuminance(brighter), "{darker}");
        }
        let shares: Vec<f64> = (0..400).map(|i| chance(f64::from(i) / 100.0)).collect();
        assert!(shares.windows(2).all(|w| w[0] <= w[1]) && shares[0] == 0.0 && shares[399] > 0.999);
        assert!((chance(1.0) - 0.5).abs() < 0.02, "{}", chance(1.0));
    }

    #[test]
    fn extremes_stay_numbers() {
        for background in [0.0, 1e-300, 1e-9, 1.0, 1e9, f64::MAX] {
            for sr in [0.0, 1e-300, 1e-12, 1.0, 1e9] {
                assert!(contrast(background, sr) > 0.0, "{background} {sr}");
            }
            assert!(illuminance(background).is_finite() && illuminance(background) >= 0.0);
        }
        assert_eq!(chance(f64::INFINITY), 1.0);
        assert!([0.0, 1e-9, 3.0].map(|off| veil_cd_m2(1e5, off)).iter().all(|v| v.is_finite()));
    }

    #[test]
    fn glare_falls_with_the_square_of_the_angle() {
        let veil = |deg: f64| veil_cd_m2(1000.0, deg.to_radians());
        assert!((veil(10.0) / 103.0 - 1.0).abs() < 1e-9);
        assert!((veil(5.0) / veil(10.0) - 4.0).abs() < 1e-9);
    }
}
