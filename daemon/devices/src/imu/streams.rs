//! What units of each format would send of one and the same motion, for tests: encoders written from the manuals' tables by
//! matrices and axes, so that they share no turn with the decoders.

use bowwave_core::{event::ImuSample, time::Time};
use glam::{DMat3, DQuat, DVec3};

use super::ImuFormat;
use crate::vectornav::CommonOutput;

/// Standard gravity, m/s^2.
const G: f64 = 9.806_65;

/// Nanoseconds from one packet (or group of packets) to the next.
pub(crate) const fn period_ns(format: ImuFormat) -> i64 {
    match format {
        ImuFormat::Bno08x | ImuFormat::Witmotion => 10_000_000,
        _ => 5_000_000,
    }
}

/// Packets of one sample.
pub(crate) const fn packets(format: ImuFormat) -> u64 {
    match format {
        ImuFormat::Sbg => 2,
        ImuFormat::Witmotion => 5,
        _ => 1,
    }
}

fn attitude(t_s: f64) -> DQuat {
    DQuat::from_rotation_z(1.0 - 0.7 * (0.9 * t_s).sin())
        * DQuat::from_rotation_y(0.2 * (0.6 * t_s + 1.0).sin())
        * DQuat::from_rotation_x(std::f64::consts::PI + 0.3 * (0.8 * t_s).sin())
}

/// The true sample `n`: a gun on a ship, forces of gravity alone.
pub(crate) fn truth(format: ImuFormat, n: i64) -> ImuSample {
    let ns = n * period_ns(format);
    let (t_s, h) = (ns as f64 * 1e-9, 1e-4);
    let turn = attitude(t_s - h).inverse() * attitude(t_s + h);
    let turn = if turn.w < 0.0 { -turn } else { turn };
    ImuSample {
        arrival: Time::from_ns(1_000_000_000 + ns),
        device_time_ns: ns,
        rate: turn.to_scaled_axis() / (2.0 * h),
        accel: attitude(t_s).inverse() * (DVec3::Z * G),
        world_from_imu: Some(attitude(t_s)),
    }
}

/// What a unit of that format sends for [`truth`]'s sample `n`.
pub(crate) fn encode(format: ImuFormat, n: i64) -> Vec<u8> {
    send(format, &truth(format, n), n, false)
}

/// What a unit of that format sends for sample `n` of any motion. `by_angles`: units that choose between quaternion and Euler angles tell
/// the angles.
pub(crate) fn send(format: ImuFormat, s: &ImuSample, n: i64, by_angles: bool) -> Vec<u8> {
    // The body's axes in the world: forward, right, down as columns of east, north, up.
    let world = DMat3::from_quat(s.world_from_imu.unwrap_or(DQuat::IDENTITY));
    let mut bytes = Vec::new();
    match format {
        ImuFormat::VectorNav => {
            if let Some(output) = CommonOutput::from_sample(s) {
                output.encode(&mut bytes);
            }
        }
        ImuFormat::VectorNavAscii => bytes = vectornav_line(s, world),
        ImuFormat::Xsens => bytes = xsens(s, world, n),
        ImuFormat::MicroStrain => bytes = mip(s, world),
        ImuFormat::Sbg => bytes = sbg(s, world, by_angles),
        ImuFormat::Bno08x => bytes = rvc(s, world, n),
        ImuFormat::Witmotion => bytes = witmotion(s, world, by_angles),
    }
    bytes
}

/// Rows of north, east, down from rows of east, north, up.
fn ned(world: DMat3) -> DMat3 {
    let rows = world.transpose();
    DMat3::from_cols(rows.y_axis, rows.x_axis, -rows.z_axis).transpose()
}

/// Nearer to the pole than this the cosine of the elevation is all rounding, and yaw has what both turn by.
const POLE: f64 = 1e-9;

/// Yaw, pitch and roll of a matrix by the textbook's formulas for z, y, x.
fn yaw_pitch_roll(m: DMat3) -> [f64; 3] {
    let at = |row: usize, column: usize| m.col(column)[row];
    if at(2, 1).hypot(at(2, 2)) < POLE {
        return [(-at(0, 1)).atan2(at(1, 1)), (-at(2, 0)).clamp(-1.0, 1.0).asin(), 0.0];
    }
    [at(1, 0).atan2(at(0, 0)), (-at(2, 0)).clamp(-1.0, 1.0).asin(), at(2, 1).atan2(at(2, 2))]
}

fn vectornav_line(s: &ImuSample, world: DMat3) -> Vec<u8> {
    let [yaw, pitch, roll] = yaw_pitch_roll(ned(world)).map(f64::to_degrees);
    let (a, w) = (s.accel, s.rate);
    let body = format!(
        "VNYMR,{yaw:+08.3},{pitch:+08.3},{roll:+08.3},+00.1000,-00.2000,+00.3000,{:+07.3},{:+07.3},{:+07.3},\
         {:+010.6},{:+010.6},{:+010.6}",
        a.x, a.y, a.z, w.x, w.y, w.z
    );
    let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
    format!("${body}*{sum:02X}\r\n").into_bytes()
}

fn be(values: impl IntoIterator<Item = f64>) -> Vec<u8> {
    values.into_iter().flat_map(|v| (v as f32).to_be_bytes()).collect()
}

fn wxyz(q: DQuat) -> [f64; 4] {
    [q.w, q.x, q.y, q.z]
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

fn xsens(s: &ImuSample, world: DMat3, n: i64) -> Vec<u8> {
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

/// A packet of MicroStrain's.
pub(crate) fn mip_packet(set: u8, fields: &[(u8, Vec<u8>)]) -> Vec<u8> {
    let payload: Vec<u8> = fields
        .iter()
        .flat_map(|(descriptor, data)| [&[data.len() as u8 + 2, *descriptor], &data[..]].concat())
        .collect();
    let mut bytes = vec![0x75, 0x65, set, payload.len() as u8];
    bytes.extend(payload);
    let (mut a, mut b) = (0u8, 0u8);
    for &byte in &bytes {
        a = a.wrapping_add(byte);
        b = b.wrapping_add(a);
    }
    bytes.extend([a, b]);
    bytes
}

fn mip(s: &ImuSample, world: DMat3) -> Vec<u8> {
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

fn le(values: impl IntoIterator<Item = f64>) -> Vec<u8> {
    values.into_iter().flat_map(|v| (v as f32).to_le_bytes()).collect()
}

fn sbg(s: &ImuSample, world: DMat3, by_angles: bool) -> Vec<u8> {
    let time = ((s.device_time_ns / 1000) as u32).to_le_bytes();
    let motion =
        [&time[..], &[0xff, 0x01], &le(s.accel.to_array()), &le(s.rate.to_array()), &le([0.0; 7])].concat();
    let (log, numbers) = if by_angles {
        let [yaw, pitch, roll] = yaw_pitch_roll(ned(world));
        (6, le([roll, pitch, yaw]))
    } else {
        (7, le(wxyz(DQuat::from_mat3(&ned(world)))))
    };
    let attitude = [&time[..], &numbers, &le([0.01; 3]), &[0x32, 0, 0, 0]].concat();
    [sbg_frame(3, &motion), sbg_frame(log, &attitude)].concat()
}

fn i16s(values: [f64; 3]) -> Vec<u8> {
    values.iter().flat_map(|v| (v.round() as i16).to_le_bytes()).collect()
}

/// Right, forward, up.
fn rfu(world: DMat3) -> DMat3 {
    DMat3::from_cols(world.y_axis, world.x_axis, -world.z_axis)
}

fn rvc(s: &ImuSample, world: DMat3, n: i64) -> Vec<u8> {
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

/// A packet of Witmotion's.
pub(crate) fn witmotion_packet(kind: u8, data: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0x55, kind];
    bytes.extend(data);
    bytes.resize(10, 0);
    bytes.push(bytes.iter().fold(0u8, |sum, &b| sum.wrapping_add(b)));
    bytes
}

fn witmotion(s: &ImuSample, world: DMat3, by_angles: bool) -> Vec<u8> {
    let m = rfu(world);
    let [yaw, pitch, roll] = yaw_pitch_roll(m).map(f64::to_degrees);
    let part = |values: [f64; 3], full: f64| i16s(values.map(|v| v / full * 32_768.0));
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
