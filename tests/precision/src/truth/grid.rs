//! The grid of cells that methods are held against.

use std::path::Path;

use anyhow::Result;

use hw_sim::ocean::{
    sky::{SkySpec, SkyWeather},
    trace::WaterBody,
    waves::Resolution,
};

use super::{
    boat::BOX_BOAT,
    cell::{CellSpec, sea_of_state},
    files,
};

/// Distances, metres.
pub const RANGES_M: [f64; 3] = [60.0, 150.0, 400.0];
/// Eye heights, metres, the usual one first.
pub const EYES_M: [f64; 3] = [8.0, 4.0, 15.0];
/// Headings of the bow, degrees clockwise from the direction of view: almost abeam, and three quarters towards the eye.
pub const HEADINGS_DEG: [f64; 2] = [80.0, 215.0];
/// Where the wind comes from, degrees clockwise from the direction of view.
pub const WIND_FROM_DEG: f64 = 320.0;

/// Named lights. Azimuths are clockwise from the direction of view, which is north.
pub const LIGHTINGS: [(&str, SkySpec); 5] = [
    ("overcast", SkySpec { weather: SkyWeather::Overcast, sun_elevation_deg: 40.0, sun_azimuth_deg: 180.0 }),
    ("high", SkySpec { weather: SkyWeather::Clear, sun_elevation_deg: 50.0, sun_azimuth_deg: 230.0 }),
    ("front", SkySpec { weather: SkyWeather::Clear, sun_elevation_deg: 25.0, sun_azimuth_deg: 12.0 }),
    ("behind", SkySpec { weather: SkyWeather::Clear, sun_elevation_deg: 25.0, sun_azimuth_deg: 190.0 }),
    ("low", SkySpec { weather: SkyWeather::Clear, sun_elevation_deg: 5.0, sun_azimuth_deg: 75.0 }),
];

/// The light of that name.
pub fn lighting(name: &str) -> Option<SkySpec> {
    LIGHTINGS.iter().find(|(n, _)| *n == name).map(|(_, s)| *s)
}

/// A cell with the grid's settings for its range: paths, and the shortest waves that have a shape.
pub fn cell(range_m: f64, state: u8, eye_m: f64, lighting_name: &str, heading_deg: f64) -> Option<CellSpec> {
    let (_, long_waves) = sea_of_state(state)?;
    let samples = if range_m < 100.0 {
        192
    } else if range_m < 300.0 {
        512
    } else {
        1536
    };
    // About twice the width that a pixel covers at that range, within what is worth tracing.
    let shortest_m = (1.3e-3 * range_m).clamp(0.05, 0.5);
    Some(CellSpec {
        range_m,
        state,
        eye_m,
        heading_deg,
        wind_from_deg: WIND_FROM_DEG,
        boat: BOX_BOAT.to_owned(),
        time_s: 0.0,
        wave_seed: 1,
        noise_seed: 1,
        samples,
        lighting: lighting_name.to_owned(),
        sky: lighting(lighting_name)?,
        long_waves,
        resolution: Resolution { shortest_m, ..Resolution::default() },
        body: WaterBody::default(),
    })
}

/// Folder of a cell.
pub fn name(c: &CellSpec) -> String {
    let mut name =
        format!("r{:03.0}-s{}-e{:02.0}-{}-h{:03.0}", c.range_m, c.state, c.eye_m, c.lighting, c.heading_deg);
    if c.boat != BOX_BOAT {
        name.push_str(&format!("-{}", c.boat));
    }
    if c.wave_seed != 1 {
        name.push_str(&format!("-w{}", c.wave_seed));
    }
    if c.time_s != 0.0 {
        name.push_str(&format!("-t{:.1}", c.time_s));
    }
    name
}

/// All cells; the quick ones are those of 8 m eye height, two lights and one heading. Each heading, eye height and light has waves of its
/// own, so that no single wave before the boat speaks for a state of the sea.
pub fn cells(quick: bool) -> Vec<CellSpec> {
    let lights: &[&str] = if quick { &["overcast", "high"] } else { &["overcast", "high", "front", "low"] };
    let eyes: &[f64] = if quick { &[8.0] } else { &EYES_M };
    let headings: &[f64] = if quick { &HEADINGS_DEG[..1] } else { &HEADINGS_DEG };
    let mut all = Vec::new();
    let mut wave_seed = 0;
    for heading in headings {
        for eye in eyes {
            for light in lights {
                wave_seed += 1;
                for range in RANGES_M {
                    let cells = (0..=4).filter_map(|state| cell(range, state, *eye, light, *heading));
                    all.extend(cells.map(|c| CellSpec { wave_seed, ..c }));
                }
            }
        }
    }
    all
}

/// Renders the cells that `out` does not yet hold with the same specification and at least as many paths. The number of paths is that of
/// the cells times `paths`.
pub fn make(cells: &[CellSpec], paths: f64, out: &Path) -> Result<()> {
    for (i, spec) in cells.iter().enumerate() {
        let mut spec = spec.clone();
        spec.samples = (f64::from(spec.samples) * paths).round().clamp(1.0, 1e6) as u32;
        let folder = out.join(name(&spec));
        if files::read_spec(&folder.join("cell.toml")).is_ok_and(|old| is_as_good(&old, &spec)) {
            continue;
        }
        let start = std::time::Instant::now();
        files::make(&spec, &folder)?;
        println!("{}/{} {} {:.1} s", i + 1, cells.len(), name(&spec), start.elapsed().as_secs_f64());
    }
    Ok(())
}

fn is_as_good(old: &CellSpec, wanted: &CellSpec) -> bool {
    let mut same = old.clone();
    same.samples = wanted.samples;
    same == *wanted && old.samples >= wanted.samples
}
