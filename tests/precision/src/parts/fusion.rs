//! Correcting the integrated orientation by what else is seen: horizon, what stands far away, a compass.

use anyhow::Result;
use bowwave_core::{
    estimate::attitude::{Attitude, HeadingSeen, Source, UpSeen, turn_between},
    event::ImuSample,
    physics::GRAVITY_M_S2,
    time::Time,
};
use glam::{DMat3, DQuat, DVec3};
use rayon::prelude::*;

use super::About;
use crate::{
    aided::{
        AidedHorizon, AidedOutcome, AidedRecording, AidedUnit, CAMERA_FROM_IMU, Estimator, Heading, SeenAids,
        bounds, outcome, product,
    },
    bench::{ExtremeResult, PartBench, Way},
    ship::{self, Ship, ShipReading, ShipSea, UnitErrors},
};

/// Description of this part.
pub const ABOUT: About = About {
    part: "fusion",
    what: "Corrects the gun's orientation by a horizon that is seen now and then, and its heading by what stands far away or by a compass; \
           says how wrong it may be.",
    truth: "the simulated ship and gun of the part before, 12 m from the ship's middle; a horizon with 0.03 deg of noise ten times a second, \
            known 45 ms late. Errors count from the second minute on; the ship is not told anything of the product",
    rivals: "the same without a horizon, and rates that are turned by a fixed share of what each horizon says",
    why: "a fixed share either forgets a bias as soon as no horizon is seen or follows the horizon's noise; the error-state filter does \
          neither, and its claim of its own error holds: with all errors drawn from what it assumes, squares over variances lie about two. \
          What a run draws once (mounting, biases, axes, refraction) is in all of its squares, so that runs count for the bounds, not squares",
};

/// Standard deviation of a horizon in the picture, radians.
const HORIZON_SIGMA: f64 = 0.03f64.to_radians();

/// Rates integrated, and a fixed share of each horizon's and heading's difference taken.
struct FixedShare {
    share: f64,
    last: Option<(Time, DVec3, DQuat)>,
}

impl Estimator for FixedShare {
    fn observe(&mut self, time: Time, sample: &ImuSample) -> Option<DQuat> {
        let found = match self.last {
            None => DQuat::from_rotation_arc(sample.accel.normalize_or(DVec3::NEG_Z), DVec3::Z),
            Some((then, rate, q)) => {
                let turn = turn_between(None, rate, sample.rate, time.secs_since(then));
                (q * DQuat::from_scaled_axis(turn)).normalize()
            }
        };
        self.last = Some((time, sample.rate, found));
        Some(found)
    }

    fn update_vertical(&mut self, seen: &UpSeen) {
        // The horizon is 45 ms old: what the unit turned by since is small beside what a share of it says.
        if let Some((_, _, q)) = &mut self.last {
            let up = *q * CAMERA_FROM_IMU.inverse() * seen.up_camera;
            *q = DQuat::from_scaled_axis(up.cross(DVec3::Z) * self.share) * *q;
        }
    }

    fn anchor(&mut self, _: f64) {}

    fn update_heading(&mut self, seen: &HeadingSeen, _: bool) {
        if let Some((_, _, q)) = &mut self.last {
            *q = DQuat::from_rotation_z(seen.off * self.share) * *q;
        }
    }

    fn covariance(&self) -> Option<DMat3> {
        None
    }
}

fn horizon(seen_s: f64) -> Option<AidedHorizon> {
    Some(AidedHorizon { seen_s, sigma: HORIZON_SIGMA })
}

type EstimatorMaker<'a> = Box<dyn Fn() -> Box<dyn Estimator> + 'a>;

/// Method, setting, on what, and the estimator at its start; the first is the product's.
fn ways<'a>(
    with: &'a AidedRecording,
    without: &'a AidedRecording,
) -> Vec<(&'static str, &'static str, &'a AidedRecording, EstimatorMaker<'a>)> {
    const OURS: &str = "VQF and error-state filter";
    const SHARE: &str = "rates and a fixed share";
    let share =
        |share: f64| -> EstimatorMaker<'a> { Box::new(move || Box::new(FixedShare { share, last: None })) };
    vec![
        (OURS, "with horizon", with, Box::new(|| Box::new(product(Source::Fused)))),
        (OURS, "without", without, Box::new(|| Box::new(product(Source::Fused)))),
        (SHARE, "0.02 of each horizon", with, share(0.02)),
        (SHARE, "0.2 of each horizon", with, share(0.2)),
        (SHARE, "all of each horizon", with, share(1.0)),
    ]
}

fn half_seen(bench: &mut PartBench, sea: ShipSea, seen_s: f64) {
    let recording = |aid| AidedRecording::new(sea, AidedUnit::Usual, (aid, Heading::Start), 300.0, 3);
    let (with, without) = (recording(horizon(seen_s)), recording(None));
    let ways =
        ways(&with, &without).into_iter().enumerate().map(|(i, (method, setting, recording, begin))| {
            let [rms, worst] = outcome(recording, &mut *begin()).up_deg;
            let work = move || {
                let mut last = DQuat::IDENTITY;
                recording.run(&mut *begin(), |_, found, _| last = found);
                last
            };
            let way =
                Way::new(method, setting, rms, recording.samples.len(), work).holds(size_of::<Attitude>());
            way.default_if(i == 0).note(format!("worst {worst:.3} deg"))
        });
    bench.scene(&format!("horizon seen for {seen_s} s, then not, {}", sea.name), "deg", 1e-3, ways.collect());
}

/// Runs of several seeds.
fn drawn(bench: &PartBench, sea: ShipSea, seen_s: f64) -> Vec<AidedOutcome> {
    let seeds = if bench.is_quick() { 4 } else { 40 };
    let run = |seed| {
        let recording =
            AidedRecording::new(sea, AidedUnit::Drawn, (horizon(seen_s), Heading::Start), 400.0, seed);
        outcome(&recording, &mut product(Source::Fused))
    };
    (0..seeds).into_par_iter().map(run).collect()
}

fn consistency(bench: &mut PartBench) {
    for (sea, seen_s) in [
        (ship::CALM, 10.0),
        (ship::SEA_4, 10.0),
        (ship::SEA_6, 10.0),
        (ship::CALM, 60.0),
        (ship::SEA_4, 60.0),
        (ship::SEA_6, 60.0),
    ] {
        let runs = drawn(bench, sea, seen_s);
        let n = runs.len() as f64;
        let over = |of: &dyn Fn(&AidedOutcome) -> f64| runs.iter().map(of).sum::<f64>() / n;
        let of_run = |run: &AidedOutcome| run.surprises.iter().sum::<f64>() / run.surprises.len() as f64;
        let mean = over(&of_run);
        let deviation = (over(&|run| (of_run(run) - mean).powi(2)) / (n - 1.0)).sqrt();
        let [low, high] = bounds(runs.len());
        let inside = |run: &AidedOutcome| {
            run.surprises.iter().filter(|s| **s < 5.99).count() as f64 / run.surprises.len() as f64
        };
        let note = format!(
            "up {:.3} deg rms, worst {:.3}; square over variance {mean:.2} +- {:.2} in the mean of {n} runs (95 % by their spread; bounds \
             where all squares of a run are one {low:.2} to {high:.2}); {:.0} % within the 95 % ellipse",
            over(&|run| run.up_deg[0].powi(2)).sqrt(),
            runs.iter().map(|run| run.up_deg[1]).fold(0.0, f64::max),
            1.96 * deviation,
            100.0 * over(&inside)
        );
        let tried = ExtremeResult::product("VQF and error-state filter", "errors drawn from its own", mean)
            .note(note);
        let case = format!("square over variance, two is right: {}, horizon {seen_s} s, then none", sea.name);
        bench.extreme(&case, "", vec![tried]);
    }
}

/// Published pulses: peak (g), length (s), whether a half sine (IEC 60068-2-27) or a sawtooth that ends at its peak (MIL-STD-810H, method 516.8).
const PULSES: [(f64, f64, bool); 4] =
    [(30.0, 0.018, true), (50.0, 0.011, true), (100.0, 0.006, true), (40.0, 0.011, false)];
/// A mount brings back in this time what a pulse moved, seconds.
const RETURN_S: f64 = 0.15;

/// What a burst of two rounds a second, the last three seconds of each thirty, adds along the barrel, m/s^2.
fn fired((peak_g, lasts_s, sine): (f64, f64, bool), time_s: f64) -> f64 {
    let since_s = time_s % 0.5;
    if time_s % 30.0 < 27.0 || since_s > lasts_s + RETURN_S {
        return 0.0;
    }
    let peak = peak_g * GRAVITY_M_S2;
    let mean = if sine { 2.0 / std::f64::consts::PI } else { 0.5 };
    match since_s < lasts_s {
        true if sine => -peak * (std::f64::consts::PI * since_s / lasts_s).sin(),
        true => -peak * since_s / lasts_s,
        false => peak * mean * lasts_s / RETURN_S,
    }
}

/// Sea 0 to 6 and a gun that fires, with errors drawn from what the filter assumes: how many runs know their error.
fn fires(bench: &mut PartBench) {
    let runs = if bench.is_quick() { 14 } else { 200 };
    for (name, aid) in [("no horizon", None), ("horizon for 10 s of 20", horizon(10.0))] {
        let run = |seed: u64| {
            let sea = ship::sea_state((seed % 7) as usize);
            let mut recording =
                AidedRecording::new(sea, AidedUnit::Drawn, (aid, Heading::Start), 240.0, seed);
            let pulse = PULSES[(seed / 7 % 4) as usize];
            recording.samples.iter_mut().for_each(|s| s.accel.x += fired(pulse, s.time_s));
            outcome(&recording, &mut product(Source::Fused))
        };
        let all: Vec<AidedOutcome> = (0..runs).into_par_iter().map(run).collect();
        let mean = |run: &AidedOutcome| run.surprises.iter().sum::<f64>() / run.surprises.len() as f64;
        // Chi squared at 2.5 and at 97.5 % with two degrees of freedom: what is drawn once in a run is in all its squares.
        let within = |bounds: std::ops::Range<f64>| {
            100.0 * all.iter().filter(|run| bounds.contains(&mean(run))).count() as f64 / all.len() as f64
        };
        let rms = (all.iter().map(|run| run.up_deg[0].powi(2)).sum::<f64>() / all.len() as f64).sqrt();
        let note = format!(
            "{} runs: square over variance within 0.05 to 7.38 in {:.1} %, above in {:.1} %; mean {:.2}; worst {:.3} deg",
            all.len(),
            within(0.0506..7.378),
            within(7.378..f64::INFINITY),
            all.iter().map(mean).sum::<f64>() / all.len() as f64,
            all.iter().map(|run| run.up_deg[1]).fold(0.0, f64::max)
        );
        let tried =
            ExtremeResult::product("VQF and error-state filter", "errors drawn from its own", rms).note(note);
        bench.extreme(&format!("sea 0 to 6, the gun fires, {name}"), "deg", vec![tried]);
    }
}

fn headings(bench: &mut PartBench) {
    let noise = 0.05f64.to_radians();
    for (case, heading) in [
        ("heading, nothing sees it", Heading::Start),
        ("heading, a coast is seen that stands still", Heading::Anchored(noise, 1e-6)),
        ("heading, a coast is seen that turns by 0.02 deg/s", Heading::Anchored(noise, 0.02f64.to_radians())),
        ("heading, a compass with 0.3 deg of noise", Heading::Compass(0.3f64.to_radians())),
    ] {
        let recording =
            AidedRecording::new(ship::SEA_4, AidedUnit::Usual, (horizon(10.0), heading), 400.0, 5);
        let tried = [("VQF and error-state filter", true, 0.0), ("rates and a fixed share", false, 0.1)].map(
            |(method, ours, share)| {
                let mut estimator: Box<dyn Estimator> = if ours {
                    Box::new(product(Source::Fused))
                } else {
                    Box::new(FixedShare { share, last: None })
                };
                let [rms, worst] = outcome(&recording, &mut *estimator).heading_deg;
                let setting = if ours { "for a gun" } else { "a tenth of each" };
                ExtremeResult { default: ours, ..ExtremeResult::rival(method, setting, rms) }
                    .note(format!("worst {worst:.3} deg in 400 s"))
            },
        );
        bench.extreme(case, "deg", tried.into());
    }
}

/// A damage to a recording's samples: its name and the code that does it.
type SampleDamage = (&'static str, fn(&mut Vec<ShipReading>));

const DAMAGES: [SampleDamage; 10] = [
    ("nothing wrong", |_| ()),
    ("10 ms missing once a second", |all| all.retain(|s| s.time_s % 1.0 > 0.010)),
    ("0.8 s missing once in 20 s", |all| all.retain(|s| s.time_s % 20.0 > 0.8)),
    ("5 s missing once in 60 s", |all| all.retain(|s| s.time_s % 60.0 > 5.0)),
    ("every tenth comes twice", |all| {
        *all = all.iter().enumerate().flat_map(|(i, s)| vec![*s; if i % 10 == 0 { 2 } else { 1 }]).collect();
    }),
    ("every tenth comes after the next", |all| {
        all.chunks_exact_mut(10).for_each(|ten| ten.swap(8, 9));
    }),
    ("recoil, 30 g for 5 ms, bursts of ten rounds a second", |all| recoil(all)),
    ("the same recoil, the accelerometer clips at 2 g", |all| {
        recoil(all);
        let range = DVec3::splat(2.0 * GRAVITY_M_S2);
        all.iter_mut().for_each(|s| s.accel = s.accel.clamp(-range, range));
    }),
    ("gyro clips at 40 deg/s, slews are 60", |all| {
        let range = 40f64.to_radians();
        all.iter_mut().for_each(|s| s.rate = s.rate.clamp(DVec3::splat(-range), DVec3::splat(range)));
    }),
    ("the ship turns for 40 s at 10 knots by 1 deg/s", |all| {
        // Towards the middle of the turn, begun and ended within five seconds; her heading is left as it was.
        for s in all.iter_mut() {
            let eased = |from_s: f64| ((s.time_s - from_s) / 5.0).clamp(0.0, 1.0);
            let inward = DVec3::X * (0.09 * (eased(150.0) - eased(190.0)));
            s.accel += s.truth.world_from_imu.inverse() * inward;
        }
    }),
];

fn recoil(all: &mut [ShipReading]) {
    for s in all.iter_mut().filter(|s| s.time_s % 30.0 < 3.0 && s.time_s % 0.1 < 0.005) {
        s.accel += DVec3::new(-300.0, 0.0, 40.0);
    }
}

fn damaged(bench: &mut PartBench) {
    for (name, damage) in DAMAGES {
        for (aid, aids) in [("no horizon", None), ("horizon for 10 s of 20", horizon(10.0))] {
            let mut recording =
                AidedRecording::new(ship::SEA_4, AidedUnit::Usual, (aids, Heading::Start), 300.0, 9);
            damage(&mut recording.samples);
            let tried = [("VQF and error-state filter", true), ("rates and a fixed share", false)].map(
                |(method, ours)| {
                    let mut estimator: Box<dyn Estimator> = if ours {
                        Box::new(product(Source::Fused))
                    } else {
                        Box::new(FixedShare { share: 0.02, last: None })
                    };
                    let out = outcome(&recording, &mut *estimator);
                    ExtremeResult { default: ours, ..ExtremeResult::rival(method, aid, out.up_deg[1]) }
                        .note(format!("up {:.3} deg rms", out.up_deg[0]))
                },
            );
            bench.extreme(&format!("sea 4, {name}"), "deg", tried.into());
        }
    }
}

/// Latitude of 50 degrees: the Earth's turn in axes east, north, up, rad/s.
const EARTH: DVec3 = DVec3::new(0.0, 4.687e-5, 5.586e-5);

/// A day at sea with the Earth's turn, a horizon half of the time and a compass: nothing may grow.
fn day(bench: &mut PartBench) {
    let hours: f64 = if bench.is_quick() { 1.0 } else { 24.0 };
    let errors = UnitErrors { rate_hz: 50.0, earth: EARTH, ..UnitErrors::usual() };
    let ship = Ship::new(ship::SEA_4, true, 3);
    let aids = SeenAids::usual(horizon(300.0), Heading::Compass(0.3f64.to_radians()));
    let seconds = hours * 3600.0;
    let part_s = (seconds / 4.0).min(3600.0);
    let mut estimator = product(Source::Fused);
    // Squares of up's error in the first and the last part after a minute; worst; norm; least variance over the largest.
    let (mut first, mut last) = ([0.0; 2], [0.0; 2]);
    let (mut worst, mut heading, mut norm, mut thin) = (0.0f64, 0.0f64, 0.0f64, f64::INFINITY);
    let mut heap = [0usize; 2];
    aids.run(ship::stream(&ship, &errors, seconds, 5), &mut estimator, |s, found, estimator| {
        norm = norm.max((found.length() - 1.0).abs());
        if s.time_s < 60.0 {
            return;
        }
        let tilt = ship::inclination_error(s.truth.world_from_imu, found).to_degrees();
        worst = worst.max(tilt);
        heading = heading.max(ship::heading_error(s.truth.world_from_imu, found).abs().to_degrees());
        if s.time_s < part_s {
            first = [first[0] + tilt * tilt, first[1] + 1.0];
            heap[0] = heap[0].max(crate::HEAP.current_usage());
        } else if s.time_s > seconds - part_s {
            last = [last[0] + tilt * tilt, last[1] + 1.0];
            heap[1] = heap[1].max(crate::HEAP.current_usage());
        }
        if let Some(c) = estimator.covariance() {
            thin = thin.min(c.determinant());
        }
    });
    let rms = |[sum, count]: [f64; 2]| (sum / count).sqrt();
    let note = format!(
        "up {:.3} deg rms at first, {:.3} at last; heading worst {heading:.2} deg; norm within {norm:.0e} of 1; least determinant of the \
         covariance {thin:.0e} rad^6; heap {} bytes more at last than at first",
        rms(first),
        rms(last),
        heap[1].saturating_sub(heap[0])
    );
    let tried =
        ExtremeResult::product("VQF and error-state filter", "horizon half of the time, compass", worst)
            .note(note);
    bench.extreme(&format!("{hours} h in sea 4 with the Earth's turn"), "deg", vec![tried]);
}

/// Measures the scenes and extreme cases.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    half_seen(bench, ship::SEA_4, 10.0);
    half_seen(bench, ship::SEA_6, 10.0);
    half_seen(bench, ship::SEA_6, 60.0);
    consistency(bench);
    fires(bench);
    headings(bench);
    damaged(bench);
    day(bench);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_horizon_half_of_the_time_is_enough_and_the_filter_knows_its_error() {
        for (sea, seed) in [(ship::CALM, 1), (ship::SEA_4, 2), (ship::SEA_6, 3)] {
            let recording =
                AidedRecording::new(sea, AidedUnit::Usual, (horizon(20.0), Heading::Start), 300.0, seed);
            let run = outcome(&recording, &mut product(Source::Fused));
            assert!(run.up_deg[0] < 0.04 && run.up_deg[1] < 0.15, "{}: {:?}", sea.name, run.up_deg);
            let mean = run.surprises.iter().sum::<f64>() / run.surprises.len() as f64;
            assert!((0.1..4.0).contains(&mean), "{}: {mean}", sea.name);
        }
    }

    #[test]
    fn a_coast_holds_the_heading_that_a_bias_would_turn() {
        let run = |heading| {
            let recording =
                AidedRecording::new(ship::SEA_4, AidedUnit::Usual, (horizon(10.0), heading), 400.0, 5);
            outcome(&recording, &mut product(Source::Fused)).heading_deg[0]
        };
        let (free, held) = (run(Heading::Start), run(Heading::Anchored(5e-4, 1e-6)));
        assert!(free > 0.5 && held < 0.2 * free, "{free} {held}");
    }
}
