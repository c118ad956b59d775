//! Dark quadrilaterals: what may be a tag.

use glam::DVec2;

use super::picture::Plane;

/// Four corners in pixels, counter-clockwise as seen (y down), as a tag's are counted.
pub(super) type Quad = [DVec2; 4];

/// Side of the tiles whose darkest and brightest pixels decide what is dark, pixels.
const TILE: usize = 8;
/// Least difference of these, codes: less is noise.
const CONTRAST: f32 = 10.0;
/// Where between dark and bright the limit lies. At a tag's corner dark meets dark at half of the way and only there: limits below part
/// them, the lower one also where a slanted view makes the dark angles wide.
const LIMITS: [f32; 2] = [0.42, 0.25];
/// Least side of a quadrilateral, pixels: a module of less than one cannot be read.
const SIDE_MIN: f64 = 9.0;
/// Most candidates of one picture and limit, the largest first: a picture of noise has tens of thousands.
const CANDIDATES: usize = 2000;
/// Most corners of a hull that are kept.
const HULL: usize = 24;

/// Darkest and brightest value around each tile.
struct Tiles {
    across: usize,
    extremes: Vec<[f32; 2]>,
}

impl Tiles {
    fn new(plane: &Plane) -> Self {
        let (across, down) = (plane.width.div_ceil(TILE), plane.height.div_ceil(TILE));
        let mut own = vec![[f32::MAX, f32::MIN]; across * down];
        for (y, row) in plane.values.chunks_exact(plane.width).enumerate() {
            let tiles = &mut own[y / TILE * across..][..across];
            for (tile, values) in tiles.iter_mut().zip(row.chunks(TILE)) {
                for v in values {
                    *tile = [tile[0].min(*v), tile[1].max(*v)];
                }
            }
        }
        let around = |i: usize| {
            let (x, y) = (i % across, i / across);
            let mut all = [f32::MAX, f32::MIN];
            for ny in y.saturating_sub(1)..(y + 2).min(down) {
                for tile in &own[ny * across + x.saturating_sub(1)..ny * across + (x + 2).min(across)] {
                    all = [all[0].min(tile[0]), all[1].max(tile[1])];
                }
            }
            all
        };
        Self { across, extremes: (0..own.len()).map(around).collect() }
    }

    /// Brightness below which a pixel is dark.
    fn limit(&self, x: usize, y: usize, share: f32) -> f32 {
        let [dark, bright] = self.extremes[y / TILE * self.across + x / TILE];
        if bright - dark < CONTRAST { f32::MIN } else { dark + share * (bright - dark) }
    }
}

/// Dark pixels side by side in one row: row, first, beyond the last.
type EdgeRun = (usize, usize, usize);

fn runs(plane: &Plane, tiles: &Tiles, share: f32) -> Vec<EdgeRun> {
    let mut runs = Vec::new();
    for (y, row) in plane.values.chunks_exact(plane.width).enumerate() {
        let mut first = None;
        for x in 0..=plane.width {
            let dark = row.get(x).is_some_and(|v| *v < tiles.limit(x, y, share));
            match (dark, first) {
                (true, None) => first = Some(x),
                (false, Some(from)) => {
                    runs.push((y, from, x));
                    first = None;
                }
                _ => {}
            }
        }
    }
    runs
}

fn root(parents: &mut [usize], mut i: usize) -> usize {
    while parents[i] != i {
        parents[i] = parents[parents[i]];
        i = parents[i];
    }
    i
}

/// Runs that hang together side by side (not across corners), each with all others of its piece, from above to below.
fn pieces(runs: &[EdgeRun]) -> Vec<Vec<EdgeRun>> {
    let mut parents: Vec<usize> = (0..runs.len()).collect();
    let mut above = 0;
    for (i, (y, from, to)) in runs.iter().copied().enumerate() {
        while runs[above].0 + 1 < y || (runs[above].0 + 1 == y && runs[above].2 <= from) {
            above += 1;
        }
        let mut k = above;
        while k < i && runs[k].0 + 1 == y && runs[k].1 < to {
            let (a, b) = (root(&mut parents, k), root(&mut parents, i));
            parents[a.max(b)] = a.min(b);
            k += 1;
        }
    }
    // Roots come before what hangs on them.
    let mut number = vec![usize::MAX; runs.len()];
    let mut pieces: Vec<Vec<EdgeRun>> = Vec::new();
    for (i, run) in runs.iter().enumerate() {
        let r = root(&mut parents, i);
        if number[r] == usize::MAX {
            number[r] = pieces.len();
            pieces.push(Vec::new());
        }
        pieces[number[r]].push(*run);
    }
    pieces
}

fn cross(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

/// Convex hull of a piece (Andrew 1979), its sharpest corners only.
fn hull(piece: &[EdgeRun]) -> Vec<DVec2> {
    // Points sorted by y: the left ends of the rows bound one side, the right ends the other.
    let chain = |left: bool| {
        let mut chain: Vec<DVec2> = Vec::new();
        for row in piece.chunk_by(|a, b| a.0 == b.0) {
            let x = if left { row.iter().map(|r| r.1).min() } else { row.iter().map(|r| r.2).max() };
            let (x, y) = (x.unwrap_or(0) as f64, row[0].0 as f64);
            for p in [DVec2::new(x, y), DVec2::new(x, y + 1.0)] {
                let outward =
                    |a: DVec2, b: DVec2| if left { cross(a, b, p) >= 0.0 } else { cross(a, b, p) <= 0.0 };
                while let [.., a, b] = chain[..] {
                    if !outward(a, b) {
                        break;
                    }
                    chain.pop();
                }
                chain.push(p);
            }
        }
        chain
    };
    // Down the left side and up the right one: counter-clockwise as seen.
    let mut hull = chain(true);
    hull.extend(chain(false).into_iter().rev());
    hull.dedup();
    while hull.len() > HULL {
        let n = hull.len();
        let loss = |i: usize| cross(hull[(i + n - 1) % n], hull[i], hull[(i + 1) % n]).abs();
        let Some(least) = (0..n).min_by(|a, b| loss(*a).total_cmp(&loss(*b))) else { break };
        hull.remove(least);
    }
    hull
}

fn area(corners: &[DVec2]) -> f64 {
    let next = corners.iter().cycle().skip(1);
    0.5 * corners.iter().zip(next).map(|(a, b)| a.perp_dot(*b)).sum::<f64>()
}

/// The largest quadrilateral on a hull, where it is nearly all of it.
fn quad(hull: &[DVec2]) -> Option<Quad> {
    let n = hull.len();
    let whole = area(hull).abs();
    if n < 4 || whole < SIDE_MIN * SIDE_MIN {
        return None;
    }
    // For every diagonal the farthest corner to either side.
    let farthest = |a: usize, b: usize, from: usize, to: usize| {
        let off = |i: &usize| cross(hull[a], hull[b], hull[*i % n]).abs();
        (from..to).max_by(|x, y| off(x).total_cmp(&off(y))).map(|i| (i % n, off(&i)))
    };
    let mut best = (0.0, [0; 4]);
    for a in 0..n {
        for b in a + 2..n {
            let (Some((c, one)), Some((d, other))) = (farthest(a, b, a + 1, b), farthest(a, b, b + 1, a + n))
            else {
                continue;
            };
            if one + other > best.0 {
                best = (one + other, [a, c, b, d]);
            }
        }
    }
    let quad = best.1.map(|i| hull[i]);
    let long = |i: usize| quad[i].distance(quad[(i + 1) % 4]) >= SIDE_MIN;
    (0.5 * best.0 > 0.88 * whole && (0..4).all(long)).then_some(quad)
}

/// All dark quadrilaterals, corners a pixel or two within the true ones.
pub(super) fn find(plane: &Plane) -> Vec<Quad> {
    if plane.width < 2 * TILE || plane.height < 2 * TILE {
        return Vec::new();
    }
    let tiles = Tiles::new(plane);
    let mut quads = Vec::new();
    for share in LIMITS {
        let mut pieces = pieces(&runs(plane, &tiles, share));
        let tall = |p: &Vec<EdgeRun>| p.last().map_or(0, |r| r.0 + 1) - p.first().map_or(0, |r| r.0);
        pieces.retain(|p| tall(p) as f64 >= SIDE_MIN);
        pieces.sort_by_key(|p| std::cmp::Reverse(p.len()));
        quads.extend(pieces.iter().take(CANDIDATES).filter_map(|p| quad(&hull(p))));
    }
    quads
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_slanted_square_is_found_and_a_round_one_is_not() {
        let corners = [(20.0, 30.0), (35.0, 90.0), (100.0, 80.0), (90.0, 15.0)].map(DVec2::from);
        let inside = |p: DVec2| (0..4).all(|i| cross(corners[i], corners[(i + 1) % 4], p) < 0.0);
        let draw = |dark: &dyn Fn(DVec2) -> bool| {
            let at = |i: usize| DVec2::new((i % 128) as f64 + 0.5, (i / 128) as f64 + 0.5);
            let values = (0..128 * 112).map(|i| if dark(at(i)) { 20.0 } else { 200.0 }).collect();
            find(&Plane { width: 128, height: 112, values })
        };
        let found = draw(&inside);
        assert!(!found.is_empty());
        for corner in corners {
            assert!(found[0].iter().any(|f| f.distance(corner) < 2.0), "{found:?}");
        }
        assert!(area(&found[0]) < 0.0, "{found:?}");
        assert!(draw(&|p| p.distance(DVec2::splat(60.0)) < 40.0).is_empty());
    }

    /// Pieces by flooding.
    fn flooded(dark: &[bool], width: usize) -> usize {
        let mut left: Vec<bool> = dark.to_vec();
        let mut count = 0;
        while let Some(first) = left.iter().position(|d| *d) {
            let mut open = vec![first];
            count += 1;
            while let Some(i) = open.pop() {
                if !std::mem::replace(&mut left[i], false) {
                    continue;
                }
                let beside = [
                    (i % width > 0).then(|| i - 1),
                    (i % width + 1 < width).then_some(i + 1),
                    i.checked_sub(width),
                    Some(i + width).filter(|i| *i < dark.len()),
                ];
                open.extend(beside.into_iter().flatten().filter(|i| left[*i]));
            }
        }
        count
    }

    proptest! {
        #[test]
        fn pieces_are_those_of_flooding(dark in prop::collection::vec(any::<bool>(), 24 * 17)) {
            let values = dark.iter().map(|d| if *d { 0.0 } else { 255.0 }).collect();
            let plane = Plane { width: 24, height: 17, values };
            let runs = runs(&plane, &Tiles::new(&plane), 0.4);
            prop_assert_eq!(runs.iter().map(|r| r.2 - r.1).sum::<usize>(), dark.iter().filter(|d| **d).count());
            let pieces = pieces(&runs);
            prop_assert_eq!(pieces.len(), flooded(&dark, 24));
            prop_assert_eq!(pieces.iter().map(Vec::len).sum::<usize>(), runs.len());
            for piece in &pieces {
                let hull = hull(piece);
                let turns = |i: usize| cross(hull[i], hull[(i + 1) % hull.len()], hull[(i + 2) % hull.len()]);
                prop_assert!((0..hull.len()).all(|i| turns(i) <= 0.0), "{hull:?}");
                if let Some(quad) = quad(&hull) {
                    prop_assert!(area(&quad) < 0.0);
                }
            }
        }
    }
}
