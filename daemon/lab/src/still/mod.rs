//! A picture with boats composed into it: TOML text in, checked values out, and the [`Scene`] that the renderer draws.
//!
//! The same steps as in a [`Session`](bowwave_core::session::Session), without time: the camera is given instead of measured.

mod camera;
mod read;

use std::path::Path;

use anyhow::{Context, Result};
use bowwave::loading::warn_of_former_names;
use glam::DVec2;

use bowwave_core::{
    daylight::Daylight,
    estimate::light::LightMeter,
    event::Picture,
    frame::{
        plan::{InView, SceneNeeds, ScenePlan},
        scene::{Hud, LeftOut, Pass, PassDecision, Scene},
        view::ViewFrustum,
        wake::Wake,
    },
    geometry::{CameraPose, Lens, ahead},
    model::{Model, ModelId},
    text::toml::{TEXT_BYTES_MAX, TomlError, TomlPlace},
    time::Time,
    water::{ReflectionMethod, Water},
    world::{
        boats::{CourseState, Hull, quasi_static},
        fleet::Afloat,
        scenario::{CAMERA_CLEAR_M, place},
        waves::{WaveField, WaveSpec},
    },
};
use bowwave_files::plain_text;
pub use camera::{Focal, StillAttitude, StillCamera, film_focal_px};

/// A commented text to begin with.
pub const EXAMPLE: &str = include_str!("example.toml");

/// Most boats of a picture.
pub const BOATS_MAX: usize = 64;
/// Farthest place of a boat, metres.
pub const RANGE_MAX_M: f64 = 20_000.0;
/// Smallest and largest picture, pixels each way.
pub const SIZE_RANGE: std::ops::RangeInclusive<u32> = 16..=8192;

/// A checked text.
#[derive(Clone, Debug, PartialEq)]
pub struct Still {
    /// The picture, or a folder of pictures, as the text names it.
    pub picture: String,
    /// Seed of the waves that boats ride on.
    pub seed: u64,
    /// Time between the pictures of a folder, seconds; `None` where they have nothing to do with each other.
    pub interval_s: Option<f64>,
    /// The camera.
    pub camera: StillCamera,
    /// Waves and where the wind comes from.
    pub waves: WaveSpec,
    /// Sun and visibility.
    pub daylight: Daylight,
    /// How the sea mirrors, and at which wind force.
    pub water: Water,
    /// The boats.
    pub boats: Vec<StillBoat>,
    /// Former names that the text uses, each with its place and the new name.
    pub warnings: Vec<String>,
}

/// A boat in the first picture.
#[derive(Clone, Debug, PartialEq)]
pub struct StillBoat {
    /// Name of the boat, for errors.
    pub name: String,
    /// Name of a model, or path of its file, for the caller to resolve.
    pub model: String,
    /// Where it is.
    pub place: StillPlace,
    /// Where it goes, radians clockwise from north.
    pub heading: f64,
    /// How fast, m/s.
    pub speed_m_s: f64,
    stands: TomlPlace,
}

impl StillBoat {
    /// A boat at rest that no text places. It is called by its model.
    pub fn new(model: &str, place: StillPlace, heading: f64) -> Self {
        Self {
            name: model.to_owned(),
            model: model.to_owned(),
            place,
            heading,
            speed_m_s: 0.0,
            stands: TomlPlace::nowhere("boat"),
        }
    }
}

/// Where a boat's middle meets the water.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StillPlace {
    /// World x and y, metres from the camera.
    World(DVec2),
    /// A pixel of the picture; the sea there has its mean height.
    Pixel(DVec2),
}

/// The scene drawn over one picture, with its plan.
#[derive(Clone, Debug)]
pub struct Composed {
    /// The scene.
    pub scene: Scene,
    /// Passes and sizes that the renderer needs for it.
    pub plan: ScenePlan,
}

impl Still {
    /// Checks a text. `origin` is its name in errors.
    pub fn parse(text: &str, origin: &str) -> Result<Self, TomlError> {
        read::still(text, origin)
    }

    /// Reads and checks a file; tells of former names in it. `advice` says where an example of such a file is.
    pub fn read(path: &Path, advice: &str) -> Result<Self> {
        let text = plain_text(path, TEXT_BYTES_MAX)
            .with_context(|| format!("cannot read the scene {}; {advice}", path.display()))?;
        let still = Self::parse(&text, &path.display().to_string())?;
        warn_of_former_names(&still.warnings);
        Ok(still)
    }

    /// The scene over picture number `index` (0 for a single one). `boat_models` says for each boat which of `models` it is.
    /// `focal_px` is the picture's own focal length in pixels, where it tells one; the text's goes first.
    ///
    /// # Errors
    /// Names the place in the text that does not fit the picture.
    pub fn compose(
        &self,
        picture: &Picture,
        index: u32,
        (models, boat_models): (&[Model], &[ModelId]),
        focal_px: Option<f64>,
    ) -> Result<Composed, TomlError> {
        let size = (picture.width(), picture.height());
        let (lens, camera) = self.sight(size, focal_px)?;
        let plan = ScenePlan::new(&SceneNeeds {
            size,
            video: picture.format(),
            picture: size,
            optics: lens.optics(),
            water: self.water,
            boats: self.boats.len(),
            moving: self.boats.iter().filter(|b| b.speed_m_s > 0.0).count(),
            belt: 0,
            burns: false,
            lights: false,
            lamps: false,
            sun_stays_up: false,
            sun_stays_down: false,
            phantoms: Default::default(),
        });
        let eye = ViewFrustum {
            camera: &camera,
            lens: &lens,
            visibility_m: self.daylight.visibility_m,
            // The picture shows where the water is.
            wind: DVec2::ZERO,
            reflections: plan.has(Pass::Water),
            wakes: plan.has(Pass::Wake),
            water_within_m: f64::INFINITY,
        };
        let waves = WaveField::new(&self.waves, self.seed);
        let time_s = f64::from(index) * self.interval_s.unwrap_or(0.0);
        let mut boats = Vec::with_capacity(self.boats.len());
        for (number, id) in boat_models.iter().enumerate().take(self.boats.len()) {
            let Some(model) = models.get(usize::from(id.0)) else { continue };
            let afloat = self.afloat(number, (*id, model), &eye, &waves, time_s)?;
            boats.extend(eye.see_with_wake(&afloat, || self.wake(number, &afloat, &waves, time_s)));
        }
        boats.sort_by(|a, b| b.range_m.total_cmp(&a.range_m));
        let mut meter = LightMeter::new(&self.daylight, self.water.method == ReflectionMethod::Baked);
        meter.observe(Time::from_ns(0), picture, &lens, &camera);
        let mut light = meter.light();
        light.sun *= self.daylight.sun_strength as f32;
        let in_view = InView {
            pose_known: true,
            sun_shines: light.sun_shines(),
            noisy: meter.noise().is_some(),
            lamps: false,
            boats: &boats,
            lights: &[],
            rounds: &[],
        };
        let mut passes = plan.frame(&in_view);
        passes[Pass::Hud as usize] = PassDecision::LeftOut(LeftOut::NoTrainee);
        let scene = Scene {
            frame: u64::from(index),
            time_s: f64::from(index) / 30.0,
            camera,
            lens,
            passes,
            boats,
            rounds: Vec::new(),
            lights: Vec::new(),
            lamps: Vec::new(),
            flash: None,
            searchlight: None,
            recoil: 1.0,
            light,
            water: self.water,
            wind: -place(self.waves.wind_from, self.water.force.wind_mean_m_s()),
            sky: meter.sky(self.water.force.wind_mean_m_s()),
            tones: meter.tones(),
            noise: meter.noise(),
            hud: Hud::READY,
            guide: None,
        };
        Ok(Composed { scene, plan })
    }

    /// A boat on the water `time_s` after the first picture.
    fn afloat<'a>(
        &self,
        number: usize,
        (id, model): (ModelId, &'a Model),
        eye: &ViewFrustum<'_>,
        waves: &WaveField,
        time_s: f64,
    ) -> Result<Afloat<'a>, TomlError> {
        let boat = &self.boats[number];
        let refuse = |problem: String| Err(boat.stands.error(problem));
        let (start, on_mean_sea) = match boat.place {
            StillPlace::World(place) => (place, false),
            StillPlace::Pixel(pixel) => match camera::on_the_sea(eye, pixel) {
                Ok(place) => (place, true),
                Err(problem) => return refuse(problem),
            },
        };
        let clear_m = model.radius_m() + CAMERA_CLEAR_M;
        let forward = ahead(boat.heading);
        let position = start + forward * (boat.speed_m_s * time_s);
        if position.length() < clear_m {
            return refuse(format!(
                "{} lies {:.1} m off, but its model {} needs {clear_m:.1} m; put it farther off",
                boat.name,
                position.length(),
                boat.model
            ));
        }
        let state = CourseState {
            position,
            heading: boat.heading,
            speed_m_s: boat.speed_m_s,
            ..CourseState::default()
        };
        let mut floating = quasi_static(&state, &Hull::of(model), waves, time_s);
        if on_mean_sea {
            // The picture shows where the water is: no wave of ours lifts the boat off it.
            floating.pose.position.z -= floating.water_level;
            floating.water_level = 0.0;
        }
        Ok(Afloat {
            boat: number,
            model_id: id,
            model,
            pose: floating.pose,
            water_level: floating.water_level,
        })
    }

    /// The wake of a boat that came straight on.
    fn wake(&self, number: usize, afloat: &Afloat<'_>, waves: &WaveField, time_s: f64) -> Option<Wake> {
        let boat = self.boats.get(number)?;
        let hull = Hull::of(afloat.model);
        let forward = ahead(boat.heading);
        let state = |t: f64| CourseState {
            position: afloat.pose.position.truncate() + forward * (boat.speed_m_s * (t - time_s)),
            heading: boat.heading,
            speed_m_s: boat.speed_m_s,
            sway_m_s: 0.0,
            turn_rate: 0.0,
        };
        let Hull { length_m, beam_m } = hull;
        // A boat that the picture lays on its water has all of its wake there.
        let waves = Some(waves).filter(|_| matches!(boat.place, StillPlace::World(_)));
        let height = |p| waves.map_or(0.0, |w| w.plane_under(p, 0.0, length_m, beam_m, time_s).height_m);
        Wake::of(hull, f64::from(-afloat.model.min.z), time_s, state, height)
    }

    /// Lens and place of the camera in a picture of that size; `focal_px` as for [`Still::compose`].
    ///
    /// # Errors
    /// As [`Still::compose`].
    pub fn sight(&self, size: (u32, u32), focal_px: Option<f64>) -> Result<(Lens, CameraPose), TomlError> {
        let lens = self.camera.lens(size, focal_px)?;
        let pose = self.camera.pose(&lens)?;
        Ok((lens, pose))
    }
}

#[cfg(test)]
#[path = "still_tests.rs"]
mod tests;
