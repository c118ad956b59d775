//! The guide over the live picture: drawn by the trainer's own renderer, shown on its own way.

use std::sync::Arc;

use anyhow::Result;
use bowwave_core::{
    event::{CameraFrame, Event, Picture, Tick},
    guide::Guide,
    session::{Session, View},
    time::Time,
};
use bowwave_devices::clock::now;
use bowwave_trainer::{
    presenter::{Handed, OutputOptions, Presenter, PresenterOptions, UserEvent},
    source::Devices,
};

use crate::run::settings::Settings;

/// Nanoseconds that a frame may take.
const FRAME_NS: i64 = 33_333_333;

/// A screen with the newest picture and the guide over it.
pub struct Screen {
    presenter: Presenter,
    options: PresenterOptions,
    session: Session,
    picture: Option<(Picture, bool)>,
    is_closed: bool,
}

impl Screen {
    /// Opens the LCD of the hardware, or a window. The settings' scenario loses its boats.
    pub fn open(settings: &mut Settings, devices: Option<&Devices>, window: bool) -> Result<Self> {
        let setup = &mut settings.setup;
        setup.scenario.boats.clear();
        setup.boat_models.clear();
        if let Some(size) = settings.config.size.or_else(|| devices?.await_lcd_size()) {
            setup.screen = size;
        }
        let session = Session::new(setup.clone())?;
        let options = PresenterOptions {
            gpu: settings.config.gpu.clone(),
            validation: settings.config.validation,
            gpu_timeout: settings.config.gpu_timeout,
            output: OutputOptions {
                reporter: devices.map(Devices::output_reporter),
                lcd: devices.and_then(Devices::lcd),
                window,
                ..OutputOptions::default()
            },
        };
        let presenter = Presenter::open(&session, &[], &options)?;
        Ok(Self { presenter, options, session, picture: None, is_closed: false })
    }

    /// Takes a picture; the newest is shown.
    pub fn picture(&mut self, picture: &Picture) {
        let plan = self.session.plan();
        // One of another size cannot be shown through this lens; the guide says so.
        if (picture.width(), picture.height()) == plan.picture {
            self.picture = Some((picture.clone(), true));
        }
    }

    /// Shows the guide.
    pub fn show(&mut self, guide: Guide) -> Result<()> {
        let begun = now();
        let planned = *self.session.plan();
        if let Some((picture, true)) = &self.picture {
            self.session.event(&Event::Frame(shown_now(picture, begun)));
        }
        if *self.session.plan() != planned {
            self.presenter.reopen(&self.session, &[], &self.options)?;
        }
        let view = self.session.tick(Tick::at(begun)).view;
        let mut scene = view.scene.clone();
        scene.guide = Some(Arc::new(guide));
        let view = View { scene: &scene, ..view };
        if let Some((_, is_new)) = &mut self.picture {
            *is_new = false;
        }
        let handed = self.presenter.show(&view, begun, Some(begun.plus_ns(FRAME_NS)))?;
        self.is_closed |= self.presenter.user_events().any(|e| e == UserEvent::Quit);
        if handed == Handed::OutputEnded {
            return Err(match self.presenter.take_error() {
                Some(e) => e,
                None => anyhow::anyhow!("the output thread has ended without a word; report it with the log"),
            });
        }
        Ok(())
    }

    /// Whether the window was closed.
    pub const fn is_closed(&self) -> bool {
        self.is_closed
    }

    /// Takes the last frames out.
    pub fn close(self) {
        if let Err(e) = self.presenter.close() {
            log::debug!("the output thread ended with: {e:#}");
        }
    }
}

/// A picture without a time of its own, as one that was exposed now.
fn shown_now(picture: &Picture, now: Time) -> CameraFrame {
    CameraFrame { arrival: now, mid_exposure: now, sequence: 0, picture: picture.clone(), jpeg: None }
}

#[cfg(test)]
mod tests {
    use bowwave_core::event::PixelFormat;

    use super::*;
    use crate::run::settings::Reader;

    #[test]
    fn pages_are_drawn_over_pictures_of_any_layout_and_over_none() {
        let mut settings = Reader { config: "absent.toml".into(), last_good: None }.read().unwrap();
        settings.config.gpu = Some("llvmpipe".to_owned());
        settings.setup.screen = (320, 192);
        let mut screen = Screen::open(&mut settings, None, false).unwrap();
        let guide = Guide { title: "Calibrate".to_owned(), says: "Begin".to_owned(), ..Guide::default() };
        screen.show(guide.clone()).unwrap();
        for (format, width) in [(PixelFormat::Yuyv, 1280), (PixelFormat::Rgb, 1280), (PixelFormat::Rgb, 640)]
        {
            screen.picture(&Picture::black(format, width, 720).unwrap());
            screen.show(guide.clone()).unwrap();
        }
        assert!(!screen.is_closed());
        assert_eq!(screen.session.plan().video, PixelFormat::Rgb);
        screen.close();
    }
}
