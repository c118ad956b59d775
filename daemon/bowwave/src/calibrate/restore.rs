//! `bowwave calibrate restore`: puts a calibration back that was replaced.

use anyhow::{Result, bail};
use bowwave_calibration::history;

use crate::{cli::CalibrateRestore, outcome::Outcome, stdout};

/// Puts it back, or lists what there is.
pub fn run(arguments: &CalibrateRestore) -> Result<Outcome> {
    let path = &arguments.calibration;
    if arguments.list {
        for kept in history::copies(path)? {
            let made = kept.made.map_or_else(|| "cannot be read".to_owned(), |d| format!("made on {d}"));
            stdout::print(format!("{:4}  {made}  {}\n", kept.number, kept.path.display()))?;
        }
        return Ok(Outcome::Done);
    }
    let Some(kept) = history::restore(path, arguments.number)? else {
        bail!("nothing else is kept of {}: no calibration has replaced one there", path.display());
    };
    eprintln!(
        "{} is number {} again; what stood there is kept as the newest copy, so that restoring once more undoes it",
        path.display(),
        kept.number
    );
    Ok(Outcome::Done)
}
