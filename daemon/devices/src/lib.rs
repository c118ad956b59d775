//! Camera, serial line and trigger of the gun computer: everything that asks the kernel for something.
//!
//! The codecs ([`imu`] and the formats behind it, [`vectornav`] and [`nmea`] among them) are sans-io: bytes and a time of
//! arrival in, samples out. The device layers around them ([`serial`], [`camera`], [`trigger`]) open nodes, report typed errors that say what to do, and hand events over
//! in bounded queues. Nothing here knows a pose or a scene.

mod bno08x;
pub mod camera;
pub mod clock;
mod framing;
pub mod imu;
pub mod lamps;
pub mod lcd;
mod lines;
mod microstrain;
pub mod nmea;
mod nodes;
mod pulse;
pub mod queue;
pub mod report;
mod sbg;
pub mod serial;
pub mod trigger;
pub mod vectornav;
mod wake;
mod witmotion;
mod xsens;
