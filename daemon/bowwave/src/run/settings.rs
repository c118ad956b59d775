//! What a run is made of: configuration, calibration, scenario. Each that is refused is replaced by its last good copy, kept in
//! the data folder, so that a mistake in a file does not end the training.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::mpsc::channel,
    thread,
    time::Duration,
};

use anyhow::{Context, Result};
use bowwave_calibration::CalibrationFile;
use bowwave_core::{
    calibration::Calibration,
    event::PixelFormat,
    fault::{Fault, FaultChange},
    geometry::Lens,
    model::Model,
    session::Setup,
    text::toml::TEXT_BYTES_MAX,
    world::scenario::{self, Scenario},
};
use bowwave_devices::{camera::CameraSettings, clock::now};
use bowwave_files::plain_text;
use bowwave_trainer::instructor::AskedScenario;
use glam::{DQuat, DVec2, DVec3};

use super::DATA;
use crate::{
    config::{self, Config},
    instructed,
    loading::{LoadedScenario, parse_scenario, read_scenario, warn_of_former_names},
};

/// Where nobody says how large pictures are.
const USUAL_SIZE: (u32, u32) = (1280, 720);
/// Horizontal field of view of the lens that is taken where none is calibrated, radians: of most cameras.
const USUAL_VIEW: f64 = 1.05;

/// What a run is made of.
#[derive(Debug)]
pub struct Settings {
    /// The configuration.
    pub config: Config,
    /// What the session is made from; screen and video are found out later.
    pub setup: Setup,
    /// The camera's serial number in the calibration; may be empty.
    pub camera_serial: String,
    /// Text of the calibration; empty where there is none.
    pub calibration_toml: String,
    /// Text of the scenario.
    pub scenario_toml: String,
    /// Folder that the paths of the scenario's models start from.
    pub models_base: PathBuf,
    /// What was refused.
    pub faults: Vec<FaultChange>,
    /// The configuration was refused, and this is an earlier one: its wiring may be that of another gun.
    pub config_is_former: bool,
}

/// Reads settings, with a place for the last good ones.
#[derive(Clone, Debug)]
pub struct Reader {
    /// The configuration file.
    pub config: PathBuf,
    /// Folder of the last good copies; none are kept without it.
    pub last_good: Option<PathBuf>,
    /// The scenario that the instructor asked for, in the configured one's place.
    pub asked: Option<AskedScenario>,
    /// The data folder that the command line names.
    pub data: Option<PathBuf>,
    /// The service's own folder.
    pub state: Option<PathBuf>,
    /// The files that were named do not answer: a mount hangs.
    is_silent: bool,
}

/// A text that was accepted, or the last good one with why the new one was refused.
struct Accepted<T> {
    value: T,
    text: String,
    refused: Option<anyhow::Error>,
}

impl Reader {
    /// For that configuration.
    pub const fn new(config: PathBuf, last_good: Option<PathBuf>) -> Self {
        Self { config, last_good, asked: None, data: None, state: None, is_silent: false }
    }

    /// The folder for hits, recordings and scenarios under that configuration.
    pub fn data(&self, config: &Config) -> PathBuf {
        let named = self.data.as_ref().or(config.files.data.as_ref()).or(self.state.as_ref());
        named.cloned().unwrap_or_else(|| Path::new(DATA).into())
    }

    /// Reads everything. Fails only where not even what is built in works. A mount that hangs, as of a stick that was pulled, holds nobody
    /// for longer than ten seconds: the last good copies are used then.
    pub fn read(&self) -> Result<Settings> {
        /// A slow disk reads the largest model in a tenth of that.
        const LONGEST: Duration = Duration::from_secs(10);
        let reader = self.clone();
        within(LONGEST, move || reader.read_files())
            .unwrap_or_else(|| Self { is_silent: true, ..self.clone() }.read_files())
    }

    fn read_files(&self) -> Result<Settings> {
        let mut faults = Vec::new();
        let mut refuse = |fault: Fault, why: &anyhow::Error| {
            faults.push(FaultChange::raised(now(), fault, format!("{why:#}")));
        };
        let (config, config_is_former) = self.config(&mut refuse);
        let calibration = self.calibration(&config, &mut refuse);
        let (scenario, scenario_toml, models, boat_models, models_base) =
            self.scenario(&config, &mut refuse)?;
        let own_ship = calibration.as_ref().map(|c| c.value.own_ship()).unwrap_or_default();
        let (calibration, calibration_toml, camera_serial) = match calibration {
            Some(c) => (c.value.calibration, c.text, c.value.camera_serial),
            None => (uncalibrated(&config), String::new(), String::new()),
        };
        let setup = Setup {
            scenario,
            calibration,
            models: models.into(),
            boat_models,
            screen: config.size.unwrap_or(USUAL_SIZE),
            video: PixelFormat::Yuyv,
            orientation: config.orientation,
            heading: config.heading.settings.clone(),
            own_ship,
        };
        Ok(Settings {
            config,
            setup,
            camera_serial,
            calibration_toml,
            scenario_toml,
            models_base,
            faults,
            config_is_former,
        })
    }

    /// The configuration, and whether it is an earlier one because the file was refused.
    fn config(&self, refuse: &mut impl FnMut(Fault, &anyhow::Error)) -> (Config, bool) {
        let base = self.config.parent().unwrap_or(Path::new("."));
        let accepted =
            self.accept("bowwave.toml", Some(&self.config), |text, origin| config::parse(text, origin, base));
        match accepted {
            Some(a) => {
                if let Some(why) = &a.refused {
                    refuse(
                        Fault::Config,
                        &why_and_instead(why, "the last good configuration is used, and nothing arms"),
                    );
                }
                warn_of_former_names(&a.value.warnings);
                (a.value, a.refused.is_some())
            }
            None => {
                let read = self.answers(&self.config).and_then(|()| config::read(&self.config));
                let why = read.err().unwrap_or_else(|| anyhow::anyhow!("cannot be read"));
                refuse(Fault::Config, &why_and_instead(&why, "the trainer runs as without a configuration"));
                (Config::default(), false)
            }
        }
    }

    fn calibration(
        &self,
        config: &Config,
        refuse: &mut impl FnMut(Fault, &anyhow::Error),
    ) -> Option<Accepted<CalibrationFile>> {
        let parse = |text: &str, origin: &str| {
            let file = bowwave_calibration::parse(text, origin)?;
            possible(&file.calibration.lens).with_context(|| origin.to_owned())?;
            Ok(file)
        };
        let accepted = self.accept("calibration.toml", config.files.calibration.as_deref(), parse);
        match (&accepted, &config.files.calibration) {
            (Some(a), _) => {
                if let Some(why) = &a.refused {
                    refuse(Fault::Config, &why_and_instead(why, "the last good calibration is used"));
                }
            }
            (None, None) => refuse(
                Fault::NoCalibration,
                &anyhow::anyhow!("{} names no calibration: set files.calibration", self.config.display()),
            ),
            (None, Some(path)) => {
                let why = self.text(path).and_then(|text| parse(&text, &path.display().to_string())).err();
                let why = why.unwrap_or_else(|| anyhow::anyhow!("{} cannot be used", path.display()));
                refuse(Fault::NoCalibration, &why);
            }
        }
        accepted
    }

    #[allow(clippy::type_complexity, reason = "the parts of a setup, once")]
    fn scenario(
        &self,
        config: &Config,
        refuse: &mut impl FnMut(Fault, &anyhow::Error),
    ) -> Result<(Scenario, String, Vec<Model>, Vec<bowwave_core::model::ModelId>, PathBuf)> {
        let load = |text: &str, origin: &str, base: &Path| -> Result<_> {
            let LoadedScenario { scenario, models, of_boats } = parse_scenario(text, origin, base)?;
            Ok((scenario, text.to_owned(), models, of_boats, base.to_owned()))
        };
        if let Some(asked) = &self.asked {
            let base = instructed::scenarios(config, &self.data(config));
            // It was checked as it was asked for, but files change.
            match instructed::load(asked, &base) {
                Ok(LoadedScenario { scenario, models, of_boats }) => {
                    return Ok((scenario, asked.text.clone(), models, of_boats, base));
                }
                Err(why) => {
                    refuse(Fault::Config, &why_and_instead(&why, "the configured scenario is used"));
                }
            }
        }
        if let Some(path) = &config.files.scenario {
            let named = self.answers(path).and_then(|()| read_scenario(path)).and_then(|(text, base)| {
                let loaded = load(&text, &path.display().to_string(), &base)?;
                self.keep("scenario.toml", &text);
                Ok(loaded)
            });
            let base = path.parent().unwrap_or(Path::new(""));
            match named {
                Ok(loaded) => return Ok(loaded),
                // Models that the last good one names may lie where nothing answers.
                Err(why) => match self
                    .kept("scenario.toml")
                    .filter(|_| !self.is_silent)
                    .and_then(|text| load(&text, "last good scenario", base).ok())
                {
                    Some(loaded) => {
                        refuse(Fault::Config, &why_and_instead(&why, "the last good scenario is used"));
                        return Ok(loaded);
                    }
                    None => refuse(Fault::Config, &why_and_instead(&why, "the built-in scenario is used")),
                },
            }
        }
        load(scenario::DEFAULT, "built-in scenario", Path::new(""))
            .context("the built-in scenario is unusable")
    }

    /// The file at `path` where it is good, else its last good copy.
    fn accept<T>(
        &self,
        name: &str,
        path: Option<&Path>,
        parse: impl Fn(&str, &str) -> Result<T>,
    ) -> Option<Accepted<T>> {
        let path = path?;
        let new = self.text(path).and_then(|text| Ok((parse(&text, &path.display().to_string())?, text)));
        match new {
            Ok((value, text)) => {
                self.keep(name, &text);
                Some(Accepted { value, text, refused: None })
            }
            Err(why) => {
                let text = self.kept(name)?;
                let value = parse(&text, &format!("last good {name}")).ok()?;
                Some(Accepted { value, text, refused: Some(why) })
            }
        }
    }

    /// Refuses a file that somebody named while its mount does not answer; a built-in scenario's name is none.
    fn answers(&self, path: &Path) -> Result<()> {
        if self.is_silent && !scenario::BUILT_IN.iter().any(|(name, _)| path == Path::new(name)) {
            anyhow::bail!("{} does not answer; does its mount hang?", path.display());
        }
        Ok(())
    }

    /// The text of a file that somebody named.
    fn text(&self, path: &Path) -> Result<String> {
        self.answers(path)?;
        read_text(path)
    }

    fn kept(&self, name: &str) -> Option<String> {
        read_text(&self.last_good.as_ref()?.join(name)).ok()
    }

    /// Keeps a good text: whole or not at all, also when power is cut.
    fn keep(&self, name: &str, text: &str) {
        let Some(folder) = &self.last_good else { return };
        if self.kept(name).as_deref() == Some(text) {
            return;
        }
        let write = || -> std::io::Result<()> {
            fs::create_dir_all(folder)?;
            let making = folder.join(format!("{name}.making"));
            let mut file = fs::File::create(&making)?;
            std::io::Write::write_all(&mut file, text.as_bytes())?;
            file.sync_all()?;
            fs::rename(&making, folder.join(name))
        };
        if let Err(e) = write() {
            log::warn!("cannot keep a copy of the good {name} in {}: {e}", folder.display());
        }
    }
}

/// Result of a call, unless it takes longer: then its thread is left behind, for nothing ends a call into a file system that hangs.
fn within<T: Send + 'static>(longest: Duration, call: impl FnOnce() -> T + Send + 'static) -> Option<T> {
    let (sender, result) = channel();
    thread::Builder::new()
        .name("settings".to_owned())
        .spawn(move || {
            // Whoever waited may have given up.
            let _ = sender.send(call());
        })
        .ok()?;
    result.recv_timeout(longest).ok()
}

fn read_text(path: &Path) -> Result<String> {
    plain_text(path, TEXT_BYTES_MAX).with_context(|| format!("cannot read {}", path.display()))
}

/// Whether there are cameras of this size, in every coding.
fn possible(lens: &Lens) -> Result<()> {
    let size = (lens.width, lens.height);
    CameraSettings { calibrated_size: Some(size), ..CameraSettings::default() }.check()?;
    anyhow::ensure!(
        lens.width.is_multiple_of(2) && lens.height.is_multiple_of(2),
        "size_px {}x{}: pictures have an even size; calibrate in a mode that the camera has",
        lens.width,
        lens.height
    );
    Ok(())
}

fn why_and_instead(why: &anyhow::Error, instead: &str) -> anyhow::Error {
    anyhow::anyhow!("{why:#}; {instead}")
}

/// What is asked of the camera: the configuration's wishes for the calibrated camera.
pub fn camera_settings(settings: &Settings) -> CameraSettings {
    let lens = &settings.setup.calibration.lens;
    let calibrated = !settings.calibration_toml.is_empty();
    let size = calibrated.then_some((lens.width, lens.height));
    camera_of(&settings.config, size, &settings.camera_serial)
}

/// The configuration's camera, with the size and serial number of the calibration; the number may be empty.
pub fn camera_of(config: &Config, calibrated_size: Option<(u32, u32)>, serial: &str) -> CameraSettings {
    let mut camera = config.camera.clone();
    camera.calibrated_size = calibrated_size;
    // The configuration can name another one, for a camera that was exchanged for its like.
    if camera.serial.is_none() && !serial.is_empty() {
        camera.serial = Some(serial.to_owned());
    }
    camera
}

/// A lens and mounting to show pictures with; nothing is scored with it.
fn uncalibrated(config: &Config) -> Calibration {
    let (width, height) = config.camera.modes.first().map_or(USUAL_SIZE, |m| (m.width, m.height));
    Calibration {
        lens: Lens::pinhole(width, height, USUAL_VIEW),
        focal_sigma_px: f64::from(width),
        camera_from_imu: DQuat::IDENTITY,
        camera_from_imu_sigma: DVec3::ONE,
        time_offset_ns: 0,
        time_offset_sigma_ns: 100_000_000,
        readout_ns: 0,
        readout_sigma_ns: 0,
        boresight: DVec2::ZERO,
        boresight_sigma: 1.0,
        muzzle_in_camera: DVec3::ZERO,
        trigger: None,
        gyro_bias: DVec3::ZERO,
        gyro_bias_sigma: DVec3::ONE,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Folder(PathBuf);

    impl Folder {
        fn new(name: &str) -> Self {
            let path = std::env::temp_dir().join(format!("bowwave-{name}-{}", std::process::id()));
            fs::create_dir_all(&path).unwrap();
            Self(path)
        }

        fn reader(&self) -> Reader {
            Reader::new(self.0.join("bowwave.toml"), Some(self.0.join("last-good")))
        }

        fn write(&self, name: &str, text: &str) {
            fs::write(self.0.join(name), text).unwrap();
        }
    }

    impl Drop for Folder {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    fn faults(settings: &Settings) -> Vec<Fault> {
        settings.faults.iter().map(|f| f.fault).collect()
    }

    #[test]
    fn what_is_refused_is_replaced_by_its_last_good_copy() {
        let folder = Folder::new("settings");
        let calibration = include_str!("../../../../calibration/examples/mount.toml");
        folder.write("calibration.toml", calibration);
        folder.write("bowwave.toml", "[files]\ncalibration = \"calibration.toml\"\nscenario = \"swarm\"\n");
        let good = folder.reader().read().unwrap();
        assert_eq!(faults(&good), []);
        let boats = good.setup.scenario.boats.len();

        folder.write("bowwave.toml", "[files]\ncalibration = 3\n");
        folder.write("calibration.toml", "nonsense");
        let kept = folder.reader().read().unwrap();
        assert_eq!(faults(&kept), [Fault::Config, Fault::Config]);
        assert_eq!(kept.setup.scenario.boats.len(), boats);
        assert_eq!(kept.setup.calibration.lens, good.setup.calibration.lens);
        assert!(kept.config_is_former && !good.config_is_former);
        let said = format!("{:?}", kept.faults[0].change);
        assert!(said.contains("bowwave.toml:2:15") && said.contains("last good"), "{said}");
    }

    #[test]
    fn a_mount_that_hangs_holds_nobody_and_the_last_good_copies_are_used() {
        assert_eq!(within(Duration::from_secs(20), || 3), Some(3));
        let (hold, held) = channel::<()>();
        assert_eq!(within(Duration::from_millis(20), move || held.recv().is_ok()), None);
        drop(hold);
        let folder = Folder::new("silent");
        let calibration = include_str!("../../../../calibration/examples/mount.toml");
        folder.write("calibration.toml", calibration);
        folder.write("bowwave.toml", "[files]\ncalibration = \"calibration.toml\"\nscenario = \"swarm\"\n");
        let good = folder.reader().read().unwrap();
        let kept = Reader { is_silent: true, ..folder.reader() }.read_files().unwrap();
        assert_eq!(faults(&kept), [Fault::Config, Fault::Config]);
        assert_eq!(kept.setup.calibration.lens, good.setup.calibration.lens);
        assert_eq!(kept.setup.scenario.boats.len(), good.setup.scenario.boats.len());
        assert!(kept.config_is_former);
        let said = format!("{:?}", kept.faults[0].change);
        assert!(said.contains("bowwave.toml does not answer"), "{said}");
    }

    #[test]
    fn sizes_that_no_camera_has_are_refused_before_anything_is_started() {
        let folder = Folder::new("sizes");
        let calibration = include_str!("../../../../calibration/examples/mount.toml");
        folder.write("calibration.toml", calibration);
        let config = "[files]\ncalibration = \"calibration.toml\"\n";
        folder.write("bowwave.toml", config);
        let good = folder.reader().read().unwrap();
        let lens = good.setup.calibration.lens;
        let from = format!("{}, {}", lens.width, lens.height);
        assert!(calibration.contains(&from), "{from}");
        for size in ["641, 480", "8, 8"] {
            folder.write("calibration.toml", &calibration.replace(&from, size));
            let kept = folder.reader().read().unwrap();
            assert_eq!(faults(&kept), [Fault::Config], "{size}");
            assert_eq!(kept.setup.calibration.lens, lens);
        }
        folder.write("calibration.toml", calibration);
        folder.write("bowwave.toml", &format!("[camera]\nmodes = [\"YUYV 641x480@30\"]\n{config}"));
        let kept = folder.reader().read().unwrap();
        assert_eq!(faults(&kept), [Fault::Config]);
        assert!(kept.config.camera.modes.is_empty());
    }

    #[test]
    fn without_any_calibration_pictures_are_shown_and_nothing_fires() {
        let folder = Folder::new("uncalibrated");
        let settings = folder.reader().read().unwrap();
        assert_eq!(faults(&settings), [Fault::Config, Fault::NoCalibration]);
        folder.write("bowwave.toml", "[files]\ncalibration = \"absent.toml\"\nscenario = \"absent.toml\"\n");
        let settings = folder.reader().read().unwrap();
        assert_eq!(faults(&settings), [Fault::NoCalibration, Fault::Config]);
    }
}
