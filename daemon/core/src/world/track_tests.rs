use std::sync::Arc;

use glam::{DVec2, Vec3};

use super::*;
use crate::{
    model::ModelId,
    sea::BeaufortForce,
    world::{
        scenario::Scenario,
        score::boxed_model,
        waves::{Spectrum, WaveField, WaveSpec},
    },
};

#[test]
fn between_samples_boats_leave_the_cubic_by_less_than_a_centimetre() {
    let text = r#"
name = "Two in waves"
[sea]
beaufort = 0
wind_from_deg = 0
[mount]
eye_height_m = 6.0
[[boat]]
name = "weaver"
model = "boxed"
side = "hostile"
course = "weave"
range_m = 400
bearing_deg = 0
heading_deg = 90
speed_kn = 25
weave_amplitude_m = 20
weave_period_s = 15
[[boat]]
name = "runner"
model = "boxed"
side = "neutral"
course = "straight"
range_m = 300
bearing_deg = 40
heading_deg = 0
speed_kn = 30
"#;
    let scenario = Scenario::parse(text, "test").expect("it is one");
    let models: Arc<[_]> = Arc::new([boxed_model(Vec3::new(-3.5, -1.0, -0.3), Vec3::new(3.5, 1.0, 0.8))]);
    let force = BeaufortForce::new(4).expect("on the scale");
    let waves = WaveField::new(&WaveSpec { spectrum: Spectrum::of_force(force), wind_from: 0.7 }, 3);
    let start = Time::from_ns(7);
    let vessels = crate::world::fleet::Vessel::of_scenario(&scenario, &[ModelId(0); 2]);
    let mut fleet = Fleet::new(vessels, models, waves, start);
    let (mut sampler, mut samples) = (TrackSampler::new(start), Vec::new());
    let mut worst = 0.0f64;
    for frame in 1..=600i64 {
        let now = start.plus_ns(frame * NS_PER_S / 30);
        fleet.follow(now);
        let known = samples.len();
        sampler.sample(now, &fleet, &mut samples);
        for i in known.max(3)..samples.len() {
            let around: [&TrackSample; 4] = std::array::from_fn(|k| &samples[i - 3 + k]);
            assert_eq!(around[2].time_ns - around[1].time_ns, TRACK_STEP_NS);
            for boat in 0..2 {
                let places = around.map(|s| Vec3::from(s.boats[boat].expect("it swims").position).as_dvec3());
                for part in [0.0, 0.25, 0.5, 0.75] {
                    let time = Time::from_ns(around[1].time_ns).plus_secs(0.05 * part);
                    let truth = fleet.pose(boat, time).expect("there is one").position;
                    worst = worst.max(cubic(places, part).distance(truth));
                }
            }
        }
    }
    assert_eq!(samples.len(), 393, "20 s less the lag");
    assert!(worst < 0.01, "{worst} m");
    assert!(
        samples[392].boats[0]
            .is_some_and(|p| DVec2::new(p.position[0].into(), p.position[1].into()).length() > 50.0)
    );
}

#[test]
fn after_a_gap_samples_go_on_at_their_places_on_the_grid() {
    let start = Time::from_ns(1);
    let fleet = Fleet::new(Vec::new(), Arc::new([]), WaveField::FLAT, start);
    let (mut sampler, mut samples) = (TrackSampler::new(start), Vec::new());
    sampler.sample(start.plus_secs(0.55), &fleet, &mut samples);
    assert_eq!(samples.len(), 4);
    sampler.sample(start.plus_secs(1000.0), &fleet, &mut samples);
    assert_eq!(samples.len(), 4 + 100);
    assert!(samples.iter().all(|s| (s.time_ns - 1) % TRACK_STEP_NS == 0));
    sampler.finish(start.plus_secs(1000.0), &fleet, &mut samples);
    assert_eq!(samples.last().map(|s| s.time_ns), Some(start.plus_secs(1000.0).ns()));
}

/// The cubic through four places at equal times, `part` of the way from the second to the third (Catmull and Rom 1974).
fn cubic([a, b, c, d]: [DVec3; 4], part: f64) -> DVec3 {
    let (from, to) = ((c - a) / 2.0, (d - b) / 2.0);
    let (s, s2, s3) = (part, part * part, part * part * part);
    b * (2.0 * s3 - 3.0 * s2 + 1.0) + from * (s3 - 2.0 * s2 + s) + c * (3.0 * s2 - 2.0 * s3) + to * (s3 - s2)
}
