//! How far the barrel has recoiled in a picture.
//!
//! A barrel slides back along its bore, and the camera does not. In its picture all lines along the bore meet in the bore's vanishing point.
//! What slides back by `d` from a depth `z` moves away from that point by the factor `z / (z - d)`; edges along the bore stay on themselves.
//! So one number, the muzzle's factor, says where all of the barrel's outline is.
//!
//! It is found as the factor at which the outline parts pixels that look as the barrel does from pixels that do not (the region-based likelihood
//! of PWP3D, Prisacariu and Reid 2012, over the few pixels next to edges that the factor moves).

use glam::DVec2;

use crate::{
    event::{Picture, PixelFormat},
    own_ship::Phantoms,
};

/// Largest factor that is looked for: a muzzle .6 m from the camera that slides back by 50 mm.
pub const FACTOR_MAX: f64 = 1.09;
/// Factors tried move the outline's farthest point by this, pixels.
const STEP_PX: f64 = 0.5;
/// Pixels between places along an edge, and how many there are at most.
const SPACING_PX: f64 = 2.0;
const PLACES_MOST: usize = 200;
/// An edge is moved by the factor where its normal and the way from the vanishing point are no further apart than this cosine.
const ACROSS_LEAST: f64 = 0.4;
/// Pixels inside and outside of the outline that are looked at: its own one or two mix both.
const DEPTHS: [f64; 3] = [1.5, 2.5, 3.5];
/// A pixel that is off by more deviations than this is none of the barrel's, and how much more counts no more.
const OFF_MOST: f32 = 3.0;
/// Pictures in which the barrel is taken to rest, at the begin.
const REST: u32 = 10;
/// No stroke lasts so many pictures: a barrel that is not where it rests for longer looks otherwise than before, in other light.
const STROKE_MOST: u32 = 12;
/// An outline fits where so small a share of the pixels next to it speaks against it.
const FITS_MOST: f32 = 0.5;
/// Share of a new picture in what is known of the barrel's look.
const LEARNT: f32 = 0.1;
/// Smallest deviation of a barrel's pixel, codes.
const DEVIATION_LEAST: f32 = 4.0;
/// A factor above 1 is believed where so large a share of what speaks against rest goes.
const BETTER_LEAST: f32 = 0.25;

/// Finds the recoil of phantoms, picture by picture.
#[derive(Clone, Debug)]
pub struct RecoilFinder {
    about: DVec2,
    places: Vec<Place>,
    factors: Vec<f64>,
    /// Pictures by which the barrel's look is known.
    pictures: u32,
    /// Pictures since it was last at rest.
    away: u32,
    factor: f64,
}

/// A place on an edge at rest.
#[derive(Clone, Copy, Debug)]
struct Place {
    at: DVec2,
    /// Unit vector towards the inside.
    inwards: DVec2,
    /// Code and its squared deviation of the barrel's pixels at each of [`DEPTHS`].
    looks: [[f32; 2]; DEPTHS.len()],
}

impl RecoilFinder {
    /// For those of `phantoms` that recoil, on the camera's picture; `None` where nothing tells their recoil.
    pub fn new(Phantoms { parts, bore: about }: &Phantoms) -> Option<Self> {
        let (mut places, about) = (Vec::new(), *about);
        for (i, phantom) in parts.iter().enumerate().filter(|(_, phantom)| phantom.recoils) {
            let is_inside_another = |at: DVec2| {
                parts.iter().enumerate().any(|(j, other)| j != i && other.distance(at) < DEPTHS[1])
            };
            for (from, to) in phantom.edges() {
                let steps = (from.distance(to) / SPACING_PX) as usize;
                let across = (to - from).normalize_or_zero().perp();
                for step in 0..steps {
                    let at = from.lerp(to, (step as f64 + 0.5) / steps as f64);
                    let inwards = if phantom.distance(at + across) < 0.0 { across } else { -across };
                    let moves = inwards.dot((at - about).normalize_or_zero()).abs() >= ACROSS_LEAST;
                    if moves && !is_inside_another(at) {
                        places.push(Place { at, inwards, looks: [[0.0; 2]; DEPTHS.len()] });
                    }
                }
            }
        }
        let farthest = places.iter().map(|place| place.at.distance(about)).fold(0.0, f64::max);
        if places.is_empty() || farthest < 1.0 {
            return None;
        }
        let every = places.len().div_ceil(PLACES_MOST);
        let places = places.into_iter().step_by(every).collect();
        let steps = ((FACTOR_MAX - 1.0) * farthest / STEP_PX).ceil();
        let factors = (0..=steps as u32).map(|i| 1.0 + f64::from(i) * (FACTOR_MAX - 1.0) / steps).collect();
        Some(Self { about, places, factors, pictures: 0, away: 0, factor: 1.0 })
    }

    /// The factor in the newest picture, 1 at rest.
    pub const fn factor(&self) -> f64 {
        self.factor
    }

    /// Takes the next picture.
    pub fn observe(&mut self, picture: &Picture) {
        let (factor, fits) = if self.pictures < REST { (1.0, true) } else { self.find(picture) };
        let mut is_at_rest = factor == 1.0 && fits;
        self.factor = factor;
        self.away = if is_at_rest { 0 } else { self.away + 1 };
        if self.away > STROKE_MOST {
            (self.pictures, self.away, self.factor) = (0, 0, 1.0);
            is_at_rest = true;
        }
        if is_at_rest {
            let share = if self.pictures < REST { 1.0 / (self.pictures + 1) as f32 } else { LEARNT };
            self.learn(picture, share);
            self.pictures = self.pictures.saturating_add(1);
        }
    }

    fn learn(&mut self, picture: &Picture, share: f32) {
        for place in &mut self.places {
            for (depth, [code, squared]) in DEPTHS.into_iter().zip(&mut place.looks) {
                let off = code_at(picture, place.at + place.inwards * depth) - *code;
                *code += share * off;
                // The first picture knows of no deviation.
                *squared = if share < 1.0 { *squared + share * (off * off - *squared) } else { 0.0 };
            }
        }
    }

    /// The factor, and whether the outline then parts what looks like the barrel from what does not.
    fn find(&self, picture: &Picture) -> (f64, bool) {
        let costs: Vec<f32> = self.factors.iter().map(|factor| self.cost(picture, *factor)).collect();
        let best = (0..costs.len()).min_by(|a, b| costs[*a].total_cmp(&costs[*b])).unwrap_or(0);
        let most = OFF_MOST * OFF_MOST * (self.places.len() * DEPTHS.len()) as f32;
        if best == 0 || costs[best] > (1.0 - BETTER_LEAST) * costs[0] {
            return (1.0, costs[0] < FITS_MOST * most);
        }
        let step = self.factors[1] - self.factors[0];
        let after = costs.get(best + 1).copied().unwrap_or(costs[best]);
        let (before, here) = (costs[best - 1], costs[best]);
        let bend = before - 2.0 * here + after;
        let shift = if bend > 0.0 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 };
        (self.factors[best] + f64::from(shift) * step, true)
    }

    /// What speaks against a factor: pixels inside that are not the barrel's, and pixels outside that are.
    fn cost(&self, picture: &Picture, factor: f64) -> f32 {
        let most = OFF_MOST * OFF_MOST;
        let size = DVec2::new(f64::from(picture.width()), f64::from(picture.height()));
        let of_place = |place: &Place| -> f32 {
            let edge = self.about + (place.at - self.about) * factor;
            let off = |inwards_px: f64, [code, squared]: [f32; 2]| {
                let at = edge + place.inwards * inwards_px;
                // What is off the picture says nothing.
                let is_seen = at.cmpge(DVec2::ZERO).all() && at.cmplt(size).all();
                let off = code_at(picture, at) - code;
                is_seen.then(|| (off * off / squared.max(DEVIATION_LEAST * DEVIATION_LEAST)).min(most))
            };
            let pairs = DEPTHS.into_iter().zip(place.looks);
            pairs
                .map(|(depth, looks)| {
                    off(depth, looks).unwrap_or(0.0) + most - off(-depth, looks).unwrap_or(most)
                })
                .sum()
        };
        self.places.iter().map(of_place).sum()
    }
}

/// Code between the four pixels about a place: luma, of RGB the green.
fn code_at(picture: &Picture, at: DVec2) -> f32 {
    let format = picture.format();
    let size = DVec2::new(f64::from(picture.width()), f64::from(picture.height()));
    let at = (at - 0.5).clamp(DVec2::ZERO, (size - 1.0).max(DVec2::ZERO));
    let (x, y) = (at.x as usize, at.y as usize);
    let (right, down) = ((at.x - x as f64) as f32, (at.y - y as f64) as f32);
    // Luma comes first in a pixel, of RGB the green stands for it.
    let first = usize::from(format == PixelFormat::Rgb);
    let code = |x: usize, y: usize| {
        let (x, y) = (x.min(picture.width() as usize - 1), y.min(picture.height() as usize - 1));
        let place = x * format.pixel_bytes() + first;
        f32::from(picture.row(y).get(place).copied().unwrap_or(0))
    };
    let row = |y: usize| code(x, y) * (1.0 - right) + code(x + 1, y) * right;
    row(y) * (1.0 - down) + row(y + 1) * down
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::own_ship::Phantom;

    const SIZE: (u32, u32) = (160, 120);
    const BORE: DVec2 = DVec2::new(80.0, 20.0);

    fn barrel() -> Phantom {
        let corners = [[70.0, 80.0], [90.0, 80.0], [105.0, 120.0], [55.0, 120.0]];
        Phantom::new("barrel", corners.map(DVec2::from_array).to_vec(), SIZE).recoiling(true)
    }

    /// A barrel of that code, seen at a factor, before a sea that differs from picture to picture.
    fn picture(number: u32, factor: f64, code: u8) -> Picture {
        let barrel = barrel().recoiled(BORE, factor);
        let pixel = |i: u32| {
            let place = DVec2::new(f64::from(i % SIZE.0) + 0.5, f64::from(i / SIZE.0) + 0.5);
            let sea = 110 + ((i / 7).wrapping_mul(2_654_435_761).wrapping_add(number * 977) >> 27) as u8;
            [if barrel.distance(place) < 0.0 { code } else { sea }; 3]
        };
        let bytes: Vec<u8> = (0..SIZE.0 * SIZE.1).flat_map(pixel).collect();
        Picture::new(PixelFormat::Rgb, SIZE.0, SIZE.1, Arc::from(bytes)).expect("it is one")
    }

    fn finder() -> RecoilFinder {
        RecoilFinder::new(&Phantoms { parts: [barrel()].into(), bore: BORE }).expect("its muzzle tells it")
    }

    #[test]
    fn a_stroke_is_followed_and_rest_is_rest() {
        let mut finder = finder();
        for number in 0..60 {
            // Away for two pictures of six.
            let factor = [1.0, 1.0, 1.0, 1.0, 1.05, 1.08][number as usize % 6];
            let factor = if number < 20 { 1.0 } else { factor };
            finder.observe(&picture(number, factor, 40));
            // Sixty pixels from where the bore vanishes: a pixel.
            assert!((finder.factor() - factor).abs() < 0.017, "{number}: {} {factor}", finder.factor());
        }
    }

    #[test]
    fn a_barrel_in_other_light_is_learnt_anew() {
        let mut finder = finder();
        (0..20).for_each(|number| finder.observe(&picture(number, 1.0, 40)));
        (20..60).for_each(|number| finder.observe(&picture(number, 1.0, 90)));
        assert_eq!(finder.factor(), 1.0);
        finder.observe(&picture(60, 1.06, 90));
        assert!((finder.factor() - 1.06).abs() < 0.017, "{}", finder.factor());
    }

    #[test]
    fn what_does_not_recoil_or_does_not_show_it_has_no_finder() {
        let of = |part: Phantom| RecoilFinder::new(&Phantoms { parts: [part].into(), bore: BORE });
        assert!(of(barrel().recoiling(false)).is_none());
        // A shaft along the bore: both its edges lead to where that vanishes.
        let along = [DVec2::new(75.0, 120.0), BORE, DVec2::new(85.0, 120.0)];
        assert!(of(Phantom::new("shaft", along.to_vec(), SIZE).recoiling(true)).is_none());
    }
}
