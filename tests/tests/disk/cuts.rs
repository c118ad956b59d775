//! Power cuts at every point of what the journal writes: no round whose commit was reported is lost, none is invented, and
//! the database opens.
//!
//! The test starts itself again as a program that shoots, under strace, which sees each operation on files in the order in
//! which the kernel does, together with each report of a commit. From that record it makes what a disk may hold after a cut
//! (see `image.rs` for what is assumed of it), opens it with the product's own code, and looks.
//!
//! `BOWWAVE_CUTS` says how many cuts (300 unless told).

use std::{env, path::Path, process::Command, time::Instant};

use super::{
    image::{Disk, DiskRandom, Survival},
    shoot,
    trace::{self, TraceStep},
    verify::{self, ExpectedShots},
};

const CUTS: usize = 300;

/// How strace has syncs fail: not while the journal is being opened, which would only say so.
const SYNCS_FAIL: &str = "inject=fsync,fdatasync:error=EIO:when=30+11";

/// Cuts the power as often as is asked for.
pub fn run() {
    let cuts = super::asked("BOWWAVE_CUTS").unwrap_or(CUTS);
    let steps = record();
    let begun = Instant::now();
    let report = cut(&steps, cuts);
    println!(
        "{} cuts at {} points of {} operations in {} ms: {} reported rounds lost, {} invented, {} databases did not open; \
         {} cuts in which a database that was damaged on purpose was put aside",
        report.cuts,
        report.points,
        steps.len(),
        begun.elapsed().as_millis(),
        report.lost,
        report.invented,
        report.unopened,
        report.quarantined,
    );
    assert_eq!((report.lost, report.invented, report.unopened), (0, 0, 0));
    assert!(report.cuts >= cuts && report.quarantined > 0);
}

/// Everything that the phases of the shooting program did to the files.
fn record() -> Vec<TraceStep> {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    std::fs::create_dir(&data).unwrap();
    let mut steps = Vec::new();
    let mut reader = trace::TraceReader::new(&data);
    for phase in 0..shoot::PHASES {
        let file = folder.path().join(format!("trace-{phase}"));
        let output = Command::new("strace")
            .args(["-f", "-qq", "-xx", "-s", "67108864", "-e", "signal=none", "-e"])
            .arg(format!("trace={}", trace::CALLS))
            .args((phase == shoot::PHASE_SYNCS_FAIL).then_some(["-e", SYNCS_FAIL]).into_iter().flatten())
            .arg("-o")
            .arg(&file)
            .arg(env::current_exe().unwrap())
            .arg(shoot::FLAG)
            .arg(data.join(shoot::NAME))
            .arg(phase.to_string())
            .output()
            .unwrap();
        let killed = phase == shoot::PHASE_ABORTED;
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.success(), !killed, "phase {phase}: {said}");
        reader.read(&std::fs::read_to_string(&file).unwrap(), &mut steps);
    }
    let syncs =
        steps.iter().filter(|step| matches!(step, TraceStep::Sync { .. } | TraceStep::SyncFolder)).count();
    let reports = steps.iter().filter(|step| matches!(step, TraceStep::Committed(_))).count();
    let failed = steps.iter().filter(|step| matches!(step, TraceStep::SyncFailed { .. })).count();
    assert!(failed >= 3, "{failed} syncs failed");
    // Each round fired by itself is a transaction of its own.
    assert!(reports >= 400 && syncs >= reports / 2, "{reports} reports, {syncs} syncs: is strace blind?");
    steps
}

#[derive(Debug, Default)]
struct CutReport {
    cuts: usize,
    points: usize,
    lost: usize,
    invented: usize,
    unopened: usize,
    quarantined: usize,
}

/// Cuts after each step, or after as many as are asked for, evenly spread.
fn cut(steps: &[TraceStep], cuts: usize) -> CutReport {
    let folder = super::scratch();
    let mut disk = Disk::default();
    let mut expected = ExpectedShots::default();
    let mut random = DiskRandom(0x0b0e_ca75);
    let mut report = CutReport::default();
    for (index, step) in steps.iter().enumerate() {
        disk.apply(step);
        expected.apply(step);
        let here = (index + 1) * cuts / steps.len() - index * cuts / steps.len();
        report.points += usize::from(here > 0);
        for variant in 0..here {
            // The two extremes at each point, then anything between.
            let survival = match if here == 1 { random.below(6) } else { variant } {
                0 => Survival::Nothing,
                1 => Survival::Everything,
                _ => Survival::Some,
            };
            let image = disk.after_cut(survival, &mut random);
            let found = verify::look(folder.path(), &image, &expected);
            report.cuts += 1;
            report.lost += found.lost;
            report.invented += found.invented;
            report.unopened += usize::from(found.unopened);
            report.quarantined += usize::from(found.quarantined);
            if let Some(fault) = found.fault {
                println!("cut after operation {index} ({step}), {survival:?} survives: {fault}");
            }
        }
    }
    report
}
