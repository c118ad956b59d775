//! The text of a [`Still`].

use glam::DVec2;

use super::{Attitude, BOATS_MAX, Focal, Place, RANGE_MAX_M, Still, StillBoat, StillCamera};
use bowwave_core::world::scenario::{
    ScenarioError, place,
    read::{document, light, reflection, sea},
    table::{Source, Table},
};

/// m/s in a knot.
const M_S_PER_KN: f64 = 1852.0 / 3600.0;

/// Largest coordinate of a pixel that a text may hold; whether it lies in the picture is checked with the picture.
const PIXEL_MAX: f64 = 8192.0;

pub(super) fn still(text: &str, origin: &str) -> Result<Still, ScenarioError> {
    let document = document(text, origin)?;
    let root = Table::root(Source { text, origin }, &document);
    root.only(&["picture", "seed", "interval_s", "camera", "boat", "sea", "light", "reflection"])?;
    let (force, waves) = sea(&root.table("sea")?, &[])?;
    let sky = root.table("light")?;
    let (sun_direction, visibility_m) = light(&sky, &["sun_strength"])?;
    Ok(Still {
        picture: root.required_text("picture", "the path of a JPEG or PNG file, or of a folder of them")?,
        seed: root.integer("seed", 0..=i64::MAX)?.map_or(1, i64::unsigned_abs),
        interval_s: root.number("interval_s", 0.001..=3600.0, "s")?,
        camera: camera(&root.table("camera")?)?,
        waves,
        sun_direction,
        sun_strength: sky.number("sun_strength", 0.0..=1.0, "")?.unwrap_or(1.0),
        visibility_m,
        water: reflection(&root.table("reflection")?, force)?,
        boats: boats(&root.tables("boat", BOATS_MAX)?)?,
        origin: origin.to_owned(),
    })
}

fn camera(table: &Table<'_>) -> Result<StillCamera, ScenarioError> {
    table.only(&[
        "eye_height_m",
        "focal_35mm_mm",
        "hfov_deg",
        "focal_px",
        "centre_px",
        "radial",
        "tangential",
        "azimuth_deg",
        "horizon",
        "pitch_deg",
        "roll_deg",
    ])?;
    let ways = [
        ("focal_px", table.number("focal_px", 1.0..=1e6, "pixels")?.map(Focal::Pixels)),
        (
            "hfov_deg",
            table.number("hfov_deg", 0.2..=150.0, "degrees")?.map(|d| Focal::Across(d.to_radians())),
        ),
        ("focal_35mm_mm", table.number("focal_35mm_mm", 5.0..=5000.0, "mm")?.map(Focal::Film)),
    ];
    let mut given = ways.into_iter().filter_map(|(key, focal)| Some((key, focal?)));
    let (key, focal) = given.next().unwrap_or(("focal_px", Focal::OfPicture));
    if let Some((other, _)) = given.next() {
        return Err(table.error(other, format!("says the same as {key}; leave one of them out")));
    }
    let span = |key: &str| pair(table, key, -10.0..=10.0, "a pair of numbers, -10 to 10: [0.01, 0.0]");
    let attitude = attitude(table)?;
    let first = if matches!(attitude, Attitude::Horizon(_)) { "horizon" } else { "pitch_deg" };
    Ok(StillCamera {
        eye_height_m: table.required_number("eye_height_m", 0.2..=500.0, "m")?,
        focal,
        centre: pair(table, "centre_px", 0.0..=PIXEL_MAX, "a pair of pixels: [960, 540]")?,
        radial: span("radial")?.unwrap_or(DVec2::ZERO),
        tangential: span("tangential")?.unwrap_or(DVec2::ZERO),
        azimuth: table.number("azimuth_deg", -360.0..=360.0, "degrees")?.unwrap_or(0.0).to_radians(),
        attitude,
        focal_mark: table.mark(key),
        attitude_mark: table.mark(first),
    })
}

fn attitude(table: &Table<'_>) -> Result<Attitude, ScenarioError> {
    let what = "two points of the horizon in pixels: [[100, 410], [1180, 404]]";
    let points = table.pairs("horizon", [0.0..=PIXEL_MAX, 0.0..=PIXEL_MAX], what)?;
    let angle = |key: &str| -> Result<Option<f64>, ScenarioError> {
        Ok(table.number(key, -85.0..=85.0, "degrees")?.map(f64::to_radians))
    };
    let (pitch, roll) = (angle("pitch_deg")?, angle("roll_deg")?);
    match points.as_deref() {
        Some(&[[ax, ay], [bx, by]]) => {
            if let Some(key) = ["pitch_deg", "roll_deg"].into_iter().find(|key| table.has(key)) {
                return Err(table.error(key, "follows from horizon; leave out it or that"));
            }
            Ok(Attitude::Horizon([DVec2::new(ax, ay), DVec2::new(bx, by)]))
        }
        Some(other) => Err(table.error("horizon", format!("has {} points; give {what}", other.len()))),
        None => match pitch {
            Some(pitch) => Ok(Attitude::Given { pitch, roll: roll.unwrap_or(0.0) }),
            None => Err(table.missing("horizon", &format!("{what}, or pitch_deg and roll_deg"))),
        },
    }
}

fn boats(tables: &[Table<'_>]) -> Result<Vec<StillBoat>, ScenarioError> {
    tables.iter().enumerate().map(|(index, table)| boat(index, table)).collect()
}

fn boat(index: usize, table: &Table<'_>) -> Result<StillBoat, ScenarioError> {
    table.only(&["name", "model", "waterline_px", "range_m", "bearing_deg", "heading_deg", "speed_kn"])?;
    let pixel = pair(table, "waterline_px", 0.0..=PIXEL_MAX, "a point of the water in pixels: [520, 470]")?;
    let (key, at) = match pixel {
        Some(pixel) => {
            if let Some(key) = ["range_m", "bearing_deg"].into_iter().find(|key| table.has(key)) {
                return Err(table.error(key, "follows from waterline_px; leave out it or that"));
            }
            ("waterline_px", Place::Pixel(pixel))
        }
        None if !table.has("range_m") && !table.has("bearing_deg") => {
            let what = "a point of the water in pixels, or range_m and bearing_deg";
            return Err(table.missing("waterline_px", what));
        }
        None => {
            let range_m = table.required_number("range_m", 1.0..=RANGE_MAX_M, "m")?;
            let bearing = table.required_number("bearing_deg", -360.0..=360.0, "degrees")?;
            ("range_m", Place::World(place(bearing.to_radians(), range_m)))
        }
    };
    Ok(StillBoat {
        name: table.text("name")?.unwrap_or_else(|| format!("boat {}", index + 1)),
        model: table.required_text("model", "the name of a model or the path of a glTF or PNG file")?,
        place: at,
        heading: table.required_number("heading_deg", -360.0..=360.0, "degrees")?.to_radians(),
        speed_m_s: table.number("speed_kn", 0.0..=100.0, "kn")?.unwrap_or(0.0) * M_S_PER_KN,
        mark: table.mark(key),
        key: format!("boat[{}].{key}", index + 1),
    })
}

/// Two numbers in a list.
fn pair(
    table: &Table<'_>,
    key: &str,
    range: std::ops::RangeInclusive<f64>,
    what: &str,
) -> Result<Option<DVec2>, ScenarioError> {
    let Some(numbers) = table.numbers(key, range, what)? else { return Ok(None) };
    match numbers[..] {
        [x, y] => Ok(Some(DVec2::new(x, y))),
        _ => Err(table.error(key, format!("has {} numbers; give {what}", numbers.len()))),
    }
}
