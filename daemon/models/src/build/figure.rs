//! People: a man of 1.75 m in any pose that his pelvis, hands and feet give.

use glam::Vec3;

use super::{
    paint::Paint,
    solid::{Solid, capsule, ellipse, ellipsoid, pipe, skin},
};

/// Shoulder joint above the hip joint of an upright man, metres.
const TRUNK: f32 = 0.50;
const SHOULDER_HALF: f32 = 0.175;
const HIP_HALF: f32 = 0.10;
const UPPER_ARM: f32 = 0.29;
const FOREARM: f32 = 0.26;
const THIGH: f32 = 0.43;
const SHIN: f32 = 0.43;

/// Headwear.
#[derive(Clone, Copy)]
pub(crate) enum Headwear {
    /// Cloth wound about the head.
    Wrap(Paint),
    /// Cap with a peak.
    Cap(Paint),
    /// Helmet.
    Helmet(Paint),
}

/// Clothes of a figure.
#[derive(Clone, Copy)]
pub(crate) struct Clothes {
    pub(crate) top: Paint,
    pub(crate) trousers: Paint,
    pub(crate) shoes: Paint,
    pub(crate) head: Headwear,
    /// Life jacket.
    pub(crate) vest: Option<Paint>,
}

/// Where the joints are, boat axes.
#[derive(Clone, Copy)]
pub(crate) struct FigurePose {
    /// Middle between the hip joints.
    pub(crate) pelvis: Vec3,
    /// Direction of the chest, horizontal.
    pub(crate) facing: Vec3,
    /// Forward lean of the trunk, metres at the shoulders.
    pub(crate) lean: f32,
    /// Left and right hand.
    pub(crate) hands: [Vec3; 2],
    /// Left and right ankle.
    pub(crate) feet: [Vec3; 2],
}

/// The figure's solids.
pub(crate) fn figure(pose: &FigurePose, wear: &Clothes) -> Vec<Solid> {
    let forward = pose.facing.normalize_or(Vec3::X);
    let left = Vec3::Z.cross(forward);
    let neck = pose.pelvis
        + Vec3::Z * (TRUNK * TRUNK - pose.lean * pose.lean).max(0.01).sqrt()
        + forward * pose.lean;
    let mut solids = vec![trunk(pose.pelvis, neck, forward, left, wear.top)];
    if let Some(vest) = wear.vest {
        solids.push(life_jacket(pose.pelvis, neck, forward, left, vest));
    }
    solids.extend(head(neck, forward, wear.head));
    for (i, side) in [1.0, -1.0].into_iter().enumerate() {
        let shoulder = neck + left * (side * SHOULDER_HALF) - Vec3::Z * 0.02;
        let elbow_hint = left * (side * 0.6) - Vec3::Z - forward * 0.5;
        solids.extend(arm(shoulder, pose.hands[i], elbow_hint, wear.top));
        let hip = pose.pelvis + left * (side * HIP_HALF);
        let knee_hint = forward + left * (side * 0.25) + Vec3::Z * 0.3;
        solids.extend(leg(hip, pose.feet[i], knee_hint, forward, wear));
    }
    solids
}

fn trunk(pelvis: Vec3, neck: Vec3, forward: Vec3, left: Vec3, paint: Paint) -> Solid {
    // Share of the way from hips to shoulders, half width, half depth.
    let rows = [
        (-0.20, 0.125, 0.085),
        (-0.08, 0.170, 0.115),
        (0.12, 0.165, 0.110),
        (0.38, 0.155, 0.105),
        (0.68, 0.190, 0.125),
        (0.92, 0.205, 0.110),
        (1.05, 0.150, 0.085),
        (1.13, 0.062, 0.060),
    ];
    let rings: Vec<_> = rows
        .iter()
        .map(|&(share, width, depth)| ellipse(pelvis.lerp(neck, share), forward * depth, left * width, 8))
        .collect();
    skin(&rings, paint, 70.0)
}

fn life_jacket(pelvis: Vec3, neck: Vec3, forward: Vec3, left: Vec3, paint: Paint) -> Solid {
    let rows = [(0.28, 0.185, 0.140), (0.38, 0.200, 0.165), (0.85, 0.205, 0.175), (1.0, 0.165, 0.135)];
    let rings: Vec<_> = rows
        .iter()
        .map(|&(share, width, depth)| ellipse(pelvis.lerp(neck, share), forward * depth, left * width, 8))
        .collect();
    skin(&rings, paint, 50.0)
}

fn head(neck: Vec3, forward: Vec3, worn: Headwear) -> Vec<Solid> {
    let throat = neck + Vec3::Z * 0.04;
    let skull = neck + Vec3::Z * 0.195 + forward * 0.025;
    let mut solids = vec![
        pipe(&[(throat, 0.058), (skull, 0.052)], 6, Paint::Skin),
        ellipsoid(skull, Vec3::new(0.088, 0.080, 0.118), 8, 6, Paint::Skin),
    ];
    match worn {
        Headwear::Wrap(paint) => {
            let at = skull + Vec3::Z * 0.055 - forward * 0.012;
            solids.push(ellipsoid(at, Vec3::new(0.112, 0.108, 0.078), 8, 5, paint));
            let nape = skull - forward * 0.055 - Vec3::Z * 0.06;
            solids.push(ellipsoid(nape, Vec3::new(0.06, 0.085, 0.10), 8, 4, paint));
        }
        Headwear::Cap(paint) => {
            let at = skull + Vec3::Z * 0.048 - forward * 0.008;
            solids.push(ellipsoid(at, Vec3::new(0.100, 0.092, 0.085), 8, 5, paint));
            let peak = skull + Vec3::Z * 0.055 + forward * 0.10;
            solids.push(ellipsoid(peak, Vec3::new(0.075, 0.075, 0.012), 8, 3, paint));
            solids.push(hair(skull, forward));
        }
        Headwear::Helmet(paint) => {
            let at = skull + Vec3::Z * 0.042 - forward * 0.012;
            solids.push(ellipsoid(at, Vec3::new(0.128, 0.118, 0.108), 8, 5, paint));
        }
    }
    solids
}

fn hair(skull: Vec3, forward: Vec3) -> Solid {
    ellipsoid(skull - forward * 0.03 - Vec3::Z * 0.01, Vec3::new(0.075, 0.084, 0.09), 8, 4, Paint::Hair)
}

fn arm(shoulder: Vec3, hand: Vec3, hint: Vec3, sleeve: Paint) -> Vec<Solid> {
    let (elbow, wrist) = bend(shoulder, hand, UPPER_ARM, FOREARM, hint);
    let along = (wrist - elbow).normalize_or(Vec3::X);
    vec![
        capsule(shoulder, elbow, 0.062, 0.048, 6, sleeve),
        capsule(elbow, wrist, 0.046, 0.034, 6, Paint::Skin),
        capsule(wrist + along * 0.03, wrist + along * 0.09, 0.038, 0.034, 6, Paint::Skin),
    ]
}

fn leg(hip: Vec3, ankle: Vec3, hint: Vec3, forward: Vec3, wear: &Clothes) -> Vec<Solid> {
    let (knee, ankle) = bend(hip, ankle, THIGH, SHIN, hint);
    let heel = ankle - forward * 0.04 - Vec3::Z * 0.03;
    vec![
        capsule(hip, knee, 0.092, 0.064, 6, wear.trousers),
        capsule(knee, ankle, 0.064, 0.046, 6, wear.trousers),
        capsule(heel, heel + forward * 0.19, 0.048, 0.042, 6, wear.shoes),
    ]
}

/// The middle joint of two bones and where the far end comes to lie, bent towards `hint`.
fn bend(root: Vec3, target: Vec3, first: f32, second: f32, hint: Vec3) -> (Vec3, Vec3) {
    let along = (target - root).normalize_or(Vec3::NEG_Z);
    let reach = (target - root).length().clamp((first - second).abs() + 0.02, (first + second) * 0.998);
    let x = (first * first - second * second + reach * reach) / (2.0 * reach);
    let out = (hint - along * hint.dot(along)).normalize_or(along.any_orthonormal_vector());
    let middle = root + along * x + out * (first * first - x * x).max(0.0).sqrt();
    (middle, root + along * reach)
}
