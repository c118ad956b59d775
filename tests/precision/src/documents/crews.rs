//! From when on a boat and its crew could be seen, by the light that there is.

use anyhow::Result;
use bowwave_core::world::seeing::{Ambient, Seeing, Target};
use glam::DVec3;

use super::{Exhibit, Line, Table, Workshop};

/// Height of the gunner's eye, metres.
const EYE_M: f64 = 8.0;
/// As far as a line of sight goes over a round Earth to a thing that stands `height_m` over the water, metres.
fn line_of_sight_m(height_m: f64) -> f64 {
    const EARTH_M: f64 = 6_371_000.0;
    [EYE_M, height_m].map(|h| (2.0 * EARTH_M * h).sqrt()).iter().sum()
}

/// A skiff from day to night, lit and not.
pub fn exhibits(_: &Workshop) -> Result<Vec<Exhibit>> {
    const MOST_M: f64 = 30_000.0;
    let mut lines = Vec::new();
    for sun_deg in [40.0_f64, 2.0, -4.0, -8.0, -14.0, -30.0] {
        let (up, level) = sun_deg.to_radians().sin_cos();
        let ambient = Ambient::new(DVec3::new(0.0, -level, up), 1.0, None, 4.0);
        let seeing = Seeing { ambient, visibility_m: 15_000.0 };
        let skiff = |lamp_lux: f64, candela: f64| Target {
            breadth_m: 6.0,
            height_m: 1.2,
            reflectance: 0.25,
            lamp_lux,
            candela,
        };
        let range = |target: &Target| seeing.farthest_m(EYE_M, DVec3::Y, target, MOST_M);
        lines.push(Line::new([
            sun_deg.into(),
            line_of_sight_m(1.2).into(),
            range(&skiff(0.0, 0.0)).into(),
            range(&skiff(1.0, 0.0)).into(),
            range(&skiff(0.0, 4.3)).into(),
        ]));
    }
    Ok(vec![Exhibit::Table(Table {
        caption: "Distance within which a skiff of 6 m is in view of an eye 8 m up, visibility 15 km, no moon: by a line of sight alone as printed, and by what eyes need".into(),
        titles: vec!["sun, deg", "line of sight, m", "dark skiff, m", "the same in one lux of a searchlight, m", "with a light of 4.3 cd, m"],
        lines,
    })])
}
