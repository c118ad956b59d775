//! How what carries the unit moves: to and fro, and by nothing in the mean.

use glam::{DMat2, DVec2};

/// Waves and hands carry a unit away and bring it back. Along each horizontal axis its place is a damped oscillation that chance drives,
/// `x'' + 2 z w x' + w^2 x = noise`, so that neither place nor velocity grow, however long specific force is integrated. How fast it moves
/// and how quickly that changes is watched; `w` is low, because a frequency that is too low only makes it learn more slowly.
#[derive(Clone, Copy, Debug)]
pub(super) struct Carriage {
    /// Frequency without damping, rad/s.
    frequency: f64,
    /// Mean squares of the velocity on an axis over a minute, over some seconds, and over the time in which the frequency is found; (m/s)^2.
    slow: f64,
    fast: f64,
    speed: f64,
    /// Mean square of the acceleration on an axis over that time, (m/s^2)^2.
    acceleration: f64,
    /// How strongly chance drives it, as the changes of the velocity in the last seconds have it, m^2/s^3.
    drive: f64,
    watched_s: f64,
}

/// Share of critical damping: the band is about as wide as it is high.
const DAMPING: f64 = 0.5;
/// Waves last no longer than a turn of this, rad/s: 13 s.
const FREQUENCY_LEAST: f64 = 0.5;
/// Nothing comes back sooner than in a turn of this, rad/s.
const FREQUENCY_MOST: f64 = 4.0;
/// The band's foot is this share of its mean frequency.
const FREQUENCY_SHARE: f64 = 0.25;
/// Velocity on an axis at the start, m/s: a gun's on a ship in sea state 6.
const SPEED_START: f64 = 1.0;
/// No unit moves less, as far as can be told, m/s.
const SPEED_LEAST: f64 = 0.05;
/// None moves faster, m/s.
const SPEED_MOST: f64 = 5.0;
/// Times over which squares are averaged, seconds: longer than a change of the weather's mood, a few waves, and a few strides.
const SLOW_S: f64 = 60.0;
const SOON_S: f64 = 10.0;
const FAST_S: f64 = 5.0;
const DRIVE_S: f64 = 2.0;

impl Carriage {
    /// Nothing seen of it yet.
    pub const fn new() -> Self {
        let start = SPEED_START * SPEED_START;
        Self {
            frequency: FREQUENCY_LEAST,
            slow: start,
            fast: start,
            speed: start,
            acceleration: 0.0,
            drive: 0.0,
            watched_s: 0.0,
        }
    }

    /// Variance of the velocity on an axis, (m/s)^2.
    pub const fn speed_variance(&self) -> f64 {
        self.slow.max(self.fast).max(self.drive / (4.0 * DAMPING * self.frequency))
    }

    /// Variance of the place on an axis, m^2.
    pub const fn place_variance(&self) -> f64 {
        self.speed_variance() / (self.frequency * self.frequency)
    }

    /// What `(x, x')` becomes in `dt_s` seconds in which the velocity was seen to change by `change`, m/s, and the covariance of what chance
    /// adds to it.
    pub fn step(&mut self, change: DVec2, dt_s: f64) -> (DMat2, DMat2) {
        // Half of the sum of both axes' squares, and half of that, because a step's own change is a draw of one.
        let now = 0.25 * change.length_squared() / dt_s;
        self.drive += (now - self.drive) * (dt_s / DRIVE_S).min(1.0);
        let speed = self.speed_variance().max(now / (4.0 * DAMPING * self.frequency));
        let kept = oscillation(self.frequency, dt_s);
        let stays = DMat2::from_diagonal(DVec2::new(self.frequency.powi(-2), 1.0));
        (kept, (stays - kept * stays * kept.transpose()) * speed)
    }

    /// Learns from the velocity that it has, m/s, and its change in the last `dt_s` seconds.
    pub fn watch(&mut self, velocity: DVec2, change: DVec2, dt_s: f64) {
        self.watched_s = (self.watched_s + dt_s).min(SLOW_S);
        let [least, most] = [SPEED_LEAST, SPEED_MOST].map(|v| v * v);
        let square = (0.5 * velocity.length_squared()).min(most);
        let mean = |of: &mut f64, over_s: f64, square: f64| *of += (square - *of) * (dt_s / over_s).min(1.0);
        mean(&mut self.slow, self.watched_s.max(SOON_S), square);
        mean(&mut self.fast, FAST_S, square);
        mean(&mut self.speed, SOON_S, square);
        mean(&mut self.acceleration, SOON_S, 0.5 * change.length_squared() / (dt_s * dt_s));
        self.slow = self.slow.max(least);
        let frequency = FREQUENCY_SHARE * (self.acceleration / self.speed.max(least)).sqrt();
        self.frequency = frequency.clamp(FREQUENCY_LEAST, FREQUENCY_MOST);
    }
}

/// What `(x, x')` of a free oscillation becomes in `dt_s` seconds.
fn oscillation(frequency: f64, dt_s: f64) -> DMat2 {
    let damped = frequency * (1.0 - DAMPING * DAMPING).sqrt();
    let (sin, cos) = (damped * dt_s).sin_cos();
    let (fades, sin, decay) = ((-DAMPING * frequency * dt_s).exp(), sin / damped, DAMPING * frequency);
    let columns = [cos + decay * sin, -frequency * frequency * sin, sin, cos - decay * sin];
    DMat2::from_cols_array(&columns) * fades
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_steps_are_one_of_twice_the_length() {
        let (half, whole) = (oscillation(0.5, 0.2), oscillation(0.5, 0.4));
        assert!((half * half).abs_diff_eq(whole, 1e-12), "{whole}");
        // The velocity is the slope of the place.
        assert!((oscillation(0.5, 1e-6).y_axis.x - 1e-6).abs() < 1e-11);
        let mut carriage = Carriage::new();
        let ((kept, added), stays) = (carriage.step(DVec2::ZERO, 0.2), carriage.place_variance());
        let before = DMat2::from_diagonal(DVec2::new(stays, carriage.speed_variance()));
        assert!((kept * before * kept.transpose() + added).abs_diff_eq(before, 1e-12), "{added}");
        assert!(added.determinant() > 0.0);
    }

    #[test]
    fn hands_come_back_sooner_than_waves() {
        let after = |amplitude: f64, frequency: f64| {
            let mut carriage = Carriage::new();
            for i in 0..1200 {
                let at = |i: i32| DVec2::X * (amplitude * (frequency * 0.1 * f64::from(i)).sin());
                carriage.step(at(i) - at(i - 1), 0.1);
                carriage.watch(at(i), at(i) - at(i - 1), 0.1);
            }
            carriage
        };
        let (waves, hands, rest) = (after(1.0, 0.6), after(1.0, 6.0), after(0.0, 1.0));
        assert_eq!(waves.frequency, FREQUENCY_LEAST);
        assert!((1.0..2.0).contains(&hands.frequency), "{hands:?}");
        assert!((0.2..0.5).contains(&waves.speed_variance()), "{waves:?}");
        assert!(hands.speed_variance() > 0.2, "{hands:?}");
        assert!(rest.speed_variance() < 0.03, "{rest:?}");
    }
}
