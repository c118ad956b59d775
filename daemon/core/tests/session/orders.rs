//! Orders of an instructor: pause, boats of the reserve, rules, texts and stoppages.

use bowwave_core::{
    engagement::Engagement,
    order::{InstructorOrder, JoinPlace, Order},
    world::{
        exercise::{ExerciseEvent, ExerciseFact},
        score::ScoreFold,
    },
};

use super::*;

/// What one frame gave.
struct Framed {
    at: Time,
    status: Status,
    boats: Vec<(usize, DVec3)>,
    clock_s: f64,
    message: Option<String>,
}

/// Frames, rounds and events of a run.
#[derive(Default)]
struct Played {
    frames: Vec<Framed>,
    records: Vec<ShotRecord>,
    events: Vec<ExerciseEvent>,
    tracks: TrackBlock,
}

impl Played {
    fn at(&self, tick: usize) -> &Framed {
        &self.frames[tick]
    }

    fn has(&self, fact: &ExerciseFact) -> bool {
        self.events.iter().any(|event| event.fact == *fact)
    }
}

/// Plays so many frames; at some of them something is ordered or the trigger is pressed or released.
fn played(text: &str, frames: i64, orders: &[(i64, Order)], edges: &[(i64, bool)]) -> Played {
    let mut s = session(text);
    let mut played = Played::default();
    for tick in 0..frames {
        let now = Time::from_ns((tick + 1) * 33 * MS);
        feed(&mut s, now);
        for (_, order) in orders.iter().filter(|(at, _)| *at == tick) {
            s.event(&Event::Order(InstructorOrder { time: now, order: order.clone() }));
        }
        for (_, pressed) in edges.iter().filter(|(at, _)| *at == tick) {
            s.event(&Event::Trigger(TriggerEdge { time: now, pressed: *pressed }));
        }
        let answer = s.tick(Tick::at(now));
        let scene = answer.view.scene;
        played.frames.push(Framed {
            at: now,
            status: scene.hud.status.clone(),
            boats: scene.boats.iter().map(|boat| (boat.boat, boat.pose.position)).collect(),
            clock_s: scene.hud.clock_s,
            message: scene.hud.message.as_deref().map(str::to_owned),
        });
        played.records.extend_from_slice(answer.records);
        played.events.extend_from_slice(answer.events);
        played.tracks.append(answer.tracks);
    }
    let (records, events) = s.finish();
    played.records.extend_from_slice(records);
    played.events.extend_from_slice(events);
    played.tracks.append(s.tracks());
    played
}

fn moving() -> String {
    SCENARIO.replace("course = \"still\"", "course = \"straight\"\nspeed_kn = 10")
}

#[test]
fn a_pause_holds_boats_clock_and_weapon_and_leaves_no_trace_in_what_follows() {
    let unpaused = played(&moving(), 90, &[], &[(50, true), (60, false)]);
    // For 40 frames nothing goes on; what comes later comes 40 frames later.
    let orders = [(30, Order::Pause), (70, Order::Resume)];
    let paused = played(&moving(), 130, &orders, &[(35, true), (65, false), (90, true), (100, false)]);
    for tick in 32..69 {
        let (frame, held) = (paused.at(tick), paused.at(31));
        assert_eq!(frame.status, Status::Paused);
        assert_eq!((&frame.boats, frame.clock_s), (&held.boats, held.clock_s));
    }
    for tick in (0..30).chain(35..90) {
        let later = if tick < 30 { tick } else { tick + 40 };
        let (a, b) = (unpaused.at(tick), paused.at(later));
        assert!((a.clock_s - b.clock_s).abs() < 0.04, "{tick}");
        for (a, b) in a.boats.iter().zip(&b.boats) {
            assert!(a.1.distance(b.1) < 0.25, "{tick}: {a:?} {b:?}");
        }
        assert_eq!(a.boats.len(), b.boats.len());
    }
    // Fired by the second press alone, at the host's time, and all of it.
    let fired: Vec<i64> = paused.records.iter().map(|r| r.fired.ns()).collect();
    assert!(fired.iter().all(|at| *at >= paused.at(90).at.ns()), "{fired:?}");
    assert_eq!(paused.records.len(), unpaused.records.len());
    let at =
        |fact: &ExerciseFact| paused.events.iter().find(|event| event.fact == *fact).map(|event| event.time);
    assert_eq!(at(&ExerciseFact::Paused), Some(paused.at(30).at));
    assert_eq!(at(&ExerciseFact::Resumed), Some(paused.at(70).at));
    let duration = |played: &Played| {
        let mut fold = ScoreFold::default();
        fold.take(&played.records, &played.events);
        fold.sheet().duration_s
    };
    assert!((duration(&unpaused) - duration(&paused)).abs() < 0.04);
    let times: Vec<i64> = paused.tracks.samples.iter().map(|sample| sample.time_ns).collect();
    assert!(times.windows(2).all(|t| t[0] < t[1]), "{times:?}");
    let gap = times.windows(2).map(|t| t[1] - t[0]).max();
    assert!(gap.is_some_and(|gap| (gap - 40 * 33 * MS).abs() < 100 * MS), "{gap:?}");
}

#[test]
fn an_exercise_that_is_loaded_to_wait_begins_when_it_is_let_go() {
    let played = played(&moving(), 90, &[(0, Order::Pause), (60, Order::Resume)], &[]);
    assert_eq!(played.at(59).clock_s, 0.0);
    assert!((played.at(89).clock_s - 29.0 * 0.033).abs() < 0.04, "{}", played.at(89).clock_s);
    assert_eq!(played.at(59).status, Status::Paused);
    assert!(played.has(&ExerciseFact::Paused) && played.has(&ExerciseFact::Resumed));
}

const RESERVE: &str = r#"
[[boat]]
name = "late"
model = "block"
side = "hostile"
crew = "attacker"
range_m = 400
bearing_deg = 3
count = 2
reserve = true
"#;

#[test]
fn a_boat_of_the_reserve_is_nowhere_until_it_joins() {
    let text = format!("{}\n{RESERVE}", SCENARIO.replace("hostile", "neutral"));
    let text = format!("{text}\n[[event]]\nwithin_m = 900\nboat = \"hostile\"\nmessage = \"CLOSE\"\n");
    let joins = |at| (30, Order::Join { boat: "late".to_owned(), at });
    let run = played(&text, 200, &[joins(None)], &[]);
    let numbers = |tick: usize| run.at(tick).boats.iter().map(|b| b.0).collect::<Vec<_>>();
    assert_eq!((numbers(29), numbers(199).len()), (vec![0], 3), "{:?}", numbers(199));
    assert_eq!(run.at(29).message, None);
    assert!(run.at(60).message.is_some(), "they are there now, and near");
    let joined: Vec<&ExerciseEvent> =
        run.events.iter().filter(|e| matches!(e.fact, ExerciseFact::Joined { .. })).collect();
    assert_eq!(joined.len(), 2);
    for event in &joined {
        let ExerciseFact::Joined { range_m, side, is_to_stop, .. } = &event.fact else { continue };
        assert!((range_m - 400.0).abs() < 40.0 && *side == Side::Hostile && *is_to_stop, "{event:?}");
    }
    // They come on from there, as if the scenario had begun then.
    let range = |tick: usize| run.at(tick).boats.iter().find(|b| b.0 == 1).map(|b| b.1.truncate().length());
    assert!(range(32).zip(range(199)).is_some_and(|(a, b)| a > b + 10.0), "{:?} {:?}", range(32), range(199));
    let there: Vec<bool> = run.tracks.samples.iter().map(|sample| sample.boats[1].is_some()).collect();
    assert!(!there[0] && there[there.len() - 1] && there.windows(2).filter(|t| t[0] != t[1]).count() == 1);
    let mut fold = ScoreFold::default();
    fold.take(&run.records, &run.events);
    assert_eq!(fold.sheet().hostile, 2);

    let elsewhere = JoinPlace { bearing_deg: 357.0, range_m: 800.0 };
    let moved = played(&text, 60, &[joins(Some(elsewhere))], &[]);
    let places: Vec<DVec3> = moved.at(33).boats.iter().filter(|b| b.0 > 0).map(|b| b.1).collect();
    assert_eq!(places.len(), 2);
    let middle = (places[0] + places[1]).truncate() / 2.0;
    let wanted = DVec2::new((-3f64).to_radians().sin(), (-3f64).to_radians().cos()) * 800.0;
    assert!(middle.distance(wanted) < 5.0, "{middle}");
}

#[test]
fn rules_texts_notes_and_stoppages_are_ordered() {
    let message = |text: &str| Order::Message { text: text.to_owned() };
    let orders = [
        (10, Order::Rules { rules: Engagement::Hold }),
        (12, message("CEASE FIRE")),
        (14, Order::Note { text: "slow to report".to_owned() }),
        (16, Order::Stoppage),
        // None of these is one: neither the text nor the boat.
        (18, message("")),
        (20, Order::Join { boat: "nobody".to_owned(), at: None }),
    ];
    let run = played(SCENARIO, 60, &orders, &[(30, true)]);
    assert!(run.has(&ExerciseFact::Rules { rules: Engagement::Hold }));
    assert!(run.has(&ExerciseFact::Note { text: "slow to report".to_owned() }));
    assert_eq!(run.at(13).message.as_deref(), Some("CEASE FIRE"));
    assert!(run.has(&ExerciseFact::StoppageOrdered) && run.has(&ExerciseFact::Stoppage));
    assert_eq!(run.records.len(), 1, "the weapon has a stoppage after its first round");
    let about =
        |e: &&ExerciseEvent| matches!(e.fact, ExerciseFact::Message { .. } | ExerciseFact::Joined { .. });
    assert_eq!(run.events.iter().filter(about).count(), 1);
}
