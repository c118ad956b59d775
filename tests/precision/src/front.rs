//! Which ways nothing else beats. Errors are compared as they are; times only as ratios within one run.

use crate::row::{ReportRow, RowKind};

/// How two ways' times compare.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ratio {
    /// Natural logarithm of the median ratio over the turns.
    pub log: f64,
    /// Standard error of that median.
    pub log_error: f64,
}

impl Ratio {
    /// Of times `a` over times `b`, turn by turn; a ratio of 1 that nothing is known of where there are none.
    pub fn of(a: &[f64], b: &[f64]) -> Self {
        let mut logs: Vec<f64> = a.iter().zip(b).map(|(a, b)| (a / b).ln()).collect();
        if logs.is_empty() {
            return Self { log: 0.0, log_error: f64::INFINITY };
        }
        let log = median(&mut logs);
        let mut off: Vec<f64> = logs.iter().map(|l| (l - log).abs()).collect();
        // 1.4826 makes a median deviation a standard deviation, 1.2533 that of a mean that of a median.
        let log_error = 1.2533 * 1.4826 * median(&mut off) / (logs.len() as f64).sqrt();
        Self { log, log_error }
    }
}

/// Middle value (the mean of the middle two); NaN of none.
pub fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    match n {
        0 => f64::NAN,
        _ => 0.5 * (values[(n - 1) / 2] + values[n / 2]),
    }
}

/// The value below which a share of them lies; NaN for none.
pub fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().saturating_sub(1);
    sorted.get((share * last as f64).round() as usize).copied().unwrap_or(f64::NAN)
}

/// Time of `a` over that of `b`, two rows of one scene.
pub fn ratio(a: &ReportRow, b: &ReportRow) -> Ratio {
    match (&a.kind, &b.kind) {
        (RowKind::Ranked(a), RowKind::Ranked(b)) => Ratio::of(&a.samples, &b.samples),
        _ => Ratio::of(&[], &[]),
    }
}

/// Factor of the time below which a way counts as no slower.
const TIE: f64 = 1.1;

/// Whether `other` beats `row`: it errs less and is surely not slower, or errs no more and is faster by more than the scene's
/// noise. Surely: two standard errors of the median ratio away. What cannot be told on a busy machine beats nobody.
fn beats(other: &ReportRow, row: &ReportRow) -> bool {
    let (RowKind::Ranked(a), RowKind::Ranked(b)) = (&other.kind, &row.kind) else { return false };
    let ratio = Ratio::of(&a.samples, &b.samples);
    let at_most = ratio.log + 2.0 * ratio.log_error;
    let (mine, its) = (row.error.max(row.truth_error), other.error.max(other.truth_error));
    its < mine && at_most < TIE.ln() || its <= mine && at_most < -a.noise.max(b.noise).ln()
}

fn same_scene(a: &ReportRow, b: &ReportRow) -> bool {
    a.part == b.part && a.scene == b.scene
}

/// Marks the rows that no other row of their scene beats.
pub fn mark(rows: &mut [ReportRow]) {
    let on_front: Vec<bool> = rows
        .iter()
        .map(|r| {
            matches!(r.kind, RowKind::Ranked(_))
                && r.error.is_finite()
                && !rows.iter().any(|o| same_scene(o, r) && beats(o, r))
        })
        .collect();
    for (row, on_front) in rows.iter_mut().zip(on_front) {
        row.on_front = on_front;
    }
}

/// What is wrong with the rows: an error that is no number, a default that diverges, a default that something beats without
/// an excuse.
pub fn complaints(rows: &[ReportRow]) -> Vec<String> {
    let mut found = Vec::new();
    for r in rows {
        let name = format!("{}: {} ({}) on {}", r.part, r.method, r.setting, r.scene);
        if r.error.is_nan() || r.error < 0.0 {
            found.push(format!("{name}: its error is no number ({})", r.error));
        } else if r.default && r.error.is_infinite() {
            found.push(format!("{name}: what the product uses diverges"));
        }
        if !r.default || !r.excuse.is_empty() {
            continue;
        }
        found.extend(rows.iter().filter(|o| same_scene(o, r) && beats(o, r)).map(|o| {
            format!(
                "{name}: the default errs {:.3e} {}; {} ({}) errs {:.3e} in {:.2} times its time",
                r.error,
                r.error_unit,
                o.method,
                o.setting,
                o.error,
                ratio(o, r).log.exp()
            )
        }));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::row::{Timing, testing::row};

    /// Times about `ns` with the same disturbance in each turn, as a machine that others use has.
    fn timed(method: &str, error: f64, ns: f64) -> ReportRow {
        let disturbed = |i: i32| ns * if i % 3 == 0 { 4.0 } else { 1.0 } * (1.0 + 0.01 * f64::from(i % 5));
        let timing = Timing { samples: (0..15).map(disturbed).collect(), noise: 1.1 };
        ReportRow { kind: RowKind::Ranked(timing), ..row(method, error) }
    }

    fn front(mut rows: Vec<ReportRow>) -> Vec<String> {
        mark(&mut rows);
        rows.into_iter().filter(|r| r.on_front).map(|r| r.method).collect()
    }

    #[test]
    fn the_front_is_what_nothing_beats() {
        let rows = vec![
            timed("cheap", 1.0, 10.0),
            timed("middle", 0.1, 100.0),
            timed("dear", 0.01, 1000.0),
            timed("dear and bad", 0.5, 500.0),
            timed("diverges", f64::INFINITY, 1.0),
        ];
        assert_eq!(front(rows), ["cheap", "middle", "dear"]);
    }

    #[test]
    fn equal_times_let_the_error_decide_and_equal_errors_the_time() {
        assert_eq!(front(vec![timed("a", 0.10, 100.0), timed("b", 0.11, 95.0)]), ["a"]);
        assert_eq!(front(vec![timed("a", 0.1, 100.0), timed("b", 0.1, 50.0)]), ["b"]);
        // Equal in both: nobody is beaten.
        assert_eq!(front(vec![timed("a", 0.1, 100.0), timed("b", 0.1, 95.0)]), ["a", "b"]);
        // A tenth faster is more than the noise of one in ten; then both are on the front.
        assert_eq!(front(vec![timed("a", 0.10, 100.0), timed("b", 0.11, 80.0)]), ["a", "b"]);
    }

    #[test]
    fn errors_below_the_truths_own_are_equal() {
        let floor = |r: ReportRow| ReportRow { truth_error: 1e-3, ..r };
        assert_eq!(front(vec![floor(timed("a", 1e-9, 100.0)), floor(timed("b", 1e-4, 50.0))]), ["b"]);
    }

    #[test]
    fn scenes_and_extreme_cases_do_not_compete() {
        let other = ReportRow { scene: "another".into(), ..timed("b", 0.0, 1.0) };
        let extreme = ReportRow { kind: RowKind::Extreme, ..timed("c", 0.0, 1.0) };
        assert_eq!(front(vec![timed("a", 1.0, 10.0), other, extreme]), ["a", "b"]);
    }

    #[test]
    fn a_beaten_default_is_told_and_one_on_the_front_is_not() {
        let default = ReportRow { default: true, ..timed("default", 0.1, 100.0) };
        assert!(complaints(&[default.clone(), timed("cheap", 1.0, 10.0)]).is_empty());
        let told = complaints(&[default.clone(), timed("better", 0.05, 100.0)]);
        assert!(told.len() == 1 && told[0].contains("better"), "{told:?}");
        let told = complaints(&[default.clone(), timed("faster", 0.1, 60.0)]);
        assert!(told.len() == 1 && told[0].contains("faster"), "{told:?}");
        let excused = ReportRow { excuse: "known".into(), ..default.clone() };
        assert!(complaints(&[excused, timed("faster", 0.1, 60.0)]).is_empty());
        // Where the ratio is all over the place, nothing can be said.
        let wild = Timing { samples: (0..15).map(|i| 60.0 * 4f64.powi(i % 5 - 2)).collect(), noise: 1.1 };
        assert!(
            complaints(&[default, ReportRow { kind: RowKind::Ranked(wild), ..timed("wild", 0.05, 1.0) }])
                .is_empty()
        );
    }

    #[test]
    fn an_error_that_is_no_number_is_told_wherever_it_is() {
        let extreme = ReportRow { kind: RowKind::Extreme, ..row("x", f64::NAN) };
        assert_eq!(complaints(&[extreme]).len(), 1);
        assert_eq!(complaints(&[timed("y", f64::NAN, 1.0)]).len(), 1);
        // A rival may diverge, the product may not.
        assert!(complaints(&[timed("z", f64::INFINITY, 1.0)]).is_empty());
        let default = ReportRow { default: true, kind: RowKind::Extreme, ..row("z", f64::INFINITY) };
        assert_eq!(complaints(&[default]).len(), 1);
    }

    #[test]
    fn a_disturbance_that_meets_both_leaves_their_ratio() {
        let (a, b) = (timed("a", 1.0, 100.0), timed("b", 1.0, 25.0));
        let r = ratio(&a, &b);
        assert!((r.log.exp() - 4.0).abs() < 1e-9 && r.log_error < 1e-9, "{r:?}");
        assert!(Ratio::of(&[], &[]).log_error.is_infinite());
    }
}
