//! Every fault of the camera against a scripted driver and a clock of numbers.

mod bench;

use std::path::Path;

use bowwave_core::event::Picture;
use rustix::io::Errno;

use super::*;
use crate::camera::{Coding, Rate, WantedMode, negotiate::Rates, timing::BufferStamp};
use bench::*;

/// Rows 1: unplugged and back.
#[test]
fn an_unplugged_camera_is_told_at_once_and_back_within_a_second() {
    for how in [Errno::NODEV, Errno::NXIO] {
        let mut bench = yuyv().streaming();
        let unplugged = bench.now;
        bench.fake.dequeue_fails = Some(how);
        let known = std::mem::take(&mut bench.fake.found);
        bench.step(Ready { failed: true, ..Ready::default() });
        assert_eq!(bench.told(unplugged), [(Fault::CamLost, "raised", 0)]);
        assert_eq!(bench.fake.log, ["close"]);
        bench.pass(3000);
        assert_eq!((bench.life(), bench.told(unplugged)), (CameraLife::Searching, vec![]));
        bench.fake.found = known;
        bench.fake.dequeue_fails = None;
        let back = bench.now;
        bench.pass(150);
        bench.frames(1);
        let told = bench.told(back);
        assert!(matches!(told[..], [(Fault::CamLost, "cleared", ..1000)]), "{told:?}");
        assert_eq!(bench.life(), CameraLife::Streaming);
    }
}

/// Row 2: back under another name.
#[test]
fn a_camera_under_another_node_is_the_same_camera() {
    let mut bench = yuyv().streaming();
    bench.fake.dequeue_fails = Some(Errno::NODEV);
    bench.step(Ready { failed: true, ..Ready::default() });
    bench.fake.dequeue_fails = None;
    bench.fake.found = vec![camera("/dev/video0", "Z"), camera("/dev/video3", "A")];
    let back = bench.now;
    bench.pass(150);
    bench.frames(1);
    let told = bench.told(back);
    assert!(told.iter().any(|(f, what, _)| (*f, *what) == (Fault::CamRenumbered, "noted")), "{told:?}");
    assert_eq!(bench.machine.status().in_use.unwrap().node, Path::new("/dev/video3"));
}

/// Row 3: no frames and no error.
#[test]
fn a_stall_is_seen_in_100_ms_and_ended_more_and_more_roughly() {
    let mut bench = yuyv().streaming();
    let last = bench.now;
    bench.pass(101);
    assert_eq!(bench.told(last), [(Fault::CamStall, "raised", 100)]);
    assert_eq!((bench.life(), bench.fake.log.len()), (CameraLife::Stalled, 0), "it may go on by itself");
    bench.pass(150);
    assert_eq!(bench.fake.log, ["restart"]);
    let restarted = bench.now;
    bench.frames(12);
    assert_eq!(bench.told(restarted), [(Fault::CamStall, "cleared", 33)]);
    // Nothing helps: opened anew, then reset, for ever, and told once.
    bench.fake.log.clear();
    bench.pass(30_000);
    let told = bench.told(restarted);
    assert!(matches!(told[..], [(Fault::CamStall, "raised", _)]), "{told:?}");
    assert!(
        bench.fake.log.starts_with(&["restart", "close", "open", "start", "close", "reset"]),
        "{:?}",
        bench.fake.log
    );
    assert!(bench.fake.log.iter().filter(|l| **l == "reset").count() >= 2);
}

#[test]
fn a_stall_ends_by_itself_when_frames_come_in_time() {
    let mut bench = yuyv().streaming();
    let last = bench.now;
    bench.pass(120);
    bench.frames(1);
    assert_eq!(bench.told(last), [(Fault::CamStall, "raised", 100), (Fault::CamStall, "cleared", 153)]);
    assert!(bench.fake.log.is_empty());
}

#[test]
fn a_slow_camera_does_not_stall() {
    let rate = Rate::hz(10).unwrap();
    let wanted = WantedMode { coding: Coding::Yuyv, width: 64, height: 48, rate };
    let mut bench =
        CameraBench::new(b"YUYV", CameraSettings { modes: vec![wanted], ..CameraSettings::default() });
    bench.fake.offers[0].sizes[0].1 = Rates::Listed(vec![rate]);
    bench.step(Ready::default());
    for _ in 0..10 {
        bench.pass(100);
        let picture = bench.picture();
        bench.fill(picture, false);
        bench.step(Ready { filled: true, ..Ready::default() });
    }
    assert_eq!((bench.frames.len(), bench.told(Time::MIN)), (10, vec![]));
}

/// Row 4: the link fails for good until a reset.
#[test]
fn three_failures_of_the_link_lead_to_a_reset() {
    for reset_works in [true, false] {
        let mut bench = yuyv().streaming();
        bench.fake.reset_works = reset_works;
        bench.fake.dequeue_fails = Some(Errno::PROTO);
        bench.fake.open_fails = [Errno::PROTO, Errno::PROTO].into();
        let shock = bench.now;
        bench.step(Ready { failed: true, ..Ready::default() });
        assert_eq!(bench.told(shock), [(Fault::CamProtocol, "raised", 0)]);
        bench.fake.dequeue_fails = None;
        bench.pass(500);
        assert_eq!(bench.fake.log.last(), Some(&"reset"));
        assert_eq!(bench.life(), CameraLife::Resetting);
        assert_eq!(bench.counters().resets, u64::from(reset_works));
        bench.pass(500);
        bench.frames(1);
        let told = bench.told(shock);
        assert!(matches!(told[..], [(Fault::CamProtocol, "cleared", ..5000)]), "{told:?}");
    }
}

/// Row 5: a buffer with the error flag.
#[test]
fn a_damaged_buffer_is_counted_and_the_next_frame_comes() {
    let mut bench = yuyv().streaming();
    bench.now = bench.now.plus_ns(PERIOD_NS);
    bench.fill(vec![1; 64 * 48 * 2], true);
    bench.step(Ready { filled: true, ..Ready::default() });
    assert!(bench.frames.is_empty());
    bench.frames(1);
    assert_eq!((bench.frames.len(), bench.told(Time::MIN)), (1, vec![]));
    assert_eq!(bench.counters().damaged_buffers, 1);
}

/// Row 6: cut and corrupt JPEGs, and JPEGs that lie.
#[test]
fn damaged_jpegs_are_counted_told_above_thirty_percent_and_forgotten_below_ten() {
    let mut bench = mjpeg().streaming();
    let send = |bench: &mut CameraBench, cut: bool| {
        let mut picture = bench.picture();
        if cut {
            picture.truncate(picture.len() * 2 / 3);
        }
        bench.send(picture);
    };
    (0..40).for_each(|n| send(&mut bench, n % 5 == 0));
    assert_eq!((bench.frames.len(), bench.told(Time::MIN)), (32, vec![]), "20 % is not worth a word");
    (0..60).for_each(|n| send(&mut bench, n % 2 == 0));
    assert!(matches!(bench.told(Time::MIN)[..], [(Fault::CamCorrupt, "raised", _)]));
    (0..70).for_each(|_| send(&mut bench, false));
    assert!(matches!(bench.told(Time::MIN)[..], [(Fault::CamCorrupt, "cleared", _)]));
    assert_eq!(bench.counters().damaged_pictures, 8 + 30);
    let jpeg = bench.frames[0].jpeg.as_ref().unwrap();
    assert!(jpeg.ends_with(&[0xff, 0xd9]));
}

/// Row 7: EIO.
#[test]
fn a_failed_queue_is_opened_again_within_half_a_second() {
    let mut bench = yuyv().streaming();
    bench.fake.dequeue_fails = Some(Errno::IO);
    let failed = bench.now;
    bench.step(Ready { failed: true, ..Ready::default() });
    bench.fake.dequeue_fails = None;
    bench.pass(250);
    bench.frames(1);
    let told = bench.told(failed);
    assert!(
        matches!(told[..], [(Fault::CamQueue, "raised", 0), (Fault::CamQueue, "cleared", ..500)]),
        "{told:?}"
    );
    assert_eq!(bench.fake.log, ["close", "open", "start"]);
}

#[test]
fn a_queue_that_only_says_that_it_failed_is_opened_again() {
    let mut bench = yuyv().streaming();
    bench.step(Ready { failed: true, ..Ready::default() });
    assert!(matches!(bench.told(Time::MIN)[..], [(Fault::CamQueue, "raised", _)]));
}

/// Row 8: another format than before, or than the calibrated one.
#[test]
fn another_size_than_the_calibrated_one_is_told_until_it_is_back() {
    let mut bench = yuyv().streaming();
    let other = SetFormat { width: 32, height: 24, bytes_per_line: 64, ..bench.fake.agreed() };
    (bench.fake.format_set, bench.fake.changed) = (Some(other), true);
    let changed = bench.now;
    bench.step(Ready { event: true, ..Ready::default() });
    bench.pass(10);
    assert!(matches!(bench.told(changed)[..], [(Fault::CamFormat, "raised", ..100)]));
    assert_eq!(bench.machine.status().in_use.unwrap().mode.width, 32);
    (bench.fake.format_set, bench.fake.changed) = (None, true);
    let back = bench.now;
    bench.step(Ready { event: true, ..Ready::default() });
    bench.pass(10);
    bench.frames(1);
    let told = bench.told(back);
    assert!(matches!(told[..], [(Fault::CamFormat, "cleared", ..1000)]), "{told:?}");
}

#[test]
fn jpegs_of_another_size_are_no_pictures_and_told_when_it_is_no_single_one() {
    let mut bench = mjpeg().streaming();
    let other = |bench: &mut CameraBench| {
        bench.send(jpeg(32, 9));
    };
    other(&mut bench);
    other(&mut bench);
    bench.frames(1);
    assert_eq!(bench.frames.len(), 1, "a damaged header says any size");
    assert_eq!(bench.told(Time::MIN), []);
    bench.frames.clear();
    (0..3).for_each(|_| other(&mut bench));
    assert!(bench.frames.is_empty());
    assert!(matches!(bench.told(Time::MIN)[..], [(Fault::CamFormat, "raised", _)]));
    bench.frames(1);
    assert!(matches!(bench.told(Time::MIN)[..], [(Fault::CamFormat, "cleared", _)]));
}

#[test]
fn a_camera_that_lies_about_its_format_gives_no_pictures_and_no_panic() {
    let mut bench = yuyv().streaming();
    for bytes in [vec![], vec![1; 100], vec![1; 64 * 48 * 2 - 1]] {
        bench.send(bytes);
    }
    // More than there is.
    bench.now = bench.now.plus_ns(PERIOD_NS);
    bench.fill(vec![1; 100], false);
    bench.fake.filled[0].0.bytes_used = usize::MAX;
    bench.step(Ready { filled: true, ..Ready::default() });
    assert_eq!((bench.frames.len(), bench.counters().damaged_pictures), (0, 4));
    // The driver's format has changed without a word.
    bench.fake.format_now = Some(SetFormat { width: 32, ..bench.fake.agreed() });
    for _ in 0..15 {
        bench.send(vec![1; 100]);
    }
    assert!(bench.fake.log.contains(&"open"), "{:?}", bench.fake.log);
    // A size that no camera has is not even started.
    let mut bench = yuyv();
    bench.fake.format_set = Some(SetFormat {
        coding: Coding::Yuyv,
        width: u32::MAX,
        height: 2,
        bytes_per_line: 0,
        size_image: 0,
    });
    bench.pass(1000);
    assert!(!bench.fake.log.contains(&"start"));
    assert!(matches!(bench.told(Time::MIN)[..], [(Fault::CamLost, "raised", _)]));
}

/// Row 9: somebody else has it.
#[test]
fn a_busy_camera_is_tried_each_second() {
    let mut bench = yuyv();
    bench.fake.open_fails = [Errno::BUSY, Errno::BUSY].into();
    let begun = bench.now;
    bench.pass(1500);
    assert_eq!(bench.told(begun), [(Fault::CamBusy, "raised", 0)]);
    assert_eq!(
        (bench.life(), bench.fake.log.iter().filter(|l| **l == "open").count()),
        (CameraLife::Busy, 2)
    );
    bench.pass(600);
    bench.frames(1);
    let told = bench.told(begun);
    assert!(matches!(told[..], [(Fault::CamBusy, "cleared", ..3000)]), "{told:?}");
}

#[test]
fn a_camera_whose_queue_failed_and_that_is_busy_then_is_busy() {
    let mut bench = yuyv().streaming();
    bench.fake.dequeue_fails = Some(Errno::IO);
    let failed = bench.now;
    bench.step(Ready { failed: true, ..Ready::default() });
    bench.fake.dequeue_fails = None;
    bench.fake.open_fails = [Errno::BUSY].into();
    bench.pass(250);
    let told: Vec<_> = bench.told(failed).into_iter().map(|(f, what, _)| (f, what)).collect();
    assert_eq!(told, [(Fault::CamQueue, "raised"), (Fault::CamQueue, "cleared"), (Fault::CamBusy, "raised")]);
    bench.pass(1000);
    bench.frames(1);
    assert!(matches!(bench.told(failed)[..], [.., (Fault::CamBusy, "cleared", ..1500)]));
}

/// Row 10: no room on the bus.
#[test]
fn without_bandwidth_a_smaller_mode_runs_and_is_told() {
    let mut bench = yuyv();
    bench.fake.start_fails = |c| (c.mode.width > 32).then_some(Errno::NOSPC);
    let begun = bench.now;
    bench.step(Ready::default());
    bench.frames(1);
    assert_eq!(bench.machine.status().in_use.unwrap().mode.width, 32);
    let told: Vec<_> = bench.told(begun).into_iter().map(|(f, what, _)| (f, what)).collect();
    assert_eq!(told, [(Fault::CamBandwidth, "raised"), (Fault::CamFormat, "raised")]);
    // Nothing fits: tried again later, not at once.
    let mut bench = yuyv();
    bench.fake.start_fails = |_| Some(Errno::NOSPC);
    bench.pass(3000);
    assert!(bench.fake.log.iter().filter(|l| **l == "open").count() <= 4);
}

/// Row 11: time stamps that repeat or go back.
#[test]
fn a_picture_that_is_not_newer_is_left_out_and_noted() {
    let mut bench = yuyv().streaming();
    for back_ms in [0, 50] {
        bench.now = bench.now.plus_ns(PERIOD_NS);
        let picture = bench.picture();
        bench.fill(picture, false);
        let stamp = &mut bench.fake.filled[0].0.stamp;
        stamp.time = stamp.time.plus_ns(-PERIOD_NS - back_ms * MS);
        bench.step(Ready { filled: true, ..Ready::default() });
        assert!(bench.frames.is_empty());
        assert!(matches!(bench.told(Time::MIN)[..], [(Fault::CamTimestamp, "noted", _)]));
    }
    bench.frames(2);
    assert_eq!((bench.frames.len(), bench.counters().out_of_order), (2, 2));
    assert!(bench.frames[0].mid_exposure < bench.frames[1].mid_exposure);
    assert_eq!(
        bench.frames[0].arrival.ns_since(bench.frames[0].mid_exposure),
        8 * MS,
        "10 ms less half of 4 ms"
    );
}

/// Exposures of 1 to 30 ms and back in eight seconds, as when a gun is trained from the sun to a shore, with either kind of stamp: the
/// middle of each is found to the change within the hundred milliseconds between two questions. A gun that turns at 40 deg/s puts a boat
/// 1.3 px (of 1920 over 60 deg) aside for each millisecond.
#[test]
fn the_middle_of_an_exposure_that_changes_is_followed() {
    const READOUT_NS: i64 = PERIOD_NS / 2;
    for start_of_exposure in [true, false] {
        let mut bench = yuyv().streaming();
        let (mut worst, mut unasked): (i64, i64) = (0, 0);
        for i in 0..480 {
            let share = 0.5 - 0.5 * (f64::from(i) / 240.0 * std::f64::consts::TAU).cos();
            let exposure_ns = MS + (share * 29e6) as i64;
            bench.fake.exposure_ns = exposure_ns;
            bench.now = bench.now.plus_ns(PERIOD_NS);
            let picture = bench.picture();
            bench.fill(picture, false);
            let stamp = &mut bench.fake.filled[0].0.stamp;
            let begun = bench.now.plus_ns(-2 * MS - READOUT_NS - exposure_ns);
            let ended = bench.now.plus_ns(-2 * MS);
            *stamp = BufferStamp {
                time: if start_of_exposure { begun } else { ended },
                monotonic: true,
                start_of_exposure,
            };
            bench.step(Ready { filled: true, ..Ready::default() });
            let Some(frame) = bench.frames.pop() else { continue };
            let off = frame.mid_exposure.ns_since(begun) - exposure_ns / 2;
            if i < 4 {
                continue;
            }
            worst = worst.max(off.abs());
            unasked = unasked.max((exposure_ns - 4 * MS).abs() / 2);
        }
        println!("worst {:.2} ms; asked once {:.2} ms", worst as f64 * 1e-6, unasked as f64 * 1e-6);
        assert!(worst < 7 * MS / 10 && unasked > 12 * MS, "{worst} {unasked}");
        assert_eq!(bench.counters().out_of_order, 0);
    }
}

/// Trouble with a camera's pictures says nothing of it once it is gone.
#[test]
fn a_camera_that_is_gone_is_lost_and_nothing_else() {
    let mut bench = mjpeg().streaming();
    for _ in 0..3 {
        bench.send(jpeg(32, 9));
    }
    let from = bench.now;
    bench.fake.dequeue_fails = Some(Errno::NODEV);
    bench.fake.found.clear();
    bench.step(Ready { failed: true, ..Ready::default() });
    let told: Vec<_> = bench.told(from).into_iter().map(|(fault, how, _)| (fault, how)).collect();
    assert!(told.contains(&(Fault::CamFormat, "cleared")), "{told:?}");
    assert!(told.contains(&(Fault::CamLost, "raised")), "{told:?}");
}

/// Row 11: stamps that are far off now and then, and from some time on all of them.
#[test]
fn a_few_odd_stamps_are_left_out_and_many_are_not_believed() {
    let mut bench = yuyv().streaming();
    let odd = |bench: &mut CameraBench| {
        bench.now = bench.now.plus_ns(PERIOD_NS);
        let picture = bench.picture();
        bench.fill(picture, false);
        let stamp = &mut bench.fake.filled[0].0.stamp;
        stamp.time = stamp.time.plus_ns(-5000 * MS);
        bench.step(Ready { filled: true, ..Ready::default() });
    };
    odd(&mut bench);
    odd(&mut bench);
    assert!(bench.frames.is_empty());
    assert_eq!(bench.told(Time::MIN).iter().filter(|t| t.0 == Fault::CamTimestamp).count(), 2);
    bench.frames(1);
    assert_eq!(bench.frames.len(), 1);
    for _ in 0..6 {
        odd(&mut bench);
    }
    assert_eq!(bench.frames.len(), 1 + 4, "their arrival counts");
    assert_eq!(bench.counters().stamps_not_believed, 8);
    assert!(bench.frames.windows(2).all(|w| w[0].mid_exposure < w[1].mid_exposure));
}

/// Row 12: another camera than the calibrated one.
#[test]
fn another_camera_is_not_opened() {
    let settings = CameraSettings { serial: Some("B".to_owned()), ..CameraSettings::default() };
    let mut bench = CameraBench::new(b"YUYV", settings);
    let begun = bench.now;
    bench.pass(1000);
    assert_eq!(bench.told(begun), [(Fault::CalMismatch, "raised", 0)]);
    assert_eq!((bench.life(), bench.fake.log.len()), (CameraLife::Mismatched, 0));
    bench.fake.found = vec![camera("/dev/video0", "B")];
    bench.pass(300);
    assert!(matches!(bench.told(begun)[..], [(Fault::CalMismatch, "cleared", _)]));
    bench.frames(1);
    assert_eq!(bench.life(), CameraLife::Streaming);
}

/// Row 13: covered or frozen.
#[test]
fn a_picture_that_stays_the_same_is_told_within_a_second() {
    let mut bench = yuyv().streaming();
    let covered = bench.now;
    for _ in 0..33 {
        bench.send(vec![16; 64 * 48 * 2]);
    }
    let told = bench.told(covered);
    assert!(matches!(told[..], [(Fault::CamStatic, "raised", 1000..1100)]), "{told:?}");
    assert_eq!(bench.frames.len(), 33, "they are shown all the same");
    bench.frames(1);
    assert!(matches!(bench.told(covered)[..], [(Fault::CamStatic, "cleared", _)]));
}

#[test]
fn the_newest_frame_wins_and_gaps_are_counted() {
    let mut bench = yuyv().streaming();
    for _ in 0..3 {
        bench.now = bench.now.plus_ns(PERIOD_NS);
        let picture = bench.picture();
        bench.fill(picture, false);
    }
    bench.sequence += 5;
    bench.step(Ready { filled: true, ..Ready::default() });
    bench.frames(1);
    assert_eq!(bench.frames.len(), 2);
    assert_eq!((bench.counters().skipped, bench.counters().sequence_gaps), (2, 5));
}

#[test]
fn pictures_are_lent_while_the_driver_keeps_two_buffers_then_copied() {
    let mut bench = yuyv().streaming();
    bench.fake.reclaim().unwrap();
    let total = bench.fake.here.len();
    bench.frames(12);
    let lent = bench.frames.iter().filter(|f| f.picture.mapping().is_some()).count();
    assert_eq!((lent, bench.fake.at_driver), (total - 2, 2));
    assert!(bench.frames.windows(2).all(|w| w[0].picture != w[1].picture), "none was overwritten");
    let held: Picture = bench.frames[0].picture.clone();
    bench.frames.clear();
    bench.frames(1);
    assert!(bench.frames[0].picture.mapping().is_some(), "buffers come back");
    assert_eq!(held.bytes().len(), 64 * 48 * 2);
}

#[test]
fn padded_rows_are_packed() {
    let mut bench = CameraBench::new(
        b"NV12",
        CameraSettings { calibrated_size: Some(SIZE), ..CameraSettings::default() },
    );
    let format =
        SetFormat { coding: Coding::Nv12, width: 64, height: 48, bytes_per_line: 80, size_image: 80 * 72 };
    bench.fake.format_set = Some(format);
    bench.step(Ready::default());
    bench.now = bench.now.plus_ns(PERIOD_NS);
    let padded: Vec<u8> =
        (0..72).flat_map(|row| (0..80).map(move |x| if x < 64 { row } else { 255 })).collect();
    bench.fill(padded, false);
    bench.step(Ready { filled: true, ..Ready::default() });
    let picture = &bench.frames[0].picture;
    assert_eq!((picture.width(), picture.height(), bench.counters().copied), (64, 48, 1));
    assert!(picture.bytes().chunks(64).zip(0..72).all(|(row, n)| row.iter().all(|v| *v == n)));
}

#[test]
fn a_camera_that_needs_long_to_begin_is_given_longer_each_time() {
    let mut bench = yuyv();
    let begun = bench.now;
    // Never a frame within the first seconds of each start.
    let mut longest = 0;
    let mut opened = begun;
    for _ in 0..400 {
        bench.now = bench.now.plus_ns(50 * MS);
        let before = bench.fake.log.len();
        bench.step(Ready::default());
        if bench.fake.log[before..].contains(&"start") {
            longest = longest.max(bench.now.ns_since(opened) / MS);
            opened = bench.now;
        }
    }
    assert!(longest > 4000, "{longest}");
    assert!(matches!(bench.told(begun)[..], [(Fault::CamStall, "raised", _)]));
}

#[test]
fn stopping_closes_the_camera() {
    let mut bench = yuyv().streaming();
    bench.machine.stop(&mut bench.fake);
    assert_eq!((bench.life(), bench.fake.log.last()), (CameraLife::Stopped, Some(&"close")));
    assert_eq!(bench.step(Ready::default()), Time::from_ns(i64::MAX));
}
