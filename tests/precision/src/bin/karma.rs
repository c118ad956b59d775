//! Calibrates a camera from its own film and gyro, and says how far an overlay would drift.

use std::process::ExitCode;

use precision::karma::report;

fn main() -> ExitCode {
    match report::run() {
        Ok(None) => ExitCode::SUCCESS,
        Ok(Some(met)) => ExitCode::from(u8::from(!met)),
        Err(e) => {
            eprintln!("karma: {e:#}");
            ExitCode::FAILURE
        }
    }
}
