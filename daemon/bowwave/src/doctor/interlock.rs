//! `bowwave doctor interlock`: the proof test of the inert interlock. The plug is pulled and fitted once, and each contact must follow.

use std::time::Duration;

use anyhow::{Context, Result};
use bowwave_devices::{
    clock::{now, sleep_until},
    trigger::{InterlockProbe, InterlockWiring},
};

use super::{Check, Verdict, check, failed};
use crate::{cli::DoctorInterlock, config};

/// Pause between two looks at the contacts, seconds.
const LOOK_S: f64 = 0.02;
/// Time for which they must stay as they are, seconds: contacts chatter.
const STEADY_S: f64 = 0.2;

/// Tests the interlock that the configuration names.
pub(super) fn checks(arguments: &DoctorInterlock) -> Result<Vec<Check>> {
    let config = config::read(&arguments.config)?;
    let mut checks = vec![self::wiring(config.gpio.interlock.as_ref())];
    let Some(wiring) = config.gpio.interlock.as_ref().filter(|wiring| wiring.check().is_ok()) else {
        return Ok(checks);
    };
    let probe =
        InterlockProbe::open(wiring).context("the trainer must not run meanwhile: systemctl stop bowwave")?;
    let within = Duration::from_secs(u64::from(arguments.seconds));
    let names: Vec<String> =
        wiring.contacts().map(|contact| format!("{} line {}", contact.chip, contact.line)).collect();
    checks.extend(proof(&names, |ask, active| {
        eprintln!("{ask}");
        await_levels(&probe, active, within)
    })?);
    Ok(checks)
}

/// Asks for the plug to be fitted, pulled and fitted again; `levels` are the contacts' after that. Ends at the first that does not follow.
fn proof(
    names: &[String],
    mut levels: impl FnMut(&'static str, bool) -> Result<Vec<bool>>,
) -> Result<Vec<Check>> {
    let mut checks = Vec::new();
    for (ask, active) in
        [("Fit the inert plug.", true), ("Pull the inert plug.", false), ("Fit the inert plug again.", true)]
    {
        let found = levels(ask, active)?;
        let passed = found.iter().all(|level| *level == active);
        checks.extend(names.iter().zip(found).map(|(name, level)| followed(name, active, level)));
        if !passed {
            break;
        }
    }
    Ok(checks)
}

/// Verdict on the wiring alone: a fail-safe one passes.
pub(super) fn wiring(wiring: Option<&InterlockWiring>) -> Check {
    let Some(wiring) = wiring else {
        return failed(
            "interlock",
            "none is configured: set [interlock]; without it the trainer does not arm",
        );
    };
    match wiring.check() {
        Err(e) => failed("interlock", e),
        Ok(()) if wiring.second.is_none() => check(
            "interlock",
            Verdict::Warning,
            "one contact: a broken wire reads as not inert; the plug must be pulled and fitted after each start, and a wire that is shorted later is \
             not noticed; wire a second contact with the opposite level (interlock.second)",
        ),
        Ok(()) => {
            check("interlock", Verdict::Ok, "two contacts: a broken or shorted wire reads as not inert")
        }
    }
}

fn followed(name: &str, active: bool, level: bool) -> Check {
    match (active, level) {
        (true, true) => check("interlock", Verdict::Ok, format!("{name}: inert with the plug fitted")),
        (false, false) => check("interlock", Verdict::Ok, format!("{name}: not inert with the plug pulled")),
        (true, false) => failed(
            "interlock",
            format!(
                "{name}: NOT inert with the plug fitted; look for a broken wire, a loose plug, a wrong active_low"
            ),
        ),
        (false, true) => failed(
            "interlock",
            format!(
                "{name}: still inert with the plug pulled; look for a shorted wire. Do not train before it is mended"
            ),
        ),
    }
}

/// The contacts' levels once all have been at `active` for a moment, or as they are when the time is over.
fn await_levels(probe: &InterlockProbe, active: bool, within: Duration) -> Result<Vec<bool>> {
    let begun = now();
    let mut since = None;
    loop {
        let (levels, at) = (probe.levels()?, now());
        since = if levels.iter().all(|level| *level == active) { since.or(Some(at)) } else { None };
        let is_steady = since.is_some_and(|since| at.secs_since(since) >= STEADY_S);
        if is_steady || at.secs_since(begun) >= within.as_secs_f64() {
            return Ok(levels);
        }
        sleep_until(at.plus_secs(LOOK_S));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Verdicts of two contacts, of which the second reads as `second` says after each request.
    fn verdicts(second: [bool; 3]) -> (Vec<Verdict>, Vec<bool>) {
        let names = ["a", "b"].map(str::to_owned);
        let (mut asked, mut second) = (Vec::new(), second.into_iter());
        let checks = proof(&names, |_, active| {
            asked.push(active);
            Ok(vec![active, second.next().unwrap()])
        });
        (checks.unwrap().iter().map(|check| check.verdict).collect(), asked)
    }

    #[test]
    fn contacts_that_follow_the_plug_pass_and_the_first_that_does_not_ends_the_test() {
        use Verdict::{Failed, Ok};
        assert_eq!(verdicts([true, false, true]), (vec![Ok; 6], vec![true, false, true]));
        // A broken wire, a shorted one, and one that came loose when the plug was pulled.
        assert_eq!(verdicts([false; 3]), (vec![Ok, Failed], vec![true]));
        assert_eq!(verdicts([true; 3]), (vec![Ok, Ok, Ok, Failed], vec![true, false]));
        assert_eq!(
            verdicts([true, false, false]),
            (vec![Ok, Ok, Ok, Ok, Ok, Failed], vec![true, false, true])
        );
    }
}
