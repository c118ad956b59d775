//! The heading in the summary of a run.

use bowwave_core::{estimate::HeadingCounts, session::Session};
use serde::{Serialize, Serializer, ser::SerializeStruct};

/// The heading at the end of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadingSummary {
    /// Standard deviation since it was set or began, degrees.
    pub sigma_deg: f64,
    /// Headings of the ship, and presses of the operator.
    pub counts: HeadingCounts,
}

impl HeadingSummary {
    /// Of a session; `None` where there was no heading.
    pub fn of(session: &Session) -> Option<Self> {
        let counts = session.sensor_counts().headings;
        Some(Self { sigma_deg: session.heading_sigma()?.to_degrees(), counts })
    }
}

impl Serialize for HeadingSummary {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let HeadingCounts { ship, ship_taken, ship_refused, rests, marks, marks_refused } = self.counts;
        let mut out = serializer.serialize_struct("HeadingSummary", 7)?;
        out.serialize_field("sigma_deg", &self.sigma_deg)?;
        out.serialize_field("ship", &ship)?;
        out.serialize_field("ship_taken", &ship_taken)?;
        out.serialize_field("ship_refused", &ship_refused)?;
        out.serialize_field("rests", &rests)?;
        out.serialize_field("marks", &marks)?;
        out.serialize_field("marks_refused", &marks_refused)?;
        out.end()
    }
}
