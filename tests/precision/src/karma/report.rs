//! The camera of the clip as its film and gyro tell it, and how well an overlay would hold.

use std::collections::BTreeMap;

use anyhow::{Context as _, Result, ensure};
use bowwave_calibration::alignment::{self, ImuReading, Observation, Options};
use bowwave_core::{
    estimate::{
        HeadingSettings,
        skyline::{SkyView, Skyline},
    },
    geometry::{Lens, look},
    time::Time,
};
use bowwave_import::START;
use glam::{DMat3, DQuat, DVec2, DVec3};

use super::{
    clip::{CloudTrack, KarmaClip},
    fit::{FOCAL, KarmaFit, KarmaMeasured, KarmaUnknowns, OFFSET, RADIAL, READOUT},
};
use crate::horizon::frames::decoded;

/// The gyro's first samples lie as late as the clocks are apart, seconds.
const BEGIN_S: f64 = 0.1;
/// An offset that is known no better than this is of no use, milliseconds: a third of a picture's time.
const USABLE_MS: f64 = 10.0;
/// When the camera begins to swing, seconds after the first picture.
const SWING_S: f64 = 11.5;
/// Clouds for the swing are chosen this long before it, so that as many as possible stay in view.
const BEFORE_S: f64 = 0.5;
/// Width that errors are told for, pixels.
const WIDTH: f64 = 1280.0;
/// Targets, pixels rms: before and in the swing.
const TARGETS: [f64; 2] = [2.0, 4.0];
/// Pictures between those of the long tracks that are fitted: neighbours say the same.
const STRIDE: usize = 4;

/// Calibrates a camera from its own film and gyro. Has no settings.
#[derive(Debug, clap::Args)]
pub struct KarmaStudy {}

impl KarmaStudy {
    /// Prints all of it; an error where a target is missed. Nothing where the clip is absent.
    pub fn run(&self) -> Result<()> {
        let Some(clip) = KarmaClip::load()? else { return Ok(()) };
        // Every method was chosen with the odd stripes held out; what the even ones say was not looked at then.
        let mut met = true;
        for (name, held) in
            [("even stripes used, odd ones held out", 1), ("odd stripes used, even ones held out", 0)]
        {
            println!("{name}");
            met &= run_on(&clip, held)?;
        }
        ensure!(met, "an overlay would drift by more than it may");
        Ok(())
    }
}

/// Prints what one half of the stripes says of the other; whether the targets are met.
fn run_on(clip: &KarmaClip, held: usize) -> Result<bool> {
    let times: Vec<Time> = clip.pictures.iter().map(|(time, _)| *time).collect();
    let at = |s: f64| times.partition_point(|t| t.secs_since(START) < s);
    let (swing, end) = (at(SWING_S), times.len());
    let (long, short) =
        (clip.follow(at(BEGIN_S), swing, held)?, clip.follow(at(SWING_S - BEFORE_S), end, held)?);
    let (_, jpeg) = clip.pictures.first().context("no picture")?;
    let start = begin(clip, &times, decoded("first", jpeg)?.size, &short)?;
    let used = |tracks: Vec<CloudTrack>| -> Vec<CloudTrack> {
        tracks.into_iter().filter(|t| !t.held_out && t.seen.len() > 2).collect()
    };
    let (quiet, pieces, turning) = (used(thinned(&long)), used(cut(&thinned(&long))), used(short.clone()));
    println!(
        "{end} pictures, {} samples of the gyro; {} clouds used before the swing, {} in it",
        clip.samples.len(),
        quiet.len(),
        turning.len()
    );
    let solve = |tracks: Vec<&CloudTrack>| {
        KarmaMeasured { times: &times, samples: &clip.samples, tracks }.solve(&start).context("no solution")
    };
    let before = solve(pieces.iter().collect())?;
    let all = solve(quiet.iter().chain(&turning).collect())?;
    describe("first 11.5 s alone", &before);
    describe("whole clip", &all);
    let moments = [START, START.plus_secs(SWING_S), *times.last().context("no picture")?];
    say_what_was_told(clip, moments, &before, &all);
    say_what_alignment_says(clip, &times, swing, &all)?;
    Ok(judge(clip, &times, (&long, &short), swing, &all))
}

/// Tracks in pieces of about a second, each with a direction of its own: how a cloud drifts over ten seconds then tells nothing of the camera.
fn cut(tracks: &[CloudTrack]) -> Vec<CloudTrack> {
    let pieces = |t: &CloudTrack| {
        let piece = |seen: &[(usize, DVec2)]| CloudTrack { seen: seen.to_vec(), ..*t };
        t.seen.chunks(30 / STRIDE).map(piece).collect::<Vec<_>>()
    };
    tracks.iter().flat_map(pieces).collect()
}

/// How well a stretch tells the clocks' offset: what the fit states, and what all that is left of it would be if it came from the offset.
struct OffsetKnown {
    sigma_ms: f64,
    /// By how much clouds move in the picture for a millisecond, pixels rms. An even turn does not count: it could as well be bias.
    px_per_ms: f64,
    known_ms: f64,
}

fn told(clip: &KarmaClip, found: &KarmaFit, (from, to): (Time, Time)) -> OffsetKnown {
    let within: Vec<DVec3> =
        clip.samples.iter().filter(|s| s.arrival >= from && s.arrival < to).map(|s| s.rate).collect();
    // What is quicker than a picture is not seen in it.
    let means: Vec<DVec3> =
        within.chunks_exact(13).map(|c| c.iter().sum::<DVec3>() / c.len() as f64).collect();
    let n = means.len().max(1) as f64;
    let mean = means.iter().sum::<DVec3>() / n;
    let rate = (means.iter().map(|r| r.distance_squared(mean)).sum::<f64>() / n).sqrt();
    let (sigma_ms, px_per_ms) = (found.sigma(OFFSET) * 1e3, rate * found.at.lens.focal.x * 1e-3);
    OffsetKnown { sigma_ms, px_per_ms, known_ms: sigma_ms.hypot(found.rms_px / px_per_ms) }
}

/// Whether the time before the swing tells the clocks' offset.
fn say_what_was_told(clip: &KarmaClip, [begin, swing, end]: [Time; 3], before: &KarmaFit, all: &KarmaFit) {
    for (name, told) in [
        ("first 11.5 s", told(clip, before, (begin, swing))),
        ("whole clip, by its swing", told(clip, all, (swing, end))),
    ] {
        println!(
            "{name}: a millisecond of offset moves clouds by {:.3} px; the offset is known to {:.1} ms (stated {:.1}): {}",
            told.px_per_ms,
            told.known_ms,
            told.sigma_ms,
            if told.known_ms > USABLE_MS {
                "tells nothing of use, film a camera that turns"
            } else {
                "of use"
            }
        );
    }
}

/// Result of the calibration for users from the camera's orientations as the sky shows them.
fn say_what_alignment_says(clip: &KarmaClip, times: &[Time], swing: usize, found: &KarmaFit) -> Result<()> {
    let readings: Vec<ImuReading> = clip.samples.iter().map(|s| ImuReading::new(s.arrival, s)).collect();
    let seen = orientations(clip, times, &found.at.lens)?;
    for (name, count) in [("first 11.5 s", swing), ("whole clip", times.len())] {
        let observations: Vec<Observation> = seen
            .iter()
            .filter(|o| times.get(..count).is_some_and(|t| t.contains(&o.stamp())))
            .copied()
            .collect();
        match alignment::solve(&readings, &observations, &Options::default()) {
            Ok(a) => println!(
                "calibrate on the {name}: offset {:.1} +- {:.1} ms, {}",
                a.offset_s * 1e3,
                a.offset_sigma_s * 1e3,
                a.grade
            ),
            Err(e) => println!("calibrate on the {name} refuses: {e}"),
        }
    }
    Ok(())
}

/// The camera's orientation in each picture as the sky alone shows it.
fn orientations(clip: &KarmaClip, times: &[Time], lens: &Lens) -> Result<Vec<Observation>> {
    // All that matters is that the sky is above; which way it looked at first is as good as any other.
    let world_from_camera = look(0.0, 0.0, 0.0);
    let view = SkyView {
        lens: *lens,
        eye_height_m: 40.0,
        world_from_camera,
        sigma: 0.01,
        drift: HeadingSettings::default().sky_drift,
    };
    let (mut skyline, mut chain, mut out) = (Skyline::new(), 0, Vec::new());
    for ((_, jpeg), stamp) in clip.pictures.iter().zip(times) {
        let picture = decoded("picture", jpeg)?.picture()?;
        let Ok(seen) = skyline.look(*stamp, &picture, &view) else { continue };
        chain += u32::from(seen.is_anchor());
        let sigma = (seen.covariance.x_axis.x + seen.covariance.y_axis.y + seen.covariance.z_axis.z) / 3.0;
        out.push(Observation::Orientation {
            stamp: *stamp,
            reference_from_camera: DQuat::from_scaled_axis(seen.turn) * world_from_camera,
            sigma: sigma.sqrt().max(1e-4),
            row: -0.3,
            chain,
        });
    }
    Ok(out)
}

/// Every so many-th picture of each track.
fn thinned(tracks: &[CloudTrack]) -> Vec<CloudTrack> {
    let thin =
        |t: &CloudTrack| CloudTrack { seen: t.seen.iter().copied().step_by(STRIDE).collect(), ..t.clone() };
    tracks.iter().map(thin).collect()
}

/// The axes of the unit, of all 24 ways to hold it the one that explains the swing best, and an undistorted lens of 70 degrees.
fn begin(
    clip: &KarmaClip,
    times: &[Time],
    (width, height): (usize, usize),
    short: &[CloudTrack],
) -> Result<KarmaUnknowns> {
    let lens = Lens::pinhole(width as u32, height as u32, 70f64.to_radians());
    let tracks: Vec<&CloudTrack> = short.iter().filter(|t| !t.held_out).collect();
    let measured = KarmaMeasured { times, samples: &clip.samples, tracks };
    let mut found: Vec<(f64, KarmaFit)> = Vec::new();
    for camera_from_imu in right_angles() {
        let start = KarmaUnknowns {
            camera_from_imu,
            offset_s: 0.0,
            bias: DVec3::ZERO,
            growth: DVec3::ZERO,
            lens,
            readout_s: 0.016,
        };
        if let Some(fit) = measured.solve(&start) {
            found.push((fit.rms_px, fit));
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (_, best) = found.into_iter().next().context("no way to hold the unit explains the swing")?;
    let nearest = |q: &DQuat| q.angle_between(best.at.camera_from_imu);
    let axes = right_angles().into_iter().min_by(|a, b| nearest(a).total_cmp(&nearest(b)));
    Ok(KarmaUnknowns {
        camera_from_imu: axes.unwrap_or_default(),
        offset_s: 0.0,
        bias: DVec3::ZERO,
        growth: DVec3::ZERO,
        lens,
        readout_s: 0.016,
    })
}

/// The 24 rotations that take axes to axes.
fn right_angles() -> Vec<DQuat> {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y, DVec3::NEG_Z];
    let mut all = Vec::new();
    for x in axes {
        for y in axes.into_iter().filter(|y| x.dot(*y) == 0.0) {
            all.push(DQuat::from_mat3(&DMat3::from_cols(x, y, x.cross(y))));
        }
    }
    all
}

fn describe(name: &str, found: &KarmaFit) {
    let KarmaUnknowns { camera_from_imu, offset_s, bias, growth, lens, readout_s } = found.at;
    let euler = camera_from_imu.to_scaled_axis().to_array().map(f64::to_degrees);
    println!(
        "{name}: offset {:.1} +- {:.1} ms, read-out {:.1} +- {:.1} ms, focal length {:.1} +- {:.1} px, k1 {:.3} +- {:.3}, k2 {:.3} +- {:.3}",
        offset_s * 1e3,
        found.sigma(OFFSET) * 1e3,
        readout_s * 1e3,
        found.sigma(READOUT) * 1e3,
        lens.focal.x,
        lens.focal.x * found.sigma(FOCAL),
        found.at.radial().x,
        found.sigma(RADIAL),
        found.at.radial().y,
        found.sigma(RADIAL + 1),
    );
    println!(
        "    rotation +- {:.1} {:.1} {:.1} mrad, bias {:.3} deg/s growing {:.4}, residuals {:.2} px rms; rotation vector {euler:.2?} deg",
        found.sigma(0) * 1e3,
        found.sigma(1) * 1e3,
        found.sigma(2) * 1e3,
        bias * 180.0 / std::f64::consts::PI,
        growth * 180.0 / std::f64::consts::PI,
        found.rms_px,
    );
}

/// By how much an overlay drifts, pixels at 1280 wide.
struct OverlayDrift {
    rms: f64,
    /// Of that, what the clouds do each by itself.
    own: f64,
    clouds: usize,
}

/// Drift of what is drawn where a cloud was seen first, against the clouds that were held out, from picture `from` on.
fn drift(measured: &KarmaMeasured<'_>, found: &KarmaFit, tracks: &[CloudTrack], from: usize) -> OverlayDrift {
    let scale = WIDTH / f64::from(found.at.lens.width);
    let path = measured.path(&found.at);
    let mut by_picture: BTreeMap<usize, Vec<DVec2>> = BTreeMap::new();
    let mut clouds = 0;
    for track in tracks.iter().filter(|t| t.held_out) {
        let seen: Vec<(usize, DVec2)> = track.seen.iter().copied().filter(|s| s.0 >= from).collect();
        if seen.len() < 3 {
            continue;
        }
        clouds += 1;
        let track = CloudTrack { seen, held_out: true };
        let world = measured.direction(&found.at, &path, &track, 1);
        let misses = measured.misses(&found.at, &path, &track, world);
        for ((picture, _), miss) in track.seen.iter().zip(misses).skip(1) {
            by_picture.entry(*picture).or_default().push(miss * scale);
        }
    }
    let (mut all, mut own, mut count) = (0.0, 0.0, 0.0);
    for misses in by_picture.values() {
        let mean = misses.iter().sum::<DVec2>() / misses.len() as f64;
        all += misses.iter().map(|m| m.length_squared()).sum::<f64>();
        own += misses.iter().map(|m| m.distance_squared(mean)).sum::<f64>();
        count += misses.len() as f64;
    }
    let rms = |sum: f64| (sum / f64::max(count, 1.0)).sqrt();
    OverlayDrift { rms: rms(all), own: rms(own), clouds }
}

/// Says whether the targets are met.
fn judge(
    clip: &KarmaClip,
    times: &[Time],
    (long, short): (&[CloudTrack], &[CloudTrack]),
    swing: usize,
    found: &KarmaFit,
) -> bool {
    let measured = KarmaMeasured { times, samples: &clip.samples, tracks: Vec::new() };
    let before = drift(&measured, found, long, 0);
    let during = drift(&measured, found, short, swing);
    let mut met = true;
    for (name, drift, target) in [("first 11.5 s", before, TARGETS[0]), ("swing", during, TARGETS[1])] {
        let good = drift.rms <= target;
        met &= good;
        println!(
            "{name}: drift against {} held-out clouds {:.2} px rms ({WIDTH} wide; clouds among each other {:.2}); target {target} px: {}",
            drift.clouds,
            drift.rms,
            drift.own,
            if good { "met" } else { "missed" }
        );
    }
    met
}
