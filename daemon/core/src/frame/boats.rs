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

/// The wake of a boat at `time`.
fn wake_of(fleet: &Fleet, afloat: &Afloat<'_>, time: Time, start: Time) -> Option<Wake> {
    let history = fleet.history(afloat.boat)?;
    let hull = history.hull();
    Wake::of(
        hull,
        f64::from(-afloat.model.min.z),
        time.secs_since(start),
        |time_s| history.state(time_s),
        |place| fleet.water_over(place, hull, time),
    )
}
