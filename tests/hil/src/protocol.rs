//! Requests to the agent and what it says, one line of JSON each.

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// A request.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Request {
    /// Comes back with the reply.
    pub id: u64,
    /// The command.
    pub command: AgentCommand,
}

/// Commands of the agent. Times are of the machine's monotonic clock, nanoseconds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AgentCommand {
    /// Reply with the time.
    Ping,
    /// Run a program and wait for it: `{code, out, err, ms}`.
    Run {
        /// Program and arguments.
        argv: Vec<String>,
        /// After so long it is killed.
        timeout_ms: u64,
    },
    /// Make or replace a file, folders included.
    Write {
        /// Where.
        path: String,
        /// What.
        text: String,
    },
    /// Overwrite bytes within a file or device.
    Patch {
        /// Where.
        path: String,
        /// From this byte on.
        offset: u64,
        /// With so many of 0xA5.
        count: u64,
    },
    /// A line for the camera's bench side (`modules/hilcam.c`).
    Camera {
        /// The command.
        line: String,
    },
    /// State of the camera, as the driver tells it.
    CameraState,
    /// Begin to play the tape, or end.
    Play {
        /// Whether to play.
        on: bool,
    },
    /// How the tape is played from now on.
    Feed(PlayerFeed),
    /// Set an input of the simulated GPIO chip, step after step: `[[before, after], ...]` for each.
    Pull {
        /// Which of [`crate::LINES`].
        line: usize,
        /// Pause before it in microseconds, and the new level.
        steps: Vec<(u64, bool)>,
    },
    /// Level of an output of the simulated GPIO chip.
    Level {
        /// Which of [`crate::LINES`].
        line: usize,
    },
    /// Stop one thread of the trainer, and let it go on after a while.
    Hold {
        /// The thread's name, as the kernel knows it.
        thread: String,
        /// For so long.
        ms: u64,
    },
    /// Names of the trainer's threads with their processor time in ticks, memory, and main process: `{pid, rss_kib, threads}`.
    Usage,
    /// A fixed computation, to compare speeds: seconds it took.
    Spin,
    /// From now on send each line of the journal.
    FollowJournal,
    /// From now on send each line that is appended to a file, which need not exist yet.
    FollowFile {
        /// The file.
        path: String,
    },
    /// From now on send each line that comes out of a named pipe.
    FollowPipe {
        /// The pipe.
        path: String,
    },
    /// Send bytes through the unit's line and see when they come back from a serial device: least delay of several, ns.
    LineDelay {
        /// The device.
        device: String,
    },
}

/// How the tape is played.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct PlayerFeed {
    /// No pictures.
    pub stall: bool,
    /// The same picture again and again.
    pub freeze: bool,
    /// Share of MJPEG pictures that are cut short or scrambled.
    pub corrupt: f64,
    /// Share of pictures with the error flag, never two in a row.
    pub flagged: f64,
    /// Share of pictures whose time stamp lies a second back.
    pub backwards: f64,
    /// Share of pictures of which only half the bytes come, though nothing says so; never two in a row.
    pub short: f64,
    /// No bytes of the unit.
    pub mute: bool,
    /// The unit repeats its last measurement, its clock goes on.
    pub stuck: bool,
    /// The unit's rates are no numbers.
    pub nan: bool,
    /// The unit's rates are at the end of their scale.
    pub saturated: bool,
    /// Share of the unit's packets that are preceded by garbage, or cut.
    pub garbage: f64,
    /// Whether the tape's own pulls of the trigger are played.
    pub trigger: bool,
    /// Name of the wrong set-up ([`hw_sim::set_up::SET_UPS`]) whose samples and pictures are played; empty for none.
    pub set_up: String,
}

/// Messages of the agent.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AgentMessage {
    /// The agent is ready.
    Hello {
        /// Time since the kernel started, nanoseconds.
        now_ns: i64,
        /// The kernel's release.
        kernel: String,
        /// Name of the GPIO chip's device, as gpiochip0.
        gpio_chip: String,
    },
    /// Result of a request.
    Reply {
        /// Of the request.
        id: u64,
        /// Its result.
        result: Result<Value, String>,
    },
    /// A line of the journal.
    Journal {
        /// When it was written, on the monotonic clock.
        at_ns: i64,
        /// Its fields.
        fields: Value,
    },
    /// A line of a followed file.
    Line {
        /// When it was seen.
        at_ns: i64,
        /// The file.
        path: String,
        /// The line.
        text: String,
    },
    /// The tape's time zero is at this time.
    Origin {
        /// Monotonic.
        at_ns: i64,
    },
    /// The tape's own pull of the trigger was played.
    Trigger {
        /// Before the line was set.
        before_ns: i64,
        /// After it was set.
        after_ns: i64,
        /// Pressed or released.
        pressed: bool,
    },
    /// The agent cannot do its work.
    Failure {
        /// Why.
        what: String,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_and_messages_survive_the_wire() {
        let request =
            Request { id: 7, command: AgentCommand::Pull { line: 0, steps: vec![(5, true), (1000, false)] } };
        let text = serde_json::to_string(&request).unwrap();
        assert!(!text.contains('\n'));
        let back: Request = serde_json::from_str(&text).unwrap();
        assert_eq!((back.id, back.command), (request.id, request.command));
        let feed: PlayerFeed = serde_json::from_str(r#"{"stall":true}"#).unwrap();
        assert_eq!(feed, PlayerFeed { stall: true, ..PlayerFeed::default() });
        let text =
            serde_json::to_string(&AgentMessage::Reply { id: 1, result: Err("no\nsuch".into()) }).unwrap();
        assert!(!text.contains('\n'));
    }
}
