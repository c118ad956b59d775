//! Maps that hold moments of the depth about a texel, blurred before they are compared: variance maps (Donnelly and Lauritzen 2006) and moment maps of
//! four moments (Peters and Klein 2015, "Moment shadow mapping", Hamburger's moment problem).

use super::{
    ShadowFrame, ShadowMethod,
    depth_map::{DepthMap, MapFaces},
    gaussian::MomentTexels,
    seen::{SeenPoint, SeenPoints},
    slices, tight,
};

/// A surface is compared so much nearer to the sun than it is, texels.
const NEARER_TEXELS: f32 = 1.0;

/// A map of all meshes, with `N` moments of the depth.
pub struct MomentMap<const N: usize> {
    side: usize,
    map: DepthMap,
    texels: MomentTexels<N>,
    /// Share of the sun of what lies at a depth, by the moments there.
    share: fn([f32; N], f32) -> f32,
}

impl<const N: usize> MomentMap<N> {
    fn with(side: usize, share: fn([f32; N], f32) -> f32) -> Self {
        Self { side, map: DepthMap::with_room(side, side), texels: MomentTexels::default(), share }
    }
}

impl MomentMap<2> {
    /// Mean and mean square in a map of `side` by `side` texels: a variance map.
    pub fn new(side: usize) -> Self {
        Self::with(side, chebyshev)
    }
}

impl MomentMap<4> {
    /// Four moments in a map of `side` by `side` texels.
    pub fn new(side: usize) -> Self {
        Self::with(side, lit_by_hamburger)
    }
}

impl<const N: usize> ShadowMethod for MomentMap<N> {
    fn prepare(&mut self, frame: &ShadowFrame<'_>, _: &SeenPoints) {
        let axes = slices::axes(frame);
        let around = axes.around(frame.meshes.iter().flat_map(|mesh| mesh.corners));
        self.map.fit(axes, &around, [self.side; 2]);
        frame.meshes.iter().for_each(|mesh| self.map.draw(mesh, MapFaces::All));
        self.texels.take(&self.map, &around);
    }

    fn share(&self, point: &SeenPoint) -> f32 {
        looked_up(&self.map, &self.texels, point, self.share)
    }

    fn bytes(&self) -> usize {
        self.map.bytes() + self.texels.bytes()
    }
}

/// Share of the sun at a point by the moments about it and its own depth.
fn looked_up<const N: usize>(
    map: &DepthMap,
    texels: &MomentTexels<N>,
    point: &SeenPoint,
    share: fn([f32; N], f32) -> f32,
) -> f32 {
    let at = map.at(point.place + point.normal * (0.5 * map.texel_m()));
    share(texels.at(at), texels.depth(at.z + NEARER_TEXELS * map.texel_m()))
}

/// Share of the sun by Chebyshev's inequality.
fn chebyshev([mean, square]: [f32; 2], depth: f32) -> f32 {
    let variance = (square - mean * mean).max(1e-7);
    let behind = depth - mean;
    if behind <= 0.0 { 1.0 } else { variance / (variance + behind * behind) }
}

/// Share of the sun by four moments.
fn lit_by_hamburger(moments: [f32; 4], depth: f32) -> f32 {
    1.0 - hamburger(moments.map(f64::from), f64::from(depth)) as f32
}

/// Four moments of the depth in a map of each boat's own.
pub struct MomentMaps {
    side: usize,
    maps: Vec<(DepthMap, MomentTexels<4>)>,
}

impl MomentMaps {
    /// Maps that fill no more than `side` by `side` texels together, one texel for a pixel.
    pub fn new(side: usize) -> Self {
        Self { side, maps: Vec::new() }
    }
}

impl ShadowMethod for MomentMaps {
    fn prepare(&mut self, frame: &ShadowFrame<'_>, _: &SeenPoints) {
        self.maps.resize_with(frame.meshes.len(), || (DepthMap::with_room(0, 0), MomentTexels::default()));
        for (mesh, (map, moments)) in frame.meshes.iter().zip(&mut self.maps) {
            let (around, casters) = tight::fit(map, frame, mesh, [1.0, tight::most_of(self.side)]);
            casters.for_each(|other| map.draw(other, MapFaces::All));
            moments.take(map, &around);
        }
    }

    fn share(&self, point: &SeenPoint) -> f32 {
        let Some((map, moments)) = self.maps.get(point.mesh as usize) else { return 1.0 };
        looked_up(map, moments, point, lit_by_hamburger)
    }

    fn bytes(&self) -> usize {
        self.maps.iter().map(|(map, moments)| map.bytes() + moments.bytes()).sum()
    }
}

/// Least share of depths before `depth` that four moments allow (Peters and Klein 2015, algorithm 2, by the Cholesky factors of the Hankel matrix).
fn hamburger(moments: [f64; 4], depth: f64) -> f64 {
    /// The share of moments of no surface that makes the matrix safe to take apart in single precision.
    const BIAS: f64 = 3e-6;
    let b = moments.map(|m| m + (0.5 - m) * BIAS);
    let l32_d22 = b[2] - b[0] * b[1];
    let d22 = b[1] - b[0] * b[0];
    let d33_d22 = (b[3] - b[1] * b[1]) * d22 - l32_d22 * l32_d22;
    let l32 = l32_d22 / d22;
    // Solved for the polynomial whose roots, with the depth itself, hold all of the moments.
    let mut c = [1.0, depth - b[0], depth * depth - b[1]];
    c[2] -= l32 * c[1];
    c[1] /= d22;
    c[2] *= d22 / d33_d22;
    c[1] -= l32 * c[2];
    c[0] -= c[1] * b[0] + c[2] * b[1];
    let (p, q) = (c[1] / c[2], c[0] / c[2]);
    let root = (0.25 * p * p - q).max(0.0).sqrt();
    let (low, high) = (-0.5 * p - root, -0.5 * p + root);
    let shadow = if high < depth {
        1.0 - weight(b, depth, [low, high])
    } else if low < depth {
        weight(b, low, [depth, high])
    } else {
        0.0
    };
    if shadow.is_finite() { shadow.clamp(0.0, 1.0) } else { 0.0 }
}

/// Share of one of three depths that have these moments together.
fn weight(b: [f64; 4], of: f64, [one, other]: [f64; 2]) -> f64 {
    (one * other - b[0] * (one + other) + b[1]) / ((of - one) * (of - other))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Moments of depths that come equally often.
    fn moments(depths: &[f64]) -> [f64; 4] {
        std::array::from_fn(|i| {
            depths.iter().map(|d| d.powi(i as i32 + 1)).sum::<f64>() / depths.len() as f64
        })
    }

    #[test]
    fn two_depths_are_told_apart_by_four_moments() {
        let b = moments(&[0.2, 0.2, 0.2, 0.6]);
        for (depth, shadow) in [(0.1, 0.0), (0.4, 0.75), (0.8, 1.0)] {
            let found = hamburger(b, depth);
            assert!((found - shadow).abs() < 0.02, "{depth}: {found}, not {shadow}");
        }
    }

    #[test]
    fn no_bound_is_above_the_share_that_there_is() {
        let depths: Vec<f64> = (0..40).map(|i| 0.1 + 0.8 * (f64::from(i) * 0.618_034).fract()).collect();
        let b = moments(&depths);
        for depth in [0.15, 0.3, 0.5, 0.7, 0.95] {
            let share = depths.iter().filter(|d| **d < depth).count() as f64 / 40.0;
            let found = hamburger(b, depth);
            assert!(found <= share + 1e-3 && found >= 0.0, "{depth}: {found} of {share}");
        }
    }
}
