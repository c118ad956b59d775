//! What a maintainer is told while he calibrates: one page, drawn over the live picture and printed on a terminal alike.
//!
//! Texts are ASCII: the display's font has no more.

/// How good something is, in words that maintainers act on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Rating {
    /// Not good enough to train with.
    Poor,
    /// Good enough; measure again when there is time.
    Usable,
    /// Nothing to be gained by measuring more.
    Good,
}

impl Rating {
    /// The word for it.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Poor => "poor",
            Self::Usable => "usable",
            Self::Good => "good",
        }
    }
}

/// How far a quantity has come.
#[derive(Clone, Debug, PartialEq)]
pub struct Gauge {
    /// What it is.
    pub name: &'static str,
    /// Its value with its unit.
    pub value: String,
    /// From 0, nothing is known, to 1, enough is.
    pub share: f64,
    /// How good it is; `None` where that is not known yet.
    pub rating: Option<Rating>,
}

/// How often something was seen in a part of the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Cell {
    /// Never.
    Empty,
    /// Less often than in most others.
    Few,
    /// Often enough.
    Many,
}

/// Parts of the picture in which something was seen.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Coverage {
    /// Parts across.
    pub columns: usize,
    /// Row by row from above.
    pub cells: Vec<Cell>,
    /// Width and height of the picture, pixels.
    pub picture: (u32, u32),
}

/// One page.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Guide {
    /// Which step it is.
    pub title: String,
    /// What to do next, one sentence.
    pub says: String,
    /// What is wrong, with what to do about it.
    pub problem: Option<String>,
    /// How far each quantity has come.
    pub gauges: Vec<Gauge>,
    /// Where in the picture the board was seen.
    pub coverage: Option<Coverage>,
    /// Whether the result is good enough, where there is one.
    pub passed: Option<bool>,
    /// What else there is to say, line by line.
    pub lines: Vec<String>,
    /// What keys and trigger do.
    pub keys: &'static str,
}

impl Guide {
    /// The word for [`Guide::passed`].
    pub fn verdict(&self) -> Option<&'static str> {
        self.passed.map(|passed| if passed { "PASS" } else { "FAIL" })
    }
}

/// A text in lines that fit, broken between words, and within a word only where that alone does not fit. `fits` holds for every
/// beginning of a text for which it holds.
pub fn wrapped(text: &str, fits: impl Fn(&str) -> bool) -> Vec<&str> {
    let longest = |ends: &mut dyn Iterator<Item = usize>, rest: &str| {
        ends.take_while(|end| fits(&rest[..*end])).last().filter(|end| *end > 0)
    };
    let (mut lines, mut rest) = (Vec::new(), text);
    while let Some(first) = rest.chars().next() {
        let mut words = rest.match_indices(' ').map(|(at, _)| at).chain([rest.len()]);
        let mut letters = rest.char_indices().map(|(at, letter)| at + letter.len_utf8());
        // A letter that does not fit stands alone, or there would be no end.
        let end = longest(&mut words, rest)
            .or_else(|| longest(&mut letters, rest))
            .unwrap_or_else(|| first.len_utf8());
        lines.push(&rest[..end]);
        rest = &rest[end..];
        rest = rest.strip_prefix(' ').unwrap_or(rest);
    }
    lines
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn lines_break_between_words_and_only_words_without_room_within() {
        let lines = |text| wrapped(text, |line| line.len() <= 8);
        for (text, expected) in [
            ("", &[][..]),
            ("aim anew", &["aim anew"]),
            ("aim anew, pull", &["aim", "anew,", "pull"]),
            ("  2 lens", &["  2 lens"]),
            ("in data/calibrate.mcap", &["in", "data/cal", "ibrate.m", "cap"]),
        ] {
            assert_eq!(lines(text), expected, "{text}");
        }
    }

    proptest! {
        #[test]
        fn nothing_but_spaces_at_breaks_is_lost(text in "\\PC{0,80}", most in 0_usize..20) {
            let lines = wrapped(&text, |line| line.chars().count() <= most);
            prop_assert!(lines.iter().all(|line| line.chars().count() <= most.max(1)));
            let letters = |text: &str| text.replace(' ', "");
            prop_assert_eq!(letters(&lines.concat()), letters(&text));
        }
    }
}
