//! The one printer of tables: text for the terminal, Markdown for notes, CSV for programs.

use std::fmt::{Display, Write as _};

use anyhow::{Context, Result};

/// A table of text. Its first columns are set to the left, the others to the right; a column is as wide as was asked for or as its
/// title is long.
pub struct TextTable {
    left: usize,
    widths: Vec<usize>,
    text: String,
}

impl TextTable {
    /// Begins with the titles of the columns, `left` of which are set to the left.
    pub fn new<T: AsRef<str>>(left: usize, columns: impl IntoIterator<Item = (T, usize)>) -> Self {
        let columns: Vec<(T, usize)> = columns.into_iter().collect();
        let widths = columns.iter().map(|(title, width)| (*width).max(title.as_ref().chars().count()));
        let mut table = Self { left, widths: widths.collect(), text: String::new() };
        table.row(columns.iter().map(|(title, _)| title.as_ref()));
        table
    }

    /// One more row.
    pub fn row<T: Display>(&mut self, cells: impl IntoIterator<Item = T>) {
        for (i, cell) in cells.into_iter().enumerate() {
            let (cell, width) = (cell.to_string(), self.widths.get(i).copied().unwrap_or(0));
            let gap = if i == 0 { "" } else { " " };
            // Writing to a String cannot fail.
            let _ = if i < self.left {
                write!(self.text, "{gap}{cell:<width$}")
            } else {
                write!(self.text, "{gap}{cell:>width$}")
            };
        }
        self.text.truncate(self.text.trim_end_matches(' ').len());
        self.text.push('\n');
    }

    /// The rows since the last call: for tables whose rows take minutes.
    pub fn take(&mut self) -> String {
        std::mem::take(&mut self.text)
    }
}

/// A table for notes.
pub fn markdown(titles: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let titles: Vec<String> = titles.iter().map(|t| (*t).to_owned()).collect();
    let mut text = line(&titles) + "|" + &"---|".repeat(titles.len()) + "\n";
    rows.into_iter().for_each(|row| text += &line(&row));
    text
}

/// A table for programs (RFC 4180).
pub fn csv(titles: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(titles)?;
    for row in rows {
        writer.write_record(row)?;
    }
    writer.into_inner().context("cannot finish the table")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_as_wide_as_asked_for_or_as_their_titles() {
        let mut table = TextTable::new(1, [("method", 3), ("ms", 5)]);
        assert_eq!(table.take(), "method    ms\n");
        table.row(["a", "1.5"]);
        table.row(["longer than that", "10"]);
        assert_eq!(table.take(), "a        1.5\nlonger than that    10\n");
        assert_eq!(
            markdown(&["a", "b"], [vec!["1".into(), "2".into()]]),
            "| a | b |\n|---|---|\n| 1 | 2 |\n"
        );
        assert_eq!(csv(&["a"], [vec!["x, y".into()]]).unwrap(), b"a\n\"x, y\"\n");
    }
}
