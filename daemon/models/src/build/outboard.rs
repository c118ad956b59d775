//! An outboard engine.

use glam::{Quat, Vec3};

use super::{
    paint::Paint,
    solid::{Solid, block, capsule, pipe, skin, tapered},
};

/// An outboard of `scale` (1: about 60 kW, cowl top 0.78 m above the transom), hung on a transom whose top is at `at`.
/// Trimmed out by `trim` radians and steered by `steer` radians to port.
pub(crate) fn outboard(at: Vec3, scale: f32, trim: f32, steer: f32) -> Vec<Solid> {
    let turn = Quat::from_rotation_z(steer) * Quat::from_rotation_y(trim);
    let mut solids = vec![
        cowl(),
        band(),
        // Midsection, plate above the propeller, gear case with its strut and skeg.
        tapered(
            Vec3::new(-0.36, -0.075, -0.62),
            Vec3::new(-0.10, 0.075, 0.16),
            [-0.06, 0.0, -0.04, -0.04],
            Paint::Cowl,
        ),
        block(Vec3::new(-0.56, -0.13, -0.655), Vec3::new(-0.10, 0.13, -0.625), Paint::Cowl),
        capsule(Vec3::new(-0.44, 0.0, -0.84), Vec3::new(-0.12, 0.0, -0.84), 0.062, 0.045, 8, Paint::Cowl),
        tapered(
            Vec3::new(-0.32, -0.02, -1.06),
            Vec3::new(-0.20, 0.02, -0.64),
            [-0.06, -0.06, -0.02, -0.02],
            Paint::Cowl,
        ),
        pipe(&[(Vec3::new(-0.58, 0.0, -0.84), 0.03), (Vec3::new(-0.50, 0.0, -0.84), 0.05)], 8, Paint::Steel),
    ];
    solids.extend(propeller());
    let mut hung: Vec<Solid> =
        solids.into_iter().map(|s| s.map(|p| p * scale).turned(turn).moved(at)).collect();
    // The clamp stays with the boat.
    for y in [-0.10, 0.10] {
        let clamp = block(Vec3::new(-0.10, y - 0.025, -0.30), Vec3::new(0.10, y + 0.025, 0.07), Paint::Steel);
        hung.push(clamp.map(|p| p * scale).moved(at));
    }
    hung
}

/// Rounded cowling: aft end, fore end, half width and height of each ring.
fn cowl() -> Solid {
    let rings = [
        (-0.58, 0.08, 0.19, 0.12),
        (-0.64, 0.11, 0.225, 0.24),
        (-0.66, 0.12, 0.235, 0.42),
        (-0.62, 0.11, 0.220, 0.58),
        (-0.52, 0.06, 0.175, 0.70),
        (-0.38, -0.04, 0.105, 0.765),
    ]
    .map(|(aft, fore, half, z)| oval(aft, fore, half, z));
    skin(&rings, Paint::Cowl, 60.0)
}

/// The light band that makers put about the cowl's foot.
fn band() -> Solid {
    let rings = [(-0.665, 0.125, 0.238, 0.27), (-0.672, 0.128, 0.243, 0.34)]
        .map(|(aft, fore, half, z)| oval(aft, fore, half, z));
    skin(&rings, Paint::CowlBand, 40.0)
}

/// A rounded rectangle of twelve corners.
fn oval(aft: f32, fore: f32, half: f32, z: f32) -> Vec<Vec3> {
    let (middle, long) = ((aft + fore) / 2.0, (fore - aft) / 2.0);
    (0..12)
        .map(|k| {
            let (s, c) = ((k as f32 + 0.5) / 12.0 * std::f32::consts::TAU).sin_cos();
            // Superellipse of exponent 3.
            let round = |v: f32| v.signum() * v.abs().powf(2.0 / 3.0);
            Vec3::new(middle + long * round(c), half * round(s), z)
        })
        .collect()
}

fn propeller() -> Vec<Solid> {
    let hub = Vec3::new(-0.53, 0.0, -0.84);
    (0..3)
        .map(|blade| {
            let turn = Quat::from_rotation_x(blade as f32 * std::f32::consts::TAU / 3.0)
                * Quat::from_rotation_z(0.45);
            block(Vec3::new(-0.012, -0.05, 0.03), Vec3::new(0.012, 0.05, 0.17), Paint::Steel)
                .turned(turn)
                .moved(hub)
        })
        .collect()
}
