//! A dialogue runs in the trainer's own loop: over pictures of any layout, and over none.

#![allow(clippy::expect_used, clippy::panic, reason = "a test that cannot go on has failed")]

use std::sync::Arc;

use anyhow::Result;
use bowwave_core::{
    calibration::Calibration,
    event::{CameraFrame, Event, Picture, PixelFormat, Tick},
    geometry::Lens,
    guide::Guide,
    session::Setup,
    time::Time,
    world::scenario::{BUILT_IN, Scenario},
};
use bowwave_trainer::{
    Companion, Ended, Signals, TickClock, Trainer, TrainerOptions,
    presenter::{GpuSettings, OutputOptions, PresenterOptions},
    source::{EventFeed, Source},
    summary::SummaryOptions,
};
use crossbeam_channel::{Sender, bounded};

/// Shows a page, and hands itself a picture with each of the first frames.
struct Script {
    pictures: Vec<Picture>,
    feed: Option<Sender<Event>>,
    seen: Vec<PixelFormat>,
    pages: usize,
    has_source_ended: bool,
}

impl Companion for Script {
    fn waits(&self) -> bool {
        false
    }

    fn frame(&mut self, events: &[Event], tick: Tick) -> Result<Option<Guide>> {
        for event in events {
            let Event::Frame(frame) = event else { panic!("{event:?}") };
            self.seen.push(frame.picture.format());
        }
        if self.has_source_ended {
            return Ok(None);
        }
        match self.pictures.pop() {
            Some(picture) => {
                let (time, sequence) = (tick.time, self.pages as u32);
                let frame = CameraFrame { arrival: time, mid_exposure: time, sequence, picture, jpeg: None };
                self.feed.as_ref().expect("open").send(Event::Frame(frame))?;
            }
            // The page is shown once more, then the source has ended.
            None => self.feed = None,
        }
        self.pages += 1;
        Ok(Some(Guide { title: "Calibrate".to_owned(), says: "Begin".to_owned(), ..Guide::default() }))
    }

    fn source_ended(&mut self) {
        self.has_source_ended = true;
    }

    fn quit(&mut self) {
        panic!("nobody asked for an end");
    }
}

fn setup() -> Setup {
    let text = BUILT_IN.iter().find(|(name, _)| *name == "empty").expect("it is built in").1;
    Setup {
        scenario: Scenario::parse(text, "empty").expect("it is a scenario"),
        calibration: Calibration::nominal(Lens::pinhole(320, 192, 1.0)),
        models: Vec::new().into(),
        boat_models: Vec::new(),
        screen: (320, 192),
        video: PixelFormat::Yuyv,
        orientation: Default::default(),
        heading: Default::default(),
        own_ship: Default::default(),
    }
}

#[test]
fn pages_are_drawn_over_pictures_of_any_layout_and_over_none() {
    let (sender, events) = bounded(8);
    let black = |format, width| Picture::black(format, width, 192).expect("a picture");
    // The last is of another size than the lens: it is not shown, and the dialogue hears of it.
    let pictures =
        vec![black(PixelFormat::Rgb, 160), black(PixelFormat::Rgb, 320), black(PixelFormat::Yuyv, 320)];
    let mut script =
        Script { pictures, feed: Some(sender), seen: Vec::new(), pages: 0, has_source_ended: false };
    let output = OutputOptions { hash: true, ..OutputOptions::default() };
    let options = TrainerOptions {
        setup: setup(),
        presenter: Some(PresenterOptions {
            gpu: GpuSettings { device: Some("llvmpipe".to_owned()), ..GpuSettings::default() },
            output,
        }),
        frames: None,
        plays_to_the_end: false,
        follow_lcd: false,
        boot_id: None,
        summary: SummaryOptions { program_start: Time::from_ns(0), ..SummaryOptions::default() },
        faults: Vec::new(),
        waits: false,
    };
    let source = Source::Feed(EventFeed::new(events));
    let trainer = Trainer::start(options, source, TickClock::paced(), None, Arc::new(Signals::default()))
        .expect("it starts");
    let finished = trainer.accompany(&mut script).expect("it runs");
    assert_eq!(script.seen, [PixelFormat::Yuyv, PixelFormat::Rgb, PixelFormat::Rgb]);
    assert_eq!((finished.ended, finished.wrong.len()), (Ended::Stopped, 0), "{:?}", finished.wrong);
    let summary = finished.summary;
    assert_eq!(summary.frames, script.pages as u64);
    assert_eq!(summary.counts["pictures_wrong_size"], 1);
    assert!(summary.counts["frames_blind"] >= 1 && summary.video.starts_with("Rgb"), "{}", summary.video);
}
