//! The sea's surface at one instant: heights and slopes on periodic tiles of three sizes, summed from waves whose
//! frequencies all fit into the recording a whole number of times.

use std::f64::consts::{PI, TAU};

use glam::Vec4;
use rustfft::num_complex::Complex;

use super::{
    lattice::Transform,
    random::{gaussian, stream},
    spectrum::{Swell, WindSea, frequency},
};

/// Points along a tile's side.
const N: usize = 256;
/// Tiles, from the longest waves to the shortest.
pub const CASCADES: usize = 3;
/// Mip levels of a tile, down to 2 x 2.
pub const LEVELS: usize = 8;
/// Side of the smallest tile, metres: 2.6 cm a point, about a pixel's width at the nearest water.
const SMALLEST_M: f64 = 6.7;
/// Points on the shortest wave that a tile carries.
const POINTS_PER_WAVE: f64 = 3.6;

/// How much each tile has to say about where crests break: the longest waves break, the shortest only fray the edge.
const SQUEEZE: [f32; CASCADES] = [1.6, 0.8, 0.25];

/// Numbers at a point: height in metres, slope to the east, slope to the north, and how much the surface is being
/// pushed together there, weighted by `SQUEEZE`.
pub type Texel = Vec4;

/// One wave and its opposite on a tile's lattice.
struct LoopedWave {
    index: u32,
    opposite: u32,
    /// Whole cycles in the recording.
    cycles: u32,
    amplitude: Complex<f32>,
    amplitude_opposite: Complex<f32>,
    /// Unit direction in the tile's axes.
    direction: [f32; 2],
}

struct LoopedBand {
    size_m: f64,
    rotation: f64,
    modes: Vec<LoopedWave>,
}

/// One tile at one instant, with its mip levels.
pub struct LoopedTile {
    /// Points per metre at level 0.
    per_metre: f32,
    axis: [f32; 2],
    levels: Vec<Vec<Texel>>,
}

/// All tiles at one instant and the memory to make them.
pub struct LoopedSurface {
    /// From the longest waves to the shortest.
    pub tiles: [LoopedTile; CASCADES],
    along: Vec<Complex<f32>>,
    across: Vec<Complex<f32>>,
    swap: Vec<Complex<f32>>,
    heights: Vec<f32>,
    phases: Vec<Complex<f32>>,
}

/// Covariance of the slopes that a tile's level still resolves: east-east, north-north, east-north.
pub type Covariance = [f32; 3];

/// The waves.
pub struct LoopedSea {
    cascades: [LoopedBand; CASCADES],
    transform: Transform<f32>,
    period_s: f64,
    cycles_max: u32,
}

impl LoopedSea {
    /// Draws the waves of a wind sea running before a wind from `wind_from` and of a swell.
    pub fn new(sea: &WindSea, wind_from: f64, swell: Option<&Swell>, period_s: f64, seed: u64) -> Self {
        let longest = swell.map_or(sea.peak(), |s| s.peak().min(sea.peak()));
        // Room for several of the longest waves, but no larger than what leaves the middle tile enough points.
        let largest = (2.4 * TAU / longest).max(5.0 * TAU / sea.peak()).clamp(120.0, 900.0);
        let sizes = [largest, (largest * SMALLEST_M).sqrt(), SMALLEST_M];
        // Turned against each other, so that their repetitions never line up.
        let rotations = [0.21, 1.17, 2.31];
        let mut lower = 0.0;
        let cascades = std::array::from_fn(|c| {
            let upper = TAU * N as f64 / (POINTS_PER_WAVE * sizes[c]);
            let frame = TileBand { size_m: sizes[c], rotation: rotations[c], lower, upper };
            lower = upper;
            let swell = if c == 0 { swell } else { None };
            LoopedBand {
                size_m: sizes[c],
                rotation: rotations[c],
                modes: draw_modes(&frame, sea, wind_from, swell, period_s, seed.wrapping_add(c as u64)),
            }
        });
        let cycles_max =
            cascades.iter().flat_map(|c: &LoopedBand| &c.modes).map(|m| m.cycles).max().unwrap_or(0);
        Self { cascades, transform: Transform::new(N), period_s, cycles_max }
    }

    /// Memory for one instant.
    pub fn surface(&self) -> LoopedSurface {
        let zeros = vec![Complex::default(); N * N];
        LoopedSurface {
            tiles: std::array::from_fn(|c| {
                let cascade = &self.cascades[c];
                let (sin, cos) = cascade.rotation.sin_cos();
                LoopedTile {
                    per_metre: (N as f64 / cascade.size_m) as f32,
                    axis: [cos as f32, sin as f32],
                    levels: (0..LEVELS).map(|l| vec![Vec4::ZERO; (N >> l) * (N >> l)]).collect(),
                }
            }),
            along: zeros.clone(),
            across: zeros.clone(),
            swap: zeros,
            heights: vec![0.0; N * N],
            phases: Vec::with_capacity(self.cycles_max as usize + 1),
        }
    }

    /// Makes `surface` that of `time_s` after the recording's start.
    pub fn evaluate(&self, time_s: f64, surface: &mut LoopedSurface) {
        let turn = (time_s / self.period_s).rem_euclid(1.0);
        surface.phases.clear();
        surface.phases.extend((0..=self.cycles_max).map(|n| {
            let (sin, cos) = (TAU * (f64::from(n) * turn).fract()).sin_cos();
            Complex::new(cos as f32, -sin as f32)
        }));
        for (c, squeeze) in SQUEEZE.into_iter().enumerate() {
            self.displacements(c, surface);
            let per_metre = surface.tiles[c].per_metre;
            displace(surface, per_metre);
            fill_tile(&mut surface.tiles[c], &surface.heights, &surface.along, &surface.across, squeeze);
        }
    }

    /// Leaves in `along` height + i * displacement in x, in `across` displacement in y (tile axes, metres).
    fn displacements(&self, c: usize, surface: &mut LoopedSurface) {
        surface.along.fill(Complex::default());
        surface.across.fill(Complex::default());
        for mode in &self.cascades[c].modes {
            let phase = surface.phases[mode.cycles as usize];
            let h = (mode.amplitude * phase + (mode.amplitude_opposite * phase).conj()) * 0.5;
            let [kx, ky] = mode.direction;
            let (here, there) = (mode.index as usize, mode.opposite as usize);
            // Two real fields share one transform: height in the real part, x displacement in the imaginary one.
            surface.along[here] = h * (1.0 - kx);
            surface.along[there] = h.conj() * (1.0 + kx);
            let dy = Complex::new(-h.im, h.re) * ky;
            surface.across[here] = dy;
            surface.across[there] = dy.conj();
        }
        self.transform.run(&mut surface.along, &mut surface.swap);
        self.transform.run(&mut surface.across, &mut surface.swap);
    }

    /// Slope covariance that each level of each tile resolves, and the variance of the height, measured at one instant.
    pub fn statistics(surface: &LoopedSurface) -> ([[Covariance; LEVELS]; CASCADES], f64) {
        let mut height = 0.0;
        let slopes = std::array::from_fn(|c| {
            let tile = &surface.tiles[c];
            height += mean(&tile.levels[0], |t| t[0] * t[0]);
            std::array::from_fn(|l| {
                let level = &tile.levels[l];
                [
                    mean(level, |t| t[1] * t[1]) as f32,
                    mean(level, |t| t[2] * t[2]) as f32,
                    mean(level, |t| t[1] * t[2]) as f32,
                ]
            })
        });
        (slopes, height)
    }
}

fn mean(level: &[Texel], f: impl Fn(&Texel) -> f32) -> f64 {
    level.iter().map(|t| f64::from(f(t))).sum::<f64>() / level.len() as f64
}

/// The part of the spectrum that one tile carries.
struct TileBand {
    size_m: f64,
    rotation: f64,
    lower: f64,
    upper: f64,
}

fn draw_modes(
    band: &TileBand,
    sea: &WindSea,
    wind_from: f64,
    swell: Option<&Swell>,
    period_s: f64,
    seed: u64,
) -> Vec<LoopedWave> {
    let lattice = TAU / band.size_m;
    let half = N as i32 / 2;
    let (sin, cos) = band.rotation.sin_cos();
    // Towards where the wind blows, as angle from east to north.
    let downwind = 0.5 * PI - (wind_from + PI);
    let vector = |i: i32, j: i32| {
        let (x, y) = (f64::from(i) * lattice, f64::from(j) * lattice);
        (x * cos - y * sin, x * sin + y * cos)
    };
    let in_plane = || (1 - half..half).flat_map(|j| (1 - half..half).map(move |i| (i, j)));
    let swell_sum: f64 = swell
        .map(|s| in_plane().map(|(i, j)| vector(i, j)).map(|(e, n)| s.weight(e, n, lattice)).sum())
        .unwrap_or(1.0);
    // Variance of the height that the wave (i, j) carries.
    let energy = |i: i32, j: i32| {
        let (east, north) = vector(i, j);
        let k = east.hypot(north);
        let mut sum = 0.0;
        if k > band.lower && k <= band.upper && k > 0.0 {
            sum +=
                sea.omnidirectional(k) / k * sea.spread(k, north.atan2(east) - downwind) * lattice * lattice;
        }
        if let Some(swell) = swell {
            sum += swell.weight(east, north, lattice) / swell_sum * (swell.height_m / 4.0).powi(2);
        }
        sum
    };
    let mut rng = stream(seed, 0x5ea);
    let mut amplitude = |variance: f64| {
        // E|a|^2 = 2 variance, since the height is the real part.
        let scale = variance.sqrt();
        Complex::new((scale * gaussian(&mut rng)) as f32, (scale * gaussian(&mut rng)) as f32)
    };
    let mut modes = Vec::new();
    for (i, j) in in_plane().filter(|&(i, j)| j > 0 || (j == 0 && i > 0)) {
        let (east, north) = vector(i, j);
        let k = east.hypot(north);
        let (forward, backward) = (energy(i, j), energy(-i, -j));
        if forward + backward < 1e-16 {
            continue;
        }
        let cell = |i: i32, j: i32| (i.rem_euclid(N as i32) * N as i32 + j.rem_euclid(N as i32)) as u32;
        let length = f64::from(i).hypot(f64::from(j));
        modes.push(LoopedWave {
            index: cell(i, j),
            opposite: cell(-i, -j),
            cycles: (frequency(k) * period_s / TAU).round().max(1.0) as u32,
            amplitude: amplitude(forward),
            amplitude_opposite: amplitude(backward),
            direction: [(f64::from(i) / length) as f32, (f64::from(j) / length) as f32],
        });
    }
    modes
}

/// Heights where the water is after moving towards the crests (Tessendorf 2004, eq. 44, with the displacement taken at the
/// place where the water ends up instead of where it comes from, so that the surface stays a function of place).
fn displace(surface: &mut LoopedSurface, per_metre: f32) {
    let (along, across) = (&surface.along, &surface.across);
    for y in 0..N {
        for x in 0..N {
            let i = y * N + x;
            let u = x as f32 - along[i].im * per_metre + N as f32;
            let v = y as f32 - across[i].re * per_metre + N as f32;
            let (iu, iv) = (u as usize, v as usize);
            let (fu, fv) = (u - iu as f32, v - iv as f32);
            let at = |dx: usize, dy: usize| along[((iv + dy) & (N - 1)) * N + ((iu + dx) & (N - 1))].re;
            let upper = at(0, 0) + fu * (at(1, 0) - at(0, 0));
            let lower = at(0, 1) + fu * (at(1, 1) - at(0, 1));
            surface.heights[i] = upper + fv * (lower - upper);
        }
    }
}

fn fill_tile(
    tile: &mut LoopedTile,
    heights: &[f32],
    along: &[Complex<f32>],
    across: &[Complex<f32>],
    weight: f32,
) {
    let scale = tile.per_metre;
    let [cos, sin] = tile.axis;
    let level = &mut tile.levels[0];
    let wrap = |i: usize, d: isize| i.wrapping_add_signed(d) & (N - 1);
    for y in 0..N {
        let rows = [-2, -1, 1, 2].map(|d| wrap(y, d) * N);
        for x in 0..N {
            let i = y * N + x;
            let columns = [-2, -1, 1, 2].map(|d| wrap(x, d));
            // Fourth-order differences.
            let slope = |a: f32, b: f32, c: f32, d: f32| (8.0 * (c - b) - (d - a)) * (scale / 12.0);
            let h = |at: usize| heights[at];
            let row = y * N;
            let sx =
                slope(h(row + columns[0]), h(row + columns[1]), h(row + columns[2]), h(row + columns[3]));
            let sy = slope(h(rows[0] + x), h(rows[1] + x), h(rows[2] + x), h(rows[3] + x));
            let squeeze = along[row + columns[1]].im - along[row + columns[2]].im + across[rows[1] + x].re
                - across[rows[2] + x].re;
            level[i] = Vec4::new(
                heights[i],
                sx * cos - sy * sin,
                sx * sin + sy * cos,
                0.5 * weight * scale * squeeze,
            );
        }
    }
    for l in 1..LEVELS {
        let (finer, coarser) = tile.levels.split_at_mut(l);
        let (from, to) = (&finer[l - 1], &mut coarser[0]);
        let (width, double) = (N >> l, N >> (l - 1));
        for y in 0..width {
            let (upper, lower) = (2 * y * double, (2 * y + 1) * double);
            for x in 0..width {
                let pair = |row: usize| from[row + 2 * x] + from[row + 2 * x + 1];
                to[y * width + x] = 0.25 * (pair(upper) + pair(lower));
            }
        }
    }
}

impl LoopedTile {
    /// Mean square of one number of a level's texels.
    pub fn mean_square(&self, level: usize, channel: usize) -> f32 {
        self.levels.get(level).map_or(0.0, |texels| mean(texels, |t| t[channel] * t[channel]) as f32)
    }

    /// TileLevel on which points are `spacing_m` apart, with its fraction; negative where even level 0 is coarser.
    pub fn level_for(&self, spacing_m: f32) -> f32 {
        (spacing_m * self.per_metre).log2()
    }

    /// One level, 0 the finest.
    #[inline(always)]
    pub fn level(&self, level: usize) -> TileLevel<'_> {
        let level = level.min(LEVELS - 1);
        let width = N >> level;
        let shrink = 1.0 / (1u32 << level) as f32;
        let scale = self.per_metre * shrink;
        TileLevel {
            texels: &self.levels[level][..width * width],
            width,
            axis: self.axis.map(|a| a * scale),
            // Averages of 2^level points lie between them.
            centre: 0.5 * shrink - 0.5,
        }
    }
}

/// One level of a tile, ready for many look-ups.
#[derive(Clone, Copy)]
pub struct TileLevel<'a> {
    texels: &'a [Texel],
    width: usize,
    axis: [f32; 2],
    centre: f32,
}

impl TileLevel<'_> {
    /// Metres from point to point.
    pub fn spacing_m(&self) -> f32 {
        1.0 / self.axis[0].hypot(self.axis[1])
    }

    /// Bilinear value at a place in the world, metres.
    #[inline(always)]
    pub fn sample(&self, east: f32, north: f32) -> Texel {
        let mask = self.width - 1;
        let u = east * self.axis[0] + north * self.axis[1] + self.centre;
        let v = north * self.axis[0] - east * self.axis[1] + self.centre;
        let ((iu, fu), (iv, fv)) = (split(u), split(v));
        let (x0, x1) = (iu & mask, iu.wrapping_add(1) & mask);
        let (y0, y1) = ((iv & mask) * self.width, (iv.wrapping_add(1) & mask) * self.width);
        let upper = self.texels[y0 + x0].lerp(self.texels[y0 + x1], fu);
        let lower = self.texels[y1 + x0].lerp(self.texels[y1 + x1], fu);
        upper.lerp(lower, fv)
    }
}

/// Splits a number within +-4 million into a whole one, modulo 2^22, and what is left, 0 to 1. At whole numbers the split
/// may be (n - 1, 1) as well as (n, 0), which is the same to an interpolation. A conversion proper costs several times as
/// much, and this is done a hundred million times a second.
#[inline(always)]
pub fn split(x: f32) -> (usize, f32) {
    // Where floats are one apart, adding rounds to a whole number and leaves it in the low bits.
    const MAGIC: f32 = 12_582_912.0;
    let whole = (x - 0.5) + MAGIC;
    ((whole.to_bits() & 0x3f_ffff) as usize, x - (whole - MAGIC))
}

#[cfg(test)]
mod tests {
    use super::{super::spectrum::wind_of_beaufort, *};

    fn field(force: u8, seed: u64) -> (LoopedSea, LoopedSurface, WindSea) {
        let sea = WindSea::new(wind_of_beaufort(force));
        let field = LoopedSea::new(&sea, 0.4, None, 20.0, seed);
        let surface = field.surface();
        (field, surface, sea)
    }

    #[test]
    fn splitting_leaves_whole_and_rest() {
        for i in -5000..5000 {
            let x = i as f32 * 0.377 + 0.01;
            let (whole, rest) = split(x);
            let below = whole as i64 - if x < 1.0 && whole > 1 << 21 { 1 << 22 } else { 0 };
            assert!((below as f32 + rest - x).abs() < 1e-3, "{x}: {below} + {rest}");
            assert!((0.0..=1.0).contains(&rest), "{x} {rest}");
        }
    }

    #[test]
    fn significant_height_is_the_spectrums() {
        for force in [2, 3, 4] {
            let (field, mut surface, sea) = field(force, 3);
            // One instant of one tile is a small sample of the longest waves: average over some.
            let mut variance = 0.0;
            for i in 0..4 {
                field.evaluate(f64::from(i) * 4.7, &mut surface);
                variance += LoopedSea::statistics(&surface).1 / 4.0;
            }
            let ratio = 4.0 * variance.sqrt() / sea.significant_height();
            assert!((ratio - 1.0).abs() < 0.1, "Beaufort {force}: {ratio} of the spectrum's height");
        }
    }

    #[test]
    fn tiles_carry_the_slopes_up_to_their_shortest_wave() {
        let (field, mut surface, sea) = field(3, 5);
        field.evaluate(1.0, &mut surface);
        let (slopes, _) = LoopedSea::statistics(&surface);
        let got: f32 = slopes.iter().map(|levels| levels[0][0] + levels[0][1]).sum();
        let shortest = TAU * N as f64 / (POINTS_PER_WAVE * SMALLEST_M);
        let ratio = f64::from(got) / sea.slope_variance(shortest);
        // Differences and displacement on a lattice cost some of the shortest waves' slopes.
        assert!((0.7..1.1).contains(&ratio), "{ratio} of the slope variance");
        for levels in slopes {
            for pair in levels.windows(2) {
                assert!(pair[1][0] <= pair[0][0] && pair[1][1] <= pair[0][1]);
            }
        }
    }

    #[test]
    fn the_sea_repeats_and_moves() {
        let (field, mut surface, _) = field(2, 9);
        let mut at = |t: f64| {
            field.evaluate(t, &mut surface);
            surface.tiles.iter().map(|tile| tile.level(0).sample(31.7, -12.9)).collect::<Vec<_>>()
        };
        let (start, later, end) = (at(0.0), at(0.4), at(20.0));
        assert_eq!(start, end);
        assert_ne!(start, later);
    }

    #[test]
    fn slope_is_the_heights_gradient() {
        let (field, mut surface, _) = field(3, 2);
        field.evaluate(2.0, &mut surface);
        for (c, tile) in surface.tiles.iter().enumerate() {
            let step = 1.0 / tile.per_metre;
            let (mut error, mut power) = (0.0, 0.0);
            for i in 0..400 {
                let (x, y) = (i as f32 * 0.713 * step, i as f32 * 1.37 * step);
                let numeric = (tile.level(0).sample(x + step, y)[0] - tile.level(0).sample(x - step, y)[0])
                    / (2.0 * step);
                let stated = tile.level(0).sample(x, y)[1];
                error += (numeric - stated).powi(2);
                power += stated.powi(2);
            }
            assert!(error < 0.12 * power, "tile {c}: {}", error / power);
        }
    }
}
