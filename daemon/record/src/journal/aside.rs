//! Rounds that the database did not take, in a file beside it: a line of JSON each, below one that describes their run. The next start
//! takes them in.

use std::{
    fs::{self, OpenOptions},
    io::{self, Write as _},
    path::{Path, PathBuf},
    thread,
    time::Duration,
};

use bowwave_core::time::Time;
use bowwave_files::plain_text;
use crossbeam_channel::bounded;
use rusqlite::{Connection, TransactionBehavior};
use serde_json::{Value, json};

use super::{
    JournalError, Run, StoredShot, Unwritten,
    open::{absent_is_fine, sync_folder, with_suffix},
    row, schema,
};
use crate::folder::folder_of;

/// Behind the database's name; the run's number and [`END`] follow.
const UNWRITTEN: &str = ".unwritten-";
/// The same of files that were taken in, and of those of which the database refused rounds.
const TAKEN: &str = ".taken-";
const REFUSED: &str = ".refused-";
const END: &str = ".jsonl";
/// Longest file that is taken in: half a million rounds.
const BYTES_MAX: usize = 256 << 20;

/// Files beside the journal at `path` with rounds that it does not have, sorted: those that the next start takes in, and those that it
/// could not.
pub fn side_files(path: &Path) -> io::Result<Vec<PathBuf>> {
    let mut files = named(path, UNWRITTEN)?;
    files.extend(named(path, REFUSED)?);
    Ok(files)
}

/// Puts rounds beside a journal that could not be opened; its next start takes them in. Rounds for which there is no place there, either,
/// are in the log, and so are those that a slow disk has not taken `within` that time.
pub fn put_aside(
    path: &Path,
    run: &Run,
    rounds: impl IntoIterator<Item = super::ShotRecord>,
    within: Duration,
) -> Unwritten {
    let rows: Vec<String> = rounds.into_iter().map(|record| StoredShot::line(0, record)).collect();
    let (done, saved) = bounded(1);
    let work = {
        let (path, run, rows) = (path.to_path_buf(), run.clone(), rows.clone());
        // Nobody waits any more for one that took too long.
        move || drop(done.send(save_or_tell(&path, (0, &run), None, &rows)))
    };
    let begun = thread::Builder::new().name("journal-aside".to_owned()).spawn(work);
    let side_file = begun.ok().and_then(|_| saved.recv_timeout(within).ok()).flatten();
    let cause = "it could not be opened".to_owned();
    let unwritten =
        Unwritten { path: path.into(), run: 0, committed: 0, cause, in_doubt: 0, rows, side_file };
    unwritten.log_rows();
    unwritten
}

/// Like [`save`]; a failure goes to the log.
pub(super) fn save_or_tell(
    path: &Path,
    run: (i64, &Run),
    former: Option<&Path>,
    rows: &[String],
) -> Option<PathBuf> {
    let saved = save(path, run, former, rows);
    saved
        .inspect_err(|e| log::error!("the rounds cannot be put beside the journal {}: {e}", path.display()))
        .ok()
}

/// Puts rows into a file beside the database, in place of what is in `former`, and onto the disk.
fn save(path: &Path, (id, run): (i64, &Run), former: Option<&Path>, rows: &[String]) -> io::Result<PathBuf> {
    let name = former.map_or_else(|| free(path, UNWRITTEN, id), Path::to_path_buf);
    let making = with_suffix(&name, ".making");
    absent_is_fine(fs::remove_file(&making))?;
    let mut text = header(id, run).to_string();
    for row in rows {
        text.push('\n');
        text.push_str(row);
    }
    text.push('\n');
    let written = (|| {
        let mut file = OpenOptions::new().write(true).create_new(true).open(&making)?;
        file.write_all(text.as_bytes())?;
        file.sync_all()?;
        fs::rename(&making, &name)
    })();
    if let Err(error) = written {
        let _ = fs::remove_file(&making);
        return Err(error);
    }
    sync_folder(path).map_err(io::Error::other)?;
    Ok(name)
}

/// Takes a file away whose rounds the database has.
pub(super) fn remove(path: &Path, file: &Path) -> io::Result<()> {
    absent_is_fine(fs::remove_file(file))?;
    sync_folder(path).map_err(io::Error::other)
}

/// Takes in the rounds that earlier runs put beside the journal. What cannot be taken in is told in the log and stays.
pub(super) fn take_in(connection: &mut Connection, path: &Path) {
    let files = named(path, UNWRITTEN).unwrap_or_else(|e| {
        log::warn!("what lies beside the journal {} is not known: {e}", path.display());
        Vec::new()
    });
    for file in files {
        if let Err(error) = take_in_file(connection, path, &file) {
            log::error!("{} cannot be taken into the journal: {error}; it is tried again", file.display());
        }
    }
}

fn take_in_file(connection: &mut Connection, path: &Path, file: &Path) -> Result<(), JournalError> {
    let io_error = |source| JournalError::from_io(path, "take rounds into", source);
    let sql_error = |error: rusqlite::Error| JournalError::from_sql(path, &error);
    let text = plain_text(file, BYTES_MAX).map_err(io_error)?;
    let mut lines = text.lines().peekable();
    let described = lines.peek().and_then(|line| of_header(line));
    if described.is_some() {
        lines.next();
    }
    let transaction =
        connection.transaction_with_behavior(TransactionBehavior::Immediate).map_err(sql_error)?;
    let (mut taken, mut refused, mut run) = (0, Vec::new(), described.as_ref().map(|(id, _)| *id));
    let mut number = None;
    for line in lines {
        let parsed = serde_json::from_str(line).map_err(|e| e.to_string());
        let stored = match parsed.and_then(|value| StoredShot::from_json(&value)) {
            Ok(stored) => stored,
            Err(why) => {
                refused.push(why);
                continue;
            }
        };
        let id = *run.get_or_insert(stored.run);
        let number = match number {
            Some(number) => number,
            None => *number.insert(
                run_for(&transaction, id, described.as_ref().map(|(_, run)| run)).map_err(sql_error)?,
            ),
        };
        match row::insert_once(&transaction, number, &stored.record) {
            Ok(Ok(())) => taken += 1,
            Ok(Err(why)) => refused.push(why),
            Err(error) => return Err(sql_error(error)),
        }
    }
    transaction.commit().map_err(sql_error)?;
    let kind = if refused.is_empty() { TAKEN } else { REFUSED };
    let kept_as = free(path, kind, run.unwrap_or_default());
    fs::rename(file, &kept_as).map_err(io_error)?;
    sync_folder(path)?;
    log::warn!(
        "{taken} rounds that an earlier run put beside the journal are in it now, as of run {}; {} is {}",
        number.unwrap_or_default(),
        file.display(),
        kept_as.display()
    );
    if let Some(why) = refused.first() {
        log::error!("{} rounds of {} cannot be taken in: {why}", refused.len(), kept_as.display());
    }
    Ok(())
}

/// Number of the run in this database. Where there is no such run yet it is begun: under its own number unless another run has it.
pub(super) fn run_for(connection: &Connection, id: i64, run: Option<&Run>) -> rusqlite::Result<i64> {
    // Files of earlier versions have a number only.
    let Some(run) = run else {
        let is_there = schema::has_run(connection, id)?;
        return if is_there { Ok(id) } else { schema::begin_run(connection, Some(id), &Run::default()) };
    };
    // Without the time of its beginning a run may look like another.
    if run.started.is_some()
        && let Some(found) = schema::find_run(connection, run)?
    {
        return Ok(found);
    }
    let own = if id > 0 && !schema::has_run(connection, id)? { Some(id) } else { None };
    schema::begin_run(connection, own, run)
}

fn header(id: i64, run: &Run) -> Value {
    json!({
        "rounds_of_run": id,
        "started_wall_ns": run.started_wall_ns,
        "scenario": run.scenario,
        "recording": run.recording,
        "seed": run.seed,
        "version": run.version,
        "boot_id": run.boot_id,
        "started_ns": run.started.map(Time::ns),
        "details": run.details,
    })
}

/// Number and description of a run; `None` for a line that is none, as in files of earlier versions.
fn of_header(line: &str) -> Option<(i64, Run)> {
    let value: Value = serde_json::from_str(line).ok()?;
    let text = |key: &str| value[key].as_str().unwrap_or_default().to_owned();
    let run = Run {
        started_wall_ns: value["started_wall_ns"].as_i64(),
        scenario: text("scenario"),
        recording: text("recording"),
        seed: value["seed"].as_u64().unwrap_or_default(),
        version: text("version"),
        boot_id: value["boot_id"].as_str().map(str::to_owned),
        started: value["started_ns"].as_i64().map(Time::from_ns),
        details: value["details"].as_str().map(str::to_owned),
    };
    Some((value["rounds_of_run"].as_i64()?, run))
}

/// The first name that is not taken.
fn free(path: &Path, kind: &str, id: i64) -> PathBuf {
    let name = |again: String| with_suffix(path, &format!("{kind}{id}{again}{END}"));
    let first = name(String::new());
    if !first.exists() {
        return first;
    }
    (2..u32::MAX).map(|n| name(format!("-{n}"))).find(|name| !name.exists()).unwrap_or(first)
}

/// Files beside the database whose names go on with `kind`, sorted.
fn named(path: &Path, kind: &str) -> io::Result<Vec<PathBuf>> {
    let Some(own) = path.file_name() else { return Ok(Vec::new()) };
    let prefix = [own.as_encoded_bytes(), kind.as_bytes()].concat();
    let mut files = Vec::new();
    for entry in fs::read_dir(folder_of(path))? {
        let entry = entry?;
        let name = entry.file_name();
        let name = name.as_encoded_bytes();
        if name.starts_with(&prefix) && name.ends_with(END.as_bytes()) && entry.file_type()?.is_file() {
            files.push(entry.path());
        }
    }
    files.sort();
    Ok(files)
}
