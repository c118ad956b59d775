//! A plot of one scene: error over run time, both logarithmic.

use anyhow::{Result, anyhow};
use plotters::{coord::Shift, prelude::*};

use crate::row::ReportRow;

const SIZE: (u32, u32) = (980, 440);
/// Width of the list of methods beside the plot, pixels.
const LEGEND: u32 = 240;
/// Height of a label, and width of one of its letters, about; pixels.
const LETTER: (i32, i32) = (13, 7);
/// Colours that stay apart for the colour-blind (Okabe and Ito 2008), then two greys.
const COLOURS: [RGBColor; 9] = [
    RGBColor(0, 114, 178),
    RGBColor(230, 159, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(213, 94, 0),
    RGBColor(120, 94, 40),
    RGBColor(90, 90, 90),
    RGBColor(160, 160, 160),
];

type PlotArea<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Chart<'a, 'b> = ChartContext<
    'a,
    SVGBackend<'b>,
    Cartesian2d<plotters::coord::combinators::LogCoord<f64>, plotters::coord::combinators::LogCoord<f64>>,
>;

/// The plot of a scene's ranked rows as SVG.
pub fn svg(rows: &[&ReportRow]) -> Result<String> {
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
        draw(&area, rows).map_err(|e| anyhow!("cannot draw the plot: {e}"))?;
        area.present().map_err(|e| anyhow!("cannot finish the plot: {e}"))?;
    }
    Ok(text)
}

/// One point of the plot.
struct PlotPoint<'r> {
    row: &'r ReportRow,
    method: usize,
    time: f64,
    error: f64,
}

/// The axes' ranges: whole decades around what there is.
struct Ranges {
    time: (f64, f64),
    error: (f64, f64),
}

fn decades(low: f64, high: f64) -> (f64, f64) {
    let (low, high) = (low.log10() - 0.3, high.log10() + 0.3);
    // Less than two decades show no slope.
    let pad = ((2.0 - (high - low)) / 2.0).max(0.0);
    (10f64.powf(low - pad), 10f64.powf(high + pad))
}

fn ranges(rows: &[&ReportRow]) -> Ranges {
    let span = |values: &mut dyn Iterator<Item = f64>| {
        values
            .filter(|v| v.is_finite() && *v > 0.0)
            .fold((f64::INFINITY, 0f64), |(l, h), v| (l.min(v), h.max(v)))
    };
    let (t0, t1) = span(&mut rows.iter().filter_map(|r| r.time_ns()));
    let (e0, e1) = span(&mut rows.iter().map(|r| r.error.max(r.truth_error)));
    let time = if t1 > 0.0 { decades(t0, t1) } else { (1.0, 100.0) };
    let error = if e1 > 0.0 { decades(e0, e1) } else { (1e-17, 1e-15) };
    Ranges { time, error }
}

fn methods<'r>(rows: &[&'r ReportRow]) -> Vec<&'r str> {
    let mut names: Vec<&str> = Vec::new();
    for r in rows {
        if !names.contains(&r.method.as_str()) {
            names.push(&r.method);
        }
    }
    names
}

fn draw(area: &PlotArea<'_>, rows: &[&ReportRow]) -> Result<(), Box<dyn std::error::Error>> {
    area.fill(&WHITE)?;
    let names = methods(rows);
    let ranges = ranges(rows);
    let points: Vec<PlotPoint<'_>> = rows
        .iter()
        .filter_map(|r| {
            let method = names.iter().position(|n| *n == r.method)?;
            // What diverged stands at the upper edge, what errs less than the truth on the truth's own error.
            let error = r.error.max(r.truth_error).clamp(ranges.error.0, ranges.error.1);
            Some(PlotPoint { row: r, method, time: r.time_ns()?.max(ranges.time.0), error })
        })
        .collect();
    let (left, right) = area.split_horizontally(SIZE.0 - LEGEND);
    let mut chart = axes(&left, rows, &ranges)?;
    draw_front(&mut chart, &points, &ranges)?;
    draw_lines(&mut chart, &points, names.len())?;
    let mut taken = Vec::new();
    let at: Vec<(i32, i32)> = points.iter().map(|p| chart.backend_coord(&(p.time, p.error))).collect();
    for (x, y) in &at {
        taken.push((x - 6, y - 6, x + 6, y + 6));
    }
    for (p, &at) in points.iter().zip(&at) {
        marker(&left, at, p.method, p.row.default)?;
        label(&left, at, &label_text(p.row), &mut taken)?;
    }
    legend(&right, &names, rows)?;
    Ok(())
}

fn axes<'a, 'b>(
    area: &'a PlotArea<'b>,
    rows: &[&ReportRow],
    ranges: &Ranges,
) -> Result<Chart<'a, 'b>, Box<dyn std::error::Error>>
where
    'b: 'a,
{
    let unit = rows.first().map_or("", |r| r.error_unit);
    let mut chart =
        ChartBuilder::on(area).margin(14).x_label_area_size(44).y_label_area_size(74).build_cartesian_2d(
            (ranges.time.0..ranges.time.1).log_scale(),
            (ranges.error.0..ranges.error.1).log_scale(),
        )?;
    chart
        .configure_mesh()
        .light_line_style(RGBColor(244, 244, 244))
        .bold_line_style(RGBColor(222, 222, 222))
        .x_desc("run time of one use, ns")
        .y_desc(format!("error, {unit}"))
        .axis_desc_style(("sans-serif", 14))
        .label_style(("sans-serif", 13))
        .x_label_formatter(&|v| power(*v))
        .y_label_formatter(&|v| power(*v))
        .draw()?;
    Ok(chart)
}

/// Steps through the front: what is above and to the right of them is beaten.
fn draw_front(
    chart: &mut Chart<'_, '_>,
    points: &[PlotPoint<'_>],
    ranges: &Ranges,
) -> Result<(), Box<dyn std::error::Error>> {
    let mut front: Vec<(f64, f64)> =
        points.iter().filter(|p| p.row.on_front).map(|p| (p.time, p.error)).collect();
    front.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut steps = Vec::new();
    let mut lowest = ranges.error.1;
    for (time, error) in front {
        steps.push((time, lowest));
        lowest = lowest.min(error);
        steps.push((time, lowest));
    }
    steps.push((ranges.time.1, lowest));
    chart.draw_series(LineSeries::new(steps, RGBColor(170, 170, 170).stroke_width(4)))?;
    let own = points.first().map_or(0.0, |p| p.row.truth_error);
    if own > ranges.error.0 {
        let line = [(ranges.time.0, own), (ranges.time.1, own)];
        chart.draw_series(DashedLineSeries::new(line, 4, 4, RGBColor(150, 150, 150).stroke_width(1)))?;
    }
    Ok(())
}

/// Joins the settings of each method.
fn draw_lines(
    chart: &mut Chart<'_, '_>,
    points: &[PlotPoint<'_>],
    methods: usize,
) -> Result<(), Box<dyn std::error::Error>> {
    for method in 0..methods {
        let line: Vec<(f64, f64)> =
            points.iter().filter(|p| p.method == method).map(|p| (p.time, p.error)).collect();
        chart.draw_series(LineSeries::new(line, colour(method).stroke_width(1)))?;
    }
    Ok(())
}

fn colour(method: usize) -> RGBColor {
    COLOURS[method % COLOURS.len()]
}

fn marker(
    area: &PlotArea<'_>,
    at: (i32, i32),
    method: usize,
    default: bool,
) -> Result<(), Box<dyn std::error::Error>> {
    let style = colour(method).filled();
    match method % 3 {
        0 => area.draw(&Circle::new(at, 5, style))?,
        1 => area.draw(&Rectangle::new([(at.0 - 4, at.1 - 4), (at.0 + 4, at.1 + 4)], style))?,
        _ => area.draw(&TriangleMarker::new(at, 6, style))?,
    }
    if default {
        area.draw(&Circle::new(at, 9, BLACK.stroke_width(2)))?;
    }
    Ok(())
}

fn label_text(row: &ReportRow) -> String {
    let mut text = if row.setting.is_empty() { String::new() } else { row.setting.clone() };
    if row.error.is_infinite() {
        text.push_str(" ∞");
    }
    text.trim().to_string()
}

/// Writes `text` where nothing is yet, near the point; nowhere when there is no room.
fn label(
    area: &PlotArea<'_>,
    (x, y): (i32, i32),
    text: &str,
    taken: &mut Vec<(i32, i32, i32, i32)>,
) -> Result<(), Box<dyn std::error::Error>> {
    if text.is_empty() {
        return Ok(());
    }
    let (h, w) = (LETTER.0, LETTER.1 * text.chars().count() as i32);
    let inside = (90, 10, (SIZE.0 - LEGEND) as i32 - 14, SIZE.1 as i32 - 60);
    let places = [
        (x + 8, y - h - 6),
        (x + 10, y - h / 2),
        (x + 8, y + 7),
        (x - w - 10, y - h / 2),
        (x - w - 6, y - h - 6),
        (x - w - 6, y + 7),
        (x - w / 2, y - h - 10),
        (x - w / 2, y + 10),
        (x + 10, y - 2 * h - 6),
        (x + 10, y + h + 8),
    ];
    for (left, top) in places {
        let place = (left, top, left + w, top + h);
        let fits = place.0 >= inside.0 && place.1 >= inside.1 && place.2 <= inside.2 && place.3 <= inside.3;
        let free = taken.iter().all(|t| place.2 < t.0 || place.0 > t.2 || place.3 < t.1 || place.1 > t.3);
        if fits && free {
            taken.push(place);
            area.draw(&Text::new(text.to_string(), (left, top), ("sans-serif", 12)))?;
            break;
        }
    }
    Ok(())
}

fn legend(
    area: &PlotArea<'_>,
    names: &[&str],
    rows: &[&ReportRow],
) -> Result<(), Box<dyn std::error::Error>> {
    let text = |s: &str, y: i32, size: i32| Text::new(s.to_string(), (26, y - 7), ("sans-serif", size));
    let mut y = 28;
    for (i, name) in names.iter().enumerate() {
        let default = rows.iter().any(|r| r.default && r.method == **name);
        marker(area, (12, y), i, default)?;
        area.draw(&text(name, y, 13))?;
        y += 22;
    }
    y += 10;
    if rows.iter().any(|r| r.default) {
        area.draw(&Circle::new((12, y), 9, BLACK.stroke_width(2)))?;
        area.draw(&text("what the product uses", y, 12))?;
        y += 22;
    }
    area.draw(&PathElement::new(vec![(2, y), (20, y)], RGBColor(170, 170, 170).stroke_width(4)))?;
    area.draw(&text("Pareto front", y, 12))?;
    if rows.iter().any(|r| r.truth_error > 0.0) {
        y += 22;
        area.draw(&PathElement::new(vec![(2, y), (8, y)], RGBColor(150, 150, 150)))?;
        area.draw(&PathElement::new(vec![(13, y), (20, y)], RGBColor(150, 150, 150)))?;
        area.draw(&text("the truth's own error", y, 12))?;
    }
    Ok(())
}

/// A whole power of ten, with its exponent raised; nothing between, where there is no room.
fn power(value: f64) -> String {
    let exponent = value.log10();
    if (exponent - exponent.round()).abs() > 1e-6 {
        return String::new();
    }
    let digits = format!("{}", exponent.round() as i32);
    let raised = digits.chars().map(|c| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        c => char::from_u32(0x2070 + c.to_digit(10).unwrap_or(0)).unwrap_or(c),
    });
    format!("10{}", raised.collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::row::{RowKind, Timing, testing::row};

    fn timed(method: &str, error: f64, ns: f64) -> ReportRow {
        ReportRow { kind: RowKind::Ranked(Timing { samples: vec![ns], noise: 1.1 }), ..row(method, error) }
    }

    #[test]
    fn shows_every_method_and_survives_zero_and_infinite_errors() {
        let rows = [timed("<exact>", 0.0, 10.0), timed("bad", f64::INFINITY, 1.0), timed("so-so", 1e-3, 3.0)];
        let picture = svg(&rows.iter().collect::<Vec<_>>()).unwrap();
        for text in ["&lt;exact&gt;", "bad", "so-so", "Pareto front", "∞"] {
            assert!(picture.contains(text), "{text} is not in the plot");
        }
        assert!(!picture.contains("NaN") && !picture.contains("inf"));
        assert!(svg(&[]).is_ok());
    }

    #[test]
    fn powers_are_raised() {
        assert_eq!([1e-12, 1.0, 1000.0].map(power), ["10⁻¹²", "10⁰", "10³"]);
        assert_eq!(power(20.0), "");
    }
}
