//! A session that fuses rates and specific force levels itself by the horizon, and holds its heading by the sky, in the pictures of a made
//! recording.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod common;

use bowwave_core::{
    estimate::{SensorCounts, attitude::Source},
    event::{Event, Picture, PixelFormat},
    own_ship::Mask,
};
use common::Played;
use glam::{DVec2, DVec3};
use hw_sim::make::{GunMotion, Periodic, Recipe, make};

/// A gun that traverses by 17 degrees and back and looks a little down.
fn recipe() -> Recipe {
    Recipe {
        width: 480,
        height: 270,
        frame_rate_hz: 10.0,
        gun: GunMotion {
            traverse: Periodic::new(0.7, &[(2, 0.15, 0.3)]),
            elevation: Periodic::new(-0.05, &[(5, 0.02, 0.1)]),
        },
        trigger: Vec::new(),
        ..Recipe::default()
    }
}

/// How long it is played, and until when it settles, seconds.
const SECONDS: i64 = 60;
const SETTLED: i64 = 25;

/// Masks and settings of a session beside the recording.
#[derive(Default)]
struct SightObstacles {
    /// A rail of the own ship, rows from the top.
    rail: std::ops::Range<usize>,
    mask: Option<Mask>,
}

impl SightObstacles {
    /// Draws the rail.
    fn draw(&self, event: &mut Event) {
        let Event::Frame(frame) = event else { return };
        let (width, height) = (frame.picture.width(), frame.picture.height());
        let mut bytes = frame.picture.bytes().to_vec();
        bytes[self.rail.start * width as usize * 3..self.rail.end * width as usize * 3].fill(15);
        frame.picture = Picture::new(PixelFormat::Rgb, width, height, bytes.into()).unwrap();
    }
}

/// By what up and heading were wrong in the pictures after it has settled, degrees; the gyro has a bias of `drift` deg/s about the vertical
/// that the calibration does not know.
fn played(recipe: &Recipe, drift: f64, sight: &SightObstacles) -> (Vec<(f64, f64)>, SensorCounts) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("level.mcap");
    make(recipe, &path, &mut |_, _| {}).unwrap();
    let mut played = Played::open(&path, SECONDS);
    // The unit's z points down.
    played.calibration.gyro_bias += DVec3::Z * drift.to_radians();
    played.calibration.gyro_bias_sigma = DVec3::splat(0.1f64.to_radians());
    let scenario = format!("[mount]\neye_height_m = {:?}\n", recipe.eye_height_m);
    let mut session = played.session(&scenario, Source::Fused, sight.mask.clone());
    let mut errors = Vec::new();
    let change = |event: &mut Event| sight.draw(event);
    played.play(&mut session, change, |frame, session, tick, replay| {
        let view = session.tick(tick).view;
        if view.blind {
            return;
        }
        let truth = replay.truth_at(view.mid_exposure).unwrap().world_from_camera;
        if view.pose_known && frame > SETTLED * 10 {
            let off = view.scene.camera.world_from_camera * truth.inverse();
            let up = off * DVec3::Z;
            errors.push((up.truncate().length().to_degrees(), (2.0 * off.z.atan2(off.w)).to_degrees()));
        }
    });
    played.replay.stop().unwrap();
    (errors, session.sensor_counts())
}

#[test]
fn up_comes_from_the_horizon_in_the_picture() {
    let (errors, counts) = played(&recipe(), 0.0, &SightObstacles::default());
    let (count, horizons) = (errors.len() as f64, counts.horizons);
    let rms = (errors.iter().map(|e| e.0 * e.0).sum::<f64>() / count.max(1.0)).sqrt();
    let worst = errors.iter().map(|e| e.0).fold(0.0, f64::max);
    println!("up errs by {rms:.3} deg rms, {worst:.3} at worst, over {count} pictures; {horizons:?}");
    assert!(count > 300.0 && horizons.taken > 450 && horizons.refused < 20, "{count} pictures; {horizons:?}");
    assert!(rms < 0.08 && worst < 0.2, "{rms:.3} deg rms, {worst:.3} at worst");
}

#[test]
fn heading_is_held_by_the_sky_in_the_picture() {
    let (errors, counts) =
        played(&Recipe { duration_s: SECONDS as f64 + 1.0, ..recipe() }, 0.05, &SightObstacles::default());
    let headings = || errors.iter().map(|e| e.1);
    let (first, last) = (headings().next().unwrap(), headings().next_back().unwrap());
    let swing = headings().fold(f64::MIN, f64::max) - headings().fold(f64::MAX, f64::min);
    println!(
        "heading is off by {first:.3} deg, {last:.3} at the end, {swing:.3} between extremes; {:?}",
        counts.skyline
    );
    // The gyro alone would drift by 1.75 degrees.
    assert!(counts.skyline.taken > 400 && counts.skyline.refused < 40, "{:?}", counts.skyline);
    assert!((last - first).abs() < 0.4 && swing < 0.4, "{first:.3} to {last:.3}, {swing:.3}");
}

/// A dark rail just below the horizon, straight and sharper than it.
#[test]
fn a_rail_of_the_own_ship_is_no_horizon_where_it_is_hidden() {
    let rail = 118..130;
    let corner = |x: f64, y: usize| DVec2::new(x, y as f64);
    let (top, bottom) = (rail.start - 3, rail.end + 3);
    let polygon = vec![corner(0.0, top), corner(480.0, top), corner(480.0, bottom), corner(0.0, bottom)];
    let mask = Mask::of_polygons(&[polygon], (480, 270));
    let of = |mask| {
        let (errors, counts) = played(&recipe(), 0.0, &SightObstacles { rail: rail.clone(), mask });
        let square = errors.iter().map(|e| e.0 * e.0).sum::<f64>();
        ((square / errors.len() as f64).sqrt(), counts.horizons)
    };
    let ((seen, seen_counts), (hidden, hidden_counts)) = (of(None), of(mask));
    println!(
        "up errs by {seen:.3} deg rms with the rail in view, {seen_counts:?}; {hidden:.3} with it hidden, {hidden_counts:?}"
    );
    assert!(hidden < 0.2 && seen > 10.0 * hidden, "{seen:.3} in view, {hidden:.3} hidden");
}
