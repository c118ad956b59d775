//! A session: a pure function from its inputs (devices' reports and ticks) to scenes and records.
//!
//! Its three stages are stepped one after the other: [`Estimator`], [`World`], [`Composer`].

mod answer;
mod digest;
mod notes;
mod setup;

use glam::DVec3;

use crate::{
    calibration::Calibration,
    estimate::{
        Estimator, EstimatorSettings, SeaReport, SensorCounts,
        clock::ClockReport,
        light::Luminaries,
        pose::{NoPose, STALE_NS},
        registration::{Misfit, RegistrationChecks},
    },
    event::{Event, Input, Tick, TriggerEdge},
    fault::{Fault, FaultBoard, FaultChange, FirePermission, Severity},
    frame::{
        Composer, ComposerSettings, FrameMoment, WaterDrawn,
        plan::ScenePlan,
        scene::{Hud, Scene},
    },
    geometry::CameraPose,
    time::Time,
    water::ReflectionMethod,
    world::{BoreAim, World, exercise::ExerciseEvent, score::ShotRecord, track::TrackBlock},
};

pub use crate::frame::{LIGHTS_A_BOAT, ROUNDS_SEEN_MAX};
pub use answer::{TickAnswer, View};
pub use digest::{Digest, SessionDigest};
pub use notes::Note;
use notes::Notes;
pub use setup::{Setup, SetupError};

/// A running session.
#[derive(Debug)]
pub struct Session {
    calibration: Calibration,
    estimator: Estimator,
    world: World,
    composer: Composer,
    faults: FaultBoard,
    records: Vec<ShotRecord>,
    happened: Vec<ExerciseEvent>,
    tracks: TrackBlock,
    found: Vec<FaultChange>,
    notes: Notes,
    digest: SessionDigest,
}

impl Session {
    /// A session in which nothing has happened yet.
    pub fn new(setup: Setup) -> Result<Self, SetupError> {
        let scenario = &setup.scenario;
        if scenario.boats.len() != setup.boat_models.len() {
            return Err(SetupError::Models { boats: scenario.boats.len(), models: setup.boat_models.len() });
        }
        let estimator = Estimator::new(&EstimatorSettings {
            calibration: &setup.calibration,
            orientation: setup.orientation,
            heading: &setup.heading,
            own_ship: &setup.own_ship,
            eye_height_m: scenario.eye_height_m,
            daylight: scenario.daylight,
            measures_tones: scenario.water.method == ReflectionMethod::Baked,
            wind: scenario.wind.truncate(),
            force: scenario.water.force,
            sea: World::sea_assumed(scenario),
        });
        let composer = Composer::new(
            &ComposerSettings {
                scenario,
                calibration: &setup.calibration,
                own_ship: &setup.own_ship,
                screen: setup.screen,
                video: setup.video,
                models: &setup.models,
                boat_models: &setup.boat_models,
            },
            &estimator,
        )?;
        Ok(Self {
            world: World::new(scenario, setup.models, &setup.boat_models),
            estimator,
            composer,
            calibration: setup.calibration,
            faults: FaultBoard::new(),
            records: Vec::new(),
            happened: Vec::new(),
            tracks: TrackBlock::default(),
            found: Vec::new(),
            notes: Notes::default(),
            digest: SessionDigest::default(),
        })
    }

    /// The plan that the renderer must be able to draw for this session.
    pub const fn plan(&self) -> &ScenePlan {
        self.composer.plan()
    }

    /// The virtual world as it is now.
    pub const fn world(&self) -> &World {
        &self.world
    }

    /// Faults that are there now.
    pub fn faults(&self) -> impl Iterator<Item = Fault> + '_ {
        self.faults.active()
    }

    /// Direction of the barrel at the newest picture, world, unit vector, and the picture's width as an angle, radians; `None` while the pose is not
    /// known.
    pub fn gun(&self) -> Option<(DVec3, f64)> {
        let time = self.estimator.video_time()?;
        let pose = self.estimator.camera(time).ok()?.pose;
        let lens = &self.composer.scene().lens;
        let half = 0.5 * f64::from(lens.width) / lens.focal.x;
        Some((pose.world_from_camera * self.calibration.bore_in_camera(), 2.0 * half.atan()))
    }

    /// Counts of sensor data that were not used so far.
    pub fn sensor_counts(&self) -> SensorCounts {
        self.estimator.counts()
    }

    /// How the inertial unit's clock does; `None` before that can be told.
    pub fn unit_clock(&self) -> Option<ClockReport> {
        self.estimator.unit_clock()
    }

    /// Standard deviation of the heading since it was set or began, radians; `None` before there is one.
    pub fn heading_sigma(&self) -> Option<f64> {
        self.estimator.heading_sigma()
    }

    /// Sun and moon at the newest picture.
    pub const fn luminaries(&self) -> &Luminaries {
        self.estimator.luminaries()
    }

    /// Confirmation of the orientation by the pictures.
    pub fn checks(&self, now: Time) -> RegistrationChecks {
        self.estimator.checks(now)
    }

    /// The head-up display as it was drawn last.
    pub const fn hud(&self) -> &Hud {
        &self.composer.scene().hud
    }

    /// The state of the sea, where the scenario has it measured in the video.
    pub fn sea(&self) -> Option<SeaReport> {
        self.estimator.sea()
    }

    /// Rounds fired and rounds that struck.
    pub const fn score(&self) -> (u64, u64) {
        let score = self.world.score();
        (score.shots, score.hits)
    }

    /// The seed of all its chance.
    pub const fn seed(&self) -> u64 {
        self.world.seed()
    }

    /// The name of its scenario.
    pub fn scenario_name(&self) -> &str {
        self.world.name()
    }

    /// A hash over all that this session gave.
    pub const fn digest(&self) -> SessionDigest {
        self.digest
    }

    /// Takes in one input. A tick gives a frame and what became of rounds; tick times must not go back.
    pub fn input(&mut self, input: &Input) -> Option<TickAnswer<'_>> {
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
            Event::Imu(sample) => self.estimator.imu(sample),
            Event::Frame(frame) => {
                self.composer.follow_layout(&frame.picture);
                self.estimator.frame(frame);
            }
            Event::Trigger(edge) => self.world.trigger(TriggerEdge {
                time: edge.time.plus_ns(self.calibration.trigger.map_or(0, |t| t.latency_ns)),
                ..*edge
            }),
            Event::Ship(sample) => self.estimator.ship(sample),
            Event::ShipFix(fix) => {
                self.estimator.ship_fix(fix);
                self.world.ship_fix(fix);
            }
            Event::Mark(mark) => self.estimator.mark(mark),
            Event::Act(act) => self.world.act(*act),
            Event::Order(order) => self.world.order(order),
            Event::Fault(change) => {
                // The line for the log is the caller's affair: this board only knows what is there.
                let _ = self.faults.take(change);
            }
        }
    }

    /// A frame is due: gives what to draw, and what became of rounds since the last tick.
    pub fn tick(&mut self, tick: Tick) -> TickAnswer<'_> {
        self.records.clear();
        self.happened.clear();
        self.tracks.clear();
        self.found.clear();
        self.notes.clear();
        let picture_is_new = self.estimator.look(!self.faults.is_active(Fault::LoadUnseen));
        self.watch_registration(tick.time);
        let permission = FirePermission::now(&self.faults, self.estimator.trouble(tick.time));
        self.world.arm(permission.fires());
        let video_time = self.estimator.video_time();
        if let Some(video_time) = video_time {
            self.advance(video_time, tick.time);
        }
        if let Some(sea) = self.estimator.sea_measured() {
            self.world.follow_sea(&sea);
        }
        let moment = FrameMoment {
            video_time,
            permission,
            is_paused: self.world.clock().is_paused(),
            warning: self.warning_shown(),
            checks: self.estimator.checks(tick.time),
            water: self.water_drawn(),
        };
        let pose_known = self.composer.compose(&moment, &self.estimator, &self.world);
        self.watch_ship(tick.time);
        self.take_notes();
        self.digest.scenes.take(self.composer.scene());
        self.digest_records();
        let frame = self.estimator.newest_frame();
        let view = View {
            scene: self.composer.scene(),
            picture: frame.map_or(self.composer.black(), |frame| &frame.picture),
            blind: frame.is_none(),
            picture_is_new: picture_is_new || frame.is_none(),
            mid_exposure: frame.map_or(tick.time, |frame| frame.mid_exposure),
            pose_known,
        };
        TickAnswer {
            view,
            records: &self.records,
            events: &self.happened,
            tracks: &self.tracks,
            faults: &self.found,
            notes: self.notes.new_ones(),
        }
    }

    /// Fires what the trigger asks for and follows boats and rounds up to the picture's time.
    fn advance(&mut self, video_time: Time, frame_time: Time) {
        /// How far behind the frame's time rounds are followed while no picture arrives, nanoseconds.
        const BLIND_LAG_NS: i64 = 50_000_000;
        /// Longest time that a round waits for an orientation measured after it, before it is scored by prediction, nanoseconds.
        const POSE_WAIT_NS: i64 = 50_000_000;
        // A frozen picture must not freeze the rounds.
        let until = video_time.max(frame_time.plus_ns(-BLIND_LAG_NS - STALE_NS));
        let newest = self.estimator.newest_orientation().unwrap_or(Time::MIN);
        let known = newest.max(frame_time.plus_ns(-POSE_WAIT_NS));
        let Self { calibration, estimator, composer, faults, world, records, .. } = self;
        let aim = |fired| aim(calibration, estimator, composer.scene().camera, faults, fired);
        world.advance(video_time, until, known, aim, records);
        self.happened.extend_from_slice(self.world.events());
        self.take_tracks();
    }

    /// Takes over the world's tracks, and fills in where the camera was.
    fn take_tracks(&mut self) {
        let Self { tracks, world, estimator, .. } = self;
        tracks.append(world.tracks());
        for sample in &mut tracks.samples {
            let camera = estimator.camera(Time::from_ns(sample.time_ns));
            sample.camera = camera.ok().map(|camera| camera.pose.into());
        }
    }

    /// Tracks of boats, rounds and gun that the last tick, or the end, added.
    pub const fn tracks(&self) -> &TrackBlock {
        &self.tracks
    }

    /// The warning that the sailor sees, of all that there are: that the picture is late comes before what does not change it.
    fn warning_shown(&self) -> Option<Fault> {
        let late = Some(Fault::LoadRate).filter(|fault| self.faults.is_active(*fault));
        late.or_else(|| self.faults.active().find(|fault| fault.severity() == Severity::Warning))
    }

    /// Which boats have reflections and wakes: a computer that is too hot or too busy leaves some out, half of a frame's work.
    fn water_drawn(&self) -> WaterDrawn {
        if self.faults.is_active(Fault::Thermal) || self.faults.is_active(Fault::LoadWater) {
            WaterDrawn::None
        } else if self.faults.is_active(Fault::LoadFar) {
            WaterDrawn::Nearest
        } else {
            WaterDrawn::All
        }
    }

    /// Tells that the ship's heading is stuck, or no longer.
    fn watch_ship(&mut self, time: Time) {
        let change = match (self.estimator.ship_frozen_s(time), self.faults.is_active(Fault::ShipFrozen)) {
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
        self.find(change);
    }

    /// Tells that picture and inertial unit disagree, or no longer.
    fn watch_registration(&mut self, time: Time) {
        let misfit = self.estimator.misfit();
        let fault = misfit.map(Misfit::fault);
        for other in Misfit::FAULTS.into_iter().filter(|f| Some(*f) != fault) {
            if self.faults.is_active(other) {
                self.find(FaultChange::cleared(time, other));
            }
        }
        if let Some(misfit) = misfit
            && !self.faults.is_active(misfit.fault())
        {
            self.find(FaultChange::raised(time, misfit.fault(), misfit.to_string()));
        }
    }

    /// Takes in a fault that this session has found itself.
    fn find(&mut self, change: FaultChange) {
        let _ = self.faults.take(&change);
        self.found.push(change);
    }

    fn take_notes(&mut self) {
        if let Some(report) = self.estimator.sea() {
            self.notes.sea(&report);
        }
        self.notes.light(self.estimator.sky_agreement());
        self.notes.luminaries(self.estimator.luminaries());
        self.notes.unexpected_horizons(self.estimator.counts().horizons.unexpected);
        self.notes.heading(self.estimator.heading_sigma(), &self.estimator.counts().headings);
        self.notes.clock(self.composer.scene().frame + 1, || self.estimator.unit_clock());
    }

    fn digest_records(&mut self) {
        for record in &self.records {
            self.digest.records.take(record);
        }
    }

    /// Rounds still in the air are recorded as misses: the session ends here. Gives these, and what else the score needs.
    pub fn finish(&mut self) -> (&[ShotRecord], &[ExerciseEvent]) {
        self.records.clear();
        self.tracks.clear();
        self.world.finish(&mut self.records);
        self.take_tracks();
        self.digest_records();
        (&self.records, self.world.events())
    }

    /// A scene in which everything that this session can ever show is in view. Drawn once and thrown away before the first
    /// frame, it lets drivers finish compiling what they put off until it is used.
    pub fn rehearsal(&self) -> Scene {
        self.composer.warm_up()
    }
}

/// Where the barrel pointed as a round left it at `fired`; from where the camera was drawn last, where that is not known.
fn aim(
    calibration: &Calibration,
    estimator: &Estimator,
    drawn: CameraPose,
    faults: &FaultBoard,
    fired: Time,
) -> BoreAim {
    let camera = estimator.camera(fired);
    let pose = camera.map_or(drawn, |camera| camera.pose);
    BoreAim {
        muzzle: pose.position + pose.world_from_camera * calibration.muzzle_in_camera,
        bore: pose.world_from_camera * calibration.bore_in_camera(),
        pose_age_ns: camera.map_or_else(NoPose::age_ns, |camera| camera.age_ns),
        unscored: FirePermission::unscored(faults, fired, estimator.stale_at(fired)),
    }
}
