//! Light that air about a lamp scatters to the camera.
//!
//! Single scattering of a point that shines to all sides depends on nothing but the angle between line of sight and lamp, and on where the line
//! ends: so it is integrated once a frame and looked up.

use std::f64::consts::PI;

/// Angles between line of sight and lamp, spaced by the square root of half of each one's sine, and ends of the line, spaced by
/// `end / (end + range)`; longest step of the integral from one end to the next, in the angle at the lamp (Kulla and Fajardo 2012, section 4).
const ANGLES: usize = 48;
const ENDS: usize = 32;
const STEP: f64 = 0.1;

/// Phase function of marine aerosol, 1/sr: two functions of Henyey and Greenstein (1941), forward and back. Their mean cosine is .69 (marine:
/// .7, Andrews et al. 2006), and straight back they give 1/23, the searchlight's ratio.
pub(super) fn phase(cosine: f64) -> f64 {
    const FORWARD: f64 = 0.8;
    const BACK: f64 = -0.5;
    const FORWARD_SHARE: f64 = 0.918;
    let of = |g: f64| {
        let base = 1.0 + g * g - 2.0 * g * cosine;
        (1.0 - g * g) / (4.0 * PI * base * base.sqrt())
    };
    FORWARD_SHARE * of(FORWARD) + (1.0 - FORWARD_SHARE) * of(BACK)
}

/// Glow of one lamp of intensity 1.
#[derive(Clone, Debug, Default)]
pub(super) struct AirGlow {
    /// By angle, then by end: the integral up to there, over the distance of the line from the lamp.
    sums: Vec<[f64; ENDS + 1]>,
    range_m: f64,
    /// Sine of half of the least angle that is looked up.
    least: f64,
}

impl AirGlow {
    /// For a lamp `range_m` away, in air that takes so much in a metre. Lines of sight within `least_angle` of the lamp, radians, get what those
    /// at that angle do.
    pub(super) fn prepare(&mut self, range_m: f64, extinction_per_m: f64, least_angle: f64) {
        (self.range_m, self.least) = (range_m, (0.5 * least_angle).sin());
        self.sums.clear();
        self.sums.extend((0..=ANGLES).map(|i| {
            let angle = 2.0 * (i as f64 / ANGLES as f64).powi(2).asin();
            integrals(range_m, angle, extinction_per_m)
        }));
    }

    /// Light along a line of sight whose angle to the lamp has that cosine, up to `end_m` metres, 1/m^2.
    pub(super) fn towards(&self, cosine: f64, end_m: f64) -> f64 {
        let half2 = (0.5 - 0.5 * cosine).clamp(self.least * self.least, 1.0);
        let half = half2.sqrt();
        let off_m = 2.0 * self.range_m * half * (1.0 - half2).sqrt();
        let share = if end_m.is_finite() { end_m / (end_m + self.range_m) } else { 1.0 };
        let (row, of_row) = split(half.sqrt() * ANGLES as f64, ANGLES);
        let (end, of_end) = split(share.max(0.0) * ENDS as f64, ENDS);
        let along = |sums: &[f64; ENDS + 1]| sums[end] + of_end * (sums[end + 1] - sums[end]);
        let (Some(a), Some(b)) = (self.sums.get(row), self.sums.get(row + 1)) else { return 0.0 };
        let sum = along(a) + of_row * (along(b) - along(a));
        // Straight away from the lamp nothing is left of the line's part.
        sum / off_m.max(1e-3 * self.range_m)
    }
}

fn split(place: f64, cells: usize) -> (usize, f64) {
    let cell = (place as usize).min(cells - 1);
    (cell, place - cell as f64)
}

/// Sums of the phase function and the air's share along one line, from end to end.
fn integrals(range_m: f64, angle: f64, extinction_per_m: f64) -> [f64; ENDS + 1] {
    let (along_m, off_m) = (range_m * angle.cos(), range_m * angle.sin());
    // Angle at the lamp between its foot on the line and an end.
    let at_lamp = |end: usize| {
        let share = end as f64 / ENDS as f64;
        (range_m * share - along_m * (1.0 - share)).atan2(off_m * (1.0 - share))
    };
    let mut sums = [0.0; ENDS + 1];
    for end in 0..ENDS {
        let (from, to) = (at_lamp(end), at_lamp(end + 1));
        let steps = ((to - from) / STEP).ceil().max(1.0);
        let step = (to - from) / steps;
        let part = |i: u32| {
            let (sine, cosine) = (from + (f64::from(i) + 0.5) * step).sin_cos();
            // Light goes on from the lamp to the line's point, and from there back along the line.
            let path_m = off_m / cosine.max(1e-9) + (along_m + off_m * sine / cosine.max(1e-9)).max(0.0);
            phase(-sine) * (-extinction_per_m * path_m).exp()
        };
        sums[end + 1] = sums[end] + extinction_per_m * step * (0..steps as u32).map(part).sum::<f64>();
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_phase_function_is_normal_and_fits_the_searchlights() {
        let steps = 200_000;
        let (mut sum, mut mean) = (0.0, 0.0);
        for i in 0..steps {
            let cosine = (f64::from(i) + 0.5) / f64::from(steps) * 2.0 - 1.0;
            let part = phase(cosine) * 2.0 * PI * 2.0 / f64::from(steps);
            sum += part;
            mean += part * cosine;
        }
        assert!((sum - 1.0).abs() < 1e-4 && (mean - 0.69).abs() < 0.01, "{sum} {mean}");
        assert!((phase(-1.0) * 23.0 - 1.0).abs() < 0.01, "{}", phase(-1.0));
    }

    /// The same integral by distance, step by step, with the true angles.
    fn stepped(range_m: f64, angle: f64, extinction_per_m: f64, end_m: f64) -> f64 {
        let steps = 300_000;
        let lamp = glam::DVec2::new(angle.cos(), angle.sin()) * range_m;
        // Even steps of the logarithm of the distance.
        let (low, high) = (1e-3f64.ln(), end_m.ln());
        let step = (high - low) / f64::from(steps);
        (0..steps)
            .map(|i| {
                let s = (low + step * (f64::from(i) + 0.5)).exp();
                let from_lamp = glam::DVec2::new(s, 0.0) - lamp;
                let r = from_lamp.length();
                let cosine = -from_lamp.x / r;
                extinction_per_m * phase(cosine) * (-extinction_per_m * (r + s)).exp() / (r * r) * s * step
            })
            .sum()
    }

    #[test]
    fn looked_up_light_is_the_integral_along_the_line() {
        for (range_m, visibility_m) in [(60.0, 2e4), (400.0, 2e4), (400.0, 500.0), (2000.0, 5000.0)] {
            let extinction = 3.912 / visibility_m;
            let mut glow = AirGlow::default();
            glow.prepare(range_m, extinction, 1e-3);
            let beside = glow.towards(f64::cos(0.05), f64::INFINITY);
            for angle in [0.01, 0.05, 0.2, 0.5, 1.0, 2.0, 2.8] {
                for end_m in [0.5 * range_m, 1.5 * range_m, 4e4] {
                    let truth = stepped(range_m, angle, extinction, end_m);
                    let found = glow.towards(f64::cos(angle), end_m);
                    let whole = glow.towards(f64::cos(angle), f64::INFINITY);
                    assert!(
                        (found - truth).abs() < 0.05 * truth + 0.03 * whole + 2e-3 * beside,
                        "{range_m} {visibility_m} {angle} {end_m}: {found} {truth}"
                    );
                }
            }
        }
    }

    #[test]
    fn extremes_are_finite_and_never_negative() {
        for (range_m, extinction) in [(1.0, 0.08), (2e4, 1e-7), (300.0, 0.08)] {
            let mut glow = AirGlow::default();
            glow.prepare(range_m, extinction, 0.004);
            for cosine in [1.0, 1.0 + 1e-12, 0.999_999_9, 0.0, -1.0, -1.0 - 1e-12] {
                for end_m in [0.0, 1.0, 1e6, f64::INFINITY] {
                    let light = glow.towards(cosine, end_m);
                    assert!(light.is_finite() && light >= 0.0, "{range_m} {cosine} {end_m} {light}");
                }
            }
        }
        assert_eq!(AirGlow::default().towards(0.5, 1.0), 0.0, "nothing is prepared");
    }
}
