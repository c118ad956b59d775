//! Tracks on their way to the journal, in blocks of a second.

use std::collections::VecDeque;

use bowwave_core::time::NS_PER_S;
use bowwave_core::world::track::{TRACK_STEP_NS, TrackBlock};
use bowwave_record::Journal;

/// Samples of boats in a block.
const BLOCK_SAMPLES: usize = (NS_PER_S / TRACK_STEP_NS) as usize;
/// Blocks that wait for the journal to be opened; those beyond are left out.
const BLOCKS_WAITING_MAX: usize = 600;

/// Tracks that wait.
#[derive(Debug, Default)]
pub(super) struct TrackQueue {
    /// The block that is filled now.
    filling: TrackBlock,
    /// Blocks with their numbers in the run, which those that are left out have as well.
    full: VecDeque<(u64, TrackBlock)>,
    /// Blocks that were closed.
    closed: u64,
    lost: u64,
}

impl TrackQueue {
    /// Takes in tracks that a tick added.
    pub(super) fn take(&mut self, tracks: &TrackBlock) {
        self.filling.append(tracks);
        if self.filling.samples.len() >= BLOCK_SAMPLES {
            self.close_block();
        }
    }

    fn close_block(&mut self) {
        self.closed += 1;
        if self.full.len() < BLOCKS_WAITING_MAX {
            self.full.push_back((self.closed, std::mem::take(&mut self.filling)));
            return;
        }
        if self.lost == 0 {
            log::error!("the journal does not take tracks of boats: the debrief will lack them from now on");
        }
        self.lost += 1;
        self.filling.clear();
    }

    /// Hands on what the journal takes; the rest is tried again.
    pub(super) fn send(&mut self, journal: &Journal) {
        while let Some((number, block)) = self.full.front()
            && journal.tracks(*number, block.clone()).is_ok()
        {
            self.full.pop_front();
        }
    }

    /// Hands on everything, a block that is not full included.
    pub(super) fn finish(&mut self, journal: &Journal) {
        if !self.filling.is_empty() {
            self.close_block();
        }
        self.send(journal);
    }

    /// Has the log say what the journal never took.
    pub(super) fn tell_unwritten(&self) {
        let lost = self.lost + self.full.len() as u64 + u64::from(!self.filling.is_empty());
        if lost > 0 {
            log::error!(
                "{lost} blocks of a second of the boats' tracks are not in the journal: the debrief lacks them"
            );
        }
    }
}
