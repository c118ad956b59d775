//! Rounds in view: tracers, splashes and sparks.

use glam::{DVec3, Vec3};

use crate::{
    frame::{scene::RoundView, view::ViewFrustum},
    time::Time,
    world::{
        RunningWorld,
        rounds::{Impact, ImpactKind},
    },
};

/// Most tracers, splashes and strikes in one scene; of more, the farthest are left out.
pub const ROUNDS_SEEN_MAX: usize = 64;

/// How much of its path a tracer's streak shows: the exposure of an ordinary camera frame, seconds.
const STREAK_S: f64 = 1.0 / 60.0;
/// Linear radiance of a tracer.
const TRACER_RADIANCE: Vec3 = Vec3::new(8.0, 2.4, 0.7);
/// Height of a splash whose column is 36 cm wide as it rises, metres; others are as wide in proportion.
const SPLASH_HEIGHT_M: f64 = 1.8;
/// How long sparks can be seen, seconds.
const STRIKE_S: f64 = 0.35;

/// The tracers, splashes and sparks in `view` at `time`, farthest first.
pub(super) fn rounds_in_view(
    running: &RunningWorld,
    view: &ViewFrustum<'_>,
    time: Time,
    into: &mut Vec<RoundView>,
) {
    into.clear();
    let RunningWorld { rounds, fleet, start, .. } = running;
    let tracers = rounds.tracers(time, *start, STREAK_S).map(|path| RoundView::Tracer {
        from: path.from,
        to: path.to,
        radiance: TRACER_RADIANCE,
    });
    let impacts = rounds.impacts(time, fleet).filter_map(|impact| impact_view(&impact));
    into.extend(tracers.chain(impacts).filter(|round| view.sees_round(round)));
    let range = |r: &RoundView| r.place().distance(view.camera.position);
    into.sort_by(|a, b| range(b).total_cmp(&range(a)));
    let surplus = into.len().saturating_sub(ROUNDS_SEEN_MAX);
    into.drain(..surplus);
}

fn impact_view(impact: &Impact) -> Option<RoundView> {
    let &Impact { at, kind, age_s } = impact;
    match kind {
        ImpactKind::Strike => {
            let left = 1.0 - age_s / STRIKE_S;
            (left > 0.0).then_some(RoundView::Strike {
                at,
                radius_m: (0.15 + 0.5 * (1.0 - left)) as f32,
                opacity: left as f32,
            })
        }
        ImpactKind::Splash { height_m, life_s } => {
            (age_s < life_s).then(|| splash(at, height_m, age_s / life_s))
        }
    }
}

/// A column of water thrown up and falling back; `share` of its life has passed.
fn splash(at: DVec3, height_m: f64, share: f64) -> RoundView {
    // Thrown up at once, falling back under gravity: a parabola whose top is reached at a third of its life.
    let rise = (share * 3.0).min(1.0);
    let height = height_m
        * if share < 1.0 / 3.0 { rise * (2.0 - rise) } else { 1.0 - ((share - 1.0 / 3.0) * 1.5).powi(2) };
    RoundView::Splash {
        at,
        height_m: height.max(0.05) as f32,
        radius_m: ((0.18 + 0.5 * share) * height_m / SPLASH_HEIGHT_M) as f32,
        opacity: (1.0 - share * share) as f32,
    }
}
