//! The HTML page: a plot a part, its table, its extreme cases, and why its default is the default.

use std::{fmt::Write as _, path::Path};

use anyhow::{Context, Result, anyhow};
use plotters::prelude::*;

use crate::table::Row;

/// What is said of a part above its rows.
#[derive(Clone, Copy, Debug)]
pub struct About {
    /// The part's name, as in the rows.
    pub part: &'static str,
    /// What the truth is and why it shares nothing with what is tested.
    pub truth: &'static str,
    /// Why the default was chosen.
    pub why: &'static str,
}

/// Error over run time, both logarithmic; the product's default is filled.
fn plot(rows: &[&Row]) -> Result<String> {
    let floor = |v: f64| v.max(1e-18);
    let range = |values: &mut dyn Iterator<Item = f64>| {
        let (low, high) = values.fold((f64::INFINITY, 0f64), |(l, h), v| (l.min(v), h.max(v)));
        floor(low) / 3.0..floor(high) * 3.0
    };
    let x = range(&mut rows.iter().map(|r| r.time_ns));
    let y = range(&mut rows.iter().map(|r| r.error));
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, (860, 420)).into_drawing_area();
        area.fill(&WHITE).map_err(|e| anyhow!("plot: {e}"))?;
        let unit = rows.first().map_or("", |r| r.error_unit);
        let mut chart = ChartBuilder::on(&area)
            .margin(12)
            .x_label_area_size(42)
            .y_label_area_size(84)
            .build_cartesian_2d(x.log_scale(), y.log_scale())
            .map_err(|e| anyhow!("plot: {e}"))?;
        chart
            .configure_mesh()
            .x_desc("run time of one use, ns")
            .y_desc(format!("error, {unit}"))
            .x_label_formatter(&|v| format!("{v:.0e}"))
            .y_label_formatter(&|v| format!("{v:.0e}"))
            .draw()
            .map_err(|e| anyhow!("plot: {e}"))?;
        let mut front: Vec<(f64, f64)> =
            rows.iter().filter(|r| r.pareto).map(|r| (r.time_ns, floor(r.error))).collect();
        front.sort_by(|a, b| a.0.total_cmp(&b.0));
        chart
            .draw_series(LineSeries::new(front, RGBColor(150, 150, 150)))
            .map_err(|e| anyhow!("plot: {e}"))?;
        for row in rows {
            let at = (row.time_ns, floor(row.error));
            let colour = if row.default { RGBColor(200, 60, 20) } else { RGBColor(30, 90, 160) };
            let style = if row.default { colour.filled() } else { colour.stroke_width(2) };
            chart
                .draw_series(std::iter::once(
                    EmptyElement::at(at)
                        + Circle::new((0, 0), 5, style)
                        + Text::new(format!("{} {}", row.method, row.setting), (8, -6), ("sans-serif", 12)),
                ))
                .map_err(|e| anyhow!("plot: {e}"))?;
        }
        area.present().map_err(|e| anyhow!("plot: {e}"))?;
    }
    Ok(svg)
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;")
}

fn table(html: &mut String, rows: &[&Row]) -> Result<()> {
    html.push_str("<table><tr><th>scene<th>method<th>setting<th>error<th>unit<th>time, ns<th>memory, B<th>front<th>note</tr>\n");
    for r in rows {
        let mark = if r.default { " class=default" } else { "" };
        writeln!(
            html,
            "<tr{mark}><td>{}<td>{}<td>{}<td>{:.3e}<td>{}<td>{:.1}<td>{}<td>{}<td>{}</tr>",
            escape(&r.scene),
            escape(&r.method),
            escape(&r.setting),
            r.error,
            r.error_unit,
            r.time_ns,
            r.memory_bytes,
            if r.pareto { "yes" } else { "" },
            escape(&r.note)
        )?;
    }
    html.push_str("</table>\n");
    Ok(())
}

/// Writes the page and its plots (inside it, so that it opens from disk).
pub fn write(path: &Path, abouts: &[About], rows: &[Row]) -> Result<()> {
    let mut html = String::from(
        "<!doctype html><meta charset=utf-8><title>Bowwave: error against run time</title><style>body{font:15px \
         sans-serif;max-width:70em;margin:2em auto}table{border-collapse:collapse}td,th{border:1px solid \
         #ccc;padding:.2em .6em;text-align:left}.default{background:#fdebe0}</style><h1>Error against run time</h1>\
         <p>Shaded rows and filled points are what the product uses. The grey line is the Pareto front. Times are medians on \
         the machine that made this page: compare them with each other only.</p>\n",
    );
    for about in abouts {
        writeln!(html, "<h2>{}</h2><p>Truth: {}</p><p>Default: {}</p>", about.part, about.truth, about.why)?;
        let of_part: Vec<&Row> = rows.iter().filter(|r| r.part == about.part).collect();
        let mut scenes: Vec<&str> = of_part.iter().filter(|r| !r.extreme).map(|r| r.scene.as_str()).collect();
        scenes.dedup();
        for scene in scenes {
            let ranked: Vec<&Row> =
                of_part.iter().copied().filter(|r| !r.extreme && r.scene == scene).collect();
            writeln!(html, "<h3>{}</h3>{}", escape(scene), plot(&ranked)?)?;
            table(&mut html, &ranked)?;
        }
        let extreme: Vec<&Row> = of_part.iter().copied().filter(|r| r.extreme).collect();
        if !extreme.is_empty() {
            html.push_str("<h3>Stiff and extreme cases</h3>");
            table(&mut html, &extreme)?;
        }
    }
    std::fs::write(path, html).with_context(|| format!("cannot write {}", path.display()))
}
