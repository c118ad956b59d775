//! The gun in the configured camera's pictures, as they come.

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use bowwave_calibration::{CalibrationFile, outline::OutlineFinder};
use bowwave_core::event::Event;
use bowwave_devices::{
    camera::{CameraError, CameraPort},
    clock::{now, sleep_until},
    report::{Reports, reporting},
};
use crossbeam_channel::Receiver;

use crate::{
    cli::{CalibratePhantom, CalibrationFiles},
    config,
    run::settings::camera_of,
};

/// Seconds of pictures: before somebody traces, and to find what keeps still while the gun turns.
const TRACED_S: u32 = 3;
const FOUND_S: u32 = 30;
/// Pause between two looks at the camera's queue.
const LOOK_NS: i64 = 5_000_000;

/// The camera, with the calibration that goes with it.
pub struct LiveCamera {
    port: CameraPort,
    reports: Reports,
    file: CalibrationFile,
    path: PathBuf,
    seconds: u32,
}

impl LiveCamera {
    /// Starts the camera that the configuration names, in the calibrated size.
    pub fn open(arguments: &CalibratePhantom) -> Result<Self> {
        let config = config::read(&arguments.config)?;
        let path = arguments.files.named_or(config.files.calibration.as_deref(), &arguments.config)?;
        let file = CalibrationFile::read(&path).with_context(|| {
            format!(
                "{} must be a calibration of this camera's lens; begin with bowwave calibrate wizard",
                path.display()
            )
        })?;
        let lens = &file.calibration.lens;
        let settings = camera_of(&config, Some((lens.width, lens.height)), &file.camera_serial);
        let (reporter, reports) = reporting();
        let port = CameraPort::start(settings, reporter)?;
        let usual = if arguments.trace { TRACED_S } else { FOUND_S };
        Ok(Self { port, reports, file, path, seconds: arguments.seconds.unwrap_or(usual) })
    }

    /// The calibration.
    pub const fn file(&self) -> &CalibrationFile {
        &self.file
    }

    /// The file of that calibration, and the one to write.
    pub fn files(&self, named: &CalibrationFiles) -> CalibrationFiles {
        CalibrationFiles { calibration: Some(self.path.clone()), out: named.out.clone() }
    }

    /// Shows the camera's pictures to the finder for the time that was asked for, from the first one on.
    pub fn show(&self, finder: &mut OutlineFinder) -> Result<()> {
        let seconds = self.seconds;
        eprintln!("taking the camera's pictures for {seconds} s");
        let time = i64::from(seconds) * 1_000_000_000;
        let (mut taken, mut end) = (0, now().plus_ns(time));
        while now() < end {
            let new = see(self.port.events(), finder);
            if taken == 0 && new > 0 {
                end = now().plus_ns(time);
            }
            taken += new;
            sleep_until(now().plus_ns(LOOK_NS));
        }
        if taken == 0 {
            bail!(no_pictures(&self.reports.left().into_iter().map(|(_, cause)| cause).collect::<Vec<_>>()));
        }
        Ok(())
    }

    /// Shows pictures that came meanwhile to the finder; tells whether there were any.
    pub fn refresh(&self, finder: &mut OutlineFinder) -> bool {
        see(self.port.events(), finder) > 0
    }

    /// Closes the camera.
    pub fn close(self) -> Result<(), CameraError> {
        self.port.stop().map(drop)
    }
}

/// Shows all pictures that wait to the finder; their number.
fn see(events: &Receiver<Event>, finder: &mut OutlineFinder) -> u64 {
    let mut taken = 0;
    for event in events.try_iter() {
        if let Event::Frame(frame) = event {
            finder.see(&frame.picture);
            taken += 1;
        }
    }
    taken
}

/// Error of a camera without pictures, with what it reports.
fn no_pictures(causes: &[String]) -> String {
    let why = if causes.is_empty() { "it sends none".to_owned() } else { causes.join("; ") };
    format!(
        "no pictures from the camera: {why}; stop the trainer (systemctl stop bowwave), see what bowwave doctor --config FILE says, or give a \
         recording or a picture in place of --live"
    )
}

#[cfg(test)]
mod tests {
    use bowwave_core::{
        event::{CameraFrame, Picture, PixelFormat},
        time::Time,
    };
    use crossbeam_channel::unbounded;

    use super::*;

    #[test]
    fn pictures_that_wait_go_into_the_mean() {
        let (sender, events) = unbounded();
        let mut finder = OutlineFinder::new((4, 2));
        assert_eq!(see(&events, &mut finder), 0);
        for code in [100, 110] {
            let picture = Picture::new(PixelFormat::Nv12, 4, 2, vec![code; 12].into()).unwrap();
            let frame = CameraFrame {
                arrival: Time::from_ns(0),
                mid_exposure: Time::from_ns(0),
                sequence: 0,
                picture,
                jpeg: None,
            };
            sender.send(Event::Frame(frame)).unwrap();
        }
        assert_eq!((see(&events, &mut finder), finder.mean()), (2, vec![105; 8]));
    }

    #[test]
    fn a_camera_without_pictures_is_told_with_its_cause_and_what_to_do() {
        for (causes, why) in [(vec![], "it sends none"), (vec!["no device".to_owned()], "no device")] {
            let said = no_pictures(&causes);
            assert!(said.contains(why) && said.contains("systemctl stop bowwave"), "{said}");
        }
    }
}
