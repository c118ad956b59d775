//! Radiance model of the mean picture by sky, roughness and light out of the water, and from it how brightness goes with slope.
//!
//! Stilwell 1969 (J. Geophys. Res. 74, 1974) took the slopes of waves from the brightness of photographs with a computed
//! reflection of the sky. Here sky, roughness and the light out of the water are fitted to the picture itself: rows above the
//! horizon show the low sky, the mean brightness of water by depression shows the rest of it through Fresnel's law. The sky is
//! horizon and zenith with an exponential between them, or the standard overcast one. Facets are Gaussian and seen by their area across the ray; they do not
//! shade each other, so the fit is worth little within two degrees of the horizon.

use super::linear::solve;
use crate::sea::Facets;

/// Scales tried of the sky's fall from horizon to zenith, radians; the last stands for the standard overcast sky.
const SCALES: [f64; 6] = [0.12, 0.22, 0.4, 0.7, 1.2, f64::INFINITY];
/// Root mean square slopes tried, per axis: a glassy sea to a storm (Cox and Munk 1954: 0.04 to 0.2).
const ROUGH: [f64; 12] = [0.02, 0.04, 0.055, 0.07, 0.085, 0.1, 0.115, 0.13, 0.15, 0.175, 0.2, 0.23];
/// Extinctions of the air tried, per metre: clear air to thick fog (Koschmieder 1924).
const HAZE: [f64; 6] = [0.0, 0.000_7, 0.002, 0.005, 0.01, 0.02];
/// A sky that brightens towards the zenith is overcast and does so all the way up (CIE standard overcast sky, S 011): least scale
/// of such a sky, radians.
const OVERCAST_SCALE: f64 = 1.0;
/// Share by which each step of haze must lessen the misfit: light out of the water looks much the same, and is usual.
const HAZE_PRICE: f64 = 0.15;
/// A fit whose misfit lies by this share of the least, and this on top, above it counts a third as much in the mean.
const AS_GOOD: (f64, f64) = (0.12, 0.001_5);
/// Fits that count less than this are left out.
const LEAST_WEIGHT: f64 = 0.05;
/// Depressions at which the change of brightness with slope is tabulated, radians: the first, the ratio, how many.
const TABLE: (f64, f64, usize) = (0.04, 1.3, 12);
/// Nodes of slope along the view to either side, over three standard deviations. Fewer make the change with tilt uneven: what a facet
/// mirrors jumps at the horizon.
const ALONG: u8 = 30;
/// Half a step of tilt for the derivative, radians.
const TILT: f64 = 0.02;
/// Unknowns: horizon, zenith, light out of the water.
const TERMS: usize = 3;

/// Brightness of one direction: elevation above the horizon, negative on the water.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RadianceRow {
    /// Elevation, radians.
    pub elevation: f64,
    /// Linear luminance.
    pub light: f64,
    /// Weight of its relative error.
    pub weight: f64,
}

/// A fitted sky over fitted water.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Radiance {
    /// Luminance of the sky at the horizon, at the zenith, and of the water's own light.
    pub parts: [f64; TERMS],
    /// Scale of the sky's fall, radians.
    pub scale: f64,
    /// Root mean square slope per axis.
    pub rough: f64,
    /// Extinction of the air, per metre.
    pub haze: f64,
    /// Height of the eye, metres.
    pub eye_m: f64,
    /// Root mean square of the relative misfit, haze priced in.
    pub misfit: f64,
}

/// Share of the horizon's light left at an elevation, given its sine too: an exponential, or of a scale without end the CIE standard
/// overcast sky (S 011, type 1), which goes with the sine.
fn fade(elevation: f64, sine: f64, scale: f64) -> f64 {
    if scale.is_finite() { (-elevation / scale).exp() } else { 1.0 - sine }
}

/// What each part of the light gives on water under a sky of that scale.
fn water_terms(facets: &Facets, scale: f64) -> [f64; TERMS] {
    let (mut horizon, mut all) = (0.0, 0.0);
    for facet in &facets.mirrored {
        horizon += facet.share * fade(facet.elevation, facet.sine, scale);
        all += facet.share;
    }
    [horizon, all - horizon, facets.through]
}

/// What each part of the light gives at a direction; the water tilted by `tilt` towards the eye.
fn terms(elevation: f64, tilt: f64, scale: f64, rough: f64) -> [f64; TERMS] {
    if elevation > 0.0 {
        sky_terms(elevation, scale)
    } else {
        water_terms(&Facets::seen(elevation, tilt, rough, ALONG), scale)
    }
}

fn sky_terms(elevation: f64, scale: f64) -> [f64; TERMS] {
    let fade = fade(elevation, elevation.sin(), scale);
    [fade, 1.0 - fade, 0.0]
}

/// The light of water behind hazy air that shines as the horizon does.
fn hazed(terms: [f64; TERMS], elevation: f64, haze: f64, eye_m: f64) -> [f64; TERMS] {
    if elevation > 0.0 || haze <= 0.0 {
        return terms;
    }
    let through = (-haze * eye_m / (-elevation).sin().max(1e-3)).exp();
    let mut terms = terms.map(|t| t * through);
    terms[0] += 1.0 - through;
    terms
}

impl Radiance {
    /// The sky, water, roughness and haze that fit the rows best in relative terms, from `eye_m` above the sea; `None` below four
    /// rows of water.
    pub fn fit(rows: &[RadianceRow], eye_m: f64) -> Option<Self> {
        if rows.iter().filter(|r| r.elevation < 0.0).count() < 4 {
            return None;
        }
        let mut search = Search::new(rows.to_vec(), eye_m);
        while search.step() {}
        search.best()
    }

    /// The same sky and water in another colour channel.
    pub fn recolour(&self, rows: &[RadianceRow]) -> Option<Self> {
        let table: Vec<[f64; TERMS]> = rows
            .iter()
            .map(|r| {
                hazed(terms(r.elevation, 0.0, self.scale, self.rough), r.elevation, self.haze, self.eye_m)
            })
            .collect();
        let (parts, misfit) = fit_parts(rows, &table)?;
        Some(Self { parts, misfit, ..*self })
    }

    /// Luminance at an elevation above the horizon, of level water below it.
    pub fn light(&self, elevation: f64) -> f64 {
        self.tilted(elevation, 0.0)
    }

    fn tilted(&self, elevation: f64, tilt: f64) -> f64 {
        let terms = hazed(terms(elevation, tilt, self.scale, self.rough), elevation, self.haze, self.eye_m);
        terms.iter().zip(self.parts).map(|(t, p)| t * p).sum()
    }

    /// Relative change of the brightness of water with its tilt towards the eye, per radian.
    pub fn gain(&self, depression: f64) -> f64 {
        let at = |tilt: f64| self.tilted(-depression, tilt);
        (at(TILT) - at(-TILT)) / (2.0 * TILT * at(0.0).max(1e-12))
    }
}

/// The search for the fits that explain the rows, roughness by roughness.
#[derive(Clone, Debug)]
pub(super) struct Search {
    rows: Vec<RadianceRow>,
    eye_m: f64,
    next: usize,
    fits: Vec<Radiance>,
}

impl Search {
    /// A search that has not begun.
    pub fn new(rows: Vec<RadianceRow>, eye_m: f64) -> Self {
        Self { rows, eye_m, next: 0, fits: Vec::new() }
    }

    /// Tries one roughness; false where none is left.
    pub fn step(&mut self) -> bool {
        let Some(&rough) = ROUGH.get(self.next) else { return false };
        self.next += 1;
        let (rows, eye_m) = (&self.rows, self.eye_m);
        let facets: Vec<Option<Facets>> = rows
            .iter()
            .map(|r| (r.elevation <= 0.0).then(|| Facets::seen(r.elevation, 0.0, rough, ALONG)))
            .collect();
        for scale in SCALES {
            let of = |(r, f): (&RadianceRow, &Option<Facets>)| match f {
                Some(facets) => water_terms(facets, scale),
                None => sky_terms(r.elevation, scale),
            };
            let clear: Vec<[f64; TERMS]> = rows.iter().zip(&facets).map(of).collect();
            for (i, haze) in HAZE.into_iter().enumerate() {
                let table: Vec<[f64; TERMS]> =
                    clear.iter().zip(rows).map(|(t, r)| hazed(*t, r.elevation, haze, eye_m)).collect();
                let Some((parts, misfit)) = fit_parts(rows, &table) else { continue };
                if parts[1] > parts[0] && scale < OVERCAST_SCALE {
                    continue;
                }
                let price = 1.0 + HAZE_PRICE * i as f64;
                self.fits.push(Radiance { parts, scale, rough, haze, eye_m, misfit: misfit * price });
            }
        }
        true
    }

    /// The fit with the least misfit so far.
    pub fn best(&self) -> Option<Radiance> {
        self.fits.iter().min_by(|a, b| a.misfit.total_cmp(&b.misfit)).copied()
    }

    /// Ends the search: the fits that are about as good as the best, with their weights.
    pub fn likely(&self) -> Vec<(Radiance, f64)> {
        let Some(best) = self.best() else { return Vec::new() };
        let width = AS_GOOD.0 * best.misfit + AS_GOOD.1;
        let weight = |f: &Radiance| (-(f.misfit - best.misfit) / width).exp();
        self.fits.iter().map(|f| (*f, weight(f))).filter(|(_, w)| *w > LEAST_WEIGHT).collect()
    }
}

/// Relative change of the brightness of water with its tilt, mean over the likely fits, by depression.
#[derive(Clone, Debug, Default)]
pub(super) struct Gains {
    sums: [f64; TABLE.2],
    squares: [f64; TABLE.2],
    rough: f64,
    weights: f64,
}

impl Gains {
    /// Counts a fit in.
    pub fn add(&mut self, fit: &Radiance, weight: f64) {
        for (i, (sum, square)) in self.sums.iter_mut().zip(&mut self.squares).enumerate() {
            let gain = fit.gain(TABLE.0 * TABLE.1.powi(i as i32));
            *sum += weight * gain;
            *square += weight * gain * gain;
        }
        self.rough += weight * fit.rough;
        self.weights += weight;
    }

    /// The mean at a depression, per radian.
    pub fn at(&self, depression: f64) -> f64 {
        let place = ((depression / TABLE.0).ln() / TABLE.1.ln()).clamp(0.0, TABLE.2 as f64 - 1.001);
        let (i, part) = (place as usize, place.fract());
        (self.sums[i] * (1.0 - part) + self.sums[i + 1] * part) / self.weights
    }

    /// Mean root mean square slope.
    pub fn rough(&self) -> f64 {
        self.rough / self.weights
    }

    /// Relative standard deviation over the fits, mean over the depressions in the middle.
    pub fn sigma(&self) -> f64 {
        let middle = 3..9;
        let one = |i: usize| {
            let mean = self.sums[i] / self.weights;
            let variance = (self.squares[i] / self.weights - mean * mean).max(0.0);
            variance.sqrt() / mean.abs().max(1e-6)
        };
        middle.clone().map(one).sum::<f64>() / middle.len() as f64
    }
}

/// Parts, none negative, of least relative error, and its root mean square.
fn fit_parts(rows: &[RadianceRow], table: &[[f64; TERMS]]) -> Option<([f64; TERMS], f64)> {
    let mut best: Option<([f64; TERMS], f64)> = None;
    for subset in 1..1_usize << TERMS {
        let Some(parts) = solve_subset(rows, table, subset) else { continue };
        if parts.iter().any(|p| *p < 0.0) {
            continue;
        }
        let (mut square, mut weight) = (0.0, 0.0);
        for (row, t) in rows.iter().zip(table) {
            let model: f64 = t.iter().zip(parts).map(|(t, p)| t * p).sum();
            square += row.weight * (model / row.light - 1.0).powi(2);
            weight += row.weight;
        }
        let misfit = (square / f64::max(weight, 1e-12)).sqrt();
        if misfit.is_finite() && best.is_none_or(|b| misfit < b.1) {
            best = Some((parts, misfit));
        }
    }
    best
}

/// Least squares with the parts whose bit is set; the others are nothing.
fn solve_subset(rows: &[RadianceRow], table: &[[f64; TERMS]], subset: usize) -> Option<[f64; TERMS]> {
    let (mut m, mut right) = ([[0.0; TERMS]; TERMS], [0.0; TERMS]);
    for (row, t) in rows.iter().zip(table) {
        let scale = row.weight / (row.light * row.light).max(1e-12);
        for i in 0..TERMS {
            for j in 0..TERMS {
                m[i][j] += scale * t[i] * t[j];
            }
            right[i] += scale * t[i] * row.light;
        }
    }
    for i in (0..TERMS).filter(|i| subset >> i & 1 == 0) {
        m[i] = [0.0; TERMS];
        right[i] = 0.0;
        m[i][i] = 1.0;
        for (j, row) in m.iter_mut().enumerate() {
            if j != i {
                row[i] = 0.0;
            }
        }
    }
    solve(m, right)
}
