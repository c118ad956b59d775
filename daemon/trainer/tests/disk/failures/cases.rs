//! What fails, from which operation on, for how long, and how the program ends.

use crate::image::DiskRandom;

/// Something that a disk does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum DiskFailure {
    /// No more space.
    Full,
    /// Nothing can be changed any more.
    ReadOnly,
    /// Nothing can be read or written.
    InputOutput,
    /// The file system has given up: what is written gets lost while syncs succeed; a little later nothing can be changed any more.
    Abort,
    /// One operation takes five seconds.
    Slow,
}

/// What somebody else does to the journal's files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Meddling {
    /// The database and its log are deleted.
    Deleted,
    /// They get other names.
    Moved,
    /// They are deleted, and a text is put in the database's place.
    Replaced,
    /// The database is locked.
    Locked,
}

/// Something that happens to the journal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// The disk fails at that call; and for some time, or for ever.
    Disk(DiskFailure, Lasting),
    /// Somebody meddles with the files; a lock is held for some time, or for ever.
    Meddling(Meddling, Lasting),
}

/// How long trouble lasts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lasting {
    /// Some calls, or a tenth of a second.
    Some,
    ForEver,
}

/// How the program ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// By itself after its last round.
    Itself,
    /// By SIGTERM, so many calls after the trouble's beginning; while the disk is slow, so many steps of time.
    Terminated(usize),
    /// By SIGKILL.
    Killed(usize),
    /// By power cuts at this many moments from the trouble's beginning on.
    PowerCuts(usize),
}

/// One run of the program.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    pub trouble: Trouble,
    /// Number of the call at which it begins.
    pub at: usize,
    pub end: End,
}

impl Case {
    /// Whether most of its time is waiting.
    pub fn is_long(&self) -> bool {
        matches!(
            self.trouble,
            Trouble::Disk(DiskFailure::Slow, _) | Trouble::Disk(_, Lasting::ForEver) | Trouble::Meddling(..)
        )
    }

    /// Number of cases that this counts as.
    pub fn count(&self) -> usize {
        if let End::PowerCuts(cuts) = self.end { cuts } else { 1 }
    }
}

/// Moments at which the power is cut in each run that is made for that.
const CUTS: usize = 8;
/// So many cases, spread evenly over troubles, the `calls` of a run that meets none, and ends.
pub fn cases(asked: usize, calls: usize) -> Vec<Case> {
    let mut random = DiskRandom(0x5ea_d15c);
    let troubles = troubles();
    // Each trouble goes through all calls; where few cases are asked for, through some of each stretch.
    let rounds = asked.div_ceil(troubles.len() * (3 + CUTS));
    let stretch = calls.div_ceil(rounds);
    let mut all = Vec::new();
    for round in 0..rounds {
        for trouble in &troubles {
            for end in ends(&mut random) {
                let at = (round * calls / rounds + random.below(stretch)) % calls;
                all.push(Case { trouble: *trouble, at, end });
            }
        }
    }
    all
}

fn troubles() -> Vec<Trouble> {
    use DiskFailure::{Abort, Full, InputOutput, ReadOnly, Slow};
    let mut all = Vec::new();
    for failure in [Full, ReadOnly, InputOutput] {
        all.extend([Lasting::Some, Lasting::ForEver].map(|lasting| Trouble::Disk(failure, lasting)));
    }
    all.push(Trouble::Disk(Abort, Lasting::ForEver));
    all.push(Trouble::Disk(Slow, Lasting::Some));
    for meddling in [Meddling::Deleted, Meddling::Moved, Meddling::Replaced] {
        all.push(Trouble::Meddling(meddling, Lasting::ForEver));
    }
    all.extend([Lasting::Some, Lasting::ForEver].map(|lasting| Trouble::Meddling(Meddling::Locked, lasting)));
    all
}

fn ends(random: &mut DiskRandom) -> [End; 4] {
    let mut later = || random.below(60);
    [End::Itself, End::Terminated(later()), End::Killed(later()), End::PowerCuts(CUTS)]
}
