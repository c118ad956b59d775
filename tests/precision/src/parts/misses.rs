//! Causes of misses: each injected alone must be the one that is named.

use std::f64::consts::TAU;

use anyhow::Result;
use bowwave_core::world::{
    gunnery::{Projectile, aim_to_hit},
    score::{BoreSample, MissCause, MissExplanation, MissedRound},
};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::{About, even};
use crate::bench::{ExtremeResult, PartBench};

/// Description of this part.
pub const ABOUT: About = About {
    part: "misses",
    what: "Says why a round missed: lead, elevation, tracking, jerk or dispersion.",
    truth: "the cause that was injected: a barrel that follows the aim that hits, turned by one cause alone, at targets of all courses; the aim is \
            by DOP853's rival in the part flight, and its residual is tested to a centimetre in core",
    rivals: "the barrel against the aim as the round left, without what it did before",
    why: "The barrel's way over .7 s tells a jerk and a drift from an aim that was wrong all the time; without it they are taken for lead and \
          elevation",
};

const MUZZLE: DVec3 = DVec3::new(0.4, 0.2, 8.0);
/// Times before the round at which the barrel is known, seconds apart.
const APART_S: f64 = 1.0 / 30.0;

/// A cause with its size, mrad.
#[derive(Clone, Copy)]
enum Injected {
    Lead(f64),
    Elevation(f64),
    Tracking(f64),
    Jerk(f64),
    Dispersion(f64),
}

impl Injected {
    const fn cause(self) -> MissCause {
        match self {
            Self::Lead(_) => MissCause::Lead,
            Self::Elevation(_) => MissCause::Elevation,
            Self::Tracking(_) => MissCause::Tracking,
            Self::Jerk(_) => MissCause::Jerk,
            Self::Dispersion(_) => MissCause::Dispersion,
        }
    }

    /// The barrel's error so long before the round, mrad to the right and over, towards `way`.
    fn barrel(self, before_s: f64, way: DVec2) -> DVec2 {
        match self {
            Self::Lead(mrad) => DVec2::new(mrad * way.x.signum(), 0.0),
            Self::Elevation(mrad) => DVec2::new(0.0, mrad * way.y.signum()),
            // At that rate away from the target, which it was on in the middle of the time that is looked at.
            Self::Tracking(mrad_s) => way * (mrad_s * (0.41 - before_s)),
            Self::Jerk(mrad) => way * (mrad * (1.0 - before_s / 0.1).max(0.0)),
            Self::Dispersion(_) => DVec2::ZERO,
        }
    }
}

/// The explanation of one round.
fn explained(
    number: u64,
    injected: Injected,
    tremor_mrad: f64,
    knows_before: bool,
) -> Option<MissExplanation> {
    let draw = |what: u64| even(number * 128 + what);
    let between = |what: u64, low: f64, high: f64| low + draw(what) * (high - low);
    let projectile = Projectile::new(0.337, 893.0)?;
    let (bearing, range) = (between(0, 0.0, TAU), between(1, 80.0, 900.0));
    let begin = DVec3::new(bearing.sin() * range, bearing.cos() * range, 0.7);
    let velocity = DVec3::new(between(2, -15.0, 15.0), between(3, -15.0, 15.0), 0.0);
    let target = |s: f64| begin + velocity * s;
    let way = DVec2::from_angle(between(4, 0.0, TAU));
    let turned = |direction: DVec3, at: DVec3, off: DVec2| {
        let forward = (at - MUZZLE).normalize();
        let right = forward.cross(DVec3::Z).normalize();
        (direction + (right * off.x + right.cross(forward) * off.y) * 1e-3).normalize()
    };
    // A hand's tremor: sines between one and five a second.
    let tremor = |before_s: f64| {
        let wave = |i: u64| {
            let phase = between(10 + i, 0.0, TAU) + between(20 + i, 6.0, 30.0) * before_s;
            DVec2::new(phase.sin(), (1.3 * phase + 1.0).cos())
        };
        (0..4).map(wave).sum::<DVec2>() * (tremor_mrad / 2.0)
    };
    let aim = |before_s: f64| {
        let hit = aim_to_hit(projectile, MUZZLE, DVec3::ZERO, |s| target(s - before_s))?;
        let off = injected.barrel(before_s, way) + tremor(before_s);
        Some(turned(hit.direction, target(-before_s), off))
    };
    let count = if knows_before { 24 } else { 0 };
    let sample = |i: u32| {
        let before_s = APART_S * f64::from(i);
        Some(BoreSample { before_s, muzzle: MUZZLE, bore: aim(before_s)? })
    };
    let before: Vec<BoreSample> = (1..=count).rev().map(sample).collect::<Option<_>>()?;
    let bore = aim(0.0)?;
    let scatter = if let Injected::Dispersion(mrad) = injected { way * mrad } else { DVec2::ZERO };
    let flown = turned(bore, target(0.0), scatter);
    let round = MissedRound { projectile, wind: DVec3::ZERO, muzzle: MUZZLE, bore, flown, before: &before };
    MissExplanation::of(&round, target)
}

/// Rounds whose cause is not the one that is named, of a hundred.
fn misnamed(count: u64, injected: Injected, tremor_mrad: f64, knows_before: bool) -> f64 {
    let is_right = |number: &u64| {
        explained(*number, injected, tremor_mrad, knows_before)
            .is_some_and(|explained| explained.largest() == injected.cause())
    };
    let right = (0..count).into_par_iter().filter(is_right).count();
    100.0 * (count - right as u64) as f64 / count as f64
}

/// Measures the extreme cases.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    let count = if bench.is_quick() { 200 } else { 5000 };
    let cases = [
        ("lead 5 mrad", Injected::Lead(5.0)),
        ("elevation 3 mrad", Injected::Elevation(3.0)),
        ("tracking 10 mrad/s", Injected::Tracking(10.0)),
        ("jerk 5 mrad in .1 s", Injected::Jerk(5.0)),
        ("dispersion 1.5 mrad", Injected::Dispersion(1.5)),
    ];
    for (name, injected) in cases {
        for (tremor, mrad) in [("alone", 0.0), ("with a tremor of .5 mrad", 0.5)] {
            let error = |knows_before| misnamed(count, injected, mrad, knows_before);
            bench.extreme(
                &format!("{name}, {tremor}: another cause is named"),
                "%",
                vec![
                    ExtremeResult::product("the barrel's way before", "0.7 s", error(true)),
                    ExtremeResult::rival("the barrel as the round left", "", error(false)),
                ],
            );
        }
    }
    Ok(())
}
