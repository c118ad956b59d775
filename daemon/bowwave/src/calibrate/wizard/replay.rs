//! The wizard on a recording.

use std::path::Path;

use anyhow::{Context, Result};
use bowwave_calibration::wizard::{Ask, Input, Key, WizardStep};
use bowwave_core::event::Event;

use super::{Guided, live, player::RecordingPlayer, terminal::TerminalUi};
use crate::{calibrate::input::open, cli::CalibrateWizard, outcome::Outcome};

/// Runs on a recording: at its own pace, or as fast as it goes.
pub fn run(recording: &Path, arguments: &CalibrateWizard) -> Result<Outcome> {
    let named = arguments.files.calibration.clone();
    let opened = open(recording, named.as_deref())?;
    // A task without pictures of the horizon does not need it.
    let height = arguments.eye_height.or_else(|| opened.height()).with_context(|| {
        format!("{} does not say how high the camera was; say it with --eye-height", recording.display())
    })?;
    let out = arguments.files.out.clone().or_else(|| named.clone());
    let guided = Guided::new(arguments, opened.file, out, height)?;
    let player = RecordingPlayer::start(recording.to_owned(), named, !arguments.fast)?;
    if arguments.fast { fast(guided, player, arguments) } else { live::paced(guided, player, arguments) }
}

/// Without a clock, and keys only where one is waited for: the same recording and keys give the same pages.
fn fast(mut guided: Guided, player: RecordingPlayer, arguments: &CalibrateWizard) -> Result<Outcome> {
    let mut teller = TerminalUi::new();
    let mut eyes = guided.eyes(arguments);
    while guided.wizard.step() != WizardStep::Over {
        teller.show(&guided.wizard.guide())?;
        if teller.is_interrupted() {
            guided.wizard.take(Input::Key(Key::Quit));
        } else if let Some(ask) = guided.wizard.ask() {
            match ask {
                Ask::Solve(work) => {
                    let solved = work.run();
                    let report = solved.report.clone();
                    guided.wizard.take(Input::Solved(Box::new(solved)));
                    guided.report(&report);
                }
                Ask::Save(found) => {
                    guided.save(&found);
                    eyes = guided.eyes(arguments);
                }
                Ask::End => {}
            }
        } else if guided.wizard.waits() {
            let key = teller.wait_key().unwrap_or(Key::Quit);
            guided.wizard.take(Input::Key(key));
        } else {
            match player.events.recv() {
                Ok(Event::Frame(frame)) => {
                    let finding = eyes.look(guided.wizard.look(), &frame);
                    guided.wizard.take(Input::Seen(frame.arrival, finding));
                }
                Ok(event) => guided.event(event),
                Err(_) => guided.wizard.take(Input::Ended),
            }
        }
    }
    teller.finish(&guided.wizard.guide())?;
    player.finish()?;
    Ok(guided.outcome())
}
