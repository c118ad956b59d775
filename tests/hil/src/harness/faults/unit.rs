//! Faults of the inertial unit. Its adapter is QEMU's, on the kernel's USB and ftdi_sio.

use std::{thread, time::Duration};

use anyhow::{Result, ensure};
use bowwave_hil::protocol::AgentCommand;
use serde_json::json;

use super::{CaseResult, FaultCase, FaultRow, LcdShown, SpecialCase, quiet};
use crate::{
    bench::{HilBench, JournalChange},
    lcd::Plate,
    unit::Passage,
};

pub(super) fn unplug(bench: &mut HilBench) -> Result<i64> {
    let at = bench.machine.guest.now_ns();
    let id = format!("adapter{}", bench.adapter);
    // A plug that is drawn cuts the line. QEMU's adapter must not be left with a byte at hand when it goes: that ends QEMU.
    bench.machine.unit.pass(Passage::Cut);
    thread::sleep(Duration::from_millis(30));
    let removed = bench.machine.qmp.remove(&id);
    bench.machine.unit.pass(Passage::Straight);
    removed.map(|()| at)
}

pub(super) fn plug(bench: &mut HilBench) -> Result<i64> {
    bench.adapter += 1;
    let id = format!("adapter{}", bench.adapter);
    bench.machine.plug_adapter(&id)?;
    Ok(bench.machine.guest.now_ns())
}

fn unplug_shooting(bench: &mut HilBench) -> Result<i64> {
    let at = unplug(bench)?;
    bench.shoot_blind(Duration::from_millis(400), 300)?;
    Ok(at)
}

fn sanity(
    number: &'static str,
    injected: &'static str,
    inject: fn(&mut HilBench) -> Result<i64>,
) -> FaultRow {
    FaultRow::Case(FaultCase {
        number,
        fault: "IMU stuck, NaN, saturated",
        injected,
        code: "IMU_SANITY",
        shown: LcdShown::NotScored("IMU STUCK"),
        seen_s: Some(0.3),
        back_s: Some(1.0),
        inject,
        end: quiet,
        ..FaultCase::USUAL
    })
}

pub fn rows() -> Vec<FaultRow> {
    vec![
        FaultRow::Case(FaultCase {
            number: "14",
            fault: "IMU unplugged",
            injected: "QEMU removes the USB adapter; a burst is fired meanwhile",
            code: "IMU_LOST",
            shown: LcdShown::NotScored("IMU LOST"),
            seen_s: Some(0.1),
            back_s: Some(1.0),
            inject: unplug_shooting,
            end: plug,
            ..FaultCase::USUAL
        }),
        FaultRow::Own(SpecialCase {
            number: "14b",
            fault: "IMU unplugged: no busy loop",
            injected: "QEMU removes the USB adapter for 5 s",
            code: "IMU_LOST",
            target: "IMU's threads under 5 % of a core",
            run: idle_without,
        }),
        FaultRow::Own(SpecialCase {
            number: "15",
            fault: "IMU back under another name",
            injected: "removed; another adapter takes ttyUSB0 first, so that it comes back as ttyUSB1",
            code: "IMU_RENUM",
            target: "back 1 s",
            run: renumbered,
        }),
        FaultRow::Own(SpecialCase {
            number: "16",
            fault: "read() that never returns",
            injected: "the reading thread is stopped with ptrace for 3 s, as by a driver that does not return",
            code: "IMU_BLOCKED",
            target: "seen 0.2 s",
            run: blocked,
        }),
        FaultRow::Case(FaultCase {
            number: "17",
            fault: "Adapter batches for 16 ms",
            injected: "the line hands bytes on every 60 ms only",
            code: "IMU_LATENCY",
            shown: LcdShown::Warning("IMU LATE"),
            inject: |b| {
                b.machine.unit.pass(Passage::Batched(Duration::from_millis(60)));
                Ok(b.machine.guest.now_ns())
            },
            end: |b| {
                b.machine.unit.pass(Passage::Straight);
                Ok(b.machine.guest.now_ns())
            },
            ..FaultCase::USUAL
        }),
        FaultRow::Own(SpecialCase {
            number: "18",
            fault: "Garbage or split packets",
            injected: "5 % of the packets cut or after garbage, all in pieces of 7 bytes",
            code: "-",
            target: "resync within 2 packets: READY throughout",
            run: garbage,
        }),
        FaultRow::Case(FaultCase {
            number: "19",
            fault: "Wrong baud rate",
            injected: "the unit goes on at 115200 baud; at another rate the line gives other bytes",
            code: "IMU_BAUD",
            shown: LcdShown::NotScored("IMU LOST"),
            stays_s: 0.0,
            inject: |b| {
                b.machine.unit.set_baud(115_200);
                Ok(b.machine.guest.now_ns())
            },
            // Nothing is mended: the rate must be found.
            end: |_| Ok(0),
            ..FaultCase::USUAL
        }),
        sanity("20a", "rates and accelerations repeat, the unit's clock goes on", |b| {
            b.feed(|f| f.stuck = true)
        }),
        sanity("20b", "rates are no numbers", |b| b.feed(|f| f.nan = true)),
        sanity("20c", "rates at the end of the scale", |b| b.feed(|f| f.saturated = true)),
    ]
}

fn threads_ticks(bench: &mut HilBench, prefix: &str) -> Result<(u64, i64)> {
    let usage = bench.machine.guest.call(AgentCommand::Usage)?;
    let threads = usage["threads"].as_object().cloned().unwrap_or_default();
    let sum = threads.iter().filter(|(n, _)| n.starts_with(prefix)).filter_map(|(_, v)| v.as_u64()).sum();
    Ok((sum, usage["now_ns"].as_i64().unwrap_or(0)))
}

fn idle_without(bench: &mut HilBench) -> Result<CaseResult> {
    bench.ready(bench.scaled(2.0))?;
    let from = unplug(bench)?;
    bench.told("IMU_LOST", JournalChange::Came, from, bench.scaled(2.0))?;
    let (before, begun) = threads_ticks(bench, "imu")?;
    thread::sleep(Duration::from_secs(5));
    let (after, ended) = threads_ticks(bench, "imu")?;
    let lcd = bench.status()?;
    plug(bench)?;
    bench.settle()?;
    let share = (after - before) as f64 / 100.0 / ((ended - begun) as f64 * 1e-9);
    let note = format!(
        "{:.1} % of one of the machine's cores, which is {:.0} times slower",
        share * 100.0,
        bench.slow
    );
    // The machine's core is so much slower, and the same work so much longer.
    let met = share < 0.05 * bench.slow.min(4.0);
    Ok(CaseResult { lcd, met, scaled: share >= 0.05, note, ..CaseResult::default() })
}

fn renumbered(bench: &mut HilBench) -> Result<CaseResult> {
    bench.ready(bench.scaled(2.0))?;
    let from = unplug(bench)?;
    bench.told("IMU_LOST", JournalChange::Came, from, bench.scaled(2.0))?;
    let lcd = bench.status()?;
    // Something else on a USB port, with another serial number.
    let null = json!({ "id": "other", "backend": { "type": "null", "data": {} } });
    bench.machine.qmp.execute("chardev-add", null)?;
    let other = json!({ "driver": "usb-serial", "id": "other0", "chardev": "other", "bus": "usb.0", "serial": "other", "always-plugged": true });
    bench.machine.qmp.execute("device_add", other)?;
    thread::sleep(Duration::from_secs(3));
    let plugged = plug(bench)?;
    let back = bench.told("IMU_LOST", JournalChange::Went, plugged, bench.scaled(2.0));
    let renamed = bench.told("IMU_RENUM", JournalChange::Came, plugged, bench.scaled(1.0));
    let nodes = bench.machine.guest.shell("ls -l /dev/ttyUSB* /dev/bowwave | cut -d ' ' -f 5-")?;
    bench.machine.qmp.remove("other0")?;
    bench.machine.qmp.execute("chardev-remove", json!({ "id": "other" }))?;
    bench.settle()?;
    ensure!(nodes.contains("ttyUSB1"), "it did not come back under another name: {nodes}");
    let back_s = (back?.max(renamed?) - plugged) as f64 * 1e-9;
    Ok(CaseResult {
        lcd,
        back_s: Some(back_s),
        within_s: Some(1.0),
        met: true,
        note: nodes.replace('\n', " "),
        ..CaseResult::default()
    })
}

fn blocked(bench: &mut HilBench) -> Result<CaseResult> {
    bench.ready(bench.scaled(2.0))?;
    let from = bench.machine.guest.now_ns();
    let held = bench.machine.guest.call(AgentCommand::Hold { thread: "imu-serial".into(), ms: 3000 })?;
    let begun = held["begun_ns"].as_i64().unwrap_or(from);
    let told = bench.told("IMU_BLOCKED", JournalChange::Came, from, bench.scaled(1.0))?;
    let at = bench.machine.guest.host_time(begun);
    let seen = bench.lcd(at, Duration::from_secs(5), "NOT SCORED", |p, _| p == Plate::NotScored)?;
    bench.settle()?;
    let seen_s = seen.saturating_duration_since(at).as_secs_f64();
    let note = format!("in the journal after {:.0} ms", (told - begun) as f64 * 1e-6);
    Ok(CaseResult {
        lcd: "NOT SCORED".into(),
        seen_s: Some(seen_s),
        within_s: Some(0.2),
        ..CaseResult::met(note)
    })
}

fn garbage(bench: &mut HilBench) -> Result<CaseResult> {
    bench.ready(bench.scaled(2.0))?;
    bench.machine.unit.pass(Passage::Split);
    bench.feed(|f| f.garbage = 0.05)?;
    let since = std::time::Instant::now();
    thread::sleep(Duration::from_secs(5));
    let lcd = bench.status()?;
    bench.settle()?;
    let lost = bench.machine.lcd.first(since, |s| s.plate == Plate::NotScored);
    Ok(CaseResult { met: lost.is_none() && lcd.starts_with("READY"), lcd, ..CaseResult::default() })
}
