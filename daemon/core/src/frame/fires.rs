//! Fire and smoke of boats that burn: puffs, each a function of its number and the time, so that any frame of any pace shows the same.
//!
//! Its heat is the world's ([`fire_heat_kw`]). Flames reach as high as
//! Heskestad (1984) gives. Smoke rises as a plume that wind bends over (Briggs 1975), widens with its height, and hides what is behind it by the
//! soot that burns off (yield of fuels: Tewarson 2002; specific extinction: Mulholland and Croarkin 2000).

use glam::{DVec2, DVec3, Vec3};

use super::scene::RoundView;
use crate::{
    chance::drawn,
    physics::haze_share,
    world::boats::{FIRE_CANDELA_KW, fire_heat_kw},
};

/// Most puffs of a boat in one scene.
pub const PUFFS_A_BOAT: usize = SMOKE_PUFFS + FLAME_PUFFS;
/// Most boats whose fires are drawn; of more, the first of the scenario.
pub const FIRES_SEEN_MAX: usize = 4;

/// Diameter of the fire, metres.
const DIAMETER_M: f64 = 0.8;
/// Heat of petrol, kJ/g, its yield of soot, g/g, and what soot takes out of light, m^2/g.
const PETROL_KJ_G: f64 = 43.7;
const SOOT: f64 = 0.06;
const EXTINCTION_M2_G: f64 = 8.7;
/// Buoyancy flux of a plume for each kW, m^4/s^3: g / (pi c_p rho T).
const BUOYANCY: f64 = 8.8e-3;
/// A plume that wind bends rises by 1.6 F^(1/3) t^(2/3) U^(-1/3) (Briggs 1975), and is half as wide each way as it has risen.
const RISE: f64 = 1.6;
const WIDENS: f64 = 0.5;
/// In less wind than this a plume is as it is in this, m/s.
const WIND_LEAST_M_S: f64 = 1.5;
/// Puffs of smoke each second, and how many of them are seen at a time.
const SMOKE_HZ: f64 = 1.5;
const SMOKE_PUFFS: usize = 18;
/// Flames each second, and how many at a time.
const FLAME_HZ: f64 = 14.0;
const FLAME_PUFFS: usize = 10;
/// Smoke fades over this last share of its life.
const FADES: f64 = 0.4;
/// Luminance of flames that soot makes bright, cd/m^2, and its colour (2000 K).
const FLAME_CD_M2: f64 = 12_000.0;
const FLAME: Vec3 = Vec3::new(2.1, 0.78, 0.14);
/// Share of light that a thick cloud of soot throws back.
pub const SOOT_ALBEDO: f64 = 0.13;

/// A boat that burns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Burning {
    /// Index of the boat in the scenario.
    pub boat: usize,
    /// Since when, seconds since the scenario began.
    pub since_s: f64,
    /// Velocity of the wind, world x and y, m/s.
    pub wind: DVec2,
    /// Where the camera is, world.
    pub eye: DVec3,
    /// Distance at which haze hides everything, metres.
    pub visibility_m: f64,
    /// Luminance that the camera shows as white, cd/m^2.
    pub white_cd_m2: f64,
}

impl Burning {
    /// Heat at a time, kW; 0 before it burns.
    pub fn heat_kw(&self, time_s: f64) -> f64 {
        fire_heat_kw(time_s - self.since_s)
    }

    /// Height of flames at a time, metres (Heskestad 1984).
    pub fn flame_height_m(&self, time_s: f64) -> f64 {
        const LEAST_M: f64 = 0.3;
        (0.235 * self.heat_kw(time_s).powf(0.4) - 1.02 * DIAMETER_M).max(LEAST_M)
    }

    /// Luminous intensity at a time, cd: it flickers by a fifth, ten times a second.
    pub fn candela(&self, time_s: f64) -> f64 {
        let moment = |i: f64| drawn(self.boat as u64, [0xf11c, i as u64]) - 0.5;
        let tenths = (time_s * 10.0).max(0.0);
        let flicker =
            moment(tenths.floor()) * (1.0 - tenths.fract()) + moment(tenths.floor() + 1.0) * tenths.fract();
        FIRE_CANDELA_KW * self.heat_kw(time_s) * (1.0 + 0.4 * flicker)
    }

    /// Colour of its light, of luminance 1.
    pub fn colour() -> Vec3 {
        FLAME / FLAME.dot(Vec3::new(0.2126, 0.7152, 0.0722))
    }

    /// Adds its puffs at a time; `source` is where the fire was at a time, `None` while it is under water.
    pub fn puffs(&self, time_s: f64, source: impl Fn(f64) -> Option<DVec3>, into: &mut Vec<RoundView>) {
        let last = |hz: f64| ((time_s - self.since_s) * hz).floor();
        let newest = last(SMOKE_HZ);
        into.extend((0..SMOKE_PUFFS).filter_map(|back| self.smoke(newest - back as f64, time_s, &source)));
        let newest = last(FLAME_HZ);
        into.extend((0..FLAME_PUFFS).filter_map(|back| self.flame(newest - back as f64, time_s, &source)));
    }

    fn smoke(&self, number: f64, time_s: f64, source: impl Fn(f64) -> Option<DVec3>) -> Option<RoundView> {
        const LIFE_S: f64 = SMOKE_PUFFS as f64 / SMOKE_HZ;
        let begin_s = self.begin_s(number, SMOKE_HZ)?;
        let age_s = time_s - begin_s;
        let heat_kw = self.heat_kw(begin_s);
        let wind_m_s = self.wind.length().max(WIND_LEAST_M_S);
        let rise_m = RISE * (BUOYANCY * heat_kw).cbrt() * (age_s * age_s).cbrt() / wind_m_s.cbrt();
        let radius_m = 0.5 * DIAMETER_M + WIDENS * rise_m;
        let chance = |of: u64| 2.0 * drawn(self.boat as u64, [0x50_0c + of, number as u64]) - 1.0;
        let stray = DVec3::new(chance(0), chance(1), chance(2)) * (0.4 * radius_m);
        let from = source(begin_s)?;
        let at = from + (self.wind * age_s).extend(rise_m) + stray;
        // Soot that burnt off between this puff and the next, spread over a disc.
        let soot_g = heat_kw / PETROL_KJ_G * SOOT / SMOKE_HZ;
        let depth = 2.0 * soot_g * EXTINCTION_M2_G / (std::f64::consts::PI * radius_m * radius_m);
        let left = ((1.0 - age_s / LIFE_S) / FADES).clamp(0.0, 1.0);
        Some(RoundView::Smoke {
            at,
            radius_m: radius_m as f32,
            depth: (depth * left) as f32,
            glow: Self::colour() * self.lit_by_flames(heat_kw, (at - from).length().max(radius_m)) as f32,
            haze: self.haze(at),
            seed: (number * 0.618_034).fract() as f32 * 64.0,
        })
    }

    fn flame(&self, number: f64, time_s: f64, source: impl Fn(f64) -> Option<DVec3>) -> Option<RoundView> {
        const LIFE_S: f64 = FLAME_PUFFS as f64 / FLAME_HZ;
        let begin_s = self.begin_s(number, FLAME_HZ)?;
        let share = (time_s - begin_s) / LIFE_S;
        let height_m = self.flame_height_m(begin_s);
        let chance = |of: u64| 2.0 * drawn(self.boat as u64, [0xf1a0 + of, number as u64]) - 1.0;
        let stray = DVec3::new(chance(0), chance(1), 0.0) * (0.35 * DIAMETER_M * (1.0 - 0.5 * share));
        // Wind leans flames by its speed over theirs, which is some 4 m/s.
        let lean = (self.wind * (height_m / 4.0 * 0.6)).clamp_length_max(height_m);
        let at = source(begin_s)? + (lean * share).extend(height_m * share) + stray;
        let radius_m = 0.5 * DIAMETER_M * (0.45 + 0.25 * height_m) * (1.0 - 0.7 * share);
        let light = self.radiance() * ((1.0 - share) * f64::from(1.0 - self.haze(at))) as f32;
        Some(RoundView::Flame {
            at,
            radius_m: radius_m as f32,
            light,
            seed: (number * 0.618_034).fract() as f32 * 64.0,
        })
    }

    /// When a puff begins, seconds since the scenario began; `None` before the fire.
    fn begin_s(&self, number: f64, hz: f64) -> Option<f64> {
        (number >= 0.0).then(|| self.since_s + number / hz)
    }

    /// Radiance of smoke so far from the flames, white in the picture being 1: what a matt cloud throws back of their illuminance.
    fn lit_by_flames(&self, heat_kw: f64, distance_m: f64) -> f64 {
        let lux = FIRE_CANDELA_KW * heat_kw / (distance_m * distance_m);
        SOOT_ALBEDO * lux / std::f64::consts::PI / self.white_cd_m2.max(1e-6)
    }

    /// Radiance of flames, white in the picture being 1.
    fn radiance(&self) -> Vec3 {
        Self::colour() * (FLAME_CD_M2 / self.white_cd_m2.max(1e-6)) as f32
    }

    fn haze(&self, at: DVec3) -> f32 {
        haze_share(at.distance(self.eye), self.visibility_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn burning(wind: DVec2) -> Burning {
        Burning { boat: 2, since_s: 5.0, wind, eye: DVec3::Z * 8.0, visibility_m: 2e4, white_cd_m2: 2e4 }
    }

    fn puffs(burning: &Burning, time_s: f64) -> Vec<RoundView> {
        let mut views = Vec::new();
        burning.puffs(time_s, |_| Some(DVec3::new(0.0, 200.0, 1.0)), &mut views);
        views
    }

    #[test]
    fn nothing_burns_before_it_is_lit_and_there_are_never_too_many_puffs() {
        let burning = burning(DVec2::new(5.0, 0.0));
        assert_eq!(puffs(&burning, 4.9), []);
        for tenths in 50..1500 {
            let views = puffs(&burning, f64::from(tenths) / 10.0);
            assert!(!views.is_empty() && views.len() <= PUFFS_A_BOAT);
        }
    }

    #[test]
    fn smoke_goes_with_the_wind_and_thins_out() {
        let burning = burning(DVec2::new(5.0, 0.0));
        let smoke: Vec<_> = puffs(&burning, 100.0)
            .into_iter()
            .filter_map(|view| match view {
                RoundView::Smoke { at, radius_m, depth, .. } => Some((at, radius_m, depth)),
                _ => None,
            })
            .collect();
        let (newest, oldest) = (smoke[0], smoke[smoke.len() - 1]);
        // Twelve seconds of five metres a second, and Briggs's rise of a megawatt: 1.6 * 8.8^(1/3) * 12^(2/3) / 5^(1/3) m.
        assert!((oldest.0.x - 58.0).abs() < 5.0, "{}", oldest.0);
        assert!((oldest.0.z - 1.0 - 10.1).abs() < 3.0, "{}", oldest.0);
        assert!(newest.1 < 1.0 && oldest.1 > 4.0 && newest.2 > 20.0 * oldest.2);
    }

    #[test]
    fn a_fire_is_as_bright_as_its_heat_and_never_of_no_number() {
        let burning = burning(DVec2::ZERO);
        assert_eq!(burning.heat_kw(4.0), 0.0);
        assert!((burning.heat_kw(5.0), burning.heat_kw(500.0)) == (150.0, 1000.0));
        let all: Vec<f64> = (0..2000).map(|i| burning.candela(100.0 + f64::from(i) * 0.013)).collect();
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        assert!((mean / (FIRE_CANDELA_KW * 1000.0) - 1.0).abs() < 0.03);
        for view in puffs(&burning, 30.0) {
            let (RoundView::Smoke { at, .. } | RoundView::Flame { at, .. }) = view else {
                panic!("{view:?}")
            };
            assert!(at.is_finite());
        }
    }
}
