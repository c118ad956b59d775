//! Outlines of a model in the picture: a mesh of a part of the gun, seen through the calibrated lens.
//!
//! The model is only needed here. Parts of the gun keep their place in the picture, so that the trainer draws by the outline alone.

use bowwave_core::{geometry::Lens, own_ship::Phantom};
use glam::{DVec2, DVec3};

use super::{
    CORNERS_MOST, FoundOutlines, ROUNDED, area, contour::closed_contours, contour::simplified, cover::cover,
};

/// Outlines follow the model to this many pixels, or with the most corners that a calibration takes.
const DETAIL_PX: f64 = 0.05;
/// Smallest area of an outline or of an opening in it, squared pixels: what is smaller hides nothing that anybody sees.
const AREA_LEAST_PX: f64 = 9.0;

/// Outlines of the triangles of one part, corners in the camera's space, metres. Where a part is seen as several pieces, each has its number
/// behind its name. Openings through which the sea is seen are counted, and covered.
pub fn outlines_of(
    lens: &Lens,
    name: &str,
    triangles: impl IntoIterator<Item = [DVec3; 3]>,
) -> FoundOutlines {
    let mut found = FoundOutlines::default();
    let Some(cover) = cover(lens, triangles) else { return found };
    let size = DVec2::new(f64::from(lens.width), f64::from(lens.height));
    let picture = size.element_product();
    let mut contours: Vec<_> = closed_contours(&cover.free, cover.size, 0.5)
        .into_iter()
        .map(|contour| contour.into_iter().map(|p| cover.low + p / cover.scale).collect::<Vec<_>>())
        .map(|contour| (area(&contour), contour))
        .filter(|(area, _)| area.abs() >= AREA_LEAST_PX)
        .collect();
    contours.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (area, contour) in contours {
        if area < 0.0 {
            found.openings.push(-area / picture);
            continue;
        }
        let corners = sharpened(&contour, &simplified(&contour, DETAIL_PX, CORNERS_MOST), 1.0 / cover.scale);
        let outline = corners.into_iter().map(|p| (p.clamp(DVec2::ZERO, size) * ROUNDED).round() / ROUNDED);
        let outline = outline.collect();
        let number = found.phantoms.len() + 1;
        let name = if number == 1 { name.to_owned() } else { format!("{name} {number}").trim().to_owned() };
        found.phantoms.push(Phantom::new(name, outline, (lens.width, lens.height)));
    }
    found
}

/// Corners where the lines meet that the contour follows between them: a grid of cells cuts a corner off by some of a cell, and chords lie within
/// what is round. `cell` is a cell's side, pixels.
fn sharpened(contour: &[DVec2], corners: &[DVec2], cell: f64) -> Vec<DVec2> {
    /// So far from a side's ends the cells know of the next side.
    const ENDS: f64 = 1.5;
    /// Fewest places of a line.
    const PLACES_LEAST: usize = 4;
    /// Most that the nearest corner may move, and distance from there within which corners are one, cells.
    const MOVED_MOST: f64 = 1.5;
    const CUT_MOST: f64 = 4.0;
    /// Lines that meet at less than this do not tell where, sine.
    const MEET_LEAST: f64 = 0.02;
    let (count, all) = (corners.len(), contour.len());
    // Corners are places of the contour, in its order.
    let Some(begin) = corners.first().and_then(|c| contour.iter().position(|p| p == c)) else {
        return corners.to_vec();
    };
    let mut at = begin;
    let mut lines = Vec::with_capacity(count);
    for (i, from) in corners.iter().enumerate() {
        let to = corners[(i + 1) % count];
        let mut places = Vec::new();
        for _ in 0..all {
            at = (at + 1) % all;
            if contour[at] == to {
                break;
            }
            places.push(contour[at]);
        }
        places.retain(|p| p.distance(*from).min(p.distance(to)) > ENDS * cell);
        lines.push((places.len() >= PLACES_LEAST).then(|| fitted(&places)));
    }
    // From line to line: between two of them lies a corner, or what the grid made of it.
    let Some(first) = lines.iter().position(Option::is_some) else { return corners.to_vec() };
    let mut sharp = Vec::with_capacity(count);
    let mut before = first;
    while before < first + count {
        let after =
            (before + 1..=first + count).find(|i| lines[i % count].is_some()).unwrap_or(first + count);
        let between = (before + 1..=after).map(|i| corners[i % count]);
        let meet = lines[before % count].zip(lines[after % count]).and_then(|((a, along), (b, other))| {
            let sine = along.perp_dot(other);
            let place = a + along * ((b - a).perp_dot(other) / sine);
            let off = between.clone().map(|corner| place.distance(corner) / cell);
            let [nearest, farthest] = off.fold([f64::INFINITY, 0.0], |[n, f], off| [n.min(off), f.max(off)]);
            let is_near = nearest < MOVED_MOST && farthest < CUT_MOST;
            (sine.abs() > MEET_LEAST && is_near).then_some(place)
        });
        match meet {
            Some(place) => sharp.push(place),
            None => sharp.extend(between),
        }
        before = after;
    }
    sharp
}

/// The line of least squares through places: a place on it and its direction.
fn fitted(places: &[DVec2]) -> (DVec2, DVec2) {
    let middle = places.iter().sum::<DVec2>() / places.len() as f64;
    let (mut across, mut both) = (0.0, 0.0);
    for off in places.iter().map(|p| *p - middle) {
        across += off.x * off.x - off.y * off.y;
        both += 2.0 * off.x * off.y;
    }
    (middle, DVec2::from_angle(0.5 * both.atan2(across)))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use bowwave_core::geometry::Distortion;
    use glam::{DQuat, DVec2};
    use proptest::prelude::*;

    use super::*;

    /// A box by its middle, half its sides and its turn.
    #[derive(Clone, Copy, Debug)]
    struct Block {
        middle: DVec3,
        half: DVec3,
        turn: DQuat,
    }

    impl Block {
        fn triangles(&self) -> Vec<[DVec3; 3]> {
            let corner = |i: usize| {
                let sign = |bit: usize| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
                self.middle + self.turn * (self.half * DVec3::new(sign(0), sign(1), sign(2)))
            };
            [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
                .into_iter()
                .flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]])
                .map(|t| t.map(corner))
                .collect()
        }

        /// Tests whether a ray from the camera meets it (Kay and Kajiya 1986), farther than the near plane.
        fn is_met(&self, ray: DVec3) -> bool {
            let (from, along) = (self.turn.inverse() * -self.middle, self.turn.inverse() * ray);
            let (a, b) = ((-self.half - from) / along, (self.half - from) / along);
            let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
            enter <= leave && leave > 0.0
        }
    }

    /// Pixels of a coarse grid in which outlines and rays disagree, but for places so near to an edge.
    fn disagree(
        lens: &Lens,
        found: &FoundOutlines,
        near_px: f64,
        is_met: impl Fn(DVec3) -> bool,
    ) -> Vec<DVec2> {
        let mut off = Vec::new();
        for y in 0..lens.height / 4 {
            for x in 0..lens.width / 4 {
                let place = 4.0 * DVec2::new(f64::from(x), f64::from(y)) + DVec2::new(2.3, 1.7);
                let distance = found.phantoms.iter().map(|p| p.distance(place)).fold(f64::INFINITY, f64::min);
                if (distance < 0.0) != is_met(lens.unproject(place)) && distance.abs() > near_px {
                    off.push(place);
                }
            }
        }
        off
    }

    fn bent() -> Lens {
        let distortion = Distortion::radial_tangential(DVec2::new(-0.25, 0.06), DVec2::new(1e-3, -5e-4));
        Lens { distortion, ..Lens::pinhole(640, 360, 1.2) }
    }

    /// Distances of outlines from places that are known to lie on edges, pixels.
    fn rms(found: &FoundOutlines, edge: impl Iterator<Item = DVec2>) -> f64 {
        let squares: Vec<f64> = edge
            .map(|at| {
                found.phantoms.iter().map(|p| p.distance(at).abs()).fold(f64::INFINITY, f64::min).powi(2)
            })
            .collect();
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    }

    #[test]
    fn a_plate_is_outlined_where_its_sides_fall_through_the_lens() {
        let lens = bent();
        let corners = [[-0.3, -0.2], [0.35, -0.1], [0.25, 0.22], [-0.2, 0.18]];
        let corners = corners.map(|[x, y]| DVec3::new(x, y, 1.1 + 0.3 * x));
        let triangles = [[corners[0], corners[1], corners[2]], [corners[0], corners[2], corners[3]]];
        let found = outlines_of(&lens, "shield", triangles);
        assert_eq!((found.phantoms.len(), &*found.phantoms[0].name), (1, "shield"));
        let side = |i: usize| {
            let (a, b) = (corners[i], corners[(i + 1) % 4]);
            (0..=200).filter_map(move |k| lens.project(a.lerp(b, f64::from(k) / 200.0)))
        };
        let off = rms(&found, (0..4).flat_map(side));
        assert!(off < 0.04, "{off} px rms");
        for corner in corners.map(|corner| lens.project(corner).unwrap()) {
            let nearest = found.phantoms[0].outline().iter().map(|p| p.distance(corner)).fold(9.0, f64::min);
            assert!(nearest < 0.07, "{nearest} px from the corner at {corner}");
        }
    }

    /// A tube's mantle and caps, along z, of so many facets.
    fn tube(radius: f64, from: f64, to: f64, below: f64, facets: u32) -> Vec<[DVec3; 3]> {
        let at = |i: u32, z: f64| {
            let angle = TAU * f64::from(i % facets) / f64::from(facets);
            DVec3::new(radius * angle.cos(), below + radius * angle.sin(), z)
        };
        let middle = |z: f64| DVec3::new(0.0, below, z);
        (0..facets)
            .flat_map(|i| {
                let [a, b, c, d] = [at(i, from), at(i + 1, from), at(i + 1, to), at(i, to)];
                [[a, b, c], [a, c, d], [a, b, middle(from)], [d, c, middle(to)]]
            })
            .collect()
    }

    #[test]
    fn a_barrel_from_behind_the_camera_ends_at_its_muzzle_and_the_picture() {
        let lens = bent();
        let (radius, below, muzzle) = (0.03, 0.12, 0.9);
        let found = outlines_of(&lens, "barrel", tube(radius, -0.5, muzzle, below, 512));
        assert_eq!(found.phantoms.len(), 1);
        // A ray meets it within its length: a quadratic in the distance, and the muzzle's disc.
        let is_met = |ray: DVec3| {
            let flat = ray.truncate();
            let (a, b) = (flat.length_squared(), flat.y * below);
            let root = b * b - a * (below * below - radius * radius);
            let hits = |t: f64| t > 0.0 && t * ray.z <= muzzle && t * ray.z >= 0.0;
            let at_muzzle = flat * (muzzle / ray.z) - DVec2::new(0.0, below);
            (root >= 0.0 && (hits((b - root.sqrt()) / a) || hits((b + root.sqrt()) / a)))
                || at_muzzle.length() < radius
        };
        assert_eq!(disagree(&lens, &found, 0.12, is_met), []);
        let [low, high] = found.phantoms[0].bounds();
        assert!(high.y == 360.0 && low.y > 180.0, "{low} {high}");
    }

    #[test]
    fn the_edge_of_a_tube_is_found_to_a_twentieth_of_a_pixel() {
        // Seen from outside, both ends in the picture: the hull of two circles.
        let lens = Lens::pinhole(1280, 720, 1.0);
        let (radius, below) = (0.05, 0.15);
        let found = outlines_of(&lens, "tube", tube(radius, 0.8, 2.0, below, 720));
        let circle = |z: f64| {
            (0..2000).map(move |i| {
                let angle = TAU * f64::from(i) / 2000.0;
                DVec3::new(radius * angle.cos(), below + radius * angle.sin(), z)
            })
        };
        let places: Vec<DVec2> = circle(0.8).chain(circle(2.0)).filter_map(|p| lens.project(p)).collect();
        let hull = hull(places);
        let sides = hull.iter().zip(hull.iter().cycle().skip(1));
        let edge = sides.flat_map(|(a, b)| {
            let steps = (2.0 * a.distance(*b)).ceil().max(1.0) as u32;
            (0..steps).map(move |i| a.lerp(*b, f64::from(i) / f64::from(steps)))
        });
        let off = rms(&found, edge);
        assert!(off < 0.05, "{off} px rms");
    }

    /// The convex hull (Andrew 1979).
    fn hull(mut places: Vec<DVec2>) -> Vec<DVec2> {
        places.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
        let chain = |places: &mut dyn Iterator<Item = DVec2>| {
            let mut chain: Vec<DVec2> = Vec::new();
            for p in places {
                while let [.., a, b] = chain[..]
                    && (b - a).perp_dot(p - b) <= 0.0
                {
                    chain.pop();
                }
                chain.push(p);
            }
            chain.pop();
            chain
        };
        let mut hull = chain(&mut places.iter().copied());
        hull.extend(chain(&mut places.iter().rev().copied()));
        hull
    }

    #[test]
    fn openings_are_told_and_pieces_are_numbered() {
        let lens = Lens::pinhole(640, 360, 1.0);
        // A ring before the camera: its middle lets the sea through.
        let ring = |i: u32, r: f64| {
            let angle = TAU * f64::from(i % 64) / 64.0;
            DVec3::new(r * angle.cos(), r * angle.sin(), 2.0)
        };
        let triangles: Vec<_> = (0..64)
            .flat_map(|i| {
                let [a, b, c, d] = [ring(i, 0.2), ring(i + 1, 0.2), ring(i + 1, 0.1), ring(i, 0.1)];
                [[a, b, c], [a, c, d]]
            })
            .collect();
        let found = outlines_of(&lens, "sight", triangles.clone());
        assert_eq!((found.phantoms.len(), found.openings.len()), (1, 1));
        let inside = std::f64::consts::PI * (0.1 / 2.0 * lens.focal.x).powi(2) / (640.0 * 360.0);
        assert!((found.openings[0] / inside - 1.0).abs() < 0.01, "{} {inside}", found.openings[0]);
        let beside = triangles.iter().map(|t| t.map(|p| p + DVec3::X * 0.6));
        let two = outlines_of(&lens, "sight", triangles.iter().copied().chain(beside));
        let names: Vec<_> = two.phantoms.iter().map(|p| &*p.name).collect();
        assert_eq!(names, ["sight", "sight 2"]);
        assert_eq!(
            outlines_of(&lens, "behind", triangles.iter().map(|t| t.map(|p| -p))),
            FoundOutlines::default()
        );
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        /// Boxes anywhere about the camera, also through its plane, by lenses of all kinds, against rays.
        #[test]
        fn outlines_and_rays_agree(
            middle in [-0.8..0.8f64, -0.6..0.6, -0.5..2.0], half in [0.02..0.4f64, 0.02..0.4, 0.02..0.8],
            axis in [-3.0..3.0f64, -3.0..3.0, -3.0..3.0], kind in 0..3usize,
        ) {
            let turn = DQuat::from_scaled_axis(DVec3::from(axis));
            let block = Block { middle: DVec3::from(middle), half: DVec3::from(half), turn };
            let lens = [
                Lens::pinhole(640, 360, 1.0),
                bent(),
                Lens::fisheye(640, 360, 200f64.to_radians(), [-0.01, 0.0, 0.0, 0.0]),
            ][kind];
            // What encloses the camera or cuts its near plane right before it covers all or nothing.
            prop_assume!((turn.inverse() * block.middle).abs().cmpgt(block.half + 0.01).any());
            let found = outlines_of(&lens, "box", block.triangles());
            let off = disagree(&lens, &found, 0.2, |ray| block.is_met(ray));
            prop_assert!(off.is_empty(), "{off:?} {found:?}");
        }
    }
}
