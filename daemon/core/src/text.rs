//! Texts from outside: places in them, errors of one line, and the reader of TOML.

pub mod toml;

/// Line and column of the character at byte `offset`, both from 1; of the text's end where there is none.
pub fn line_column(text: &str, offset: usize) -> (usize, usize) {
    let end = (0..=offset.min(text.len())).rev().find(|&i| text.is_char_boundary(i)).unwrap_or(0);
    let before = &text[..end];
    let line = before.matches('\n').count() + 1;
    let start = before.rfind('\n').map_or(0, |i| i + 1);
    (line, before[start..].chars().count() + 1)
}

/// `message` as one line that a terminal and a log show as it is: breaks become spaces, other control characters and those that reverse the
/// direction of writing their escapes. A quotation from a file may hold any of them.
pub fn one_line(message: &str) -> String {
    let mut line = String::with_capacity(message.len());
    for c in message.trim_end().chars() {
        match c {
            '\n' => line.push(' '),
            c if c.is_control() || turns_direction(c) => line.extend(c.escape_default()),
            c => line.push(c),
        }
    }
    line
}

/// A text as a cell of a table for spreadsheets: in one line, and marked as the text that it is where it would be taken for a formula.
pub fn plain_cell(text: &str) -> String {
    let mark = if text.starts_with(['=', '+', '-', '@', '\t', '\r']) { "'" } else { "" };
    format!("{mark}{}", one_line(text))
}

/// Tests for a control of the direction of writing (bidirectional control, Unicode UAX 9).
const fn turns_direction(c: char) -> bool {
    matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn places_count_characters() {
        let text = "a = 1\nwörter = \"ö\"\n";
        assert_eq!(line_column(text, 0), (1, 1));
        assert_eq!(line_column(text, 5), (1, 6));
        assert_eq!(line_column(text, 6), (2, 1));
        // After the two bytes of ö, and within them.
        assert_eq!(line_column(text, 9), (2, 3));
        assert_eq!(line_column(text, 8), (2, 2));
        assert_eq!(line_column(text, 1000), (3, 1));
    }

    #[test]
    fn a_message_stays_on_its_line() {
        assert_eq!(one_line("a\nb\rc\0d\u{7f}\n"), "a b\\rc\\u{0}d\\u{7f}");
        assert_eq!(one_line("größer"), "größer");
        assert_eq!(one_line("a\u{202e}txt.exe"), "a\\u{202e}txt.exe");
    }

    fn text() -> impl Strategy<Value = String> {
        proptest::collection::vec(any::<char>(), 0..20).prop_map(String::from_iter)
    }

    proptest! {
        #[test]
        fn any_text_has_its_places(lines in [text(), text()], offset in 0usize..60) {
            let text = lines.join("\n");
            let (line, column) = line_column(&text, offset);
            let there = text.split('\n').nth(line - 1).expect("a line of the text");
            prop_assert!((1..=there.chars().count() + 1).contains(&column));
        }

        #[test]
        fn one_line_is_one_line(text in text()) {
            prop_assert!(!one_line(&text).chars().any(char::is_control));
        }
    }
}
