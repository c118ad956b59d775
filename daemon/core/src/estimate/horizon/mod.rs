//! The sea's horizon in a picture: which way is up, as the camera sees it.
//!
//! Steps of brightness down columns eight pixels wide (`edges`) vote for lines (Hough 1962), each by how quiet the rows above
//! it are: sky is. The six lines with most votes are fitted in shrinking windows with Tukey's weights (`fit`), on rays that
//! the lens's distortion is taken off (`rays`), to the direction of up, dip included. Each column tells what it shows at a line
//! (`columns`): its edge under sky, its edge under land, or sky that ends elsewhere. A line is weighed by the first and by what
//! speaks against it (`judge`); the best is fitted anew to its free columns, and is the horizon, or there is none, with the
//! reason.
//!
//! What it cannot tell: a far shore that is low, straight and smooth, or lies in haze, from the sea; a straight line of cloud
//! low in the sky over water that cannot be told from it. Where land is seen behind part of the line, the covariance holds what
//! a nearer shore would lower it by. Refraction moves the true horizon by up to a tenth of a degree, which no picture shows.

mod answer;
mod cells;
mod columns;
mod edges;
mod finder;
mod fit;
mod haze;
mod judge;
mod mask;
mod rays;
mod steps;

pub use answer::{Horizon, HorizonView, LineQuality, NoHorizon, Prior};
pub use finder::HorizonFinder;
pub use haze::lowered_by_haze;

#[cfg(test)]
mod tests;
