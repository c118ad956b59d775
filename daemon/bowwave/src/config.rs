//! The configuration file: raw TOML in, checked settings out. Unknown keys and bad values are refused with line and column.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use serde::Deserialize;
use toml::Spanned;

use crate::cli::parse_size;

/// Checked settings. Everything has a default; the command line overrides it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Config {
    /// Screen size in pixels.
    pub size: Option<(u32, u32)>,
    /// Whether to show a window.
    pub window: bool,
    /// Vulkan device by number or part of its name.
    pub gpu: Option<String>,
    /// Whether to run with the validation layer.
    pub validation: bool,
    /// Scenario file.
    pub scenario: Option<PathBuf>,
    /// Calibration file.
    pub calibration: Option<PathBuf>,
    /// Whether to keep what went in as a recording.
    pub record: bool,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Raw {
    screen: RawScreen,
    gpu: RawGpu,
    files: RawFiles,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawScreen {
    size: Option<Spanned<String>>,
    window: bool,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawGpu {
    device: Option<Spanned<String>>,
    validation: bool,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawFiles {
    scenario: Option<PathBuf>,
    calibration: Option<PathBuf>,
    record: bool,
}

/// Reads and checks a configuration file. Relative paths in it are taken from its own folder.
pub fn read(path: &Path) -> Result<Config> {
    let text = std::fs::read_to_string(path).with_context(|| {
        format!("cannot read the configuration {}; name an existing file with --config", path.display())
    })?;
    let base = path.parent().unwrap_or(Path::new("."));
    parse(&text, &path.display().to_string(), base)
}

/// Checks configuration text; `origin` is what errors call it.
pub fn parse(text: &str, origin: &str, base: &Path) -> Result<Config> {
    let raw: Raw = match toml::from_str(text) {
        Ok(raw) => raw,
        Err(e) => {
            let (line, column) = line_column(text, e.span().map_or(0, |s| s.start));
            bail!(
                "{origin}:{line}:{column}: {}; systemd/bowwave.toml shows every key",
                e.message().replace('\n', " ")
            );
        }
    };
    let size = match &raw.screen.size {
        None => None,
        Some(s) => Some(parse_size(s.get_ref()).map_err(|why| {
            let (line, column) = line_column(text, s.span().start);
            anyhow::anyhow!("{origin}:{line}:{column}: screen.size: {why}")
        })?),
    };
    if let Some(device) = raw.gpu.device.as_ref().filter(|d| d.get_ref().trim().is_empty()) {
        let (line, column) = line_column(text, device.span().start);
        bail!(
            "{origin}:{line}:{column}: gpu.device is empty; leave it out or give a number or part of a name"
        );
    }
    let file = |p: Option<PathBuf>| p.map(|p| base.join(p));
    Ok(Config {
        size,
        window: raw.screen.window,
        gpu: raw.gpu.device.map(Spanned::into_inner),
        validation: raw.gpu.validation,
        scenario: file(raw.files.scenario),
        calibration: file(raw.files.calibration),
        record: raw.files.record,
    })
}

/// Line and column, both from 1, of a byte offset.
fn line_column(text: &str, offset: usize) -> (usize, usize) {
    let before = text.get(..offset).unwrap_or(text);
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().unwrap_or("").chars().count() + 1;
    (line, column)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(text: &str) -> String {
        parse(text, "x.toml", Path::new("/etc")).unwrap_err().to_string()
    }

    #[test]
    fn the_installed_file_is_valid() {
        let text = include_str!("../../../systemd/bowwave.toml");
        let config = parse(text, "systemd/bowwave.toml", Path::new(".")).unwrap();
        assert_eq!(config.size, Some((1280, 720)));
    }

    #[test]
    fn every_key_is_read() {
        let text = "[screen]\nsize = \"800x480\"\nwindow = true\n[gpu]\ndevice = \"llvm\"\nvalidation = true\n\
                    [files]\nscenario = \"a.toml\"\ncalibration = \"/b.toml\"\nrecord = true\n";
        let expected = Config {
            size: Some((800, 480)),
            window: true,
            gpu: Some("llvm".into()),
            validation: true,
            scenario: Some("/etc/a.toml".into()),
            calibration: Some("/b.toml".into()),
            record: true,
        };
        assert_eq!(parse(text, "x.toml", Path::new("/etc")).unwrap(), expected);
    }

    #[test]
    fn mistakes_are_refused_where_they_are() {
        assert!(refused("[screen]\nsise = \"1x1\"\n").starts_with("x.toml:2:1: unknown field `sise`"));
        assert!(
            refused("[screen]\nsize = \"1x1\"\n").starts_with("x.toml:2:8: screen.size: '1x1' is no size")
        );
        assert!(refused("[gpu]\ndevice = \" \"\n").starts_with("x.toml:2:10: gpu.device is empty"));
        assert!(refused("[gpu]\nvalidation = 3\n").starts_with("x.toml:2:14: "));
        assert!(refused("[gpu\n").starts_with("x.toml:1:5: "));
    }
}
