//! The kinds of faults, and changes of them.

use crate::time::Time;

/// How much a fault takes away.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Severity {
    /// The log is told; training goes on and the sailor need not know.
    Note,
    /// Training goes on; the sailor sees a line.
    Warning,
    /// Rounds fired now are not scored.
    NotScored,
    /// The trainer cannot train: no round is fired at all.
    Fault,
}

macro_rules! faults {
    ($($(#[$doc:meta])* $name:ident = $code:literal, $severity:ident, $cause:literal, $action:literal;)*) => {
        /// A kind of fault.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Fault {
            $($(#[$doc])* $name,)*
        }

        impl Fault {
            /// How many kinds there are.
            pub const COUNT: usize = Self::ALL.len();
            /// All of them, in the order of their declaration: of two that are equally severe the first is shown.
            pub const ALL: [Self; [$($code),*].len()] = [$(Self::$name),*];

            /// The code that the log carries.
            pub const fn code(self) -> &'static str {
                match self { $(Self::$name => $code,)* }
            }

            /// How much it takes away.
            pub const fn severity(self) -> Severity {
                match self { $(Self::$name => Severity::$severity,)* }
            }

            /// Short cause for the display, upper case; empty for a [`Severity::Note`].
            pub const fn cause(self) -> &'static str {
                match self { $(Self::$name => $cause,)* }
            }

            /// The one thing to do, upper case; empty for a [`Severity::Note`].
            pub const fn action(self) -> &'static str {
                match self { $(Self::$name => $action,)* }
            }
        }
    };
}

faults! {
    /// The program was asked to stop.
    Stop = "STOP", Fault, "STOPPED", "SWITCH OFF, OR START AGAIN";
    /// The configured calibration belongs to another camera, or another size.
    CalMismatch = "CAL_MISMATCH", Fault, "CAL MISMATCH", "FIT THE CALIBRATED CAMERA";
    /// The camera no longer delivers the calibrated format or size.
    CamFormat = "CAM_FORMAT", Fault, "CAL LOST: PICTURE SIZE", "CALIBRATE THIS CAMERA";
    /// There is no calibration that can be used.
    NoCalibration = "CAL_NONE", Fault, "NOT CALIBRATED", "CALIBRATE THE CAMERA";
    /// The contacts of the inert interlock differ: one of their wires is broken or shorted.
    Interlock = "INTERLOCK", Fault, "NOT ARMED: INTERLOCK BROKEN", "PULL THE INERT PLUG, FIT IT";
    /// The interlock's one contact has not shown the plug out since the start: its wire may be shorted.
    InterlockUntested = "INTERLOCK_TEST", Fault, "NOT ARMED: TEST THE INERT PLUG", "PULL THE INERT PLUG, FIT IT";
    /// There is no interlock, or a broken wire of it would read as inert.
    InterlockWiring = "INTERLOCK_CFG", Fault, "NOT ARMED: NO SAFE INTERLOCK", "SEE THE LOG, CORRECT IT";
    /// The configuration was refused: nothing is armed by an earlier one, which may be that of another gun.
    FormerConfig = "CFG_FORMER", Fault, "NOT ARMED: OLD CONFIGURATION", "SEE THE LOG, CORRECT IT";
    /// The inert interlock is open: the trainer does not arm.
    NotInert = "NOT_INERT", Fault, "NOT ARMED: GUN NOT INERT", "FIT THE INERT PLUG";
    /// The configuration or a file that it names was refused; the last good one is kept.
    Config = "CFG", Warning, "CONFIGURATION REFUSED", "SEE THE LOG, CORRECT IT";
    /// The program started too often in a short time: video and message only.
    CrashLoop = "CRASHLOOP", Fault, "SAFE MODE", "SWITCH OFF AND ON, THEN REPORT";
    /// GPIO edges carry no monotonic time: the trigger cannot be used.
    TriggerClock = "TRG_CLOCK", Fault, "TRIGGER CLOCK", "UPDATE THE SYSTEM";
    /// The camera is gone.
    CamLost = "CAM_LOST", NotScored, "CAMERA LOST", "CHECK THE CAMERA CABLE";
    /// The camera is there and delivers nothing.
    CamStall = "CAM_STALL", NotScored, "CAMERA STALLED", "WAIT, THEN CHECK ITS CABLE";
    /// The camera's link fails for good until it is reset.
    CamProtocol = "CAM_EPROTO", NotScored, "CAMERA LINK BROKEN", "WAIT, THEN REPLUG CAMERA";
    /// The kernel's queue of pictures failed.
    CamQueue = "CAM_QUEUE", NotScored, "CAMERA LOST", "WAIT, THEN REPLUG CAMERA";
    /// Another program holds the camera.
    CamBusy = "CAM_BUSY", NotScored, "CAMERA IN USE", "STOP THE OTHER PROGRAM";
    /// No picture has come since the start.
    CamAwaited = "CAM_WAIT", NotScored, "NO CAMERA YET", "WAIT, THEN CHECK ITS CABLE";
    /// The unit has told nothing since the start.
    ImuAwaited = "IMU_WAIT", NotScored, "NO IMU YET", "WAIT, THEN CHECK ITS CABLE";
    /// The unit is gone.
    ImuLost = "IMU_LOST", NotScored, "IMU LOST", "CHECK THE IMU CABLE";
    /// A read of the unit's line did not return.
    ImuBlocked = "IMU_BLOCKED", NotScored, "IMU LOST", "REPLUG THE IMU";
    /// The line carries bytes that are no packets: another baud rate.
    ImuBaud = "IMU_BAUD", NotScored, "IMU LOST: BAUD RATE", "WAIT, THEN REPLUG THE IMU";
    /// The unit is stuck, saturated, or sends what is no number.
    ImuSanity = "IMU_SANITY", NotScored, "IMU STUCK", "SWITCH THE IMU OFF AND ON";
    /// The unit is turned against the camera, otherwise than calibrated.
    UnitTurned = "REG_TURNED", NotScored, "IMU TURNED AGAINST CAMERA", "FIT THE IMU AS CALIBRATED";
    /// An axis of the unit has the wrong sign.
    UnitReversed = "REG_REVERSED", NotScored, "IMU AXIS REVERSED", "SET THE IMU'S AXES";
    /// The unit's rates are in another unit of measurement.
    RateUnit = "REG_RATE_UNIT", NotScored, "IMU RATES IN DEG/S", "SET THE IMU TO RAD/S";
    /// The unit's specific force is in another unit of measurement.
    ForceUnit = "REG_FORCE_UNIT", NotScored, "IMU FORCE IN G", "SET THE IMU TO M/S2";
    /// The picture is of another lens than the calibrated one.
    OtherLens = "REG_LENS", NotScored, "OTHER LENS OR ZOOM", "FIT THE CALIBRATED CAMERA";
    /// The picture is mirrored.
    PictureMirrored = "REG_MIRROR", NotScored, "PICTURE MIRRORED", "SWITCH THE CAMERA'S FLIP OFF";
    /// Pictures come later than calibrated.
    PictureLate = "REG_LATE", NotScored, "PICTURES LATE", "CALIBRATE IMU TO CAMERA";
    /// Picture and unit disagree otherwise.
    NotRegistered = "REG_OFF", NotScored, "PICTURE AND IMU DISAGREE", "CALIBRATE IMU TO CAMERA";
    /// The trigger's line is gone.
    TriggerLost = "TRG_LOST", NotScored, "TRIGGER LOST", "CHECK THE TRIGGER CABLE";
    /// The trigger is held far longer than a belt lasts.
    TriggerStuck = "TRG_STUCK", Warning, "TRIGGER STUCK", "RELEASE THE TRIGGER";
    /// The picture does not change: lens covered or camera frozen.
    CamStatic = "CAM_STATIC", Warning, "PICTURE FROZEN", "UNCOVER THE LENS";
    /// More than 30 % of the pictures are damaged.
    CamCorrupt = "CAM_CORRUPT", Warning, "PICTURES DAMAGED", "CHECK THE CAMERA CABLE";
    /// The bus has no room for the wanted mode; a smaller one runs.
    CamBandwidth = "CAM_BW", Warning, "CAMERA: USB TOO SLOW", "GIVE IT A USB PORT OF ITS OWN";
    /// The serial adapter holds bytes back.
    ImuLatency = "IMU_LATENCY", Warning, "IMU LATE", "SET THE ADAPTER'S LATENCY TO 1 MS";
    /// The ship's heading does not come.
    ShipLost = "SHIP_LOST", Warning, "SHIP HEADING LOST", "CHECK THE SHIP FEED'S CABLE";
    /// A read of the ship feed's line did not return.
    ShipBlocked = "SHIP_BLOCKED", Warning, "SHIP HEADING LOST", "REPLUG THE SHIP FEED";
    /// The ship feed's line carries bytes that are no lines of text: another baud rate.
    ShipBaud = "SHIP_BAUD", Warning, "SHIP HEADING LOST: BAUD RATE", "SET THE SHIP FEED'S RATE";
    /// Lines come, and none tells a valid heading.
    ShipInvalid = "SHIP_INVALID", Warning, "SHIP HEADING INVALID", "CHECK THE SHIP'S COMPASS";
    /// The ship's heading is the very same all the time though the ship moves.
    ShipFrozen = "SHIP_FROZEN", Warning, "SHIP HEADING FROZEN", "CHECK THE SHIP'S COMPASS";
    /// The file system is full.
    DiskFull = "DISK_FULL", Warning, "REC: DISK FULL", "FREE THE DATA PARTITION";
    /// The file system cannot be written.
    DiskReadOnly = "DISK_RO", Warning, "REC: DISK READ-ONLY", "SWITCH OFF AND ON";
    /// The disk does not confirm what was written.
    DiskFsync = "DISK_FSYNC", Warning, "REC LOST: DISK FAILS", "REPLACE THE DISK";
    /// The journal was damaged; a fresh one is used and the old one kept.
    DbQuarantine = "DB_QUARANTINE", Warning, "REC: NEW HIT JOURNAL", "KEEP THE OLD FILE, REPORT";
    /// Another program holds the journal.
    DbLocked = "DB_LOCKED", Warning, "REC: JOURNAL IN USE", "CLOSE THE OTHER PROGRAM";
    /// The computer is too hot.
    Thermal = "THERMAL", Warning, "HOT", "SHADE THE COMPUTER";
    /// The supply voltage is low.
    Brownout = "BROWNOUT", Warning, "PWR LOW", "CHECK THE POWER SUPPLY";
    /// No clock battery: dates are filled in later.
    ClockUnset = "CLK_UNSET", Warning, "CLOCK NOT SET", "DATES ARE FILLED IN LATER";
    /// The GPU's driver lost the device.
    GpuLost = "GPU_LOST", NotScored, "DISPLAY RESTARTED", "WAIT";
    /// The GPU did not finish a frame.
    GpuHang = "GPU_HANG", Fault, "DISPLAY FROZEN", "WAIT FOR THE RESTART";
    /// No LCD is connected.
    DisplayLost = "DISP_LOST", Note, "", "";
    /// The camera came back under another name.
    CamRenumbered = "CAM_RENUM", Note, "", "";
    /// A picture's time stamp repeated or went back.
    CamTimestamp = "CAM_TS", Note, "", "";
    /// The unit came back under another name.
    ImuRenumbered = "IMU_RENUM", Note, "", "";
    /// The ship feed came back under another name.
    ShipRenumbered = "SHIP_RENUM", Note, "", "";
    /// Edges of the trigger were lost in the kernel.
    TriggerOverrun = "TRG_OVERRUN", Note, "", "";
    /// The wall clock stepped.
    ClockStep = "CLK_STEP", Note, "", "";
    /// The last run did not end as it should: power was cut.
    BootDirty = "BOOT_DIRTY", Note, "", "";
    /// A thread gave no sign of life.
    Watchdog = "WATCHDOG", Note, "", "";
}

impl Fault {
    /// The fault with that code.
    pub fn from_code(code: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|f| f.code() == code)
    }
}

/// Change of a fault.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Change {
    /// It is there from now on, until cleared. Raising it again changes nothing but its cause.
    Raised {
        /// The cause for the log: one line with what, where and what to do.
        cause: String,
    },
    /// It is gone.
    Cleared,
    /// It happened and is over: the log is told, nothing stays active.
    Noted {
        /// The cause for the log.
        cause: String,
    },
}

/// A fault came, went or happened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FaultChange {
    /// When.
    pub time: Time,
    /// Which.
    pub fault: Fault,
    /// Its end.
    pub change: Change,
}

impl FaultChange {
    /// It is there from `time` on.
    pub fn raised(time: Time, fault: Fault, cause: impl Into<String>) -> Self {
        Self { time, fault, change: Change::Raised { cause: cause.into() } }
    }

    /// It is gone.
    pub const fn cleared(time: Time, fault: Fault) -> Self {
        Self { time, fault, change: Change::Cleared }
    }

    /// It happened at `time`.
    pub fn noted(time: Time, fault: Fault, cause: impl Into<String>) -> Self {
        Self { time, fault, change: Change::Noted { cause: cause.into() } }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    #[test]
    fn codes_are_unique_and_found_again() {
        let codes: HashSet<_> = Fault::ALL.iter().map(|f| f.code()).collect();
        assert_eq!(codes.len(), Fault::COUNT);
        assert!(Fault::ALL.iter().all(|f| Fault::from_code(f.code()) == Some(*f)));
        assert_eq!(Fault::from_code("cam_lost"), None);
    }

    #[test]
    fn what_the_sailor_sees_has_a_cause_and_one_thing_to_do() {
        for fault in Fault::ALL {
            let shown = fault.severity() > Severity::Note;
            assert_eq!(!fault.cause().is_empty(), shown, "{fault:?}");
            assert_eq!(!fault.action().is_empty(), shown, "{fault:?}");
            for text in [fault.cause(), fault.action()] {
                assert!(text.len() <= 34 && text == text.to_uppercase(), "{text}");
            }
        }
    }
}
