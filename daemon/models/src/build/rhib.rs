//! Rigid inflatable, 7.5 m: deep-V hull in a collar of inflated tube, console with windscreen, two outboards, A-frame.

use bowwave_core::model::Zone;
use glam::Vec3;

use super::{
    assembly::Assembly,
    figure::{Clothes, FigurePose, Headwear, figure},
    loft::{LinesPlan, Offsets, offsets, smooth},
    outboard::outboard,
    paint::Paint,
    solid::{Solid, bar, block, drum, ellipsoid, pipe, tapered},
};

/// Keel, chine, edge of the sole and its centre line.
const OFFSETS: Offsets<4, 6> = offsets(include_str!("rhib.txt"));

/// Middle of the port tube and its radius, from the cone at the stern to the bow.
const TUBE: [(f32, f32, f32, f32); 9] = [
    (-3.75, 1.10, 0.40, 0.05),
    (-3.45, 1.11, 0.38, 0.20),
    (-3.05, 1.12, 0.37, 0.25),
    (-1.40, 1.14, 0.38, 0.255),
    (0.40, 1.13, 0.43, 0.255),
    (1.70, 1.00, 0.54, 0.255),
    (2.60, 0.70, 0.67, 0.25),
    (3.20, 0.34, 0.76, 0.24),
    (3.42, 0.0, 0.79, 0.24),
];

/// The whole boat.
pub(crate) fn build() -> Assembly {
    let mut boat = Assembly::default();
    boat.add(Zone::Hull, hull());
    boat.add_all(Zone::Hull, collar());
    boat.add_all(Zone::Hull, fittings());
    boat.add_all(Zone::Hull, frame());
    boat.add_all(
        Zone::Hull,
        crew(Vec3::new(-1.62, 0.0, 1.02), -1.12, 1.22, Headwear::Helmet(Paint::GreyHull)),
    );
    for y in [-0.40, 0.40] {
        boat.add_all(Zone::Engine, outboard(Vec3::new(-3.16, y, 0.60), 1.12, 0.06, 0.0));
    }
    boat.add_all(Zone::Helm, console());
    boat.add_all(Zone::Helm, crew(Vec3::new(-0.66, 0.0, 1.08), -0.16, 1.30, Headwear::Helmet(Paint::White)));
    boat
}

fn hull() -> Solid {
    let [keel, chine, edge, sole] = &OFFSETS;
    LinesPlan {
        lines: &[keel, chine, edge, sole],
        round: &[],
        rows: &[2, 1, 1, 0],
        paints: &[(Paint::GreyHull, 2), (Paint::SoleGrey, 2)],
        steps: 4,
        crease: 32.0,
        transom: Paint::GreyHull,
    }
    .build()
}

/// The tube, and the rubbing strake along its outside.
fn collar() -> Vec<Solid> {
    let port: Vec<(Vec3, f32)> = TUBE.iter().map(|&(x, y, z, r)| (Vec3::new(x, y, z), r)).collect();
    let star = port.iter().rev().skip(1).map(|&(p, r)| (Vec3::new(p.x, -p.y, p.z), r));
    let around: Vec<(Vec3, f32)> = port.iter().copied().chain(star).collect();
    let path = smooth(&around, 2);
    // Along the outermost line of the tube, where it rubs.
    let strake: Vec<(Vec3, f32)> = path
        .windows(3)
        .filter(|w| w[1].0.x > -3.2)
        .map(|w| (w[1].0 + Vec3::Z.cross(w[2].0 - w[0].0).normalize_or(Vec3::X) * (w[1].1 * 0.98), 0.04))
        .collect();
    let mut solids = vec![pipe(&path, 10, Paint::Tube), pipe(&strake, 4, Paint::Rubber)];
    // Grab patches along the top.
    for x in [-2.4, -1.2, 0.0, 1.1] {
        for y in [-1.13, 1.13] {
            let foot = Vec3::new(x, y, 0.62 + 0.03 * (x + 2.4).max(0.0));
            solids.push(block(
                foot - Vec3::new(0.13, 0.045, 0.02),
                foot + Vec3::new(0.13, 0.045, 0.035),
                Paint::Orange,
            ));
        }
    }
    solids
}

/// Transom, seats, locker forward.
fn fittings() -> Vec<Solid> {
    vec![
        block(Vec3::new(-3.16, -0.90, 0.05), Vec3::new(-3.02, 0.90, 0.60), Paint::GreyHull),
        seat(-0.68),
        seat(-1.64),
        tapered(
            Vec3::new(1.25, -0.42, 0.32),
            Vec3::new(2.05, 0.42, 0.78),
            [0.04, 0.12, 0.06, 0.06],
            Paint::GreyHull,
        ),
        ellipsoid(Vec3::new(2.55, 0.0, 0.66), Vec3::new(0.26, 0.24, 0.12), 8, 4, Paint::Sand),
        block(Vec3::new(-2.85, -0.25, 0.24), Vec3::new(-2.35, 0.25, 0.55), Paint::Black),
    ]
}

/// A jockey seat with a backrest.
fn seat(x: f32) -> Solid {
    let mut pod = tapered(
        Vec3::new(x - 0.36, -0.19, 0.25),
        Vec3::new(x + 0.30, 0.19, 0.82),
        [0.10, 0.08, 0.03, 0.03],
        Paint::GreyHull,
    );
    let cushion = tapered(
        Vec3::new(x - 0.32, -0.17, 0.82),
        Vec3::new(x + 0.26, 0.17, 0.94),
        [0.02, 0.04, 0.03, 0.03],
        Paint::Black,
    );
    let back = tapered(
        Vec3::new(x - 0.40, -0.20, 0.80),
        Vec3::new(x - 0.28, 0.20, 1.26),
        [0.0, 0.03, 0.03, 0.03],
        Paint::Black,
    );
    pod.tris.extend(cushion.tris);
    pod.tris.extend(back.tris);
    pod
}

/// Console with windscreen, wheel and throttle.
fn console() -> Vec<Solid> {
    let wheel_hub = Vec3::new(-0.13, 0.0, 1.22);
    let rim: Vec<(Vec3, f32)> = (0..=12)
        .map(|k| {
            let (s, c) = (k as f32 / 12.0 * std::f32::consts::TAU).sin_cos();
            (wheel_hub + Vec3::new(-0.10 - 0.05 * s, 0.19 * c, 0.18 * s), 0.016)
        })
        .collect();
    vec![
        tapered(
            Vec3::new(-0.05, -0.44, 0.26),
            Vec3::new(0.75, 0.44, 1.20),
            [0.03, 0.22, 0.06, 0.06],
            Paint::GreyHull,
        ),
        tapered(
            Vec3::new(0.0, -0.36, 1.20),
            Vec3::new(0.50, 0.36, 1.32),
            [0.10, 0.06, 0.02, 0.02],
            Paint::Black,
        ),
        tapered(
            Vec3::new(0.30, -0.38, 1.20),
            Vec3::new(0.52, 0.38, 1.68),
            [0.0, 0.19, 0.05, 0.05],
            Paint::Glass,
        ),
        pipe(&[(Vec3::new(0.04, 0.0, 1.18), 0.03), (wheel_hub - Vec3::X * 0.10, 0.03)], 6, Paint::Black),
        pipe(&rim, 4, Paint::Black),
        bar(Vec3::new(0.02, -0.30, 1.18), Vec3::new(-0.05, -0.30, 1.36), 0.022, Paint::Steel),
        bar(Vec3::new(0.34, -0.39, 1.20), Vec3::new(0.34, -0.36, 1.72), 0.018, Paint::Steel),
        bar(Vec3::new(0.34, 0.39, 1.20), Vec3::new(0.34, 0.36, 1.72), 0.018, Paint::Steel),
        bar(Vec3::new(0.34, -0.37, 1.71), Vec3::new(0.34, 0.37, 1.71), 0.018, Paint::Steel),
    ]
}

/// A-frame over the engines with radar, light and whips.
fn frame() -> Vec<Solid> {
    let leg = |side: f32| {
        let path = [
            (Vec3::new(-2.15, 0.92 * side, 0.30), 0.04),
            (Vec3::new(-2.55, 0.84 * side, 1.55), 0.04),
            (Vec3::new(-2.68, 0.66 * side, 2.02), 0.04),
            (Vec3::new(-2.70, 0.40 * side, 2.10), 0.04),
            (Vec3::new(-2.70, 0.0, 2.11), 0.04),
        ];
        pipe(&path, 6, Paint::Steel)
    };
    vec![
        leg(1.0),
        leg(-1.0),
        bar(Vec3::new(-2.95, 0.86, 0.30), Vec3::new(-2.60, 0.76, 1.80), 0.032, Paint::Steel),
        bar(Vec3::new(-2.95, -0.86, 0.30), Vec3::new(-2.60, -0.76, 1.80), 0.032, Paint::Steel),
        block(Vec3::new(-2.90, -0.24, 2.13), Vec3::new(-2.50, 0.24, 2.17), Paint::Steel),
        drum(Vec3::new(-2.70, 0.0, 2.17), 0.23, 0.20, 12, Paint::White),
        bar(Vec3::new(-2.68, 0.62, 2.02), Vec3::new(-2.95, 0.66, 3.90), 0.012, Paint::White),
        bar(Vec3::new(-2.68, -0.62, 2.02), Vec3::new(-2.90, -0.64, 3.20), 0.012, Paint::White),
        drum(Vec3::new(-2.70, 0.36, 2.12), 0.05, 0.22, 6, Paint::White),
    ]
}

/// A man astride a seat, his hands on what is in front of him.
fn crew(pelvis: Vec3, hands_x: f32, hands_z: f32, head: Headwear) -> Vec<Solid> {
    let pose = FigurePose {
        pelvis,
        facing: Vec3::X,
        lean: 0.10,
        hands: [Vec3::new(hands_x, 0.17, hands_z), Vec3::new(hands_x, -0.17, hands_z)],
        feet: [Vec3::new(pelvis.x + 0.18, 0.31, 0.34), Vec3::new(pelvis.x + 0.18, -0.31, 0.34)],
    };
    let wear = Clothes {
        top: Paint::Navy,
        trousers: Paint::Navy,
        shoes: Paint::Black,
        head,
        vest: Some(Paint::Orange),
    };
    figure(&pose, &wear)
}
