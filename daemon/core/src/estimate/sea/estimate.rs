//! The sea as the picture shows it, or why it does not.

use glam::DVec2;

use crate::{
    geometry::{CameraPose, Lens},
    sea::{BeaufortForce, WmoSeaState},
    time::Time,
};

/// Seconds of picture before the first estimate.
pub const LEAST_S: f64 = 40.0;

/// One picture as the estimator sees it.
pub struct SeaFrame<'a> {
    /// Mid-exposure.
    pub time: Time,
    /// The camera; its z is the height of the eye above the mean sea.
    pub camera: CameraPose,
    /// The picture's lens.
    pub lens: &'a Lens,
    /// Linear luminance at a pixel, 1 where the camera is white; `None` where something else than real water or sky covers it
    /// (boats, the barrel, marks on the screen) and outside of the picture.
    pub luminance: &'a dyn Fn(DVec2) -> Option<f32>,
}

/// A value and its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasuredValue {
    /// The value.
    pub value: f64,
    /// One standard deviation.
    pub sigma: f64,
}

/// The sea as the picture shows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeaEstimate {
    /// Time of the newest picture used.
    pub time: Time,
    /// Length of the record used, seconds.
    pub seconds: f64,
    /// Four standard deviations of the water's height, metres.
    pub significant_height_m: MeasuredValue,
    /// Period at the peak of the spectrum of height, seconds; of a flat sea: the longest that was looked for.
    pub peak_period_s: MeasuredValue,
    /// Mean direction from which the waves about the peak come, radians clockwise from north; sigma pi where unknown.
    pub direction_from_rad: MeasuredValue,
    /// The state that holds that height.
    pub state: WmoSeaState,
    /// Probability that the true height lies in that state, taking its error for normal.
    pub state_probability: f64,
    /// Wind that would raise such waves (Toba 1972, J. Oceanogr. Soc. Japan 28, eq. 3.7), m/s 10 m above the sea. Of swell it is
    /// not the local wind.
    pub wind_m_s: MeasuredValue,
    /// That wind's force.
    pub force: BeaufortForce,
    /// Root mean square slope per axis of all that roughens the water, from its mean brightness.
    pub rough_slope: f64,
    /// Share of the patches' power at the frequencies used that keeps the dispersion relation, 0 to 1.
    pub wave_share: f64,
}

/// Why there is no estimate.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Unknown {
    /// Not long enough yet.
    #[error("the sea has been watched for {seconds:.0} s{}; an estimate needs {LEAST_S:.0} s", .after.map_or(String::new(), |a| format!(" since {a}")))]
    TooShort {
        /// Seconds watched.
        seconds: f64,
        /// The event that ended the watch before.
        after: Option<Restart>,
    },
    /// The camera does not see enough water.
    #[error("the camera sees too little water below the horizon: point it at the sea")]
    NoWater,
    /// Pose, height of the eye or lens are no usable numbers.
    #[error(
        "pose, eye height ({eye_m} m; 0.5 to 200 is possible) or lens are no usable numbers: check unit and calibration"
    )]
    BadPose {
        /// The camera's height above the sea as told, metres.
        eye_m: f64,
    },
    /// The picture stands still.
    #[error("the picture has not changed for {seconds:.0} s")]
    Frozen {
        /// For how long, seconds.
        seconds: f64,
    },
    /// Too dark to see waves.
    #[error("the water is too dark to see waves: luminance {luminance:.5} of white")]
    Dark {
        /// Mean luminance of the water.
        luminance: f64,
    },
    /// Brightness of the water does not fall evenly towards the eye: the sun's glitter, a shore, shallows.
    #[error(
        "the water's brightness is uneven by {:.0} % (glitter or something on the water): turn away from the sun", misfit * 100.0
    )]
    Uneven {
        /// Root mean square of the relative misfit to an even fall.
        misfit: f64,
    },
    /// Brightness tells too little of slope: fog, a lens too long to see the water's brightness fall, a flat grey picture.
    #[error("how the water's brightness goes with its slope is only known to {:.0} %: fog, or too narrow a view", sigma * 100.0)]
    Unsure {
        /// Relative standard deviation over the calibrations that explain the picture; no number where none does.
        sigma: f64,
    },
    /// Nothing moves as waves do, and the view is not clear enough to say that there are none.
    #[error("nothing on the water moves as waves do; waves of up to {limit_m:.1} m could be hidden")]
    NoPattern {
        /// Significant height that would not have been noticed, metres.
        limit_m: f64,
    },
    /// The waves are too high for the height of the eye.
    #[error("waves of about {height_m:.1} m are too high to be measured from {eye_m:.1} m above the sea")]
    TooLow {
        /// Significant height, metres, as a rough value.
        height_m: f64,
        /// Height of the eye, metres.
        eye_m: f64,
    },
}

/// Event that ended a watch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Restart {
    /// The camera was turned away.
    #[error("the camera turned")]
    Turned,
    /// The eye's height changed.
    #[error("the eye's height changed")]
    Height,
    /// Pictures were missing or their time jumped.
    #[error("pictures were missing")]
    Gap,
    /// The picture stood still.
    #[error("the picture stood still")]
    Frozen,
    /// Pose or lens were no numbers.
    #[error("there was no pose")]
    Pose,
}
