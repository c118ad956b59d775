//! Tables and pictures that were measured and drawn in this run, as HTML that fetches nothing.

use std::{fmt::Write as _, io::Cursor};

use anyhow::{Context as _, Result};
use base64::{Engine as _, engine::general_purpose::STANDARD};
use image::{ExtendedColorType, ImageEncoder as _, RgbImage, codecs::png};

use crate::page::{escape, number, time};

/// Width of a picture on the page at most, pixels: two stand side by side.
const PAGE_PX: u32 = 480;

/// One cell of a table.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// Words.
    Text(String),
    /// A measured number; nothing where there is none.
    Number(Option<f64>),
    /// A run time in nanoseconds; nothing where nothing was timed.
    Time(Option<f64>),
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<f64> for Cell {
    fn from(value: f64) -> Self {
        Self::Number(Some(value))
    }
}

/// A line of a table.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// Its cells.
    pub cells: Vec<Cell>,
    /// Whether it is what the product does.
    pub is_product: bool,
}

impl Line {
    /// A line of something else.
    pub fn new<const N: usize>(cells: [Cell; N]) -> Self {
        Self { cells: cells.into(), is_product: false }
    }

    /// Marks what the product does.
    pub fn product_if(self, is_product: bool) -> Self {
        Self { is_product, ..self }
    }
}

/// A measured table.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Words above it.
    pub caption: String,
    /// Titles of the columns.
    pub titles: Vec<&'static str>,
    /// Lines.
    pub lines: Vec<Line>,
}

/// A picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Words below it.
    pub caption: String,
    /// Words in its place, for who does not see it.
    pub alt: String,
    /// PNG or SVG as `data:` address.
    address: String,
    width: u32,
}

impl Figure {
    /// A picture as PNG.
    pub fn new(caption: impl Into<String>, alt: impl Into<String>, picture: &RgbImage) -> Result<Self> {
        let mut bytes = Cursor::new(Vec::new());
        png::PngEncoder::new_with_quality(&mut bytes, png::CompressionType::Best, png::FilterType::Adaptive)
            .write_image(picture.as_raw(), picture.width(), picture.height(), ExtendedColorType::Rgb8)
            .context("cannot code a picture as PNG")?;
        let address = format!("data:image/png;base64,{}", STANDARD.encode(bytes.into_inner()));
        Ok(Self { caption: caption.into(), alt: alt.into(), address, width: picture.width() })
    }

    /// A drawing that is SVG already.
    pub fn of_svg(caption: impl Into<String>, alt: impl Into<String>, svg: &[u8]) -> Self {
        let address = format!("data:image/svg+xml;base64,{}", STANDARD.encode(svg));
        Self { caption: caption.into(), alt: alt.into(), address, width: 640 }
    }
}

/// Evidence of a row.
#[derive(Clone, Debug, PartialEq)]
pub enum Exhibit {
    /// A measured table.
    Table(Table),
    /// Pictures side by side.
    Figures(Vec<Figure>),
    /// Why there is nothing.
    Missing(String),
}

impl Exhibit {
    /// Writes it as HTML.
    pub fn write(&self, html: &mut String) -> Result<()> {
        match self {
            Self::Table(table) => table.write(html),
            Self::Missing(words) => Ok(writeln!(html, "<p class=bad>{}</p>", escape(words))?),
            Self::Figures(figures) => {
                html.push_str("<div class=figures>");
                for figure in figures {
                    writeln!(
                        html,
                        "<figure style=\"max-width:{}px\"><img alt=\"{}\" src=\"{}\"><figcaption>{}</figcaption></figure>",
                        figure.width.min(PAGE_PX),
                        escape(&figure.alt),
                        figure.address,
                        escape(&figure.caption)
                    )?;
                }
                html.push_str("</div>\n");
                Ok(())
            }
        }
    }
}

impl Table {
    fn write(&self, html: &mut String) -> Result<()> {
        write!(html, "<p class=small>{}</p><div class=box><table><tr>", escape(&self.caption))?;
        let is_number = |column: usize| {
            self.lines.iter().any(|l| !matches!(l.cells.get(column), Some(Cell::Text(_)) | None))
        };
        for (column, title) in self.titles.iter().enumerate() {
            write!(html, "<th{}>{}", if is_number(column) { " class=n" } else { "" }, escape(title))?;
        }
        html.push_str("</tr>\n");
        for line in &self.lines {
            html.push_str(if line.is_product { "<tr class=default>" } else { "<tr>" });
            for cell in &line.cells {
                match cell {
                    Cell::Text(text) => write!(html, "<td>{}", escape(text))?,
                    Cell::Number(value) => {
                        write!(html, "<td class=n>{}", value.map(number).unwrap_or_default())?;
                    }
                    Cell::Time(ns) => write!(html, "<td class=n>{}", ns.map(time).unwrap_or_default())?,
                }
            }
            html.push_str("</tr>\n");
        }
        html.push_str("</table></div>\n");
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_lies_in_the_page_with_its_words() {
        let picture = RgbImage::from_pixel(4, 2, image::Rgb([200, 10, 20]));
        let figure = Figure::new("a \"red\" field", "red", &picture).unwrap();
        let coded = figure.address.strip_prefix("data:image/png;base64,").unwrap().to_owned();
        let back = image::load_from_memory(&STANDARD.decode(coded).unwrap()).unwrap().to_rgb8();
        assert_eq!(back, picture);
        let mut html = String::new();
        Exhibit::Figures(vec![figure]).write(&mut html).unwrap();
        assert!(html.contains("alt=\"red\"") && html.contains("a &quot;red&quot; field"), "{html}");
        assert!(html.contains("src=\"data:image/png"));
    }

    #[test]
    fn numbers_stand_to_the_right_and_the_products_line_is_marked() {
        let table = Table {
            caption: "Measured".into(),
            titles: vec!["way", "error"],
            lines: vec![
                Line::new(["one".into(), 0.25.into()]).product_if(true),
                Line::new(["none".into(), Cell::Number(None)]),
            ],
        };
        let mut html = String::new();
        table.write(&mut html).unwrap();
        assert!(html.contains("<th>way<th class=n>error"), "{html}");
        assert!(html.contains("<tr class=default><td>one<td class=n>0.250</tr>"), "{html}");
        assert!(html.contains("<tr><td>none<td class=n></tr>"), "{html}");
    }
}
