//! What is measured besides the faults.

use std::{thread, time::Duration};

use anyhow::{Context, Result, ensure};
use bowwave_hil::protocol::Command;
use glam::DVec3;
use serde_json::Value;

use super::bench::{Bench, recipe};

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
pub fn usage(bench: &mut Bench, what: &str) -> Result<Vec<Figure>> {
    let before = bench.machine.guest.call(Command::Usage)?;
    thread::sleep(Duration::from_secs(6));
    let after = bench.machine.guest.call(Command::Usage)?;
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

/// Shots against what the bench did: kernel's time of the edge, order, pose at the time of firing.
pub fn shots(bench: &mut Bench, line_delay_ms: Option<f64>) -> Result<Vec<Figure>> {
    let rounds = bench.rounds()?;
    let origin = bench.machine.guest.origin_ns().context("nothing was played")?;
    let fired = |r: &Value| r["fired_ns"].as_i64().unwrap_or(i64::MIN);
    let mut figures = Vec::new();
    figures.extend(edges(bench, &rounds));
    figures.push(order(bench, &rounds));
    let motion = recipe().motion();
    let bore_at = |ns: i64| {
        let t = (ns - origin).rem_euclid(recipe_period(bench)) as f64 * 1e-9;
        motion.at(t).pose.world_from_camera * DVec3::Z
    };
    let scored: Vec<&Value> =
        rounds.iter().filter(|r| r["outcome"] != "not_scored" && fired(r) > origin).collect();
    ensure!(scored.len() >= 20, "only {} scored rounds", scored.len());
    let mut errors: Vec<Aim> = scored
        .iter()
        .filter_map(|round| {
            let numbers: Vec<f64> =
                round["bore"].as_array().into_iter().flatten().filter_map(Value::as_f64).collect();
            let [x, y, z] = numbers[..] else { return None };
            let at = fired(round);
            let velocity = (bore_at(at + 500_000) - bore_at(at - 500_000)) * 1000.0;
            Some(Aim { at, off: DVec3::new(x, y, z) - bore_at(at), velocity })
        })
        .collect();
    errors.sort_by_key(|aim| aim.at);
    let (first, second) = errors.split_at(errors.len() / 2);
    let (all_s, constant_s, rest_s) = (late_s(&errors), late_s(first), late_s(second) - late_s(first));
    let spread = second.iter().map(|aim| (aim.off - aim.velocity * constant_s).length_squared()).sum::<f64>();
    let spread_mrad = (spread / second.len() as f64).sqrt() * 1e3;
    let way = line_delay_ms
        .map_or_else(String::new, |ms| format!(", {ms:.2} of it the bytes' way through an idle machine"));
    figures.push(Figure::told(
        "pose of scored rounds against the tape's truth: constant time error",
        format!(
            "{:+.2} ms over {} rounds{way}: the line's delay, which a calibration takes out",
            all_s * 1e3,
            errors.len()
        ),
    ));
    figures.push(Figure::judged(
        "the same, what is left in the second half when the first half's is taken out",
        format!("{:+.2} ms over {} rounds; {spread_mrad:.2} mrad rms", rest_s * 1e3, second.len()),
        "1 ms",
        rest_s.abs() <= 1e-3,
    ));
    Ok(figures)
}

/// Where a round was aimed: by how much that differs from the truth of its time, and how fast the truth moved.
struct Aim {
    at: i64,
    off: DVec3,
    /// Per second.
    velocity: DVec3,
}

/// By how many seconds the poses of these rounds come after the rounds, by least squares.
fn late_s(aims: &[Aim]) -> f64 {
    let along: f64 = aims.iter().map(|aim| aim.off.dot(aim.velocity)).sum();
    along / aims.iter().map(|aim| aim.velocity.length_squared()).sum::<f64>().max(f64::MIN_POSITIVE)
}

fn recipe_period(bench: &Bench) -> i64 {
    bench.tape.period_ns.max(1)
}

/// The first round of each pull against the time of the pull.
fn edges(bench: &Bench, rounds: &[Value]) -> Vec<Figure> {
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
fn order(bench: &Bench, rounds: &[Value]) -> Figure {
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
pub fn committed(bench: &mut Bench) -> Result<Figure> {
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
