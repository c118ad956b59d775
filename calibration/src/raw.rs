//! From TOML text to checked numbers.

use bowwave_core::{
    calibration::{Calibration, TriggerLatency},
    estimate::horizon::Mask,
    geometry::{Distortion, Lens},
    text::{line_column, one_line},
};
use glam::{DQuat, DVec2, DVec3};
use serde::Deserialize;
use toml::{Spanned, value::Datetime};

use crate::{CalibrationError, CalibrationFile, Date, Provenance};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFile {
    made: Spanned<Datetime>,
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
    trigger: Option<RawTrigger>,
    gyro_bias: RawGyroBias,
    own_ship: Option<RawOwnShip>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawLens {
    size_px: Spanned<[u32; 2]>,
    focal_px: Spanned<[f64; 2]>,
    focal_sigma_px: Spanned<f64>,
    centre_px: Spanned<[f64; 2]>,
    radial: Option<Spanned<[f64; 2]>>,
    tangential: Option<Spanned<[f64; 2]>>,
    fisheye: Option<Spanned<[f64; 4]>>,
    measured: Spanned<Datetime>,
    #[serde(default)]
    how: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawRotation {
    rotation_wxyz: Spanned<[f64; 4]>,
    sigma_mrad: Spanned<[f64; 3]>,
    measured: Spanned<Datetime>,
    #[serde(default)]
    how: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawTimeOffset {
    offset_ms: Spanned<f64>,
    sigma_ms: Spanned<f64>,
    measured: Spanned<Datetime>,
    #[serde(default)]
    how: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawShutter {
    readout_ms: Spanned<f64>,
    sigma_ms: Spanned<f64>,
    measured: Spanned<Datetime>,
    #[serde(default)]
    how: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawBoresight {
    right_deg: Spanned<f64>,
    down_deg: Spanned<f64>,
    sigma_mrad: Spanned<f64>,
    muzzle_m: Spanned<[f64; 3]>,
    measured: Spanned<Datetime>,
    #[serde(default)]
    how: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawTrigger {
    latency_ms: Spanned<f64>,
    sigma_ms: Spanned<f64>,
    measured: Spanned<Datetime>,
    #[serde(default)]
    how: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawGyroBias {
    bias_deg_per_s: Spanned<[f64; 3]>,
    sigma_deg_per_s: Spanned<[f64; 3]>,
    measured: Spanned<Datetime>,
    #[serde(default)]
    how: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawOwnShip {
    hidden_px: Vec<Spanned<Vec<[f64; 2]>>>,
}

/// Reads a calibration; `origin` (a file name, usually) stands at the head of error messages.
pub fn parse(text: &str, origin: &str) -> Result<CalibrationFile, CalibrationError> {
    let at = Place { text, origin };
    let raw: RawFile = toml::from_str(text).map_err(|e| at.syntax(&e))?;
    Ok(CalibrationFile {
        made: at.date("made", &raw.made)?,
        lens: at.provenance("lens.measured", &raw.lens.measured, &raw.lens.how)?,
        camera_from_imu: at.provenance(
            "camera_from_imu.measured",
            &raw.camera_from_imu.measured,
            &raw.camera_from_imu.how,
        )?,
        time_offset: at.provenance(
            "time_offset.measured",
            &raw.time_offset.measured,
            &raw.time_offset.how,
        )?,
        shutter: raw
            .shutter
            .as_ref()
            .map(|shutter| at.provenance("shutter.measured", &shutter.measured, &shutter.how))
            .transpose()?,
        boresight: at.provenance("boresight.measured", &raw.boresight.measured, &raw.boresight.how)?,
        trigger: raw
            .trigger
            .as_ref()
            .map(|trigger| at.provenance("trigger.measured", &trigger.measured, &trigger.how))
            .transpose()?,
        gyro_bias: at.provenance("gyro_bias.measured", &raw.gyro_bias.measured, &raw.gyro_bias.how)?,
        calibration: at.calibration(&raw)?,
        own_ship: at.own_ship(&raw)?,
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
pub(crate) fn ns_from_ms(ms: f64) -> i64 {
    (ms * 1e6).round() as i64
}

/// How far a quaternion's length may be off before it is taken for a typing error, and from where it is left as it stands.
const NORM_TOLERANCE: f64 = 1e-3;
const NORM_EXACT: f64 = 1e-14;

/// Polygons of the own ship, corners of one, and the share of the picture that they may hide.
const POLYGONS_MOST: usize = 32;
const CORNERS_MOST: usize = 64;
const SHARE_MOST: f64 = 0.8;

/// No camera of 10 pictures a second or more takes longer to read one.
const READOUT_MS_MAX: f64 = 100.0;

struct Place<'a> {
    text: &'a str,
    origin: &'a str,
}

impl Place<'_> {
    fn syntax(&self, e: &toml::de::Error) -> CalibrationError {
        let (line, column) = line_column(self.text, e.span().map_or(0, |s| s.start));
        let message = one_line(e.message());
        CalibrationError::Syntax { origin: self.origin.to_owned(), line, column, message }
    }

    fn refuse<T>(&self, key: &'static str, at: &Spanned<T>, problem: impl Into<String>) -> CalibrationError {
        let (line, column) = line_column(self.text, at.span().start);
        CalibrationError::Value {
            origin: self.origin.to_owned(),
            line,
            column,
            key,
            problem: one_line(&problem.into()),
        }
    }

    fn date(&self, key: &'static str, raw: &Spanned<Datetime>) -> Result<Date, CalibrationError> {
        let value = raw.get_ref();
        if value.time.is_some() || value.offset.is_some() {
            return Err(self.refuse(key, raw, format!("is {value}, but must be a date without a time")));
        }
        value
            .date
            .and_then(|d| Date::new(d.year, d.month, d.day))
            .ok_or_else(|| self.refuse(key, raw, format!("is {value}, but must be a day of the calendar")))
    }

    fn provenance(
        &self,
        key: &'static str,
        measured: &Spanned<Datetime>,
        how: &str,
    ) -> Result<Provenance, CalibrationError> {
        Ok(Provenance::new(self.date(key, measured)?, how))
    }

    /// Every number within `low..=high`, which no NaN is.
    fn within<const N: usize>(
        &self,
        key: &'static str,
        raw: &Spanned<[f64; N]>,
        low: f64,
        high: f64,
    ) -> Result<[f64; N], CalibrationError> {
        let values = *raw.get_ref();
        match values.iter().find(|v| !(low..=high).contains(*v)) {
            Some(v) => Err(self.refuse(key, raw, format!("has {v}, but must lie within {low} and {high}"))),
            None => Ok(values),
        }
    }

    fn one_within(
        &self,
        key: &'static str,
        raw: &Spanned<f64>,
        low: f64,
        high: f64,
    ) -> Result<f64, CalibrationError> {
        let value = *raw.get_ref();
        if (low..=high).contains(&value) {
            Ok(value)
        } else {
            Err(self.refuse(key, raw, format!("is {value}, but must lie within {low} and {high}")))
        }
    }

    /// Standard deviations: above zero and at most `high`.
    fn sigma<const N: usize>(
        &self,
        key: &'static str,
        raw: &Spanned<[f64; N]>,
        high: f64,
    ) -> Result<[f64; N], CalibrationError> {
        let values = *raw.get_ref();
        match values.iter().find(|v| !(**v > 0.0 && **v <= high)) {
            Some(v) => Err(self.refuse(key, raw, format!("has {v}, but must be above 0 and at most {high}"))),
            None => Ok(values),
        }
    }

    fn one_sigma(&self, key: &'static str, raw: &Spanned<f64>, high: f64) -> Result<f64, CalibrationError> {
        let value = *raw.get_ref();
        if value > 0.0 && value <= high {
            Ok(value)
        } else {
            Err(self.refuse(key, raw, format!("is {value}, but must be above 0 and at most {high}")))
        }
    }

    /// The same in milliseconds, to nanoseconds.
    fn sigma_ns(&self, key: &'static str, raw: &Spanned<f64>, high_ms: f64) -> Result<i64, CalibrationError> {
        let ns = ns_from_ms(self.one_sigma(key, raw, high_ms)?);
        if ns < 1 {
            return Err(self.refuse(key, raw, "is below a nanosecond, the resolution of all times"));
        }
        Ok(ns)
    }

    fn calibration(&self, raw: &RawFile) -> Result<Calibration, CalibrationError> {
        let offset_ms =
            self.one_within("time_offset.offset_ms", &raw.time_offset.offset_ms, -10_000.0, 10_000.0)?;
        let time_offset_sigma_ns =
            self.sigma_ns("time_offset.sigma_ms", &raw.time_offset.sigma_ms, 10_000.0)?;
        let (readout_ns, readout_sigma_ns) = self.shutter(raw.shutter.as_ref())?;
        let right = self.one_within("boresight.right_deg", &raw.boresight.right_deg, -80.0, 80.0)?;
        let down = self.one_within("boresight.down_deg", &raw.boresight.down_deg, -80.0, 80.0)?;
        let bias = self.within("gyro_bias.bias_deg_per_s", &raw.gyro_bias.bias_deg_per_s, -100.0, 100.0)?;
        let bias_sigma = self.sigma("gyro_bias.sigma_deg_per_s", &raw.gyro_bias.sigma_deg_per_s, 100.0)?;
        let rotation_sigma =
            self.sigma("camera_from_imu.sigma_mrad", &raw.camera_from_imu.sigma_mrad, 4000.0)?;
        let boresight_sigma = self.one_sigma("boresight.sigma_mrad", &raw.boresight.sigma_mrad, 4000.0)?;
        Ok(Calibration {
            lens: self.lens(&raw.lens)?,
            focal_sigma_px: self.one_sigma("lens.focal_sigma_px", &raw.lens.focal_sigma_px, 1e5)?,
            camera_from_imu: self.rotation(&raw.camera_from_imu.rotation_wxyz)?,
            camera_from_imu_sigma: DVec3::from_array(rotation_sigma.map(radians_from_mrad)),
            time_offset_ns: ns_from_ms(offset_ms),
            time_offset_sigma_ns,
            readout_ns,
            readout_sigma_ns,
            boresight: DVec2::new(right.to_radians(), down.to_radians()),
            boresight_sigma: radians_from_mrad(boresight_sigma),
            muzzle_in_camera: DVec3::from_array(self.within(
                "boresight.muzzle_m",
                &raw.boresight.muzzle_m,
                -100.0,
                100.0,
            )?),
            trigger: raw.trigger.as_ref().map(|t| self.trigger(t)).transpose()?,
            gyro_bias: DVec3::from_array(bias.map(f64::to_radians)),
            gyro_bias_sigma: DVec3::from_array(bias_sigma.map(f64::to_radians)),
        })
    }

    /// Polygons of the own ship in the picture, in pixels.
    fn own_ship(&self, raw: &RawFile) -> Result<Vec<Vec<DVec2>>, CalibrationError> {
        const KEY: &str = "own_ship.hidden_px";
        let Some(own_ship) = &raw.own_ship else { return Ok(Vec::new()) };
        let [width, height] = raw.lens.size_px.get_ref().map(f64::from);
        let mut polygons = Vec::new();
        for polygon in &own_ship.hidden_px {
            let corners = polygon.get_ref();
            if !(3..=CORNERS_MOST).contains(&corners.len()) || polygons.len() >= POLYGONS_MOST {
                let problem = format!(
                    "has a polygon of {} corners: give 3 to {CORNERS_MOST} for each, and {POLYGONS_MOST} polygons at most",
                    corners.len()
                );
                return Err(self.refuse(KEY, polygon, problem));
            }
            let outside = |c: &&[f64; 2]| !((0.0..=width).contains(&c[0]) && (0.0..=height).contains(&c[1]));
            if let Some([x, y]) = corners.iter().find(outside) {
                let problem =
                    format!("has the corner [{x}, {y}], which is not in a picture of {width}x{height}");
                return Err(self.refuse(KEY, polygon, problem));
            }
            polygons.push(corners.iter().map(|c| DVec2::from_array(*c)).collect());
        }
        let mask = Mask::of_polygons(&polygons, (width as u32, height as u32));
        match (own_ship.hidden_px.first(), mask.map(|mask| mask.share())) {
            (Some(first), Some(share)) if share > SHARE_MOST => {
                let problem =
                    format!("hides {:.0} % of the picture: too little is left to see", share * 100.0);
                Err(self.refuse(KEY, first, problem))
            }
            (Some(first), None) => Err(self.refuse(KEY, first, "hides nothing: its polygons have no area")),
            _ => Ok(polygons),
        }
    }

    /// Readout time and its deviation, nanoseconds; without the section all rows are exposed at once.
    fn shutter(&self, raw: Option<&RawShutter>) -> Result<(i64, i64), CalibrationError> {
        let Some(raw) = raw else { return Ok((0, 0)) };
        let readout =
            self.one_within("shutter.readout_ms", &raw.readout_ms, -READOUT_MS_MAX, READOUT_MS_MAX)?;
        Ok((ns_from_ms(readout), self.sigma_ns("shutter.sigma_ms", &raw.sigma_ms, READOUT_MS_MAX)?))
    }

    fn trigger(&self, raw: &RawTrigger) -> Result<TriggerLatency, CalibrationError> {
        let latency = self.one_within("trigger.latency_ms", &raw.latency_ms, -1000.0, 1000.0)?;
        let sigma_ns = self.sigma_ns("trigger.sigma_ms", &raw.sigma_ms, 1000.0)?;
        Ok(TriggerLatency { latency_ns: ns_from_ms(latency), sigma_ns })
    }

    fn rotation(&self, raw: &Spanned<[f64; 4]>) -> Result<DQuat, CalibrationError> {
        let key = "camera_from_imu.rotation_wxyz";
        let [w, x, y, z] = self.within(key, raw, -1.0 - NORM_TOLERANCE, 1.0 + NORM_TOLERANCE)?;
        let q = DQuat::from_xyzw(x, y, z, w);
        let excess = (q.length() - 1.0).abs();
        if excess > NORM_TOLERANCE {
            let problem = format!("has length {:.6}, but a rotation's quaternion has length 1", q.length());
            return Err(self.refuse(key, raw, problem));
        }
        // Numbers written with full precision stay as they are to the last bit.
        Ok(if excess <= NORM_EXACT { q } else { q.normalize() })
    }

    fn lens(&self, raw: &RawLens) -> Result<Lens, CalibrationError> {
        let [width, height] = *raw.size_px.get_ref();
        if !(1..=8192).contains(&width) || !(1..=8192).contains(&height) {
            let problem = format!("is {width} x {height}, but both must be 1 to 8192");
            return Err(self.refuse("lens.size_px", &raw.size_px, problem));
        }
        let (w, h) = (f64::from(width), f64::from(height));
        let centre = DVec2::from_array(self.within("lens.centre_px", &raw.centre_px, -8192.0, 16_384.0)?);
        if !(0.0..=w).contains(&centre.x) || !(0.0..=h).contains(&centre.y) {
            let problem = format!("is outside the picture of {width} x {height} pixels");
            return Err(self.refuse("lens.centre_px", &raw.centre_px, problem));
        }
        let lens = Lens {
            width,
            height,
            focal: DVec2::from_array(self.sigma("lens.focal_px", &raw.focal_px, 1e6)?),
            centre,
            distortion: self.distortion(raw)?,
            row_turn: DVec3::ZERO,
        };
        if let Some(corner) = unseen_corner(&lens) {
            let problem = format!(
                "makes no picture of {width} x {height} pixels: no direction falls on the corner ({}, {}), the distortion \
                 folds back or grows too fast before it",
                corner.x, corner.y
            );
            return Err(match (&raw.fisheye, &raw.radial) {
                (Some(k), _) => self.refuse("lens.fisheye", k, problem),
                (None, Some(k)) => self.refuse("lens.radial", k, problem),
                (None, None) => self.refuse("lens.size_px", &raw.size_px, problem),
            });
        }
        Ok(lens)
    }

    fn distortion(&self, raw: &RawLens) -> Result<Distortion, CalibrationError> {
        match (&raw.fisheye, &raw.radial, &raw.tangential) {
            (Some(k), None, None) => {
                Ok(Distortion::fisheye(self.within("lens.fisheye", k, -100.0, 100.0)?))
            }
            (None, Some(radial), Some(tangential)) => Ok(Distortion::radial_tangential(
                DVec2::from_array(self.within("lens.radial", radial, -100.0, 100.0)?),
                DVec2::from_array(self.within("lens.tangential", tangential, -10.0, 10.0)?),
            )),
            (Some(k), ..) => Err(self.refuse(
                "lens.fisheye",
                k,
                "stands beside radial or tangential; a lens is one or the other",
            )),
            (None, ..) => Err(self.refuse(
                "lens.size_px",
                &raw.size_px,
                "stands in a lens without distortion; give radial and tangential, or fisheye",
            )),
        }
    }
}

/// A corner of the picture that does not come back to itself through the lens: the distortion folds back inside the picture.
fn unseen_corner(lens: &Lens) -> Option<DVec2> {
    let (w, h) = (f64::from(lens.width), f64::from(lens.height));
    [DVec2::ZERO, DVec2::new(w, 0.0), DVec2::new(0.0, h), DVec2::new(w, h)]
        .into_iter()
        .find(|corner| !lens.project(lens.unproject(*corner)).is_some_and(|p| p.distance(*corner) < 0.01))
}
