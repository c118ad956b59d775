//! What is measured besides the faults.

use std::{fmt::Write, fs, path::Path, thread, time::Duration};

use anyhow::{Context, Result, ensure};
use bowwave_hil::protocol::AgentCommand;
use glam::{DQuat, DVec2, DVec3};
use hw_sim::make::Motion;
use serde_json::Value;

use super::bench::{Configured, HilBench, PICTURE, recipe};

/// Upper share of the picture that is hidden: sky and horizon stay within it while the tape plays, and more a calibration may not hide.
const HIDDEN_SHARE: f64 = 0.78;

/// A line of the list of figures.
pub struct Figure {
    /// What.
    pub what: String,
    /// How much, with its unit.
    pub value: String,
    /// Target, where there is one.
    pub target: String,
    /// Whether it was met; `None` where there is none.
    pub met: Option<bool>,
}

impl Figure {
    /// Something that is only reported.
    pub fn told(what: &str, value: String) -> Self {
        Self { what: what.into(), value, target: String::new(), met: None }
    }

    /// Something with a target.
    pub fn judged(what: &str, value: String, target: &str, met: bool) -> Self {
        Self { what: what.into(), value, target: target.into(), met: Some(met) }
    }
}

/// Value of a sorted list below which that share lies.
pub fn percentile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    values.get((last as f64 * share).round() as usize).copied().unwrap_or(f64::NAN)
}

/// How much of the machine's two cores the trainer uses over some seconds, by thread, and its memory.
pub fn usage(bench: &mut HilBench, what: &str) -> Result<Vec<Figure>> {
    let before = bench.machine.guest.call(AgentCommand::Usage)?;
    thread::sleep(Duration::from_secs(6));
    let after = bench.machine.guest.call(AgentCommand::Usage)?;
    let ns = |v: &Value| v["now_ns"].as_i64().unwrap_or(0);
    let seconds = (ns(&after) - ns(&before)) as f64 * 1e-9;
    let threads = |v: &Value| v["threads"].as_object().cloned().unwrap_or_default();
    let earlier = threads(&before);
    let mut shares: Vec<(String, f64)> = threads(&after)
        .iter()
        .map(|(name, ticks)| {
            let was = earlier.get(name).and_then(Value::as_u64).unwrap_or(0);
            (name.clone(), (ticks.as_u64().unwrap_or(0).saturating_sub(was)) as f64 / seconds)
        })
        .collect();
    shares.sort_by(|a, b| b.1.total_cmp(&a.1));
    let sum: f64 = shares.iter().map(|(_, s)| s).sum();
    let largest: Vec<String> =
        shares.iter().filter(|(_, s)| *s >= 0.5).take(8).map(|(n, s)| format!("{n} {s:.0} %")).collect();
    let memory = after["rss_kib"].as_f64().unwrap_or(0.0) / 1024.0;
    Ok(vec![
        Figure::told(
            &format!("processor use, {what}"),
            format!("{sum:.0} % of one core of the machine ({})", largest.join(", ")),
        ),
        Figure::told(&format!("memory (RSS), {what}"), format!("{memory:.0} MiB")),
    ])
}

/// Fires over a whole round of the tape while nothing that the camera sees can correct the unit: its calibration hides the sky and the
/// horizon as the own ship. The machine's times before and after.
pub fn fire_unaided(bench: &mut HilBench) -> Result<(i64, i64)> {
    let mut file = hw_sim::make::calibration(&recipe());
    let (width, height) = PICTURE;
    let [right, bottom] = [f64::from(width), (f64::from(height) * HIDDEN_SHARE).floor()];
    file.hidden =
        vec![vec![DVec2::ZERO, DVec2::new(right, 0.0), DVec2::new(right, bottom), DVec2::new(0.0, bottom)]];
    let path = "/run/hil/etc/unaided.toml".to_owned();
    bench.machine.guest.call(AgentCommand::Write { path, text: bowwave_calibration::to_toml(&file) })?;
    bench.configure(&Configured { calibration: "unaided.toml".into(), ..Configured::default() })?;
    bench.service("reload")?;
    thread::sleep(Duration::from_secs(2));
    bench.scoring(bench.scaled(2.0))?;
    let from = bench.machine.guest.now_ns();
    while bench.machine.guest.now_ns() - from < bench.tape.period_ns {
        bench.shoot(1000)?;
        thread::sleep(Duration::from_secs(1));
    }
    let to = bench.machine.guest.now_ns();
    bench.configure(&Configured::default())?;
    bench.service("reload")?;
    thread::sleep(Duration::from_secs(2));
    bench.ready(bench.scaled(2.0))?;
    Ok((from, to))
}

/// Shots against what the bench did: kernel's time of the edge, order, pose at the time of firing.
///
/// The unit itself errs by half a milliradian, slowly, and the tape's gun moves by a tenth of a radian a second: against the
/// truth that is milliseconds. So does what the camera sees: the machine's small pictures tell the heading to half a milliradian, otherwise at
/// each place and some tenths of a second later. What the trainer can be early or late by is held against what the unit said while nothing
/// corrected it (`unaided`, the machine's times); how far all is from the truth is told as an angle.
pub fn shots(bench: &mut HilBench, line_delay_ms: f64, unaided: (i64, i64)) -> Result<Vec<Figure>> {
    let rounds = bench.rounds()?;
    let origin = bench.machine.guest.origin_ns().context("nothing was played")?;
    let fired = |r: &Value| r["fired_ns"].as_i64().unwrap_or(i64::MIN);
    let mut figures = Vec::new();
    figures.extend(edges(bench, &rounds));
    figures.push(order(bench, &rounds));
    let unit = UnitTrack::of(bench);
    let scored: Vec<&Value> =
        rounds.iter().filter(|r| r["outcome"] != "not_scored" && fired(r) > origin).collect();
    ensure!(scored.len() >= 20, "only {} scored rounds", scored.len());
    let aims: Vec<BoreAim> = scored
        .iter()
        .filter_map(|round| {
            let numbers: Vec<f64> =
                round["bore"].as_array().into_iter().flatten().filter_map(Value::as_f64).collect();
            let [x, y, z] = numbers[..] else { return None };
            let bore = DVec3::new(x, y, z);
            let tape_ns = (fired(round) - origin).rem_euclid(unit.period_ns);
            let said = unit.bore_at(tape_ns)?;
            let velocity = (unit.bore_at(tape_ns + 5_000_000)? - unit.bore_at(tape_ns - 5_000_000)?) * 100.0;
            let wrong_rad = bore.angle_between(unit.true_bore_at(tape_ns));
            Some(BoreAim { fired_ns: fired(round), off: bore - said, velocity, wrong_rad })
        })
        .collect();
    write_aims(&bench.out.join("rounds.csv"), &aims)?;
    let rms = |aims: &[&BoreAim], square: &dyn Fn(&BoreAim) -> f64| {
        (aims.iter().map(|aim| square(aim)).sum::<f64>() / aims.len().max(1) as f64).sqrt() * 1e3
    };
    let all: Vec<&BoreAim> = aims.iter().collect();
    let (from, to) = unaided;
    let alone: Vec<&BoreAim> = aims.iter().filter(|aim| (from..to).contains(&aim.fired_ns)).collect();
    ensure!(alone.len() >= 20, "only {} rounds were scored while nothing corrected the unit", alone.len());
    let off_mrad = rms(&alone, &|aim| aim.off.length_squared());
    let wrong_mrad = rms(&all, &|aim| aim.wrong_rad * aim.wrong_rad);
    // The unit's samples are known to the machine this much later than measured, at best: its own way and the line's. The clock
    // map leaves that in the time (a calibration of the mount takes it out), so it is the hardware's.
    let way_ms = recipe().imu.latency_ns[0] as f64 * 1e-6 + line_delay_ms;
    let raw_ms = late_s(&alone) * 1e3;
    let late_ms = raw_ms + way_ms;
    figures.push(Figure::judged(
        "pose of scored rounds against what the unit said of that time: time error",
        format!(
            "{late_ms:+.2} ms over {} rounds, {off_mrad:.2} mrad rms ({raw_ms:+.2} ms with the {way_ms:.2} ms that the samples are under \
             way at least)",
            alone.len()
        ),
        "1 ms",
        late_ms.abs() <= 1.0,
    ));
    figures.push(Figure::told(
        "pose of scored rounds against the tape's truth, with the unit's own error and what the camera saw",
        format!("{wrong_mrad:.2} mrad rms over {} rounds", all.len()),
    ));
    Ok(figures)
}

/// Where a round was aimed: by how much that differs from what the unit said of its time, and how fast that moved.
struct BoreAim {
    /// On the machine's clock.
    fired_ns: i64,
    off: DVec3,
    /// Per second.
    velocity: DVec3,
    /// Angle to the truth.
    wrong_rad: f64,
}

/// Round by round, for whoever looks for the cause of an error.
fn write_aims(path: &Path, aims: &[BoreAim]) -> Result<()> {
    let mut text = String::from(
        "fired_s,off_x_mrad,off_y_mrad,off_z_mrad,velocity_x,velocity_y,velocity_z,wrong_mrad\n",
    );
    for aim in aims {
        let (off, v) = (aim.off * 1e3, aim.velocity);
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "{:.6},{:.4},{:.4},{:.4},{:.5},{:.5},{:.5},{:.4}",
            aim.fired_ns as f64 * 1e-9,
            off.x,
            off.y,
            off.z,
            v.x,
            v.y,
            v.z,
            aim.wrong_rad * 1e3
        );
    }
    fs::write(path, text).with_context(|| path.display().to_string())
}

/// By how many seconds the poses of these rounds are ahead of the rounds, by least squares; what all are off by alike is not of time.
fn late_s(aims: &[&BoreAim]) -> f64 {
    let count = aims.len().max(1) as f64;
    let mean_off = aims.iter().map(|aim| aim.off).sum::<DVec3>() / count;
    let mean_velocity = aims.iter().map(|aim| aim.velocity).sum::<DVec3>() / count;
    let (along, square) = aims.iter().fold((0.0, 0.0), |(along, square), aim| {
        let velocity = aim.velocity - mean_velocity;
        (along + (aim.off - mean_off).dot(velocity), square + velocity.length_squared())
    });
    along / square.max(f64::MIN_POSITIVE)
}

/// Readings of the tape's unit and the truth, by nanoseconds since the tape's beginning.
struct UnitTrack {
    period_ns: i64,
    attitudes: Vec<DQuat>,
    camera_from_imu: DQuat,
    truth: Motion,
}

impl UnitTrack {
    fn of(bench: &HilBench) -> Self {
        let recipe = recipe();
        Self {
            period_ns: bench.tape.period_ns.max(1),
            attitudes: bench.tape.samples.iter().filter_map(|s| s.attitude.map(DQuat::from_array)).collect(),
            camera_from_imu: recipe.camera_from_imu(),
            truth: recipe.motion(),
        }
    }

    /// The samples are evenly spaced and begin with the tape.
    fn bore_at(&self, tape_ns: i64) -> Option<DVec3> {
        let count = self.attitudes.len();
        let place = tape_ns.rem_euclid(self.period_ns) as f64 / self.period_ns as f64 * count as f64;
        let from = self.attitudes.get(place as usize)?;
        let to = self.attitudes.get((place as usize + 1) % count)?;
        let world_from_imu = from.slerp(*to, place.fract());
        Some(world_from_imu * self.camera_from_imu.inverse() * DVec3::Z)
    }

    fn true_bore_at(&self, tape_ns: i64) -> DVec3 {
        self.truth.at(tape_ns as f64 * 1e-9).pose.world_from_camera * DVec3::Z
    }
}

/// The first round of each pull against the time of the pull.
fn edges(bench: &HilBench, rounds: &[Value]) -> Vec<Figure> {
    let mut late = Vec::new();
    let presses = bench.pulls.iter().filter(|(.., pressed)| *pressed);
    let blind = |at: i64| bench.blind.iter().any(|(from, to)| (*from..=*to).contains(&at));
    let mut unmatched = 0;
    for (before, after, _) in presses.filter(|(before, ..)| !blind(*before)) {
        let first = rounds
            .iter()
            .filter_map(|r| r["fired_ns"].as_i64())
            .filter(|f| (before - 2_000_000..after + 50_000_000).contains(f))
            .min();
        match first {
            Some(first) => late.push((first - before).max(first - after) as f64 * 1e-6),
            None => unmatched += 1,
        }
    }
    let inside = late.len();
    let worst = percentile(&mut late, 1.0);
    let p50 = percentile(&mut late, 0.5);
    vec![Figure::judged(
        "first round of a pull: its time after the line was set",
        format!(
            "p50 {p50:.2} ms, worst {worst:.2} ms over {inside} pulls; {unmatched} pulls without a round: not armed, or lost as row 23 wants it"
        ),
        "kernel edge time, 1 ms",
        inside >= 5 && (-0.1..=1.0).contains(&p50),
    )]
}

/// Times rise, no round is twice, none was fired without a pull, none scored in the dark.
fn order(bench: &HilBench, rounds: &[Value]) -> Figure {
    let fired = |r: &Value| r["fired_ns"].as_i64().unwrap_or(0);
    let key = |r: &Value| (r["run"].as_i64(), r["shot"].as_i64());
    let backwards =
        rounds.windows(2).filter(|w| w[0]["run"] == w[1]["run"] && fired(&w[1]) < fired(&w[0])).count();
    let twice = rounds.windows(2).filter(|w| key(&w[0]) == key(&w[1])).count();
    let mut held = Vec::new();
    let mut pressed = None;
    for (before, after, high) in &bench.pulls {
        match (high, pressed) {
            (true, None) => pressed = Some(*before),
            (false, Some(from)) => {
                held.push((from, *after));
                pressed = None;
            }
            _ => {}
        }
    }
    let slack = 60_000_000;
    let phantom = rounds
        .iter()
        .filter(|r| !held.iter().any(|(from, to)| (from - slack..to + slack).contains(&fired(r))))
        .filter(|r| !bench.blind.iter().any(|(from, to)| (*from..*to).contains(&fired(r))))
        .count();
    let wrong = rounds
        .iter()
        .filter(|r| bench.blind.iter().any(|(from, to)| (*from..*to).contains(&fired(r))))
        .filter(|r| r["outcome"] != "not_scored")
        .count();
    Figure::judged(
        "rounds in the journal",
        format!(
            "{}: {backwards} out of order, {twice} twice, {phantom} without a pull, {wrong} scored without camera or IMU",
            rounds.len()
        ),
        "none of these",
        !rounds.is_empty() && backwards + twice + phantom + wrong == 0,
    )
}

/// From the pull to the committed round: commits as the program reports them.
pub fn committed(bench: &mut HilBench) -> Result<Figure> {
    let mut delays = Vec::new();
    for _ in 0..6 {
        let seen = bench.machine.guest.lines().len();
        let at = bench.shoot(50)?;
        for _ in 0..100 {
            let lines = bench.machine.guest.lines();
            if let Some((then, _)) = lines.iter().skip(seen).find(|(_, text)| text.starts_with("committed "))
            {
                delays.push((then - at) as f64 * 1e-6);
                break;
            }
            thread::sleep(Duration::from_millis(50));
        }
    }
    ensure!(!delays.is_empty(), "no commit was reported");
    let count = delays.len();
    let (p50, worst) = (percentile(&mut delays, 0.5), percentile(&mut delays, 1.0));
    let what = "trigger edge to committed round, flight included";
    Ok(Figure::told(what, format!("p50 {p50:.0} ms, worst {worst:.0} ms over {count} rounds")))
}
