//! Notes of a session for the log: the sea in the video, the heading, the unit's clock, pictures that contradict the scenario. Each is told
//! once when it changes.

use glam::DVec3;

use crate::{
    ephemeris::Moment,
    estimate::{
        HeadingCounts, SeaReport,
        clock::ClockReport,
        light::{Luminaries, SkyAgreement},
        sea::{SeaSource, Unknown},
    },
    geometry::bearing_and_elevation_deg,
};

/// The log is told when the heading's standard deviation crosses one of these, degrees: the length of a boat at 500 m, a boat's
/// distance from its neighbour, and an error at which no round is worth anything.
const LIMITS_DEG: [f64; 4] = [0.5, 1.0, 2.0, 5.0];
/// It is told again only where it came back below a limit by this share.
const BACK: f64 = 0.8;
/// The unit's clock is looked at once in so many frames: ten seconds.
const CLOCK_FRAMES: u64 = 300;

/// A line for the log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Note {
    /// Whether somebody should act on it.
    pub warning: bool,
    /// One line.
    pub text: String,
}

/// Follows a session and says what is new.
#[derive(Debug, Default)]
pub(super) struct Notes {
    new: Vec<Note>,
    sea: Option<(u8, SeaSource)>,
    sea_refused: Option<std::mem::Discriminant<Unknown>>,
    heading_above: usize,
    headings: HeadingCounts,
    clock_bad: bool,
    /// Frames since the light's agreement with the scenario is another than the one that was told last.
    light_frames: u32,
    light: SkyAgreement,
    /// That the ship's place and time are used, or contradict the scenario.
    ship_moment_told: bool,
    horizon_told: bool,
}

impl Notes {
    /// The notes that were not told yet.
    pub(super) fn new_ones(&self) -> &[Note] {
        &self.new
    }

    /// What there was has been told.
    pub(super) fn clear(&mut self) {
        self.new.clear();
    }

    fn say(&mut self, warning: bool, text: String) {
        self.new.push(Note { warning, text });
    }

    /// Takes in the sea after a frame.
    pub(super) fn sea(&mut self, report: &SeaReport) {
        let now = (report.in_use.state.get(), report.in_use.source);
        if self.sea.replace(now) != Some(now) {
            self.say(false, sea_words(report));
        }
        let refused = match &report.newest {
            // That it takes time is no refusal.
            Ok(_) | Err(Unknown::TooShort { after: None, .. }) => None,
            Err(why) => Some(std::mem::discriminant(why)),
        };
        if self.sea_refused != refused {
            self.sea_refused = refused;
            if let (Some(_), Err(why)) = (refused, &report.newest) {
                self.say(false, format!("the sea is not measured at present: {why}"));
            }
        }
    }

    /// Takes in the heading's standard deviation (radians) after a frame.
    pub(super) fn heading(&mut self, sigma: Option<f64>, counts: &HeadingCounts) {
        if counts.marks > self.headings.marks {
            let deg = sigma.unwrap_or(0.0).to_degrees();
            self.say(false, format!("the heading was set by the operator, to {deg:.2} deg"));
        }
        if counts.marks_refused > self.headings.marks_refused {
            let text = "the operator's press could not be used: set [rezero] or [landmarks] in the configuration, with from_bow_deg the \
                        ship's heading must come, and of two landmarks that are as near none is taken";
            self.say(true, text.to_owned());
        }
        self.headings = *counts;
        if let Some(line) = sigma.and_then(|sigma| self.cross(sigma.to_degrees())) {
            self.say(false, line);
        }
    }

    /// The line about a deviation of `deg` degrees, where it crossed a limit.
    fn cross(&mut self, deg: f64) -> Option<String> {
        let above = LIMITS_DEG.iter().filter(|limit| deg > **limit).count();
        let held = LIMITS_DEG.iter().filter(|limit| deg > **limit * BACK).count();
        if above > self.heading_above {
            self.heading_above = above;
            let limit = LIMITS_DEG.get(above - 1)?;
            return Some(format!(
                "the heading is known to {deg:.2} deg only (1 sigma, above {limit} deg): re-zero the gun at its stow or on a landmark"
            ));
        }
        if held < self.heading_above {
            self.heading_above = held;
            return Some(format!("the heading is known to {deg:.2} deg again (1 sigma)"));
        }
        None
    }

    /// Takes in the picture's light after a frame; `None` where no sky was seen yet.
    pub(super) fn light(&mut self, seen: Option<SkyAgreement>) {
        /// Three seconds: a camera that starts is dark or bright for less.
        const FRAMES: u32 = 90;
        let Some(seen) = seen else { return };
        self.light_frames = if seen == self.light { 0 } else { self.light_frames + 1 };
        if self.light_frames < FRAMES {
            return;
        }
        self.light_frames = 0;
        self.light = seen;
        match seen {
            SkyAgreement::BrightAtNight => self.say(
                true,
                "the scenario's sun is below the horizon and the picture's sky is bright: boats are lit as at night; give [light] \
                 of the scenario the time or the sun of the picture"
                    .to_owned(),
            ),
            SkyAgreement::DarkByDay => self.say(
                true,
                "the scenario's sun stands above the horizon and the picture's sky is dark: boats are lit as by day; give [light] \
                 of the scenario the time or the sun of the picture, or open the lens's cap"
                    .to_owned(),
            ),
            SkyAgreement::Plausible => self.say(false, "the picture's light is that of the scenario again".to_owned()),
        }
    }

    /// Takes in sun and moon after a frame.
    pub(super) fn luminaries(&mut self, seen: &Luminaries) {
        /// Angle between two suns beyond which their shadows contradict each other, radians.
        const APART: f64 = 20.0 * std::f64::consts::PI / 180.0;
        if self.ship_moment_told {
            return;
        }
        if let Some(moment) = seen.moment.filter(|_| seen.from_ship) {
            self.ship_moment_told = true;
            self.say(false, luminaries_words(seen, &moment));
        } else if let Some((Moment { place, utc }, sun)) = seen.unused
            && sun.angle_between(seen.sun) > APART
        {
            self.ship_moment_told = true;
            let (real, given) = (stands(sun), stands(seen.sun));
            self.say(
                true,
                format!(
                    "by the ship's place and time ({place}, {utc}) the sun stands {real}, the scenario puts it {given}: virtual shadows fall \
                     otherwise than real ones; with source = \"ship\" in [light] the scenario takes the ship's"
                ),
            );
        }
    }

    /// Takes in how many horizons were seen that the scenario's visibility hides.
    pub(super) fn unexpected_horizons(&mut self, count: u64) {
        /// A cloud's edge is taken for one now and then.
        const MANY: u64 = 10;
        if count >= MANY && !self.horizon_told {
            self.horizon_told = true;
            self.say(
                true,
                "the picture shows a horizon that the scenario's haze would hide, and it is not used: give [light] visibility_km of the \
                 scenario the picture's"
                    .to_owned(),
            );
        }
    }

    /// Takes in the unit's clock in frame number `frame`.
    pub(super) fn clock(&mut self, frame: u64, report: impl FnOnce() -> Option<ClockReport>) {
        if !frame.is_multiple_of(CLOCK_FRAMES) {
            return;
        }
        let Some(report) = report() else { return };
        let was = std::mem::replace(&mut self.clock_bad, report.is_bad());
        match (was, self.clock_bad) {
            (false, true) => self.say(
                true,
                format!(
                    "the inertial unit's clock runs {:+.0} ppm against this computer's and its mapped times jitter by {:.2} ms: boats swim \
                     by that much; `bowwave doctor imu` says what to do",
                    report.drift_ppm,
                    report.jitter_s * 1e3
                ),
            ),
            (true, false) => self.say(false, "the inertial unit's clock does well again".to_owned()),
            _ => {}
        }
    }
}

fn luminaries_words(seen: &Luminaries, moment: &Moment) -> String {
    let moonlight = seen.moonlight().map_or_else(String::new, |moon| {
        format!(
            "; the moon lights the scene, {}, {:.0} % of it lit",
            stands(moon.direction),
            100.0 * moon.lit
        )
    });
    let (place, utc) = (moment.place, moment.utc);
    format!("the sun stands {} by the ship's place and time ({place}, {utc}){moonlight}", stands(seen.sun))
}

/// Place of something in the sky, in words.
fn stands(direction: DVec3) -> String {
    let [bearing, elevation] = bearing_and_elevation_deg(direction);
    let side = if elevation < 0.0 { "below" } else { "above" };
    format!("at {bearing:.0} degrees, {:.0} {side} the horizon", elevation.abs())
}

fn sea_words(report: &SeaReport) -> String {
    let c = report.in_use.conditions;
    let sea = format!(
        "{:.2} m, {:.1} s, from {:.0} deg",
        c.significant_height_m,
        c.peak_period_s,
        c.from_rad.to_degrees().rem_euclid(360.0)
    );
    let source = match report.in_use.source {
        SeaSource::Ordered => "as ordered",
        SeaSource::Measured => "measured in the video",
        SeaSource::Kept => "kept from before, not measured at present",
        SeaSource::Assumed => "of the scenario, not measured yet",
    };
    format!(
        "sea state {} ({source}): {sea}, wind for reflections {:.1} m/s",
        report.in_use.state.get(),
        report.wind_m_s
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_is_told_once_and_its_end_once() {
        let mut notes = Notes::default();
        let said: Vec<_> = [0.1, 0.4, 0.6, 0.7, 1.2, 0.95, 1.1, 0.3, 0.2]
            .into_iter()
            .map(|deg| notes.cross(deg).is_some())
            .collect();
        assert_eq!(said, [false, false, true, false, true, false, false, true, false]);
    }

    #[test]
    fn what_crosses_two_limits_at_once_is_one_line() {
        let mut notes = Notes::default();
        assert!(notes.cross(3.0).expect("said").contains("above 2 deg"));
        assert!(notes.cross(0.0).expect("said").contains("0.00 deg again"));
    }

    #[test]
    fn light_that_contradicts_the_scenario_is_told_once_after_three_seconds() {
        let mut notes = Notes::default();
        let at_night = SkyAgreement::BrightAtNight;
        let told = |notes: &Notes| notes.new_ones().iter().map(|n| n.warning).collect::<Vec<_>>();
        notes.light(None);
        (0..89).for_each(|_| notes.light(Some(at_night)));
        assert!(told(&notes).is_empty());
        (0..500).for_each(|_| notes.light(Some(at_night)));
        assert_eq!(told(&notes), [true]);
        (0..200).for_each(|_| notes.light(Some(SkyAgreement::Plausible)));
        assert_eq!(told(&notes), [true, false]);
    }

    #[test]
    fn a_press_that_is_refused_is_a_warning() {
        let mut notes = Notes::default();
        let refused = HeadingCounts { marks_refused: 1, ..HeadingCounts::default() };
        notes.heading(None, &refused);
        notes.heading(None, &refused);
        assert_eq!(notes.new_ones().iter().map(|n| n.warning).collect::<Vec<_>>(), [true]);
    }
}
