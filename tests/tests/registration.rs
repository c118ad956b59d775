//! Trainers that are set up wrongly, on a whole session with real pictures: named with a cause, and never READY.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use bowwave_core::estimate::attitude::Source;
use hw_sim::{
    make::{Recipe, make},
    set_up::SetUp,
};
use precision::setups::told;

/// Long enough that a gun that is swung has shown each way to be wrong.
const SECONDS: f64 = 20.0;

#[test]
fn a_wrong_set_up_is_named_and_never_ready_and_the_right_one_is() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("swung.mcap");
    let recipe = Recipe { width: 384, height: 216, trigger: Vec::new(), ..Recipe::default() };
    make(&recipe, &path, &mut |_, _| {}).unwrap();
    let by_unit = [
        "nothing",
        "force in g",
        "picture mirrored",
        "pictures late by 300 ms",
        "another mount, 5 deg rolled",
    ];
    let fused = ["unit turned by 180 deg about x", "rates in deg/s"];
    let kinds = [(&by_unit[..], Source::Auto), (&fused[..], Source::Fused)];
    for (name, source) in kinds.iter().flat_map(|(names, source)| names.iter().map(|name| (*name, *source))) {
        let set_up = SetUp::named(name).unwrap();
        let (last, ready) = told(&path, set_up, source, SECONDS).unwrap();
        assert!(set_up.is_named(last), "{name}: told {last:?}");
        let is_right = set_up.faults.is_empty();
        assert!(
            if is_right { ready > 0.2 } else { ready == 0.0 },
            "{name}: READY in {ready:.2} of the frames"
        );
    }
}
