//! Rules of engagement.

use serde::{Deserialize, Serialize};

/// Rules of engagement. A round breaks them by when it was fired, whatever it strikes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Engagement {
    /// No round may be fired but in self-defence.
    Hold,
    /// Only boats that were warned may be fired at.
    Warn,
    /// Only boats that were called hostile may be fired at.
    Tight,
    /// All but neutral boats may be fired at.
    #[default]
    Free,
}

impl Engagement {
    /// All rules.
    pub const ALL: [Self; 4] = [Self::Hold, Self::Warn, Self::Tight, Self::Free];

    /// The name in scenarios and tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Hold => "hold",
            Self::Warn => "warn",
            Self::Tight => "tight",
            Self::Free => "free",
        }
    }
}
