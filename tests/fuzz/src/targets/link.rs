//! The socket between trainer and instructor's process: any bytes, in both directions, and messages whose length is right.
//!
//! Input: one byte that says how the rest is sent: 0 as it is, 1 and 2 as the content of a message of kind 0 and 1, behind its right length.

use bowwave_link::{
    FromDaemon, LinkError, ToDaemon, read_from_daemon, read_to_daemon, write_from_daemon, write_to_daemon,
};

/// What is asked for before a list's elements are there: a mebibyte for each list that the innermost lies in.
const MEMORY_BYTES: usize = 10 << 20;

/// Reading ends, in bounded memory; what is taken is the same when it is written and read once more.
pub fn run(input: &[u8]) {
    let Some((form, rest)) = input.split_first() else { return };
    let wire = match form {
        0 => rest.to_vec(),
        kind => framed(kind.wrapping_sub(1), rest),
    };
    let limit_bytes = MEMORY_BYTES + 512 * wire.len();
    let to = super::memory::within(limit_bytes, || all(&wire, |from| read_to_daemon(from)));
    to.iter().for_each(check_to);
    let from = super::memory::within(limit_bytes, || all(&wire, |from| read_from_daemon(from)));
    from.into_iter().for_each(check_from);
}

fn framed(kind: u8, content: &[u8]) -> Vec<u8> {
    let length = u32::try_from(content.len()).expect("an input of no more than 4 GiB");
    [&length.to_le_bytes()[..], &[kind], content].concat()
}

/// All messages until one that is none.
fn all<T>(mut wire: &[u8], read: impl Fn(&mut &[u8]) -> Result<T, LinkError>) -> Vec<T> {
    std::iter::from_fn(|| {
        let before = wire.len();
        let message = read(&mut wire).ok()?;
        assert!(wire.len() + 5 <= before, "a message of {} bytes", before - wire.len());
        Some(message)
    })
    .collect()
}

// As bytes: a number that is none is not equal to itself.
fn check_to(message: &ToDaemon) {
    let written = to_bytes(message);
    let mut from = written.as_slice();
    let again = read_to_daemon(&mut from).unwrap_or_else(|e| panic!("{e}: {message:?}"));
    assert!(from.is_empty() && to_bytes(&again) == written, "{message:?} comes as {again:?}");
}

fn to_bytes(message: &ToDaemon) -> Vec<u8> {
    let mut wire = Vec::new();
    write_to_daemon(&mut wire, message).unwrap_or_else(|e| panic!("{e}: {message:?}"));
    wire
}

fn check_from(message: FromDaemon) {
    if let FromDaemon::Picture(picture) = &message {
        assert_eq!(picture.rgba.len() as u64, 4 * u64::from(picture.width) * u64::from(picture.height));
    }
    let written = from_bytes(message);
    let mut from = written.as_slice();
    let again = read_from_daemon(&mut from).unwrap_or_else(|e| panic!("{e}: {written:?}"));
    assert!(from.is_empty() && from_bytes(again) == written, "{written:?}");
}

fn from_bytes(message: FromDaemon) -> Vec<u8> {
    let mut wire = Vec::new();
    write_from_daemon(&mut wire, message).unwrap_or_else(|e| panic!("a message that was read: {e}"));
    wire
}
