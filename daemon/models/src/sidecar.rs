//! The small TOML file beside a picture.

use std::{ops::Range, path::Path};

use bowwave_core::text::{line_column, one_line};
use serde::Deserialize;
use toml::Spanned;

use crate::{
    error::ModelError,
    load::read_bounded,
    quad::{Bow, QuadSpec, Rect},
};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawSpec {
    length_m: Spanned<f64>,
    waterline_row: Spanned<f64>,
    bow: Option<Spanned<String>>,
    engine: Option<Spanned<RawRect>>,
    helm: Option<Spanned<RawRect>>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawRect {
    left: f64,
    top: f64,
    right: f64,
    bottom: f64,
}

/// Reads the file beside a picture of `size` pixels.
pub(crate) fn read(path: &Path, size: (u32, u32)) -> Result<QuadSpec, ModelError> {
    let file = path.display().to_string();
    let bytes = match read_bounded(path) {
        Err(ModelError::Read { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => {
            return Err(ModelError::SidecarMissing { file, row: size.1 * 9 / 10 });
        }
        other => other?,
    };
    let text = String::from_utf8_lossy(&bytes);
    parse(&text, size).map_err(|(at, problem)| {
        let (line, column) = line_column(&text, at);
        ModelError::Sidecar { file, line, column, problem: one_line(&problem) }
    })
}

/// Parses and checks; an error comes with its byte offset.
fn parse(text: &str, (width, height): (u32, u32)) -> Result<QuadSpec, (usize, String)> {
    let raw: RawSpec =
        toml::from_str(text).map_err(|e| (e.span().unwrap_or(0..0).start, e.message().to_owned()))?;
    let check = |value: &Spanned<f64>, key: &str, range: Range<f64>, unit: &str| {
        let v = *value.get_ref();
        let problem = || format!("{key} = {v} must lie between {} and {} {unit}", range.start, range.end);
        if range.contains(&v) { Ok(v) } else { Err((value.span().start, problem())) }
    };
    let length_m = check(&raw.length_m, "length_m", 0.5..500.0, "metres")?;
    let waterline_row =
        check(&raw.waterline_row, "waterline_row", 1.0..f64::from(height) + 1.0, "(a row of the picture)")?;
    let bow = match raw.bow.as_ref().map(|b| (b.get_ref().as_str(), b.span().start)) {
        None | Some(("right", _)) => Bow::Right,
        Some(("left", _)) => Bow::Left,
        Some((other, at)) => return Err((at, format!("bow = {other:?} must be \"left\" or \"right\""))),
    };
    let rect = |raw: &Option<Spanned<RawRect>>, key: &str| {
        let Some(raw) = raw else { return Ok(None) };
        let RawRect { left, top, right, bottom } = *raw.get_ref();
        let fits = 0.0 <= left
            && left < right
            && right <= f64::from(width)
            && 0.0 <= top
            && top < bottom
            && bottom <= f64::from(height);
        let problem =
            || format!("[{key}] must have left < right and top < bottom within {width}x{height} pixels");
        if fits { Ok(Some(Rect { left, top, right, bottom })) } else { Err((raw.span().start, problem())) }
    };
    Ok(QuadSpec {
        length_m,
        waterline_row,
        bow,
        engine: rect(&raw.engine, "engine")?,
        helm: rect(&raw.helm, "helm")?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(text: &str) -> (usize, usize, String) {
        let (at, problem) = parse(text, (400, 100)).expect_err("must be refused");
        let (line, column) = line_column(text, at);
        (line, column, problem)
    }

    #[test]
    fn a_full_sidecar_is_read() {
        let text = "length_m = 120.0\nwaterline_row = 90\nbow = \"left\"\n[helm]\nleft = 1\ntop = 2\nright = 30\nbottom = 40\n";
        let spec = parse(text, (400, 100)).expect("valid");
        assert_eq!((spec.length_m, spec.waterline_row, spec.bow), (120.0, 90.0, Bow::Left));
        assert_eq!(spec.helm, Some(Rect { left: 1.0, top: 2.0, right: 30.0, bottom: 40.0 }));
        assert_eq!(spec.engine, None);
    }

    #[test]
    fn bad_values_are_refused_with_their_place() {
        let (line, column, problem) = error("length_m = 120.0\nwaterline_row = 900\n");
        assert_eq!((line, column), (2, 17));
        assert!(problem.contains("waterline_row = 900"), "{problem}");
        let (line, _, problem) = error("length_m = 120.0\nwaterline_row = 90\nlenght = 3\n");
        assert_eq!(line, 3);
        assert!(problem.contains("lenght"), "{problem}");
        let (line, column, problem) = error("length_m = nan\nwaterline_row = 90\n");
        assert_eq!((line, column), (1, 12), "{problem}");
        let (line, _, problem) = error("length_m = 12\nwaterline_row = 90\nbow = \"up\"");
        assert_eq!(line, 3, "{problem}");
        let (line, _, problem) =
            error("length_m = 12\nwaterline_row = 90\n[engine]\nleft = 30\nright = 2\ntop = 1\nbottom = 4");
        assert_eq!(line, 3, "{problem}");
    }
}
