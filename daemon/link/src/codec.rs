//! Messages as bytes.

use std::io::{self, Read, Write};

use serde::{Deserialize, Serialize, de::DeserializeOwned};

use crate::message::{FromDaemon, Hello, Picture, Status, ToDaemon};

/// Most bytes of a message to the trainer: a scenario of the greatest length, and its names.
pub const DAEMON_BYTES_MAX: usize = (1 << 20) + (64 << 10);
/// Most bytes of a message from the trainer that is no picture: 64 boats and all devices are a fiftieth of it.
pub const INSTRUCTOR_BYTES_MAX: usize = 1 << 20;
/// Most bytes of a picture: one of 4096 x 2160.
pub const PICTURE_BYTES_MAX: usize = 36 << 20;

const MESSAGE: u8 = 0;
const PICTURE: u8 = 1;
/// Deepest that lists and maps lie in each other: a status, its boats, a boat. For each one that only claims to be long up to a mebibyte is
/// taken, so no more are gone into.
const DEPTH_MAX: usize = 8;
/// Bytes before a picture's pixels: its number, its time, width and height.
const PICTURE_HEADER: usize = 8 + 8 + 4 + 4;

/// A message that cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The other side is gone, or does not answer in time.
    #[error("the other side of the socket: {0}")]
    Io(#[from] io::Error),
    /// The other side has closed the socket between two messages.
    #[error("the other side has closed the socket")]
    Closed,
    /// A message is longer than any can be.
    #[error("a message of kind {kind} and {bytes} bytes, where {most} are the most")]
    TooLong {
        /// Its kind.
        kind: u8,
        /// Bytes that it says it has.
        bytes: usize,
        /// Bytes that it may have.
        most: usize,
    },
    /// A message of a kind that there is not.
    #[error("a message of kind {0}, which there is not")]
    Kind(u8),
    /// Content that is none of the protocol's messages.
    #[error("a message that is none of this version's: {0}")]
    Content(String),
}

/// Messages of the trainer that are no pictures.
#[derive(Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
enum Told {
    Hello { hello: Hello },
    Status { status: Box<Status> },
    Refused { why: String },
}

/// Reads a message to the trainer. Blocks until one is there.
///
/// # Errors
/// Where the socket fails or is closed, or what comes is no message. Nothing further can be read then.
pub fn read_to_daemon(from: &mut impl Read) -> Result<ToDaemon, LinkError> {
    let (kind, length) = header(from)?;
    match kind {
        MESSAGE => content(&bytes(from, kind, length, DAEMON_BYTES_MAX)?),
        other => Err(LinkError::Kind(other)),
    }
}

/// Writes a message to the trainer.
///
/// # Errors
/// Where the socket fails, or the message is too long.
pub fn write_to_daemon(to: &mut impl Write, message: &ToDaemon) -> Result<(), LinkError> {
    write_message(to, message, DAEMON_BYTES_MAX)
}

/// Reads a message from the trainer. Blocks until one is there.
///
/// # Errors
/// As [`read_to_daemon`].
pub fn read_from_daemon(from: &mut impl Read) -> Result<FromDaemon, LinkError> {
    let (kind, length) = header(from)?;
    match kind {
        MESSAGE => Ok(match content(&bytes(from, kind, length, INSTRUCTOR_BYTES_MAX)?)? {
            Told::Hello { hello } => FromDaemon::Hello(hello),
            Told::Status { status } => FromDaemon::Status(status),
            Told::Refused { why } => FromDaemon::Refused(why),
        }),
        PICTURE => picture(&bytes(from, kind, length, PICTURE_BYTES_MAX)?).map(FromDaemon::Picture),
        other => Err(LinkError::Kind(other)),
    }
}

/// Writes a message from the trainer.
///
/// # Errors
/// Where the socket fails, or the message is too long.
pub fn write_from_daemon(to: &mut impl Write, message: FromDaemon) -> Result<(), LinkError> {
    let told = match message {
        FromDaemon::Hello(hello) => Told::Hello { hello },
        FromDaemon::Status(status) => Told::Status { status },
        FromDaemon::Refused(why) => Told::Refused { why },
        FromDaemon::Picture(picture) => return write_picture(to, &picture),
    };
    write_message(to, &told, INSTRUCTOR_BYTES_MAX)
}

/// Writes a picture from the trainer. Its pixels are not copied.
///
/// # Errors
/// Where the socket fails, or the picture is too large.
pub fn write_picture(to: &mut impl Write, picture: &Picture) -> Result<(), LinkError> {
    let Picture { frame, complete_ns, width, height, rgba } = picture;
    let length = PICTURE_HEADER + rgba.len();
    write_header(to, PICTURE, length, PICTURE_BYTES_MAX)?;
    to.write_all(&frame.to_le_bytes())?;
    to.write_all(&complete_ns.to_le_bytes())?;
    to.write_all(&width.to_le_bytes())?;
    to.write_all(&height.to_le_bytes())?;
    to.write_all(rgba)?;
    Ok(to.flush()?)
}

fn write_message(to: &mut impl Write, message: &impl Serialize, most: usize) -> Result<(), LinkError> {
    let content = rmp_serde::to_vec_named(message).map_err(|e| LinkError::Content(e.to_string()))?;
    write_header(to, MESSAGE, content.len(), most)?;
    to.write_all(&content)?;
    Ok(to.flush()?)
}

fn write_header(to: &mut impl Write, kind: u8, length: usize, most: usize) -> Result<(), LinkError> {
    let too_long = || LinkError::TooLong { kind, bytes: length, most };
    let length = u32::try_from(length).ok().filter(|_| length <= most).ok_or_else(too_long)?;
    let [a, b, c, d] = length.to_le_bytes();
    Ok(to.write_all(&[a, b, c, d, kind])?)
}

/// The kind and the length of the next message.
fn header(from: &mut impl Read) -> Result<(u8, usize), LinkError> {
    let mut header = [0; 5];
    let [first, rest @ ..] = &mut header;
    match from.read_exact(std::slice::from_mut(first)) {
        Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => return Err(LinkError::Closed),
        read => read?,
    }
    from.read_exact(rest)?;
    let [a, b, c, d, kind] = header;
    Ok((kind, u32::from_le_bytes([a, b, c, d]) as usize))
}

/// Content of that length: memory grows with what has come, not with what was said.
fn bytes(from: &mut impl Read, kind: u8, length: usize, most: usize) -> Result<Vec<u8>, LinkError> {
    if length > most {
        return Err(LinkError::TooLong { kind, bytes: length, most });
    }
    let mut content = Vec::new();
    from.by_ref().take(length as u64).read_to_end(&mut content)?;
    if content.len() < length {
        return Err(LinkError::Io(io::ErrorKind::UnexpectedEof.into()));
    }
    Ok(content)
}

fn content<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, LinkError> {
    let mut from = rmp_serde::Deserializer::from_read_ref(bytes);
    from.set_max_depth(DEPTH_MAX);
    T::deserialize(&mut from).map_err(|e| LinkError::Content(e.to_string()))
}

fn picture(bytes: &[u8]) -> Result<Picture, LinkError> {
    let no_picture = || LinkError::Content("a picture whose bytes are not those of its size".to_owned());
    let (frame, rest) = bytes.split_first_chunk().ok_or_else(no_picture)?;
    let (complete_ns, rest) = rest.split_first_chunk().ok_or_else(no_picture)?;
    let (width, rest) = rest.split_first_chunk().ok_or_else(no_picture)?;
    let (height, rgba) = rest.split_first_chunk().ok_or_else(no_picture)?;
    let (width, height) = (u32::from_le_bytes(*width), u32::from_le_bytes(*height));
    let expected = u64::from(width).checked_mul(u64::from(height)).and_then(|pixels| pixels.checked_mul(4));
    if expected != Some(rgba.len() as u64) || rgba.is_empty() {
        return Err(no_picture());
    }
    Ok(Picture {
        frame: u64::from_le_bytes(*frame),
        complete_ns: i64::from_le_bytes(*complete_ns),
        width,
        height,
        rgba: rgba.to_vec(),
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

    use bowwave_core::{
        act::Act,
        engagement::Engagement,
        order::{JoinPlace, Order},
    };
    use proptest::prelude::*;

    use super::*;
    use crate::message::{BoatState, DeviceLevel, DeviceState, GunState, VERSION};

    fn to_daemon() -> Vec<ToDaemon> {
        let join = Order::Join {
            boat: "skiff-3".to_owned(),
            at: Some(JoinPlace { bearing_deg: 12.5, range_m: 900.0 }),
        };
        let orders = [
            Order::Rules { rules: Engagement::Tight },
            Order::Stoppage,
            Order::Message { text: "CEASE FIRE".to_owned() },
            Order::Note { text: "good lead".to_owned() },
            join,
            Order::Pause,
            Order::Resume,
        ];
        let mut all = vec![
            ToDaemon::Hello { hello: Hello::new("0.1.0") },
            ToDaemon::Picture,
            ToDaemon::Load { origin: "two-skiffs.toml".to_owned(), scenario: "name = \"x\"".to_owned() },
            ToDaemon::StandBy,
        ];
        all.extend(orders.map(|order| ToDaemon::Order { order }));
        all.extend(Act::ALL.map(|act| ToDaemon::Act { act }));
        all
    }

    fn from_daemon() -> Vec<FromDaemon> {
        let boat = BoatState {
            name: "skiff-1".to_owned(),
            side: "hostile".to_owned(),
            east_m: 1.5,
            north_m: -20.25,
            heading_deg: 359.0,
            speed_m_s: 12.0,
            swims: true,
            in_reserve: false,
            is_struck: true,
            crew: Some("attack".to_owned()),
            length_m: 7.0,
        };
        let device = DeviceState {
            name: "camera".to_owned(),
            level: DeviceLevel::Fault,
            code: "CAM_LOST".to_owned(),
            cause: "CAMERA LOST".to_owned(),
            action: "CHECK THE CAMERA CABLE".to_owned(),
        };
        let status = Status {
            number: 7,
            time_ns: i64::MAX,
            rules: Some(Engagement::Hold),
            boats: vec![boat; 64],
            devices: vec![device],
            gun: Some(GunState { bearing_deg: 1.0, elevation_deg: -0.5, view_deg: 60.0 }),
            ..Status::default()
        };
        let picture = Picture { frame: 3, complete_ns: -4, width: 2, height: 3, rgba: (0..24).collect() };
        vec![
            FromDaemon::Hello(Hello { version: VERSION, program: "1".to_owned() }),
            FromDaemon::Status(Box::new(status)),
            FromDaemon::Refused("no".to_owned()),
            FromDaemon::Picture(picture),
        ]
    }

    #[test]
    fn messages_arrive_as_they_were_sent() {
        let mut wire = Vec::new();
        to_daemon().iter().for_each(|message| write_to_daemon(&mut wire, message).unwrap());
        let mut from = wire.as_slice();
        for message in to_daemon() {
            assert_eq!(read_to_daemon(&mut from).unwrap(), message);
        }
        assert!(matches!(read_to_daemon(&mut from), Err(LinkError::Closed)));
        let mut wire = Vec::new();
        from_daemon().into_iter().for_each(|message| write_from_daemon(&mut wire, message).unwrap());
        let mut from = wire.as_slice();
        for message in from_daemon() {
            assert_eq!(read_from_daemon(&mut from).unwrap(), message);
        }
    }

    #[test]
    fn a_length_is_not_believed() {
        let long = [0xff, 0xff, 0xff, 0xff, MESSAGE];
        assert!(matches!(read_to_daemon(&mut long.as_slice()), Err(LinkError::TooLong { .. })));
        let short = [0, 0, 0x10, 0, MESSAGE, 1, 2, 3];
        assert!(matches!(read_to_daemon(&mut short.as_slice()), Err(LinkError::Io(_))));
        let picture = [4, 0, 0, 0, PICTURE, 1, 2, 3, 4];
        assert!(matches!(read_to_daemon(&mut picture.as_slice()), Err(LinkError::Kind(PICTURE))));
        assert!(matches!(read_from_daemon(&mut picture.as_slice()), Err(LinkError::Content(_))));
        let scenario = "x".repeat(DAEMON_BYTES_MAX);
        let load = ToDaemon::Load { origin: String::new(), scenario };
        assert!(matches!(write_to_daemon(&mut Vec::new(), &load), Err(LinkError::TooLong { .. })));
    }

    proptest! {
        /// Whatever comes, it ends in a message or an error.
        #[test]
        fn garbage_ends_in_an_error(garbage in proptest::collection::vec(any::<u8>(), 0..300), cut in 0usize..400) {
            let mut from = garbage.as_slice();
            while read_to_daemon(&mut from).is_ok() {}
            let mut from = garbage.as_slice();
            while read_from_daemon(&mut from).is_ok() {}
            let mut wire = Vec::new();
            for message in to_daemon() {
                write_to_daemon(&mut wire, &message).unwrap();
            }
            let cut = cut.min(wire.len());
            wire.splice(cut..cut, garbage);
            let mut from = wire.as_slice();
            while read_to_daemon(&mut from).is_ok() {}
        }
    }
}
