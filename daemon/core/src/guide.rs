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
