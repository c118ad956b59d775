//! What stands on the frigate's deck.

use glam::{Quat, Vec3};

use super::{
    paint::Paint,
    solid::{Solid, bar, block, drum, ellipsoid, pipe, prism, skin, tapered},
};

/// A block with sloped sides: x aft and fore, half breadth, z low and high, and how far each side leans in.
fn house(x: [f32; 2], half: f32, z: [f32; 2], lean: [f32; 3], paint: Paint) -> Solid {
    let [aft, fore, side] = lean;
    tapered(Vec3::new(x[0], -half, z[0]), Vec3::new(x[1], half, z[1]), [aft, fore, side, side], paint)
}

/// Hangar, main deckhouse, boat bays, launchers.
pub(crate) fn superstructure() -> Vec<Solid> {
    let mut solids = vec![
        house([-38.0, -20.0], 6.9, [5.5, 11.6], [0.3, 0.0, 0.75], Paint::Haze),
        house([-20.0, 30.0], 7.45, [5.6, 9.4], [0.0, 1.6, 0.45], Paint::Haze),
        house([6.0, 28.2], 6.6, [9.4, 12.4], [0.5, 0.9, 0.4], Paint::Haze),
        house([-19.0, -3.0], 5.2, [9.4, 11.4], [0.3, 0.3, 0.4], Paint::Haze),
        // Hangar door and the windows above it.
        block(Vec3::new(-38.06, -3.1, 5.7), Vec3::new(-37.7, 3.1, 10.4), Paint::DeckGrey),
        block(Vec3::new(-37.95, -4.9, 10.0), Vec3::new(-37.5, -3.6, 10.7), Paint::Glass),
        block(Vec3::new(-37.95, 3.6, 10.0), Vec3::new(-37.5, 4.9, 10.7), Paint::Glass),
        // Angled launchers amidships.
        launcher(1.6, 1.0),
        launcher(-1.6, -1.0),
    ];
    for side in [1.0, -1.0] {
        // Boat bay: a dark opening with the ship's boat in it.
        let y = side * 7.42;
        solids.push(block(Vec3::new(-8.0, y - side * 0.9, 6.3), Vec3::new(0.5, y, 8.9), Paint::Glass));
        let boat = [(-7.2, 0.1), (-6.6, 0.55), (-3.0, 0.6), (-1.2, 0.42), (-0.4, 0.1)];
        let hull: Vec<(Vec3, f32)> = boat.iter().map(|&(x, r)| (Vec3::new(x, y, 7.1), r)).collect();
        solids.push(pipe(&hull, 8, Paint::Orange));
        // Doors and vents break the plating up.
        for (x, z, w, h) in
            [(12.0, 6.9, 1.0, 1.9), (20.5, 7.1, 1.0, 1.9), (-14.0, 6.4, 1.0, 1.9), (5.0, 7.2, 2.2, 1.1)]
        {
            let lean = 0.118 * (z - 5.6);
            let at = Vec3::new(x, side * (7.45 - lean), z);
            solids.push(block(
                at - Vec3::new(w / 2.0, 0.12, 0.0),
                at + Vec3::new(w / 2.0, 0.02, h),
                Paint::DeckGrey,
            ));
        }
    }
    solids
}

fn launcher(y: f32, side: f32) -> Solid {
    let tubes = block(Vec3::new(-0.6, -2.6, -0.6), Vec3::new(0.6, 2.6, 0.6), Paint::DeckGrey);
    tubes.turned(Quat::from_rotation_x(side * 0.42)).moved(Vec3::new(1.8 + 0.8 * side, y, 10.9))
}

/// Bridge with its band of windows and the wings.
pub(crate) fn bridge() -> Vec<Solid> {
    let (aft, fore, half, low, high) = (11.0, 27.2, 6.2, 12.4, 16.0);
    let band = (14.1, 15.2);
    let windows = house([aft, fore], half, [low, high], [0.4, 1.0, 0.45], Paint::Haze)
        .cut(Vec3::Z, band.0)
        .cut(Vec3::Z, band.1)
        .cut(Vec3::X, 17.5)
        .repaint(Paint::Glass, |p| p.z > band.0 && p.z < band.1 && p.x > 17.5);
    // Posts between the panes, on the sloped front and sides.
    let lean = |z: f32, by: f32| by * (z - low) / (high - low);
    let mut posts = Vec::new();
    for k in -5..=5_i32 {
        let at = |z: f32| Vec3::new(fore - lean(z, 1.0), k as f32 * 1.08, z);
        posts.push(bar(at(band.0), at(band.1), 0.10, Paint::Haze));
    }
    for side in [1.0, -1.0] {
        for k in 0..6 {
            let at = |z: f32| Vec3::new(18.2 + 1.5 * k as f32, side * (half - lean(z, 0.45)), z);
            posts.push(bar(at(band.0), at(band.1), 0.10, Paint::Haze));
        }
    }
    posts.extend([
        windows,
        house([19.0, 23.5], 7.5, [12.4, 13.5], [0.2, 0.2, 0.05], Paint::Haze),
        block(Vec3::new(26.3, -6.0, 15.95), Vec3::new(11.2, 6.0, 16.15), Paint::DeckGrey),
    ]);
    posts
}

/// Funnel with its black top.
pub(crate) fn funnel() -> Vec<Solid> {
    let low = [
        (-17.0, -2.6),
        (-15.8, -3.4),
        (-8.2, -3.4),
        (-7.0, -2.4),
        (-7.0, 2.4),
        (-8.2, 3.4),
        (-15.8, 3.4),
        (-17.0, 2.6),
    ];
    let high = low.map(|(x, y): (f32, f32)| (-11.9 + (x + 12.0) * 0.78, y * 0.72));
    let cap = low.map(|(x, y): (f32, f32)| (-11.9 + (x + 12.0) * 0.70, y * 0.62));
    let mut solids = vec![
        prism(&low, 11.4, &high, 17.2, Paint::Haze).paint_above(16.0, Paint::BootTop),
        prism(&cap, 17.2, &cap, 17.7, Paint::BootTop),
    ];
    for x in [-13.6, -10.2] {
        for y in [-0.9, 0.9] {
            solids.push(drum(Vec3::new(x, y, 17.5), 0.55, 1.1, 8, Paint::BootTop));
        }
    }
    for side in [1.0, -1.0] {
        // Intake louvres.
        let at = Vec3::new(-12.0, side * 3.1, 12.4);
        solids.push(block(at - Vec3::new(2.4, 0.15, 0.0), at + Vec3::new(2.4, 0.15, 1.5), Paint::DeckGrey));
    }
    solids
}

/// Main mast with radar, after mast with its dome, aerials.
pub(crate) fn masts() -> Vec<Solid> {
    let octagon = |x: f32, r: f32| {
        (0..8)
            .map(|k| {
                let (s, c) = ((k as f32 + 0.5) / 8.0 * std::f32::consts::TAU).sin_cos();
                (x + r * c, r * s)
            })
            .collect::<Vec<_>>()
    };
    let mut solids = vec![
        prism(&octagon(15.0, 3.4), 16.0, &octagon(14.6, 1.9), 25.0, Paint::Haze),
        prism(&octagon(14.6, 2.2), 25.0, &octagon(14.6, 2.2), 25.5, Paint::Haze),
        house([13.4, 15.8], 2.1, [25.9, 28.7], [0.5, 0.5, 0.3], Paint::DeckGrey),
        drum(Vec3::new(14.6, 0.0, 25.4), 0.9, 0.6, 8, Paint::Haze),
        pipe(&[(Vec3::new(14.6, 0.0, 28.6), 0.34), (Vec3::new(14.6, 0.0, 36.0), 0.14)], 6, Paint::Haze),
        bar(Vec3::new(14.6, -3.2, 31.6), Vec3::new(14.6, 3.2, 31.6), 0.12, Paint::Haze),
        bar(Vec3::new(14.6, -2.0, 33.4), Vec3::new(14.6, 2.0, 33.4), 0.10, Paint::Haze),
        drum(Vec3::new(14.6, 0.0, 35.9), 0.45, 0.7, 8, Paint::White),
        // After mast.
        house([-29.5, -25.5], 1.9, [11.5, 15.8], [0.7, 0.7, 0.6], Paint::Haze),
        ellipsoid(Vec3::new(-27.5, 0.0, 17.2), Vec3::splat(1.75), 12, 6, Paint::White),
        bar(Vec3::new(-21.2, 0.0, 11.4), Vec3::new(-21.2, 0.0, 22.5), 0.14, Paint::Haze),
        bar(Vec3::new(-21.2, -1.8, 20.4), Vec3::new(-21.2, 1.8, 20.4), 0.08, Paint::Haze),
        // Navigation radar on the bridge, and the fire-control director.
        block(Vec3::new(22.3, -1.5, 17.3), Vec3::new(22.6, 1.5, 17.6), Paint::White),
        drum(Vec3::new(22.45, 0.0, 16.0), 0.25, 1.3, 6, Paint::Haze),
        ellipsoid(Vec3::new(19.4, 0.0, 17.6), Vec3::new(1.15, 1.15, 1.2), 10, 5, Paint::Haze),
        drum(Vec3::new(19.4, 0.0, 16.0), 0.8, 1.0, 8, Paint::Haze),
    ];
    for side in [1.0, -1.0] {
        for (x, z) in [(19.0, 15.5), (15.2, 21.5)] {
            solids.push(ellipsoid(
                Vec3::new(x, side * (4.2 + (18.0 - x).max(0.0) * -0.55), z + 1.2),
                Vec3::splat(0.75),
                8,
                5,
                Paint::White,
            ));
        }
        let spar = Vec3::new(14.8, side * 2.0, 22.4);
        solids.push(bar(spar, spar + Vec3::new(0.0, side * 2.6, 0.3), 0.14, Paint::Haze));
        solids.push(bar(
            Vec3::new(9.0, side * 4.8, 12.4),
            Vec3::new(8.2, side * 5.8, 21.0),
            0.07,
            Paint::White,
        ));
        solids.push(bar(
            Vec3::new(-34.0, side * 5.6, 11.6),
            Vec3::new(-35.0, side * 6.4, 19.5),
            0.07,
            Paint::White,
        ));
    }
    solids
}

/// Gun, missile cells, close-in weapon.
pub(crate) fn weapons() -> Vec<Solid> {
    let turret_low = [
        (42.6, -1.5),
        (43.6, -1.9),
        (46.2, -1.5),
        (47.2, -0.7),
        (47.2, 0.7),
        (46.2, 1.5),
        (43.6, 1.9),
        (42.6, 1.5),
    ];
    let turret_high = turret_low.map(|(x, y): (f32, f32)| (44.2 + (x - 44.6) * 0.50, y * 0.50));
    let barrel = [
        (Vec3::new(46.0, 0.0, 9.7), 0.30),
        (Vec3::new(47.6, 0.0, 9.95), 0.22),
        (Vec3::new(52.4, 0.0, 10.6), 0.13),
    ];
    let mut solids = vec![
        drum(Vec3::new(44.7, 0.0, 7.7), 2.1, 0.6, 14, Paint::Haze),
        prism(&turret_low, 8.3, &turret_high, 10.8, Paint::Haze),
        pipe(&barrel, 8, Paint::DeckGrey),
        house([32.5, 39.0], 3.1, [6.8, 8.7], [0.1, 0.1, 0.1], Paint::Haze),
        // Breakwater.
        skin(
            &[
                vec![
                    Vec3::new(41.0, -4.6, 7.5),
                    Vec3::new(41.2, -4.6, 7.5),
                    Vec3::new(41.2, -4.6, 8.8),
                    Vec3::new(41.0, -4.6, 8.8),
                ],
                vec![
                    Vec3::new(42.3, 0.0, 7.7),
                    Vec3::new(42.5, 0.0, 7.7),
                    Vec3::new(42.5, 0.0, 8.8),
                    Vec3::new(42.3, 0.0, 8.8),
                ],
                vec![
                    Vec3::new(41.0, 4.6, 7.5),
                    Vec3::new(41.2, 4.6, 7.5),
                    Vec3::new(41.2, 4.6, 8.8),
                    Vec3::new(41.0, 4.6, 8.8),
                ],
            ],
            Paint::Haze,
            25.0,
        ),
        // Close-in weapon on the hangar.
        drum(Vec3::new(-33.5, 0.0, 11.5), 1.1, 0.9, 10, Paint::Haze),
        ellipsoid(Vec3::new(-33.5, 0.0, 13.6), Vec3::new(0.85, 0.85, 1.5), 10, 5, Paint::White),
        bar(Vec3::new(-34.2, 0.0, 12.9), Vec3::new(-36.0, 0.0, 13.2), 0.16, Paint::BootTop),
        // Anchor windlass, jackstaff, ensign staff with an ensign.
        drum(Vec3::new(55.5, -0.8, 8.8), 0.5, 0.7, 8, Paint::DeckGrey),
        drum(Vec3::new(55.5, 0.8, 8.8), 0.5, 0.7, 8, Paint::DeckGrey),
        bar(Vec3::new(64.2, 0.0, 9.6), Vec3::new(64.6, 0.0, 12.2), 0.06, Paint::Haze),
        bar(Vec3::new(-64.3, 0.0, 5.6), Vec3::new(-65.3, 0.0, 9.8), 0.07, Paint::Haze),
    ];
    for row in 0..4 {
        for side in [1.0, -1.0] {
            let at = Vec3::new(33.3 + 1.4 * row as f32, side * 1.35, 8.7);
            solids.push(block(
                at - Vec3::new(0.5, 1.0, 0.05),
                at + Vec3::new(0.5, 1.0, 0.06),
                Paint::DeckGrey,
            ));
        }
    }
    solids
}

/// Marks on the flight deck and the nets folded down along its edges.
pub(crate) fn flight_deck() -> Vec<Solid> {
    let z = 5.64;
    let line = |a: (f32, f32), b: (f32, f32)| {
        block(Vec3::new(a.0, a.1, z), Vec3::new(b.0, b.1, z + 0.06), Paint::Marking)
    };
    let mut solids = vec![
        line((-60.5, -0.15), (-39.5, 0.15)),
        line((-60.5, -6.0), (-60.1, 6.0)),
        line((-60.5, -6.0), (-39.5, -5.75)),
        line((-60.5, 5.75), (-39.5, 6.0)),
        line((-51.0, -2.6), (-50.6, 2.6)),
    ];
    for side in [1.0, -1.0] {
        for k in 0..4 {
            let x = -61.0 + 5.5 * k as f32;
            let y = side * (6.95 + 0.014 * (x + 61.0));
            let net = block(Vec3::new(x, y, 5.25), Vec3::new(x + 5.0, y + side * 1.0, 5.33), Paint::DeckGrey);
            solids.push(net);
        }
    }
    solids
}
