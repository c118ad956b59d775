//! Marks of runs: shapes that differ without colour, and a tone for each.

use maud::{Markup, html};

/// Outlines within two units of their middle, and whether they are filled.
const SHAPES: [(&str, bool); 14] = [
    (CIRCLE, true),
    (SQUARE, true),
    (UP, true),
    (DIAMOND, true),
    (DOWN, true),
    (CROSS, false),
    (PLUS, false),
    (CIRCLE, false),
    (SQUARE, false),
    (UP, false),
    (DIAMOND, false),
    (DOWN, false),
    (STAR, true),
    (STAR, false),
];
const CIRCLE: &str = "M-1.7 0a1.7 1.7 0 1 0 3.4 0a1.7 1.7 0 1 0 -3.4 0z";
const SQUARE: &str = "M-1.5 -1.5h3v3h-3z";
const UP: &str = "M0 -2L1.9 1.5h-3.8z";
const DOWN: &str = "M0 2L1.9 -1.5h-3.8z";
const DIAMOND: &str = "M0 -2.1L2.1 0L0 2.1L-2.1 0z";
const CROSS: &str = "M-1.6 -1.6L1.6 1.6M1.6 -1.6L-1.6 1.6";
const PLUS: &str = "M0 -2V2M-2 0H2";
const STAR: &str = "M0 -2.2L.6 -.6L2.2 0L.6 .6L0 2.2L-.6 .6L-2.2 0L-.6 -.6z";
/// Tones of the style sheet.
const TONES: usize = 6;

/// Classes of all that is drawn of a run.
pub fn class(run: usize) -> String {
    format!("run-{run} tone-{}", run % TONES)
}

/// The mark of a run at a place of a drawing, that many units large, with words for it.
pub fn at(run: usize, [x, y]: [f64; 2], unit: f64, title: &str) -> Markup {
    let (path, filled) = SHAPES[run % SHAPES.len()];
    html! {
        path d=(path) transform={ "translate(" (format!("{x:.2} {y:.2}")) ") scale(" (unit) ")" } class=(if filled { "full" } else { "hollow" }) {
            title { (title) }
        }
    }
}

/// The mark of a run within a line of text. The number beside it says the same.
pub fn mark(run: usize) -> Markup {
    html! { svg class={ "mark " (class(run)) } viewBox="-3 -3 6 6" aria-hidden="true" { (at(run, [0.0; 2], 1.0, "")) } }
}
