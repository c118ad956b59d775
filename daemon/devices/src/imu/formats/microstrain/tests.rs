use std::f64::consts::PI;

use bowwave_core::{estimate::clock::ClockMap, event::ImuSample, time::Time};
use glam::{DMat3, DQuat, DVec3};
use proptest::prelude::*;

use super::*;
use crate::{
    framing::{LineCounters, Scanner},
    imu::{
        ImuDecoder, ImuFormat,
        streams::{G, SimulatedUnit, be, ned, recording, world_of, wxyz},
    },
};

impl SimulatedUnit for MicroStrainCodec {
    fn send(s: &ImuSample, _: i64, _: bool) -> Vec<u8> {
        let world = world_of(s);
        let q = DQuat::from_mat3(&ned(world));
        mip_packet(
            0x80,
            &[
                (0xd5, (s.device_time_ns as u64).to_be_bytes().to_vec()),
                (0x04, be((s.accel / G).to_array())),
                (0x05, be(s.rate.to_array())),
                (0x0a, be(wxyz(q))),
            ],
        )
    }
}

/// A packet of MicroStrain's.
pub(crate) fn mip_packet(set: u8, fields: &[(u8, Vec<u8>)]) -> Vec<u8> {
    let payload: Vec<u8> = fields
        .iter()
        .flat_map(|(descriptor, data)| [&[data.len() as u8 + 2, *descriptor], &data[..]].concat())
        .collect();
    sealed(set, &payload)
}

/// A packet with any payload.
fn sealed(set: u8, payload: &[u8]) -> Vec<u8> {
    let mut bytes = [&[0x75, 0x65, set, payload.len() as u8], payload].concat();
    let (mut a, mut b) = (0u8, 0u8);
    for &byte in &bytes {
        a = a.wrapping_add(byte);
        b = b.wrapping_add(a);
    }
    bytes.extend([a, b]);
    bytes
}

fn parse(stream: &[u8]) -> (Vec<MipPacket>, LineCounters) {
    Scanner::<MicroStrainCodec>::parsed(stream, MipPacket::parse)
}

fn recorded() -> Option<Vec<u8>> {
    recording("microstrain_mip/mip_data_first_half.bin")
}

fn decode(bytes: &[u8]) -> (Vec<ImuSample>, ImuDecoder) {
    let mut decoder = ImuDecoder::new();
    let mut samples = Vec::new();
    for (n, piece) in (0..).zip(bytes.chunks(97)) {
        samples.extend(decoder.samples(piece, Time::from_ns(n * 8_000_000)));
    }
    (samples, decoder)
}

/// A real unit: every check sum is right, nothing is skipped, and the file ends within a packet on purpose.
#[test]
fn a_real_unit_is_decoded_whole() {
    let Some(bytes) = recorded() else { return };
    let (packets, counters) = parse(&bytes);
    assert_eq!((counters.packets, counters.bad_crc, counters.skipped_bytes), (4155, 0, 0));
    let moving = packets.iter().filter(|p| !p.from_filter && p.moves()).count();
    let filtered: Vec<&MipPacket> = packets.iter().filter(|p| p.from_filter).collect();
    assert_eq!((moving, filtered.len()), (2265, 361));
    // The first of its bytes, worked out by hand: 282.809 s, and 15.6 mg along x.
    let first = packets.iter().find(|p| p.moves()).expect("one of them");
    assert_eq!(first.reference_ns, Some(0x0000_0041_d8ba_e040));
    assert_eq!(first.accel.map(|a| a[0].to_bits()), Some(0x3c8e_af72));
    let (samples, decoder) = decode(&bytes);
    assert_eq!(decoder.format(), Some(ImuFormat::MicroStrain));
    assert_eq!((samples.len(), decoder.counters().unusable), (2265, 0));
    assert!(samples.windows(2).all(|w| w[1].device_time_ns - w[0].device_time_ns == 8_000_000));
    assert!(decoder.fields().clock && decoder.fields().attitude);
}

/// Roll and pitch of the filter against gravity of the same moment (shaken by hand from the middle on), and its attitude
/// against the one carried to the samples.
#[test]
fn the_real_units_attitude_agrees_with_gravity_and_with_its_rates() {
    let Some(bytes) = recorded() else { return };
    let (samples, _) = decode(&bytes);
    let with = |s: &&ImuSample| s.world_from_imu.is_some();
    assert!(samples.iter().filter(with).count() > 2250);
    let tilt = |s: &ImuSample| {
        let up = s.world_from_imu.expect("filtered") * s.accel;
        up.angle_between(DVec3::Z).to_degrees()
    };
    let still: Vec<f64> = samples.iter().filter(with).skip(20).take(250).map(tilt).collect();
    let mean = still.iter().sum::<f64>() / still.len() as f64;
    eprintln!("attitude against gravity, at rest: mean {mean:.2} degrees of {} samples", still.len());
    assert!(mean < 0.1, "{mean} degrees");
    // From one filter packet to the next the carried attitude must arrive where the filter says.
    let (packets, _) = parse(&bytes);
    let mut unit = MicroStrainCodec::default();
    let filtered = packets.iter().filter(|p| p.from_filter).map(|p| {
        let reading = unit.convert(p);
        let ReadingStamp::Device { ns } = reading.stamp else { panic!("{reading:?}") };
        (ns, reading.world_from_imu.expect("valid"))
    });
    let mut last: Option<DQuat> = None;
    let mut errors: Vec<(f64, f64)> = filtered
        .filter_map(|(ns, attitude)| {
            let held = last.replace(attitude)?;
            let before = samples.iter().filter(with).rev().find(|s| s.device_time_ns <= ns)?;
            let dt_s = (ns - before.device_time_ns) as f64 * 1e-9;
            let carried = before.world_from_imu? * DQuat::from_scaled_axis(before.rate * dt_s);
            Some((carried.angle_between(attitude).to_degrees(), held.angle_between(attitude).to_degrees()))
        })
        .collect();
    let fastest = samples.iter().map(|s| s.rate.length()).fold(0.0, f64::max).to_degrees();
    let all = errors.len() as f64;
    let (carried, held) = errors.iter().fold((0.0, 0.0), |(c, h), e| (c + e.0 / all, h + e.1 / all));
    errors.sort_by(|a, b| a.0.total_cmp(&b.0));
    let worst = errors[errors.len() - 1];
    eprintln!(
        "50 ms after each of {all} filter packets, up to {fastest:.0} deg/s: carried {carried:.3} degrees from the next, held \
         {held:.3}; worst {:.2}, held {:.2} there",
        worst.0, worst.1
    );
    assert!(carried < held / 5.0 && carried < 0.3, "{carried} {held}");
}

/// Quaternion and Euler angles of one attitude, in both sets: the same attitude.
#[test]
fn quaternions_and_angles_agree() {
    for (roll, pitch, yaw) in [(0.1, -0.2, 3.0), (-PI + 0.1, 1.2, -1.0), (0.0, 0.0, 0.0)] {
        // Rows written out as the manuals print the matrix that turns north-east-down into the body.
        let (sr, cr, sp, cp, sy, cy) =
            (f64::sin(roll), f64::cos(roll), f64::sin(pitch), f64::cos(pitch), f64::sin(yaw), f64::cos(yaw));
        let ned_from_body = DMat3::from_cols(
            DVec3::new(cp * cy, cp * sy, -sp),
            DVec3::new(sr * sp * cy - cr * sy, sr * sp * sy + cr * cy, sr * cp),
            DVec3::new(cr * sp * cy + sr * sy, cr * sp * sy - sr * cy, cr * cp),
        );
        let q = DQuat::from_mat3(&ned_from_body);
        let (wxyz, angles) = (be([q.w, q.x, q.y, q.z]), be([roll, pitch, yaw]));
        let good = |data: &[u8]| [data, &[0, 1]].concat();
        for packet in [
            mip_packet(0x80, &[(0x0a, wxyz.clone())]),
            mip_packet(0x80, &[(0x0c, angles.clone())]),
            mip_packet(0x82, &[(0x03, good(&wxyz))]),
            mip_packet(0x82, &[(0x05, good(&angles))]),
        ] {
            let attitude =
                MicroStrainCodec::default().convert(&parse(&packet).0[0]).world_from_imu.expect("given");
            let forward = attitude * DVec3::X;
            let expected =
                DVec3::new(ned_from_body.x_axis.y, ned_from_body.x_axis.x, -ned_from_body.x_axis.z);
            assert!(forward.abs_diff_eq(expected, 1e-6), "{forward} {expected}");
            let down = attitude * DVec3::Z;
            let expected =
                DVec3::new(ned_from_body.z_axis.y, ned_from_body.z_axis.x, -ned_from_body.z_axis.z);
            assert!(down.abs_diff_eq(expected, 1e-6), "{down} {expected}");
        }
    }
    let invalid = [&be([1.0, 0.0, 0.0, 0.0])[..], &[0, 0]].concat();
    assert_eq!(parse(&mip_packet(0x82, &[(0x03, invalid)])).0[0].quaternion, None);
}

#[test]
fn the_filter_is_believed_where_both_sets_come() {
    let mut unit = MicroStrainCodec::default();
    let sensor = |unit: &mut MicroStrainCodec| {
        let fields =
            [(0x04, be([0.0, 0.0, -1.0])), (0x05, be([0.1, 0.0, 0.0])), (0x0a, be([1.0, 0.0, 0.0, 0.0]))];
        unit.convert(&parse(&mip_packet(0x80, &fields)).0[0])
    };
    let filter = |unit: &mut MicroStrainCodec, fields: &[(u8, Vec<u8>)]| {
        unit.convert(&parse(&mip_packet(0x82, fields)).0[0])
    };
    let good = |values: &[f64]| [&be(values.iter().copied())[..], &[0, 1]].concat();
    let first = sensor(&mut unit);
    assert!(first.world_from_imu.is_some());
    assert!(first.accel.expect("given").abs_diff_eq(DVec3::NEG_Z * 9.806_65, 1e-6));
    let attitude = filter(&mut unit, &[(0x05, good(&[0.0, 0.0, 0.5]))]);
    assert_eq!((attitude.rate, attitude.world_from_imu.is_some()), (None, true));
    let second = sensor(&mut unit);
    assert_eq!((second.world_from_imu, second.rate.is_some()), (None, true));
    let whole = filter(&mut unit, &[(0x0e, good(&[0.2, 0.0, 0.0])), (0x1c, good(&[0.0, 0.0, -9.8]))]);
    assert!(whole.accel.expect("given").abs_diff_eq(DVec3::NEG_Z * 9.8, 1e-6), "m/s^2 already");
    let third = sensor(&mut unit);
    assert_eq!((third.rate, third.accel), (None, None));
}

#[test]
fn times_of_gps_are_taken_where_there_is_no_clock() {
    let gps = |tow_s: f64, week: u16| [&tow_s.to_be_bytes()[..], &week.to_be_bytes(), &[0, 7]].concat();
    let time = |field| parse(&mip_packet(0x80, &[field])).0[0].stamp();
    assert_eq!(time((0x12, gps(1.5, 0))), ReadingStamp::Device { ns: 1_500_000_000 });
    assert_eq!(time((0xd3, gps(0.25, 2))), ReadingStamp::Device { ns: 1_209_600_250_000_000 });
    for wrong in [f64::NAN, -1.0, 604_800.0, f64::INFINITY] {
        assert_eq!(time((0xd3, gps(wrong, 2))), ReadingStamp::Arrival);
    }
    assert_eq!(time((0xd3, gps(1.0, u16::MAX))), ReadingStamp::Arrival);
    assert_eq!(time((0xd5, u64::MAX.to_be_bytes().to_vec())), ReadingStamp::Arrival);
}

#[test]
fn a_unit_that_begins_anew_restarts_the_map() {
    let still = |ns: u64| {
        let fields = [
            (0xd5, ns.to_be_bytes().to_vec()),
            (0x04, be([0.0, 0.0, -1.0])),
            (0x05, be([0.0, 0.0, ns as f64 * 1e-12])),
        ];
        mip_packet(0x80, &fields)
    };
    let mut decoder = ImuDecoder::new();
    let mut map = ClockMap::new();
    for n in 0..400u64 {
        let ns = if n < 200 { 60_000_000_000 + n * 5_000_000 } else { (n - 200) * 5_000_000 };
        let arrival = Time::from_ns(n as i64 * 5_000_000);
        for s in decoder.samples(&still(ns), arrival) {
            map.observe(s.device_time_ns, s.arrival);
        }
    }
    assert_eq!((map.restarts(), decoder.counters().samples), (1, 400));
}

proptest! {
    #[test]
    fn fields_of_any_bytes_are_survived(payload in prop::collection::vec(any::<u8>(), 1..255), filter in any::<bool>()) {
        let bytes = sealed(if filter { FILTER } else { SENSOR }, &payload);
        let (packets, counters) = parse(&bytes);
        prop_assert_eq!((packets.len(), counters.packets), (1, 1));
        MicroStrainCodec::default().convert(&packets[0]);
    }
}
