//! The test: one machine, every fault, one table.

use std::{
    fs,
    path::Path,
    time::{Duration, Instant},
};

use anyhow::{Context, Result};
use bowwave_hil::protocol::AgentCommand;

use super::{
    bench::{HilBench, JournalChange, LCD, Shop},
    faults::{CaseResult, FaultRow, FaultVerdict, rows},
    lcd::Plate,
    measure::{self, Figure},
    report::HilReport,
};

/// A machine's hardware clock that was never set.
const NO_CLOCK: &str = "2020-01-01T00:00:00";

/// The row that destroys the journal: before it, the rounds of the rows so far are looked at.
const REPLACES_JOURNAL: &str = "33";

/// Asked for like a row: the figures of a machine in order, without any fault.
const FIGURES: &str = "figures";

/// Runs the rows whose numbers are asked for, all where none is. Whether nothing was missed.
pub fn run(shop: &Shop, only: &[String]) -> Result<bool> {
    let begun = Instant::now();
    let host = bowwave_hil::spin();
    let data = shop.used_data("data.img")?;
    let mut bench = HilBench::switch_on(shop, &data, NO_CLOCK)?;
    let mut report = HilReport::default();
    let outcome = tried(shop, &mut bench, &mut report, host, only);
    if let Err(e) = &outcome {
        eprintln!("{e:#}");
        keep_journal(&bench, &shop.out.join("journal.txt"))?;
        bench.keep_picture("last");
        report.figures.push(Figure::judged("the run itself", format!("{e:#}"), "to its end", false));
    }
    keep_journal(&bench, &shop.out.join("journal.txt"))?;
    if only.is_empty() && outcome.is_ok() {
        power_cut(shop, bench, &data, &mut report)?;
    }
    report.write(&shop.out)?;
    print!("{}", report.markdown());
    println!(
        "\n{} missed; {:.0} s; {}",
        report.missed(),
        begun.elapsed().as_secs_f64(),
        shop.out.join("faults.md").display()
    );
    Ok(report.passed())
}

fn tried(
    shop: &Shop,
    bench: &mut HilBench,
    report: &mut HilReport,
    host: f64,
    only: &[String],
) -> Result<()> {
    // Before anything is drawn, so that it is the processor that is measured.
    let guest = bench.machine.guest.call_within(AgentCommand::Spin, Duration::from_secs(120))?;
    bench.slow = (guest.as_f64().context("seconds")? / host).max(1.0);
    report.slow = bench.slow;
    bench.pull(1, true)?;
    bench.play()?;
    start_up(bench, report)?;
    let (w, h) = LCD;
    report.machine = format!(
        "QEMU without KVM, two cores, LCD {w}x{h} (virtio-gpu), kernel {}",
        crate::machine::MachineParts::release(&shop.parts.image)?
    );
    // A machine without a clock battery says so until its clock is set: that row goes first.
    for row in rows().iter().filter(|r| r.number() == "26") {
        try_row(row, bench, report);
    }
    bench.ready(bench.scaled(5.0))?;
    let figures = only.is_empty() || only.iter().any(|n| n == FIGURES);
    let unaided = if figures { Some(steady(bench, report)?) } else { None };
    for row in rows().iter().filter(|r| r.number() != "26") {
        if let Some(unaided) = unaided.filter(|_| row.number() == REPLACES_JOURNAL) {
            let delay = after_stop(bench)?;
            report.figures.extend(measure::shots(bench, delay, unaided)?);
            bench.machine.guest.call(AgentCommand::Play { on: true })?;
            bench.settle()?;
        }
        if only.is_empty() || only.iter().any(|n| n == row.number()) {
            try_row(row, bench, report);
        }
    }
    Ok(())
}

fn try_row(row: &FaultRow, bench: &mut HilBench, report: &mut HilReport) {
    let begun = Instant::now();
    let mut line = row.run(bench);
    if line.verdict == FaultVerdict::Missed && !row.only_once() {
        // The host may have been busy: once more, and the table says so.
        let [number, fault, ..] = line.row;
        eprintln!("{number:>4} {fault} was missed: {}; once more", line.seen.note);
        let first = std::mem::replace(&mut line, row.run(bench));
        line.seen.note = format!("second try; the first: {}; {}", first.seen.note, line.seen.note);
    }
    let ([number, fault, ..], seen) = (line.row, &line.seen);
    eprintln!(
        "{number:>4} {fault:<40} {:<14} {:>6.1} s  {} {}",
        line.verdict.text(),
        begun.elapsed().as_secs_f64(),
        seen.lcd,
        seen.note
    );
    report.lines.push(line);
}

/// From power-on to the first picture and to READY.
fn start_up(bench: &mut HilBench, report: &mut HilReport) -> Result<()> {
    let on = bench.machine.power_on;
    let picture = bench.lcd(on, Duration::from_secs(240), "a picture", |p, _| p != Plate::Black)?;
    let ready = bench.lcd(on, Duration::from_secs(240), "READY", |p, _| p == Plate::Ready)?;
    let show = |bench: &mut HilBench, property: &str| -> Result<f64> {
        let text = bench.machine.guest.run(&["/bin/systemctl", "show", "-P", property, "bowwave.service"])?;
        Ok(text.trim().parse::<f64>().context("microseconds")? * 1e-6)
    };
    let begun = show(bench, "ExecMainStartTimestampMonotonic")?;
    let active = show(bench, "ActiveEnterTimestampMonotonic")?;
    let seconds = |at: Instant| at.saturating_duration_since(on).as_secs_f64();
    // Judged when the machine's speed is known.
    report.figures.push(Figure::told("power-on to the first picture", format!("{:.1} s", seconds(picture))));
    report.figures.push(Figure::told("power-on to READY on the LCD", format!("{:.1} s", seconds(ready))));
    report.figures.push(Figure::told("service started to READY=1", format!("{:.1} s", active - begun)));
    Ok(())
}

/// Figures while nothing is wrong; when nothing corrected the unit.
fn steady(bench: &mut HilBench, report: &mut HilReport) -> Result<(i64, i64)> {
    for (figure, target) in report.figures.iter_mut().zip([15.0, 15.0, 4.0]) {
        let seconds: f64 = figure.value.trim_end_matches(" s").parse().unwrap_or(f64::INFINITY);
        figure.target = format!("{target} s, scaled {:.0} s", target * bench.slow);
        figure.met = Some(seconds <= target * bench.slow);
    }
    let (found, of) = bench.identical(20)?;
    bench.keep_picture("ready");
    report.figures.push(Figure::judged(
        "LCD from outside against the off-screen pictures (SHA-256)",
        format!("{found} of {of} pictures identical"),
        "all",
        found == of && of >= 10,
    ));
    report.figures.extend(measure::usage(bench, "idle")?);
    bench.feed(|f| f.trigger = true)?;
    report.figures.extend(measure::usage(bench, "in a scenario, firing")?);
    bench.feed(|f| f.trigger = false)?;
    for _ in 0..12 {
        bench.shoot(120)?;
        std::thread::sleep(Duration::from_millis(700));
    }
    report.figures.push(measure::committed(bench)?);
    let unaided = measure::fire_unaided(bench)?;
    // What the tape pulled, the journal must hold as well.
    let played = bench.machine.guest.triggers();
    bench.pulls.extend(played);
    bench.pulls.sort_unstable();
    Ok(unaided)
}

/// With the trainer off, the unit's line is free: how long its bytes take at least.
fn after_stop(bench: &mut HilBench) -> Result<f64> {
    bench.machine.guest.run(&["/bin/systemctl", "stop", "bowwave.service"])?;
    bench.machine.guest.call(AgentCommand::Play { on: false })?;
    let command = AgentCommand::LineDelay { device: "/dev/bowwave/imu".into() };
    let delay = bench.machine.guest.call_within(command, Duration::from_secs(60))?;
    Ok(delay["least_ns"].as_f64().context("no byte came back through the unit's line")? * 1e-6)
}

/// Row 32: the machine's process is killed while it shoots, and started again.
fn power_cut(shop: &Shop, mut bench: HilBench, data: &Path, report: &mut HilReport) -> Result<()> {
    let row = |seen: CaseResult, slow: f64| {
        let verdict = match seen.back_s {
            Some(s) if seen.met && s <= 15.0 => FaultVerdict::Met,
            Some(s) if seen.met && s <= 15.0 * slow => FaultVerdict::MetScaled,
            _ => FaultVerdict::Missed,
        };
        super::faults::FaultLine {
            row: [
                "32",
                "Power cut",
                "QEMU's process is killed while rounds are fired; started again",
                "BOOT_DIRTY",
            ],
            seen,
            target: "ready in 15 s, no committed hit lost".into(),
            verdict,
        }
    };
    let slow = bench.slow;
    let tried = (|| -> Result<CaseResult> {
        bench.play().or_else(|_| bench.machine.guest.call(AgentCommand::Play { on: true }).map(|_| ()))?;
        bench.machine.guest.run(&["/bin/systemctl", "--no-block", "start", "bowwave.service"])?;
        bench.ready(bench.scaled(15.0))?;
        let seen = bench.machine.guest.lines().len();
        bench.pull(0, true)?;
        std::thread::sleep(Duration::from_millis(2700));
        let acknowledged = super::cuts::committed(&bench.machine.guest.lines()[seen..]);
        bench.machine.cut()?;
        let mut again = HilBench::switch_on(shop, data, "utc")?;
        again.slow = slow;
        again.pull(1, true)?;
        again.play()?;
        let dirty = again.told("BOOT_DIRTY", JournalChange::Came, 0, again.scaled(15.0));
        let on = again.machine.power_on;
        let ready = again.lcd(on, again.scaled(15.0), "READY", |p, _| p == Plate::Ready)?;
        let lcd = again.status()?;
        let rounds = again.rounds()?;
        keep_journal(&again, &shop.out.join("journal-after-cut.txt"))?;
        dirty?;
        let lost = super::cuts::lost(&acknowledged, &rounds);
        let note = format!("{} rounds reported committed, {lost} of them lost", acknowledged.len());
        let back_s = ready.saturating_duration_since(on).as_secs_f64();
        Ok(CaseResult {
            lcd,
            back_s: Some(back_s),
            met: lost == 0 && !acknowledged.is_empty(),
            note,
            ..CaseResult::default()
        })
    })();
    report.lines.push(row(
        tried.unwrap_or_else(|e| CaseResult { note: format!("{e:#}"), ..CaseResult::default() }),
        slow,
    ));
    Ok(())
}

fn keep_journal(bench: &HilBench, path: &Path) -> Result<()> {
    let text: String = bench
        .machine
        .guest
        .journal_since(0)
        .iter()
        .map(|e| format!("{:10.3} {}\n", e.at_ns as f64 * 1e-9, e.text()))
        .collect();
    let failures = bench.machine.guest.failures();
    fs::write(path, format!("{text}{}", failures.join("\n"))).with_context(|| path.display().to_string())
}
