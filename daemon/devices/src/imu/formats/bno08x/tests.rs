use bowwave_core::{event::ImuSample, time::Time};
use glam::DVec3;

use super::*;
use crate::{
    framing::Scanner,
    imu::{
        ImuDecoder, ImuFormat,
        streams::{FormatTolerance, G, POLE, SimulatedUnit, encode, i16s, recording, rfu, truth, world_of},
    },
};

impl SimulatedUnit for Bno08xCodec {
    const PERIOD_NS: i64 = 10_000_000;
    // Hundredths of a degree; the rate is their difference over 10 ms, half of that old.
    const TOLERANCE: FormatTolerance =
        FormatTolerance { rate: 0.04, accel: 0.006, attitude: 2e-4, time_ns: 1_000_000 };

    fn send(s: &ImuSample, n: i64, _: bool) -> Vec<u8> {
        let world = world_of(s);
        let m = rfu(world);
        let at = |row: usize, column: usize| m.col(column)[row];
        // About z, then x, then y.
        let pitch = at(2, 1).clamp(-1.0, 1.0).asin();
        let (yaw, roll) = if at(2, 0).hypot(at(2, 2)) < POLE {
            (at(1, 0).atan2(at(0, 0)), 0.0)
        } else {
            ((-at(0, 1)).atan2(at(1, 1)), (-at(2, 0)).atan2(at(2, 2)))
        };
        let mut bytes = vec![0xaa, 0xaa, n as u8];
        bytes.extend(i16s([yaw, pitch, roll].map(|v| v.to_degrees() * 100.0)));
        bytes.extend(i16s([s.accel.y, s.accel.x, -s.accel.z].map(|v| v / G * 1000.0)));
        bytes.extend([0; 3]);
        bytes.push(bytes[2..].iter().fold(0u8, |sum, &b| sum.wrapping_add(b)));
        bytes
    }
}

fn parse(stream: &[u8]) -> Vec<Bno08xPacket> {
    Scanner::<Bno08xCodec>::parsed(stream, |bytes, ()| Bno08xPacket::parse(bytes)).0
}

/// The data sheet's example and what it says of it.
#[test]
fn the_data_sheets_example_is_decoded_as_it_says() {
    let Some(bytes) = recording("bno08x_uart_rvc_datasheet_example.bin") else { return };
    let packets = parse(&bytes);
    assert_eq!(
        packets,
        [Bno08xPacket {
            index: 222,
            yaw_pitch_roll_deg: [0.01, -1.1, 20.85],
            accel_g: [-0.371, -0.02, 0.977]
        }]
    );
    // Its acceleration is gravity in the axes that we take its angles for.
    let reading = Bno08xCodec::default().convert(&packets[0]);
    let up = reading.world_from_imu.expect("given") * reading.accel.expect("given");
    let off = up.angle_between(DVec3::Z).to_degrees();
    eprintln!("the example's acceleration is {off:.3} degrees from its own vertical");
    assert!(off < 0.1, "{off} degrees");
}

#[test]
fn angles_lie_where_the_axes_say() {
    let packet =
        |yaw_pitch_roll_deg| Bno08xPacket { index: 0, yaw_pitch_roll_deg, accel_g: [0.1, 0.2, 0.97] };
    let attitude = |angles| Bno08xCodec::default().convert(&packet(angles)).world_from_imu.expect("given");
    let level = attitude([0.0; 3]);
    assert!((level * DVec3::X).abs_diff_eq(DVec3::Y, 1e-12), "forward is north");
    assert!((level * DVec3::Y).abs_diff_eq(DVec3::X, 1e-12), "right is east");
    assert!(
        (attitude([90.0, 0.0, 0.0]) * DVec3::X).abs_diff_eq(DVec3::NEG_X, 1e-12),
        "counter-clockwise to the west"
    );
    assert!((attitude([0.0, 30.0, 0.0]) * DVec3::X).z > 0.49, "the nose goes up");
    assert!((attitude([0.0, 0.0, 30.0]) * DVec3::Y).z < -0.49, "the right side goes down");
    let accel = Bno08xCodec::default().convert(&packet([0.0; 3])).accel.expect("given");
    assert!(accel.abs_diff_eq(DVec3::new(0.2, 0.1, -0.97) * G, 1e-12), "forward, right, down");
}

/// The index wraps every 2.56 s; packets that are lost leave a gap of their number.
#[test]
fn the_index_wraps_and_tells_what_is_lost() {
    let mut decoder = ImuDecoder::fixed(ImuFormat::Bno08x);
    let mut samples: Vec<ImuSample> = Vec::new();
    for n in (0..3_000).filter(|n| n % 500 != 499) {
        samples.extend(decoder.samples(&encode(ImuFormat::Bno08x, n), truth(ImuFormat::Bno08x, n).arrival));
    }
    let steps: Vec<i64> = samples.windows(2).map(|w| w[1].device_time_ns - w[0].device_time_ns).collect();
    let of = |ms: i64| steps.iter().filter(|s| (**s - ms * 1_000_000).abs() < 100_000).count();
    assert_eq!((of(10), of(20)), (steps.len() - 5, 5));
}

/// A unit that begins anew begins its index anew: time goes on, as no clock says otherwise.
#[test]
fn an_index_that_begins_anew_breaks_nothing() {
    let mut decoder = ImuDecoder::fixed(ImuFormat::Bno08x);
    let mut last = -1;
    for n in 0..2_000i64 {
        let index = if n < 777 { n } else { n - 777 };
        let gap = if n < 777 { 0 } else { 400_000_000 };
        let arrival = Time::from_ns(truth(ImuFormat::Bno08x, n).arrival.ns() + gap);
        let mut bytes = encode(ImuFormat::Bno08x, n);
        let change = (index as u8).wrapping_sub(bytes[2]);
        bytes[2] = index as u8;
        bytes[18] = bytes[18].wrapping_add(change);
        for s in decoder.samples(&bytes, arrival) {
            assert!(s.device_time_ns > last, "packet {n}");
            last = s.device_time_ns;
            let expected = arrival.ns_since(truth(ImuFormat::Bno08x, 0).arrival);
            assert!((last - expected).abs() < 1_000_000, "packet {n}: {last} {expected}");
        }
    }
    assert!(decoder.counters().samples > 1_990);
}
