//! Doubts about a scenario that is allowed and yet hardly meant so: things that never happen, or cannot be met.

use bowwave_core::world::{
    boats::{Act, Behaviour, CrewState},
    exercise::{About, HappeningCause, group_of},
    scenario::{BoatSpec, Scenario, Side, read::M_S_PER_KN},
};

/// Sentences about what an instructor may want to look at.
pub fn of(scenario: &Scenario) -> Vec<String> {
    let mut doubts = Vec::new();
    timeline(scenario, &mut doubts);
    calls(scenario, &mut doubts);
    goals(scenario, &mut doubts);
    weapon(scenario, &mut doubts);
    swarms(scenario, &mut doubts);
    light(scenario, &mut doubts);
    crews(scenario, &mut doubts);
    doubts
}

fn is_exercise(scenario: &Scenario) -> bool {
    scenario.exercise.briefing.is_some() || scenario.exercise.rules.is_some()
}

fn range_m(boat: &BoatSpec) -> f64 {
    boat.behaviour.begin().position.length()
}

fn covered<'a>(scenario: &'a Scenario, about: &'a About) -> impl Iterator<Item = &'a BoatSpec> {
    scenario.boats.iter().filter(|boat| about.covers(&boat.name, boat.side))
}

fn named(about: &About) -> String {
    match about {
        About::Side(side) => format!("{} boats", side.name()),
        About::Name(name) => format!("\"{name}\""),
    }
}

fn timeline(scenario: &Scenario, doubts: &mut Vec<String>) {
    for (i, happening) in scenario.exercise.happenings.iter().enumerate() {
        let event = format!("event[{}]", i + 1);
        match &happening.cause {
            HappeningCause::At(at_s) => {
                if let Some(end_s) = scenario.duration_s.filter(|end_s| at_s >= end_s) {
                    doubts.push(format!(
                        "{event} at {at_s} s never happens: the scenario ends after {end_s} s"
                    ));
                }
            }
            HappeningCause::Within(about, metres) => {
                let near = covered(scenario, about).find(|boat| range_m(boat) <= *metres);
                if let Some(boat) = near {
                    let m = range_m(boat);
                    doubts.push(format!(
                        "{event} happens at once: \"{}\" begins {m:.0} m off, within {metres} m",
                        boat.name
                    ));
                }
            }
            HappeningCause::Struck(_) => {}
        }
    }
}

fn calls(scenario: &Scenario, doubts: &mut Vec<String>) {
    for (i, call) in scenario.exercise.calls.iter().enumerate() {
        let what = format!("call[{}] (\"{}\" of {})", i + 1, call.call.name(), named(&call.about));
        let nearer = call.before_m.and_then(|m| covered(scenario, &call.about).find(|b| range_m(b) <= m));
        if let (Some(boat), Some(before_m)) = (nearer, call.before_m) {
            let m = range_m(boat);
            doubts.push(format!(
                "{what} cannot be in time for \"{}\": it begins {m:.0} m off, and is to be called before {before_m} m",
                boat.name
            ));
        }
        if let (Some(within_s), Some(end_s)) = (call.within_s, scenario.duration_s)
            && within_s > end_s
        {
            doubts.push(format!("{what} may be made in {within_s} s: the scenario ends after {end_s} s"));
        }
    }
}

fn goals(scenario: &Scenario, doubts: &mut Vec<String>) {
    let goals = &scenario.exercise.goals;
    let hostile: Vec<&BoatSpec> = scenario.boats.iter().filter(|b| b.side == Side::Hostile).collect();
    // Without an exercise nobody is to be kept off.
    let is_asked = is_exercise(scenario);
    if let Some(boat) = hostile.iter().find(|boat| is_asked && range_m(boat) < goals.keep_off_m) {
        let (name, m, keep_off_m) = (&boat.name, range_m(boat), goals.keep_off_m);
        doubts.push(format!("\"{name}\" begins {m:.0} m off, within goals.keep_off_m = {keep_off_m}"));
    }
}

fn weapon(scenario: &Scenario, doubts: &mut Vec<String>) {
    let weapon = &scenario.weapon;
    if weapon.belt == 0 && is_exercise(scenario) {
        doubts.push("weapon.belt is 0: nobody can fire".to_owned());
    }
    if let Some(every) = weapon.stoppage_every.filter(|every| *every < 5.0) {
        doubts.push(format!("weapon.stoppage_every = {every}: the weapon hardly fires a burst"));
    }
}

fn crews(scenario: &Scenario, doubts: &mut Vec<String>) {
    /// Built-in crews ask for all that their boats have, which differs a little from one to another.
    const SLACK: f64 = 1.25;
    let mut seen: Vec<&str> = Vec::new();
    for boat in &scenario.boats {
        let group = group_of(&boat.name);
        let Behaviour::Crewed(start) = &boat.behaviour else { continue };
        if seen.contains(&group) {
            continue;
        }
        seen.push(group);
        let (name, states) = (&boat.name, &start.plan.states);
        if let Some(state) = states.iter().find(|state| state.speed_m_s > SLACK * start.speed_max_m_s) {
            doubts.push(format!(
                "\"{name}\" cannot make the {:.0} kn that its crew's state \"{}\" asks for: its speed_max_kn is {:.0}",
                state.speed_m_s / M_S_PER_KN,
                state.name,
                start.speed_max_m_s / M_S_PER_KN
            ));
        }
        let mut reached = vec![0];
        let mut next = 0;
        while let Some(state) = reached.get(next).and_then(|state| states.get(*state)) {
            let new: Vec<usize> =
                state.exits.iter().map(|exit| exit.to).filter(|to| !reached.contains(to)).collect();
            reached.extend(new);
            next += 1;
        }
        if let Some((_, state)) = states.iter().enumerate().find(|(i, _)| !reached.contains(i)) {
            doubts.push(format!("nothing leads the crew of \"{name}\" to its state \"{}\"", state.name));
        }
    }
}

fn light(scenario: &Scenario, doubts: &mut Vec<String>) {
    let waits = |boat: &&BoatSpec| match &boat.behaviour {
        Behaviour::Crewed(start) => {
            start.plan.states.iter().flat_map(|state| &state.exits).any(|exit| exit.guard.lit)
        }
        _ => false,
    };
    let waiting = scenario.boats.iter().find(waits);
    match (waiting, scenario.searchlight) {
        (Some(boat), None) => doubts.push(format!(
            "\"{}\" waits until it is lit, and nothing can light it: add a table [searchlight]",
            boat.name
        )),
        (_, Some(_)) if scenario.daylight.stays_up() => {
            doubts.push("searchlight lights nobody: the sun is up".to_owned());
        }
        _ => {}
    }
}

fn swarms(scenario: &Scenario, doubts: &mut Vec<String>) {
    for boat in &scenario.boats {
        let Behaviour::Crewed(start) = &boat.behaviour else { continue };
        let Some(due_s) = start.on_target_s else { continue };
        let name = &boat.name;
        if let Some(end_s) = scenario.duration_s.filter(|end_s| due_s > *end_s) {
            doubts.push(format!("\"{name}\" is due at {due_s} s: the scenario ends after {end_s} s"));
        }
        let goes = |state: &CrewState| match state.act {
            Act::Approach { stop_m } | Act::Attack { stop_m: Some(stop_m) } => {
                Some((state.speed_m_s, stop_m))
            }
            Act::Attack { stop_m: None } => Some((state.speed_m_s, 0.0)),
            _ => None,
        };
        let fastest = start.plan.states.iter().filter_map(goes).max_by(|a, b| a.0.total_cmp(&b.0));
        let Some((speed_m_s, stop_m)) = fastest else {
            doubts
                .push(format!("\"{name}\" is due at {due_s} s, and its crew neither approaches nor attacks"));
            continue;
        };
        let speed_m_s = speed_m_s.min(start.speed_max_m_s);
        let needs_s = (range_m(boat) - stop_m) / speed_m_s.max(0.1);
        if needs_s > due_s {
            doubts.push(format!(
                "\"{name}\" cannot be there at {due_s} s: it begins {:.0} m off and needs {needs_s:.0} s at {:.0} kn",
                range_m(boat),
                speed_m_s / M_S_PER_KN
            ));
        }
    }
}
