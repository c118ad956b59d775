//! Made recordings: what is in the picture is where the truth says, everything loops, and a seed means one recording.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::{collections::BTreeMap, sync::LazyLock};

use bowwave_calibration::parse;
use bowwave_core::{
    estimate::{
        attitude::{Attitude, AttitudeSettings, Source},
        clock::ClockMap,
        pose::registration_error_px,
    },
    geometry::{Distortion, Lens, horizon_dip},
};
use bowwave_record::{Entry, RecordingReader};
use glam::{DVec2, DVec3};
use hw_sim::make::{
    DEVICE_LOOP_KEY, MakeError, Periodic, Recipe, START, Studio, calibration, imu_samples, make,
};

const WIDTH: u32 = 320;
const HEIGHT: u32 = 180;

/// The default recording in small and short: every motion and every wave still closes.
fn small() -> Recipe {
    let mut recipe = Recipe { width: WIDTH, height: HEIGHT, duration_s: 2.0, ..Recipe::default() };
    recipe.frame_rate_hz = 10.0;
    recipe.trigger.retain(|burst| burst.start_s + burst.length_s < 2.0);
    recipe.trigger.push(hw_sim::make::Burst { start_s: 0.5, length_s: 0.25 });
    recipe
}

/// Without noise, clouds and haze (which hides the last kilometres before the horizon), for measuring in the picture.
fn clean() -> Recipe {
    let mut recipe = small();
    (recipe.camera.read_noise, recipe.camera.shot_noise) = (0.0, 0.0);
    recipe.sky.cloud_cover = 0.0;
    recipe.visibility_m = 1e6;
    recipe
}

static CLEAN: LazyLock<Studio> = LazyLock::new(|| Studio::new(&clean()).unwrap());

fn luminance(rgb: &[u8], x: u32, y: u32) -> f64 {
    let i = ((y * WIDTH + x) * 3) as usize;
    0.3 * f64::from(rgb[i]) + 0.6 * f64::from(rgb[i + 1]) + 0.1 * f64::from(rgb[i + 2])
}

/// Row of the sea horizon in a column: half-way between the light some pixels above and below, near the steepest step.
fn horizon_row(rgb: &[u8], x: u32, near: f64) -> f64 {
    let first = (near as u32).saturating_sub(6).max(3);
    let steepest = (first..first + 12)
        .max_by(|a, b| {
            let step = |y: u32| luminance(rgb, x, y - 1) - luminance(rgb, x, y + 1);
            step(*a).total_cmp(&step(*b))
        })
        .unwrap();
    let (sky, sea) = (luminance(rgb, x, steepest - 3), luminance(rgb, x, steepest + 3));
    let middle = 0.5 * (sky + sea);
    assert!(sky - sea > 6.0, "no horizon in column {x}: {sky} over {sea}");
    let above = (steepest - 3..steepest + 3).find(|y| luminance(rgb, x, y + 1) < middle).unwrap();
    let (a, b) = (luminance(rgb, x, above), luminance(rgb, x, above + 1));
    f64::from(above) + 0.5 + (a - middle) / (a - b)
}

/// Where the horizon must cross the middle of column `x`.
fn predicted_row(lens: &Lens, world_from_camera: glam::DQuat, height: f64, x: u32) -> f64 {
    let dip = horizon_dip(height).sin();
    let below = |y: f64| {
        let ray = world_from_camera * lens.unproject(DVec2::new(f64::from(x) + 0.5, y));
        ray.z < -dip
    };
    let (mut up, mut down) = (0.0, f64::from(lens.height));
    assert!(!below(up) && below(down), "the horizon is not in column {x}");
    for _ in 0..50 {
        let middle = 0.5 * (up + down);
        if below(middle) { down = middle } else { up = middle }
    }
    up
}

#[test]
fn the_horizon_is_where_the_truth_says() {
    let lens = clean().lens();
    let (mut sum, mut worst, mut count) = (0.0, 0.0f64, 0.0);
    for frame in [0, 7, 13] {
        let (truth, rgb) = CLEAN.shoot_rgb(frame);
        for x in (5..WIDTH - 5).step_by(10) {
            let expected = predicted_row(&lens, truth.world_from_camera, truth.position.z, x);
            let off = horizon_row(&rgb, x, expected) - expected;
            sum += off;
            worst = worst.max(off.abs());
            count += 1.0;
        }
    }
    assert!(worst < 0.3, "worst {worst} px");
    assert!((sum / count).abs() < 0.15, "mean {} px", sum / count);
}

#[test]
fn the_horizon_bends_as_the_lens_does() {
    for (distortion, hfov) in [
        (Distortion::radial_tangential(DVec2::new(-0.2, 0.03), DVec2::ZERO), 1.2),
        (Distortion::fisheye([-0.03, 0.004, 0.0, 0.0]), 1.5),
    ] {
        let mut recipe = clean();
        (recipe.camera.distortion, recipe.camera.hfov) = (distortion, hfov);
        let (truth, rgb) = Studio::new(&recipe).unwrap().shoot_rgb(3);
        let row = |lens: &Lens, x| predicted_row(lens, truth.world_from_camera, truth.position.z, x);
        let (lens, straight) = (recipe.lens(), Lens { distortion: Distortion::None, ..recipe.lens() });
        let (mut worst, mut bent) = (0.0f64, 0.0f64);
        for x in (5..WIDTH - 5).step_by(10) {
            worst = worst.max((horizon_row(&rgb, x, row(&lens, x)) - row(&lens, x)).abs());
            bent = bent.max((row(&straight, x) - row(&lens, x)).abs());
        }
        assert!(worst < 0.35 && bent > 1.0, "{distortion:?}: off by {worst} px, bent by {bent} px");
    }
}

/// A gun that is elevated at 40 deg/s while its shutter takes 30 ms, on a ship with a list: the horizon runs over many rows.
#[test]
fn a_rolling_shutter_sees_each_row_at_its_own_time() {
    let mut recipe = clean();
    recipe.camera.readout_ns = 30_000_000;
    recipe.ship.roll = Periodic::new(0.3, &[]);
    recipe.gun.traverse = Periodic::default();
    recipe.gun.elevation = Periodic::new(-0.02, &[(1, 40f64.to_radians() / std::f64::consts::PI, 0.0)]);
    let (studio, motion) = (Studio::new(&recipe).unwrap(), recipe.motion());
    for frame in [0, 10] {
        let (truth, rgb) = studio.shoot_rgb(frame);
        let time = f64::from(frame) / recipe.frame_rate_hz + recipe.exposure_delay_s();
        let [from, to] = [-0.015, 0.015].map(|t| motion.at(time + t).pose.world_from_camera);
        let rolling = recipe.lens().read_while((from.inverse() * to).to_scaled_axis());
        let (mut worst, mut ignored) = (0.0f64, 0.0f64);
        for x in (5..WIDTH - 5).step_by(10) {
            let expected = predicted_row(&rolling, truth.world_from_camera, truth.position.z, x);
            worst = worst.max((horizon_row(&rgb, x, expected) - expected).abs());
            let global = predicted_row(&recipe.lens(), truth.world_from_camera, truth.position.z, x);
            ignored = ignored.max((global - expected).abs());
        }
        assert!(worst < 0.35 && ignored > 0.9, "frame {frame}: off by {worst} px, ignored {ignored} px");
    }
}

/// A session's view of the default's samples: clock mapped, orientation at each frame's exposure.
#[test]
fn the_default_registers_within_two_pixels() {
    let recipe = Recipe::default();
    let (lens, motion, calibration) = (recipe.lens(), recipe.motion(), calibration(&recipe).calibration);
    let mut samples = imu_samples(&recipe, START).into_iter().peekable();
    let mut clock = ClockMap::new();
    let settings = AttitudeSettings::new(Source::Auto, &calibration);
    let mut attitude = Attitude::new(settings, calibration.gyro_bias, calibration.camera_from_imu);
    let (mut sum, mut worst, mut count) = (0.0, 0.0f64, 0.0);
    for frame in 0..recipe.frames() {
        let stamp = START.plus_ns(recipe.frame_stamp_ns(frame));
        while let Some(s) = samples.next_if(|s| s.arrival <= stamp.plus_ns(recipe.camera.latency_ns[0])) {
            let time = clock.observe(s.device_time_ns, s.arrival);
            attitude.observe(time, &s);
        }
        let at = attitude.at(stamp.plus_ns(calibration.time_offset_ns)).unwrap();
        let used = attitude.camera(at.world_from_imu);
        let truth = motion.at(stamp.secs_since(START) + recipe.exposure_delay_s()).pose.world_from_camera;
        let error = registration_error_px(&lens, truth, used).unwrap();
        sum += error * error;
        worst = worst.max(error);
        count += 1.0;
    }
    let rms = (sum / count).sqrt();
    eprintln!("registration of the default: {rms:.2} px rms, {worst:.2} px worst");
    assert!(rms < 1.5 && worst < 4.0, "{rms} px rms, {worst} px worst");
    assert!(rms > 0.1, "the unit is perfect: {rms} px");
}

#[test]
fn the_picture_loops_and_moves() {
    let difference = |a: u32, b: u32| {
        let (a, b) = (CLEAN.shoot_rgb(a).1, CLEAN.shoot_rgb(b).1);
        let sum: u64 = a.iter().zip(&b).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
        sum as f64 / a.len() as f64
    };
    let seam = difference(0, CLEAN.frames());
    assert!(seam < 0.02, "frames 0 and {} differ by {seam} levels", CLEAN.frames());
    let step = difference(0, 1);
    assert!(step > 0.5, "nothing moves: {step} levels");
}

#[test]
fn clouds_move_as_the_camera_turns() {
    let mut recipe = clean();
    recipe.sky.cloud_cover = 0.6;
    let lens = recipe.lens();
    let studio = Studio::new(&recipe).unwrap();
    let (from, before) = studio.shoot_rgb(2);
    let (to, after) = studio.shoot_rgb(3);
    // What is seen in one frame is seen in the next where the turn puts it, and not where it was.
    let (mut followed, mut stayed, mut count) = (0.0, 0.0, 0);
    for y in (2..30).step_by(2) {
        for x in (10..WIDTH - 10).step_by(3) {
            let world =
                from.world_from_camera * lens.unproject(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5));
            let Some(place) = lens.project(to.world_from_camera.inverse() * world) else { continue };
            let (u, v) = (place.x.floor(), place.y.floor());
            if u < 0.0 || v < 0.0 || u >= f64::from(WIDTH) || v >= f64::from(HEIGHT) {
                continue;
            }
            let then = luminance(&before, x, y);
            followed += (luminance(&after, u as u32, v as u32) - then).abs();
            stayed += (luminance(&after, x, y) - then).abs();
            count += 1;
        }
    }
    assert!(count > 500);
    assert!(followed < 0.4 * stayed, "{followed} {stayed} over {count} places");
}

#[test]
fn a_recording_holds_what_the_recipe_says() {
    let recipe = small();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("made.mcap");
    let mut heard = Vec::new();
    let made = make(&recipe, &path, &mut |done, total| heard.push((done, total))).unwrap();
    assert_eq!((made.frames, made.imu_samples, made.trigger_edges), (20, 400, 2));
    assert_eq!((heard.first(), heard.last()), (Some(&(0, 20)), Some(&(20, 20))));

    let reader = RecordingReader::open(&path).unwrap();
    let properties = reader.properties();
    assert_eq!(properties.loop_ns, Some(2_000_000_000));
    assert_eq!(properties.picture, (WIDTH, HEIGHT));
    assert_eq!(properties.extra[DEVICE_LOOP_KEY], "2000070000");
    let calibration = parse(&properties.calibration_toml, "made.mcap").unwrap().calibration;
    assert!(calibration.camera_from_imu.angle_between(recipe.camera_from_imu()) < 1e-9);

    let motion = recipe.motion();
    let (mut truths, mut frames) = (BTreeMap::new(), 0);
    for entry in reader.entries().unwrap() {
        match entry.unwrap() {
            Entry::Truth(truth) => {
                truths.insert(truth.time, truth.pose);
            }
            Entry::Frame(frame) => {
                // The truth of a frame has its stamp and comes before it.
                let truth = truths[&frame.mid_exposure];
                let since_start = frame.mid_exposure.secs_since(properties.start);
                let exact = motion.at(since_start + recipe.exposure_delay_s()).pose;
                assert!(exact.world_from_camera.angle_between(truth.world_from_camera) < 1e-7);
                assert!((exact.position - truth.position).length() < 1e-9);
                let picture = image::load_from_memory(&frame.jpeg).unwrap();
                assert_eq!((picture.width(), picture.height()), (WIDTH, HEIGHT));
                frames += 1;
            }
            _ => {}
        }
    }
    assert_eq!(frames, 20);
    // What is there is not overwritten.
    assert!(matches!(make(&recipe, &path, &mut |_, _| {}), Err(MakeError::Record(_))));
}

#[test]
fn far_off_recipes_still_draw_a_sea_under_a_sky() {
    type Change = fn(&mut Recipe);
    let cases: [(&str, Change); 6] = [
        ("low eye in high waves", |r| {
            (r.eye_height_m, r.beaufort) = (3.0, bowwave_core::sea::BeaufortForce::new(6).unwrap());
        }),
        ("from a cliff", |r| r.eye_height_m = 200.0),
        ("telephoto", |r| r.camera.hfov = 0.05),
        ("wide with distortion", |r| {
            r.camera.hfov = 1.6;
            r.camera.distortion = Distortion::radial_tangential(DVec2::new(-0.1, 0.01), DVec2::ZERO);
        }),
        ("fisheye", |r| {
            (r.camera.hfov, r.camera.distortion) = (1.7, Distortion::fisheye([-0.02, 0.0, 0.0, 0.0]))
        }),
        ("calm, upright, low sun ahead", |r| {
            r.beaufort = bowwave_core::sea::BeaufortForce::new(0).unwrap();
            (r.swell, r.sky.sun_azimuth, r.sky.sun_elevation) = (None, 0.1, 0.05);
        }),
    ];
    for (name, change) in cases {
        let mut recipe = Recipe { width: 64, height: 48, ..clean() };
        change(&mut recipe);
        let studio = Studio::new(&recipe).unwrap();
        for frame in [0, 9] {
            let (truth, rgb) = studio.shoot_rgb(frame);
            let row_mean =
                |y: usize| rgb[y * 192..(y + 1) * 192].iter().map(|v| f64::from(*v)).sum::<f64>() / 192.0;
            let (top, bottom) = (row_mean(0), row_mean(47));
            let lens = recipe.lens();
            let top_ray = truth.world_from_camera * lens.unproject(DVec2::new(32.0, 0.5));
            if top_ray.z > 0.05 {
                assert!(top > bottom, "{name}, frame {frame}: sky {top}, sea {bottom}");
            }
            assert!((1.0..254.0).contains(&bottom), "{name}, frame {frame}: sea {bottom}");
        }
    }
}

#[test]
fn a_seed_means_one_recording() {
    let mut recipe = small();
    recipe.duration_s = 0.5;
    recipe.trigger.clear();
    let folder = tempfile::tempdir().unwrap();
    let file = |recipe: &Recipe, name: &str| {
        let path = folder.path().join(name);
        make(recipe, &path, &mut |_, _| {}).unwrap();
        std::fs::read(path).unwrap()
    };
    let first = file(&recipe, "first");
    assert!(first == file(&recipe, "second"), "the same seed gave two recordings");
    recipe.seed += 1;
    assert!(first != file(&recipe, "third"), "another seed gave the same recording");
}

#[test]
fn the_sun_glitters_below_itself() {
    let mut recipe = clean();
    recipe.sky.sun_azimuth = 0.0;
    recipe.sky.sun_elevation = 0.6;
    let studio = Studio::new(&recipe).unwrap();
    let (truth, rgb) = studio.shoot_rgb(0);
    let lens = recipe.lens();
    let brightness = |azimuth: f64| {
        let (mut sum, mut count) = (0.0, 0.0);
        for i in 0..20 {
            let down = 0.03 + 0.01 * f64::from(i);
            let ray = DVec3::new(azimuth.sin(), azimuth.cos(), -down);
            if let Some(p) = lens.project(truth.world_from_camera.inverse() * ray)
                && (0.0..f64::from(WIDTH)).contains(&p.x)
                && (0.0..f64::from(HEIGHT)).contains(&p.y)
            {
                sum += luminance(&rgb, p.x as u32, p.y as u32);
                count += 1.0;
            }
        }
        assert!(count > 5.0, "azimuth {azimuth} is not in view");
        sum / count
    };
    let forward = truth.world_from_camera * DVec3::Z;
    let off = if forward.x.atan2(forward.y) > 0.0 { 0.45 } else { -0.45 };
    assert!(brightness(0.0) > brightness(off) + 25.0, "{} {}", brightness(0.0), brightness(off));
}

#[test]
fn the_ships_own_heading_is_told_with_its_errors_and_late() {
    use hw_sim::make::{ShipFeedRecipe, ship_samples};
    let feed = ShipFeedRecipe { offset: 0.02, attitude: true, ..ShipFeedRecipe::default() };
    let recipe = Recipe { ship_feed: Some(feed), ..Recipe::default() };
    recipe.check().expect("a recipe");
    let (motion, start) = (recipe.motion(), bowwave_core::time::Time::from_ns(7));
    let samples = ship_samples(&recipe, start);
    assert_eq!(samples.len(), 200);
    let (mut sum, mut square) = (0.0, 0.0);
    for (n, sample) in samples.iter().enumerate() {
        let [heading, pitch, _] = motion.ship_at(n as f64 * 0.1);
        let off = (sample.heading.expect("told") - heading).rem_euclid(std::f64::consts::TAU);
        (sum, square) = (sum + off, square + (off - 0.02) * (off - 0.02));
        assert!((sample.pitch.expect("told") - pitch).abs() <= 0.05f64.to_radians() + 1e-12);
        let late = sample.arrival.ns_since(start) - n as i64 * 100_000_000;
        assert!((60_000_000..=75_000_000).contains(&late), "{late}");
    }
    // Noise of 0.05 deg and steps of 0.1 deg, whose error is even.
    let expected = 0.05f64.hypot(0.1 / 12f64.sqrt()).to_radians();
    assert!((sum / 200.0 - 0.02).abs() < 4.0 * expected / 200f64.sqrt(), "{}", sum / 200.0);
    assert!(((square / 200.0).sqrt() / expected - 1.0).abs() < 0.2, "{}", (square / 200.0).sqrt());
    assert!(ship_samples(&Recipe::default(), start).is_empty());
}
