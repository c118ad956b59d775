//! Quick form of the sea from video: four clips of different light, waves and eyes.

use precision::sea_video::{clips, score};

#[test]
fn height_period_and_direction_come_out_of_simulated_video() {
    // Clear, overcast, dusk, broken cloud; eyes at 10 to 14 m.
    let chosen: Vec<_> = [10, 3, 17, 15].into_iter().map(clips::main_clip).collect();
    let outcomes = score::run_all(chosen, 45.0, |_, outcome| println!("{}", score::line(outcome)));
    assert_eq!(outcomes.len(), 4);
    for o in &outcomes {
        let errors = (o.height_error(), o.period_error(), o.direction_error());
        let (Some(height), Some(period), Some(direction)) = errors else {
            panic!("no answer: {}", score::line(o))
        };
        assert!(height.abs() < 0.3 && period.abs() < 0.12, "{}", score::line(o));
        assert!(direction.abs() < 15f64.to_radians(), "{}", score::line(o));
    }
}

#[test]
fn the_sun_in_the_water_and_waves_above_the_eye_are_refused() {
    for clip in [clips::main_clip(34), clips::hard_clip(3)] {
        let outcome = score::run(clip, 45.0);
        assert!(outcome.answer.is_err(), "{}", score::line(&outcome));
    }
}
