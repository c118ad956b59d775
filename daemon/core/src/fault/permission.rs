//! Whether the weapon may fire, and whether a round that it fires is scored: decided here and nowhere else.

use super::{Fault, FaultBoard, Severity};
use crate::time::Time;

/// Whether the weapon may fire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FirePermission {
    /// It may, and rounds are scored.
    Armed,
    /// It may, and rounds are not scored.
    NotScored(NotScored),
    /// It may not.
    Safe(Fault),
}

/// Why a round is not scored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum NotScored {
    /// No orientation younger than 100 ms.
    ImuStale,
    /// No picture younger than 100 ms.
    CameraStale,
    /// This fault was there.
    Fault(Fault),
}

impl FirePermission {
    /// The permission now: by the worst of the faults that are there, else by what is wrong with the sensors.
    pub fn now(faults: &FaultBoard, sensors: Option<Fault>) -> Self {
        let severe = |f: &Fault| f.severity() >= Severity::NotScored;
        match faults.active().next().filter(severe).or(sensors) {
            None => Self::Armed,
            Some(fault) if fault.severity() == Severity::Fault => Self::Safe(fault),
            Some(fault) => Self::NotScored(NotScored::Fault(fault)),
        }
    }

    /// Why a round that left at `fired` is not scored: sensors that were `stale` then, else a fault that was there by then.
    pub fn unscored(faults: &FaultBoard, fired: Time, stale: Option<NotScored>) -> Option<NotScored> {
        stale.or_else(|| {
            faults
                .active()
                .filter(|f| f.severity() >= Severity::NotScored)
                .find(|f| faults.since(*f).is_some_and(|since| since <= fired))
                .map(NotScored::Fault)
        })
    }

    /// Whether rounds leave the muzzle.
    pub const fn fires(self) -> bool {
        !matches!(self, Self::Safe(_))
    }
}

impl NotScored {
    /// The name used in databases and tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::ImuStale => "imu_stale",
            Self::CameraStale => "camera_stale",
            Self::Fault(fault) => fault.code(),
        }
    }

    /// The cause with that name.
    pub fn from_name(name: &str) -> Option<Self> {
        match name {
            "imu_stale" => Some(Self::ImuStale),
            "camera_stale" => Some(Self::CameraStale),
            code => Fault::from_code(code).map(Self::Fault),
        }
    }

    /// The entry of the table of faults that tells the sailor about it.
    pub const fn fault(self) -> Fault {
        match self {
            Self::ImuStale => Fault::ImuLost,
            Self::CameraStale => Fault::CamLost,
            Self::Fault(fault) => fault,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fault::FaultChange;

    #[test]
    fn the_worst_fault_decides_and_sensors_only_where_there_is_none() {
        let at = |s: i64| Time::from_ns(s * 1_000_000_000);
        let mut board = FaultBoard::new();
        assert_eq!(FirePermission::now(&board, None), FirePermission::Armed);
        board.take(&FaultChange::raised(at(1), Fault::Thermal, "a warning"));
        assert_eq!(FirePermission::now(&board, None), FirePermission::Armed);
        let lost = FirePermission::now(&board, Some(Fault::ImuLost));
        assert_eq!(lost, FirePermission::NotScored(NotScored::Fault(Fault::ImuLost)));
        board.take(&FaultChange::raised(at(2), Fault::CamLost, ""));
        let camera = FirePermission::now(&board, Some(Fault::ImuLost));
        assert_eq!(camera, FirePermission::NotScored(NotScored::Fault(Fault::CamLost)));
        board.take(&FaultChange::raised(at(3), Fault::NotInert, ""));
        assert_eq!(FirePermission::now(&board, None), FirePermission::Safe(Fault::NotInert));
        assert!(!FirePermission::now(&board, None).fires() && camera.fires());
    }

    #[test]
    fn a_round_is_judged_by_what_was_there_as_it_left() {
        let at = |s: i64| Time::from_ns(s * 1_000_000_000);
        let mut board = FaultBoard::new();
        board.take(&FaultChange::raised(at(2), Fault::CamLost, ""));
        assert_eq!(FirePermission::unscored(&board, at(1), None), None);
        let later = FirePermission::unscored(&board, at(3), None);
        assert_eq!(later, Some(NotScored::Fault(Fault::CamLost)));
        let stale = FirePermission::unscored(&board, at(3), Some(NotScored::ImuStale));
        assert_eq!(stale, Some(NotScored::ImuStale));
        assert_eq!(NotScored::from_name("CAM_LOST"), later);
    }
}
