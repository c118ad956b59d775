//! Keys and rules that texts with boats have in common.

use glam::DVec2;
use serde::Deserialize;

use super::spec::place;
use crate::text::toml::{BareOrQuoted, OptionalKey, ValueRule, number, whole};

/// m/s in a knot.
pub const M_S_PER_KN: f64 = 1852.0 / 3600.0;
/// A seed of chance.
pub fn seed() -> ValueRule<'static, i64, u64> {
    whole(0..=i64::MAX as u64)
}
/// An angle clockwise, in either direction.
pub fn angle() -> ValueRule<'static, f64, f64> {
    number(-360.0..=360.0, "degrees")
}

/// A time after the beginning.
pub(super) fn seconds() -> ValueRule<'static, f64, f64> {
    number(0.0..=86_400.0, "s")
}

/// Distance of a boat or a point of its course from the camera.
pub(super) fn range() -> ValueRule<'static, f64, f64> {
    number(1.0..=20_000.0, "m")
}

/// A condition that is asked for; one that is not is left out.
pub(super) fn only_true() -> ValueRule<'static, bool, bool> {
    ValueRule::new("true, or leave it out", |raw: &bool| raw.then_some(true))
}

/// A point of a course by bearing and range.
pub(super) fn waypoint() -> ValueRule<'static, Vec<f64>, DVec2> {
    let allowed = "pairs [bearing_deg, range_m] within -360 to 360 degrees and 1 to 20000 m";
    ValueRule::new(allowed, |raw: &Vec<f64>| match raw[..] {
        [bearing, range_m] => Some(place(angle().check(&bearing)?.to_radians(), range().check(&range_m)?)),
        _ => None,
    })
}

/// Keys of a table `[sea]`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SeaKeys {
    /// Wind force.
    pub beaufort: OptionalKey<i64>,
    /// Where the wind comes from, degrees clockwise from north.
    pub wind_from_deg: OptionalKey<f64>,
    /// Significant wave height, metres; of the wind force without it.
    pub significant_wave_height_m: OptionalKey<f64>,
    /// Period of the highest waves, seconds; goes with the height.
    pub peak_period_s: OptionalKey<f64>,
}

/// Keys of a table `[light]`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LightKeys {
    /// Where the sun stands, degrees clockwise from north.
    pub sun_azimuth_deg: OptionalKey<f64>,
    /// How high it stands, degrees.
    pub sun_elevation_deg: OptionalKey<f64>,
    /// Latitude, degrees north.
    pub latitude_deg: OptionalKey<f64>,
    /// Longitude, degrees east.
    pub longitude_deg: OptionalKey<f64>,
    /// Date and time, UTC.
    pub utc: OptionalKey<BareOrQuoted>,
    /// Meteorological visibility, kilometres.
    pub visibility_km: OptionalKey<f64>,
}

/// Keys of a table `[reflection]`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ReflectionKeys {
    /// Name of the method.
    pub method: OptionalKey<String>,
    /// How strong the shadow is, 0 to 2.
    pub shadow_level: OptionalKey<i64>,
}
