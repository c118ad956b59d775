use glam::DVec3;

use super::*;

fn at(seconds: f64) -> Time {
    Time::from_ns(3_000_000_000).plus_secs(seconds)
}

fn event(seconds: f64, fact: ExerciseFact) -> ExerciseEvent {
    ExerciseEvent { time: at(seconds), fact }
}

fn began(stop: u32, self_defence_m: f64) -> ExerciseEvent {
    let fact = ExerciseFact::Began { rounds: 100, hostile: 2, keep_off_m: 150.0, self_defence_m, stop };
    event(0.0, fact)
}

fn in_view(seconds: f64, boat: &str, side: Side) -> ExerciseEvent {
    event(seconds, ExerciseFact::InView { boat: boat.to_owned(), side, range_m: 900.0 })
}

fn stopped(seconds: f64, boat: &str, range_m: f64) -> ExerciseEvent {
    event(seconds, ExerciseFact::Stopped { boat: boat.to_owned(), range_m })
}

fn did(seconds: f64, act: Act, boat: &str, range_m: f64) -> ExerciseEvent {
    let (boat, range_m) = (Some(boat.to_owned()), Some(range_m));
    event(seconds, ExerciseFact::Did { act, boat, range_m })
}

fn shot(seconds: f64, outcome: Outcome) -> ShotRecord {
    ShotRecord { shot: 1, fired: at(seconds), muzzle: DVec3::ZERO, bore: DVec3::Y, pose_age_ns: 0, outcome }
}

fn hit(seconds: f64, boat: &str, side: Side) -> ShotRecord {
    let (boat, time) = (boat.to_owned(), at(seconds + 0.5));
    let (range_m, point) = (300.0, DVec3::ZERO);
    shot(seconds, Outcome::Hit { boat, side: Some(side), zone: Zone::Engine, time, range_m, point })
}

fn miss(seconds: f64, boat: &str, miss_m: f64) -> ShotRecord {
    let boat = Some(boat.to_owned());
    shot(seconds, Outcome::Miss { boat, miss_m, time: at(seconds + 0.5), range_m: 300.0 })
}

fn sheet(events: &[ExerciseEvent], shots: &[ShotRecord]) -> ScoreSheet {
    let mut fold = ScoreFold::default();
    events.iter().for_each(|event| fold.event(event));
    shots.iter().for_each(|shot| fold.shot(shot));
    fold.sheet()
}

#[test]
fn a_flawless_run_has_all_points() {
    let call = |boat: &str| ExerciseFact::CallAsked {
        call: Act::Report,
        boat: boat.to_owned(),
        before_m: Some(500.0),
        within_s: None,
    };
    let events = [
        began(2, 0.0),
        event(0.0, ExerciseFact::Rules { rules: Engagement::Tight }),
        in_view(1.0, "a", Side::Hostile),
        event(1.0, call("a")),
        in_view(2.0, "b", Side::Hostile),
        event(2.0, call("b")),
        did(5.0, Act::Report, "a", 800.0),
        did(6.0, Act::Report, "b", 700.0),
        did(8.0, Act::Identify(Side::Hostile), "a", 600.0),
        did(9.0, Act::Identify(Side::Hostile), "b", 600.0),
        stopped(20.0, "a", 320.0),
        stopped(30.0, "b", 280.0),
        event(40.0, ExerciseFact::Ended { rounds_left: 96 }),
    ];
    let shots = [hit(12.0, "a", Side::Hostile), miss(12.1, "a", 2.0), hit(25.0, "b", Side::Hostile)];
    let sheet = sheet(&events, &shots);
    assert_eq!(sheet.points, Some(100.0), "{sheet:#?}");
    assert_eq!((sheet.stopped, sheet.hostile, sheet.duration_s), (2, 2, 40.0));
    assert_eq!((sheet.rounds.bursts, sheet.rounds.first_round_hits), (2, 2));
    assert_eq!(sheet.rounds.per_stop, Some(1.5));
    assert_eq!(sheet.calls, CallsSheet { asked: 2, in_time: 2, ..CallsSheet::default() });
    let a = &sheet.boats[0];
    assert_eq!((a.reported_s, a.identified_as, a.hits), (Some(4.0), Some("hostile"), 1));
    assert_eq!((a.detected_s, a.pointed_s), (Some(4.0), None));
}

#[test]
fn a_boat_is_detected_by_the_gun_or_by_word_and_never_before_it_could_be_seen() {
    let pointed =
        |s: f64, boat: &str| event(s, ExerciseFact::Pointed { boat: boat.to_owned(), range_m: 700.0 });
    let events = [
        began(2, 0.0),
        did(1.0, Act::Report, "b", 950.0),
        in_view(2.0, "a", Side::Hostile),
        in_view(3.0, "b", Side::Hostile),
        pointed(6.0, "a"),
        did(8.0, Act::Report, "a", 800.0),
        in_view(9.0, "c", Side::Hostile),
    ];
    let detected: Vec<Option<f64>> = sheet(&events, &[]).boats.iter().map(|boat| boat.detected_s).collect();
    assert_eq!(detected, [Some(4.0), Some(0.0), None]);
}

#[test]
fn time_under_threat_of_two_boats_at_once_counts_once() {
    let close = |s: f64, boat: &str| event(s, ExerciseFact::CameClose { boat: boat.to_owned() });
    let no_longer = |s: f64, boat: &str| event(s, ExerciseFact::NoLongerClose { boat: boat.to_owned() });
    let events = [
        began(2, 0.0),
        close(10.0, "a"),
        close(14.0, "b"),
        no_longer(16.0, "a"),
        no_longer(19.0, "b"),
        close(30.0, "a"),
        event(33.0, ExerciseFact::Ended { rounds_left: 0 }),
    ];
    assert_eq!(sheet(&events, &[]).under_threat_s, 12.0);
}

#[test]
fn rules_are_those_of_when_a_round_was_fired() {
    let rules = |s: f64, rules| event(s, ExerciseFact::Rules { rules });
    let events = [
        began(1, 350.0),
        in_view(0.0, "a", Side::Hostile),
        in_view(0.0, "n", Side::Neutral),
        rules(0.0, Engagement::Hold),
        rules(10.0, Engagement::Warn),
        did(15.0, Act::Warn, "a", 700.0),
        did(15.0, Act::Warn, "n", 700.0),
        rules(20.0, Engagement::Tight),
        did(25.0, Act::Identify(Side::Hostile), "n", 700.0),
    ];
    let fired = |s: f64, boat: Option<&str>| {
        let (boat, range_m) = (boat.map(str::to_owned), boat.map(|_| 300.0));
        event(s, ExerciseFact::Fired { shot: 1, boat, range_m })
    };
    let breaches = |rounds: &[(f64, Option<&str>)]| {
        let rounds = rounds.iter().map(|(s, boat)| fired(*s, *boat));
        let sheet = sheet(&events.iter().cloned().chain(rounds).collect::<Vec<_>>(), &[]);
        sheet.breaches.iter().map(|b| (b.at_s, b.rules, b.rounds)).collect::<Vec<_>>()
    };
    // In self-defence any rules allow it; of the neutral boat none does.
    assert_eq!(breaches(&[(5.0, Some("a"))]), []);
    assert_eq!(breaches(&[(5.0, Some("n")), (5.1, Some("n"))]), [(5.0, Engagement::Hold, 2)]);
    assert_eq!(breaches(&[(5.0, None)]), [(5.0, Engagement::Hold, 1)]);
    assert_eq!(breaches(&[(12.0, Some("n"))]), [(12.0, Engagement::Warn, 1)]);
    assert_eq!(breaches(&[(12.0, None)]), [], "a shot across the bow");
    assert_eq!(breaches(&[(16.0, Some("n"))]), []);
    assert_eq!(breaches(&[(21.0, Some("n"))]), [(21.0, Engagement::Tight, 1)]);
    assert_eq!(breaches(&[(26.0, Some("n"))]), [], "it was called hostile");
}

#[test]
fn neutrals_that_were_struck_cost_and_count_as_no_hits() {
    let events = [began(1, 0.0), in_view(0.0, "a", Side::Hostile), stopped(20.0, "a", 320.0)];
    let good = [hit(12.0, "a", Side::Hostile)];
    let bad = [hit(12.0, "a", Side::Hostile), hit(13.0, "n", Side::Neutral), hit(13.1, "n", Side::Neutral)];
    let (good, bad) = (sheet(&events, &good), sheet(&events, &bad));
    assert_eq!(good.points, Some(100.0));
    assert_eq!((bad.rounds.hits, bad.rounds.neutral_hits), (1, 2));
    assert!(bad.points.is_some_and(|points| points <= 80.0), "{bad:?}");
}

#[test]
fn calls_may_be_late_missing_or_wrong() {
    let call = |call, before_m, within_s| {
        event(1.0, ExerciseFact::CallAsked { call, boat: "a".to_owned(), before_m, within_s })
    };
    let events = [
        began(1, 0.0),
        in_view(1.0, "a", Side::Hostile),
        call(Act::Report, None, Some(10.0)),
        call(Act::Warn, Some(400.0), None),
        call(Act::Identify(Side::Hostile), Some(400.0), None),
        did(12.0, Act::Report, "a", 700.0),
        did(13.0, Act::Warn, "a", 600.0),
        did(14.0, Act::Identify(Side::Neutral), "a", 600.0),
    ];
    let calls = sheet(&events, &[]).calls;
    assert_eq!(calls, CallsSheet { asked: 3, in_time: 1, late: 1, missing: 1, wrong: 1 });
}

#[test]
fn runs_without_events_have_rounds_and_no_points() {
    let shots = [miss(1.0, "a", 3.0), hit(1.1, "a", Side::Hostile)];
    let sheet = sheet(&[], &shots);
    assert_eq!(sheet.points, None);
    assert_eq!((sheet.rounds.fired, sheet.rounds.hits), (2, 1));
}
