//! Camera, serial line and trigger of the gun computer: everything that asks the kernel for something.
//!
//! The codecs ([`imu`] with its formats, and [`nmea`]) are sans-io pull decoders: bytes and a time of arrival in, samples out. The
//! device layers around them ([`serial`], [`camera`], [`trigger`], [`lamps`], [`lcd`]) open nodes, report typed errors that say what to
//! do, and hand events over in bounded queues; `worker` owns their threads, `gpio` the lines of chips. Nothing here knows a pose or a
//! scene.

pub mod camera;
pub mod clock;
mod framing;
pub mod gpio;
pub mod imu;
pub mod lamps;
pub mod lcd;
mod lines;
pub mod nmea;
mod nodes;
pub mod serial;
pub mod trigger;
mod worker;

pub use imu::formats::vectornav;
pub use worker::{queue, report};
