//! The same on a real file system: ext4 on a loop device, and what the kernel itself can do to one while the program shoots.
//!
//! The layer meets each call; this meets what the layer takes for granted: that ext4 keeps what it has synced, and says so when it cannot.
//! It does not always: a sync that is under way as ext4 gives up (an abort, a shut-down) may return success although nothing of it is on the
//! disk. What was reported by such a sync is in doubt until the next call fails, and then written again or told; a program that is killed or
//! loses its power within these milliseconds cannot. As root only.

use std::{
    collections::BTreeSet,
    fs::{self, File},
    io::{BufRead as _, BufReader, Write as _},
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    sync::{
        Mutex,
        atomic::{AtomicUsize, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use nix::{
    sys::signal::{Signal, kill},
    unistd::Pid,
};
use rustix::{
    fs::FallocateFlags,
    ioctl::{Opcode, Setter, ioctl, opcode},
    process::geteuid,
};

use super::{
    END_MOST, gun,
    look::{CaseReport, Rounds, compare, files, logged, rows_aside},
};
use crate::{
    image::DiskRandom,
    layer::{ENDED, ENDING, folder_in},
    scratch,
    step::Step,
};

/// Bytes of the file system.
const SIZE: u64 = 16 << 20;
const AT_ONCE: usize = 8;
/// How long a frozen file system stays so.
const FROZEN: Duration = Duration::from_secs(5);
/// How long a full one stays so where that is not for ever.
const FULL: Duration = Duration::from_millis(40);
/// Rounds within which trouble begins.
const ROUNDS: usize = 20;

/// Has ext4 give up at once (EXT4_IOC_SHUTDOWN of linux/fs/ext4/ext4.h); its argument says what is still written.
const SHUT_DOWN: Opcode = opcode::read::<u32>(b'X', 125);
/// Nothing is still written, the journal neither: what a power cut leaves.
const NO_LOG_FLUSH: u32 = 2;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Trouble {
    /// The program's end alone.
    Nothing,
    Full,
    FullForAWhile,
    /// ext4 finds an error in itself, aborts its journal and lets nothing be changed any more.
    Abort,
    /// All calls fail.
    InputOutput,
    /// Nothing is written for five seconds.
    Slow,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    Itself,
    Terminated(Duration),
    Killed(Duration),
    PowerCut(Duration),
}

#[derive(Clone, Copy, Debug)]
struct Case {
    trouble: Trouble,
    /// Fired rounds after which it begins, and how long after.
    at: usize,
    later: Duration,
    end: End,
}

/// Each trouble with each end, so many times, and prints what became of the rounds.
pub fn run(times: usize) {
    if !geteuid().is_root() || LoopDisk::mount().is_none() {
        println!("skipped: a real file system on a loop device needs root and loop devices");
        return;
    }
    let cases = cases(times);
    let (next, reports) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    thread::scope(|scope| {
        for _ in 0..AT_ONCE {
            scope.spawn(|| {
                while let Some(case) = cases.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let report = shoot(case);
                    for fault in &report.faults {
                        println!("{case:?}: {fault}");
                    }
                    reports.lock().unwrap().push(report);
                }
            });
        }
    });
    let reports = reports.into_inner().unwrap();
    let sum = |value: fn(&CaseReport) -> usize| reports.iter().map(value).sum::<usize>();
    println!(
        "ext4 on loop devices: {} cases, {} rounds reported, {} lost, {} in the side file, {} in the log, longest end {:.2} s",
        reports.len(),
        sum(|r| r.rounds.reported),
        sum(|r| r.rounds.lost),
        sum(|r| r.rounds.aside),
        sum(|r| r.rounds.logged),
        reports.iter().filter_map(|report| report.end).max().unwrap_or_default().as_secs_f64(),
    );
    assert!(reports.iter().all(|report| report.faults.is_empty()), "something was lost, invented or late");
}

fn cases(times: usize) -> Vec<Case> {
    use Trouble::{Abort, Full, FullForAWhile, InputOutput, Nothing, Slow};
    let mut random = DiskRandom(0x10_0b);
    let mut all = Vec::new();
    for _ in 0..times {
        for trouble in [Slow, Nothing, Full, FullForAWhile, Abort, InputOutput] {
            let mut milliseconds = || Duration::from_millis(random.below(60) as u64);
            let ends = [
                End::Itself,
                End::Terminated(milliseconds()),
                End::Killed(milliseconds()),
                End::PowerCut(milliseconds()),
            ];
            for end in ends {
                let later = Duration::from_micros(random.below(3000) as u64);
                all.push(Case { trouble, at: 1 + random.below(ROUNDS), later, end });
            }
        }
    }
    all
}

/// What is seen of the program while it runs.
#[derive(Default)]
struct Followed {
    rounds: Rounds,
    /// When it was asked to end, or said that it would.
    asked: Option<Instant>,
    /// When it had nothing left to do.
    done: Option<Instant>,
    /// Rounds that were reported before the trouble began.
    before: BTreeSet<u64>,
}

/// The program on a disk that goes through the case.
fn shoot(case: &Case) -> CaseReport {
    let disk = LoopDisk::mount().unwrap();
    let folder = folder_in(&disk.mounted);
    let log = disk.base.path().join("log");
    let mut program = Command::new(std::env::current_exe().unwrap())
        .args([gun::FLAG.as_ref(), folder.as_os_str()])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(File::create(&log).unwrap())
        .spawn()
        .unwrap();
    let followed = follow(&mut program, &disk, case);
    let code = program.wait().unwrap().code();
    let exited = Instant::now();
    // A call that waits for a frozen file system cannot be interrupted, so the process is there until it thaws.
    let ended = if case.trouble == Trouble::Slow { followed.done.unwrap_or(exited) } else { exited };
    let is_killed = matches!(case.end, End::Killed(_) | End::PowerCut(_));
    let end = followed.asked.filter(|_| !is_killed).map(|asked| ended.saturating_duration_since(asked));
    let mut report = CaseReport { end, ..CaseReport::default() };
    let log = fs::read_to_string(&log).unwrap();
    if !is_killed {
        if code != Some(0) {
            report.faults.push(format!("it ended with {code:?}: {log}"));
        }
        if end.is_none_or(|end| end > END_MOST) {
            report.faults.push(format!("its end took {end:?}"));
        }
    }
    let logged = logged(&log);
    disk.mount_again();
    report.rounds.reported = followed.rounds.reported.len();
    report.rounds.logged = logged.len();
    report.rounds.aside = rows_aside(&folder);
    // One that has ended in time was not killed.
    let must = match case.trouble {
        _ if code == Some(0) => &followed.rounds.fired,
        Trouble::Abort | Trouble::InputOutput => &followed.before,
        _ => &followed.rounds.reported,
    };
    compare(&files(&folder), &followed.rounds, must, &logged, &mut report);
    report
}

/// Reads what the program says until it ends, and has the trouble begin.
fn follow(program: &mut Child, disk: &LoopDisk, case: &Case) -> Followed {
    let pid = Pid::from_raw(program.id().cast_signed());
    let lines = BufReader::new(program.stdout.take().unwrap()).lines();
    let mut stdin = program.stdin.take().unwrap();
    stdin.write_all(b"\n").unwrap();
    let mut followed = Followed::default();
    let mut reported = Vec::new();
    thread::scope(|scope| {
        let mut meddling = None;
        for line in lines {
            let line = line.unwrap();
            match line.split_once(' ') {
                Some(("fired", shot)) => {
                    followed.rounds.take(&Step::Fired(shot.parse().unwrap()));
                    if followed.rounds.fired.len() == case.at {
                        meddling = Some(scope.spawn(move || meddle(disk, case, pid)));
                    }
                }
                Some(("committed", shot)) => {
                    let shot = shot.parse().unwrap();
                    reported.push((shot, Instant::now()));
                    followed.rounds.take(&Step::Committed(shot));
                }
                None if line == ENDING => followed.asked = Some(Instant::now()),
                None if line == ENDED => followed.done = Some(Instant::now()),
                _ => {}
            }
        }
        let (begun, signalled) = meddling.map(|meddling| meddling.join().unwrap()).unzip();
        followed.asked = followed.asked.into_iter().chain(signalled.flatten()).min();
        let is_before = |(_, at): &&(u64, Instant)| begun.is_none_or(|begun| *at < begun);
        followed.before = reported.iter().filter(is_before).map(|(shot, _)| *shot).collect();
    });
    followed
}

/// Makes the trouble, and the end; when the trouble began, and when the program was sent a signal.
fn meddle(disk: &LoopDisk, case: &Case, pid: Pid) -> (Instant, Option<Instant>) {
    thread::sleep(case.later);
    let begun = Instant::now();
    let filler = disk.mounted.join("filler");
    match case.trouble {
        Trouble::Nothing => {}
        Trouble::Full | Trouble::FullForAWhile => fill(&filler),
        Trouble::Abort => disk.find_an_error(),
        Trouble::InputOutput => disk.shut_down(),
        Trouble::Slow => command("fsfreeze", &["-f"], &disk.mounted),
    }
    let mut signalled = None;
    thread::scope(|scope| {
        scope.spawn(|| match case.trouble {
            Trouble::FullForAWhile => {
                thread::sleep(FULL);
                // The power may be gone by then.
                let _ = fs::remove_file(&filler);
            }
            Trouble::Slow => {
                thread::sleep(FROZEN.saturating_sub(begun.elapsed()));
                command("fsfreeze", &["-u"], &disk.mounted);
            }
            _ => {}
        });
        signalled = end(disk, case, pid);
    });
    (begun, signalled)
}

fn end(disk: &LoopDisk, case: &Case, pid: Pid) -> Option<Instant> {
    let (after, signal) = match case.end {
        End::Itself => return None,
        End::Terminated(after) => (after, Signal::SIGTERM),
        End::Killed(after) | End::PowerCut(after) => (after, Signal::SIGKILL),
    };
    thread::sleep(after);
    if matches!(case.end, End::PowerCut(_)) {
        disk.shut_down();
    }
    let at = Instant::now();
    // It may have ended already.
    kill(pid, signal).ok().map(|()| at)
}

/// Leaves no block free, as another program's file does.
fn fill(path: &Path) {
    let file = File::create(path).unwrap();
    let mut length = SIZE;
    let mut at = 0;
    while length >= 1024 {
        match rustix::fs::fallocate(&file, FallocateFlags::empty(), at, length) {
            Ok(()) => at += length,
            Err(_) => length /= 2,
        }
    }
}

/// ext4 in a file, on a loop device.
struct LoopDisk {
    base: tempfile::TempDir,
    device: String,
    mounted: PathBuf,
}

impl LoopDisk {
    /// A new one; nothing where the machine has none to give.
    fn mount() -> Option<Self> {
        let base = scratch();
        let (image, mounted) = (base.path().join("image"), base.path().join("disk"));
        File::create(&image).unwrap().set_len(SIZE).unwrap();
        fs::create_dir(&mounted).unwrap();
        let made = Command::new("mkfs.ext4").args(["-q", "-F", "-m", "0"]).arg(&image).status();
        made.is_ok_and(|status| status.success()).then_some(())?;
        let output = Command::new("losetup").args(["--find", "--show"]).arg(&image).output().ok()?;
        let device = output.status.success().then(|| String::from_utf8(output.stdout).unwrap())?;
        let disk = Self { base, device: device.trim().to_owned(), mounted };
        disk.attach().then_some(disk)
    }

    fn attach(&self) -> bool {
        let mounting = Command::new("mount")
            .args(["-o", "errors=remount-ro", &self.device])
            .arg(&self.mounted)
            .stderr(Stdio::null())
            .status();
        mounting.is_ok_and(|status| status.success())
    }

    /// What the next start meets.
    fn mount_again(&self) {
        assert!(self.unmount(), "{} stays busy", self.mounted.display());
        assert!(self.attach(), "{} cannot be mounted again", self.mounted.display());
    }

    /// A program that is being started beside holds what is open here for a moment.
    fn unmount(&self) -> bool {
        const TRIES: u32 = 200;
        (0..TRIES).any(|_| {
            let done = Command::new("umount").arg(&self.mounted).stderr(Stdio::null()).status();
            let is_done = done.is_ok_and(|status| status.success());
            if !is_done {
                thread::sleep(Duration::from_millis(10));
            }
            is_done
        })
    }

    fn shut_down(&self) {
        let folder = File::open(&self.mounted).unwrap();
        // SAFETY: the call reads a u32.
        let ext4_shutdown = unsafe { Setter::<{ SHUT_DOWN }, u32>::new(NO_LOG_FLUSH) };
        // SAFETY: as above; it changes the file system alone.
        unsafe { ioctl(&folder, ext4_shutdown) }.unwrap();
    }

    fn find_an_error(&self) {
        let name = Path::new(&self.device).file_name().unwrap();
        fs::write(Path::new("/sys/fs/ext4").join(name).join("trigger_fs_error"), "1").unwrap();
    }
}

impl Drop for LoopDisk {
    fn drop(&mut self) {
        self.unmount();
        let _ = Command::new("losetup").args(["--detach", &self.device]).status();
    }
}

fn command(name: &str, arguments: &[&str], path: &Path) {
    let output = Command::new(name).args(arguments).arg(path).output().unwrap();
    assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
}
