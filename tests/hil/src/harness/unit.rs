//! The inertial unit: what the machine's player sends comes back to the machine through QEMU's USB serial adapter.
//!
//! The adapter stands on a pseudo-terminal, so that the speed that the machine's driver sets is seen here: at another one than
//! the unit's, bytes come as garbage, as on a real line.

use std::{
    fs::{File, OpenOptions},
    io::Read,
    os::unix::net::UnixStream,
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
    thread,
    time::Duration,
};

use anyhow::{Context, Result};
use hw_sim::pty::Terminal;
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

/// How bytes go through.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Passage {
    /// As they come.
    Straight,
    /// Collected, as an adapter does that waits for more.
    Batched(Duration),
    /// In pieces of a few bytes.
    Split,
    /// Not at all.
    Cut,
}

struct SerialLineState {
    passage: Mutex<Passage>,
    baud: AtomicU64,
    lost: AtomicU64,
}

/// The unit's line.
pub struct SerialUnit {
    shared: Arc<SerialLineState>,
    slave: PathBuf,
    port: File,
}

impl SerialUnit {
    /// A line that nobody listens to yet; its relay starts with [`SerialUnit::relay`].
    pub fn new() -> Result<(Self, Terminal)> {
        let terminal = Terminal::open().context("no pseudo-terminal for the unit's line")?;
        let slave = terminal.slave().to_owned();
        // Kept open, so that the line does not hang up while no adapter is plugged; raw, so that it does not echo.
        let port = OpenOptions::new().read(true).write(true).open(&slave).context("the unit's line")?;
        let mut attributes = tcgetattr(&port).context("the unit's line")?;
        attributes.make_raw();
        tcsetattr(&port, OptionalActions::Now, &attributes).context("the unit's line")?;
        let shared = SerialLineState {
            passage: Mutex::new(Passage::Straight),
            baud: AtomicU64::new(921_600),
            lost: AtomicU64::new(0),
        };
        Ok((Self { shared: Arc::new(shared), slave, port }, terminal))
    }

    /// The terminal that QEMU's adapter stands on.
    pub fn path(&self) -> &Path {
        &self.slave
    }

    /// How bytes go through from now on.
    pub fn pass(&self, passage: Passage) {
        *passage_of(&self.shared) = passage;
    }

    /// The speed that the unit sends at.
    pub fn set_baud(&self, baud: u32) {
        self.shared.baud.store(u64::from(baud), Ordering::Relaxed);
    }

    /// The speed that the machine has set.
    pub fn line_baud(&self) -> u32 {
        tcgetattr(&self.port).map_or(0, |a| a.output_speed())
    }

    /// Bytes that nobody took.
    pub fn lost(&self) -> u64 {
        self.shared.lost.load(Ordering::Relaxed)
    }

    /// Passes bytes on until the machine is gone.
    pub fn relay(&self, mut from: UnixStream, terminal: Terminal) -> Result<()> {
        let shared = Arc::clone(&self.shared);
        let port = self.port.try_clone().context("the unit's line")?;
        thread::Builder::new()
            .name("unit".into())
            .spawn(move || {
                let mut bytes = [0; 4096];
                loop {
                    let passage = *passage_of(&shared);
                    if let Passage::Batched(wait) = passage {
                        thread::sleep(wait);
                    }
                    let Ok(count @ 1..) = from.read(&mut bytes) else { return };
                    if passage == Passage::Cut {
                        continue;
                    }
                    let taken = &mut bytes[..count];
                    let line = tcgetattr(&port).map_or(0, |a| u64::from(a.output_speed()));
                    if line != shared.baud.load(Ordering::Relaxed) {
                        // Bits fall into other places.
                        taken.iter_mut().for_each(|b| *b = b.rotate_left(3) ^ 0x5a);
                    }
                    let pieces = if passage == Passage::Split { 7 } else { 4096 };
                    for piece in taken.chunks(pieces) {
                        let lost = terminal.send(piece).unwrap_or(piece.len());
                        shared.lost.fetch_add(lost as u64, Ordering::Relaxed);
                        if passage == Passage::Split {
                            thread::sleep(Duration::from_micros(300));
                        }
                    }
                }
            })
            .context("a thread")?;
        Ok(())
    }
}

fn passage_of(shared: &SerialLineState) -> MutexGuard<'_, Passage> {
    shared.passage.lock().unwrap_or_else(PoisonError::into_inner)
}
