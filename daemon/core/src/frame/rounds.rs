//! Rounds in view: tracers, splashes and sparks; and the fires that they light.

use glam::{DVec3, Vec3};

use super::fires::{Burning, FIRES_SEEN_MAX, PUFFS_A_BOAT};
use crate::{
    frame::{scene::RoundView, view::ViewFrustum},
    geometry::{ahead, starboard},
    model::Zone,
    time::Time,
    world::{
        RunningWorld,
        rounds::{Impact, ImpactKind},
    },
};

/// Most tracers, splashes and strikes in one scene, and puffs of fires; of more, the farthest are left out.
pub const ROUNDS_SEEN_MAX: usize = 64 + FIRES_SEEN_MAX * PUFFS_A_BOAT;

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
    (time, white_cd_m2): (Time, f64),
    into: &mut Vec<RoundView>,
) {
    into.clear();
    let RunningWorld { rounds, fleet, start, .. } = running;
    let time_s = time.secs_since(*start);
    for burning in fires(running, view, white_cd_m2) {
        burning.puffs(time_s, source_of(running, burning.boat, time), into);
    }
    into.retain(|puff| view.sees_round(puff));
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

/// Boats that burn: no more than are drawn.
pub(super) fn fires<'a>(
    running: &'a RunningWorld,
    view: &ViewFrustum<'_>,
    white_cd_m2: f64,
) -> impl Iterator<Item = Burning> + use<'a> {
    let RunningWorld { fleet, start, .. } = running;
    let (start, wind, eye, visibility_m) = (*start, view.wind, view.camera.position, view.visibility_m);
    let burning = move |boat: usize| {
        let since_s = fleet.burns_since(boat)?.secs_since(start);
        Some(Burning { boat, since_s, wind, eye, visibility_m, white_cd_m2 })
    };
    (0..fleet.len()).filter_map(burning).take(FIRES_SEEN_MAX)
}

/// Where a boat's fire was at a time before `now`, seconds since the scenario began: over its engine, as high as that is now.
pub(super) fn source_of(running: &RunningWorld, boat: usize, now: Time) -> impl Fn(f64) -> Option<DVec3> {
    let RunningWorld { fleet, start, .. } = running;
    let place = fleet.model(boat).map(|model| model.middle_of(Zone::Engine));
    let now = fleet.floating(boat, now);
    let height = now.zip(place).map(|(now, place)| now.pose.to_world(place).z);
    move |time_s| {
        let (place, state) = (place?, fleet.history(boat)?.state(time_s));
        let swims = fleet.swims(boat, start.plus_secs(time_s));
        let at = state.position + ahead(state.heading) * place.x - starboard(state.heading) * place.y;
        swims.then_some(at.extend(height?))
    }
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

#[cfg(test)]
mod tests {
    use std::{collections::VecDeque, sync::Arc};

    use super::*;
    use crate::{
        frame::lights::lights_in_view,
        geometry::{CameraPose, Lens, look},
        model::ModelId,
        world::{
            boats::RoundStrike,
            fleet::Fleet,
            rounds::{Ammunition, Rounds},
            scenario::Scenario,
            score::boxed_model,
        },
    };

    /// A boat 200 m ahead whose engine was set on fire after a second, half a minute later.
    fn burning() -> RunningWorld {
        let text = "[[boat]]\nname = \"b\"\nmodel = \"skiff\"\ncourse = \"still\"\nrange_m = 200\nbearing_deg = 0\nheading_deg = 90\n";
        let scenario = Scenario::parse(text, "test").expect("sound");
        let models = Arc::new([boxed_model(Vec3::new(-3.5, -1.0, -0.3), Vec3::new(3.5, 1.0, 0.8))]);
        let start = Time::from_ns(0);
        let mut fleet = Fleet::of_scenario(&scenario, models, &[ModelId(0)], start);
        let strike = RoundStrike { zone: Zone::Engine, hole: None, ignites: true };
        fleet.strike(0, &strike, start.plus_secs(1.0));
        let ammunition = Ammunition { weapon: scenario.weapon.clone(), wind: DVec3::ZERO, seed: 1 };
        let rounds = Rounds::new(ammunition, scenario.wave_field(), start);
        RunningWorld { start, now: start.plus_secs(30.0), fleet, rounds, fired: VecDeque::new() }
    }

    #[test]
    fn a_boat_that_burns_smokes_and_shines() {
        let running = burning();
        let camera = CameraPose { world_from_camera: look(0.0, -0.03, 0.0), position: DVec3::Z * 8.0 };
        let view = ViewFrustum {
            camera: &camera,
            lens: &Lens::pinhole(1280, 720, 1.0),
            visibility_m: 2e4,
            wind: glam::DVec2::X * 3.0,
            reflections: true,
            wakes: true,
            water_within_m: f64::INFINITY,
        };
        let mut seen = Vec::new();
        rounds_in_view(&running, &view, (running.start, 100.0), &mut seen);
        assert_eq!(seen, [], "it does not burn yet");
        rounds_in_view(&running, &view, (running.now, 100.0), &mut seen);
        let smoke = seen.iter().filter(|view| matches!(view, RoundView::Smoke { .. })).count();
        let flames: Vec<_> = seen.iter().filter(|view| matches!(view, RoundView::Flame { .. })).collect();
        assert!(smoke == 18 && flames.len() > 5, "{smoke} {}", flames.len());
        assert!(
            flames.iter().all(|flame| flame.place().distance(DVec3::new(0.0, 200.0, 1.0)) < 5.0),
            "{flames:?}"
        );
        assert!(
            seen.is_sorted_by(
                |a, b| a.place().distance(camera.position) >= b.place().distance(camera.position)
            )
        );
        // 319 kW at 12.7 cd each, at 200 m, where 100 cd/m^2 are white.
        let boats: Vec<_> = running.fleet.afloat(running.now).filter_map(|boat| view.see(&boat)).collect();
        let mut lights = Vec::new();
        lights_in_view(&running, &view, (running.now, 100.0), &boats, &mut lights);
        assert_eq!(lights.len(), 1);
        let luminance = lights[0].light.dot(Vec3::new(0.2126, 0.7152, 0.0722));
        assert!((luminance / 1e-3 - 1.0).abs() < 0.3, "{luminance}");
    }
}
