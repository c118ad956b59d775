//! What a run is made of, gathered from the command line, the configuration, the recording and what is built in.

use std::{
    path::{Path, PathBuf},
    time::Duration,
};

use anyhow::{Context, Result, bail};
use bowwave_calibration::CalibrationFile;
use bowwave_core::{
    estimate::attitude::Source,
    event::PixelFormat,
    session::Setup,
    text::toml::TEXT_BYTES_MAX,
    world::scenario::{self, Scenario},
};
use bowwave_files::plain_text;
use bowwave_record::{Properties, RecordingReader};
use bowwave_trainer::{presenter::GpuSettings, replay::session_properties};

use crate::{
    cache,
    cli::{OrientationArg, Simulate},
    config::{self, Config, ScreenOutput},
    loading::{read_scenario, scenario_models, warn_of_former_names},
};

/// Screen size where nothing else is said.
const SIZE: (u32, u32) = (1280, 720);

/// A run, ready to begin.
#[derive(Debug)]
pub struct Prepared {
    /// The recording.
    pub recording: PathBuf,
    /// What it says about itself.
    pub properties: Properties,
    /// Its length, nanoseconds.
    pub duration_ns: i64,
    /// What the session is made from.
    pub setup: Setup,
    /// Text of the scenario in use.
    pub scenario_toml: String,
    /// Text of the calibration in use.
    pub calibration_toml: String,
    /// Folder that the paths of the scenario's models start from.
    pub models_base: PathBuf,
    /// The GPU.
    pub gpu: GpuSettings,
    /// Whether to show a window.
    pub window: bool,
    /// Whether to keep what went in.
    pub record: bool,
}

/// Gathers what a run needs, and refuses what cannot work before anything is begun.
pub fn prepare(arguments: &Simulate) -> Result<Prepared> {
    let config = arguments.config.as_deref().map_or_else(|| Ok(Config::default()), config::read)?;
    let recording = match &arguments.recording {
        Some(path) => path.clone(),
        None => cache::default_recording()?,
    };
    let reader = RecordingReader::open(&recording)?;
    let properties = reader.properties().clone();
    let duration_ns = reader.duration_ns();

    let (calibration, calibration_toml) = calibration(
        arguments.calibration.as_ref().or(config.files.calibration.as_ref()),
        &properties,
        &recording,
    )?;
    let (lens, picture) = (&calibration.calibration.lens, properties.picture);
    if picture != (0, 0) && picture != (lens.width, lens.height) {
        bail!(
            "the calibration is for pictures of {}x{}, those of {} have {}x{}: give the calibration of its camera, or leave --calibration \
             out for the recording's own",
            lens.width,
            lens.height,
            recording.display(),
            picture.0,
            picture.1
        );
    }
    let named = arguments.scenario.as_ref().or(config.files.scenario.as_ref());
    let (mut scenario, scenario_toml, base) = scenario(named, &properties, &recording)?;
    if let Some(seed) = arguments.seed {
        scenario.seed = seed;
    }
    let (models, boat_models) = scenario_models(&scenario, &base)?;
    let (orientation, warning) = orientation(arguments);
    if let Some(warning) = warning {
        log::warn!("{warning}");
    }
    Ok(Prepared {
        recording,
        properties,
        duration_ns,
        setup: Setup {
            scenario,
            own_ship: calibration.own_ship_mask(),
            calibration: calibration.calibration,
            models: models.into(),
            boat_models,
            screen: arguments.size.or(config.size).unwrap_or(SIZE),
            // JPEG pictures are decoded to RGB.
            video: PixelFormat::Rgb,
            orientation: orientation.unwrap_or(config.orientation),
            heading: config.heading.settings.clone(),
        },
        scenario_toml,
        calibration_toml,
        models_base: base,
        gpu: GpuSettings {
            device: arguments.gpu.clone().or(config.gpu.device),
            validation: arguments.validation || config.gpu.validation,
            // A desk may do other work than to draw: half a second without a frame is no hung GPU there.
            timeout: Some(Duration::from_secs(5)),
        },
        window: arguments.window || config.output == ScreenOutput::Window && !arguments.headless,
        record: arguments.record || config.files.record,
    })
}

/// The source of the orientation that the command line asks for, and the warning about a former name.
fn orientation(arguments: &Simulate) -> (Option<Source>, Option<&'static str>) {
    if arguments.fuse {
        let warning = "--fuse is now called --orientation fused; the former name will not be read any longer in the next version";
        return (Some(Source::Fused), Some(warning));
    }
    let asked = arguments.orientation.map(|asked| match asked {
        OrientationArg::Auto => Source::Auto,
        OrientationArg::Fused => Source::Fused,
    });
    (asked, None)
}

fn calibration(
    named: Option<&PathBuf>,
    properties: &Properties,
    recording: &Path,
) -> Result<(CalibrationFile, String)> {
    let (text, origin) = match named {
        Some(path) => {
            let text = plain_text(path, TEXT_BYTES_MAX).with_context(|| {
                format!(
                    "cannot read the calibration {}; name an existing file with --calibration",
                    path.display()
                )
            })?;
            (text, path.display().to_string())
        }
        None => (properties.calibration_toml.clone(), format!("{} (its calibration)", recording.display())),
    };
    Ok((bowwave_calibration::parse(&text, &origin)?, text))
}

/// The scenario, its text, and the folder that its models' paths start from.
fn scenario(
    named: Option<&PathBuf>,
    properties: &Properties,
    recording: &Path,
) -> Result<(Scenario, String, PathBuf)> {
    let folder = |path: &Path| path.parent().unwrap_or(Path::new("")).to_path_buf();
    let (text, origin, base) = match (named, &properties.scenario_toml) {
        (Some(path), _) => {
            let (text, base) = read_scenario(path)?;
            (text, path.display().to_string(), base)
        }
        (None, Some(text)) => {
            (text.clone(), format!("{} (its scenario)", recording.display()), folder(recording))
        }
        (None, None) => (scenario::DEFAULT.to_owned(), "built-in scenario".to_owned(), PathBuf::new()),
    };
    let scenario = Scenario::parse(&text, &origin)?;
    warn_of_former_names(&scenario.warnings);
    Ok((scenario, text, base))
}

/// The properties of a recording of this run: the same hardware, with the calibration and scenario in use.
pub fn properties_of_run(prepared: &Prepared, start: bowwave_core::time::Time) -> Properties {
    let mut extra = prepared.properties.extra.clone();
    extra.extend(session_properties(&prepared.setup, &prepared.models_base));
    Properties {
        calibration_toml: prepared.calibration_toml.clone(),
        scenario_toml: Some(prepared.scenario_toml.clone()),
        // What is kept is a stretch of the original: it need not close.
        loop_ns: None,
        start,
        source: format!("replay of {}", prepared.properties.source),
        extra,
        ..prepared.properties.clone()
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser as _;

    use super::*;
    use crate::cli::{CommandLine, ProgramCommand};

    #[test]
    fn the_former_name_of_a_fused_orientation_is_read_with_a_warning() {
        let asked = |arguments: &[&str]| {
            let cli = CommandLine::try_parse_from(["bowwave", "simulate"].iter().chain(arguments)).unwrap();
            let ProgramCommand::Simulate(simulate) = cli.command else { panic!("not simulate") };
            orientation(&simulate)
        };
        assert_eq!(asked(&[]), (None, None));
        assert_eq!(asked(&["--orientation", "fused"]), (Some(Source::Fused), None));
        assert_eq!(asked(&["--orientation", "auto"]), (Some(Source::Auto), None));
        let (former, warning) = asked(&["--fuse"]);
        assert_eq!(former, Some(Source::Fused));
        assert!(warning.is_some_and(|w| w.contains("--orientation fused")), "{warning:?}");
        for wrong in [&["--orientation", "unit"][..], &["--fuse", "--orientation", "auto"]] {
            assert!(
                CommandLine::try_parse_from(["bowwave", "simulate"].iter().chain(wrong)).is_err(),
                "{wrong:?}"
            );
        }
    }
}
