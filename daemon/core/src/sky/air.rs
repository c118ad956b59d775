//! Composition of the air, and the share of the sun that comes through it.

use std::sync::OnceLock;

use glam::{DVec3, Vec3};

/// Radii of the sea's level and of the air's upper end, metres.
pub(super) const GROUND_M: f64 = 6_360_000.0;
pub(super) const TOP_M: f64 = 6_460_000.0;

/// Scattering by molecules at sea level at 645, 550 and 440 nm, 1/m (Bodhaine 1999). At these three, powers of the wavelength from -1 to -4
/// are within 2 % of the linear sRGB channels of their spectra.
pub(super) const RAYLEIGH: DVec3 = DVec3::new(7.08e-6, 13.558e-6, 33.1e-6);
/// Absorption by ozone at its densest, 1/m (Hillaire 2020; at 645 nm by the cross-section of Serdyuchenko 2014).
const OZONE: DVec3 = DVec3::new(1.24e-6, 1.881e-6, 0.085e-6);
/// Heights over which molecules and haze thin out by e, metres.
const RAYLEIGH_M: f64 = 8_000.0;
const HAZE_M: f64 = 1_200.0;
/// Share of what haze takes that it scatters: maritime aerosol.
pub(super) const HAZE_ALBEDO: f64 = 0.96;
/// Haze takes as the wavelength to the power -1 (Angstrom 1929), over that at 550 nm.
const HAZE_COLOUR: DVec3 = DVec3::new(550.0 / 645.0, 1.0, 550.0 / 440.0);
/// Asymmetry of haze: what is scattered forwards over backwards. Of 0.65 to 0.82 it comes closest to Hosek and Wilkie's skies and to the CIE's
/// clear ones together.
pub(super) const HAZE_G: f64 = 0.70;

/// Extinction by haze at sea level, 1/m; the turbidity is the optical depth of molecules and haze over that of molecules, at 550 nm.
pub(super) fn haze(turbidity: f64) -> DVec3 {
    (turbidity - 1.0).max(0.0) * RAYLEIGH.y * RAYLEIGH_M / HAZE_M * HAZE_COLOUR
}

/// Densities of molecules, haze and ozone at a height in metres, relative to those at sea level, of ozone to its densest.
pub(super) fn densities(height_m: f64) -> DVec3 {
    let height_m = height_m.max(0.0);
    DVec3::new(
        (-height_m / RAYLEIGH_M).exp(),
        (-height_m / HAZE_M).exp(),
        (1.0 - (height_m - 25_000.0).abs() / 15_000.0).max(0.0),
    )
}

/// Extinction of the three where their densities are `of`, or optical depth where these are columns in metres.
pub(super) fn depth(of: DVec3, turbidity: f64) -> DVec3 {
    RAYLEIGH * of.x + haze(turbidity) * of.y + OZONE * of.z
}

/// Columns of molecules, haze and ozone from a height to the top of the air, by the sine of elevation of the line: metres at the densities of
/// sea level. Tabled once: each light's way out goes through it.
struct Columns(Vec<DVec3>);

const HEIGHTS: usize = 40;
const LINES: usize = 80;

impl Columns {
    fn new() -> Self {
        let cell = |i: usize| {
            let (height, line) = ((i / LINES) as f64, (i % LINES) as f64);
            // Heights closer together near the sea, where haze is.
            let radius = GROUND_M + (TOP_M - GROUND_M) * (height / (HEIGHTS - 1) as f64).powi(3);
            let (near, far) = ways(radius);
            let way = near + (far - near) * line / (LINES - 1) as f64;
            let sine = sine_of_way(radius, way);
            column(radius, sine, way)
        };
        Self((0..HEIGHTS * LINES).map(cell).collect())
    }

    fn at(&self, radius: f64, sine: f64) -> DVec3 {
        let (near, far) = ways(radius);
        let line = (way_to_top(radius, sine) - near) / (far - near).max(1.0);
        mixed(&self.0, (share_of_radius(radius), HEIGHTS), (line, LINES))
    }
}

/// The cell of a table of `count` nodes in which a share of it lies, and the share of that cell.
pub(super) fn cell(share: f64, count: usize) -> (usize, f64) {
    let place = share.clamp(0.0, 1.0) * (count - 1) as f64;
    let index = (place as usize).min(count - 2);
    (index, place - index as f64)
}

/// Value of a table between its four nodes about a share of its rows and one of its columns; each comes with how many there are.
pub(super) fn mixed(nodes: &[DVec3], rows: (f64, usize), columns: (f64, usize)) -> DVec3 {
    let ((row, up), (column, over)) = (cell(rows.0, rows.1), cell(columns.0, columns.1));
    let at = |row: usize, column: usize| nodes[row * columns.1 + column];
    let low = at(row, column).lerp(at(row, column + 1), over);
    low.lerp(at(row + 1, column).lerp(at(row + 1, column + 1), over), up)
}

/// Share of a table's rows at a radius from the Earth's middle, metres: rows are closer together near the sea, where haze is.
pub(super) fn share_of_radius(radius: f64) -> f64 {
    ((radius - GROUND_M) / (TOP_M - GROUND_M)).max(0.0).cbrt()
}

/// The shortest and the longest way from a radius to the top: straight up, and past the horizon.
fn ways(radius: f64) -> (f64, f64) {
    let level = (radius * radius - GROUND_M * GROUND_M).max(0.0).sqrt();
    (TOP_M - radius, level + (TOP_M * TOP_M - GROUND_M * GROUND_M).sqrt())
}

/// Way to the top along a line of that sine of elevation, metres.
pub(super) fn way_to_top(radius: f64, sine: f64) -> f64 {
    let along = radius * sine;
    (along * along + TOP_M * TOP_M - radius * radius).max(0.0).sqrt() - along
}

/// The sine of elevation of a line whose way to the top is `way`.
fn sine_of_way(radius: f64, way: f64) -> f64 {
    ((TOP_M * TOP_M - radius * radius - way * way) / (2.0 * radius * way.max(1e-3))).clamp(-1.0, 1.0)
}

/// Way to the sea along a line of that sine of elevation, metres; `None` for one that misses it.
pub(super) fn way_to_sea(radius: f64, sine: f64) -> Option<f64> {
    let along = radius * sine;
    let inside = along * along + GROUND_M * GROUND_M - radius * radius;
    (sine < 0.0 && inside >= 0.0).then(|| (-along - inside.sqrt()).max(0.0))
}

/// Height after so much of a line, radius from the Earth's middle, metres, and the sine of elevation of the line there.
pub(super) fn along(radius: f64, sine: f64, way: f64) -> (f64, f64) {
    let after = (radius * radius + way * way + 2.0 * radius * way * sine).max(1.0).sqrt();
    (after, ((radius * sine + way) / after).clamp(-1.0, 1.0))
}

/// The columns along a line, by Simpson's rule in steps that grow with the square of what is behind.
fn column(radius: f64, sine: f64, way: f64) -> DVec3 {
    const STEPS: usize = 64;
    let at =
        |share: f64| densities(along(radius, sine, way * share * share).0 - GROUND_M) * (2.0 * share * way);
    let step = 1.0 / STEPS as f64;
    (0..STEPS)
        .map(|i| {
            let from = i as f64 * step;
            (at(from) + 4.0 * at(from + 0.5 * step) + at(from + step)) * (step / 6.0)
        })
        .sum()
}

/// Share of the sun's light that comes through to a height (radius from the Earth's middle, metres), the sine of its elevation there being
/// `sine`: as much of its disc as the horizon leaves.
pub(super) fn through(radius: f64, sine: f64, turbidity: f64) -> DVec3 {
    static COLUMNS: OnceLock<Columns> = OnceLock::new();
    /// Radius of the sun's disc, radians.
    const SUN: f64 = 0.004_65;
    let dip = -(1.0 - (GROUND_M / radius).powi(2)).max(0.0).sqrt();
    // A linear share for a disc: within a tenth of its area.
    let risen = ((sine - dip) / (2.0 * SUN) + 0.5).clamp(0.0, 1.0);
    if risen == 0.0 {
        return DVec3::ZERO;
    }
    let columns = COLUMNS.get_or_init(Columns::new).at(radius, sine.max(dip));
    risen * (-depth(columns, turbidity)).exp()
}

/// Light of the sun at the sea's level on a surface that faces it, over that above the air; `sine` is that of its elevation.
pub fn sunlight(sine: f64, turbidity: f64) -> Vec3 {
    through(GROUND_M + 10.0, sine, turbidity).as_vec3()
}
