//! Ways to be set up wrongly, and what to do about each.

use crate::fault::Fault;

/// A way in which the trainer is set up wrongly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Misfit {
    /// The unit is turned against the camera by so many degrees.
    Turned(u16),
    /// One or all of the gyro's axes have the wrong sign, or all of the specific force.
    Reversed(&'static str),
    /// Rates come in deg/s.
    RateUnit,
    /// Specific forces come in units of standard gravity.
    ForceUnit,
    /// The lens is longer or shorter than the calibrated one.
    Lens,
    /// The picture is mirrored.
    Mirrored,
    /// Pictures come so many milliseconds later than their stamps say.
    Late(u16),
    /// The horizon is all the time at another place than the unit has it.
    Mount,
}

impl Misfit {
    /// Faults of all misfits.
    pub const FAULTS: [Fault; 8] = [
        Fault::UnitTurned,
        Fault::UnitReversed,
        Fault::RateUnit,
        Fault::ForceUnit,
        Fault::OtherLens,
        Fault::PictureMirrored,
        Fault::PictureLate,
        Fault::NotRegistered,
    ];

    /// The entry of the table of faults that tells the sailor about it.
    pub const fn fault(self) -> Fault {
        match self {
            Self::Turned(_) => Fault::UnitTurned,
            Self::Reversed(_) => Fault::UnitReversed,
            Self::RateUnit => Fault::RateUnit,
            Self::ForceUnit => Fault::ForceUnit,
            Self::Lens => Fault::OtherLens,
            Self::Mirrored => Fault::PictureMirrored,
            Self::Late(_) => Fault::PictureLate,
            Self::Mount => Fault::NotRegistered,
        }
    }
}

impl std::fmt::Display for Misfit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Turned(degrees) => write!(
                f,
                "the inertial unit is turned by {degrees} degrees against how it was calibrated: fit it as it was, or calibrate it to the camera"
            ),
            Self::Reversed(what) => write!(
                f,
                "{what} of the inertial unit has the wrong sign: set its axes to forward, right, down, or calibrate anew"
            ),
            Self::RateUnit => f.write_str("the inertial unit sends rates in deg/s: set it to rad/s"),
            Self::ForceUnit => f.write_str("the inertial unit sends specific force in g: set it to m/s^2"),
            Self::Lens => f.write_str(
                "the picture turns faster or slower than the calibrated lens would have it: fit the calibrated camera, undo its zoom, or \
                 calibrate its lens",
            ),
            Self::Mirrored => f.write_str("the picture is mirrored: switch the camera's flip off"),
            Self::Late(ms) => write!(
                f,
                "pictures come about {ms} ms later than calibrated: calibrate the inertial unit to the camera anew"
            ),
            Self::Mount => f.write_str(
                "the horizon in the picture is not where the inertial unit has it: is this the calibration of this mount? calibrate the inertial \
                 unit to the camera",
            ),
        }
    }
}
