//! Correcting an orientation that the unit finds by itself, by horizon and by what stands far away.

use anyhow::Result;
use bowwave_core::{
    estimate::attitude::{Attitude, HeadingSeen, Source, UpSeen},
    event::ImuSample,
    time::Time,
};
use glam::{DMat3, DQuat, DVec3};
use rayon::prelude::*;
use vqf_rs::{Params, VQF};

use super::{About, rms};
use crate::{
    aided::{
        AidedHorizon, AidedOutcome, AidedRecording, AidedUnit, CAMERA_FROM_IMU, Estimator, Heading, outcome,
        product,
    },
    bench::{ExtremeResult, PartBench, Way},
    ship::{self, ShipSea},
};

/// Description of this part.
pub const ABOUT: About = About {
    part: "own",
    what: "Corrects the orientation that a unit finds by itself, whose ways it does not tell, by a horizon that is seen now and then and by \
           what stands far away.",
    truth: "the simulated ship and gun of the parts before. The unit is another filter, told nothing of the product: VQF as its authors set it, \
            which takes a creeping gun's turn for bias, and VQF for a gun on a ship, as a good unit",
    rivals: "the unit as it is, a fixed share of what each horizon and heading says, and leaving the unit's orientation for its rates \
             (the part fusion)",
    why: "errors go to and fro about a mean within seconds, by as much as horizons have shown, and the mean creeps: where a horizon is seen it \
          is followed as fast as the unit errs, and a good unit is not made worse by the horizon's noise",
};

/// Standard deviations of a horizon and of a heading in the picture, radians.
const SEEN_SIGMA: f64 = 0.03f64.to_radians();
/// How long it is seen, and then not, seconds.
const SEEN_S: f64 = 10.0;
const SECONDS: f64 = 300.0;

/// A unit: its name and how its filter is set.
type OwnRecording = (&'static str, fn() -> Params);

const UNITS: [OwnRecording; 2] = [
    ("good unit", || Params { rest_bias_est_enabled: false, tau_acc: 10.0, ..Params::default() }),
    ("unit that learns wrong biases", Params::default),
];

/// A recording, and what the unit made of it by itself.
struct OwnTold {
    recording: AidedRecording,
    told: Vec<DQuat>,
}

impl OwnTold {
    fn new(sea: ShipSea, params: Params, seed: u64) -> Self {
        let aids = (
            Some(AidedHorizon { seen_s: SEEN_S, sigma: SEEN_SIGMA }),
            Heading::Anchored(SEEN_SIGMA, 0.001f64.to_radians()),
        );
        let recording = AidedRecording::new(sea, AidedUnit::Usual, aids, SECONDS, seed);
        let period_s = recording.samples.get(1).map_or(0.005, |s| s.time_s);
        let mut filter = VQF::new(period_s, None, None, Some(params));
        let tell = |s: &ship::ShipReading| {
            filter.update(s.rate.to_array(), s.accel.to_array(), None);
            let q = filter.quat_6d();
            DQuat::from_xyzw(q.1, q.2, q.3, q.0)
        };
        let told = recording.samples.iter().map(tell).collect();
        Self { recording, told }
    }

    fn outcome(&self, corrected: &dyn Fn() -> Box<dyn Estimator>) -> AidedOutcome {
        outcome(&self.recording, &mut Unasked { told: self.told.iter(), estimator: corrected() })
    }
}

/// Gives an estimator what the unit told with each sample.
struct Unasked<'a> {
    told: std::slice::Iter<'a, DQuat>,
    estimator: Box<dyn Estimator>,
}

impl Estimator for Unasked<'_> {
    fn observe(&mut self, time: Time, sample: &ImuSample) -> Option<DQuat> {
        let world_from_imu = self.told.next().copied();
        self.estimator.observe(time, &ImuSample { world_from_imu, ..*sample })
    }

    fn update_vertical(&mut self, seen: &UpSeen) {
        self.estimator.update_vertical(seen);
    }

    fn anchor(&mut self, drift: f64) {
        self.estimator.anchor(drift);
    }

    fn update_heading(&mut self, seen: &HeadingSeen, anchored: bool) {
        self.estimator.update_heading(seen, anchored);
    }

    fn covariance(&self) -> Option<DMat3> {
        self.estimator.covariance()
    }
}

/// The unit as it is, turned by a fixed share of what each horizon and heading differs by.
struct OwnFixedShare {
    share: f64,
    turn: DQuat,
    found: DQuat,
}

impl OwnFixedShare {
    const fn new(share: f64) -> Self {
        Self { share, turn: DQuat::IDENTITY, found: DQuat::IDENTITY }
    }
}

impl Estimator for OwnFixedShare {
    fn observe(&mut self, _: Time, sample: &ImuSample) -> Option<DQuat> {
        self.found = (self.turn * sample.world_from_imu?).normalize();
        Some(self.found)
    }

    fn update_vertical(&mut self, seen: &UpSeen) {
        // The horizon is 45 ms old: what the unit turned by since is small beside what a share of it says.
        let up = self.found * CAMERA_FROM_IMU.inverse() * seen.up_camera;
        self.turn = DQuat::from_scaled_axis(up.cross(DVec3::Z) * self.share) * self.turn;
    }

    fn anchor(&mut self, _: f64) {}

    fn update_heading(&mut self, seen: &HeadingSeen, _: bool) {
        self.turn = DQuat::from_rotation_z(seen.off * self.share) * self.turn;
    }

    fn covariance(&self) -> Option<DMat3> {
        None
    }
}

type OwnBegin = (&'static str, &'static str, fn() -> Box<dyn Estimator>);

/// Method, setting and the estimator at its start; the first is the product's.
const WAYS: [OwnBegin; 5] = [
    ("the unit's, and error states", "for a gun", || Box::new(product(Source::Auto))),
    ("the unit's as it is", "", || Box::new(OwnFixedShare::new(0.0))),
    ("the unit's, and a fixed share", "0.05 of each", || Box::new(OwnFixedShare::new(0.05))),
    ("the unit's, and a fixed share", "0.3 of each", || Box::new(OwnFixedShare::new(0.3))),
    ("its rates, VQF and error-state filter", "fusion", || Box::new(product(Source::Fused))),
];

/// Measures the scenes and extreme cases.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    for sea in [ship::CALM, ship::SEA_4, ship::SEA_6] {
        for (unit, params) in UNITS {
            let told = OwnTold::new(sea, params(), 3);
            let ways = WAYS.into_iter().enumerate().map(|(i, (method, setting, begin))| {
                let out = told.outcome(&|| begin());
                let told = &told;
                let work = move || {
                    let mut unasked = Unasked { told: told.told.iter(), estimator: begin() };
                    let mut last = DQuat::IDENTITY;
                    told.recording.run(&mut unasked, |_, found, _| last = found);
                    last
                };
                let [rms, worst] = out.up_deg;
                let note = format!(
                    "worst {worst:.3} deg; heading {:.3} deg rms, worst {:.3}",
                    out.heading_deg[0], out.heading_deg[1]
                );
                Way::new(method, setting, rms, told.told.len(), work)
                    .holds(size_of::<Attitude>())
                    .default_if(i == 0)
                    .note(note)
            });
            let scene = format!("{unit}, horizon for {SEEN_S} s of {}, {}", 2.0 * SEEN_S, sea.name);
            bench.scene(&scene, "deg", 1e-3, ways.collect());
        }
    }
    consistency(bench);
    Ok(())
}

fn consistency(bench: &mut PartBench) {
    let seeds = if bench.is_quick() { 4 } else { 24 };
    for (unit, params) in UNITS {
        for sea in [ship::CALM, ship::SEA_4, ship::SEA_6] {
            let run = |seed| OwnTold::new(sea, params(), seed).outcome(&|| Box::new(product(Source::Auto)));
            let runs: Vec<AidedOutcome> = (0..seeds).into_par_iter().map(run).collect();
            let squares: Vec<f64> = runs.iter().flat_map(|run| run.surprises.iter().copied()).collect();
            let count = squares.len() as f64;
            let inside = squares.iter().filter(|s| **s < 5.99).count() as f64 / count;
            let note = format!(
                "up {:.3} deg rms, worst {:.3}; {:.0} % within the 95 % ellipse; {} runs",
                rms(runs.iter().map(|run| run.up_deg[0])),
                runs.iter().map(|run| run.up_deg[1]).fold(0.0, f64::max),
                100.0 * inside,
                runs.len()
            );
            let (method, setting, _) = WAYS[0];
            let tried =
                ExtremeResult::product(method, setting, squares.iter().sum::<f64>() / count).note(note);
            bench.extreme(
                &format!("square over variance, two is right: {unit}, {}", sea.name),
                "",
                vec![tried],
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn horizons_make_a_units_own_inclination_better() {
        for ((unit, params), most) in UNITS.into_iter().zip([0.12, 1.0]) {
            let told = OwnTold::new(ship::SEA_4, params(), 4);
            let [[ours, worst], [alone, _]] = [0, 1].map(|i| told.outcome(&|| WAYS[i].2()).up_deg);
            assert!(ours < most && ours < 0.6 * alone, "{unit}: {ours} (worst {worst}), alone {alone} deg");
        }
    }
}
