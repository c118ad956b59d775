//! The parts of a trainer that faults are about, for whoever is to look at them.

use super::Fault;

/// A device, or a part of the computer that matters as one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DevicePart {
    /// The camera, and the calibration of its lens.
    Camera,
    /// The inertial unit.
    Imu,
    /// Agreement of picture and unit.
    Registration,
    /// The feed of the ship's instruments.
    Ship,
    /// The trigger.
    Trigger,
    /// The plug that tells that the gun is inert.
    Interlock,
    /// The LCD.
    Display,
    /// Disk, journal and recording.
    Storage,
    /// The GPU.
    Gpu,
    /// The computer otherwise: heat, power, load, clock, configuration.
    Computer,
}

impl DevicePart {
    /// All parts.
    pub const ALL: [Self; 10] = [
        Self::Camera,
        Self::Imu,
        Self::Registration,
        Self::Ship,
        Self::Trigger,
        Self::Interlock,
        Self::Display,
        Self::Storage,
        Self::Gpu,
        Self::Computer,
    ];

    /// The name for people.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Camera => "camera",
            Self::Imu => "IMU",
            Self::Registration => "picture and IMU",
            Self::Ship => "ship's heading",
            Self::Trigger => "trigger",
            Self::Interlock => "inert plug",
            Self::Display => "LCD",
            Self::Storage => "disk and journal",
            Self::Gpu => "GPU",
            Self::Computer => "computer",
        }
    }
}

impl Fault {
    /// The part that it is about.
    pub const fn part(self) -> DevicePart {
        match self {
            Self::CalMismatch
            | Self::CamFormat
            | Self::NoCalibration
            | Self::CamLost
            | Self::CamStall
            | Self::CamProtocol
            | Self::CamQueue
            | Self::CamBusy
            | Self::CamAwaited
            | Self::CamStatic
            | Self::CamCorrupt
            | Self::CamBandwidth
            | Self::CamRenumbered
            | Self::CamTimestamp
            | Self::OtherLens
            | Self::PictureMirrored => DevicePart::Camera,
            Self::ImuAwaited
            | Self::ImuLost
            | Self::ImuBlocked
            | Self::ImuBaud
            | Self::ImuSanity
            | Self::ImuLatency
            | Self::ImuRenumbered
            | Self::UnitTurned
            | Self::UnitReversed
            | Self::RateUnit
            | Self::ForceUnit => DevicePart::Imu,
            Self::PictureLate | Self::NotRegistered => DevicePart::Registration,
            Self::ShipLost
            | Self::ShipBlocked
            | Self::ShipBaud
            | Self::ShipInvalid
            | Self::ShipFrozen
            | Self::ShipRenumbered => DevicePart::Ship,
            Self::TriggerClock | Self::TriggerLost | Self::TriggerStuck | Self::TriggerOverrun => {
                DevicePart::Trigger
            }
            Self::Interlock
            | Self::InterlockUntested
            | Self::InterlockWiring
            | Self::FormerConfig
            | Self::NotInert => DevicePart::Interlock,
            Self::DisplayLost => DevicePart::Display,
            Self::DiskFull | Self::DiskReadOnly | Self::DiskFsync | Self::DbQuarantine | Self::DbLocked => {
                DevicePart::Storage
            }
            Self::GpuLost | Self::GpuHang => DevicePart::Gpu,
            Self::Stop
            | Self::Config
            | Self::CrashLoop
            | Self::Thermal
            | Self::Brownout
            | Self::ClockUnset
            | Self::ClockStep
            | Self::LoadRate
            | Self::LoadWater
            | Self::LoadFar
            | Self::LoadUnseen
            | Self::BootDirty
            | Self::Watchdog => DevicePart::Computer,
        }
    }
}
