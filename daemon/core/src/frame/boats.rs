//! Boats and wakes in view.

use crate::{
    frame::{scene::BoatView, view::ViewFrustum, wake::Wake},
    time::Time,
    world::fleet::{Afloat, Fleet},
};

/// The boats that `view` sees at `time`, farthest first.
pub(super) fn boats_in_view(
    fleet: &Fleet,
    view: &ViewFrustum<'_>,
    time: Time,
    start: Time,
    into: &mut Vec<BoatView>,
) {
    into.clear();
    for afloat in fleet.afloat(time) {
        into.extend(view.see_with_wake(&afloat, || wake_of(fleet, &afloat, time, start)));
    }
    into.sort_by(|a, b| b.range_m.total_cmp(&a.range_m));
}

/// How far the nearest boat is that may be in view at `time`, metres; nothing where there is none.
pub(super) fn nearest_m(fleet: &Fleet, view: &ViewFrustum<'_>, time: Time) -> f64 {
    let ranges = fleet.afloat(time).filter_map(|afloat| {
        let offset = afloat.pose.position - view.camera.position;
        let range_m = offset.length();
        view.may_see(offset, range_m, afloat.model.radius_m()).then_some(range_m)
    });
    ranges.reduce(f64::min).unwrap_or(0.0)
}

/// The wake of a boat at `time`.
fn wake_of(fleet: &Fleet, afloat: &Afloat<'_>, time: Time, start: Time) -> Option<Wake> {
    let history = fleet.history(afloat.boat)?;
    let hull = history.hull();
    let water = fleet.water_over(hull, time);
    Wake::of(
        hull,
        f64::from(-afloat.model.min.z),
        time.secs_since(start),
        |time_s| history.state(time_s),
        |place| water.at(place),
    )
}
