//! A trainer with an instructor joined: orders reach the exercise, scenarios are loaded one after the other, and nothing that happens to the
//! other side touches a run.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

mod playing;

use std::{
    os::unix::net::UnixStream,
    path::Path,
    time::{Duration, Instant},
};

use bowwave_core::{
    act::Act,
    engagement::Engagement,
    order::{JoinPlace, Order},
    world::exercise::ExerciseFact,
};
use bowwave_link::{FromDaemon, Hello, Picture, Status, ToDaemon, read_from_daemon, write_to_daemon};
use bowwave_record::{RunSelection, read_events, read_runs};
use playing::{Playing, SCENARIO};

/// An instructor's process, in its place.
struct Instructor {
    stream: UnixStream,
}

impl Instructor {
    /// Joins as soon as somebody listens.
    fn join(socket: &Path) -> Self {
        let begun = Instant::now();
        let stream = loop {
            match UnixStream::connect(socket) {
                Ok(stream) => break stream,
                Err(e) => assert!(begun.elapsed() < Duration::from_secs(300), "nobody listens: {e}"),
            }
            std::thread::sleep(Duration::from_millis(50));
        };
        stream.set_read_timeout(Some(Duration::from_secs(240))).unwrap();
        let mut instructor = Self { stream };
        instructor.ask(&ToDaemon::Hello { hello: Hello::new("test") });
        instructor
    }

    fn ask(&mut self, message: &ToDaemon) {
        write_to_daemon(&mut self.stream, message).expect("the trainer reads");
    }

    fn order(&mut self, order: Order) {
        self.ask(&ToDaemon::Order { order });
    }

    fn next(&mut self) -> FromDaemon {
        read_from_daemon(&mut self.stream).expect("the trainer writes")
    }

    /// The first status that is so.
    fn until(&mut self, what: &str, is_so: impl Fn(&Status) -> bool) -> Status {
        let begun = Instant::now();
        let mut last = None;
        while begun.elapsed() < Duration::from_secs(240) {
            match self.next() {
                FromDaemon::Status(status) if is_so(&status) => return *status,
                FromDaemon::Status(status) => last = Some(status),
                FromDaemon::Refused(why) => panic!("refused: {why}"),
                FromDaemon::Hello(_) | FromDaemon::Picture(_) => {}
            }
        }
        panic!("{what} never came; the last was {last:?}");
    }

    fn refusal(&mut self) -> String {
        loop {
            if let FromDaemon::Refused(why) = self.next() {
                return why;
            }
        }
    }

    fn picture(&mut self) -> Picture {
        self.ask(&ToDaemon::Picture);
        loop {
            if let FromDaemon::Picture(picture) = self.next() {
                return picture;
            }
        }
    }
}

#[test]
fn an_instructor_runs_an_exercise_and_then_another() {
    let mut playing = Playing::start();
    let mut instructor = Instructor::join(&playing.socket());
    let waits =
        instructor.until("a start that waits", |s| s.is_paused && s.word == "PAUSED" && !s.boats.is_empty());
    assert_eq!((waits.clock_s, waits.scenario.as_str(), waits.session), (0.0, "With a reserve", 1));
    assert!(waits.can_load && waits.gun.is_some());
    let reserve = |s: &Status| s.boats.iter().filter(|b| b.in_reserve && !b.swims).count();
    assert_eq!((waits.boats.len(), reserve(&waits)), (3, 2));

    instructor.order(Order::Resume);
    instructor.until("its clock", |s| s.clock_s > 0.5 && !s.is_paused);
    // A picture is of the LCD: bright sky over darker sea.
    let picture = instructor.picture();
    assert_eq!((picture.width, picture.height), (640, 360));
    let row = |y: usize| picture.rgba[y * 640 * 4..][..640 * 4].iter().map(|v| u64::from(*v)).sum::<u64>();
    assert!(row(60) > row(300) + 10_000, "{} {}", row(60), row(300));

    instructor.order(Order::Rules { rules: Engagement::Hold });
    instructor.until("other rules", |s| s.rules == Some(Engagement::Hold));
    instructor.order(Order::Message { text: "LOOK NORTH".to_owned() });
    instructor.until("the text", |s| s.message.as_deref() == Some("LOOK NORTH"));
    instructor.ask(&ToDaemon::Act { act: Act::Report });
    let at = Some(JoinPlace { bearing_deg: 20.0, range_m: 700.0 });
    instructor.order(Order::Join { boat: "late".to_owned(), at });
    let joined = instructor.until("the boats that join", |s| reserve(s) == 0 && s.boats[1].swims);
    let boat = &joined.boats[1];
    assert!((boat.east_m.hypot(boat.north_m) - 700.0).abs() < 60.0, "{boat:?}");
    instructor.order(Order::Join { boat: "late".to_owned(), at: None });
    assert!(instructor.refusal().contains("on the water already"));

    // What is no scenario is refused, and the run goes on.
    let load = |text: &str| ToDaemon::Load { origin: "browser".to_owned(), scenario: text.to_owned() };
    instructor.ask(&load("nonsense = 1"));
    let why = instructor.refusal();
    assert!(why.contains("browser:1:1") && why.contains("nonsense"), "{why}");
    instructor.ask(&load(&SCENARIO.replace("model = \"dhow\"", "model = \"/etc/passwd\"")));
    assert!(instructor.refusal().contains("is a path"));
    instructor.ask(&load(&SCENARIO.replace("With a reserve", "The second")));
    let second = instructor.until("the second scenario", |s| s.session == 2);
    assert_eq!((second.scenario.as_str(), second.is_paused, second.clock_s), ("The second", true, 0.0));
    instructor.order(Order::Resume);
    instructor.until("its clock", |s| s.clock_s > 0.3);
    instructor.order(Order::Pause);
    instructor.until("the pause", |s| s.is_paused);
    instructor.ask(&ToDaemon::StandBy);
    let stands = instructor.until("stand-by", |s| s.stands_by && s.session == 3);
    assert!(stands.boats.is_empty() && stands.is_paused);

    // Killed, it has kept what it was ordered; what is no exercise is no run.
    playing.kill();
    let runs = read_runs(&playing.journal()).unwrap();
    assert_eq!(
        runs.iter().map(|r| r.run.scenario.as_str()).collect::<Vec<_>>(),
        ["With a reserve", "The second"]
    );
    let facts: Vec<ExerciseFact> = read_events(&playing.journal(), RunSelection::Run(runs[0].id))
        .unwrap()
        .into_iter()
        .map(|stored| stored.expect("a known event").fact)
        .collect();
    let has = |is_so: &dyn Fn(&ExerciseFact) -> bool| facts.iter().any(is_so);
    assert!(has(&|f| matches!(f, ExerciseFact::Rules { rules: Engagement::Hold })), "{facts:?}");
    assert!(has(&|f| matches!(f, ExerciseFact::Message { text } if text == "LOOK NORTH")));
    assert!(has(&|f| matches!(f, ExerciseFact::Did { act: Act::Report, .. })));
    assert_eq!(facts.iter().filter(|f| matches!(f, ExerciseFact::Joined { .. })).count(), 2);
    assert!(matches!(facts.first(), Some(ExerciseFact::Paused)), "{facts:?}");
}
