//! How bright the sea is in the picture, by how far below the horizon it is seen.

use glam::{DMat3, DVec3};

/// What is left of a spread that the camera's noise alone could make, sRGB code 0 to 1.
const SPREAD_MIN: f32 = 0.004;

/// One pixel of sea.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToneSample {
    /// Tangent of the angle below the horizontal under which it is seen.
    pub tangent: f64,
    /// Luma of its sRGB code, 0 to 1.
    pub luma: f64,
}

/// Mean and standard deviation of the sea's luma (sRGB-coded, 0 to 1): polynomials of the root of the tangent below the horizontal, which
/// follow the steep change towards the horizon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeaTones {
    /// Coefficients of the mean, of the root's powers 0 to 2.
    pub mean: [f32; 3],
    /// The same of the standard deviation.
    pub spread: [f32; 3],
    /// The roots between which they were found; outside of them their ends hold.
    pub roots: [f32; 2],
}

impl Default for SeaTones {
    /// A dark grey sea, before any was seen.
    fn default() -> Self {
        Self { mean: [0.4, 0.0, 0.0], spread: [0.05, 0.0, 0.0], roots: [0.0, 1.0] }
    }
}

impl SeaTones {
    /// Fits the pixels. `None` for fewer than a dozen, or ones that all lie in one row.
    pub fn fit(samples: &[ToneSample]) -> Option<Self> {
        let roots = || samples.iter().map(|s| s.tangent.max(0.0).sqrt());
        let (low, high) = roots().fold((f64::MAX, f64::MIN), |(a, b), r| (a.min(r), b.max(r)));
        if samples.len() < 12 || (high - low).is_nan() || high - low <= 1e-3 {
            return None;
        }
        let mean = quadratic(roots().zip(samples.iter().map(|s| s.luma)))?;
        // A normal distribution's mean deviation is sqrt(2 / pi) of its standard deviation.
        let off = |(root, s): (f64, &ToneSample)| (root, 1.2533 * (s.luma - value(mean, root)).abs());
        let spread = quadratic(roots().zip(samples).map(off))?;
        let single = |v: DVec3| v.as_vec3().to_array();
        Some(Self { mean: single(mean), spread: single(spread), roots: [low as f32, high as f32] })
    }

    /// Mean luma (sRGB-coded) of what is seen under that tangent; `None` where no sea was seen.
    pub fn mean_at(&self, tangent: f64) -> Option<f32> {
        let root = tangent.max(0.0).sqrt() as f32;
        let [low, high] = self.roots;
        (low..=high).contains(&root).then(|| self.mean[0] + root * (self.mean[1] + root * self.mean[2]))
    }

    /// How many standard deviations brighter than the sea's mean a luma is where it is seen under that tangent.
    pub fn tone(&self, tangent: f64, luma: f32) -> f32 {
        let root = (tangent.max(0.0).sqrt() as f32).clamp(self.roots[0], self.roots[1]);
        let at = |c: &[f32; 3]| c[0] + root * (c[1] + root * c[2]);
        (luma - at(&self.mean)) / at(&self.spread).max(SPREAD_MIN)
    }

    /// Moves a share of the way to `other`.
    #[must_use]
    pub fn towards(&self, other: &Self, share: f32) -> Self {
        let mix = |a: [f32; 3], b: [f32; 3]| std::array::from_fn(|i| a[i] + (b[i] - a[i]) * share);
        Self {
            mean: mix(self.mean, other.mean),
            spread: mix(self.spread, other.spread),
            roots: [self.roots[0].min(other.roots[0]), self.roots[1].max(other.roots[1])],
        }
    }
}

fn value(c: DVec3, x: f64) -> f64 {
    c.x + x * (c.y + x * c.z)
}

/// Least squares.
fn quadratic(points: impl Iterator<Item = (f64, f64)>) -> Option<DVec3> {
    let (mut normal, mut right) = (DMat3::ZERO, DVec3::ZERO);
    for (x, y) in points {
        let powers = DVec3::new(1.0, x, x * x);
        normal += DMat3::from_cols(powers * powers.x, powers * powers.y, powers * powers.z);
        right += powers * y;
    }
    // A little stiffness holds what few rows leave open.
    let stiff = 1e-9 * normal.x_axis.x;
    normal += DMat3::from_diagonal(DVec3::splat(stiff));
    let solved = normal.inverse() * right;
    solved.is_finite().then_some(solved)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sea_that_darkens_towards_the_eye_is_fitted() {
        let samples: Vec<ToneSample> = (0..400)
            .map(|i| {
                let tangent = 0.01 + 0.001 * f64::from(i % 100);
                let noise = if i % 2 == 0 { 0.03 } else { -0.03 };
                ToneSample { tangent, luma: 0.6 - 0.5 * tangent.sqrt() + noise }
            })
            .collect();
        let tones = SeaTones::fit(&samples).expect("enough");
        assert!(tones.tone(0.04, 0.5).abs() < 0.02);
        // Two values 0.03 on either side: the normal distribution of that mean deviation.
        assert!((tones.tone(0.04, 0.53) - 0.03 / (0.03 * 1.2533)).abs() < 0.02);
        assert_eq!(SeaTones::fit(&samples[..11]), None);
        assert_eq!(SeaTones::fit(&[ToneSample { tangent: 0.1, luma: 0.3 }; 50]), None);
        for tangent in [0.0, -1.0, 1e9, f64::NAN] {
            assert!(tones.tone(tangent, 0.4).is_finite(), "{tangent}");
        }
    }
}
