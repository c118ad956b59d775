//! What the harness on the host and the agent in the machine share.
//!
//! The harness (`hil`) boots the gun computer's image under QEMU and gives it, in memory, an agent (`hil-agent`) and the bench's
//! kernel modules; nothing is changed in the image. The agent plays a recording into the kernel's interfaces and does what the
//! harness says; they talk over a virtio serial port (`protocol`).

#![forbid(unsafe_code)]

pub mod protocol;
pub mod tape;

/// Where the bench lives in the machine: in memory, kept over the switch from the initial file system to the image's.
pub const BENCH: &str = "/run/hil";
/// Serial port of requests and replies.
pub const PORT_CONTROL: &str = "hil.ctl";
/// Serial port on which the unit's bytes leave the machine, to come back through the serial adapter.
pub const PORT_IMU: &str = "hil.imu";
/// Serial port that the service's standard output goes to.
pub const PORT_OUTPUT: &str = "hil.out";
/// Serial number of the disk that the tape is on.
pub const TAPE_SERIAL: &str = "hil-tape";
/// Lines of the simulated GPIO chip, by number.
pub const LINES: [&str; 7] =
    ["trigger", "interlock", "power-fail", "lamp-ready", "lamp-hit", "lamp-fault", "interlock-inverted"];
/// The interlock among them...
pub const INTERLOCK: usize = 1;
/// ...and its second contact, which is low while the gun is inert.
pub const INTERLOCK_INVERTED: usize = 6;

/// A fixed computation of one core, seconds it takes: to compare the machine's speed with the host's. Best of two, so that what
/// else runs counts less.
pub fn spin() -> f64 {
    let mut best = f64::INFINITY;
    for _ in 0..2 {
        let begun = std::time::Instant::now();
        let mut hash = <sha2::Sha256 as sha2::Digest>::new();
        let mut block = vec![7u8; 1 << 16];
        for i in 0..32u32 {
            // Integers and numbers, as the trainer has both.
            for (k, b) in block.iter_mut().enumerate() {
                let x = (f64::from(i) + k as f64 * 1e-4).sin();
                *b = b.wrapping_add((x * 100.0) as i8 as u8);
            }
            sha2::Digest::update(&mut hash, &block);
        }
        std::hint::black_box(sha2::Digest::finalize(hash));
        best = best.min(begun.elapsed().as_secs_f64());
    }
    best
}
