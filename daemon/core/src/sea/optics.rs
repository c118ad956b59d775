//! What the water throws back.

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

#[cfg(test)]
mod tests {
    use super::*;

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
