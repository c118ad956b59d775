use bowwave_core::{event::CameraFrame, fault::Fault, geometry::Lens, guide::Rating};
use glam::{DQuat, DVec2, DVec3};
use proptest::prelude::*;

use super::*;
use crate::{
    alignment::Observation,
    capture::{BoardSeen, HorizonSeen, PictureSeen},
    lens::{BoardView, Corner},
    parse,
    simulated::{Motion, Random, Recipe, Recording},
    solve::so3::exp,
};

fn setup() -> WizardSetup {
    let calibration = parse(include_str!("../../examples/mount.toml"), "mount.toml").unwrap().calibration;
    WizardSetup {
        calibration,
        eye_height_m: 10.0,
        target: Some(Target::A4),
        range_m: Some(40.0),
        replaces: false,
    }
}

/// Events of a simulated recording in the order of arrival: with the board or with the horizon.
fn inputs(recording: &Recording, by_board: bool) -> Vec<Input> {
    let samples = recording.readings.iter().map(|r| {
        let sample = ImuSample {
            arrival: r.time,
            device_time_ns: r.time.ns(),
            rate: r.rate,
            accel: r.specific_force.unwrap_or(DVec3::Z * 9.81),
            world_from_imu: None,
        };
        (sample.arrival, Input::Sample(sample))
    });
    let told = if by_board { &recording.orientations } else { &recording.ups };
    let pixel = DVec2::new(640.0, 360.0);
    let pictures = told.iter().map(|o| {
        let mut seen =
            PictureSeen { stamp: o.stamp(), fits: true, horizon: None, is_blurred: false, board: None };
        match *o {
            Observation::Up { up_in_camera, sigma, .. } => {
                seen.horizon = Some(HorizonSeen { up_in_camera, sigma, pixel });
            }
            Observation::Orientation { reference_from_camera, sigma, .. } => {
                seen.board = Some(BoardSeen {
                    board_from_camera: reference_from_camera,
                    sigma,
                    pixel,
                    corners: Vec::new(),
                });
            }
        }
        let arrival = seen.stamp.plus_ns(15_000_000);
        (arrival, Input::Seen(arrival, Detection::Orientation(seen)))
    });
    let mut all: Vec<(Time, Input)> = samples.chain(pictures).collect();
    all.sort_by_key(|i| i.0);
    all.into_iter().map(|i| i.1).collect()
}

/// Does what is asked for at once; what was saved last comes back.
fn serve(wizard: &mut Wizard) -> Option<WizardSolution> {
    let mut saved = None;
    while let Some(ask) = wizard.ask() {
        match ask {
            Ask::Solve(work) => wizard.take(Input::Solved(Box::new(work.run()))),
            Ask::Save(found) => {
                let calibration = Box::new(wizard.calibration().clone());
                wizard.take(Input::Saved(Ok(calibration)));
                saved = Some(*found);
            }
            Ask::End => {}
        }
    }
    saved
}

fn play(wizard: &mut Wizard, inputs: impl IntoIterator<Item = Input>) {
    for input in inputs {
        wizard.take(input);
        serve(wizard);
    }
}

fn minute(motion: Motion) -> Recording {
    Recipe::minute(motion, 2e-3, 1e-3, 11).record()
}

fn press(wizard: &mut Wizard, key: Key) -> Option<WizardSolution> {
    wizard.take(Input::Key(key));
    serve(wizard)
}

#[test]
fn a_good_movement_ends_in_a_pass_that_is_saved() {
    let recording = minute(Motion::ByHand);
    let mut wizard = Wizard::new(setup(), None);
    assert_eq!(wizard.step(), WizardStep::Choose);
    assert!(wizard.guide().lines[0].starts_with("> 1 camera lens"), "{:?}", wizard.guide());
    press(&mut wizard, Key::Pick(Task::Alignment));
    press(&mut wizard, Key::Next);
    assert_eq!((wizard.step(), wizard.look()), (WizardStep::Gather, DetectorMode::Orientation));
    assert!(wizard.guide().gauges.iter().all(|g| g.rating.is_none() && g.share == 0.0));
    play(&mut wizard, inputs(&recording, true));
    let guide = wizard.guide();
    assert!(guide.says.starts_with("Press Enter") && guide.problem.is_none(), "{guide:?}");
    assert!(guide.gauges.iter().all(|g| g.rating == Some(Rating::Good) && g.share > 0.99), "{guide:?}");
    assert!(guide.gauges[0].value.contains("mrad") && guide.gauges[0].value.contains("m at 500 m"));
    assert_eq!(press(&mut wizard, Key::Next), None);
    let guide = wizard.guide();
    assert_eq!((wizard.step(), guide.passed), (WizardStep::Result, Some(true)));
    assert!(guide.lines[0].starts_with("good"), "{guide:?}");
    // Nothing stood there before.
    assert_eq!(guide.says, "Press Enter to save");
    let Some(WizardSolution::Alignment(found, how)) = press(&mut wizard, Key::Next) else {
        panic!("{guide:?}")
    };
    let off = recording.recipe.camera_from_imu.angle_between(found.camera_from_imu);
    assert!(off < 1e-3 && how.contains("board, good"), "{off} {how}");
    assert_eq!(wizard.step(), WizardStep::Saved);
    press(&mut wizard, Key::Next);
    assert!(wizard.guide().lines[1].ends_with("(done)"), "{:?}", wizard.guide());
    press(&mut wizard, Key::Quit);
    assert_eq!(wizard.step(), WizardStep::Over);
}

#[test]
fn traverse_only_is_never_good_and_names_what_is_missing() {
    let mut wizard = Wizard::new(setup(), Some(Task::Alignment));
    for input in inputs(&minute(Motion::TraverseOnly), true) {
        wizard.take(input);
        serve(&mut wizard);
        let good = wizard.guide().gauges.iter().any(|g| g.rating == Some(Rating::Good));
        assert!(!good || wizard.guide().gauges.iter().any(|g| g.rating < Some(Rating::Good)));
    }
    let guide = wizard.guide();
    assert_eq!(guide.says, "Elevate the gun up and down");
    assert_eq!(guide.problem.as_deref(), Some("ONLY TRAVERSE SO FAR"));
    press(&mut wizard, Key::Next);
    let guide = wizard.guide();
    assert_eq!(guide.passed, Some(false));
    assert!(guide.lines.iter().any(|l| l.contains("missing: elevation")), "{guide:?}");
    // Nothing is saved; more is gathered, and then it passes.
    assert_eq!(press(&mut wizard, Key::Next), None);
    assert_eq!(wizard.step(), WizardStep::Gather);
    let mut recipe = minute(Motion::ByHand).recipe;
    recipe.seconds = 30.0;
    let later = inputs(&recipe.record(), true).into_iter().map(|input| later(input, 60.0));
    play(&mut wizard, later);
    press(&mut wizard, Key::Next);
    assert_eq!(wizard.guide().passed, Some(true), "{:?}", wizard.guide());
}

/// The same so much later.
fn later(input: Input, seconds: f64) -> Input {
    match input {
        Input::Sample(s) => Input::Sample(ImuSample {
            arrival: s.arrival.plus_secs(seconds),
            device_time_ns: s.device_time_ns + (seconds * 1e9) as i64,
            ..s
        }),
        Input::Seen(arrival, Detection::Orientation(seen)) => Input::Seen(
            arrival.plus_secs(seconds),
            Detection::Orientation(PictureSeen { stamp: seen.stamp.plus_secs(seconds), ..seen }),
        ),
        other => other,
    }
}

#[test]
fn a_picture_that_tells_nothing_or_is_smeared_is_said() {
    for (blurred, fits, word) in [
        (false, true, "NEITHER BOARD NOR HORIZON"),
        (true, true, "TOO FAST"),
        (false, false, "CAL LOST: PICTURE SIZE"),
    ] {
        let mut wizard = Wizard::new(setup(), Some(Task::Alignment));
        let blind = inputs(&minute(Motion::ByHand), true).into_iter().take(1500).map(|input| match input {
            Input::Seen(arrival, Detection::Orientation(seen)) => {
                let seen = PictureSeen { board: None, is_blurred: blurred, fits, ..seen };
                Input::Seen(arrival, Detection::Orientation(seen))
            }
            other => other,
        });
        play(&mut wizard, blind);
        let problem = wizard.guide().problem.unwrap_or_default();
        assert!(problem.contains(word), "{problem} is not {word}");
    }
}

#[test]
fn devices_that_go_and_come_back_are_said_and_do_no_harm() {
    let recording = minute(Motion::ByHand);
    let all = inputs(&recording, true);
    let begin = recording.readings[0].time;
    let gone = |from: f64, to: f64, t: Time| (from..to).contains(&t.secs_since(begin));
    let mut wizard = Wizard::new(setup(), Some(Task::Alignment));
    let (mut said, mut cleared) = (Vec::new(), false);
    for input in all {
        let lost = match &input {
            Input::Sample(s) => gone(20.0, 23.0, s.arrival),
            Input::Seen(arrival, _) => gone(30.0, 34.0, *arrival),
            _ => false,
        };
        if lost {
            continue;
        }
        wizard.take(input);
        serve(&mut wizard);
        if let Some(problem) = wizard.guide().problem.filter(|p| said.last() != Some(p)) {
            said.push(problem);
        }
        cleared = wizard.guide().problem.is_none();
    }
    assert_eq!(said, ["IMU LOST: CHECK THE IMU CABLE", "CAMERA STALLED: WAIT, THEN CHECK ITS CABLE"]);
    assert!(cleared);
    // What the devices themselves report goes before.
    wizard.take(Input::Fault(FaultChange::raised(wizard.now, Fault::CamBusy, "test")));
    assert_eq!(wizard.guide().problem.as_deref(), Some("CAMERA IN USE: STOP THE OTHER PROGRAM"));
    wizard.take(Input::Fault(FaultChange::cleared(wizard.now, Fault::CamBusy)));
    press(&mut wizard, Key::Next);
    assert_eq!(wizard.guide().passed, Some(true), "{:?}", wizard.guide());
}

#[test]
fn the_trigger_is_a_key_but_not_where_pulls_are_measured() {
    let edge = |s: f64| Input::Edge(TriggerEdge { time: Time::from_ns(0).plus_secs(s), pressed: true });
    let mut wizard = Wizard::new(setup(), None);
    wizard.take(Input::Time(Time::from_ns(0)));
    wizard.take(edge(0.3));
    assert_eq!(wizard.step(), WizardStep::Choose, "a pull at once belonged to what was before");
    wizard.take(Input::Key(Key::Pick(Task::Boresight)));
    wizard.take(edge(4.0));
    assert_eq!(wizard.step(), WizardStep::Gather);
    (0..9).for_each(|i| wizard.take(edge(5.0 + f64::from(i))));
    assert_eq!(wizard.step(), WizardStep::Gather);
    wizard.take(Input::Fault(FaultChange::raised(wizard.now, Fault::NotInert, "test")));
    let inert = "NOT ARMED: GUN NOT INERT: FIT THE INERT PLUG";
    assert_eq!(wizard.guide().problem.as_deref(), Some(inert));
}

#[test]
fn pulls_at_the_marked_tag_become_a_boresight_by_themselves() {
    let mut wizard = Wizard::new(setup(), Some(Task::Boresight));
    let mut random = Random::new(4);
    let at = |s: f64| Time::from_ns(7_000_000_000).plus_secs(s);
    let mut picture = 0;
    for pull in 0..6 {
        let from = 2.0 * f64::from(pull);
        let aimed = DVec2::new(700.0, 380.0) + DVec2::new(random.gauss(), random.gauss()) * 0.5;
        while f64::from(picture) / 30.0 < from + 1.9 {
            let stamp = at(f64::from(picture) / 30.0);
            let finding = Detection::Mark { stamp, pixel: (pull != 2).then_some(aimed) };
            wizard.take(Input::Seen(stamp.plus_ns(9_000_000), finding));
            picture += 1;
            if picture % 60 == 30 {
                wizard.take(Input::Edge(TriggerEdge { time: stamp, pressed: true }));
            }
            serve(&mut wizard);
        }
        if pull == 2 {
            assert!(wizard.guide().problem.unwrap().contains("THE MARK WAS NOT SEEN"));
        }
    }
    let guide = wizard.guide();
    assert_eq!((wizard.step(), guide.passed), (WizardStep::Result, Some(true)), "{guide:?}");
    let Some(WizardSolution::Boresight(found, range_m)) = press(&mut wizard, Key::Next) else {
        panic!("{guide:?}")
    };
    assert_eq!((found.residuals.len(), range_m), (5, 40.0));
}

#[test]
fn dry_shots_become_a_latency_by_themselves() {
    let mut wizard = Wizard::new(setup(), Some(Task::Trigger));
    let mut random = Random::new(8);
    let at = |i: i32| Time::from_ns(7_000_000_000).plus_ns(i64::from(i) * 5_000_000);
    for i in 0..2600 {
        let since = f64::from(i % 400 - 300) * 0.005 - 0.02;
        let jolt = if since > 0.0 { 30.0 * (-since / 0.03).exp() * (300.0 * since).cos() } else { 0.0 };
        let sample = ImuSample {
            arrival: at(i),
            device_time_ns: at(i).ns(),
            rate: random.vector() * 1e-3,
            accel: DVec3::new(jolt, 0.0, -9.81) + random.vector() * 0.05,
            world_from_imu: None,
        };
        wizard.take(Input::Sample(sample));
        if i % 400 == 300 {
            wizard.take(Input::Edge(TriggerEdge { time: at(i), pressed: true }));
        }
        serve(&mut wizard);
    }
    let guide = wizard.guide();
    assert_eq!((wizard.step(), guide.passed), (WizardStep::Result, Some(true)), "{guide:?}");
    let Some(WizardSolution::Trigger(found)) = press(&mut wizard, Key::Next) else { panic!("{guide:?}") };
    assert!((found.latency_s - 0.02).abs() < 0.006, "{found:?}");
}

/// Corners of the board seen through a lens.
fn view(lens: &Lens, turn: DVec3, place: DVec3, random: &mut Random) -> BoardView {
    let camera_from_board = exp(turn) * DQuat::from_rotation_x(std::f64::consts::PI);
    let middle = camera_from_board * (Target::A4.size_m() / 2.0).extend(0.0);
    let corners = (0..Target::A4.tags()).flat_map(|id| Target::A4.corners(id)).filter_map(|board| {
        let pixel = lens.project(camera_from_board * board.extend(0.0) - middle + place)?;
        let inside = pixel.cmpge(DVec2::ZERO).all() && pixel.x < 1280.0 && pixel.y < 720.0;
        let noise = DVec2::new(random.gauss(), random.gauss()) * 0.1;
        inside.then_some(Corner { board, pixel: pixel + noise })
    });
    BoardView { corners: corners.collect() }
}

#[test]
fn the_lens_is_found_while_the_board_is_led_over_the_picture() {
    let lens = Lens::pinhole(1280, 720, 1.0);
    let mut random = Random::new(2);
    let mut wizard = Wizard::new(setup(), Some(Task::Lens));
    let mut now = Time::from_ns(1);
    let mut show = |wizard: &mut Wizard, view: &BoardView| {
        now = now.plus_ns(33_000_000);
        let finding = Detection::Corners { view: view.clone(), size: (1280, 720) };
        wizard.take(Input::Seen(now, finding));
        serve(wizard);
        wizard.guide()
    };
    let far = view(&lens, DVec3::ZERO, DVec3::new(0.0, 0.0, 3.0), &mut random);
    assert!(show(&mut wizard, &BoardView::default()).problem.unwrap().contains("NOT SEEN"));
    assert!(show(&mut wizard, &far).problem.unwrap().contains("TOO FAR"));
    let mut covered = Vec::new();
    for i in 0..30 {
        let spot = DVec2::new(f64::from(i % 5 - 2) * 0.075, f64::from(i / 5 % 3 - 1) * 0.05);
        let turn = DVec3::new(random.gauss(), random.gauss(), 0.3 * random.gauss()) * 0.3;
        let seen = view(&lens, turn, spot.extend(0.24 + 0.02 * f64::from(i % 4)), &mut random);
        assert_eq!(show(&mut wizard, &seen).problem.as_deref(), Some("HOLD THE BOARD STILL"));
        let guide = show(&mut wizard, &seen);
        assert_eq!(guide.problem, None);
        covered.push(
            guide.coverage.unwrap().cells.iter().filter(|c| **c != bowwave_core::guide::Cell::Empty).count(),
        );
    }
    assert!(covered.is_sorted() && covered[29] > 40 && covered[0] < 30, "{covered:?}");
    press(&mut wizard, Key::Next);
    let guide = wizard.guide();
    assert_eq!(guide.passed, Some(true), "{guide:?}");
    let Some(WizardSolution::Lens(found)) = press(&mut wizard, Key::Next) else { panic!("{guide:?}") };
    assert!((found.intrinsics[0] - lens.focal.x).abs() < 4.0 * found.sigma[0], "{found:?}");
}

#[test]
fn what_cannot_be_begun_says_why() {
    let bare = WizardSetup { target: None, range_m: None, ..setup() };
    let mut wizard = Wizard::new(bare.clone(), Some(Task::Lens));
    assert_eq!(wizard.step(), WizardStep::Choose);
    assert!(wizard.guide().problem.unwrap().contains("--target"));
    press(&mut wizard, Key::Pick(Task::Boresight));
    press(&mut wizard, Key::Next);
    assert_eq!(wizard.step(), WizardStep::Choose);
    let with_board = WizardSetup { target: Some(Target::A4), ..bare };
    let mut wizard = Wizard::new(with_board, Some(Task::Boresight));
    assert!(wizard.guide().problem.unwrap().contains("--range"));
    assert_eq!(press(&mut wizard, Key::Next), None);
}

#[test]
fn a_result_that_cannot_be_written_is_not_lost() {
    let mut wizard = Wizard::new(setup(), Some(Task::Alignment));
    play(&mut wizard, inputs(&minute(Motion::ByHand), true));
    press(&mut wizard, Key::Next);
    wizard.take(Input::Key(Key::Next));
    wizard.take(Input::Saved(Err("the disk is full".to_owned())));
    assert_eq!(
        (wizard.step(), wizard.guide().problem.as_deref()),
        (WizardStep::Result, Some("the disk is full"))
    );
    assert!(press(&mut wizard, Key::Next).is_some());
}

/// Anything, in any order, at any time.
fn anything() -> impl Strategy<Value = Input> {
    let time = || prop_oneof![any::<i64>(), 0..20_000_000_000i64].prop_map(Time::from_ns);
    let number = || prop_oneof![prop::num::f64::ANY, -10.0..10.0];
    let vector = move || (number(), number(), number()).prop_map(DVec3::from);
    let pixel = move || (number(), number()).prop_map(|(x, y)| DVec2::new(x, y) * 100.0);
    let sample =
        (time(), any::<i64>(), vector(), vector()).prop_map(|(arrival, device_time_ns, rate, accel)| {
            Input::Sample(ImuSample { arrival, device_time_ns, rate, accel, world_from_imu: None })
        });
    let edge = (time(), any::<bool>()).prop_map(|(time, pressed)| Input::Edge(TriggerEdge { time, pressed }));
    let seen = (time(), time(), any::<[bool; 4]>(), vector(), number(), pixel()).prop_map(
        |(arrival, stamp, [fits, is_blurred, horizon, board], v, sigma, pixel)| {
            let horizon = horizon.then_some(HorizonSeen { up_in_camera: v, sigma, pixel });
            let board_from_camera = DQuat::from_xyzw(v.x, v.y, v.z, sigma);
            let board = board.then_some(BoardSeen { board_from_camera, sigma, pixel, corners: Vec::new() });
            Input::Seen(
                arrival,
                Detection::Orientation(PictureSeen { stamp, fits, horizon, is_blurred, board }),
            )
        },
    );
    let corner = (pixel(), pixel()).prop_map(|(board, pixel)| Corner { board, pixel });
    let corners =
        (time(), prop::collection::vec(corner, 0..20), any::<bool>()).prop_map(|(at, corners, wide)| {
            let size = if wide { (1280, 720) } else { (0, 1) };
            Input::Seen(at, Detection::Corners { view: BoardView { corners }, size })
        });
    let mark = (time(), time(), prop::option::of(pixel()))
        .prop_map(|(at, stamp, pixel)| Input::Seen(at, Detection::Mark { stamp, pixel }));
    let key = prop_oneof![
        3 => Just(Key::Next),
        1 => Just(Key::Back),
        1 => prop::sample::select(Task::ALL.to_vec()).prop_map(Key::Pick)
    ]
    .prop_map(Input::Key);
    let fault =
        (time(), prop::sample::select(Fault::ALL.to_vec()), any::<bool>()).prop_map(|(at, fault, raised)| {
            Input::Fault(if raised {
                FaultChange::raised(at, fault, "any")
            } else {
                FaultChange::cleared(at, fault)
            })
        });
    let saved = any::<bool>().prop_map(|ok| {
        Input::Saved(if ok { Ok(Box::new(setup().calibration)) } else { Err("no".to_owned()) })
    });
    prop_oneof![
        4 => sample,
        2 => edge,
        2 => seen,
        2 => corners,
        2 => mark,
        2 => key,
        1 => fault,
        1 => saved,
        1 => time().prop_map(Input::Time),
        1 => Just(Input::Ended),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn no_order_of_events_breaks_it(
        inputs in prop::collection::vec((anything(), any::<bool>()), 0..200), first in 0usize..5
    ) {
        let mut wizard = Wizard::new(setup(), Task::ALL.get(first).copied());
        let mut late = Vec::new();
        for (input, at_once) in inputs {
            wizard.take(input);
            while let Some(ask) = wizard.ask() {
                match ask {
                    Ask::Solve(work) if at_once => wizard.take(Input::Solved(Box::new(work.run()))),
                    // Comes when something else is under way.
                    Ask::Solve(work) => late.push(work),
                    Ask::Save(_) | Ask::End => {}
                }
            }
            if let Some(work) = late.pop().filter(|_| at_once) {
                wizard.take(Input::Solved(Box::new(work.run())));
            }
            let guide = wizard.guide();
            prop_assert!(guide.gauges.iter().all(|g| (0.0..=1.0).contains(&g.share)), "{:?}", guide);
            prop_assert!(guide.says.is_ascii() && guide.lines.iter().all(|l| l.is_ascii()), "{:?}", guide);
        }
    }
}

/// A frame's own type is not needed here but by [`Detector`].
#[test]
fn eyes_find_only_what_is_looked_for() {
    let WizardSetup { calibration, target, .. } = setup();
    let (width, height) = (calibration.lens.width, calibration.lens.height);
    let picture =
        bowwave_core::event::Picture::black(bowwave_core::event::PixelFormat::Rgb, width, height).unwrap();
    let stamp = Time::from_ns(3);
    let frame = CameraFrame { arrival: stamp, mid_exposure: stamp, sequence: 0, picture, jpeg: None };
    let mut eyes = Detector::new(&calibration, 8.0, target, 0);
    assert_eq!(eyes.look(DetectorMode::Nothing, &frame), Detection::Picture);
    assert_eq!(eyes.look(DetectorMode::Mark, &frame), Detection::Mark { stamp, pixel: None });
    let size = (width, height);
    assert_eq!(
        eyes.look(DetectorMode::Corners, &frame),
        Detection::Corners { view: BoardView::default(), size }
    );
    let Detection::Orientation(seen) = eyes.look(DetectorMode::Orientation, &frame) else { panic!() };
    assert!(seen.fits && seen.horizon.is_none() && seen.board.is_none());
}
