//! From the configuration to the devices of a run.

use std::time::Duration;

use bowwave_core::fault::{Fault, FaultChange};
use bowwave_devices::{
    clock::now,
    trigger::{InputLine, InterlockWiring, TriggerSettings, named_inputs},
};
use bowwave_render::TimeOuts;
use bowwave_trainer::{
    source::{DeviceSettings, LampChoice},
    supervisor::Mode,
};

use super::settings::{Settings, camera_settings};
use crate::config::{Config, ScreenOutput};

/// A trigger held for this long beyond the time that the belt lasts is stuck.
const STUCK_BEYOND: Duration = Duration::from_secs(3);
/// The longest that is watched for: nobody holds a trigger for an hour.
const STUCK_MOST: Duration = Duration::from_secs(3600);

/// The devices that the settings name; `mode` leaves all but camera, LCD and lamps out. What is missing is told as a fault.
pub fn device_settings(settings: &Settings, mode: Mode, faults: &mut Vec<FaultChange>) -> DeviceSettings {
    let config = &settings.config;
    let training = mode == Mode::Training;
    DeviceSettings {
        lcd: (config.output == ScreenOutput::Lcd).then(|| config.lcd.clone()),
        camera: camera_settings(settings),
        imu: training.then(|| config.imu.clone()),
        ship: config.heading.ship.clone().filter(|_| training),
        trigger: if training { trigger(settings, faults) } else { None },
        lamps: config.gpio.lamps.clone().map(|lamps| LampChoice { lamps, inputs: inputs(config) }),
        health: config.health.clone(),
        gpu_timeout: config.gpu.timeout.unwrap_or(TimeOuts::default().frame),
    }
}

/// All configured inputs. No lamp may be one of them, whether it is used now or not.
fn inputs(config: &Config) -> Vec<(&'static str, InputLine)> {
    let trigger = config.gpio.trigger.as_ref().map(|t| &t.line);
    let (interlock, power_fail) = (config.gpio.interlock.as_ref(), config.gpio.power_fail.as_ref());
    let inputs = named_inputs(trigger, interlock, power_fail, &config.heading.presses);
    inputs.map(|(name, line)| (name, line.clone())).collect()
}

/// The interlock, where it can be believed; else why the trainer does not arm.
fn interlock(settings: &Settings) -> Result<InterlockWiring, (Fault, String)> {
    let unsafe_wiring = |why: String| (Fault::InterlockWiring, why);
    if settings.config_is_former {
        let why = "the configuration was refused: correct it and reload; an earlier one may name the interlock of another gun";
        return Err((Fault::FormerConfig, why.to_owned()));
    }
    let Some(interlock) = &settings.config.gpio.interlock else {
        let why = "no interlock is configured: set [interlock] to the line that tells that the gun is inert";
        return Err(unsafe_wiring(why.to_owned()));
    };
    interlock.check().map_err(|e| unsafe_wiring(e.to_string()))?;
    if interlock.second.is_none() {
        log::warn!(
            "the interlock has one contact: the plug must be pulled and fitted after each start, and a wire that is shorted later is not \
             noticed; wire a second one (interlock.second)"
        );
    }
    Ok(interlock.clone())
}

fn trigger(settings: &Settings, faults: &mut Vec<FaultChange>) -> Option<TriggerSettings> {
    let (config, weapon) = (&settings.config, &settings.setup.scenario.weapon);
    let interlock = interlock(settings)
        .map_err(|(fault, cause)| faults.push(FaultChange::raised(now(), fault, cause)))
        .ok();
    let Some(trigger) = &config.gpio.trigger else {
        let cause = "no trigger is configured: set [trigger] to its line";
        faults.push(FaultChange::raised(now(), Fault::TriggerLost, cause));
        return None;
    };
    let belt_s = f64::from(weapon.belt) * 60.0 / weapon.rounds_per_minute.max(1.0);
    Some(TriggerSettings {
        debounce: trigger.debounce,
        stuck_after: (Duration::try_from_secs_f64(belt_s).unwrap_or(STUCK_MOST) + STUCK_BEYOND)
            .min(STUCK_MOST),
        interlock,
        power_fail: config.gpio.power_fail.clone(),
        presses: config.heading.presses.clone(),
        ..TriggerSettings::new(trigger.line.clone())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::settings::Reader;

    /// What the training's start says of an interlock that is configured so.
    fn faults_of(folder: &std::path::Path, interlock: &str) -> Vec<Fault> {
        let line = "chip = \"chip\"\nline = 1\n";
        let path = folder.join("bowwave.toml");
        std::fs::write(&path, format!("[trigger]\n{line}{interlock}")).unwrap();
        let reader = Reader::new(path, Some(folder.join("last-good")));
        let mut faults = Vec::new();
        device_settings(&reader.read().unwrap(), Mode::Training, &mut faults);
        faults.iter().map(|change| change.fault).collect()
    }

    #[test]
    fn an_interlock_arms_only_where_a_broken_wire_is_not_inert_and_its_configuration_is_the_present_one() {
        let folder = tempfile::tempdir().unwrap();
        let with =
            |keys: &str| faults_of(folder.path(), &format!("[interlock]\nchip = \"chip\"\nline = 2\n{keys}"));
        for (keys, fails_safe) in [
            ("", false),
            ("active_low = true\n", false),
            ("bias = \"as-is\"\n", false),
            ("bias = \"disabled\"\n", false),
            ("bias = \"pull-up\"\n", false),
            ("active_low = true\nbias = \"pull-down\"\n", false),
            ("bias = \"pull-down\"\n", true),
            ("bias = \"external-pull-down\"\n", true),
            ("active_low = true\nbias = \"pull-up\"\n", true),
            ("bias = \"pull-down\"\nsecond = { chip = \"chip\", line = 3, bias = \"pull-down\" }\n", false),
            (
                "bias = \"pull-down\"\nsecond = { chip = \"chip\", line = 3, active_low = true, bias = \"pull-up\" }\n",
                true,
            ),
        ] {
            let expected: &[Fault] = if fails_safe { &[] } else { &[Fault::InterlockWiring] };
            assert_eq!(with(keys), expected, "{keys}");
        }
        assert_eq!(faults_of(folder.path(), ""), [Fault::InterlockWiring]);
        // The last good one has an interlock that would do; the present one is not readable.
        with("bias = \"pull-down\"\n");
        assert_eq!(with("bias = \"pull-down\"\nunknown = 1\n"), [Fault::FormerConfig]);
    }
}
