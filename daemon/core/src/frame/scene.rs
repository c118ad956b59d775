//! The scene of one frame: the session's output, the renderer's only input besides the picture.

use std::sync::Arc;

use glam::{DVec2, DVec3, Vec3};

use crate::{
    estimate::light::{Light, SeenNoise},
    estimate::{
        light::{SeaTones, SkyLight},
        sea::SeaSource,
    },
    fault::Fault,
    frame::{
        lamplight::Lamplight,
        lamps::{FlashView, LampView},
        searchlight::SearchlightView,
        wake::Wake,
    },
    geometry::{CameraPose, Lens, RigidPose},
    guide::Guide,
    model::{ModelId, Zone},
    sea::WmoSeaState,
    water::Water,
    world::{exercise::Engagement, weapon::WeaponState},
};

/// One frame.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Counts from 0 within a session.
    pub frame: u64,
    /// Time for which boats and water stand as they are drawn, seconds since the session began.
    pub time_s: f64,
    /// Camera pose at the drawn picture's mid-exposure.
    pub camera: CameraPose,
    /// The lens as seen on the screen: [`Lens::covering`] the screen's size.
    pub lens: Lens,
    /// The decision for each pass of this frame, one for each of [`Pass::ALL`], in that order.
    pub passes: [PassDecision; Pass::COUNT],
    /// Boats whose hull or reflection can be seen, farthest first.
    pub boats: Vec<BoatView>,
    /// Tracers and splashes in view, farthest first.
    pub rounds: Vec<RoundView>,
    /// Points of light that can be seen: boats' navigation lights, fires and flares.
    pub lights: Vec<LightView>,
    /// Lamps that light what is around them by night.
    pub lamps: Vec<LampView>,
    /// The flash before the muzzle, while a round leaves it by night.
    pub flash: Option<FlashView>,
    /// The gun's searchlight, while it is on.
    pub searchlight: Option<SearchlightView>,
    /// Recoil factor of the gun: distance from the bore's vanishing point over that at rest, from 1.
    pub recoil: f64,
    /// Light on the boats.
    pub light: Light,
    /// How the sea mirrors.
    pub water: Water,
    /// Velocity of the wind 10 m above the sea, world x and y, m/s.
    pub wind: DVec2,
    /// The sky that boats hide from the sea.
    pub sky: SkyLight,
    /// How bright the sea is in the picture.
    pub tones: SeaTones,
    /// The camera's noise, where it is seen on boats.
    pub noise: Option<SeenNoise>,
    /// The head-up display.
    pub hud: Hud,
    /// The page that it shows instead of counts and state, while a maintainer calibrates.
    pub guide: Option<Arc<Guide>>,
}

impl Scene {
    /// Whether `pass` runs in this frame.
    pub fn runs(&self, pass: Pass) -> bool {
        self.passes[pass as usize] == PassDecision::Run
    }

    /// The lamps that light sea and air.
    pub fn lamplight(&self) -> Lamplight<'_> {
        let searchlight = self.searchlight.as_ref();
        Lamplight { searchlight, lamps: &self.lamps, wind_m_s: self.wind.length() }
    }
}

/// The passes in the order in which they run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Pass {
    /// The camera's picture.
    Video,
    /// Boats as the sun sees them: what it does not see lies in the shade.
    Shadow,
    /// Boats mirrored in the sea, to a layer of its own.
    Mirror,
    /// The mirrored layer distorted and blended onto the sea; shadows on the water.
    Water,
    /// Waves and foam of boats under way.
    Wake,
    /// The boats.
    Boats,
    /// The camera's noise on them.
    Noise,
    /// The light of searchlight, flares and fires on sea and air.
    Lamplight,
    /// Points of light: boats' navigation lights, fires, flares.
    Lights,
    /// Tracers and splashes.
    Rounds,
    /// The own gun and ship in the picture, before all of these.
    Phantoms,
    /// Text and state.
    Hud,
}

impl Pass {
    /// How many there are.
    pub const COUNT: usize = 12;
    /// All of them, in order.
    pub const ALL: [Self; Self::COUNT] = [
        Self::Video,
        Self::Shadow,
        Self::Mirror,
        Self::Water,
        Self::Wake,
        Self::Boats,
        Self::Noise,
        Self::Lamplight,
        Self::Lights,
        Self::Rounds,
        Self::Phantoms,
        Self::Hud,
    ];

    /// The name used in summaries.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Video => "video",
            Self::Shadow => "shadow",
            Self::Mirror => "mirror",
            Self::Water => "water",
            Self::Wake => "wake",
            Self::Boats => "boats",
            Self::Noise => "noise",
            Self::Lamplight => "lamplight",
            Self::Lights => "lights",
            Self::Rounds => "rounds",
            Self::Phantoms => "phantoms",
            Self::Hud => "hud",
        }
    }
}

/// Whether a pass runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PassDecision {
    /// It runs.
    Run,
    /// It does not, at no cost.
    LeftOut(LeftOut),
}

/// Why a pass is left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum LeftOut {
    /// The scenario has no boats.
    NoBoats,
    /// No boat is within the picture.
    NoBoatInView,
    /// No reflection or shadow of a boat falls within the picture.
    NoReflectionInView,
    /// Above Beaufort 4 no reflection is seen.
    SeaTooRough,
    /// The reflection is switched off.
    ReflectionOff,
    /// Neither reflection nor shadow is wanted.
    NoReflectionNoShadow,
    /// No boat of the scenario ever moves.
    NoBoatMoves,
    /// No wake of a boat is within the picture.
    NoWakeInView,
    /// No tracer or splash is within the picture.
    NoRoundInView,
    /// The weapon has no rounds.
    NoRounds,
    /// No boat of the scenario shows lights, or can be set on fire.
    NoLights,
    /// The sun is up, and stays where it is.
    Daylight,
    /// No light is within the picture, or the sun is up.
    NoLightInView,
    /// The scenario has no searchlight and no flare, and no boat can be set on fire.
    NoLamps,
    /// No lamp shines.
    NoLampShines,
    /// The sun does not shine: it is down, or clouds hide it.
    NoSun,
    /// The camera has no noise that is seen on boats.
    NoiseUnseen,
    /// The calibration has no outline of the own gun or ship.
    NoPhantoms,
    /// Nothing is drawn that they could hide.
    NothingToHide,
    /// No usable orientation: boats cannot be placed.
    NoPose,
    /// A composed picture tells nobody anything.
    NoTrainee,
}

impl LeftOut {
    /// The name used in summaries.
    pub const fn name(self) -> &'static str {
        match self {
            Self::NoBoats => "no_boats",
            Self::NoBoatInView => "no_boat_in_view",
            Self::NoReflectionInView => "no_reflection_in_view",
            Self::SeaTooRough => "sea_above_beaufort_4",
            Self::ReflectionOff => "reflection_off",
            Self::NoReflectionNoShadow => "no_reflection_no_shadow",
            Self::NoBoatMoves => "no_boat_moves",
            Self::NoWakeInView => "no_wake_in_view",
            Self::NoRoundInView => "no_round_in_view",
            Self::NoRounds => "no_rounds",
            Self::NoLights => "no_lights",
            Self::Daylight => "daylight",
            Self::NoLightInView => "no_light_in_view",
            Self::NoLamps => "no_lamps",
            Self::NoLampShines => "no_lamp_shines",
            Self::NoSun => "no_sun",
            Self::NoiseUnseen => "noise_unseen",
            Self::NoPhantoms => "no_phantoms",
            Self::NothingToHide => "nothing_to_hide",
            Self::NoPose => "no_pose",
            Self::NoTrainee => "no_trainee",
        }
    }
}

/// A rectangle of whole pixels on the screen; never empty, always inside the screen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelRect {
    /// Left edge.
    pub x: u32,
    /// Upper edge.
    pub y: u32,
    /// At least 1.
    pub width: u32,
    /// At least 1.
    pub height: u32,
}

/// A boat to draw.
#[derive(Clone, Debug)]
pub struct BoatView {
    /// Index of the boat in the scenario.
    pub boat: usize,
    /// Its model.
    pub model: ModelId,
    /// Its pose at the picture's time; curvature of the sea already taken off its height.
    pub pose: RigidPose,
    /// Height of the water at whose line the hull is seen to end, same space as `pose`: hull below it is hidden, the mirror plane lies
    /// in it.
    pub water_level: f64,
    /// How far that is above the boat's own water, metres: waves before it hide so much of its hull.
    pub hidden_m: f64,
    /// Pixels that the hull can cover (two pixels of margin included); `None` where only the reflection is in view.
    pub hull: Option<PixelRect>,
    /// Pixels that its reflection or shadow can reach, distortion and blur included; `None` where neither is drawn.
    pub reflection: Option<PixelRect>,
    /// Its wake, curvature of the sea taken off; `None` where it lies still or nothing of it is in view.
    pub wake: Option<Wake>,
    /// Distance from the camera, metres.
    pub range_m: f64,
    /// Share of its light that haze replaces by the horizon's, 0 to 1.
    pub haze: f32,
    /// Beyond the sea horizon: hide what lies below the line of sight over it.
    pub beyond_horizon: bool,
}

/// A point of light: a navigation light, a fire, a flare.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightView {
    /// Index of its boat in the scenario; `None` of what is on none.
    pub boat: Option<usize>,
    /// Its place, world, curvature of the sea already taken off its height.
    pub at: DVec3,
    /// Its illuminance at the camera over the luminance that the camera shows as white, by colour, sr: what it adds to all pixels together
    /// times the solid angle of one.
    pub light: Vec3,
}

/// What rounds do: a tracer, a splash, fire and smoke.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RoundView {
    /// The streak of a round in flight over the picture's exposure.
    Tracer {
        /// Where the streak begins, world.
        from: DVec3,
        /// Where it ends, world.
        to: DVec3,
        /// Linear radiance relative to paper white at the video's exposure.
        radiance: Vec3,
    },
    /// A column of water where a round struck the sea.
    Splash {
        /// Foot of the column, world.
        at: DVec3,
        /// Height now, metres.
        height_m: f32,
        /// Radius now, metres.
        radius_m: f32,
        /// 1 fresh, 0 gone.
        opacity: f32,
    },
    /// A puff of smoke from a boat that burns.
    Smoke {
        /// Its middle, world.
        at: DVec3,
        /// Its radius, metres: that at which its optical depth is 1/e of that through its middle.
        radius_m: f32,
        /// Optical depth through its middle.
        depth: f32,
        /// What it throws back of the fire's light, linear radiance.
        glow: Vec3,
        /// Share of its light that haze replaces by the horizon's, 0 to 1.
        haze: f32,
        /// Tells its shape from others'.
        seed: f32,
    },
    /// A flame.
    Flame {
        /// Its middle, world.
        at: DVec3,
        /// Its radius, metres.
        radius_m: f32,
        /// Linear radiance of its middle.
        light: Vec3,
        /// Tells its shape from others'.
        seed: f32,
    },
    /// Sparks where a round struck a boat.
    Strike {
        /// The place, world.
        at: DVec3,
        /// Radius now, metres.
        radius_m: f32,
        /// 1 fresh, 0 gone.
        opacity: f32,
    },
}

impl RoundView {
    /// Where it is now, world.
    pub const fn place(&self) -> DVec3 {
        match *self {
            Self::Tracer { to, .. } => to,
            Self::Splash { at, .. }
            | Self::Strike { at, .. }
            | Self::Smoke { at, .. }
            | Self::Flame { at, .. } => at,
        }
    }
}

/// The state that the sailor is told.
#[derive(Clone, Debug, PartialEq)]
pub enum Status {
    /// Ready to train.
    Ready,
    /// The last round struck a hostile boat.
    Hit {
        /// Where.
        zone: Zone,
    },
    /// The last round struck a neutral boat.
    NeutralHit {
        /// Where.
        zone: Zone,
    },
    /// The last round missed.
    Miss,
    /// Ready, but nothing in the picture has confirmed for some time that boats are drawn where they belong.
    NotChecked {
        /// For how long, upper case.
        cause: &'static str,
    },
    /// An instructor has the exercise stand still: nothing is fired.
    Paused,
    /// Rounds fired now are not scored.
    NotScored {
        /// Short cause, upper case.
        cause: &'static str,
        /// One thing to do.
        action: &'static str,
    },
    /// Something is broken.
    Fault {
        /// Short cause, upper case.
        cause: &'static str,
        /// One thing to do.
        action: &'static str,
    },
}

/// The words of a state, upper case; empty where there are none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StatusWords {
    /// The state.
    pub word: &'static str,
    /// The cause, or the part that was struck.
    pub cause: &'static str,
    /// The one thing to do.
    pub action: &'static str,
}

impl Status {
    /// Its words on the LCD and wherever else it is shown.
    pub const fn words(&self) -> StatusWords {
        const fn words(word: &'static str, cause: &'static str, action: &'static str) -> StatusWords {
            StatusWords { word, cause, action }
        }
        match *self {
            Self::Ready => words("READY", "", ""),
            Self::Hit { zone } => words("HIT", zone_word(zone), ""),
            Self::NeutralHit { zone } => words("NEUTRAL HIT", zone_word(zone), "HOLD FIRE"),
            Self::Miss => words("MISS", "", ""),
            Self::NotChecked { cause } => words("NOT CHECKED", cause, "LOOK AT THE HORIZON"),
            Self::Paused => words("PAUSED", "", "WAIT FOR THE INSTRUCTOR"),
            Self::NotScored { cause, action } => words("NOT SCORED", cause, action),
            Self::Fault { cause, action } => words("FAULT", cause, action),
        }
    }
}

const fn zone_word(zone: Zone) -> &'static str {
    match zone {
        Zone::Hull => "HULL",
        Zone::Engine => "ENGINE",
        Zone::Helm => "HELM",
    }
}

/// The head-up display. The word TRAINING is always drawn and is no field.
#[derive(Clone, Debug, PartialEq)]
pub struct Hud {
    /// State with colour, shape and word.
    pub status: Status,
    /// The fault that the sailor should know of though training goes on: [`Severity::Warning`](crate::fault::Severity).
    pub warning: Option<Fault>,
    /// Rounds left in the belt.
    pub rounds_left: u32,
    /// Rounds fired.
    pub shots: u32,
    /// Rounds that struck a hostile boat.
    pub hits: u32,
    /// Rounds that struck a neutral one.
    pub neutral_hits: u32,
    /// Seconds since the scenario began.
    pub clock_s: f64,
    /// The sea that is drawn, where it is measured in the video.
    pub sea: Option<(WmoSeaState, SeaSource)>,
    /// Standard deviation of the heading in tenths of a degree, where the sailor is to know it.
    pub heading_tenths_deg: Option<u16>,
    /// Rules of engagement, where the scenario gives any.
    pub rules: Option<Engagement>,
    /// State of the virtual weapon.
    pub weapon: WeaponState,
    /// Text of the scenario, printable ASCII.
    pub message: Option<Arc<str>>,
}

impl Hud {
    /// Nothing has happened yet, and there is nothing to fire.
    pub const READY: Self = Self {
        status: Status::Ready,
        warning: None,
        rounds_left: 0,
        shots: 0,
        hits: 0,
        neutral_hits: 0,
        clock_s: 0.0,
        sea: None,
        heading_tenths_deg: None,
        rules: None,
        weapon: WeaponState::Ready,
        message: None,
    };
}
