//! A crew as data: states, what is done in each, and when the next begins.

use glam::DVec2;

/// What a crew does, and when it does something else.
#[derive(Clone, Debug, PartialEq)]
pub struct CrewPlan {
    /// The first is the one that it begins in.
    pub states: Vec<CrewState>,
}

/// One state of a crew.
#[derive(Clone, Debug, PartialEq)]
pub struct CrewState {
    /// Its name in the scenario.
    pub name: String,
    /// What is done.
    pub act: Act,
    /// Speed that is kept in it, m/s.
    pub speed_m_s: f64,
    /// Ways out, the first that holds is taken.
    pub exits: Vec<Exit>,
}

/// What a crew does in a state. Ranges are from the own ship's gun.
#[derive(Clone, Debug, PartialEq)]
pub enum Act {
    /// Goes from point to point (world, metres), to the last or round for ever.
    Transit {
        /// Points, in order.
        points: Vec<DVec2>,
        /// Back to the first after the last.
        repeat: bool,
    },
    /// Stays about where it was as the state began.
    Loiter {
        /// Metres about that place.
        radius_m: f64,
    },
    /// Goes a little this way, a little that way, and lies still in between.
    Fish,
    /// Lies at anchor.
    Anchor,
    /// Goes towards the gun and lies still at a range.
    Approach {
        /// Metres.
        stop_m: f64,
    },
    /// Goes towards the gun, turns away at a range, and has arrived once it has opened to twice that.
    Probe {
        /// Metres.
        turn_m: f64,
    },
    /// Goes for the gun.
    Attack {
        /// Range to which it goes, metres; `None` rams.
        stop_m: Option<f64>,
    },
    /// Goes round the gun.
    Circle {
        /// Metres.
        radius_m: f64,
        /// Seen from above.
        clockwise: bool,
    },
    /// Goes away from the gun.
    Flee,
    /// Stops and lies still.
    Stop,
    /// Stops and gives up.
    Surrender,
    /// Takes its engine out of gear and goes where that leaves it.
    Drift,
    /// Does what a person orders.
    Driven,
}

/// A way out of a state.
#[derive(Clone, Debug, PartialEq)]
pub struct Exit {
    /// All of it has to hold.
    pub guard: Guard,
    /// With which probability it is taken, once it holds.
    pub chance: f64,
    /// Index of the next state.
    pub to: usize,
}

/// Conditions; those that are not named do not matter.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Guard {
    /// Seconds in the state, at least.
    pub after_s: Option<f64>,
    /// Range from the gun, metres, at most.
    pub within_m: Option<f64>,
    /// Range from the gun, metres, at least.
    pub beyond_m: Option<f64>,
    /// What the state does is done.
    pub arrived: bool,
    /// The boat was warned.
    pub warned: bool,
    /// The boat was struck.
    pub hit: bool,
    /// A boat of its side within 300 m was struck.
    pub neighbour_hit: bool,
    /// A searchlight is on it.
    pub lit: bool,
    /// It sees the ship that the gun stands on, or her searchlight.
    pub sees_gun: bool,
}
