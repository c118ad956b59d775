//! From the configuration to the devices of a run.

use std::time::Duration;

use bowwave_core::{
    fault::{Fault, FaultChange},
    world::scenario::WeaponSpec,
};
use bowwave_devices::{clock::now, trigger::TriggerSettings};
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
        trigger: if training { trigger(config, &settings.setup.scenario.weapon, faults) } else { None },
        lamps: config.lamps.clone().map(|lamps| LampChoice { lamps, inputs: inputs(config) }),
        health: config.health.clone(),
        gpu_timeout: config.gpu_timeout.unwrap_or(TimeOuts::default().frame),
    }
}

/// All configured inputs. No lamp may be one of them, whether it is used now or not.
fn inputs(config: &Config) -> Vec<(&'static str, bowwave_devices::trigger::InputLine)> {
    let lines = [
        ("trigger", config.trigger.as_ref().map(|t| &t.line)),
        ("interlock", config.interlock.as_ref()),
        ("power-fail", config.power_fail.as_ref()),
    ];
    let presses = config.heading.presses.iter().map(|press| (press.name(), Some(&press.line)));
    lines.into_iter().chain(presses).filter_map(|(name, line)| Some((name, line?.clone()))).collect()
}

fn trigger(config: &Config, weapon: &WeaponSpec, faults: &mut Vec<FaultChange>) -> Option<TriggerSettings> {
    if config.interlock.is_none() {
        let cause =
            "no interlock is configured: set [interlock] to the line that tells that the gun is inert";
        faults.push(FaultChange::raised(now(), Fault::NotInert, cause));
    }
    let Some(trigger) = &config.trigger else {
        let cause = "no trigger is configured: set [trigger] to its line";
        faults.push(FaultChange::raised(now(), Fault::TriggerLost, cause));
        return None;
    };
    let belt_s = f64::from(weapon.belt) * 60.0 / weapon.rounds_per_minute.max(1.0);
    Some(TriggerSettings {
        debounce: trigger.debounce,
        stuck_after: (Duration::try_from_secs_f64(belt_s).unwrap_or(STUCK_MOST) + STUCK_BEYOND)
            .min(STUCK_MOST),
        interlock: config.interlock.clone(),
        power_fail: config.power_fail.clone(),
        presses: config.heading.presses.clone(),
        ..TriggerSettings::new(trigger.line.clone())
    })
}
