//! What an error about a text must say.

/// Panics unless `message` is one line that begins with `origin`, a line and a column that are places in `text`.
pub fn check(message: &str, origin: &str, text: &str) {
    assert!(!message.chars().any(|c| c == '\n' || c == '\r'), "an error of more than one line: {message:?}");
    let place = message.strip_prefix(origin).and_then(|rest| rest.strip_prefix(':')).and_then(|rest| {
        let (line, rest) = rest.split_once(':')?;
        let (column, what) = rest.split_once(": ")?;
        Some((line.parse::<usize>().ok()?, column.parse::<usize>().ok()?, what))
    });
    let (line, column, what) = place.unwrap_or_else(|| panic!("an error without a place: {message:?}"));
    assert!(!what.trim().is_empty(), "an error that says nothing: {message:?}");
    // The end of the text is a place, too: something is missing there.
    let there = line.checked_sub(1).and_then(|before| text.split('\n').nth(before));
    let there = there.unwrap_or_else(|| panic!("an error on a line that is not there: {message:?}"));
    assert!(
        (1..=there.chars().count() + 1).contains(&column),
        "an error at a column that is not there: {message:?}"
    );
}
