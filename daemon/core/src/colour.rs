//! Colour: sRGB codes, linear light and luminance.

use glam::Vec3;

/// Share of linear red, green and blue in luminance (ITU-R BT.709).
pub const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);

/// One channel of linear light to its sRGB code (IEC 61966-2-1).
pub fn linear_to_srgb(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// One sRGB-coded channel to linear light (IEC 61966-2-1).
pub fn srgb_to_linear(coded: f32) -> f32 {
    if coded <= 0.040_45 { coded / 12.92 } else { ((coded + 0.055) / 1.055).powf(2.4) }
}
