//! The resolved waves: tiles of Gaussian heights made by Fourier transform, and where rays meet their sum.
//!
//! Tiles have incommensurate sizes and directions, so that their sum does not repeat within a view. Each holds a band of wave
//! lengths of no less than `CELLS_A_WAVE` cells; interpolation between cells loses a known share of the slopes, which is added
//! to the unresolved ones.

use std::f64::consts::{FRAC_PI_8, PI, TAU};

use glam::{DVec2, DVec3};
use rayon::prelude::*;
use rustfft::num_complex::Complex64;

use super::{
    lattice::Transform,
    random::gauss_pair,
    spectrum::{Spectrum, cox_munk, frequency},
};

/// Cells that the shortest wave of a tile spans.
const CELLS_A_WAVE: f64 = 4.0;
/// Longest waves of a tile fit into it this many times.
const WAVES_A_TILE: f64 = 8.0;
/// Directions of the tiles' axes, radians from east: their tangents (golden ratio, 1 + root 2 and so on) are far from simple fractions, so
/// that a view along the axes of the world meets no row of repeats.
const TURNS: [f64; 6] = [0.5536, 3.0 * FRAC_PI_8, FRAC_PI_8, 1.0172, 0.6319, 0.9389];
/// Beyond this distance along a ray waves are not traced, metres.
const FAR_M: f64 = 2500.0;
/// Slopes beyond this many standard deviations are not reckoned with when a ray steps through clear air.
const SLOPE_SIGMAS: f64 = 3.5;

/// How finely waves are resolved.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Resolution {
    /// Shortest wave that has a shape, metres; what is shorter is statistics.
    pub shortest_m: f64,
    /// Cells along the side of the first tile (a power of two).
    pub cells: usize,
    /// Multiplies the cells of every tile without adding waves: discretisation alone.
    pub oversample: usize,
    /// Smaller steps along rays: 1 usual, 2 half as long.
    pub step_refine: f64,
}

impl Default for Resolution {
    fn default() -> Self {
        Self { shortest_m: 0.06, cells: 1024, oversample: 1, step_refine: 1.0 }
    }
}

/// One tile at one time.
pub(super) struct WaveTile {
    cells: usize,
    cells_per_m: f64,
    turn: DVec2,
    heights: Vec<f32>,
    slopes: Vec<[f32; 2]>,
    /// Greatest height of this tile and all finer ones, metres.
    rest_m: f64,
    /// Slope that the sum of this tile and all coarser ones rarely exceeds.
    steepest: f64,
}

/// Slopes below the resolved waves: a Gaussian about the resolved slope.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unresolved {
    /// Unit vector along the wind.
    pub along: DVec2,
    /// Standard deviations along and across the wind.
    pub sigma: DVec2,
}

/// The sea surface at one time.
pub struct Waves {
    tiles: Vec<WaveTile>,
    /// No wave is higher, metres.
    pub highest_m: f64,
    /// Beyond this distance along a ray the sea is the plane z = 0 with [`Self::all_slopes`].
    pub far_m: f64,
    still: SeaConstants,
}

/// Where a ray meets the water.
#[derive(Clone, Copy, Debug)]
pub struct WaterHit {
    /// Distance along the ray, metres.
    pub t: f64,
    /// The place.
    pub point: DVec3,
    /// Slope of the resolved waves (east, north).
    pub slope: DVec2,
    /// Slopes below.
    pub unresolved: Unresolved,
}

/// The resolved waves of a sea at all times.
pub struct TracedSea {
    tiles: Vec<TileModes>,
    still: SeaConstants,
}

/// Properties of a sea that do not change with time.
#[derive(Clone, Copy)]
struct SeaConstants {
    unresolved: Unresolved,
    all_slopes: Unresolved,
    resolved: DVec2,
    cell_m: f64,
    step_refine: f64,
}

impl TracedSea {
    /// The sea of `spectrum`. The same seed gives the same waves at every resolution.
    pub fn new(spectrum: &Spectrum, resolution: &Resolution, seed: u64) -> Self {
        let mut tiles = Vec::new();
        let mut resolved = DVec2::ZERO;
        let kp = spectrum.peak();
        let mut finest = f64::INFINITY;
        if kp.is_finite() {
            let mut longest = f64::INFINITY;
            let mut size_m = (WAVES_A_TILE * TAU / kp).max(64.0);
            let mut most = resolution.cells;
            // A rest of less than a third of an octave is not worth a tile.
            while longest > 1.25 * resolution.shortest_m && tiles.len() < TURNS.len() {
                let needed = size_m / resolution.shortest_m * CELLS_A_WAVE;
                let cells = (needed.ceil() as usize).next_power_of_two().clamp(16, most);
                let shortest = (size_m / cells as f64 * CELLS_A_WAVE).max(resolution.shortest_m);
                let band = (TAU / longest, TAU / shortest);
                let cells = cells * resolution.oversample;
                let tile = TilePlan { size_m, cells, turn: DVec2::from_angle(TURNS[tiles.len()]), band }
                    .of_spectrum(spectrum, seed, tiles.len() as i64);
                resolved += tile.delivered;
                finest = (size_m / cells as f64).min(finest);
                tiles.push(tile);
                longest = shortest;
                // Not a round share, so that no two tiles repeat together.
                size_m = WAVES_A_TILE * longest * 1.137;
                most = (resolution.cells / 2).max(256);
            }
        }
        let (up, across) = cox_munk(spectrum.wind_m_s);
        let along = spectrum.downwind();
        let sigma = |up: f64, across: f64| DVec2::new(up.max(0.0).sqrt(), across.max(0.0).sqrt());
        // The observed total governs; its axes only as far as the resolved waves leave room in both.
        let rest = (up + across - resolved.x - resolved.y).max(0.0);
        let share = if rest > 0.0 { ((up - resolved.x) / rest).clamp(0.35, 0.65) } else { 0.5 };
        let still = SeaConstants {
            unresolved: Unresolved { along, sigma: sigma(rest * share, rest * (1.0 - share)) },
            all_slopes: Unresolved { along, sigma: sigma(up, across) },
            resolved,
            cell_m: if finest.is_finite() { finest } else { 1.0 },
            step_refine: resolution.step_refine,
        };
        Self { tiles, still }
    }

    /// The surface at `time_s`.
    pub fn at(&self, time_s: f64) -> Waves {
        let mut tiles: Vec<WaveTile> = self.tiles.iter().map(|t| t.at(time_s)).collect();
        finish_bounds(&mut tiles);
        Waves { highest_m: tiles.first().map_or(0.0, |t| t.rest_m), tiles, far_m: FAR_M, still: self.still }
    }
}

impl Waves {
    /// A sea without resolved waves, all of whose slopes are statistics.
    pub fn statistical(spectrum: &Spectrum) -> Self {
        let (up, across) = cox_munk(spectrum.wind_m_s);
        let all = Unresolved { along: spectrum.downwind(), sigma: DVec2::new(up.sqrt(), across.sqrt()) };
        Self::flat_sea(all)
    }

    /// A flat mirror: no waves and no slopes.
    pub fn mirror() -> Self {
        Self::flat_sea(Unresolved { along: DVec2::Y, sigma: DVec2::ZERO })
    }

    fn flat_sea(slopes: Unresolved) -> Self {
        let still = SeaConstants {
            unresolved: slopes,
            all_slopes: slopes,
            resolved: DVec2::ZERO,
            cell_m: 1.0,
            step_refine: 1.0,
        };
        Self { tiles: Vec::new(), highest_m: 0.0, far_m: f64::INFINITY, still }
    }

    /// Slopes between cells and below the shortest wave.
    pub fn unresolved(&self) -> Unresolved {
        self.still.unresolved
    }

    /// All slopes as statistics: what water so far off has that its waves are not traced.
    pub fn all_slopes(&self) -> Unresolved {
        self.still.all_slopes
    }

    /// Mean square slopes that the tiles deliver in expectation (along the wind, across it).
    pub fn resolved(&self) -> DVec2 {
        self.still.resolved
    }

    /// Height of the resolved water, metres.
    pub fn height(&self, place: DVec2) -> f64 {
        self.tiles.iter().map(|t| t.height(place)).sum()
    }

    /// Slope of the resolved water (east, north).
    pub fn slope(&self, place: DVec2) -> DVec2 {
        self.tiles.iter().map(|t| t.slope(place)).sum()
    }

    /// First place from `from` on where the ray (unit `direction`) goes below the water.
    pub fn meet(&self, origin: DVec3, direction: DVec3, from: f64) -> Option<WaterHit> {
        let plane_t = |z: f64| (z - origin.z) / direction.z;
        if self.tiles.is_empty() {
            let t = plane_t(0.0);
            return (direction.z < 0.0 && t > from && origin.z > 0.0)
                .then(|| self.flat(origin, direction, t));
        }
        let (mut t, end) = if direction.z < 0.0 {
            (from.max(plane_t(self.highest_m)), plane_t(-self.highest_m))
        } else if origin.z > self.highest_m {
            return None;
        } else if direction.z > 0.0 {
            (from, plane_t(self.highest_m))
        } else {
            (from, self.far_m)
        };
        let run = direction.truncate().length();
        let least = self.still.cell_m / self.still.step_refine / run.max(1e-3);
        let mut before = None;
        while t <= end {
            if t > self.far_m {
                let t = plane_t(0.0);
                return (direction.z < 0.0).then(|| self.flat(origin, direction, t.max(self.far_m)));
            }
            let (gap, step) = self.probe(origin + direction * t, direction.z, run);
            if gap <= 0.0 {
                if let Some((t0, gap0)) = before {
                    return Some(self.refine(origin, direction, (t0, gap0), (t, gap)));
                }
            } else {
                before = Some((t, gap));
            }
            t += (step / self.still.step_refine).max(least * (1.0 + t / 400.0));
        }
        None
    }

    /// Height of a point over the water (or less than it, where coarse tiles already tell that it is well clear), and how far a
    /// ray can go on.
    fn probe(&self, point: DVec3, dz: f64, run: f64) -> (f64, f64) {
        let place = point.truncate();
        let mut gap = point.z;
        let last = self.tiles.len() - 1;
        for (i, tile) in self.tiles.iter().enumerate() {
            gap -= tile.height(place);
            let rest = self.tiles.get(i + 1).map_or(0.0, |t| t.rest_m);
            let clear = gap - rest;
            let closing = (tile.steepest * run - dz).max(1e-3);
            let step = clear / closing;
            if i == last || step > 2.0 * self.still.cell_m + 0.25 * rest / closing {
                return (if i == last { gap } else { clear }, step);
            }
        }
        (gap, 0.0)
    }

    fn refine(&self, origin: DVec3, direction: DVec3, above: (f64, f64), below: (f64, f64)) -> WaterHit {
        let ((mut t0, mut g0), (mut t1, mut g1)) = (above, below);
        for i in 0..12 {
            // Regula falsi, with a bisection now and then so that it cannot hang at one end.
            let t = if i % 3 == 2 { (t0 + t1) / 2.0 } else { t0 + (t1 - t0) * g0 / (g0 - g1).max(1e-12) };
            let p = origin + direction * t;
            let gap = p.z - self.height(p.truncate());
            if gap > 0.0 {
                (t0, g0) = (t, gap);
            } else {
                (t1, g1) = (t, gap);
            }
            if gap.abs() < 1e-5 {
                break;
            }
        }
        let t = if g0 < -g1 { t0 } else { t1 };
        let point = origin + direction * t;
        WaterHit { t, point, slope: self.slope(point.truncate()), unresolved: self.still.unresolved }
    }

    fn flat(&self, origin: DVec3, direction: DVec3, t: f64) -> WaterHit {
        WaterHit { t, point: origin + direction * t, slope: DVec2::ZERO, unresolved: self.still.all_slopes }
    }
}

fn finish_bounds(tiles: &mut [WaveTile]) {
    let mut rest = 0.0;
    for tile in tiles.iter_mut().rev() {
        rest += tile.rest_m;
        tile.rest_m = rest;
    }
    let mut squares = 0.0;
    for tile in tiles {
        squares += tile.steepest * tile.steepest;
        tile.steepest = SLOPE_SIGMAS * squares.sqrt();
    }
}

impl WaveTile {
    /// Cell and shares between it and the next ones.
    fn locate(&self, place: DVec2) -> ([usize; 4], DVec2) {
        let p = self.turn.rotate(place) * self.cells_per_m;
        let floor = p.floor();
        let mask = self.cells as i64 - 1;
        let (x0, y0) = ((floor.x as i64 & mask) as usize, (floor.y as i64 & mask) as usize);
        let (x1, y1) = ((x0 + 1) & mask as usize, ((y0 + 1) & mask as usize) * self.cells);
        let y0 = y0 * self.cells;
        ([y0 + x0, y0 + x1, y1 + x0, y1 + x1], p - floor)
    }

    pub(super) fn height(&self, place: DVec2) -> f64 {
        let ([a, b, c, d], f) = self.locate(place);
        let h = |i: usize| f64::from(self.heights[i]);
        let low = h(a) + (h(b) - h(a)) * f.x;
        let high = h(c) + (h(d) - h(c)) * f.x;
        low + (high - low) * f.y
    }

    pub(super) fn slope(&self, place: DVec2) -> DVec2 {
        let ([a, b, c, d], f) = self.locate(place);
        let s = |i: usize| DVec2::new(f64::from(self.slopes[i][0]), f64::from(self.slopes[i][1]));
        let low = s(a) + (s(b) - s(a)) * f.x;
        let high = s(c) + (s(d) - s(c)) * f.x;
        low + (high - low) * f.y
    }
}

/// One wave of a tile and the one that runs against it.
struct TracedWave {
    cell: (u32, u32),
    k: DVec2,
    omega: f64,
    with: Complex64,
    against: Complex64,
}

/// The waves of one tile.
pub(super) struct TileModes {
    cells: usize,
    size_m: f64,
    turn: DVec2,
    modes: Vec<TracedWave>,
    transform: Transform<f64>,
    /// Mean square slopes that survive interpolation (along, across the wind).
    delivered: DVec2,
}

impl TileModes {
    /// Variances of the slope (both axes together) and of the height, where `variance` is what a wave carries of the latter.
    pub(super) fn expected(&self, variance: impl Fn(DVec2) -> f64 + Sync) -> (f64, f64) {
        let of = |m: &TracedWave| (m.k.length_squared(), variance(m.k));
        self.modes.iter().map(of).fold((0.0, 0.0), |(slope, height), (k2, v)| (slope + v * k2, height + v))
    }

    /// The tile at `time_s`.
    pub(super) fn at(&self, time_s: f64) -> WaveTile {
        let n = self.cells;
        let mut height = vec![Complex64::ZERO; n * n];
        let mut slope = vec![Complex64::ZERO; n * n];
        for m in &self.modes {
            let phase = Complex64::from_polar(1.0, -m.omega * time_s);
            let h = m.with * phase + (m.against * phase).conj();
            let i = m.cell.1 as usize * n + m.cell.0 as usize;
            height[i] = h;
            // Two real transforms in one: east in the real part, north in the imaginary one.
            slope[i] = Complex64::i() * m.k.x * h - m.k.y * h;
        }
        let mut swap = vec![Complex64::ZERO; n * n];
        self.transform.run_in_place(&mut height, &mut swap);
        self.transform.run_in_place(&mut slope, &mut swap);
        let heights: Vec<f32> = height.iter().map(|c| c.re as f32).collect();
        WaveTile {
            cells: n,
            cells_per_m: n as f64 / self.size_m,
            turn: self.turn,
            rest_m: heights.iter().fold(0f32, |m, h| m.max(h.abs())).into(),
            heights,
            slopes: slope.iter().map(|c| [c.re as f32, c.im as f32]).collect(),
            // One standard deviation for now; summed by finish_bounds.
            steepest: self.delivered.max_element().sqrt(),
        }
    }
}

/// Size, direction and band of a tile.
pub(super) struct TilePlan {
    /// Side, metres.
    pub(super) size_m: f64,
    /// Cells along the side.
    pub(super) cells: usize,
    /// The rotation from the world's axes to the tile's.
    pub(super) turn: DVec2,
    /// Wave numbers that it carries, rad/m: the first is in it, the last is not.
    pub(super) band: (f64, f64),
}

impl TilePlan {
    /// The waves within the band. `amplitude` gives that of the wave in a cell of the plane of wave numbers that runs along a vector
    /// (rad/m, east and north): half of the height of its crests.
    pub(super) fn waves(
        self,
        omega: impl Fn(f64) -> f64 + Sync,
        amplitude: impl Fn(i64, i64, DVec2) -> Complex64 + Sync,
    ) -> TileModes {
        let unit = TAU / self.size_m;
        let within = |ix: i64, iy: i64, k: DVec2| {
            let length = k.length();
            let outside = length < self.band.0 || length >= self.band.1 || length == 0.0;
            if outside { Complex64::ZERO } else { amplitude(ix, iy, k) }
        };
        // Wave numbers that a tile of half as many cells would fold are left out by the band already.
        let reach = ((self.band.1 / unit).ceil() as i64 + 1).min(self.cells as i64 / 2 - 1);
        let plane =
            (-reach..=reach).into_par_iter().flat_map_iter(|iy| (-reach..=reach).map(move |ix| (ix, iy)));
        let modes = plane.filter_map(|(ix, iy)| {
            let k = self.turn.conjugate_rotate(DVec2::new(ix as f64, iy as f64) * unit);
            let (with, against) = (within(ix, iy, k), within(-ix, -iy, -k));
            let wrap = |i: i64| i.rem_euclid(self.cells as i64) as u32;
            (with != Complex64::ZERO || against != Complex64::ZERO).then(|| TracedWave {
                cell: (wrap(ix), wrap(iy)),
                k,
                omega: omega(k.length()),
                with,
                against,
            })
        });
        let modes = modes.collect();
        TileModes {
            cells: self.cells,
            size_m: self.size_m,
            turn: self.turn,
            modes,
            transform: Transform::new(self.cells),
            delivered: DVec2::ZERO,
        }
    }

    /// The waves of a spectrum: both sine and cosine part of each normally distributed. WaveTile `number` of a seed.
    fn of_spectrum(self, spectrum: &Spectrum, seed: u64, number: i64) -> TileModes {
        let unit = TAU / self.size_m;
        let delivered = self.delivered(spectrum);
        let modes = self.waves(frequency, |ix, iy, k| {
            let power = spectrum.directional(k.length(), k.angle_to(spectrum.downwind())) * unit * unit / 2.0;
            let gauss = gauss_pair(seed, &[number, ix, iy]);
            Complex64::new(gauss[0], gauss[1]) * (power / 2.0).sqrt()
        });
        TileModes { delivered, ..modes }
    }

    /// Expected mean square slopes along and across the wind, less what linear interpolation takes: a wave that advances by `a`
    /// radians a cell keeps (2 + cos a) / 3 of its power on average.
    fn delivered(&self, spectrum: &Spectrum) -> DVec2 {
        let along = spectrum.downwind();
        let (from, to) = (self.band.0.max(spectrum.peak() / 30.0), self.band.1);
        let (steps, angles) = (200, 90);
        let d_log = (to / from).ln() / f64::from(steps);
        let cell = self.size_m / self.cells as f64;
        let mut sum = DVec2::ZERO;
        for i in 0..steps {
            let k = from * ((f64::from(i) + 0.5) * d_log).exp();
            for j in 0..angles {
                let angle = PI * ((f64::from(j) + 0.5) / f64::from(angles) - 0.5);
                let power = spectrum.directional(k, angle) * k * k * d_log * PI / f64::from(angles);
                let phase = self.turn.rotate(DVec2::from_angle(angle).rotate(along) * k) * cell;
                let kept = (2.0 + phase.x.cos()) * (2.0 + phase.y.cos()) / 9.0;
                let slope = DVec2::new(angle.cos(), angle.sin()) * k;
                sum += slope * slope * power * kept;
            }
        }
        sum
    }
}

/// Rotation back by the unit complex number `self`.
trait ConjugateRotate {
    fn conjugate_rotate(self, v: DVec2) -> DVec2;
}

impl ConjugateRotate for DVec2 {
    fn conjugate_rotate(self, v: DVec2) -> DVec2 {
        DVec2::new(self.x, -self.y).rotate(v)
    }
}
