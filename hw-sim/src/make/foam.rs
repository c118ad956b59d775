//! Whitecaps, from a gentle breeze on.

use glam::Vec4;

use crate::ocean::{
    looped::{CASCADES, LEVELS, LoopedSurface},
    noise::{smoothstep, upper_quantile},
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
    pub fn new(wind: f64, surface: &LoopedSurface) -> Option<Self> {
        if wind < ONSET {
            return None;
        }
        let covered = 3.84e-6 * wind.powf(3.41);
        let squeeze = std::array::from_fn(|c| std::array::from_fn(|l| surface.tiles[c].mean_square(l, 3)));
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
    pub fn cover(&self, colour: Vec4, water: Vec4, threshold: f32, patch: f32, light: Vec4) -> Vec4 {
        let limit = threshold * (1.0 - 0.12 * patch.clamp(-1.0, 1.0));
        if water.w < 0.9 * limit {
            return colour;
        }
        let share = 0.85 * smoothstep(0.9 * limit, 1.25 * limit, water.w);
        // Foam is nearly white and lit by sun and sky, which together are a little brighter than the lower sky.
        colour.lerp(0.25 + 0.9 * light, share)
    }
}
