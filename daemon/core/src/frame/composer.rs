//! Stage three as a whole: estimates and world in, the scene of a frame out.

use std::sync::Arc;

use glam::{DQuat, DVec3, Vec3};

use super::{
    boats::{boats_in_view, nearest_m},
    lamps::{FlashView, LAMPS_MAX, LampView},
    lights::{flares_in_view, flash_at, lamps_at, lights_in_view, muzzle_px},
    plan::{InView, SceneNeeds, ScenePlan, sea_reflects},
    rounds::{ROUNDS_SEEN_MAX, rounds_in_view},
    scene::{BoatView, Hud, LightView, Pass, RoundView, Scene, Status},
    searchlight::SearchlightView,
    view::ViewFrustum,
    wake::Wake,
};
use crate::{
    calibration::Calibration,
    estimate::{Estimator, registration::RegistrationChecks},
    event::{Picture, PictureError, PixelFormat},
    fault::{Fault, FirePermission, NotScored},
    geometry::{CameraPose, Lens, RigidPose, look},
    model::{Model, ModelId},
    own_ship::{OwnShip, Phantom},
    time::Time,
    world::{
        LastResult, RESULT_S, World,
        boats::{CourseState, Hull},
        fleet::Afloat,
        scenario::{Scenario, Side},
        searchlight::SearchlightSpec,
    },
};

/// Settings of a composer.
#[derive(Clone, Copy, Debug)]
pub struct ComposerSettings<'a> {
    /// The scenario.
    pub scenario: &'a Scenario,
    /// The calibration of the camera.
    pub calibration: &'a Calibration,
    /// The own gun and ship in the camera's pictures.
    pub own_ship: &'a OwnShip,
    /// Screen size in pixels.
    pub screen: (u32, u32),
    /// How the camera's bytes are laid out.
    pub video: PixelFormat,
    /// All models in use.
    pub models: &'a Arc<[Model]>,
    /// The model of each of the scenario's boats, in order.
    pub boat_models: &'a [ModelId],
}

/// Which boats have reflections and wakes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WaterDrawn {
    /// All.
    All,
    /// The nearest in view.
    Nearest,
    /// None.
    None,
}

/// The moment that a frame shows, and what the sailor is to be told.
#[derive(Clone, Copy, Debug)]
pub struct FrameMoment {
    /// When the picture was exposed (middle); `None` before the first picture.
    pub video_time: Option<Time>,
    /// Whether the weapon may fire.
    pub permission: FirePermission,
    /// The exercise stands still.
    pub is_paused: bool,
    /// The fault that the sailor should know of though training goes on.
    pub warning: Option<Fault>,
    /// Confirmation of the orientation by the pictures.
    pub checks: RegistrationChecks,
    /// Which boats have reflections and wakes.
    pub water: WaterDrawn,
}

/// Composes the scenes of a session, one after the other.
#[derive(Debug)]
pub struct Composer {
    plan: ScenePlan,
    screen_lens: Lens,
    visibility_m: f64,
    eye_height_m: f64,
    /// The barrel, camera's axes.
    bore: DVec3,
    /// The muzzle as the camera sees it, its axes; `None` where no outline of the gun is known.
    muzzle: Option<DVec3>,
    models: Arc<[Model]>,
    boat_models: Vec<ModelId>,
    black: Picture,
    scene: Scene,
    frames: u64,
}

impl Composer {
    /// A composer whose first frame has yet to come. No picture may have the calibrated size in that layout: then there is none.
    pub fn new(settings: &ComposerSettings<'_>, estimator: &Estimator) -> Result<Self, PictureError> {
        let ComposerSettings { scenario, calibration, own_ship, screen, video, models, boat_models } =
            *settings;
        let picture = (calibration.lens.width, calibration.lens.height);
        let black = Picture::black(video, picture.0, picture.1)?;
        let screen_lens = calibration.lens.covering(screen.0, screen.1);
        let plan = ScenePlan::new(&SceneNeeds {
            size: screen,
            video,
            picture,
            optics: calibration.optics(),
            phantoms: own_ship.phantoms.on_screen(&calibration.lens, &screen_lens),
            ..SceneNeeds::of_scenario(scenario)
        });
        let muzzle = plan.phantoms.parts.iter().filter(|part| part.recoils).map(Phantom::outline);
        let muzzle = muzzle_px(muzzle, plan.phantoms.bore);
        let light = estimator.light();
        let camera =
            CameraPose { world_from_camera: DQuat::IDENTITY, position: DVec3::Z * scenario.eye_height_m };
        let scene = Scene {
            frame: 0,
            time_s: 0.0,
            camera,
            lens: screen_lens,
            passes: plan.frame(&InView::default()),
            boats: Vec::with_capacity(scenario.boats.len()),
            rounds: Vec::with_capacity(2 * ROUNDS_SEEN_MAX),
            lights: Vec::new(),
            lamps: Vec::with_capacity(LAMPS_MAX),
            flash: None,
            searchlight: None,
            recoil: 1.0,
            light: light.boats,
            water: scenario.water,
            wind: scenario.wind.truncate(),
            sky: light.sky,
            tones: light.tones,
            noise: None,
            hud: Hud { rounds_left: scenario.weapon.belt, ..Hud::READY },
            guide: None,
        };
        Ok(Self {
            plan,
            screen_lens,
            visibility_m: scenario.daylight.visibility_m,
            eye_height_m: scenario.eye_height_m,
            bore: calibration.bore_in_camera(),
            muzzle: muzzle.map(|px| screen_lens.unproject(px).normalize()),
            models: Arc::clone(models),
            boat_models: boat_models.to_vec(),
            black,
            scene,
            frames: 0,
        })
    }

    /// The plan that the renderer must be able to draw.
    pub const fn plan(&self) -> &ScenePlan {
        &self.plan
    }

    /// The scene that was composed last.
    pub const fn scene(&self) -> &Scene {
        &self.scene
    }

    /// A black picture of the planned size and layout.
    pub const fn black(&self) -> &Picture {
        &self.black
    }

    /// Plans for pictures of the calibrated size that come in another layout than planned.
    pub fn follow_layout(&mut self, picture: &Picture) {
        let format = picture.format();
        if format == self.plan.video || (picture.width(), picture.height()) != self.plan.picture {
            return;
        }
        let (width, height) = self.plan.picture;
        // A picture of that size and layout is here, so a black one can be made.
        if let Ok(black) = Picture::black(format, width, height) {
            self.black = black;
            self.plan.video = format;
        }
    }

    /// Composes the next frame's scene; says whether the camera's pose was known.
    pub fn compose(&mut self, moment: &FrameMoment, estimator: &Estimator, world: &World) -> bool {
        let camera = match moment.video_time {
            Some(time) => self.compose_view(time, moment, estimator, world),
            None => {
                self.compose_black(moment);
                None
            }
        };
        self.scene.frame = self.frames;
        self.frames += 1;
        camera.is_some()
    }

    /// While no picture has come: nothing but what is wrong.
    fn compose_black(&mut self, moment: &FrameMoment) {
        let scene = &mut self.scene;
        scene.boats.clear();
        scene.lights.clear();
        scene.lamps.clear();
        (scene.searchlight, scene.flash) = (None, None);
        scene.recoil = 1.0;
        scene.rounds.clear();
        scene.passes = self.plan.frame(&InView::default());
        scene.hud.status = status(moment, None);
        scene.hud.warning = moment.warning;
    }

    fn compose_view(
        &mut self,
        time: Time,
        moment: &FrameMoment,
        estimator: &Estimator,
        world: &World,
    ) -> Option<CameraPose> {
        let camera = estimator.camera(time).ok().map(|camera| camera.pose);
        let scene = &mut self.scene;
        (scene.wind, scene.water.force) = estimator.wind();
        scene.boats.clear();
        scene.lights.clear();
        scene.lamps.clear();
        scene.rounds.clear();
        scene.flash = None;
        let light = estimator.light();
        if let (Some(camera), Some(running)) = (&camera, world.running()) {
            scene.camera = *camera;
            scene.lens = estimator.lens_at(time).covering(self.plan.size.0, self.plan.size.1);
            let frustum = ViewFrustum {
                camera,
                lens: &scene.lens,
                visibility_m: self.visibility_m,
                wind: scene.wind,
                reflections: self.plan.has(Pass::Water) && sea_reflects(scene.water.force),
                wakes: self.plan.has(Pass::Wake),
                water_within_m: f64::INFINITY,
            };
            // Boats and rounds lie in the exercise's time, camera and light in the picture's.
            let time = world.clock().of_host(time);
            scene.time_s = time.secs_since(running.start);
            let frustum = ViewFrustum {
                water_within_m: match moment.water {
                    WaterDrawn::All => f64::INFINITY,
                    WaterDrawn::Nearest => nearest_m(&running.fleet, &frustum, time),
                    WaterDrawn::None => 0.0,
                },
                ..frustum
            };
            boats_in_view(&running.fleet, &frustum, time, running.start, &mut scene.boats);
            let moment = (time, light.white_cd_m2);
            let is_night = estimator.luminaries().is_between_sunset_and_sunrise();
            if self.plan.has(Pass::Lights) && is_night {
                lights_in_view(running, &frustum, moment, &scene.boats, &mut scene.lights);
            }
            rounds_in_view(running, &frustum, moment, &mut scene.rounds);
            if self.plan.has(Pass::Lamplight) && is_night {
                lamps_at(running, &frustum, moment, &mut scene.lamps);
                flares_in_view(&scene.lamps, &frustum, &mut scene.lights);
                let muzzle = self.muzzle.filter(|_| self.plan.has(Pass::Rounds));
                scene.flash =
                    muzzle.and_then(|to| flash_at(running, &frustum, moment, to, &mut scene.rounds));
            }
        }
        let shining = world.searchlight().filter(|_| self.plan.has(Pass::Lamplight));
        scene.searchlight =
            shining.map(|spec| SearchlightView::new(spec, self.bore, light.white_cd_m2, self.visibility_m));
        scene.recoil = estimator.recoil();
        (scene.light, scene.sky, scene.tones) = (light.boats, light.sky, light.tones);
        scene.noise = light.noise;
        scene.passes = self.plan.frame(&InView {
            pose_known: camera.is_some(),
            sun_shines: scene.light.sun_shines(),
            noisy: scene.noise.is_some(),
            lamps: scene.searchlight.is_some() || !scene.lamps.is_empty(),
            boats: &scene.boats,
            lights: &scene.lights,
            rounds: &scene.rounds,
        });
        let time = world.clock().of_host(time);
        let result = world.last_result().filter(|result| time.secs_since(result.time) < RESULT_S);
        let score = world.score();
        scene.hud = Hud {
            status: status(moment, result),
            warning: moment.warning,
            rounds_left: world.rounds_left(),
            shots: u32::try_from(score.shots).unwrap_or(u32::MAX),
            hits: u32::try_from(score.hits).unwrap_or(u32::MAX),
            neutral_hits: u32::try_from(score.neutral_hits).unwrap_or(u32::MAX),
            clock_s: world.clock_s(time),
            sea: estimator.sea().map(|sea| (sea.in_use.state, sea.in_use.source)),
            heading_tenths_deg: estimator.heading_shown(),
            rules: world.watch().rules(),
            weapon: world.weapon_state(),
            message: world.message(time),
        };
        camera
    }

    /// A scene in which everything that this session can ever show is in view. Drawn once and thrown away before the first
    /// frame, it lets drivers finish compiling what they put off until it is used.
    pub fn warm_up(&self) -> Scene {
        let camera = CameraPose {
            world_from_camera: look(0.0, -0.08, 0.0),
            position: DVec3::new(0.0, 0.0, self.eye_height_m),
        };
        let frustum = ViewFrustum {
            camera: &camera,
            lens: &self.screen_lens,
            visibility_m: self.visibility_m,
            wind: self.scene.wind,
            reflections: self.plan.has(Pass::Water),
            wakes: self.plan.has(Pass::Wake),
            water_within_m: f64::INFINITY,
        };
        let boats = self.boat_models.iter().enumerate();
        let boats: Vec<_> = boats.filter_map(|(boat, id)| self.warm_up_boat(&frustum, boat, *id)).collect();
        let at = DVec3::new(0.0, self.eye_height_m * 10.0, 0.5);
        let rounds = if self.plan.has(Pass::Rounds) {
            vec![
                RoundView::Splash { at, height_m: 1.0, radius_m: 0.5, opacity: 1.0 },
                RoundView::Strike { at, radius_m: 0.5, opacity: 1.0 },
                RoundView::Tracer { from: at, to: at + DVec3::Y * 10.0, radiance: Vec3::ONE },
                RoundView::Smoke { at, radius_m: 0.5, depth: 1.0, glow: Vec3::ONE, haze: 0.5, seed: 0.0 },
                RoundView::Flame { at, radius_m: 0.5, light: Vec3::ONE, seed: 0.0 },
            ]
        } else {
            Vec::new()
        };
        let on = |view: &BoatView| LightView {
            boat: Some(view.boat),
            at: view.pose.position + DVec3::Z,
            light: Vec3::splat(1e-6),
        };
        let lights: Vec<_> =
            if self.plan.has(Pass::Lights) { boats.iter().map(on).collect() } else { Vec::new() };
        let searchlight = self
            .plan
            .has(Pass::Lamplight)
            .then(|| SearchlightView::new(&SearchlightSpec::default(), self.bore, 1.0, self.visibility_m));
        let in_view = InView {
            pose_known: true,
            sun_shines: true,
            noisy: true,
            lamps: searchlight.is_some(),
            boats: &boats,
            lights: &lights,
            rounds: &rounds,
        };
        let passes = self.plan.frame(&in_view);
        let (strength, extinction_per_m) = (Vec3::splat(1e-3), 1e-4);
        let lamp = |at: DVec3, is_high| LampView { at, strength, extinction_per_m, is_high };
        let lamps = if self.plan.has(Pass::Lamplight) {
            vec![lamp(at, false), lamp(at + DVec3::Z * 50.0, true)]
        } else {
            Vec::new()
        };
        let flash = self.muzzle.map(|_| FlashView { on_gun: strength });
        Scene { camera, passes, boats, lights, lamps, flash, searchlight, rounds, ..self.scene.clone() }
    }

    /// A boat broadside before the camera, under way if it is one of as many as move.
    fn warm_up_boat(&self, frustum: &ViewFrustum<'_>, boat: usize, model_id: ModelId) -> Option<BoatView> {
        let model = self.models.get(usize::from(model_id.0))?;
        let ahead_m = (self.eye_height_m * 10.0).max(4.0 * model.radius_m());
        let pose = RigidPose { world_from_body: DQuat::IDENTITY, position: DVec3::new(0.0, ahead_m, 0.0) };
        let under_way = CourseState {
            position: pose.position.truncate(),
            heading: std::f64::consts::FRAC_PI_2,
            speed_m_s: 5.0,
            sway_m_s: 0.0,
            turn_rate: 0.0,
        };
        let wake = || {
            let wake = Wake::of(Hull::of(model), f64::from(-model.min.z), 0.0, |_| under_way, |_| 0.0);
            wake.filter(|_| boat < self.plan.moving)
        };
        frustum.see_with_wake(&Afloat { boat, model_id, model, pose, water_level: 0.0 }, wake)
    }
}

/// What is said of an orientation that nothing has confirmed, from so many seconds on.
const UNCHECKED: [(f64, &str); 9] = [
    (10.0, "NO HORIZON FOR 10 S"),
    (30.0, "NO HORIZON FOR 30 S"),
    (60.0, "NO HORIZON FOR 1 MIN"),
    (120.0, "NO HORIZON FOR 2 MIN"),
    (300.0, "NO HORIZON FOR 5 MIN"),
    (600.0, "NO HORIZON FOR 10 MIN"),
    (1800.0, "NO HORIZON FOR 30 MIN"),
    (3600.0, "NO HORIZON FOR 1 H"),
    (f64::INFINITY, "NO HORIZON SEEN YET"),
];

/// Why what is drawn counts as unconfirmed; `None` where it is confirmed.
fn unchecked(checks: &RegistrationChecks) -> Option<&'static str> {
    let unseen = UNCHECKED.iter().rev().find(|(from_s, _)| checks.unseen_s >= *from_s);
    unseen.map(|(_, cause)| *cause).or((!checks.is_tried).then_some("TURN AND TILT THE GUN"))
}

/// The status: the fault that keeps the weapon from scoring, else that the exercise stands still, else the newest result, else whether what is drawn has been confirmed.
fn status(moment: &FrameMoment, result: Option<LastResult>) -> Status {
    match moment.permission {
        FirePermission::Safe(f) => Status::Fault { cause: f.cause(), action: f.action() },
        FirePermission::NotScored(why) => {
            let fault = NotScored::fault(why);
            Status::NotScored { cause: fault.cause(), action: fault.action() }
        }
        FirePermission::Armed if moment.is_paused => Status::Paused,
        FirePermission::Armed => match result {
            Some(LastResult { struck: Some((Side::Hostile, zone)), .. }) => Status::Hit { zone },
            Some(LastResult { struck: Some((Side::Neutral, zone)), .. }) => Status::NeutralHit { zone },
            Some(LastResult { struck: None, .. }) => Status::Miss,
            None => unchecked(&moment.checks).map_or(Status::Ready, |cause| Status::NotChecked { cause }),
        },
    }
}
