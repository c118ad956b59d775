//! Runs the estimator over clips and gathers its errors.

use std::f64::consts::{PI, TAU};

use bowwave_core::{
    estimate::sea::{SeaEstimate, SeaFrame, SeaMeter, Unknown},
    geometry::{Lens, look},
    sea::WmoSeaState,
    time::Time,
};
use glam::{DVec2, DVec3};

use super::{
    clips,
    gauges::Gauged,
    video::{SeaClip, SeaVideo},
};
use crate::{bench::thread_ns, front::quantile, table};

/// Time between two pictures, nanoseconds: 30 Hz.
const FRAME_NS: i64 = 33_333_333;
/// Errors within which an answer counts as right: height and period as shares, direction in radians.
const TARGET: (f64, f64, f64) = (0.15, 0.05, 15.0 * PI / 180.0);

/// The estimator's answer about one clip, and the truth.
#[derive(Clone, Debug)]
pub struct ClipOutcome {
    /// The clip's class.
    pub class: &'static str,
    /// Height of the eye, metres.
    pub eye_m: f64,
    /// Significant height of the spectrum, metres.
    pub height_m: f64,
    /// Four standard deviations of the water that was in view, metres.
    pub seen_m: f64,
    /// Peak period, seconds.
    pub period_s: f64,
    /// Direction from which the waves come, radians.
    pub from_rad: f64,
    /// Peak and direction of the water that was in view, from buoys on it.
    pub gauged: Option<Gauged>,
    /// The answer.
    pub answer: Result<SeaEstimate, Unknown>,
}

impl ClipOutcome {
    /// Relative error of the height against the water in view.
    pub fn height_error(&self) -> Option<f64> {
        self.answer.ok().map(|e| e.significant_height_m.value / self.seen_m - 1.0)
    }

    /// Relative error of the height against the spectrum's.
    pub fn spectrum_error(&self) -> Option<f64> {
        self.answer.ok().map(|e| e.significant_height_m.value / self.height_m - 1.0)
    }

    /// Relative error of the peak period.
    pub fn period_error(&self) -> Option<f64> {
        self.answer.ok().map(|e| e.peak_period_s.value / self.period_s - 1.0)
    }

    /// Error of the direction, radians.
    pub fn direction_error(&self) -> Option<f64> {
        let error = |e: SeaEstimate| (e.direction_from_rad.value - self.from_rad + PI).rem_euclid(TAU) - PI;
        self.answer.ok().map(error)
    }

    /// Whether the state is right: that of the water in view.
    pub fn state_right(&self) -> Option<bool> {
        self.answer.ok().map(|e| e.state == WmoSeaState::of_wave_height(self.seen_m))
    }
}

/// Shows simulated video to the estimator of the sea's state and lists its errors.
#[derive(Debug, clap::Args)]
pub struct SeaVideoStudy {
    /// First clip of the main series; 0 to 39 served to set the estimator's constants
    #[arg(long, default_value_t = 40)]
    first: u64,
    /// Clips of the main series
    #[arg(long, default_value_t = 40)]
    clips: u64,
    /// Clips of the hard cases
    #[arg(long, default_value_t = 12)]
    hard: u64,
    /// Seconds of each clip
    #[arg(long, default_value_t = 60.0)]
    seconds: f64,
    /// Only the run time
    #[arg(long)]
    cost: bool,
}

impl SeaVideoStudy {
    /// Prints a line for each clip, the tables, and the time of a picture.
    pub fn run(&self) -> anyhow::Result<()> {
        if !self.cost {
            let tell = |_: usize, outcome: &ClipOutcome| println!("{}", line(outcome));
            let clips = (self.first..self.first + self.clips).map(clips::main_clip).collect();
            let main = run_all(clips, self.seconds, tell);
            let hard = run_all((0..self.hard).map(clips::hard_clip).collect(), self.seconds, tell);
            println!("\n{}\n{}", table(&main), table(&hard));
        }
        let cost = cost();
        println!(
            "a picture costs {:.0} ns in the mean, {:.0} ns at the 99th percentile, {:.0} ns at worst; {} bytes",
            cost.mean_ns, cost.p99_ns, cost.worst_ns, cost.memory_bytes
        );
        Ok(())
    }
}

/// Shows `seconds` of a clip to the estimator. The last analysis must have begun when they are over; it is given five more.
pub fn run(clip: SeaClip, seconds: f64) -> ClipOutcome {
    let mut video = SeaVideo::new(clip);
    let mut meter = SeaMeter::new();
    for i in 0..((seconds + 5.0) * 30.0) as i64 {
        let time = Time::from_ns(i * FRAME_NS);
        let t = time.ns() as f64 * 1e-9;
        if meter.wants(time) {
            video.advance(t);
        }
        let (camera, lens) = (video.told_pose(t), video.clip.lens);
        let seen = &video;
        meter.observe(&SeaFrame { time, camera, lens: &lens, luminance: &|p| seen.luminance(p) });
    }
    let main = video.clip.systems[0];
    ClipOutcome {
        class: video.clip.class,
        eye_m: video.clip.eye_m,
        height_m: video.significant_m(),
        seen_m: video.seen_m(),
        period_s: main.peak_s,
        from_rad: main.from_rad,
        gauged: video.gauged(),
        answer: meter.estimate(),
    }
}

/// Runs clips on two threads, in order.
pub fn run_all(
    clips: Vec<SeaClip>,
    seconds: f64,
    mut tell: impl FnMut(usize, &ClipOutcome),
) -> Vec<ClipOutcome> {
    let mut outcomes = Vec::new();
    for pair in clips.chunks(2) {
        let done: Vec<ClipOutcome> = std::thread::scope(|scope| {
            let handles: Vec<_> = pair.iter().map(|c| scope.spawn(|| run(c.clone(), seconds))).collect();
            handles.into_iter().filter_map(|h| h.join().ok()).collect()
        });
        for outcome in done {
            tell(outcomes.len(), &outcome);
            outcomes.push(outcome);
        }
    }
    outcomes
}

/// One line about a clip.
pub fn line(outcome: &ClipOutcome) -> String {
    let (gauged_s, gauged_from) = outcome.gauged.map_or((f64::NAN, f64::NAN), |g| (g.period_s, g.from_rad));
    let head = format!(
        "{:16} eye {:4.1} m  H {:4.2} (in view {:4.2}) T {:5.2} ({:5.2}) from {:3.0} ({:3.0})",
        outcome.class,
        outcome.eye_m,
        outcome.height_m,
        outcome.seen_m,
        outcome.period_s,
        gauged_s,
        outcome.from_rad.to_degrees().rem_euclid(360.0),
        gauged_from.to_degrees().rem_euclid(360.0)
    );
    match &outcome.answer {
        Ok(e) => format!(
            "{head} | H {:4.2} +- {:4.2}  T {:5.2} +- {:4.2}  from {:3.0} +- {:3.0}  state {} (p {:.2})  wind {:.1} m/s",
            e.significant_height_m.value,
            e.significant_height_m.sigma,
            e.peak_period_s.value,
            e.peak_period_s.sigma,
            e.direction_from_rad.value.to_degrees(),
            e.direction_from_rad.sigma.to_degrees(),
            e.state.get(),
            e.state_probability,
            e.wind_m_s.value,
        ),
        Err(why) => format!("{head} | {why}"),
    }
}

/// Median, 95th percentile and share within a limit of absolute values.
fn statistics(values: impl Iterator<Item = f64>, limit: f64) -> (f64, f64, f64) {
    let values: Vec<f64> = values.map(f64::abs).collect();
    let within = values.iter().filter(|v| **v <= limit).count() as f64 / values.len() as f64;
    (quantile(&values, 0.5), quantile(&values, 0.95), within)
}

/// One row of [`table()`].
fn table_row(name: &str, some: &[&ClipOutcome]) -> Vec<String> {
    let answered = some.iter().filter(|o| o.answer.is_ok()).count();
    let right = some.iter().filter(|o| o.state_right() == Some(true)).count();
    let cell = |error: fn(&ClipOutcome) -> Option<f64>, limit: f64, unit: f64| {
        let (median, p95, share) = statistics(some.iter().filter_map(|o| error(o)), limit);
        if median.is_nan() {
            return String::from("-");
        }
        format!("{:.1} / {:.1} / {:.0} %", median * unit, p95 * unit, share * 100.0)
    };
    vec![
        name.to_owned(),
        format!("{answered} of {}", some.len()),
        format!("{right} of {answered}"),
        cell(ClipOutcome::height_error, TARGET.0, 100.0),
        cell(ClipOutcome::spectrum_error, TARGET.0, 100.0),
        cell(ClipOutcome::period_error, TARGET.1, 100.0),
        cell(ClipOutcome::direction_error, TARGET.2, 1.0_f64.to_degrees()),
    ]
}

/// Table of errors by class: median / 95th percentile / share within the target, of the clips that were answered.
pub fn table(outcomes: &[ClipOutcome]) -> String {
    let mut classes: Vec<&str> = Vec::new();
    for outcome in outcomes {
        if !classes.contains(&outcome.class) {
            classes.push(outcome.class);
        }
    }
    let of =
        |wanted: &dyn Fn(&ClipOutcome) -> bool| outcomes.iter().filter(|o| wanted(o)).collect::<Vec<_>>();
    let low = |o: &ClipOutcome| o.seen_m > 0.25 * o.eye_m;
    let mut rows: Vec<Vec<String>> =
        classes.into_iter().map(|class| table_row(class, &of(&|o| o.class == class))).collect();
    rows.push(table_row("all", &of(&|_| true)));
    rows.push(table_row("of these, waves above a quarter of the eye", &of(&low)));
    rows.push(table_row("of these, waves below it", &of(&|o| !low(o))));
    let titles = [
        "clips",
        "answered",
        "state right",
        "height in view",
        "height of the spectrum",
        "period",
        "direction, deg",
    ];
    table::markdown(&titles, rows)
}

/// PictureCost of one picture to the estimator.
#[derive(Clone, Copy, Debug)]
pub struct PictureCost {
    /// Mean over all pictures, nanoseconds.
    pub mean_ns: f64,
    /// 99th percentile, nanoseconds.
    pub p99_ns: f64,
    /// The dearest picture, nanoseconds.
    pub worst_ns: f64,
    /// Memory held, bytes.
    pub memory_bytes: usize,
}

/// Times the estimator on a picture in memory, 1280 x 720, over the time in which its longest window fills.
pub fn cost() -> PictureCost {
    let lens = Lens::pinhole(1280, 720, PI / 3.0);
    let picture: Vec<f32> = (0..1280 * 720).map(|i| 0.2 + 0.4 * (1.0 - (i / 1280) as f32 / 720.0)).collect();
    let mut meter = SeaMeter::new();
    let (mut times, mut memory_bytes) = (Vec::new(), 0);
    for i in 0..140 * 30 {
        let time = Time::from_ns(i * FRAME_NS);
        let t = time.ns() as f64 * 1e-9;
        let camera = bowwave_core::geometry::CameraPose {
            world_from_camera: look(0.002 * t.sin(), -0.12 + 0.002 * (1.7 * t).sin(), 0.0),
            position: DVec3::Z * 8.0,
        };
        let look_up = |p: DVec2| {
            let (x, y) = (p.x as usize, p.y as usize);
            let wave = 1.0 + 0.05 * (0.02 * p.y + 1.3 * t).sin() as f32;
            (x < 1280 && y < 720).then(|| picture[y * 1280 + x] * wave)
        };
        let begin = thread_ns();
        meter.observe(&SeaFrame { time, camera, lens: &lens, luminance: &look_up });
        times.push(thread_ns() - begin);
        memory_bytes = memory_bytes.max(meter.memory_bytes());
    }
    let mean_ns = times.iter().sum::<f64>() / times.len() as f64;
    PictureCost { mean_ns, p99_ns: quantile(&times, 0.99), worst_ns: quantile(&times, 1.0), memory_bytes }
}
