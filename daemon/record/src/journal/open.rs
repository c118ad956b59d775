//! Opening the database, and closing it without trusting what the disk did not confirm.

use std::{
    ffi::OsString,
    fs::{self, OpenOptions},
    io::{self, Read},
    os::unix::{ffi::OsStrExt, fs::FileExt},
    path::{Path, PathBuf},
    time::Duration,
};

use bowwave_core::text::one_line;
use bowwave_files::plain_file;
use rusqlite::{Connection, ErrorCode, OpenFlags, config::DbConfig};

use super::{
    JournalError, JournalSettings, Quarantine,
    place::{AboutToOpen, FilePlace},
    quarantine,
    schema::{self, APPLICATION_ID, VERSION},
};
use crate::folder;

/// How long another process may hold the database, when it is opened, before that is an error.
pub(super) const BUSY: Duration = Duration::from_secs(2);
/// SQLite's page.
const PAGE_BYTES: u64 = 4096;
const MAGIC: &[u8; 16] = b"SQLite format 3\0";

/// A database that is ready to be written.
pub(super) struct OpenedJournal {
    pub(super) connection: Connection,
    pub(super) place: FilePlace,
    pub(super) quarantined: Option<Quarantine>,
}

impl OpenedJournal {
    fn connect(
        path: &Path,
        settings: &JournalSettings,
        quarantined: Option<Quarantine>,
    ) -> Result<Self, JournalError> {
        let (connection, place) = connect(path, settings)?;
        Ok(Self { connection, place, quarantined })
    }
}

/// Opens or makes the database for writing; puts a damaged one aside.
pub(super) fn for_writing(path: &Path, settings: &JournalSettings) -> Result<OpenedJournal, JournalError> {
    if let Some(resumed) = quarantine::resume(path)? {
        return OpenedJournal::connect(path, settings, Some(resumed));
    }
    let head = head(path)?;
    if head.looks_foreign() && !settings.options.own {
        return Err(JournalError::NotADatabase { path: path.into() });
    }
    if head.is_blank() && was_never_begun(path)? {
        remove_unborn(path)?;
    }
    let head = self::head(path)?;
    let broken = if head.is_blank() {
        Err("its beginning is blank".to_owned())
    } else if head.looks_foreign() {
        Err("its beginning is no database's".to_owned())
    } else {
        check(path)?
    };
    let Err(reason) = broken else {
        return OpenedJournal::connect(path, settings, None);
    };
    let kept_as = quarantine::replace(path, settings, |_| Ok(()))?;
    let quarantined = Some(Quarantine { kept_as: Some(kept_as), reason, rounds_left_there: 0 });
    OpenedJournal::connect(path, settings, quarantined)
}

/// Opens an existing journal for reading.
///
/// Also gives the version of its tables: nothing is migrated by reading.
pub(super) fn for_reading(path: &Path) -> Result<(Connection, i64), JournalError> {
    match fs::metadata(path) {
        Ok(status) if status.is_file() => {}
        Ok(_) => return Err(JournalError::NotADatabase { path: path.into() }),
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            return Err(JournalError::Missing { path: path.into() });
        }
        Err(source) => return Err(JournalError::File { path: path.into(), doing: "open", source }),
    }
    if head(path)?.looks_foreign() {
        return Err(JournalError::NotADatabase { path: path.into() });
    }
    let (connection, versions) =
        connect_for_reading(path).map_err(|error| JournalError::from_sql(path, &error))?;
    match versions {
        (APPLICATION_ID, found @ 1..=VERSION) => Ok((connection, found)),
        (APPLICATION_ID, found) if found > VERSION => {
            Err(JournalError::Newer { path: path.into(), found, supported: VERSION })
        }
        _ => Err(JournalError::ForeignDatabase { path: path.into() }),
    }
}

/// A connection that has read something, and what it read: application and schema version.
fn connect_for_reading(path: &Path) -> rusqlite::Result<(Connection, (i64, i64))> {
    let open = |name: &Path, flags| {
        let connection = Connection::open_with_flags(name, flags)?;
        connection.busy_timeout(BUSY)?;
        let versions = schema::versions(&connection)?;
        Ok((connection, versions))
    };
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    open(path, flags).or_else(|error: rusqlite::Error| {
        // Reading needs a file for its locks beside the database, which not everybody may make who may read. While there is no log nobody writes: a
        // trainer that begins to, as another user, writes to its log first, and who reads is done long before that goes into the database.
        let log_bytes = fs::metadata(with_suffix(path, "-wal")).map_or(0, |status| status.len());
        let has_no_locks =
            matches!(error.sqlite_error_code(), Some(ErrorCode::CannotOpen | ErrorCode::ReadOnly));
        if !has_no_locks || log_bytes > 0 {
            return Err(error);
        }
        open(&immutable_uri(path), flags | OpenFlags::SQLITE_OPEN_URI)
    })
}

/// `path` as SQLite takes files that nobody changes.
fn immutable_uri(path: &Path) -> PathBuf {
    let mut uri = "file:".to_owned();
    for byte in path.as_os_str().as_bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'/' | b'.' | b'-' | b'_' => {
                uri.push(char::from(*byte))
            }
            other => uri.push_str(&format!("%{other:02X}")),
        }
    }
    uri.push_str("?immutable=1");
    PathBuf::from(uri)
}

/// The first bytes of a file, as far as there are any.
struct FileHead(Vec<u8>);

impl FileHead {
    fn is_blank(&self) -> bool {
        !self.0.is_empty() && self.0.iter().all(|byte| *byte == 0)
    }

    /// Neither absent, nor empty, nor a database, nor the zeros that a power cut can leave of one.
    fn looks_foreign(&self) -> bool {
        !self.0.is_empty() && !self.is_blank() && !self.0.starts_with(MAGIC)
    }
}

fn head(path: &Path) -> Result<FileHead, JournalError> {
    let mut bytes = Vec::new();
    match plain_file(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => {}
        Err(source) => return Err(JournalError::File { path: path.into(), doing: "open", source }),
        Ok(file) => {
            file.take(MAGIC.len() as u64).read_to_end(&mut bytes).map_err(|source| JournalError::File {
                path: path.into(),
                doing: "read",
                source,
            })?;
        }
    }
    Ok(FileHead(bytes))
}

/// Whether the file is what a power cut leaves of a database that was just being made: one page without its bytes, and no
/// log. Nothing was ever in it.
fn was_never_begun(path: &Path) -> Result<bool, JournalError> {
    let fail = |source| JournalError::from_io(path, "read", source);
    if fs::metadata(path).map_err(fail)?.len() > PAGE_BYTES {
        return Ok(false);
    }
    let blank = fs::read(path).map_err(fail)?.iter().all(|byte| *byte == 0);
    Ok(blank && fs::metadata(with_suffix(path, "-wal")).map_or(0, |status| status.len()) == 0)
}

fn remove_unborn(path: &Path) -> Result<(), JournalError> {
    let fail = |source| JournalError::from_io(path, "begin again", source);
    for part in ["-journal", ""] {
        absent_is_fine(fs::remove_file(with_suffix(path, part))).map_err(fail)?;
    }
    sync_folder(path)
}

/// Whether the database is intact; the inner error says why not. A fresh one is.
fn check(path: &Path) -> Result<Result<(), String>, JournalError> {
    let found = (|| -> rusqlite::Result<(String, Option<String>)> {
        let connection = Connection::open(path)?;
        connection.busy_timeout(BUSY)?;
        keep_log(&connection);
        let verdict = connection.query_row("PRAGMA quick_check(1)", [], |row| row.get::<_, String>(0))?;
        Ok((verdict, schema::foreign_part(&connection)?))
    })();
    match found {
        Ok((verdict, None)) if verdict == "ok" => Ok(Ok(())),
        Ok((_, Some(foreign))) => Ok(Err(foreign)),
        Ok((verdict, None)) => Ok(Err(one_line(&verdict))),
        // The first bytes are SQLite's: whatever follows them was one of its databases once.
        Err(error)
            if matches!(
                error.sqlite_error_code(),
                Some(ErrorCode::DatabaseCorrupt | ErrorCode::NotADatabase)
            ) =>
        {
            Ok(Err(error.to_string()))
        }
        Err(error) => Err(JournalError::from_sql(path, &error)),
    }
}

/// Connects to a database that is intact, or makes it. Everything that can be read over the connection is on the disk.
pub(super) fn connect(
    path: &Path,
    settings: &JournalSettings,
) -> Result<(Connection, FilePlace), JournalError> {
    let fail = |error: rusqlite::Error| JournalError::from_sql(path, &error);
    let about = AboutToOpen::at(path)?;
    let mut connection = Connection::open(path).map_err(fail)?;
    connection.busy_timeout(settings.busy).map_err(fail)?;
    keep_log(&connection);
    // Nothing that a file holds may run with a statement of ours.
    connection.set_db_config(DbConfig::SQLITE_DBCONFIG_DEFENSIVE, true).map_err(fail)?;
    connection.set_db_config(DbConfig::SQLITE_DBCONFIG_ENABLE_TRIGGER, false).map_err(fail)?;
    schema::claim(&connection, path)?;
    let mode: String =
        connection.query_row("PRAGMA journal_mode = WAL", [], |row| row.get(0)).map_err(fail)?;
    if mode != "wal" {
        let reason = format!("its file system allows no write-ahead log (got {mode})");
        return Err(JournalError::Open { path: path.into(), reason });
    }
    // Checkpoints are the thread's own business: SQLite would keep quiet about those that fail.
    connection
        .execute_batch(
            "PRAGMA synchronous = FULL; PRAGMA foreign_keys = ON; PRAGMA trusted_schema = OFF; \
             PRAGMA cell_size_check = ON;",
        )
        .map_err(fail)?;
    connection.query_row("PRAGMA wal_autocheckpoint = 0", [], |_| Ok(())).map_err(fail)?;
    if let Some(pages) = settings.pages_max {
        connection.query_row(&format!("PRAGMA max_page_count = {pages}"), [], |_| Ok(())).map_err(fail)?;
    }
    if let Some(pages) = settings.pages_cached {
        connection.execute_batch(&format!("PRAGMA cache_size = {pages}")).map_err(fail)?;
    }
    settle_log(&connection, path)?;
    schema::make_tables(&mut connection).map_err(fail)?;
    // SQLite asks for this too, and does not say when it fails.
    sync_folder(path)?;
    let place = about.opened(path)?;
    Ok((connection, place))
}

/// Puts the log that is found beside the database onto the disk again.
///
/// After an fsync that failed, Linux holds the pages for clean: they read as written although the disk has none of them, and
/// the next fsync reports success. A log that was left behind (by the process that saw the failure, or by one that died
/// since) may be such a one. It is written once more, byte by byte the same, before anything is built upon it.
fn settle_log(connection: &Connection, path: &Path) -> Result<(), JournalError> {
    let log = with_suffix(path, "-wal");
    if fs::metadata(&log).map_or(0, |status| status.len()) == 0 {
        return Ok(());
    }
    let fail = |error: rusqlite::Error| JournalError::from_sql(path, &error);
    // Nobody else may write the log meanwhile.
    connection.execute_batch("BEGIN IMMEDIATE").map_err(fail)?;
    let written = write_again(&log);
    connection.execute_batch("ROLLBACK").map_err(fail)?;
    written.map_err(|source| JournalError::from_io(path, "write again the log of", source))
}

fn write_again(path: &Path) -> io::Result<()> {
    let file = OpenOptions::new().read(true).write(true).open(path)?;
    let mut buffer = vec![0; 64 << 10];
    let mut offset = 0;
    loop {
        let count = file.read_at(&mut buffer, offset)?;
        let Some(bytes) = buffer.get(..count).filter(|bytes| !bytes.is_empty()) else { break };
        file.write_all_at(bytes, offset)?;
        offset += count as u64;
    }
    file.sync_all()
}

/// Leaves the log where it is when the connection is closed, instead of moving it into the database: for connections that
/// may see what is not on the disk.
pub(super) fn keep_log(connection: &Connection) {
    // Fails only for options that SQLite does not know.
    if let Err(error) = connection.set_db_config(DbConfig::SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, true) {
        log::debug!("SQLite keeps no log at the end: {error}");
    }
}

/// Has the log moved into the database when the connection is closed, for one that has met no failure.
pub(super) fn empty_log_at_end(connection: &Connection) {
    if let Err(error) = connection.set_db_config(DbConfig::SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, false) {
        log::debug!("SQLite keeps its log: {error}");
    }
}

/// A file that is not there need be neither removed nor moved.
pub(super) fn absent_is_fine(done: io::Result<()>) -> io::Result<()> {
    match done {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        other => other,
    }
}

/// Puts the names in the folder of `path` onto the disk.
pub(super) fn sync_folder(path: &Path) -> Result<(), JournalError> {
    folder::sync_folder(path).map_err(|source| JournalError::from_io(path, "sync the folder of", source))
}

/// `path` with `suffix` behind its name.
pub(super) fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = OsString::from(path.as_os_str());
    name.push(suffix);
    PathBuf::from(name)
}
