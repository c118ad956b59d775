//! What a run tells of the heading: in the summary.

use bowwave_core::session::Session;
use serde::Serialize;

/// The heading at the end of a run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct HeadingSummary {
    /// Standard deviation since it was set or began, degrees.
    pub sigma_deg: f64,
    /// Headings of the ship that came.
    pub ship: u64,
    /// Of these, taken in.
    pub ship_taken: u64,
    /// Of these, not believed.
    pub ship_refused: u64,
    /// Rests of the gun on its mount at whose start the ship's heading was tied to the gun's.
    pub rests: u64,
    /// Presses of the operator that set the heading.
    pub marks: u64,
    /// Presses that could not be used.
    pub marks_refused: u64,
}

impl HeadingSummary {
    /// Of a session; `None` where there was no heading.
    pub fn of(session: &Session) -> Option<Self> {
        let c = session.sensor_counts().headings;
        Some(Self {
            sigma_deg: session.heading_sigma()?.to_degrees(),
            ship: c.ship,
            ship_taken: c.ship_taken,
            ship_refused: c.ship_refused,
            rests: c.rests,
            marks: c.marks,
            marks_refused: c.marks_refused,
        })
    }
}
