//! Causes of a miss, in the shooter's terms: the direction in which a round left against the aim that would have hit.
//!
//! All directions are angles at the muzzle, milliradians, to the right of and over the line from the muzzle to the target. Line of sight and
//! barrel are followed over the last seconds before the round left, so that an aim that was off all the time, one that ran away from the
//! target and one that jerked at the trigger are different causes.

use std::fmt;

use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

use crate::world::gunnery::{Projectile, aim_to_hit};

/// How long before a round the barrel is followed, seconds.
pub const AIM_TREND_S: f64 = 0.7;
/// What the barrel did in the last moment belongs to the trigger, seconds.
const TRIGGER_S: f64 = 0.12;
/// Fewest samples that show a trend.
const SAMPLES_FEWEST: usize = 5;
/// Sideways movement of a target that needs no lead, metres in the time of flight.
const LEADLESS_M: f64 = 0.3;

/// The barrel at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoreSample {
    /// Seconds before the round left the muzzle.
    pub before_s: f64,
    /// The muzzle, world, metres.
    pub muzzle: DVec3,
    /// Direction of the barrel, world, unit vector.
    pub bore: DVec3,
}

/// A round that missed.
#[derive(Clone, Copy, Debug)]
pub struct MissedRound<'a> {
    /// Its ammunition.
    pub projectile: Projectile,
    /// Velocity of the air, world, m/s.
    pub wind: DVec3,
    /// The muzzle as it left, world, metres.
    pub muzzle: DVec3,
    /// Direction of the barrel then, unit vector.
    pub bore: DVec3,
    /// Direction in which it left, scatter included, unit vector.
    pub flown: DVec3,
    /// The barrel before that, oldest first.
    pub before: &'a [BoreSample],
}

/// A cause of a miss.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MissCause {
    /// The barrel pointed too far ahead of or behind the target all the time.
    Lead,
    /// It pointed over or under it all the time.
    Elevation,
    /// It ran away from the target, or the target from it: the gun was swung, or the ship rolled, at another rate than the target's.
    Tracking,
    /// It left the target in the last moment before the round.
    Jerk,
    /// The round's own scatter.
    Dispersion,
}

impl MissCause {
    /// All causes, in the order of [`MissExplanation::parts_mrad`].
    pub const ALL: [Self; 5] = [Self::Lead, Self::Elevation, Self::Tracking, Self::Jerk, Self::Dispersion];

    /// The name in tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Lead => "lead",
            Self::Elevation => "elevation",
            Self::Tracking => "tracking",
            Self::Jerk => "jerk",
            Self::Dispersion => "dispersion",
        }
    }
}

impl fmt::Display for MissCause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// By how much a round missed, and why.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MissExplanation {
    /// Distance of the target as it would have been met, metres.
    pub range_m: f64,
    /// Lead that would have hit, to the right, mrad.
    pub lead_needed_mrad: f64,
    /// Elevation over the line of sight that would have hit, mrad.
    pub elevation_needed_mrad: f64,
    /// Way in which the target goes: 1 to the right, -1 to the left, 0 where it needs no lead.
    pub target_goes: i8,
    /// Error of the direction in which the round left, to the right and over, mrad: the sum of the parts.
    pub error_mrad: [f64; 2],
    /// Part of each of [`MissCause::ALL`] in that.
    pub parts_mrad: [[f64; 2]; 5],
}

impl MissExplanation {
    /// Explains a miss of a target that was at `target`, world, metres, so many seconds after the round left (before, where negative).
    /// `None` where no aim would have hit it.
    pub fn of(round: &MissedRound<'_>, target: impl Fn(f64) -> DVec3) -> Option<Self> {
        let aim = aim_to_hit(round.projectile, round.muzzle, round.wind, &target)?;
        let sight = Sight::at(round.muzzle, target(0.0))?;
        let needed = sight.angles(aim.direction);
        let (bore, flown) = (sight.angles(round.bore), sight.angles(round.flown));
        let (held, drift) = trend(round.before, &target).unwrap_or((bore, DVec2::ZERO));
        let steady = held - needed;
        let parts =
            [DVec2::new(steady.x, 0.0), DVec2::new(0.0, steady.y), drift, bore - held - drift, flown - bore];
        let goes = sight.right.dot(aim.at - target(0.0));
        Some(Self {
            range_m: aim.at.distance(round.muzzle),
            lead_needed_mrad: needed.x,
            elevation_needed_mrad: needed.y,
            target_goes: if goes.abs() < LEADLESS_M { 0 } else { goes.signum() as i8 },
            error_mrad: (flown - needed).to_array(),
            parts_mrad: parts.map(|part| part.to_array()),
        })
    }

    /// Size of a cause's part, mrad.
    pub fn part_mrad(&self, cause: MissCause) -> f64 {
        let [right, over] = self.parts_mrad[cause as usize];
        right.hypot(over)
    }

    /// The cause with the largest part.
    pub fn largest(&self) -> MissCause {
        let larger = |a: MissCause, b: MissCause| if self.part_mrad(b) > self.part_mrad(a) { b } else { a };
        MissCause::ALL.into_iter().reduce(larger).unwrap_or(MissCause::Dispersion)
    }

    /// Whether the round passed so near that it was fired at the boat, and its miss says something of the shooter.
    pub fn was_aimed(&self) -> bool {
        const NEAR_M: f64 = 50.0;
        let [right, over] = self.error_m();
        right.hypot(over) <= NEAR_M
    }

    /// By how much the round passed, to the right and over, metres at the target's distance.
    pub fn error_m(&self) -> [f64; 2] {
        self.error_mrad.map(|mrad| mrad * 1e-3 * self.range_m)
    }
}

/// As a coach says it: `6.2 m behind and 1.1 m under at 312 m; lead: 4.1 mrad to the right, 12.0 would have hit`.
impl fmt::Display for MissExplanation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [right, over] = self.error_m();
        let ahead = match (self.target_goes, right >= 0.0) {
            (0, true) => "right",
            (0, false) => "left",
            (goes, is_right) if (goes > 0) == is_right => "ahead",
            _ => "behind",
        };
        let above = if over >= 0.0 { "over" } else { "under" };
        write!(f, "{:.1} m {ahead} and {:.1} m {above} at {:.0} m; ", right.abs(), over.abs(), self.range_m)?;
        let side = |mrad: f64| if mrad >= 0.0 { "right" } else { "left" };
        match self.largest() {
            MissCause::Lead => {
                let held = self.lead_needed_mrad + self.parts_mrad[MissCause::Lead as usize][0];
                write!(
                    f,
                    "lead: {:.1} mrad to the {}, {:.1} to the {} would have hit",
                    held.abs(),
                    side(held),
                    self.lead_needed_mrad.abs(),
                    side(self.lead_needed_mrad)
                )
            }
            MissCause::Elevation => {
                let held = self.elevation_needed_mrad + self.parts_mrad[MissCause::Elevation as usize][1];
                let side = |mrad: f64| if mrad >= 0.0 { "over" } else { "under" };
                write!(
                    f,
                    "elevation: {:.1} mrad {} the target, {:.1} {} it would have hit",
                    held.abs(),
                    side(held),
                    self.elevation_needed_mrad.abs(),
                    side(self.elevation_needed_mrad)
                )
            }
            cause => {
                let why = match cause {
                    MissCause::Tracking => "tracking: the barrel did not keep up with the target, by",
                    MissCause::Jerk => "jerk: the barrel left the target as the round was fired, by",
                    _ => "dispersion: the round's own scatter,",
                };
                write!(f, "{why} {:.1} mrad", self.part_mrad(cause))
            }
        }
    }
}

/// A line of sight with the directions across it.
#[derive(Clone, Copy)]
struct Sight {
    forward: DVec3,
    right: DVec3,
    up: DVec3,
}

impl Sight {
    fn at(muzzle: DVec3, target: DVec3) -> Option<Self> {
        let forward = (target - muzzle).try_normalize()?;
        let right = forward.cross(DVec3::Z).try_normalize()?;
        Some(Self { forward, right, up: right.cross(forward) })
    }

    /// A direction's angles to the right and over, mrad.
    fn angles(&self, direction: DVec3) -> DVec2 {
        let along = direction.dot(self.forward);
        DVec2::new(direction.dot(self.right), direction.dot(self.up)).map(|across| 1e3 * across.atan2(along))
    }
}

/// Where the barrel was held about the target, in the mean before the trigger's moment, and how far it has gone from there since: a straight
/// line through the samples.
fn trend(before: &[BoreSample], target: impl Fn(f64) -> DVec3) -> Option<(DVec2, DVec2)> {
    let relative = |sample: &BoreSample| {
        let sight = Sight::at(sample.muzzle, target(-sample.before_s))?;
        Some((-sample.before_s, sight.angles(sample.bore)))
    };
    let steady = before.iter().filter(|s| (TRIGGER_S..=AIM_TREND_S).contains(&s.before_s));
    let samples: Vec<(f64, DVec2)> = steady.filter_map(relative).collect();
    if samples.len() < SAMPLES_FEWEST {
        return None;
    }
    let count = samples.len() as f64;
    let time = samples.iter().map(|(t, _)| t).sum::<f64>() / count;
    let held = samples.iter().map(|(_, held)| *held).sum::<DVec2>() / count;
    let spread: f64 = samples.iter().map(|(t, _)| (t - time).powi(2)).sum();
    let slope = samples.iter().map(|(t, at)| (*at - held) * (t - time)).sum::<DVec2>() / spread.max(1e-9);
    Some((held, slope * -time))
}

#[cfg(test)]
#[path = "miss_tests.rs"]
mod tests;
