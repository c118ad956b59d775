//! The text of a [`Still`].

use std::ops::RangeInclusive;

use bowwave_core::{
    text::toml::{
        BareOrQuoted, OptionalKey, RequiredKey, Spanned, TomlError, TomlPlace, TomlSection, TomlText,
        ValueRule, number, plain_text,
    },
    world::scenario::{
        place,
        read::{LightKeys, M_S_PER_KN, ReflectionKeys, SeaKeys, angle, light, reflection, sea, seed},
    },
};
use glam::DVec2;
use serde::Deserialize;

use super::{BOATS_MAX, Focal, RANGE_MAX_M, Still, StillAttitude, StillBoat, StillCamera, StillPlace};

/// Largest coordinate of a pixel that a text may hold; whether it lies in the picture is checked with the picture.
const PIXEL_MAX: f64 = 8192.0;

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawStill {
    picture: OptionalKey<String>,
    seed: OptionalKey<i64>,
    interval_s: OptionalKey<f64>,
    camera: Option<Spanned<RawStillCamera>>,
    boat: Vec<Spanned<RawStillBoat>>,
    sea: Option<Spanned<SeaKeys>>,
    light: Option<Spanned<RawStillLight>>,
    reflection: Option<Spanned<ReflectionKeys>>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawStillCamera {
    eye_height_m: OptionalKey<f64>,
    focal_35mm_mm: OptionalKey<f64>,
    hfov_deg: OptionalKey<f64>,
    focal_px: OptionalKey<f64>,
    centre_px: OptionalKey<Vec<f64>>,
    radial: OptionalKey<Vec<f64>>,
    tangential: OptionalKey<Vec<f64>>,
    azimuth_deg: OptionalKey<f64>,
    horizon: Option<Spanned<Vec<RequiredKey<Vec<f64>>>>>,
    pitch_deg: OptionalKey<f64>,
    roll_deg: OptionalKey<f64>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawStillLight {
    sun_azimuth_deg: OptionalKey<f64>,
    sun_elevation_deg: OptionalKey<f64>,
    latitude_deg: OptionalKey<f64>,
    longitude_deg: OptionalKey<f64>,
    utc: OptionalKey<BareOrQuoted>,
    sun_strength: OptionalKey<f64>,
    visibility_km: OptionalKey<f64>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawStillBoat {
    name: OptionalKey<String>,
    model: OptionalKey<String>,
    waterline_px: OptionalKey<Vec<f64>>,
    range_m: OptionalKey<f64>,
    bearing_deg: OptionalKey<f64>,
    heading_deg: OptionalKey<f64>,
    speed_kn: OptionalKey<f64>,
}

pub(super) fn still(text: &str, origin: &str) -> Result<Still, TomlError> {
    let text = TomlText::new(text, origin)?;
    let (raw, mut warnings) = text.read::<RawStill>(&[])?;
    let (section, keys) = text.section("sea", raw.sea);
    let (force, waves) = sea(&section, &keys)?;
    let (section, keys) = text.section("light", raw.light);
    let RawStillLight { sun_azimuth_deg, sun_elevation_deg, latitude_deg, longitude_deg, utc, .. } = keys;
    let (sun_strength, visibility_km) = (keys.sun_strength, keys.visibility_km);
    let keys =
        LightKeys { sun_azimuth_deg, sun_elevation_deg, latitude_deg, longitude_deg, utc, visibility_km };
    let mut daylight = light(&section, &keys)?;
    daylight.sun_strength = text.given(&sun_strength, number(0.0..=1.0, ""))?.unwrap_or(1.0);
    let (_, mirror) = text.section("reflection", raw.reflection);
    let (section, view) = text.section("camera", raw.camera);
    let boats = text.sections("boat", raw.boat, BOATS_MAX)?;
    let Some(picture) = &raw.picture else {
        return Err(text.root().missing("picture", "the path of a JPEG or PNG file, or of a folder of them"));
    };
    Ok(Still {
        picture: text.needed(picture, plain_text())?,
        seed: text.given(&raw.seed, seed())?.unwrap_or(1),
        interval_s: text.given(&raw.interval_s, number(0.001..=3600.0, "s"))?,
        camera: camera(&section, &view)?,
        waves,
        daylight,
        water: reflection(text, &mirror, force, &mut warnings)?,
        boats: boats
            .iter()
            .enumerate()
            .map(|(i, (section, raw))| boat(section, raw, i + 1))
            .collect::<Result<_, _>>()?,
        warnings,
    })
}

/// A pair of numbers: a point or two coefficients.
fn pair(range: RangeInclusive<f64>, allowed: &str) -> ValueRule<'static, Vec<f64>, DVec2> {
    ValueRule::new(allowed, move |raw: &Vec<f64>| match raw[..] {
        [x, y] if range.contains(&x) && range.contains(&y) => Some(DVec2::new(x, y)),
        _ => None,
    })
}

/// A point of the picture.
fn pixel(allowed: &str) -> ValueRule<'static, Vec<f64>, DVec2> {
    pair(0.0..=PIXEL_MAX, allowed)
}

/// Two coefficients of the lens.
fn coefficients() -> ValueRule<'static, Vec<f64>, DVec2> {
    pair(-10.0..=10.0, "a pair of numbers, -10 to 10: [0.01, 0.0]")
}

fn camera(section: &TomlSection<'_>, raw: &RawStillCamera) -> Result<StillCamera, TomlError> {
    let text = section.text;
    let ways = [
        ("focal_px", &raw.focal_px, number(1.0..=1e6, "pixels"), Focal::Pixels as fn(f64) -> Focal),
        ("hfov_deg", &raw.hfov_deg, number(0.2..=150.0, "degrees"), |deg| Focal::Across(deg.to_radians())),
        ("focal_35mm_mm", &raw.focal_35mm_mm, number(5.0..=5000.0, "mm"), Focal::Film),
    ];
    let mut told: Option<(&str, Focal, TomlPlace)> = None;
    for (key, value, rule, focal) in ways {
        let (Some(number), Some(value)) = (text.given(value, rule)?, value) else { continue };
        match told {
            Some((first, ..)) => {
                return Err(text.error(value, format!("says the same as {first}; leave one of them out")));
            }
            None => told = Some((key, focal(number), text.place(value))),
        }
    }
    let (focal, focal_at) = match told {
        Some((_, focal, at)) => (focal, at),
        None => (Focal::OfPicture, section.place("focal_px")),
    };
    let attitude = attitude(section, raw)?;
    let attitude_at = match (&raw.horizon, &raw.pitch_deg) {
        (Some(horizon), _) => text.place(horizon),
        (None, Some(pitch)) => text.place(pitch),
        (None, None) => section.place("horizon"),
    };
    Ok(StillCamera {
        eye_height_m: section.required("eye_height_m", &raw.eye_height_m, number(0.2..=500.0, "m"))?,
        focal,
        centre: text.given(&raw.centre_px, pixel("a pair of pixels: [960, 540]"))?,
        radial: text.given(&raw.radial, coefficients())?.unwrap_or(DVec2::ZERO),
        tangential: text.given(&raw.tangential, coefficients())?.unwrap_or(DVec2::ZERO),
        azimuth: text.given(&raw.azimuth_deg, angle())?.unwrap_or(0.0).to_radians(),
        attitude,
        focal_at,
        attitude_at,
    })
}

fn attitude(section: &TomlSection<'_>, raw: &RawStillCamera) -> Result<StillAttitude, TomlError> {
    let text = section.text;
    let what = "two points of the horizon in pixels: [[100, 410], [1180, 404]]";
    let angle = |value: &OptionalKey<f64>| -> Result<Option<f64>, TomlError> {
        Ok(text.given(value, number(-85.0..=85.0, "degrees"))?.map(f64::to_radians))
    };
    let (pitch, roll) = (angle(&raw.pitch_deg)?, angle(&raw.roll_deg)?);
    if let Some(horizon) = &raw.horizon {
        let point = |value| text.needed(value, pixel(what));
        let points = horizon.get_ref().iter().map(point).collect::<Result<Vec<_>, _>>()?;
        if let Some(value) = raw.pitch_deg.as_ref().or(raw.roll_deg.as_ref()) {
            return Err(text.error(value, "follows from horizon; leave out it or that"));
        }
        return match points[..] {
            [a, b] => Ok(StillAttitude::Horizon([a, b])),
            _ => Err(text.refuse(horizon, what)),
        };
    }
    match pitch {
        Some(pitch) => Ok(StillAttitude::Given { pitch, roll: roll.unwrap_or(0.0) }),
        None => Err(section.missing("horizon", &format!("{what}, or pitch_deg and roll_deg"))),
    }
}

fn boat(section: &TomlSection<'_>, raw: &RawStillBoat, nth: usize) -> Result<StillBoat, TomlError> {
    let text = section.text;
    let range = number(1.0..=RANGE_MAX_M, "m");
    let (at, stands) = match (&raw.waterline_px, &raw.range_m, &raw.bearing_deg) {
        (Some(_), Some(other), _) | (Some(_), None, Some(other)) => {
            return Err(text.error(other, "follows from waterline_px; leave out it or that"));
        }
        (Some(value), None, None) => {
            let rule = pixel("a point of the water in pixels: [520, 470]");
            (StillPlace::Pixel(text.needed(value, rule)?), text.place(value))
        }
        (None, None, None) => {
            let what = "a point of the water in pixels, or range_m and bearing_deg";
            return Err(section.missing("waterline_px", what));
        }
        (None, value, bearing) => {
            let range_m = section.required("range_m", value, range)?;
            let bearing = section.required("bearing_deg", bearing, angle())?;
            let stands = value.as_ref().map_or_else(|| section.place("range_m"), |value| text.place(value));
            (StillPlace::World(place(bearing.to_radians(), range_m)), stands)
        }
    };
    let Some(model) = &raw.model else {
        return Err(section.missing("model", "the name of a model or the path of a glTF or PNG file"));
    };
    Ok(StillBoat {
        name: text.given(&raw.name, plain_text())?.unwrap_or_else(|| format!("boat {nth}")),
        model: text.needed(model, plain_text())?,
        place: at,
        heading: section.required("heading_deg", &raw.heading_deg, angle())?.to_radians(),
        speed_m_s: text.given(&raw.speed_kn, number(0.0..=100.0, "kn"))?.unwrap_or(0.0) * M_S_PER_KN,
        stands,
    })
}
