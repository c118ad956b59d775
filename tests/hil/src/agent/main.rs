//! The agent in the machine: plays the tape into the kernel's interfaces and does what the harness says.

mod bench;
mod follow;
mod link;
mod player;
mod system;

use std::{
    io::{BufRead, BufReader},
    sync::Arc,
    thread,
};

use anyhow::{Context, Result};
use bowwave_devices::clock;
use bowwave_hil::{
    LINES,
    protocol::{AgentCommand, AgentMessage, Request},
};
use serde_json::{Value, json};

use crate::{bench::Gpio, link::Link, player::TapePlayer};

/// Everything that requests act on.
struct Agent {
    link: Arc<Link>,
    gpio: Arc<Gpio>,
    player: TapePlayer,
}

fn main() -> Result<()> {
    // The ports' driver is among them.
    let modules = bench::load_modules();
    let (link, control) = Link::open()?;
    if let Err(e) = modules {
        link.say(&AgentMessage::Failure { what: format!("{e:#}") });
        return Err(e);
    }
    let agent = match Agent::start(Arc::clone(&link)) {
        Ok(agent) => Arc::new(agent),
        Err(e) => {
            link.say(&AgentMessage::Failure { what: format!("{e:#}") });
            return Err(e);
        }
    };
    let kernel = std::fs::read_to_string("/proc/sys/kernel/osrelease").unwrap_or_default();
    link.say(&AgentMessage::Hello {
        now_ns: clock::now().ns(),
        kernel: kernel.trim().to_owned(),
        gpio_chip: agent.gpio.chip().to_owned(),
    });
    for line in BufReader::new(control).lines() {
        let line = line.context("the control port")?;
        match serde_json::from_str::<Request>(&line) {
            // A request that takes long holds up no other one.
            Ok(request) => {
                let agent = Arc::clone(&agent);
                thread::spawn(move || {
                    let result = agent.execute(request.command).map_err(|e| format!("{e:#}"));
                    agent.link.say(&AgentMessage::Reply { id: request.id, result });
                });
            }
            Err(e) => link.say(&AgentMessage::Failure { what: format!("no request: {line}: {e}") }),
        }
    }
    Ok(())
}

impl Agent {
    fn start(link: Arc<Link>) -> Result<Self> {
        let gpio = Arc::new(Gpio::make()?);
        let player = TapePlayer::new(Arc::clone(&link), Arc::clone(&gpio))?;
        Ok(Self { link, gpio, player })
    }

    fn execute(&self, command: AgentCommand) -> Result<Value> {
        match command {
            AgentCommand::Ping => Ok(json!(clock::now().ns())),
            AgentCommand::Run { argv, timeout_ms } => system::run(&argv, timeout_ms),
            AgentCommand::Write { path, text } => system::write(&path, &text),
            AgentCommand::Patch { path, offset, count } => system::patch(&path, offset, count),
            AgentCommand::Camera { line } => bench::camera_command(&line).map(|()| Value::Null),
            AgentCommand::CameraState => Ok(serde_json::to_value(bench::camera_state()?)?),
            AgentCommand::Play { on } => self.player.play(on),
            AgentCommand::Feed(feed) => {
                self.player.feed(feed);
                Ok(json!(clock::now().ns()))
            }
            AgentCommand::Pull { line, steps } => Ok(serde_json::to_value(self.gpio.pull(line, &steps)?)?),
            AgentCommand::Level { line } => Ok(json!(self.gpio.level(line)?)),
            AgentCommand::Hold { thread, ms } => system::hold(&thread, ms),
            AgentCommand::Usage => system::usage(),
            AgentCommand::Spin => Ok(json!(bowwave_hil::spin())),
            AgentCommand::FollowJournal => follow::journal(&self.link),
            AgentCommand::FollowFile { path } => follow::file(&self.link, path),
            AgentCommand::FollowPipe { path } => follow::pipe(&self.link, path),
            AgentCommand::LineDelay { device } => self.player.line_delay(&device),
        }
    }
}

const _: () = assert!(LINES.len() == 7, "bench::Gpio makes these lines");
