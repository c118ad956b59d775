//! How the energy of the waves is spread over frequency and direction.

use crate::{physics::GRAVITY_M_S2, sea::BeaufortForce};

/// Frequencies are drawn between these multiples of the peak's: 99.9 % of a Pierson-Moskowitz sea's energy.
const BAND: (f64, f64) = (0.4, 6.0);

/// Wave energy by frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spectrum {
    significant_height_m: f64,
    peak_rad_s: f64,
    gamma: f64,
}

impl Spectrum {
    /// No waves.
    pub const FLAT: Self = Self { significant_height_m: 0.0, peak_rad_s: 1.0, gamma: 1.0 };

    /// The sea that a wind of `wind_m_s` at 10 m (0 to 25 m/s) raises after a long time (Pierson and Moskowitz 1964): peak
    /// at 0.877 g over the wind at 19.5 m. `None` outside that range.
    pub fn fully_developed(wind_m_s: f64) -> Option<Self> {
        /// Wind at 19.5 m, where Pierson and Moskowitz measured it, over that at 10 m (logarithmic profile).
        const WIND_19_5_OVER_10: f64 = 1.026;
        if wind_m_s == 0.0 {
            return Some(Self::FLAT);
        }
        if !(0.0..=25.0).contains(&wind_m_s) {
            return None;
        }
        let peak_rad_s = 0.877 * GRAVITY_M_S2 / (WIND_19_5_OVER_10 * wind_m_s);
        Some(Self { significant_height_m: pierson_moskowitz_height(peak_rad_s), peak_rad_s, gamma: 1.0 })
    }

    /// A sea of that significant height (0 to 20 m) and peak period (0.5 to 30 s), of the shape of JONSWAP (Hasselmann 1973)
    /// with peak enhancement `gamma` (1, which is Pierson-Moskowitz, to 10). `None` outside those.
    pub fn jonswap(significant_height_m: f64, peak_period_s: f64, gamma: f64) -> Option<Self> {
        let fits = (0.0..=20.0).contains(&significant_height_m)
            && (0.5..=30.0).contains(&peak_period_s)
            && (1.0..=10.0).contains(&gamma);
        fits.then_some(Self {
            significant_height_m,
            peak_rad_s: std::f64::consts::TAU / peak_period_s,
            gamma,
        })
    }

    /// The open sea of a wind force: the probable height of WMO-No. 306 with the period at which Pierson-Moskowitz waves
    /// have it.
    pub fn of_force(force: BeaufortForce) -> Self {
        let significant_height_m = force.probable_wave_height_m();
        if significant_height_m <= 0.0 {
            return Self::FLAT;
        }
        let peak_rad_s = (pierson_moskowitz_height(1.0) / significant_height_m).sqrt();
        Self { significant_height_m, peak_rad_s, gamma: 1.0 }
    }

    /// Four standard deviations of the water's height, metres.
    pub const fn significant_height_m(&self) -> f64 {
        self.significant_height_m
    }

    /// Period of the highest waves, seconds.
    pub fn peak_period_s(&self) -> f64 {
        std::f64::consts::TAU / self.peak_rad_s
    }

    pub(super) const fn peak_rad_s(&self) -> f64 {
        self.peak_rad_s
    }

    /// Shape of the spectrum at `x` times the peak's frequency, not normalised.
    fn shape(&self, x: f64) -> f64 {
        let sigma = if x <= 1.0 { 0.07 } else { 0.09 };
        let peak = (-((x - 1.0) / sigma).powi(2) / 2.0).exp();
        x.powi(-5) * (-1.25 * x.powi(-4)).exp() * self.gamma.powf(peak)
    }

    /// The band's energy in `count` equal shares by rising frequency: the root mean square frequency of each, rad/s. Waves of these
    /// frequencies have the band's mean zero-crossing period, whatever their number.
    pub(super) fn shares_rad_s(&self, count: usize) -> Vec<f64> {
        let x = |i: i32| BAND.0 * (BAND.1 / BAND.0).powf(f64::from(i) / 2000.0);
        let points: Vec<(f64, f64)> = (0..=2000).map(|i| (x(i), self.shape(x(i)))).collect();
        let bounds: Vec<f64> = (0..=count).map(|i| i as f64 / count as f64).collect();
        let ends = invert_cumulative(&points, &bounds);
        let square = |(x, density): (f64, f64)| density * x * x;
        let energy: f64 = points.windows(2).map(|p| (p[0].1 + p[1].1) / 2.0 * (p[1].0 - p[0].0)).sum();
        let share = |pair: &[f64]| {
            let steps = 64;
            let width = (pair[1] - pair[0]) / f64::from(steps);
            let middle = |j: i32| pair[0] + width * (f64::from(j) + 0.5);
            let second: f64 = (0..steps).map(|j| square((middle(j), self.shape(middle(j)))) * width).sum();
            (second * count as f64 / energy).sqrt() * self.peak_rad_s
        };
        ends.windows(2).map(share).collect()
    }
}

/// Significant height of a Pierson-Moskowitz sea with its peak at `peak_rad_s`: 4 sqrt(alpha g^2 / (5 peak^4)).
fn pierson_moskowitz_height(peak_rad_s: f64) -> f64 {
    /// Phillips' constant of the Pierson-Moskowitz spectrum.
    const ALPHA: f64 = 0.0081;
    4.0 * GRAVITY_M_S2 * (ALPHA / 5.0).sqrt() / (peak_rad_s * peak_rad_s)
}

/// Angle from the wind's direction below which the share `quantile` of the energy at `x` times the peak's frequency runs:
/// cos^2s(angle / 2) with s after Mitsuyasu 1975, radians.
pub(super) fn spread_quantile(x: f64, quantile: f64) -> f64 {
    /// Greatest value of the spreading exponent, for wind waves (Goda 1985).
    const SPREAD_MAX: f64 = 10.0;
    let s = SPREAD_MAX * if x <= 1.0 { x.powi(5) } else { x.powf(-2.5) };
    let angle = |i: i32| f64::from(i - 360) * std::f64::consts::PI / 360.0;
    let points: Vec<(f64, f64)> =
        (0..=720).map(|i| (angle(i), (angle(i) / 2.0).cos().abs().powf(2.0 * s))).collect();
    invert_cumulative(&points, &[quantile]).into_iter().sum()
}

/// Where the integral of a density, given at `points` (abscissa, density) and linear between them, reaches each of the
/// shares `quantiles` of its total.
fn invert_cumulative(points: &[(f64, f64)], quantiles: &[f64]) -> Vec<f64> {
    let mut cumulative = vec![0.0];
    let mut sum = 0.0;
    for pair in points.windows(2) {
        sum += (pair[0].1 + pair[1].1) / 2.0 * (pair[1].0 - pair[0].0);
        cumulative.push(sum);
    }
    let locate = |&q: &f64| {
        let target = q * sum;
        let i = cumulative.partition_point(|&c| c <= target).clamp(1, points.len() - 1);
        let (c0, c1) = (cumulative[i - 1], cumulative[i]);
        let share = if c1 > c0 { ((target - c0) / (c1 - c0)).clamp(0.0, 1.0) } else { 0.0 };
        points[i - 1].0 + share * (points[i].0 - points[i - 1].0)
    };
    quantiles.iter().map(locate).collect()
}

/// A sea to make waves of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WaveSpec {
    /// Energy by frequency.
    pub spectrum: Spectrum,
    /// Where the wind, and with it the waves, come from: radians clockwise from north.
    pub wind_from: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_data::rows;

    #[test]
    fn heights_of_pierson_moskowitz_seas_agree_with_the_closed_form() {
        let table = rows(include_str!("../../../data/wave_spectra_moments.csv"));
        let plain: Vec<_> = table.iter().filter(|row| row[1] == 1.0).collect();
        assert_eq!(plain.len(), 5);
        for row in plain {
            let height = pierson_moskowitz_height(std::f64::consts::TAU / row[0]);
            assert!((height - row[2]).abs() < 1e-5 * row[2], "{row:?}: {height}");
        }
    }

    #[test]
    fn the_shape_has_the_moments_of_the_table() {
        // Height over that of gamma 1, and mean zero-crossing period sqrt(m0/m2), both by quadrature of the shape.
        let moment = |s: &Spectrum, n: i32| -> f64 {
            let step = 1e-3;
            (0..60_000)
                .map(|i| 0.3 + step * (f64::from(i) + 0.5))
                .map(|x| s.shape(x) * x.powi(n) * step)
                .sum()
        };
        for row in rows(include_str!("../../../data/wave_spectra_moments.csv")) {
            let spectrum = Spectrum::jonswap(1.0, row[0], row[1]).expect("in range");
            let plain = Spectrum::jonswap(1.0, row[0], 1.0).expect("in range");
            let height = pierson_moskowitz_height(spectrum.peak_rad_s)
                * (moment(&spectrum, 0) / moment(&plain, 0)).sqrt();
            assert!((height - row[3]).abs() < 1e-3 * row[3], "{row:?}: {height}");
            let crossing = (moment(&spectrum, 0) / moment(&spectrum, 2)).sqrt() * row[0];
            assert!((crossing - row[5]).abs() < 2e-3 * row[5], "{row:?}: {crossing}");
        }
    }

    #[test]
    fn the_wind_raises_the_sea_that_handbooks_state() {
        // Carter 1982: a fully developed sea has a significant height of 0.0246 U^2 (U at 10 m, m/s).
        for wind in [2.0, 5.0, 10.0, 15.0] {
            let height = Spectrum::fully_developed(wind).expect("in range").significant_height_m();
            assert!((height / (0.0246 * wind * wind) - 1.0).abs() < 0.1, "{wind} m/s: {height} m");
        }
        for bad in [-1.0, 26.0, f64::NAN] {
            assert!(Spectrum::fully_developed(bad).is_none(), "{bad} m/s");
        }
    }

    #[test]
    fn shares_have_the_periods_of_the_band() {
        let spectrum = Spectrum::jonswap(1.0, 6.0, 1.0).expect("in range");
        let peak = spectrum.peak_rad_s;
        // Closed form of the cumulative: exp(-1.25 x^-4), cut at the ends of the band.
        let below = |w: f64| (-1.25 * (w / peak).powi(-4)).exp();
        let (low, high) = (below(BAND.0 * peak), below(BAND.1 * peak));
        for count in [1, 8, 32] {
            let shares = spectrum.shares_rad_s(count);
            for (i, w) in shares.iter().enumerate() {
                let at = (below(*w) - low) / (high - low) * count as f64;
                assert!((i as f64..=i as f64 + 1.0).contains(&at), "{w} rad/s lies in share {at}, not {i}");
            }
            // Mean square frequency by the substitution u = 1.25 x^-4: sqrt(1.25) times an integral of u^-1/2 exp(-u).
            let u = |x: f64| 1.25 / x.powi(4);
            let n = 200_000;
            let (from, to) = (u(BAND.1).sqrt(), u(BAND.0).sqrt());
            let integral: f64 = (0..n)
                .map(|i| from + (to - from) * (f64::from(i) + 0.5) / f64::from(n))
                .map(|v| 2.0 * (-v * v).exp() * (to - from) / f64::from(n))
                .sum();
            let expected = 1.25f64.sqrt() * integral / (high - low) * peak * peak;
            let found = shares.iter().map(|w| w * w).sum::<f64>() / count as f64;
            assert!((found / expected - 1.0).abs() < 1e-3, "{count} shares: {found} against {expected}");
        }
    }

    #[test]
    fn directions_spread_about_the_wind_and_more_so_off_the_peak() {
        let half_width = |x: f64| spread_quantile(x, 0.84) - spread_quantile(x, 0.16);
        assert!(spread_quantile(1.0, 0.5).abs() < 1e-9);
        assert!(half_width(1.0) < half_width(2.0) && half_width(2.0) < half_width(4.0));
        assert!(spread_quantile(5.0, 0.999) < std::f64::consts::PI);
    }
}
