//! Open skiff, 7 m: narrow planing hull with a high flared bow, tiller-steered outboard, helmsman and one passenger.

use bowwave_core::model::Zone;
use glam::Vec3;

use super::{
    assembly::Assembly,
    figure::{Clothes, Head, Pose, figure},
    loft::{Hull, Line},
    outboard::outboard,
    paint::Paint,
    solid::{Solid, bar, block, capsule, drum, ellipsoid, pipe, tapered},
};

// Control points from the stern: transom aft, transom fore (filled), the same open, three amidships, fore bulkhead open,
// the same decked, foredeck, stem.
const KEEL: [[f32; 3]; 10] = [
    [-3.50, 0.0, -0.22],
    [-3.43, 0.0, -0.22],
    [-3.43, 0.0, -0.22],
    [-2.00, 0.0, -0.26],
    [0.00, 0.0, -0.28],
    [1.50, 0.0, -0.26],
    [2.30, 0.0, -0.20],
    [2.30, 0.0, -0.20],
    [2.70, 0.0, -0.12],
    [3.00, 0.0, 0.05],
];
const CHINE: [[f32; 3]; 10] = [
    [-3.50, 0.72, -0.07],
    [-3.43, 0.72, -0.07],
    [-3.43, 0.72, -0.07],
    [-2.00, 0.77, -0.07],
    [0.00, 0.77, -0.04],
    [1.50, 0.60, 0.06],
    [2.40, 0.35, 0.18],
    [2.40, 0.35, 0.18],
    [2.82, 0.18, 0.27],
    [3.18, 0.0, 0.40],
];
const STRIPE: [[f32; 3]; 10] = [
    [-3.51, 0.805, 0.33],
    [-3.43, 0.81, 0.33],
    [-3.43, 0.81, 0.33],
    [-2.00, 0.885, 0.33],
    [0.00, 0.91, 0.38],
    [1.50, 0.80, 0.50],
    [2.43, 0.52, 0.65],
    [2.43, 0.52, 0.65],
    [2.93, 0.265, 0.74],
    [3.38, 0.0, 0.84],
];
const SHEER: [[f32; 3]; 10] = [
    [-3.52, 0.84, 0.50],
    [-3.43, 0.845, 0.50],
    [-3.43, 0.845, 0.50],
    [-2.00, 0.93, 0.50],
    [0.00, 0.97, 0.56],
    [1.50, 0.90, 0.70],
    [2.45, 0.62, 0.86],
    [2.45, 0.62, 0.86],
    [3.00, 0.33, 0.96],
    [3.50, 0.0, 1.07],
];
/// Foot of the inner side; the top of the transom and the foredeck where the boat is not open.
const INSIDE: [[f32; 3]; 10] = [
    [-3.52, 0.40, 0.575],
    [-3.43, 0.40, 0.575],
    [-3.43, 0.68, 0.07],
    [-2.00, 0.74, 0.07],
    [0.00, 0.75, 0.09],
    [1.50, 0.58, 0.15],
    [2.45, 0.34, 0.26],
    [2.45, 0.30, 0.935],
    [3.00, 0.16, 1.03],
    [3.50, 0.0, 1.12],
];
const CENTRE: [[f32; 3]; 10] = [
    [-3.52, 0.0, 0.585],
    [-3.43, 0.0, 0.585],
    [-3.43, 0.0, 0.07],
    [-2.00, 0.0, 0.07],
    [0.00, 0.0, 0.09],
    [1.50, 0.0, 0.15],
    [2.45, 0.0, 0.26],
    [2.45, 0.0, 0.95],
    [3.00, 0.0, 1.04],
    [3.50, 0.0, 1.12],
];

/// The sheer moved outwards (inwards where negative) and up; at the stem forward instead.
fn beside(line: &[[f32; 3]; 10], out: f32, up: f32) -> [[f32; 3]; 10] {
    line.map(|[x, y, z]| if y > 0.0 { [x, y + out, z + up] } else { [x + out.max(0.0), y, z + up] })
}

/// The whole boat.
pub(crate) fn build() -> Assembly {
    let mut boat = Assembly::default();
    boat.add(Zone::Hull, hull());
    boat.add_all(Zone::Hull, fittings());
    boat.add_all(Zone::Hull, passenger());
    boat.add_all(Zone::Engine, outboard(Vec3::new(-3.49, 0.0, 0.55), 1.0, 0.08, -0.10));
    boat.add_all(Zone::Helm, helmsman());
    let tiller = [(Vec3::new(-3.40, 0.02, 0.86), 0.035), (Vec3::new(-2.74, -0.06, 0.93), 0.022)];
    boat.add(Zone::Helm, pipe(&tiller, 6, Paint::Cowl));
    boat
}

fn hull() -> Solid {
    let under = beside(&SHEER, 0.035, 0.0);
    let top = beside(&SHEER, 0.035, 0.06);
    let inner = beside(&SHEER, -0.05, 0.06);
    let line = |points, rows, paint| Line { points, corner: true, rows, paint };
    Hull {
        lines: &[
            line(&KEEL, 2, Paint::WhiteHull),
            line(&CHINE, 2, Paint::WhiteHull),
            line(&STRIPE, 1, Paint::BlueHull),
            line(&SHEER, 1, Paint::BlueHull),
            line(&under, 1, Paint::WhiteHull),
            line(&top, 1, Paint::WhiteHull),
            line(&inner, 2, Paint::Inside),
            line(&INSIDE, 1, Paint::Inside),
            line(&CENTRE, 0, Paint::Inside),
        ],
        steps: 4,
        crease: 32.0,
        transom: Paint::WhiteHull,
    }
    .build()
}

/// Thwarts, cans, a drum, a heap of net, rope on the foredeck.
fn fittings() -> Vec<Solid> {
    let thwart = |x: f32, half: f32, z: f32| {
        block(Vec3::new(x, -half, z - 0.05), Vec3::new(x + 0.30, half, z), Paint::WhiteHull)
    };
    let can = |x: f32, y: f32, paint| {
        let foot = Vec3::new(x, y, 0.08);
        tapered(foot, foot + Vec3::new(0.34, 0.17, 0.36), [0.03, 0.06, 0.02, 0.02], paint)
    };
    vec![
        thwart(-2.65, 0.83, 0.42),
        thwart(-0.75, 0.87, 0.44),
        thwart(0.95, 0.84, 0.52),
        can(-3.05, 0.30, Paint::Orange),
        can(-1.85, 0.42, Paint::Yellow),
        can(-1.85, 0.20, Paint::Yellow),
        can(-1.45, -0.55, Paint::BlueDrum),
        drum(Vec3::new(-0.05, 0.36, 0.08), 0.27, 0.62, 12, Paint::BlueDrum),
        ellipsoid(Vec3::new(0.1, -0.32, 0.16), Vec3::new(0.50, 0.34, 0.26), 10, 5, Paint::Net),
        ellipsoid(Vec3::new(1.95, 0.0, 0.30), Vec3::new(0.34, 0.32, 0.20), 8, 4, Paint::Sand),
        capsule(Vec3::new(2.75, -0.12, 1.02), Vec3::new(2.75, 0.12, 1.02), 0.03, 0.03, 6, Paint::Steel),
        bar(Vec3::new(-1.2, -0.80, 0.60), Vec3::new(1.6, -0.62, 0.74), 0.025, Paint::Planks),
    ]
}

fn helmsman() -> Vec<Solid> {
    let pose = Pose {
        pelvis: Vec3::new(-2.50, -0.30, 0.53),
        facing: Vec3::new(1.0, 0.12, 0.0),
        lean: 0.05,
        hands: [Vec3::new(-2.76, -0.07, 0.97), Vec3::new(-2.08, -0.46, 0.66)],
        feet: [Vec3::new(-1.98, -0.14, 0.15), Vec3::new(-2.02, -0.44, 0.15)],
    };
    let wear = Clothes {
        top: Paint::RedShirt,
        trousers: Paint::Navy,
        shoes: Paint::Black,
        head: Head::Wrap(Paint::White),
        vest: None,
    };
    figure(&pose, &wear)
}

fn passenger() -> Vec<Solid> {
    let pose = Pose {
        pelvis: Vec3::new(1.08, 0.16, 0.62),
        facing: Vec3::X,
        lean: 0.14,
        hands: [Vec3::new(1.52, 0.34, 0.74), Vec3::new(1.52, 0.0, 0.74)],
        feet: [Vec3::new(1.58, 0.28, 0.24), Vec3::new(1.58, 0.02, 0.24)],
    };
    let wear = Clothes {
        top: Paint::Sand,
        trousers: Paint::Olive,
        shoes: Paint::Black,
        head: Head::Cap(Paint::Navy),
        vest: None,
    };
    figure(&pose, &wear)
}
