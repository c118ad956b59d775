//! The trainee's acts besides the trigger.

use serde::{Deserialize, Serialize};

use crate::{side::Side, time::Time};

/// Something that the trainee does, or says and an instructor marks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Act {
    /// The report button: what the gun points at is reported.
    Report,
    /// The call that what the gun points at is hostile or neutral.
    Identify(#[serde(with = "by_name")] Side),
    /// The call that warns what the gun points at.
    Warn,
    /// A fresh belt is put in.
    Reload,
    /// The immediate action that clears a stoppage.
    Clear,
    /// The weapon is made safe.
    Safe,
    /// It is made ready again.
    Ready,
    /// The searchlight on the gun is switched on, or off again.
    Light,
    /// The person who drives a boat gives it an order. That is no act of the trainee's, and comes the same way.
    Drive(DriveOrder),
}

/// An order of the person who drives a boat, as a telegraph and a wheel with notches give it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DriveOrder {
    /// A notch more ahead: a quarter of the throttle.
    Ahead,
    /// A notch more astern.
    Astern,
    /// A notch of the helm to port: a third of it.
    Port,
    /// A notch to starboard.
    Starboard,
    /// Helm amidships.
    Midships,
}

impl Act {
    /// All acts.
    pub const ALL: [Self; 14] = [
        Self::Report,
        Self::Identify(Side::Hostile),
        Self::Identify(Side::Neutral),
        Self::Warn,
        Self::Reload,
        Self::Clear,
        Self::Safe,
        Self::Ready,
        Self::Light,
        Self::Drive(DriveOrder::Ahead),
        Self::Drive(DriveOrder::Astern),
        Self::Drive(DriveOrder::Port),
        Self::Drive(DriveOrder::Starboard),
        Self::Drive(DriveOrder::Midships),
    ];

    /// The name in scenarios, configurations and tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Report => "report",
            Self::Identify(Side::Hostile) => "hostile",
            Self::Identify(Side::Neutral) => "neutral",
            Self::Warn => "warn",
            Self::Reload => "reload",
            Self::Clear => "clear",
            Self::Safe => "safe",
            Self::Ready => "ready",
            Self::Light => "light",
            Self::Drive(DriveOrder::Ahead) => "ahead",
            Self::Drive(DriveOrder::Astern) => "astern",
            Self::Drive(DriveOrder::Port) => "port",
            Self::Drive(DriveOrder::Starboard) => "starboard",
            Self::Drive(DriveOrder::Midships) => "midships",
        }
    }

    /// Acts that are words about a boat.
    pub fn calls() -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().filter(|act| act.is_about_a_boat())
    }

    /// Tests whether it is a word about the boat that the gun points at.
    pub const fn is_about_a_boat(self) -> bool {
        matches!(self, Self::Report | Self::Identify(_) | Self::Warn)
    }
}

/// An act with its time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TraineeAct {
    /// When.
    pub time: Time,
    /// What.
    pub act: Act,
}

/// A side by its name.
pub(crate) mod by_name {
    use serde::{Deserialize, Deserializer, Serializer, de::Error};

    use crate::side::Side;

    pub fn serialize<S: Serializer>(side: &Side, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(side.name())
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Side, D::Error> {
        let name = String::deserialize(from)?;
        let known = Side::ALL.into_iter().find(|side| side.name() == name);
        known.ok_or_else(|| D::Error::custom(format!("no side is called {name:?}")))
    }
}
