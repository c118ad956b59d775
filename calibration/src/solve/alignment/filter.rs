//! Weighing of residuals whose errors are a gyro's drift plus a camera's noise.
//!
//! An orientation seen by the camera differs from the integrated gyro by noise of its own and by what the gyro's white noise has added
//! up to since. Both together have a covariance that is full, but the Kalman filter of the model "random walk seen in noise" (a local
//! level, Durbin & Koopman 2012, ch. 2; three axes here) factors it in one pass: its innovations are independent. Run over the
//! residual and over each column of the Jacobian (Rosenberg 1973; de Jong 1991, augmented filter) it turns generalised least squares into
//! plain ones, and its log-likelihood tells how large the noises are. An unknown reference is a walk that starts anywhere.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// Number of parameters, see [`place`].
pub(super) const PARAMETERS: usize = 18;
/// Square matrix over all parameters.
pub(super) type NormalMatrix = SMatrix<f64, PARAMETERS, PARAMETERS>;
/// One value for each parameter.
pub(super) type UnknownsStep = SVector<f64, PARAMETERS>;
/// Residual by each parameter, reference's axes.
pub(super) type Jacobian = SMatrix<f64, 3, PARAMETERS>;

/// Where each parameter stands.
pub(super) mod place {
    /// Turn of the camera against the unit, camera's axes: three.
    pub const ROTATION: usize = 0;
    /// Time offset.
    pub const OFFSET: usize = 3;
    /// Gyro bias: three.
    pub const BIAS: usize = 4;
    /// Read-out time of the whole picture.
    pub const READOUT: usize = 7;
    /// Relative error of the gyro's scale: three.
    pub const SCALE: usize = 8;
    /// Up in the reference: two.
    pub const UP: usize = 11;
    /// Lens: share of the focal length, principal point (two), first coefficient of distortion.
    pub const LENS: usize = 13;
    /// Error of the horizon's dip that all pictures share.
    pub const DIP: usize = 17;
}

/// Kind of measurement behind a residual.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ResidualKind {
    Orientation,
    Up,
    Level,
    /// Former calibration: its sigma is given, not estimated.
    Known,
}

impl ResidualKind {
    /// Whether it comes from the camera.
    pub(super) fn is_seen(self) -> bool {
        matches!(self, Self::Orientation | Self::Up)
    }
}

/// One residual: the rotation vector in the reference's axes that takes the prediction to what was seen.
#[derive(Clone, Debug)]
pub(super) struct ResidualRow {
    pub time: f64,
    pub kind: ResidualKind,
    /// Number of the observation among those of its kind.
    pub index: usize,
    pub residual: Vector3<f64>,
    pub jacobian: Jacobian,
    /// How fast the residual changes with the stamp, rad/s.
    pub speed: Vector3<f64>,
    /// Direction about which nothing was seen.
    pub blind: Option<Vector3<f64>>,
    pub sigma: f64,
    /// Error that all of its kind share, as if each had so much of its own: standard deviation times the square root of their number.
    pub common: f64,
    /// Share of its weight that an outlier keeps.
    pub weight: f64,
    /// Residuals of different segments have walks of their own.
    pub segment: usize,
}

impl ResidualRow {
    pub(super) fn freedom(&self) -> f64 {
        if self.blind.is_some() { 2.0 } else { 3.0 }
    }

    /// The prediction's own rotation, from the camera's axes to the reference's: the Jacobian by the rotation. An up's has nothing about the
    /// vertical.
    pub(super) fn reference_from_camera(&self) -> Matrix3<f64> {
        self.jacobian.fixed_columns::<3>(place::ROTATION).into()
    }
}

/// How large the errors are.
#[derive(Clone, Copy, Debug)]
pub(super) struct Levels {
    /// Times the stated sigma, for each kind.
    pub scale: [f64; 4],
    /// Of the camera's stamps, one sigma, seconds.
    pub jitter_s: f64,
    /// Gyro's angle random walk, rad/sqrt(s).
    pub walk: f64,
}

/// Variance of a walk at its begin. References are set so that it begins near zero; this is far more than what is left, and yet so
/// little that a wild first observation is seen to be one.
const DIFFUSE: f64 = 1e-3;
const BLIND: f64 = 1e4;

fn noise(row: &ResidualRow, levels: &Levels) -> Matrix3<f64> {
    let own = levels.scale[row.kind as usize] * row.sigma;
    let mut r = Matrix3::from_diagonal_element(own * own + row.common * row.common);
    if row.kind.is_seen() {
        r += row.speed * row.speed.transpose() * levels.jitter_s.powi(2);
    }
    if let Some(blind) = row.blind {
        r += blind * blind.transpose() * BLIND;
    }
    r
}

/// Sums over all whitened residuals.
#[derive(Clone, Debug)]
pub(super) struct Whitened {
    pub normal: NormalMatrix,
    pub gradient: UnknownsStep,
    /// Sum of squares plus the log-determinant of the covariance: twice the negative log-likelihood, but for a constant.
    pub cost: f64,
    /// Of each row as if it were no outlier: square of the whitened innovation.
    pub squares: Vec<f64>,
    /// Of each row: residual less the walk predicted from those before.
    pub innovations: Vec<Vector3<f64>>,
    /// Of each row: the same as independent numbers of variance one, where the noises are what they are taken for.
    pub white: Vec<Vector3<f64>>,
    /// Of each row: its part of the gradient.
    pub scores: Vec<UnknownsStep>,
}

/// Walk and covariance while the filter runs.
struct GyroWalk<const C: usize> {
    mean: SMatrix<f64, 3, C>,
    covariance: Matrix3<f64>,
    time: f64,
    segment: usize,
}

impl<const C: usize> GyroWalk<C> {
    fn begin(row: &ResidualRow) -> Self {
        Self {
            mean: SMatrix::zeros(),
            covariance: Matrix3::from_diagonal_element(DIFFUSE),
            time: row.time,
            segment: row.segment,
        }
    }

    /// Carries the walk to the row's time.
    fn reach(&mut self, row: &ResidualRow, walk: f64) {
        if self.segment == row.segment {
            let dt = (row.time - self.time).max(0.0);
            self.covariance += Matrix3::from_diagonal_element(walk * walk * dt);
            self.time = row.time;
        } else {
            *self = Self::begin(row);
        }
    }

    /// Takes in what was seen; gives the whitened and the plain innovation and the log-determinant.
    fn meet(
        &mut self,
        seen: &SMatrix<f64, 3, C>,
        r: &Matrix3<f64>,
    ) -> Option<(SMatrix<f64, 3, C>, SMatrix<f64, 3, C>, f64)> {
        let s = self.covariance + r;
        let factor = s.cholesky()?;
        let innovation = seen - self.mean;
        let whitened = factor.l_dirty().solve_lower_triangular(&innovation)?;
        let log_det = 2.0 * factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        let gain = factor.solve(&self.covariance).transpose();
        self.mean += gain * innovation;
        let left = self.covariance - gain * self.covariance;
        self.covariance = (left + left.transpose()) * 0.5;
        Some((whitened, innovation, log_det))
    }
}

/// Runs the filter over rows in order of time, Jacobians included; `None` where a number breaks it.
pub(super) fn whiten(rows: &[ResidualRow], levels: &Levels) -> Option<Whitened> {
    const COLUMNS: usize = PARAMETERS + 1;
    let mut out = Whitened {
        normal: NormalMatrix::zeros(),
        gradient: UnknownsStep::zeros(),
        cost: 0.0,
        squares: Vec::with_capacity(rows.len()),
        innovations: Vec::with_capacity(rows.len()),
        white: Vec::with_capacity(rows.len()),
        scores: Vec::with_capacity(rows.len()),
    };
    let mut walk = GyroWalk::<COLUMNS>::begin(rows.first()?);
    for row in rows {
        walk.reach(row, levels.walk);
        let mut seen = SMatrix::<f64, 3, COLUMNS>::zeros();
        seen.fixed_columns_mut::<PARAMETERS>(0).copy_from(&row.jacobian);
        seen.set_column(PARAMETERS, &row.residual);
        let r = noise(row, levels);
        let plain = walk.covariance + r;
        let (w, innovation, log_det) = walk.meet(&seen, &(r / row.weight))?;
        let jacobian = w.fixed_columns::<PARAMETERS>(0).into_owned();
        let residual: Vector3<f64> = w.column(PARAMETERS).into();
        let turn: Vector3<f64> = innovation.column(PARAMETERS).into();
        out.normal += jacobian.transpose() * jacobian;
        let score = jacobian.transpose() * residual;
        out.gradient += score;
        out.scores.push(score);
        out.cost += residual.norm_squared() + log_det;
        out.squares.push(if row.weight < 1.0 {
            turn.dot(&plain.cholesky()?.solve(&turn))
        } else {
            residual.norm_squared()
        });
        out.innovations.push(turn);
        out.white.push(residual);
    }
    out.cost.is_finite().then_some(out)
}

/// The cost alone, with the parameters held; infinite where it is none.
pub(super) fn cost(rows: &[ResidualRow], levels: &Levels) -> f64 {
    let Some(first) = rows.first() else { return f64::INFINITY };
    let mut walk = GyroWalk::<1>::begin(first);
    let mut sum = 0.0;
    for row in rows {
        walk.reach(row, levels.walk);
        let Some((w, _, log_det)) = walk.meet(&row.residual, &(noise(row, levels) / row.weight)) else {
            return f64::INFINITY;
        };
        sum += w.norm_squared() + log_det;
    }
    if sum.is_finite() { sum } else { f64::INFINITY }
}

/// Rotation, offset and bias: the parameters that can take most of the noise.
const MAIN: usize = 7;

/// Twice the negative restricted log-likelihood (Patterson & Thompson 1971): what the main parameters could take of the noise does
/// not make it look smaller. Infinite where there is none.
pub(super) fn restricted(rows: &[ResidualRow], levels: &Levels) -> f64 {
    const COLUMNS: usize = MAIN + 1;
    let told = || {
        let mut walk = GyroWalk::<COLUMNS>::begin(rows.first()?);
        let (mut cost, mut normal) = (0.0, SMatrix::<f64, MAIN, MAIN>::zeros());
        for row in rows {
            walk.reach(row, levels.walk);
            let mut seen = SMatrix::<f64, 3, COLUMNS>::zeros();
            seen.fixed_columns_mut::<MAIN>(0).copy_from(&row.jacobian.fixed_columns::<MAIN>(0));
            seen.set_column(MAIN, &row.residual);
            let (w, _, log_det) = walk.meet(&seen, &(noise(row, levels) / row.weight))?;
            let jacobian = w.fixed_columns::<MAIN>(0).into_owned();
            normal += jacobian.transpose() * jacobian;
            cost += w.column(MAIN).norm_squared() + log_det;
        }
        let scale = normal.diagonal().map(f64::sqrt);
        let even = SMatrix::<f64, MAIN, MAIN>::from_fn(|r, c| normal[(r, c)] / (scale[r] * scale[c]));
        let factor = even.cholesky()?;
        let log_det =
            factor.l_dirty().diagonal().component_mul(&scale).iter().map(|d| 2.0 * d.ln()).sum::<f64>();
        Some(cost + log_det).filter(|c| c.is_finite())
    };
    told().unwrap_or(f64::INFINITY)
}

/// Inverse of the normal matrix over the `active` parameters, zero elsewhere; `None` where it is singular beyond rounding.
/// Parameters are scaled by their own information first, so that units do not matter.
pub(super) fn invert(normal: &NormalMatrix, active: &[usize], damping: f64) -> Option<NormalMatrix> {
    let n = active.len();
    let scale: Vec<f64> = active.iter().map(|&i| normal[(i, i)].sqrt()).collect();
    if n == 0 || scale.iter().any(|s| !s.is_finite() || *s <= 0.0) {
        return None;
    }
    let mut m =
        nalgebra::DMatrix::from_fn(n, n, |r, c| normal[(active[r], active[c])] / (scale[r] * scale[c]));
    for i in 0..n {
        m[(i, i)] += damping;
    }
    let inverse = m.cholesky()?.inverse();
    let mut out = NormalMatrix::zeros();
    for r in 0..n {
        for c in 0..n {
            out[(active[r], active[c])] = inverse[(r, c)] / (scale[r] * scale[c]);
        }
    }
    out.iter().all(|v| v.is_finite()).then_some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The filter against the full covariance matrix written out.
    #[test]
    fn innovations_are_those_of_the_full_covariance() {
        let levels = Levels { scale: [1.3, 1.0, 1.0, 1.0], jitter_s: 0.01, walk: 0.02 };
        let rows: Vec<ResidualRow> = (0..8)
            .map(|i| {
                let x = f64::from(i);
                let mut jacobian = Jacobian::zeros();
                for (k, v) in jacobian.iter_mut().enumerate() {
                    *v = (x * 1.7 + k as f64 * 0.9).sin();
                }
                ResidualRow {
                    time: x * 0.3 + 0.1 * x.sin(),
                    kind: ResidualKind::Orientation,
                    index: i as usize,
                    residual: Vector3::new(x.sin(), x.cos(), 0.2 * x) * 0.1,
                    jacobian,
                    speed: Vector3::new(0.5, x * 0.1, -0.3),
                    blind: None,
                    sigma: 0.03,
                    common: 0.0,
                    weight: 1.0,
                    segment: 0,
                }
            })
            .collect();
        let n = rows.len() * 3;
        let full = nalgebra::DMatrix::from_fn(n, n, |r, c| {
            let (i, j) = (r / 3, c / 3);
            let walk = levels.walk.powi(2) * (rows[i].time.min(rows[j].time) - rows[0].time);
            let shared = if r % 3 == c % 3 { walk + DIFFUSE } else { 0.0 };
            let own = if i == j { noise(&rows[i], &levels)[(r % 3, c % 3)] } else { 0.0 };
            shared + own
        });
        let e = nalgebra::DVector::from_fn(n, |r, _| rows[r / 3].residual[r % 3]);
        let j = nalgebra::DMatrix::from_fn(n, PARAMETERS, |r, c| rows[r / 3].jacobian[(r % 3, c)]);
        let factor = full.clone().cholesky().unwrap();
        let by_matrix =
            e.dot(&factor.solve(&e)) + 2.0 * factor.l().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        let got = whiten(&rows, &levels).unwrap();
        assert!((got.cost - by_matrix).abs() < 1e-9 * by_matrix.abs(), "{} {by_matrix}", got.cost);
        assert!((cost(&rows, &levels) - by_matrix).abs() < 1e-9 * by_matrix.abs());
        let normal = j.transpose() * factor.solve(&j);
        assert!((got.normal - normal).abs().max() < 1e-9 * got.normal.abs().max());
        assert!((got.gradient - j.transpose() * factor.solve(&e)).abs().max() < 1e-8);
    }
}
