//! Rows of a run besides its rounds: events of the exercise, and tracks. Rounds are written first, and tracks give way to them where room is
//! short.

use std::collections::VecDeque;

use rusqlite::{Connection, ErrorCode, TransactionBehavior};

use super::{
    event::{self, NumberedEvent},
    track::{self, NumberedBlock},
};

/// Most rows in one transaction.
const BATCH: usize = 1024;
/// Most blocks of tracks that wait while the database cannot be written: minutes of them.
const BLOCKS_HELD: usize = 600;
/// Most written blocks that are kept in memory for a fresh database.
const BLOCKS_KEPT: usize = 600;

const NO_ROOM: &str = "tracks of boats are not in the journal from now on: what room there is is for rounds";

/// Rows that wait, and those of this run that were written, for a fresh database.
#[derive(Debug)]
pub(super) struct DebriefRows {
    events: VecDeque<NumberedEvent>,
    events_kept: VecDeque<NumberedEvent>,
    blocks: VecDeque<NumberedBlock>,
    blocks_kept: VecDeque<NumberedBlock>,
    /// Blocks that found no place since that was last told.
    lost: u64,
    events_held_max: usize,
    events_kept_max: usize,
}

impl DebriefRows {
    /// No rows. At most so many events wait, and so many are kept.
    pub(super) fn new(events_held_max: usize, events_kept_max: usize) -> Self {
        let (events, events_kept) = (VecDeque::new(), VecDeque::new());
        let (blocks, blocks_kept) = (VecDeque::new(), VecDeque::new());
        Self { events, events_kept, blocks, blocks_kept, lost: 0, events_held_max, events_kept_max }
    }

    /// Tests whether nothing waits.
    pub(super) fn is_empty(&self) -> bool {
        self.events.is_empty() && self.blocks.is_empty()
    }

    /// Takes in an event; one that finds no place is in the log.
    pub(super) fn take_event(&mut self, event: NumberedEvent) {
        if self.events.len() < self.events_held_max {
            self.events.push_back(event);
        } else {
            tell(&event);
        }
    }

    /// Takes in a block of tracks, unless the last room is kept for rounds.
    pub(super) fn take_block(&mut self, block: NumberedBlock, room_is_short: bool) {
        if room_is_short || self.blocks.len() >= BLOCKS_HELD {
            if self.lost == 0 {
                log::warn!(
                    "tracks of boats are not in the journal from now on: what room there is is for rounds"
                );
            }
            self.lost += 1;
            return;
        }
        if self.lost > 0 {
            log::warn!(
                "tracks of boats are in the journal again; {} blocks of a second are missing",
                self.lost
            );
            self.lost = 0;
        }
        self.blocks.push_back(block);
    }

    /// Commits what waits, as much as one transaction takes: events first. Blocks for which there is no room are left out.
    pub(super) fn commit(&mut self, connection: &mut Connection, run: i64) -> rusqlite::Result<()> {
        let events = self.events.len().min(BATCH);
        if events > 0 {
            let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
            for event in self.events.iter().take(events) {
                event::insert_once(&transaction, run, event)?;
            }
            transaction.commit()?;
            self.events_kept.extend(self.events.drain(..events));
            self.events_kept.drain(..self.events_kept.len().saturating_sub(self.events_kept_max));
        }
        let done = self.commit_blocks(connection, run);
        if done.as_ref().is_err_and(|error| error.sqlite_error_code() == Some(ErrorCode::DiskFull)) {
            self.lost += self.blocks.len() as u64;
            self.blocks.clear();
            log::warn!("{NO_ROOM}");
        }
        done
    }

    fn commit_blocks(&mut self, connection: &mut Connection, run: i64) -> rusqlite::Result<()> {
        let blocks = self.blocks.len().min(BATCH);
        if blocks == 0 {
            return Ok(());
        }
        let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
        for block in self.blocks.iter().take(blocks) {
            track::insert_once(&transaction, run, block)?;
        }
        transaction.commit()?;
        self.blocks_kept.extend(self.blocks.drain(..blocks));
        self.blocks_kept.drain(..self.blocks_kept.len().saturating_sub(BLOCKS_KEPT));
        Ok(())
    }

    /// Inserts events that were written and are missing.
    pub(super) fn insert_kept(&self, connection: &Connection, run: i64) -> rusqlite::Result<()> {
        self.events_kept.iter().try_for_each(|event| event::insert_once(connection, run, event))
    }

    /// Blocks that were written may be missing: they wait again, after the rounds.
    pub(super) fn write_blocks_again(&mut self) {
        self.blocks_kept.append(&mut self.blocks);
        std::mem::swap(&mut self.blocks, &mut self.blocks_kept);
    }

    /// Has the log say what was never written.
    pub(super) fn tell_unwritten(&self) {
        self.events.iter().for_each(tell);
        let lost = self.lost + self.blocks.len() as u64;
        if lost > 0 {
            log::error!(
                "{lost} blocks of a second of the boats' tracks are not in the journal: the debrief lacks them"
            );
        }
    }
}

fn tell(event: &NumberedEvent) {
    log::error!("event not in the journal: {}", event.fact());
}
