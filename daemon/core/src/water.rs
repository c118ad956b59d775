//! How the sea mirrors boats: what a scenario asks for.

use crate::sea::BeaufortForce;

/// How a boat's light is put onto the sea.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ReflectionMethod {
    /// No reflection.
    Off,
    /// The plain mirror picture.
    Mirror,
    /// Nelson 2009, Full Reflection shader, eq. 4-6, singular cases as published.
    FullAsPublished,
    /// The same, singular cases mended and distances tied to the boat's size on the screen.
    Full,
    /// Nelson 2009, Physics shader, eq. 9-16 and table 1, as published.
    PhysicsAsPublished,
    /// The same with the normal from the slope, waves of the wind force's spectrum, and phases that hold at any distance.
    Physics,
    /// Light thrown back by waves of that wind, from the table of [`crate::frame::reflection`].
    Baked,
}

impl ReflectionMethod {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::Off,
        Self::Mirror,
        Self::Full,
        Self::FullAsPublished,
        Self::Physics,
        Self::PhysicsAsPublished,
        Self::Baked,
    ];

    /// The name used in scenarios, on the command line and in tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Mirror => "mirror",
            Self::FullAsPublished => "full_as_published",
            Self::Full => "full",
            Self::Physics => "physics",
            Self::PhysicsAsPublished => "physics_as_published",
            Self::Baked => "baked",
        }
    }

    /// The method of that name or former name; hyphens stand for underscores, and "none" for "off".
    pub fn of_name(name: &str) -> Option<Self> {
        let name = if name == "none" { "off".to_owned() } else { name.replace('-', "_") };
        let current = Self::ALL.into_iter().find(|method| method.name() == name);
        current.or_else(|| Self::FORMER_NAMES.iter().find(|(old, _)| *old == name).map(|(_, method)| *method))
    }

    /// All names that are read, former ones last.
    pub fn names() -> impl Iterator<Item = &'static str> {
        let former = Self::FORMER_NAMES.into_iter().map(|(name, _)| name);
        Self::ALL.into_iter().map(Self::name).chain(former)
    }

    /// Former names, which are read for one version.
    const FORMER_NAMES: [(&str, Self); 3] = [
        ("waves", Self::Baked),
        ("full_as_printed", Self::FullAsPublished),
        ("physics_as_printed", Self::PhysicsAsPublished),
    ];

    /// The warning about a former name: names the new one. `None` for a name of today.
    pub fn warning(name: &str) -> Option<String> {
        let name = name.replace('-', "_");
        let (_, method) = Self::FORMER_NAMES.iter().find(|(old, _)| *old == name)?;
        let new = method.name();
        Some(format!(
            "\"{name}\" is now called \"{new}\"; the former name will not be read any longer in the next version"
        ))
    }
}

/// Nelson 2009, eq. 7-8: how a boat darkens the sea at its foot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ShadowLevel {
    /// Level 0: none.
    None,
    /// Level 1: gradual.
    Gradual,
    /// Level 2: strong and short.
    Strong,
}

/// How the sea mirrors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Water {
    /// The method.
    pub method: ReflectionMethod,
    /// Wind force: which of the five parameterisations.
    pub force: BeaufortForce,
    /// How strong the shadow is.
    pub shadow: ShadowLevel,
}
