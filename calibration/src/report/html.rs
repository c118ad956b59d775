//! The report as a page: one HTML file that needs no other and no network, with its plots inside.

use bowwave_core::statistics::quantile;
use glam::{DMat3, DVec2};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use plotters::prelude::*;

use super::{AXES, CalibrationReport, CalibrationVerdict, PlacedResidual};

const SIZE: (u32, u32) = (980, 320);
/// More points than this hide each other and make the page slow.
const POINTS_MOST: usize = 1200;
const ARROWS_MOST: usize = 400;
/// Colours that stay apart for the colour-blind (Okabe and Ito 2008): about x, y and z.
const COLOURS: [RGBColor; 3] = [RGBColor(0, 114, 178), RGBColor(213, 94, 0), RGBColor(0, 158, 115)];

const STYLE: &str = "body{font:1rem/1.5 sans-serif;max-width:64rem;margin:2rem auto;padding:0 1rem;color:#111;background:#fff}\
    table{border-collapse:collapse}td,th{padding:.15rem .8rem .15rem 0;text-align:left;vertical-align:top}\
    td+td{font-variant-numeric:tabular-nums}.verdict{padding:.8rem 1rem;border-left:.6rem solid;font-size:1.2rem}\
    .well{border-color:#0a0;background:#efe}.ill{border-color:#c00;background:#fee}.open{border-color:#c80;background:#fff4dd}\
    svg{max-width:100%;height:auto}";

/// The page. Everything in it that came from a file is text, whatever it says.
pub fn html(report: &CalibrationReport) -> String {
    let class = match report.verdict {
        CalibrationVerdict::Pass | CalibrationVerdict::Good => "well",
        CalibrationVerdict::Fail | CalibrationVerdict::Stale => "ill",
        CalibrationVerdict::CannotTell => "open",
    };
    let (size, focal) = report.picture;
    let arrows = |area: &PlotArea<'_>, all: &[PlacedResidual]| in_picture(area, all, size, focal);
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                title { (report.title) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                h1 { (report.title) }
                p class={ "verdict " (class) } { b { (report.verdict) } ": " (report.says) }
                @if !report.notes.is_empty() {
                    ul { @for note in &report.notes { li { (note) } } }
                }
                table { @for (name, value) in &report.rows { tr { td { (name) } td { (value) } } } }
                @if let Some(covariance) = &report.covariance { (table(covariance)) }
                @if !report.residuals.is_empty() {
                    h2 { "What is left of each picture, over time" }
                    (plot(over_time, &report.residuals))
                    h2 { "The same in the picture" }
                    p { "From where it was seen to where it was expected, " (GROWN) " times as long." }
                    (plot(arrows, &report.residuals))
                }
            }
        }
    };
    page.into_string()
}

/// Standard deviations and correlations.
fn table(covariance: &DMat3) -> Markup {
    let c = covariance.to_cols_array_2d();
    let sigma = [0, 1, 2].map(|i| c[i][i].max(0.0).sqrt());
    let correlation = |i: usize, j: usize| c[j][i] / (sigma[i] * sigma[j]).max(f64::MIN_POSITIVE);
    html! {
        h2 { "Covariance of the rotation" }
        table {
            tr { th {} th { "sigma, mrad" } @for name in AXES { th { "with " (name) } } }
            @for (i, name) in AXES.iter().enumerate() {
                tr {
                    td { (name) }
                    td { (format!("{:.3}", sigma[i] * 1e3)) }
                    @for j in 0..3 { td { (format!("{:.3}", correlation(i, j))) } }
                }
            }
        }
    }
}

type PlotArea<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
type PlotResult = Result<(), Box<dyn std::error::Error>>;

/// A plot as SVG, or why there is none.
fn plot(
    draw: impl Fn(&PlotArea<'_>, &[PlacedResidual]) -> PlotResult,
    residuals: &[PlacedResidual],
) -> Markup {
    let mut text = String::new();
    let drawn = {
        let area = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
        draw(&area, residuals).and_then(|()| Ok(area.present()?))
    };
    match drawn {
        Ok(()) => PreEscaped(text),
        Err(e) => html! { p { "no plot: " (e) } },
    }
}

/// Longest time and largest picture that are drawn: axes of absurd length never get all their marks.
const SECONDS_MOST: f64 = 1e5;
const SIDE_MOST: f64 = 1e4;

/// Every so many of `all` that no more than `most` are left, those that can be drawn.
fn thinned(all: &[PlacedResidual], most: usize) -> impl Iterator<Item = &PlacedResidual> + Clone {
    let sound = |p: &&PlacedResidual| {
        p.residual.turn.is_finite() && p.pixel.is_finite() && p.seconds.abs() <= SECONDS_MOST
    };
    all.iter().step_by(all.len().div_ceil(most).max(1)).filter(sound)
}

fn over_time(area: &PlotArea<'_>, residuals: &[PlacedResidual]) -> PlotResult {
    area.fill(&WHITE)?;
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    thinned(residuals, POINTS_MOST).for_each(|p| (low, high) = (low.min(p.seconds), high.max(p.seconds)));
    if low > high {
        return Err("no residual is a number".into());
    }
    let sizes =
        thinned(residuals, POINTS_MOST).flat_map(|p| (p.residual.turn * 1e3).to_array().map(f64::abs));
    // A few wild ones must not press all others onto the axis; they stand at the edge.
    let reach = (1.5 * quantile(sizes, 0.98)).clamp(1e-3, 1e4);
    let mut chart = ChartBuilder::on(area)
        .margin(8)
        .x_label_area_size(36)
        .y_label_area_size(56)
        .build_cartesian_2d(low..high.max(low + 1.0), -reach..reach)?;
    chart.configure_mesh().light_line_style(TRANSPARENT).x_desc("s").y_desc("mrad").draw()?;
    for axis in 0..3 {
        let colour = COLOURS[axis];
        let points = thinned(residuals, POINTS_MOST).map(|p| {
            let y = (p.residual.turn[axis] * 1e3).clamp(-reach, reach);
            Circle::new((p.seconds, y), 2, colour.mix(0.6).filled())
        });
        chart
            .draw_series(points)?
            .label(AXES[axis])
            .legend(move |(x, y)| Circle::new((x + 8, y), 4, colour.filled()));
    }
    chart.configure_series_labels().background_style(WHITE.mix(0.8)).border_style(BLACK).draw()?;
    Ok(())
}

/// How much longer residuals are drawn than they are.
const GROWN: f64 = 10.0;

fn in_picture(area: &PlotArea<'_>, residuals: &[PlacedResidual], size: DVec2, focal: DVec2) -> PlotResult {
    area.fill(&WHITE)?;
    let size = size.max(DVec2::ONE).min(DVec2::splat(SIDE_MOST));
    let mut chart = ChartBuilder::on(area)
        .margin(8)
        .x_label_area_size(36)
        .y_label_area_size(56)
        .build_cartesian_2d(0.0..size.x, size.y..0.0)?;
    chart.configure_mesh().light_line_style(TRANSPARENT).x_desc("px").y_desc("px").draw()?;
    chart.draw_series(thinned(residuals, ARROWS_MOST).map(|p| {
        // A turn about x moves what is seen down or up, one about y across.
        let turn = p.residual.turn;
        let moved = DVec2::new(-turn.y * focal.x, turn.x * focal.y) * GROWN;
        let [from, to] = [p.pixel, p.pixel + moved].map(|at| at.max(DVec2::ZERO).min(size));
        PathElement::new([(from.x, from.y), (to.x, to.y)], COLOURS[0])
    }))?;
    chart.draw_series(
        thinned(residuals, ARROWS_MOST).map(|p| Circle::new((p.pixel.x, p.pixel.y), 2, COLOURS[1].filled())),
    )?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use bowwave_core::time::Time;
    use glam::DVec3;

    use super::*;
    use crate::alignment::Residual;

    fn report() -> CalibrationReport {
        let residuals = (0..3000)
            .map(|i| {
                let x = f64::from(i);
                PlacedResidual {
                    seconds: x * 0.03,
                    residual: Residual {
                        stamp: Time::from_ns(0),
                        turn: DVec3::new(x.sin(), x.cos(), if i == 7 { f64::NAN } else { 0.0 }) * 1e-3,
                        normalised: 1.0,
                        weight: 1.0,
                    },
                    pixel: DVec2::new(100.0 + 0.1 * x, 80.0),
                }
            })
            .collect();
        CalibrationReport {
            title: "a <script>alert(1)</script> & \"b\"".to_owned(),
            verdict: CalibrationVerdict::Pass,
            says: "x < y".to_owned(),
            rows: vec![("what".to_owned(), "<img src=x>".to_owned())],
            notes: vec!["<b>note</b>".to_owned()],
            covariance: Some(DMat3::from_diagonal(DVec3::new(1e-6, 4e-6, 0.0))),
            deviations: Vec::new(),
            residuals,
            picture: (DVec2::new(640.0, 360.0), DVec2::splat(500.0)),
        }
    }

    #[test]
    fn a_page_is_whole_small_and_escapes_what_came_from_files() {
        let page = html(&report());
        for text in ["<script", "<img", "<b>note", "https://"] {
            assert!(!page.contains(text), "{text}");
        }
        assert!(page.contains("&lt;script&gt;") && page.contains("<b>PASS</b>: x &lt; y"));
        assert_eq!(page.matches("<svg").count(), 2);
        assert_eq!(page.matches("</svg>").count(), 2);
        assert!(page.contains("<td>traverse</td><td>2.000</td><td>0.000</td><td>1.000</td>"));
        assert!(page.len() < 800_000, "{}", page.len());
        // The verdict stands before everything else that is told.
        let at = |text: &str| page.find(text).unwrap();
        assert!(at("PASS") < at("note") && at("note") < at("<table>"));
    }

    #[test]
    fn odd_numbers_make_no_panic() {
        for v in [f64::NAN, f64::INFINITY, 1e300, 0.0, -1e300] {
            let mut odd = report();
            odd.covariance = Some(DMat3::from_diagonal(DVec3::splat(v)));
            odd.picture = (DVec2::splat(v), DVec2::splat(v));
            odd.residuals.truncate(3);
            odd.residuals[1].seconds = v;
            odd.residuals[1].pixel = DVec2::splat(v);
            odd.residuals[2].residual.turn = DVec3::splat(v);
            assert!(html(&odd).contains("PASS"));
        }
    }
}
