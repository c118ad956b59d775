//! The devices of a run: started together, drained together, watched together.

use std::{sync::Arc, time::Duration};

use anyhow::Result;
use bowwave_core::{
    event::Event,
    fault::{DevicePart, Fault, FaultChange},
    frame::scene::Status,
    time::Time,
};
use bowwave_devices::{
    camera::{CameraPort, CameraSettings},
    clock::now,
    lamps::{LampSettings, LampState, Lamps},
    lcd::{LcdPort, LcdSettings, Vblanks},
    report::{Reporter, Reports, reporting},
    serial::{ImuPort, ImuSettings, LineSettings, ShipPort},
    trigger::{InputLine, TriggerPort, TriggerSettings},
};

use crate::supervisor::{Health, HealthSettings};

/// A thread without a sign of life for so much longer than a GPU may take for a frame hangs: 1 s in all, where nothing is
/// configured. A computer on which a frame may take seconds is slow at everything.
const HEARTBEAT_BEYOND: Duration = Duration::from_millis(500);
/// The trigger's thread.
const TRIGGER: &str = "trigger";
/// The thread that watches the computer.
const HEALTH: &str = "health";
/// How long the first start waits for the LCD, to draw in its size.
const LCD_WAIT: Duration = Duration::from_millis(1500);

/// Lamps, and the inputs that none of them may be.
#[derive(Clone, Debug)]
pub struct LampChoice {
    /// The lamps.
    pub lamps: LampSettings,
    /// All configured inputs with their names, whether they are used now or not.
    pub inputs: Vec<(&'static str, InputLine)>,
}

/// The devices of a run. What is absent is not started.
#[derive(Clone, Debug)]
pub struct DeviceSettings {
    /// The LCD.
    pub lcd: Option<LcdSettings>,
    /// The camera.
    pub camera: CameraSettings,
    /// The inertial unit.
    pub imu: Option<ImuSettings>,
    /// The feed of the ship's heading.
    pub ship: Option<LineSettings>,
    /// Trigger, interlock and presses.
    pub trigger: Option<TriggerSettings>,
    /// The lamps.
    pub lamps: Option<LampChoice>,
    /// What is watched of the computer.
    pub health: HealthSettings,
    /// How long the GPU may take over a frame before it counts as hung.
    pub gpu_timeout: Duration,
}

/// The devices.
pub struct Devices {
    camera: CameraPort,
    imu: Option<ImuPort>,
    ship: Option<ShipPort>,
    trigger: Option<TriggerPort>,
    lcd: Option<Arc<LcdPort>>,
    lamps: Option<Lamps>,
    health: Health,
    threads: Vec<(&'static str, Reports)>,
    /// The longest that a thread may be silent.
    heartbeat_ns: i64,
    output: Reporter,
    fetched: Vec<Event>,
}

impl Devices {
    /// Starts everything that the settings name. A device that is not there is searched for; only settings that cannot be right fail.
    pub fn start(settings: DeviceSettings, faults: &mut Vec<FaultChange>) -> Result<Self> {
        let DeviceSettings { lcd, camera, imu, ship, trigger, lamps, health, gpu_timeout } = settings;
        let mut threads = Vec::new();
        let mut reporter = |name| {
            let (reporter, reports) = reporting();
            threads.push((name, reports));
            reporter
        };
        let lcd = lcd.map(|lcd| LcdPort::start(lcd, reporter("lcd")).map(Arc::new)).transpose()?;
        let camera = CameraPort::start(camera, reporter("camera"))?;
        let imu = imu.map(|imu| ImuPort::start(imu, reporter("imu"))).transpose()?;
        let ship = ship.map(|ship| ShipPort::start(ship, reporter("ship"))).transpose()?;
        let lamps = lamps.and_then(|choice| start_lamps(choice, faults));
        let health = Health::start(&health, reporter(HEALTH))?;
        let output = reporter("output");
        let trigger = match trigger.map(|t| TriggerPort::start(t, reporter(TRIGGER))).transpose() {
            Ok(trigger) => trigger,
            Err(e) => {
                faults.push(FaultChange::raised(now(), Fault::Config, format!("{e}; there is no trigger")));
                // Nobody gives its signs of life.
                threads.retain(|(name, _)| *name != TRIGGER);
                None
            }
        };
        let heartbeat_ns = i64::try_from((gpu_timeout + HEARTBEAT_BEYOND).as_nanos()).unwrap_or(i64::MAX);
        let fetched = Vec::new();
        Ok(Self { camera, imu, ship, trigger, lcd, lamps, health, threads, heartbeat_ns, output, fetched })
    }

    /// Parts that are configured.
    pub fn parts(&self) -> Vec<DevicePart> {
        use DevicePart as P;
        let optional = [
            (P::Imu, self.imu.is_some()),
            (P::Registration, self.imu.is_some()),
            (P::Ship, self.ship.is_some()),
            (P::Trigger, self.trigger.is_some()),
            (P::Interlock, self.trigger.is_some()),
            (P::Display, self.lcd.is_some()),
        ];
        let always = [P::Camera, P::Storage, P::Gpu, P::Computer];
        let configured = optional.into_iter().filter(|(_, is_there)| *is_there).map(|(part, _)| part);
        always.into_iter().chain(configured).collect()
    }

    /// The LCD, to show on.
    pub fn lcd(&self) -> Option<Arc<LcdPort>> {
        self.lcd.clone()
    }

    /// Size of the LCD, waited for at the start.
    pub fn await_lcd_size(&self) -> Option<(u32, u32)> {
        self.lcd.as_ref()?.await_mode(LCD_WAIT).map(|m| (m.width, m.height))
    }

    /// Size of the LCD that shows now.
    pub fn lcd_size(&self) -> Option<(u32, u32)> {
        match self.lcd.as_ref()?.status().state {
            bowwave_devices::lcd::LcdState::Showing(mode) => Some((mode.width, mode.height)),
            _ => None,
        }
    }

    /// What the output thread reports with.
    pub fn output_reporter(&self) -> Reporter {
        self.output.clone()
    }

    /// What watches the computer.
    pub const fn health(&self) -> &Health {
        &self.health
    }

    /// Fetches what has arrived since the last call, in the order of arrival, and the changes of faults.
    pub fn collect(&mut self, events: &mut Vec<Event>, faults: &mut Vec<FaultChange>) {
        self.fetched.clear();
        self.fetched.extend(self.camera.events().try_iter());
        if let Some(imu) = &self.imu {
            self.fetched.extend(imu.events().try_iter());
        }
        if let Some(ship) = &self.ship {
            self.fetched.extend(ship.events().try_iter());
        }
        if let Some(trigger) = &self.trigger {
            self.fetched.extend(trigger.events().try_iter());
        }
        // Stable: each device's own order stays.
        self.fetched.sort_by_key(Event::arrival);
        events.append(&mut self.fetched);
        for (_, reports) in &self.threads {
            faults.extend(reports.changes());
        }
    }

    /// Vertical blanks at which frames came on the LCD, with their period; nothing where the driver knows no blanks.
    pub fn flips(&self) -> impl Iterator<Item = (Time, i64)> + '_ {
        let lcd = self.lcd.as_ref();
        let period = lcd.and_then(|lcd| {
            let status = lcd.status();
            let counted = status.vblanks == Some(Vblanks::Counted);
            status.choice.filter(|_| counted).map(|c| c.mode.period_ns())
        });
        lcd.into_iter()
            .flat_map(|lcd| lcd.flips().try_iter())
            .filter_map(move |flip| period.map(|period| (flip.time, period)))
    }

    /// The thread that has given no sign of life for too long, if any.
    pub fn hanging(&self, now: Time) -> Option<&'static str> {
        self.threads
            .iter()
            // Some temperature sensors take seconds to answer, which is no reason to end a training.
            .filter(|(name, _)| *name != HEALTH)
            .find(|(_, reports)| now.ns_since(reports.last_beat()) > self.heartbeat_ns)
            .map(|(name, _)| *name)
    }

    /// Lights the lamps that belong to `status`; never waits for them.
    pub fn light(&mut self, status: &Status) {
        let Some(lamps) = &mut self.lamps else { return };
        let state = LampState {
            ready: matches!(
                status,
                Status::Ready | Status::Hit { .. } | Status::NeutralHit { .. } | Status::Miss
            ),
            hit: matches!(status, Status::Hit { .. }),
            fault: matches!(status, Status::NotScored { .. } | Status::Fault { .. }),
        };
        lamps.set(state);
    }

    /// Names and counters of what the devices met, for the summary.
    pub fn counters(&self) -> Vec<(&'static str, u64)> {
        let camera = self.camera.status().counters;
        let mut counters = vec![
            ("camera_pictures", camera.frames),
            ("camera_pictures_lent", camera.lent),
            ("camera_pictures_copied", camera.copied),
            ("camera_buffers_skipped", camera.skipped),
            ("camera_buffers_damaged", camera.damaged_buffers),
            ("camera_pictures_damaged", camera.damaged_pictures),
            ("camera_sequence_gaps", camera.sequence_gaps),
            ("camera_out_of_order", camera.out_of_order),
            ("camera_opened", camera.opened),
        ];
        if let Some(imu) = &self.imu {
            let status = imu.status();
            let (line, unit) = (status.line, status.said);
            counters.extend([
                ("imu_samples", unit.counters.samples),
                ("imu_bad_crc", unit.counters.bad_crc),
                ("imu_skipped_bytes", unit.counters.skipped_bytes),
                ("imu_lost_samples", unit.lost_samples),
                ("imu_overflow", line.overflow),
                ("imu_opened", line.opened),
            ]);
        }
        if let Some(ship) = &self.ship {
            let status = ship.status();
            counters.extend([
                ("ship_headings", status.said.headings),
                ("ship_lines", status.said.lines.packets),
                ("ship_lines_damaged", status.said.lines.bad_crc),
                ("ship_opened", status.line.opened),
            ]);
        }
        if let Some(lcd) = &self.lcd {
            let c = lcd.status().counters;
            counters.extend([("lcd_given", c.given), ("lcd_shown", c.shown), ("lcd_replaced", c.replaced)]);
        }
        counters
    }

    /// Ends all devices; what does not end in its time is left to the process's end.
    pub fn stop(self) {
        let Self { camera, imu, ship, trigger, lcd, lamps, health, .. } = self;
        let told = |what: &str, e: &dyn std::fmt::Display| log::warn!("{what}: {e}");
        if let Err(e) = camera.stop() {
            told("camera", &e);
        }
        if let Some(Err(e)) = imu.map(ImuPort::stop) {
            told("inertial unit", &e);
        }
        if let Some(Err(e)) = ship.map(ShipPort::stop) {
            told("ship feed", &e);
        }
        if let Some(Err(e)) = trigger.map(TriggerPort::stop) {
            told("trigger", &e);
        }
        if let Some(Err(e)) = lamps.map(Lamps::stop) {
            told("lamps", &e);
        }
        health.stop();
        // The output thread, which shared it, has ended.
        if let Some(Err(e)) = lcd.and_then(Arc::into_inner).map(LcdPort::stop) {
            told("LCD", &e);
        }
    }
}

fn start_lamps(choice: LampChoice, faults: &mut Vec<FaultChange>) -> Option<Lamps> {
    let inputs = choice.inputs.iter().map(|(name, line)| (*name, line));
    match Lamps::start(choice.lamps, inputs) {
        Ok(lamps) => Some(lamps),
        Err(e) => {
            faults.push(FaultChange::raised(now(), Fault::Config, format!("{e}; no lamp is lit")));
            None
        }
    }
}
