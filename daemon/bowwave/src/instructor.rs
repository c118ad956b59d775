//! `bowwave instructor`: the process that serves the instructor's page.

use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

use anyhow::{Context, Result};
use bowwave_instructor::{Instructor, InstructorOptions, Limits, TlsFiles, TokenFile};
use bowwave_trainer::supervisor::Notifier;

use crate::{
    cli::{InstructorArgs, InstructorCommand, TokenCommand},
    outcome::Outcome,
    stdout,
};

/// Quality of the live picture: what differs from the LCD is not seen at it.
const JPEG_QUALITY: u8 = 80;

/// Serves the page until it is interrupted, or manages tokens.
pub fn run(arguments: &InstructorArgs) -> Result<Outcome> {
    match &arguments.command {
        Some(InstructorCommand::Token(command)) => token(command),
        None => serve(arguments),
    }
}

fn serve(arguments: &InstructorArgs) -> Result<Outcome> {
    let InstructorArgs { certificate, key, .. } = arguments;
    let tokens = TokenFile::new(&arguments.tokens.tokens);
    if let Some(warning) = tokens.warning() {
        log::warn!("{warning}");
    }
    let options = InstructorOptions {
        bind: arguments.bind,
        names: arguments.name.clone(),
        tokens: Some(tokens.path().to_owned()),
        tls: certificate.clone().zip(key.clone()).map(|(certificate, key)| TlsFiles { certificate, key }),
        allow_plain_http: arguments.without_tls,
        allow_without_token: arguments.without_token,
        library: Some(arguments.library.clone()),
        picture_rate: arguments.picture_rate,
        jpeg_quality: JPEG_QUALITY,
        limits: Limits::default(),
        ..InstructorOptions::new(&arguments.socket)
    };
    let stop = Arc::new(AtomicBool::new(false));
    let asked = Arc::clone(&stop);
    ctrlc::set_handler(move || asked.store(true, Ordering::Relaxed)).context("cannot catch interrupts")?;
    let instructor = Instructor::bind(options)?;
    let mut notifier = Notifier::from_environment();
    stdout::print(format!("{}\n", instructor.url()))?;
    if !has_tokens(&tokens) && !arguments.without_token {
        let path = tokens.path().display();
        log::warn!(
            "nobody can steer yet, only look: make a token with `bowwave instructor token add NAME --tokens {path}`, or start with --without-token"
        );
    }
    notifier.ready();
    instructor.serve(|| stop.load(Ordering::Relaxed))?;
    notifier.stopping();
    Ok(Outcome::Done)
}

fn has_tokens(tokens: &TokenFile) -> bool {
    tokens.list().is_ok_and(|list| !list.is_empty())
}

fn token(command: &TokenCommand) -> Result<Outcome> {
    match command {
        TokenCommand::Add(named) => {
            let token = TokenFile::new(&named.tokens.tokens).add(&named.name)?;
            stdout::print(format!("{token}\n"))?;
            eprintln!(
                "{} enters this token at the page to steer. It is shown this once: only its hash is kept.",
                bowwave_core::text::one_line(&named.name)
            );
        }
        TokenCommand::List(tokens) => {
            for entry in TokenFile::new(&tokens.tokens).list()? {
                stdout::print(format!("{}  {}\n", entry.made, bowwave_core::text::one_line(&entry.name)))?;
            }
        }
        TokenCommand::Revoke(named) => TokenFile::new(&named.tokens.tokens).revoke(&named.name)?,
    }
    Ok(Outcome::Done)
}
