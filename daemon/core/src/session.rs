//! A session: a pure function from its inputs (devices' reports and ticks) to scenes and records.

mod digest;
mod notes;

use std::sync::Arc;

use glam::DVec3;

use crate::{
    calibration::Calibration,
    estimate::{HeadingSettings, SeaReport, SeaStateTracker, SensorCounts, Sensors},
    estimate::{
        attitude::Source,
        clock::ClockReport,
        horizon::Mask,
        light::LightMeter,
        pose::{NoPose, OrientationAt, STALE_NS},
    },
    event::{Event, Input, Picture, PictureError, PixelFormat, Tick, TriggerEdge},
    fault::{Fault, FaultBoard, FaultChange, Severity},
    frame::{
        plan::{Needs, ScenePlan, sea_reflects},
        scene::{Hud, Pass, RoundView, Scene, Status},
        view::{Afloat, Eye},
        wake::Wake,
    },
    geometry::{CameraPose, Lens, RigidPose, look},
    model::{Model, ModelId},
    sea::BeaufortForce,
    time::Time,
    water::Water,
    world::{
        boats::{CourseState, Hull},
        scenario::Scenario,
        score::{NotScored, Outcome, ShotRecord},
        waves::WaveField,
        weapon::Weapon,
    },
    world::{
        fleet::{Fleet, Vessel},
        rounds::{Ammunition, Launch, Rounds},
    },
};

pub use digest::{Digest, SessionDigest};
pub use notes::Note;
use notes::Notes;

/// How long the last round's result stays on the display, seconds.
const RESULT_S: f64 = 1.5;

/// Most tracers, splashes and strikes in one scene; of more, the farthest are left out.
pub const ROUNDS_SEEN_MAX: usize = 64;

/// How far behind the frame's time rounds are followed while no picture arrives, nanoseconds.
const BLIND_LAG_NS: i64 = 50_000_000;

/// Longest time that a round waits for an orientation measured after it, before it is scored by prediction, nanoseconds.
const POSE_WAIT_NS: i64 = 50_000_000;

/// What a session is made from.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The scenario, its seed the one of all chance.
    pub scenario: Scenario,
    /// The calibration of the camera and inertial unit in use.
    pub calibration: Calibration,
    /// All models in use.
    pub models: Arc<[Model]>,
    /// The model of each of the scenario's boats, in order.
    pub boat_models: Vec<ModelId>,
    /// Screen size in pixels.
    pub screen: (u32, u32),
    /// How the camera's bytes are laid out.
    pub video: PixelFormat,
    /// Whose estimate of the orientation is used.
    pub orientation: Source,
    /// What is known of headings beforehand.
    pub heading: HeadingSettings,
    /// What of the pictures shows the own ship or gun: no horizon and no sky is sought there.
    pub own_ship: Option<Mask>,
}

/// Why a session cannot be made.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SetupError {
    /// Not every boat has a model.
    #[error("the scenario has {boats} boats, but models for {models}: give each boat one")]
    Models {
        /// Boats in the scenario.
        boats: usize,
        /// Models given.
        models: usize,
    },
    /// No picture has the calibrated size in that layout.
    #[error("the calibrated size does not fit the camera's pictures: {0}")]
    Picture(#[from] PictureError),
}

/// What one tick gives.
#[derive(Debug)]
pub struct Step<'a> {
    /// What to draw.
    pub view: View<'a>,
    /// Rounds that ended, in the order in which they were fired within the step.
    pub records: &'a [ShotRecord],
    /// Faults that the session itself has found to come or go. It knows of them already: they are for the log only.
    pub faults: &'a [FaultChange],
    /// What else the log is to be told.
    pub notes: &'a [Note],
}

/// What to draw.
#[derive(Debug)]
pub struct View<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The picture that it is drawn over.
    pub picture: &'a Picture,
    /// No picture has come yet: the scene is black and says what is wrong.
    pub blind: bool,
    /// Whether the picture is another than the last step's.
    pub picture_is_new: bool,
    /// The picture's own time stamp, to find it again.
    pub mid_exposure: Time,
    /// Whether the camera's pose was known.
    pub pose_known: bool,
}

/// A running session.
#[derive(Debug)]
pub struct Session {
    setup: Setup,
    lens: Lens,
    plan: ScenePlan,
    sensors: Sensors,
    faults: FaultBoard,
    weapon: Weapon,
    meter: LightMeter,
    watch: Option<SeaStateTracker>,
    waves: WaveField,
    running: Option<Running>,
    black: Picture,
    scene: Scene,
    records: Vec<ShotRecord>,
    shots: u64,
    hits: u64,
    last_result: Option<(Time, bool)>,
    picture_is_new: bool,
    frames: u64,
    found: Vec<FaultChange>,
    notes: Notes,
    digest: SessionDigest,
}

/// What exists from the first picture on.
#[derive(Debug)]
struct Running {
    start: Time,
    now: Time,
    fleet: Fleet,
    rounds: Rounds,
}

impl Session {
    /// A session in which nothing has happened yet.
    pub fn new(setup: Setup) -> Result<Self, SetupError> {
        let scenario = &setup.scenario;
        if scenario.boats.len() != setup.boat_models.len() {
            return Err(SetupError::Models { boats: scenario.boats.len(), models: setup.boat_models.len() });
        }
        let (width, height) = (setup.calibration.lens.width, setup.calibration.lens.height);
        let black = Picture::black(setup.video, width, height)?;
        let lens = setup.calibration.lens.covering(setup.screen.0, setup.screen.1);
        let plan = ScenePlan::new(&Needs {
            size: setup.screen,
            video: setup.video,
            picture: (width, height),
            optics: setup.calibration.optics(),
            water: water_to_plan(scenario),
            boats: scenario.boats.len(),
            moving: scenario.boats.iter().filter(|b| b.course.speed_max_m_s() > 0.0).count(),
            belt: scenario.weapon.belt,
        });
        let waves = scenario.wave_field();
        let watch = SeaStateTracker::of(scenario);
        let sensors = Sensors::new(
            &setup.calibration,
            setup.orientation,
            &setup.heading,
            setup.own_ship.as_ref(),
            setup.scenario.eye_height_m,
            setup.scenario.visibility_m,
        );
        let weapon = Weapon::new(scenario.weapon.rounds_per_minute, scenario.weapon.belt);
        let meter = LightMeter::new(scenario.sun_direction, scenario.water.method);
        let scene = Scene {
            frame: 0,
            camera: CameraPose {
                world_from_camera: glam::DQuat::IDENTITY,
                position: DVec3::Z * scenario.eye_height_m,
            },
            lens,
            passes: plan.frame(false, &[], &[]),
            boats: Vec::with_capacity(scenario.boats.len()),
            rounds: Vec::with_capacity(2 * ROUNDS_SEEN_MAX),
            light: meter.light(),
            water: scenario.water,
            wind: scenario.wind.truncate(),
            sky: meter.sky(scenario.wind.length()),
            tones: meter.tones(),
            hud: Hud { rounds_left: scenario.weapon.belt, ..Hud::READY },
            guide: None,
        };
        Ok(Self {
            lens,
            plan,
            sensors,
            faults: FaultBoard::new(),
            weapon,
            meter,
            watch,
            waves,
            running: None,
            black,
            scene,
            records: Vec::new(),
            shots: 0,
            hits: 0,
            last_result: None,
            picture_is_new: false,
            frames: 0,
            found: Vec::new(),
            notes: Notes::default(),
            digest: SessionDigest::default(),
            setup,
        })
    }

    /// What the renderer must be able to do for this session.
    pub const fn plan(&self) -> &ScenePlan {
        &self.plan
    }

    /// What was wrong with the sensors so far.
    pub fn sensor_counts(&self) -> SensorCounts {
        self.sensors.counts()
    }

    /// How the inertial unit's clock does; `None` before that can be told.
    pub fn unit_clock(&self) -> Option<ClockReport> {
        self.sensors.clock()
    }

    /// Standard deviation of the heading since it was set or began, radians; `None` before there is one.
    pub fn heading_sigma(&self) -> Option<f64> {
        self.sensors.heading_sigma()
    }

    /// The head-up display as it was drawn last.
    pub const fn hud(&self) -> &Hud {
        &self.scene.hud
    }

    /// What is known of the sea, where the scenario has it measured in the video.
    pub fn sea(&self) -> Option<SeaReport> {
        self.watch.as_ref().map(SeaStateTracker::report)
    }

    /// Rounds fired and rounds that struck.
    pub const fn score(&self) -> (u64, u64) {
        (self.shots, self.hits)
    }

    /// The seed of all its chance.
    pub const fn seed(&self) -> u64 {
        self.setup.scenario.seed
    }

    /// The name of its scenario.
    pub fn scenario_name(&self) -> &str {
        &self.setup.scenario.name
    }

    /// A hash over all that this session gave.
    pub const fn digest(&self) -> SessionDigest {
        self.digest
    }

    /// Takes in one input. A tick gives a frame and what became of rounds; tick times must not go back.
    pub fn input(&mut self, input: &Input) -> Option<Step<'_>> {
        match input {
            Input::Event(event) => {
                self.event(event);
                None
            }
            Input::Tick(tick) => Some(self.tick(*tick)),
        }
    }

    /// Takes in what was reported. Reports of one device come in the order of their arrival. Afterwards [`Self::plan`] may be another: a
    /// renderer made for the old one must be made anew before the next tick's scene is drawn.
    pub fn event(&mut self, event: &Event) {
        match event {
            Event::Imu(sample) => self.sensors.imu(sample),
            Event::Frame(frame) => {
                self.follow_layout(&frame.picture);
                self.picture_is_new |= self.sensors.frame(frame);
            }
            Event::Trigger(edge) => self.weapon.edge(TriggerEdge {
                time: edge.time.plus_ns(self.setup.calibration.trigger.map_or(0, |t| t.latency_ns)),
                ..*edge
            }),
            Event::Ship(sample) => self.sensors.ship(sample),
            Event::Mark(mark) => self.sensors.mark(mark),
            Event::Fault(change) => {
                // The line for the log is the caller's affair: this board only knows what is there.
                let _ = self.faults.take(change);
            }
        }
    }

    /// A frame is due: gives what to draw, and what became of rounds since the last tick.
    pub fn tick(&mut self, tick: Tick) -> Step<'_> {
        self.records.clear();
        self.found.clear();
        self.notes.clear();
        let picture_is_new = std::mem::take(&mut self.picture_is_new);
        self.weapon.arm(self.broken().is_none());
        let video_time = self.sensors.video_time();
        let pose_known = match video_time {
            Some(video_time) => {
                if picture_is_new {
                    self.sensors.sight();
                }
                self.advance(video_time, tick.time);
                self.draw(video_time, tick.time, picture_is_new)
            }
            None => {
                self.draw_black(tick.time);
                false
            }
        };
        self.scene.frame = self.frames;
        self.frames += 1;
        self.watch_ship(tick.time);
        self.take_notes();
        self.digest.scenes.take(&self.scene);
        self.digest_records();
        let view = match self.sensors.newest_frame() {
            Some(frame) => View {
                scene: &self.scene,
                picture: &frame.picture,
                blind: false,
                picture_is_new,
                mid_exposure: frame.mid_exposure,
                pose_known,
            },
            None => View {
                scene: &self.scene,
                picture: &self.black,
                blind: true,
                picture_is_new: true,
                mid_exposure: tick.time,
                pose_known: false,
            },
        };
        Step { view, records: &self.records, faults: &self.found, notes: self.notes.new_ones() }
    }

    /// Pictures of the calibrated size that come in another layout than planned change the plan.
    fn follow_layout(&mut self, picture: &Picture) {
        let format = picture.format();
        if format == self.plan.video || (picture.width(), picture.height()) != self.plan.picture {
            return;
        }
        let (width, height) = self.plan.picture;
        // A picture of that size and layout is here, so a black one can be made.
        if let Ok(black) = Picture::black(format, width, height) {
            self.black = black;
            self.plan.video = format;
            self.setup.video = format;
        }
    }

    /// While no picture has come: nothing but what is wrong.
    fn draw_black(&mut self, time: Time) {
        let status = self.status(time, time);
        self.scene.boats.clear();
        self.scene.rounds.clear();
        self.scene.passes = self.plan.frame(false, &[], &[]);
        self.scene.hud.status = status;
        self.scene.hud.warning = self.warning();
    }

    /// Tells that the ship's heading is stuck, or no longer.
    fn watch_ship(&mut self, time: Time) {
        let change = match (self.sensors.ship_frozen_s(time), self.faults.is_active(Fault::ShipFrozen)) {
            (Some(seconds), false) => FaultChange::raised(
                time,
                Fault::ShipFrozen,
                format!(
                    "the ship's heading has been the very same for {seconds:.0} s though the ship rolls: is the compass settled, and does \
                     what sends its lines still hear it?"
                ),
            ),
            (None, true) => FaultChange::cleared(time, Fault::ShipFrozen),
            _ => return,
        };
        let _ = self.faults.take(&change);
        self.found.push(change);
    }

    fn take_notes(&mut self) {
        if let Some(watch) = &self.watch {
            self.notes.sea(&watch.report());
        }
        self.notes.heading(self.sensors.heading_sigma(), &self.sensors.counts().headings);
        self.notes.clock(self.frames, || self.sensors.clock());
    }

    fn digest_records(&mut self) {
        for record in &self.records {
            self.digest.records.take(record);
        }
    }

    /// Rounds still in the air are recorded as misses: the session ends here.
    pub fn finish(&mut self) -> &[ShotRecord] {
        self.records.clear();
        if let Some(running) = &mut self.running {
            // Twenty seconds are the longest that a round is followed.
            let end = running.now.plus_secs(21.0);
            running.rounds.advance(end, running.start, &mut running.fleet, &mut self.records);
        }
        self.count_records();
        self.digest_records();
        &self.records
    }

    fn start(&self, start: Time) -> Running {
        let scenario = &self.setup.scenario;
        let vessel = |(boat, model): (&crate::world::scenario::BoatSpec, &ModelId)| Vessel {
            name: boat.name.clone(),
            model: *model,
            course: boat.course.clone(),
        };
        let vessels = scenario.boats.iter().zip(&self.setup.boat_models).map(vessel).collect();
        let fleet = Fleet::new(vessels, Arc::clone(&self.setup.models), self.waves.clone(), start);
        let ammunition = Ammunition { weapon: scenario.weapon, wind: scenario.wind, seed: scenario.seed };
        Running { start, now: start, fleet, rounds: Rounds::new(ammunition, self.waves.clone(), start) }
    }

    /// Fires what the trigger asks for and follows all rounds up to the picture's time.
    fn advance(&mut self, video_time: Time, frame_time: Time) {
        let mut running = match self.running.take() {
            Some(running) => running,
            None => self.start(video_time),
        };
        // A frozen picture must not freeze the rounds.
        let now = running.now.max(video_time).max(frame_time.plus_ns(-BLIND_LAG_NS - STALE_NS));
        let newest = self.sensors.newest_orientation().unwrap_or(Time::MIN);
        let known = newest.max(frame_time.plus_ns(-POSE_WAIT_NS)).min(now);
        while let Some(fired) = self.weapon.fire(known) {
            self.fire(fired, &mut running);
        }
        running.rounds.advance(now, running.start, &mut running.fleet, &mut self.records);
        running.now = now;
        self.running = Some(running);
        self.count_records();
    }

    fn fire(&mut self, fired: Time, running: &mut Running) {
        self.shots += 1;
        let orientation = self.sensors.orientation(fired);
        let cause = match orientation {
            Err(_) => Some(NotScored::ImuStale),
            Ok(_) if !self.sensors.frame_fresh(fired) => Some(NotScored::CameraStale),
            Ok(_) => self.unscored(fired).map(NotScored::Fault),
        };
        let calibration = &self.setup.calibration;
        let camera = self.camera(orientation).unwrap_or(self.scene.camera);
        let launch = Launch {
            shot: self.shots,
            fired,
            muzzle: camera.position + camera.world_from_camera * calibration.muzzle_in_camera,
            bore: camera.world_from_camera * calibration.bore_in_camera(),
            pose_age_ns: orientation.map_or_else(NoPose::age_ns, |o| o.provenance.age_ns()),
        };
        match cause {
            None => running.rounds.launch(launch, running.start, &mut self.records),
            Some(cause) => {
                let Launch { shot, fired, muzzle, bore, pose_age_ns } = launch;
                let outcome = Outcome::NotScored { cause };
                self.records.push(ShotRecord { shot, fired, muzzle, bore, pose_age_ns, outcome });
            }
        }
    }

    fn camera(&self, orientation: Result<OrientationAt, NoPose>) -> Option<CameraPose> {
        let world_from_imu = orientation.ok()?.world_from_imu;
        Some(CameraPose {
            world_from_camera: self.sensors.world_from_camera(world_from_imu),
            position: DVec3::Z * self.setup.scenario.eye_height_m,
        })
    }

    fn count_records(&mut self) {
        for record in &self.records {
            let (time, hit) = match &record.outcome {
                Outcome::Hit { time, .. } => (*time, true),
                Outcome::Miss { time, .. } => (*time, false),
                Outcome::NotScored { .. } => continue,
            };
            self.hits += u64::from(hit);
            // Of several results at once a hit is what the sailor wants to see.
            if hit
                || self.last_result.is_none_or(|(last, was_hit)| !was_hit || time.secs_since(last) > RESULT_S)
            {
                self.last_result = Some((time, hit));
            }
        }
    }

    /// Fills the scene; says whether the camera's pose was known.
    fn draw(&mut self, video_time: Time, frame_time: Time, picture_is_new: bool) -> bool {
        let camera = self.camera(self.sensors.orientation(video_time));
        let lens = self.sensors.lens_at(video_time);
        if let (Some(camera), true, Some(frame)) = (&camera, picture_is_new, self.sensors.newest_frame()) {
            self.meter.observe(video_time, &frame.picture, &lens, camera);
            if let Some(watch) = &mut self.watch {
                watch.observe(video_time, &frame.picture, &lens, camera);
            }
        }
        self.follow_sea();
        let status = self.status(video_time, frame_time);
        let warning = self.warning();
        let heading_tenths_deg = self.sensors.heading_shown();
        let sea = self.sea().map(|sea| (sea.in_use.state, sea.in_use.source));
        let scene = &mut self.scene;
        scene.boats.clear();
        scene.rounds.clear();
        if let (Some(camera), Some(running)) = (&camera, &self.running) {
            scene.camera = *camera;
            scene.lens = lens.covering(self.setup.screen.0, self.setup.screen.1);
            // A computer that is too hot draws no reflections and wakes: half of the work.
            let cool = !self.faults.is_active(Fault::Thermal);
            let eye = Eye {
                camera,
                lens: &scene.lens,
                visibility_m: self.setup.scenario.visibility_m,
                wind: scene.wind,
                reflections: cool && self.plan.has(Pass::Water) && sea_reflects(scene.water.force),
                wakes: cool && self.plan.has(Pass::Wake),
            };
            running.fleet.seen(&eye, video_time, &mut scene.boats);
            running.rounds.views(video_time, running.start, &running.fleet, &mut scene.rounds);
            scene.rounds.retain(|r| eye.sees_round(r));
            let range = |r: &RoundView| r.place().distance(camera.position);
            scene.rounds.sort_by(|a, b| range(b).total_cmp(&range(a)));
            let surplus = scene.rounds.len().saturating_sub(ROUNDS_SEEN_MAX);
            scene.rounds.drain(..surplus);
        }
        scene.passes = self.plan.frame(camera.is_some(), &scene.boats, &scene.rounds);
        scene.light = self.meter.light();
        scene.sky = self.meter.sky(scene.wind.length());
        scene.tones = self.meter.tones();
        scene.hud = Hud {
            status,
            warning,
            rounds_left: self.weapon.rounds_left(),
            shots: u32::try_from(self.shots).unwrap_or(u32::MAX),
            hits: u32::try_from(self.hits).unwrap_or(u32::MAX),
            clock_s: self.running.as_ref().map_or(0.0, |r| video_time.secs_since(r.start)),
            sea,
            heading_tenths_deg,
        };
        camera.is_some()
    }

    /// Lets waves, wind and with them boats and reflections go over to the sea in the video.
    fn follow_sea(&mut self) {
        let (Some(watch), Some(running)) = (&mut self.watch, &mut self.running) else { return };
        // What is drawn and scored up to now stays as it was.
        let now_s = running.now.secs_since(running.start);
        if let Some(spec) = watch.change(now_s) {
            let next = WaveField::new(&spec, self.setup.scenario.seed);
            self.waves = std::mem::replace(&mut self.waves, WaveField::FLAT).changing_to(next, now_s);
            running.fleet.set_waves(self.waves.clone(), running.now);
            running.rounds.set_sea(self.waves.clone());
        }
        let (wind, force) = watch.wind();
        self.scene.wind = wind;
        self.scene.water.force = force;
    }

    /// The worst fault because of which no round is fired.
    fn broken(&self) -> Option<Fault> {
        self.faults.active().next().filter(|f| f.severity() == Severity::Fault)
    }

    /// A fault that was there at `time` and because of which rounds are not scored.
    fn unscored(&self, time: Time) -> Option<Fault> {
        self.faults
            .active()
            .filter(|f| f.severity() >= Severity::NotScored)
            .find(|f| self.faults.since(*f).is_some_and(|since| since <= time))
    }

    fn warning(&self) -> Option<Fault> {
        self.faults.active().find(|f| f.severity() == Severity::Warning)
    }

    fn status(&self, video_time: Time, frame_time: Time) -> Status {
        match self.faults.active().next() {
            Some(f) if f.severity() == Severity::Fault => {
                return Status::Fault { cause: f.cause(), action: f.action() };
            }
            Some(f) if f.severity() == Severity::NotScored => {
                return Status::NotScored { cause: f.cause(), action: f.action() };
            }
            _ => {}
        }
        if let Some(trouble) = self.sensors.trouble(frame_time) {
            return trouble;
        }
        match self.last_result {
            Some((time, hit)) if video_time.secs_since(time) < RESULT_S => {
                if hit {
                    Status::Hit
                } else {
                    Status::Miss
                }
            }
            _ => Status::Ready,
        }
    }

    /// A scene in which everything that this session can ever show is in view. Drawn once and thrown away before the first
    /// frame, it lets drivers finish compiling what they put off until it is used.
    pub fn rehearsal(&self) -> Scene {
        let eye_height_m = self.setup.scenario.eye_height_m;
        let camera = CameraPose {
            world_from_camera: look(0.0, -0.08, 0.0),
            position: DVec3::new(0.0, 0.0, eye_height_m),
        };
        let eye = Eye {
            camera: &camera,
            lens: &self.lens,
            visibility_m: self.setup.scenario.visibility_m,
            wind: self.scene.wind,
            reflections: self.plan.has(Pass::Water),
            wakes: self.plan.has(Pass::Wake),
        };
        let models = &self.setup.models;
        let boats: Vec<_> = self
            .setup
            .boat_models
            .iter()
            .enumerate()
            .filter_map(|(boat, id)| {
                let model = models.get(usize::from(id.0))?;
                let ahead_m = (eye_height_m * 10.0).max(4.0 * model.radius_m());
                let pose = RigidPose {
                    world_from_body: glam::DQuat::IDENTITY,
                    position: DVec3::new(0.0, ahead_m, 0.0),
                };
                let under_way = CourseState {
                    position: pose.position.truncate(),
                    heading: std::f64::consts::FRAC_PI_2,
                    speed_m_s: 5.0,
                    turn_rate: 0.0,
                };
                let wake = || Wake::of(Hull::of(model), f64::from(-model.min.z), 0.0, |_| under_way, |_| 0.0);
                eye.see_with_wake(&Afloat { boat, model_id: *id, model, pose, water_level: 0.0 }, wake)
            })
            .collect();
        let at = DVec3::new(0.0, eye_height_m * 10.0, 0.5);
        let rounds = vec![
            RoundView::Splash { at, height_m: 1.0, radius_m: 0.5, opacity: 1.0 },
            RoundView::Strike { at, radius_m: 0.5, opacity: 1.0 },
            RoundView::Tracer { from: at, to: at + DVec3::Y * 10.0, radiance: glam::Vec3::ONE },
        ];
        Scene { camera, passes: self.plan.frame(true, &boats, &rounds), boats, rounds, ..self.scene.clone() }
    }
}

/// How the sea mirrors as far as it is known beforehand: one that is measured may turn out calm enough to mirror.
fn water_to_plan(scenario: &Scenario) -> Water {
    let mut water = scenario.water;
    if scenario.sea_from_video && !sea_reflects(water.force) {
        water.force = BeaufortForce::of_wind(0.0);
    }
    water
}
