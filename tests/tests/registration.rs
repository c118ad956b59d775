//! Trainers that are set up wrongly, on a whole session with real pictures: named with a cause, and never READY.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use bowwave_core::estimate::attitude::Source;
use hw_sim::{
    make::{Recipe, make},
    set_up::SetUp,
};
use precision::setups::told;

/// Long enough that a gun that is swung has shown each way to be wrong.
const SECONDS: f64 = 12.0;

#[test]
fn a_wrong_set_up_is_named_and_never_ready_and_the_right_one_is() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("swung.mcap");
    let recipe = Recipe { width: 384, height: 216, trigger: Vec::new(), ..Recipe::default() };
    make(&recipe, &path, &mut |_, _| {}).unwrap();
    let kinds = [
        ("nothing", Source::Auto),
        ("unit turned by 180 deg about x", Source::Fused),
        ("rates in deg/s", Source::Fused),
        ("force in g", Source::Auto),
        ("picture mirrored", Source::Auto),
        ("pictures late by 300 ms", Source::Auto),
        ("another mount, 5 deg rolled", Source::Auto),
    ];
    for (name, source) in kinds {
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
