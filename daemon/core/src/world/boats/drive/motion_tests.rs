use std::f64::consts::PI;

use super::*;
use crate::world::boats::{crew::hard_turn, hull::HullForm};

const H: f64 = 1.0 / 60.0;
const KN: f64 = 1852.0 / 3600.0;
/// A boat counts as stopped below this, m/s: what it still does then is drift.
const STOPPED: f64 = 2.0;

fn hull(length_m: f64, beam_m: f64, draught_m: f64) -> HullForm {
    let half = length_m / 2.0;
    HullForm::new((-half, half), draught_m, 1.2, |x| 0.5 * beam_m * (1.0 - (x / half).max(0.0).powi(3)))
}

/// The boats of the table of manoeuvres, each with its name there and its top speed, knots.
fn boats() -> [(&'static str, f64, Craft); 6] {
    let boat = |length: f64, beam: f64, draught: f64, drive, kn: f64| {
        (length, Craft::new(&hull(length, beam, draught), drive, kn * KN))
    };
    let named = |name, (length, craft)| (name, length, craft);
    [
        named("skiff outboard", boat(5.0, 1.4, 0.25, Propulsor::Outboard, 22.0)),
        named("skiff outboard", boat(6.5, 1.6, 0.28, Propulsor::Outboard, 28.0)),
        named("RHIB outboard", boat(6.5, 1.9, 0.36, Propulsor::Outboard, 38.0)),
        named("RHIB outboard", boat(7.5, 2.1, 0.4, Propulsor::Outboard, 42.0)),
        named("RHIB waterjet", boat(9.0, 2.6, 0.5, Propulsor::Jet, 36.0)),
        named("patrol boat shaft", boat(12.0, 3.2, 0.7, Propulsor::Shaft, 28.0)),
    ]
}

/// A trial: the state and the time at its end, and the farthest that the boat came.
struct Trial {
    state: DriveState,
    time_s: f64,
}

/// Steps a boat from a steady speed until `done`, or for ten minutes.
fn trial(
    craft: &Craft,
    speed_m_s: f64,
    orders: impl Fn(&DriveState) -> Orders,
    done: impl Fn(&DriveState) -> bool,
) -> Trial {
    let mut state = DriveState::steady(craft, DVec2::ZERO, 0.0, speed_m_s);
    let mut time_s = 0.0;
    while !done(&state) && time_s < 600.0 {
        state = craft.step(&state, &orders(&state), &Surroundings::default(), H);
        time_s += H;
    }
    Trial { state, time_s }
}

/// A helmsman who turns as hard as he dares, with the throttle as it was.
fn turning(craft: &Craft, throttle: f64) -> impl Fn(&DriveState) -> Orders {
    let craft = craft.clone();
    move |state| Orders { throttle, ..craft.turn_at(state, hard_turn(state.surge)) }
}

/// What the trial of a row of the table gives.
fn measured(craft: &Craft, quantity: &str, speed_m_s: f64) -> f64 {
    let length_m = craft.length_m;
    let throttle = craft.throttle_for(speed_m_s);
    let whole_turns =
        |n: f64| trial(craft, speed_m_s, turning(craft, throttle), move |s| s.heading > n * 2.0 * PI).state;
    let stop = |throttle: f64| {
        trial(craft, speed_m_s, move |_| Orders { throttle, helm: 0.0 }, |s| s.surge < STOPPED)
    };
    let full = Orders { throttle: 1.0, helm: 0.0 };
    match quantity {
        "tactical diameter" => {
            trial(craft, speed_m_s, turning(craft, throttle), |s| s.heading > PI).state.centre.x / length_m
        }
        "turn rate sustained" => whole_turns(3.0).yaw_rate.to_degrees(),
        "speed kept in hard turn" => whole_turns(3.0).surge / speed_m_s,
        "lateral acceleration" => {
            let state = whole_turns(1.0);
            state.surge * state.yaw_rate / GRAVITY_M_S2
        }
        "heel into turn" => {
            let state = whole_turns(1.0);
            craft.way_attitude(&state.course(craft)).lean.to_degrees()
        }
        "throttle-off stop distance" => stop(0.0).state.centre.y / length_m,
        "throttle-off stop time" => stop(0.0).time_s,
        "crash stop (astern) distance" | "crash stop (bucket) distance" | "crash stop distance" => {
            stop(-1.0).state.centre.y / length_m
        }
        "crash stop time" => stop(-1.0).time_s,
        "time to plane" => {
            trial(craft, 0.0, move |_| full, |s| craft.running.at(s.surge).planing > 0.9).time_s
        }
        "time 0 to 30 kn" => trial(craft, 0.0, move |_| full, |s| s.surge > 30.0 * KN).time_s,
        other => panic!("no trial for '{other}'"),
    }
}

#[test]
fn boats_turn_and_stop_within_the_published_ranges() {
    let boats = boats();
    let (mut rows, mut off) = (0, Vec::new());
    for line in
        include_str!("../../../../data/craft_manoeuvre.csv").lines().filter(|l| !l.starts_with('#')).skip(1)
    {
        let cells: Vec<&str> = line.split(',').collect();
        let number = |i: usize| cells[i].parse::<f64>().ok();
        let Some((_, _, craft)) =
            boats.iter().find(|(name, length, _)| *name == cells[0] && number(1) == Some(*length))
        else {
            assert!(cells[0] == "merchant ship" || cells[1] == "11", "no boat for {line}");
            continue;
        };
        let speed = number(2).unwrap_or(0.0) * KN;
        let (low, high) = (number(5).expect("low"), number(6).expect("high"));
        let is = measured(craft, cells[3], speed);
        println!("{} {} m {} kn, {}: {is:.2} in {low} to {high}", cells[0], cells[1], cells[2], cells[3]);
        rows += 1;
        if !(low..=high).contains(&is) {
            off.push(format!("{line}: {is:.2}"));
        }
    }
    assert!(rows > 15, "{rows} rows");
    assert!(off.is_empty(), "{off:#?}");
}

#[test]
fn a_boat_keeps_the_speed_that_its_throttle_is_set_for_and_reaches_its_greatest() {
    for (name, _, craft) in boats() {
        for share in [0.3, 0.6, 1.0] {
            let speed = share * craft.speed_max_m_s;
            let throttle = craft.throttle_for(speed);
            let end = trial(&craft, speed, move |_| Orders { throttle, helm: 0.0 }, |_| false).state;
            assert!((end.surge - speed).abs() < 0.02 * speed, "{name}: {} of {speed}", end.surge);
            assert!(end.centre.x.abs() < 1e-9 && end.yaw_rate == 0.0, "{name} goes straight");
        }
    }
}

#[test]
fn a_mirrored_helm_turns_a_mirrored_way() {
    for (name, _, craft) in boats() {
        let run = |side: f64| {
            let orders = move |_: &DriveState| Orders { throttle: 0.7, helm: 0.6 * side };
            trial(&craft, 8.0, orders, |s| s.heading.abs() > 2.0).state
        };
        let (right, left) = (run(1.0), run(-1.0));
        assert!((right.centre.x + left.centre.x).abs() < 1e-9, "{name}: {right:?}, {left:?}");
        assert!((right.centre.y - left.centre.y).abs() < 1e-9 && (right.sway + left.sway).abs() < 1e-9);
        assert!(right.sway < 0.0, "{name} slides outwards");
    }
}

#[test]
fn wild_orders_never_throw_a_boat() {
    for (name, _, craft) in boats() {
        let mut state = DriveState::default();
        let top = 1.2 * craft.speed_max_m_s;
        for i in 0..60 * 600 {
            // Ahead, astern, hard over and back, each as long as another prime of steps; slopes of a sea that breaks.
            let sign = |steps: i32| if (i / steps) % 2 == 0 { 1.0 } else { -1.0 };
            let orders = Orders { throttle: sign(307), helm: sign(211) };
            let around =
                Surroundings { forward_slope: 0.2 * sign(97), port_slope: 0.2 * sign(61), anchor: None };
            state = craft.step(&state, &orders, &around, H);
            let speed = state.surge.hypot(state.sway);
            assert!(speed < top + 8.0 && state.yaw_rate.abs() < 3.0, "{name} at step {i}: {state:?}");
        }
    }
}
