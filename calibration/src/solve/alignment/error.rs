//! Why there is no alignment.

use std::fmt;

/// A movement of the camera about one of its own axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Movement {
    /// Left and right, about the picture's vertical.
    Traverse,
    /// Up and down, about the picture's horizontal.
    Elevation,
    /// About the optical axis.
    Roll,
    /// None of them was enough.
    Any,
}

impl fmt::Display for Movement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Traverse => "traverse (left and right)",
            Self::Elevation => "elevation (up and down)",
            Self::Roll => "roll (about the line of sight)",
            Self::Any => "movement of any kind",
        })
    }
}

/// Why rotation and offset could not be found.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum AlignmentError {
    /// Not enough to begin with.
    #[error(
        "only {count} {what}, at least {least} are needed; record longer, or look at the target or the horizon for longer"
    )]
    TooFew {
        /// Name of the measurements.
        what: &'static str,
        /// How many there are.
        count: usize,
        /// How many there must be.
        least: usize,
    },
    /// Camera and unit were not recorded at the same time.
    #[error(
        "the camera's {camera_s:.1} s and the inertial unit's {gyro_s:.1} s do not overlap, or their clocks differ by more than \
         the search goes; check that both stamps are on the host's clock"
    )]
    NoOverlap {
        /// Length of what the camera saw.
        camera_s: f64,
        /// Length of the gyro's readings.
        gyro_s: f64,
    },
    /// The recording is longer than what one bias can hold for.
    #[error("the recording spans {span_s:.0} s, more than {most_s:.0} s; cut it, or mend its stamps")]
    TooLong {
        /// From the first to the last reading.
        span_s: f64,
        /// The most that is taken.
        most_s: f64,
    },
    /// A turn of the unit looks mirrored in the camera.
    #[error(
        "the inertial unit's axes are mirrored: {:.0} % of the turning fits no rotation, {:.0} % with one axis reversed; exactly \
         one or three axes have the wrong sign, mend the unit's axis settings", left * 100.0, left_mirrored * 100.0
    )]
    Mirrored {
        /// Share of the turns' energy that a rotation leaves unexplained.
        left: f64,
        /// The same with a mirrored rotation.
        left_mirrored: f64,
    },
    /// The movement does not tell all three angles.
    #[error(
        "the recording lacks {missing}: of the rotation the worst-known angle is uncertain by {sigma_mrad:.0} mrad, and it is known \
         {:.4} times as well as the best one; record again with that movement",
        ratio
    )]
    NotObservable {
        /// Movement that is missing.
        missing: Movement,
        /// Smallest singular value of the normalised information over the largest.
        ratio: f64,
        /// Standard deviation about the worst axis, milliradians.
        sigma_mrad: f64,
    },
    /// The gyro felt what the camera did not see.
    #[error(
        "the camera has seen only {:.0} % of the movement by which the gyro would tell the time offset; the rest is vibration, or a gimbal \
         holds the camera still: fasten camera and inertial unit on one rigid mount, and turn it farther",
        share * 100.0
    )]
    NotShared {
        /// Share of the gyro's movement that the camera has seen.
        share: f64,
    },
    /// Nothing fits.
    #[error(
        "what the camera saw does not fit the gyro: {problem}; check that both were recorded on one rigid mount, at the same time"
    )]
    NoFit {
        /// Description of the problem.
        problem: &'static str,
    },
}
