//! How lenses bend what falls through them: two models, forth and back.

use glam::{DMat2, DVec2, DVec3};

/// A lens's distortion, from undistorted to distorted normalised coordinates (pixels from the principal point over the focal length).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Distortion {
    /// None: a pinhole.
    #[default]
    None,
    /// Radial and tangential.
    RadialTangential(RadialTangential),
    /// By the angle from the axis.
    Fisheye(Fisheye),
}

/// Radial k1, k2 and tangential p1, p2 (Brown 1971; Conrady 1919; OpenCV's first four coefficients).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadialTangential {
    radial: DVec2,
    tangential: DVec2,
    /// Squared tangent of the angle from the axis at which the radius no longer grows.
    reach2: f64,
}

/// Equidistant fisheye with k1 to k4 (Kannala & Brandt 2006, eq. 6; OpenCV's fisheye).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fisheye {
    k: [f64; 4],
    /// Angle from the axis at which the radius no longer grows, at most half a turn.
    reach: f64,
}

/// Steps in which a fisheye's fold is looked for.
const REACH_STEPS: u32 = 512;

/// Newton's method is stopped after so many steps; halving the bracket alone would need as many.
const STEPS_MAX: usize = 60;
/// A step of it is halved at most so often.
const HALVINGS_MAX: i32 = 20;

impl Distortion {
    /// Radial k1, k2 and tangential p1, p2; a pinhole where all are zero.
    pub fn radial_tangential(radial: DVec2, tangential: DVec2) -> Self {
        if radial == DVec2::ZERO && tangential == DVec2::ZERO {
            Self::None
        } else {
            Self::RadialTangential(RadialTangential::new(radial, tangential))
        }
    }

    /// A fisheye with k1 to k4.
    pub fn fisheye(k: [f64; 4]) -> Self {
        Self::Fisheye(Fisheye::new(k))
    }

    /// Whether all coefficients are numbers.
    pub fn is_finite(&self) -> bool {
        match self {
            Self::None => true,
            Self::RadialTangential(d) => d.radial.is_finite() && d.tangential.is_finite(),
            Self::Fisheye(d) => d.k.iter().all(|k| k.is_finite()),
        }
    }

    /// Where a point of the camera's space falls, normalised; `None` behind the camera or where the distortion has folded back: a
    /// model that wrapped would put far-off points into the picture.
    pub(super) fn project(&self, camera: DVec3) -> Option<DVec2> {
        if let Self::Fisheye(d) = self {
            return d.project(camera);
        }
        if camera.z <= 1e-6 || !camera.is_finite() {
            return None;
        }
        let n = camera.truncate() / camera.z;
        match self {
            Self::RadialTangential(d) => (n.length_squared() < d.reach2).then(|| d.bend(n)),
            _ => Some(n),
        }
    }

    /// Direction of what falls on a normalised place, not of unit length; where nothing does, one near the model's rim.
    pub(super) fn unproject(&self, distorted: DVec2) -> DVec3 {
        match self {
            Self::None => distorted.extend(1.0),
            Self::RadialTangential(d) => d.undo(distorted).extend(1.0),
            Self::Fisheye(d) => d.lift(distorted),
        }
    }
}

impl RadialTangential {
    pub(super) fn new(radial: DVec2, tangential: DVec2) -> Self {
        // Smallest positive root of 1 + 3 k1 s + 5 k2 s^2, the radius's growth; by the stable formula, which needs no k2.
        let (b, c) = (3.0 * radial.x, 5.0 * radial.y);
        let discriminant = b * b - 4.0 * c;
        let root = if discriminant < 0.0 { f64::INFINITY } else { 2.0 / (-b + discriminant.sqrt()) };
        // Where the root that the formula gives is negative, the other one is further off or negative, too.
        let reach2 = if root > 0.0 { root } else { f64::INFINITY };
        Self { radial, tangential, reach2 }
    }

    /// k1, k2.
    pub const fn radial(&self) -> DVec2 {
        self.radial
    }

    /// p1, p2.
    pub const fn tangential(&self) -> DVec2 {
        self.tangential
    }

    /// Squared tangent of the angle from the axis at which the radius no longer grows; infinite where it always does.
    pub const fn reach2(&self) -> f64 {
        self.reach2
    }

    /// Undistorted normalised coordinates (x/z, y/z) to distorted ones.
    pub fn bend(&self, n: DVec2) -> DVec2 {
        let r2 = n.length_squared();
        let radial = 1.0 + r2 * (self.radial.x + r2 * self.radial.y);
        let (p1, p2) = (self.tangential.x, self.tangential.y);
        let tangential = DVec2::new(
            2.0 * p1 * n.x * n.y + p2 * (r2 + 2.0 * n.x * n.x),
            p1 * (r2 + 2.0 * n.y * n.y) + 2.0 * p2 * n.x * n.y,
        );
        n * radial + tangential
    }

    /// Derivative of [`RadialTangential::bend`].
    pub(super) fn slope(&self, n: DVec2) -> DMat2 {
        let r2 = n.length_squared();
        let radial = 1.0 + r2 * (self.radial.x + r2 * self.radial.y);
        let growth = 2.0 * (self.radial.x + 2.0 * r2 * self.radial.y);
        let (p1, p2) = (self.tangential.x, self.tangential.y);
        let cross = growth * n.x * n.y + 2.0 * (p1 * n.x + p2 * n.y);
        DMat2::from_cols(
            DVec2::new(radial + growth * n.x * n.x + 2.0 * p1 * n.y + 6.0 * p2 * n.x, cross),
            DVec2::new(cross, radial + growth * n.y * n.y + 6.0 * p1 * n.y + 2.0 * p2 * n.x),
        )
    }

    /// Distorted normalised coordinates to undistorted ones: the radius by a bracketed Newton's method, then both coordinates by
    /// Newton's with the derivative, as long as that comes nearer.
    fn undo(&self, distorted: DVec2) -> DVec2 {
        let far = distorted.length();
        if far < 1e-12 {
            return distorted;
        }
        let (k1, k2) = (self.radial.x, self.radial.y);
        let radius = inverse(far, self.reach2.sqrt(), |r| {
            let r2 = r * r;
            (r * (1.0 + r2 * (k1 + r2 * k2)), 1.0 + r2 * (3.0 * k1 + r2 * 5.0 * k2))
        });
        let mut n = distorted * (radius / far);
        let mut off = distorted - self.bend(n);
        // Within rounding: no step comes nearer.
        let enough = 1e-30 * distorted.length_squared();
        for _ in 0..STEPS_MAX {
            let step = self.slope(n).inverse() * off;
            // Where the radius hardly grows a whole step goes too far.
            let nearer = (0..HALVINGS_MAX).find_map(|halvings| {
                if halvings > 0 && off.length_squared() <= enough {
                    return None;
                }
                let next = n + step * 0.5f64.powi(halvings);
                let left = distorted - self.bend(next);
                (left.length_squared() < off.length_squared()).then_some((next, left))
            });
            let Some(nearer) = nearer else { break };
            (n, off) = nearer;
        }
        n
    }
}

impl Fisheye {
    fn new(k: [f64; 4]) -> Self {
        let half_turn = std::f64::consts::PI;
        let grows = |angle: f64| radius(&k, angle).1 > 0.0;
        let step = half_turn / f64::from(REACH_STEPS);
        let folded = (1..=REACH_STEPS).map(|i| f64::from(i) * step).find(|angle| !grows(*angle));
        let reach = folded.map_or(half_turn, |after| {
            let (mut low, mut high) = (after - step, after);
            for _ in 0..STEPS_MAX {
                let middle = 0.5 * (low + high);
                if grows(middle) { low = middle } else { high = middle }
            }
            low
        });
        Self { k, reach }
    }

    /// k1 to k4.
    pub const fn k(&self) -> [f64; 4] {
        self.k
    }

    /// Angle from the axis at which the radius no longer grows, at most half a turn.
    pub const fn reach(&self) -> f64 {
        self.reach
    }

    fn project(&self, camera: DVec3) -> Option<DVec2> {
        let across = camera.truncate().length();
        let angle = across.atan2(camera.z);
        if !camera.is_finite() || angle >= self.reach || camera.length_squared() < 1e-12 {
            return None;
        }
        let scale = if angle < 1e-9 { 1.0 / camera.z } else { radius(&self.k, angle).0 / across };
        Some(camera.truncate() * scale)
    }

    fn lift(&self, distorted: DVec2) -> DVec3 {
        let far = distorted.length();
        if far < 1e-12 {
            return distorted.extend(1.0);
        }
        let angle = inverse(far, self.reach, |angle| radius(&self.k, angle));
        (distorted * (angle.sin() / far)).extend(angle.cos())
    }
}

/// Distorted radius of a fisheye at an angle from the axis, and its growth.
pub(super) fn radius(k: &[f64; 4], angle: f64) -> (f64, f64) {
    let a2 = angle * angle;
    let value = 1.0 + a2 * (k[0] + a2 * (k[1] + a2 * (k[2] + a2 * k[3])));
    let slope = 1.0 + a2 * (3.0 * k[0] + a2 * (5.0 * k[1] + a2 * (7.0 * k[2] + a2 * 9.0 * k[3])));
    (angle * value, slope)
}

/// Where a function that grows from 0 on, to `limit` at most (which may be infinite), has the value `target`; `limit` where it does
/// not get there. Newton's method within a bracket that is halved wherever a step would leave it (Press et al. 2007, 9.4).
fn inverse(target: f64, limit: f64, f: impl Fn(f64) -> (f64, f64)) -> f64 {
    let mut high = target.min(limit);
    while f(high).0 < target {
        if high >= limit || high > 1e6 {
            return high;
        }
        high = (2.0 * high).min(limit);
    }
    let (mut low, mut x) = (0.0, high);
    for _ in 0..STEPS_MAX {
        let (value, slope) = f(x);
        let off = target - value;
        if off > 0.0 {
            low = x
        } else {
            high = x
        }
        let newton = x + off / slope;
        let next = if (low..=high).contains(&newton) { newton } else { 0.5 * (low + high) };
        if (next - x).abs() <= 4.0 * f64::EPSILON * x {
            return next;
        }
        x = next;
    }
    x
}
