use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DQuat, DVec2, DVec3};
use proptest::prelude::*;

use super::*;
use crate::{
    geometry::{CameraPose, Lens, look},
    physics::GRAVITY_M_S2,
    sea::{BeaufortForce, WmoSeaState},
    time::Time,
};

const EYE_M: f64 = 8.0;

/// Reflectance of water by the sine of the angle under which a facet is met, n = 1.34.
fn reflectance(sine: f64) -> f64 {
    let t = (1.0 - (1.0 - sine * sine) / (1.34 * 1.34)).sqrt();
    let s = ((sine - 1.34 * t) / (sine + 1.34 * t)).powi(2);
    let p = ((1.34 * sine - t) / (1.34 * sine + t)).powi(2);
    0.5 * (s + p)
}

fn sky(elevation: f64) -> f64 {
    0.3 + 0.6 * (-elevation / 0.4).exp()
}

/// Plane waves of one sea, smooth between them: amplitude, wave vector, phase.
struct PlaneWaves(Vec<(f64, DVec2, f64)>);

impl PlaneWaves {
    fn new(height_m: f64, peak_s: f64, from: f64) -> Self {
        let n = 16;
        let one = |i: usize| {
            // Frequencies over +-12 % and directions over +-15 degrees, in an order that mixes both.
            let (u, v) = (i as f64 / n as f64 - 0.47, (i * 7 % n) as f64 / n as f64 - 0.47);
            let omega = TAU / peak_s * (1.0 + 0.24 * u);
            let towards = from + PI + 0.5 * v;
            let k = DVec2::new(towards.sin(), towards.cos()) * (omega * omega / GRAVITY_M_S2);
            (height_m / 4.0 * (2.0 / n as f64).sqrt(), k, 2.4 * (i * i) as f64)
        };
        Self((0..n).map(one).collect())
    }

    /// Slope towards an eye that looks along `view`.
    fn slope(&self, at: DVec2, view: DVec2, t: f64) -> f64 {
        let one = |(a, k, phase): &(f64, DVec2, f64)| {
            let omega = (GRAVITY_M_S2 * k.length()).sqrt();
            -a * k.dot(view) * (k.dot(at) - omega * t + phase).sin()
        };
        self.0.iter().map(one).sum()
    }
}

/// Luminance along a ray: smooth facets on the plane z = 0 under an even sky, tilted by the waves.
fn light(waves: &PlaneWaves, camera: &CameraPose, ray: DVec3, t: f64) -> f32 {
    if ray.z > -0.01 {
        return sky(ray.z.max(0.0).asin()) as f32;
    }
    let at = (ray * (-camera.position.z / ray.z)).truncate();
    let view = ray.truncate().normalize();
    let (depression, slope) = ((-ray.z).asin(), waves.slope(at, view, t));
    let mirror = reflectance((depression + slope).max(0.0).sin());
    (mirror * sky((depression + 2.0 * slope).abs()) + (1.0 - mirror) * 0.03) as f32
}

fn watch(meter: &mut SeaMeter, waves: &PlaneWaves, seconds: std::ops::Range<f64>, step_s: f64) {
    let lens = Lens::pinhole(640, 360, 1.0);
    let mut t = seconds.start;
    while t < seconds.end {
        let time = Time::from_ns(0).plus_secs(t);
        let camera = CameraPose { world_from_camera: look(0.3, -0.12, 0.0), position: DVec3::Z * EYE_M };
        let see = |p: DVec2| Some(light(waves, &camera, camera.world_from_camera * lens.unproject(p), t));
        meter.observe(&SeaFrame { time, camera, lens: &lens, luminance: &see });
        t += step_s;
    }
}

#[test]
fn waves_of_known_height_period_and_direction_are_found() {
    for (height_m, peak_s, from) in [(0.3, 3.5, 0.3), (0.8, 5.5, 3.6), (0.5, 4.5, 1.3)] {
        let mut meter = SeaMeter::new();
        watch(&mut meter, &PlaneWaves::new(height_m, peak_s, from), 0.0..72.0, 0.1);
        let e = meter.estimate().expect("an estimate");
        let turn = (e.direction_from_rad.value - from + PI).rem_euclid(TAU) - PI;
        let said = format!("{height_m} m, {peak_s} s, {from} rad: {e:?}");
        assert!((e.significant_height_m.value / height_m - 1.0).abs() < 0.25, "{said}");
        assert!((e.peak_period_s.value / peak_s - 1.0).abs() < 0.06, "{said}");
        assert!(turn.abs() < 0.2, "{said}");
    }
}

#[test]
fn a_glassy_sea_is_state_0_and_not_a_swell() {
    let mut meter = SeaMeter::new();
    // A ripple of 2 mm, or nothing in the picture would change.
    watch(&mut meter, &PlaneWaves::new(0.002, 2.5, 0.0), 0.0..70.0, 0.1);
    let e = meter.estimate().expect("an estimate");
    assert!(e.state.get() <= 1, "{e:?}");
}

#[test]
fn the_pieces_of_an_estimate_come_one_by_one_and_memory_stays() {
    let mut meter = SeaMeter::new();
    let waves = PlaneWaves::new(0.4, 4.0, 2.0);
    watch(&mut meter, &waves, 0.0..20.0, 0.1);
    assert!(matches!(meter.estimate(), Err(Unknown::TooShort { after: None, .. })), "{:?}", meter.estimate());
    watch(&mut meter, &waves, 20.0..150.0, 0.2);
    let held = meter.memory_bytes();
    watch(&mut meter, &waves, 150.0..190.0, 0.2);
    assert!(meter.memory_bytes() <= held + held / 4 && held < 8_000_000, "{held}");
}

#[test]
fn gaps_a_standing_picture_and_no_pose_end_the_watch_and_say_so() {
    let waves = PlaneWaves::new(0.4, 4.0, 2.0);
    let mut meter = SeaMeter::new();
    watch(&mut meter, &waves, 0.0..10.0, 0.1);
    watch(&mut meter, &waves, 20.0..24.0, 0.1);
    assert!(matches!(meter.estimate(), Err(Unknown::TooShort { after: Some(Restart::Gap), .. })));

    let lens = Lens::pinhole(640, 360, 1.0);
    let mut camera = CameraPose { world_from_camera: look(0.3, -0.12, 0.0), position: DVec3::Z * EYE_M };
    for i in 0..40 {
        let time = Time::from_ns(0).plus_secs(24.0 + 0.2 * f64::from(i));
        meter.observe(&SeaFrame { time, camera, lens: &lens, luminance: &|_| Some(0.3) });
        if meter.estimate() == Err(Unknown::Frozen { seconds: 2.0 }) {
            break;
        }
    }
    assert!(matches!(meter.estimate(), Err(Unknown::Frozen { .. })), "{:?}", meter.estimate());

    camera.world_from_camera = DQuat::from_xyzw(f64::NAN, 0.0, 0.0, 1.0);
    meter.observe(&SeaFrame {
        time: Time::from_ns(40_000_000_000),
        camera,
        lens: &lens,
        luminance: &|_| Some(0.3),
    });
    assert!(matches!(meter.estimate(), Err(Unknown::BadPose { .. })), "{:?}", meter.estimate());
}

#[test]
fn a_gun_that_sweeps_the_horizon_is_given_no_sea() {
    // A lens that darkens its corners, turned to and fro by 12 degrees in 10 s over water without any wave.
    let lens = Lens::pinhole(640, 360, 1.0);
    let mut meter = SeaMeter::new();
    for i in 0..900 {
        let t = 0.1 * f64::from(i);
        let azimuth = 0.3 + 0.2 * (TAU * t / 10.0).sin();
        let camera = CameraPose { world_from_camera: look(azimuth, -0.12, 0.0), position: DVec3::Z * EYE_M };
        let see = |p: DVec2| {
            let ray = lens.unproject(p);
            let level = light(&PlaneWaves::new(0.002, 2.5, 0.0), &camera, camera.world_from_camera * ray, t);
            Some(level * ray.z.powi(4) as f32)
        };
        meter.observe(&SeaFrame {
            time: Time::from_ns(0).plus_secs(t),
            camera,
            lens: &lens,
            luminance: &see,
        });
        assert!(meter.estimate().is_err(), "{:?}", meter.estimate());
    }
}

#[test]
fn a_night_without_light_is_told_as_dark() {
    let lens = Lens::pinhole(640, 360, 1.0);
    let camera = CameraPose { world_from_camera: look(0.3, -0.12, 0.0), position: DVec3::Z * EYE_M };
    let mut meter = SeaMeter::new();
    for i in 0..600 {
        let time = Time::from_ns(0).plus_secs(0.1 * f64::from(i));
        meter.observe(&SeaFrame { time, camera, lens: &lens, luminance: &|_| Some(0.000_3) });
    }
    assert!(matches!(meter.estimate(), Err(Unknown::Dark { .. })), "{:?}", meter.estimate());
}

fn found(height_m: f64) -> Result<SeaEstimate, Unknown> {
    let one = |value: f64, sigma: f64| MeasuredValue { value, sigma };
    Ok(SeaEstimate {
        time: Time::from_ns(0),
        seconds: 60.0,
        significant_height_m: one(height_m, 0.1 * height_m),
        peak_period_s: one(5.0, 0.2),
        direction_from_rad: one(6.2, 0.1),
        state: WmoSeaState::of_wave_height(height_m),
        state_probability: 0.9,
        wind_m_s: one(5.0, 1.0),
        force: BeaufortForce::of_wind(5.0),
        rough_slope: 0.1,
        wave_share: 0.8,
    })
}

#[test]
fn the_state_in_use_does_not_flicker_and_the_operator_has_the_last_word() {
    let assumed = SeaConditions { significant_height_m: 1.0, peak_period_s: 5.0, from_rad: 0.1 };
    let mut follower = SeaFollower::new(assumed);
    assert_eq!(follower.in_use().source, SeaSource::Assumed);
    follower.update(&found(0.46));
    assert_eq!(follower.in_use().state.get(), 2);
    // Heights that swing by a tenth about the border between states 2 and 3.
    for i in 0..40 {
        follower.update(&found(if i % 2 == 0 { 0.55 } else { 0.45 }));
        assert_eq!(follower.in_use().state.get(), 2, "after {i}");
    }
    for _ in 0..12 {
        follower.update(&found(0.8));
    }
    assert_eq!(follower.in_use().state.get(), 3);
    follower.update(&Err(Unknown::NoWater));
    assert_eq!((follower.in_use().state.get(), follower.in_use().source), (3, SeaSource::Kept));
    // Directions about north are not averaged to south.
    assert!(follower.in_use().conditions.from_rad.cos() > 0.98);
    let ordered = WmoSeaState::new(5).expect("on the scale");
    follower.order(SeaOrder::State(ordered));
    let now = follower.in_use();
    assert_eq!((now.state, now.source), (ordered, SeaSource::Ordered));
    assert_eq!(WmoSeaState::of_wave_height(now.conditions.significant_height_m), ordered);
    follower.order(SeaOrder::Measured);
    assert_eq!(follower.in_use().state.get(), 3);
}

#[test]
fn a_sky_cut_off_at_white_is_read_from_the_water() {
    let lens = Lens::pinhole(640, 360, 1.0);
    let camera = CameraPose { world_from_camera: look(0.3, -0.05, 0.0), position: DVec3::Z * EYE_M };
    let waves = PlaneWaves::new(0.1, 4.0, 0.0);
    for exposure in [0.9, 2.5] {
        let mut meter = SkyMeter::new();
        for i in 0..40 {
            let t = 0.5 * f64::from(i);
            let see = |p: DVec2| {
                let l = light(&waves, &camera, camera.world_from_camera * lens.unproject(p), t) * exposure;
                Some([0.8 * l, 0.9 * l, l].map(|c| c.min(1.0)))
            };
            meter.observe(&SkyFrame { camera, lens: &lens, colour: &see });
        }
        let e = meter.estimate().expect("an estimate");
        // Smooth water mirrors the sky up to twice the depression; what lies above is continued.
        for (elevation, tolerance) in [(0.05, 0.1), (0.2, 0.2), (0.5, 0.25), (1.0, 0.4)] {
            // Wholly cut off, the sky is known from its reflection alone.
            let tolerance = if exposure > 1.0 { f64::max(tolerance, 0.3) * 1.5 } else { tolerance };
            let truth = sky(elevation) * f64::from(exposure) * 0.9;
            let got = f64::from(e.radiance(elevation).y);
            assert!(
                (got / truth - 1.0).abs() < tolerance,
                "exposure {exposure}, {elevation} rad: {got} for {truth}; {e:?}"
            );
        }
        let deck = e.white_deck();
        assert!((deck.x / deck.z - 0.8).abs() < 0.1, "{deck}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    /// Whatever is shown, the answer is finite or a refusal.
    #[test]
    fn nothing_that_is_shown_makes_it_panic_or_answer_with_no_number(
        seed in any::<u64>(), eye in prop_oneof![0.1..30.0f64, Just(f64::NAN), Just(0.0), Just(1e9)],
        elevation in -1.6..0.5f64, hfov in 0.05..2.4f64, gain in prop_oneof![0.0..2.0f32, Just(f32::NAN), Just(1e30)],
        step in prop_oneof![Just(0.2), 0.01..0.5f64], mask in 0.0..1.0f64, bad in 0u32..40,
    ) {
        let lens = Lens::pinhole(320, 180, hfov);
        let mut meter = SeaMeter::new();
        let mut sky = SkyMeter::new();
        let hash = |a: u64| {
            let z = (a ^ seed).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            ((z ^ (z >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40) as f64 / (1u64 << 24) as f64
        };
        for i in 0..420u64 {
            let t = step * i as f64 + if bad == 1 && i % 60 == 59 { -3.0 } else { 0.0 };
            let jump = if bad == 2 && i % 31 == 0 { FRAC_PI_2 } else { 0.0 };
            let turn = if bad == 3 && i == 200 { f64::NAN } else { jump };
            let camera = CameraPose {
                world_from_camera: look(turn, elevation + 0.002 * hash(i), 0.0),
                position: DVec3::new(0.0, 0.0, eye),
            };
            let see = |p: DVec2| {
                let noise = hash(p.x as u64 * 7919 + p.y as u64 * 104_729 + i * 31);
                (noise >= 0.9 * mask).then_some(gain * (0.2 + noise as f32))
            };
            let time = Time::from_ns(0).plus_secs(t);
            meter.observe(&SeaFrame { time, camera, lens: &lens, luminance: &see });
            if i % 50 == 0 {
                sky.observe(&SkyFrame { camera, lens: &lens, colour: &|p| see(p).map(|l| [l; 3]) });
            }
        }
        if let Ok(e) = meter.estimate() {
            for m in [e.significant_height_m, e.peak_period_s, e.direction_from_rad, e.wind_m_s] {
                prop_assert!(m.value.is_finite() && m.sigma.is_finite() && m.value >= 0.0 && m.sigma >= 0.0, "{e:?}");
            }
            prop_assert!((0.0..=1.0).contains(&e.state_probability), "{e:?}");
        }
        if let Some(s) = sky.estimate() {
            for elevation in [0.0, 0.3, 1.5] {
                prop_assert!(s.radiance(elevation).is_finite() && s.water(elevation).is_finite(), "{s:?}");
            }
            prop_assert!(s.white_deck().is_finite());
        }
    }
}
