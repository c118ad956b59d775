//! The inertial unit's serial line.

#[cfg(test)]
mod tests;

use std::{
    io::{self, Read},
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::Duration,
};

use bowwave_core::event::Event;
use crossbeam_channel::Receiver;
use serialport::{SerialPort, SerialPortType};

use crate::{
    clock,
    imu::{ImuCounters, ImuDecoder},
    nodes,
    queue::{self, NewestSender},
};

/// Samples that wait to be drained: 4 s at 1000 Hz.
pub const QUEUE_SAMPLES: usize = 4096;

/// How long a read waits for bytes before it looks at whether to stop.
const READ_TIMEOUT: Duration = Duration::from_millis(20);

/// A serial port of this computer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PortInfo {
    /// Its node, such as `/dev/ttyUSB0`.
    pub node: PathBuf,
    /// A name that survives replugging, where udev gives one.
    pub by_id: Option<PathBuf>,
    /// What it is: USB identity, PCI, or built in.
    pub kind: String,
}

/// Why the line cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SerialError {
    /// No such node.
    #[error(
        "no serial port {}: ports here: {present}; plug the inertial unit in, or name a port that is there (best by its \
         /dev/serial/by-id link)",
        node.display()
    )]
    NotFound {
        /// The name asked for.
        node: PathBuf,
        /// Ports that are there.
        present: String,
    },
    /// The daemon's user may not open it.
    #[error("may not open {}: add the user to group dialout (usermod -aG dialout USER), then log in again", node.display())]
    Permission {
        /// The name asked for.
        node: PathBuf,
    },
    /// No line runs at that rate.
    #[error("{baud} baud is no rate of a serial line: give the inertial unit's, such as 115200 or 921600")]
    Baud {
        /// The rate asked for.
        baud: u32,
    },
    /// It cannot be opened as a serial port.
    #[error(
        "cannot open {} as a serial port: {source}; is it one, and is no other program using it (fuser shows which)?",
        node.display()
    )]
    Open {
        /// The name asked for.
        node: PathBuf,
        /// What the serial layer says.
        source: serialport::Error,
    },
    /// The ports cannot be listed.
    #[error("cannot list the serial ports: {0}; is /sys mounted?")]
    List(#[source] serialport::Error),
    /// The reading thread could not be started.
    #[error("cannot start the thread that reads {}: {source}; are too many processes running?", node.display())]
    Thread {
        /// The port.
        node: PathBuf,
        /// The kernel's answer.
        source: io::Error,
    },
    /// The reading thread panicked: a defect of this program.
    #[error("the thread that reads {} broke down: report it with the log", node.display())]
    BrokeDown {
        /// The port.
        node: PathBuf,
    },
}

/// Every serial port of this computer.
pub fn list() -> Result<Vec<PortInfo>, SerialError> {
    let by_id = Path::new("/dev/serial/by-id");
    let mut ports: Vec<_> = serialport::available_ports()
        .map_err(SerialError::List)?
        .into_iter()
        .map(|port| {
            let node = PathBuf::from(&port.port_name);
            PortInfo { by_id: nodes::link_to(by_id, &node), kind: kind(&port.port_type), node }
        })
        .collect();
    ports.sort_by(|a, b| a.node.cmp(&b.node));
    Ok(ports)
}

fn kind(port: &SerialPortType) -> String {
    match port {
        SerialPortType::UsbPort(usb) => {
            let names = [usb.manufacturer.as_deref(), usb.product.as_deref()];
            let names: Vec<_> = names.into_iter().flatten().collect();
            format!("USB {:04x}:{:04x} {}", usb.vid, usb.pid, names.join(" ")).trim_end().to_owned()
        }
        SerialPortType::PciPort => "PCI".to_owned(),
        SerialPortType::BluetoothPort => "Bluetooth".to_owned(),
        SerialPortType::Unknown => "built in".to_owned(),
    }
}

/// The life of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineStatus {
    /// It is being read; it may be silent.
    Open,
    /// It hung up: the adapter was unplugged or the far end closed. It does not come back by itself: open it anew.
    HungUp,
    /// Reading failed with this kind of error. It does not come back by itself: open it anew.
    Failed(io::ErrorKind),
    /// [`ImuPort::stop`] ended it.
    Stopped,
}

/// What a line has carried.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PortCounters {
    /// What the decoder met.
    pub imu: ImuCounters,
    /// Samples dropped, oldest first, because nobody drained the queue.
    pub overflow: u64,
}

struct Shared {
    stop: AtomicBool,
    state: Mutex<(LineStatus, PortCounters)>,
}

impl Shared {
    /// Plain numbers: whole even where a holder panicked.
    fn state(&self) -> MutexGuard<'_, (LineStatus, PortCounters)> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// An inertial unit on a serial line, read by a thread of its own into a bounded queue.
pub struct ImuPort {
    node: PathBuf,
    events: Receiver<Event>,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl ImuPort {
    /// Opens the port at `node` with 8 data bits, no parity, one stop bit at `baud`, for itself alone, and begins to read.
    /// Bytes from before the opening are discarded.
    pub fn open(node: &Path, baud: u32) -> Result<Self, SerialError> {
        let port = open_port(node, baud)?;
        let (queue, events) = queue::newest(QUEUE_SAMPLES);
        let shared = Arc::new(Shared {
            stop: AtomicBool::new(false),
            state: Mutex::new((LineStatus::Open, PortCounters::default())),
        });
        let reader = Reader { port, queue, shared: Arc::clone(&shared) };
        let thread = thread::Builder::new()
            .name("imu-serial".to_owned())
            .spawn(move || reader.run())
            .map_err(|source| SerialError::Thread { node: node.to_owned(), source })?;
        Ok(Self { node: node.to_owned(), events, shared, thread: Some(thread) })
    }

    /// The samples read and not yet drained, [`Event::Imu`] in the order of their arrival. At most [`QUEUE_SAMPLES`]; the
    /// oldest give way.
    pub fn events(&self) -> &Receiver<Event> {
        &self.events
    }

    /// How the line does.
    pub fn status(&self) -> LineStatus {
        self.shared.state().0
    }

    /// What it has carried so far.
    pub fn counters(&self) -> PortCounters {
        self.shared.state().1
    }

    /// Ends the reading and closes the port. Samples not drained are lost.
    pub fn stop(mut self) -> Result<PortCounters, SerialError> {
        self.shared.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            return Err(SerialError::BrokeDown { node: self.node.clone() });
        }
        Ok(self.counters())
    }
}

impl Drop for ImuPort {
    fn drop(&mut self) {
        if self.thread.is_some() {
            log::warn!("{} was dropped without stop()", self.node.display());
            self.shared.stop.store(true, Ordering::Relaxed);
        }
    }
}

fn open_port(node: &Path, baud: u32) -> Result<Box<dyn SerialPort>, SerialError> {
    if baud == 0 {
        return Err(SerialError::Baud { baud });
    }
    match std::fs::metadata(node) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => {
            let present = list().unwrap_or_default();
            return Err(SerialError::NotFound {
                node: node.to_owned(),
                present: nodes::listed(present.iter().map(|p| p.node.display().to_string())),
            });
        }
        // Whatever else is wrong, opening says it.
        Ok(_) | Err(_) => {}
    }
    let open = || {
        let port = serialport::new(node.to_string_lossy(), baud).timeout(READ_TIMEOUT).open()?;
        port.clear(serialport::ClearBuffer::Input)?;
        Ok(port)
    };
    open().map_err(|source: serialport::Error| match source.kind() {
        serialport::ErrorKind::Io(io::ErrorKind::PermissionDenied) => {
            SerialError::Permission { node: node.to_owned() }
        }
        _ => SerialError::Open { node: node.to_owned(), source },
    })
}

/// The reading thread.
struct Reader {
    port: Box<dyn SerialPort>,
    queue: NewestSender<Event>,
    shared: Arc<Shared>,
}

impl Reader {
    fn run(mut self) {
        let mut decoder = ImuDecoder::new();
        let mut bytes = [0; 1024];
        let end = loop {
            if self.shared.stop.load(Ordering::Relaxed) {
                break LineStatus::Stopped;
            }
            match self.port.read(&mut bytes) {
                // A terminal that reads nothing has hung up; to try again would be a busy loop.
                Ok(0) => break LineStatus::HungUp,
                Ok(count) => {
                    let arrival = clock::now();
                    decoder.push(&bytes[..count], arrival, |sample| self.queue.send(Event::Imu(sample)));
                    self.shared.state().1 =
                        PortCounters { imu: decoder.counters(), overflow: self.queue.dropped() };
                }
                Err(e) => match e.kind() {
                    io::ErrorKind::TimedOut | io::ErrorKind::Interrupted | io::ErrorKind::WouldBlock => {}
                    io::ErrorKind::BrokenPipe => break LineStatus::HungUp,
                    kind => break LineStatus::Failed(kind),
                },
            }
        };
        self.shared.state().0 = end;
    }
}
