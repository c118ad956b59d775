//! Progress: each main item of the score from run to run.

use maud::{Markup, html};
use serde_json::Value;

use super::{
    ComparedRun, mark,
    scores::{Row, points, summary},
};
use crate::cells::shown;

/// Items of the summary that are drawn besides the points.
const DRAWN: [&str; 6] = [
    "/under_threat_s",
    "/nearest_m",
    "/rounds/fired",
    "/rounds/hits",
    "/rounds/first_round_hits",
    "/calls/in_time",
];
/// The drawing's inside, units: left, right, top, bottom.
const LEFT: f64 = 30.0;
const RIGHT: f64 = 292.0;
const TOP: f64 = 16.0;
const BOTTOM: f64 = 104.0;
/// Runs beyond which values are not written beside their marks; the table has them.
const WRITTEN_MOST: usize = 10;

/// The plots.
pub fn plots(runs: &[ComparedRun], scores: &[Value]) -> Markup {
    let is_drawn =
        |row: &Row| DRAWN.iter().any(|pointer| row.pointers.iter().flatten().any(|p| p == pointer));
    let rows: Vec<Row> =
        points(scores).into_iter().chain(summary(scores).into_iter().filter(is_drawn)).collect();
    html! {
        section.panel {
            h2 { "From run to run" }
            p.muted { "Runs in the order of their beginnings, at equal distances. A line joins neighbours of one scenario; a dashed line, neighbours of different ones. The numbers are those of the table." }
            div.progress { @for row in &rows { (plot(row, runs, scores)) } }
        }
    }
}

fn plot(row: &Row, runs: &[ComparedRun], scores: &[Value]) -> Markup {
    let value =
        |i: usize| row.pointers[i].as_deref().and_then(|at| scores[i].pointer(at)).and_then(Value::as_f64);
    let values: Vec<Option<f64>> = (0..runs.len()).map(value).collect();
    let most = values.iter().flatten().copied().fold(0.0, f64::max).max(of(row, scores)).max(1.0);
    let least = values.iter().flatten().copied().fold(0.0, f64::min);
    let x = |i: usize| LEFT + (RIGHT - LEFT) * (i as f64 + 0.5) / runs.len().max(1) as f64;
    let y = |value: f64| BOTTOM - (BOTTOM - TOP) * (value - least) / (most - least);
    let in_words: Vec<String> =
        (0..runs.len()).map(|i| format!("run {}: {}", i + 1, text(row, scores, i))).collect();
    // So many runs lie between two numbers of the axis.
    let apart = runs.len().div_ceil(16).max(1);
    html! {
        figure {
            figcaption { (row.name) @if !row.meaning.is_empty() { " " small { (row.meaning) } } }
            svg.plot viewBox="0 0 300 122" role="img" aria-label={ (row.name) " by run. " (in_words.join(", ")) } {
                g.grid {
                    @for level in [least, (least + most) / 2.0, most] {
                        path d=(format!("M{LEFT} {:.2}H{RIGHT}", y(level))) {}
                        text x=(LEFT - 3.0) y=(format!("{:.2}", y(level) + 2.5)) text-anchor="end" { (level_text(level)) }
                    }
                    @for i in (0..runs.len()).step_by(apart) { text x=(format!("{:.2}", x(i))) y="116" text-anchor="middle" { (i + 1) } }
                }
                @for i in 1..runs.len() {
                    @if let (Some(before), Some(here)) = (values[i - 1], values[i]) {
                        @let same = runs[i - 1].stored.run.scenario == runs[i].stored.run.scenario;
                        path class=(if same { "line" } else { "line dashed" }) d=(format!("M{:.2} {:.2}L{:.2} {:.2}", x(i - 1), y(before), x(i), y(here))) {}
                    }
                }
                @for (i, value) in values.iter().enumerate() {
                    @if let Some(value) = value {
                        g class=(mark::class(i)) { (mark::at(i, [x(i), y(*value)], 2.0, &in_words[i])) }
                        @if runs.len() <= WRITTEN_MOST {
                            text.value x=(format!("{:.2}", x(i))) y=(format!("{:.2}", y(*value) - 6.0)) text-anchor="middle" { (text(row, scores, i)) }
                        }
                    }
                }
            }
        }
    }
}

/// The most that an item of the points can have in any run; 0 for other items.
fn of(row: &Row, scores: &[Value]) -> f64 {
    let of_run = |(pointer, score): (&Option<String>, &Value)| match pointer.as_deref()? {
        "/points" => Some(100.0),
        at => score.pointer(&format!("{}/of", at.strip_suffix("/points")?)).and_then(Value::as_f64),
    };
    row.pointers.iter().zip(scores).filter_map(of_run).fold(0.0, f64::max)
}

fn text(row: &Row, scores: &[Value], run: usize) -> String {
    shown(row.pointers[run].as_deref().and_then(|at| scores[run].pointer(at)), row.digits)
}

fn level_text(level: f64) -> String {
    if level.fract() == 0.0 { format!("{level:.0}") } else { format!("{level:.1}") }
}
