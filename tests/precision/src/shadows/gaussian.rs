//! Powers of the depth in a map, blurred by a Gaussian and read between texels: what variance, moment and Z-GaF maps judge by.

use glam::Vec3;

use super::depth_map::{DepthMap, SunBox};

/// Weights of the blur's texels from the middle outwards: a Gaussian of 1.2 texels, cut off at three, with a sum of 1 over both sides.
const WEIGHTS: [f32; 4] = [0.333_4, 0.235_6, 0.083_1, 0.014_6];

/// Texels that the blur reaches.
const REACH: usize = WEIGHTS.len() - 1;

/// Moments of the depth from the sun, 0 (nearest) to 1 (farthest), about each texel. Those about texels that nothing was drawn near to are not kept.
#[derive(Clone, Debug)]
pub struct MomentTexels<const N: usize> {
    texels: Vec<[f32; N]>,
    across: Vec<[f32; N]>,
    /// First texel of the map that is kept, and how many are, across and down.
    corner: [usize; 2],
    size: [usize; 2],
    /// Nearness of depth 0, and metres from there to depth 1.
    nearest: f32,
    span: f32,
}

impl<const N: usize> Default for MomentTexels<N> {
    fn default() -> Self {
        Self { texels: Vec::new(), across: Vec::new(), corner: [0; 2], size: [0; 2], nearest: 0.0, span: 1.0 }
    }
}

impl<const N: usize> MomentTexels<N> {
    /// Takes a drawn map's depths, which lie within a box, and blurs them.
    pub fn take(&mut self, map: &DepthMap, around: &SunBox) {
        let [from, to] = map.touched();
        self.corner = from.map(|v| v.saturating_sub(REACH + 1));
        self.size =
            std::array::from_fn(|i| (to[i] + REACH + 1).min(map.size[i]).saturating_sub(self.corner[i]));
        self.nearest = around.high.z;
        self.span = (around.high.z - around.low.z).max(1e-3);
        self.texels.clear();
        for y in self.corner[1]..self.corner[1] + self.size[1] {
            let start = y * map.size[0] + self.corner[0];
            let row = &map.nearest[start..start + self.size[0]];
            self.texels.extend(row.iter().map(|nearness| powers(depth(*nearness, self.nearest, self.span))));
        }
        self.across.resize(self.texels.len(), [0.0; N]);
        if self.texels.is_empty() {
            return;
        }
        blur_across(&self.texels, &mut self.across, self.size[0]);
        blur_down(&self.across, &mut self.texels, self.size[0]);
    }

    /// Depth of a place by its nearness to the sun.
    pub fn depth(&self, nearness: f32) -> f32 {
        depth(nearness, self.nearest, self.span)
    }

    /// Moments at texel coordinates, between the four texels about them.
    pub fn at(&self, at: Vec3) -> [f32; N] {
        let (x, y) = (at.x - 0.5 - self.corner[0] as f32, at.y - 0.5 - self.corner[1] as f32);
        let (i, j) = (x.floor(), y.floor());
        let (u, v) = (x - i, y - j);
        let texel = |di: i32, dj: i32| {
            let (i, j) = (i as i32 + di, j as i32 + dj);
            let inside = i >= 0 && j >= 0 && (i as usize) < self.size[0] && (j as usize) < self.size[1];
            // Empty texels are as far from the sun as there is.
            if inside { self.texels[j as usize * self.size[0] + i as usize] } else { [1.0; N] }
        };
        let (a, b, c, d) = (texel(0, 0), texel(1, 0), texel(0, 1), texel(1, 1));
        std::array::from_fn(|n| {
            let (low, high) = (a[n] + (b[n] - a[n]) * u, c[n] + (d[n] - c[n]) * u);
            low + (high - low) * v
        })
    }

    /// Bytes that it holds.
    pub fn bytes(&self) -> usize {
        (self.texels.capacity() + self.across.capacity()) * size_of::<[f32; N]>()
    }
}

fn depth(nearness: f32, nearest: f32, span: f32) -> f32 {
    ((nearest - nearness) / span).clamp(0.0, 1.0)
}

fn powers<const N: usize>(depth: f32) -> [f32; N] {
    let mut power = 1.0;
    std::array::from_fn(|_| {
        power *= depth;
        power
    })
}

/// The middle texel by its weight, and those at each distance to both sides by theirs.
fn weighed<const N: usize>(at: impl Fn(isize) -> [f32; N]) -> [f32; N] {
    let mut sum = at(0).map(|v| v * WEIGHTS[0]);
    for (off, weight) in (1..).zip(&WEIGHTS[1..]) {
        let (a, b) = (at(-off), at(off));
        (0..N).for_each(|n| sum[n] += weight * (a[n] + b[n]));
    }
    sum
}

/// Blurs each row; beyond its ends it goes on as it ends.
fn blur_across<const N: usize>(from: &[[f32; N]], to: &mut [[f32; N]], width: usize) {
    for (row, to) in from.chunks_exact(width).zip(to.chunks_exact_mut(width)) {
        let ends = REACH.min(width)..width.saturating_sub(REACH);
        for (x, to) in to.iter_mut().enumerate() {
            *to = if ends.contains(&x) {
                let near = &row[x - REACH..=x + REACH];
                weighed(|off| near[REACH.wrapping_add_signed(off)])
            } else {
                weighed(|off| row[x.saturating_add_signed(off).min(width - 1)])
            };
        }
    }
}

/// Blurs each column.
fn blur_down<const N: usize>(from: &[[f32; N]], to: &mut [[f32; N]], width: usize) {
    let last = from.len() / width - 1;
    for (y, to) in to.chunks_exact_mut(width).enumerate() {
        let row = |off: isize| &from[y.saturating_add_signed(off).min(last) * width..][..width];
        let rows: [&[[f32; N]]; 2 * REACH + 1] = std::array::from_fn(|i| row(i as isize - REACH as isize));
        for (x, to) in to.iter_mut().enumerate() {
            *to = weighed(|off| rows[REACH.wrapping_add_signed(off)][x]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_blur_keeps_what_there_is_and_spreads_it_alike_both_ways() {
        let sum = WEIGHTS[0] + 2.0 * WEIGHTS[1..].iter().sum::<f32>();
        assert!((sum - 1.0).abs() < 1e-3, "{sum}");
        let mut texels = vec![[0.0]; 15 * 11];
        texels[5 * 15 + 7] = [1.0];
        let (mut across, mut both) = (vec![[0.0]; 165], vec![[0.0]; 165]);
        blur_across(&texels, &mut across, 15);
        blur_down(&across, &mut both, 15);
        let at = |x: usize, y: usize| both[y * 15 + x][0];
        assert!((both.iter().map(|t| t[0]).sum::<f32>() - 1.0).abs() < 3e-3);
        assert!((at(8, 5) - at(7, 6)).abs() < 1e-7 && (at(6, 5) - at(8, 5)).abs() < 1e-7);
    }
}
