//! The committed SPIR-V is what the sources give, and is valid.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn installed(tool: &str) -> bool {
    Command::new(tool).arg("--version").output().is_ok()
}

fn sources() -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder().join("glsl"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.ends_with(".vert") || name.ends_with(".frag"))
        .collect();
    names.sort();
    names
}

#[test]
fn every_source_is_a_shader_of_the_crate_and_is_committed() {
    let mut named: Vec<&str> = shaders_spirv::ALL.iter().map(|s| s.name).collect();
    named.sort_unstable();
    assert_eq!(named, sources());
    for shader in shaders_spirv::ALL {
        assert_eq!(shader.words()[0], 0x0723_0203, "{} is no SPIR-V", shader.name);
        // Vulkan 1.3 takes SPIR-V up to 1.6.
        assert!(shader.words()[1] <= 0x0001_0600, "{}", shader.name);
    }
}

#[test]
fn committed_spirv_is_what_the_sources_give() {
    if !installed("glslangValidator") || !installed("spirv-val") {
        eprintln!("skipped: glslangValidator and spirv-val are not installed (glslang-tools, spirv-tools)");
        return;
    }
    let out = tempfile::tempdir().unwrap();
    let built = Command::new(folder().join("build")).arg(out.path()).output().unwrap();
    assert!(built.status.success(), "./build: {}", String::from_utf8_lossy(&built.stderr));
    let compiler = |folder: &Path| fs::read_to_string(folder.join("compiler")).unwrap();
    let (here, committed) = (compiler(out.path()), compiler(&folder().join("spv")));
    if here != committed {
        eprintln!("skipped: compiled with glslang {}, committed with {}", here.trim(), committed.trim());
        return;
    }
    for name in sources() {
        let file = format!("{name}.spv");
        let (made, kept) = (fs::read(out.path().join(&file)), fs::read(folder().join("spv").join(&file)));
        assert!(made.unwrap() == kept.unwrap(), "{name} has changed: run shaders-spirv/build");
    }
}
