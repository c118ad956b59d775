//! Tracks of boats, gun and rounds.

use super::*;

#[test]
fn tracks_tell_where_boat_gun_and_rounds_were() {
    let mut s = session(SCENARIO);
    let (mut tracks, mut records) = (TrackBlock::default(), Vec::new());
    play(&mut s, 3.0, &ALL, &burst(300, 900), |session, _, _, new| {
        tracks.append(session.tracks());
        records.extend_from_slice(new);
    });
    let left = s.finish().0.to_vec();
    tracks.append(s.tracks());
    records.extend(left);
    let times: Vec<i64> = tracks.samples.iter().map(|sample| sample.time_ns).collect();
    assert!(times.len() > 50 && times.windows(2).all(|t| t[1] - t[0] == TRACK_STEP_NS), "{times:?}");
    for sample in &tracks.samples {
        let boat = sample.boats[0].expect("it swims").position;
        assert!(Vec3::from(boat).distance(Vec3::new(0.0, 200.0, 0.0)) < 0.5, "{boat:?}");
        let camera = sample.camera.expect("its pose is known");
        assert_eq!(camera.position, [0.0, 0.0, 6.0]);
    }
    // Each round has a path from its muzzle to where its record says that it ended.
    assert_eq!(tracks.rounds.len(), records.len());
    assert!(!records.is_empty());
    for record in &records {
        let path = tracks.rounds.iter().find(|path| path.shot == record.shot).expect("it has a path");
        let [first, last] = [path.points.first(), path.points.last()].map(|p| p.expect("it has points"));
        assert_eq!(path.fired_ns, record.fired.ns());
        assert!(Vec3::from(first.position).as_dvec3().distance(record.muzzle) < 1e-3);
        assert!(path.points.windows(2).all(|p| p[0].after_s <= p[1].after_s));
        if let Outcome::Hit { time, range_m, .. } = &record.outcome {
            assert!((f64::from(last.after_s) - time.secs_since(record.fired)).abs() < 1e-5);
            let flown = Vec3::from(last.position).as_dvec3().distance(record.muzzle);
            assert!((flown - range_m).abs() < 1e-2, "{flown} {range_m}");
        }
    }
    assert!(records.iter().any(|record| matches!(record.outcome, Outcome::Hit { .. })));
}
