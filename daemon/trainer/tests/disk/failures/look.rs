//! What a run of the program has left.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
    time::Duration,
};

use bowwave_record::{Journal, Run, RunSelection, ShotFilter, StoredShot, read_shots, side_files};

use super::{
    END_MOST,
    cases::{Case, DiskFailure, End, Meddling, Trouble},
    plan::{MOVED, TroublePlan},
};
use crate::{
    image::{Disk, DiskRandom, Survival},
    layer::{Ended, Layer, folder_in},
    scratch, shoot,
    step::Step,
};

/// What became of the rounds.
#[derive(Debug, Default)]
pub struct CaseReport {
    /// All that is wrong, a line each.
    pub faults: Vec<String>,
    /// How long the end took from when it was asked for.
    pub end: Option<Duration>,
    pub rounds: RoundCounts,
}

/// Rounds that were reported as committed, that must be somewhere and are not, and that stand beside the journal and in the log.
#[derive(Debug, Default)]
pub struct RoundCounts {
    pub reported: usize,
    pub lost: usize,
    pub aside: usize,
    pub logged: usize,
}

/// A run of the program.
pub struct Shooting {
    _base: tempfile::TempDir,
    folder: PathBuf,
    pub steps: Vec<Step>,
    pub calls: usize,
    ended: Ended,
    pub log: String,
}

impl Shooting {
    /// Runs it, and prints each of its calls where that `tells`.
    pub fn run(case: Option<Case>, tells: bool) -> Self {
        let base = scratch();
        let folder = folder_in(base.path());
        let log = base.path().join("log");
        let mut layer = Layer::new(&folder, TroublePlan::new(&folder, case));
        layer.tells = tells;
        let ended = layer.run(&[super::gun::FLAG.as_ref(), folder.as_ref()], &log);
        Self {
            calls: layer.calls(),
            steps: std::mem::take(&mut layer.files.steps),
            ended,
            log: fs::read_to_string(&log).unwrap(),
            folder,
            _base: base,
        }
    }

    /// What is left, against what must be.
    pub fn look(&self, case: &Case) -> CaseReport {
        let mut report = CaseReport { end: self.ended.after, ..CaseReport::default() };
        let mut rounds = Rounds::default();
        if let End::PowerCuts(cuts) = case.end {
            self.cut(case, cuts, &mut report);
            return report;
        }
        self.steps.iter().for_each(|step| rounds.take(step));
        report.rounds.reported = rounds.reported.len();
        let was_killed = matches!(case.end, End::Killed(_)) && self.ended.code.is_none();
        if !was_killed {
            if self.ended.code != Some(0) {
                report.faults.push(format!("it ended with {:?}: {}", self.ended.code, self.log));
            }
            if self.ended.after.is_none_or(|after| after > END_MOST) {
                report.faults.push(format!("its end took {:?}", self.ended.after));
            }
        }
        let logged = logged(&self.log);
        report.rounds.logged = logged.len();
        report.rounds.aside = rows_aside(&self.folder);
        let must = rounds.must(case, was_killed);
        // What a file system that gave up had not written is not in this folder, although it still reads so.
        let on_disk = if case.trouble_is_abort() && !was_killed {
            let mut disk = Disk::default();
            self.steps.iter().for_each(|step| disk.apply(step));
            disk.after_cut(Survival::Nothing, &mut DiskRandom(1))
        } else {
            files(&self.folder)
        };
        compare(&on_disk, &rounds, &must, &logged, &mut report);
        report
    }

    /// Cuts the power at some moments from the trouble's beginning on.
    fn cut(&self, case: &Case, cuts: usize, report: &mut CaseReport) {
        let trouble = self.steps.iter().position(|step| matches!(step, Step::Trouble)).unwrap_or(0);
        let at = |cut: usize| trouble + (self.steps.len() - 1 - trouble) * cut / cuts;
        let (mut disk, mut rounds) = (Disk::default(), Rounds::default());
        let mut random = DiskRandom(case.at as u64);
        let mut next = 0;
        for (index, step) in self.steps.iter().enumerate() {
            disk.apply(step);
            rounds.take(step);
            while next < cuts && at(next) == index {
                let survival = [Survival::Nothing, Survival::Everything, Survival::Some][random.below(3)];
                let image = disk.after_cut(survival, &mut random);
                let must = rounds.must(case, true);
                let before = report.faults.len();
                compare(&image, &rounds, &must, &BTreeSet::new(), report);
                if let Some(fault) = report.faults.get_mut(before) {
                    *fault = format!("cut after step {index} ({step}), {survival:?} survives: {fault}");
                }
                next += 1;
            }
        }
        report.rounds.reported = rounds.reported.len();
    }
}

/// Rounds in the order in which they were fired and reported.
#[derive(Default)]
pub struct Rounds {
    pub fired: BTreeSet<u64>,
    pub reported: BTreeSet<u64>,
    /// The last one fired before the trouble, and those reported before it.
    before: Option<(u64, BTreeSet<u64>)>,
    refused: bool,
}

impl Rounds {
    pub fn take(&mut self, step: &Step) {
        match step {
            Step::Fired(shot) => drop(self.fired.insert(*shot)),
            Step::Committed(shot) => drop(self.reported.insert(*shot)),
            Step::Trouble => {
                let last = self.fired.last().copied().unwrap_or(0);
                self.before = Some((last, self.reported.clone()));
            }
            Step::Refused => self.refused = true,
            _ => {}
        }
    }

    /// Those that must be somewhere; what was not reported need not be where the program or the power went at once.
    fn must(&self, case: &Case, at_once: bool) -> BTreeSet<u64> {
        let Some((last, before)) = &self.before else { return self.reported.clone() };
        let must = if at_once { &self.reported } else { &self.fired };
        match case.trouble {
            // Somebody has deleted them, and the program has not met that yet: it is noticed before another round is reported.
            Trouble::Meddling(Meddling::Deleted | Meddling::Replaced, _)
                if at_once && self.reported.last().is_none_or(|reported| reported <= last) =>
            {
                BTreeSet::new()
            }
            // Nobody can tell a disk that says what is not so, until it refuses something.
            Trouble::Disk(DiskFailure::Abort, _) if at_once || !self.refused => before.clone(),
            _ => must.clone(),
        }
    }
}

impl Case {
    fn trouble_is_abort(&self) -> bool {
        matches!(self.trouble, Trouble::Disk(DiskFailure::Abort, _))
    }
}

/// Rounds that the log has instead of the journal.
pub fn logged(log: &str) -> BTreeSet<u64> {
    let rows = log.lines().filter_map(|line| line.split_once("not in the journal: "));
    let row = |row| serde_json::from_str::<serde_json::Value>(row).unwrap();
    rows.map(|(_, text)| row(text)["shot"].as_u64().unwrap()).collect()
}

/// The folder's files with their contents.
pub fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).unwrap().map(Result::unwrap);
    let files = entries.filter(|entry| !entry.file_name().to_string_lossy().ends_with("-shm"));
    files.map(|f| (f.file_name().into_string().unwrap(), fs::read(f.path()).unwrap())).collect()
}

/// Rounds in files beside the journal.
pub fn rows_aside(folder: &Path) -> usize {
    let files = side_files(&folder.join(shoot::NAME)).unwrap();
    files.iter().map(|file| fs::read_to_string(file).unwrap().lines().count().saturating_sub(1)).sum()
}

/// Has the trainer start on what the disk has, and looks which rounds are where they can be found.
pub fn compare(
    on_disk: &BTreeMap<String, Vec<u8>>,
    rounds: &Rounds,
    must: &BTreeSet<u64>,
    logged: &BTreeSet<u64>,
    report: &mut CaseReport,
) {
    let folder = scratch();
    for (name, bytes) in on_disk {
        fs::write(folder.path().join(name), bytes).unwrap();
    }
    let path = folder.path().join(shoot::NAME);
    let mut found = logged.clone();
    match restart(&path) {
        Err(fault) => report.faults.push(fault),
        Ok(stored) => {
            for stored in stored {
                let number = stored.record.shot;
                if !rounds.fired.contains(&number) || stored.record != shoot::shot(number) {
                    report.faults.push(format!("round {number} was never fired so"));
                } else if !found.insert(number) && !logged.contains(&number) {
                    report.faults.push(format!("round {number} is there twice"));
                }
            }
        }
    }
    let moved = folder.path().join(format!("{MOVED}{}", shoot::NAME));
    // One that was moved before anything was in it says so.
    let stored = read_shots(&moved, &ShotFilter { runs: RunSelection::All, hits_only: false });
    found.extend(stored.into_iter().flatten().map(|stored| stored.record.shot));
    let lost: Vec<_> = must.difference(&found).collect();
    if !lost.is_empty() {
        report.rounds.lost += lost.len();
        report.faults.push(format!("rounds {lost:?} are nowhere"));
    }
}

/// The next start, and what it finds.
fn restart(path: &Path) -> Result<Vec<StoredShot>, String> {
    let journal = Journal::open_with(path, &Run::default(), &shoot::OPTIONS).map_err(|e| e.to_string())?;
    journal.finish().map_err(|e| e.to_string())?;
    read_shots(path, &ShotFilter { runs: RunSelection::All, hits_only: false }).map_err(|e| e.to_string())
}
