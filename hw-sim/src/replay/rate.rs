//! How fast the unit's clock runs, from one round of a recording.

/// Collects pairs of device time and arrival and finds the rate between the two clocks from the lower convex hull of the
/// arrivals, which delays of the line only ever lie above: Moon, Skelly and Towsley, "Estimation and removal of clock skew
/// from network delay measurements", INFOCOM 1999, section III. Of all lines below the points the hull's edge over their
/// mean has the least sum of distances.
#[derive(Debug, Default)]
pub(super) struct ClockRate {
    origin: Option<(i64, i64)>,
    hull: Vec<(i64, i64)>,
    device_sum: i128,
    count: i128,
    newest: i64,
}

impl ClockRate {
    /// Takes one sample's times; those not newer than the one before are left out.
    pub(super) fn note(&mut self, device_ns: i64, arrival_ns: i64) {
        let origin = *self.origin.get_or_insert((device_ns, arrival_ns));
        let point = (device_ns.saturating_sub(origin.0), arrival_ns.saturating_sub(origin.1));
        if self.count > 0 && point.0 <= self.newest {
            return;
        }
        self.newest = point.0;
        self.device_sum += i128::from(point.0);
        self.count += 1;
        while let [.., a, b] = self.hull[..] {
            if turns_left(a, b, point) {
                break;
            }
            self.hull.pop();
        }
        self.hull.push(point);
    }

    /// From the first device time to the newest, nanoseconds.
    pub(super) const fn span_ns(&self) -> i64 {
        self.newest
    }

    /// Device nanoseconds in `host_ns`. Without two samples, or where the rates differ by more than a hundredth (no unit's
    /// clock is that bad), the clocks count as equal.
    pub(super) fn device_ns(&self, host_ns: i64) -> i64 {
        let mean = self.device_sum / self.count.max(1);
        let edge = self.hull.windows(2).find(|edge| i128::from(edge[1].0) >= mean);
        let Some(&[(device_0, host_0), (device_1, host_1)]) = edge else { return host_ns };
        let rate = device_1.saturating_sub(device_0) as f64 / host_1.saturating_sub(host_0) as f64;
        if (rate - 1.0).abs() < 0.01 {
            host_ns + (host_ns as f64 * (rate - 1.0)).round() as i64
        } else {
            host_ns
        }
    }
}

/// Whether the way from `a` over `b` to `c` bends upwards.
fn turns_left(a: (i64, i64), b: (i64, i64), c: (i64, i64)) -> bool {
    let to = |(x, y): (i64, i64)| (i128::from(x) - i128::from(a.0), i128::from(y) - i128::from(a.1));
    let (b, c) = (to(b), to(c));
    b.0 * c.1 > b.1 * c.0
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    use super::*;

    /// 20 s at 200 Hz, a clock 80 ppm fast, 3 ms of delay on average and bursts of 80 ms.
    #[test]
    fn delays_do_not_spoil_the_rate() {
        let mut random = Pcg64Mcg::seed_from_u64(1);
        let mut rate = ClockRate::default();
        for n in 0..4000_i64 {
            let host = n * 5_000_000;
            let delay = -(random.random_range(1e-9..1.0_f64)).ln() * 3e6;
            let burst = if n % 500 < 16 { 80e6 } else { 0.0 };
            rate.note(
                7_000_000_000 + host + host * 80 / 1_000_000,
                50_000_000_000 + host + (delay + burst) as i64,
            );
        }
        let error = rate.device_ns(20_000_000_000) - (20_000_000_000 + 20_000_000 * 80 / 1_000);
        assert!(error.abs() < 50_000, "{error} ns in 20 s");
    }

    #[test]
    fn clocks_that_say_nothing_count_as_equal() {
        let mut rate = ClockRate::default();
        assert_eq!(rate.device_ns(1_000), 1_000);
        rate.note(5, 5);
        assert_eq!(rate.device_ns(1_000), 1_000);
        for n in 0..100 {
            rate.note(5, n);
        }
        assert_eq!(rate.device_ns(1_000), 1_000);
        rate.note(i64::MAX, 7);
        rate.note(i64::MIN, 8);
        assert_eq!(rate.device_ns(1_000), 1_000);
    }
}
