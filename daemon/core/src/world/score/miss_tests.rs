use super::*;

const MUZZLE: DVec3 = DVec3::new(0.4, 0.2, 8.0);

fn heavy() -> Projectile {
    Projectile::new(0.337, 893.0).expect("a round")
}

/// A skiff that crosses at 400 m to the right with 12 m/s and closes a little.
fn skiff(s: f64) -> DVec3 {
    DVec3::new(20.0 + 12.0 * s, 400.0 - 3.0 * s, 0.6)
}

/// The barrel that follows the target perfectly, turned by `off(before_s)` (mrad to the right and over).
fn explained(off: impl Fn(f64) -> DVec2, scatter: DVec2) -> MissExplanation {
    let turned = |direction: DVec3, at: DVec3, off: DVec2| {
        let sight = Sight::at(MUZZLE, at).expect("a sight");
        (direction + (sight.right * off.x + sight.up * off.y) * 1e-3).normalize()
    };
    let aim = |before_s: f64| {
        let hit = aim_to_hit(heavy(), MUZZLE, DVec3::ZERO, |s| skiff(s - before_s)).expect("in range");
        turned(hit.direction, skiff(-before_s), off(before_s))
    };
    let before: Vec<BoreSample> = (1..25)
        .rev()
        .map(|i| f64::from(i) / 30.0)
        .map(|before_s| BoreSample { before_s, muzzle: MUZZLE, bore: aim(before_s) })
        .collect();
    let bore = aim(0.0);
    let round = MissedRound {
        projectile: heavy(),
        wind: DVec3::ZERO,
        muzzle: MUZZLE,
        bore,
        flown: turned(bore, skiff(0.0), scatter),
        before: &before,
    };
    MissExplanation::of(&round, skiff).expect("explained")
}

#[test]
fn a_cause_that_is_injected_alone_is_the_largest_and_of_its_size() {
    let none = DVec2::ZERO;
    let cases: [(MissCause, f64, MissExplanation); 5] = [
        (MissCause::Lead, 5.0, explained(|_| DVec2::new(-5.0, 0.0), none)),
        (MissCause::Elevation, 3.0, explained(|_| DVec2::new(0.0, 3.0), none)),
        (MissCause::Tracking, 4.1, explained(|before_s| DVec2::new(10.0 * (0.41 - before_s), 0.0), none)),
        (
            MissCause::Jerk,
            6.0,
            explained(|before_s| DVec2::new(0.0, -60.0 * (0.1 - before_s).max(0.0)), none),
        ),
        (MissCause::Dispersion, 2.5, explained(|_| none, DVec2::new(1.5, -2.0))),
    ];
    for (cause, size, explained) in cases {
        assert_eq!(explained.largest(), cause, "{explained:?}");
        assert!((explained.part_mrad(cause) - size).abs() < 0.15, "{cause}: {explained:?}");
        let sum = explained.parts_mrad.iter().fold(DVec2::ZERO, |sum, part| sum + DVec2::from_array(*part));
        assert!((sum - DVec2::from_array(explained.error_mrad)).length() < 1e-9);
    }
}

#[test]
fn a_miss_is_said_as_a_coach_says_it() {
    let none = DVec2::ZERO;
    let behind = explained(|_| DVec2::new(-5.0, 0.0), none).to_string();
    assert!(behind.starts_with("2.0 m behind and 0.0 m ") && behind.contains("lead: "), "{behind}");
    let over = explained(|_| DVec2::new(0.0, 3.0), none).to_string();
    assert!(over.contains("1.2 m over at 399") && over.contains("elevation: "), "{over}");
}

#[test]
fn a_barrel_that_was_not_followed_has_no_trend() {
    let explained = explained(|_| DVec2::new(-5.0, 0.0), DVec2::ZERO);
    let sight = Sight::at(MUZZLE, skiff(0.0)).expect("a sight");
    let aim = aim_to_hit(heavy(), MUZZLE, DVec3::ZERO, skiff).expect("in range");
    let bore = (aim.direction - sight.right * 5e-3).normalize();
    let round = MissedRound {
        projectile: heavy(),
        wind: DVec3::ZERO,
        muzzle: MUZZLE,
        bore,
        flown: bore,
        before: &[],
    };
    let alone = MissExplanation::of(&round, skiff).expect("explained");
    assert!((alone.part_mrad(MissCause::Lead) - explained.part_mrad(MissCause::Lead)).abs() < 0.1);
    assert_eq!(alone.part_mrad(MissCause::Jerk), 0.0);
}
