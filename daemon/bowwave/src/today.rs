//! The date of what is measured now.

use std::time::SystemTime;

use anyhow::{Context, Result};
use bowwave_calibration::Date;

/// The date in UTC: what is measured now is measured today.
pub fn today() -> Result<Date> {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).ok();
    now.and_then(|d| Date::from_unix_seconds(i64::try_from(d.as_secs()).ok()?))
        .context("the clock of this computer is not set: set it, so that what is measured can be dated")
}
