//! The messages of a browser that steers: any bytes.

use bowwave_core::act::Act;
use bowwave_instructor::{COMMAND_BYTES_MAX, Command, CommandError, parse_command};

/// A message is refused, or it is one that can be carried out.
pub fn run(input: &[u8]) {
    match super::memory::within(memory_bytes(input.len()), || parse_command(input)) {
        Ok(command) => {
            assert!(input.len() <= COMMAND_BYTES_MAX, "{} bytes", input.len());
            check(&command);
        }
        Err(error) => {
            let is_long = matches!(error, CommandError::TooLong(_));
            assert_eq!(is_long, input.len() > COMMAND_BYTES_MAX, "{error}");
            assert!(error.to_string().len() < 1000 + 8 * COMMAND_BYTES_MAX, "{error}");
        }
    }
}

/// The message as a tree of values, before it is known which one it is.
const fn memory_bytes(input_bytes: usize) -> usize {
    (64 << 10) + 512 * input_bytes
}

fn check(command: &Command) {
    match command {
        Command::Order { order } => assert_eq!(order.check(), Ok(()), "{order:?}"),
        Command::Act { act } => assert!(!matches!(act, Act::Drive(_)), "{act:?}"),
        Command::Ping { t } => assert!(t.is_finite(), "{t}"),
        Command::StandBy {} | Command::Reset {} => {}
        Command::Drawn { .. } | Command::Pictures { .. } => assert!(!command.needs_control()),
        // Otherwise nobody could ever have it.
        Command::TakeControl {} | Command::HandBack {} => assert!(!command.needs_control()),
    }
}
