//! The instructor's process: its page on the local network, joined to the trainer by a Unix socket.
//!
//! The trainer has no network and shall have none. This process has: it serves a page to browsers, and hands on what the one that has control
//! orders. Whoever breaks it gains what an instructor may do, and no more.
//!
//! A thread keeps the way to the trainer (`link`), one encodes pictures (`frames`), and a small tokio runtime serves (`serve`). `hub` is what
//! they share. Every answer passes `guard`; `access` knows who is let in, `control` who may order something.

#![forbid(unsafe_code)]

mod access;
mod assets;
mod command;
mod control;
mod daytime;
mod frames;
mod guard;
mod hub;
mod library;
mod link;
mod options;
mod page;
mod routes;
mod score;
mod serve;
mod socket;
mod stop;
mod stream;
mod tls;
mod token;

use std::sync::{Mutex, MutexGuard, PoisonError};

pub use command::{COMMAND_BYTES_MAX, Command, CommandError, parse_command};
pub use options::{InstructorError, InstructorOptions, Limits, TlsFiles};
pub use serve::{Instructor, serve};
pub use token::{TOKEN_NAME_BYTES_MAX, TOKEN_PREFIX, TOKENS_MAX, TokenEntry, TokenError, TokenFile};

/// The value behind a lock. A thread that panicked while it had it left a whole value: each is set at once.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
