//! Faults of the camera. The driver is the bench's own (`modules/hilcam.c`), on the kernel's videobuf2 as uvcvideo is.

use std::{thread, time::Duration};

use anyhow::{Result, ensure};
use bowwave_hil::protocol::AgentCommand;

use super::{CaseResult, FaultCase, FaultRow, LcdShown, SpecialCase, quiet};
use crate::{
    bench::{Configured, HilBench, JournalChange, PICTURE},
    guest::JournalEntry,
};

const EBUSY: i32 = 16;
const EPROTO: i32 = 71;

/// The camera's modes while nothing is wrong.
pub fn modes() -> String {
    let (w, h) = PICTURE;
    format!("YUYV:{w}x{h}@30 MJPG:{w}x{h}@30 YUYV:{}x{}@30", w / 2, h / 2)
}

/// Draws the camera's plug and puts it in again with other modes; the machine's time of that.
fn plug_with(bench: &mut HilBench, modes: &str) -> Result<i64> {
    bench.camera("unplug")?;
    bench.camera(&format!("modes {modes}"))?;
    bench.camera("plug 0")
}

/// The camera goes while rounds are fired: none of them may be scored.
fn unplug_shooting(bench: &mut HilBench) -> Result<i64> {
    let at = bench.camera("unplug")?;
    bench.shoot_blind(Duration::from_millis(400), 300)?;
    Ok(at)
}

pub fn rows() -> Vec<FaultRow> {
    vec![
        FaultRow::Case(FaultCase {
            number: "1",
            fault: "Camera unplugged",
            injected: "driver unregisters the device while it streams; a burst is fired meanwhile",
            code: "CAM_LOST",
            shown: LcdShown::NotScored("CAMERA LOST"),
            seen_s: Some(0.1),
            back_s: Some(1.0),
            inject: unplug_shooting,
            end: |b| b.camera("plug 0"),
            ..FaultCase::USUAL
        }),
        FaultRow::Own(SpecialCase {
            number: "2",
            fault: "Camera back as another node",
            injected: "unregistered as /dev/video0, registered as /dev/video7",
            code: "CAM_RENUM",
            target: "back 1 s",
            run: renumbered,
        }),
        FaultRow::Case(FaultCase {
            number: "3",
            fault: "Camera stalls without an error",
            injected: "no picture is delivered, the queue stays whole",
            code: "CAM_STALL",
            shown: LcdShown::NotScored("CAMERA STALLED"),
            seen_s: Some(0.1),
            back_s: Some(2.0),
            stays_s: 1.0,
            inject: |b| b.feed(|f| f.stall = true),
            end: quiet,
            ..FaultCase::USUAL
        }),
        FaultRow::Case(FaultCase {
            number: "4",
            fault: "Shock: permanent EPROTO",
            injected: "the queue fails, and then starting to stream answers EPROTO",
            code: "CAM_EPROTO",
            shown: LcdShown::NotScored("CAMERA LINK BROKEN"),
            back_s: Some(5.0),
            stays_s: 1.0,
            inject: |b| {
                b.camera(&format!("fail streamon {EPROTO}"))?;
                b.camera("fail queue")
            },
            end: |b| b.camera("fail streamon 0"),
            ..FaultCase::USUAL
        }),
        FaultRow::Own(SpecialCase {
            number: "5",
            fault: "Buffer with the error flag",
            injected: "6 % of the buffers carry V4L2_BUF_FLAG_ERROR",
            code: "-",
            target: "next frame: no fault of the camera",
            run: |b| goes_on(b, |f| f.flagged = 0.06),
        }),
        FaultRow::Case(FaultCase {
            number: "7",
            fault: "EIO from the queue",
            injected: "videobuf2's queue fails until streaming is started anew",
            code: "CAM_QUEUE",
            shown: LcdShown::Nothing,
            back_s: Some(0.5),
            stays_s: 0.0,
            inject: |b| b.camera("fail queue"),
            end: |_| Ok(0),
            ..FaultCase::USUAL
        }),
        FaultRow::Case(FaultCase {
            number: "8",
            fault: "Format or size changed",
            injected: "unplugged, and back with half the size only",
            code: "CAM_FORMAT",
            shown: LcdShown::Fault("CAL LOST"),
            back_s: Some(1.0),
            inject: |b| {
                let (w, h) = PICTURE;
                plug_with(b, &format!("YUYV:{}x{}@30", w / 2, h / 2))
            },
            end: |b| plug_with(b, &modes()),
            ..FaultCase::USUAL
        }),
        FaultRow::Case(FaultCase {
            number: "9",
            fault: "Device busy",
            injected: "unplugged, and back answering EBUSY as with another owner",
            code: "CAM_BUSY",
            shown: LcdShown::NotScored("CAMERA IN USE"),
            back_s: Some(1.0),
            inject: |b| {
                b.camera(&format!("fail control {EBUSY}"))?;
                b.camera("unplug")?;
                b.camera("plug 0")
            },
            end: |b| b.camera("fail control 0"),
            ..FaultCase::USUAL
        }),
        FaultRow::Own(SpecialCase {
            number: "10",
            fault: "No bandwidth (ENOSPC)",
            injected: "starting modes of more than 1 MB/s answers ENOSPC: YUYV is too much, MJPEG of the same size is not",
            code: "CAM_BW",
            target: "smaller mode in 2 s",
            run: no_bandwidth,
        }),
        FaultRow::Case(FaultCase {
            number: "11",
            fault: "Camera timestamps backward",
            injected: "20 % of the pictures are stamped two seconds back",
            code: "CAM_TS",
            shown: LcdShown::Nothing,
            lasts: false,
            stays_s: 1.0,
            inject: |b| b.feed(|f| f.backwards = 0.2),
            end: quiet,
            ..FaultCase::USUAL
        }),
        FaultRow::Case(FaultCase {
            number: "13",
            fault: "Lens covered, image frozen",
            injected: "the same picture again and again",
            code: "CAM_STATIC",
            shown: LcdShown::Warning("PICTURE FROZEN"),
            seen_s: Some(1.0),
            back_s: Some(1.0),
            inject: |b| b.feed(|f| f.freeze = true),
            end: quiet,
            ..FaultCase::USUAL
        }),
        FaultRow::Own(SpecialCase {
            number: "5b",
            fault: "Camera lies about its format",
            injected: "6 % of the pictures have half the bytes",
            code: "-",
            target: "next frame: no fault of the camera",
            run: |b| goes_on(b, |f| f.short = 0.06),
        }),
        FaultRow::Case(FaultCase {
            number: "6",
            fault: "Truncated or corrupt MJPEG",
            injected: "the camera offers MJPEG only; then 60 % of the pictures are cut or scrambled",
            code: "CAM_CORRUPT",
            shown: LcdShown::Warning("PICTURES DAMAGED"),
            inject: |b| {
                let (w, h) = PICTURE;
                plug_with(b, &format!("MJPG:{w}x{h}@30"))?;
                thread::sleep(b.scaled(0.1));
                b.ready(b.scaled(1.0) + Duration::from_secs(20))?;
                b.feed(|f| f.corrupt = 0.6)
            },
            end: |b| {
                let at = quiet(b)?;
                b.told("CAM_CORRUPT", JournalChange::Went, at, b.scaled(2.0))?;
                plug_with(b, &modes())?;
                Ok(at)
            },
            ..FaultCase::USUAL
        }),
        FaultRow::Own(SpecialCase {
            number: "12",
            fault: "Another camera than the one calibrated",
            injected: "a calibration of the camera with another serial number is configured, SIGHUP",
            code: "CAL_MISMATCH",
            target: "until recalibrated",
            run: mismatch,
        }),
    ]
}

/// The camera goes on: no fault of its own in the journal, and the LCD shows none of its causes.
fn goes_on(bench: &mut HilBench, change: fn(&mut bowwave_hil::protocol::PlayerFeed)) -> Result<CaseResult> {
    bench.ready(bench.scaled(2.0))?;
    let from = bench.feed(change)?;
    thread::sleep(Duration::from_secs(5));
    let status = bench.status()?;
    quiet(bench)?;
    let of_camera = |e: &JournalEntry| {
        e.fields["FAULT_STATE"] == "raised"
            && e.fields["FAULT_CODE"].as_str().is_some_and(|c| c.starts_with("CAM"))
    };
    let lines = bench.machine.guest.journal_since(from);
    let mut said: Vec<&str> = lines.iter().filter(|e| of_camera(e)).map(JournalEntry::text).collect();
    let shown = status.contains("CAM") || status.contains("PICTURE");
    let met = said.is_empty() && !shown;
    said.extend(shown.then_some(status.as_str()));
    let note = said.join("; ");
    Ok(CaseResult { lcd: status, met, note, ..CaseResult::default() })
}

fn renumbered(bench: &mut HilBench) -> Result<CaseResult> {
    bench.ready(bench.scaled(2.0))?;
    let from = bench.camera("unplug")?;
    bench.told("CAM_LOST", JournalChange::Came, from, bench.scaled(1.0))?;
    let lcd = bench.status()?;
    let plugged = bench.camera("plug 7")?;
    let renamed = bench.told("CAM_RENUM", JournalChange::Came, plugged, bench.scaled(2.0))?;
    let back = bench.told("CAM_LOST", JournalChange::Went, plugged, bench.scaled(2.0))?;
    bench.ready(bench.scaled(2.0))?;
    let back_s = (back.max(renamed) - plugged) as f64 * 1e-9;
    Ok(CaseResult { lcd, back_s: Some(back_s), within_s: Some(1.0), met: true, ..CaseResult::default() })
}

fn no_bandwidth(bench: &mut HilBench) -> Result<CaseResult> {
    bench.ready(bench.scaled(2.0))?;
    let from = bench.machine.guest.now_ns();
    bench.camera("bandwidth 1000000")?;
    bench.camera("unplug")?;
    let plugged = bench.camera("plug 0")?;
    let told = bench.told("CAM_BW", JournalChange::Came, from, bench.scaled(3.0))?;
    bench.ready(bench.scaled(2.0))?;
    let streams = bench.machine.guest.now_ns();
    let state = bench.machine.guest.call(AgentCommand::CameraState)?;
    let lcd = bench.says("USB TOO SLOW")?;
    bench.keep_picture("row-10");
    ensure!(
        state["streaming"] == 1 && state["fourcc"] == "MJPG",
        "it does not stream the smaller mode: {state}"
    );
    let (seen_s, back_s) = ((told - plugged) as f64 * 1e-9, (streams - plugged) as f64 * 1e-9);
    Ok(CaseResult {
        lcd,
        seen_s: Some(seen_s),
        back_s: Some(back_s),
        within_s: Some(2.0),
        met: true,
        ..CaseResult::default()
    })
}

fn mismatch(bench: &mut HilBench) -> Result<CaseResult> {
    bench.ready(bench.scaled(2.0))?;
    let mut other = hw_sim::make::calibration(&crate::bench::recipe());
    other.camera_serial = "0002".into();
    let text = bowwave_calibration::to_toml(&other);
    let path = "/run/hil/etc/other.toml".to_owned();
    bench.machine.guest.call(AgentCommand::Write { path, text })?;
    bench.configure(&Configured { calibration: "other.toml".into(), ..Configured::default() })?;
    let from = bench.machine.guest.now_ns();
    bench.service("reload")?;
    let told = bench.told("CAL_MISMATCH", JournalChange::Came, from, bench.scaled(2.0));
    let lcd = bench.says("CAL MISMATCH").or_else(|_| bench.status())?;
    bench.keep_picture("row-12");
    bench.configure(&Configured::default())?;
    bench.service("reload")?;
    told?;
    Ok(CaseResult { met: lcd.contains("CAL MISMATCH"), lcd, ..CaseResult::default() })
}
