//! Navigation lights by the COLREGS 1972: which a vessel shows (rules 23, 26, 30), in which sectors (rule 21), how bright (annex I, 8 to 10).

use glam::{DVec3, Vec3};

use crate::{geometry::bearing_and_elevation_deg, model::Model};

/// A scenario's choice of lights for a boat.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightsKept {
    /// None: who does not want to be seen.
    #[default]
    None,
    /// Those of what it does.
    ByConduct,
    /// Always the same, whatever it does.
    Always(Conduct),
}

impl LightsKept {
    /// All of them by the names that scenarios use.
    pub const NAMES: [(&'static str, Self); 5] = [
        ("off", Self::None),
        ("rules", Self::ByConduct),
        ("under-way", Self::Always(Conduct::UnderWay)),
        ("fishing", Self::Always(Conduct::Fishing)),
        ("anchored", Self::Always(Conduct::Anchored)),
    ];
}

/// Conduct of a vessel, as the rules tell vessels apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Conduct {
    /// Under way by engine.
    UnderWay,
    /// Fishing otherwise than by trawl.
    Fishing,
    /// At anchor.
    Anchored,
}

/// Colour of a light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightColour {
    /// White.
    White,
    /// Red: port.
    Red,
    /// Green: starboard.
    Green,
}

impl LightColour {
    /// Linear light of luminance 1: colours inside of the regions of annex I, 7, as near as sRGB comes.
    pub const fn rgb(self) -> Vec3 {
        match self {
            Self::White => Vec3::new(1.35, 0.95, 0.45),
            Self::Red => Vec3::new(4.7, 0.0, 0.0),
            Self::Green => Vec3::new(0.0, 1.32, 0.78),
        }
    }
}

/// Part of the horizon over which a light shows.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Sector {
    /// First and last bearing from the bow, degrees clockwise; beyond 360 it goes on from 0.
    degrees: [f64; 2],
    /// Width over which it is cut off beyond each, degrees: `None` where it falls as rule 9 (a) ii allows.
    cut_off: [Option<f64>; 2],
}

impl Sector {
    const ALL_ROUND: Self = Self { degrees: [0.0, 360.0], cut_off: [None; 2] };
    const MASTHEAD: Self = Self { degrees: [247.5, 472.5], cut_off: [None; 2] };
    const STERN: Self = Self { degrees: [112.5, 247.5], cut_off: [None; 2] };
    /// Sidelights are cut off sharply ahead: between 1 and 3 degrees beyond the bow (annex I, 9 (a) i).
    const STARBOARD: Self = Self { degrees: [0.0, 112.5], cut_off: [Some(AHEAD_DEG), None] };
    const PORT: Self = Self { degrees: [247.5, 360.0], cut_off: [None, Some(AHEAD_DEG)] };

    /// Share of the intensity towards a bearing, degrees.
    fn share(&self, bearing_deg: f64) -> f64 {
        let [from, to] = self.degrees;
        if to - from >= 360.0 {
            return 1.0;
        }
        let middle = 0.5 * (from + to);
        let off = (bearing_deg - middle + 180.0).rem_euclid(360.0) - 180.0;
        // Degrees inside of the nearer limit; negative beyond it.
        let inside = 0.5 * (to - from) - off.abs();
        let [first, last] = self.cut_off;
        match if off < 0.0 { first } else { last } {
            Some(width) => (1.0 + inside / width).clamp(0.0, 1.0),
            None => (0.5 + 0.5 * inside / SOFT_DEG).clamp(0.0, 1.0),
        }
    }
}

/// Width of the cut-off ahead, degrees.
const AHEAD_DEG: f64 = 2.0;
/// Width over which other lights fall to half inside of their limit, and to nothing beyond it, degrees.
const SOFT_DEG: f64 = 5.0;

/// Share of the intensity at an elevation above or below the level of the vessel: all to 5 degrees, 60 % at 7.5 (annex I, 10); on to nothing
/// at 25, as lamps with a lens about them do.
fn vertical_share(elevation_deg: f64) -> f64 {
    let e = elevation_deg.abs();
    if e <= 7.5 { (1.0 - 0.4 * (e - 5.0) / 2.5).min(1.0) } else { (0.6 * (25.0 - e) / 17.5).max(0.0) }
}

/// One light of a vessel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NavigationLight {
    /// Its place, the boat's space, metres.
    pub place: DVec3,
    /// Its colour.
    pub colour: LightColour,
    /// Intensity within its sector, candela.
    pub candela: f64,
    sector: Sector,
}

impl NavigationLight {
    /// Intensity towards a unit direction of the boat's space, candela.
    pub fn candela_towards(&self, direction: DVec3) -> f64 {
        // With the bow as north, port is west.
        let [bearing, elevation] =
            bearing_and_elevation_deg(DVec3::new(-direction.y, direction.x, direction.z));
        self.candela * self.sector.share(bearing) * vertical_share(elevation)
    }
}

/// Least intensity of a light that is seen so many nautical miles away, candela (annex I, 8): threshold 2e-7 lx, transmission .8 a mile.
fn candela_for(range_nm: f64) -> f64 {
    3.43e6 * 2e-7 * range_nm * range_nm * 0.8_f64.powf(-range_nm)
}

/// Ranges that lights of a vessel of that length need, nautical miles (rule 22): masthead, sidelights, stern and all-round.
fn ranges_nm(length_m: f64) -> [f64; 3] {
    match length_m {
        l if l >= 50.0 => [6.0, 3.0, 3.0],
        l if l >= 20.0 => [5.0, 2.0, 2.0],
        l if l >= 12.0 => [3.0, 2.0, 2.0],
        _ => [2.0, 1.0, 2.0],
    }
}

/// Height of one all-round light over the other, metres: at least 1 on vessels below 20 m (annex I, 2 (i)).
const APART_M: f64 = 1.0;

/// A vessel's lights for all that it may do.
#[derive(Clone, Debug, PartialEq)]
pub struct LightsRigged {
    under_way: Vec<NavigationLight>,
    fishing: Vec<NavigationLight>,
    anchored: Vec<NavigationLight>,
}

impl LightsRigged {
    /// Rigs a model as a vessel of its size is rigged: on its highest part, on either side of it, and at its stern.
    pub fn on(model: &Model) -> Self {
        let length_m = model.length_m();
        let [mast_nm, side_nm, round_nm] = ranges_nm(length_m);
        let light = |place, colour, range_nm, sector| NavigationLight {
            place,
            colour,
            candela: candela_for(range_nm),
            sector,
        };
        let (white, red, green) = (LightColour::White, LightColour::Red, LightColour::Green);
        let Places { top, sides: [port, starboard], stern, fore } = Places::on(model);
        let sides = [
            light(port, red, side_nm, Sector::PORT),
            light(starboard, green, side_nm, Sector::STARBOARD),
            light(stern, white, round_nm, Sector::STERN),
        ];
        // From 50 m on there are two (rule 23 (a) ii), and two at anchor (rule 30 (a) ii).
        let long = length_m >= 50.0;
        let mast = |place| light(place, white, mast_nm, Sector::MASTHEAD);
        let masts = if long { vec![mast(top), mast(fore)] } else { vec![mast(top)] };
        let round = |place, colour| light(place, colour, round_nm, Sector::ALL_ROUND);
        let nets = vec![round(top + DVec3::Z * APART_M, red), round(top, white)];
        let anchored =
            if long { vec![round(fore, white), round(stern, white)] } else { vec![round(top, white)] };
        Self {
            under_way: [masts, sides.to_vec()].concat(),
            fishing: [nets, sides.to_vec()].concat(),
            anchored,
        }
    }

    /// The lights for what it does; `makes_way` says whether it moves through the water: who fishes and lies still shows neither
    /// sidelights nor a stern light (rule 26 (c) iii).
    pub fn shown(&self, conduct: Conduct, makes_way: bool) -> &[NavigationLight] {
        match conduct {
            Conduct::UnderWay => &self.under_way,
            Conduct::Fishing if makes_way => &self.fishing,
            Conduct::Fishing => self.fishing.get(..2).unwrap_or_default(),
            Conduct::Anchored => &self.anchored,
        }
    }
}

/// Places for lights on a model, the boat's space, metres.
struct Places {
    /// Its highest point.
    top: DVec3,
    /// Port and starboard, beside that.
    sides: [DVec3; 2],
    stern: DVec3,
    /// Before the highest point and lower.
    fore: DVec3,
}

impl Places {
    fn on(model: &Model) -> Self {
        /// Distance of a light from what it stands on, metres.
        const OFF_M: f64 = 0.06;
        /// Height of a pole that carries a light, metres.
        const POLE_M: f64 = 1.5;
        let corners = || model.vertices.iter().map(|v| v.position.as_dvec3());
        let highest =
            |of: &dyn Fn(DVec3) -> bool| corners().filter(|p| of(*p)).max_by(|a, b| a.z.total_cmp(&b.z));
        let [low, high] = [model.min, model.max].map(Vec3::as_dvec3);
        let box_top = DVec3::new(0.5 * (low.x + high.x), 0.0, high.z);
        let top = highest(&|_| true).map_or(box_top, |p| DVec3::new(p.x, 0.0, p.z));
        let length_m = high.x - low.x;
        // What is about abreast of the highest point and widest there carries the sidelights.
        let abreast = |p: DVec3| (p.x - top.x).abs() < 0.2 * length_m;
        let beam = corners().filter(|p| abreast(*p)).map(|p| p.y.abs()).fold(0.0, f64::max);
        let rail = highest(&|p| abreast(p) && p.y.abs() > 0.85 * beam).map_or(0.5 * high.z, |p| p.z);
        let side = |sign: f64| DVec3::new(top.x, sign * (beam + OFF_M), rail + OFF_M);
        // The forward light of a long vessel stands on a pole on the highest that there is well before the other, and below that.
        let before = highest(&|p| p.x > top.x + 0.1 * length_m).unwrap_or(top);
        let fore = DVec3::new(before.x, 0.0, (before.z + POLE_M).min(top.z));
        let transom = |p: DVec3| p.x < low.x + 0.05 * length_m;
        let taffrail = highest(&transom).map_or(0.5 * high.z, |p| p.z);
        Self {
            top,
            sides: [side(1.0), side(-1.0)],
            stern: DVec3::new(low.x - OFF_M, 0.0, taffrail + OFF_M),
            fore,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::score::boxed_model;

    fn boat() -> Model {
        boxed_model(Vec3::new(-3.0, -1.0, -0.5), Vec3::new(3.0, 1.0, 1.5))
    }

    fn towards(bearing_deg: f64, elevation_deg: f64) -> DVec3 {
        let (b, e) = (bearing_deg.to_radians(), elevation_deg.to_radians());
        DVec3::new(e.cos() * b.cos(), -e.cos() * b.sin(), e.sin())
    }

    #[test]
    fn intensities_are_those_of_the_annex() {
        // The annex's own table, to the digits that it prints.
        for (range_nm, candela) in
            [(1.0, 0.9), (2.0, 4.3), (3.0, 12.0), (4.0, 27.0), (5.0, 52.0), (6.0, 94.0)]
        {
            let found = candela_for(range_nm);
            assert!((found / candela - 1.0).abs() < 0.05, "{range_nm}: {found}");
        }
    }

    /// Colours seen from a bearing that is well inside of the sectors, brightest first by where they stand.
    fn seen(lights: &[NavigationLight], bearing_deg: f64) -> Vec<LightColour> {
        let from = towards(bearing_deg, 0.0);
        lights.iter().filter(|l| l.candela_towards(from) > 0.5 * l.candela).map(|l| l.colour).collect()
    }

    #[test]
    fn each_side_shows_what_the_rules_say() {
        use LightColour::{Green, Red, White};
        let rigged = LightsRigged::on(&boat());
        let under_way = rigged.shown(Conduct::UnderWay, true);
        assert_eq!(seen(under_way, 45.0), [White, Green]);
        assert_eq!(seen(under_way, -45.0), [White, Red]);
        assert_eq!(seen(under_way, 180.0), [White]);
        // Both sidelights show a degree off the bow at most.
        assert_eq!(seen(under_way, 0.5), [White, Red, Green]);
        assert_eq!(seen(under_way, 2.5), [White, Green]);
        assert_eq!(seen(rigged.shown(Conduct::Fishing, false), 100.0), [Red, White]);
        assert_eq!(seen(rigged.shown(Conduct::Fishing, true), 100.0), [Red, White, Green]);
        assert_eq!(seen(rigged.shown(Conduct::Anchored, false), 200.0), [White]);
    }

    #[test]
    fn no_bearing_is_without_a_light_and_none_jumps() {
        let rigged = LightsRigged::on(&boat());
        let lights = rigged.shown(Conduct::UnderWay, true);
        for tenth in 0..3600 {
            let at = |t: i32| towards(f64::from(t) / 10.0, 0.0);
            assert!(lights.iter().any(|l| l.candela_towards(at(tenth)) >= 0.49 * l.candela), "{tenth}");
            for light in lights {
                let step = light.candela_towards(at(tenth + 1)) - light.candela_towards(at(tenth));
                assert!(step.abs() < 0.06 * light.candela, "{tenth}: {step}");
            }
        }
        for e in [-90.0, -20.0, 0.0, 20.0, 90.0] {
            assert!(lights.iter().all(|l| l.candela_towards(towards(10.0, e)).is_finite()));
        }
    }

    #[test]
    fn lights_stand_on_the_model_and_the_right_side_is_green() {
        let model = boat();
        let rigged = LightsRigged::on(&model);
        let reach = f64::from(model.max.z) + APART_M + 0.1;
        for light in [&rigged.under_way, &rigged.fishing, &rigged.anchored].into_iter().flatten() {
            assert!(light.place.is_finite() && light.place.z > 0.0 && light.place.z < reach, "{light:?}");
            match light.colour {
                LightColour::Green => assert!(light.place.y < 0.0),
                LightColour::Red => assert!(light.place.y >= 0.0),
                LightColour::White => {}
            }
        }
    }
}
