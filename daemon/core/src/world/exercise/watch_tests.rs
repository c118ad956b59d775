use super::*;
use crate::world::exercise::{About, CallSpec, Goals, Happening};

fn at(seconds: f64) -> Time {
    Time::from_ns(7_000_000_000).plus_secs(seconds)
}

fn skiff(range_m: f64, speed_m_s: f64) -> WatchedBoat<'static> {
    WatchedBoat {
        in_reserve: false,
        name: "skiff-1",
        side: Side::Hostile,
        range_m,
        speed_m_s,
        off_bore: Some(0.5),
        seen: 1.0,
        struck: None,
        is_lit: false,
        gave_up: false,
        sinks: None,
        burns_since: None,
    }
}

fn spec() -> ExerciseSpec {
    let call = |call, before_m, within_s| CallSpec {
        call,
        about: About::Name("skiff".to_owned()),
        before_m,
        within_s,
    };
    ExerciseSpec {
        rules: Some(Engagement::Warn),
        goals: Goals { keep_off_m: 200.0, ..Goals::default() },
        calls: vec![call(Act::Report, None, Some(30.0)), call(Act::Warn, Some(300.0), None)],
        happenings: vec![
            Happening {
                cause: HappeningCause::Within(About::Side(Side::Hostile), 250.0),
                effects: vec![HappeningEffect::Rules(Engagement::Free), HappeningEffect::Stoppage],
            },
            Happening {
                cause: HappeningCause::At(2.0),
                effects: vec![HappeningEffect::Message("Port lookout: small craft".to_owned())],
            },
        ],
        ..ExerciseSpec::default()
    }
}

#[test]
fn a_boat_that_was_lit_and_opens_has_turned_away() {
    let ended = |is_lit: bool| {
        let mut watch = ExerciseWatch::new(ExerciseSpec::default());
        let mut events = Vec::new();
        for second in 0..20 {
            let boat = WatchedBoat {
                is_lit: is_lit && second == 3,
                ..skiff(300.0 + 10.0 * f64::from(second - 4).max(0.0), 10.0)
            };
            watch.follow(at(f64::from(second)), &[boat], 100, &mut events);
        }
        events.iter().any(|event| matches!(event.fact, ExerciseFact::TurnedAway { .. }))
    };
    assert!(ended(true) && !ended(false));
}

/// Names of what happened while the boat is as said at each second.
fn facts(
    watch: &mut ExerciseWatch,
    from_s: f64,
    boats: &[WatchedBoat<'_>],
) -> (Vec<ExerciseFact>, WatchOrders) {
    let (mut events, mut orders) = (Vec::new(), WatchOrders::default());
    for (i, boat) in boats.iter().enumerate() {
        let now = watch.follow(at(from_s + i as f64), &[*boat], 400, &mut events);
        orders.warned.extend(now.warned);
        orders.stoppage |= now.stoppage;
    }
    (events.into_iter().map(|event| event.fact).collect(), orders)
}

#[test]
fn an_exercise_begins_with_its_rules_and_asks_for_calls_once_a_boat_shows() {
    let mut watch = ExerciseWatch::new(spec());
    let far = WatchedBoat { seen: 0.49, ..skiff(2600.0, 10.0) };
    let shows = WatchedBoat { seen: 0.51, ..skiff(2500.0, 10.0) };
    let (facts, _) = facts(&mut watch, 0.0, &[far, shows, skiff(2400.0, 10.0)]);
    assert!(matches!(facts[0], ExerciseFact::Began { rounds: 400, hostile: 1, stop: 1, .. }), "{facts:?}");
    assert_eq!(facts[1], ExerciseFact::Rules { rules: Engagement::Warn });
    let boat = "skiff-1".to_owned();
    assert_eq!(facts[2], ExerciseFact::InView { boat: boat.clone(), side: Side::Hostile, range_m: 2500.0 });
    let asked =
        |call, before_m, within_s| ExerciseFact::CallAsked { call, boat: boat.clone(), before_m, within_s };
    assert_eq!(facts[3..5], [asked(Act::Report, None, Some(30.0)), asked(Act::Warn, Some(300.0), None)]);
    assert_eq!(facts[5], ExerciseFact::Message { text: "Port lookout: small craft".to_owned() });
    assert_eq!(facts.len(), 6);
}

#[test]
fn acts_are_about_the_boat_that_the_gun_points_at() {
    let mut watch = ExerciseWatch::new(spec());
    let pointed = WatchedBoat { off_bore: Some(0.02), ..skiff(800.0, 10.0) };
    watch.act(TraineeAct { time: at(0.2), act: Act::Warn });
    let (facts, orders) = facts(&mut watch, 1.0, &[skiff(810.0, 10.0), pointed]);
    let not_at_all = ExerciseFact::Did { act: Act::Warn, boat: None, range_m: None };
    assert!(facts.contains(&not_at_all) && orders.warned.is_empty(), "{facts:?}");
    watch.act(TraineeAct { time: at(3.0), act: Act::Warn });
    watch.act(TraineeAct { time: at(3.1), act: Act::Reload });
    let (facts, orders) = self::facts(&mut watch, 3.2, &[pointed]);
    let boat = Some("skiff-1".to_owned());
    assert!(facts.contains(&ExerciseFact::Did { act: Act::Warn, boat, range_m: Some(800.0) }), "{facts:?}");
    assert!(facts.contains(&ExerciseFact::Did { act: Act::Reload, boat: None, range_m: None }));
    assert_eq!(orders.warned, [0]);
    assert!(facts.iter().any(|fact| matches!(fact, ExerciseFact::Pointed { .. })), "{facts:?}");
}

#[test]
fn what_is_to_happen_happens_once() {
    let mut watch = ExerciseWatch::new(spec());
    let (facts, orders) =
        facts(&mut watch, 0.0, &[skiff(300.0, 10.0), skiff(240.0, 10.0), skiff(230.0, 10.0)]);
    let rules = |rules| facts.iter().filter(|fact| **fact == ExerciseFact::Rules { rules }).count();
    assert_eq!((rules(Engagement::Warn), rules(Engagement::Free)), (1, 1));
    assert!(orders.stoppage);
    assert_eq!(watch.rules(), Some(Engagement::Free));
}

#[test]
fn a_threat_ends_by_a_stop_or_by_going_away_and_may_come_back() {
    let mut watch = ExerciseWatch::new(spec());
    let struck =
        |range_m: f64, speed_m_s: f64| WatchedBoat { struck: Some(at(0.0)), ..skiff(range_m, speed_m_s) };
    let boat = "skiff-1".to_owned();
    let (comes, _) = facts(&mut watch, 0.0, &[skiff(210.0, 12.0), skiff(198.0, 12.0)]);
    assert!(comes.contains(&ExerciseFact::CameClose { boat: boat.clone() }));
    let away: Vec<_> = (0..6).map(|i| struck(198.0 + 10.0 * f64::from(i), 10.0)).collect();
    let (goes, _) = facts(&mut watch, 2.0, &away);
    assert!(goes.iter().any(|fact| matches!(fact, ExerciseFact::TurnedAway { .. })), "{goes:?}");
    assert!(goes.contains(&ExerciseFact::NoLongerClose { boat: boat.clone() }), "{goes:?}");
    assert!(watch.is_decided());
    let back: Vec<_> = (0..7).map(|i| struck(248.0 - 10.0 * f64::from(i), 10.0)).collect();
    let (comes, _) = facts(&mut watch, 8.0, &back);
    assert!(comes.contains(&ExerciseFact::CameBack { boat: boat.clone() }), "{comes:?}");
    assert!(comes.contains(&ExerciseFact::CameClose { boat: boat.clone() }));
    assert!(!watch.is_decided());
    let (stops, _) = facts(&mut watch, 15.0, &[struck(180.0, 0.2)]);
    assert!(stops.contains(&ExerciseFact::Stopped { boat: boat.clone(), range_m: 180.0 }));
    assert!(watch.is_decided());
    let mut ended = Vec::new();
    watch.finish(at(16.0), &[struck(180.0, 0.1)], 10, &mut ended);
    let nearest = ExerciseFact::Nearest { boat, side: Side::Hostile, range_m: 180.0 };
    assert_eq!(ended[0].fact, nearest);
    assert_eq!(ended[1].fact, ExerciseFact::Ended { rounds_left: 10 });
}

#[test]
fn facts_read_back_as_they_were_written() {
    let mut watch = ExerciseWatch::new(spec());
    watch.act(TraineeAct { time: at(0.0), act: Act::Identify(Side::Neutral) });
    let pointed = WatchedBoat { off_bore: Some(0.0), ..skiff(150.0, 12.0) };
    let (facts, _) = facts(&mut watch, 0.0, &[pointed, pointed]);
    for fact in facts {
        let text = serde_json::to_string(&fact).expect("written");
        assert_eq!(serde_json::from_str::<ExerciseFact>(&text).expect("read"), fact, "{text}");
    }
}
