//! A checked scenario.

use std::fmt::Display;

use glam::{DVec2, DVec3};

use crate::{
    daylight::Daylight,
    side::Side,
    text::toml::{TomlError, TomlPlace},
    water::Water,
    world::{
        boats::{Behaviour, LightsKept},
        burst::BurstSpec,
        exercise::ExerciseSpec,
        gunnery::Projectile,
        searchlight::SearchlightSpec,
        waves::{WaveField, WaveSpec},
        weapon::BarrelHeat,
    },
};

/// Space that every boat must leave between its farthest point and the camera, metres.
pub const CAMERA_CLEAR_M: f64 = 2.0;
/// Courses of scenarios without a duration are checked this far ahead, seconds.
const ENDLESS_S: f64 = 24.0 * 3600.0;

/// A checked scenario.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenario {
    /// Its name.
    pub name: String,
    /// Seed of the waves and of the rounds' scatter.
    pub seed: u64,
    /// When it is over, seconds; `None` for one that goes on.
    pub duration_s: Option<f64>,
    /// Waves and where the wind comes from.
    pub waves: WaveSpec,
    /// Whether the sea is measured in the video; the waves above are then what is drawn until it is.
    pub sea_from_video: bool,
    /// Velocity of the air, world, m/s.
    pub wind: DVec3,
    /// Height of the camera over the mean sea, metres.
    pub eye_height_m: f64,
    /// Sun and visibility.
    pub daylight: Daylight,
    /// How the sea mirrors, and at which wind force.
    pub water: Water,
    /// The training weapon.
    pub weapon: WeaponSpec,
    /// The searchlight on the gun, where there is one.
    pub searchlight: Option<SearchlightSpec>,
    /// Rules, goals, calls and events.
    pub exercise: ExerciseSpec,
    /// The boats.
    pub boats: Vec<BoatSpec>,
    /// Former names that the text uses, each with its place and the new name.
    pub warnings: Vec<String>,
}

/// The training weapon.
#[derive(Clone, Debug, PartialEq)]
pub struct WeaponSpec {
    /// The built-in kind that it is made from, if any.
    pub kind: Option<String>,
    /// Cyclic rate.
    pub rounds_per_minute: f64,
    /// Rounds in the belt.
    pub belt: u32,
    /// Belts besides that.
    pub spare_belts: u32,
    /// Time that a belt takes to put in, seconds.
    pub reload_s: f64,
    /// Rounds from one stoppage to the next on average; `None` for none.
    pub stoppage_every: Option<f64>,
    /// Its round.
    pub projectile: Projectile,
    /// Scatter, standard deviation along each of two axes, milliradians.
    pub dispersion_mrad: f64,
    /// Every how many rounds one is a tracer; `None` for no tracers.
    pub tracer_every: Option<u32>,
    /// Distance from the muzzle at which a tracer burns out, metres.
    pub tracer_burnout_m: f64,
    /// Height of the splash of a round that enters steeply, metres.
    pub splash_height_m: f64,
    /// How long it stands, seconds.
    pub splash_life_s: f64,
    /// Angle to the water below which a round bounces, degrees.
    pub ricochet_below_deg: f64,
    /// Area of the holes that a round makes, where it goes in and where it goes out, cm^2.
    pub hole_cm2: f64,
    /// Heat of its barrel; `None` for one that stays cold.
    pub heat: Option<BarrelHeat>,
    /// Fuze and fragments; `None` for solid rounds.
    pub burst: Option<BurstSpec>,
}

impl Default for WeaponSpec {
    /// Numbers where a scenario gives none: those of the first scenarios.
    fn default() -> Self {
        Self {
            kind: None,
            rounds_per_minute: 500.0,
            belt: 100,
            spare_belts: 0,
            reload_s: 8.0,
            stoppage_every: None,
            projectile: Projectile::HEAVY,
            dispersion_mrad: 0.6,
            tracer_every: Some(5),
            tracer_burnout_m: 1800.0,
            splash_height_m: 1.8,
            splash_life_s: 1.6,
            ricochet_below_deg: 0.0,
            hole_cm2: 10.0,
            heat: None,
            burst: None,
        }
    }
}

impl WeaponSpec {
    /// Whether round `shot` (counted from 1) is a tracer.
    pub fn is_tracer(&self, shot: u64) -> bool {
        self.tracer_every.is_some_and(|every| shot.is_multiple_of(u64::from(every)))
    }
}

/// A boat.
#[derive(Clone, Debug, PartialEq)]
pub struct BoatSpec {
    /// Its name, different from all others.
    pub name: String,
    /// Its looks: the name of a model or a path to a file, for the caller to resolve.
    pub model: String,
    /// Whom it belongs to.
    pub side: Side,
    /// Its behaviour.
    pub behaviour: Behaviour,
    /// The lights that it shows between sunset and sunrise.
    pub lights: LightsKept,
    /// When it is on fire by itself, seconds after the beginning; `None` for one that only rounds set on fire.
    pub burns_at_s: Option<f64>,
    /// It waits until an instructor has it join.
    pub in_reserve: bool,
    /// Where the text places it.
    pub(super) stands: TomlPlace,
}

impl BoatSpec {
    /// An error where the text places the boat.
    pub fn error(&self, problem: impl Display) -> TomlError {
        self.stands.error(problem)
    }
}

impl Scenario {
    /// The waves of its sea.
    pub fn wave_field(&self) -> WaveField {
        WaveField::new(&self.waves, self.seed)
    }

    /// Whether every boat stays clear of the camera on its whole course. `radii_m` holds for each boat, in order, the radius
    /// about its origin that holds its model; boats without one are not checked.
    pub fn check_clearance(&self, radii_m: &[f64]) -> Result<(), TomlError> {
        let until_s = self.duration_s.unwrap_or(ENDLESS_S);
        for (boat, &radius_m) in self.boats.iter().zip(radii_m) {
            let clear_m = radius_m + CAMERA_CLEAR_M;
            let Some(time_s) = boat.behaviour.first_within(clear_m, until_s) else { continue };
            let when =
                if time_s > 0.0 { format!("after {time_s:.0} s") } else { "from the start".to_owned() };
            let problem = format!(
                "{} comes within {clear_m:.1} m of the camera {when}: its model {} reaches {radius_m:.1} m; \
                 start it farther off or change its course",
                boat.name, boat.model
            );
            return Err(boat.error(problem));
        }
        Ok(())
    }
}

/// World x and y of what lies `range_m` away at `bearing`, radians clockwise from north.
pub fn place(bearing: f64, range_m: f64) -> DVec2 {
    DVec2::new(bearing.sin(), bearing.cos()) * range_m
}
