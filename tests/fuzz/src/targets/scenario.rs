//! The scenario: any text.

use bowwave_core::world::{
    boats::{Behaviour, BoatDamage, CourseState},
    scenario::Scenario,
};

const ORIGIN: &str = "scenario.toml";
/// Moments at which boats are looked at, seconds.
const MOMENTS_S: [f64; 4] = [0.0, 0.5, 60.0, 86_400.0];

/// A scenario is refused with its place, or sea, light, weapon and boats are finite at any time.
pub fn run(input: &[u8]) {
    let Ok(text) = std::str::from_utf8(input) else { return };
    match super::memory::within(memory_bytes(text.len()), || Scenario::parse(text, ORIGIN)) {
        Err(error) => super::place::check(&error.to_string(), ORIGIN, text),
        Ok(scenario) => check(&scenario),
    }
}

/// The document as a tree of values with their places, and the table of a round's flight.
const fn memory_bytes(text_bytes: usize) -> usize {
    (1 << 20) + 512 * text_bytes
}

fn check(scenario: &Scenario) {
    assert!(
        (scenario.daylight.sun_direction.length() - 1.0).abs() < 1e-9,
        "{:?}",
        scenario.daylight.sun_direction
    );
    assert!(scenario.wind.is_finite() && scenario.wind.z == 0.0, "{:?}", scenario.wind);
    for positive in [scenario.eye_height_m, scenario.daylight.visibility_m, scenario.weapon.rounds_per_minute]
    {
        assert!(positive.is_finite() && positive > 0.0, "{scenario:?}");
    }
    assert!(scenario.duration_s.is_none_or(|s| s > 0.0 && s <= 86_400.0), "{:?}", scenario.duration_s);
    let dispersion = scenario.weapon.dispersion_mrad;
    assert!(dispersion.is_finite() && dispersion >= 0.0, "{dispersion}");
    assert!(!scenario.weapon.is_tracer(0) || scenario.weapon.tracer_every.is_some());
    let crest_m = scenario.wave_field().crest_max_m();
    assert!((0.0..1000.0).contains(&crest_m), "waves of {crest_m} m");
    for (n, boat) in scenario.boats.iter().enumerate() {
        assert!(
            scenario.boats.iter().take(n).all(|b| b.name != boat.name),
            "two boats called {:?}",
            boat.name
        );
        let top_m_s = boat.behaviour.speed_max_m_s();
        assert!(top_m_s.is_finite() && (0.0..100.0).contains(&top_m_s), "{top_m_s} m/s: {boat:?}");
        let hurt =
            BoatDamage { engine_s: Some(0.25), helm_s: Some(30.0), first_s: Some(0.25), ..BoatDamage::NONE };
        for time_s in MOMENTS_S {
            for damage in [BoatDamage::NONE, hurt] {
                let state = match &boat.behaviour {
                    Behaviour::ScriptedCourse(course) => course.state(time_s, &damage),
                    Behaviour::Crewed(start) => start.course(),
                };
                check_state(&state, top_m_s);
            }
        }
    }
}

fn check_state(state: &CourseState, top_m_s: f64) {
    assert!(state.position.is_finite() && state.heading.is_finite(), "{state:?}");
    assert!(state.turn_rate.is_finite(), "{state:?}");
    assert!((0.0..=top_m_s * (1.0 + 1e-9)).contains(&state.speed_m_s), "{state:?}, at most {top_m_s} m/s");
}
