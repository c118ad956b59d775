//! Messages of the browser over its WebSocket.

use bowwave_core::{
    act::Act,
    order::{Order, OrderError},
};
use serde::Deserialize;

/// Most bytes of a message: the longest note, each byte of it escaped.
pub const COMMAND_BYTES_MAX: usize = 16 << 10;

/// A message of the browser.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Command {
    /// The picture of that number is drawn: the next may come.
    Drawn {
        /// Its number.
        frame: u64,
    },
    /// Pictures are wanted, or not, as by a page in the background.
    Pictures {
        /// They are.
        on: bool,
    },
    /// Asks for an answer at once, to measure how long that takes.
    Ping {
        /// The browser's time, which comes back.
        t: f64,
    },
    /// Takes control, from whoever has it.
    TakeControl {},
    /// Gives control back.
    HandBack {},
    /// Orders something of the exercise.
    Order {
        /// The order.
        order: Order,
    },
    /// Marks a call of the trainee's.
    Act {
        /// The act.
        act: Act,
    },
    /// Ends the exercise.
    StandBy {},
    /// Begins the scenario that was begun last once more.
    Reset {},
}

/// A message that is none.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CommandError {
    /// It is too long.
    #[error("a message of {0} bytes, where {COMMAND_BYTES_MAX} are the most")]
    TooLong(usize),
    /// It is no message of this version.
    #[error("a message that is none of this version's ({0}): load the page again")]
    Content(String),
    /// It orders what cannot be.
    #[error(transparent)]
    Order(#[from] OrderError),
    /// It marks an act that nobody calls out.
    #[error("{0} is nothing that an instructor marks")]
    Act(&'static str),
}

impl Command {
    /// Tests whether only the holder of control may give it.
    pub fn needs_control(&self) -> bool {
        matches!(self, Self::Order { .. } | Self::Act { .. } | Self::StandBy {} | Self::Reset {})
    }
}

/// The message that these bytes are.
///
/// # Errors
/// Where they are none, or one that cannot be carried out by anybody.
pub fn parse_command(bytes: &[u8]) -> Result<Command, CommandError> {
    if bytes.len() > COMMAND_BYTES_MAX {
        return Err(CommandError::TooLong(bytes.len()));
    }
    let command = serde_json::from_slice(bytes).map_err(|e| CommandError::Content(e.to_string()))?;
    match &command {
        Command::Order { order } => order.check()?,
        // Whoever drives has a wheel for it.
        Command::Act { act: act @ Act::Drive(_) } => return Err(CommandError::Act(act.name())),
        Command::Ping { t } if !t.is_finite() => {
            return Err(CommandError::Content("a time that is no number".to_owned()));
        }
        _ => {}
    }
    Ok(command)
}

#[cfg(test)]
mod tests {
    use bowwave_core::{engagement::Engagement, side::Side};
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn messages_of_the_page_are_read() {
        let read = |text: &str| parse_command(text.as_bytes());
        assert_eq!(read(r#"{"kind":"drawn","frame":7}"#), Ok(Command::Drawn { frame: 7 }));
        assert_eq!(read(r#"{"kind":"take_control"}"#), Ok(Command::TakeControl {}));
        let free = Order::Rules { rules: Engagement::Free };
        assert_eq!(
            read(r#"{"kind":"order","order":{"order":"rules","rules":"free"}}"#),
            Ok(Command::Order { order: free })
        );
        let hostile = Act::Identify(Side::Hostile);
        assert_eq!(read(r#"{"kind":"act","act":{"identify":"hostile"}}"#), Ok(Command::Act { act: hostile }));
        assert_eq!(read(r#"{"kind":"act","act":"report"}"#), Ok(Command::Act { act: Act::Report }));
        let join =
            r#"{"kind":"order","order":{"order":"join","boat":"a","at":{"bearing_deg":10,"range_m":900}}}"#;
        assert!(matches!(read(join), Ok(Command::Order { order: Order::Join { at: Some(_), .. } })));
    }

    #[test]
    fn what_nobody_may_order_is_refused() {
        let read = |text: &str| parse_command(text.as_bytes());
        for wrong in [
            "",
            "{}",
            "null",
            r#"{"kind":"load"}"#,
            r#"{"kind":"take_control","force":true}"#,
            r#"{"kind":"drawn","frame":-1}"#,
            r#"{"kind":"ping","t":1e999}"#,
            r#"{"kind":"act","act":{"identify":"unknown"}}"#,
            r#"{"kind":"act","act":{"drive":"ahead"}}"#,
            r#"{"kind":"order","order":{"order":"message","text":"two\nlines"}}"#,
            r#"{"kind":"order","order":{"order":"join","boat":"a","at":{"bearing_deg":1,"range_m":1}}}"#,
        ] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
        let long =
            format!(r#"{{"kind":"order","order":{{"order":"note","text":"{}"}}}}"#, "x".repeat(20_000));
        assert_eq!(read(&long), Err(CommandError::TooLong(long.len())));
        let nested = "[".repeat(10_000);
        assert!(matches!(read(&nested), Err(CommandError::Content(_))));
    }

    proptest! {
        #[test]
        fn any_bytes_are_read_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
            let _ = parse_command(&bytes);
        }

        #[test]
        fn what_is_read_can_be_carried_out(text in ".{0,150}", bearing in any::<f64>(), range in any::<f64>()) {
            let order = serde_json::json!({"kind": "order", "order": {"order": "message", "text": text}});
            if let Ok(Command::Order { order }) = parse_command(order.to_string().as_bytes()) {
                prop_assert_eq!(order.check(), Ok(()));
            }
            let at = serde_json::json!({"bearing_deg": bearing, "range_m": range});
            let join = serde_json::json!({"kind": "order", "order": {"order": "join", "boat": "a", "at": at}});
            if let Ok(Command::Order { order }) = parse_command(join.to_string().as_bytes()) {
                prop_assert_eq!(order.check(), Ok(()));
            }
        }
    }
}
