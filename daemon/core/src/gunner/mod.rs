//! A simulated gunner: plays a scenario without pictures, for par scores and tests.
//!
//! It sees what geometry, size, light and haze let a person see ([`eye`](self)), decides by the rules of engagement, and moves the gun as people do:
//! late, not quite on the target, and better with each burst whose fall it has seen. All numbers of a person are in [`Skill`]. It is given
//! the same trigger, acts and weapon as a trainee.

mod eye;
mod hand;
mod head;
mod play;
mod skill;

pub use play::{Gunner, GunnerMove, Played, play};
pub use skill::Skill;
