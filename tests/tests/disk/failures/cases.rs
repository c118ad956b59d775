//! What fails, from which operation on, for how long, and how the program ends.

use std::collections::BTreeMap;

use crate::{image::DiskRandom, trace::Meddling};

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

/// Something that happens to the journal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// The disk fails at that operation; and the following ones, or for ever.
    Disk(DiskFailure, Lasting),
    /// Somebody meddles with the files; a lock is held for a while or for ever.
    Meddling(Meddling, Lasting),
}

/// How long trouble lasts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lasting {
    /// This many operations of each kind.
    Operations(usize),
    ForEver,
}

/// How the program ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// By itself after its last round.
    Itself,
    /// By SIGTERM, so long after that round.
    Terminated { round: u64, later_us: u64 },
    /// By SIGKILL.
    Killed { round: u64, later_us: u64 },
    /// By power cuts at this many moments after the trouble's beginning, as the trace tells.
    PowerCuts(usize),
}

impl End {
    /// As the program's argument.
    pub fn argument(self) -> String {
        match self {
            Self::Itself | Self::PowerCuts(_) => "-".to_owned(),
            Self::Terminated { round, later_us } => format!("term:{round}:{later_us}"),
            Self::Killed { round, later_us } => format!("kill:{round}:{later_us}"),
        }
    }
}

/// One run of the program.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    pub trouble: Trouble,
    /// The operation at which it begins.
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
/// Operations of each kind that a failure lasts where it does not last for ever.
const SOME: usize = 12;

/// So many cases, spread evenly over troubles, the `operations` of a run that meets none, and ends.
pub fn cases(asked: usize, operations: usize) -> Vec<Case> {
    let mut random = DiskRandom(0x5ea_d15c);
    let troubles = troubles();
    let (mut all, mut count) = (Vec::new(), 0);
    let mut round = 0;
    while count < asked {
        // Each trouble goes through all operations; where fewer cases are asked for, through every so many.
        let per_round = troubles.len() * (3 + CUTS);
        let rounds = asked.div_ceil(per_round).max(1);
        let at = round * operations / rounds % operations;
        for trouble in &troubles {
            for end in ends(&mut random) {
                let case = Case { trouble: *trouble, at: (at + random.below(operations.div_ceil(rounds))) % operations, end };
                count += case.count();
                all.push(case);
            }
        }
        round += 1;
    }
    all
}

fn troubles() -> Vec<Trouble> {
    use DiskFailure::{Abort, Full, InputOutput, ReadOnly, Slow};
    let mut all = Vec::new();
    for failure in [Full, ReadOnly, InputOutput] {
        all.extend([Lasting::Operations(SOME), Lasting::ForEver].map(|lasting| Trouble::Disk(failure, lasting)));
    }
    all.push(Trouble::Disk(Abort, Lasting::ForEver));
    all.push(Trouble::Disk(Slow, Lasting::Operations(1)));
    for meddling in [Meddling::Deleted, Meddling::Moved, Meddling::Replaced] {
        all.push(Trouble::Meddling(meddling, Lasting::ForEver));
    }
    all.extend([Lasting::Operations(1), Lasting::ForEver].map(|lasting| Trouble::Meddling(Meddling::Locked, lasting)));
    all
}

fn ends(random: &mut DiskRandom) -> [End; 4] {
    let mut when = || (1 + random.below(20) as u64, random.below(4000) as u64);
    let ((round, later_us), killed) = (when(), when());
    [
        End::Itself,
        End::Terminated { round, later_us },
        End::Killed { round: killed.0, later_us: killed.1 },
        End::PowerCuts(CUTS),
    ]
}

/// The calls that a run makes on the journal's folder, in their order.
pub struct Operations(pub Vec<String>);

impl Operations {
    /// How often each call has been made before the `at`th operation, and is made with it.
    fn before(&self, at: usize) -> (BTreeMap<&str, usize>, &str) {
        let mut counts = BTreeMap::new();
        for call in &self.0[..at] {
            *counts.entry(call.as_str()).or_default() += 1;
        }
        (counts, &self.0[at])
    }

    /// What strace is told to do from the operation `at` on. With `reports`, standard output is traced, too, and `write` left alone, as
    /// reports are written by it.
    pub fn injections(&self, case: &Case, reports: bool) -> Vec<String> {
        let (before, call) = self.before(case.at);
        let first = |call: &str| before.get(call).copied().unwrap_or(0) + 1;
        let one = |what: &str| vec![format!("inject={call}:{what}:when={}", first(call))];
        let (failure, lasting) = match case.trouble {
            // A report is stopped as well as any other call.
            Trouble::Meddling(..) => return one("signal=SIGSTOP"),
            Trouble::Disk(DiskFailure::Slow, _) => return one("delay_enter=5000000"),
            Trouble::Disk(failure, lasting) => (failure, lasting),
        };
        let is_taken = |call: &&&str| !reports || **call != "write";
        let inject = |calls: &[&str], what: &str, later: usize| -> Vec<String> {
            let each = |call: &&str| {
                let from = first(call) + later;
                let until = match lasting {
                    Lasting::ForEver => "+".to_owned(),
                    Lasting::Operations(count) => format!("..{}", from + count - 1),
                };
                format!("inject={call}:{what}:when={from}{until}")
            };
            calls.iter().filter(is_taken).map(each).collect()
        };
        match failure {
            DiskFailure::Full => inject(&["write", "pwrite64", "ftruncate", "fallocate"], "error=ENOSPC", 0),
            DiskFailure::ReadOnly => inject(CHANGING, "error=EROFS", 0),
            DiskFailure::InputOutput => {
                let mut all = inject(CHANGING, "error=EIO", 0);
                all.extend(inject(&["read", "pread64", "fsync", "fdatasync"], "error=EIO", 0));
                all
            }
            DiskFailure::Abort => {
                let mut all = inject(&["fsync", "fdatasync"], "retval=0", 0);
                all.extend(inject(CHANGING, "error=EROFS", 6));
                all
            }
            DiskFailure::Slow => Vec::new(),
        }
    }
}

/// Calls that change something, or are made to.
const CHANGING: &[&str] = &["openat", "write", "pwrite64", "ftruncate", "fallocate", "unlink", "rename"];
