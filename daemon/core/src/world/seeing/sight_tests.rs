use super::*;

const SKIFF: Target = Target { breadth_m: 3.0, height_m: 1.5, reflectance: 0.3, lamp_lux: 0.0, candela: 0.0 };

fn seeing(sun_deg: f64, visibility_m: f64) -> Seeing {
    let (sine, cosine) = sun_deg.to_radians().sin_cos();
    // The sun stands in the east; boats in the north.
    Seeing { ambient: Ambient::new(DVec3::new(cosine, 0.0, sine), 1.0, None, 5.0), visibility_m }
}

fn times(seeing: &Seeing, range_m: f64, target: &Target) -> f64 {
    seeing.times_threshold(DVec3::Z * 8.0, DVec3::Y * range_m, target, Glare::default())
}

fn farthest_m(seeing: &Seeing, target: &Target) -> f64 {
    seeing.farthest_m(8.0, DVec3::Y, target, 5e4)
}

#[test]
fn a_dark_skiff_is_seen_kilometres_off_by_day_and_hundreds_of_metres_by_starlight() {
    let [day, dusk, night] = [40.0, -6.0, -30.0].map(|deg| farthest_m(&seeing(deg, 2e4), &SKIFF));
    assert!((2500.0..8000.0).contains(&day), "{day}");
    assert!((1000.0..day).contains(&dusk), "{dusk}");
    assert!((80.0..500.0).contains(&night), "{night}");
}

#[test]
fn lights_and_searchlights_are_seen_by_night_and_not_by_day() {
    let night = seeing(-30.0, 2.5e4);
    // A light that the COLREGS want seen two miles away, where air lets 80 % of light through in a mile.
    let lit = Target { candela: 4.3, ..SKIFF };
    assert!(farthest_m(&night, &lit) > 2.0 * 1852.0, "{}", farthest_m(&night, &lit));
    let day = seeing(40.0, 2.5e4);
    assert!((farthest_m(&day, &lit) - farthest_m(&day, &SKIFF)).abs() < 2.0);
    let in_beam = Target { lamp_lux: 1.0, ..SKIFF };
    assert!(farthest_m(&night, &in_beam) > 3.0 * farthest_m(&night, &SKIFF));
    let burning = Target { candela: 5000.0, ..SKIFF };
    assert!(farthest_m(&night, &burning) > 8000.0);
}

#[test]
fn haze_night_distance_and_smallness_never_help() {
    let easier =
        |hard: f64, easy: f64, what: &str| assert!(hard <= easy * (1.0 + 1e-9), "{what}: {hard} {easy}");
    let reflectances = [0.0, 0.1, 0.3];
    for reflectance in reflectances {
        let skiff = Target { reflectance, ..SKIFF };
        for sun_deg in [-20.0, -8.0, -2.0] {
            let at = seeing(sun_deg, 1e4);
            for range_m in [50.0, 300.0, 1000.0, 3000.0] {
                easier(times(&at, range_m * 1.2, &skiff), times(&at, range_m, &skiff), "range");
                let smaller = Target { breadth_m: 2.5, height_m: 1.2, ..skiff };
                easier(times(&at, range_m, &smaller), times(&at, range_m, &skiff), "size");
                easier(times(&seeing(sun_deg, 5e3), range_m, &skiff), times(&at, range_m, &skiff), "haze");
                easier(
                    times(&seeing(sun_deg - 2.0, 1e4), range_m, &skiff),
                    times(&at, range_m, &skiff),
                    "light",
                );
            }
        }
    }
}

#[test]
fn the_sun_behind_a_boat_hides_it() {
    let low = |azimuth: f64| {
        let (sine, cosine) = 4f64.to_radians().sin_cos();
        let sun = DVec3::new(azimuth.sin() * cosine, azimuth.cos() * cosine, sine);
        farthest_m(&Seeing { ambient: Ambient::new(sun, 1.0, None, 5.0), visibility_m: 2e4 }, &SKIFF)
    };
    let [behind, beside] = [0.0, 1.2].map(low);
    assert!(behind < 0.7 * beside, "{behind} {beside}");
    // Somebody whom a searchlight blinds sees nothing of who stands beside it.
    let night = seeing(-30.0, 2e4);
    let ship = Target { breadth_m: 24.0, height_m: 8.0, ..SKIFF };
    let times =
        |lux: f64| night.times_threshold(DVec3::Z * 2.0, DVec3::Y * 400.0, &ship, Glare { lux, off: 0.01 });
    assert!(times(0.0) > 1.0 && times(1.0) < 0.2 * times(0.0), "{} {}", times(0.0), times(1.0));
}

#[test]
fn the_earth_hides_what_is_beyond_its_horizon() {
    let clear = seeing(40.0, 1e9);
    assert!(times(&clear, 14_000.0, &Target { breadth_m: 100.0, height_m: 30.0, ..SKIFF }) > 1.0);
    assert_eq!(times(&clear, 40_000.0, &SKIFF), 0.0);
    // A mast stands before the sky, the hull below it before the sea.
    let shown = |height_m: f64| Shown::of(8.0, 1000.0, height_m).expect("it shows").above_horizon;
    assert_eq!(shown(1.5), 0.0);
    assert!((0.5..0.65).contains(&shown(16.0)), "{}", shown(16.0));
}

#[test]
fn extremes_are_finite() {
    for sun_deg in (-90..=90).step_by(10) {
        for visibility_m in [1.0, 1e3, 1e9] {
            let at = seeing(f64::from(sun_deg), visibility_m);
            for range_m in [0.0, 1.0, 1e3, 1e6] {
                for candela in [0.0, 1.0, 1e8] {
                    let target = Target { candela, ..SKIFF };
                    let times = times(&at, range_m, &target);
                    assert!(times.is_finite() && times >= 0.0, "{sun_deg} {visibility_m} {range_m}: {times}");
                }
            }
        }
    }
    let flat = Target { breadth_m: 0.0, height_m: 0.0, ..SKIFF };
    assert_eq!(times(&seeing(40.0, 2e4), 100.0, &flat), 0.0);
}
