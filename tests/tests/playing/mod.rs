//! `bowwave play` with the instructor's socket.

#![allow(dead_code, reason = "each test file uses some of it")]

use std::{
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
};

use bowwave_tests::program;
use tempfile::TempDir;

/// One boat that comes on, and two in reserve.
pub const SCENARIO: &str = r#"
name = "With a reserve"
seed = 3
[sea]
beaufort = 2
wind_from_deg = 0
[mount]
eye_height_m = 6.0
[weapon]
rounds_per_minute = 500
belt = 100
[[boat]]
name = "passer-by"
model = "dhow"
side = "neutral"
course = "straight"
range_m = 300
bearing_deg = 340
heading_deg = 90
speed_kn = 12
[[boat]]
name = "late"
model = "skiff"
side = "hostile"
crew = "attacker"
range_m = 600
bearing_deg = 10
count = 2
reserve = true
"#;

/// A trainer that plays, with its socket.
pub struct Playing {
    pub folder: TempDir,
    child: Child,
}

impl Playing {
    /// Starts it. Its exercise stands still until an instructor has it go on.
    pub fn start() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("reserve.toml"), SCENARIO).expect("the scenario is written");
        let child = play(folder.path());
        Self { folder, child }
    }

    /// Ends it as a power cut would.
    pub fn kill(&mut self) {
        self.child.kill().expect("it can be killed");
        self.child.wait().expect("it ends");
    }

    /// Starts it once more, with the same socket and journal.
    pub fn start_again(&mut self) {
        self.child = play(self.folder.path());
    }

    /// Its socket for the instructor's process.
    pub fn socket(&self) -> PathBuf {
        self.folder.path().join("s.sock")
    }

    /// Its journal.
    pub fn journal(&self) -> PathBuf {
        self.folder.path().join("out/hits.sqlite")
    }
}

impl Drop for Playing {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn play(folder: &Path) -> Child {
    Command::new(program())
        .env("BOWWAVE_CACHE", folder)
        .env_remove("DISPLAY")
        .arg("play")
        .arg(folder.join("reserve.toml"))
        .args(["--aim", "expert", "--headless", "--camera", "320x180", "--size", "640x360", "--instructor"])
        .arg(folder.join("s.sock"))
        .arg("--out")
        .arg(folder.join("out"))
        .stdout(Stdio::null())
        .spawn()
        .expect("the program starts")
}
