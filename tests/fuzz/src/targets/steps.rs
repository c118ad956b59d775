//! Steps of a fuzzed line, and what every sample promises.

use bowwave_core::event::ImuSample;

/// The bytes on the wire of each step of `input`: `wire` makes them of the step's head and its content, which is as long as the head's
/// lowest ten bits say, or as is left.
pub fn of(mut input: &[u8], wire: fn(u16, &[u8]) -> Vec<u8>) -> impl Iterator<Item = Vec<u8>> {
    std::iter::from_fn(move || {
        let (&[low, high], rest) = input.split_first_chunk()?;
        let head = u16::from_le_bytes([low, high]);
        let (content, rest) = rest.split_at(usize::from(head & 0x3ff).min(rest.len()));
        input = rest;
        Some(wire(head, content))
    })
}

/// Its numbers are finite, its time is one, and its attitude a rotation.
pub fn check_sample(sample: &ImuSample) {
    assert!(sample.device_time_ns >= 0, "{sample:?}");
    assert!(sample.rate.is_finite() && sample.accel.is_finite(), "{sample:?}");
    if let Some(attitude) = sample.world_from_imu {
        assert!((attitude.length() - 1.0).abs() < 1e-6, "an attitude that is no rotation: {sample:?}");
    }
}
