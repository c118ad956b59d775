use proptest::prelude::*;

use super::*;
use crate::{sea::BeaufortForce, world::waves::Spectrum};

fn sea(force: u8, seed: u64) -> WaveField {
    let force = BeaufortForce::new(force).expect("on the scale");
    WaveField::new(&WaveSpec { spectrum: Spectrum::of_force(force), wind_from: 0.7 }, seed)
}

#[test]
fn height_has_the_variance_of_the_specification() {
    for force in [1, 2, 4, 6] {
        for seed in [1, 2, 99] {
            let waves = sea(force, seed);
            let height = BeaufortForce::new(force).expect("on the scale").probable_wave_height_m();
            let n = 40_000;
            let (mut mean, mut square) = (0.0, 0.0);
            for i in 0..n {
                // Scattered over a large area and a long time, far apart against every wave.
                let i = f64::from(i);
                let at = DVec2::new(fraction(i * GOLDEN), fraction(i * 0.754_877_666)) * 50e3;
                let h = waves.height(at, fraction(i * 0.569_840_29) * 20e3);
                mean += h / f64::from(n);
                square += h * h / f64::from(n);
            }
            let significant = 4.0 * square.sqrt();
            assert!((significant / height - 1.0).abs() < 0.03, "force {force}, seed {seed}: {significant} m");
            assert!(mean.abs() < 0.02 * height, "force {force}, seed {seed}: mean {mean} m");
        }
    }
}

#[test]
fn force_0_is_flat() {
    let waves = sea(0, 1);
    assert!(waves.is_flat());
    assert_eq!(waves.height(DVec2::new(12.0, 300.0), 7.0), 0.0);
    assert_eq!(waves.slope(DVec2::new(12.0, 300.0), 7.0), DVec2::ZERO);
    assert_eq!(waves.plane_under(DVec2::ZERO, 0.3, 8.0, 2.0, 1.0), WaterPlane::default());
}

#[test]
fn the_seed_decides_the_waves() {
    assert_eq!(sea(3, 5), sea(3, 5));
    assert_ne!(sea(3, 5), sea(3, 6));
}

#[test]
fn waves_come_from_where_the_wind_does() {
    let towards: DVec2 = sea(3, 1).waves.iter().map(|w| w.cycles_per_m.normalize()).sum();
    let expected = -DVec2::new(0.7_f64.sin(), 0.7_f64.cos());
    assert!(towards.normalize().dot(expected) > 0.97, "{towards}");
}

#[test]
fn each_wave_keeps_the_dispersion_relation_of_deep_water() {
    for wave in &sea(4, 3).waves {
        let (omega, k) = (wave.hz * TAU, wave.cycles_per_m.length() * TAU);
        assert!((omega * omega - GRAVITY_M_S2 * k).abs() < 1e-9);
    }
}

#[test]
fn phases_stay_exact_kilometres_away_and_days_later() {
    // Oracle: the cycles of the stored doubles by integer arithmetic, free of rounding.
    fn exact_cycles(a: f64, b: f64) -> f64 {
        let parts = |v: f64| {
            let bits = v.to_bits();
            let exponent = ((bits >> 52) & 0x7ff) as i32 - 1075;
            let mantissa = i128::from((bits & ((1 << 52) - 1)) | (1 << 52));
            (if v < 0.0 { -mantissa } else { mantissa }, exponent)
        };
        let ((ma, ea), (mb, eb)) = (parts(a), parts(b));
        let (product, exponent) = (ma * mb, ea + eb);
        assert!((-126..0).contains(&exponent), "the oracle's range");
        let one = 1_i128 << -exponent;
        product.rem_euclid(one) as f64 / one as f64
    }
    let days_s = 10.0 * 86_400.0 + 0.1234;
    let at = DVec2::new(-23_456.789, 98_765.432_1);
    for wave in &sea(1, 3).waves {
        let cycles = exact_cycles(wave.cycles_per_m.x, at.x) + exact_cycles(wave.cycles_per_m.y, at.y)
            - exact_cycles(wave.hz, days_s)
            + wave.phase;
        let error = (wave.phase(at, days_s) - TAU * fraction(cycles)).sin().abs();
        assert!(error < 2e-9, "{error} rad at {} Hz", wave.hz);
    }
}

#[test]
fn a_sea_goes_over_into_another_without_a_jump_and_keeps_its_energy() {
    let (old, new) = (sea(3, 1), sea(5, 2));
    let changing = old.clone().changing_to(new.clone(), 100.0);
    let at = DVec2::new(40.0, -7.0);
    assert_eq!(changing.height(at, 99.0), old.height(at, 99.0));
    assert_eq!(changing.height(at, 101.0 + CHANGE_S), new.height(at, 101.0 + CHANGE_S));
    let variance = |waves: &WaveField| waves.waves.iter().map(|w| w.amplitude_m.powi(2) / 2.0).sum::<f64>();
    let (low, high) = (variance(&old), variance(&new));
    let mut last = low;
    for i in 0..=1500 {
        let t = 100.0 + CHANGE_S * f64::from(i) / 1500.0;
        let now: f64 = changing.waves_at(t).map(|(f, w)| (f * w.amplitude_m).powi(2) / 2.0).sum();
        assert!((low - 1e-9..=high + 1e-9).contains(&now) && now >= last - 1e-9, "{now} after {t} s");
        assert!(now - last < 0.003 * (high - low), "{now} after {last}");
        last = now;
        let slow = (changing.height(at, t + 1e-3) - changing.height(at, t)).abs();
        assert!(slow < 0.02, "{slow} m in a millisecond");
    }
    assert!(
        !WaveField::FLAT.changing_to(new, 0.0).is_flat() && !old.changing_to(WaveField::FLAT, 0.0).is_flat()
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn slope_is_the_derivative_of_height(x in -5e3..5e3_f64, y in -5e3..5e3_f64, t in 0.0..1e5_f64, force in 1_u8..8) {
        let (waves, at, h) = (sea(force, 11), DVec2::new(x, y), 1e-4);
        let d = |step: DVec2| (waves.height(at + step, t) - waves.height(at - step, t)) / (2.0 * h);
        let numeric = DVec2::new(d(DVec2::X * h), d(DVec2::Y * h));
        prop_assert!((waves.slope(at, t) - numeric).length() < 1e-6);
    }

    #[test]
    fn the_plane_under_a_hull_is_the_least_squares_fit(
        x in -3e3..3e3_f64, y in -3e3..3e3_f64, t in 0.0..1e4_f64, heading in -7.0..7.0_f64,
        length in 0.1..150.0_f64, beam in 0.1..20.0_f64, force in 1_u8..8,
    ) {
        let (waves, centre) = (sea(force, 4), DVec2::new(x, y));
        let forward = DVec2::new(heading.sin(), heading.cos());
        // The sum below sees eight places of the shortest wave, or it would take it for a longer one.
        let n = 240;
        let shortest_m = waves.waves.iter().map(|w| w.cycles_per_m.length().recip()).fold(f64::INFINITY, f64::min);
        let (length, beam) = (length.min(30.0 * shortest_m), beam.min(7.5 * shortest_m));
        let (mut mean, mut by_x, mut by_y, mut xx, mut yy) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for i in 0..n {
            for j in 0..n / 4 {
                let a = ((f64::from(i) + 0.5) / f64::from(n) - 0.5) * length;
                let b = ((f64::from(j) + 0.5) / f64::from(n / 4) - 0.5) * beam;
                let h = waves.height(centre + forward * a + forward.perp() * b, t);
                mean += h / f64::from(n * (n / 4));
                by_x += a * h;
                xx += a * a;
                by_y += b * h;
                yy += b * b;
            }
        }
        let plane = waves.plane_under(centre, heading, length, beam, t);
        let size = BeaufortForce::new(force).expect("on the scale").probable_wave_height_m();
        prop_assert!((plane.height_m - mean).abs() < 3e-3 * size, "{plane:?}, mean {mean}");
        prop_assert!((plane.forward_slope - by_x / xx).abs() < 3e-3, "{plane:?}, {}", by_x / xx);
        prop_assert!((plane.port_slope - by_y / yy).abs() < 3e-3, "{plane:?}, {}", by_y / yy);
    }
}

#[test]
fn the_level_over_places_is_the_height_of_the_plane_there() {
    let waves = sea(4, 3);
    let level = waves.level_over(7.0, 2.0, 12.3);
    for i in 0..200 {
        let place = DVec2::new(f64::from(i) * 37.0 - 2000.0, f64::from(i % 17) * 9.1);
        let off = level.at(place) - waves.plane_under(place, 0.0, 7.0, 2.0, 12.3).height_m;
        assert!(off.abs() < 1e-10 * waves.crest_max_m(), "{off}");
    }
    // A sea that goes over into another is the sum of both.
    let changing = sea(4, 3).changing_to(sea(6, 5), 5.0);
    let place = DVec2::new(31.0, -7.0);
    let off = changing.level_over(7.0, 2.0, 12.3).at(place)
        - changing.plane_under(place, 0.0, 7.0, 2.0, 12.3).height_m;
    assert!(off.abs() < 1e-10 * changing.crest_max_m(), "{off}");
    assert_eq!(WaveField::FLAT.level_over(7.0, 2.0, 12.3).at(place), 0.0);
}
