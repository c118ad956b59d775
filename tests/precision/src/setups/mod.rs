//! Wrong set-ups: what a trainer that is set up wrongly says of it, and how soon. Recordings with truth are replayed into sessions with one thing
//! wrong; the right set-up is replayed beside them.

mod obstacles;
mod right;

use std::{
    collections::VecDeque,
    path::{Path, PathBuf},
    sync::Arc,
};

use anyhow::Result;
use bowwave_core::{
    calibration::Calibration,
    estimate::{HeadingSettings, attitude::Source},
    event::{Event, Picture, PixelFormat, Tick},
    fault::{Change, Fault, Severity},
    session::{Session, Setup},
    time::secs_to_ns,
    world::scenario::Scenario,
};
use hw_sim::{
    make::{Periodic, Recipe},
    replay::Replay,
    set_up::{SET_UPS, SetUp, WrongSetUp},
};

use crate::{
    registration::{looped, record},
    table::TextTable,
};

/// Events as a trainer that is set up so gets them.
fn events(wrong: WrongSetUp) -> impl FnMut(Event, &Replay) -> Event {
    let mut shown = VecDeque::new();
    move |event, _| match event {
        Event::Imu(sample) => Event::Imu(wrong.sample(sample)),
        Event::Frame(mut frame) => {
            let [columns, rows] = wrong.flips();
            if (columns || rows)
                && let Some(flipped) = flipped(&frame.picture, columns, rows)
            {
                frame.picture = flipped;
            }
            let late = wrong.frames_late(30);
            if late > 0 {
                // The stamp is this picture's, what it shows is older.
                shown.push_back(frame.picture.clone());
                if shown.len() > late + 1 {
                    shown.pop_front();
                }
                frame.picture = shown.front().cloned().unwrap_or_else(|| frame.picture.clone());
            }
            Event::Frame(frame)
        }
        event => event,
    }
}

/// A picture's brightness, row by row, codes: its luma, or its green.
fn luma(picture: &Picture) -> impl Iterator<Item = u8> {
    let bytes = picture.format().pixel_bytes();
    let rows = (0..picture.height() as usize).map(|y| picture.row(y));
    rows.flat_map(move |row| row.iter().skip(usize::from(bytes == 3)).step_by(bytes).copied())
}

/// A grey picture of another one's luma, in reverse order.
fn flipped(picture: &Picture, columns: bool, rows: bool) -> Option<Picture> {
    let width = picture.width() as usize;
    let mut luma: Vec<u8> = luma(picture).collect();
    // All in reverse order is a picture turned by 180 degrees: rows and columns.
    if rows {
        luma.reverse();
    }
    if rows != columns {
        luma.chunks_exact_mut(width).for_each(<[u8]>::reverse);
    }
    let flipped: Vec<u8> = luma.into_iter().flat_map(|luma| [luma; 3]).collect();
    Picture::new(PixelFormat::Rgb, picture.width(), picture.height(), flipped.into()).ok()
}

/// What a session said of a set-up.
#[derive(Debug, Default)]
struct Said {
    /// Seconds from the first pose to the first fault that keeps rounds from being scored, and its code.
    first: Option<(f64, Fault)>,
    /// The last one.
    last: Option<Fault>,
    /// Share of the frames from two seconds on that were READY, and that were unchecked for more than ten seconds.
    ready: f64,
    unchecked: f64,
}

/// How a recording is played into a trainer.
#[derive(Clone, Copy, Debug)]
struct Played<'a> {
    source: Source,
    seconds: f64,
    /// Frames a second.
    rate: f64,
    scenario: &'a str,
}

/// Plays the recording at `path` with a calibration and events made of its own.
fn replay(
    path: &Path,
    played: Played<'_>,
    calibration: impl FnOnce(Calibration) -> Calibration,
    mut changed: impl FnMut(Event, &Replay) -> Event,
) -> Result<Said> {
    let Played { source, seconds, rate, scenario } = played;
    let (mut replay, own) = looped(path, seconds)?;
    let calibration = calibration(own);
    let lens = calibration.lens;
    let mut session = Session::new(Setup {
        scenario: Scenario::parse(scenario, "set-up")?,
        calibration,
        models: Arc::new([]),
        boat_models: Vec::new(),
        screen: (lens.width, lens.height),
        video: PixelFormat::Rgb,
        orientation: source,
        heading: HeadingSettings::default(),
        own_ship: Default::default(),
    })?;
    let (mut said, mut events, mut begun) = (Said::default(), Vec::new(), None);
    let (mut frames, mut ready, mut unchecked) = (0_u32, 0_u32, 0_u32);
    for frame in 1..=(seconds * rate) as i64 {
        let time = replay.origin().plus_ns(secs_to_ns(frame as f64 / rate));
        events.clear();
        replay.collect(time, &mut events)?;
        for event in events.drain(..) {
            session.event(&changed(event, &replay));
        }
        let answer = session.tick(Tick::at(time));
        let known = answer.view.pose_known;
        let since = |begun: bowwave_core::time::Time| time.secs_since(begun);
        if known && begun.is_none() {
            begun = Some(time);
        }
        for change in answer.faults {
            let severe = change.fault.severity() >= Severity::NotScored;
            if matches!(change.change, Change::Raised { .. }) && severe {
                said.last = Some(change.fault);
                said.first = said.first.or(begun.map(|begun| (since(begun), change.fault)));
            }
        }
        let trouble = session.hud().status.clone();
        if begun.is_some_and(|begun| since(begun) > 2.0) {
            frames += 1;
            ready += u32::from(trouble == bowwave_core::frame::scene::Status::Ready);
            unchecked += u32::from(session.checks(time).unseen_s > 10.0);
        }
    }
    replay.stop()?;
    let share = |count: u32| f64::from(count) / f64::from(frames.max(1));
    (said.ready, said.unchecked) = (share(ready), share(unchecked));
    Ok(said)
}

/// What a trainer that is set up so tells last of a recording, and its share of READY frames from two seconds on.
pub fn told(path: &Path, set_up: &SetUp, source: Source, seconds: f64) -> Result<(Option<Fault>, f64)> {
    let played = Played { source, seconds, rate: 30.0, scenario: "" };
    let said = replay(path, played, |own| set_up.wrong.calibration(own), events(set_up.wrong))?;
    Ok((said.last, said.ready))
}

/// The recordings.
fn recipes() -> [(&'static str, Recipe); 2] {
    let small = Recipe { width: 640, height: 360, trigger: Vec::new(), ..Recipe::default() };
    let deg = f64::to_radians;
    let mut ship = small.clone();
    ship.ship.roll = Periodic::new(0.0, &[(2, deg(6.0), 0.3), (3, deg(2.0), 1.0)]);
    ship.gun.traverse = Periodic::new(deg(42.0), &[]);
    ship.gun.elevation = Periodic::new(deg(-4.0), &[]);
    [("gun swung", small), ("ship rolls", ship)]
}

/// Replays recordings into trainers that are set up wrongly, in many ways, and lists what these say of it.
#[derive(Debug, clap::Args)]
pub struct SetUpStudy {
    /// Seconds that are replayed
    #[arg(long, default_value_t = 20.0)]
    seconds: f64,
    /// Only set-ups whose names contain this
    #[arg(long)]
    only: Option<String>,
    /// A recording in place of the two that are made
    #[arg(long, value_name = "FILE")]
    recording: Option<PathBuf>,
    /// Frames a second
    #[arg(long, default_value_t = 30.0)]
    rate: f64,
    /// Instead, so many hours of right set-ups in seas of all kinds
    #[arg(long, value_name = "HOURS", conflicts_with = "only")]
    right: Option<f64>,
    /// Number of the first of these; those below 547 helped to choose, the others only judge
    #[arg(long, default_value_t = 547, requires = "right")]
    first: u64,
}

impl SetUpStudy {
    /// Prints for each set-up how soon it was told, and as what.
    pub fn run(&self) -> Result<()> {
        if let Some(hours) = self.right {
            return right::run(hours, self.first);
        }
        let titles = [("recording", 12), ("orientation", 12), ("set-up", 36)];
        let parts =
            [("told s", 8), ("as", 16), ("last as", 16), ("named", 6), ("ready", 6), ("unchecked", 9)];
        let mut table = TextTable::new(3, titles.into_iter().chain(parts));
        let folder = tempfile::tempdir()?;
        let (mut named, mut all, mut in_time) = (0, 0, 0);
        let mut recordings = Vec::new();
        match &self.recording {
            Some(path) => recordings.push(("given", path.clone())),
            None => {
                for (name, recipe) in recipes() {
                    let path = folder.path().join(name.replace(' ', "-")).with_extension("mcap");
                    record(&recipe, &path)?;
                    recordings.push((name, path));
                }
            }
        }
        for (name, path) in recordings {
            for (source, orientation) in [(Source::Auto, "unit's own"), (Source::Fused, "fused")] {
                for set_up in SET_UPS {
                    if self.only.as_ref().is_some_and(|only| !set_up.name.contains(only.as_str())) {
                        continue;
                    }
                    let played = Played { source, seconds: self.seconds, rate: self.rate, scenario: "" };
                    let said =
                        replay(&path, played, |own| set_up.wrong.calibration(own), events(set_up.wrong))?;
                    let right = set_up.is_named(said.last);
                    all += 1;
                    named += u32::from(right);
                    in_time +=
                        u32::from(set_up.faults.is_empty() || said.first.is_some_and(|(s, _)| s <= 2.0));
                    let cells = [
                        name.to_owned(),
                        orientation.to_owned(),
                        set_up.name.to_owned(),
                        said.first.map_or_else(String::new, |(s, _)| format!("{s:.2}")),
                        said.first.map_or("", |(_, fault)| fault.code()).to_owned(),
                        said.last.map_or("", Fault::code).to_owned(),
                        if right { "yes" } else { "NO" }.to_owned(),
                        format!("{:.2}", said.ready),
                        format!("{:.2}", said.unchecked),
                    ];
                    table.row(cells);
                    print!("{}", table.take());
                }
            }
        }
        println!("{named} of {all} named rightly, {in_time} told within 2 s or rightly not at all");
        Ok(())
    }
}
