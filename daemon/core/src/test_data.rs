//! Reads the tables under `data/`, for tests only.

/// The numeric rows of a CSV text: comments, the heading and cells that are no numbers (read as NaN) aside.
pub(crate) fn rows(csv: &str) -> Vec<Vec<f64>> {
    csv.lines()
        .filter(|line| !line.starts_with('#'))
        .skip(1)
        .map(|line| line.split(',').map(|cell| cell.trim().parse().unwrap_or(f64::NAN)).collect())
        .collect()
}
