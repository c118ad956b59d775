//! What is attacked: the commands that read files.

use std::{
    fs,
    io::Read as _,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use bowwave_core::{
    model::Zone,
    time::Time,
    world::{
        scenario::Side,
        score::{Outcome, ShotRecord},
    },
};
use bowwave_record::{Journal, Run};
use bowwave_tests::{play, program, root, small_recording};
use glam::DVec3;

/// Longest time that a run may keep a processor busy, seconds, ...
const BUSY_S: u32 = 10;
/// ...and take beside others.
const TIME: Duration = Duration::from_secs(60);
/// Most memory that it may ask for, KiB.
const MEMORY_KIB: u32 = 512 << 10;

/// One in so many runs has a Vulkan driver, which takes ten times as long to start as all the rest: the others read the same files without.
const DRAWN: usize = 16;

/// A command and the file that it is attacked by.
pub struct Target {
    pub name: &'static str,
    /// Name that the file has.
    file: &'static str,
    /// Good files, or folders of them.
    good: Vec<PathBuf>,
    /// Arguments in a folder that has the file under its name.
    arguments: Vec<String>,
    /// Files beside it.
    beside: Vec<(&'static str, Vec<u8>)>,
}

impl Target {
    /// The good files.
    pub fn seeds(&self) -> Vec<Vec<u8>> {
        let read = |path: &Path| {
            let bytes = fs::read(path).unwrap();
            assert!(
                bytes.len() < 1 << 20,
                "{} is too large to be damaged thousands of times",
                path.display()
            );
            bytes
        };
        let mut files = Vec::new();
        for path in &self.good {
            if path.is_dir() {
                let mut found: Vec<_> =
                    fs::read_dir(path).unwrap().map(|entry| entry.unwrap().path()).collect();
                found.sort();
                files.extend(found);
            } else {
                files.push(path.clone());
            }
        }
        assert!(!files.is_empty(), "{}: no good file", self.name);
        files.iter().map(|path| read(path)).collect()
    }

    /// Runs the command on the `number`th file, of those bytes, in `folder`; its exit code, or what is wrong.
    pub fn run(&self, folder: &Path, number: usize, bytes: &[u8]) -> Result<i32, String> {
        let put = |name: &str, bytes: &[u8]| {
            let file = folder.join(name);
            fs::create_dir_all(file.parent().unwrap()).unwrap();
            fs::write(file, bytes).unwrap();
        };
        self.beside.iter().for_each(|(name, bytes)| put(name, bytes));
        put(self.file, bytes);
        let said = Said::of(folder, &self.arguments, number.is_multiple_of(DRAWN))?;
        said.judge()
    }
}

/// What a run printed, and how it ended.
struct Said {
    out: Vec<u8>,
    code: Option<i32>,
}

impl Said {
    fn of(folder: &Path, arguments: &[String], is_drawn: bool) -> Result<Self, String> {
        let driver =
            if is_drawn { "" } else { "export VK_DRIVER_FILES=/dev/null VK_ICD_FILENAMES=/dev/null; " };
        let limited = format!("{driver}ulimit -v {MEMORY_KIB}; ulimit -t {BUSY_S}; exec \"$0\" \"$@\"");
        let out = fs::File::create(folder.join("said")).unwrap();
        let mut child = Command::new("sh")
            .args(["-c", &limited])
            .arg(program())
            .args(arguments)
            .current_dir(folder)
            .env_remove("RUST_LOG")
            // Arenas of threads are reserved, not used.
            .env("MALLOC_ARENA_MAX", "1")
            .stdin(Stdio::null())
            .stderr(out.try_clone().unwrap())
            .stdout(out)
            .spawn()
            .unwrap();
        let until = Instant::now() + TIME;
        let code = loop {
            if let Some(status) = child.try_wait().unwrap() {
                break status.code();
            }
            if Instant::now() > until {
                child.kill().unwrap();
                child.wait().unwrap();
                return Err(format!("it had not ended after {} s", TIME.as_secs()));
            }
            thread::sleep(Duration::from_millis(1));
        };
        let mut out = Vec::new();
        fs::File::open(folder.join("said")).unwrap().take(64 << 20).read_to_end(&mut out).unwrap();
        Ok(Self { out, code })
    }

    fn judge(self) -> Result<i32, String> {
        let text = String::from_utf8_lossy(&self.out);
        if let Some(line) = text.lines().find(|line| line.contains("panicked at")) {
            return Err(format!("it panicked: {line}"));
        }
        let code = self.code.ok_or_else(|| format!("a signal ended it: {text:.300}"))?;
        if !(0..=3).contains(&code) {
            return Err(format!("exit code {code}: {text:.300}"));
        }
        if let Some(line) = text.lines().find(|line| line.trim_start().starts_with("FORGED")) {
            return Err(format!("the file made up the line {line:?}"));
        }
        let is_control = |c: &char| c.is_control() && !matches!(c, '\n' | '\t') || *c == '\u{202e}';
        if let Some(c) = text.chars().find(is_control) {
            return Err(format!("it printed {c:?}"));
        }
        Ok(code)
    }
}

/// All commands; `folder` takes the good files that are made for them.
pub fn all(folder: &Path) -> Vec<Target> {
    let corpus = |name: &str| root().join("tests/fuzz/corpus").join(name);
    let strings = |arguments: &[&str]| arguments.iter().map(|a| (*a).to_owned()).collect::<Vec<_>>();
    let run = folder.join("run");
    play(small_recording(), &run, 0, &["--record", "--frames", "20", "--video", "--stills", "3"]);
    let still = run.join("frame-00003.png");
    let board = folder.join("board.yaml");
    fs::write(&board, "target_type: 'aprilgrid'\ntagCols: 6\ntagRows: 6\ntagSize: 0.022\ntagSpacing: 0.3\n")
        .unwrap();
    let journal = folder.join("hits.sqlite");
    shoot(&journal);
    let scenario = b"[[boat]]\nname = \"a\"\nmodel = \"boat.glb\"\ncourse = \"still\"\nbearing_deg = 0\nrange_m = 200\nheading_deg = 90\n";
    let target = |name, file, good: Vec<PathBuf>, arguments: &[&str]| Target {
        name,
        file,
        good,
        arguments: strings(arguments),
        beside: Vec::new(),
    };
    vec![
        target("scenario", "file.toml", vec![corpus("scenario")], &["plan", "file.toml"]),
        Target {
            beside: vec![("scenario.toml", scenario.to_vec())],
            ..target("model", "boat.glb", vec![corpus("model")], &["plan", "scenario.toml"])
        },
        Target {
            // Of the size that one of the good calibrations is for.
            beside: vec![("pictures/still.png", png(1280, 720))],
            ..target(
                "calibration",
                "file.toml",
                vec![corpus("calibration")],
                &["import", "pictures", "--calibration", "file.toml", "--force", "--out", "made.mcap"],
            )
        },
        target(
            "recording",
            "file.mcap",
            vec![run.join("recording.mcap"), corpus("recording")],
            &["replay", "file.mcap"],
        ),
        target(
            "journal",
            "file.sqlite",
            vec![journal],
            &["hits", "file.sqlite", "--all-runs", "--format", "csv"],
        ),
        target(
            "video",
            "file.mp4",
            vec![run.join("video.mp4")],
            &["import", "file.mp4", "--force", "--out", "made.mcap"],
        ),
        target(
            "pictures",
            "pictures/file.png",
            vec![still, jpegs(&corpus("jpeg"), &folder.join("jpegs"))],
            &["import", "pictures", "--force", "--out", "made.mcap"],
        ),
        target(
            "board",
            "file.yaml",
            vec![board],
            &["calibrate", "board", "--target", "file.yaml", "--force", "--out", "made.svg"],
        ),
    ]
}

/// Pictures of the fuzz targets' inputs, whose first byte is none of the picture's; their folder.
fn jpegs(inputs: &Path, folder: &Path) -> PathBuf {
    fs::create_dir_all(folder).unwrap();
    for entry in fs::read_dir(inputs).unwrap().map(Result::unwrap) {
        fs::write(folder.join(entry.file_name()), &fs::read(entry.path()).unwrap()[1..]).unwrap();
    }
    folder.to_owned()
}

/// A black picture.
fn png(width: u32, height: u32) -> Vec<u8> {
    let mut png = std::io::Cursor::new(Vec::new());
    image::RgbImage::new(width, height).write_to(&mut png, image::ImageFormat::Png).unwrap();
    png.into_inner()
}

/// A journal of some rounds.
fn shoot(path: &Path) {
    let journal = Journal::open(path, &Run { scenario: "attacked".to_owned(), ..Run::default() }).unwrap();
    for shot in 1..=40u32 {
        let time = Time::from_ns(i64::from(shot) * 100_000_000);
        let outcome = Outcome::Hit {
            boat: "skiff".to_owned(),
            side: Some(Side::Hostile),
            zone: Zone::ALL[shot as usize % Zone::ALL.len()],
            time,
            range_m: 300.0,
            point: DVec3::ZERO,
        };
        let muzzle = DVec3::new(0.0, 0.5, 3.0);
        let shot = u64::from(shot);
        journal
            .shot(&ShotRecord { shot, fired: time, muzzle, bore: DVec3::Y, pose_age_ns: 0, outcome })
            .unwrap();
    }
    journal.finish().unwrap();
}
