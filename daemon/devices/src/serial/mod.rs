//! Serial lines, of the inertial unit and of the ship's instruments: found, opened, read, lost and found again, for as long as the
//! trainer runs.
//!
//! `health` decides, as a function of what came and of time; `line` and `ioctl` speak to the kernel; `reader` joins them in a
//! thread, `port` owns it. What the bytes mean is a `feed`: `imu_feed`, whose arrivals `timing` judges, and `ship`.

mod feed;
mod find;
mod health;
mod imu_feed;
mod ioctl;
mod line;
mod port;
mod reader;
mod ship;
#[cfg(test)]
mod tests;
mod timing;

use std::{
    fmt, io,
    path::{Path, PathBuf},
    thread,
    time::Duration,
};

use bowwave_core::{
    estimate::clock::{ClockMap, ClockReport},
    event::Event,
    fault::Fault,
};
use crossbeam_channel::Receiver;
use serialport::SerialPortType;

pub use self::imu_feed::ImuReport;
pub use self::{
    health::LineStatus,
    ship::{ShipPort, ShipReport, ShipStatus, check_ship},
    timing::ArrivalTiming,
};
use self::{imu_feed::ImuFeed, port::LinePort};
use crate::{
    clock,
    imu::ImuFormat,
    nodes,
    report::{Reporter, reporting},
};

/// Samples that wait to be drained: 4 s at 1000 Hz.
pub const QUEUE_SAMPLES: usize = 4096;

/// The rates that units come with or can be set to, the likeliest first.
const RATES: [u32; 9] = [115_200, 921_600, 460_800, 230_400, 57_600, 128_000, 38_400, 19_200, 9_600];

/// A serial port of this computer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PortInfo {
    /// Its node, such as `/dev/ttyUSB0`.
    pub node: PathBuf,
    /// A name that survives replugging, where udev gives one.
    pub by_id: Option<PathBuf>,
    /// Its kind: USB identity, PCI, or built in.
    pub kind: String,
    /// Identity of its adapter, where it is one on USB.
    pub usb: Option<UsbIdentity>,
}

/// Identity of a USB adapter, whatever its node is called.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UsbIdentity {
    /// Vendor number.
    pub vendor: u16,
    /// Product number.
    pub product: u16,
    /// Serial number, where the adapter has one.
    pub serial: Option<String>,
}

impl fmt::Display for UsbIdentity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "USB {:04x}:{:04x}", self.vendor, self.product)?;
        self.serial.as_ref().map_or(Ok(()), |serial| write!(f, " serial {serial}"))
    }
}

/// Why the line cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SerialError {
    /// No such node.
    #[error(
        "no serial port {}: ports here: {present}; plug the device in, or name a port that is there (best by its \
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
    #[error("{baud} baud is no rate of a serial line: give the device's, such as 115200 or 921600")]
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
        /// The serial layer's answer.
        source: io::Error,
    },
    /// Another program has it.
    #[error("{} is in use by another program (fuser shows which): end that one", node.display())]
    Busy {
        /// The name asked for.
        node: PathBuf,
    },
    /// The port does not run at that rate.
    #[error("{} does not run at {baud} baud but at {got}: set a rate that both the device and the port know", node.display())]
    BaudNotTaken {
        /// The name asked for.
        node: PathBuf,
        /// The rate asked for.
        baud: u32,
        /// The rate that the port took.
        got: u32,
    },
    /// No rates to try.
    #[error("no baud rate is given: name one, or up to 16 to be tried")]
    NoRates,
    /// No adapter is there.
    #[error(
        "no USB serial adapter: ports here: {present}; plug the inertial unit in, or name its port (built-in ones are not \
         guessed)"
    )]
    NoAdapter {
        /// Ports that are there.
        present: String,
    },
    /// No port's name fits the configured pattern.
    #[error(
        "no serial port fits {pattern}: ports here: {present}; plug the device in, or correct the pattern"
    )]
    NoMatch {
        /// The pattern.
        pattern: String,
        /// Ports that are there.
        present: String,
    },
    /// The adapter that carried the device is gone.
    #[error("the adapter ({adapter}) is gone: ports here: {present}; plug it in again")]
    Gone {
        /// The adapter that it was.
        adapter: String,
        /// Ports that are there.
        present: String,
    },
    /// A kernel call of the reading thread does not return.
    #[error("a kernel call on {node} does not return: its thread is left behind; unplug the adapter")]
    Blocked {
        /// The port.
        node: String,
    },
    /// The ports cannot be listed.
    #[error("cannot list the serial ports: {0}; is /sys mounted?")]
    List(#[source] serialport::Error),
    /// The threads could not be started.
    #[error("cannot start the threads that read a serial line: {0}; are too many processes running?")]
    Thread(#[source] io::Error),
    /// A thread panicked: a defect of this program.
    #[error("a thread that reads a serial line broke down: report it with the log")]
    BrokeDown,
}

/// Every serial port of this computer.
pub fn list() -> Result<Vec<PortInfo>, SerialError> {
    let by_id = Path::new("/dev/serial/by-id");
    let mut ports: Vec<_> = serialport::available_ports()
        .map_err(SerialError::List)?
        .into_iter()
        .map(|port| {
            let node = PathBuf::from(&port.port_name);
            PortInfo {
                by_id: nodes::link_to(by_id, &node),
                kind: kind(&port.port_type),
                usb: identity(port.port_type),
                node,
            }
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

fn identity(port: SerialPortType) -> Option<UsbIdentity> {
    match port {
        SerialPortType::UsbPort(usb) => {
            Some(UsbIdentity { vendor: usb.vid, product: usb.pid, serial: usb.serial_number })
        }
        SerialPortType::PciPort | SerialPortType::BluetoothPort | SerialPortType::Unknown => None,
    }
}

/// The rate of the line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Baud {
    /// This rate and no other.
    Fixed(u32),
    /// The first of these is tried; where bytes come that are no packets, the others are. At most 16.
    Scan(Vec<u32>),
}

impl Default for Baud {
    fn default() -> Self {
        Self::Scan(RATES.to_vec())
    }
}

impl Baud {
    fn rates(&self) -> &[u32] {
        match self {
            Self::Fixed(baud) => std::slice::from_ref(baud),
            Self::Scan(rates) => rates,
        }
    }

    pub(super) fn check(&self) -> Result<(), SerialError> {
        let rates = self.rates();
        match rates.iter().find(|baud| **baud == 0) {
            Some(baud) => Err(SerialError::Baud { baud: *baud }),
            None if rates.is_empty() || rates.len() > 16 => Err(SerialError::NoRates),
            None => Ok(()),
        }
    }
}

/// Port and rate of a serial line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LineSettings {
    /// Its node, or better its link in `/dev/serial/by-id`; `*` and `?` in it stand for what may change: the first port that fits and
    /// answers is taken. Absent: the first USB adapter on which such a device answers.
    pub device: Option<PathBuf>,
    /// Its rate.
    pub baud: Baud,
    /// Ask the adapter to hand bytes on at once.
    pub low_latency: bool,
}

impl Default for LineSettings {
    fn default() -> Self {
        Self { device: None, baud: Baud::default(), low_latency: true }
    }
}

impl LineSettings {
    /// Ship's instruments on that port, at whichever of their usual rates.
    pub fn ship(device: PathBuf) -> Self {
        Self { device: Some(device), baud: Baud::Scan(ship::RATES.to_vec()), ..Self::default() }
    }
}

/// Line, format and timing of the inertial unit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ImuSettings {
    /// Its line.
    pub line: LineSettings,
    /// The only format that is read; absent: whichever comes.
    pub format: Option<ImuFormat>,
    /// How much longer than its period the 99th percentile of the gaps between its packets may be; more is reported.
    pub late: Duration,
}

impl Default for ImuSettings {
    fn default() -> Self {
        Self { line: LineSettings::default(), format: None, late: timing::LATE }
    }
}

/// Whether the adapter hands bytes on at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LowLatency {
    /// Nobody asked it to.
    NotAsked,
    /// It does.
    Set,
    /// Its driver has no such setting; most of those hold nothing back.
    NotOffered,
    /// This user may not set it.
    Refused,
}

/// A port that is open.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OpenLine {
    /// Its node.
    pub node: PathBuf,
    /// The rate in use.
    pub baud: u32,
    /// Whether the adapter hands bytes on at once.
    pub low_latency: LowLatency,
}

impl std::fmt::Display for OpenLine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} at {} baud", self.node.display(), self.baud)
    }
}

/// Report of a line's health.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LineReport {
    /// Its life.
    pub status: LineStatus,
    /// The port that is open.
    pub open: Option<OpenLine>,
    /// Events dropped, oldest first, because nobody drained the queue.
    pub overflow: u64,
    /// Bytes without a stop bit, where the port counts them.
    pub framing_errors: u64,
    /// Bytes lost in the port or in the kernel, where the port counts them.
    pub overruns: u64,
    /// Times that a port was opened.
    pub opened: u64,
    /// Times that the port said it could be read and gave nothing.
    pub spurious: u64,
}

impl LineReport {
    /// The node that is open, for people.
    pub(crate) fn node(&self) -> String {
        self.open
            .as_ref()
            .map_or_else(|| "the serial port".to_owned(), |open| open.node.display().to_string())
    }
}

/// Status of a device on a serial line.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SerialStatus<R> {
    /// The line.
    pub line: LineReport,
    /// Report of what was said on it.
    pub said: R,
}

/// Status of the inertial unit.
pub type ImuStatus = SerialStatus<ImuReport>;

/// An inertial unit on a serial line, read by a thread of its own into a bounded queue.
#[derive(Debug)]
pub struct ImuPort {
    port: LinePort<ImuFeed>,
}

impl ImuPort {
    /// Begins to look for the unit, to read it, and to look for it again whenever it is lost. That it is not there is told
    /// by `reporter`, as all that happens later.
    pub fn start(settings: ImuSettings, reporter: Reporter) -> Result<Self, SerialError> {
        let feed = ImuFeed::new(&settings);
        Ok(Self { port: LinePort::start(settings.line, feed, reporter, QUEUE_SAMPLES)? })
    }

    /// Like [`Self::start`] for a port that must be there, without reports: for replays and checks. Bytes that are sent
    /// once this has returned are not lost.
    pub fn open(node: &Path, baud: u32) -> Result<Self, SerialError> {
        let feed = ImuFeed::new(&ImuSettings::default());
        Ok(Self { port: LinePort::open(node, baud, feed, QUEUE_SAMPLES)? })
    }

    /// The samples read and not yet drained, [`Event::Imu`] in the order of their arrival. At most [`QUEUE_SAMPLES`]; the
    /// oldest give way.
    pub fn events(&self) -> &Receiver<Event> {
        self.port.events()
    }

    /// How the unit and its line do.
    pub fn status(&self) -> ImuStatus {
        self.port.status()
    }

    /// Ends the reading and closes the port, within 200 ms. Samples not drained are lost.
    pub fn stop(self) -> Result<ImuStatus, SerialError> {
        self.port.stop()
    }
}

/// Findings of a check by hand.
#[derive(Clone, Debug, PartialEq)]
pub struct Checked<S> {
    /// The status at the end.
    pub status: S,
    /// The faults that were there at the end, with their causes.
    pub faults: Vec<(Fault, String)>,
    /// How a unit's clock does; absent before that can be told, and of a ship feed, which has none.
    pub clock: Option<ClockReport>,
}

/// How often a check drains what it listens to: less than what fills the queue of the fastest unit.
const DRAIN: Duration = Duration::from_millis(50);

/// Calls `drain` for `time`.
fn listen(time: Duration, mut drain: impl FnMut()) {
    let end = clock::now().plus_ns(i64::try_from(time.as_nanos()).unwrap_or(i64::MAX));
    while clock::now() < end {
        thread::sleep(DRAIN.min(time));
        drain();
    }
}

/// Reads the unit for `time` and tells how it does: for a check by hand.
pub fn check(settings: ImuSettings, time: Duration) -> Result<Checked<ImuStatus>, SerialError> {
    let (reporter, reports) = reporting();
    let port = ImuPort::start(settings, reporter)?;
    // Without a session the check itself maps the unit's time, as the session does.
    let mut clock = ClockMap::new();
    listen(time, || {
        for event in port.events().try_iter() {
            if let Event::Imu(sample) = event {
                clock.observe(sample.device_time_ns, sample.arrival);
            }
        }
    });
    let status = port.status();
    port.stop()?;
    Ok(Checked { status, faults: reports.left(), clock: clock.report() })
}
