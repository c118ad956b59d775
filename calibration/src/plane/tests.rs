//! Planes whose place is known.

use bowwave_core::geometry::Distortion;
use glam::DQuat;
use proptest::prelude::*;

use super::*;
use crate::simulated::Random;

fn lens() -> Lens {
    let distortion = Distortion::radial_tangential(DVec2::new(-0.12, 0.03), DVec2::new(4e-4, -2e-4));
    Lens { distortion, ..Lens::pinhole(1280, 720, 1.0) }
}

/// A plane 1 m before the camera, turned about its first axis by `tilt` degrees.
fn tilted(tilt: f64) -> PlaneFrame {
    let (sin, cos) = tilt.to_radians().sin_cos();
    PlaneFrame { origin: DVec3::new(0.05, 0.1, 1.0), right: DVec3::X, up: DVec3::new(0.0, -cos, sin) }
}

const SQUARE: [[f64; 2]; 4] = [[-0.2, -0.15], [0.2, -0.15], [0.2, 0.15], [-0.2, 0.15]];

fn points(lens: &Lens, frame: &PlaneFrame, places: &[[f64; 2]]) -> Vec<SeenPoint> {
    let seen = |p: &[f64; 2]| {
        let plane = DVec2::from_array(*p);
        SeenPoint { pixel: lens.project(frame.at(plane)).unwrap(), plane }
    };
    places.iter().map(seen).collect()
}

#[test]
fn the_plane_and_what_is_traced_on_it_come_back() {
    let (lens, frame) = (lens(), tilted(50.0));
    let view = PlaneView::new(&lens, &points(&lens, &frame, &SQUARE)).unwrap();
    let traced = [[-0.1, -0.1], [0.3, 0.0], [0.0, 0.25]];
    let pixels: Vec<DVec2> = points(&lens, &frame, &traced).iter().map(|p| p.pixel).collect();
    for (found, truth) in view.places(&pixels).unwrap().iter().zip(traced) {
        assert!(found.distance(DVec2::from_array(truth)) < 1e-9, "{found} {truth:?}");
    }
    let found = view.in_camera().unwrap();
    assert!(found.origin.distance(frame.origin) < 1e-9, "{found:?}");
    assert!(found.right.distance(frame.right) < 1e-9 && found.up.distance(frame.up) < 1e-9, "{found:?}");
    assert!(view.rms_px() < 1e-6, "{}", view.rms_px());
}

/// Error of the points' own places for pixels that are off by [`MARKED_PX`], as a share of their extent.
fn error_share(lens: &Lens, frame: &PlaneFrame, places: &[[f64; 2]], random: &mut Random) -> f64 {
    let truth = points(lens, frame, places);
    let pixels: Vec<DVec2> = truth.iter().map(|p| p.pixel).collect();
    let (mut squares, mut count) = (0.0, 0.0);
    for _ in 0..100 {
        let off = |p: &SeenPoint| {
            let noise = DVec2::new(random.gauss(), random.gauss()) * MARKED_PX;
            SeenPoint { pixel: p.pixel + noise, ..*p }
        };
        let marked: Vec<SeenPoint> = truth.iter().map(off).collect();
        let Ok(view) = PlaneView::new(lens, &marked) else { continue };
        let Ok(found) = view.places(&pixels) else { return f64::INFINITY };
        squares += found.iter().zip(&truth).map(|(f, t)| f.distance_squared(t.plane)).sum::<f64>();
        count += truth.len() as f64;
    }
    (squares / count).sqrt() / spread(truth.iter().map(|p| p.plane))
}

#[test]
fn planes_that_are_taken_are_as_exact_as_the_bound_says() {
    let (lens, mut random) = (lens(), Random::new(5));
    let mut taken = 0;
    let five = [SQUARE[0], SQUARE[1], SQUARE[2], SQUARE[3], [0.03, 0.04]];
    let triangle = [[-0.2, -0.15], [0.2, -0.15], [0.0, 0.15], [0.0, 0.0]];
    let tall = [[-0.03, -0.2], [0.03, -0.2], [0.03, 0.2], [-0.03, 0.2]];
    for (places, above) in
        [(&SQUARE[..], 0.1), (&triangle, 0.1), (&tall, 0.1), (&SQUARE, 0.0), (&five, 0.0), (&tall, 0.0)]
    {
        for tilt in [0.0, 30.0, 60.0, 70.0, 75.0, 80.0, 84.0, 86.0, 88.0, 89.0, 89.9] {
            let frame = PlaneFrame { origin: DVec3::new(0.05, above, 1.0), ..tilted(tilt) };
            match PlaneView::new(&lens, &points(&lens, &frame, places)) {
                Ok(view) => {
                    taken += 1;
                    let share = error_share(&lens, &frame, places, &mut random);
                    assert!(
                        share < ERROR_MOST,
                        "{tilt} degrees: {share} of the extent, {:?}",
                        view.condition()
                    );
                }
                Err(error) => {
                    assert!(matches!(error, PlaneError::Condition { .. }), "{tilt} degrees: {error}");
                    assert!(tilt > 45.0, "{tilt} degrees: {error}");
                }
            }
        }
    }
    assert!(taken >= 9, "only {taken} are taken");
}

#[test]
fn points_that_do_not_tell_a_plane_are_refused_with_what_to_do() {
    let (lens, frame) = (lens(), tilted(20.0));
    let refused = |places: &[[f64; 2]]| PlaneView::new(&lens, &points(&lens, &frame, places)).unwrap_err();
    assert_eq!(refused(&SQUARE[..3]), PlaneError::Count(3));
    let line = [[-0.2, -0.1], [0.0, -0.1], [0.2, -0.1], [0.0, 0.2]];
    assert_eq!(refused(&line), PlaneError::Line([1, 2, 3]));
    assert!(refused(&line).to_string().contains("1, 2 and 3 lie on a line"));
    let repeated = [SQUARE[0], SQUARE[1], SQUARE[2], SQUARE[1]];
    assert_eq!(refused(&repeated), PlaneError::Same(2, 4));
    let mut swapped = points(&lens, &frame, &SQUARE);
    (swapped[0].pixel, swapped[1].pixel) = (swapped[1].pixel, swapped[0].pixel);
    let refused = PlaneView::new(&lens, &swapped).unwrap_err();
    assert!(matches!(refused, PlaneError::Order | PlaneError::Condition { .. }), "{refused}");
    let edge_on = PlaneView::new(
        &lens,
        &points(&lens, &PlaneFrame { origin: DVec3::new(0.0, 0.02, 1.0), ..tilted(89.9) }, &SQUARE),
    );
    let said = edge_on.unwrap_err().to_string();
    assert!(said.contains("condition number") && said.contains("--model"), "{said}");
}

#[test]
fn what_lies_beyond_the_planes_horizon_is_refused() {
    let (lens, frame) = (lens(), tilted(84.0));
    let view = PlaneView::new(&lens, &points(&lens, &frame, &SQUARE)).unwrap();
    let sky = DVec2::new(640.0, 2.0);
    assert_eq!(view.places(&[DVec2::new(640.0, 420.0), sky]), Err(PlaneError::Horizon(2)));
}

#[test]
fn axes_must_be_directions_at_right_angles() {
    let new = |right, up| PlaneFrame::new(DVec3::ZERO, right, up);
    assert!(new(DVec3::ZERO, DVec3::Y).unwrap_err().contains("no length"));
    assert!(new(DVec3::X, DVec3::new(1.0, 1.0, 0.0)).unwrap_err().contains("45 degrees"));
    assert_eq!(new(DVec3::X * 2.0, DVec3::Y * 3.0).unwrap().up, DVec3::Y);
}

proptest! {
    #[test]
    fn any_plane_that_is_taken_comes_back(
        turn in [-1.0..1.0f64, -1.0..1.0, -3.0..3.0], at in [-0.2..0.2f64, -0.1..0.1, 0.7..2.0], place in [-0.15..0.15f64, -0.15..0.15],
    ) {
        let (lens, turn) = (lens(), DQuat::from_scaled_axis(DVec3::from(turn)));
        let frame = PlaneFrame { origin: DVec3::from(at), right: turn * DVec3::X, up: turn * DVec3::Y };
        if let Ok(view) = PlaneView::new(&lens, &points(&lens, &frame, &SQUARE)) {
            let seen = points(&lens, &frame, &[place])[0];
            let found = view.places(&[seen.pixel]).unwrap()[0];
            prop_assert!(found.distance(seen.plane) < 1e-7, "{found} {place:?}");
            prop_assert!(view.pixel(seen.plane).unwrap().distance(seen.pixel) < 1e-6);
        }
    }
}
