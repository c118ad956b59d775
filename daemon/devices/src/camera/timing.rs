//! When a picture was taken: from the driver's time stamp to the middle of the exposure.

use bowwave_core::time::{NS_PER_S, Time};

/// A driver's stamp of a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct BufferStamp {
    /// The time.
    pub time: Time,
    /// Whether it is of `CLOCK_MONOTONIC`.
    pub monotonic: bool,
    /// Whether it is the start of the exposure; else the end of the frame.
    pub start_of_exposure: bool,
}

/// Timing of the sensor, as far as it is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Sensor {
    /// Exposure time, nanoseconds, where the camera tells it.
    pub exposure_ns: Option<i64>,
    /// From the end of the middle row's exposure to the end of the frame, nanoseconds.
    pub readout_ns: i64,
    /// Time from frame to frame, nanoseconds.
    pub period_ns: i64,
}

/// Exposure time taken where the camera does not tell: daylight at sea. A constant error is part of the calibrated offset
/// between camera and inertial unit.
const EXPOSURE_UNKNOWN_NS: i64 = 5_000_000;
/// A stamp further ahead of the arrival is no time of the past.
const AHEAD_MAX_NS: i64 = 2_000_000;
/// A stamp further behind the arrival is no time of this picture.
const BEHIND_MAX_NS: i64 = NS_PER_S;

/// Middle of the exposure of a picture that reached the host at `arrival`, and whether the stamp could be believed. Where it
/// could not (another clock, or nowhere near the arrival) the arrival is taken for the end of the frame.
pub(super) fn mid_exposure(stamp: BufferStamp, arrival: Time, sensor: Sensor) -> (Time, bool) {
    let half = sensor.exposure_ns.unwrap_or(EXPOSURE_UNKNOWN_NS).clamp(0, sensor.period_ns.max(0)) / 2;
    let behind = arrival.ns_since(stamp.time);
    let believed = stamp.monotonic && (-AHEAD_MAX_NS..=BEHIND_MAX_NS).contains(&behind);
    let middle = if !believed {
        arrival.plus_ns(-sensor.readout_ns - half)
    } else if stamp.start_of_exposure {
        stamp.time.plus_ns(half)
    } else {
        stamp.time.plus_ns(-sensor.readout_ns - half)
    };
    // A picture cannot have arrived before it was taken.
    (middle.min(arrival), believed)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SENSOR: Sensor =
        Sensor { exposure_ns: Some(4_000_000), readout_ns: 16_000_000, period_ns: 33_333_333 };

    fn stamp(ms: i64, monotonic: bool, start_of_exposure: bool) -> BufferStamp {
        BufferStamp { time: Time::from_ns(ms * 1_000_000), monotonic, start_of_exposure }
    }

    #[test]
    fn start_of_exposure_and_end_of_frame_lead_to_its_middle() {
        let arrival = Time::from_ns(10_050_000_000);
        let of = |stamp| {
            let (time, believed) = mid_exposure(stamp, arrival, SENSOR);
            (time.ns() / 1_000_000, believed)
        };
        assert_eq!(of(stamp(10_000, true, true)), (10_002, true));
        assert_eq!(of(stamp(10_030, true, false)), (10_012, true));
        // The wall clock's, and one from long ago: the arrival counts.
        assert_eq!(of(stamp(10_030, false, true)), (10_032, false));
        assert_eq!(of(stamp(0, true, true)), (10_032, false));
        assert_eq!(of(stamp(10_100, true, false)), (10_032, false));
    }

    proptest! {
        #[test]
        fn no_picture_is_of_the_future_or_of_long_ago(
            time in any::<i64>(),
            arrival in 0..i64::MAX / 2,
            monotonic in any::<bool>(),
            start_of_exposure in any::<bool>(),
            exposure_ns in prop::option::of(any::<i64>()),
        ) {
            let stamp = BufferStamp { time: Time::from_ns(time), monotonic, start_of_exposure };
            let arrival = Time::from_ns(arrival);
            let (middle, _) = mid_exposure(stamp, arrival, Sensor { exposure_ns, ..SENSOR });
            prop_assert!(middle <= arrival && arrival.ns_since(middle) < 2 * NS_PER_S);
        }
    }
}
