//! Reading what strace saw.

use std::{collections::HashMap, fmt, path::Path};

/// The calls that change files, their names or their order on the disk.
pub const CALLS: &str = "openat,open,creat,close,lseek,write,pwrite64,writev,pwritev,ftruncate,truncate,fallocate,fsync,\
     fdatasync,sync_file_range,msync,unlink,unlinkat,rename,renameat,renameat2,link,linkat,dup,dup2,dup3";

/// Something that happened to the journal's folder, or was reported.
#[derive(Clone, Debug)]
pub enum TraceStep {
    /// A new empty file.
    Create { name: String },
    /// Bytes of a file; files are named by the number of their creation.
    Write { file: usize, offset: usize, bytes: Vec<u8> },
    /// A file's length.
    Resize { file: usize, length: usize },
    /// A file is on the disk.
    Sync { file: usize },
    /// A sync was refused: what was to be written is nowhere but in the system's memory, and not marked to be written.
    SyncFailed { file: usize },
    /// The names in the folder are on the disk.
    SyncFolder,
    /// A name is gone.
    Remove { name: String },
    /// A file has another name.
    Rename { from: String, to: String },
    /// A round was fired.
    Fired(u64),
    /// A round was reported as committed.
    Committed(u64),
    /// The database is damaged on purpose from here on.
    Damage,
}

impl fmt::Display for TraceStep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Write { file, offset, bytes } => {
                write!(f, "{} bytes at {offset} of file {file}", bytes.len())
            }
            other => write!(f, "{other:?}"),
        }
    }
}

enum OpenFile {
    DiskFile { file: usize, position: usize },
    Folder,
}

/// Turns traces of programs that ran one after the other into steps.
pub struct TraceReader {
    folder: String,
    /// File of each name that is there.
    names: HashMap<String, usize>,
    created: usize,
    open: HashMap<i64, OpenFile>,
    /// Calls that had not returned when another thread's came, by thread.
    unfinished: HashMap<String, String>,
}

impl TraceReader {
    pub fn new(folder: &Path) -> Self {
        Self {
            folder: folder.to_str().unwrap().to_owned(),
            names: HashMap::new(),
            created: 0,
            open: HashMap::new(),
            unfinished: HashMap::new(),
        }
    }

    /// Adds the steps of one program.
    pub fn read(&mut self, trace: &str, steps: &mut Vec<TraceStep>) {
        self.open.clear();
        self.unfinished.clear();
        for line in trace.lines() {
            let (thread, call) = line.split_once(' ').unwrap_or_else(|| panic!("strace: {line}"));
            let call = call.trim_start();
            if call.starts_with("+++") || call.starts_with("---") {
                continue;
            }
            if let Some(begun) = call.strip_suffix("<unfinished ...>") {
                // A report is out as soon as it is begun; all else is done when it returns.
                if !self.report(begun, steps) {
                    self.unfinished.insert(thread.to_owned(), begun.to_owned());
                }
            } else if call.starts_with("<... ") {
                let rest = call.split_once("resumed>").unwrap().1;
                if let Some(begun) = self.unfinished.remove(thread) {
                    self.call(&format!("{begun}{rest}"), steps);
                }
            } else if !self.report(call, steps) {
                self.call(call, steps);
            }
        }
    }

    /// Whether the call is a report on standard output.
    fn report(&self, call: &str, steps: &mut Vec<TraceStep>) -> bool {
        let Some(rest) = call.strip_prefix("write(1, ") else { return false };
        let text = String::from_utf8(bytes(rest.split(", ").next().unwrap())).unwrap();
        let number = |text: &str| text.trim().parse().unwrap();
        match text.trim().split_once(' ') {
            Some(("fired", shot)) => steps.push(TraceStep::Fired(number(shot))),
            Some(("committed", shot)) => steps.push(TraceStep::Committed(number(shot))),
            None if text.trim() == "damage" => steps.push(TraceStep::Damage),
            _ => panic!("the program said {text:?}"),
        }
        true
    }

    fn call(&mut self, call: &str, steps: &mut Vec<TraceStep>) {
        let (head, result) = call.rsplit_once(" = ").unwrap_or_else(|| panic!("strace: {call:.200}"));
        let result: i64 = result.split(' ').next().unwrap().parse().unwrap_or(-1);
        let (name, arguments) = head.trim_end().split_once('(').unwrap();
        if result < 0 && !matches!(name, "fsync" | "fdatasync") {
            return;
        }
        let arguments: Vec<&str> = arguments.strip_suffix(')').unwrap().split(", ").map(str::trim).collect();
        let number = |index: usize| arguments[index].parse::<i64>().unwrap();
        match name {
            "openat" => self.opened(&arguments, result, steps),
            "close" => drop(self.open.remove(&number(0))),
            "lseek" => {
                if let Some(OpenFile::DiskFile { position, .. }) = self.open.get_mut(&number(0)) {
                    *position = result as usize;
                }
            }
            "write" => {
                if let Some(OpenFile::DiskFile { file, position }) = self.open.get_mut(&number(0)) {
                    let bytes = bytes(arguments[1])[..result as usize].to_vec();
                    steps.push(TraceStep::Write { file: *file, offset: *position, bytes });
                    *position += result as usize;
                }
            }
            "pwrite64" => {
                if let Some(OpenFile::DiskFile { file, .. }) = self.open.get(&number(0)) {
                    let bytes = bytes(arguments[1])[..result as usize].to_vec();
                    steps.push(TraceStep::Write { file: *file, offset: number(3) as usize, bytes });
                }
            }
            "ftruncate" | "fallocate" => {
                if let Some(OpenFile::DiskFile { file, .. }) = self.open.get(&number(0)) {
                    let length = arguments.last().unwrap().parse().unwrap();
                    steps.push(TraceStep::Resize { file: *file, length });
                }
            }
            "fsync" | "fdatasync" => match self.open.get(&number(0)) {
                Some(OpenFile::DiskFile { file, .. }) if result < 0 => {
                    steps.push(TraceStep::SyncFailed { file: *file })
                }
                Some(OpenFile::DiskFile { file, .. }) => steps.push(TraceStep::Sync { file: *file }),
                Some(OpenFile::Folder) if result == 0 => steps.push(TraceStep::SyncFolder),
                Some(OpenFile::Folder) | None => {}
            },
            "unlink" | "unlinkat" => {
                let path = arguments.iter().find(|argument| argument.starts_with('"')).unwrap();
                if let Some(name) = self.name(path) {
                    self.names.remove(&name);
                    steps.push(TraceStep::Remove { name });
                }
            }
            "rename" | "renameat" | "renameat2" => {
                let mut paths = arguments.iter().filter(|argument| argument.starts_with('"'));
                let (from, to) = (self.name(paths.next().unwrap()), self.name(paths.next().unwrap()));
                if let (Some(from), Some(to)) = (from, to) {
                    let file = self.names.remove(&from).unwrap();
                    self.names.insert(to.clone(), file);
                    steps.push(TraceStep::Rename { from, to });
                }
            }
            other => self.refuse(other, &arguments),
        }
    }

    /// Calls that nothing is known of here must not touch the folder's files.
    fn refuse(&self, call: &str, arguments: &[&str]) {
        let ours = arguments.iter().any(|argument| {
            argument.parse().is_ok_and(|fd: i64| self.open.contains_key(&fd))
                || argument.starts_with('"') && self.name(argument).is_some()
        });
        assert!(!ours, "the journal uses {call}, which this test does not know");
    }

    fn opened(&mut self, arguments: &[&str], fd: i64, steps: &mut Vec<TraceStep>) {
        let path = String::from_utf8(bytes(arguments[1])).unwrap();
        if path == self.folder {
            self.open.insert(fd, OpenFile::Folder);
            return;
        }
        let Some(name) = self.name(arguments[1]) else { return };
        let flags = arguments[2];
        let file = *self.names.entry(name.clone()).or_insert_with(|| {
            assert!(flags.contains("O_CREAT"), "{name} came from nowhere");
            self.created += 1;
            steps.push(TraceStep::Create { name });
            self.created - 1
        });
        if flags.contains("O_TRUNC") {
            steps.push(TraceStep::Resize { file, length: 0 });
        }
        self.open.insert(fd, OpenFile::DiskFile { file, position: 0 });
    }

    /// The name in the folder that a quoted path means, unless it is another place, or SQLite's map of the log: what that one
    /// holds after a cut is made up.
    fn name(&self, quoted: &str) -> Option<String> {
        let path = String::from_utf8(bytes(quoted)).unwrap();
        let name = path.strip_prefix(&self.folder)?.strip_prefix('/')?;
        (!name.is_empty() && !name.ends_with("-shm")).then(|| name.to_owned())
    }
}

/// The bytes of `"\x2f\x64"`.
fn bytes(quoted: &str) -> Vec<u8> {
    let inner = quoted.strip_prefix('"').and_then(|text| text.strip_suffix('"'));
    let inner = inner.unwrap_or_else(|| panic!("strace cut a string short: {quoted:.80}"));
    let digit = |byte: u8| char::from(byte).to_digit(16).unwrap() as u8;
    inner.as_bytes().chunks(4).map(|hex| digit(hex[2]) << 4 | digit(hex[3])).collect()
}
