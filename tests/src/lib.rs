//! Tests of the whole: what no single crate can check. They live in `tests/`; here is what they share.

#![forbid(unsafe_code)]
#![allow(clippy::expect_used, clippy::panic, reason = "a test that cannot go on has failed")]

pub mod desktop;

use std::{
    path::{Path, PathBuf},
    process::{Command, Output},
    sync::OnceLock,
};

use hw_sim::make::{self, Burst, GunMotion, Periodic, Recipe, ShipMotion};
use serde_json::Value;

/// The workspace's folder.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the crate lies in the workspace").to_path_buf()
}

/// The program, built as it is shipped, with the laboratory's program beside it.
pub fn program() -> &'static Path {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    PROGRAM.get_or_init(|| {
        let built = Command::new(env!("CARGO"))
            .args(["build", "--release", "--quiet", "-p", "bowwave", "-p", "bowwave-lab"])
            .current_dir(root())
            .status()
            .expect("cargo runs");
        assert!(built.success(), "the program does not build");
        let target =
            std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from);
        target.join("release/bowwave")
    })
}

/// The recipe of a small recording: 3 s of 160x96, the trigger held for most of it.
pub fn small_recipe() -> Recipe {
    let mut recipe = Recipe { width: 160, height: 96, duration_s: 3.0, ..Recipe::default() };
    recipe.gun.traverse.harmonics.clear();
    recipe.trigger = vec![Burst { start_s: 0.4, length_s: 2.2 }];
    recipe
}

/// A small recording, made once a test program.
pub fn small_recording() -> &'static Path {
    static RECORDING: OnceLock<(tempfile::TempDir, PathBuf)> = OnceLock::new();
    let (_, path) = RECORDING.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("small.mcap");
        make::make(&small_recipe(), &path, &mut |_, _| {}).expect("the recording is made");
        (folder, path)
    });
    path
}

/// Twenty seconds of a small picture of the sea.
fn sea(ship: ShipMotion, gun: GunMotion) -> Recipe {
    Recipe {
        width: 256,
        height: 144,
        frame_rate_hz: 10.0,
        ship,
        gun,
        trigger: Vec::new(),
        ..Recipe::default()
    }
}

/// A recording of the sea with camera and unit in the hand.
pub fn by_hand() -> Recipe {
    sea(
        ShipMotion { roll: Periodic::new(0.0, &[(4, 0.10, 0.0), (11, 0.06, 1.0)]), ..ShipMotion::default() },
        GunMotion {
            traverse: Periodic::new(0.0, &[(3, 0.12, 0.5), (9, 0.08, 2.0)]),
            elevation: Periodic::new(0.0, &[(5, 0.05, 1.5), (13, 0.03, 0.2)]),
        },
    )
}

/// The same with the gun swung left and right on a ship at rest.
pub fn traverse_only() -> Recipe {
    let traverse = Periodic::new(0.0, &[(3, 0.2, 0.5), (7, 0.1, 2.0)]);
    let elevation = Periodic::new(-0.03, &[]);
    sea(ShipMotion::default(), GunMotion { traverse, elevation })
}

/// Runs the program and waits for it.
pub fn bowwave<I: AsRef<std::ffi::OsStr>>(arguments: impl IntoIterator<Item = I>) -> Output {
    Command::new(program()).args(arguments).env_remove("RUST_LOG").output().expect("the program runs")
}

/// Writes a file of text into a folder; its path.
pub fn write(folder: &Path, name: &str, text: &str) -> String {
    let path = folder.join(name);
    std::fs::write(&path, text).expect("a file");
    path.to_str().expect("a plain path").to_owned()
}

/// Standard error of a run.
pub fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Requires that exit code and no panic.
pub fn expect_code(output: &Output, code: i32) {
    let said = said(output);
    assert!(!said.contains("panicked"), "it panicked: {said}");
    assert_eq!(output.status.code(), Some(code), "{said}");
}

/// Plays `recording` fast and small into `out`, with further arguments, and gives the summary.
pub fn play(recording: &Path, out: &Path, code: i32, further: &[&str]) -> Value {
    let mut arguments: Vec<&std::ffi::OsStr> = vec!["simulate".as_ref(), recording.as_os_str()];
    arguments.extend(["--fast", "--size", "160x96", "--out"].map(std::ffi::OsStr::new));
    arguments.push(out.as_os_str());
    arguments.extend(further.iter().map(std::ffi::OsStr::new));
    let output = bowwave(arguments);
    expect_code(&output, code);
    let text = std::fs::read_to_string(out.join("summary.json")).expect("a summary");
    serde_json::from_str(&text).expect("the summary is JSON")
}
