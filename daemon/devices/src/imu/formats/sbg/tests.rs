use bowwave_core::{estimate::clock::ClockMap, event::ImuSample, time::Time};
use glam::{DQuat, DVec3};
use proptest::prelude::*;

use super::*;
use crate::{
    framing::{LineCounters, Scanner},
    imu::{
        ImuDecoder, ImuFormat,
        streams::{FormatTolerance, SimulatedUnit, le, ned, world_of, wxyz, yaw_pitch_roll},
    },
};

impl SimulatedUnit for SbgCodec {
    const PACKETS: u64 = 2;
    // An attitude of its own log is carried over one period.
    const TOLERANCE: FormatTolerance =
        FormatTolerance { rate: 1e-6, accel: 2e-6, attitude: 2e-6, time_ns: 0 };

    fn send(s: &ImuSample, _: i64, by_angles: bool) -> Vec<u8> {
        let world = world_of(s);
        let time = ((s.device_time_ns / 1000) as u32).to_le_bytes();
        let motion =
            [&time[..], &[0xff, 0x01], &le(s.accel.to_array()), &le(s.rate.to_array()), &le([0.0; 7])]
                .concat();
        let (log, numbers) = if by_angles {
            let [yaw, pitch, roll] = yaw_pitch_roll(ned(world));
            (6, le([roll, pitch, yaw]))
        } else {
            (7, le(wxyz(DQuat::from_mat3(&ned(world)))))
        };
        let attitude = [&time[..], &numbers, &le([0.01; 3]), &[0x32, 0, 0, 0]].concat();
        [sbg_frame(3, &motion), sbg_frame(log, &attitude)].concat()
    }
}

/// A frame of SBG's own logs.
pub(crate) fn sbg_frame(message: u8, data: &[u8]) -> Vec<u8> {
    let mut body = vec![message, 0];
    body.extend((data.len() as u16).to_le_bytes());
    body.extend(data);
    let crc = body.iter().fold(0u16, |crc, &byte| {
        (0..8).fold(crc ^ u16::from(byte), |c, _| if c & 1 == 1 { (c >> 1) ^ 0x8408 } else { c >> 1 })
    });
    [&[0xff, 0x5a][..], &body, &crc.to_le_bytes(), &[0x33]].concat()
}

fn parse(stream: &[u8]) -> (Vec<SbgLog>, LineCounters) {
    Scanner::<SbgCodec>::parsed(stream, SbgLog::parse)
}

/// Check value of CRC-16/KERMIT in the CRC catalogue of Greg Cook.
#[test]
fn the_check_sum_matches_the_catalogue() {
    assert_eq!(CRC.checksum(b"123456789"), 0x2189);
}

fn f32s(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn imu_data(time_us: u32, accel: [f32; 3], rate: [f32; 3]) -> Vec<u8> {
    let data = [&time_us.to_le_bytes()[..], &[0, 0], &f32s(&accel), &f32s(&rate), &f32s(&[0.0; 7])].concat();
    assert_eq!(data.len(), 58, "as the manual's table");
    sbg_frame(3, &data)
}

fn quaternion(time_us: u32, wxyz: [f32; 4], mode: u8) -> Vec<u8> {
    let data = [&time_us.to_le_bytes()[..], &f32s(&wxyz), &f32s(&[0.1; 3]), &[mode, 0, 0, 0]].concat();
    assert_eq!(data.len(), 36, "as the manual's table");
    sbg_frame(7, &data)
}

fn euler(time_us: u32, angles: [f32; 3], mode: u8) -> Vec<u8> {
    let data = [&time_us.to_le_bytes()[..], &f32s(&angles), &f32s(&[0.1; 3]), &[mode, 0, 0, 0]].concat();
    assert_eq!(data.len(), 32, "as the manual's table");
    sbg_frame(6, &data)
}

fn short(status: u16, accel: [i32; 3], rate: [i32; 3]) -> Vec<u8> {
    let ints = accel.iter().chain(&rate).flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>();
    sbg_frame(44, &[&9u32.to_le_bytes()[..], &status.to_le_bytes(), &ints, &[0, 0]].concat())
}

#[test]
fn logs_are_read_by_the_manuals_tables() {
    let stream = [
        imu_data(7, [1.0, 2.0, -9.5], [0.25, -0.5, 4.0]),
        short(0, [1 << 20, 0, -(9 << 20)], [1 << 26, -(1 << 25), 0]),
        short(1 << 10, [0; 3], [12_304_174, 0, 0]),
        euler(8, [0.5, 0.25, -1.0], 2),
        quaternion(9, [1.0, 0.0, 0.0, 0.0], 4),
        // Not started, another log, another class, and one too short.
        quaternion(10, [1.0, 0.0, 0.0, 0.0], 0xf0),
        sbg_frame(1, &[0; 22]),
        sbg_frame(3, &[0; 20]),
    ];
    let (logs, counters) = parse(&stream.concat());
    assert_eq!((counters.packets, counters.bad_crc, counters.skipped_bytes), (8, 0, 0));
    let motion = |time_us, accel, rate| SbgLog::Motion { time_us, accel, rate };
    assert_eq!(
        logs,
        [
            motion(7, [1.0, 2.0, -9.5], [0.25, -0.5, 4.0]),
            motion(9, [1.0, 0.0, -9.0], [1.0, -0.5, 0.0]),
            motion(9, [0.0; 3], [1.0, 0.0, 0.0]),
            SbgLog::Euler { time_us: 8, roll_pitch_yaw: [0.5, 0.25, -1.0] },
            SbgLog::Quaternion { time_us: 9, wxyz: [1.0, 0.0, 0.0, 0.0] },
        ]
    );
}

#[test]
fn axes_and_the_choice_of_attitude() {
    let mut unit = SbgCodec::default();
    let mut attitude =
        |frame: &[u8]| unit.convert(&parse(frame).0[0]).map(|r| r.world_from_imu.expect("given"));
    let east = std::f32::consts::FRAC_PI_2;
    let angles = attitude(&euler(1, [0.0, 0.0, east], 2)).expect("angles alone");
    assert!((angles * DVec3::X).abs_diff_eq(DVec3::X, 1e-6), "yaw of 90 degrees looks east");
    assert!((angles * DVec3::Z).abs_diff_eq(DVec3::NEG_Z, 1e-6));
    let nose_up = attitude(&euler(1, [0.0, 0.5, 0.0], 2)).expect("angles alone");
    assert!((nose_up * DVec3::X).z > 0.4);
    let north = attitude(&quaternion(2, [1.0, 0.0, 0.0, 0.0], 2)).expect("a quaternion");
    assert!((north * DVec3::X).abs_diff_eq(DVec3::Y, 1e-6) && (north * DVec3::Y).abs_diff_eq(DVec3::X, 1e-6));
    assert_eq!(attitude(&euler(3, [0.0; 3], 2)), None, "angles beside quaternions say nothing new");
}

/// The clock of 32 bits of microseconds wraps in 71.6 minutes; later the unit begins anew.
#[test]
fn the_clock_goes_on_where_it_wraps_and_back_where_the_unit_begins_anew() {
    let mut decoder = ImuDecoder::fixed(ImuFormat::Sbg);
    let mut map = ClockMap::new();
    let mut times = Vec::new();
    for n in 0..2_000u32 {
        let time_us =
            if n < 1_500 { (u32::MAX - 999_999).wrapping_add(n * 5_000) } else { (n - 1_500) * 5_000 };
        let arrival = Time::from_ns(i64::from(n) * 5_000_000);
        for s in decoder.samples(&imu_data(time_us, [0.0, 0.0, -9.8], [0.0, 0.0, n as f32]), arrival) {
            map.observe(s.device_time_ns, arrival);
            times.push(s.device_time_ns);
        }
        assert_eq!(map.restarts(), u32::from(n >= 1_500), "frame {n}");
    }
    assert!(times[..1_500].windows(2).all(|w| w[1] - w[0] == 5_000_000));
    assert!(times[1_500] < times[1_499]);
}

#[test]
fn lengths_beyond_the_protocol_are_refused_and_long_ones_hold_nothing_back() {
    let good = [imu_data(1, [0.0; 3], [0.0; 3]), imu_data(2, [0.0; 3], [0.0; 3])].concat();
    for claimed in [4_086u16, 4_087, 65_535, 3_000] {
        let stream = [&[0xff, 0x5a, 3, 0][..], &claimed.to_le_bytes(), &good].concat();
        let (logs, counters) = parse(&stream);
        assert_eq!((logs.len(), counters.skipped_bytes), (2, 6), "{claimed} bytes claimed");
    }
    let longest = sbg_frame(3, &[0; 4_086]);
    assert_eq!(parse(&longest).1.packets, 1);
    assert_eq!(longest.len(), SbgCodec::MAX_BYTES);
    let mut unended = imu_data(1, [0.0; 3], [0.0; 3]);
    if let Some(end) = unended.last_mut() {
        *end = 0x34;
    }
    assert_eq!(parse(&unended).1.packets, 0);
}

proptest! {
    #[test]
    fn logs_of_any_bytes_are_survived(message in any::<u8>(), data in prop::collection::vec(any::<u8>(), 0..80)) {
        let (logs, counters) = parse(&sbg_frame(message, &data));
        prop_assert_eq!(counters.packets, 1);
        for log in logs {
            SbgCodec::default().convert(&log);
        }
    }
}
