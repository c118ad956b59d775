//! Small linear equations.

/// Solves `matrix` x = `right` by Gauss and Jordan with pivots; `None` where the equations do not decide.
pub(super) fn solve<const N: usize>(mut matrix: [[f64; N]; N], mut right: [f64; N]) -> Option<[f64; N]> {
    for column in 0..N {
        let larger = |&a: &usize, &b: &usize| matrix[a][column].abs().total_cmp(&matrix[b][column].abs());
        let pivot = (column..N).max_by(larger)?;
        matrix.swap(column, pivot);
        right.swap(column, pivot);
        let (lead, lead_right) = (matrix[column], right[column]);
        if !lead[column].is_finite() || lead[column].abs() < 1e-12 {
            return None;
        }
        for row in (0..N).filter(|&r| r != column) {
            let factor = matrix[row][column] / lead[column];
            for (value, lead) in matrix[row].iter_mut().zip(lead) {
                *value -= factor * lead;
            }
            right[row] -= factor * lead_right;
        }
    }
    Some(std::array::from_fn(|i| right[i] / matrix[i][i]))
}
