//! The plan of a scene: its needs, and why the rest is left out.

use crate::{
    event::PixelFormat,
    frame::scene::{BoatView, LeftOut, LightView, Pass, PassDecision, RoundView},
    geometry::Optics,
    own_ship::Phantoms,
    sea::BeaufortForce,
    water::{ReflectionMethod, ShadowLevel, Water},
    world::{boats::LightsKept, scenario::Scenario},
};

/// Above this wind force no reflection of a boat is seen (Nelson 2009, III.D.1.c), so none is drawn.
pub const REFLECTION_FORCE_MAX: u8 = 4;

/// Whether reflections are seen in a sea of that force at all.
pub fn sea_reflects(force: BeaufortForce) -> bool {
    force.get() <= REFLECTION_FORCE_MAX
}

/// The passes and sizes that frames of a scenario can ever need. A pass that is left out here is not compiled, not allocated and never run.
#[derive(Clone, Debug, PartialEq)]
pub struct ScenePlan {
    /// Screen size in pixels.
    pub size: (u32, u32),
    /// For each of [`Pass::ALL`].
    pub passes: [PassDecision; Pass::COUNT],
    /// How the sea mirrors.
    pub water: Water,
    /// Number of boats.
    pub boats: usize,
    /// How many of them ever move.
    pub moving: usize,
    /// How the camera's bytes are laid out; one variant of the video pass is compiled.
    pub video: PixelFormat,
    /// The camera's picture size; equal to the screen's leaves out the scaling variant.
    pub picture: (u32, u32),
    /// The optics that drawing has to follow; one variant of the boats' shader is compiled.
    pub optics: Optics,
    /// Phantoms on the screen, pixels.
    pub phantoms: Phantoms,
}

/// The needs that decide on a plan.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneNeeds {
    /// Screen size in pixels.
    pub size: (u32, u32),
    /// How the camera's bytes are laid out.
    pub video: PixelFormat,
    /// The camera's picture size.
    pub picture: (u32, u32),
    /// The optics of its lens and shutter.
    pub optics: Optics,
    /// How the sea is asked to mirror.
    pub water: Water,
    /// Number of boats in the scenario.
    pub boats: usize,
    /// How many of them ever move.
    pub moving: usize,
    /// Rounds in the belt.
    pub belt: u32,
    /// A boat burns by itself.
    pub burns: bool,
    /// Points of light may be seen by night: boats' own, fires, flares.
    pub lights: bool,
    /// Something may light sea and air by night: a searchlight, a flare, a boat on fire.
    pub lamps: bool,
    /// The sun is up, and neither moves nor comes from the ship.
    pub sun_stays_up: bool,
    /// The same of one that is down.
    pub sun_stays_down: bool,
    /// Phantoms on the screen, pixels.
    pub phantoms: Phantoms,
}

/// A frame's view, as it decides on the passes.
#[derive(Clone, Copy, Debug, Default)]
pub struct InView<'a> {
    /// The camera's pose is known.
    pub pose_known: bool,
    /// The sun shines so that it casts shadows.
    pub sun_shines: bool,
    /// The camera has noise that is seen on boats.
    pub noisy: bool,
    /// Boats that are seen, or mirrored.
    pub boats: &'a [BoatView],
    /// A lamp shines.
    pub lamps: bool,
    /// Navigation lights that are seen.
    pub lights: &'a [LightView],
    /// Tracers, splashes and strikes that are seen.
    pub rounds: &'a [RoundView],
}

impl SceneNeeds {
    /// The needs of a scenario, for a screen, camera and lens that are yet to be told. A sea that is to be measured may turn out calm
    /// enough to mirror.
    pub fn of_scenario(scenario: &Scenario) -> Self {
        let mut water = scenario.water;
        if scenario.sea_from_video && !sea_reflects(water.force) {
            water.force = BeaufortForce::of_wind(0.0);
        }
        let burns = scenario.boats.iter().any(|boat| boat.burns_at_s.is_some());
        // A fire, which rounds may light too, or a flare.
        let shines = burns || scenario.weapon.belt > 0 || scenario.exercise.has_flares();
        Self {
            size: (0, 0),
            video: PixelFormat::Rgb,
            picture: (0, 0),
            optics: Optics::default(),
            water,
            boats: scenario.boats.len(),
            moving: scenario.boats.iter().filter(|b| b.behaviour.speed_max_m_s() > 0.0).count(),
            belt: scenario.weapon.belt,
            burns,
            lights: shines || scenario.boats.iter().any(|b| b.lights != LightsKept::None),
            lamps: shines || scenario.searchlight.is_some(),
            sun_stays_up: scenario.daylight.stays_up(),
            sun_stays_down: scenario.daylight.stays_down(),
            phantoms: Phantoms::default(),
        }
    }
}

impl ScenePlan {
    /// The plan for these needs.
    pub fn new(needs: &SceneNeeds) -> Self {
        let boats =
            if needs.boats == 0 { PassDecision::LeftOut(LeftOut::NoBoats) } else { PassDecision::Run };
        let mirrors = needs.water.method != ReflectionMethod::Off;
        let shadows = needs.water.shadow != ShadowLevel::None;
        let water = match boats {
            PassDecision::LeftOut(_) => boats,
            PassDecision::Run if !sea_reflects(needs.water.force) => {
                PassDecision::LeftOut(LeftOut::SeaTooRough)
            }
            PassDecision::Run if !mirrors && !shadows => PassDecision::LeftOut(LeftOut::NoReflectionNoShadow),
            PassDecision::Run => PassDecision::Run,
        };
        let mirror = match water {
            PassDecision::Run if !mirrors => PassDecision::LeftOut(LeftOut::ReflectionOff),
            other => other,
        };
        let wake = match boats {
            PassDecision::Run if needs.moving == 0 => PassDecision::LeftOut(LeftOut::NoBoatMoves),
            other => other,
        };
        let lights = match boats {
            PassDecision::Run if !needs.lights => PassDecision::LeftOut(LeftOut::NoLights),
            PassDecision::Run if needs.sun_stays_up => PassDecision::LeftOut(LeftOut::Daylight),
            other => other,
        };
        let lamplight = match (needs.lamps, needs.sun_stays_up) {
            (false, _) => PassDecision::LeftOut(LeftOut::NoLamps),
            (true, true) => PassDecision::LeftOut(LeftOut::Daylight),
            (true, false) => PassDecision::Run,
        };
        let rounds = if needs.belt == 0 && !needs.burns {
            PassDecision::LeftOut(LeftOut::NoRounds)
        } else {
            PassDecision::Run
        };
        let mut passes = [PassDecision::Run; Pass::COUNT];
        passes[Pass::Shadow as usize] = match boats {
            PassDecision::Run if needs.sun_stays_down => PassDecision::LeftOut(LeftOut::NoSun),
            other => other,
        };
        passes[Pass::Mirror as usize] = mirror;
        passes[Pass::Water as usize] = water;
        passes[Pass::Wake as usize] = wake;
        passes[Pass::Boats as usize] = boats;
        passes[Pass::Noise as usize] = match boats {
            PassDecision::Run if needs.sun_stays_up => PassDecision::LeftOut(LeftOut::Daylight),
            other => other,
        };
        passes[Pass::Lamplight as usize] = lamplight;
        passes[Pass::Lights as usize] = lights;
        passes[Pass::Rounds as usize] = rounds;
        let drawn =
            [boats, lamplight, lights, rounds].into_iter().find(|decision| *decision == PassDecision::Run);
        passes[Pass::Phantoms as usize] = match drawn {
            _ if needs.phantoms.parts.is_empty() => PassDecision::LeftOut(LeftOut::NoPhantoms),
            None => PassDecision::LeftOut(LeftOut::NothingToHide),
            Some(run) => run,
        };
        Self {
            size: needs.size,
            passes,
            water: needs.water,
            boats: needs.boats,
            moving: needs.moving,
            video: needs.video,
            picture: needs.picture,
            optics: needs.optics,
            phantoms: needs.phantoms.clone(),
        }
    }

    /// Whether a pass can ever run.
    pub fn has(&self, pass: Pass) -> bool {
        self.passes[pass as usize] == PassDecision::Run
    }

    /// The passes of one frame: what the plan allows and what is in view asks for.
    pub fn frame(&self, in_view: &InView<'_>) -> [PassDecision; Pass::COUNT] {
        let InView { pose_known, sun_shines, noisy, lamps, boats, lights, rounds } = *in_view;
        let mut passes = self.passes;
        let mut leave_out = |pass: Pass, unless: bool, why: LeftOut| {
            let decision = &mut passes[pass as usize];
            if *decision == PassDecision::Run && !unless {
                *decision = PassDecision::LeftOut(why);
            }
        };
        for pass in Pass::ALL.into_iter().filter(|pass| !matches!(pass, Pass::Video | Pass::Hud)) {
            leave_out(pass, pose_known, LeftOut::NoPose);
        }
        let reflected = boats.iter().any(|b| b.reflection.is_some());
        leave_out(Pass::Shadow, boats.iter().any(|b| b.hull.is_some()), LeftOut::NoBoatInView);
        leave_out(Pass::Shadow, sun_shines, LeftOut::NoSun);
        leave_out(Pass::Mirror, reflected, LeftOut::NoReflectionInView);
        leave_out(Pass::Water, reflected, LeftOut::NoReflectionInView);
        leave_out(Pass::Wake, boats.iter().any(|b| b.wake.is_some()), LeftOut::NoWakeInView);
        leave_out(Pass::Boats, boats.iter().any(|b| b.hull.is_some()), LeftOut::NoBoatInView);
        leave_out(Pass::Noise, boats.iter().any(|b| b.hull.is_some()), LeftOut::NoBoatInView);
        leave_out(Pass::Noise, noisy, LeftOut::NoiseUnseen);
        leave_out(Pass::Lamplight, lamps, LeftOut::NoLampShines);
        leave_out(Pass::Lights, !lights.is_empty(), LeftOut::NoLightInView);
        leave_out(Pass::Rounds, !rounds.is_empty(), LeftOut::NoRoundInView);
        let drawn = !boats.is_empty() || lamps || !lights.is_empty() || !rounds.is_empty();
        leave_out(Pass::Phantoms, drawn, LeftOut::NothingToHide);
        passes
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::DVec2;

    use super::*;
    use crate::own_ship::Phantom;

    fn needs() -> SceneNeeds {
        let triangle = Phantom::new("", vec![DVec2::ZERO, DVec2::X, DVec2::Y], (1280, 720));
        SceneNeeds {
            size: (1280, 720),
            video: PixelFormat::Rgb,
            picture: (1280, 720),
            optics: Optics::default(),
            water: Water {
                method: ReflectionMethod::Full,
                force: BeaufortForce::new(2).unwrap(),
                shadow: ShadowLevel::Gradual,
            },
            boats: 3,
            moving: 2,
            belt: 100,
            burns: false,
            lights: true,
            lamps: true,
            sun_stays_up: false,
            sun_stays_down: false,
            phantoms: Phantoms { parts: Arc::new([triangle]), bore: DVec2::ZERO },
        }
    }

    #[test]
    fn each_thing_left_out_has_its_reason() {
        let full = ScenePlan::new(&needs());
        assert!(Pass::ALL.into_iter().all(|p| full.has(p)));
        let reason = |needs: SceneNeeds, pass: Pass| match ScenePlan::new(&needs).passes[pass as usize] {
            PassDecision::LeftOut(why) => Some(why),
            PassDecision::Run => None,
        };
        let empty = SceneNeeds { boats: 0, ..needs() };
        assert_eq!(reason(empty.clone(), Pass::Mirror), Some(LeftOut::NoBoats));
        assert_eq!(reason(empty.clone(), Pass::Water), Some(LeftOut::NoBoats));
        assert_eq!(reason(empty.clone(), Pass::Boats), Some(LeftOut::NoBoats));
        let rough =
            SceneNeeds { water: Water { force: BeaufortForce::new(5).unwrap(), ..needs().water }, ..needs() };
        assert_eq!(reason(rough.clone(), Pass::Mirror), Some(LeftOut::SeaTooRough));
        assert_eq!(reason(rough, Pass::Boats), None);
        let shadow_only =
            SceneNeeds { water: Water { method: ReflectionMethod::Off, ..needs().water }, ..needs() };
        assert_eq!(reason(shadow_only.clone(), Pass::Mirror), Some(LeftOut::ReflectionOff));
        assert_eq!(reason(shadow_only, Pass::Water), None);
        let nothing = Water { method: ReflectionMethod::Off, shadow: ShadowLevel::None, ..needs().water };
        assert_eq!(
            reason(SceneNeeds { water: nothing, ..needs() }, Pass::Water),
            Some(LeftOut::NoReflectionNoShadow)
        );
        assert_eq!(reason(SceneNeeds { moving: 0, ..needs() }, Pass::Wake), Some(LeftOut::NoBoatMoves));
        assert_eq!(reason(empty, Pass::Wake), Some(LeftOut::NoBoats));
        assert_eq!(reason(SceneNeeds { lights: false, ..needs() }, Pass::Lights), Some(LeftOut::NoLights));
        assert_eq!(
            reason(SceneNeeds { sun_stays_up: true, ..needs() }, Pass::Lights),
            Some(LeftOut::Daylight)
        );
        let dark = SceneNeeds { lamps: false, ..needs() };
        assert_eq!(reason(dark, Pass::Lamplight), Some(LeftOut::NoLamps));
        assert_eq!(
            reason(SceneNeeds { sun_stays_down: true, ..needs() }, Pass::Shadow),
            Some(LeftOut::NoSun)
        );
        let day = SceneNeeds { sun_stays_up: true, ..needs() };
        assert_eq!(reason(day.clone(), Pass::Noise), Some(LeftOut::Daylight));
        assert_eq!(reason(day, Pass::Lamplight), Some(LeftOut::Daylight));
        assert_eq!(reason(SceneNeeds { belt: 0, ..needs() }, Pass::Rounds), Some(LeftOut::NoRounds));
        let bare = SceneNeeds { phantoms: Phantoms::default(), ..needs() };
        assert_eq!(reason(bare, Pass::Phantoms), Some(LeftOut::NoPhantoms));
        let calm = SceneNeeds { boats: 0, belt: 0, lamps: false, ..needs() };
        assert_eq!(reason(calm, Pass::Phantoms), Some(LeftOut::NothingToHide));
    }

    #[test]
    fn a_frame_runs_only_what_is_in_view() {
        let plan = ScenePlan::new(&needs());
        let frame = plan.frame(&InView { pose_known: true, ..InView::default() });
        assert_eq!(frame[Pass::Video as usize], PassDecision::Run);
        assert_eq!(frame[Pass::Boats as usize], PassDecision::LeftOut(LeftOut::NoBoatInView));
        assert_eq!(frame[Pass::Noise as usize], PassDecision::LeftOut(LeftOut::NoBoatInView));
        assert_eq!(frame[Pass::Water as usize], PassDecision::LeftOut(LeftOut::NoReflectionInView));
        assert_eq!(frame[Pass::Wake as usize], PassDecision::LeftOut(LeftOut::NoWakeInView));
        assert_eq!(frame[Pass::Rounds as usize], PassDecision::LeftOut(LeftOut::NoRoundInView));
        assert_eq!(frame[Pass::Lamplight as usize], PassDecision::LeftOut(LeftOut::NoLampShines));
        assert_eq!(frame[Pass::Phantoms as usize], PassDecision::LeftOut(LeftOut::NothingToHide));
        let lost = plan.frame(&InView::default());
        assert_eq!(lost[Pass::Boats as usize], PassDecision::LeftOut(LeftOut::NoPose));
        assert_eq!(lost[Pass::Hud as usize], PassDecision::Run);
        // The scenario's reason stands before the frame's.
        let empty = ScenePlan::new(&SceneNeeds { boats: 0, ..needs() });
        assert_eq!(
            empty.frame(&InView::default())[Pass::Boats as usize],
            PassDecision::LeftOut(LeftOut::NoBoats)
        );
    }
}
