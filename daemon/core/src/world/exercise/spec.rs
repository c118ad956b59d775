//! An exercise as a scenario asks for it.

pub use crate::engagement::Engagement;
use crate::{act::Act, side::Side, world::flare::FlareSpec};

/// The exercise around boats and rounds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ExerciseSpec {
    /// Text that the trainee reads beforehand.
    pub briefing: Option<String>,
    /// Rules of engagement as it begins; `None` where the scenario gives none: then they are free, and nothing shows them.
    pub rules: Option<Engagement>,
    /// Range within which a hostile boat may be fired at under any rules, metres; 0 for none.
    pub self_defence_m: f64,
    /// What is to be reached.
    pub goals: Goals,
    /// Calls that are to be made.
    pub calls: Vec<CallSpec>,
    /// What is to happen.
    pub happenings: Vec<Happening>,
}

/// What is to be reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Goals {
    /// Range that hostile boats are to be kept beyond, metres.
    pub keep_off_m: f64,
    /// Hostile boats that are to be stopped or turned away; `None` for all.
    pub stop: Option<u32>,
    /// Scores of the simulated novice and expert on average, where they were measured.
    pub par: Option<[f64; 2]>,
}

impl ExerciseSpec {
    /// Tests whether flares are lit in it.
    pub fn has_flares(&self) -> bool {
        let effects = self.happenings.iter().flat_map(|happening| &happening.effects);
        effects.into_iter().any(|effect| matches!(effect, HappeningEffect::Flare(_)))
    }
}

impl Goals {
    /// Range where a scenario gives none: that of hand weapons, metres.
    pub const KEEP_OFF_M: f64 = 100.0;
}

impl Default for Goals {
    fn default() -> Self {
        Self { keep_off_m: Self::KEEP_OFF_M, stop: None, par: None }
    }
}

/// The name of the group that a boat of that name is one of, as `skiff` of `skiff-3`; its own where it is of none.
pub fn group_of(boat: &str) -> &str {
    match boat.rsplit_once('-') {
        Some((group, number)) if !number.is_empty() && number.bytes().all(|b| b.is_ascii_digit()) => group,
        _ => boat,
    }
}

/// Tests whether a name is that of a boat, or of the group that it is one of.
pub fn is_called(boat: &str, name: &str) -> bool {
    boat == name || group_of(boat) == name
}

/// Boats that something is about.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum About {
    /// Each boat of a side.
    Side(Side),
    /// The boat of that name, or all boats of the group of that name.
    Name(String),
}

impl About {
    /// Tests whether it is about a boat of that name and side.
    pub fn covers(&self, boat: &str, side: Side) -> bool {
        match self {
            Self::Side(about) => *about == side,
            Self::Name(name) => is_called(boat, name),
        }
    }
}

/// A call that is to be made of each boat that it is about, once it can be seen.
#[derive(Clone, Debug, PartialEq)]
pub struct CallSpec {
    /// What is to be called.
    pub call: Act,
    /// The boats.
    pub about: About,
    /// Before such a boat is nearer than that, metres.
    pub before_m: Option<f64>,
    /// Within so many seconds after it came in view.
    pub within_s: Option<f64>,
}

/// Something that is to happen once.
#[derive(Clone, Debug, PartialEq)]
pub struct Happening {
    /// When.
    pub cause: HappeningCause,
    /// What.
    pub effects: Vec<HappeningEffect>,
}

/// When something is to happen.
#[derive(Clone, Debug, PartialEq)]
pub enum HappeningCause {
    /// So many seconds after the beginning.
    At(f64),
    /// Once one of the boats is within that range, metres.
    Within(About, f64),
    /// Once one of the boats was struck.
    Struck(About),
}

/// What is to happen.
#[derive(Clone, Debug, PartialEq)]
pub enum HappeningEffect {
    /// Other rules of engagement.
    Rules(Engagement),
    /// The virtual weapon has a stoppage with its next round.
    Stoppage,
    /// Text for the trainee.
    Message(String),
    /// An illuminating flare is lit.
    Flare(FlareSpec),
}
