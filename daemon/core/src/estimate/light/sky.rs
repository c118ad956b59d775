//! The sky behind boats, by elevation.

use glam::Vec3;

/// Sky radiance by elevation, linear, behind a boat; linear between the nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkyLight {
    /// At the elevations of [`SKY_SINES`].
    pub nodes: [Vec3; SKY_SINES.len()],
}

/// Sines of 1, 4, 9, 18, 35 and 70 degrees.
pub const SKY_SINES: [f64; 6] = [0.017_5, 0.069_8, 0.156_4, 0.309, 0.573_6, 0.939_7];

impl SkyLight {
    /// The sky whose mean radiance is `horizon` from 0.5 to 6 degrees and `sky` from there to some 20, as [`LightMeter`] has it. What lies
    /// higher than a camera sees is guessed: a sky that darkens upwards does so as a clear one, one that brightens as an overcast one.
    ///
    /// [`LightMeter`]: super::LightMeter
    pub fn of_bands(horizon: Vec3, sky: Vec3) -> Self {
        // Sines of 3 and 12 degrees stand for the bands.
        let (low, high) = (0.052_3, 0.207_9);
        let node = |sine: f64, h: f32, s: f32| {
            // Clear: an exponential towards the zenith's; overcast (Moon and Spencer 1942): even in the sine.
            let shape = |x: f64| if h > s { (-x / 0.25).exp() } else { -x };
            let share = (shape(sine) - shape(high)) / (shape(low) - shape(high));
            (s + (h - s) * share as f32).clamp(0.25 * s, 3.0 * s.max(h))
        };
        let colour = |sine| Vec3::from_array(std::array::from_fn(|c| node(sine, horizon[c], sky[c])));
        Self { nodes: SKY_SINES.map(colour) }
    }

    /// Radiance at an elevation of that sine; at the ends that of the nodes there.
    pub fn at(&self, sine: f64) -> Vec3 {
        let [first, .., last] = self.nodes;
        let Some(i) = SKY_SINES.iter().position(|s| sine < *s) else { return last };
        let Some(before) = i.checked_sub(1) else { return first };
        let share = (sine - SKY_SINES[before]) / (SKY_SINES[i] - SKY_SINES[before]);
        self.nodes[before].lerp(self.nodes[i], share as f32)
    }

    /// The same sky, each channel so many times as bright.
    #[must_use]
    pub fn scaled(&self, times: Vec3) -> Self {
        Self { nodes: self.nodes.map(|n| n * times) }
    }
}
