//! Faults of the inertial unit. Its adapter is QEMU's, on the kernel's USB and ftdi_sio.

use std::{thread, time::Duration};

use anyhow::{Result, ensure};
use bowwave_hil::protocol::{Command, Feed};
use serde_json::json;

use super::{Case, Own, Row, Seen, Shown};
use crate::{
    bench::{Bench, Told},
    lcd::Plate,
    unit::Passage,
};

fn quiet(bench: &mut Bench) -> Result<i64> {
    bench.feed(|f| *f = Feed { trigger: f.trigger, ..Feed::default() })
}

pub(super) fn unplug(bench: &mut Bench) -> Result<i64> {
    let at = bench.machine.guest.now_ns();
    let id = format!("adapter{}", bench.adapter);
    // A plug that is drawn cuts the line. QEMU's adapter must not be left with a byte at hand when it goes: that ends QEMU.
    bench.machine.unit.pass(Passage::Cut);
    thread::sleep(Duration::from_millis(30));
    let removed = bench.machine.qmp.remove(&id);
    bench.machine.unit.pass(Passage::Straight);
    removed.map(|()| at)
}

pub(super) fn plug(bench: &mut Bench) -> Result<i64> {
    bench.adapter += 1;
    let id = format!("adapter{}", bench.adapter);
    bench.machine.plug_adapter(&id)?;
    Ok(bench.machine.guest.now_ns())
}

fn unplug_shooting(bench: &mut Bench) -> Result<i64> {
    let at = unplug(bench)?;
    thread::sleep(Duration::from_millis(400));
    let from = bench.shoot(300)?;
    bench.blind.push((from, bench.machine.guest.now_ns()));
    Ok(at)
}

fn sanity(number: &'static str, injected: &'static str, inject: fn(&mut Bench) -> Result<i64>) -> Row {
    Row::Case(Case {
        number,
        fault: "IMU stuck, NaN, saturated",
        injected,
        code: "IMU_SANITY",
        shown: Shown::NotScored("IMU STUCK"),
        seen_s: Some(0.3),
        back_s: Some(1.0),
        lasts: true,
        stays_s: 0.5,
        inject,
        end: quiet,
    })
}

pub fn rows() -> Vec<Row> {
    vec![
        Row::Case(Case {
            number: "14",
            fault: "IMU unplugged",
            injected: "QEMU removes the USB adapter; a burst is fired meanwhile",
            code: "IMU_LOST",
            shown: Shown::NotScored("IMU LOST"),
            seen_s: Some(0.1),
            back_s: Some(1.0),
            lasts: true,
            stays_s: 0.5,
            inject: unplug_shooting,
            end: plug,
        }),
        Row::Own(Own {
            number: "14b",
            fault: "IMU unplugged: no busy loop",
            injected: "QEMU removes the USB adapter for 5 s",
            code: "IMU_LOST",
            target: "IMU's threads under 5 % of a core",
            run: idle_without,
        }),
        Row::Own(Own {
            number: "15",
            fault: "IMU back under another name",
            injected: "removed; another adapter takes ttyUSB0 first, so that it comes back as ttyUSB1",
            code: "IMU_RENUM",
            target: "back 1 s",
            run: renumbered,
        }),
        Row::Own(Own {
            number: "16",
            fault: "read() that never returns",
            injected: "the reading thread is stopped with ptrace for 3 s, as by a driver that does not return",
            code: "IMU_BLOCKED",
            target: "seen 0.2 s",
            run: blocked,
        }),
        Row::Case(Case {
            number: "17",
            fault: "Adapter batches for 16 ms",
            injected: "the line hands bytes on every 60 ms only",
            code: "IMU_LATENCY",
            shown: Shown::Warning("IMU LATE"),
            seen_s: None,
            back_s: None,
            lasts: true,
            stays_s: 0.5,
            inject: |b| {
                b.machine.unit.pass(Passage::Batched(Duration::from_millis(60)));
                Ok(b.machine.guest.now_ns())
            },
            end: |b| {
                b.machine.unit.pass(Passage::Straight);
                Ok(b.machine.guest.now_ns())
            },
        }),
        Row::Own(Own {
            number: "18",
            fault: "Garbage or split packets",
            injected: "5 % of the packets cut or after garbage, all in pieces of 7 bytes",
            code: "-",
            target: "resync within 2 packets: READY throughout",
            run: garbage,
        }),
        Row::Case(Case {
            number: "19",
            fault: "Wrong baud rate",
            injected: "the unit goes on at 115200 baud; at another rate the line gives other bytes",
            code: "IMU_BAUD",
            shown: Shown::NotScored("IMU LOST"),
            seen_s: None,
            back_s: None,
            lasts: true,
            stays_s: 0.0,
            inject: |b| {
                b.machine.unit.set_baud(115_200);
                Ok(b.machine.guest.now_ns())
            },
            // Nothing is mended: the rate must be found.
            end: |_| Ok(0),
        }),
        sanity("20a", "rates and accelerations repeat, the unit's clock goes on", |b| {
            b.feed(|f| f.stuck = true)
        }),
        sanity("20b", "rates are no numbers", |b| b.feed(|f| f.nan = true)),
        sanity("20c", "rates at the end of the scale", |b| b.feed(|f| f.saturated = true)),
    ]
}

fn threads_ticks(bench: &mut Bench, prefix: &str) -> Result<(u64, i64)> {
    let usage = bench.machine.guest.call(Command::Usage)?;
    let threads = usage["threads"].as_object().cloned().unwrap_or_default();
    let sum = threads.iter().filter(|(n, _)| n.starts_with(prefix)).filter_map(|(_, v)| v.as_u64()).sum();
    Ok((sum, usage["now_ns"].as_i64().unwrap_or(0)))
}

fn idle_without(bench: &mut Bench) -> Result<Seen> {
    bench.ready(bench.scaled(2.0))?;
    let from = unplug(bench)?;
    bench.told("IMU_LOST", Told::Came, from, bench.scaled(2.0))?;
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
    Ok(Seen { lcd, met, scaled: share >= 0.05, note, ..Seen::default() })
}

fn renumbered(bench: &mut Bench) -> Result<Seen> {
    bench.ready(bench.scaled(2.0))?;
    let from = unplug(bench)?;
    bench.told("IMU_LOST", Told::Came, from, bench.scaled(2.0))?;
    let lcd = bench.status()?;
    // Something else on a USB port, with another serial number.
    let null = json!({ "id": "other", "backend": { "type": "null", "data": {} } });
    bench.machine.qmp.execute("chardev-add", null)?;
    let other = json!({ "driver": "usb-serial", "id": "other0", "chardev": "other", "bus": "usb.0", "serial": "other", "always-plugged": true });
    bench.machine.qmp.execute("device_add", other)?;
    thread::sleep(Duration::from_secs(3));
    let plugged = plug(bench)?;
    let back = bench.told("IMU_LOST", Told::Went, plugged, bench.scaled(2.0));
    let renamed = bench.told("IMU_RENUM", Told::Came, plugged, bench.scaled(1.0));
    let nodes = bench.machine.guest.shell("ls -l /dev/ttyUSB* /dev/bowwave | cut -d ' ' -f 5-")?;
    bench.machine.qmp.remove("other0")?;
    bench.machine.qmp.execute("chardev-remove", json!({ "id": "other" }))?;
    bench.settle()?;
    ensure!(nodes.contains("ttyUSB1"), "it did not come back under another name: {nodes}");
    let back_s = (back?.max(renamed?) - plugged) as f64 * 1e-9;
    Ok(Seen {
        lcd,
        back_s: Some(back_s),
        within_s: Some(1.0),
        met: true,
        note: nodes.replace('\n', " "),
        ..Seen::default()
    })
}

fn blocked(bench: &mut Bench) -> Result<Seen> {
    bench.ready(bench.scaled(2.0))?;
    let from = bench.machine.guest.now_ns();
    let held = bench.machine.guest.call(Command::Hold { thread: "imu-serial".into(), ms: 3000 })?;
    let begun = held["begun_ns"].as_i64().unwrap_or(from);
    let told = bench.told("IMU_BLOCKED", Told::Came, from, bench.scaled(1.0))?;
    let at = bench.machine.guest.host_time(begun);
    let seen = bench.lcd(at, Duration::from_secs(5), "NOT SCORED", |p, _| p == Plate::NotScored)?;
    bench.settle()?;
    let seen_s = seen.saturating_duration_since(at).as_secs_f64();
    let note = format!("in the journal after {:.0} ms", (told - begun) as f64 * 1e-6);
    Ok(Seen {
        lcd: "NOT SCORED".into(),
        seen_s: Some(seen_s),
        within_s: Some(0.2),
        met: true,
        note,
        ..Seen::default()
    })
}

fn garbage(bench: &mut Bench) -> Result<Seen> {
    bench.ready(bench.scaled(2.0))?;
    bench.machine.unit.pass(Passage::Split);
    bench.feed(|f| f.garbage = 0.05)?;
    let since = std::time::Instant::now();
    thread::sleep(Duration::from_secs(5));
    let lcd = bench.status()?;
    bench.settle()?;
    let lost = bench.machine.lcd.first(since, |s| s.plate == Plate::NotScored);
    Ok(Seen { met: lost.is_none() && lcd.starts_with("READY"), lcd, ..Seen::default() })
}
