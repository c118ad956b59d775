//! The picture of a scenario: a chart of the boats' tracks, and a timeline of their crews.

use bowwave_core::world::scenario::{Scenario, Side};
use glam::DVec2;
use maud::{Markup, html};

use super::rehearsal::Track;

/// Side of the chart and height of a line of the timeline, pixels.
const CHART: f64 = 760.0;
const LINE: f64 = 20.0;
/// Left edge of the timeline's bars, and the width of the whole.
const BARS: f64 = 150.0;
const WIDTH: f64 = 800.0;
const MARGIN: f64 = 20.0;
/// Seconds from dot to dot on a track.
const DOTS_S: usize = 30;

/// A place on the chart where a round struck a boat.
#[derive(Clone, Copy, Debug)]
pub struct StrikeMark {
    /// World x and y, metres.
    pub at: DVec2,
    /// Whose boat it was.
    pub side: Side,
}

/// The picture of what boats do while nobody fires, as SVG.
pub fn draw(scenario: &Scenario, tracks: &[Track], seconds: f64) -> String {
    draw_with(scenario, tracks, seconds, "while nobody fires or shines a light", &[])
}

/// The picture of `what` happened, with the strikes of rounds, as SVG.
pub fn draw_with(
    scenario: &Scenario,
    tracks: &[Track],
    seconds: f64,
    what: &str,
    strikes: &[StrikeMark],
) -> String {
    let height = MARGIN + 40.0 + CHART + 60.0 + LINE * tracks.len() as f64 + MARGIN;
    let size = format!("0 0 {WIDTH} {height:.0}");
    let picture = html! {
        svg xmlns="http://www.w3.org/2000/svg" viewBox=(size) width=(WIDTH) height=(format!("{height:.0}"))
            font-family="sans-serif" font-size="12" {
            rect width="100%" height="100%" fill="#f4f7f9" {}
            text x=(MARGIN) y="26" font-size="18" font-weight="bold" { (scenario.name) }
            text x=(MARGIN) y="46" { (caption(scenario, tracks, seconds, what)) }
            (chart(tracks, strikes))
            (timeline(tracks, seconds))
        }
    };
    picture.into_string() + "\n"
}

fn caption(scenario: &Scenario, tracks: &[Track], seconds: f64, what: &str) -> String {
    let neutral = tracks.iter().filter(|t| t.side == Side::Neutral).count();
    let wind = scenario.waves.wind_from.to_degrees().rem_euclid(360.0);
    format!(
        "{} hostile (red) and {neutral} neutral (blue) boats, {seconds:.0} s {what}, wind force {} from {wind:.0} degrees, \
         visibility {:.0} km",
        tracks.len() - neutral,
        scenario.water.force.get(),
        scenario.daylight.visibility_m / 1000.0
    )
}

fn colour(side: Side) -> &'static str {
    match side {
        Side::Hostile => "#b3261e",
        Side::Neutral => "#1f5fa8",
    }
}

/// The chart: bearing 0 is up, the gun is in the middle.
fn chart(tracks: &[Track], strikes: &[StrikeMark]) -> Markup {
    let farthest = tracks.iter().flat_map(|t| &t.states).map(|s| s.position.abs().max_element());
    let reach_m = farthest.fold(100.0, f64::max) * 1.08;
    let scale = CHART / 2.0 / reach_m;
    let middle = DVec2::new(MARGIN + CHART / 2.0, MARGIN + 40.0 + CHART / 2.0);
    let place = |p: DVec2| middle + DVec2::new(p.x, -p.y) * scale;
    let ring_m = ring_step(reach_m);
    let rings = (1..=4).map(|i| f64::from(i) * ring_m).take_while(|r| *r < 1.3 * reach_m);
    html! {
        clipPath id="sea" {
            rect x=(MARGIN) y=(MARGIN + 40.0) width=(CHART) height=(CHART) {}
        }
        rect x=(MARGIN) y=(MARGIN + 40.0) width=(CHART) height=(CHART) fill="#dfeaf0" stroke="#7d8b94" {}
        g clip-path="url(#sea)" {
            @for ring in rings {
                circle cx=(middle.x) cy=(middle.y) r=(px(ring * scale)) fill="none" stroke="#a9bac4" {}
                text x=(px(middle.x + 4.0)) y=(px(middle.y - ring * scale - 4.0)) fill="#5c6b74" { (format!("{ring:.0} m")) }
            }
            line x1=(middle.x) y1=(px(middle.y - CHART / 2.0)) x2=(middle.x) y2=(middle.y) stroke="#a9bac4" stroke-dasharray="4 4" {}
            circle cx=(middle.x) cy=(middle.y) r="6" fill="#333" {}
            text x=(px(middle.x + 9.0)) y=(px(middle.y + 4.0)) { "gun" }
            @for track in tracks { (drawn(track, &place)) }
            @for strike in strikes {
                @let DVec2 { x, y } = place(strike.at);
                path d=(format!("M{:.1},{:.1} l6,6 m0,-6 l-6,6", x - 3.0, y - 3.0)) fill="none"
                    stroke=(if strike.side == Side::Neutral { colour(strike.side) } else { "#111" }) stroke-width="1.2" {}
            }
        }
    }
}

fn drawn(track: &Track, place: &impl Fn(DVec2) -> DVec2) -> Markup {
    let points: Vec<String> =
        track.states.iter().map(|s| place(s.position)).map(|p| format!("{:.1},{:.1}", p.x, p.y)).collect();
    let first = track.states.first().map(|s| place(s.position)).unwrap_or_default();
    let last = track.states.last().copied().unwrap_or_default();
    let (end, bow) = (place(last.position), last.heading.to_degrees());
    let colour = colour(track.side);
    html! {
        polyline points=(points.join(" ")) fill="none" stroke=(colour) stroke-width="1.4" {}
        @for state in track.states.iter().step_by(DOTS_S).skip(1) {
            @let dot = place(state.position);
            circle cx=(px(dot.x)) cy=(px(dot.y)) r="2.2" fill=(colour) {}
        }
        circle cx=(px(first.x)) cy=(px(first.y)) r="4" fill="white" stroke=(colour) stroke-width="1.6" {}
        text x=(px(first.x + 6.0)) y=(px(first.y - 5.0)) fill=(colour) { (track.name) }
        path d="M0,-8 L4,5 L-4,5 Z" fill=(colour)
            transform=(format!("translate({:.1} {:.1}) rotate({bow:.0})", end.x, end.y)) {}
    }
}

/// The timeline: a bar for each state of a crew, and how near each boat comes.
fn timeline(tracks: &[Track], seconds: f64) -> Markup {
    let top = MARGIN + 40.0 + CHART + 34.0;
    let scale = (WIDTH - MARGIN - BARS - 150.0) / seconds.max(1.0);
    let step_s = time_step(seconds);
    let ticks = (0..).map(|i| f64::from(i) * step_s).take_while(|t| *t <= seconds);
    let bottom = top + LINE * tracks.len() as f64;
    html! {
        @for tick in ticks {
            @let x = px(BARS + tick * scale);
            line x1=(x) y1=(top - 4.0) x2=(x) y2=(px(bottom)) stroke="#c3ced5" {}
            text x=(x) y=(top - 8.0) text-anchor="middle" fill="#5c6b74" { (format!("{tick:.0} s")) }
        }
        @for (row, track) in tracks.iter().enumerate() {
            @let y = top + LINE * row as f64;
            @let (nearest_m, when_s) = track.nearest();
            text x=(MARGIN) y=(px(y + 14.0)) fill=(colour(track.side)) { (track.name) }
            @for (from, until, name) in bars(track, seconds) {
                rect x=(px(BARS + from * scale)) y=(px(y + 2.0)) width=(px((until - from) * scale)) height=(LINE - 4.0)
                    fill=(colour(track.side)) fill-opacity="0.18" stroke=(colour(track.side)) stroke-width="0.6" {}
                // A name that is wider than its bar would run into the next.
                @if name.chars().count() as f64 * 6.4 < (until - from) * scale {
                    text x=(px(BARS + from * scale + 3.0)) y=(px(y + 14.0)) font-size="11" { (name) }
                }
            }
            text x=(WIDTH - MARGIN) y=(px(y + 14.0)) text-anchor="end" fill="#5c6b74" {
                (format!("nearest {nearest_m:.0} m, {when_s} s"))
            }
        }
    }
}

/// From when to when a boat does what.
fn bars(track: &Track, seconds: f64) -> Vec<(f64, f64, &str)> {
    if track.crew.is_empty() {
        return vec![(0.0, seconds, "course")];
    }
    let ends = track.crew.iter().skip(1).map(|(from, _)| *from as f64).chain([seconds]);
    track.crew.iter().zip(ends).map(|((from, name), until)| (*from as f64, until, name.as_str())).collect()
}

/// A round distance of which some rings fit.
fn ring_step(reach_m: f64) -> f64 {
    [25.0, 50.0, 100.0, 200.0, 250.0, 500.0, 1000.0, 2000.0, 5000.0]
        .into_iter()
        .find(|step| reach_m / step < 4.0)
        .unwrap_or(10_000.0)
}

/// A round time of which some ticks fit.
fn time_step(seconds: f64) -> f64 {
    [5.0, 10.0, 15.0, 30.0, 60.0, 120.0, 300.0]
        .into_iter()
        .find(|step| seconds / step <= 9.0)
        .unwrap_or(600.0)
}

fn px(value: f64) -> String {
    format!("{value:.1}")
}
