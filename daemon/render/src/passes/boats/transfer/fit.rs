//! Values at the corners of triangles whose mix over each triangle comes closest to samples of it.

/// A place within a triangle: its corners' numbers, and its barycentric coordinates.
#[derive(Clone, Copy)]
pub(super) struct Seat {
    pub(super) corners: [usize; 3],
    pub(super) shares: [f32; 3],
}

impl Seat {
    /// Mix of what the corners hold.
    pub(super) fn mix<const N: usize>(&self, held: &[[f32; N]]) -> [f32; N] {
        let mut mixed = [0.0; N];
        for (at, share) in self.corners.into_iter().zip(self.shares) {
            mixed.iter_mut().zip(held[at]).for_each(|(mixed, held)| *mixed += share * held);
        }
        mixed
    }
}

/// A value known at a place.
pub(super) struct Sample<const N: usize> {
    pub(super) at: Seat,
    pub(super) weight: f32,
    pub(super) value: [f32; N],
}

/// Brings `held` closer to least squares of the samples, by the simultaneous iterative reconstruction of Gilbert 1972. The weight of the
/// samples about each corner: one that has none keeps what it holds.
pub(super) fn fit<const N: usize>(samples: &[Sample<N>], held: &mut [[f32; N]]) -> Vec<f32> {
    const ROUNDS: u32 = 8;
    /// Weight below which a corner follows its samples in part only.
    const LEAST: f32 = 0.05;
    let mut weights = vec![0.0_f32; held.len()];
    for s in samples {
        s.at.corners.iter().zip(s.at.shares).for_each(|(at, share)| weights[*at] += share * s.weight);
    }
    let mut more = vec![[0.0; N]; held.len()];
    for _ in 0..ROUNDS {
        more.fill([0.0; N]);
        for s in samples {
            let mixed = s.at.mix(held);
            for (at, share) in s.at.corners.iter().zip(s.at.shares) {
                let off = s.value.iter().zip(mixed).map(|(value, mixed)| share * s.weight * (value - mixed));
                more[*at].iter_mut().zip(off).for_each(|(more, off)| *more += off);
            }
        }
        for ((held, more), weight) in held.iter_mut().zip(&more).zip(&weights) {
            held.iter_mut().zip(more).for_each(|(held, more)| *held += more / weight.max(LEAST));
        }
    }
    weights
}
