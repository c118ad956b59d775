use bowwave_core::{event::ImuSample, time::Time};
use glam::{DQuat, DVec3};
use proptest::prelude::*;

use super::{CRC, CommonOutput, VectorNavCodec, VectorNavPacket, layout::MAX_PACKET};
use crate::{
    framing::{CHUNK, Framing as _, PacketLook, Scanner, intact_places},
    imu::streams::{SimulatedUnit, recording},
};

impl SimulatedUnit for VectorNavCodec {
    fn send(s: &ImuSample, _: i64, _: bool) -> Vec<u8> {
        let mut bytes = Vec::new();
        if let Some(output) = CommonOutput::from_sample(s) {
            output.encode(&mut bytes);
        }
        bytes
    }
}

/// Check value of CRC-16/XMODEM (same polynomial, start and order) in the CRC catalogue of Greg Cook.
#[test]
fn the_check_sum_matches_the_catalogue() {
    assert_eq!(CRC.checksum(b"123456789"), 0x31c3);
}

#[test]
fn the_check_sum_is_zero_over_data_and_itself() {
    let mut bytes = vec![0x01, 0x29, 0x01, 0xfa, 0x00];
    bytes.extend(CRC.checksum(&bytes).to_be_bytes());
    assert_eq!(CRC.checksum(&bytes), 0);
}

/// A scanner of the binary output, as its lines' scanner.
type BinaryScanner = Scanner<VectorNavCodec>;

/// Takes `bytes` in; the packets that they complete.
fn pull(scanner: &mut BinaryScanner, mut bytes: &[u8]) -> Vec<VectorNavPacket> {
    let mut packets = Vec::new();
    while let Some(found) = scanner.next_of(&mut bytes) {
        packets.push(VectorNavPacket::decode(found.bytes, &found.head));
    }
    packets
}

fn parse(bytes: &[u8]) -> (Vec<VectorNavPacket>, BinaryScanner) {
    parse_split(bytes, bytes.len().max(1))
}

fn parse_split(bytes: &[u8], piece: usize) -> (Vec<VectorNavPacket>, BinaryScanner) {
    let mut scanner = Scanner::new();
    let packets = bytes.chunks(piece).flat_map(|piece| pull(&mut scanner, piece)).collect();
    (packets, scanner)
}

/// The n-th of a series of distinct packets; every fourth lacks the attitude, as a second output of the unit would.
fn output(n: u32) -> CommonOutput {
    let v = n as f32;
    CommonOutput {
        time_startup_ns: u64::from(n) * 5_000_000,
        quaternion: (n % 4 != 3).then_some([0.5, -0.5, 0.5, 0.5]),
        angular_rate: [v, -v, 0.25 * v],
        accel: [0.1, v, -9.8],
    }
}

fn stream(range: std::ops::Range<u32>) -> Vec<u8> {
    let mut bytes = Vec::new();
    for n in range {
        output(n).encode(&mut bytes);
    }
    bytes
}

fn times(packets: &[VectorNavPacket]) -> Vec<u64> {
    packets.iter().filter_map(|p| p.time_startup_ns).map(|t| t / 5_000_000).collect()
}

#[test]
fn encoded_packets_come_back_whole() {
    let (packets, scanner) = parse(&stream(0..100));
    assert_eq!(packets.len(), 100);
    for (n, packet) in packets.iter().enumerate() {
        let sent = output(n as u32);
        assert_eq!(packet.time_startup_ns, Some(sent.time_startup_ns));
        assert_eq!(packet.quaternion, sent.quaternion);
        assert_eq!(packet.angular_rate, Some(sent.angular_rate));
        assert_eq!(packet.accel, Some(sent.accel));
    }
    assert_eq!((scanner.counters().bad_crc, scanner.counters().skipped_bytes), (0, 0));
}

#[test]
fn every_place_to_split_a_packet_is_fine() {
    let bytes = stream(0..6);
    for piece in 1..=bytes.len() {
        let (packets, scanner) = parse_split(&bytes, piece);
        assert_eq!(times(&packets), [0, 1, 2, 3, 4, 5], "pieces of {piece}");
        assert_eq!(scanner.counters().skipped_bytes, 0);
    }
}

#[test]
fn a_damaged_packet_costs_only_itself() {
    let clean = stream(0..6);
    let second = CommonOutput::MAX_BYTES;
    for at in second..2 * second {
        let mut bytes = clean.clone();
        bytes[at] ^= 0x55;
        // A damaged mask can claim a longer packet; a live line then goes on.
        let (packets, scanner) = parse(&bytes);
        assert_eq!(times(&packets), [0, 2, 3, 4, 5], "byte {at}");
        assert_eq!(scanner.counters().skipped_bytes, second as u64);
    }
}

/// A preamble that claims 600 bytes must not hold back the packets behind it once the line's layout is known.
#[test]
fn a_long_false_preamble_holds_back_no_more_than_one_packet() {
    let long = [0xfa, 0x21, 0xff, 0x7f, 0xff, 0x03];
    let mut scanner = BinaryScanner::new();
    let mut got = Vec::new();
    got.extend(pull(&mut scanner, &stream(0..1)));
    got.extend(pull(&mut scanner, &long));
    got.extend(pull(&mut scanner, &stream(1..2)));
    got.extend(pull(&mut scanner, &stream(2..3)));
    assert_eq!(times(&got), [0, 1, 2]);
    assert_eq!(scanner.counters().skipped_bytes, long.len() as u64);
}

#[test]
fn a_packet_cut_by_the_next_costs_only_itself() {
    let whole = stream(0..1);
    for cut in 1..whole.len() {
        let mut bytes = stream(0..2);
        bytes.extend(&whole[..cut]);
        bytes.extend(stream(4..8));
        let (packets, _) = parse(&bytes);
        assert_eq!(times(&packets), [0, 1, 4, 5, 6, 7], "cut after {cut} bytes");
    }
}

/// A false preamble of a kind that the line does not send, which its check sum happens to fit, is none where a packet lies within.
#[test]
fn a_chance_packet_costs_none_within_it_however_the_bytes_come() {
    let mut bytes = stream(0..2);
    let chance = bytes.len();
    bytes.extend([0xfa, 0x05, 0x31, 0x01, 0x01, 0x02]);
    bytes.extend(stream(2..4));
    let PacketLook::Packet { bytes: length, .. } = VectorNavCodec::look(&bytes[chance..]) else {
        panic!("a header")
    };
    bytes.truncate(chance + length - 2);
    let crc = CRC.checksum(&bytes[chance + 1..]);
    bytes.extend(crc.to_be_bytes());
    bytes.extend(stream(4..6));
    assert_eq!(
        intact_places::<VectorNavCodec>(&bytes).len(),
        6,
        "real ones, less the one cut, and the chance"
    );
    for piece in 1..=bytes.len() {
        assert_eq!(times(&parse_split(&bytes, piece).0), [0, 1, 2, 4, 5], "pieces of {piece}");
    }
}

#[test]
fn a_level_unit_that_faces_north_is_level_and_faces_north() {
    let packet = VectorNavPacket {
        time_startup_ns: Some(1),
        quaternion: Some([0.0, 0.0, 0.0, 1.0]),
        angular_rate: Some([0.0; 3]),
        accel: Some([0.0, 0.0, -9.81]),
        ..VectorNavPacket::default()
    };
    let sample = packet.to_sample(Time::from_ns(7)).expect("complete");
    let attitude = sample.world_from_imu.expect("given");
    assert!((attitude * DVec3::X).abs_diff_eq(DVec3::Y, 1e-12), "forward is north");
    assert!((attitude * DVec3::Y).abs_diff_eq(DVec3::X, 1e-12), "right is east");
    assert!((attitude * DVec3::Z).abs_diff_eq(DVec3::NEG_Z, 1e-12), "down is down");
    assert!((attitude * sample.accel).z > 9.8, "the force felt at rest is upwards");
    // 90 degrees of yaw turn the nose to the east; pitch lifts it; roll lowers the right side.
    let turned = |ypr: [f32; 3]| {
        let packet = VectorNavPacket { quaternion: None, yaw_pitch_roll_deg: Some(ypr), ..packet };
        packet.to_sample(Time::MIN).and_then(|s| s.world_from_imu).expect("given")
    };
    assert!((turned([90.0, 0.0, 0.0]) * DVec3::X).abs_diff_eq(DVec3::X, 1e-7));
    assert!((turned([0.0, 30.0, 0.0]) * DVec3::X).z > 0.49);
    assert!((turned([0.0, 0.0, 30.0]) * DVec3::Y).z < -0.49);
}

#[test]
fn packets_without_what_a_sample_needs_give_none() {
    let whole = VectorNavPacket {
        time_startup_ns: Some(1),
        angular_rate: Some([0.0; 3]),
        accel: Some([0.0; 3]),
        ..VectorNavPacket::default()
    };
    assert!(whole.to_sample(Time::MIN).is_some());
    for lacking in [
        VectorNavPacket { time_startup_ns: None, ..whole },
        VectorNavPacket { time_startup_ns: Some(u64::MAX), ..whole },
        VectorNavPacket { angular_rate: None, ..whole },
        VectorNavPacket { accel: None, ..whole },
    ] {
        assert_eq!(lacking.to_sample(Time::MIN), None);
    }
}

/// Bytes with many sync bytes, group bytes and masks, so that false preambles are common.
fn garbage() -> impl Strategy<Value = Vec<u8>> {
    let byte =
        prop_oneof![4 => any::<u8>(), 2 => Just(0xfa), 2 => Just(0x01), 1 => Just(0x29), 1 => Just(0x14)];
    prop::collection::vec(byte, 0..120)
}

proptest! {
    #[test]
    fn any_bytes_are_survived_in_bounded_memory(bytes in prop::collection::vec(garbage(), 0..40), piece in 1usize..2000) {
        let bytes = bytes.concat();
        let (packets, scanner) = parse_split(&bytes, piece);
        let c = scanner.counters();
        prop_assert_eq!(packets.len() as u64, c.packets);
        prop_assert!(c.skipped_bytes <= bytes.len() as u64);
        let (bytes, memory) = scanner.held();
        prop_assert!(bytes < MAX_PACKET);
        prop_assert!(memory <= 2 * (MAX_PACKET + CHUNK));
    }

    /// Whatever lies between them, every packet is found, in order and once; none is invented.
    #[test]
    fn garbage_between_packets_loses_none(gaps in prop::collection::vec(garbage(), 1..20), piece in 1usize..400) {
        let (mut bytes, mut starts) = (Vec::new(), Vec::new());
        for (n, gap) in (0..).zip(&gaps) {
            bytes.extend(gap);
            starts.push(bytes.len());
            output(n).encode(&mut bytes);
        }
        let sent = gaps.len() as u64;
        // The line goes silent with text, which ends a last false preamble.
        bytes.extend([0x20; MAX_PACKET]);
        // Of false preambles one in 65536 is followed by what its check sum fits: such a packet is found as well, and rightly.
        prop_assume!(intact_places::<VectorNavCodec>(&bytes) == starts);
        let (packets, scanner) = parse_split(&bytes, piece);
        prop_assert_eq!(times(&packets), (0..sent).collect::<Vec<_>>());
        let garbage: usize = gaps.iter().map(Vec::len).sum();
        prop_assert_eq!(scanner.counters().skipped_bytes, (garbage + MAX_PACKET) as u64);
    }

    /// How the bytes are cut into reads changes nothing.
    #[test]
    fn pieces_do_not_matter(gaps in prop::collection::vec(garbage(), 1..8), piece in 1usize..64) {
        let mut bytes = stream(0..1);
        for (n, gap) in (1..).zip(&gaps) {
            bytes.extend(gap);
            output(n).encode(&mut bytes);
        }
        let (pieces, _) = parse_split(&bytes, piece);
        let (whole, _) = parse(&bytes);
        // As text, for a chance packet may hold what is no number, which equals nothing.
        prop_assert_eq!(format!("{pieces:?}"), format!("{whole:?}"));
    }

    /// After garbage on a line whose layout is known, at most the first packet waits for the second.
    #[test]
    fn back_in_step_within_two_packets(gap in garbage()) {
        let line = [stream(0..3), gap.clone(), stream(4..7)].concat();
        prop_assume!(intact_places::<VectorNavCodec>(&line).len() == 6);
        let mut scanner = BinaryScanner::new();
        let mut got = Vec::new();
        for n in 0..3 {
            got.extend(pull(&mut scanner, &stream(n..n + 1)));
        }
        got.extend(pull(&mut scanner, &gap));
        // Packets 4 to 6 have the layout of packet 2.
        got.extend(pull(&mut scanner, &stream(4..5)));
        got.extend(pull(&mut scanner, &stream(5..6)));
        prop_assert!(times(&got).starts_with(&[0, 1, 2, 4]), "{:?}", times(&got));
        got.extend(pull(&mut scanner, &stream(6..7)));
        prop_assert!(times(&got).starts_with(&[0, 1, 2, 4, 5]), "{:?}", times(&got));
    }

    /// A sample survives the wire to the precision of its floats.
    #[test]
    fn samples_survive_the_wire(
        time in 0i64..1 << 62,
        rate in prop::array::uniform3(-35.0f64..35.0),
        accel in prop::array::uniform3(-160.0f64..160.0),
        axis in prop::array::uniform3(-1.0f64..1.0),
        angle in 0.0f64..std::f64::consts::TAU,
        attitude in any::<bool>(),
    ) {
        let axis = DVec3::from_array(axis).try_normalize().unwrap_or(DVec3::X);
        let sent = ImuSample {
            arrival: Time::from_ns(11),
            device_time_ns: time,
            rate: DVec3::from_array(rate),
            accel: DVec3::from_array(accel),
            world_from_imu: attitude.then(|| DQuat::from_axis_angle(axis, angle)),
        };
        let mut bytes = Vec::new();
        CommonOutput::from_sample(&sent).expect("after start-up").encode(&mut bytes);
        prop_assert!(bytes.len() <= CommonOutput::MAX_BYTES);
        let (packets, _) = parse(&bytes);
        prop_assert_eq!(packets.len(), 1);
        let got = packets[0].to_sample(sent.arrival).expect("complete");
        prop_assert_eq!(got.arrival, sent.arrival);
        prop_assert_eq!(got.device_time_ns, sent.device_time_ns);
        prop_assert!(got.rate.abs_diff_eq(sent.rate, 4e-6));
        prop_assert!(got.accel.abs_diff_eq(sent.accel, 2e-5));
        prop_assert_eq!(got.world_from_imu.is_some(), attitude);
        if let (Some(a), Some(b)) = (got.world_from_imu, sent.world_from_imu) {
            prop_assert!(a.angle_between(b) < 1e-6, "{a} {b}");
            prop_assert!((a.length() - 1.0).abs() < 1e-12);
        }
    }

    /// Every field of every fixed length is stepped over: the fields behind it are read from the right place.
    #[test]
    fn fields_behind_skipped_ones_are_found(
        common in 0u16..0x8000,
        imu in 0u16..0x0800,
        payload in prop::collection::vec(any::<u8>(), 512),
    ) {
        let common = common & !(1 << 3) | 1 << 4;
        let imu = imu | 1 << 5;
        let mut bytes = vec![0xfa, 0x05];
        bytes.extend(common.to_le_bytes());
        bytes.extend(imu.to_le_bytes());
        // Lengths written out by kind (time, three floats, ...) rather than taken from the table under test.
        let sum = |mask: u16, kinds: &[(u16, usize)]| -> usize {
            kinds.iter().map(|(bits, len)| (mask & bits).count_ones() as usize * len).sum()
        };
        let before = sum(common & 0x000f, &[(0b0111, 8), (0b1000, 12)]);
        let common_len = before + 16 + sum(common & 0x7fe0, &[
            (1 << 5 | 1 << 7 | 1 << 8, 12), (1 << 6 | 1 << 9, 24), (1 << 10, 20), (1 << 11, 28), (1 << 12, 2),
            (1 << 13, 4), (1 << 14, 8),
        ]);
        let imu_before = sum(imu & 0x001f, &[(1, 2), (0b1110, 12), (1 << 4, 4)]);
        let imu_len = imu_before + 4 + sum(imu & 0x07c0, &[(1 << 6, 16), (0x0780, 12)]);
        let payload = &payload[..common_len + imu_len];
        bytes.extend(payload);
        let crc = CRC.checksum(&bytes[1..]);
        bytes.extend(crc.to_be_bytes());
        let (packets, _) = parse(&bytes);
        prop_assert_eq!(packets.len(), 1);
        let float = |at: usize| u32::from_le_bytes(payload[at..at + 4].try_into().expect("four bytes"));
        let quaternion = packets[0].quaternion.expect("in the mask").map(f32::to_bits);
        prop_assert_eq!(quaternion, [0, 4, 8, 12].map(|i| float(before + i)));
        let pressure = packets[0].pressure_kpa.expect("in the mask").to_bits();
        prop_assert_eq!(pressure, float(common_len + imu_before));
    }
}

/// The recorded stream of a real VN-100 with text of a GNSS receiver mixed in, and what its authors decoded from it.
fn recorded(bytes: &str, decoded: &str) -> Option<(Vec<u8>, Vec<Vec<f32>>)> {
    let of = |name: &str| recording(&format!("vectornav_vn100/{name}"));
    let (bytes, decoded) = (of(bytes)?, String::from_utf8(of(decoded)?).expect("text"));
    let rows =
        decoded.lines().skip(1).map(|line| line.split(',').filter_map(|v| v.trim().parse().ok()).collect());
    Some((bytes, rows.collect()))
}

fn row(p: &VectorNavPacket) -> Option<Vec<f32>> {
    let mut row = Vec::new();
    row.extend(p.raw_mag?);
    row.extend(p.raw_accel?);
    row.extend(p.raw_rate?);
    row.extend([p.temperature_c?, p.pressure_kpa?]);
    row.extend(p.yaw_pitch_roll_deg?);
    row.extend(p.dcm?);
    row.extend(p.mag_ned?);
    row.extend(p.accel_ned?);
    Some(row)
}

/// How many packets the authors decoded to the same numbers (printed with seven digits), in the same order.
fn equal_to_authors(packets: &[VectorNavPacket], authors: &[Vec<f32>]) -> usize {
    let mut next = 0;
    let mut matched = 0;
    for packet in packets {
        let got = row(packet).expect("the stream has one layout");
        let close = |want: &Vec<f32>| want.iter().zip(&got).all(|(w, g)| (w - g).abs() <= 2e-6 * w.abs());
        // Either side may lack a few packets.
        if let Some(ahead) = authors[next..].iter().take(5).position(close) {
            next += ahead + 1;
            matched += 1;
        }
    }
    matched
}

#[test]
fn a_real_unit_is_decoded_as_its_authors_did() {
    for (bytes, decoded) in
        [("F00294", "F00294_B"), ("F00379_first_400000_bytes", "F00379_B_first_2400_lines")]
    {
        let Some((bytes, decoded)) = recorded(bytes, decoded) else { return };
        let (packets, scanner) = parse_split(&bytes, 61);
        let c = scanner.counters();
        let authors: Vec<_> = decoded.into_iter().filter(|row| row.len() == 29).collect();
        let equal = equal_to_authors(&packets, &authors);
        eprintln!("{c:?}, the authors decoded {}, equal {equal}", authors.len());
        assert!(equal > 90);
        assert_eq!(equal, packets.len().min(authors.len()));
    }
}

/// The unit's own matrix is a check of our reading of its angles, and gravity one of the way into our world.
#[test]
fn the_real_unit_feels_gravity_upwards_in_our_world() {
    let Some((bytes, _)) = recorded("F00294", "F00294_B") else { return };
    let (packets, _) = parse(&bytes);
    for packet in packets {
        let dated = VectorNavPacket { time_startup_ns: Some(0), ..packet };
        let sample = dated.to_sample(Time::MIN).expect("raw rate and acceleration are there");
        let attitude = sample.world_from_imu.expect("yaw, pitch and roll are there");
        let up = attitude * sample.accel;
        assert!((9.5..10.1).contains(&up.z) && up.truncate().length() < 0.3, "{up}");
        let forward = attitude * DVec3::X;
        let dcm = packet.dcm.expect("there").map(f64::from);
        // First column: the body's x axis in north, east, down.
        assert!(forward.abs_diff_eq(DVec3::new(dcm[3], dcm[0], -dcm[6]), 1e-5), "{forward} {dcm:?}");
    }
}
