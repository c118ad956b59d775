//! Wrong set-ups: unit, camera and calibration that do not belong together, each with a session of its own.

use std::{
    fmt::Write as _,
    fs, thread,
    time::{Duration, Instant},
};

use anyhow::{Context, Result};
use bowwave_core::fault::Fault;
use bowwave_hil::protocol::AgentCommand;
use hw_sim::set_up::{SET_UPS, SetUp};

use super::{CaseResult, FaultRow, SpecialCase};
use crate::{
    bench::{HilBench, JournalChange, says},
    lcd::Plate,
};

/// From the request of a new session to its first frames, and two seconds more, in which READY may still be believed.
const BEGUN: Duration = Duration::from_secs(5);
/// Longest wait for a word on a gun computer, seconds, and how long it must stay.
const PATIENCE_S: f64 = 4.0;
const STAYS: Duration = Duration::from_secs(3);
/// Share of wrong set-ups that must be named.
const NAMED: f64 = 0.9;

pub(super) fn rows() -> Vec<FaultRow> {
    vec![FaultRow::Own(SpecialCase {
        number: "R",
        fault: "Wrong set-ups",
        injected: "one after the other: unit turned, axes reversed, other units of measurement, another lens or mount, pictures mirrored or late",
        code: "REG_*",
        target: "nine of ten named, none READY; the right one READY",
        run: set_ups,
    })]
}

/// What the trainer said of a set-up.
struct Told {
    /// The last fault of registration, and after how many seconds the first came.
    last: Option<Fault>,
    first_s: Option<f64>,
    is_ready: bool,
}

fn set_ups(bench: &mut HilBench) -> Result<CaseResult> {
    let (mut table, mut others) = (String::from("set-up,told,first_s,named,ready\n"), Vec::new());
    let (mut named, mut ready, mut right) = (0, 0, false);
    for (number, set_up) in SET_UPS.iter().enumerate() {
        let told = tried(bench, set_up, number)?;
        let (is_named, code) = (set_up.is_named(told.last), told.last.map_or("-", Fault::code));
        if set_up.faults.is_empty() {
            right = is_named && told.is_ready;
        } else {
            (named, ready) = (named + usize::from(is_named), ready + usize::from(told.is_ready));
        }
        if !is_named {
            others.push(format!("{}: {code}", set_up.name));
        }
        let first = told.first_s.map_or_else(String::new, |s| format!("{s:.1}"));
        // Writing to a String cannot fail.
        let _ = writeln!(table, "\"{}\",{code},{first},{is_named},{}", set_up.name, told.is_ready);
        eprintln!("     {}: {code} {first} {}", set_up.name, if told.is_ready { "READY" } else { "" });
    }
    let path = bench.out.join("set-ups.csv");
    fs::write(&path, table).with_context(|| path.display().to_string())?;
    calibrate(bench, SET_UPS[0], 0)?;
    bench.service("reload")?;
    bench.settle()?;
    let all = SET_UPS.iter().filter(|set_up| !set_up.faults.is_empty()).count();
    let note = format!(
        "{named} of {all} named, {ready} READY; not named: {}; the right one {}; set-ups.csv",
        others.join(", "),
        if right { "READY" } else { "NOT READY" }
    );
    let met = right && ready == 0 && named as f64 >= NAMED * all as f64;
    Ok(CaseResult { lcd: "NOT SCORED".to_owned(), met, note, ..CaseResult::default() })
}

/// Gives the trainer the calibration of that set-up; a number of its own makes it a new one.
fn calibrate(bench: &mut HilBench, set_up: SetUp, number: usize) -> Result<()> {
    let mut file = bowwave_calibration::parse(&bench.tape.calibration_toml, "the tape's calibration")?;
    file.calibration = set_up.wrong.calibration(file.calibration);
    let text = format!("# {number}: {}\n{}", set_up.name, bowwave_calibration::to_toml(&file));
    let path = "/run/hil/etc/calibration.toml".to_owned();
    bench.machine.guest.call(AgentCommand::Write { path, text }).map(|_| ())
}

/// A session that is set up so: its configuration is read again.
fn tried(bench: &mut HilBench, set_up: &SetUp, number: usize) -> Result<Told> {
    bench.feed(|feed| feed.set_up = set_up.name.to_owned())?;
    calibrate(bench, *set_up, number)?;
    let from = bench.machine.guest.now_ns();
    bench.service("reload")?;
    let begun = Instant::now() + BEGUN;
    let until = Instant::now() + bench.scaled(PATIENCE_S);
    loop {
        thread::sleep(STAYS);
        let told = told(bench, from);
        let is_ready = bench.machine.lcd.first(begun, |s| s.plate == Plate::Ready).is_some();
        let is_over =
            if set_up.faults.is_empty() { is_ready } else { set_up.is_named(told.last().map(|t| t.0)) };
        if (is_over && Instant::now() > begun) || Instant::now() > until {
            let first_s = told.first().map(|(_, at_ns)| (at_ns - from) as f64 * 1e-9);
            return Ok(Told { last: told.last().map(|t| t.0), first_s, is_ready });
        }
    }
}

/// Faults of registration in the journal since then.
fn told(bench: &HilBench, from_ns: i64) -> Vec<(Fault, i64)> {
    let came = |entry: &crate::guest::JournalEntry| {
        let is = |fault: &Fault| {
            fault.code().starts_with("REG_") && says(&entry.fields, fault.code()) == Some(JournalChange::Came)
        };
        Some((Fault::ALL.into_iter().find(is)?, entry.at_ns))
    };
    bench.machine.guest.journal_since(from_ns).iter().filter_map(came).collect()
}
