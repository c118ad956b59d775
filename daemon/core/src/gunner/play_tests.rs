use super::*;
use crate::{world::scenario::Scenario, world::score::boxed_model};
use glam::Vec3;

const TEXT: &str = r#"
seed = 4
[weapon]
kind = "heavy-machine-gun"
[rules]
engagement = "tight"
[goals]
keep_off_m = 150
[[call]]
say = "report"
about = "hostile"
within_s = 60
[[boat]]
name = "skiff"
model = "skiff"
crew = "attacker"
count = 2
formation = "abreast"
spacing_m = 40
speed_kn = 15
range_m = 700
bearing_deg = 30
[[boat]]
name = "fisher"
model = "dhow"
side = "neutral"
crew = "fisher"
range_m = 600
bearing_deg = 350
"#;

fn played(skill: &Skill, seed: u64) -> Played {
    let scenario = Scenario { seed, ..Scenario::parse(TEXT, "x").expect("sound") };
    let models: Arc<[Model]> = Arc::new([boxed_model(Vec3::new(-3.5, -1.0, -0.3), Vec3::new(3.5, 1.0, 1.4))]);
    play(&scenario, models, &[ModelId(0); 3], skill, 120.0)
}

#[test]
fn the_same_seed_gives_the_same_run_and_another_seed_another() {
    let (a, b, other) = (played(&Skill::TRAINED, 4), played(&Skill::TRAINED, 4), played(&Skill::TRAINED, 5));
    assert_eq!((&a.shots, &a.events), (&b.shots, &b.events));
    assert!(!a.shots.is_empty() && a.events.len() > 10);
    assert_ne!(a.shots, other.shots);
}

#[test]
fn a_gunner_reports_identifies_and_stops_what_attacks() {
    let sheets: Vec<_> = (0..12).map(|seed| played(&Skill::EXPERT, seed).fold().sheet()).collect();
    let stopped: u32 = sheets.iter().map(|s| s.stopped + s.turned_away).sum();
    assert!(stopped >= 20, "{stopped} of 24");
    assert_eq!(sheets.iter().map(|s| s.breaches.len()).sum::<usize>(), 0);
    assert!(sheets.iter().all(|s| s.calls.asked == 2 && s.calls.missing == 0), "{sheets:#?}");
}

#[test]
fn an_expert_does_better_than_a_novice() {
    let points = |skill: &Skill| -> f64 {
        (0..12).filter_map(|seed| played(skill, seed).fold().sheet().points).sum::<f64>() / 12.0
    };
    let (novice, expert) = (points(&Skill::NOVICE), points(&Skill::EXPERT));
    assert!(expert > novice + 10.0, "novice {novice}, expert {expert}");
}
