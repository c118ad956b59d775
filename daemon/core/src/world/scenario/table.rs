//! Reads one TOML table key by key and says exactly what is wrong where.

use std::{fmt::Write, ops::RangeInclusive};

use toml::{
    Spanned,
    de::{DeTable, DeValue},
};

use super::ScenarioError;
use crate::text::{line_column, one_line};

/// A place in the text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mark {
    line: usize,
    column: usize,
}

impl Mark {
    /// The place of a byte.
    pub fn at(text: &str, offset: usize) -> Self {
        let (line, column) = line_column(text, offset);
        Self { line, column }
    }

    /// An error at this place. `origin` is the name of the text, `key` the path of the key.
    pub fn error(self, origin: &str, key: &str, problem: String) -> ScenarioError {
        let Self { line, column } = self;
        ScenarioError {
            origin: origin.to_owned(),
            line,
            column,
            key: one_line(key),
            problem: one_line(&problem),
        }
    }
}

/// The text that is being read.
#[derive(Clone, Copy, Debug)]
pub struct Source<'a> {
    /// Its characters.
    pub text: &'a str,
    /// Its name in errors.
    pub origin: &'a str,
}

/// A table of the text, or the defaults where the text has none.
#[derive(Clone, Debug)]
pub struct Table<'a> {
    source: Source<'a>,
    /// Path of the table with a dot at its end; empty for the root.
    path: String,
    entries: Option<&'a DeTable<'a>>,
    /// Where the table starts.
    start: usize,
}

type Value<'a> = &'a Spanned<DeValue<'a>>;

impl<'a> Table<'a> {
    /// The whole document.
    pub fn root(source: Source<'a>, document: &'a Spanned<DeTable<'a>>) -> Self {
        let (entries, start) = (Some(document.get_ref()), document.span().start);
        Self { source, path: String::new(), entries, start }
    }

    /// Refuses keys other than `keys`.
    pub fn only(&self, keys: &[&str]) -> Result<(), ScenarioError> {
        let Some(entries) = self.entries else { return Ok(()) };
        match entries.keys().find(|key| !keys.contains(&key.get_ref().as_ref())) {
            None => Ok(()),
            Some(key) => {
                let place = Mark::at(self.source.text, key.span().start);
                let path = format!("{}{}", self.path, key.get_ref());
                Err(place.error(
                    self.source.origin,
                    &path,
                    format!("unknown key; known are {}", keys.join(", ")),
                ))
            }
        }
    }

    /// Whether the key is there.
    pub fn has(&self, key: &str) -> bool {
        self.get(key).is_some()
    }

    fn get(&self, key: &str) -> Option<Value<'a>> {
        self.entries?.iter().find(|(k, _)| k.get_ref().as_ref() == key).map(|(_, value)| value)
    }

    /// Where a key's value stands, or the table's start where it is left out.
    pub fn mark(&self, key: &str) -> Mark {
        Mark::at(self.source.text, self.get(key).map_or(self.start, |v| v.span().start))
    }

    /// An error about a key.
    pub fn error(&self, key: &str, problem: impl Into<String>) -> ScenarioError {
        self.mark(key).error(self.source.origin, &format!("{}{key}", self.path), problem.into())
    }

    fn written(&self, value: Value<'a>) -> String {
        let written = self.source.text.get(value.span()).unwrap_or_default();
        let first_line = written.lines().next().unwrap_or_default();
        if first_line.chars().count() > 40 || first_line.len() < written.len() {
            format!("{}...", first_line.chars().take(37).collect::<String>())
        } else {
            first_line.to_owned()
        }
    }

    fn refuse<T>(&self, key: &str, value: Value<'a>, allowed: &str) -> Result<T, ScenarioError> {
        Err(self.error(key, format!("{} is not allowed; give {allowed}", self.written(value))))
    }

    /// A number within `range`, in `unit`; `None` where the key is left out.
    pub fn number(
        &self,
        key: &str,
        range: RangeInclusive<f64>,
        unit: &str,
    ) -> Result<Option<f64>, ScenarioError> {
        let Some(value) = self.get(key) else { return Ok(None) };
        match as_number(value.get_ref()) {
            Some(number) if range.contains(&number) => Ok(Some(number)),
            _ => self.refuse(key, value, &bounds(&range, unit)),
        }
    }

    /// A number that must be there.
    pub fn required_number(
        &self,
        key: &str,
        range: RangeInclusive<f64>,
        unit: &str,
    ) -> Result<f64, ScenarioError> {
        self.number(key, range.clone(), unit)?.ok_or_else(|| self.missing(key, &bounds(&range, unit)))
    }

    /// A whole number within `range`; `None` where the key is left out.
    pub fn integer(&self, key: &str, range: RangeInclusive<i64>) -> Result<Option<i64>, ScenarioError> {
        let Some(value) = self.get(key) else { return Ok(None) };
        match as_integer(value.get_ref()) {
            Some(number) if range.contains(&number) => Ok(Some(number)),
            _ => self.refuse(key, value, &format!("a whole number, {} to {}", range.start(), range.end())),
        }
    }

    /// A text of 1 to 200 printable characters; `None` where the key is left out.
    pub fn text(&self, key: &str) -> Result<Option<String>, ScenarioError> {
        let Some(value) = self.get(key) else { return Ok(None) };
        match value.get_ref().as_str() {
            Some(s)
                if (1..=200).contains(&s.len())
                    && !s.trim().is_empty()
                    && !s.chars().any(char::is_control) =>
            {
                Ok(Some(s.to_owned()))
            }
            _ => self.refuse(key, value, "a text in quotes, 1 to 200 printable characters"),
        }
    }

    /// A text that must be there.
    pub fn required_text(&self, key: &str, what: &str) -> Result<String, ScenarioError> {
        self.text(key)?.ok_or_else(|| self.missing(key, what))
    }

    /// One of a few names; `None` where the key is left out.
    pub fn choice<T: Copy>(&self, key: &str, names: &[(&str, T)]) -> Result<Option<T>, ScenarioError> {
        let Some(value) = self.get(key) else { return Ok(None) };
        let chosen = value.get_ref().as_str().and_then(|s| names.iter().find(|(name, _)| *name == s));
        match chosen {
            Some((_, meaning)) => Ok(Some(*meaning)),
            None => self.refuse(key, value, &one_of(names)),
        }
    }

    /// One of a few names that must be there.
    pub fn required_choice<T: Copy>(&self, key: &str, names: &[(&str, T)]) -> Result<T, ScenarioError> {
        self.choice(key, names)?.ok_or_else(|| self.missing(key, &one_of(names)))
    }

    /// `true` or `false`; `None` where the key is left out.
    pub fn boolean(&self, key: &str) -> Result<Option<bool>, ScenarioError> {
        let Some(value) = self.get(key) else { return Ok(None) };
        match value.get_ref().as_bool() {
            Some(flag) => Ok(Some(flag)),
            None => self.refuse(key, value, "true or false"),
        }
    }

    /// A date and time, written bare or as text; `None` where the key is left out.
    pub fn date_time(&self, key: &str) -> Result<Option<toml::value::Datetime>, ScenarioError> {
        let Some(value) = self.get(key) else { return Ok(None) };
        let parsed = match value.get_ref() {
            DeValue::Datetime(stamp) => Some(*stamp),
            other => other.as_str().and_then(|s| s.parse().ok()),
        };
        match parsed {
            Some(stamp) => Ok(Some(stamp)),
            None => self.refuse(key, value, "a time like \"2026-06-01T12:00:00Z\""),
        }
    }

    /// A list of numbers within `range`; `None` where the key is left out.
    pub fn numbers(
        &self,
        key: &str,
        range: RangeInclusive<f64>,
        what: &str,
    ) -> Result<Option<Vec<f64>>, ScenarioError> {
        let Some(value) = self.get(key) else { return Ok(None) };
        let numbers = value.get_ref().as_array().and_then(|items| {
            let number =
                |item: &Spanned<DeValue<'_>>| as_number(item.get_ref()).filter(|n| range.contains(n));
            items.iter().map(number).collect::<Option<Vec<f64>>>()
        });
        match numbers {
            Some(numbers) => Ok(Some(numbers)),
            None => self.refuse(key, value, what),
        }
    }

    /// Pairs of numbers, each within its range; `None` where the key is left out.
    pub fn pairs(
        &self,
        key: &str,
        ranges: [RangeInclusive<f64>; 2],
        what: &str,
    ) -> Result<Option<Vec<[f64; 2]>>, ScenarioError> {
        let Some(value) = self.get(key) else { return Ok(None) };
        let Some(items) = value.get_ref().as_array() else { return self.refuse(key, value, what) };
        let mut pairs = Vec::new();
        for item in items.iter() {
            let numbers: Vec<f64> = item
                .get_ref()
                .as_array()
                .map(|pair| pair.iter().filter_map(|n| as_number(n.get_ref())).collect())
                .unwrap_or_default();
            match numbers[..] {
                [a, b] if ranges[0].contains(&a) && ranges[1].contains(&b) => pairs.push([a, b]),
                _ => {
                    let place = Mark::at(self.source.text, item.span().start);
                    let problem = format!("{} is not allowed; give {what}", self.written(item));
                    return Err(place.error(self.source.origin, &format!("{}{key}", self.path), problem));
                }
            }
        }
        Ok(Some(pairs))
    }

    /// A table below this one; one without entries where the key is left out.
    pub fn table(&self, key: &str) -> Result<Table<'a>, ScenarioError> {
        let path = format!("{}{key}.", self.path);
        let Some(value) = self.get(key) else {
            return Ok(Table { source: self.source, path, entries: None, start: self.start });
        };
        match value.get_ref().as_table() {
            Some(entries) => Ok(self.below(path, value, entries)),
            None => self.refuse(key, value, &format!("a table: [{key}]")),
        }
    }

    /// The tables of a list, at most `max`; none where the key is left out.
    pub fn tables(&self, key: &str, max: usize) -> Result<Vec<Table<'a>>, ScenarioError> {
        let Some(value) = self.get(key) else { return Ok(Vec::new()) };
        let Some(items) = value.get_ref().as_array().filter(|items| items.len() <= max) else {
            return self.refuse(key, value, &format!("at most {max} tables: [[{key}]]"));
        };
        let table = |(i, item): (usize, Value<'a>)| match item.get_ref().as_table() {
            Some(entries) => Ok(self.below(format!("{}{key}[{}].", self.path, i + 1), item, entries)),
            None => self.refuse(key, item, &format!("tables: [[{key}]]")),
        };
        items.iter().enumerate().map(table).collect()
    }

    fn below(&self, path: String, value: Value<'a>, entries: &'a DeTable<'a>) -> Table<'a> {
        Table { source: self.source, path, entries: Some(entries), start: value.span().start }
    }

    /// The error that a key is left out.
    pub fn missing(&self, key: &str, allowed: &str) -> ScenarioError {
        self.error(key, format!("is missing; give {allowed}"))
    }
}

fn as_number(value: &DeValue<'_>) -> Option<f64> {
    match value {
        // Beyond 2^53 a whole number rounds; every range ends long before.
        DeValue::Integer(_) => as_integer(value).map(|i| i as f64),
        DeValue::Float(f) => f.as_str().parse().ok(),
        _ => None,
    }
}

fn as_integer(value: &DeValue<'_>) -> Option<i64> {
    value.as_integer().and_then(|i| i64::from_str_radix(i.as_str(), i.radix()).ok())
}

fn bounds(range: &RangeInclusive<f64>, unit: &str) -> String {
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    format!("a number, {} to {}{unit}", range.start(), range.end())
}

fn one_of<T>(names: &[(&str, T)]) -> String {
    let mut text = String::from("one of");
    for (i, (name, _)) in names.iter().enumerate() {
        // Writing into a String cannot fail.
        let _ = write!(text, "{} \"{name}\"", if i == 0 { "" } else { "," });
    }
    text
}
