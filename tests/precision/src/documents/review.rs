//! A run by the trainer's own program that is recorded, replayed, and looked at from elsewhere.

use std::{path::Path, process::Command};

use anyhow::{Context as _, Result, ensure};
use bowwave_core::{
    frame::scene::{LeftOut, Pass, PassDecision},
    geometry::{RigidPose, look},
    model::Model,
    own_ship::Phantoms,
    world::score::ShotRecord,
};
use bowwave_record::journal::{RunSelection, ShotFilter, read_shots};
use bowwave_trainer::replay::{Replayed, replay_noting, scenario_of};
use glam::{DVec2, DVec3};
use image::imageops;

use super::{Exhibit, Figure, Line, Table, Workshop, canvas::SeaShot};

/// Seconds of the run, and the frame that is looked at from elsewhere as well.
const SECONDS: u32 = 8;
const FRAME: usize = 180;
/// The exercise.
const SCENARIO: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../data/crowd-ahead.toml");

/// Boats of a tick: name, model, pose.
type Placed = Vec<(String, Model, RigidPose)>;

/// A replay.
struct ReviewedRun {
    replayed: Replayed,
    records: Vec<ShotRecord>,
    placed: Placed,
}

fn run(program: &Path, words: &[&str], paths: &[&Path]) -> Result<()> {
    let done = Command::new(program)
        .args(words)
        .args(paths)
        .output()
        .with_context(|| format!("{} cannot be started", program.display()))?;
    let said = String::from_utf8_lossy(&done.stderr);
    ensure!(done.status.success(), "bowwave {}: {}", words.join(" "), said.trim());
    Ok(())
}

fn replayed(recording: &Path) -> Result<ReviewedRun> {
    let (mut records, mut placed, mut ticks) = (Vec::new(), Vec::new(), 0);
    let result = replay_noting(recording, &mut |world, of_tick, _| {
        records.extend_from_slice(of_tick);
        ticks += 1;
        if let (true, Some(running)) = (ticks == FRAME, world.running()) {
            let boats = 0..running.fleet.len();
            placed.extend(boats.filter_map(|boat| {
                let pose = running.fleet.pose(boat, running.now)?;
                Some((running.fleet.name(boat).to_owned(), running.fleet.model(boat)?.clone(), pose))
            }));
        }
    })?;
    // Rounds come as they end; the journal has them as they were fired.
    records.sort_by_key(|record: &ShotRecord| record.shot);
    Ok(ReviewedRun { replayed: result, records, placed })
}

/// Runs, replays, and shows the run from the gun, from elsewhere and from above.
pub fn exhibits(workshop: &Workshop) -> Result<Vec<Exhibit>> {
    if !workshop.program.is_file() {
        let program = workshop.program.display();
        return Ok(vec![Exhibit::Missing(format!(
            "Not measured: no program at {program}; build it with cargo build --release"
        ))]);
    }
    let folder = tempfile::tempdir().context("no folder for a run")?;
    let (out, chart) = (folder.path().join("run"), folder.path().join("run.svg"));
    let still = FRAME.to_string();
    let seconds = SECONDS.to_string();
    let words = ["simulate", "--record", "--size", "640x360", "--duration", &seconds, "--stills", &still];
    let scenario = Path::new(SCENARIO);
    run(&workshop.program, &[&words[..], &["--scenario"]].concat(), &[scenario, Path::new("--out"), &out])?;
    let recording = out.join("recording.mcap");
    run(&workshop.program, &["replay", "--chart"], &[&chart, &recording])?;
    let review = replayed(&recording)?;
    let summary: serde_json::Value = serde_json::from_slice(&std::fs::read(out.join("summary.json"))?)?;
    let journal =
        read_shots(&out.join("hits.sqlite"), &ShotFilter { runs: RunSelection::Latest, hits_only: false })?;
    let mut logged: Vec<ShotRecord> = journal.into_iter().map(|shot| shot.record).collect();
    logged.sort_by_key(|record| record.shot);
    let still = out.join(format!("frame-{FRAME:05}.png"));
    let seen = image::open(&still).with_context(|| still.display().to_string())?.to_rgb8();
    let figures = vec![
        Figure::new(format!("Frame {FRAME} as the gunner saw it"), "boats ahead of the gun", &seen)?,
        elsewhere(&review.placed)?,
        Figure::of_svg(
            "The same run from above: bowwave replay --chart",
            "tracks of boats around the gun",
            &std::fs::read(&chart)?,
        ),
    ];
    Ok(vec![
        Exhibit::Table(compared(&review, &logged, &summary, scenario_of(&recording)?.boats.len())),
        Exhibit::Figures(figures),
    ])
}

/// The run against its replay.
fn compared(review: &ReviewedRun, logged: &[ShotRecord], summary: &serde_json::Value, boats: usize) -> Table {
    let text = |key: &str| summary[key].as_str().unwrap_or("none").to_owned();
    let digest = review.replayed.digest;
    let farthest = |of: fn(&ShotRecord) -> DVec3| {
        let pairs = review.records.iter().zip(logged);
        pairs.map(|(a, b)| of(a).distance(of(b))).fold(0.0, f64::max)
    };
    let late = review
        .records
        .iter()
        .zip(logged)
        .map(|(a, b)| (a.fired.ns() - b.fired.ns()).abs() as f64 * 1e-9)
        .fold(0.0, f64::max);
    let same = if review.replayed.differs_from.is_none() { "all" } else { "not all" };
    let line = |what: &str, run: String, replay: String| Line::new([what.into(), run.into(), replay.into()]);
    Table {
        caption: format!(
            "A run of {SECONDS} s with {boats} boats, and its replay; scenes hold the poses of all boats that are seen, to the bit"
        ),
        titles: vec!["quantity", "run", "replay"],
        lines: vec![
            line("ticks", summary["frames"].to_string(), review.replayed.ticks.to_string()),
            line("ticks whose records and scenes are those logged", "-".into(), same.into()),
            line("inputs that the recording lacks", "-".into(), review.replayed.missing.to_string()),
            line("hash of all records", text("records_digest"), format!("{:016x}", digest.records.get())),
            line("hash of all scenes", text("scenes_digest"), format!("{:016x}", digest.scenes.get())),
            line("rounds in journal and replay", logged.len().to_string(), review.records.len().to_string()),
            line(
                "farthest that a round's muzzle is apart, m",
                "-".into(),
                format!("{}", farthest(|r| r.muzzle)),
            ),
            line(
                "farthest that a round's direction is apart",
                "-".into(),
                format!("{}", farthest(|r| r.bore)),
            ),
            line("most that a round's time is apart, s", "-".into(), format!("{late}")),
        ],
    }
}

/// The boats of the replay from a place beside them, 25 m up.
fn elsewhere(placed: &Placed) -> Result<Figure> {
    const HIGH_M: f64 = 25.0;
    const OFF_M: f64 = 150.0;
    let mut shot = SeaShot::new([35.0, 215.0], 20_000.0)?;
    let mut near: Vec<&(String, Model, RigidPose)> = placed.iter().collect();
    near.sort_by(|a, b| a.2.position.length().total_cmp(&b.2.position.length()));
    near.truncate(8);
    ensure!(!near.is_empty(), "the replay has no boats at frame {FRAME}");
    let middle: DVec2 = near.iter().map(|b| b.2.position.truncate()).sum::<DVec2>() / near.len() as f64;
    // Beside the line from the gun to them, looking across it and down.
    let across = middle.normalize_or(DVec2::Y).perp();
    let eye = middle + across * OFF_M;
    let ahead = (middle - eye).normalize_or(DVec2::Y);
    shot.camera.position = eye.extend(HIGH_M);
    shot.camera.world_from_camera = look(ahead.x.atan2(ahead.y), -(HIGH_M / OFF_M).atan() * 1.2, 0.0);
    // Another view has no picture of the sea: sky over water, as the camera's colours have them.
    shot.picture = plain(&shot);
    let models: Vec<Model> = near.iter().map(|b| b.1.clone()).collect();
    let boats: Vec<(usize, RigidPose)> = near.iter().enumerate().map(|(i, b)| (i, b.2)).collect();
    let mut scene = shot.scene(shot.light(0.9)?, &models, &boats, 20_000.0)?;
    scene.passes[Pass::Mirror as usize] = PassDecision::LeftOut(LeftOut::ReflectionOff);
    let drawn = shot.draw(&scene, &models, Phantoms::default())?;
    let names: Vec<&str> = near.iter().map(|b| b.0.as_str()).collect();
    Figure::new(
        format!(
            "The replay of that tick from {OFF_M:.0} m beside and {HIGH_M:.0} m up: {}",
            names.join(", ")
        ),
        "the same boats seen from the side",
        &drawn,
    )
}

/// A picture of sky and water in the mean colours of a simulated one, by that camera's horizon.
fn plain(shot: &SeaShot) -> image::RgbImage {
    let rows = |from: u32, to: u32| {
        let part = imageops::crop_imm(&shot.picture, 0, from, shot.picture.width(), to - from).to_image();
        let mut sum = [0_u64; 3];
        part.pixels().for_each(|p| (0..3).for_each(|c| sum[c] += u64::from(p[c])));
        image::Rgb(sum.map(|s| (s / u64::from(part.width() * part.height())) as u8))
    };
    let height = shot.picture.height();
    let (sky, water) = (rows(0, height / 8), rows(height / 2, height));
    image::RgbImage::from_fn(shot.picture.width(), height, |x, y| {
        let ray = shot.camera.world_from_camera
            * shot.lens.unproject(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5));
        if ray.z > 0.0 { sky } else { water }
    })
}
