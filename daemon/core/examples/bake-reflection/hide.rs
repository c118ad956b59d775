//! How much of a hull the waves before it hide.

use bowwave_core::frame::reflection::grid::{ELEVATIONS, STATES, elevation, state_weights};
use rand::RngExt;
use rand_pcg::Pcg64;
use rayon::prelude::*;

use crate::{HALF_BEAM_M, fit::NormalEquations, sea::BakedSea};

/// Places of a hull on each patch.
const PLACES: usize = 600;
/// Waves are looked at so far apart along the line of sight, metres.
const STEP_M: f64 = 0.2;
/// The line of sight is followed eight degrees aslant, so that it does not come by the same waves again where a patch repeats.
const ASLANT: f64 = 0.137;

/// By elevation and state: height over a hull's own water up to which it is hidden, metres.
pub fn hidden(seas: &[BakedSea], spread: [f64; 2]) -> Vec<f64> {
    let sums = seas.par_iter().enumerate().map(|(n, sea)| on_patch(sea, spread, n as u128));
    let merge = |mut a: Vec<NormalEquations<1>>, b: Vec<NormalEquations<1>>| {
        a.iter_mut().zip(&b).for_each(|(a, b)| a.join(b));
        a
    };
    let fits = sums.reduce(|| vec![NormalEquations::new(); ELEVATIONS], merge);
    fits.iter().flat_map(|fit| fit.solve().map(|[v]| v)).collect()
}

fn on_patch(sea: &BakedSea, spread: [f64; 2], seed: u128) -> Vec<NormalEquations<1>> {
    let mut fits = vec![NormalEquations::new(); ELEVATIONS];
    if sea.reach_m <= 0.0 {
        return fits;
    }
    let mut rng = Pcg64::new(seed, 0x41de);
    for _ in 0..PLACES {
        let (x, y) = (rng.random::<f64>() * 1000.0, rng.random::<f64>() * 1000.0);
        let afloat = sea.afloat(x, y + HALF_BEAM_M);
        let [level, tilt] = [0, 1].map(|i| afloat[i] / spread[i].max(1e-9));
        let states: [f64; STATES] = state_weights(level, tilt);
        for (fit, height) in fits.iter_mut().zip(highest(sea, x, y)) {
            fit.add(1.0, &states, 1.0, &[(height - afloat[0]).max(0.0) as f32]);
        }
    }
    fits
}

/// Height at the hull of the lowest line of sight that passes over all waves before it, by elevation.
fn highest(sea: &BakedSea, x: f64, y: f64) -> [f64; ELEVATIONS] {
    let tangents: [f64; ELEVATIONS] = std::array::from_fn(|e| elevation(e).tan());
    let mut out = [f64::NEG_INFINITY; ELEVATIONS];
    let mut before = 0.0;
    loop {
        let water = sea.at(x + ASLANT * before, y - before)[0];
        let mut open = false;
        for (height, tangent) in out.iter_mut().zip(tangents) {
            *height = height.max(water - before * tangent);
            open |= sea.reach_m - before * tangent > *height;
        }
        if !open {
            return out;
        }
        before += STEP_M;
    }
}
