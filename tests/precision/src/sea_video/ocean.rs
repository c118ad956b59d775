//! A linear Gaussian sea: superposed JONSWAP systems with a directional spread, as three nested periodic height fields.
//!
//! Own code: nothing is shared with the sea of `bowwave-core`. Deep water, omega^2 = g k; no second-order terms, no foam.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};
use rustfft::{Fft, FftPlanner, num_complex::Complex32};

/// Gravity that the generator uses, m/s^2 (CODATA's conventional value).
const G: f64 = 9.806_65;

/// One wave system.
#[derive(Clone, Copy, Debug)]
pub struct System {
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

impl System {
    fn shape(&self, x: f64) -> f64 {
        let width = if x < 1.0 { 0.07 } else { 0.09 };
        x.powi(-5)
            * (-1.25 / x.powi(4)).exp()
            * self.gamma.powf((-(x - 1.0).powi(2) / (2.0 * width * width)).exp())
    }

    /// Integral of the shape over x, by the midpoint rule in ln x.
    fn area(&self) -> f64 {
        let n = 4000;
        let (low, high) = (0.3_f64.ln(), 40_f64.ln());
        let step = (high - low) / f64::from(n);
        (0..n).map(|i| (low + (f64::from(i) + 0.5) * step).exp()).map(|x| self.shape(x) * x * step).sum()
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

/// Uniform numbers in (0, 1) by hashing a counter (splitmix64).
pub fn uniform(key: u64) -> f64 {
    let mut z = key.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64 + f64::EPSILON / 8.0
}

/// Two independent normal numbers (Box and Muller).
pub fn normal(key: u64) -> (f64, f64) {
    let (u, v) = (uniform(key.wrapping_mul(2)), uniform(key.wrapping_mul(2).wrapping_add(1)));
    let r = (-2.0 * u.ln()).sqrt();
    (r * (TAU * v).cos(), r * (TAU * v).sin())
}

struct Mode {
    amplitude: Complex32,
    /// Index of the mode with the opposite wave vector.
    opposite: usize,
    omega: f32,
    k: [f32; 2],
}

/// One periodic field with the waves of one band of wavenumbers.
struct Cascade {
    n: usize,
    length_m: f64,
    turn: DVec2,
    modes: Vec<Mode>,
    fft: std::sync::Arc<dyn Fft<f32>>,
    slope_variance: f64,
    height_variance: f64,
    /// Height, slope east, slope north by grid point.
    field: Vec<[f32; 3]>,
}

impl Cascade {
    fn new(systems: &[System], n: usize, length_m: f64, band: (f64, f64), angle: f64, seed: u64) -> Self {
        let dk = TAU / length_m;
        let turn = DVec2::from_angle(angle);
        let norms: Vec<f64> = systems.iter().map(System::area).collect();
        let table: Vec<f64> = (0..=400).map(|i| spread_norm(f64::from(i) * 0.125)).collect();
        let wave = |i: usize| if i < n / 2 { i as f64 } else { i as f64 - n as f64 };
        let (mut slope_variance, mut height_variance) = (0.0, 0.0);
        let modes = (0..n * n)
            .map(|index| {
                let (ix, iy) = (index % n, index / n);
                let local = DVec2::new(wave(ix), wave(iy)) * dk;
                let k = turn.rotate(local);
                let size = k.length();
                let inside = size >= band.0 && size < band.1 && ix != n / 2 && iy != n / 2;
                let mut variance = 0.0;
                if inside {
                    let omega = (G * size).sqrt();
                    for (system, area) in systems.iter().zip(&norms) {
                        let peak = TAU / system.peak_s;
                        let x = omega / peak;
                        if x < 0.3 || system.height_m <= 0.0 {
                            continue;
                        }
                        let s = system.spread_at(x).clamp(0.0, 50.0);
                        let towards = -DVec2::new(system.from_rad.sin(), system.from_rad.cos());
                        let half = ((1.0 + towards.dot(k) / size) / 2.0).max(0.0);
                        let direction = half.powf(s) * table[(s / 0.125).round() as usize];
                        let density = system.height_m.powi(2) / 16.0 * system.shape(x) / (area * peak);
                        // Per wave vector: d omega / dk = g / (2 omega), and the ring is k long.
                        variance += density * direction * G / (2.0 * omega) / size * dk * dk;
                    }
                    slope_variance += variance * size * size;
                    height_variance += variance;
                }
                let (a, b) = normal(seed.wrapping_mul(0x1_0000_0001).wrapping_add(index as u64));
                let scale = variance.sqrt();
                Mode {
                    amplitude: Complex32::new((a * scale) as f32, (b * scale) as f32),
                    opposite: (n - iy) % n * n + (n - ix) % n,
                    omega: (G * size).sqrt() as f32,
                    k: [k.x as f32, k.y as f32],
                }
            })
            .collect();
        let fft = FftPlanner::new().plan_fft_inverse(n);
        let field = vec![[0.0; 3]; n * n];
        Self { n, length_m, turn, modes, fft, slope_variance, height_variance, field }
    }

    fn transform(&self, data: &mut Vec<Complex32>) {
        let n = self.n;
        for _ in 0..2 {
            self.fft.process(data);
            *data = (0..n * n).map(|i| data[i % n * n + i / n]).collect();
        }
    }

    fn advance(&mut self, t: f64) {
        let rotated: Vec<Complex32> = self
            .modes
            .iter()
            .map(|m| m.amplitude * Complex32::from_polar(1.0, -((f64::from(m.omega) * t) % TAU) as f32))
            .collect();
        let (mut first, mut second) = (Vec::with_capacity(rotated.len()), Vec::with_capacity(rotated.len()));
        let i = Complex32::i();
        for (a, m) in rotated.iter().zip(&self.modes) {
            let height = (a + rotated[m.opposite].conj()) * 0.5;
            // Real fields two at a time: height + i slope_x, slope_y.
            first.push(height + i * (i * m.k[0] * height));
            second.push(i * m.k[1] * height);
        }
        self.transform(&mut first);
        self.transform(&mut second);
        for ((f, a), b) in self.field.iter_mut().zip(&first).zip(&second) {
            *f = [a.re, a.im, b.re];
        }
    }

    fn at(&self, place: DVec2) -> DVec3 {
        let n = self.n;
        let grid = DVec2::new(self.turn.dot(place), self.turn.perp().dot(place)) * (n as f64 / self.length_m);
        let base = grid.floor();
        let part = grid - base;
        let wrap = |v: f64| (v as i64).rem_euclid(n as i64) as usize;
        let (x0, y0) = (wrap(base.x), wrap(base.y));
        let (x1, y1) = ((x0 + 1) % n, (y0 + 1) % n);
        let get = |x: usize, y: usize| {
            let f = self.field[y * n + x];
            DVec3::new(f64::from(f[0]), f64::from(f[1]), f64::from(f[2]))
        };
        get(x0, y0).lerp(get(x1, y0), part.x).lerp(get(x0, y1).lerp(get(x1, y1), part.x), part.y)
    }
}

/// What a ray finds on the water.
#[derive(Clone, Copy, Debug)]
pub struct Facet {
    /// Slope (rise per metre east and north) of the waves larger than the footprint.
    pub slope: DVec2,
    /// Variance of the slope of the smaller ones, per axis.
    pub rough: f64,
}

/// A sea, at one time after the other.
pub struct Ocean {
    cascades: Vec<Cascade>,
    /// Slope variance of everything shorter than the fields, per axis.
    ripples: f64,
    /// Four standard deviations of the height.
    pub significant_m: f64,
}

impl Ocean {
    /// The systems with ripples that bring the slope variance per axis up to `slope_variance` (Cox and Munk 1954).
    pub fn new(systems: &[System], slope_variance: f64, seed: u64) -> Self {
        let peak = systems.iter().map(|s| s.peak_s).fold(f64::INFINITY, f64::min).clamp(1.0, 20.0);
        let long = systems.iter().map(|s| s.peak_s).fold(0.0, f64::max).clamp(1.0, 20.0);
        let wavelength = |t: f64| G * t * t / TAU;
        let sizes = [
            (256, 14.3 * wavelength(long).min(6.0 * wavelength(peak)), 0.0),
            (128, 1.13 * wavelength(peak), 0.6),
            (128, 0.147 * wavelength(peak), -0.4),
        ];
        let mut low = 0.0;
        let mut cascades = Vec::new();
        for (i, (n, length_m, angle)) in sizes.into_iter().enumerate() {
            let high = TAU / length_m * (n as f64) * 0.45;
            cascades.push(Cascade::new(
                systems,
                n,
                length_m,
                (low, high),
                angle,
                seed.wrapping_add(977 * i as u64),
            ));
            low = high;
        }
        let resolved: f64 = cascades.iter().map(|c| c.slope_variance).sum::<f64>() / 2.0;
        let variance: f64 = cascades.iter().map(|c| c.height_variance).sum();
        Self {
            cascades,
            ripples: (slope_variance - resolved).max(0.15 * slope_variance),
            significant_m: 4.0 * variance.sqrt(),
        }
    }

    /// Moves the water to `t` seconds.
    pub fn advance(&mut self, t: f64) {
        for cascade in &mut self.cascades {
            cascade.advance(t);
        }
    }

    /// Height of the water, metres.
    pub fn height(&self, place: DVec2) -> f64 {
        self.water(place).x
    }

    /// Height of the water in metres and its slopes east and north, but for the ripples of the third field.
    pub fn water(&self, place: DVec2) -> DVec3 {
        // It adds millimetres of height only.
        self.cascades.iter().take(2).map(|c| c.at(place)).sum()
    }

    /// Slopes at a place for a pixel that covers `footprint_m` of water.
    pub fn facet(&self, place: DVec2, footprint_m: f64) -> Facet {
        let mut facet = Facet { slope: DVec2::ZERO, rough: self.ripples };
        for (i, cascade) in self.cascades.iter().enumerate() {
            // A band counts as waves where a pixel resolves its middle, as roughness where it does not.
            let cell = cascade.length_m / cascade.n as f64;
            let seen = if i == 0 { 1.0 } else { (2.0 - footprint_m / (4.0 * cell)).clamp(0.0, 1.0) };
            if seen > 0.0 {
                let f = cascade.at(place);
                facet.slope += DVec2::new(f.y, f.z) * seen;
            }
            facet.rough += (1.0 - seen * seen) * cascade.slope_variance / 2.0;
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
