//! Opening the database: version, settings, quarantine.

use std::{
    ffi::OsString,
    fs::{self, File},
    io::{self, Read},
    os::unix::ffi::OsStrExt,
    path::{Path, PathBuf},
    time::Duration,
};

use rusqlite::{Connection, ErrorCode, OpenFlags, TransactionBehavior, params};

use super::{JournalError, Run};

/// Marks the file as ours ("BOWW").
const APPLICATION_ID: i64 = 0x424f_5757;
/// Version of the tables.
const VERSION: i64 = 1;
/// How long another process may hold the database before that is an error.
const BUSY: Duration = Duration::from_secs(2);
const MAGIC: &[u8; 16] = b"SQLite format 3\0";

/// The tables. Numbers that are not finite become NULL, since SQLite has no NaN.
const TABLES: &str = "
CREATE TABLE runs (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    started_wall_ns INTEGER,
    scenario TEXT NOT NULL,
    recording TEXT NOT NULL,
    seed TEXT NOT NULL,
    version TEXT NOT NULL,
    finished INTEGER NOT NULL DEFAULT 0 CHECK (finished IN (0, 1))
) STRICT;
CREATE TABLE shots (
    run INTEGER NOT NULL REFERENCES runs (id),
    shot INTEGER NOT NULL,
    fired_ns INTEGER NOT NULL,
    muzzle_x_m REAL, muzzle_y_m REAL, muzzle_z_m REAL,
    bore_x REAL, bore_y REAL, bore_z REAL,
    pose_age_ns INTEGER NOT NULL,
    outcome TEXT NOT NULL CHECK (outcome IN ('hit', 'miss', 'not_scored')),
    boat TEXT CHECK (boat IS NOT NULL OR outcome <> 'hit'),
    zone TEXT CHECK ((zone IS NOT NULL) = (outcome = 'hit')),
    time_ns INTEGER CHECK ((time_ns IS NOT NULL) = (outcome <> 'not_scored')),
    range_m REAL,
    point_x_m REAL, point_y_m REAL, point_z_m REAL,
    miss_m REAL,
    cause TEXT CHECK ((cause IS NOT NULL) = (outcome = 'not_scored')),
    PRIMARY KEY (run, shot)
) STRICT, WITHOUT ROWID;
";

/// A database that is ready to be written.
pub(super) struct Opened {
    pub(super) connection: Connection,
    pub(super) quarantined: Option<PathBuf>,
}

/// Opens or makes the database for writing; puts a damaged one aside.
pub(super) fn for_writing(path: &Path, pages_max: Option<u32>) -> Result<Opened, JournalError> {
    let head = head(path)?;
    if head.looks_foreign() {
        return Err(JournalError::NotADatabase { path: path.into() });
    }
    let broken = if head.is_blank() { Err("its beginning is blank".to_owned()) } else { check(path)? };
    let Err(reason) = broken else {
        return Ok(Opened { connection: connect(path, pages_max)?, quarantined: None });
    };
    let aside = quarantine(path)?;
    log::error!(
        "DB_QUARANTINE the journal {} is damaged ({reason}); it is kept as {} and a fresh one begun",
        path.display(),
        aside.display()
    );
    Ok(Opened { connection: connect(path, pages_max)?, quarantined: Some(aside) })
}

/// Begins a run and gives its number.
pub(super) fn begin_run(connection: &Connection, path: &Path, run: &Run) -> Result<i64, JournalError> {
    connection
        .execute(
            "INSERT INTO runs (started_wall_ns, scenario, recording, seed, version) VALUES (?1, ?2, ?3, ?4, ?5)",
            params![run.started_wall_ns, run.scenario, run.recording, run.seed.to_string(), run.version],
        )
        .map_err(|error| JournalError::from_sql(path, &error))?;
    Ok(connection.last_insert_rowid())
}

/// Opens an existing journal for reading.
pub(super) fn for_reading(path: &Path) -> Result<Connection, JournalError> {
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
        (APPLICATION_ID, VERSION) => Ok(connection),
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
        let versions = versions(&connection)?;
        Ok((connection, versions))
    };
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    open(path, flags).or_else(|error: rusqlite::Error| {
        // Reading needs a file for its locks beside the database. Where none can be made nobody can write either, so that
        // reading without locks is safe, unless a log holds what the database does not have yet.
        let log_bytes = fs::metadata(with_suffix(path, "-wal")).map_or(0, |status| status.len());
        if error.sqlite_error_code() != Some(ErrorCode::CannotOpen) || log_bytes > 0 {
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
struct Head(Vec<u8>);

impl Head {
    fn is_blank(&self) -> bool {
        !self.0.is_empty() && self.0.iter().all(|byte| *byte == 0)
    }

    /// Neither absent, nor empty, nor a database, nor the zeros that a power cut can leave of one.
    fn looks_foreign(&self) -> bool {
        !self.0.is_empty() && !self.is_blank() && !self.0.starts_with(MAGIC)
    }
}

fn head(path: &Path) -> Result<Head, JournalError> {
    let mut bytes = Vec::new();
    match File::open(path) {
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
    Ok(Head(bytes))
}

/// Whether the database is intact; the inner error says why not. A fresh one is.
fn check(path: &Path) -> Result<Result<(), String>, JournalError> {
    let found = (|| {
        let connection = Connection::open(path)?;
        connection.busy_timeout(BUSY)?;
        connection.query_row("PRAGMA quick_check(1)", [], |row| row.get::<_, String>(0))
    })();
    match found {
        Ok(verdict) if verdict == "ok" => Ok(Ok(())),
        Ok(verdict) => Ok(Err(verdict.replace('\n', " "))),
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

fn connect(path: &Path, pages_max: Option<u32>) -> Result<Connection, JournalError> {
    let fail = |error: rusqlite::Error| JournalError::from_sql(path, &error);
    let mut connection = Connection::open(path).map_err(fail)?;
    connection.busy_timeout(BUSY).map_err(fail)?;
    claim(&connection, path)?;
    let mode: String =
        connection.query_row("PRAGMA journal_mode = WAL", [], |row| row.get(0)).map_err(fail)?;
    if mode != "wal" {
        let reason = format!("its file system allows no write-ahead log (got {mode})");
        return Err(JournalError::Open { path: path.into(), reason });
    }
    connection
        .execute_batch("PRAGMA synchronous = FULL; PRAGMA foreign_keys = ON; PRAGMA trusted_schema = OFF;")
        .map_err(fail)?;
    if let Some(pages) = pages_max {
        connection.query_row(&format!("PRAGMA max_page_count = {pages}"), [], |_| Ok(())).map_err(fail)?;
    }
    make_tables(&mut connection).map_err(fail)?;
    Ok(connection)
}

/// Refuses databases of other programs and of newer versions.
fn claim(connection: &Connection, path: &Path) -> Result<(), JournalError> {
    let fail = |error: rusqlite::Error| JournalError::from_sql(path, &error);
    let (application, version) = versions(connection).map_err(fail)?;
    if application == APPLICATION_ID {
        if version > VERSION {
            return Err(JournalError::Newer { path: path.into(), found: version, supported: VERSION });
        }
        return Ok(());
    }
    let tables: i64 =
        connection.query_row("SELECT count(*) FROM sqlite_schema", [], |row| row.get(0)).map_err(fail)?;
    if application != 0 || version != 0 || tables != 0 {
        return Err(JournalError::ForeignDatabase { path: path.into() });
    }
    Ok(())
}

/// Application and schema version.
fn versions(connection: &Connection) -> rusqlite::Result<(i64, i64)> {
    let application = connection.query_row("PRAGMA application_id", [], |row| row.get(0))?;
    let version = connection.query_row("PRAGMA user_version", [], |row| row.get(0))?;
    Ok((application, version))
}

/// Makes the tables where there are none. One transaction, so that nobody ever finds half of them.
fn make_tables(connection: &mut Connection) -> rusqlite::Result<()> {
    let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
    // Asked within the transaction: another process may have been faster.
    if versions(&transaction)?.1 == 0 {
        transaction.execute_batch(TABLES)?;
        transaction.execute_batch(&format!(
            "PRAGMA application_id = {APPLICATION_ID}; PRAGMA user_version = {VERSION};"
        ))?;
    }
    transaction.commit()
}

/// Renames the database and its log; the number makes the name unique.
fn quarantine(path: &Path) -> Result<PathBuf, JournalError> {
    let fail = |source| JournalError::File { path: path.into(), doing: "put aside", source };
    let aside = (1_u32..)
        .map(|number| with_suffix(path, &format!(".corrupt-{number}")))
        .find(|candidate| !candidate.exists())
        .ok_or_else(|| fail(io::Error::from(io::ErrorKind::AlreadyExists)))?;
    fs::rename(path, &aside).map_err(fail)?;
    for part in ["-wal", "-shm"] {
        match fs::rename(with_suffix(path, part), with_suffix(&aside, part)) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(fail(error)),
            _ => {}
        }
    }
    Ok(aside)
}

/// `path` with `suffix` behind its name.
pub(super) fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = OsString::from(path.as_os_str());
    name.push(suffix);
    PathBuf::from(name)
}
