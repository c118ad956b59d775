//! Wrong set-ups: one thing of a trainer that is not as it was calibrated.

use std::f64::consts::{FRAC_PI_2, PI};

use bowwave_core::{calibration::Calibration, event::ImuSample, fault::Fault};
use glam::{DQuat, DVec3};

/// Fault of a set-up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WrongSetUp {
    /// Nothing.
    Nothing,
    /// The unit is turned about its own axes against how it was calibrated (scaled axis, radians).
    Turned(DVec3),
    /// Signs of rates, and of specific forces.
    Signs(DVec3, DVec3),
    /// Factors on rates and specific forces.
    Scale(f64, f64),
    /// Factor on the focal length of the lens that is calibrated.
    Focal(f64),
    /// Columns, rows in reverse order.
    Flipped(bool, bool),
    /// Pictures that show what was so many milliseconds before their stamps.
    Late(i64),
    /// The calibrated turn from unit to camera is wrong by a turn about the camera's axes (scaled axis, radians).
    Mount(DVec3),
}

/// A way to be set up, and the faults that name it.
#[derive(Clone, Copy, Debug)]
pub struct SetUp {
    /// For a table.
    pub name: &'static str,
    /// Its fault.
    pub wrong: WrongSetUp,
    /// One of these must be told; none where nothing is wrong.
    pub faults: &'static [Fault],
}

const DEG: f64 = PI / 180.0;
const TURNED: &[Fault] = &[Fault::UnitTurned];
const REVERSED: &[Fault] = &[Fault::UnitReversed];
const LENS: &[Fault] = &[Fault::OtherLens];
const MIRRORED: &[Fault] = &[Fault::PictureMirrored];
const LATE: &[Fault] = &[Fault::PictureLate];
const MOUNT: &[Fault] = &[Fault::NotRegistered];

/// The right set-up, then the wrong ones.
pub const SET_UPS: &[SetUp] = &[
    SetUp::new("nothing", WrongSetUp::Nothing, &[]),
    SetUp::new("unit turned by 180 deg about x", turned(PI, 0.0, 0.0), TURNED),
    SetUp::new("unit turned by 180 deg about y", turned(0.0, PI, 0.0), TURNED),
    SetUp::new("unit turned by 180 deg about z", turned(0.0, 0.0, PI), TURNED),
    SetUp::new("unit turned by 90 deg about x", turned(FRAC_PI_2, 0.0, 0.0), TURNED),
    SetUp::new("unit turned by -90 deg about x", turned(-FRAC_PI_2, 0.0, 0.0), TURNED),
    SetUp::new("unit turned by 90 deg about y", turned(0.0, FRAC_PI_2, 0.0), TURNED),
    SetUp::new("unit turned by -90 deg about y", turned(0.0, -FRAC_PI_2, 0.0), TURNED),
    SetUp::new("unit turned by 90 deg about z", turned(0.0, 0.0, FRAC_PI_2), TURNED),
    SetUp::new("unit turned by -90 deg about z", turned(0.0, 0.0, -FRAC_PI_2), TURNED),
    SetUp::new("rate x reversed", WrongSetUp::Signs(DVec3::new(-1.0, 1.0, 1.0), DVec3::ONE), REVERSED),
    SetUp::new("rate y reversed", WrongSetUp::Signs(DVec3::new(1.0, -1.0, 1.0), DVec3::ONE), REVERSED),
    SetUp::new("rate z reversed", WrongSetUp::Signs(DVec3::new(1.0, 1.0, -1.0), DVec3::ONE), REVERSED),
    SetUp::new("rates reversed", WrongSetUp::Signs(DVec3::NEG_ONE, DVec3::ONE), REVERSED),
    SetUp::new("force reversed", WrongSetUp::Signs(DVec3::ONE, DVec3::NEG_ONE), REVERSED),
    SetUp::new("rates in deg/s", WrongSetUp::Scale(1.0 / DEG, 1.0), &[Fault::RateUnit]),
    SetUp::new("force in g", WrongSetUp::Scale(1.0, 1.0 / 9.806_65), &[Fault::ForceUnit]),
    SetUp::new("lens longer by half", WrongSetUp::Focal(1.0 / 1.5), LENS),
    SetUp::new("lens shorter by a third", WrongSetUp::Focal(1.5), LENS),
    SetUp::new("picture mirrored", WrongSetUp::Flipped(true, false), MIRRORED),
    SetUp::new("picture upside down", WrongSetUp::Flipped(false, true), MIRRORED),
    SetUp::new(
        "picture turned by 180 deg",
        WrongSetUp::Flipped(true, true),
        &[Fault::UnitTurned, Fault::PictureMirrored],
    ),
    SetUp::new("pictures late by 150 ms", WrongSetUp::Late(150), LATE),
    SetUp::new("pictures late by 300 ms", WrongSetUp::Late(300), LATE),
    SetUp::new("another mount, 5 deg up", mount(5.0, 0.0), MOUNT),
    SetUp::new("another mount, 5 deg down", mount(-5.0, 0.0), MOUNT),
    SetUp::new("another mount, 5 deg rolled", mount(0.0, 5.0), MOUNT),
    SetUp::new("another mount, 2 deg up, 2 rolled", mount(2.0, 2.0), MOUNT),
];

const fn turned(x: f64, y: f64, z: f64) -> WrongSetUp {
    WrongSetUp::Turned(DVec3::new(x, y, z))
}

/// Degrees about the camera's horizontal axis and its optical axis.
const fn mount(up: f64, rolled: f64) -> WrongSetUp {
    WrongSetUp::Mount(DVec3::new(up * DEG, 0.0, rolled * DEG))
}

impl SetUp {
    const fn new(name: &'static str, wrong: WrongSetUp, faults: &'static [Fault]) -> Self {
        Self { name, wrong, faults }
    }

    /// The one of that name.
    pub fn named(name: &str) -> Option<&'static Self> {
        SET_UPS.iter().find(|set_up| set_up.name == name)
    }

    /// Whether what was told last names it.
    pub fn is_named(&self, told: Option<Fault>) -> bool {
        told.map_or(self.faults.is_empty(), |fault| self.faults.contains(&fault))
    }
}

impl WrongSetUp {
    /// The calibration that the trainer is given in place of the right one.
    pub fn calibration(self, mut right: Calibration) -> Calibration {
        match self {
            Self::Focal(factor) => right.lens.focal *= factor,
            Self::Mount(turn) => {
                right.camera_from_imu = DQuat::from_scaled_axis(turn) * right.camera_from_imu
            }
            _ => {}
        }
        right
    }

    /// What the unit sends in place of a sample.
    pub fn sample(self, s: ImuSample) -> ImuSample {
        match self {
            Self::Turned(turn) => {
                let turn = DQuat::from_scaled_axis(turn);
                ImuSample {
                    rate: turn.inverse() * s.rate,
                    accel: turn.inverse() * s.accel,
                    world_from_imu: s.world_from_imu.map(|q| q * turn),
                    ..s
                }
            }
            Self::Signs(rate, accel) => ImuSample { rate: s.rate * rate, accel: s.accel * accel, ..s },
            Self::Scale(rate, accel) => ImuSample { rate: s.rate * rate, accel: s.accel * accel, ..s },
            _ => s,
        }
    }

    /// Whether columns and rows of pictures come in reverse order.
    pub const fn flips(self) -> [bool; 2] {
        if let Self::Flipped(columns, rows) = self { [columns, rows] } else { [false; 2] }
    }

    /// How many frames before a picture's stamp is what it shows, at so many a second.
    pub const fn frames_late(self, rate_hz: i64) -> usize {
        if let Self::Late(ms) = self { (ms * rate_hz / 1000) as usize } else { 0 }
    }
}
