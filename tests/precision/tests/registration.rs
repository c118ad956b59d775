//! Whole sessions on simulated recordings draw things far away where they belong; `precision registration` has the table.

#![allow(clippy::unwrap_used, reason = "a step that fails fails the test")]

use bowwave_core::estimate::attitude::Source;
use precision::registration::{
    GunMovement, RegistrationErrors, Replayed, SKY_STANDS, record, replay, summary,
};

const WIDTH: u32 = 480;

fn errors(moved: GunMovement, sources: &[(Source, bool)]) -> Vec<RegistrationErrors> {
    let recipe = moved.recipe(WIDTH);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("registration.mcap");
    record(&recipe, &path).unwrap();
    let how = |(source, shutter_unknown)| Replayed {
        source,
        exact: true,
        sky_drift: Some(SKY_STANDS),
        shutter_unknown,
        seconds: 45.0,
    };
    sources.iter().map(|source| replay(&recipe, &path, how(*source)).unwrap()).collect()
}

#[test]
fn a_gun_that_is_swung_at_40_deg_s_registers() {
    let found = errors(GunMovement::Swung, &[(Source::Auto, false), (Source::Fused, false)]);
    let ((rms, p99), (held, held_p99)) = (summary(&found[0].whole), summary(&found[1].aided));
    println!(
        "the unit's own: {rms:.2} px rms, p99 {p99:.2}; fused, from its start: {held:.2}, {held_p99:.2}"
    );
    assert!(found.iter().all(|e| e.whole.len() > 100), "too few frames");
    assert!(rms < 2.0 && p99 < 4.0, "the unit's own: {rms} px rms, p99 {p99}");
    // Its heading starts with the unit's own error, which nothing in the picture shows; the sky holds it there.
    assert!(held < 2.0 && held_p99 < 4.0, "fused, from its start: {held} px rms, p99 {held_p99}");
}

#[test]
fn a_rolling_shutter_registers_where_it_is_known() {
    let found = errors(GunMovement::Rolling, &[(Source::Auto, false), (Source::Auto, true)]);
    let [(known, p99), (unknown, _)] = [summary(&found[0].whole), summary(&found[1].whole)];
    println!("30 ms at 40 deg/s: {known:.2} px rms, p99 {p99:.2}; nothing known of it: {unknown:.2}");
    assert!(known < 2.0 && p99 < 4.0, "{known} px rms, p99 {p99}");
    assert!(unknown > 3.0 * known, "{unknown} px without, {known} px with the shutter");
}
