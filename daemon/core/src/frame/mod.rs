//! Stage three: what one frame shows, and why the rest is left out.

pub mod plan;
pub mod reflection;
pub mod scene;
pub mod view;
pub mod wake;
