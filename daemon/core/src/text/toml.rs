//! The one way to read TOML: raw structs that serde derives, checked into values in one place.
//!
//! A raw struct says which keys a table has ([`OptionalKey`] for one that may be left out, [`RequiredKey`] for one that may not). A
//! [`ValueRule`] says which values a key may have. [`TomlText`] reads the struct and applies the rules. Every refusal is a
//! [`TomlError`]: origin, line, column, key, the value as it is written, and what is allowed.

mod rules;

use std::{borrow::Cow, fmt::Display, ops::Range};

use ::toml::de::{DeTable, DeValue, Deserializer};
use serde::{Deserialize, de::IgnoredAny};

pub use self::rules::{
    BareOrQuoted, ValueRule, date_and_time, list_of, number, one_of, plain_text, positive, whole, yes_no,
};
pub use ::toml::Spanned;

use super::{line_column, one_line};

/// Longest text that is read, bytes. The longest scenario of 64 boats and 100 waypoints each has a fifth of it.
pub const TEXT_BYTES_MAX: usize = 1 << 20;
/// Longest quotation of a value in an error, characters.
const QUOTED_MAX: usize = 40;

/// Why a text is refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{origin}:{line}:{column}: {}{problem}", if key.is_empty() { String::new() } else { format!("{key}: ") })]
pub struct TomlError {
    /// Name of the text: a file name, usually.
    pub origin: String,
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// Path of the key, as `boat[2].speed_kn`; empty where the text is no TOML.
    pub key: String,
    /// The mistake: the value as it is written, and the values that are allowed.
    pub problem: String,
}

/// Place of a value, for checks that come after reading.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TomlPlace {
    origin: String,
    line: usize,
    column: usize,
    key: String,
}

impl TomlPlace {
    /// The place of a key that no text holds.
    pub fn nowhere(key: &str) -> Self {
        Self { origin: String::new(), line: 1, column: 1, key: key.to_owned() }
    }

    /// An error there.
    pub fn error(&self, problem: impl Display) -> TomlError {
        let Self { origin, line, column, key } = self.clone();
        TomlError { origin, line, column, key: one_line(&key), problem: one_line(&problem.to_string()) }
    }

    /// The same place for another key.
    #[must_use]
    pub fn of_key(self, key: impl Into<String>) -> Self {
        Self { key: key.into(), ..self }
    }
}

/// A value of the expected kind, or of any other, which the rule then refuses with its place.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
pub enum Loose<T> {
    /// Of the expected kind.
    Fits(T),
    /// Of another kind.
    Other(IgnoredAny),
}

/// A key that has to be there.
pub type RequiredKey<T> = Spanned<Loose<T>>;
/// A key that may be left out.
pub type OptionalKey<T> = Option<RequiredKey<T>>;

/// Former name of a key. It is read, with a warning that names the new one.
#[derive(Clone, Copy, Debug)]
pub struct RenamedKey {
    /// Path of the table, as `gpu`; empty for the root.
    pub table: &'static str,
    /// The former name.
    pub old: &'static str,
    /// The name.
    pub new: &'static str,
}

/// The text that is read.
#[derive(Clone, Copy, Debug)]
pub struct TomlText<'a> {
    text: &'a str,
    origin: &'a str,
}

impl<'a> TomlText<'a> {
    /// A text; `origin` is its name in errors.
    ///
    /// # Errors
    /// Where it is longer than [`TEXT_BYTES_MAX`].
    pub fn new(text: &'a str, origin: &'a str) -> Result<Self, TomlError> {
        let whole = Self { text, origin };
        if text.len() > TEXT_BYTES_MAX {
            let problem = format!("has {} bytes; give at most {TEXT_BYTES_MAX}", text.len());
            return Err(whole.at(0).error(problem));
        }
        Ok(whole)
    }

    /// The raw struct of the text, and warnings about former names of keys.
    ///
    /// # Errors
    /// Where the text is no TOML, a key is unknown or missing, or a table is no table.
    pub fn read<T: for<'de> Deserialize<'de>>(
        self,
        renamed: &[RenamedKey],
    ) -> Result<(T, Vec<String>), TomlError> {
        let syntax = |e: ::toml::de::Error| self.at(e.span().map_or(0, |s| s.start)).error(e.message());
        let mut document = DeTable::parse(self.text).map_err(syntax)?;
        let mut warnings = Vec::new();
        for key in renamed {
            warnings.extend(self.rename(document.get_mut(), key)?);
        }
        let raw = T::deserialize(Deserializer::from(document)).map_err(|e| self.explain(&e))?;
        Ok((raw, warnings))
    }

    /// Gives a key its new name; the warning about it.
    fn rename(self, root: &mut DeTable<'_>, key: &RenamedKey) -> Result<Option<String>, TomlError> {
        let table = match key.table {
            "" => Some(root),
            path => match root.get_mut(path).map(Spanned::get_mut) {
                Some(DeValue::Table(table)) => Some(table),
                _ => None,
            },
        };
        let Some(table) = table else { return Ok(None) };
        let Some((name, value)) = table.remove_entry(key.old) else { return Ok(None) };
        let path =
            if key.table.is_empty() { key.old.to_owned() } else { format!("{}.{}", key.table, key.old) };
        let place = self.at(name.span().start).of_key(path);
        if table.contains_key(key.new) {
            return Err(place.error(format!("is the former name of {}; leave it out", key.new)));
        }
        table.insert(Spanned::new(name.span(), Cow::Borrowed(key.new)), value);
        let warning = format!(
            "is now called {}; the former name will not be read any longer in the next version",
            key.new
        );
        Ok(Some(place.error(warning).to_string()))
    }

    /// The value of a key that may be left out.
    ///
    /// # Errors
    /// Where the rule does not allow the value.
    pub fn given<R, V>(
        self,
        value: &OptionalKey<R>,
        rule: ValueRule<'_, R, V>,
    ) -> Result<Option<V>, TomlError> {
        value.as_ref().map(|value| self.needed(value, rule)).transpose()
    }

    /// The value of a key that has to be there.
    ///
    /// # Errors
    /// Where the rule does not allow the value.
    pub fn needed<R, V>(self, value: &RequiredKey<R>, rule: ValueRule<'_, R, V>) -> Result<V, TomlError> {
        let checked = match value.get_ref() {
            Loose::Fits(raw) => rule.check(raw),
            Loose::Other(_) => None,
        };
        checked.ok_or_else(|| self.refuse(value, &rule.allowed))
    }

    /// The error that a value is not allowed.
    pub fn refuse<T>(self, value: &Spanned<T>, allowed: &str) -> TomlError {
        self.error(value, format!("{} is not allowed; give {allowed}", self.written(&value.span())))
    }

    /// Refuses the first key that is there although it is none of `allowed`.
    ///
    /// # Errors
    /// With `problem` at that key's value.
    pub fn only(
        self,
        keys: impl IntoIterator<Item = KeyPlace>,
        allowed: &[&str],
        problem: impl FnOnce() -> String,
    ) -> Result<(), TomlError> {
        let foreign = keys.into_iter().filter(|(key, _)| !allowed.contains(key)).find_map(|(_, value)| value);
        foreign.map_or(Ok(()), |value| Err(self.error(&value, problem())))
    }

    /// An error about a value.
    pub fn error<T>(self, value: &Spanned<T>, problem: impl Display) -> TomlError {
        self.place(value).error(problem)
    }

    /// Place of a value.
    pub fn place<T>(self, value: &Spanned<T>) -> TomlPlace {
        self.at(value.span().start).of_key(self.path(&value.span()))
    }

    /// Place of a value, under a name of the caller's.
    pub fn place_as<T>(self, value: &Spanned<T>, key: impl Into<String>) -> TomlPlace {
        self.at(value.span().start).of_key(key)
    }

    /// The root, for keys that it lacks.
    pub fn root(self) -> TomlSection<'a> {
        TomlSection { text: self, path: String::new(), start: 0 }
    }

    /// A table of the root, `name`; one of defaults where the text has none.
    pub fn section<T: Default>(self, name: &str, table: Option<Spanned<T>>) -> (TomlSection<'a>, T) {
        let start = table.as_ref().map_or(0, |table| table.span().start);
        (
            TomlSection { text: self, path: name.to_owned(), start },
            table.map(Spanned::into_inner).unwrap_or_default(),
        )
    }

    /// The tables of a list of the root, `name`.
    ///
    /// # Errors
    /// Where there are more than `max`.
    pub fn sections<T>(
        self,
        name: &str,
        tables: Vec<Spanned<T>>,
        max: usize,
    ) -> Result<Vec<(TomlSection<'a>, T)>, TomlError> {
        self.root().sections(name, tables, max)
    }

    /// The place of a byte.
    fn at(self, offset: usize) -> TomlPlace {
        let (line, column) = line_column(self.text, offset);
        TomlPlace { origin: self.origin.to_owned(), line, column, key: String::new() }
    }

    /// The text of a span, cut to one short line.
    fn written(self, span: &Range<usize>) -> String {
        let written = self.text.get(span.clone()).unwrap_or_default();
        let first = written.lines().next().unwrap_or_default();
        if first.chars().count() > QUOTED_MAX || first.len() < written.len() {
            format!("{}...", first.chars().take(QUOTED_MAX - 3).collect::<String>())
        } else {
            first.to_owned()
        }
    }

    /// Path of the key or value that stands there; the deepest of several.
    fn path(self, span: &Range<usize>) -> String {
        let mut path = String::new();
        if let Ok(document) = DeTable::parse(self.text) {
            find_in_table(document.get_ref(), span, "", &mut path);
        }
        path
    }

    /// The error of a serde type in this text's words. What is not understood is told as it is.
    fn explain(self, error: &::toml::de::Error) -> TomlError {
        let span = error.span().unwrap_or(0..0);
        let place = self.at(span.start).of_key(self.path(&span));
        let message = error.message();
        let mut names = message.split('`').skip(1).step_by(2);
        if message.starts_with("unknown field") {
            let unknown = names.next().unwrap_or_default().to_owned();
            let known: Vec<&str> = names.collect();
            let nearest = known.iter().map(|k| (strsim::damerau_levenshtein(k, &unknown), k)).min();
            let hint = match nearest {
                Some((distance, name)) if distance <= 1 + unknown.len() / 3 => {
                    format!("; did you mean {name}?")
                }
                _ => String::new(),
            };
            return place.error(format!("unknown key; known are {}{hint}", known.join(", ")));
        }
        if message.starts_with("missing field") {
            let (table, missing) = (place.key.clone(), names.next().unwrap_or_default());
            let key = if table.is_empty() { missing.to_owned() } else { format!("{table}.{missing}") };
            return place.of_key(key).error("is missing");
        }
        let Some((_, expected)) = message.split_once(", expected ") else { return place.error(message) };
        let key = place.key.rsplit('.').next().unwrap_or_default().to_owned();
        let allowed = match expected {
            "a sequence" => "a list".to_owned(),
            "a string" => plain_text().allowed,
            "a boolean" => yes_no().allowed,
            kind if kind.starts_with("struct ") && !key.contains('[') => format!("a table: [{key}]"),
            kind if kind.starts_with("struct ") => "a table".to_owned(),
            kind => kind.replace('`', "\""),
        };
        place.error(format!("{} is not allowed; give {allowed}", self.written(&span)))
    }
}

fn find_in_table(table: &DeTable<'_>, span: &Range<usize>, above: &str, path: &mut String) {
    for (key, value) in table.iter() {
        let own =
            if above.is_empty() { key.get_ref().to_string() } else { format!("{above}.{}", key.get_ref()) };
        if key.span() == *span {
            own.clone_into(path);
        }
        find_in_value(value, span, &own, path);
    }
}

fn find_in_value(value: &Spanned<DeValue<'_>>, span: &Range<usize>, own: &str, path: &mut String) {
    if value.span() == *span {
        own.clone_into(path);
    }
    match value.get_ref() {
        DeValue::Table(table) => find_in_table(table, span, own, path),
        // Only lists of tables number their parts: the parts of a plain list are no keys.
        DeValue::Array(items) => {
            for (i, item) in items.iter().enumerate() {
                let part =
                    if item.get_ref().is_table() { format!("{own}[{}]", i + 1) } else { own.to_owned() };
                find_in_value(item, span, &part, path);
            }
        }
        _ => {}
    }
}

/// A key of a table with the place of its value; `None` where it is left out.
pub type KeyPlace = (&'static str, Option<Spanned<()>>);

/// A key and the place of its value.
pub fn key_place<T>(key: &'static str, value: &Option<Spanned<T>>) -> KeyPlace {
    (key, value.as_ref().map(|value| Spanned::new(value.span(), ())))
}

/// A table of the text: names the keys that it lacks.
#[derive(Clone, Debug)]
pub struct TomlSection<'a> {
    /// The whole text.
    pub text: TomlText<'a>,
    path: String,
    start: usize,
}

impl<'a> TomlSection<'a> {
    /// The value of a key that has to be there.
    ///
    /// # Errors
    /// Where it is left out, or the rule does not allow the value.
    pub fn required<R, V>(
        &self,
        key: &str,
        value: &OptionalKey<R>,
        rule: ValueRule<'_, R, V>,
    ) -> Result<V, TomlError> {
        match value {
            Some(value) => self.text.needed(value, rule),
            None => Err(self.missing(key, &rule.allowed)),
        }
    }

    /// The tables of a list in this one, `name`.
    ///
    /// # Errors
    /// Where there are more than `max`.
    pub fn sections<T>(
        &self,
        name: &str,
        tables: Vec<Spanned<T>>,
        max: usize,
    ) -> Result<Vec<(TomlSection<'a>, T)>, TomlError> {
        let (text, own) = (self.text, self.path_of(name));
        if let Some(beyond) = tables.get(max) {
            let problem = format!("at most {max} tables are allowed: [[{name}]]");
            return Err(text.at(beyond.span().start).of_key(own).error(problem));
        }
        let section = |(i, table): (usize, Spanned<T>)| {
            let (path, start) = (format!("{own}[{}]", i + 1), table.span().start);
            (TomlSection { text, path, start }, table.into_inner())
        };
        Ok(tables.into_iter().enumerate().map(section).collect())
    }

    /// The error that a key is left out.
    pub fn missing(&self, key: &str, allowed: &str) -> TomlError {
        self.error(key, format!("is missing; give {allowed}"))
    }

    /// An error about a key, at the table's start.
    pub fn error(&self, key: &str, problem: impl Display) -> TomlError {
        self.place(key).error(problem)
    }

    /// Place of the table, under the name of a key.
    pub fn place(&self, key: &str) -> TomlPlace {
        self.text.at(self.start).of_key(self.path_of(key))
    }

    /// A table within this one, `name`.
    pub fn table<T>(&self, name: &str, table: &Spanned<T>) -> Self {
        TomlSection { text: self.text, path: self.path_of(name), start: table.span().start }
    }

    fn path_of(&self, key: &str) -> String {
        if self.path.is_empty() { key.to_owned() } else { format!("{}.{key}", self.path) }
    }
}

#[cfg(test)]
#[path = "toml_tests.rs"]
mod tests;
