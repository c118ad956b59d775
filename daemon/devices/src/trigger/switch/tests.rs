use bowwave_core::fault::Change;
use proptest::prelude::*;

use super::*;

const MS: i64 = 1_000_000;

fn at(ms: i64) -> Time {
    Time::from_ns(ms * MS)
}

fn switch() -> Switch {
    let mut switch = Switch::new(15 * MS, 5000 * MS, true);
    switch.opened(at(0), at(0), false);
    switch
}

/// The outputs: `P`ress or `R`elease with its time in milliseconds, or a fault.
fn out(switch: &mut Switch) -> Vec<String> {
    let text = |output| match output {
        SwitchOutput::Edge(e) => format!("{}{}", if e.pressed { 'P' } else { 'R' }, e.time.ns() / MS),
        SwitchOutput::Fault(c) => match c.change {
            Change::Raised { .. } => format!("+{}", c.fault.code()),
            Change::Cleared => format!("-{}", c.fault.code()),
            Change::Noted { .. } => format!("!{}", c.fault.code()),
        },
    };
    switch.out().map(text).collect()
}

fn edge(switch: &mut Switch, ms: i64, level: bool) {
    switch.edge(at(ms), at(ms), level);
}

#[test]
fn a_press_and_a_release_keep_the_kernels_times() {
    let mut s = switch();
    s.edge(at(107), at(100), true);
    assert_eq!(s.life(), TriggerLife::Pressed);
    edge(&mut s, 102, false);
    edge(&mut s, 103, true);
    s.tick(at(130));
    s.edge(at(400), at(390), false);
    s.tick(at(500));
    assert_eq!(out(&mut s), ["P100", "R390"]);
    assert_eq!((s.counters().presses, s.counters().chatter, s.life()), (1, 2, TriggerLife::Released));
}

#[test]
fn what_is_held_at_the_start_fires_after_a_release() {
    let mut s = Switch::new(15 * MS, 5000 * MS, true);
    s.opened(at(0), at(0), true);
    assert_eq!(s.life(), TriggerLife::Held);
    edge(&mut s, 100, false);
    s.tick(at(120));
    edge(&mut s, 200, true);
    assert_eq!(out(&mut s), ["P200"]);
}

#[test]
fn a_trigger_held_too_long_is_stuck_until_released() {
    let mut s = switch();
    edge(&mut s, 1000, true);
    s.tick(at(6000));
    assert_eq!(out(&mut s), ["P1000"]);
    s.tick(at(6001));
    s.tick(at(9000));
    edge(&mut s, 9500, false);
    assert_eq!(out(&mut s), ["+TRG_STUCK", "R9500", "-TRG_STUCK"]);
}

#[test]
fn a_lost_press_is_no_shot_and_a_lost_release_is_one() {
    let mut s = switch();
    s.level(at(100), true);
    assert_eq!(out(&mut s), [""; 0], "the kernel's thread may be on its way");
    assert_eq!(s.deadline(), Some(at(105)));
    s.level(at(105), true);
    assert_eq!(out(&mut s), ["!TRG_OVERRUN"]);
    assert_eq!(s.life(), TriggerLife::Held);
    s.tick(at(200));
    edge(&mut s, 300, false);
    s.tick(at(400));
    edge(&mut s, 500, true);
    s.tick(at(600));
    s.level(at(700), false);
    s.level(at(706), false);
    assert_eq!(out(&mut s), ["P500", "!TRG_OVERRUN", "R706"]);
    assert_eq!((s.counters().overruns, s.counters().presses), (2, 1));
}

/// The kernel's queue holds 16 edges; what is lost within the window changes nothing where the end is the same.
#[test]
fn edges_lost_in_chatter_are_no_second_shot() {
    let mut s = switch();
    for n in 0..16 {
        edge(&mut s, 100 + n / 4, n % 2 == 0);
    }
    s.level(at(104), true);
    s.level(at(110), true);
    s.tick(at(200));
    assert_eq!(out(&mut s), ["P100", "!TRG_OVERRUN"]);
    assert_eq!(s.life(), TriggerLife::Pressed);
}

#[test]
fn a_level_that_the_edge_confirms_is_no_loss() {
    let mut s = switch();
    s.level(at(100), true);
    s.edge(at(103), at(99), true);
    s.level(at(103), true);
    s.level(at(110), true);
    assert_eq!(out(&mut s), ["P99"]);
}

#[test]
fn a_line_that_is_lost_stops_firing() {
    let mut s = switch();
    edge(&mut s, 100, true);
    s.lost(at(200), "gone");
    s.lost(at(300), "still gone");
    assert_eq!(out(&mut s), ["P100", "R200", "+TRG_LOST"]);
    s.opened(at(400), at(400), true);
    s.tick(at(500));
    assert_eq!(out(&mut s), ["-TRG_LOST"]);
    assert_eq!(s.life(), TriggerLife::Held);
}

#[test]
fn without_the_interlock_nothing_fires() {
    let mut s = Switch::new(15 * MS, 5000 * MS, false);
    s.opened(at(0), at(0), false);
    edge(&mut s, 100, true);
    s.tick(at(120));
    s.arm(at(200), true);
    s.tick(at(300));
    assert_eq!(out(&mut s), [""; 0], "held while it was armed");
    edge(&mut s, 400, false);
    s.tick(at(420));
    edge(&mut s, 500, true);
    s.arm(at(600), false);
    edge(&mut s, 700, false);
    assert_eq!(out(&mut s), ["P500", "R600"]);
    assert_eq!(s.counters().withheld, 1);
}

#[test]
fn times_of_another_clock_end_it_for_good() {
    for wrong_ms in [1_700_000_000_000, -5000] {
        let mut s = switch();
        edge(&mut s, 100, true);
        s.edge(at(200), at(wrong_ms), false);
        assert_eq!(out(&mut s), ["P100", "R200", "+TRG_CLOCK"]);
        edge(&mut s, 300, false);
        s.tick(at(400));
        edge(&mut s, 500, true);
        s.tick(at(600));
        assert_eq!(out(&mut s), [""; 0]);
        assert_eq!(s.life(), TriggerLife::Refused);
    }
}

/// The kernel keeps edges as soon as it has the line; reading the level after that may take a while.
#[test]
fn edges_from_before_the_level_was_read_are_in_it() {
    let mut s = Switch::new(15 * MS, 5000 * MS, true);
    s.opened(at(100), at(140), false);
    // A release that chatters: the press in it is none.
    for (ms, level) in [(110, false), (112, true), (113, false)] {
        s.edge(at(141), at(ms), level);
    }
    s.level(at(141), false);
    s.tick(at(200));
    assert_eq!((out(&mut s), s.life()), (vec![], TriggerLife::Released));
    edge(&mut s, 300, true);
    assert_eq!(out(&mut s), ["P300"]);
    // One that came after the level: it is there, and was not seen to come.
    s.opened(at(400), at(440), false);
    out(&mut s);
    s.edge(at(441), at(439), true);
    s.level(at(441), true);
    s.level(at(446), true);
    assert_eq!(out(&mut s), ["!TRG_OVERRUN"]);
    assert_eq!(s.life(), TriggerLife::Held);
}

#[test]
fn a_clock_that_is_little_off_is_refused_after_several_edges() {
    let mut s = switch();
    edge(&mut s, 100, true);
    s.edge(at(200), at(-50), false);
    s.level(at(200), false);
    s.level(at(205), false);
    assert_eq!(out(&mut s), ["P100", "!TRG_OVERRUN", "R205"], "it stops all the same");
    edge(&mut s, 300, true);
    edge(&mut s, 400, false);
    s.tick(at(450));
    assert_eq!(out(&mut s), ["P300", "R400"]);
    for ms in [500, 510, 520] {
        s.edge(at(ms), at(ms + 50), ms != 510);
    }
    assert_eq!(out(&mut s), ["+TRG_CLOCK"]);
    assert_eq!(s.life(), TriggerLife::Refused);
}

proptest! {
    /// Whatever happens: presses and releases alternate, no press is invented, none comes while disarmed, lost or refused,
    /// and what fires stops with the line.
    #[test]
    fn no_phantom_shots(happenings in prop::collection::vec((0u8..7, 0i64..40, any::<bool>()), 0..300)) {
        let mut s = switch();
        let (mut ms, mut firing, mut armed, mut open) = (0, false, true, true);
        let mut press_edges = std::collections::HashSet::new();
        for (what, step, level) in happenings {
            ms += step;
            let mut may_fire = armed && open;
            match what {
                0 | 1 => {
                    if level && open {
                        press_edges.insert(ms);
                    }
                    edge(&mut s, ms, level);
                }
                2 | 3 => s.level(at(ms), level),
                4 => {
                    armed = level;
                    s.arm(at(ms), level);
                }
                5 => {
                    if level { s.opened(at(ms), at(ms), false) } else { s.lost(at(ms), "lost") }
                    open = level;
                    if !level { press_edges.clear(); }
                }
                _ => s.tick(at(ms)),
            }
            may_fire &= armed && open;
            for output in s.out() {
                let SwitchOutput::Edge(e) = output else { continue };
                prop_assert!(e.pressed != firing, "alternate");
                firing = e.pressed;
                if e.pressed {
                    prop_assert!(may_fire && press_edges.contains(&(e.time.ns() / MS)));
                }
            }
            prop_assert!(!firing || (armed && open));
        }
    }
}
