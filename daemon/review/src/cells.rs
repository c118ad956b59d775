//! Cells with numbers of the score, and the names and meanings of its items: the same on every page.

use bowwave_core::text::one_line;
use maud::{Markup, html};
use serde_json::Value;

/// Meaning of the points.
pub const POINTS: &str = "Points are parts of those that the scenario asks for: 50 for hostile boats that were stopped or turned away, 15 for \
                          keeping them off, 15 for rounds that struck, 20 for calls. 20 are taken off for each neutral boat that was struck, and \
                          10 for each burst that broke the rules.";

/// Items of the summary: name, place in the score, digits after the point, and meaning.
pub const SUMMARY: [(&str, &str, usize, &str); 21] = [
    ("Duration, s", "/duration_s", 1, "from the beginning of the exercise to its end"),
    ("Hostile boats", "/hostile", 0, ""),
    ("Stopped", "/stopped", 0, "struck, and have lost their way"),
    ("Turned away", "/turned_away", 0, "went away or gave up"),
    ("Under threat, s", "/under_threat_s", 1, "a hostile boat was within the range to be kept"),
    ("Nearest, m", "/nearest_m", 1, "that a hostile boat came"),
    ("Rounds fired", "/rounds/fired", 0, ""),
    ("Hits", "/rounds/hits", 0, "on hostile boats"),
    ("Neutral hits", "/rounds/neutral_hits", 0, "a round that bursts may strike several"),
    ("Not scored", "/rounds/not_scored", 0, "it was not known where the barrel pointed"),
    ("Bursts", "/rounds/bursts", 0, "at a boat"),
    ("First-round hits", "/rounds/first_round_hits", 0, "bursts whose first round struck a hostile boat"),
    ("Rounds a stop", "/rounds/per_stop", 1, "for each hostile boat that was stopped"),
    ("Rounds left", "/rounds/left", 0, ""),
    ("Stoppages", "/rounds/stoppages", 0, "of the virtual weapon"),
    ("Barrel hot", "/rounds/barrel_hot", 0, "times"),
    ("Calls asked for", "/calls/asked", 0, ""),
    ("Calls in time", "/calls/in_time", 0, ""),
    ("Calls late", "/calls/late", 0, ""),
    ("Calls missing", "/calls/missing", 0, ""),
    ("Calls wrong", "/calls/wrong", 0, "boats called hostile that are neutral, or the reverse"),
];

/// Cells with numbers of a score. Each names its place in the score's JSON.
pub struct Cells<'a> {
    /// The score.
    pub score: &'a Value,
    /// Number of the run on a page that has several.
    run: Option<usize>,
}

impl<'a> Cells<'a> {
    /// Cells of the only score of a page.
    pub const fn of(score: &'a Value) -> Self {
        Self { score, run: None }
    }

    /// Cells of one score among several.
    pub const fn of_run(score: &'a Value, run: usize) -> Self {
        Self { score, run: Some(run) }
    }

    /// A cell with the number at a JSON pointer, shown with so many digits after the point.
    pub fn number(&self, pointer: &str, digits: usize) -> Markup {
        let value = self.score.pointer(pointer);
        let shown = shown(value, digits);
        html! { td.number data-run=[self.run] data-score=(pointer) data-value=[value.filter(|v| v.is_number()).map(Value::to_string)] { (shown) } }
    }

    /// The text at a JSON pointer, in one line.
    pub fn text(&self, pointer: &str) -> String {
        self.score.pointer(pointer).and_then(Value::as_str).map_or_else(|| "-".to_owned(), one_line)
    }

    /// Entries of the list at a JSON pointer.
    pub fn count(&self, pointer: &str) -> usize {
        self.score.pointer(pointer).and_then(Value::as_array).map_or(0, Vec::len)
    }
}

/// A number of the score as the pages show it.
pub fn shown(value: Option<&Value>, digits: usize) -> String {
    value.and_then(Value::as_f64).map_or_else(|| "-".to_owned(), |number| format!("{number:.digits$}"))
}
