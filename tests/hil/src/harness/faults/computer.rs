//! Faults of the computer: clock, heat, screen, GPU, disk, and the program itself.

use std::{
    thread,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, ensure};
use bowwave_hil::protocol::AgentCommand;

use super::{CaseResult, FaultCase, FaultRow, LcdShown, SpecialCase, trigger::shots};
use crate::{
    bench::{Configured, GPU_FAULT, HilBench, JournalChange, STATE},
    guest::JournalEntry,
    lcd::Plate,
};

fn write(bench: &mut HilBench, path: &str, text: &str) -> Result<i64> {
    bench.machine.guest.call(AgentCommand::Write { path: path.into(), text: text.into() })?;
    Ok(bench.machine.guest.now_ns())
}

fn shell(bench: &mut HilBench, line: &str) -> Result<i64> {
    bench.machine.guest.shell(line)?;
    Ok(bench.machine.guest.now_ns())
}

pub fn rows() -> Vec<FaultRow> {
    let mut all = clock_and_heat();
    all.extend(screen_and_disk());
    // From here on the trainer is started anew, with a full belt.
    all.extend(super::trigger::last());
    all.extend(program());
    all.extend(absent());
    all
}

fn clock_and_heat() -> Vec<FaultRow> {
    vec![
        FaultRow::Own(SpecialCase {
            number: "26",
            fault: "No clock battery",
            injected: "the machine started with its hardware clock at 2020; then the clock is set",
            code: "CLK_UNSET",
            target: "warning until set",
            run: clock_unset,
        }),
        FaultRow::Own(SpecialCase {
            number: "25",
            fault: "Wall clock steps an hour",
            injected: "date --set '+1 hour', and back",
            code: "CLK_STEP",
            target: "no missed frame: READY throughout",
            run: clock_step,
        }),
        FaultRow::Case(FaultCase {
            number: "36",
            fault: "Thermal throttling",
            injected: "the configured temperature file says 95 C",
            code: "THERMAL",
            shown: LcdShown::Warning("HOT"),
            inject: |b| write(b, "/run/hil/thermal", "95000\n"),
            end: |b| write(b, "/run/hil/thermal", "41000\n"),
            ..FaultCase::USUAL
        }),
    ]
}

fn screen_and_disk() -> Vec<FaultRow> {
    vec![
        FaultRow::Own(SpecialCase {
            number: "29",
            fault: "LCD unplugged and back",
            injected: "the connector's status is forced off in sysfs, and detected again",
            code: "DISP_LOST",
            target: "back 2 s",
            run: lcd_unplugged,
        }),
        FaultRow::Case(FaultCase {
            number: "30",
            fault: "Disk full",
            injected: "a file takes all of the data partition",
            code: "DISK_FULL",
            shown: LcdShown::Warning("REC: DISK FULL"),
            stays_s: 1.0,
            inject: |b| {
                let at = shell(
                    b,
                    "dd if=/dev/zero of=/data/fill bs=1M 2>/dev/null; dd if=/dev/zero of=/data/fill2 bs=4k 2>/dev/null; true",
                )?;
                b.shoot(400)?;
                Ok(at)
            },
            end: |b| shell(b, "rm -f /data/fill /data/fill2"),
            ..FaultCase::USUAL
        }),
        FaultRow::Own(SpecialCase {
            number: "31",
            fault: "File system read-only",
            injected: "all disks are remounted read-only (SysRq) while rounds are fired, later the data partition writable",
            code: "DISK_RO",
            target: "hits kept in memory, and written once that is possible",
            run: read_only,
        }),
    ]
}

/// What a run rides out without an end of its recording: each is brought about, told, and over.
pub(super) fn disturbances() -> [fn(&mut HilBench) -> Result<CaseResult>; 4] {
    [hot, clock_step, lcd_unplugged, gpu_lost]
}

fn hot(bench: &mut HilBench) -> Result<CaseResult> {
    let from = write(bench, "/run/hil/thermal", "95000\n")?;
    bench.told("THERMAL", JournalChange::Came, from, bench.scaled(5.0))?;
    let cool = write(bench, "/run/hil/thermal", "41000\n")?;
    bench.told("THERMAL", JournalChange::Went, cool, bench.scaled(5.0))?;
    Ok(CaseResult { met: true, ..CaseResult::default() })
}

fn program() -> Vec<FaultRow> {
    vec![
        FaultRow::Own(SpecialCase {
            number: "41",
            fault: "Bad configuration",
            injected: "an unknown key, SIGHUP; then the good one, SIGHUP",
            code: "CFG",
            target: "last good one kept, nothing arms, line:column in the journal",
            run: bad_configuration,
        }),
        FaultRow::Own(SpecialCase {
            number: "27",
            fault: "Vulkan device lost",
            injected: "a Vulkan layer answers VK_ERROR_DEVICE_LOST",
            code: "GPU_LOST",
            target: "rebuilt in 2 s",
            run: gpu_lost,
        }),
        FaultRow::Own(SpecialCase {
            number: "28",
            fault: "GPU hangs",
            injected: "a Vulkan layer never carries out what is submitted",
            code: "GPU_HANG",
            target: "restart, pictures again",
            run: gpu_hang,
        }),
        FaultRow::Own(SpecialCase {
            number: "38",
            fault: "SIGTERM",
            injected: "systemctl stop",
            code: "STOP",
            target: "0.5 s",
            run: stop,
        }),
        FaultRow::Own(SpecialCase {
            number: "33",
            fault: "Database corrupt",
            injected: "while the trainer is off, bytes within hits.sqlite are overwritten",
            code: "DB_QUARANTINE",
            target: "fresh one, old kept",
            run: database,
        }),
        FaultRow::Own(SpecialCase {
            number: "39",
            fault: "A thread hangs",
            injected: "the camera's thread is stopped with ptrace for 60 s",
            code: "WATCHDOG",
            target: "systemd restarts the trainer",
            run: hang,
        }),
        FaultRow::Own(SpecialCase {
            number: "43",
            fault: "Memory used up",
            injected: "while rounds are fired the service's limit of memory falls to 16 MB, and rises again",
            code: "BOOT_DIRTY",
            target: "no stored round lost, READY again by itself",
            run: memory_used_up,
        }),
        FaultRow::Own(SpecialCase {
            number: "40",
            fault: "Crash loop",
            injected: "SIGKILL as soon as it runs, four times",
            code: "CRASHLOOP",
            target: "SAFE MODE",
            run: crash_loop,
        }),
    ]
}

fn absent() -> Vec<FaultRow> {
    vec![
        FaultRow::Not(
            "34",
            "fsync fails",
            "the journal's tests of every write, where a file system that fails is put beneath SQLite, cover it",
        ),
        FaultRow::Not(
            "35",
            "Recording cut short",
            "no device is involved: tests/tests/bad_input.rs cuts recordings, and `recover` reads them",
        ),
        FaultRow::Not(
            "42",
            "Network down",
            "the gun computer has no network: nothing is queued because nothing is sent",
        ),
    ]
}

fn clock_unset(bench: &mut HilBench) -> Result<CaseResult> {
    let told = bench.told("CLK_UNSET", JournalChange::Came, 0, Duration::from_secs(5))?;
    let lcd = bench.says("CLOCK NOT SET").or_else(|_| bench.status())?;
    let set = shell(bench, "date -u -s '2026-06-01 12:00:00'")?;
    let went = bench.told("CLK_UNSET", JournalChange::Went, set - 2_000_000_000, bench.scaled(1.0))?;
    let note = format!("told {:.1} s after the kernel's start", told as f64 * 1e-9);
    Ok(CaseResult {
        met: lcd.contains("CLOCK NOT SET"),
        lcd,
        back_s: Some((went - set) as f64 * 1e-9),
        note,
        ..CaseResult::default()
    })
}

fn clock_step(bench: &mut HilBench) -> Result<CaseResult> {
    bench.ready(bench.scaled(2.0))?;
    let since = Instant::now();
    let from = bench.machine.guest.now_ns();
    shell(bench, "date -s '+1 hour'")?;
    bench.told("CLK_STEP", JournalChange::Came, from, bench.scaled(1.0))?;
    let between = bench.machine.guest.now_ns();
    shell(bench, "date -s '-1 hour'")?;
    bench.told("CLK_STEP", JournalChange::Came, between, bench.scaled(1.0))?;
    let lcd = bench.status()?;
    let lost = bench.machine.lcd.first(since, |s| s.plate == Plate::NotScored || s.plate == Plate::Fault);
    Ok(CaseResult { met: lost.is_none() && lcd.starts_with("READY"), lcd, ..CaseResult::default() })
}

fn lcd_unplugged(bench: &mut HilBench) -> Result<CaseResult> {
    bench.ready(bench.scaled(2.0))?;
    let path =
        bench.machine.guest.shell("ls -d /sys/class/drm/card*-Virtual-1/status | head -1")?.trim().to_owned();
    let from = write(bench, &path, "off")?;
    let told = bench.told("DISP_LOST", JournalChange::Came, from, bench.scaled(2.0));
    thread::sleep(Duration::from_secs(1));
    let back = write(bench, &path, "detect")?;
    let over = bench.told("DISP_LOST", JournalChange::Went, back, bench.scaled(2.0))?;
    let seen = bench
        .lcd(bench.machine.guest.host_time(back), bench.scaled(2.0), "READY", |p, _| p == Plate::Ready)?;
    let told = told?;
    let back_s = ((over - back) as f64 * 1e-9)
        .max(seen.saturating_duration_since(bench.machine.guest.host_time(back)).as_secs_f64());
    let note = format!("noticed after {:.0} ms", (told - from) as f64 * 1e-6);
    Ok(CaseResult { lcd: "-".into(), back_s: Some(back_s), within_s: Some(2.0), ..CaseResult::met(note) })
}

/// The system's journal is on the same disk: what it could not write is lost, and the LCD alone tells.
fn read_only(bench: &mut HilBench) -> Result<CaseResult> {
    bench.ready(bench.scaled(2.0))?;
    let stored = bench.rounds()?.len();
    let at = shell(bench, "echo u > /proc/sysrq-trigger; sleep 0.5")?;
    let seen = bench.lcd(bench.machine.guest.host_time(at), bench.scaled(2.0), "a warning", |_, w| w);
    let lcd = bench.says("REC: DISK READ-ONLY");
    bench.keep_picture("row-31");
    let before = shots(bench)?;
    bench.shoot(400)?;
    thread::sleep(Duration::from_secs(4));
    let fired = shots(bench)? - before;
    let back = shell(bench, "mount -o remount,rw /data")?;
    bench.settle()?;
    let until = Instant::now() + bench.scaled(2.0);
    while bench.status()?.contains("DISK READ-ONLY") && Instant::now() < until {
        thread::sleep(Duration::from_millis(200));
    }
    let back_s = (bench.machine.guest.now_ns() - back) as f64 * 1e-9;
    let kept = bench.rounds()?.len() - stored;
    let seen_s = seen?.saturating_duration_since(bench.machine.guest.host_time(at)).as_secs_f64();
    let note = format!(
        "{fired} rounds meanwhile, {kept} more in the database afterwards; the system's journal is on the same disk and cannot hold the code"
    );
    let met = fired > 0 && kept as u64 >= fired && !bench.status()?.contains("READ-ONLY");
    Ok(CaseResult {
        lcd: lcd?,
        seen_s: Some(seen_s),
        back_s: Some(back_s),
        met,
        note,
        ..CaseResult::default()
    })
}

fn bad_configuration(bench: &mut HilBench) -> Result<CaseResult> {
    bench.ready(bench.scaled(2.0))?;
    let from = bench.machine.guest.now_ns();
    bench.configure(&Configured { extra: "no_such_key = 1\n".into(), ..Configured::default() })?;
    bench.service("reload")?;
    let told = bench.told("CFG", JournalChange::Came, from, bench.scaled(2.0));
    let lcd = bench.says("OLD CONFIGURATION").or_else(|_| bench.status())?;
    let lines = bench.machine.guest.journal_since(from);
    let place =
        lines.iter().map(|e| e.text()).find(|t| t.contains("bowwave.toml:")).unwrap_or_default().to_owned();
    let between = bench.machine.guest.now_ns();
    bench.configure(&Configured::default())?;
    bench.service("reload")?;
    let went = bench.told("CFG", JournalChange::Went, between, bench.scaled(2.0));
    bench.settle()?;
    told?;
    went?;
    Ok(CaseResult {
        met: lcd.contains("OLD CONFIGURATION") && !place.is_empty(),
        lcd,
        note: place,
        ..CaseResult::default()
    })
}

fn gpu(bench: &mut HilBench, fault: &str, code: &str) -> Result<(i64, i64, String)> {
    bench.ready(bench.scaled(2.0))?;
    let from = bench.machine.guest.now_ns();
    // The trainer's user deletes it.
    let line = format!(
        "echo {fault} > {GPU_FAULT}.new && chown bowwave {GPU_FAULT}.new && mv {GPU_FAULT}.new {GPU_FAULT}"
    );
    let caused = shell(bench, &line)?;
    let told = bench.told(code, JournalChange::Came, from, bench.scaled(3.0))?;
    let lcd = bench.status()?;
    Ok((caused, told, lcd))
}

fn gpu_lost(bench: &mut HilBench) -> Result<CaseResult> {
    let (caused, told, lcd) = gpu(bench, "lost", "GPU_LOST")?;
    let back = bench.told("GPU_LOST", JournalChange::Went, caused, bench.scaled(4.0))?;
    bench.settle()?;
    let back_s = (back - told) as f64 * 1e-9;
    Ok(CaseResult { lcd, back_s: Some(back_s), within_s: Some(2.0), met: true, ..CaseResult::default() })
}

fn gpu_hang(bench: &mut HilBench) -> Result<CaseResult> {
    let (_, told, lcd) = gpu(bench, "hang", "GPU_HANG")?;
    thread::sleep(Duration::from_secs(2));
    let ready = bench.ready(bench.scaled(15.0))?;
    let back_s = ready.saturating_duration_since(bench.machine.guest.host_time(told)).as_secs_f64();
    Ok(CaseResult { lcd, back_s: Some(back_s), within_s: Some(15.0), met: true, ..CaseResult::default() })
}

/// The trainer is off: seconds that it took by systemd's account.
pub(super) fn off(bench: &mut HilBench) -> Result<f64> {
    let begun = Instant::now();
    bench.service("stop")?;
    let until = Instant::now() + Duration::from_secs(60);
    while bench.machine.guest.run(&["/bin/systemctl", "show", "-P", "ActiveState", "bowwave.service"])?.trim()
        != "inactive"
    {
        ensure!(Instant::now() < until, "the trainer does not stop");
    }
    Ok(begun.elapsed().as_secs_f64())
}

fn stop(bench: &mut HilBench) -> Result<CaseResult> {
    bench.ready(bench.scaled(2.0))?;
    let from = bench.machine.guest.now_ns();
    off(bench)?;
    // The journal may be behind.
    let ended = |e: &JournalEntry| e.text().starts_with("Stopped bowwave.service");
    bench.machine.guest.journal(from, Duration::from_secs(20), "systemd's line of the end", ended)?;
    let lines = bench.machine.guest.journal_since(from);
    let at = |text: &str| lines.iter().find(|e| e.text().starts_with(text)).map(|e| e.at_ns);
    let begun = at("Stopping bowwave.service").context("systemd's line of the beginning")?;
    let ended = at("Stopped bowwave.service")
        .or_else(|| at("bowwave.service: Deactivated"))
        .context("systemd's line of the end")?;
    let told = lines.iter().any(|e| crate::bench::says(&e.fields, "STOP") == Some(JournalChange::Came));
    let seconds = (ended - begun) as f64 * 1e-9;
    let clean =
        !lines.iter().any(|e| e.text().contains("Failed with result") || e.text().contains("timed out"));
    let note =
        format!("{seconds:.2} s from systemd's request to its end{}", if clean { "" } else { ", not clean" });
    Ok(CaseResult {
        lcd: "-".into(),
        back_s: Some(seconds),
        within_s: Some(0.5),
        met: told && clean,
        note,
        ..CaseResult::default()
    })
}

fn database(bench: &mut HilBench) -> Result<CaseResult> {
    bench.ready(bench.scaled(2.0))?;
    off(bench)?;
    let path = format!("{STATE}/hits.sqlite");
    shell(bench, &format!("rm -f {path}-wal {path}-shm"))?;
    bench.machine.guest.call(AgentCommand::Patch { path, offset: 0, count: 8192 })?;
    let from = bench.machine.guest.now_ns();
    bench.service("start")?;
    let told = bench.told("DB_QUARANTINE", JournalChange::Came, from, bench.scaled(15.0))?;
    bench
        .lcd(Instant::now(), bench.scaled(15.0), "a state", |p, _| p != Plate::Black && p != Plate::Plain)?;
    let lcd = bench.status()?;
    bench.keep_picture("row-33");
    let kept = bench.machine.guest.shell(&format!("ls {STATE}"))?.replace('\n', " ");
    let met = lcd.contains("NEW HIT JOURNAL")
        && kept.split(' ').filter(|n| n.starts_with("hits.sqlite")).count() >= 2;
    let seen_s = (told - from) as f64 * 1e-9;
    // The warning lasts as long as the run.
    off(bench)?;
    Ok(CaseResult { lcd, seen_s: Some(seen_s), met, note: kept, ..CaseResult::default() })
}

fn main_pid(bench: &mut HilBench) -> Result<u64> {
    let pid = bench.machine.guest.run(&["/bin/systemctl", "show", "-P", "MainPID", "bowwave.service"])?;
    pid.trim().parse().context("a process")
}

fn hang(bench: &mut HilBench) -> Result<CaseResult> {
    bench.ready(bench.scaled(2.0))?;
    let before = main_pid(bench)?;
    let from = bench.machine.guest.now_ns();
    bench
        .machine
        .guest
        .call_within(AgentCommand::Hold { thread: "camera".into(), ms: 60_000 }, Duration::from_secs(100))?;
    let lines = bench.machine.guest.journal_since(from);
    let own = lines.iter().any(|e| crate::bench::says(&e.fields, "WATCHDOG") == Some(JournalChange::Came));
    let systemd = lines.iter().any(|e| e.text().to_lowercase().contains("watchdog timeout"));
    bench.ready(bench.scaled(15.0))?;
    let after = main_pid(bench)?;
    let note = format!("told by the trainer: {own}, by systemd: {systemd}; process {before}, then {after}");
    Ok(CaseResult { lcd: "frozen".into(), met: systemd && after != before, note, ..CaseResult::default() })
}

fn memory_used_up(bench: &mut HilBench) -> Result<CaseResult> {
    bench.ready(bench.scaled(2.0))?;
    bench.shoot(400)?;
    // Until the last round has ended and is stored.
    thread::sleep(bench.scaled(2.0));
    let (stored, before) = (bench.rounds()?.len(), main_pid(bench)?);
    bench.shoot(400)?;
    let from = bench.machine.guest.now_ns();
    let limit = "systemctl set-property --runtime bowwave.service MemoryMax=";
    bench.machine.guest.shell(&format!("{limit}16M; sleep 2; {limit}1G"))?;
    let killed = |e: &JournalEntry| e.text().contains("oom-kill");
    bench.machine.guest.journal(from, Duration::from_secs(20), "the kill for want of memory", killed)?;
    bench.told("BOOT_DIRTY", JournalChange::Came, from, bench.scaled(15.0))?;
    bench.ready(bench.scaled(15.0))?;
    let (kept, after) = (bench.rounds()?.len(), main_pid(bench)?);
    let lcd = bench.status()?;
    let note = format!("{stored} rounds were stored before, {kept} after; process {before}, then {after}");
    Ok(CaseResult {
        lcd,
        met: stored > 0 && kept >= stored && after != before,
        note,
        ..CaseResult::default()
    })
}

fn crash_loop(bench: &mut HilBench) -> Result<CaseResult> {
    bench.ready(bench.scaled(2.0))?;
    let from = bench.machine.guest.now_ns();
    for _ in 0..4 {
        let line = "for i in $(seq 100); do [ -s /run/bowwave/starts ] && break; sleep 0.1; done; sleep 0.5; systemctl kill -s KILL bowwave.service";
        bench.machine.guest.shell(line)?;
        thread::sleep(Duration::from_millis(1500));
    }
    let told = bench.told("CRASHLOOP", JournalChange::Came, from, bench.scaled(10.0))?;
    let at = bench.machine.guest.host_time(told);
    bench.lcd(at, bench.scaled(10.0), "FAULT", |p, _| p == Plate::Fault)?;
    thread::sleep(Duration::from_secs(1));
    let lcd = bench.status()?;
    bench.keep_picture("row-40");
    off(bench)?;
    Ok(CaseResult { met: lcd.contains("SAFE MODE"), lcd, ..CaseResult::default() })
}
