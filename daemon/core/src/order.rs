//! Orders of an instructor to a running exercise.

use serde::{Deserialize, Serialize};

use crate::{engagement::Engagement, time::Time};

/// Most bytes of a text for the trainee: two lines of the LCD.
pub const MESSAGE_BYTES_MAX: usize = 120;
/// Most bytes of a note.
pub const NOTE_BYTES_MAX: usize = 2000;
/// Most bytes of a boat's name in an order.
pub const NAME_BYTES_MAX: usize = 200;
/// Ranges at which a boat may join, metres.
pub const JOIN_RANGE_M: std::ops::RangeInclusive<f64> = 50.0..=20_000.0;

/// Something that an instructor orders while an exercise runs. Calls of the trainee's are [`crate::act::Act`]s.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "order", rename_all = "snake_case")]
pub enum Order {
    /// Other rules of engagement hold from now on.
    Rules {
        /// The rules.
        rules: Engagement,
    },
    /// The virtual weapon has a stoppage with its next round.
    Stoppage,
    /// Text for the trainee, shown on the LCD.
    Message {
        /// The text, of one line.
        text: String,
    },
    /// Text for the debrief that the trainee does not see.
    Note {
        /// The text.
        text: String,
    },
    /// A boat of the scenario's reserve joins.
    Join {
        /// Its name.
        boat: String,
        /// Another place than the scenario's; `None` for that.
        at: Option<JoinPlace>,
    },
    /// The exercise stands still: boats, clock and weapon. Rounds in the air wait.
    Pause,
    /// It goes on.
    Resume,
}

/// Place from the gun at which a boat joins.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct JoinPlace {
    /// Clockwise from true north, degrees.
    pub bearing_deg: f64,
    /// Metres.
    pub range_m: f64,
}

/// An order that cannot be carried out.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OrderError {
    /// A text is empty, too long, or has control characters.
    #[error("the text must have 1 to {most} bytes and no control characters; it has {bytes} bytes")]
    Text {
        /// Bytes that it may have.
        most: usize,
        /// Bytes that it has.
        bytes: usize,
    },
    /// A text for the LCD has letters that it does not have.
    #[error("the LCD shows letters without accents only (ASCII): write the text with these")]
    NoAscii,
    /// A place is no number, or out of reach.
    #[error(
        "bearing {bearing_deg} deg, range {range_m} m is no place: give a bearing of 0 to 360 and a range of 50 to 20000"
    )]
    Place {
        /// Bearing given.
        bearing_deg: f64,
        /// Range given.
        range_m: f64,
    },
}

impl Order {
    /// Checks lengths and numbers.
    ///
    /// # Errors
    /// A text that is none, or a place that is none, is refused.
    pub fn check(&self) -> Result<(), OrderError> {
        match self {
            // The LCD's letters are those of ASCII.
            Self::Message { text } if !text.is_ascii() => Err(OrderError::NoAscii),
            Self::Message { text } => plain(text, MESSAGE_BYTES_MAX),
            Self::Note { text } => plain(text, NOTE_BYTES_MAX),
            Self::Join { boat, at } => {
                plain(boat, NAME_BYTES_MAX)?;
                at.map_or(Ok(()), JoinPlace::check)
            }
            Self::Rules { .. } | Self::Stoppage | Self::Pause | Self::Resume => Ok(()),
        }
    }
}

impl JoinPlace {
    fn check(self) -> Result<(), OrderError> {
        let Self { bearing_deg, range_m } = self;
        if (0.0..=360.0).contains(&bearing_deg) && JOIN_RANGE_M.contains(&range_m) {
            Ok(())
        } else {
            Err(OrderError::Place { bearing_deg, range_m })
        }
    }
}

fn plain(text: &str, most: usize) -> Result<(), OrderError> {
    let bytes = text.len();
    if text.trim().is_empty() || bytes > most || text.chars().any(char::is_control) {
        return Err(OrderError::Text { most, bytes });
    }
    Ok(())
}

/// An order with its time.
#[derive(Clone, Debug, PartialEq)]
pub struct InstructorOrder {
    /// When.
    pub time: Time,
    /// What.
    pub order: Order,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_that_are_none_are_refused_in_words() {
        let message = |text: &str| Order::Message { text: text.to_owned() }.check();
        assert_eq!(message("CEASE FIRE, REPORT"), Ok(()));
        assert_eq!(message("GRÜSSE"), Err(OrderError::NoAscii));
        assert!(message(" ").is_err() && message("two\nlines").is_err());
        assert!(message(&"x".repeat(MESSAGE_BYTES_MAX + 1)).unwrap_err().to_string().contains("121 bytes"));
        let join = |bearing_deg, range_m| {
            Order::Join { boat: "skiff-1".into(), at: Some(JoinPlace { bearing_deg, range_m }) }.check()
        };
        assert_eq!(join(350.0, 800.0), Ok(()));
        for (bearing_deg, range_m) in [(f64::NAN, 800.0), (10.0, f64::INFINITY), (-1.0, 800.0), (10.0, 10.0)]
        {
            assert!(join(bearing_deg, range_m).is_err(), "{bearing_deg} {range_m}");
        }
    }
}
