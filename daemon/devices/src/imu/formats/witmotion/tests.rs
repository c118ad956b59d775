use bowwave_core::{event::ImuSample, time::Time};
use glam::{DQuat, DVec3};

use super::*;
use crate::{
    framing::Scanner,
    imu::{
        ImuDecoder, ImuFormat,
        streams::{FormatTolerance, G, SimulatedUnit, i16s as words, rfu, world_of, wxyz, yaw_pitch_roll},
    },
};

impl SimulatedUnit for WitmotionCodec {
    const PERIOD_NS: i64 = 10_000_000;
    const PACKETS: u64 = 5;
    const TOLERANCE: FormatTolerance =
        FormatTolerance { rate: 6e-4, accel: 0.003, attitude: 8e-5, time_ns: 1_000_000 };

    fn send(s: &ImuSample, _: i64, by_angles: bool) -> Vec<u8> {
        let world = world_of(s);
        let m = rfu(world);
        let [yaw, pitch, roll] = yaw_pitch_roll(m).map(f64::to_degrees);
        let part = |values: [f64; 3], full: f64| words(values.map(|v| v / full * 32_768.0));
        let body = |v: DVec3| [v.y, v.x, -v.z];
        let quaternion: Vec<u8> = wxyz(DQuat::from_mat3(&m))
            .iter()
            .flat_map(|v| ((v * 32_768.0).round().min(32_767.0) as i16).to_le_bytes())
            .collect();
        let mut bytes = [
            witmotion_packet(0x51, &part(body(s.accel / G), 16.0)),
            witmotion_packet(0x52, &part(body(s.rate * 1f64.to_degrees()), 2000.0)),
            witmotion_packet(0x53, &part([roll, pitch, yaw], 180.0)),
            witmotion_packet(0x54, &[1, 2, 3, 4]),
        ]
        .concat();
        if !by_angles {
            bytes.extend(witmotion_packet(0x59, &quaternion));
        }
        bytes
    }
}

/// A packet of Witmotion's.
pub(crate) fn witmotion_packet(kind: u8, data: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0x55, kind];
    bytes.extend(data);
    bytes.resize(10, 0);
    bytes.push(bytes.iter().fold(0u8, |sum, &b| sum.wrapping_add(b)));
    bytes
}

fn i16s(values: [i16; 4]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn packet(kind: u8, values: [i16; 4]) -> Vec<u8> {
    witmotion_packet(kind, &i16s(values))
}

fn decode(groups: &[Vec<u8>]) -> Vec<ImuSample> {
    let mut decoder = ImuDecoder::fixed(ImuFormat::Witmotion);
    let mut samples = Vec::new();
    for (n, group) in (0..).zip(groups) {
        samples.extend(decoder.samples(group, Time::from_ns(n * 10_000_000)));
    }
    samples
}

#[test]
fn full_scales_are_those_of_the_specification() {
    let read = |kind, values| {
        let bytes = packet(kind, values);
        let mut scanner = Scanner::<WitmotionCodec>::new();
        let mut got = None;
        let mut bytes = &bytes[..];
        while let Some(found) = scanner.next_of(&mut bytes) {
            got = WitmotionPacket::parse(found.bytes, found.head);
        }
        got.expect("a packet")
    };
    assert_eq!(read(0x51, [2048, -2048, -32_768, 2500]), WitmotionPacket::Accel([1.0, -1.0, -16.0]));
    assert_eq!(read(0x52, [16_384, -32_768, 0, 0]), WitmotionPacket::Rate([1000.0, -2000.0, 0.0]));
    assert_eq!(read(0x53, [16_384, -8192, -32_768, 0]), WitmotionPacket::Angles([90.0, -45.0, -180.0]));
    assert_eq!(read(0x59, [16_384, 0, -16_384, 0]), WitmotionPacket::Quaternion([0.5, 0.0, -0.5, 0.0]));
    assert_eq!(read(0x54, [1; 4]), WitmotionPacket::Other);
}

#[test]
fn axes_right_forward_up_become_forward_right_down() {
    // At rest, level, turned 90 degrees counter-clockwise from east-north: its forward looks west.
    let group =
        [packet(0x51, [0, 0, 2048, 0]), packet(0x52, [16, 32, 64, 0]), packet(0x53, [0, 0, 16_384, 0])]
            .concat();
    let samples = decode(&vec![group; 3]);
    let sample = samples[2];
    assert!(sample.accel.abs_diff_eq(DVec3::NEG_Z * G, 1e-12));
    let lsb = (2000.0 / 32_768.0f64).to_radians();
    assert!(sample.rate.abs_diff_eq(DVec3::new(32.0, 16.0, -64.0) * lsb, 1e-12));
    let attitude = sample.world_from_imu.expect("angles");
    assert!((attitude * DVec3::X).abs_diff_eq(DVec3::NEG_X, 1e-12), "{}", attitude * DVec3::X);
    assert!((attitude * sample.accel).abs_diff_eq(DVec3::Z * G, 1e-12));
    // Pitch turns about y (forward): right side down. Roll turns about x (right): nose up.
    let angles = |roll, pitch| {
        let group =
            [packet(0x51, [0, 0, 2048, 0]), packet(0x52, [0; 4]), packet(0x53, [roll, pitch, 0, 0])].concat();
        decode(&vec![group; 2])[1].world_from_imu.expect("angles")
    };
    assert!((angles(0, 4096) * DVec3::Y).z < -0.3);
    assert!((angles(4096, 0) * DVec3::X).z > 0.3);
}

/// One sample a group, at its last packet, whatever the unit is set to send.
#[test]
fn a_group_is_one_sample() {
    let (a, w, e, q) = (
        packet(0x51, [0, 0, 2048, 0]),
        packet(0x52, [1, 2, 3, 0]),
        packet(0x53, [0; 4]),
        packet(0x59, [32_767, 0, 0, 0]),
    );
    let clock = packet(0x50, [7; 4]);
    for (group, attitude) in [
        (vec![&a, &w], false),
        (vec![&a, &w, &e], true),
        (vec![&clock, &a, &w, &e], true),
        (vec![&a, &w, &e, &q], true),
        (vec![&a, &w, &q], true),
    ] {
        let bytes: Vec<u8> = group.into_iter().flatten().copied().collect();
        let samples = decode(&vec![bytes; 10]);
        assert_eq!(samples.len(), 10);
        assert!(samples[1..].iter().all(|s| s.world_from_imu.is_some() == attitude));
    }
    // No gyro: the rate is that of the attitudes.
    let turning: Vec<Vec<u8>> = (0..20i16)
        .map(|n| [packet(0x51, [0, 0, 2048, 0]), packet(0x53, [0, 0, n * 182, 0])].concat())
        .collect();
    let samples = decode(&turning);
    assert!(samples.len() >= 17, "{}", samples.len());
    let rate = samples[samples.len() - 1].rate;
    // 182 / 32768 of half a turn in 10 ms, counter-clockwise: about z down the other way round.
    let expected = (182.0 / 32_768.0 * 180.0f64).to_radians() / 0.01;
    assert!(
        (rate.z + expected).abs() < 0.15 * expected && rate.truncate().length() < 1e-6,
        "{rate} {expected}"
    );
}

#[test]
fn a_group_that_lacks_a_part_is_left_out() {
    let (a, w, q) =
        (packet(0x51, [0, 0, 2048, 0]), packet(0x52, [1, 2, 3, 0]), packet(0x59, [32_767, 0, 0, 0]));
    let whole = [&a[..], &w, &q].concat();
    let without = [&a[..], &q].concat();
    let cut = [&a[..], &w[..7]].concat();
    assert_eq!(decode(&[whole.clone(), whole.clone(), cut, whole.clone()]).len(), 3);
    // A rate that is lost: nothing is made of attitudes that are fit for that, and the next group is whole again.
    let samples = decode(&[whole.clone(), whole.clone(), without, whole]);
    assert!(samples.len() == 4 && samples.iter().all(|s| s.rate.is_finite()), "{}", samples.len());
}
