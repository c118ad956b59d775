//! What a run is made of, gathered from the command line, the configuration, the recording and what is built in.

use std::path::{Path, PathBuf};

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

use bowwave_trainer::presenter::Seat;

use crate::{
    cache,
    cli::{OrientationArg, Simulate},
    desk::{self, PreparedRun},
    loading::{read_scenario, scenario_models, warn_of_former_names},
};

/// A recording, and the run that it is for.
#[derive(Debug)]
pub struct PreparedRecording {
    /// The recording.
    pub path: PathBuf,
    /// Its length, nanoseconds.
    pub duration_ns: i64,
    /// The run.
    pub run: PreparedRun,
}

/// Gathers what a run needs, and refuses what cannot work before anything is begun.
pub fn prepare(arguments: &Simulate) -> Result<PreparedRecording> {
    let config = desk::config(&arguments.desk)?;
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
    if let Some(seed) = arguments.desk.seed {
        scenario.seed = seed;
    }
    let (models, boat_models) = scenario_models(&scenario, &base)?;
    let (orientation, warning) = orientation(arguments);
    if let Some(warning) = warning {
        log::warn!("{warning}");
    }
    let setup = Setup {
        scenario,
        own_ship: calibration.own_ship(),
        calibration: calibration.calibration,
        models: models.into(),
        boat_models,
        screen: desk::screen(&arguments.desk, &config),
        // JPEG pictures are decoded to RGB.
        video: PixelFormat::Rgb,
        orientation: orientation.unwrap_or(config.orientation),
        heading: config.heading.settings.clone(),
    };
    let window = desk::shows_window(&arguments.desk, &config);
    let record = arguments.desk.record || config.files.record;
    let gpu = desk::gpu(&arguments.desk, config.gpu);
    let source = format!("replay of {}", properties.source);
    let run = PreparedRun {
        properties,
        setup,
        scenario_toml,
        calibration_toml,
        models_base: base,
        gpu,
        window,
        seat: Seat::Trainee,
        source,
        record,
    };
    Ok(PreparedRecording { path: recording, duration_ns, run })
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
