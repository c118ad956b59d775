//! The page of a debrief.

use bowwave_web::{Module, PLANE, Page, THREE, UPLOT, UPLOT_STYLE};
use maud::{Markup, PreEscaped, html};
use serde_json::Value;

use crate::{
    data,
    document::{Document, VIDEO_ELEMENT},
    run::ReviewedRun,
    tables,
    video::{RunVideo, VideoPlace},
};

const STYLE: &str = concat!(include_str!("../assets/page.css"), include_str!("../assets/review.css"));

/// The page's own modules.
const MODULES: [Module; 8] = [
    Module { name: "main.js", source: include_str!("../assets/main.js") },
    Module { name: "run.js", source: include_str!("../assets/run.js") },
    Module { name: "clock.js", source: include_str!("../assets/clock.js") },
    Module { name: "chart.js", source: include_str!("../assets/chart.js") },
    Module { name: "view.js", source: include_str!("../assets/view.js") },
    Module { name: "shots.js", source: include_str!("../assets/shots.js") },
    Module { name: "film.js", source: include_str!("../assets/film.js") },
    Module { name: "theme.js", source: include_str!("../assets/theme.js") },
];

/// The page of `run` and of its video, one file that needs no other but a video that is not embedded.
pub fn page(run: &ReviewedRun, video: Option<&RunVideo>) -> Document {
    let (data, mut notes) = data::of(run, video);
    notes.extend(video.iter().flat_map(|video| video.notes()));
    notes.extend(track_notes(run));
    if run.scored.unknown > 0 {
        notes.push(format!("{} events are of a newer version and do not count", run.scored.unknown));
    }
    if !run.stored.finished {
        notes.push(
            "the run still goes on, or did not end as it should; what there is of it is shown".to_owned(),
        );
    }
    // No type of the data has a map with keys that are no text, nor a number that JSON cannot hold but as null.
    let text = serde_json::to_string(&data).unwrap_or_default();
    let score = serde_json::to_value(&run.scored).unwrap_or_default();
    let title = format!("{} - run {}", run.stored.run.scenario, run.stored.id);
    let modules: Vec<Module> = THREE.into_iter().chain([UPLOT, PLANE]).chain(MODULES).collect();
    let style = [UPLOT_STYLE, STYLE].concat();
    let body = body(run, video, &score, &notes);
    let embedded = video.filter(|video| video.place == VideoPlace::Embedded).map(|video| video.path.clone());
    let plays_files = video.is_some() && embedded.is_none();
    let page = Page {
        title: &title,
        style: &style,
        body,
        data: &text,
        modules: &modules,
        main: "main.js",
        plays_files,
    };
    Document::new(page.to_html(), embedded)
}

/// Notes on tracks that are missing.
fn track_notes(run: &ReviewedRun) -> Vec<String> {
    /// The last samples of a run that ended well are no further from its last event than this, nanoseconds.
    const NEAR_NS: i64 = 2_000_000_000;
    if run.stored.run.details.is_none() {
        return vec!["the run is of a version that kept no tracks: chart and view stay empty".to_owned()];
    }
    let mut notes = Vec::new();
    if run.has_unreadable_details {
        notes.push("the journal's details of the run cannot be read: its boats are not shown".to_owned());
    }
    let Some(last) = run.tracks.tracks.samples.last() else {
        notes.push(
            "the journal has no tracks of the run: chart and view stay empty; the log of the run says why"
                .to_owned(),
        );
        return notes;
    };
    if run.tracks.missing > 0 {
        notes.push(format!("tracks of about {} s are missing in the journal", run.tracks.missing));
    }
    if run.end_ns().saturating_sub(last.time_ns) > NEAR_NS {
        let (end_s, tracked_s) = (run.seconds(run.end_ns()), run.seconds(last.time_ns));
        notes.push(format!("tracks end at {tracked_s:.0} s, and the run went on to {end_s:.0} s"));
    }
    notes
}

fn body(run: &ReviewedRun, video: Option<&RunVideo>, score: &Value, notes: &[String]) -> Markup {
    html! {
        (header(run, score))
        main {
            @if !notes.is_empty() {
                section.panel.notes aria-label="Notes" { ul { @for note in notes { li { (note) } } } }
            }
            noscript { p.panel { "Chart and view need JavaScript. The tables do not." } }
            div class=(if video.is_some() { "stage screen-only with-video" } else { "stage screen-only" }) {
                @if video.is_some() { (film()) }
                (view(run))
                (chart())
                (happenings())
            }
            (tables::all(run, score, video.is_some()))
        }
        (time_line())
        @if video.is_some_and(|video| video.place == VideoPlace::Embedded) { (PreEscaped(VIDEO_ELEMENT)) (PreEscaped("</script>")) }
    }
}

fn header(run: &ReviewedRun, score: &Value) -> Markup {
    let points = score.pointer("/points").and_then(Value::as_f64);
    html! {
        header.bar {
            h1.grow { (run.stored.run.scenario) " " small { "run " (run.stored.id) ", version " (run.stored.run.version) ", seed " (run.stored.run.seed) } }
            @match points {
                Some(points) => { span.badge { (format!("{points:.0} of 100 points")) } }
                None => { span.badge { "no points: no events were kept" } }
            }
            (light())
        }
    }
}

/// The choice of a palette.
pub fn light() -> Markup {
    html! {
        label.screen-only { "Light " select id="theme" {
            @for (value, name) in [("day", "Day"), ("bright", "Bright"), ("dusk", "Dusk"), ("night", "Night")] {
                option value=(value) { (name) }
            }
        } }
    }
}

fn film() -> Markup {
    html! {
        section.panel.film aria-labelledby="video-title" {
            h2 id="video-title" { "Video" }
            div.frame {
                video id="video" muted playsinline preload="auto" aria-label="The picture that the trainee's display showed at the time of the time line" {}
                p id="video-note" role="status" {}
            }
            p.muted { "The trainee's display, in step with the time line. Virtual boats and rounds are where they were when the picture was taken." }
        }
    }
}

fn view(run: &ReviewedRun) -> Markup {
    html! {
        section.panel.view aria-labelledby="view-title" {
            h2 id="view-title" { "View" }
            div.tools role="group" aria-label="Viewpoint" {
                button type="button" data-view="gun" aria-pressed="true" { "Gun" }
                button type="button" data-view="above" aria-pressed="false" { "Above" }
                button type="button" data-view="free" aria-pressed="false" { "Free" }
                label { span.visually-hidden { "At a boat" } select id="view-boat" {
                    option value="" { "At a boat ..." }
                    @for (i, boat) in run.details.boats.iter().enumerate() { option value=(i) { (boat.name) " (" (boat.side) ")" } }
                } }
            }
            canvas id="view" tabindex="0" role="img" aria-label="Boats, rounds and gun in three dimensions. Drag or use the arrow keys to turn, the wheel or + and - to come closer." {}
            p.muted id="view-note" {}
        }
    }
}

fn chart() -> Markup {
    html! {
        section.panel.chart aria-labelledby="chart-title" {
            h2 id="chart-title" { "Chart" }
            div.tools role="group" aria-label="Scale" {
                button type="button" id="chart-out" { "Wider" }
                button type="button" id="chart-in" { "Closer" }
                span.muted id="chart-scale" {}
            }
            canvas id="chart" role="img" aria-label="Chart about the gun, north up, in true scale: tracks of boats, bearing and field of view of the gun, rounds and where they ended." {}
            p.muted { "Hostile boats are arrowheads, neutral ones squares. The sector is the camera's field of view, the line in it the barrel; the dashed ring is the range to be kept. Rounds that \
                        struck leave a cross, on a neutral boat a cross in a square; others a ring." }
        }
    }
}

fn happenings() -> Markup {
    html! {
        section.panel.happenings aria-labelledby="events-title" {
            h2 id="events-title" { "Events" }
            div.tools {
                label { input type="checkbox" id="show-rounds" checked; " rounds" }
                label { input type="checkbox" id="show-plain" checked; " minor events" }
            }
            div.scroll tabindex="0" aria-label="Events in their order" { table { tbody id="events" {} } }
        }
    }
}

fn time_line() -> Markup {
    html! {
        footer.bar.clock.screen-only {
            button type="button" id="play" aria-keyshortcuts="Space" { "Play" }
            button type="button" id="back" aria-label="Event before" aria-keyshortcuts="ArrowLeft" { "\u{2039}" }
            button type="button" id="on" aria-label="Next event" aria-keyshortcuts="ArrowRight" { "\u{203a}" }
            label { span.visually-hidden { "Speed" } select id="speed" {
                @for speed in ["0.1", "0.25", "0.5", "1", "2", "5", "10"] { option value=(speed) selected[speed == "1"] { (speed) " x" } }
            } }
            div.grow.line {
                canvas id="marks" aria-hidden="true" {}
                input type="range" id="time" min="0" step="any" value="0" aria-label="Time in the run";
            }
            output id="now" for="time" { "0.0 s" }
        }
    }
}
