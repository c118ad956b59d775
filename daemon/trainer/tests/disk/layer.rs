//! A layer between a program and the system: it sees each call on the files of one folder, in the order in which the system does, together
//! with what the program reports, and has calls refused, done in appearance only, or wait.
//!
//! It traces the program (ptrace(2)), all of its threads: no call goes past it, whichever library makes it. Calls that it does not know must
//! not touch the folder.

use std::{
    collections::{BTreeMap, HashMap},
    ffi::OsStr,
    fs::File,
    io::{Read as _, Write as _},
    os::unix::fs::FileExt,
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use nix::{
    errno::Errno,
    libc::{self, user_regs_struct},
    sys::{
        ptrace::{self, Options},
        signal::{Signal, kill},
        wait::{WaitPidFlag, WaitStatus, waitpid},
    },
    unistd::Pid,
};

use super::step::Step;

/// A call on a file of the folder, or on the folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Call {
    Open { name: String, makes: bool, writes: bool, empties: bool },
    OpenFolder,
    Read,
    Write { offset: Option<usize> },
    Resize { length: usize },
    Sync,
    Remove { name: String },
    Rename { from: String, to: String },
}

/// What is done about a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It goes through.
    Pass,
    /// It fails.
    Refuse(Errno),
    /// It is not done, and returns as if it were.
    Pretend,
    /// It goes through later.
    Wait(Duration),
}

/// Decides about calls, and may do things of its own.
pub trait Plan {
    /// About the call with that number; what the plan does itself is added to what has happened to `files`.
    fn verdict(&mut self, number: usize, call: &Call, files: &mut FolderFiles) -> Verdict;

    /// Called often while the program runs: the signal that it gets now, after so many calls.
    fn tick(&mut self, _calls: usize) -> Option<Signal> {
        None
    }
}

/// The files of the folder, and what happened to them.
#[derive(Default)]
pub struct FolderFiles {
    pub steps: Vec<Step>,
    names: HashMap<String, usize>,
    created: usize,
}

impl FolderFiles {
    /// A new empty file, and its number.
    pub fn create(&mut self, name: &str) -> usize {
        self.created += 1;
        self.names.insert(name.to_owned(), self.created - 1);
        self.steps.push(Step::Create { name: name.to_owned() });
        self.created - 1
    }

    /// Whether there is a file of that name.
    pub fn has(&self, name: &str) -> bool {
        self.names.contains_key(name)
    }

    /// A name is gone, if it is there.
    pub fn remove(&mut self, name: &str) {
        if self.names.remove(name).is_some() {
            self.steps.push(Step::Remove { name: name.to_owned() });
        }
    }

    /// A file has another name, if it is there.
    pub fn rename(&mut self, from: &str, to: &str) {
        if let Some(file) = self.names.remove(from) {
            self.names.insert(to.to_owned(), file);
            self.steps.push(Step::Rename { from: from.to_owned(), to: to.to_owned() });
        }
    }
}

/// A program's end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ended {
    /// Its exit code, where it was not killed.
    pub code: Option<i32>,
    /// How long after it was asked to end, or said that it would.
    pub after: Option<Duration>,
}

enum OpenFile {
    /// SQLite's map of its log: what it holds after a cut is made up.
    Map,
    Folder,
    File {
        file: usize,
        position: usize,
    },
}

/// A call between its beginning and its end.
struct Begun {
    call: Call,
    fd: i64,
    regs: user_regs_struct,
    verdict: Verdict,
}

/// The program and what is known of it.
pub struct Layer<P> {
    folder: String,
    pub plan: P,
    pub files: FolderFiles,
    calls: usize,
    /// Print each call.
    pub tells: bool,
    open: HashMap<i64, OpenFile>,
    /// Threads within a call, with the call where it is one on the folder.
    inside: HashMap<Pid, Option<Begun>>,
    /// Threads that wait, and until when.
    held: BTreeMap<Instant, Vec<Pid>>,
    memory: Option<File>,
    main: Pid,
    asked: Option<Instant>,
}

/// A program that has not ended by then is killed.
const HANGS: Duration = Duration::from_secs(40);
/// What an x86-64 kernel has as a call's result while it begins.
const BEGINS: i64 = -(Errno::ENOSYS as i64);
/// The program says so with a line like this that it is about to end by itself.
pub const ENDING: &str = "ending";
/// The same once nothing is left to do.
pub const ENDED: &str = "ended";

impl<P: Plan> Layer<P> {
    /// For a program that works in `folder`.
    pub fn new(folder: &Path, plan: P) -> Self {
        Self {
            folder: folder.to_str().unwrap().to_owned(),
            plan,
            files: FolderFiles::default(),
            calls: 0,
            tells: false,
            open: HashMap::new(),
            inside: HashMap::new(),
            held: BTreeMap::new(),
            memory: None,
            main: Pid::from_raw(0),
            asked: None,
        }
    }

    /// Number of calls so far.
    pub const fn calls(&self) -> usize {
        self.calls
    }

    /// Runs this test's program with these arguments to its end, with its log in `log`. The program waits for a line before it begins.
    pub fn run(&mut self, arguments: &[&OsStr], log: &Path) -> Ended {
        self.open.clear();
        self.inside.clear();
        self.asked = None;
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(File::create(log).unwrap())
            .spawn()
            .unwrap();
        self.main = Pid::from_raw(child.id().cast_signed());
        self.memory = Some(File::open(format!("/proc/{}/mem", child.id())).unwrap());
        let options =
            Options::PTRACE_O_TRACESYSGOOD | Options::PTRACE_O_TRACECLONE | Options::PTRACE_O_EXITKILL;
        ptrace::seize(self.main, options).unwrap();
        ptrace::interrupt(self.main).unwrap();
        let mut out = child.stdout.take().unwrap();
        // What it says is read from its calls; the pipe must not fill up.
        let reader = thread::spawn(move || out.read_to_end(&mut Vec::new()));
        let ended = self.follow(&mut child);
        reader.join().unwrap().unwrap();
        ended
    }

    fn follow(&mut self, child: &mut Child) -> Ended {
        let mut begun = false;
        let until = Instant::now() + HANGS;
        loop {
            if Instant::now() > until {
                // What it did so far is looked at all the same.
                let _ = kill(self.main, Signal::SIGKILL);
            }
            self.tick();
            self.let_go();
            let flags = WaitPidFlag::__WALL | WaitPidFlag::__WNOTHREAD | WaitPidFlag::WNOHANG;
            match waitpid(None, Some(flags)) {
                Ok(WaitStatus::StillAlive) => thread::sleep(Duration::from_micros(20)),
                Ok(WaitStatus::Exited(pid, code)) if pid == self.main => return self.ended(Some(code)),
                Ok(WaitStatus::Signaled(pid, ..)) if pid == self.main => return self.ended(None),
                Ok(WaitStatus::PtraceSyscall(pid)) => self.stopped(pid),
                // Signals go through, traps of ptrace's own do not.
                Ok(WaitStatus::Stopped(pid, signal)) => go_on(pid, Some(signal)),
                Ok(WaitStatus::PtraceEvent(pid, ..)) => {
                    go_on(pid, None);
                    if !begun && pid == self.main {
                        begun = true;
                        // One that is gone already says so by its end.
                        let _ = child.stdin.as_mut().unwrap().write_all(b"\n");
                    }
                }
                Ok(_) => {}
                Err(Errno::EINTR) => {}
                Err(error) => panic!("waiting for the program: {error}"),
            }
        }
    }

    fn ended(&self, code: Option<i32>) -> Ended {
        Ended { code, after: self.asked.map(|asked| asked.elapsed()) }
    }

    fn tick(&mut self) {
        if let Some(signal) = self.plan.tick(self.calls) {
            self.asked.get_or_insert_with(Instant::now);
            kill(self.main, signal).unwrap();
        }
    }

    /// Lets threads go on whose time has come.
    fn let_go(&mut self) {
        while let Some(first) = self.held.first_entry().filter(|first| *first.key() <= Instant::now()) {
            first.remove().into_iter().for_each(|pid| go_on(pid, None));
        }
    }

    /// A thread stands at the beginning or at the end of a call.
    fn stopped(&mut self, pid: Pid) {
        let Ok(regs) = ptrace::getregs(pid) else { return };
        match self.inside.remove(&pid) {
            None if regs.rax.cast_signed() == BEGINS => return self.begins(pid, regs),
            // A new thread comes out of the call that made it.
            None | Some(None) => {}
            Some(Some(begun)) => self.ends(pid, &begun, regs),
        }
        go_on(pid, None);
    }

    fn begins(&mut self, pid: Pid, regs: user_regs_struct) {
        let fd = regs.rdi.cast_signed() as i32 as i64;
        let Some(call) = self.call(&regs, fd) else {
            self.inside.insert(pid, None);
            return go_on(pid, None);
        };
        let verdict = self.plan.verdict(self.calls, &call, &mut self.files);
        if self.tells {
            println!("{} {pid}: {call:?}, {verdict:?}", self.calls);
        }
        self.calls += 1;
        self.tick();
        self.inside.insert(pid, Some(Begun { call, fd, regs, verdict }));
        match verdict {
            Verdict::Pass => {}
            Verdict::Refuse(_) | Verdict::Pretend => {
                // A call that there is not.
                let _ = ptrace::setregs(pid, user_regs_struct { orig_rax: u64::MAX, ..regs });
            }
            Verdict::Wait(time) => {
                self.held.entry(Instant::now() + time).or_default().push(pid);
                return;
            }
        }
        go_on(pid, None);
    }

    fn ends(&mut self, pid: Pid, begun: &Begun, regs: user_regs_struct) {
        let is_sync = matches!(begun.call, Call::Sync);
        let made_up = match begun.verdict {
            Verdict::Refuse(error) => Some(-(error as i64)),
            // A write has taken all.
            Verdict::Pretend if matches!(begun.call, Call::Write { .. }) => {
                Some(begun.regs.rdx.cast_signed())
            }
            Verdict::Pretend => Some(0),
            Verdict::Pass | Verdict::Wait(_) => None,
        };
        let result = made_up.unwrap_or(regs.rax.cast_signed());
        if made_up.is_some() {
            let _ = ptrace::setregs(pid, user_regs_struct { rax: result.cast_unsigned(), ..regs });
        }
        if is_sync && (made_up.is_some() || result < 0) {
            if let Some(OpenFile::File { file, .. }) = self.open.get(&begun.fd) {
                self.files.steps.push(Step::SyncFailed { file: *file });
            }
        } else if made_up.is_none() && result >= 0 {
            self.done(begun, result);
        }
    }

    /// A call that was done.
    fn done(&mut self, begun: &Begun, result: i64) {
        match &begun.call {
            Call::OpenFolder => drop(self.open.insert(result, OpenFile::Folder)),
            Call::Open { name, .. } if name.ends_with("-shm") => {
                self.open.insert(result, OpenFile::Map);
            }
            Call::Open { name, makes, empties, .. } => {
                let file = match self.files.names.get(name) {
                    Some(file) => *file,
                    None if *makes => self.files.create(name),
                    None => panic!("{name} came from nowhere"),
                };
                if *empties {
                    self.files.steps.push(Step::Resize { file, length: 0 });
                }
                self.open.insert(result, OpenFile::File { file, position: 0 });
            }
            Call::Read => {
                // A read at a place of its own moves nothing.
                if begun.regs.orig_rax == libc::SYS_read as u64
                    && let Some(OpenFile::File { position, .. }) = self.open.get_mut(&begun.fd)
                {
                    *position += result as usize;
                }
            }
            Call::Write { offset } => {
                let mut bytes = vec![0; result as usize];
                self.read_memory(begun.regs.rsi, &mut bytes);
                if let Some(OpenFile::File { file, position }) = self.open.get_mut(&begun.fd) {
                    let at = offset.unwrap_or(*position);
                    *position += if offset.is_none() { bytes.len() } else { 0 };
                    self.files.steps.push(Step::Write { file: *file, offset: at, bytes });
                }
            }
            Call::Resize { length } => {
                if let Some(OpenFile::File { file, .. }) = self.open.get(&begun.fd) {
                    self.files.steps.push(Step::Resize { file: *file, length: *length });
                }
            }
            Call::Sync => match self.open.get(&begun.fd) {
                Some(OpenFile::File { file, .. }) => self.files.steps.push(Step::Sync { file: *file }),
                Some(OpenFile::Folder) => self.files.steps.push(Step::SyncFolder),
                Some(OpenFile::Map) | None => {}
            },
            Call::Remove { name } => self.files.remove(name),
            Call::Rename { from, to } => self.files.rename(from, to),
        }
    }

    /// The call that begins, if it is one on the folder; takes in what concerns no disk.
    fn call(&mut self, regs: &user_regs_struct, fd: i64) -> Option<Call> {
        let is_ours = self.open.contains_key(&fd);
        let at_position = |offset| is_ours.then_some(Call::Write { offset });
        match regs.orig_rax.cast_signed() {
            libc::SYS_open => self.opening(regs.rdi, regs.rsi),
            libc::SYS_openat => self.opening(regs.rsi, regs.rdx),
            libc::SYS_close => {
                self.open.remove(&fd);
                None
            }
            libc::SYS_lseek => {
                assert!(
                    !is_ours || regs.rdx as i32 == libc::SEEK_SET,
                    "the journal seeks in a way that this test does not know"
                );
                if let Some(OpenFile::File { position, .. }) = self.open.get_mut(&fd) {
                    *position = regs.rsi as usize;
                }
                None
            }
            libc::SYS_read | libc::SYS_pread64 => is_ours.then_some(Call::Read),
            libc::SYS_write if fd == 1 => {
                self.reported(regs);
                None
            }
            libc::SYS_write => at_position(None),
            libc::SYS_pwrite64 => at_position(Some(regs.r10 as usize)),
            libc::SYS_ftruncate => is_ours.then_some(Call::Resize { length: regs.rsi as usize }),
            libc::SYS_fallocate => is_ours.then_some(Call::Resize { length: (regs.rdx + regs.r10) as usize }),
            libc::SYS_fsync | libc::SYS_fdatasync => is_ours.then_some(Call::Sync),
            libc::SYS_unlink => Some(Call::Remove { name: self.name(regs.rdi)? }),
            libc::SYS_unlinkat => Some(Call::Remove { name: self.name(regs.rsi)? }),
            libc::SYS_rename => Some(Call::Rename { from: self.name(regs.rdi)?, to: self.name(regs.rsi)? }),
            libc::SYS_renameat | libc::SYS_renameat2 => {
                Some(Call::Rename { from: self.name(regs.rsi)?, to: self.name(regs.r10)? })
            }
            libc::SYS_writev
            | libc::SYS_pwritev
            | libc::SYS_readv
            | libc::SYS_preadv
            | libc::SYS_dup
            | libc::SYS_dup2
            | libc::SYS_dup3
            | libc::SYS_sync_file_range
            | libc::SYS_copy_file_range
            | libc::SYS_sendfile => {
                assert!(!is_ours, "the journal uses call {}, which this test does not know", regs.orig_rax);
                None
            }
            libc::SYS_truncate | libc::SYS_creat | libc::SYS_link | libc::SYS_symlink => {
                assert!(
                    self.name(regs.rdi).is_none(),
                    "the journal uses call {}, which this test does not know",
                    regs.orig_rax
                );
                None
            }
            _ => None,
        }
    }

    fn opening(&self, path: u64, flags: u64) -> Option<Call> {
        let path = self.text(path);
        if path == self.folder {
            return Some(Call::OpenFolder);
        }
        let name = self.in_folder(&path)?;
        let has = |flag: i32| flags as i32 & flag != 0;
        let writes = has(libc::O_WRONLY | libc::O_RDWR);
        Some(Call::Open { name, makes: has(libc::O_CREAT), writes, empties: has(libc::O_TRUNC) })
    }

    fn name(&self, path: u64) -> Option<String> {
        self.in_folder(&self.text(path))
    }

    fn in_folder(&self, path: &str) -> Option<String> {
        let name = path.strip_prefix(&self.folder)?.strip_prefix('/')?;
        (!name.is_empty()).then(|| name.to_owned())
    }

    /// Takes in what the program says on its standard output: a report is out as soon as it is begun.
    fn reported(&mut self, regs: &user_regs_struct) {
        let mut bytes = vec![0; regs.rdx as usize];
        self.read_memory(regs.rsi, &mut bytes);
        let text = String::from_utf8(bytes).unwrap();
        for line in text.lines() {
            if self.tells {
                println!("{line}");
            }
            match line.split_once(' ') {
                Some(("fired", shot)) => self.files.steps.push(Step::Fired(shot.parse().unwrap())),
                Some(("committed", shot)) => self.files.steps.push(Step::Committed(shot.parse().unwrap())),
                None if line == "damage" => self.files.steps.push(Step::Damage),
                None if line == ENDED => {}
                None if line == ENDING => drop(self.asked.get_or_insert_with(Instant::now)),
                _ => panic!("the program said {text:?}"),
            }
        }
    }

    fn read_memory(&self, at: u64, bytes: &mut [u8]) {
        self.memory.as_ref().unwrap().read_exact_at(bytes, at).unwrap();
    }

    /// A text that ends with a zero.
    fn text(&self, at: u64) -> String {
        let mut bytes = Vec::new();
        let mut block = [0; 256];
        loop {
            let from = at + bytes.len() as u64;
            // A block ends where a page does: what follows may not be there.
            let length = block.len().min((4096 - from % 4096) as usize);
            let Ok(count) = self.memory.as_ref().unwrap().read_at(&mut block[..length], from) else { break };
            let zero = block[..count].iter().position(|byte| *byte == 0);
            bytes.extend_from_slice(&block[..zero.unwrap_or(count)]);
            if zero.is_some() || count == 0 {
                break;
            }
        }
        String::from_utf8_lossy(&bytes).into_owned()
    }
}

/// A thread goes on to its next call's beginning or end; one that is gone does not.
fn go_on(pid: Pid, signal: Option<Signal>) {
    let _ = ptrace::syscall(pid, signal);
}

/// The folder's path as the program sees it.
pub fn folder_in(base: &Path) -> PathBuf {
    let folder = base.canonicalize().unwrap().join("data");
    std::fs::create_dir(&folder).unwrap();
    folder
}
