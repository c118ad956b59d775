//! Optics of the water's surface.

use glam::DVec3;

/// Refractive index of sea water, in the middle of visible light.
pub const SEA_INDEX: f64 = 1.34;

/// Share of unpolarised light that the sea's surface reflects, 0 to 1, where its direction has the cosine `cos_incidence`
/// (clamped to 0 to 1) with the normal: Fresnel's equations from air into [`SEA_INDEX`]. One square root, and no difference
/// of near numbers at grazing or normal view.
pub fn fresnel(cos_incidence: f64) -> f64 {
    let cos = cos_incidence.clamp(0.0, 1.0);
    // Index times the cosine inside, by Snell's law.
    let inside = (SEA_INDEX * SEA_INDEX - 1.0 + cos * cos).sqrt();
    let s = (cos - inside) / (cos + inside);
    let (dense, thin) = (SEA_INDEX * SEA_INDEX * cos, inside);
    let p = (dense - thin) / (dense + thin);
    0.5 * (s * s + p * p)
}

/// Mean square slope of both axes together of the open sea under a wind of `wind_m_s`, 12.5 m above it (Cox and Munk 1954, clean
/// surface).
pub fn mean_square_slope(wind_m_s: f64) -> f64 {
    0.003 + 5.12e-3 * wind_m_s.max(0.0)
}

/// Root mean square slope along each axis: half of the mean square of both.
pub fn rms_slope(wind_m_s: f64) -> f64 {
    (0.5 * mean_square_slope(wind_m_s)).sqrt()
}

/// What water mirrors of other water, as a share of the sky at that elevation.
const SECOND_BOUNCE: f64 = 0.6;
/// Slopes along the view reach so many standard deviations to either side.
const REACH: f64 = 3.0;
/// Nodes across the view (Gauss and Hermite, three), in standard deviations, and their weights.
const ACROSS: [(f64, f64); 3] = [(-1.732, 1.0 / 6.0), (0.0, 2.0 / 3.0), (1.732, 1.0 / 6.0)];

/// A direction that rough water mirrors.
#[derive(Clone, Copy, Debug)]
pub struct Mirrored {
    /// Its elevation, radians.
    pub elevation: f64,
    /// The sine of that.
    pub sine: f64,
    /// Share of the light from there that reaches the eye.
    pub share: f64,
}

/// What the mean pixel of rough water is made of, whatever the sky.
#[derive(Clone, Debug)]
pub struct Facets {
    /// The directions that it mirrors.
    pub mirrored: Vec<Mirrored>,
    /// Share of the light that comes out of the water.
    pub through: f64,
}

impl Facets {
    /// Water seen `elevation` radians above the horizontal (negative: from above), tilted by `tilt` radians towards the eye,
    /// whose slopes have the root mean square `rough` along each axis, taken at `along` nodes to either side. Facets are Gaussian
    /// and seen by their area across the ray (Cox and Munk 1954, eq. 9); they do not shade each other, so it is worth little within
    /// two degrees of the horizontal.
    pub fn seen(elevation: f64, tilt: f64, rough: f64, along: u8) -> Self {
        // In the plane of view: x away from the eye, y across, z up.
        let ray = DVec3::new(elevation.cos(), 0.0, elevation.sin());
        let along = i32::from(along.max(1));
        let (mut mirrored, mut through, mut area) = (Vec::with_capacity(6 * along as usize + 3), 0.0, 0.0);
        for i in -along..=along {
            let u = f64::from(i) * REACH / f64::from(along);
            let normal_weight = (-u * u / 2.0).exp();
            for (v, share) in ACROSS {
                let normal = DVec3::new(-(tilt + u * rough), -v * rough, 1.0);
                let facing = -normal.dot(ray);
                if facing <= 0.0 {
                    continue;
                }
                let weight = normal_weight * share * facing;
                let size = normal.length();
                let mirror = fresnel(facing / size);
                let up = (ray + normal * (2.0 * facing / (size * size))).z;
                let bounce = if up > 0.0 { 1.0 } else { SECOND_BOUNCE };
                let sine = up.abs().min(1.0);
                mirrored.push(Mirrored { elevation: sine.asin(), sine, share: weight * mirror * bounce });
                through += weight * (1.0 - mirror);
                area += weight;
            }
        }
        let area = f64::max(area, 1e-12);
        mirrored.iter_mut().for_each(|m| m.share /= area);
        Self { mirrored, through: through / area }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn level_water_mirrors_one_direction_by_fresnels_share() {
        for depression in [0.05, 0.2, 0.8, 1.5] {
            let facets = Facets::seen(-depression, 0.0, 1e-9, 6);
            let whole: f64 = facets.mirrored.iter().map(|m| m.share).sum();
            assert!((whole - fresnel(f64::sin(depression))).abs() < 1e-6, "{depression}");
            assert!((whole + facets.through - 1.0).abs() < 1e-6, "{depression}");
            assert!(facets.mirrored.iter().all(|m| (m.sine - f64::sin(depression)).abs() < 1e-6));
        }
        // Nothing faces an eye under water; the shares stay finite.
        let none = Facets::seen(1.0, 0.0, 0.05, 6);
        assert!(none.through == 0.0 && none.mirrored.is_empty());
    }

    #[test]
    fn agrees_with_textbook_values() {
        assert!((fresnel(1.0) - ((SEA_INDEX - 1.0) / (SEA_INDEX + 1.0)).powi(2)).abs() < 1e-15);
        assert_eq!(fresnel(0.0), 1.0);
        // Brewster's angle: half of the s-polarised part.
        let brewster = SEA_INDEX.atan();
        let n2 = SEA_INDEX * SEA_INDEX;
        assert!((fresnel(brewster.cos()) - 0.5 * ((n2 - 1.0) / (n2 + 1.0)).powi(2)).abs() < 1e-12);
    }

    #[test]
    fn cosines_beyond_their_range_are_its_ends() {
        assert_eq!((fresnel(-1e-9), fresnel(1.0 + 1e-9)), (1.0, fresnel(1.0)));
    }
}
