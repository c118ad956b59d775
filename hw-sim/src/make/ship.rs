//! The ship's own instruments: what they measure of the exact motion, and when the host hears of it.

use std::f64::consts::TAU;

use bowwave_core::{
    event::ShipSample,
    time::{Time, secs_to_ns},
};

use super::{imu::draw_latency, recipe::Recipe};
use crate::ocean::random::{gaussian, stream};

/// All lines of a recording, in the order of measurement; none where the recipe has no feed. `start` is the recording's start on the
/// host's clock.
pub fn samples(recipe: &Recipe, start: Time) -> Vec<ShipSample> {
    let Some(feed) = &recipe.ship_feed else { return Vec::new() };
    let motion = recipe.motion();
    let (mut noise, mut latency) = (stream(recipe.seed, 0x5e0), stream(recipe.seed, 0x5e1));
    let step = feed.step_deg.to_radians();
    let told = |angle: f64| (angle / step).round() * step;
    let count = (recipe.duration_s * feed.rate_hz).round() as u32;
    (0..count)
        .map(|i| {
            let time_s = f64::from(i) / feed.rate_hz;
            let [heading, pitch, roll] = motion.ship_at(time_s);
            let heading = told(heading + feed.offset + feed.noise * gaussian(&mut noise)).rem_euclid(TAU);
            ShipSample {
                arrival: start.plus_ns(secs_to_ns(time_s) + draw_latency(&mut latency, feed.latency_ns)),
                heading: Some(heading),
                roll: feed.attitude.then(|| told(roll)),
                pitch: feed.attitude.then(|| told(pitch)),
                heading_sigma: None,
                reduced: false,
            }
        })
        .collect()
}
