//! `bowwave calibrate board`: the board to print.

use std::fmt::{self, Write as _};

use anyhow::{Context, Result};
use bowwave_calibration::target::{MODULES, Target, is_white};

use crate::{
    cli::CalibrateBoard,
    new_file::{refuse_to_replace, write_new},
    outcome::Outcome,
};

/// White around the board, millimetres: printers cannot print to the edge, and the outermost squares need white beside them.
const MARGIN_MM: f64 = 12.0;
/// Room for the text below the board, and between its lines.
const TEXT_MM: f64 = 30.0;
const LINE_MM: f64 = 4.5;

/// Writes the board.
pub fn run(arguments: &CalibrateBoard) -> Result<Outcome> {
    let path = &arguments.out;
    let mut text = String::new();
    draw(&mut text, &arguments.target).context("cannot draw the board")?;
    let kalibr = arguments.kalibr.iter().map(|path| (path, arguments.target.to_kalibr()));
    let files: Vec<_> = [(path, text)].into_iter().chain(kalibr).collect();
    for (path, _) in &files {
        refuse_to_replace(path, arguments.force)?;
    }
    for (path, text) in &files {
        write_new(path, text)?;
    }
    let size = sheet_mm(&arguments.target);
    eprintln!(
        "{}: {} tags on {:.0} x {:.0} mm. Print it in true size (100 %), measure the line below the board, and mount it flat on \
         something stiff",
        path.display(),
        arguments.target.tags(),
        size[0],
        size[1]
    );
    if let Some(path) = &arguments.kalibr {
        eprintln!("{}: the same board for Kalibr, and for --target", path.display());
    }
    Ok(Outcome::Done)
}

/// Width and height of the sheet, millimetres.
fn sheet_mm(target: &Target) -> [f64; 2] {
    let board = target.size_m() * 1e3;
    [board.x + 2.0 * MARGIN_MM, board.y + 2.0 * MARGIN_MM + TEXT_MM]
}

fn draw(out: &mut String, target: &Target) -> fmt::Result {
    let [width, height] = sheet_mm(target);
    writeln!(
        out,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.3}mm\" height=\"{height:.3}mm\" \
         viewBox=\"0 0 {width:.3} {height:.3}\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>"
    )?;
    squares(out, target)?;
    for id in 0..target.tags() {
        tag(out, target, id)?;
    }
    words(out, target)?;
    writeln!(out, "</svg>")
}

/// Where a place on the board lies on the sheet, millimetres, y down.
fn on_sheet(target: &Target, place: glam::DVec2) -> [f64; 2] {
    let edge = MARGIN_MM + target.spacing() * target.tag_m() * 1e3;
    let top = MARGIN_MM + target.size_m().y * 1e3 - target.spacing() * target.tag_m() * 1e3;
    [edge + place.x * 1e3, top - place.y * 1e3]
}

fn rectangle(out: &mut String, [x, y]: [f64; 2], [w, h]: [f64; 2], fill: &str) -> fmt::Result {
    writeln!(out, "<rect x=\"{x:.4}\" y=\"{y:.4}\" width=\"{w:.4}\" height=\"{h:.4}\" fill=\"{fill}\"/>")
}

/// The black squares where gaps cross.
fn squares(out: &mut String, target: &Target) -> fmt::Result {
    let (tag, gap) = (target.tag_m() * 1e3, target.spacing() * target.tag_m() * 1e3);
    let pitch = tag + gap;
    for row in 0..=target.rows() {
        for column in 0..=target.columns() {
            let at = [MARGIN_MM + column as f64 * pitch, MARGIN_MM + row as f64 * pitch];
            rectangle(out, at, [gap, gap], "black")?;
        }
    }
    Ok(())
}

fn tag(out: &mut String, target: &Target, id: usize) -> fmt::Result {
    let [lower_left, _, _, upper_left] = target.corners(id);
    let (side, module) = (target.tag_m() * 1e3, target.tag_m() * 1e3 / MODULES as f64);
    let [left, top] = on_sheet(target, upper_left);
    rectangle(out, [left, top], [side, side], "black")?;
    // White in runs, across and down: neighbours that only touch would leave hairlines.
    let mut run = |white: &dyn Fn(usize) -> bool, place: &dyn Fn(f64, f64) -> ([f64; 2], [f64; 2])| {
        let mut first = 0;
        for i in 0..=MODULES {
            if i < MODULES && white(i) {
                continue;
            }
            if i > first {
                let (at, size) = place(first as f64, (i - first) as f64);
                rectangle(out, at, size, "white")?;
            }
            first = i + 1;
        }
        Ok(())
    };
    for line in 0..MODULES {
        let across = line as f64 * module;
        run(&|i| is_white(id, line, i), &|from, count| {
            ([left + from * module, top + across], [count * module, module])
        })?;
        run(&|i| is_white(id, i, line), &|from, count| {
            ([left + across, top + from * module], [module, count * module])
        })?;
    }
    let gap = target.spacing() * side;
    let [_, bottom] = on_sheet(target, lower_left);
    writeln!(
        out,
        "<text x=\"{:.3}\" y=\"{:.3}\" font-size=\"{:.3}\" font-family=\"sans-serif\" text-anchor=\"middle\" \
         fill=\"#999999\">{id}</text>",
        left + side / 2.0,
        bottom + gap * 0.6,
        gap * 0.3
    )
}

/// Text for the maintainer, and a line to measure.
fn words(out: &mut String, target: &Target) -> fmt::Result {
    let (left, mut y) = (MARGIN_MM, MARGIN_MM + target.size_m().y * 1e3 + 8.0);
    let ruler_mm = if target.size_m().x >= 0.1 { 100.0 } else { 10.0 };
    rectangle(out, [left, y], [ruler_mm, 0.4], "black")?;
    for end in [left, left + ruler_mm - 0.2] {
        rectangle(out, [end, y - 1.5], [0.2, 3.4], "black")?;
    }
    let lines = [
        format!("This line is {ruler_mm:.0} mm long; a tag is {:.2} mm wide.", target.tag_m() * 1e3),
        format!("bowwave calibrate intrinsics PICTURES --target {target}"),
        "Print in true size, glue it to a stiff flat plate (glass, aluminium), keep it matt and evenly lit."
            .to_owned(),
        "20 pictures: all corners and edges of the picture, near and far, tilted left, right, up and down."
            .to_owned(),
    ];
    for line in lines {
        y += LINE_MM;
        writeln!(
            out,
            "<text x=\"{left:.3}\" y=\"{y:.3}\" font-size=\"3.2\" font-family=\"sans-serif\" fill=\"black\">{line}</text>"
        )?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether the drawing is black at a place of the sheet: the last rectangle there counts.
    fn black(svg: &str, [x, y]: [f64; 2]) -> bool {
        let number = |line: &str, key: &str| -> Option<f64> {
            line.split(&format!(" {key}=\"")).nth(1)?.split('"').next()?.parse().ok()
        };
        let mut black = false;
        for line in svg.lines().filter(|l| l.starts_with("<rect x")) {
            let [left, top, width, height] =
                ["x", "y", "width", "height"].map(|key| number(line, key).unwrap());
            if (left..left + width).contains(&x) && (top..top + height).contains(&y) {
                black = line.contains("\"black\"");
            }
        }
        black
    }

    #[test]
    fn the_drawing_is_the_board() {
        let target = Target::new(3, 2, 0.02, 0.3).unwrap();
        let mut svg = String::new();
        draw(&mut svg, &target).unwrap();
        for id in 0..target.tags() {
            let corners = target.corners(id);
            for row in 0..MODULES {
                for column in 0..MODULES {
                    let module = target.tag_m() / MODULES as f64;
                    let step = glam::DVec2::new(column as f64 + 0.5, -(row as f64 + 0.5)) * module;
                    let white = is_white(id, row, column);
                    assert_eq!(
                        black(&svg, on_sheet(&target, corners[3] + step)),
                        !white,
                        "{id} {row} {column}"
                    );
                }
            }
            // Around each corner two fields are black and two are white.
            for (corner, into) in
                corners.into_iter().zip([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])
            {
                let into = glam::DVec2::from(into) * 1e-3;
                let at = |d: glam::DVec2| black(&svg, on_sheet(&target, corner + d));
                assert!(at(into) && at(-into) && !at(into.perp()) && !at(-into.perp()), "{id} {corner}");
            }
        }
    }

    #[test]
    fn the_usual_board_fits_a4() {
        let [width, height] = sheet_mm(&Target::A4);
        assert!(width <= 210.0 && height <= 297.0, "{width} x {height}");
    }
}
