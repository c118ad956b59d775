//! Rules for values: which are allowed, and how that is told.

use std::{fmt::Display, ops::RangeInclusive};

use serde::Deserialize;
use toml::value::Datetime;

/// Which values a key may have: `R` in the text, `V` checked.
pub struct ValueRule<'r, R, V> {
    /// The allowed values, in words.
    pub allowed: String,
    check: ValueCheck<'r, R, V>,
}

/// Gives the checked value where it is allowed.
type ValueCheck<'r, R, V> = Box<dyn Fn(&R) -> Option<V> + 'r>;

impl<'r, R, V> ValueRule<'r, R, V> {
    /// A rule; `check` gives the value where it is allowed.
    pub fn new(allowed: impl Into<String>, check: impl Fn(&R) -> Option<V> + 'r) -> Self {
        Self { allowed: allowed.into(), check: Box::new(check) }
    }

    /// The value, where it is allowed.
    pub fn check(&self, raw: &R) -> Option<V> {
        (self.check)(raw)
    }
}

/// A unit behind a number; nothing where there is none.
fn behind(unit: &str) -> String {
    if unit.is_empty() { String::new() } else { format!(" {unit}") }
}

/// A number within bounds, in a unit. NaN lies within none.
pub fn number(range: RangeInclusive<f64>, unit: &str) -> ValueRule<'static, f64, f64> {
    let allowed = format!("a number, {} to {}{}", range.start(), range.end(), behind(unit));
    ValueRule::new(allowed, move |raw: &f64| range.contains(raw).then_some(*raw))
}

/// A number above zero and up to a limit, in a unit: a standard deviation.
pub fn positive(limit: f64, unit: &str) -> ValueRule<'static, f64, f64> {
    let allowed = format!("a number above 0, up to {limit}{}", behind(unit));
    ValueRule::new(allowed, move |raw: &f64| (*raw > 0.0 && *raw <= limit).then_some(*raw))
}

/// `N` values in a list, each of which `rule` allows.
pub fn list_of<'r, const N: usize, R: 'r, V: 'r>(rule: ValueRule<'r, R, V>) -> ValueRule<'r, Vec<R>, [V; N]> {
    ValueRule::new(format!("a list of {N}, each {}", rule.allowed), move |raw: &Vec<R>| {
        raw.iter().map(|part| rule.check(part)).collect::<Option<Vec<_>>>()?.try_into().ok()
    })
}

/// A whole number within bounds.
pub fn whole<T: TryFrom<i64> + PartialOrd + Display + 'static>(
    range: RangeInclusive<T>,
) -> ValueRule<'static, i64, T> {
    let allowed = format!("a whole number, {} to {}", range.start(), range.end());
    ValueRule::new(allowed, move |raw: &i64| T::try_from(*raw).ok().filter(|n| range.contains(n)))
}

/// A text of 1 to 200 printable characters.
pub fn plain_text() -> ValueRule<'static, String, String> {
    ValueRule::new("a text in quotes, 1 to 200 printable characters", |raw: &String| {
        let printable = !raw.trim().is_empty() && !raw.chars().any(char::is_control);
        (printable && raw.len() <= 200).then(|| raw.clone())
    })
}

/// One of a few names, each with its meaning.
pub fn one_of<'r, T: Copy>(names: &'r [(&'r str, T)]) -> ValueRule<'r, String, T> {
    let quoted: Vec<String> = names.iter().map(|(name, _)| format!("\"{name}\"")).collect();
    ValueRule::new(format!("one of {}", quoted.join(", ")), move |raw: &String| {
        names.iter().find(|(name, _)| name == raw).map(|(_, meaning)| *meaning)
    })
}

/// True or false.
pub fn yes_no() -> ValueRule<'static, bool, bool> {
    ValueRule::new("true or false", |raw: &bool| Some(*raw))
}

/// A date and time as it stands in a text: bare, or in quotes.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
pub enum BareOrQuoted {
    /// Without quotes.
    Bare(Datetime),
    /// In quotes.
    Quoted(String),
}

/// A date, a time or both, bare or in quotes.
pub fn date_and_time() -> ValueRule<'static, BareOrQuoted, Datetime> {
    ValueRule::new("a time like \"2026-06-01T12:00:00Z\"", |raw: &BareOrQuoted| match raw {
        BareOrQuoted::Bare(stamp) => Some(*stamp),
        BareOrQuoted::Quoted(text) => text.parse().ok(),
    })
}
