//! What stands or passes before the horizon, and what lies on the lens: painted into pictures whose pose is known.

use std::{f64::consts::TAU, sync::Arc};

use bowwave_core::{
    event::{Picture, PixelFormat},
    geometry::{CameraPose, Lens, curvature_drop, horizon_dip, horizon_distance, wrapped},
};
use glam::{DQuat, DVec2, DVec3};
use rand::RngExt as _;
use rand_pcg::Pcg64;

use super::luma;

/// Nothing that is painted but drops stands higher or lower than this, as a part of the distance.
const HIGHEST: f64 = 0.2;
const LOWEST: f64 = -0.05;

/// Land between two bearings.
#[derive(Clone, Debug)]
struct Coast {
    /// Middle and half of its width, radians clockwise from north.
    middle: f64,
    half: f64,
    range_m: f64,
    height_m: f64,
    /// Brightness, codes.
    luma: f64,
    /// Phases of the waves that its outline is made of.
    outline: [f64; 5],
}

/// A ship that passes at a steady speed, broadside on.
#[derive(Clone, Copy, Debug)]
struct PassingShip {
    /// Bearing at the start, radians clockwise from north, and how fast that changes, rad/s.
    bearing: f64,
    rate: f64,
    range_m: f64,
    length_m: f64,
    luma: f64,
}

/// A drop of water on the lens: a lens that shows what lies about it small, upside down and out of focus.
#[derive(Clone, Copy, Debug)]
struct LensDrop {
    /// Middle and radius as shares of the picture's width.
    middle: DVec2,
    radius: f64,
    /// Seconds after the start between which it is there.
    from_s: f64,
    to_s: f64,
}

/// Everything in the way.
#[derive(Clone, Debug, Default)]
pub(super) struct Obstacles {
    coast: Option<Coast>,
    ships: Vec<PassingShip>,
    drops: Vec<LensDrop>,
    visibility_m: f64,
    rays: Vec<DVec3>,
}

impl Obstacles {
    /// Some of each by chance, for so many seconds: no coast in two of five cases, one all round in one of six.
    pub(super) fn by_chance(rng: &mut Pcg64, seconds: f64, visibility_m: f64) -> Self {
        let mut between = |from: f64, to: f64| from + (to - from) * rng.random::<f64>();
        let kind = between(0.0, 6.0);
        let coast = (kind > 2.4).then(|| Coast {
            middle: between(0.0, TAU),
            half: if kind > 5.0 { std::f64::consts::PI } else { between(0.3, 1.2) },
            // From a near shore to land whose foot is below the horizon.
            range_m: between(500f64.ln(), 25_000f64.ln()).exp(),
            height_m: between(5.0, 150.0),
            luma: between(30.0, 120.0),
            outline: std::array::from_fn(|_| between(0.0, TAU)),
        });
        let ships = between(0.0, 6.0) as usize;
        let ships = (0..ships)
            .map(|_| {
                let range_m = between(400f64.ln(), 8000f64.ln()).exp();
                PassingShip {
                    bearing: between(0.0, TAU),
                    rate: between(-12.0, 12.0) / range_m,
                    range_m,
                    length_m: between(15.0, 200.0),
                    luma: between(30.0, 220.0),
                }
            })
            .collect();
        let drops = if between(0.0, 2.0) < 1.0 { 0 } else { between(1.0, 12.0) as usize };
        let drops = (0..drops)
            .map(|_| {
                let from_s = between(-60.0, seconds);
                LensDrop {
                    middle: DVec2::new(between(0.0, 1.0), between(0.0, 0.5625)),
                    radius: between(0.01, 0.07),
                    from_s,
                    to_s: from_s + between(20.0, 180.0),
                }
            })
            .collect();
        Self { coast, ships, drops, visibility_m, rays: Vec::new() }
    }

    /// In a word or two.
    pub(super) fn name(&self) -> String {
        let coast = match &self.coast {
            Some(coast) if coast.half > 3.0 => format!("land all round at {:.0} m", coast.range_m),
            Some(coast) => format!("a coast at {:.0} m", coast.range_m),
            None => "open sea".to_owned(),
        };
        format!("{coast}, {} ships, {} drops", self.ships.len(), self.drops.len())
    }

    /// The picture that a camera with that lens at `pose` takes `at_s` seconds after the start.
    pub(super) fn paint(&mut self, picture: &Picture, lens: &Lens, pose: &CameraPose, at_s: f64) -> Picture {
        let mut canvas = Canvas::of(picture);
        if self.coast.is_some() || !self.ships.is_empty() {
            if self.rays.len() != canvas.luma.len() {
                self.rays = rays(lens);
            }
            self.paint_far(&mut canvas, pose, 1.0 / lens.focal.y, at_s);
        }
        for drop in self.drops.iter().filter(|d| (d.from_s..d.to_s).contains(&at_s)) {
            canvas.lay(drop);
        }
        canvas.laid_over(picture)
    }

    fn paint_far(&self, canvas: &mut Canvas, pose: &CameraPose, pixel: f64, at_s: f64) {
        let eye_m = pose.position.z.max(0.5);
        let up = pose.world_from_camera.inverse() * DVec3::Z;
        let [east, north] = [DVec3::X, DVec3::Y].map(|axis| pose.world_from_camera.inverse() * axis);
        for (luma, ray) in canvas.luma.iter_mut().zip(&self.rays) {
            let elevation = ray.dot(up);
            if !(LOWEST..HIGHEST).contains(&elevation) {
                continue;
            }
            let bearing = ray.dot(east).atan2(ray.dot(north));
            let mut lay = |colour: f64, cover: f64, range_m: f64| {
                // Koschmieder: contrast against what is behind falls to 2 % at the visibility.
                let share = cover * (-3.912 * range_m / self.visibility_m).exp();
                *luma = (f64::from(*luma) * (1.0 - share) + colour * share) as f32;
            };
            if let Some(coast) = &self.coast {
                let cover = coast.cover(bearing, elevation, eye_m, pixel);
                if cover > 0.0 {
                    lay(coast.luma + 12.0 * grain(bearing, elevation), cover, coast.range_m);
                }
            }
            for ship in &self.ships {
                let cover = ship.cover(bearing, elevation, at_s, eye_m, pixel);
                if cover > 0.0 {
                    lay(ship.luma + 6.0 * grain(bearing, elevation), cover, ship.range_m);
                }
            }
        }
    }
}

impl Coast {
    /// Share of a pixel that it covers.
    fn cover(&self, bearing: f64, elevation: f64, eye_m: f64, pixel: f64) -> f64 {
        let off = wrapped(bearing - self.middle);
        if off.abs() > self.half {
            return 0.0;
        }
        let waves = self.outline.iter().enumerate().map(|(i, phase)| {
            let frequency = 3.0 * 2.3f64.powi(i as i32);
            (frequency * bearing + phase).sin() / f64::from(1 << i)
        });
        // It falls off to the sea at its ends.
        let end = ((self.half - off.abs()) / 0.1).min(1.0);
        let height_m = self.height_m * end * (0.5 + 0.25 * waves.sum::<f64>()).max(0.02);
        span(self.range_m, height_m, eye_m, elevation, pixel)
    }
}

impl PassingShip {
    fn cover(&self, bearing: f64, elevation: f64, at_s: f64, eye_m: f64, pixel: f64) -> f64 {
        let along_m = wrapped(bearing - self.bearing - self.rate * at_s) * self.range_m;
        let half_m = 0.5 * self.length_m;
        if along_m.abs() > half_m {
            return 0.0;
        }
        let house = (-0.3..0.1).contains(&(along_m / half_m));
        let height_m = self.length_m * if house { 0.15 } else { 0.05 };
        span(self.range_m, height_m, eye_m, elevation, pixel)
    }
}

/// Share of a pixel at `elevation` that something covers which stands in the sea at that range and is so high.
fn span(range_m: f64, height_m: f64, eye_m: f64, elevation: f64, pixel: f64) -> f64 {
    let far_m = horizon_distance(eye_m);
    let dip = horizon_dip(eye_m);
    let falls_m = curvature_drop(range_m);
    let foot = if range_m < far_m { -(eye_m + falls_m) / range_m } else { -dip };
    let top = (height_m - eye_m - falls_m) / range_m;
    let within = |edge: f64| (0.5 + (edge - elevation) / pixel).clamp(0.0, 1.0);
    (within(top) - within(foot)).max(0.0)
}

/// Texture that stays where it is in the world: -1 to 1.
fn grain(bearing: f64, elevation: f64) -> f64 {
    let cell = |v: f64| (v * 300.0).floor() as i64;
    let hash = (cell(bearing).wrapping_mul(0x9e37_79b9) ^ cell(elevation).wrapping_mul(0x85eb_ca6b)) as u64;
    let hash = hash.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 40;
    hash as f64 / f64::from(1 << 23) - 1.0
}

/// Rays of the pixels, camera's axes, row by row.
fn rays(lens: &Lens) -> Vec<DVec3> {
    let pixels = (0..lens.height).flat_map(|y| (0..lens.width).map(move |x| (x, y)));
    pixels.map(|(x, y)| lens.unproject(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5))).collect()
}

/// A picture's brightness.
struct Canvas {
    luma: Vec<f32>,
    width: usize,
    height: usize,
}

impl Canvas {
    fn of(picture: &Picture) -> Self {
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        Self { luma: luma(picture).map(f32::from).collect(), width, height }
    }

    fn at(&self, x: f64, y: f64) -> f32 {
        let x = (x.max(0.0) as usize).min(self.width - 1);
        let y = (y.max(0.0) as usize).min(self.height - 1);
        self.luma[y * self.width + x]
    }

    fn lay(&mut self, drop: &LensDrop) {
        /// How much smaller things are in a drop, and over how many of the picture's pixels a place in it is blurred.
        const SMALLER: f64 = 5.0;
        const BLUR: [f64; 3] = [-6.0, 0.0, 6.0];
        let width = self.width as f64;
        let (middle, radius) = (drop.middle * width, drop.radius * width);
        let before = &Self { luma: self.luma.clone(), ..*self };
        for (i, luma) in self.luma.iter_mut().enumerate() {
            let off = DVec2::new((i % self.width) as f64, (i / self.width) as f64) - middle;
            let share = ((radius - off.length()) / 2.0).clamp(0.0, 1.0) as f32;
            if share == 0.0 {
                continue;
            }
            let from = middle - off * SMALLER;
            let sum: f32 =
                BLUR.iter().flat_map(|x| BLUR.iter().map(move |y| before.at(from.x + x, from.y + y))).sum();
            *luma += share * (sum / 9.0 - *luma);
        }
    }

    /// `picture` with this brightness.
    fn laid_over(&self, picture: &Picture) -> Picture {
        let stride = picture.format().pixel_bytes();
        let mut bytes = picture.bytes().to_vec();
        for (pixel, luma) in bytes.chunks_exact_mut(stride).zip(&self.luma) {
            let luma = luma.round() as u8;
            if picture.format() == PixelFormat::Rgb { pixel.fill(luma) } else { pixel[0] = luma }
        }
        let made = Picture::new(picture.format(), picture.width(), picture.height(), Arc::from(bytes));
        made.unwrap_or_else(|_| picture.clone())
    }
}

/// The specific force by which a ship's turn at `speed_m_s` differs from that of a ship that stands, m/s^2, the world's axes.
pub(super) fn turning_force(heading: f64, rate: f64, speed_m_s: f64) -> DVec3 {
    speed_m_s * rate * (DQuat::from_rotation_z(-heading) * DVec3::X)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_near_shore_ends_the_water_below_the_horizon_and_far_land_at_it() {
        let eye_m = 6.0;
        let dip = horizon_dip(eye_m);
        let pixel = 1e-6;
        let covered = |range_m: f64, elevation: f64| span(range_m, 40.0, eye_m, elevation, pixel) > 0.5;
        assert!(covered(1000.0, -5.9e-3) && !covered(1000.0, -6.2e-3));
        assert!(covered(1000.0, 0.033) && !covered(1000.0, 0.035));
        assert!(covered(15_000.0, -dip + 1e-5) && !covered(15_000.0, -dip - 1e-5));
        // Beyond the horizon its lower part is hidden, and at last all of it.
        assert!(!covered(40_000.0, -dip + 1e-5));
    }

    #[test]
    fn a_turn_to_starboard_pushes_a_ship_to_starboard() {
        let north = turning_force(0.0, 0.05, 8.0);
        assert!(north.distance(DVec3::X * 0.4) < 1e-12, "{north}");
        let east = turning_force(std::f64::consts::FRAC_PI_2, 0.05, 8.0);
        assert!(east.distance(DVec3::NEG_Y * 0.4) < 1e-12, "{east}");
    }
}
