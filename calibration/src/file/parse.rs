//! From TOML text to checked numbers.

use bowwave_core::{
    calibration::{Calibration, TriggerLatency},
    geometry::{Distortion, Lens},
    own_ship::{Mask, OwnShip, Phantom},
    text::toml::{
        Loose, OptionalKey, RequiredKey, TomlError, TomlText, ValueRule, list_of, number, positive, whole,
    },
};
use glam::{DQuat, DVec2, DVec3};
use serde::Deserialize;
use toml::value::Datetime;

use crate::{CalibrationError, CalibrationFile, Date, Provenance};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawCalibration {
    made: RequiredKey<Datetime>,
    source: String,
    #[serde(default)]
    camera_name: String,
    #[serde(default)]
    camera_serial: String,
    #[serde(default)]
    imu_name: String,
    #[serde(default)]
    imu_serial: String,
    lens: RawLens,
    camera_from_imu: RawRotation,
    time_offset: RawTimeOffset,
    shutter: Option<RawShutter>,
    boresight: RawBoresight,
    trigger: Option<RawTriggerLatency>,
    gyro_bias: RawGyroBias,
    own_ship: Option<RawOwnShip>,
}

/// Sections of measured values. Each says on which day they were measured, and may say how.
macro_rules! measured {
    ($($name:ident { $($key:ident: $kind:ty,)* })*) => {$(
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct $name {
            $($key: $kind,)*
            measured: RequiredKey<Datetime>,
            #[serde(default)]
            how: String,
        }

        impl $name {
            fn provenance(&self, text: TomlText<'_>) -> Result<Provenance, TomlError> {
                Ok(Provenance::new(text.needed(&self.measured, calendar_day())?, self.how.as_str()))
            }
        }
    )*};
}

measured! {
    RawLens {
        size_px: RequiredKey<Vec<i64>>,
        focal_px: RequiredKey<Vec<f64>>,
        focal_sigma_px: RequiredKey<f64>,
        centre_px: RequiredKey<Vec<f64>>,
        radial: OptionalKey<Vec<f64>>,
        tangential: OptionalKey<Vec<f64>>,
        fisheye: OptionalKey<Vec<f64>>,
    }
    RawRotation {
        rotation_wxyz: RequiredKey<Vec<f64>>,
        sigma_mrad: RequiredKey<Vec<f64>>,
    }
    RawTimeOffset {
        offset_ms: RequiredKey<f64>,
        sigma_ms: RequiredKey<f64>,
    }
    RawShutter {
        readout_ms: RequiredKey<f64>,
        sigma_ms: RequiredKey<f64>,
    }
    RawBoresight {
        right_deg: RequiredKey<f64>,
        down_deg: RequiredKey<f64>,
        sigma_mrad: RequiredKey<f64>,
        muzzle_m: RequiredKey<Vec<f64>>,
    }
    RawTriggerLatency {
        latency_ms: RequiredKey<f64>,
        sigma_ms: RequiredKey<f64>,
    }
    RawGyroBias {
        bias_deg_per_s: RequiredKey<Vec<f64>>,
        sigma_deg_per_s: RequiredKey<Vec<f64>>,
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawOwnShip {
    #[serde(default)]
    hidden_px: Vec<RequiredKey<Vec<[f64; 2]>>>,
    #[serde(default)]
    phantom: Vec<RawPhantom>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPhantom {
    #[serde(default)]
    name: String,
    outline_px: RequiredKey<Vec<[f64; 2]>>,
    #[serde(default)]
    recoils: bool,
}

/// A calibration's text, checked; `origin` (a file name, usually) stands at the head of error messages.
///
/// # Errors
/// Names the place, the key, the value and what is allowed.
pub fn parse(text: &str, origin: &str) -> Result<CalibrationFile, CalibrationError> {
    let text = TomlText::new(text, origin)?;
    let (raw, _) = text.read::<RawCalibration>(&[])?;
    let (hidden, phantoms) = own_ship(text, &raw)?;
    Ok(CalibrationFile {
        made: text.needed(&raw.made, calendar_day())?,
        lens: raw.lens.provenance(text)?,
        camera_from_imu: raw.camera_from_imu.provenance(text)?,
        time_offset: raw.time_offset.provenance(text)?,
        shutter: raw.shutter.as_ref().map(|shutter| shutter.provenance(text)).transpose()?,
        boresight: raw.boresight.provenance(text)?,
        trigger: raw.trigger.as_ref().map(|trigger| trigger.provenance(text)).transpose()?,
        gyro_bias: raw.gyro_bias.provenance(text)?,
        calibration: calibration(text, &raw)?,
        hidden,
        phantoms,
        source: raw.source,
        camera_name: raw.camera_name,
        camera_serial: raw.camera_serial,
        imu_name: raw.imu_name,
        imu_serial: raw.imu_serial,
    })
}

/// Milliradians to radians; the writer's inverse must be the inverse of just this.
pub(crate) fn radians_from_mrad(mrad: f64) -> f64 {
    mrad / 1000.0
}

/// Milliseconds to whole nanoseconds.
fn ns_from_ms(ms: f64) -> i64 {
    (ms * 1e6).round() as i64
}

/// How far a quaternion's length may be off before it is taken for a typing error, and from where it is left as it stands.
const NORM_TOLERANCE: f64 = 1e-3;
const NORM_EXACT: f64 = 1e-14;

/// Polygons of the own gun and ship that a file may have.
pub const POLYGONS_MOST: usize = 32;
/// Corners of one of them, and the share of the picture that all may hide.
const CORNERS_MOST: usize = 64;
const SHARE_MOST: f64 = 0.8;

/// No camera of 10 pictures a second or more takes longer to read one.
const READOUT_MS_MAX: f64 = 100.0;

/// A day without a time.
fn calendar_day() -> ValueRule<'static, Datetime, Date> {
    let allowed = "a day of the calendar, without quotes and without a time: 2026-11-20";
    ValueRule::new(allowed, |raw: &Datetime| {
        let date = raw.date.filter(|_| raw.time.is_none() && raw.offset.is_none())?;
        Date::new(date.year, date.month, date.day)
    })
}

/// A duration of up to so many milliseconds either way, to nanoseconds.
fn milliseconds(limit: f64) -> ValueRule<'static, f64, i64> {
    let rule = number(-limit..=limit, "ms");
    ValueRule::new(rule.allowed.clone(), move |raw: &f64| rule.check(raw).map(ns_from_ms))
}

/// A standard deviation of up to so many milliseconds, to nanoseconds.
fn sigma_ms(limit: f64) -> ValueRule<'static, f64, i64> {
    let allowed = format!("a number above 0, up to {limit} ms; a nanosecond is the resolution of all times");
    ValueRule::new(allowed, move |raw: &f64| (*raw <= limit).then(|| ns_from_ms(*raw)).filter(|ns| *ns >= 1))
}

/// Numbers of a vector, each up to `limit` either way.
fn each_up_to<const N: usize>(limit: f64, unit: &str) -> ValueRule<'static, Vec<f64>, [f64; N]> {
    list_of(number(-limit..=limit, unit))
}

fn calibration(text: TomlText<'_>, raw: &RawCalibration) -> Result<Calibration, TomlError> {
    let angle = || number(-80.0..=80.0, "degrees");
    let sigma_mrad = || positive(4000.0, "mrad");
    let (boresight, bias) = (&raw.boresight, &raw.gyro_bias);
    let turn = [&boresight.right_deg, &boresight.down_deg].map(|deg| text.needed(deg, angle()));
    let [right, down] = turn;
    let bias_sigma = text.needed(&bias.sigma_deg_per_s, list_of(positive(100.0, "degrees/s")))?;
    let rotation_sigma = text.needed(&raw.camera_from_imu.sigma_mrad, list_of(sigma_mrad()))?;
    let (readout_ns, readout_sigma_ns) = match &raw.shutter {
        Some(shutter) => (
            text.needed(&shutter.readout_ms, milliseconds(READOUT_MS_MAX))?,
            text.needed(&shutter.sigma_ms, sigma_ms(READOUT_MS_MAX))?,
        ),
        // All rows are exposed at once.
        None => (0, 0),
    };
    let trigger = |raw: &RawTriggerLatency| -> Result<TriggerLatency, TomlError> {
        Ok(TriggerLatency {
            latency_ns: text.needed(&raw.latency_ms, milliseconds(1000.0))?,
            sigma_ns: text.needed(&raw.sigma_ms, sigma_ms(1000.0))?,
        })
    };
    Ok(Calibration {
        lens: lens(text, &raw.lens)?,
        focal_sigma_px: text.needed(&raw.lens.focal_sigma_px, positive(1e5, "pixels"))?,
        camera_from_imu: rotation(text, &raw.camera_from_imu.rotation_wxyz)?,
        camera_from_imu_sigma: DVec3::from_array(rotation_sigma.map(radians_from_mrad)),
        time_offset_ns: text.needed(&raw.time_offset.offset_ms, milliseconds(10_000.0))?,
        time_offset_sigma_ns: text.needed(&raw.time_offset.sigma_ms, sigma_ms(10_000.0))?,
        readout_ns,
        readout_sigma_ns,
        boresight: DVec2::new(right?.to_radians(), down?.to_radians()),
        boresight_sigma: radians_from_mrad(text.needed(&boresight.sigma_mrad, sigma_mrad())?),
        muzzle_in_camera: text.needed(&boresight.muzzle_m, each_up_to(100.0, "m"))?.into(),
        trigger: raw.trigger.as_ref().map(trigger).transpose()?,
        gyro_bias: DVec3::from_array(
            text.needed(&bias.bias_deg_per_s, each_up_to(100.0, "degrees/s"))?.map(f64::to_radians),
        ),
        gyro_bias_sigma: DVec3::from_array(bias_sigma.map(f64::to_radians)),
    })
}

/// Own gun and ship in the picture: polygons that hide the sea, and phantoms.
fn own_ship(text: TomlText<'_>, raw: &RawCalibration) -> Result<(Vec<Vec<DVec2>>, Vec<Phantom>), TomlError> {
    let Some(own_ship) = &raw.own_ship else { return Ok(Default::default()) };
    let [width, height] = text.needed(&raw.lens.size_px, picture_size())?;
    let size = (width, height);
    let all = own_ship.hidden_px.iter().chain(own_ship.phantom.iter().map(|phantom| &phantom.outline_px));
    if let Some(beyond) = all.clone().nth(POLYGONS_MOST) {
        return Err(text.error(beyond, format!("is one polygon too many: give {POLYGONS_MOST} at most")));
    }
    let polygon = |raw: &RequiredKey<Vec<[f64; 2]>>| polygon(text, raw, size);
    let hidden = own_ship.hidden_px.iter().map(polygon).collect::<Result<Vec<_>, _>>()?;
    let phantom = |raw: &RawPhantom| {
        let outline = polygon(&raw.outline_px)?;
        Ok(Phantom::new(raw.name.as_str(), outline, size).recoiling(raw.recoils))
    };
    let phantoms = own_ship.phantom.iter().map(phantom).collect::<Result<Vec<_>, TomlError>>()?;
    let seen = OwnShip::new(phantoms, DVec2::ZERO, &hidden, size);
    if let (Some(first), Some(share)) = (all.clone().next(), seen.mask.map(|mask| mask.share()))
        && share > SHARE_MOST
    {
        let problem = format!("hides {:.0} % of the picture: too little is left to see", share * 100.0);
        return Err(text.error(first, problem));
    }
    Ok((hidden, seen.phantoms.parts.to_vec()))
}

/// A polygon with an area, its corners in a picture of `size` pixels.
fn polygon(
    text: TomlText<'_>,
    raw: &RequiredKey<Vec<[f64; 2]>>,
    (width, height): (u32, u32),
) -> Result<Vec<DVec2>, TomlError> {
    let Loose::Fits(corners) = raw.get_ref() else {
        return Err(text.refuse(raw, "a list of corners in pixels: [[0, 640], [420, 560], [430, 720]]"));
    };
    if !(3..=CORNERS_MOST).contains(&corners.len()) {
        let problem = format!("is a polygon of {} corners: give 3 to {CORNERS_MOST}", corners.len());
        return Err(text.error(raw, problem));
    }
    let size = DVec2::new(f64::from(width), f64::from(height));
    let outside = |[x, y]: &&[f64; 2]| !((0.0..=size.x).contains(x) && (0.0..=size.y).contains(y));
    if let Some([x, y]) = corners.iter().find(outside) {
        let problem = format!("has the corner [{x}, {y}], which is not in a picture of {width}x{height}");
        return Err(text.error(raw, problem));
    }
    let corners: Vec<_> = corners.iter().map(|c| DVec2::from_array(*c)).collect();
    if Mask::of_polygons(std::slice::from_ref(&corners), (width, height)).is_none() {
        return Err(text.error(raw, "hides nothing: it has no area"));
    }
    Ok(corners)
}

fn rotation(text: TomlText<'_>, raw: &RequiredKey<Vec<f64>>) -> Result<DQuat, TomlError> {
    let [w, x, y, z] = text.needed(raw, each_up_to(1.0 + NORM_TOLERANCE, ""))?;
    let q = DQuat::from_xyzw(x, y, z, w);
    let excess = (q.length() - 1.0).abs();
    if excess > NORM_TOLERANCE {
        let problem = format!("has length {:.6}, but a rotation's quaternion has length 1", q.length());
        return Err(text.error(raw, problem));
    }
    // Numbers written with full precision stay as they are to the last bit.
    Ok(if excess <= NORM_EXACT { q } else { q.normalize() })
}

/// Width and height of pictures, pixels.
fn picture_size() -> ValueRule<'static, Vec<i64>, [u32; 2]> {
    list_of(whole(1..=8192))
}

fn lens(text: TomlText<'_>, raw: &RawLens) -> Result<Lens, TomlError> {
    let [width, height] = text.needed(&raw.size_px, picture_size())?;
    let centre = DVec2::from(text.needed(&raw.centre_px, each_up_to::<2>(16_384.0, "pixels"))?);
    let size = DVec2::new(f64::from(width), f64::from(height));
    if centre.cmplt(DVec2::ZERO).any() || centre.cmpgt(size).any() {
        let problem = format!("is outside the picture of {width} x {height} pixels");
        return Err(text.error(&raw.centre_px, problem));
    }
    let lens = Lens {
        width,
        height,
        focal: text.needed(&raw.focal_px, list_of::<2, _, _>(positive(1e6, "pixels")))?.into(),
        centre,
        distortion: distortion(text, raw)?,
        row_turn: DVec3::ZERO,
    };
    if let Some(corner) = unseen_corner(&lens) {
        let problem = format!(
            "makes no picture of {width} x {height} pixels: no direction falls on the corner ({}, {}), the distortion \
             folds back or grows too fast before it",
            corner.x, corner.y
        );
        return Err(match raw.fisheye.as_ref().or(raw.radial.as_ref()) {
            Some(k) => text.error(k, problem),
            None => text.error(&raw.size_px, problem),
        });
    }
    Ok(lens)
}

fn distortion(text: TomlText<'_>, raw: &RawLens) -> Result<Distortion, TomlError> {
    match (&raw.fisheye, &raw.radial, &raw.tangential) {
        (Some(k), None, None) => Ok(Distortion::fisheye(text.needed(k, each_up_to(100.0, ""))?)),
        (None, Some(radial), Some(tangential)) => Ok(Distortion::radial_tangential(
            text.needed(radial, each_up_to::<2>(100.0, ""))?.into(),
            text.needed(tangential, each_up_to::<2>(10.0, ""))?.into(),
        )),
        (Some(k), ..) => Err(text.error(k, "stands beside radial or tangential; a lens is one or the other")),
        (None, ..) => Err(text.error(
            &raw.size_px,
            "stands in a lens without distortion; give radial and tangential, or fisheye",
        )),
    }
}

/// A corner of the picture that does not come back to itself through the lens: the distortion folds back inside the picture.
fn unseen_corner(lens: &Lens) -> Option<DVec2> {
    let (w, h) = (f64::from(lens.width), f64::from(lens.height));
    [DVec2::ZERO, DVec2::new(w, 0.0), DVec2::new(0.0, h), DVec2::new(w, h)]
        .into_iter()
        .find(|corner| !lens.project(lens.unproject(*corner)).is_some_and(|p| p.distance(*corner) < 0.01))
}
