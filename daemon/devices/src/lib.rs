//! Camera, serial line and trigger of the gun computer: everything that asks the kernel for something.
//!
//! The codecs ([`imu`] with its formats, and [`nmea`]) are sans-io: bytes and a time of
//! arrival in, samples out. The device layers around them ([`serial`], [`camera`], [`trigger`]) open nodes, report typed errors that say what to do, and hand events over
//! in bounded queues. Nothing here knows a pose or a scene.

pub mod camera;
pub mod clock;
mod framing;
pub mod imu;
pub mod lamps;
pub mod lcd;
mod lines;
pub mod nmea;
mod nodes;
mod pulse;
pub mod queue;
pub mod report;
pub mod serial;
pub mod trigger;
mod wake;

pub use imu::formats::vectornav;
