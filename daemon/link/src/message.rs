//! The messages.

use bowwave_core::{act::Act, engagement::Engagement, order::Order};
use serde::{Deserialize, Serialize};

/// Version of the protocol. Peers of another version refuse each other.
pub const VERSION: u32 = 1;

/// The first message of each side.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Hello {
    /// Version of the protocol.
    pub version: u32,
    /// Version of the program.
    pub program: String,
}

impl Hello {
    /// Of a program of that version.
    pub fn new(program: &str) -> Self {
        Self { version: VERSION, program: program.to_owned() }
    }
}

/// A message to the trainer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum ToDaemon {
    /// Greets.
    Hello {
        /// Versions.
        hello: Hello,
    },
    /// Asks for the next picture that is shown.
    Picture,
    /// Orders something of the running exercise.
    Order {
        /// The order.
        order: Order,
    },
    /// Marks an act of the trainee's, as a call that was spoken.
    Act {
        /// The act.
        act: Act,
    },
    /// Begins a scenario as a run of its own. The exercise stands still until [`Order::Resume`].
    Load {
        /// Where the text is from, for messages.
        origin: String,
        /// The scenario's text. Its boats are built-in ones, or models in the folder of the configured scenario.
        scenario: String,
    },
    /// Ends the exercise: the live picture without boats.
    StandBy,
}

/// A message from the trainer.
#[derive(Clone, Debug, PartialEq)]
pub enum FromDaemon {
    /// Greets.
    Hello(Hello),
    /// How things are, a few times a second.
    Status(Box<Status>),
    /// What was asked for is refused: why, and what to do.
    Refused(String),
    /// The newest picture that was shown, for each one that was asked for.
    Picture(Picture),
}

/// The trainer at one time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Status {
    /// Counts the statuses of a connection: one that does not rise is old.
    pub number: u64,
    /// `CLOCK_MONOTONIC`, nanoseconds.
    pub time_ns: i64,
    /// Name of the scenario.
    pub scenario: String,
    /// Counts scenarios that were begun since the program began: another number is another run in the journal.
    pub session: u64,
    /// Path of the journal; `None` where none is kept.
    pub journal: Option<String>,
    /// [`ToDaemon::Load`] and [`ToDaemon::StandBy`] can be done.
    pub can_load: bool,
    /// It was asked to end the exercise, and shows the live picture alone.
    pub stands_by: bool,
    /// Seconds of the exercise; 0 before it begins.
    pub clock_s: f64,
    /// Seconds that the scenario says it lasts.
    pub duration_s: Option<f64>,
    /// The exercise stands still.
    pub is_paused: bool,
    /// The word that stands on the LCD, as READY.
    pub word: String,
    /// What it is about.
    pub cause: String,
    /// The one thing to do.
    pub action: String,
    /// How good that is.
    pub level: StatusLevel,
    /// Rules of engagement, where the scenario has any or an order gave them.
    pub rules: Option<Engagement>,
    /// State of the weapon: ready, safe, stoppage, reloading or empty.
    pub weapon: String,
    /// Rounds left in the belt.
    pub rounds_left: u32,
    /// Rounds fired.
    pub shots: u64,
    /// Rounds that struck a hostile boat.
    pub hits: u64,
    /// Rounds that struck a neutral one.
    pub neutral_hits: u64,
    /// Text that stands on the LCD.
    pub message: Option<String>,
    /// All devices.
    pub devices: Vec<DeviceState>,
    /// All boats, by their numbers in the scenario.
    pub boats: Vec<BoatState>,
    /// The gun, while it is known where it points.
    pub gun: Option<GunState>,
}

/// How good the state on the LCD is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StatusLevel {
    /// Trains and scores.
    Good,
    /// Trains, with something to look at.
    #[default]
    Attention,
    /// Does not score, or does not train.
    Bad,
}

/// A device, or a part of the computer that matters as one.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DeviceState {
    /// Its name, as "camera".
    pub name: String,
    /// How it fares.
    pub level: DeviceLevel,
    /// Code of its most severe fault; empty where there is none.
    pub code: String,
    /// Cause as on the LCD, or a word such as "works".
    pub cause: String,
    /// The one thing to do; empty where there is nothing to do.
    pub action: String,
}

/// How a device fares.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DeviceLevel {
    /// Nothing is known to be wrong.
    Works,
    /// Something is wrong, and training goes on.
    Warning,
    /// Rounds are not scored, or nothing is armed.
    Fault,
    /// The configuration names none.
    Absent,
}

/// A boat at one time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BoatState {
    /// Its name in the scenario.
    pub name: String,
    /// hostile or neutral.
    pub side: String,
    /// Place from the gun, east, metres.
    pub east_m: f64,
    /// Place from the gun, north, metres.
    pub north_m: f64,
    /// Clockwise from north, degrees.
    pub heading_deg: f64,
    /// Over ground, m/s.
    pub speed_m_s: f64,
    /// It is on the water: it has joined and has not sunk.
    pub swims: bool,
    /// It waits in reserve until an order has it join.
    pub in_reserve: bool,
    /// It was struck.
    pub is_struck: bool,
    /// The state that its crew is in.
    pub crew: Option<String>,
    /// Length at the waterline, metres.
    pub length_m: f64,
}

/// Where the gun points.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GunState {
    /// Clockwise from true north, degrees.
    pub bearing_deg: f64,
    /// Above the horizontal, degrees.
    pub elevation_deg: f64,
    /// Horizontal field of view, degrees.
    pub view_deg: f64,
}

/// A frame as it was shown.
#[derive(Clone, PartialEq, Eq)]
pub struct Picture {
    /// Its number.
    pub frame: u64,
    /// When its pixels were complete, `CLOCK_MONOTONIC`, nanoseconds.
    pub complete_ns: i64,
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Red, green, blue, unused; sRGB; rows from the top.
    pub rgba: Vec<u8>,
}

impl std::fmt::Debug for Picture {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Picture({} {}x{})", self.frame, self.width, self.height)
    }
}
