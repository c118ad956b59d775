//! Power cuts at every point of what the journal writes: no round whose commit was reported is lost, none is invented, and
//! the database opens.
//!
//! The test starts itself again as a program that shoots, over a layer that sees each call on files together with each report of a commit.
//! From that record it makes what a disk may hold after a cut
//! (see `image.rs` for what is assumed of it), opens it with the product's own code, and looks.
//!
//! `BOWWAVE_CUTS` says how many cuts (300 unless told).

use std::time::Instant;

use nix::errno::Errno;

use super::{
    image::{Disk, DiskRandom, Survival},
    layer::{Call, FolderFiles, Layer, Plan, Verdict, folder_in},
    shoot,
    step::Step,
    verify::{self, ExpectedShots},
};

const CUTS: usize = 300;

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
    assert!(report.cuts >= cuts && (report.quarantined > 0 || cuts < CUTS));
}

/// Everything that the phases of the shooting program did to the files.
fn record() -> Vec<Step> {
    let base = tempfile::tempdir().unwrap();
    let data = folder_in(base.path());
    let mut layer = Layer::new(&data, SyncsFail::default());
    for phase in 0..shoot::PHASES {
        let (path, number) = (data.join(shoot::NAME), phase.to_string());
        layer.plan.fails = phase == shoot::PHASE_SYNCS_FAIL;
        let log = base.path().join("log");
        let ended = layer.run(&[shoot::FLAG.as_ref(), path.as_ref(), number.as_ref()], &log);
        let code = if phase == shoot::PHASE_ABORTED { None } else { Some(0) };
        assert_eq!(ended.code, code, "phase {phase}: {}", std::fs::read_to_string(&log).unwrap());
    }
    let steps = layer.files.steps;
    let syncs = steps.iter().filter(|step| matches!(step, Step::Sync { .. } | Step::SyncFolder)).count();
    let reports = steps.iter().filter(|step| matches!(step, Step::Committed(_))).count();
    let failed = steps.iter().filter(|step| matches!(step, Step::SyncFailed { .. })).count();
    assert!(failed >= 3, "{failed} syncs failed");
    // Each round fired by itself is a transaction of its own.
    assert!(reports >= 400 && syncs >= reports / 2, "{reports} reports, {syncs} syncs: what is not seen?");
    steps
}

/// Every eleventh sync of a phase fails: not while the journal is being opened, which would only say so.
#[derive(Default)]
struct SyncsFail {
    fails: bool,
    syncs: usize,
}

impl Plan for SyncsFail {
    fn verdict(&mut self, _number: usize, call: &Call, _files: &mut FolderFiles) -> Verdict {
        if !self.fails || *call != Call::Sync {
            return Verdict::Pass;
        }
        self.syncs += 1;
        if self.syncs >= 30 && (self.syncs - 30).is_multiple_of(11) {
            return Verdict::Refuse(Errno::EIO);
        }
        Verdict::Pass
    }
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
fn cut(steps: &[Step], cuts: usize) -> CutReport {
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
