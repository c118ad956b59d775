//! Arguments of `calibrate phantom`.

use std::path::PathBuf;

use bowwave_calibration::plane::{PlaneFrame, SeenPoint};
use clap::Args;
use glam::{DVec2, DVec3};

use super::{
    CONFIG,
    mounting::{CalibrationFiles, parse_mark},
};

/// Arguments of `calibrate phantom`.
#[derive(Debug, Args)]
pub struct CalibratePhantom {
    /// Recording (MCAP) in which the gun turns and tilts at the sea without firing, so that sea passes behind all of it; or, to trace on it by
    /// hand, a picture (PNG, JPEG) as the camera took it
    #[arg(group = "seen", required_unless_present_any = ["outline", "model", "live"])]
    pub recording: Option<PathBuf>,
    /// Take the camera's pictures as they come instead of a recording: the gun turns and tilts at the sea meanwhile, or is traced by hand on their
    /// mean (--trace); the trainer must not run meanwhile
    #[arg(long, group = "seen", conflicts_with_all = ["outline", "model"])]
    pub live: bool,
    /// Configuration (TOML) that names camera and calibration, with --live
    #[arg(long, value_name = "FILE", default_value = CONFIG, requires = "live", conflicts_with_all = ["recording", "outline", "model"])]
    pub config: PathBuf,
    /// Seconds of pictures to take with --live; without it 30, or 3 to trace
    #[arg(long, value_name = "SECONDS", requires = "live", value_parser = clap::value_parser!(u32).range(1..=600))]
    pub seconds: Option<u32>,
    /// Trace a part by hand instead: its corners in pixels in order, once for each part; parts that touch must overlap
    #[arg(long, value_name = "[NAME=]X,Y X,Y X,Y...", value_parser = parse_outline, conflicts_with_all = ["trace", "model"])]
    pub outline: Vec<TracedOutline>,
    /// Trace by hand in a window, with mouse or keys, on a recording, a picture or the camera (--live); it shows what the pictures tell and what the
    /// calibration has
    #[arg(long, conflicts_with = "model", requires = "seen")]
    pub trace: bool,
    /// Take the outlines from a model of the gun instead (glTF 2.0, .glb or .gltf): triangles in metres, x left, y up, z along the bore; each named
    /// node is a part
    #[arg(long, value_name = "FILE")]
    pub model: Option<PathBuf>,
    /// The camera's place in the model, metres: left, up, forward; without it the model's origin is the muzzle of the calibration's boresight
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_place, allow_hyphen_values = true)]
    pub camera_at: Option<PlaceInGun>,
    /// How far the camera is rolled about the bore, degrees clockwise as seen from behind it
    #[arg(long, value_name = "DEG", value_parser = parse_roll, allow_hyphen_values = true, default_value_t = 0.0)]
    pub camera_roll: f64,
    /// The outlines lie in this plane of the gun: four or more of its points, each in the picture (pixels) and in the plane (metres); writes
    /// them as a model (--glb) and leaves the calibration as it is
    #[arg(long, value_name = "X,Y=X,Y X,Y=X,Y...", value_parser = parse_plane, requires_all = ["outline", "glb"])]
    pub plane: Option<PlanePoints>,
    /// Origin and axes of the plane in the gun's frame, metres; without them the points tell how it lies before the camera
    #[arg(long, value_name = "X,Y,Z X,Y,Z X,Y,Z", value_parser = parse_axes, requires = "plane", allow_hyphen_values = true)]
    pub plane_axes: Option<PlaneFrame>,
    /// Model of the traced outlines to write (binary glTF, .glb), in the gun's frame: --model takes it
    #[arg(long, value_name = "FILE", requires = "plane")]
    pub glb: Option<PathBuf>,
    /// The parts slide back along the bore with each round, as a machine gun's barrel does; for one part of several write
    /// `recoils` in the file
    #[arg(long, conflicts_with = "trace")]
    pub recoils: bool,
    /// Also write the recording's mean picture, or the picture, with the outlines on it (PNG)
    #[arg(long, value_name = "FILE")]
    pub picture: Option<PathBuf>,
    #[command(flatten)]
    pub files: CalibrationFiles,
    /// Print the result as JSON
    #[arg(long)]
    pub json: bool,
}

/// A part of the gun that was traced by hand.
#[derive(Clone, Debug, PartialEq)]
pub struct TracedOutline {
    /// Its name; may be empty.
    pub name: String,
    /// Its corners, pixels.
    pub corners: Vec<DVec2>,
}

/// A place in the gun's frame, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaceInGun(pub DVec3);

/// Points of a plane, in the picture and in the plane.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanePoints(pub Vec<SeenPoint>);

fn parse_outline(text: &str) -> Result<TracedOutline, String> {
    let (name, corners) = text.split_once('=').unwrap_or(("", text));
    let corners: Vec<_> = corners.split_whitespace().map(parse_mark).collect::<Result<_, _>>()?;
    if corners.len() < 3 {
        return Err(format!(
            "'{text}' has {} corners: an outline has three or more, as 'barrel=600,560 680,560 760,720'",
            corners.len()
        ));
    }
    Ok(TracedOutline {
        name: name.trim().to_owned(),
        corners: corners.into_iter().map(|mark| mark.0).collect(),
    })
}

/// Numbers with commas between them, metres, none beyond 100 m.
fn metres<const N: usize>(text: &str) -> Option<[f64; N]> {
    let numbers: Vec<f64> = text.split(',').map(|n| n.trim().parse().ok()).collect::<Option<_>>()?;
    let numbers: [f64; N] = numbers.try_into().ok()?;
    numbers.iter().all(|n| (-100.0..=100.0).contains(n)).then_some(numbers)
}

fn parse_place(text: &str) -> Result<PlaceInGun, String> {
    let place = metres::<3>(text).map(|p| PlaceInGun(p.into()));
    place.ok_or_else(|| {
        format!("'{text}' is no place: write X,Y,Z in metres, none beyond 100, as 0,0.12,-0.9")
    })
}

fn parse_roll(text: &str) -> Result<f64, String> {
    let degrees = text.parse::<f64>().ok().filter(|v| (-180.0..=180.0).contains(v));
    degrees.ok_or_else(|| format!("'{text}' is no roll: give degrees, -180 to 180"))
}

fn parse_plane(text: &str) -> Result<PlanePoints, String> {
    let point = |pair: &str| {
        let (pixel, plane) = pair.split_once('=')?;
        Some(SeenPoint { pixel: parse_mark(pixel).ok()?.0, plane: metres::<2>(plane)?.into() })
    };
    let point = |pair: &str| {
        let said = || {
            format!("'{pair}' is no point of a plane: write x,y=X,Y in pixels and metres, as 600,560=0,0.25")
        };
        point(pair).ok_or_else(said)
    };
    text.split_whitespace().map(point).collect::<Result<_, _>>().map(PlanePoints)
}

fn parse_axes(text: &str) -> Result<PlaneFrame, String> {
    let said = || {
        format!(
            "'{text}' is no plane: write its origin and two directions in it, each X,Y,Z in the gun's frame (left, up, forward), as '0,0.2,0.4 \
             -1,0,0 0,1,0'"
        )
    };
    let three = text.split_whitespace().map(|t| metres::<3>(t).map(DVec3::from)).collect::<Option<Vec<_>>>();
    let Some(&[origin, right, up]) = three.as_deref() else { return Err(said()) };
    PlaneFrame::new(origin, right, up)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_and_places_are_read_or_refused_with_an_example() {
        let PlanePoints(points) = parse_plane("1,2=0,0.5 3.5,4=-1,0").expect("two points");
        assert_eq!(points[1], SeenPoint { pixel: DVec2::new(3.5, 4.0), plane: DVec2::new(-1.0, 0.0) });
        for bad in ["1,2", "1,2=3", "1,2=0,500", "-1,2=0,0", "1,2=nan,0"] {
            assert!(parse_plane(bad).expect_err(bad).contains("600,560=0,0.25"), "{bad}");
        }
        assert_eq!(parse_place("0, 0.1,-0.9").expect("a place").0, DVec3::new(0.0, 0.1, -0.9));
        assert!(parse_place("0,1").is_err() && parse_place("0,1,inf").is_err());
        assert!(parse_axes("0,0,1 1,0,0 0,1,0").is_ok());
        assert!(parse_axes("0,0,1 1,0,0 1,1,0").expect_err("askew").contains("45 degrees"));
        assert!(parse_axes("0,0,1 1,0,0").expect_err("two").contains("two directions"));
    }
}
