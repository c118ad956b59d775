//! Settings of a session.

use std::sync::Arc;

use crate::{
    calibration::Calibration,
    estimate::{HeadingSettings, attitude::Source},
    event::{PictureError, PixelFormat},
    model::{Model, ModelId},
    own_ship::OwnShip,
    world::scenario::Scenario,
};

/// Settings of a session.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The scenario, its seed the one of all chance.
    pub scenario: Scenario,
    /// The calibration of the camera and inertial unit in use.
    pub calibration: Calibration,
    /// All models in use.
    pub models: Arc<[Model]>,
    /// The model of each of the scenario's boats, in order.
    pub boat_models: Vec<ModelId>,
    /// Screen size in pixels.
    pub screen: (u32, u32),
    /// How the camera's bytes are laid out.
    pub video: PixelFormat,
    /// Whose estimate of the orientation is used.
    pub orientation: Source,
    /// Settings of heading aiding.
    pub heading: HeadingSettings,
    /// The own gun and ship in the pictures.
    pub own_ship: OwnShip,
}

/// Why a session cannot be made.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SetupError {
    /// Not every boat has a model.
    #[error("the scenario has {boats} boats, but models for {models}: give each boat one")]
    Models {
        /// Boats in the scenario.
        boats: usize,
        /// Models given.
        models: usize,
    },
    /// No picture has the calibrated size in that layout.
    #[error("the calibrated size does not fit the camera's pictures: {0}")]
    Picture(#[from] PictureError),
}
