//! Fishing dhow, 18 m: teak hull with a long raked stem and a high stern, wheelhouse on the poop, short raked mast.

use bowwave_core::model::Zone;
use glam::Vec3;

use super::{
    assembly::Assembly,
    figure::{Clothes, FigurePose, Headwear, figure},
    loft::{LinesPlan, Offsets, beside, offsets, smooth},
    paint::Paint,
    solid::{Solid, bar, block, drum, ellipsoid, pipe, prism, tapered},
};

/// Keel, bilge, water, wale, rail, deck and centre line.
const OFFSETS: Offsets<7, 9> = offsets(include_str!("dhow.txt"));

/// The whole boat.
pub(crate) fn build() -> Assembly {
    let mut boat = Assembly::default();
    // The engine stands under the poop: what is struck low on the quarters goes into it.
    let (aft, fore, top) = (-6.6, -3.0, 1.1);
    let skin = hull().cut(Vec3::X, aft).cut(Vec3::X, fore).cut(Vec3::Z, top);
    boat.add_by(skin, |p| {
        let outside = p.y.abs() > 0.75 || p.z < -0.3;
        if p.x > aft && p.x < fore && p.z < top && outside { Zone::Engine } else { Zone::Hull }
    });
    boat.add_all(Zone::Engine, exhaust());
    boat.add_all(Zone::Hull, stem_and_rudder());
    boat.add_all(Zone::Hull, rails());
    boat.add_all(Zone::Hull, rig());
    boat.add_all(Zone::Hull, gear());
    boat.add_all(Zone::Hull, hands());
    boat.add_all(Zone::Helm, wheelhouse());
    boat
}

fn hull() -> Solid {
    let [keel, bilge, water, wale, rail, deck, centre] = &OFFSETS;
    let rail_at = |out: f32, up: f32| beside(rail, out, up, out);
    LinesPlan {
        lines: &[
            keel,
            bilge,
            water,
            wale,
            rail,
            &rail_at(0.06, 0.0),
            &rail_at(0.06, 0.09),
            &rail_at(-0.14, 0.09),
            deck,
            centre,
        ],
        round: &[1, 2],
        rows: &[2, 2, 3, 2, 1, 1, 1, 1, 1, 0],
        paints: &[(Paint::Teak, 3), (Paint::GreenStrake, 1), (Paint::DeckHouse, 4), (Paint::Planks, 2)],
        steps: 3,
        crease: 32.0,
        transom: Paint::Teak,
    }
    .build()
    .paint_below(0.12, Paint::Antifouling)
}

/// Stem post that rises above the rail, rudder, rubbing wales.
fn stem_and_rudder() -> Vec<Solid> {
    let stem = [(8.55, 2.0), (9.0, 2.0), (10.15, 3.72), (9.86, 3.86)];
    let ring = |y: f32| stem.iter().map(|&(x, z)| Vec3::new(x, y, z)).collect::<Vec<_>>();
    let rudder = [(-8.35, -1.25), (-7.42, -1.30), (-7.75, 0.4), (-8.12, 1.95), (-8.36, 1.95), (-8.25, 0.2)];
    let blade = |y: f32| rudder.iter().map(|&(x, z)| Vec3::new(x, y, z)).collect::<Vec<_>>();
    let wale = |side: f32| {
        let [_, _, _, wale, ..] = &OFFSETS;
        let path: Vec<(Vec3, f32)> = wale[1..]
            .iter()
            .filter(|p| p[1] > 0.0)
            .map(|&[x, y, z]| (Vec3::new(x, (y + 0.03) * side, z), 0.07))
            .chain([(Vec3::new(8.36, 0.0, 2.02), 0.06)])
            .collect();
        let mut distinct = path.clone();
        distinct.dedup_by(|a, b| a.0 == b.0);
        pipe(&smooth(&distinct, 4), 4, Paint::Rubber)
    };
    vec![
        super::solid::skin(&[ring(-0.09), ring(0.09)], Paint::Teak, 25.0),
        super::solid::skin(&[blade(-0.05), blade(0.05)], Paint::Teak, 25.0),
        wale(1.0),
        wale(-1.0),
    ]
}

/// Wheelhouse on the poop with windows, roof and what stands on it.
fn wheelhouse() -> Vec<Solid> {
    let (aft, fore, half, low, high) = (-6.7, -3.9, 1.25, 2.02, 4.25);
    let window = (3.18, 3.88);
    let house = tapered(
        Vec3::new(aft, -half, low),
        Vec3::new(fore, half, high),
        [0.05, 0.18, 0.06, 0.06],
        Paint::DeckHouse,
    )
    .cut(Vec3::Z, window.0)
    .cut(Vec3::Z, window.1)
    .cut(Vec3::X, aft + 0.4)
    .repaint(Paint::Glass, |p| p.z > window.0 && p.z < window.1 && p.x > aft + 0.4);
    let lean = |z: f32, by: f32| by * (z - low) / (high - low);
    let mut solids = vec![house];
    for y in [-0.42, 0.42] {
        let at = |z: f32| Vec3::new(fore - lean(z, 0.18), y, z);
        solids.push(bar(at(window.0), at(window.1), 0.09, Paint::DeckHouse));
    }
    for side in [1.0, -1.0] {
        for x in [-5.65, -4.85, -4.12] {
            let at = |z: f32| {
                Vec3::new(x - if x > -4.5 { lean(z, 0.18) } else { 0.0 }, side * (half - lean(z, 0.06)), z)
            };
            solids.push(bar(at(window.0), at(window.1), 0.12, Paint::DeckHouse));
        }
    }
    let roof_low = [(-7.15, -1.55), (-3.40, -1.55), (-3.40, 1.55), (-7.15, 1.55)];
    let roof_high = [(-7.10, -1.45), (-3.45, -1.45), (-3.45, 1.45), (-7.10, 1.45)];
    solids.extend([
        prism(&roof_low, 4.25, &roof_high, 4.40, Paint::GreenStrake),
        // Dark doorway aft.
        block(Vec3::new(-6.73, -0.36, 2.10), Vec3::new(-6.60, 0.36, 3.85), Paint::Glass),
        drum(Vec3::new(-4.6, 0.0, 4.40), 0.30, 0.22, 10, Paint::White),
        ellipsoid(Vec3::new(-5.9, 0.75, 4.56), Vec3::new(0.52, 0.26, 0.20), 8, 4, Paint::Orange),
        bar(Vec3::new(-6.6, -1.0, 4.40), Vec3::new(-6.7, -1.0, 7.6), 0.025, Paint::White),
        bar(Vec3::new(-5.3, -0.9, 4.40), Vec3::new(-5.3, -0.9, 5.5), 0.05, Paint::DeckHouse),
    ]);
    solids
}

/// Exhaust behind the wheelhouse.
fn exhaust() -> Vec<Solid> {
    let path = [
        (Vec3::new(-7.05, 0.85, 2.05), 0.12),
        (Vec3::new(-7.05, 0.85, 4.55), 0.12),
        (Vec3::new(-7.30, 0.85, 4.80), 0.12),
    ];
    vec![pipe(&path, 8, Paint::BootTop)]
}

/// Poop rail on stanchions, awning over the stern.
fn rails() -> Vec<Solid> {
    let mut solids = Vec::new();
    for side in [1.0, -1.0] {
        let foot = |x: f32| Vec3::new(x, side * (2.46 + 0.105 * (x + 3.0)), 2.1 + 0.195 * (-3.0 - x));
        let up = Vec3::Z * 0.75;
        for k in 0..6 {
            let at = foot(-3.1 - k as f32);
            solids.push(bar(at, at + up, 0.035, Paint::DeckHouse));
        }
        solids.push(bar(foot(-3.05) + up, foot(-8.15) + up, 0.04, Paint::DeckHouse));
        solids.push(bar(foot(-3.05) + up * 0.5, foot(-8.15) + up * 0.5, 0.025, Paint::DeckHouse));
        // Posts of the awning.
        solids.push(bar(
            foot(-3.2) * Vec3::new(1.0, 0.88, 1.0),
            Vec3::new(-3.2, side * 1.9, 4.15),
            0.04,
            Paint::Teak,
        ));
        solids.push(bar(
            foot(-8.1) * Vec3::new(1.0, 0.98, 1.0),
            Vec3::new(-8.2, side * 1.6, 4.20),
            0.04,
            Paint::Teak,
        ));
    }
    let low = [(-8.35, -1.65), (-7.15, -1.70), (-7.15, 1.70), (-8.35, 1.65)];
    solids.push(prism(&low, 4.16, &low, 4.22, Paint::Canvas));
    let fore = [(-3.45, -1.95), (-2.55, -1.95), (-2.55, 1.95), (-3.45, 1.95)];
    solids.push(prism(&fore, 4.10, &fore, 4.16, Paint::Canvas));
    solids
}

/// Mast, derrick boom, shrouds.
fn rig() -> Vec<Solid> {
    let head = Vec3::new(2.45, 0.0, 9.4);
    let foot = Vec3::new(1.6, 0.0, 0.9);
    let boom_end = Vec3::new(-2.5, 0.0, 6.6);
    let mut solids = vec![
        pipe(&[(foot, 0.16), (foot.lerp(head, 0.6), 0.13), (head, 0.07)], 8, Paint::Teak),
        pipe(&[(foot.lerp(head, 0.25), 0.08), (boom_end, 0.06)], 6, Paint::Planks),
        bar(boom_end, head, 0.018, Paint::Black),
        bar(head, Vec3::new(9.7, 0.0, 3.6), 0.018, Paint::Black),
    ];
    for side in [1.0, -1.0] {
        for x in [0.6, 2.6] {
            solids.push(bar(foot.lerp(head, 0.9), Vec3::new(x, side * 2.45, 1.75), 0.018, Paint::Black));
        }
    }
    solids
}

/// Nets, fish boxes, drums, a hatch, tyres along the sides.
fn gear() -> Vec<Solid> {
    let mut solids = vec![
        tapered(
            Vec3::new(-1.9, -0.9, 0.9),
            Vec3::new(0.5, 0.9, 1.42),
            [0.05, 0.05, 0.05, 0.05],
            Paint::Planks,
        ),
        ellipsoid(Vec3::new(3.4, 0.55, 1.45), Vec3::new(1.15, 0.95, 0.62), 10, 5, Paint::Net),
        ellipsoid(Vec3::new(4.7, -0.5, 1.65), Vec3::new(0.95, 0.80, 0.50), 10, 5, Paint::Net),
        drum(Vec3::new(-2.4, 1.75, 0.95), 0.29, 0.88, 10, Paint::BlueDrum),
        drum(Vec3::new(-2.4, -1.75, 0.95), 0.29, 0.88, 10, Paint::BlueDrum),
        drum(Vec3::new(-1.75, -1.85, 0.95), 0.29, 0.88, 10, Paint::BlueDrum),
        ellipsoid(Vec3::new(6.3, 0.2, 1.95), Vec3::new(0.5, 0.6, 0.30), 8, 4, Paint::Sand),
    ];
    for (k, paint) in [Paint::Yellow, Paint::Orange, Paint::Yellow, Paint::BlueDrum].into_iter().enumerate() {
        let at = Vec3::new(-1.6 + 0.62 * k as f32, 0.25 - 0.3 * (k % 2) as f32, 1.42);
        solids.push(tapered(at, at + Vec3::new(0.55, 0.40, 0.32), [0.02; 4], paint));
    }
    for side in [1.0, -1.0] {
        for (x, y, z) in [(-4.6, 2.36, 0.62), (-1.2, 2.50, 0.50), (2.1, 2.48, 0.55)] {
            let middle = Vec3::new(x, y * side, z);
            solids.push(pipe(
                &[(middle - Vec3::Y * 0.09, 0.32), (middle + Vec3::Y * 0.09, 0.32)],
                12,
                Paint::Rubber,
            ));
        }
    }
    solids
}

/// Two men on deck.
fn hands() -> Vec<Solid> {
    let standing = FigurePose {
        pelvis: Vec3::new(1.0, -1.35, 1.85),
        facing: Vec3::new(0.2, -1.0, 0.0),
        lean: 0.10,
        hands: [Vec3::new(1.35, -2.05, 1.82), Vec3::new(0.80, -2.10, 1.82)],
        feet: [Vec3::new(1.15, -1.40, 1.02), Vec3::new(0.85, -1.32, 1.02)],
    };
    let seated = FigurePose {
        pelvis: Vec3::new(5.75, 0.9, 1.78),
        facing: Vec3::new(-1.0, -0.3, 0.0),
        lean: 0.12,
        hands: [Vec3::new(5.30, 0.55, 1.88), Vec3::new(5.25, 0.95, 1.88)],
        feet: [Vec3::new(5.22, 0.55, 1.40), Vec3::new(5.18, 0.90, 1.40)],
    };
    let wear = |top, head| Clothes { top, trousers: Paint::Sand, shoes: Paint::Skin, head, vest: None };
    let mut solids = figure(&standing, &wear(Paint::White, Headwear::Wrap(Paint::RedShirt)));
    solids.extend(figure(&seated, &wear(Paint::BlueDrum, Headwear::Wrap(Paint::White))));
    solids
}
