//! A live run with faults is recorded and stepped again from its recording: records and scenes must be the same.

use std::{
    thread,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use super::{CaseResult, FaultRow, SpecialCase, computer, quiet};
use crate::bench::{Configured, HilBench, STATE};
use bowwave_hil::protocol::PlayerFeed;

/// How long each fault stays, and how long nothing is wrong after it.
const STAYS: Duration = Duration::from_millis(1500);
/// Longest that an ended run may take to leave its summary, and how often it is looked for.
const SUMMARY_WITHIN: Duration = Duration::from_secs(60);
const SUMMARY_EVERY: Duration = Duration::from_millis(500);
/// Longest that the machine may take to step the session through the recording.
const PATIENCE: Duration = Duration::from_secs(500);

pub(super) fn rows() -> Vec<FaultRow> {
    vec![FaultRow::Own(SpecialCase {
        number: "P",
        fault: "a live run with faults, stepped again from its recording",
        injected: "unit silent, stuck, saturated, garbled; camera stalled, flagged, late, unplugged; not inert; hot; wall clock stepped; LCD unplugged; GPU lost; rounds all the while",
        code: "-",
        target: "equal digests of records and of scenes, no input missing",
        run: replayed,
    })]
}

fn replayed(bench: &mut HilBench) -> Result<CaseResult> {
    bench.ready(bench.scaled(2.0))?;
    bench.configure(&Configured { record: true, ..Configured::default() })?;
    bench.service("reload")?;
    thread::sleep(Duration::from_secs(2));
    bench.ready(bench.scaled(4.0))?;
    let faults: [fn(&mut PlayerFeed); 7] = [
        |f| f.mute = true,
        |f| f.stuck = true,
        |f| f.saturated = true,
        |f| f.garbage = 0.3,
        |f| f.stall = true,
        |f| f.flagged = 0.3,
        |f| f.backwards = 0.2,
    ];
    for fault in faults {
        bench.shoot(300)?;
        bench.feed(fault)?;
        thread::sleep(STAYS);
        bench.shoot(300)?;
        quiet(bench)?;
        thread::sleep(STAYS);
    }
    bench.camera("unplug")?;
    thread::sleep(STAYS);
    bench.camera("plug 0")?;
    bench.pull(1, false)?;
    thread::sleep(STAYS);
    bench.pull(1, true)?;
    thread::sleep(STAYS);
    for disturb in computer::disturbances() {
        bench.shoot(300)?;
        disturb(bench)?;
        thread::sleep(STAYS);
    }
    bench.shoot(300)?;
    thread::sleep(STAYS);
    // A reload ends the recording and leaves the run's summary, in place of the one of the run before.
    bench.machine.guest.shell(&format!("rm -f {STATE}/summary.json"))?;
    bench.configure(&Configured::default())?;
    bench.service("reload")?;
    let run = summary(bench)?;
    bench.ready(bench.scaled(4.0))?;
    let newest = format!("exec bowwave replay \"$(ls -t {STATE}/recording-*.mcap | head -n 1)\" --json");
    let (code, out, said) = bench.machine.guest.run_any(&["/bin/sh", "-c", &newest], PATIENCE)?;
    let replay: Value =
        serde_json::from_str(&out).with_context(|| format!("exit code {code}: {}", said.trim()))?;
    bench.machine.guest.shell(&format!("rm -f {STATE}/recording-*.mcap"))?;
    let same = |key: &str| run[key] == replay[key] && run[key].is_string();
    Ok(CaseResult {
        met: code == 0 && same("records_digest") && same("scenes_digest"),
        note: format!(
            "{} ticks, {} inputs, {} missing; records {} and {}, scenes {} and {}; {} rounds, faults {}",
            replay["ticks"],
            replay["inputs"],
            replay["missing"],
            run["records_digest"],
            replay["records_digest"],
            run["scenes_digest"],
            replay["scenes_digest"],
            run["shots"],
            run["faults"]
        ),
        ..CaseResult::default()
    })
}

/// The summary that the ended run leaves.
fn summary(bench: &mut HilBench) -> Result<Value> {
    let until = Instant::now() + SUMMARY_WITHIN;
    loop {
        let text = bench.machine.guest.shell(&format!("cat {STATE}/summary.json 2>/dev/null || true"))?;
        // It is half written for a moment.
        if let Ok(summary) = serde_json::from_str(&text) {
            return Ok(summary);
        }
        ensure!(
            Instant::now() < until,
            "the ended run left no summary within {} s",
            SUMMARY_WITHIN.as_secs()
        );
        thread::sleep(SUMMARY_EVERY);
    }
}
