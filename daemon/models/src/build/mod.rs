//! The boats that the project builds itself: parametric surfaces, written as binary glTF and loaded like any other file.

mod assembly;
mod dhow;
mod figure;
mod frigate;
mod frigate_top;
mod glb;
mod loft;
mod outboard;
pub(crate) mod paint;
mod rhib;
mod skiff;
mod solid;

pub use glb::parts_glb;

/// A boat that the project builds itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Boat {
    /// Open skiff of 7 m with an outboard engine and two people.
    Skiff,
    /// Rigid inflatable of 7.5 m with a console, a helmsman and one passenger.
    Rhib,
    /// Fishing dhow of 18 m.
    Dhow,
    /// Frigate of 130 m.
    Frigate,
}

impl Boat {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Skiff, Self::Rhib, Self::Dhow, Self::Frigate];

    /// The name that scenarios use.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Skiff => "skiff",
            Self::Rhib => "rhib",
            Self::Dhow => "dhow",
            Self::Frigate => "frigate",
        }
    }
}

/// A GLB file of `boat`: metres, y up, +z forward as glTF has it, waterline at y = 0, one node for each of the parts
/// `hull`, `engine` and `helm`. The same bytes every time.
pub fn build_glb(boat: Boat) -> Vec<u8> {
    let assembly = match boat {
        Boat::Skiff => skiff::build(),
        Boat::Rhib => rhib::build(),
        Boat::Dhow => dhow::build(),
        Boat::Frigate => frigate::build(),
    };
    glb::write(boat.name(), &assembly)
}
