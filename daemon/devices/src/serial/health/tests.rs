//! The line's health over time, without a line.

use bowwave_core::fault::Change;
use proptest::prelude::*;

use super::*;
use crate::serial::feed::IMU;

const MS: i64 = 1_000_000;

fn at(ms: i64) -> Time {
    Time::from_ns(ms * MS)
}

/// A line with a unit that sends 200 packets of 50 bytes a second at `unit_baud`, stepped every 5 ms.
struct LineRig {
    health: LineHealth,
    now_ms: i64,
    unit_baud: Option<u32>,
    garbage: bool,
    framing: bool,
    log: Vec<(i64, String)>,
    set: Vec<u32>,
}

impl LineRig {
    fn new(baud: Baud, unit_baud: Option<u32>) -> Self {
        let mut health = LineHealth::new(&baud, &IMU);
        health.opened(at(0));
        Self {
            health,
            now_ms: 0,
            unit_baud,
            garbage: false,
            framing: false,
            log: Vec::new(),
            set: Vec::new(),
        }
    }

    fn run(&mut self, ms: i64) {
        for _ in 0..ms / 5 {
            self.now_ms += 5;
            let now = at(self.now_ms);
            if self.garbage {
                self.health.received(now, 50, 0);
            } else if let Some(baud) = self.unit_baud {
                let right = baud == self.health.baud();
                self.health.received(now, 50, u64::from(right));
                if !right && self.framing {
                    self.health.framing(20);
                }
            }
            if let LineAction::SetBaud(baud) = self.health.tick(now, false) {
                self.set.push(baud);
            }
            self.fetch();
        }
    }

    fn fetch(&mut self) {
        for c in self.health.changes() {
            let sign = if c.change == Change::Cleared { '-' } else { '+' };
            self.log.push((self.now_ms, format!("{sign}{}", c.fault.code())));
        }
    }

    fn codes(&self) -> Vec<&str> {
        self.log.iter().map(|(_, code)| code.as_str()).collect()
    }
}

#[test]
fn the_right_rate_raises_nothing() {
    let mut rig = LineRig::new(Baud::Fixed(115_200), Some(115_200));
    rig.run(3000);
    assert_eq!(rig.codes(), [""; 0]);
    assert_eq!(rig.health.status(), LineStatus::Streaming);
}

#[test]
fn a_wrong_rate_is_told_after_500_ms_and_the_right_one_is_found_and_kept() {
    for (unit, framing) in [(9_600, false), (460_800, false), (460_800, true)] {
        let mut rig = LineRig::new(Baud::default(), Some(unit));
        rig.framing = framing;
        rig.run(4000);
        assert_eq!(rig.codes(), ["+IMU_BAUD", "-IMU_BAUD"], "{unit}");
        let told = rig.log.first().map(|l| l.0).unwrap();
        assert!(if framing { told <= 160 } else { (500..=510).contains(&told) }, "{told}");
        assert_eq!((rig.health.baud(), rig.health.status()), (unit, LineStatus::Streaming));
        let sets = rig.set.len();
        rig.run(5000);
        assert_eq!(rig.set.len(), sets, "no more changes");
    }
}

#[test]
fn a_fixed_rate_is_not_changed() {
    let mut rig = LineRig::new(Baud::Fixed(115_200), Some(9_600));
    rig.run(3000);
    assert_eq!(rig.codes(), ["+IMU_BAUD"]);
    assert!(rig.set.is_empty());
    rig.unit_baud = Some(115_200);
    rig.run(20);
    assert_eq!(rig.codes(), ["+IMU_BAUD", "-IMU_BAUD"]);
}

/// After a burst of garbage the rate that was right is looked at every other time.
#[test]
fn a_long_burst_of_garbage_does_not_lose_the_rate() {
    let mut rig = LineRig::new(Baud::default(), Some(230_400));
    rig.run(4000);
    for burst_ms in [200, 700, 1100, 2500, 60_000] {
        rig.garbage = true;
        rig.run(burst_ms);
        rig.garbage = false;
        rig.run(620);
        assert_eq!(
            (rig.health.baud(), rig.health.status()),
            (230_400, LineStatus::Streaming),
            "{burst_ms} ms"
        );
    }
}

#[test]
fn silence_is_told_after_100_ms_and_ends_with_the_first_packet() {
    let mut rig = LineRig::new(Baud::default(), Some(115_200));
    rig.run(1000);
    rig.unit_baud = None;
    rig.run(300);
    assert_eq!(rig.log, [(1100, "+IMU_LOST".to_owned())]);
    assert_eq!(rig.health.status(), LineStatus::Silent);
    rig.unit_baud = Some(115_200);
    rig.run(5);
    assert_eq!(rig.codes(), ["+IMU_LOST", "-IMU_LOST"]);
    assert!(rig.set.is_empty(), "silence is no reason to change the rate");
}

/// A unit without power and one that is switched off during the scan: lost, not at another rate.
#[test]
fn silence_is_no_wrong_rate() {
    let mut rig = LineRig::new(Baud::default(), None);
    rig.run(3000);
    assert_eq!(rig.codes(), ["+IMU_LOST"]);
    let mut rig = LineRig::new(Baud::default(), Some(19_200));
    rig.run(1000);
    rig.unit_baud = None;
    rig.run(2000);
    assert_eq!(rig.codes(), ["+IMU_BAUD", "-IMU_BAUD", "+IMU_LOST"]);
    assert_eq!(rig.health.baud(), 115_200);
}

#[test]
fn a_port_that_lies_about_bytes_is_opened_anew() {
    let mut health = LineHealth::new(&Baud::Fixed(9_600), &IMU);
    health.opened(at(0));
    health.spurious(at(10));
    assert_eq!(health.tick(at(20), false), LineAction::Keep);
    health.received(at(30), 50, 2);
    health.spurious(at(40));
    assert_eq!(health.tick(at(180), false), LineAction::Keep);
    assert_eq!(health.tick(at(190), false), LineAction::Reopen);
    let raised: Vec<_> = health.changes().map(|c| c.fault).collect();
    assert_eq!(raised, [Fault::ImuLost, Fault::ImuBlocked], "nothing came, and why");
    health.opened(at(300));
    health.received(at(310), 50, 2);
    let cleared: Vec<_> = health.changes().map(|c| (c.fault, c.change)).collect();
    assert_eq!(cleared, [(Fault::ImuLost, Change::Cleared), (Fault::ImuBlocked, Change::Cleared)]);
}

#[test]
fn where_any_port_may_be_it_the_next_one_is_tried() {
    let mut health = LineHealth::new(&Baud::default(), &IMU);
    health.opened(at(0));
    assert_eq!(health.tick(at(1400), true), LineAction::Keep);
    assert_eq!(health.tick(at(1500), true), LineAction::NextPort);
    health.leave(at(1500));
    health.opened(at(1600));
    health.received(at(1700), 100, 2);
    assert_eq!(health.tick(at(9000), true), LineAction::Keep, "the unit was here");
    // It is back under another name, and another adapter has its own.
    health.lost(at(9100), "unplugged");
    health.opened(at(9200));
    assert_eq!(health.tick(at(10_699), true), LineAction::Keep);
    assert_eq!(health.tick(at(10_700), true), LineAction::NextPort);
}

/// There may be no other port yet: the question comes again and again, and nothing else does.
#[test]
fn a_port_that_stays_the_only_one_is_kept_and_told_of_once() {
    for (bytes, every_ms) in [(0, 1500), (50, 3200)] {
        let mut rig = LineRig::new(Baud::default(), None);
        let mut asked = Vec::new();
        for ms in (5..10_000).step_by(5) {
            if bytes > 0 {
                rig.health.received(at(ms), bytes, 0);
            }
            if rig.health.tick(at(ms), true) == LineAction::NextPort {
                asked.push(ms);
            }
            rig.now_ms = ms;
            rig.fetch();
        }
        let gaps: Vec<_> = asked.windows(2).map(|w| w[1] - w[0]).collect();
        assert!(!gaps.is_empty() && gaps.iter().all(|gap| *gap == every_ms), "{asked:?}");
        assert_eq!(rig.codes(), [if bytes > 0 { "+IMU_BAUD" } else { "+IMU_LOST" }]);
    }
}

/// A talking adapter and a silent one in turn, and then the unit.
#[test]
fn ports_without_a_unit_are_left_without_a_to_and_fro_of_faults() {
    let mut rig = LineRig::new(Baud::default(), None);
    let mut left = 0;
    for ms in (5..60_000).step_by(5) {
        if left % 2 == 0 {
            rig.health.received(at(ms), 50, 0);
        }
        if rig.health.tick(at(ms), true) == LineAction::NextPort {
            rig.health.leave(at(ms));
            rig.health.opened(at(ms));
            left += 1;
        }
        rig.now_ms = ms;
        rig.fetch();
    }
    assert!(left > 10, "{left}");
    assert_eq!(rig.codes(), ["+IMU_BAUD", "-IMU_BAUD", "+IMU_LOST"]);
    (rig.now_ms, rig.unit_baud) = (60_000, Some(115_200));
    rig.health.leave(at(60_000));
    rig.health.opened(at(60_000));
    rig.run(100);
    assert_eq!(rig.codes()[3..], ["-IMU_LOST"]);
}

proptest! {
    /// Whatever happens, at most one of "lost" and "rate" is there, each is raised and cleared in turn, and a unit that
    /// sends at a rate of the list streams within a full scan.
    #[test]
    fn faults_alternate_and_the_unit_is_found(
        happenings in prop::collection::vec((0u8..6, 1i64..200, 0u64..3), 0..200),
    ) {
        let mut health = LineHealth::new(&Baud::Scan(vec![1, 2, 3]), &IMU);
        let mut active = std::collections::HashSet::new();
        let mut now_ms = 0;
        let mut follow = |health: &mut LineHealth| {
            for c in health.changes() {
                let fresh = if c.change == Change::Cleared { active.remove(&c.fault) } else { active.insert(c.fault) };
                assert!(fresh, "{c:?}");
            }
            assert!(!(active.contains(&Fault::ImuLost) && active.contains(&Fault::ImuBaud)));
        };
        for (what, ms, packets) in happenings {
            now_ms += ms;
            let now = at(now_ms);
            match what {
                0 => health.opened(now),
                1 => health.lost(now, "lost"),
                2 => health.absent(now, "absent"),
                3 => health.spurious(now),
                4 => health.leave(now),
                _ => health.received(now, 40, packets),
            }
            health.tick(now, false);
            follow(&mut health);
        }
        health.opened(at(now_ms));
        for _ in 0..600 {
            now_ms += 5;
            let packets = u64::from(health.baud() == 3);
            health.received(at(now_ms), 50, packets);
            health.tick(at(now_ms), false);
            follow(&mut health);
        }
        prop_assert_eq!(health.status(), LineStatus::Streaming);
        prop_assert!(active.is_empty());
    }
}
