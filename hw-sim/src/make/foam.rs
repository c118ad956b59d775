//! Whitecaps, from a gentle breeze on.

use super::{
    field::{CASCADES, LEVELS, Surface},
    noise::{smoothstep, upper_quantile},
    sky::Rgb,
};

/// Wind below which no crest breaks, m/s (Beaufort 3 begins at 3.4).
const ONSET: f64 = 3.4;

/// Which part of the surface is foam.
pub(super) struct Foam {
    /// Deviations of the squeeze above which a crest breaks.
    quantile: f32,
    /// Variance of the squeeze by tile and level.
    squeeze: [[f32; LEVELS]; CASCADES],
}

impl Foam {
    /// `None` where the wind is too light. The covered share is that of Monahan and O'Muircheartaigh 1980,
    /// 3.84e-6 U^3.41 (U in m/s).
    pub fn new(wind: f64, surface: &Surface) -> Option<Self> {
        if wind < ONSET {
            return None;
        }
        let covered = 3.84e-6 * wind.powf(3.41);
        let squeeze = std::array::from_fn(|c| {
            std::array::from_fn(|l| surface.tiles[c].mean_square(l, 3))
        });
        Some(Self { quantile: upper_quantile(covered) as f32, squeeze })
    }

    /// Squeeze above which water seen at these levels breaks.
    pub fn threshold(&self, levels: &[(usize, f32, bool); CASCADES]) -> f32 {
        let variance: f32 = levels
            .iter()
            .enumerate()
            .filter(|(_, (_, _, shows))| *shows)
            .map(|(c, &(level, share, _))| {
                let next = (level + 1).min(LEVELS - 1);
                self.squeeze[c][level] + share * (self.squeeze[c][next] - self.squeeze[c][level])
            })
            .sum();
        self.quantile * variance.sqrt().max(1e-4)
    }

    /// Lays foam over `colour` where the water is squeezed above `threshold`; gusts (`patch`) break more crests.
    #[inline(always)]
    pub fn cover(&self, colour: &mut [f32; 4], water: &[f32; 4], threshold: f32, patch: f32, light: Rgb) {
        let limit = threshold * (1.0 - 0.12 * patch.clamp(-1.0, 1.0));
        if water[3] < 0.9 * limit {
            return;
        }
        let share = 0.85 * smoothstep(0.9 * limit, 1.25 * limit, water[3]);
        // Foam is nearly white and lit by sun and sky, which together are a little brighter than the lower sky.
        for c in 0..3 {
            let white = 0.25 + 0.9 * light[c];
            colour[c] += share * (white - colour[c]);
        }
    }
}
