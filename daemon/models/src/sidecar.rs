//! The small TOML file beside a picture.

use std::path::Path;

use bowwave_core::text::toml::{OptionalKey, RequiredKey, Spanned, TomlError, TomlText, number, one_of};
use serde::Deserialize;

use crate::{
    error::ModelError,
    load::read_bounded,
    quad::{Bow, QuadSpec, Rect},
};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawSidecar {
    length_m: RequiredKey<f64>,
    waterline_row: RequiredKey<f64>,
    bow: OptionalKey<String>,
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

/// The checked file beside a picture of `size` pixels.
pub(crate) fn read(path: &Path, size: (u32, u32)) -> Result<QuadSpec, ModelError> {
    let file = path.display().to_string();
    let bytes = match read_bounded(path) {
        Err(ModelError::Read { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => {
            return Err(ModelError::SidecarMissing { file, row: size.1 * 9 / 10 });
        }
        other => other?,
    };
    parse(&String::from_utf8_lossy(&bytes), &file, size).map_err(ModelError::Sidecar)
}

fn parse(text: &str, origin: &str, (width, height): (u32, u32)) -> Result<QuadSpec, TomlError> {
    let text = TomlText::new(text, origin)?;
    let (raw, _) = text.read::<RawSidecar>(&[])?;
    let (width, height) = (f64::from(width), f64::from(height));
    let rect = |raw: &Option<Spanned<RawRect>>| {
        let Some(value) = raw else { return Ok(None) };
        let RawRect { left, top, right, bottom } = *value.get_ref();
        let across = 0.0 <= left && left < right && right <= width;
        if across && 0.0 <= top && top < bottom && bottom <= height {
            return Ok(Some(Rect { left, top, right, bottom }));
        }
        let allowed = format!("left < right and top < bottom within {width}x{height} pixels");
        Err(text.error(value, format!("is not allowed; give {allowed}")))
    };
    let rows = number(1.0..=height, "(a row of the picture)");
    Ok(QuadSpec {
        length_m: text.needed(&raw.length_m, number(0.5..=500.0, "m"))?,
        waterline_row: text.needed(&raw.waterline_row, rows)?,
        bow: text
            .given(&raw.bow, one_of(&[("right", Bow::Right), ("left", Bow::Left)]))?
            .unwrap_or(Bow::Right),
        engine: rect(&raw.engine)?,
        helm: rect(&raw.helm)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(text: &str) -> (usize, usize, String) {
        let error = parse(text, "ship.toml", (400, 100)).expect_err("must be refused");
        (error.line, error.column, error.to_string())
    }

    #[test]
    fn a_full_sidecar_is_read() {
        let text = "length_m = 120.0\nwaterline_row = 90\nbow = \"left\"\n[helm]\nleft = 1\ntop = 2\nright = 30\nbottom = 40\n";
        let spec = parse(text, "ship.toml", (400, 100)).expect("valid");
        assert_eq!((spec.length_m, spec.waterline_row, spec.bow), (120.0, 90.0, Bow::Left));
        assert_eq!(spec.helm, Some(Rect { left: 1.0, top: 2.0, right: 30.0, bottom: 40.0 }));
        assert_eq!(spec.engine, None);
    }

    #[test]
    fn bad_values_are_refused_with_their_place() {
        let (line, column, problem) = error("length_m = 120.0\nwaterline_row = 900\n");
        assert_eq!((line, column), (2, 17));
        assert!(problem.contains("waterline_row: 900 is not allowed; give a number, 1 to 100"), "{problem}");
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
