//! Opening what a cut left, with the product's own code.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::Path,
};

use bowwave_record::{Journal, Run, ShotFilter, read_shots};

use super::{shoot, step::Step};

/// A round that is fired after the cut.
const NEXT: u64 = 1_000_000;

/// Rounds that must be, and that may be, in the journal.
#[derive(Default)]
pub struct ExpectedShots {
    fired: BTreeSet<u64>,
    committed: BTreeSet<u64>,
    /// From the damage on until the next report: the disk itself has lost rounds, and nobody has said otherwise yet.
    damaged: bool,
}

impl ExpectedShots {
    pub fn apply(&mut self, step: &Step) {
        match step {
            Step::Fired(shot) => drop(self.fired.insert(*shot)),
            Step::Committed(shot) => {
                if self.damaged {
                    // Earlier runs are in the database that was put aside; this one is whole again.
                    self.committed.retain(|earlier| earlier / 1000 == shot / 1000);
                    self.damaged = false;
                }
                self.committed.insert(*shot);
            }
            Step::Damage => self.damaged = true,
            _ => {}
        }
    }
}

/// Rounds found in the journal.
#[derive(Default)]
pub struct FoundShots {
    pub lost: usize,
    pub invented: usize,
    pub unopened: bool,
    pub quarantined: bool,
    /// The first thing that is wrong.
    pub fault: Option<String>,
}

/// Puts the files into `folder`, opens the journal there, and compares.
pub fn look(folder: &Path, image: &BTreeMap<String, Vec<u8>>, expected: &ExpectedShots) -> FoundShots {
    for entry in fs::read_dir(folder).unwrap() {
        fs::remove_file(entry.unwrap().path()).unwrap();
    }
    for (name, bytes) in image {
        fs::write(folder.join(name), bytes).unwrap();
    }
    // SQLite's map of its log is never synced: absent, blank or nonsense.
    match image.values().map(Vec::len).sum::<usize>() % 3 {
        0 => {}
        fill => fs::write(folder.join("hits.sqlite-shm"), vec![fill as u8 - 1; 32 << 10]).unwrap(),
    }
    let path = folder.join(shoot::NAME);
    match open_and_shoot(&path, expected.damaged) {
        Err(fault) => FoundShots { unopened: true, fault: Some(fault), ..FoundShots::default() },
        Ok(quarantined) if expected.damaged => FoundShots { quarantined, ..FoundShots::default() },
        Ok(_) => compare(&path, expected),
    }
}

/// Whether a damaged database was put aside.
fn open_and_shoot(path: &Path, damaged: bool) -> Result<bool, String> {
    let journal = Journal::open_with(path, &Run::default(), &shoot::OPTIONS).map_err(|e| e.to_string())?;
    let quarantined = journal.quarantined();
    if let Some(quarantine) = quarantined.as_ref().filter(|_| !damaged) {
        return Err(format!("it was put aside: {}", quarantine.reason));
    }
    journal.shot(&shoot::shot(NEXT)).map_err(|e| e.to_string())?;
    let summary = journal.finish().map_err(|e| e.to_string())?;
    if summary.committed != 1 {
        return Err("it takes no more rounds".to_owned());
    }
    Ok(quarantined.is_some())
}

fn compare(path: &Path, expected: &ExpectedShots) -> FoundShots {
    let stored = match read_shots(path, &ShotFilter::default()) {
        Ok(stored) => stored,
        Err(error) => {
            return FoundShots { unopened: true, fault: Some(error.to_string()), ..FoundShots::default() };
        }
    };
    let mut numbers = BTreeSet::new();
    let mut found = FoundShots::default();
    let mut fault = |what: String| {
        found.fault.get_or_insert(what);
    };
    for stored in &stored {
        let number = stored.record.shot;
        let known = number == NEXT || expected.fired.contains(&number);
        if !known || !numbers.insert(number) || stored.record != shoot::shot(number) {
            found.invented += 1;
            fault(format!("round {number} was never fired so, or is there twice"));
        }
    }
    for number in expected.committed.iter().chain([&NEXT]) {
        if !numbers.contains(number) {
            found.lost += 1;
            fault(format!("round {number} was reported and is not there"));
        }
    }
    found
}
