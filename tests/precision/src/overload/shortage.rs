//! What a computer is short of: processor time that others take, heat that slows it down, memory, and a slow disk. The last three are limits of
//! the kernel's control groups (version 1 or 2), which only root may set.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
    sync::atomic::{AtomicBool, Ordering},
    thread,
    time::Duration,
};

use anyhow::{Context, Result, ensure};

/// A shortage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shortage {
    /// So many busy loops beside the program.
    Loops(usize),
    /// The processor does so much of its work a second, of 1: it is too hot.
    Heat(f64),
    /// So many MB are left.
    Memory(u64),
    /// So many MB a second can be written.
    Disk(u64),
}

impl Shortage {
    /// For the table.
    pub fn name(self) -> String {
        match self {
            Self::Loops(count) => format!("{count} busy loops"),
            Self::Heat(share) => format!("heat: {:.0} % speed", share * 100.0),
            Self::Memory(mb) => format!("{mb} MB free"),
            Self::Disk(mb) => format!("disk {mb} MB/s"),
        }
    }
}

/// Where a program runs that is to fall short: its control group, and for a slow disk a file system of its own.
#[derive(Debug)]
pub struct Place {
    short: Shortage,
    group: Option<Group>,
    disk: Option<Disk>,
    folder: tempfile::TempDir,
}

impl Place {
    /// Makes it; only [`Shortage::Loops`] can do without root.
    pub fn new(short: Shortage) -> Result<Self> {
        let folder = tempfile::tempdir()?;
        let group = match short {
            Shortage::Loops(_) => None,
            _ => Some(Group::new()?),
        };
        let disk = match short {
            Shortage::Disk(_) => Some(Disk::new(folder.path())?),
            _ => None,
        };
        Ok(Self { short, group, disk, folder })
    }

    /// The folder that the program writes to.
    pub fn folder(&self) -> &Path {
        self.disk.as_ref().map_or(self.folder.path(), |disk| &disk.mounted)
    }

    /// Takes a process in.
    pub fn enter(&self, process: u32) -> Result<()> {
        self.group.as_ref().map_or(Ok(()), |group| group.enter(process))
    }

    /// Falls short for so long; `begun` and `ended` are called when that begins and ends.
    pub fn fall_short<T>(&self, time: Duration, now: impl Fn() -> T) -> Result<[T; 2]> {
        if let Shortage::Loops(count) = self.short {
            return Ok(busy(count, time, now));
        }
        let group = self.group.as_ref().context("a control group")?;
        let begun = now();
        match self.short {
            Shortage::Heat(share) => {
                let cores = thread::available_parallelism().map_or(1, usize::from) as f64;
                group.processor(Some(share * cores))?;
            }
            Shortage::Memory(mb) => group.memory(Some(mb << 20))?,
            Shortage::Disk(mb) => {
                group.disk(self.disk.as_ref().context("a disk")?.device, Some(mb * 1_000_000))?
            }
            Shortage::Loops(_) => {}
        }
        thread::sleep(time);
        match self.short {
            Shortage::Heat(_) => group.processor(None)?,
            Shortage::Memory(_) => group.memory(None)?,
            Shortage::Disk(_) => group.disk(self.disk.as_ref().context("a disk")?.device, None)?,
            Shortage::Loops(_) => {}
        }
        Ok([begun, now()])
    }
}

/// Busy loops for so long.
fn busy<T>(count: usize, time: Duration, now: impl Fn() -> T) -> [T; 2] {
    let over = AtomicBool::new(false);
    thread::scope(|scope| {
        let begun = now();
        for _ in 0..count {
            scope.spawn(|| {
                while !over.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            });
        }
        thread::sleep(time);
        over.store(true, Ordering::Relaxed);
        [begun, now()]
    })
}

const GROUPS: &str = "/sys/fs/cgroup";

/// A control group.
#[derive(Debug)]
struct Group {
    /// Its folders: one for each kind of limit in version 1, one for all in version 2.
    folders: Vec<PathBuf>,
    is_second: bool,
}

impl Group {
    fn new() -> Result<Self> {
        let root = Path::new(GROUPS);
        let is_second = root.join("cgroup.controllers").exists();
        let name = format!("bowwave-overload-{}", std::process::id());
        let parents = if is_second {
            put(&root.join("cgroup.subtree_control"), "+cpu +memory +io")?;
            vec![root.to_owned()]
        } else {
            vec![root.join("memory"), root.join("cpu"), root.join("blkio")]
        };
        let folders: Vec<PathBuf> = parents.into_iter().map(|parent| parent.join(&name)).collect();
        for folder in &folders {
            fs::create_dir(folder).with_context(|| format!("{}: run this as root", folder.display()))?;
        }
        Ok(Self { folders, is_second })
    }

    fn enter(&self, process: u32) -> Result<()> {
        self.folders.iter().try_for_each(|folder| put(&folder.join("cgroup.procs"), &process.to_string()))
    }

    fn file(&self, first: [&str; 2], second: &str) -> PathBuf {
        if self.is_second {
            return self.folders[0].join(second);
        }
        let [kind, name] = first;
        let of = |folder: &&PathBuf| folder.parent().is_some_and(|parent| parent.ends_with(kind));
        self.folders.iter().find(of).unwrap_or(&self.folders[0]).join(name)
    }

    /// Seconds of processor time a second.
    fn processor(&self, cores: Option<f64>) -> Result<()> {
        /// Shorter than a frame, and so long that a turn of a few milliseconds is not cut: a hot processor is slow, it does not stand.
        const PERIOD_US: f64 = 5000.0;
        let quota = cores.map(|cores| (cores * PERIOD_US).round());
        if self.is_second {
            let text = quota.map_or("max".to_owned(), |quota| quota.to_string());
            return put(&self.folders[0].join("cpu.max"), &format!("{text} {PERIOD_US}"));
        }
        put(&self.file(["cpu", "cpu.cfs_period_us"], ""), &PERIOD_US.to_string())?;
        put(&self.file(["cpu", "cpu.cfs_quota_us"], ""), &quota.unwrap_or(-1.0).to_string())
    }

    /// Bytes beyond what the programs hold themselves; what files have in memory is given up for them.
    fn memory(&self, free: Option<u64>) -> Result<()> {
        let limit = self.file(["memory", "memory.limit_in_bytes"], "memory.max");
        let Some(free) = free else { return put(&limit, if self.is_second { "max" } else { "-1" }) };
        let used =
            number(&fs::read_to_string(self.file(["memory", "memory.usage_in_bytes"], "memory.current"))?)?;
        let all = fs::read_to_string(self.file(["memory", "memory.stat"], "memory.stat"))?;
        let key = if self.is_second { "file " } else { "cache " };
        let of_files = all.lines().find_map(|line| line.strip_prefix(key)).context("memory of files")?;
        put(&limit, &(used.saturating_sub(number(of_files)?) + free).to_string())
    }

    /// Bytes a second to and from that device. In version 1 what the kernel writes later belongs to no group: all that use it are limited.
    fn disk(&self, (major, minor): (u32, u32), bytes: Option<u64>) -> Result<()> {
        if self.is_second {
            let text = bytes.map_or("max".to_owned(), |bytes| bytes.to_string());
            return put(&self.folders[0].join("io.max"), &format!("{major}:{minor} rbps={text} wbps={text}"));
        }
        for name in ["read", "write"] {
            let path = Path::new(GROUPS).join("blkio").join(format!("blkio.throttle.{name}_bps_device"));
            put(&path, &format!("{major}:{minor} {}", bytes.unwrap_or(0)))?;
        }
        Ok(())
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        self.folders.iter().for_each(|folder| drop(fs::remove_dir(folder)));
    }
}

fn number(text: &str) -> Result<u64> {
    text.trim().parse().with_context(|| format!("a number of bytes: {text:?}"))
}

fn put(path: &Path, text: &str) -> Result<()> {
    fs::write(path, text).with_context(|| format!("{} does not take {text}", path.display()))
}

/// A file system in a file, on a loop device.
#[derive(Debug)]
struct Disk {
    mounted: PathBuf,
    device: (u32, u32),
}

impl Disk {
    fn new(folder: &Path) -> Result<Self> {
        const BYTES: u64 = 512 << 20;
        let (image, mounted) = (folder.join("disk"), folder.join("mounted"));
        fs::File::create(&image)?.set_len(BYTES)?;
        fs::create_dir(&mounted)?;
        command("mkfs.ext4", &["-q", "-F"], &[&image])?;
        command("mount", &["-o", "loop"], &[&image, &mounted])?;
        let device = rustix::fs::stat(&mounted)?.st_dev;
        Ok(Self { mounted, device: (rustix::fs::major(device), rustix::fs::minor(device)) })
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        if let Err(e) = command("umount", &[], &[&self.mounted]) {
            eprintln!("{e:#}");
        }
    }
}

fn command(program: &str, options: &[&str], paths: &[&Path]) -> Result<()> {
    let done =
        Command::new(program).args(options).args(paths).output().with_context(|| program.to_owned())?;
    let said = String::from_utf8_lossy(&done.stderr);
    ensure!(done.status.success(), "{program}: {}; run this as root", said.trim());
    Ok(())
}
