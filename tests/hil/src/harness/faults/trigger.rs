//! Faults of the trigger, the interlock and the supply. Their lines are gpio-sim's, on the kernel's GPIO character device.

use std::{thread, time::Duration};

use anyhow::{Context, Result};
use bowwave_hil::{INTERLOCK, INTERLOCK_INVERTED, protocol::AgentCommand};
use serde_json::Value;

use super::{CaseResult, FaultCase, FaultRow, LcdShown, SpecialCase};
use crate::{
    bench::{Configured, HilBench, JournalChange, says},
    lcd::Plate,
};

/// Rows that are tried before all others.
pub fn first() -> Vec<FaultRow> {
    vec![
        FaultRow::Own(SpecialCase {
            number: "I2",
            fault: "Interlock wired wrongly, broken, shorted",
            injected: "24 wirings of a gun that is not inert: both polarities, three biases, one contact or two, the first one's wire open or shorted",
            code: "NOT_INERT, INTERLOCK, INTERLOCK_CFG, INTERLOCK_TEST",
            target: "never armed",
            run: wirings,
        }),
        FaultRow::Case(FaultCase {
            number: "I",
            fault: "Interlock open: gun not inert",
            injected: "the interlock's line goes low",
            code: "NOT_INERT",
            shown: LcdShown::Fault("NOT ARMED"),
            seen_s: Some(0.1),
            back_s: Some(0.1),
            stays_s: 0.3,
            inject: |b| {
                let at = b.pull(1, false)?;
                // Nothing may be fired.
                b.shoot_blind(Duration::from_millis(300), 200)?;
                Ok(at)
            },
            end: |b| b.pull(1, true),
            ..FaultCase::USUAL
        }),
    ]
}

pub fn rows() -> Vec<FaultRow> {
    vec![
        FaultRow::Own(SpecialCase {
            number: "21",
            fault: "Trigger bounce",
            injected: "12 edges within 6 ms, then pressed for 30 ms, then 12 edges again",
            code: "-",
            target: "one shot",
            run: bounce,
        }),
        FaultRow::Own(SpecialCase {
            number: "23",
            fault: "GPIO events lost",
            injected: "the trigger's thread is stopped for 4 s while 61 edges come, the last a press; the kernel keeps 16",
            code: "TRG_OVERRUN",
            target: "no phantom shots",
            run: overrun,
        }),
        FaultRow::Not(
            "24",
            "GPIO clock is not monotonic",
            "kernels before 5.7 only; the image's stamps edges with the monotonic clock. Unit tests of the trigger cover it",
        ),
        FaultRow::Case(FaultCase {
            number: "37",
            fault: "Low voltage",
            injected: "the power-fail line goes high",
            code: "BROWNOUT",
            shown: LcdShown::Warning("PWR"),
            seen_s: Some(0.05),
            stays_s: 0.3,
            inject: |b| b.pull(2, true),
            end: |b| b.pull(2, false),
            ..FaultCase::USUAL
        }),
    ]
}

/// Rows that are tried when no round is needed any more: they use up the belt.
pub fn last() -> Vec<FaultRow> {
    vec![FaultRow::Case(FaultCase {
        number: "22",
        fault: "Trigger held over 3 s beyond the belt",
        injected: "the trigger's line stays high; the belt is 400 rounds long",
        code: "TRG_STUCK",
        shown: LcdShown::Warning("TRIGGER STUCK"),
        stays_s: 0.2,
        inject: |b| b.pull(0, true),
        end: |b| b.pull(0, false),
        ..FaultCase::USUAL
    })]
}

/// A contact of the interlock as the configuration describes it, and the levels of its wire.
struct WiredContact {
    active_low: bool,
    bias: &'static str,
}

impl WiredContact {
    fn keys(&self) -> String {
        format!("active_low = {}, bias = \"{}\"", self.active_low, self.bias)
    }

    /// The level that means inert.
    const fn inert(&self) -> bool {
        !self.active_low
    }

    /// The level of an open wire: where no resistor decides it, the worst one.
    fn open(&self) -> bool {
        match self.bias {
            "external-pull-up" => true,
            "external-pull-down" => false,
            _ => self.inert(),
        }
    }
}

/// A gun that is not inert, and an interlock of every wiring: nothing may arm.
fn wirings(bench: &mut HilBench) -> Result<CaseResult> {
    let mut armed = Vec::new();
    let mut said: std::collections::BTreeMap<String, u32> = std::collections::BTreeMap::new();
    for number in 0..24 {
        let opposite = |bias| match bias {
            "external-pull-up" => "external-pull-down",
            "external-pull-down" => "external-pull-up",
            other => other,
        };
        let bias = ["external-pull-up", "external-pull-down", "as-is"][number / 2 % 3];
        let first = WiredContact { active_low: number % 2 == 1, bias };
        let second = WiredContact { active_low: !first.active_low, bias: opposite(bias) };
        let (two, shorted) = (number / 6 % 2 == 1, number / 12 == 1);
        bench.pulls(INTERLOCK, vec![(0, if shorted { first.inert() } else { first.open() })])?;
        bench.pulls(INTERLOCK_INVERTED, vec![(0, !second.inert())])?;
        // What the wiring before makes of these levels is over when the new one comes.
        thread::sleep(bench.scaled(0.1));
        let from = bench.machine.guest.now_ns();
        let mut interlock = first.keys().replace(", ", "\n");
        if two {
            interlock += &format!(
                "\ndiscrepancy_ms = 500\nsecond = {{ chip = \"bench\", line = \"interlock-inverted\", {} }}",
                second.keys()
            );
        }
        bench.configure(&Configured { interlock: interlock.clone(), ..Configured::default() })?;
        bench.service("reload")?;
        let patience = bench.scaled(2.0);
        let is_told = |e: &crate::guest::JournalEntry| {
            ["NOT_INERT", "INTERLOCK_CFG"]
                .iter()
                .any(|code| says(&e.fields, code) == Some(JournalChange::Came))
        };
        let told = bench.machine.guest.journal(from, patience, "why nothing arms", is_told)?.at_ns;
        // A contact that can be believed would arm within 50 ms.
        thread::sleep(bench.scaled(0.1));
        let lines = bench.machine.guest.journal_since(told);
        let arms = lines.iter().any(|e| says(&e.fields, "NOT_INERT") == Some(JournalChange::Went));
        let status = bench.says_within("NOT ARMED", patience);
        match status {
            Ok(status) if !arms => {
                *said.entry(status.split(';').next().unwrap_or_default().to_owned()).or_default() += 1;
            }
            _ => armed.push(interlock),
        }
    }
    bench.configure(&Configured::default())?;
    bench.pull(INTERLOCK, false)?;
    bench.service("reload")?;
    bench.settle()?;
    let note = format!("{} of 24 armed {armed:?}; {said:?}", armed.len());
    Ok(CaseResult { lcd: "NOT ARMED".to_owned(), met: armed.is_empty(), note, ..CaseResult::default() })
}

/// Shots as the status line counts them.
pub fn shots(bench: &mut HilBench) -> Result<u64> {
    let status = bench.status()?;
    let text = status.split("shots ").nth(1).and_then(|t| t.split(',').next());
    text.and_then(|t| t.trim().parse().ok()).with_context(|| format!("no count of shots in \"{status}\""))
}

/// Rounds take a second to fly, and the status line a second to follow.
fn settled_shots(bench: &mut HilBench) -> Result<u64> {
    thread::sleep(Duration::from_millis(2500));
    shots(bench)
}

fn bounce(bench: &mut HilBench) -> Result<CaseResult> {
    bench.ready(bench.scaled(2.0))?;
    let before = settled_shots(bench)?;
    let chatter = |up: bool| (0..12).map(move |i| (500, (i % 2 == 0) == up));
    let mut steps: Vec<(u64, bool)> = chatter(true).collect();
    steps.push((500, true));
    steps.push((30_000, false));
    steps.extend(chatter(true));
    steps.push((500, false));
    let from = bench.machine.guest.now_ns();
    let times = bench.pulls(0, steps)?;
    let after = settled_shots(bench)?;
    let lcd = bench.status()?;
    let took = (times[times.len() - 1][1] - times[0][0]) as f64 * 1e-6;
    // Ten rounds a second: a press of so short a time is one round.
    let met = after == before + 1;
    let said = bench.machine.guest.journal_since(from).len();
    let note = format!(
        "{} rounds for one press; all edges within {took:.0} ms; {said} lines in the journal",
        after - before
    );
    Ok(CaseResult { lcd, met, note, ..CaseResult::default() })
}

/// How long the lost edges may stay unnoticed once the thread runs again. The line stays pressed meanwhile.
const PATIENCE: Duration = Duration::from_secs(3);
/// Presses among the 16 edges that the kernel keeps of a line.
const KEPT: f64 = 8.0;
/// Rounds a second of the bench's weapon.
const CYCLIC: f64 = 10.0;

/// One go at row 23.
struct Lost {
    held: Value,
    told_ns: Result<i64>,
    fired: u64,
    allowed: f64,
}

/// A round for each press that was kept, and as many as the weapon fires where the line is pressed and that is known.
fn lose_edges(bench: &mut HilBench) -> Result<Lost> {
    let before = settled_shots(bench)?;
    let from = bench.machine.guest.now_ns();
    let hold = bench.machine.guest.send(AgentCommand::Hold { thread: "trigger".into(), ms: 4000 })?;
    thread::sleep(Duration::from_millis(2000));
    let edges = bench.pulls(0, (0..61).map(|i| (2000, i % 2 == 0)).collect())?;
    let held = hold.answer(Duration::from_secs(20))?;
    let told_ns = bench.told("TRG_OVERRUN", JournalChange::Came, from, PATIENCE);
    let released = bench.pull(0, false)?;
    let last = edges.last().map_or(from, |edge| edge[1]);
    let pressed_s = (released - told_ns.as_ref().map_or(last, |told| *told)).max(0) as f64 * 1e-9;
    let fired = settled_shots(bench)? - before;
    Ok(Lost { held, told_ns, fired, allowed: KEPT + CYCLIC * (pressed_s + 0.5) })
}

fn overrun(bench: &mut HilBench) -> Result<CaseResult> {
    bench.ready(bench.scaled(2.0))?;
    // Which edges the kernel keeps depends on how many were read before the thread stood still. Where the last one kept is the
    // last one there was, nothing is lost that anybody could miss.
    let mut lost = lose_edges(bench)?;
    for _ in 0..2 {
        if lost.told_ns.is_ok() || lost.fired as f64 > lost.allowed {
            break;
        }
        lost = lose_edges(bench)?;
    }
    let lcd = bench.status()?;
    bench.settle()?;
    let Lost { held, told_ns, fired, allowed } = lost;
    told_ns?;
    let seen = bench.machine.lcd.last().map(|s| s.plate) == Some(Plate::Ready);
    let note = format!(
        "{fired} rounds for 31 presses of which most were lost, {allowed:.0} at most; the thread stood still: {held}"
    );
    Ok(CaseResult { lcd, met: fired as f64 <= allowed && seen, note, ..CaseResult::default() })
}
