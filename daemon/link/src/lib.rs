//! The messages between the trainer and the instructor's process, over a Unix socket.
//!
//! The trainer listens, the instructor's process connects. Each side says [`Hello`] first; other versions are refused in words. From then on
//! the trainer sends its [`Status`] a few times a second, and a [`Picture`] for each that was asked for. A message is its length in bytes
//! (u32, little-endian), its kind (a byte: 0 a message in MessagePack with named fields, 1 a picture), and its content. No length is believed
//! before the bytes are there.

#![forbid(unsafe_code)]

mod codec;
mod message;

pub use codec::{
    DAEMON_BYTES_MAX, INSTRUCTOR_BYTES_MAX, LinkError, PICTURE_BYTES_MAX, read_from_daemon, read_to_daemon,
    write_from_daemon, write_picture, write_to_daemon,
};
pub use message::{
    BoatState, DeviceLevel, DeviceState, FromDaemon, GunState, Hello, Picture, Status, StatusLevel, ToDaemon,
    VERSION,
};
