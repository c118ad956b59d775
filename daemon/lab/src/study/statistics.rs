//! Rates, their standard errors, and d'.

use statrs::function::erf::erfc_inv;

/// A rate with its standard error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// One standard deviation of it.
    pub error: f64,
}

/// How often of how many.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AnswerTally {
    /// Pictures called real.
    pub real: u32,
    /// Pictures answered.
    pub seen: u32,
}

impl AnswerTally {
    /// Takes in one answer.
    pub fn add(&mut self, called_real: bool) {
        self.real += u32::from(called_real);
        self.seen += 1;
    }

    /// Both together.
    pub fn plus(self, other: Self) -> Self {
        Self { real: self.real + other.real, seen: self.seen + other.seen }
    }

    /// Share called real; `None` where nothing was answered.
    pub fn rate(self) -> Option<f64> {
        (self.seen > 0).then(|| f64::from(self.real) / f64::from(self.seen))
    }

    /// The rate away from 0 and 1, whose z is infinite: half an answer stands for none (Macmillan and Kaplan 1985).
    fn corrected(self) -> Option<f64> {
        let half = 0.5 / f64::from(self.seen);
        self.rate().map(|rate| rate.clamp(half, 1.0 - half))
    }
}

/// The rate of all answers. Its error is that of the mean over participants (their spread by the root of their number), since a
/// participant's answers are not independent; of a single one, the binomial error.
pub fn rate(participants: &[AnswerTally]) -> Option<Estimate> {
    let all = participants.iter().copied().fold(AnswerTally::default(), AnswerTally::plus);
    let value = all.rate()?;
    let rates: Vec<f64> = participants.iter().filter_map(|t| t.rate()).collect();
    let n = rates.len() as f64;
    let error = if rates.len() < 2 {
        (value * (1.0 - value) / f64::from(all.seen)).sqrt()
    } else {
        let mean = rates.iter().sum::<f64>() / n;
        (rates.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt()
    };
    Some(Estimate { value, error })
}

/// d' = z(hits) - z(false alarms), hits being real pictures called real and false alarms generated ones called real (Green and
/// Swets 1966); error by Gourevitch and Galanter 1967. `None` where either kind was not answered.
pub fn d_prime(real: AnswerTally, generated: AnswerTally) -> Option<Estimate> {
    let (hits, false_alarms) = (real.corrected()?, generated.corrected()?);
    let share = |p: f64, n: u32| p * (1.0 - p) / (f64::from(n) * density(z(p)).powi(2));
    Some(Estimate {
        value: z(hits) - z(false_alarms),
        error: (share(hits, real.seen) + share(false_alarms, generated.seen)).sqrt(),
    })
}

/// The standard normal deviate below which a share `p` lies.
fn z(p: f64) -> f64 {
    -std::f64::consts::SQRT_2 * erfc_inv(2.0 * p)
}

fn density(z: f64) -> f64 {
    (-z * z / 2.0).exp() / std::f64::consts::TAU.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tally(real: u32, seen: u32) -> AnswerTally {
        AnswerTally { real, seen }
    }

    #[test]
    fn deviates_of_printed_tables() {
        // Abramowitz and Stegun, table 26.5.
        for (p, value) in
            [(0.5, 0.0), (0.9, 1.281_551_6), (0.975, 1.959_964_0), (0.25, -0.674_489_8), (0.995, 2.575_829_3)]
        {
            assert!((z(p) - value).abs() < 1e-6, "{p}: {}", z(p));
        }
    }

    #[test]
    fn the_thesis_has_a_d_prime_of_1_87() {
        // 87 % of the real pictures and 23 % of the generated ones were called real: 1.126 + 0.739.
        let d = d_prime(tally(87, 100), tally(23, 100)).expect("both kinds");
        assert!((d.value - 1.865).abs() < 0.001, "{d:?}");
    }

    #[test]
    fn d_prime_and_its_error_by_hand() {
        // H = 9/10, F = 5/20: 1.28155 + 0.67449. 0.09/10/0.175498^2 + 0.1875/20/0.317777^2 = 0.29222 + 0.09284.
        let d = d_prime(tally(9, 10), tally(5, 20)).expect("both kinds");
        assert!((d.value - 1.956_04).abs() < 1e-4, "{d:?}");
        assert!((d.error - 0.620_5).abs() < 1e-3, "{d:?}");
    }

    #[test]
    fn rates_of_none_and_all_are_corrected_by_half_an_answer() {
        // 10 of 10 counts as 9.5, 0 of 20 as 0.5: 1.64485 + 1.95996.
        let d = d_prime(tally(10, 10), tally(0, 20)).expect("both kinds");
        assert!((d.value - 3.604_81).abs() < 1e-4 && d.error.is_finite(), "{d:?}");
        assert_eq!(d_prime(tally(0, 0), tally(1, 2)), None);
        let single = d_prime(tally(1, 1), tally(0, 1)).expect("both kinds");
        assert_eq!(single.value, 0.0, "one answer each tells nothing");
    }

    #[test]
    fn the_error_of_a_rate_comes_from_the_spread_of_participants() {
        // Rates 0.25, 0.5, 0.75: deviation 0.25, by the root of 3.
        let three = rate(&[tally(1, 4), tally(2, 4), tally(3, 4)]).expect("answers");
        assert!((three.value - 0.5).abs() < 1e-12 && (three.error - 0.25 / 3f64.sqrt()).abs() < 1e-12);
        // One participant: sqrt(0.25 * 0.75 / 4).
        let one = rate(&[tally(1, 4), AnswerTally::default()]).expect("answers");
        assert!((one.error - (0.1875_f64 / 4.0).sqrt()).abs() < 1e-12, "{one:?}");
        assert_eq!(rate(&[AnswerTally::default()]), None);
    }
}
