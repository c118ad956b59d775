//! The HTML page: for each part what is true, who competes, why the default is the default, its plots and tables.

use std::{fmt::Write as _, path::Path};

use anyhow::{Context, Result};

use crate::{documents::Section, front, parts::About, plot, row::ReportRow};

const STYLE: &str = "body{font:16px/1.45 system-ui,sans-serif;max-width:62rem;margin:2rem auto;padding:0 1rem;color:#222}\
h1{font-size:1.9rem}h2{margin-top:3rem;border-bottom:2px solid #ddd}h3{margin:1.8rem 0 .3rem}\
table{border-collapse:collapse;font-size:.85rem;margin:.6rem 0}\
td,th{border-bottom:1px solid #ddd;padding:.2rem .7rem .2rem 0;text-align:left;vertical-align:top}\
td.n,th.n{text-align:right;white-space:nowrap;font-variant-numeric:tabular-nums}\
tr.default{background:#fff0d8}dl{display:grid;grid-template-columns:6rem 1fr;gap:.3rem .8rem}\
dt{font-weight:600}dd{margin:0}.box{overflow-x:auto}svg{max-width:100%;height:auto}\
.bad{color:#b00020;font-weight:600}.small{font-size:.85rem;color:#555}h4{margin:2.2rem 0 .3rem;font-size:1.1rem}\
.figures{display:flex;flex-wrap:wrap;gap:.8rem;align-items:flex-start}figure{margin:.4rem 0}\
figure img{display:block;width:100%;height:auto}figcaption{font-size:.85rem;color:#555}code{font-size:.85rem;overflow-wrap:anywhere}";

const INTRODUCTION: &str = "<h1>Error against run time</h1><p>Each numerical part of the trainer is measured against a truth \
that shares no code with it, and against cheaper and dearer ways of doing the same. Rows on yellow, and ringed points, are what \
the product uses. The grey steps are the Pareto front: what no other way beats in both error and time. Lines join the settings \
of one method.</p><p>The ways of a scene are timed in turns within one run, by the processor's time; they are compared by the \
median ratio of the turns. Faster means by more than the noise, which is what a way differs from itself by (at least a tenth). \
Errors are compared as they are, down to the truth's own; ∞ is what diverges or never gets there. Nanoseconds are medians on the \
machine that made this page: compare them with each other only. Memory is what a way holds plus the most heap that one use \
takes.</p>";

pub(crate) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Three digits, with a raised exponent where there must be one.
pub(crate) fn number(value: f64) -> String {
    if value.is_infinite() {
        return "∞".into();
    }
    if value == 0.0 || (1e-3..1e4).contains(&value.abs()) {
        let digits = if value == 0.0 { 0 } else { (2 - value.abs().log10().floor() as i32).max(0) };
        return format!("{value:.*}", digits as usize);
    }
    let text = format!("{value:.2e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    format!("{mantissa}&thinsp;·&thinsp;10<sup>{exponent}</sup>")
}

pub(crate) fn time(ns: f64) -> String {
    let (value, unit) = match ns {
        n if n < 1e3 => (n, "ns"),
        n if n < 1e6 => (n / 1e3, "µs"),
        n if n < 1e9 => (n / 1e6, "ms"),
        n => (n / 1e9, "s"),
    };
    format!("{}&nbsp;{unit}", number(value))
}

fn bytes(count: usize) -> String {
    match count {
        0 => "–".into(),
        n if n < 10_000 => format!("{n}&nbsp;B"),
        n if n < 10_000_000 => format!("{}&nbsp;kB", n / 1000),
        n => format!("{}&nbsp;MB", n / 1_000_000),
    }
}

fn ranked_table(html: &mut String, rows: &[&ReportRow]) -> Result<()> {
    let unit = rows.first().map_or("", |r| r.error_unit);
    let default = rows.iter().find(|r| r.default);
    write!(
        html,
        "<div class=box><table><tr><th>method<th>setting<th class=n>error, {}<th class=n>time<th class=n>{}\
         <th class=n>memory<th>front<th>note</tr>",
        escape(unit),
        if default.is_some() { "time, ratio" } else { "" },
    )?;
    for r in rows {
        let ratio = default.map_or(String::new(), |d| number(front::ratio(r, d).log.exp()));
        writeln!(
            html,
            "<tr{}><td>{}<td>{}<td class=n>{}<td class=n>{}<td class=n>{}<td class=n>{}<td>{}<td>{}</tr>",
            if r.default { " class=default" } else { "" },
            escape(&r.method),
            escape(&r.setting),
            number(r.error),
            r.time_ns().map(time).unwrap_or_default(),
            ratio,
            bytes(r.memory_bytes),
            if r.on_front { "yes" } else { "" },
            escape(
                &[r.excuse.as_str(), &r.note]
                    .iter()
                    .filter(|t| !t.is_empty())
                    .copied()
                    .collect::<Vec<_>>()
                    .join("; ")
            )
        )?;
    }
    html.push_str("</table></div>\n");
    Ok(())
}

fn extreme_table(html: &mut String, rows: &[&ReportRow]) -> Result<()> {
    html.push_str(
        "<div class=box><table><tr><th>case<th>tried<th>setting<th class=n>worst error<th>unit<th>note</tr>\n",
    );
    let mut last = "";
    for r in rows {
        let case = if r.scene == last { String::new() } else { escape(&r.scene) };
        last = &r.scene;
        writeln!(
            html,
            "<tr{}><td>{case}<td>{}<td>{}<td class=n>{}<td>{}<td>{}</tr>",
            if r.default { " class=default" } else { "" },
            escape(&r.method),
            escape(&r.setting),
            number(r.error),
            escape(r.error_unit),
            escape(&r.note)
        )?;
    }
    html.push_str("</table></div>\n");
    Ok(())
}

/// The defaults, one line a scene.
fn summary(html: &mut String, rows: &[ReportRow]) -> Result<()> {
    html.push_str(
        "<h2>Summary</h2><div class=box><table><tr><th>part<th>scene<th>default<th class=n>error<th>unit\
         <th class=n>time<th>front<th class=n>noise</tr>\n",
    );
    for r in rows.iter().filter(|r| r.default && !r.is_extreme()) {
        let noise = match &r.kind {
            crate::row::RowKind::Ranked(t) => format!("{:.0}&nbsp;%", (t.noise - 1.0) * 100.0),
            crate::row::RowKind::Extreme => String::new(),
        };
        writeln!(
            html,
            "<tr><td><a href=\"#{0}\">{0}</a><td>{1}<td>{2} {3}<td class=n>{4}<td>{5}<td class=n>{6}<td>{7}<td \
             class=n>{noise}</tr>",
            r.part,
            escape(&r.scene),
            escape(&r.method),
            escape(&r.setting),
            number(r.error),
            escape(r.error_unit),
            r.time_ns().map(time).unwrap_or_default(),
            match (r.on_front, r.excuse.as_str()) {
                (true, _) => "yes".into(),
                (false, "") => "<span class=bad>no</span>".into(),
                (false, why) => format!("<span class=bad>no</span>: {}", escape(why)),
            },
        )?;
    }
    html.push_str("</table></div>\n");
    Ok(())
}

fn part_section(html: &mut String, about: &About, rows: &[ReportRow]) -> Result<()> {
    writeln!(
        html,
        "<h2 id=\"{0}\">{0}</h2><p>{1}</p><dl><dt>Truth<dd>{2}<dt>Rivals<dd>{3}<dt>Default<dd>{4}</dl>",
        about.part,
        escape(about.what),
        escape(about.truth),
        escape(about.rivals),
        escape(about.why)
    )?;
    let of_part: Vec<&ReportRow> = rows.iter().filter(|r| r.part == about.part).collect();
    let mut scenes: Vec<&str> = Vec::new();
    for r in of_part.iter().filter(|r| !r.is_extreme()) {
        if !scenes.contains(&r.scene.as_str()) {
            scenes.push(&r.scene);
        }
    }
    for scene in scenes {
        let ranked: Vec<&ReportRow> =
            of_part.iter().copied().filter(|r| !r.is_extreme() && r.scene == scene).collect();
        writeln!(html, "<h3>{}</h3>{}", escape(scene), plot::svg(&ranked)?)?;
        ranked_table(html, &ranked)?;
    }
    let extreme: Vec<&ReportRow> = of_part.iter().copied().filter(|r| r.is_extreme()).collect();
    if !extreme.is_empty() {
        html.push_str("<h3>Stiff and extreme cases</h3>");
        extreme_table(html, &extreme)?;
    }
    Ok(())
}

fn begin(title: &str) -> String {
    format!(
        "<!doctype html><html lang=en><meta charset=utf-8><meta name=viewport content=\"width=device-width\">\
         <title>Bowwave: {title}</title><style>{STYLE}</style>"
    )
}

/// The page of the source documents alone.
pub fn documents_alone(section: &Section, rows: &[ReportRow]) -> Result<String> {
    Ok(begin("source documents") + &section.contents() + &section.html(rows)? + "</html>\n")
}

/// The page, plots, pictures and style inside it, so that it opens from disk.
pub fn html(abouts: &[About], rows: &[ReportRow], section: &Section) -> Result<String> {
    let mut html = begin("error against run time") + INTRODUCTION + "\n";
    let parts: Vec<String> =
        abouts.iter().map(|about| format!("<a href=\"#{0}\">{0}</a>", about.part)).collect();
    writeln!(html, "<p class=small>Parts: {}</p>", parts.join(" · "))?;
    if !section.is_empty() {
        writeln!(html, "<p><a href=\"#documents\">Source documents</a></p>{}", section.contents())?;
    }
    let complaints = front::complaints(rows);
    if complaints.is_empty() {
        html.push_str("<p>No default is beaten but those that say so below.</p>\n");
    } else {
        for c in complaints {
            writeln!(html, "<p class=bad>{}</p>", escape(&c))?;
        }
    }
    summary(&mut html, rows)?;
    for about in abouts {
        part_section(&mut html, about, rows)?;
    }
    if !section.is_empty() {
        html.push_str(&section.html(rows)?);
    }
    html.push_str("</html>\n");
    Ok(html)
}

/// Writes [`html`] to a file.
pub fn write(path: &Path, abouts: &[About], rows: &[ReportRow], section: &Section) -> Result<()> {
    std::fs::write(path, html(abouts, rows, section)?)
        .with_context(|| format!("cannot write {}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        parts::PARTS,
        row::{RowKind, Timing, testing::row},
    };

    #[test]
    fn holds_every_part_with_its_plot_tables_and_reasons() {
        let abouts: Vec<About> = PARTS.iter().map(|p| p.about).collect();
        let mut rows = Vec::new();
        for about in &abouts {
            let timing = Timing { samples: vec![5.0], noise: 1.1 };
            let ranked = ReportRow { part: about.part, kind: RowKind::Ranked(timing), ..row("a < b", 0.25) };
            rows.push(ranked);
            rows.push(ReportRow { part: about.part, scene: "odd & hard".into(), ..row("tried", 2.0) });
        }
        let page = html(&abouts, &rows, &Section::default()).unwrap();
        for about in &abouts {
            assert!(page.contains(&format!("<h2 id=\"{}\">", about.part)), "{} is missing", about.part);
            assert!(page.contains(&escape(about.truth)) && page.contains(&escape(about.why)));
        }
        assert_eq!(page.matches("<svg").count(), abouts.len());
        assert_eq!(page.matches("odd &amp; hard").count(), abouts.len());
        assert!(page.contains("a &lt; b") && !page.contains("a < b"));
        assert!(!page.contains("id=\"documents\""));
        let page = html(&abouts, &rows, &Section::of_all(None).unwrap()).unwrap();
        let targets: Vec<&str> = page.split("href=\"#").skip(1).filter_map(|t| t.split('"').next()).collect();
        assert!(targets.iter().filter(|t| t.starts_with("documents")).count() >= 19);
        assert!(targets.iter().all(|t| page.contains(&format!("id=\"{t}\""))), "{targets:?}");
        // Opens from disk: nothing is fetched.
        assert_eq!(page.matches("src=").count(), page.matches("src=\"data:image/").count());
        assert!(!page.contains("href=\"http"));
    }

    #[test]
    fn numbers_read_well() {
        assert_eq!([0.0, 0.5, 12.345, 1234.0].map(number), ["0", "0.500", "12.3", "1234"]);
        assert_eq!(number(4.2e-7), "4.20&thinsp;·&thinsp;10<sup>-7</sup>");
        assert_eq!(
            (time(1530.0), bytes(0), bytes(123_456)),
            ("1.53&nbsp;µs".into(), "–".into(), "123&nbsp;kB".into())
        );
    }
}
