//! A session on a made recording that is played round and round.

use std::{path::Path, sync::Arc};

use bowwave_core::{
    calibration::Calibration,
    estimate::attitude::Source,
    event::{Event, PixelFormat, Tick},
    own_ship::{Mask, OwnShip},
    session::{Session, Setup},
    world::scenario::Scenario,
};
use hw_sim::replay::{Replay, ReplayOptions};

const FRAME_NS: i64 = 100_000_000;

/// A recording, and the session that gets its events ten times a second.
pub struct Played {
    /// The recording.
    pub replay: Replay,
    /// The calibration in it.
    pub calibration: Calibration,
    seconds: i64,
}

impl Played {
    /// Opens a recording for so many seconds.
    pub fn open(path: &Path, seconds: i64) -> Self {
        let options = ReplayOptions {
            duration_ns: Some((seconds + 1) * 1_000_000_000),
            looped: true,
            ..ReplayOptions::default()
        };
        let replay = Replay::fast(path, &options).unwrap();
        let calibration =
            bowwave_calibration::parse(&replay.properties().calibration_toml, "recording").unwrap();
        Self { replay, calibration: calibration.calibration, seconds }
    }

    /// A session by this calibration.
    pub fn session(&self, scenario: &str, orientation: Source, mask: Option<Mask>) -> Session {
        let lens = self.calibration.lens;
        Session::new(Setup {
            scenario: Scenario::parse(scenario, "test").unwrap(),
            calibration: self.calibration.clone(),
            models: Arc::new([]),
            boat_models: Vec::new(),
            screen: (lens.width, lens.height),
            video: PixelFormat::Rgb,
            orientation,
            heading: bowwave_core::estimate::HeadingSettings::default(),
            own_ship: OwnShip { mask, ..OwnShip::default() },
        })
        .unwrap()
    }

    /// Plays it to `session`: events are changed by `change`, and `seen` is asked after every frame, told its number from 1.
    pub fn play(
        &mut self,
        session: &mut Session,
        mut change: impl FnMut(&mut Event),
        mut seen: impl FnMut(i64, &mut Session, Tick, &Replay),
    ) {
        let mut events = Vec::new();
        for frame in 1..=self.seconds * 10 {
            let time = self.replay.origin().plus_ns(frame * FRAME_NS);
            events.clear();
            self.replay.collect(time, &mut events).unwrap();
            events.iter_mut().for_each(&mut change);
            events.iter().for_each(|event| session.event(event));
            seen(frame, session, Tick::at(time), &self.replay);
        }
    }
}
