//! A linear Gaussian sea: superposed JONSWAP systems with a directional spread, as three nested tiles.
//!
//! Deep water, omega^2 = g k; no second-order terms, no foam.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};
use rustfft::num_complex::Complex64;

use super::{
    random::keyed_normal,
    spectrum::{GRAVITY, jonswap_shape},
    waves::{TileModes, TilePlan, WaveTile},
};

/// One wave system.
#[derive(Clone, Copy, Debug)]
pub struct WaveSystem {
    /// Significant height, metres.
    pub height_m: f64,
    /// Peak period, seconds.
    pub peak_s: f64,
    /// Peak enhancement of JONSWAP.
    pub gamma: f64,
    /// Where the waves come from, radians clockwise from north.
    pub from_rad: f64,
    /// Exponent s of cos^2s(angle / 2); `None`: Mitsuyasu's dependence on frequency with 10 at the peak.
    pub spread: Option<f64>,
}

impl WaveSystem {
    /// Integral of the shape over x, by the midpoint rule in ln x.
    fn area(&self) -> f64 {
        let n = 4000;
        let (low, high) = (0.3_f64.ln(), 40_f64.ln());
        let step = (high - low) / f64::from(n);
        let at = |i| f64::exp(low + (f64::from(i) + 0.5) * step);
        (0..n).map(at).map(|x| jonswap_shape(x, self.gamma) * x * step).sum()
    }

    fn spread_at(&self, x: f64) -> f64 {
        self.spread.unwrap_or_else(|| 10.0 * if x < 1.0 { x.powi(5) } else { x.powf(-2.5) })
    }
}

/// Normalisation of cos^2s(angle / 2) over the circle.
fn spread_norm(s: f64) -> f64 {
    let n = 720;
    let sum: f64 = (0..n).map(|i| (f64::from(i) * TAU / f64::from(n) / 2.0).cos().abs().powf(2.0 * s)).sum();
    f64::from(n) / (sum * TAU)
}

/// One tile and what it carries in expectation.
struct SystemTile {
    waves: TileModes,
    now: WaveTile,
    cell_m: f64,
    slope_variance: f64,
    height_variance: f64,
}

impl SystemTile {
    fn new(systems: &[WaveSystem], plan: TilePlan, seed: u64) -> Self {
        let (n, unit) = (plan.cells as i64, TAU / plan.size_m);
        let areas: Vec<f64> = systems.iter().map(WaveSystem::area).collect();
        let norms: Vec<f64> = (0..=400).map(|i| spread_norm(f64::from(i) * 0.125)).collect();
        // Variance of the height that a wave carries.
        let variance = |k: DVec2| {
            let size = k.length();
            let omega = (GRAVITY * size).sqrt();
            let mut variance = 0.0;
            for (system, area) in systems.iter().zip(&areas) {
                let peak = TAU / system.peak_s;
                let x = omega / peak;
                if x < 0.3 || system.height_m <= 0.0 {
                    continue;
                }
                let s = system.spread_at(x).clamp(0.0, 50.0);
                let towards = -DVec2::new(system.from_rad.sin(), system.from_rad.cos());
                let half = ((1.0 + towards.dot(k) / size) / 2.0).max(0.0);
                let direction = half.powf(s) * norms[(s / 0.125).round() as usize];
                let density = system.height_m.powi(2) / 16.0 * jonswap_shape(x, system.gamma) / (area * peak);
                // Per wave vector: d omega / dk = g / (2 omega), and the ring is k long.
                variance += density * direction * GRAVITY / (2.0 * omega) / size * unit * unit;
            }
            variance
        };
        let cell_m = plan.size_m / plan.cells as f64;
        let waves = plan.waves(
            |k| (GRAVITY * k).sqrt(),
            |ix, iy, k| {
                let index = iy.rem_euclid(n) * n + ix.rem_euclid(n);
                let [a, b] = keyed_normal(seed.wrapping_mul(0x1_0000_0001).wrapping_add(index as u64));
                Complex64::new(a, b) * (variance(k).sqrt() / 2.0)
            },
        );
        let (slope_variance, height_variance) = waves.expected(variance);
        let now = waves.at(0.0);
        Self { waves, now, cell_m, slope_variance, height_variance }
    }
}

/// The water within the footprint of a pixel.
#[derive(Clone, Copy, Debug)]
pub struct SeaFacet {
    /// Slope (rise per metre east and north) of the waves larger than the footprint.
    pub slope: DVec2,
    /// Variance of the slope of the smaller ones, per axis.
    pub rough: f64,
}

/// A sea of several systems, at one time after the other.
pub struct SystemSea {
    tiles: Vec<SystemTile>,
    /// Slope variance of everything shorter than the tiles' waves, per axis.
    ripples: f64,
    /// Four standard deviations of the height.
    pub significant_m: f64,
}

impl SystemSea {
    /// The systems with ripples that bring the slope variance per axis up to `slope_variance` (Cox and Munk 1954).
    pub fn new(systems: &[WaveSystem], slope_variance: f64, seed: u64) -> Self {
        let peak = systems.iter().map(|s| s.peak_s).fold(f64::INFINITY, f64::min).clamp(1.0, 20.0);
        let long = systems.iter().map(|s| s.peak_s).fold(0.0, f64::max).clamp(1.0, 20.0);
        let wavelength = |t: f64| GRAVITY * t * t / TAU;
        let sizes = [
            (256, 14.3 * wavelength(long).min(6.0 * wavelength(peak)), 0.0),
            (128, 1.13 * wavelength(peak), 0.6),
            (128, 0.147 * wavelength(peak), -0.4),
        ];
        let mut low = 0.0;
        let mut tiles = Vec::new();
        for (i, (cells, size_m, angle)) in sizes.into_iter().enumerate() {
            let high = TAU / size_m * (cells as f64) * 0.45;
            let plan = TilePlan { size_m, cells, turn: DVec2::from_angle(-angle), band: (low, high) };
            tiles.push(SystemTile::new(systems, plan, seed.wrapping_add(977 * i as u64)));
            low = high;
        }
        let resolved: f64 = tiles.iter().map(|t| t.slope_variance).sum::<f64>() / 2.0;
        let variance: f64 = tiles.iter().map(|t| t.height_variance).sum();
        Self {
            tiles,
            ripples: (slope_variance - resolved).max(0.15 * slope_variance),
            significant_m: 4.0 * variance.sqrt(),
        }
    }

    /// Moves the water to `t` seconds.
    pub fn advance(&mut self, t: f64) {
        for tile in &mut self.tiles {
            tile.now = tile.waves.at(t);
        }
    }

    /// Height of the water, metres, but for the third tile's waves, which add millimetres only.
    pub fn height(&self, place: DVec2) -> f64 {
        self.tiles.iter().take(2).map(|t| t.now.height(place)).sum()
    }

    /// Height of the water in metres and its slopes east and north, but for the third tile's waves.
    pub fn water(&self, place: DVec2) -> DVec3 {
        let at = |t: &SystemTile| {
            let slope = t.now.slope(place);
            DVec3::new(t.now.height(place), slope.x, slope.y)
        };
        self.tiles.iter().take(2).map(at).sum()
    }

    /// Slopes at a place for a pixel that covers `footprint_m` of water.
    pub fn facet(&self, place: DVec2, footprint_m: f64) -> SeaFacet {
        let mut facet = SeaFacet { slope: DVec2::ZERO, rough: self.ripples };
        for (i, tile) in self.tiles.iter().enumerate() {
            // A band counts as waves where a pixel resolves its middle, as roughness where it does not.
            let seen = if i == 0 { 1.0 } else { (2.0 - footprint_m / (4.0 * tile.cell_m)).clamp(0.0, 1.0) };
            if seen > 0.0 {
                facet.slope += tile.now.slope(place) * seen;
            }
            facet.rough += (1.0 - seen * seen) * tile.slope_variance / 2.0;
        }
        facet
    }

    /// Where a ray from `eye` along the unit vector `ray` meets the water: ray-marched, so that crests hide what lies behind.
    /// `None` beyond `far_m`.
    pub fn hit(&self, eye: DVec3, ray: DVec3, far_m: f64) -> Option<DVec3> {
        let across = ray.truncate().length().max(1e-9);
        let top = 1.2 * self.significant_m;
        let steep = 0.35 + (ray.z / across).abs();
        // Distance along the ground up to which the ray is above every crest.
        let mut d = if ray.z < 0.0 { ((eye.z - top) / (-ray.z / across)).max(0.0) } else { 0.0 };
        let along = ray.truncate() / across;
        let point = |d: f64| (eye.truncate() + along * d).extend(eye.z + ray.z / across * d);
        let mut before = d;
        for _ in 0..400 {
            let p = point(d);
            if d > far_m || (ray.z >= 0.0 && p.z > top) {
                return None;
            }
            let gap = p.z - self.height(p.truncate());
            if gap <= 0.0 {
                let (mut low, mut high) = (before, d);
                for _ in 0..12 {
                    let middle = 0.5 * (low + high);
                    let p = point(middle);
                    if p.z > self.height(p.truncate()) { low = middle } else { high = middle }
                }
                return Some(point(high));
            }
            before = d;
            d += (gap / steep).max(0.01 + 0.002 * d);
        }
        Some(point(d))
    }
}
