//! Each built-in scenario plays.

use bowwave_tests::{play, small_recording};

#[test]
fn each_built_in_scenario_is_drawn() {
    for name in bowwave_core::world::scenario::BUILT_IN.iter().map(|(name, _)| *name) {
        let out = tempfile::tempdir().expect("a folder");
        let summary = play(small_recording(), out.path(), 0, &["--scenario", name, "--frames", "4"]);
        assert_eq!(summary["frames"].as_u64(), Some(4), "{name}");
    }
}
