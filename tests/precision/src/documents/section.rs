//! The part of a page that goes through the documents row by row.

use std::fmt::Write as _;

use anyhow::{Context as _, Result};

use super::{Cell, DocumentRow, Exhibit, Line, PartTable, Source, Table, Workshop, rows};
use crate::{front, page::escape, row::ReportRow};

/// The rows of both documents with what was made for them.
#[derive(Default)]
pub struct Section {
    made: Vec<(&'static DocumentRow, Vec<Exhibit>)>,
}

impl Section {
    /// All rows, each with its own tables and pictures if `with_exhibits`.
    pub fn of_all(workshop: Option<&Workshop>) -> Result<Self> {
        Self::of(rows(), workshop)
    }

    /// These rows; without a workshop only tables of the report's parts.
    pub fn of(
        rows: impl IntoIterator<Item = &'static DocumentRow>,
        workshop: Option<&Workshop>,
    ) -> Result<Self> {
        let mut made = Vec::new();
        for row in rows {
            let exhibits = match (workshop, row.exhibits) {
                (Some(workshop), Some(make)) => {
                    eprintln!("documents: {}", row.id);
                    make(workshop).with_context(|| format!("row {}", row.id))?
                }
                _ => Vec::new(),
            };
            made.push((row, exhibits));
        }
        Ok(Self { made })
    }

    /// Whether there is nothing to show.
    pub fn is_empty(&self) -> bool {
        self.made.is_empty()
    }

    /// Links to all rows.
    pub fn contents(&self) -> String {
        let link = |row: &DocumentRow| format!("<a href=\"#{}\">{}</a>", anchor(row), escape(row.name));
        let of = |source: Source| {
            let links: Vec<String> =
                self.made.iter().filter(|(row, _)| row.source == source).map(|(row, _)| link(row)).collect();
            if links.is_empty() {
                return String::new();
            }
            format!("<p class=small>{}: {}</p>\n", escape(source.title()), links.join(" · "))
        };
        Source::ALL.map(of).concat()
    }

    /// The section as HTML, with tables of the measured `rows`.
    pub fn html(&self, rows: &[ReportRow]) -> Result<String> {
        let mut html = String::from(
            "<h2 id=\"documents\">Source documents</h2><p>Each row of the two documents on light and shadow: what the passage does as printed, where that \
             breaks, and what the product does. Tables are measured and pictures are drawn in the run that made this page. Lines on yellow are the \
             product's.</p>\n",
        );
        for source in Source::ALL {
            let mut of = self.made.iter().filter(|(row, _)| row.source == source).peekable();
            if of.peek().is_some() {
                write!(html, "<h3>{}</h3>", escape(source.title()))?;
            }
            for (row, exhibits) in of {
                write_row(&mut html, row, exhibits, rows)?;
            }
        }
        Ok(html)
    }
}

/// Address of a row within the page.
fn anchor(row: &DocumentRow) -> String {
    format!("documents-{}", row.id)
}

fn write_row(html: &mut String, row: &DocumentRow, exhibits: &[Exhibit], rows: &[ReportRow]) -> Result<()> {
    let commands: Vec<String> = row.commands.iter().map(|c| format!("<code>{}</code>", escape(c))).collect();
    writeln!(
        html,
        "<h4 id=\"{}\">{}</h4><dl><dt>Passage<dd>{}<dt>Printed<dd>{}<dt>Breaks<dd>{}<dt>Product<dd>{}<dt>Command<dd>{}</dl>",
        anchor(row),
        escape(row.name),
        escape(row.passage),
        escape(row.printed),
        escape(row.breaks),
        escape(row.product),
        commands.join("<br>")
    )?;
    for table in row.tables {
        let found = table.filled(rows);
        if found.lines.is_empty() {
            let missing = format!("Part {} was not measured in this run.", table.part);
            writeln!(html, "<p class=small>{}</p>", escape(&missing))?;
        } else {
            Exhibit::Table(found).write(html)?;
        }
    }
    exhibits.iter().try_for_each(|exhibit| exhibit.write(html))
}

impl PartTable {
    /// The table from measured rows.
    pub fn filled(&self, rows: &[ReportRow]) -> Table {
        let has = |names: &[&str], of: &[&str]| {
            names.is_empty() || names.iter().any(|name| of.iter().any(|text| text.contains(name)))
        };
        let chosen = |r: &&ReportRow| {
            r.part == self.part
                && has(self.scenes, &[&r.scene])
                && (r.default || has(self.methods, &[&r.method, &r.setting]))
        };
        let mut last = "";
        let lines = rows.iter().filter(chosen).map(|r| {
            let scene = if r.scene == last { "" } else { r.scene.as_str() };
            last = &r.scene;
            line_of(r, scene, rows)
        });
        Table {
            caption: format!("{} (part {})", self.caption, self.part),
            lines: lines.collect(),
            titles: vec!["scene", "method", "setting", "error", "unit", "time", "time, ratio", "note"],
        }
    }
}

fn line_of(r: &ReportRow, scene: &str, rows: &[ReportRow]) -> Line {
    let is_rival = |d: &&ReportRow| d.default && !d.is_extreme() && d.part == r.part && d.scene == r.scene;
    let default = rows.iter().find(is_rival).filter(|_| !r.is_extreme());
    let cells = [
        scene.into(),
        r.method.as_str().into(),
        r.setting.as_str().into(),
        r.error.into(),
        r.error_unit.into(),
        Cell::Time(r.time_ns()),
        Cell::Number(default.map(|d| front::ratio(r, d).log.exp())),
        r.note.as_str().into(),
    ];
    Line::new(cells).product_if(r.default)
}
