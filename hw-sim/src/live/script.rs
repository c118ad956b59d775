//! A script that moves the hands: the same aim every time.

use bowwave_core::{
    act::Act,
    text::toml::{OptionalKey, Spanned, TomlError, TomlSection, TomlText, number, one_of},
    time::Time,
};
use glam::DVec2;
use serde::Deserialize;

use super::{gun::BEGIN, hands::Hands};
use crate::panorama::{ELEVATION, TRAVERSE_MAX};

/// Most steps of a script.
const STEPS_MAX: usize = 10_000;
/// Longest script, seconds.
const LENGTH_MAX_S: f64 = 86_400.0;

/// Shortest pull of the trigger, seconds: a shorter one may fall between two samples of the switch.
const PRESS_LEAST_S: f64 = 0.01;

/// A script that is played: what is done, in the order of time.
#[derive(Clone, Debug, PartialEq)]
pub struct Script {
    steps: Vec<ScriptStep>,
    /// Steps begun.
    begun: usize,
    aim: Option<ScriptAim>,
    release_s: Option<f64>,
}

/// A turn.
#[derive(Clone, Copy, Debug, PartialEq)]
struct ScriptAim {
    from: DVec2,
    to: DVec2,
    begin_s: f64,
    over_s: f64,
}

/// One thing that is done.
#[derive(Clone, Copy, Debug, PartialEq)]
struct ScriptStep {
    at_s: f64,
    /// Azimuth and elevation to turn to, radians.
    azimuth: Option<f64>,
    elevation: Option<f64>,
    over_s: f64,
    press_s: Option<f64>,
    act: Option<Act>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawScript {
    step: Vec<Spanned<RawStep>>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawStep {
    at_s: OptionalKey<f64>,
    azimuth_deg: OptionalKey<f64>,
    elevation_deg: OptionalKey<f64>,
    over_s: OptionalKey<f64>,
    press_s: OptionalKey<f64>,
    act: OptionalKey<String>,
}

impl Script {
    /// Reads a script: `[[step]]` tables. `origin` is its name in errors.
    pub fn parse(text: &str, origin: &str) -> Result<Self, TomlError> {
        let text = TomlText::new(text, origin)?;
        let (raw, _) = text.read::<RawScript>(&[])?;
        let mut steps: Vec<ScriptStep> = Vec::new();
        for (section, raw) in text.sections("step", raw.step, STEPS_MAX)? {
            let step = step(&section, &raw)?;
            if let Some(before) = steps.last().filter(|before| before.at_s > step.at_s) {
                let problem = format!(
                    "{} s comes after {} s of the step before: put steps in the order of time",
                    step.at_s, before.at_s
                );
                return Err(section.error("at_s", problem));
            }
            steps.push(step);
        }
        Ok(Self { steps, begun: 0, aim: None, release_s: None })
    }

    /// Moves the hands as the script says for `time_s` seconds after the begin, which is `time` on the host's clock.
    pub(super) fn play(&mut self, time_s: f64, time: Time, hands: &Hands) {
        while let Some(step) = self.steps.get(self.begun).filter(|step| step.at_s <= time_s) {
            self.begun += 1;
            if step.azimuth.is_some() || step.elevation.is_some() {
                let from = self.aim.map_or(BEGIN, |aim| aim.at(time_s).0);
                let to = DVec2::new(step.azimuth.unwrap_or(from.x), step.elevation.unwrap_or(from.y));
                self.aim = Some(ScriptAim { from, to, begin_s: step.at_s, over_s: step.over_s });
            }
            if let Some(press_s) = step.press_s {
                hands.press(true);
                self.release_s = Some(self.release_s.unwrap_or(0.0).max(step.at_s + press_s));
            }
            if let Some(act) = step.act {
                hands.act(act);
            }
        }
        if self.release_s.is_some_and(|release_s| release_s <= time_s) {
            hands.press(false);
            self.release_s = None;
        }
        if let Some(aim) = &self.aim {
            let (direction, rates) = aim.at(time_s);
            hands.point(time, direction, rates);
        }
    }
}

impl ScriptAim {
    /// Direction and its rates.
    fn at(&self, time_s: f64) -> (DVec2, DVec2) {
        let share =
            if self.over_s > 0.0 { ((time_s - self.begin_s) / self.over_s).clamp(0.0, 1.0) } else { 1.0 };
        let moves = if share < 1.0 { (self.to - self.from) / self.over_s } else { DVec2::ZERO };
        (self.from.lerp(self.to, share), moves)
    }
}

fn step(section: &TomlSection<'_>, raw: &RawStep) -> Result<ScriptStep, TomlError> {
    let text = section.text;
    let seconds = || number(0.0..=LENGTH_MAX_S, "s");
    let angle = |key: &OptionalKey<f64>, [least, most]: [f64; 2]| -> Result<Option<f64>, TomlError> {
        let range = least.to_degrees().round()..=most.to_degrees().round();
        Ok(text.given(key, number(range, "degrees"))?.map(f64::to_radians))
    };
    Ok(ScriptStep {
        at_s: section.required("at_s", &raw.at_s, seconds())?,
        azimuth: angle(&raw.azimuth_deg, [-TRAVERSE_MAX, TRAVERSE_MAX])?,
        elevation: angle(&raw.elevation_deg, ELEVATION)?,
        over_s: text.given(&raw.over_s, seconds())?.unwrap_or(0.0),
        press_s: text.given(&raw.press_s, number(PRESS_LEAST_S..=LENGTH_MAX_S, "s"))?,
        act: text.given(&raw.act, one_of(&Act::ALL.map(|act| (act.name(), act))))?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::live::gun::Wish;

    const TEXT: &str = r#"
[[step]]
at_s = 0
azimuth_deg = 10
elevation_deg = -2

[[step]]
at_s = 1
azimuth_deg = 20
over_s = 2
act = "report"

[[step]]
at_s = 4
press_s = 0.5
"#;

    #[test]
    fn a_script_is_played_by_its_times() {
        let mut script = Script::parse(TEXT, "test").unwrap();
        let (hands, origin) = (Hands::default(), Time::from_ns(1_000));
        let mut seen = Vec::new();
        for step in 0..1200 {
            let time_s = f64::from(step) * 0.005;
            let time = origin.plus_secs(time_s);
            script.play(time_s, time, &hands);
            let (pressed, act) = hands.word();
            seen.push((hands.wish(time, DVec2::ZERO), pressed, act));
        }
        let direction = |at_s: f64| match seen[(at_s * 200.0) as usize].0 {
            Wish::World(direction, rates) => {
                (direction.x.to_degrees(), direction.y.to_degrees(), rates.x.to_degrees())
            }
            Wish::Mount(..) => panic!("no direction in the world"),
        };
        assert_eq!(direction(0.5), (10.0, -2.0, 0.0));
        let (azimuth, elevation, rate) = direction(2.0);
        assert!((azimuth - 15.0).abs() < 1e-9 && (elevation + 2.0).abs() < 1e-9 && (rate - 5.0).abs() < 1e-9);
        assert!((direction(5.0).0 - 20.0).abs() < 1e-9);
        let pressed = seen.iter().filter(|(_, pressed, _)| *pressed).count();
        assert_eq!(pressed, 100);
        assert_eq!(seen.iter().filter_map(|(_, _, act)| *act).collect::<Vec<_>>(), [Act::Report]);
    }

    #[test]
    fn wrong_scripts_are_refused_by_line_with_what_to_do() {
        for (text, place, says) in [
            ("[[step]]\nazimuth_deg = 3", "test:1", "is missing; give"),
            ("[[step]]\nat_s = -1", "test:2", "is not allowed; give"),
            ("[[step]]\nat_s = 2\n[[step]]\nat_s = 1", "test:3", "in the order of time"),
            ("[[step]]\nat_s = 1\nazimuth_deg = 120", "test:3", "-70"),
            ("[[step]]\nat_s = 1\npress_s = 0", "test:3", "0.01"),
            ("[[step]]\nat_s = 1\nact = \"shout\"", "test:3", "report"),
            ("[[step]]\nat_s = 1\nazimut_deg = 1", "test:3", "azimuth_deg"),
        ] {
            let error = Script::parse(text, "test").unwrap_err().to_string();
            assert!(error.starts_with(place) && error.contains(says), "{text}: {error}");
        }
    }
}
