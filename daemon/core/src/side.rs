//! Sides.

/// Whom a boat belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Side {
    /// It attacks.
    Hostile,
    /// It is not to be fired at.
    Neutral,
}

impl Side {
    /// All sides.
    pub const ALL: [Self; 2] = [Self::Hostile, Self::Neutral];

    /// The name used in scenarios, databases and tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Hostile => "hostile",
            Self::Neutral => "neutral",
        }
    }
}
