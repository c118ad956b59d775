//! A GPU that is lost or hangs, by the layer of `tests/hil/gpu-fault-layer`. The Vulkan loader reads its environment when it
//! starts, so each case runs in a process of its own: this same test program, started with the layer on.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

mod common;

use std::{
    env, fs,
    os::unix::fs::symlink,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    sync::Mutex,
    thread,
    time::{Duration, Instant},
};

use bowwave_core::model::Model;
use bowwave_render::{DrawRequest, RenderConfig, RenderError, TimeOuts};
use common::{
    config, open, sea, submit,
    testing::{add_boat, empty_scene},
};

/// Names the file that commands the layer.
const COMMAND: &str = "BOWWAVE_GPU_FAULT";
/// A case that takes longer than this has stopped.
const CASE_S: u64 = 120;

/// The layer's library, which cargo builds beside this program because it is a dependency.
fn library() -> PathBuf {
    let program = env::current_exe().unwrap();
    let folder = program.parent().unwrap();
    [folder, folder.parent().unwrap()]
        .map(|f| f.join("libgpu_fault_layer.so"))
        .into_iter()
        .find(|path| path.exists())
        .expect("libgpu_fault_layer.so beside the test program")
}

/// Runs the ignored test `case` in a process with the layer.
fn run(case: &str) {
    let folder = tempfile::tempdir().unwrap();
    let layer = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/hil/gpu-fault-layer");
    let manifest = "VkLayer_bowwave_gpu_fault.json";
    fs::copy(layer.join(manifest), folder.path().join(manifest)).unwrap();
    symlink(library(), folder.path().join("libgpu_fault_layer.so")).unwrap();
    let mut child = Command::new(env::current_exe().unwrap())
        .args(["--exact", case, "--ignored", "--nocapture", "--test-threads=1"])
        .env("VK_ADD_LAYER_PATH", folder.path())
        .env("VK_INSTANCE_LAYERS", "VK_LAYER_BOWWAVE_gpu_fault")
        .env(COMMAND, folder.path().join("command"))
        .stdin(Stdio::null())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            assert!(status.success(), "{case}: {status}, see above");
            return;
        }
        if begun.elapsed() > Duration::from_secs(CASE_S) {
            child.kill().unwrap();
            child.wait().unwrap();
            panic!("{case} did not end within {CASE_S} s");
        }
        thread::sleep(Duration::from_millis(20));
    }
}

/// Commands the layer.
fn command(what: &str) {
    let path = PathBuf::from(env::var_os(COMMAND).expect("started by `run`"));
    let new = path.with_extension("new");
    fs::write(&new, what).unwrap();
    fs::rename(&new, &path).unwrap();
}

/// Everything that was logged, so that what the validation layer says while things are destroyed is not lost with them.
struct Logged(Mutex<Vec<String>>);

static LOGGED: Logged = Logged(Mutex::new(Vec::new()));

impl log::Log for Logged {
    fn enabled(&self, _: &log::Metadata<'_>) -> bool {
        true
    }
    fn log(&self, record: &log::Record<'_>) {
        self.0.lock().unwrap().push(format!("{}: {}", record.level(), record.args()));
    }
    fn flush(&self) {}
}

fn logged_by_vulkan() -> Vec<String> {
    LOGGED.0.lock().unwrap().iter().filter(|line| line.contains("Vulkan:")).cloned().collect()
}

fn listen() {
    log::set_logger(&LOGGED).unwrap();
    log::set_max_level(log::LevelFilter::Warn);
}

#[test]
fn a_lost_device_is_told_dropped_without_waiting_and_made_anew() {
    run("case_lost");
}

#[test]
fn a_hang_is_told_in_time_and_dropping_does_not_wait_for_it() {
    run("case_hang");
}

#[test]
fn a_renderer_whose_hang_nobody_noticed_is_dropped_in_time() {
    run("case_hang_at_drop");
}

fn boats() -> Vec<Model> {
    ["dhow", "skiff", "rhib"].map(|name| bowwave_models::resolve(name, Path::new(".")).unwrap()).to_vec()
}

#[test]
#[ignore = "a case of this file, run by it in a process with the layer"]
fn case_lost() {
    listen();
    let models = boats();
    let mut scene = empty_scene(640, 360);
    add_boat(&mut scene, &models, 0, 60.0, -0.14, 3.0);
    add_boat(&mut scene, &models, 1, 30.0, 0.1, 2.6);
    add_boat(&mut scene, &models, 2, 110.0, 0.15, 0.3);
    let picture = sea(640, 360);
    let config = RenderConfig { frames_in_flight: 3, ..config(&scene) };
    let (mut renderer, mut completions) = open(&config, &models);
    let reference = submit(&mut renderer, &mut completions, &scene, &picture);
    for n in 1..4 {
        // Two frames on their way and one with the reader when it happens.
        for frame in [1, 2] {
            scene.frame = frame;
            renderer.submit(DrawRequest::new(&scene, &picture, true)).unwrap();
        }
        let held = completions.wait_next(Duration::from_secs(20)).unwrap().unwrap();
        command("lost");
        let lost = renderer.submit(DrawRequest::new(&scene, &picture, true)).unwrap_err();
        assert_eq!(lost, RenderError::DeviceLost { call: "vkQueueSubmit2" });
        assert_eq!(completions.wait_next(Duration::from_secs(20)).err(), Some(lost.clone()));
        assert_eq!(renderer.submit(DrawRequest::new(&scene, &picture, true)).unwrap_err(), lost);
        assert!(lost.to_string().contains("made anew"));
        let begun = Instant::now();
        drop(renderer);
        drop(completions);
        assert_eq!(held.rgba(), reference, "a finished frame stays readable");
        drop(held);
        let dropped = begun.elapsed();
        (renderer, completions) = open(&config, &models);
        let made = begun.elapsed();
        scene.frame = 0;
        let again = submit(&mut renderer, &mut completions, &scene, &picture);
        eprintln!(
            "loss {n}: dropped after {dropped:?}, made after {made:?}, first frame after {:?}",
            begun.elapsed()
        );
        assert!(again == reference, "the picture after loss {n} differs");
    }
    drop((renderer, completions));
    assert_eq!(logged_by_vulkan(), Vec::<String>::new());
}

#[test]
#[ignore = "a case of this file, run by it in a process with the layer"]
fn case_hang() {
    let scene = empty_scene(320, 180);
    let picture = sea(320, 180);
    let (mut renderer, mut completions) = open(&config(&scene), &[]);
    submit(&mut renderer, &mut completions, &scene, &picture);
    command("hang");
    renderer.submit(DrawRequest::new(&scene, &picture, true)).unwrap();
    let begun = Instant::now();
    // In steps, as the output thread waits.
    let error = loop {
        match completions.wait_next(Duration::from_millis(120)) {
            Ok(frame) => assert!(frame.is_none(), "a hung GPU finished a frame"),
            Err(error) => break error,
        }
    };
    let told = begun.elapsed();
    assert_eq!(error, RenderError::Hung { what: "a frame", after_ms: 500 });
    assert!(told >= Duration::from_millis(490) && told < Duration::from_secs(5), "told after {told:?}");
    assert_eq!(renderer.submit(DrawRequest::new(&scene, &picture, true)).unwrap_err(), error);
    drop(renderer);
    drop(completions);
    let gone = begun.elapsed() - told;
    assert!(gone < Duration::from_millis(300), "dropping took {gone:?}");
}

#[test]
#[ignore = "a case of this file, run by it in a process with the layer"]
fn case_hang_at_drop() {
    let scene = empty_scene(320, 180);
    let picture = sea(320, 180);
    let time_outs = TimeOuts { frame: Duration::from_millis(200), ..TimeOuts::default() };
    let (mut renderer, mut completions) = open(&RenderConfig { time_outs, ..config(&scene) }, &[]);
    submit(&mut renderer, &mut completions, &scene, &picture);
    command("hang");
    renderer.submit(DrawRequest::new(&scene, &picture, true)).unwrap();
    let begun = Instant::now();
    drop(renderer);
    let gone = begun.elapsed();
    assert!(gone >= Duration::from_millis(190) && gone < Duration::from_secs(5), "dropping took {gone:?}");
    let hung = RenderError::Hung { what: "a frame", after_ms: 200 };
    assert_eq!(completions.wait_next(Duration::from_secs(5)).err(), Some(hung));
}
