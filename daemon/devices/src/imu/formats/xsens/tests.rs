use bowwave_core::{estimate::clock::ClockMap, event::ImuSample, time::Time};
use glam::{DMat3, DQuat, DVec3};
use proptest::prelude::*;

use super::*;
use crate::{
    framing::Scanner,
    imu::{
        ImuDecoder, ImuFormat,
        streams::{SimulatedUnit, be, recording, world_of, wxyz},
    },
};

impl SimulatedUnit for XsensCodec {
    fn send(s: &ImuSample, n: i64, _: bool) -> Vec<u8> {
        let world = world_of(s);
        // Forward, left, up.
        let unit = DMat3::from_cols(world.x_axis, -world.y_axis, -world.z_axis);
        let flu = |v: DVec3| be([v.x, -v.y, -v.z]);
        let payload = [
            item(0x1020, &(n as u16).to_be_bytes()),
            item(0x1060, &((s.device_time_ns / 100_000) as u32).to_be_bytes()),
            item(0x2010, &be(wxyz(DQuat::from_mat3(&unit)))),
            item(0x4020, &flu(s.accel)),
            item(0x8020, &flu(s.rate)),
            item(0xe020, &[0, 0, 0, 3]),
        ]
        .concat();
        xbus(0x36, &payload)
    }
}

/// A message of a single unit.
pub(crate) fn xbus(message: u8, payload: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0xfa, 0xff, message];
    match u8::try_from(payload.len()) {
        Ok(short) if short < 0xff => bytes.push(short),
        _ => {
            bytes.push(0xff);
            bytes.extend((payload.len() as u16).to_be_bytes());
        }
    }
    bytes.extend(payload);
    let sum = bytes[1..].iter().fold(0u8, |sum, &b| sum.wrapping_add(b));
    bytes.push(sum.wrapping_neg());
    bytes
}

fn item(id: u16, data: &[u8]) -> Vec<u8> {
    [&id.to_be_bytes()[..], &[data.len() as u8], data].concat()
}

/// The payloads that the maker's own program decoded, and its words for them, by turns.
fn golden() -> Option<Vec<(Vec<u8>, String)>> {
    let text = recording("xsens_mtdata2/mtmanager_packets.md")?;
    let text = String::from_utf8(text).expect("text");
    let blocks: Vec<&str> = text.split("```").skip(1).step_by(2).map(str::trim).collect();
    let pairs =
        blocks.windows(2).filter(|w| w[0].starts_with("10 20 02") && w[1].starts_with("{(PacketCounter"));
    Some(pairs.map(|w| (bytes(w[0]), w[1].to_owned())).collect())
}

fn bytes(hex: &str) -> Vec<u8> {
    hex.split_whitespace().map(|b| u8::from_str_radix(b, 16).expect("hexadecimal")).collect()
}

/// The numbers that follow `name` in the program's words.
fn decoded<const N: usize>(words: &str, name: &str) -> Option<[f64; N]> {
    let rest = words.split(&format!("({name}")).nth(1)?;
    let rest = rest.split_once(" bytes,")?.1;
    let mut numbers = rest
        .split(|c: char| !(c.is_ascii_digit() || ".-".contains(c)))
        .filter(|s| s.contains('.'))
        .map(|s| s.parse().expect("a number"));
    let values: [f64; N] = std::array::from_fn(|_| numbers.next().expect("so many numbers"));
    Some(values)
}

fn parse(stream: &[u8]) -> (Vec<XsensMessage>, crate::framing::LineCounters) {
    Scanner::<XsensCodec>::parsed(stream, XsensMessage::parse)
}

fn close<const N: usize>(got: Option<[f64; N]>, want: Option<[f64; N]>) {
    assert_eq!(got.is_some(), want.is_some());
    for (g, w) in got.iter().flatten().zip(want.iter().flatten()) {
        assert!((g - w).abs() <= 5.1e-9, "{g} {w}: the words have eight digits");
    }
}

#[test]
fn the_makers_packets_are_decoded_as_its_program_does() {
    let Some(golden) = golden() else { return };
    assert_eq!(golden.len(), 6);
    let stream: Vec<u8> = golden.iter().flat_map(|(payload, _)| xbus(MTDATA2, payload)).collect();
    let (packets, counters) = parse(&stream);
    assert_eq!((packets.len(), counters.bad_crc, counters.skipped_bytes), (6, 0, 0));
    for (packet, (_, words)) in packets.iter().zip(&golden) {
        let after =
            |name: &str| words.split(name).nth(1).and_then(|r| r.split(['(', ')']).next()).map(str::trim);
        let counter = packet.counter.map(|n| n.to_string());
        assert_eq!(counter.as_deref(), after("PacketCounter, 2 bytes,"));
        let fine = packet.sample_time_fine.map(|n| n.to_string());
        assert_eq!(fine.as_deref(), after("SampleTimeFine, 4 bytes,"));
        close(packet.quaternion.map(|q| q.0), decoded(words, "Quaternion|Float|ENU"));
        close(packet.accel, decoded(words, "Acceleration|Float"));
        close(packet.rate, decoded(words, "RateOfTurn|Float"));
        assert_eq!(packet.quaternion.map(|q| q.1), Some(0), "east-north-up");
    }
}

/// The unit lay still for four of them: its force then points up in our world, in our axes.
#[test]
fn the_real_unit_feels_gravity_upwards_in_our_world() {
    let Some(golden) = golden() else { return };
    let mut unit = XsensCodec::default();
    for (payload, _) in &golden[..4] {
        let reading = unit.convert(&parse(&xbus(MTDATA2, payload)).0[0]);
        let (attitude, accel) = (reading.world_from_imu.expect("given"), reading.accel.expect("given"));
        let up = attitude * accel;
        assert!((9.7..9.9).contains(&up.z) && up.truncate().length() < 0.1, "{up}");
        // The same turn, by its own words: free acceleration is what is left without gravity.
        assert!((up - DVec3::Z * 9.812).length() < 0.05, "{up}");
    }
}

fn f32s(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_be_bytes()).collect()
}

#[test]
fn the_same_attitude_in_each_reference() {
    // A unit that faces north, level: yaw is 90 degrees from east, 0 from north.
    let half = std::f32::consts::FRAC_1_SQRT_2;
    for (low, wxyz) in [
        (0x0, [half, 0.0, 0.0, half]),
        // Its z axis points up, against the reference's: half a turn about north.
        (0x4, [0.0, 1.0, 0.0, 0.0]),
        (0x8, [1.0, 0.0, 0.0, 0.0]),
    ] {
        let packet = parse(&xbus(MTDATA2, &item(0x2010 | low, &f32s(&wxyz)))).0[0];
        let attitude = XsensCodec::default().convert(&packet).world_from_imu.expect("given");
        assert!((attitude * DVec3::X).abs_diff_eq(DVec3::Y, 1e-7), "reference {low:x}: forward is north");
        assert!((attitude * DVec3::Y).abs_diff_eq(DVec3::X, 1e-7), "reference {low:x}: right is east");
        assert!((attitude * DVec3::Z).abs_diff_eq(DVec3::NEG_Z, 1e-7), "reference {low:x}: down is down");
    }
    // Euler angles: roll, pitch, yaw; a positive pitch is nose down with y to the left.
    let packet = parse(&xbus(MTDATA2, &item(0x2030, &f32s(&[0.0, 30.0, 90.0])))).0[0];
    let forward = XsensCodec::default().convert(&packet).world_from_imu.expect("given") * DVec3::X;
    assert!(forward.abs_diff_eq(DVec3::new(0.0, 0.75f64.sqrt(), -0.5), 1e-7), "{forward}");
    let unassigned = parse(&xbus(MTDATA2, &item(0x201c, &f32s(&[1.0, 0.0, 0.0, 0.0])))).0[0];
    assert_eq!(XsensCodec::default().convert(&unassigned).world_from_imu, None);
}

#[test]
fn all_precisions_are_the_same_number() {
    let values = [-1.25, 100.000_976_562_5, 0.5];
    let encoded = [
        f32s(&values.map(|v| v as f32)),
        values.iter().flat_map(|v| ((v * f64::from(1 << 20)) as i32).to_be_bytes()).collect(),
        values
            .iter()
            .flat_map(|v| {
                let fixed = (v * 2f64.powi(32)) as i64;
                [&(fixed as u32).to_be_bytes()[..], &((fixed >> 32) as i16).to_be_bytes()].concat()
            })
            .collect(),
        values.iter().flat_map(|v| v.to_be_bytes()).collect(),
    ];
    for (low, data) in (0u16..).zip(encoded) {
        let packet = parse(&xbus(MTDATA2, &item(0x4020 | low, &data))).0[0];
        assert_eq!(packet.accel, Some(values), "precision {low}");
    }
    let wrong = parse(&xbus(MTDATA2, &item(0x4020, &[0; 11]))).0[0];
    assert_eq!(wrong.accel, None);
}

fn still(fine: u32) -> Vec<u8> {
    let payload = [
        item(0x1060, &fine.to_be_bytes()),
        item(0x4020, &f32s(&[0.0, 0.0, 9.8])),
        item(0x8020, &f32s(&[0.0, 0.0, fine as f32 * 1e-9])),
    ];
    xbus(MTDATA2, &payload.concat())
}

#[test]
fn the_clock_goes_on_where_it_wraps_and_back_where_the_unit_begins_anew() {
    let mut decoder = ImuDecoder::fixed(ImuFormat::Xsens);
    let mut map = ClockMap::new();
    let mut times = Vec::new();
    // Ticks of 100 us at 200 Hz over the wrap, then a start anew.
    let ticks =
        (0..1_000u32).map(|n| (u32::MAX - 9_999).wrapping_add(n * 50)).chain((0..100).map(|n| 7 + n * 50));
    for (n, fine) in (0..).zip(ticks) {
        let arrival = Time::from_ns(n * 5_000_000);
        for s in decoder.samples(&still(fine), arrival) {
            map.observe(s.device_time_ns, arrival);
            times.push(s.device_time_ns);
        }
        assert_eq!(map.restarts(), u32::from(n >= 1_000), "packet {n}");
    }
    assert!(times[..1_000].windows(2).all(|w| w[1] - w[0] == 5_000_000));
    assert!(times[1_000] < times[999]);
}

/// A unit that is set to send no time: its packet counter of 16 bits is its clock, by the beat that arrivals tell.
#[test]
fn a_unit_without_a_clock_goes_on_where_its_packet_counter_wraps() {
    let mut decoder = ImuDecoder::fixed(ImuFormat::Xsens);
    let mut map = ClockMap::new();
    let mut times = Vec::new();
    // 200 Hz over two wraps, with two packets lost at the first.
    for n in (0..140_000_i64).filter(|n| !(65_535..65_537).contains(n)) {
        let payload = [
            item(0x1020, &(n as u16).to_be_bytes()),
            item(0x4020, &f32s(&[0.0, 0.0, 9.8])),
            item(0x8020, &f32s(&[0.0, 0.0, n as f32 * 1e-9])),
        ];
        let arrival = Time::from_ns(n * 5_000_000);
        for s in decoder.samples(&xbus(MTDATA2, &payload.concat()), arrival) {
            times.push((map.observe(s.device_time_ns, arrival).ns_since(arrival), s.device_time_ns));
        }
    }
    assert_eq!((times.len(), map.restarts()), (139_998, 0));
    assert!(times.windows(2).all(|w| w[1].1 > w[0].1), "never back");
    let off = times.iter().skip(1000).map(|t| t.0.abs()).max();
    assert!(off < Some(10_000), "{off:?} ns off at a wrap");
}

#[test]
fn lengths_beyond_a_payload_and_the_protocol_are_refused() {
    let long =
        xbus(MTDATA2, &[item(0x1020, &[0, 9]), item(0x30ff, &[0; 255]), item(0x30ff, &[0; 255])].concat());
    assert_eq!(long[3], 0xff);
    let (packets, counters) = parse(&long);
    assert_eq!((packets[0].counter, counters.skipped_bytes), (Some(9), 0));
    // 2049 bytes are claimed: refused at once, and the packet behind is found although nothing else comes.
    let mut stream = vec![0xfa, 0xff, 0x36, 0xff, 0x08, 0x01];
    stream.extend(still(1));
    stream.extend(still(2));
    assert_eq!(parse(&stream).0.len(), 2);
    // 2048 are possible: whole packets behind it show it to be false, before they all came.
    stream[5] = 0;
    assert_eq!(parse(&stream).0.len(), 2);
    // An item that is longer than its message.
    let bad = xbus(MTDATA2, &[0x40, 0x20, 0x0d, 0, 0, 0]);
    assert_eq!(parse(&bad).1.packets, 0);
}

#[test]
fn other_messages_and_attitudes_alone_are_no_samples() {
    let mut decoder = ImuDecoder::fixed(ImuFormat::Xsens);
    let mut samples = 0;
    samples += decoder.samples(&xbus(0x11, &[]), Time::MIN).count();
    for n in 0..100u16 {
        let payload = [item(0x1020, &n.to_be_bytes()), item(0x2010, &f32s(&[1.0, 0.0, 0.0, 0.0]))].concat();
        samples += decoder.samples(&xbus(MTDATA2, &payload), Time::from_ns(i64::from(n))).count();
    }
    let counters = decoder.counters();
    assert_eq!((samples, counters.packets, counters.other + counters.unusable), (0, 101, 101));
    assert!(counters.unusable > 90);
    assert_eq!(decoder.fields().missing(), ["acceleration"]);
}

proptest! {
    #[test]
    fn items_of_any_bytes_are_survived(payload in prop::collection::vec(any::<u8>(), 0..300)) {
        let (packets, counters) = parse(&xbus(MTDATA2, &payload));
        prop_assert!(packets.len() as u64 <= counters.packets);
        for packet in packets {
            XsensCodec::default().convert(&packet);
        }
    }
}
