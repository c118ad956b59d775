//! The tables of the page. Each number of the score is in a cell that names its place in the score's JSON.

use bowwave_core::world::score::Outcome;
use bowwave_record::RunDetails;
use maud::{Markup, html};
use serde_json::Value;

use crate::{
    cells::{Cells, POINTS, SUMMARY},
    run::ReviewedRun,
    words::{self, Weight},
};

/// All tables. Where there is a video, each round has a picture of it.
pub fn all(run: &ReviewedRun, score: &Value, has_video: bool) -> Markup {
    let cells = Cells::of(score);
    html! {
        div.tables {
            (circumstances(run))
            (points(&cells))
            (breaches(&cells))
            (misses(&cells))
            (summary(&cells))
            (group(run))
            (boats(&cells))
            (rounds(run, score, has_video))
        }
    }
}

/// Briefing, weapon, wind and ranges.
fn circumstances(run: &ReviewedRun) -> Markup {
    let RunDetails {
        briefing,
        weapon,
        keep_off_m,
        self_defence_m,
        eye_height_m,
        wind_m_s: [east, north],
        ..
    } = &run.details;
    let from_deg = (-east).atan2(-north).to_degrees().rem_euclid(360.0);
    html! {
        section.panel {
            h2 { "Exercise" }
            @for line in briefing.iter().flat_map(|text| text.lines()) { p { (line) } }
            table { tbody {
                @if let Some(weapon) = weapon { tr { th { "Weapon" } td { (weapon) } } }
                @if *keep_off_m > 0.0 { tr { th { "Range to be kept" } td { (format!("{keep_off_m:.0} m")) } } }
                @if *self_defence_m > 0.0 { tr { th { "Self-defence within" } td { (format!("{self_defence_m:.0} m")) } } }
                @if *eye_height_m > 0.0 { tr { th { "Camera over the water" } td { (format!("{eye_height_m:.1} m")) } } }
                @if !run.details.boats.is_empty() {
                    tr { th { "Wind" } td { (format!("{:.1} m/s from {from_deg:.0} degrees", east.hypot(*north))) } }
                }
            } }
        }
    }
}

fn points(cells: &Cells<'_>) -> Markup {
    html! {
        section.panel {
            h2 { "Points" }
            p.muted { (POINTS) }
            table {
                thead { tr { th { "Item" } th.number { "Points" } th.number { "Of" } } }
                tbody {
                    @for i in 0..cells.count("/items") {
                        tr {
                            td { (cells.text(&format!("/items/{i}/item"))) }
                            (cells.number(&format!("/items/{i}/points"), 1))
                            (cells.number(&format!("/items/{i}/of"), 1))
                        }
                    }
                    tr { th { "Total" } (cells.number("/points", 1)) td.number { "100" } }
                }
            }
            p.muted { "Version of the points' meaning: " (version(cells)) }
        }
    }
}

fn version(cells: &Cells<'_>) -> Markup {
    let value = cells.score.pointer("/version").map(Value::to_string);
    html! { span data-score="/version" data-value=[value.as_deref()] { (value.as_deref().unwrap_or("-")) } }
}

fn summary(cells: &Cells<'_>) -> Markup {
    let parts = cells.score.pointer("/rounds/by_part").and_then(Value::as_object);
    html! {
        section.panel {
            h2 { "Score" }
            table { tbody {
                @for (name, pointer, digits, meaning) in SUMMARY {
                    tr { th { (name) } (cells.number(pointer, digits)) td.muted { (meaning) } }
                }
                @for part in parts.into_iter().flat_map(|parts| parts.keys()) {
                    tr { th { "Hits, " (part) } (cells.number(&format!("/rounds/by_part/{part}"), 0)) td.muted { "on hostile boats" } }
                }
            } }
        }
    }
}

fn boats(cells: &Cells<'_>) -> Markup {
    let count = cells.count("/boats");
    if count == 0 {
        return html! {};
    }
    html! {
        section.panel.wide {
            h2 { "Boats" }
            p.muted { "Seconds count from when a boat could be seen." }
            div.scroll tabindex="0" { table {
                thead { tr {
                    th { "Boat" } th { "Side" } th.number { "Could be seen, m" } th.number { "Gun on it, s" } th.number { "Detected, s" }
                    th.number { "Reported, s" } th { "Called" } th.number { "Called, s" } th.number { "Warned, s" } th.number { "Hits" } th { "Ended" } th.number { "at, m" } th.number { "Nearest, m" }
                } }
                tbody {
                    @for i in 0..count {
                        @let at = |field: &str| format!("/boats/{i}/{field}");
                        tr {
                            td { (cells.text(&at("name"))) }
                            td { (cells.text(&at("side"))) }
                            (cells.number(&at("in_view_m"), 0))
                            (cells.number(&at("pointed_s"), 1))
                            (cells.number(&at("detected_s"), 1))
                            (cells.number(&at("reported_s"), 1))
                            td { (cells.text(&at("identified_as"))) }
                            (cells.number(&at("identified_s"), 1))
                            (cells.number(&at("warned_s"), 1))
                            (cells.number(&at("hits"), 0))
                            td { (ended(cells, i)) }
                            (cells.number(&at("ended_m"), 0))
                            (cells.number(&at("nearest_m"), 0))
                        }
                    }
                }
            } }
        }
    }
}

fn ended(cells: &Cells<'_>, boat: usize) -> String {
    let is = |field: &str| cells.score.pointer(&format!("/boats/{boat}/{field}")) == Some(&Value::Bool(true));
    let ending = match cells.text(&format!("/boats/{boat}/ending")).as_str() {
        "stopped" => "stopped",
        "turned_away" => "turned away",
        _ => "",
    };
    let words: Vec<&str> =
        [ending, if is("sank") { "sank" } else { "" }, if is("burns") && !is("sank") { "burns" } else { "" }]
            .into_iter()
            .filter(|word| !word.is_empty())
            .collect();
    if words.is_empty() { "-".to_owned() } else { words.join(", ") }
}

fn breaches(cells: &Cells<'_>) -> Markup {
    let count = cells.count("/breaches");
    if count == 0 {
        return html! {};
    }
    html! {
        section.panel {
            h2 { "Rules of engagement broken" }
            table {
                thead { tr { th.number { "At, s" } th { "Rules" } th { "Boat" } th.number { "Rounds" } } }
                tbody { @for i in 0..count {
                    tr {
                        (cells.number(&format!("/breaches/{i}/at_s"), 1))
                        td { (cells.text(&format!("/breaches/{i}/rules"))) }
                        td { (cells.text(&format!("/breaches/{i}/boat"))) }
                        (cells.number(&format!("/breaches/{i}/rounds"), 0))
                    }
                } }
            }
        }
    }
}

fn misses(cells: &Cells<'_>) -> Markup {
    let count = cells.count("/misses");
    if count == 0 {
        return html! {};
    }
    html! {
        section.panel {
            h2 { "Misses by their largest cause" }
            p.muted { "Rounds that passed every boat by more than 50 m were fired at none, and are not counted. The mean of the cause's part in their error is beside it." }
            table {
                thead { tr { th { "Cause" } th.number { "Rounds" } th.number { "Right, mrad" } th.number { "Over, mrad" } } }
                tbody { @for i in 0..count {
                    tr {
                        th { (cells.text(&format!("/misses/{i}/cause"))) }
                        (cells.number(&format!("/misses/{i}/rounds"), 0))
                        (cells.number(&format!("/misses/{i}/mean_mrad/0"), 1))
                        (cells.number(&format!("/misses/{i}/mean_mrad/1"), 1))
                    }
                } }
            }
        }
    }
}

/// Rounds about their target, drawn by a script.
fn group(run: &ReviewedRun) -> Markup {
    if !run.scored.explained.iter().any(|round| round.was_aimed) {
        return html! {};
    }
    html! {
        section.panel.group {
            h2 { "Rounds about the target" }
            p.muted { "As the shooter saw it: to the right and over are positive. Misses that were aimed, and their error over the run." }
            div.plot id="group" role="img" aria-label="Misses about the target, metres to the right and over. The same numbers are in the table of rounds." {}
            div.plot id="errors" role="img" aria-label="Error of each aimed miss over the time of the run, metres. The same numbers are in the table of rounds." {}
        }
    }
}

fn rounds(run: &ReviewedRun, score: &Value, has_video: bool) -> Markup {
    let cells = Cells::of(score);
    html! {
        section.panel.wide {
            h2 { "Rounds" }
            p.muted { "A round's errors are to the right and over, at the target." }
            div.scroll.long tabindex="0" { table {
                thead { tr {
                    @if has_video { th.screen-only { "Picture" } }
                    th.number { "Round" } th.number { "Fired, s" } th { "Outcome" } th.number { "Range, m" }
                    th.number { "Right, m" } th.number { "Over, m" } th.number { "Right, mrad" } th.number { "Over, mrad" } th { "Cause" }
                } }
                tbody id="rounds" {
                    @for stored in &run.scored.shots {
                        @let record = &stored.record;
                        @let found = run.scored.explanation(record.shot);
                        @let (weight, words) = words::round(record, found.map(|(_, round)| round));
                        @let fired_s = run.seconds(record.fired.ns());
                        tr data-time=(fired_s) data-shot=(record.shot) {
                            @if has_video { td.screen-only { canvas.moment width="144" height="81" role="img" aria-label={ "Picture as round " (record.shot) " was fired" } {} } }
                            td.number { (record.shot) }
                            td.number { (format!("{fired_s:.2}")) }
                            td { (badge(&record.outcome, weight)) " " (words) }
                            td.number { (range(&record.outcome)) }
                            @match found {
                                Some((i, round)) => {
                                    (cells.number(&format!("/explained/{i}/error_m/0"), 1))
                                    (cells.number(&format!("/explained/{i}/error_m/1"), 1))
                                    (cells.number(&format!("/explained/{i}/error_mrad/0"), 1))
                                    (cells.number(&format!("/explained/{i}/error_mrad/1"), 1))
                                    td { @if round.was_aimed { (round.largest_cause) } @else { "-" } }
                                }
                                None => { @for _ in 0..4 { td.number { "" } } td {} }
                            }
                        }
                    }
                }
            } }
        }
    }
}

fn range(outcome: &Outcome) -> String {
    match outcome {
        Outcome::Hit { range_m, .. } | Outcome::Miss { range_m, .. } => format!("{range_m:.0}"),
        Outcome::NotScored { .. } => "-".to_owned(),
    }
}

/// A word for an outcome: colour alone says nothing.
fn badge(outcome: &Outcome, weight: Weight) -> Markup {
    match (outcome, weight) {
        (Outcome::NotScored { .. }, _) => html! { span.badge.warning { "NOT SCORED" } },
        (_, Weight::Alarm) => html! { span.badge.alarm { "NEUTRAL" } },
        (_, Weight::Good) => html! { span.badge.good { "HIT" } },
        (_, Weight::Plain) => html! {},
    }
}
