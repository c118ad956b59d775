//! Constants of nature and small laws that several stages need.

/// Standard acceleration of gravity, m/s^2 (ISO 2533).
pub const GRAVITY_M_S2: f64 = 9.806_65;

/// Share of light that air takes in a metre, at a meteorological visibility of `visibility_m` (Koschmieder 1924).
pub const fn extinction_per_m(visibility_m: f64) -> f64 {
    3.912 / visibility_m
}

/// Illuminance of a surface that faces a point of light, lux: `candela` at `range_m`, of which air takes that share in a metre. Nearer than a metre no
/// lamp is a point.
pub fn illuminance(candela: f64, range_m: f64, extinction_per_m: f64) -> f64 {
    const NEAREST_M: f64 = 1.0;
    let range_m = range_m.max(NEAREST_M);
    candela * (-extinction_per_m * range_m).exp() / (range_m * range_m)
}

/// Share of light that haze takes over `range_m` at a meteorological visibility of `visibility_m` (Koschmieder 1924, contrast
/// threshold 2 %).
pub fn haze_share(range_m: f64, visibility_m: f64) -> f32 {
    if visibility_m <= 0.0 {
        return 1.0;
    }
    (1.0 - (-extinction_per_m(visibility_m) * range_m.max(0.0)).exp()) as f32
}
