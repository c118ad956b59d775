//! Properties of a recording.

use std::{collections::BTreeMap, path::Path};

use bowwave_core::{
    geometry::{Distortion, Lens},
    time::Time,
};

use super::RecordError;

/// Name of the metadata record.
pub(crate) const METADATA: &str = "bowwave";
/// Names of the attachments.
pub(crate) const CALIBRATION: &str = "calibration.toml";
pub(crate) const SCENARIO: &str = "scenario.toml";
/// The newest format of the metadata record that is read, and the one that is written.
const FORMAT: u32 = 1;
/// Prefix of the keys in [`Properties::extra`].
const EXTRA: &str = "extra.";

/// Properties of a recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Properties {
    /// The calibration file of camera, inertial unit and mount.
    pub calibration_toml: String,
    /// The scenario that was played, where there was one.
    pub scenario_toml: Option<String>,
    /// Length after which the recording repeats without a seam, nanoseconds.
    pub loop_ns: Option<i64>,
    /// When the recording begins; not negative.
    pub start: Time,
    /// Its source, for people.
    pub source: String,
    /// Width and height of the pictures in pixels.
    pub picture: (u32, u32),
    /// The camera's numbers for viewers, written once to `/camera/info`.
    pub camera_info: Option<CameraInfo>,
    /// Anything else.
    pub extra: BTreeMap<String, String>,
}

/// The camera's numbers as ROS and OpenCV have them: the centre of the first pixel is (0, 0).
#[derive(Clone, Debug, PartialEq)]
pub struct CameraInfo {
    /// Picture width in pixels.
    pub width: u32,
    /// Picture height in pixels.
    pub height: u32,
    /// Camera matrix, row-major, pixels.
    pub k: [f64; 9],
    /// Distortion: k1, k2, p1, p2, k3 ("plumb_bob"), or a fisheye's k1 to k4 ("equidistant").
    pub d: Vec<f64>,
}

impl CameraInfo {
    /// The numbers of `lens`, whose pixels are counted from half a pixel further out.
    pub fn from_lens(lens: &Lens) -> Self {
        Self {
            width: lens.width,
            height: lens.height,
            k: [
                lens.focal.x,
                0.0,
                lens.centre.x - 0.5,
                0.0,
                lens.focal.y,
                lens.centre.y - 0.5,
                0.0,
                0.0,
                1.0,
            ],
            d: match lens.distortion {
                Distortion::None => vec![0.0; 5],
                Distortion::RadialTangential(d) => {
                    vec![d.radial().x, d.radial().y, d.tangential().x, d.tangential().y, 0.0]
                }
                Distortion::Fisheye(d) => d.k().to_vec(),
            },
        }
    }
}

impl Properties {
    pub(crate) fn to_metadata(&self) -> BTreeMap<String, String> {
        let mut map = BTreeMap::from([
            ("format".to_owned(), FORMAT.to_string()),
            ("version".to_owned(), env!("CARGO_PKG_VERSION").to_owned()),
            ("source".to_owned(), self.source.clone()),
            ("start_ns".to_owned(), self.start.ns().to_string()),
            ("width".to_owned(), self.picture.0.to_string()),
            ("height".to_owned(), self.picture.1.to_string()),
        ]);
        if let Some(loop_ns) = self.loop_ns {
            map.insert("loop_ns".to_owned(), loop_ns.to_string());
        }
        for (key, value) in &self.extra {
            map.insert(format!("{EXTRA}{key}"), value.clone());
        }
        map
    }

    /// The properties of a metadata record; attachments and camera are filled in afterwards.
    pub(crate) fn from_metadata(path: &Path, map: &BTreeMap<String, String>) -> Result<Self, RecordError> {
        let fault =
            |name: &str, what: String| RecordError::Property { path: path.into(), name: name.into(), what };
        let text = |name: &str| map.get(name).ok_or_else(|| fault(name, "is missing".to_owned()));
        let number = |name: &str| -> Result<i64, RecordError> {
            let text = text(name)?;
            text.parse().map_err(|_| fault(name, format!("{text:?} is no whole number")))
        };
        let side = |name: &str| -> Result<u32, RecordError> {
            let value = number(name)?;
            match u32::try_from(value) {
                Ok(side @ 1..=8192) => Ok(side),
                _ => Err(fault(name, format!("{value} is not within 1 to 8192 pixels"))),
            }
        };
        let found = u32::try_from(number("format")?).unwrap_or(u32::MAX);
        if found > FORMAT {
            return Err(RecordError::Newer { path: path.into(), found, supported: FORMAT });
        }
        let start = number("start_ns")?;
        if start < 0 {
            return Err(fault("start_ns", format!("{start} is before the clock's zero")));
        }
        let loop_ns = map.contains_key("loop_ns").then(|| number("loop_ns")).transpose()?;
        if let Some(length) = loop_ns.filter(|ns| *ns <= 0) {
            return Err(fault("loop_ns", format!("{length} is no length")));
        }
        Ok(Self {
            loop_ns,
            start: Time::from_ns(start),
            source: text("source")?.clone(),
            picture: (side("width")?, side("height")?),
            extra: map
                .iter()
                .filter_map(|(key, value)| Some((key.strip_prefix(EXTRA)?.to_owned(), value.clone())))
                .collect(),
            ..Self::default()
        })
    }
}
