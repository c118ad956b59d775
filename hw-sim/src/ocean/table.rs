//! Reference tables that tests compare with.

/// The numbers of each row below two lines of heading.
pub(crate) fn rows(text: &str) -> impl Iterator<Item = Vec<f64>> {
    text.lines().skip(2).map(|line| line.split(',').map(|cell| cell.trim().parse().unwrap()).collect())
}
