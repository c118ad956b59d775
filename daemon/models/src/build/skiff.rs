//! Open skiff, 7 m: narrow planing hull with a high flared bow, tiller-steered outboard, helmsman and one passenger.

use bowwave_core::model::Zone;
use glam::Vec3;

use super::{
    assembly::Assembly,
    figure::{Clothes, FigurePose, Headwear, figure},
    loft::{LinesPlan, Offsets, beside, offsets},
    outboard::outboard,
    paint::Paint,
    solid::{Solid, bar, block, capsule, drum, ellipsoid, pipe, tapered},
};

/// Keel, chine, stripe, sheer, foot of the inner side and centre line.
const OFFSETS: Offsets<6, 10> = offsets(include_str!("skiff.txt"));

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
    let [keel, chine, stripe, sheer, inside, centre] = &OFFSETS;
    let sheer_at = |out: f32, up: f32| beside(sheer, out, up, out.max(0.0));
    LinesPlan {
        lines: &[
            keel,
            chine,
            stripe,
            sheer,
            &sheer_at(0.035, 0.0),
            &sheer_at(0.035, 0.06),
            &sheer_at(-0.05, 0.06),
            inside,
            centre,
        ],
        round: &[],
        rows: &[2, 2, 1, 1, 1, 1, 2, 1, 0],
        paints: &[(Paint::WhiteHull, 2), (Paint::BlueHull, 2), (Paint::WhiteHull, 2), (Paint::Inside, 3)],
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
    let pose = FigurePose {
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
        head: Headwear::Wrap(Paint::White),
        vest: None,
    };
    figure(&pose, &wear)
}

fn passenger() -> Vec<Solid> {
    let pose = FigurePose {
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
        head: Headwear::Cap(Paint::Navy),
        vest: None,
    };
    figure(&pose, &wear)
}
