//! States of a disk after a power cut.
//!
//! Assumed: what was written to a file before an fsync of it that returned is there, and so are the names that were given or
//! taken in the folder before an fsync of the folder. Of everything since, anything may be there or not: of writes any
//! subset, each torn at 512-byte sectors, a file's length without its bytes (then zeros), names without the files' content
//! and the reverse. An fsync of a file does not keep its name (POSIX, stricter than ext4). Half of the cuts keep names in
//! their order, as journalling file systems do, the other half any subset of them. After a sync that
//! failed, all that it was to write is lost for good unless it is written again, although it still reads as written: as Linux
//! does. Not assumed away: a later write to a
//! sector without an earlier one to it. Never: that bytes outside of a write change (SQLite's own assumption of
//! power-safe overwriting, true for every disk with whole-sector writes).

use std::collections::BTreeMap;

use super::step::Step;

const SECTOR: usize = 512;

/// Fate of writes that were not synced.
#[derive(Clone, Copy, Debug)]
pub enum Survival {
    /// Nothing.
    Nothing,
    /// Everything.
    Everything,
    /// A random part.
    Some,
}

/// Numbers that look random and are the same each time (SplitMix64).
pub struct DiskRandom(pub u64);

impl DiskRandom {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn below(&mut self, end: usize) -> usize {
        (self.next() % end.max(1) as u64) as usize
    }

    fn coin(&mut self) -> bool {
        self.next() & 1 == 1
    }
}

#[derive(Clone)]
enum DiskChange {
    Write { offset: usize, bytes: Vec<u8> },
    Resize(usize),
}

#[derive(Clone)]
enum Naming {
    Create { name: String, file: usize },
    Remove(String),
    Rename { from: String, to: String },
}

#[derive(Default)]
struct DiskFile {
    /// On the disk for sure.
    synced: Vec<u8>,
    /// Since then.
    changes: Vec<DiskChange>,
}

type Names = BTreeMap<String, usize>;

/// Files and names, synced and not.
#[derive(Default)]
pub struct Disk {
    files: Vec<DiskFile>,
    names: Names,
    namings: Vec<Naming>,
}

impl Disk {
    pub fn apply(&mut self, step: &Step) {
        match step {
            Step::Create { name } => {
                self.namings.push(Naming::Create { name: name.clone(), file: self.files.len() });
                self.files.push(DiskFile::default());
            }
            Step::Write { file, offset, bytes } => {
                self.files[*file].changes.push(DiskChange::Write { offset: *offset, bytes: bytes.clone() });
            }
            Step::Resize { file, length } => self.files[*file].changes.push(DiskChange::Resize(*length)),
            Step::Sync { file } => {
                let DiskFile { synced, changes } = &mut self.files[*file];
                for change in changes.drain(..) {
                    apply(synced, &change, |_| true);
                }
            }
            Step::SyncFailed { file } => self.files[*file].changes.clear(),
            Step::SyncFolder => {
                for naming in self.namings.drain(..) {
                    rename(&mut self.names, &naming);
                }
            }
            Step::Remove { name } => self.namings.push(Naming::Remove(name.clone())),
            Step::Rename { from, to } => {
                self.namings.push(Naming::Rename { from: from.clone(), to: to.clone() });
            }
            Step::Fired(_) | Step::Committed(_) | Step::Damage | Step::Trouble | Step::Refused => {}
        }
    }

    /// Files when the power is back: bytes by name.
    pub fn after_cut(&self, survival: Survival, random: &mut DiskRandom) -> BTreeMap<String, Vec<u8>> {
        let mut names = self.names.clone();
        let in_order = random.coin();
        let last = random.below(self.namings.len() + 1);
        for (index, naming) in self.namings.iter().enumerate() {
            let there = match survival {
                Survival::Nothing => false,
                Survival::Everything => true,
                Survival::Some if in_order => index < last,
                Survival::Some => random.coin(),
            };
            if there {
                rename(&mut names, naming);
            }
        }
        names
            .iter()
            .map(|(name, file)| (name.clone(), self.files[*file].after_cut(survival, random)))
            .collect()
    }
}

impl DiskFile {
    fn after_cut(&self, survival: Survival, random: &mut DiskRandom) -> Vec<u8> {
        let mut bytes = self.synced.clone();
        match survival {
            Survival::Nothing => return bytes,
            Survival::Everything => {
                self.changes.iter().for_each(|change| apply(&mut bytes, change, |_| true));
                return bytes;
            }
            Survival::Some => {}
        }
        // Four kinds of loss: the last writes, any writes, any sectors, and the length alone.
        let kind = random.below(4);
        let last = random.below(self.changes.len() + 1);
        for (index, change) in self.changes.iter().enumerate() {
            match kind {
                // The write at which it was cut is torn somewhere.
                0 => {
                    let torn = if index < last { usize::MAX } else { random.below(9) };
                    if index <= last {
                        apply(&mut bytes, change, |sector| sector < torn);
                    }
                }
                1 => {
                    if random.coin() {
                        apply(&mut bytes, change, |_| true);
                    }
                }
                2 => apply(&mut bytes, change, |_| random.coin()),
                _ => apply(&mut bytes, change, |_| false),
            }
        }
        bytes
    }
}

fn rename(names: &mut Names, naming: &Naming) {
    match naming {
        Naming::Create { name, file } => drop(names.insert(name.clone(), *file)),
        Naming::Remove(name) => drop(names.remove(name)),
        Naming::Rename { from, to } => {
            if let Some(file) = names.remove(from) {
                names.insert(to.clone(), file);
            }
        }
    }
}

/// Applies a change; `keep` says which of the sectors that a write touches (numbered from its first) reach the disk. The
/// length does in any case.
fn apply(bytes: &mut Vec<u8>, change: &DiskChange, mut keep: impl FnMut(usize) -> bool) {
    match change {
        DiskChange::Resize(length) => bytes.resize(*length, 0),
        DiskChange::Write { offset, bytes: written } => {
            let end = offset + written.len();
            if bytes.len() < end {
                bytes.resize(end, 0);
            }
            let mut at = *offset;
            let mut sector = 0;
            while at < end {
                let next = (at / SECTOR + 1) * SECTOR;
                let next = next.min(end);
                if keep(sector) {
                    bytes[at..next].copy_from_slice(&written[at - offset..next - offset]);
                }
                (at, sector) = (next, sector + 1);
            }
        }
    }
}
