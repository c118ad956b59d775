//! Where the boats of a group stand about its middle.

use glam::DVec2;
use rand::RngExt;
use rand_pcg::Pcg64;

use crate::geometry::{ahead, starboard};

/// How a group of boats stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Formation {
    /// Side by side.
    Abreast,
    /// One behind the other.
    Column,
    /// A V with its point ahead.
    Wedge,
    /// By chance, none closer to another than the spacing.
    Scattered,
}

impl Formation {
    /// The names used in scenarios.
    pub const NAMES: [(&'static str, Self); 4] = [
        ("abreast", Self::Abreast),
        ("column", Self::Column),
        ("wedge", Self::Wedge),
        ("scattered", Self::Scattered),
    ];
}

/// How many of `count` boats are in part `part` of `parts`: as even as it goes.
pub(super) const fn share(count: u32, parts: u32, part: u32) -> u32 {
    count / parts + (part < count % parts) as u32
}

/// Places of `count` boats from the group's middle, world x and y, metres, for a group that heads along `heading`.
pub(super) fn places(
    formation: Formation,
    count: u32,
    spacing_m: f64,
    heading: f64,
    seed: u64,
) -> Vec<DVec2> {
    let (forward, right) = (ahead(heading), starboard(heading));
    let middle = 0.5 * f64::from(count.saturating_sub(1));
    match formation {
        Formation::Abreast => (0..count).map(|i| right * ((f64::from(i) - middle) * spacing_m)).collect(),
        Formation::Column => (0..count).map(|i| forward * ((middle - f64::from(i)) * spacing_m)).collect(),
        Formation::Wedge => (0..count)
            .map(|i| {
                // The first is the point, then one to port and one to starboard of it by turns.
                let row = f64::from(i.div_ceil(2));
                let side = if i % 2 == 0 { 1.0 } else { -1.0 };
                (right * (side * row) - forward * row) * (spacing_m / std::f64::consts::SQRT_2)
            })
            .collect(),
        Formation::Scattered => scattered(count, spacing_m, seed),
    }
}

/// Points in a disc that is wide enough for all, thrown until none is too close.
fn scattered(count: u32, spacing_m: f64, seed: u64) -> Vec<DVec2> {
    let mut random = Pcg64::new(u128::from(seed), 0x5ca7);
    let mut radius_m = spacing_m * f64::from(count).sqrt();
    let mut places: Vec<DVec2> = Vec::with_capacity(count as usize);
    while places.len() < count as usize {
        let mut unit = || 2.0 * random.random::<f64>() - 1.0;
        let thrown = DVec2::new(unit(), unit()) * radius_m;
        let far = places.iter().all(|p| p.distance(thrown) >= spacing_m);
        if thrown.length() <= radius_m && far {
            places.push(thrown);
        } else {
            // Room for the next comes sooner or later.
            radius_m *= 1.01;
        }
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boats_of_a_group_stand_apart_and_about_its_middle() {
        for (name, formation) in Formation::NAMES {
            for count in [1, 2, 5, 40] {
                let places = places(formation, count, 30.0, 0.7, 9);
                assert_eq!(places.len(), count as usize, "{name}");
                for (i, a) in places.iter().enumerate() {
                    assert!(places[..i].iter().all(|b| a.distance(*b) > 29.99), "{name}: {places:?}");
                }
            }
        }
        let wedge = places(Formation::Wedge, 3, 30.0, 0.0, 9);
        assert_eq!(wedge[0], DVec2::ZERO);
        assert!(wedge[1].x < 0.0 && wedge[2].x > 0.0 && wedge[1].y < 0.0, "{wedge:?}");
        let column = places(Formation::Column, 3, 30.0, 0.0, 9);
        assert!((column[0] - DVec2::new(0.0, 30.0)).length() < 1e-9, "the first leads");
    }
}
