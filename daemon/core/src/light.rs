//! Light on the boats, taken from the picture itself so that they fit it.
//!
//! A few hundred pixels above the horizon give the sky's radiance at the camera's own exposure and white balance; the sun's
//! share follows from its height. This is an estimate for shading, not a photometric measurement.

use glam::{DVec2, DVec3, Vec3};

use crate::{
    event::Picture,
    geometry::{CameraPose, Lens},
    reflection::{Sample, SeaTones, SkyLight},
    scene::Light,
    time::Time,
};

/// The estimate follows the picture with this time constant, so that one dark wave or passing bird does not flicker boats.
const FOLLOW_S: f64 = 1.0;

/// Pixels sampled along the picture's width and height.
const GRID: (u32, u32) = (24, 18);

/// A white matt surface facing a high sun in clear air is this many times as bright as one that sees only the sky, as
/// cameras expose it: illuminances of 70-90 klx and 15-20 klx (CIE S 011), less the highlight roll-off of ordinary cameras.
const SUN_TO_SKY: f32 = 2.6;

/// Optical depth of a clear maritime atmosphere at about 610, 550 and 465 nm (Rayleigh and background aerosol).
const OPTICAL_DEPTH: Vec3 = Vec3::new(0.10, 0.14, 0.22);

/// Share of linear red, green and blue in luminance (ITU-R BT.709).
pub const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);

/// One channel of linear light to its sRGB code (IEC 61966-2-1).
pub fn linear_to_srgb(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// One sRGB-coded channel to linear light (IEC 61966-2-1).
pub fn srgb_to_linear(coded: f32) -> f32 {
    if coded <= 0.040_45 { coded / 12.92 } else { ((coded + 0.055) / 1.055).powf(2.4) }
}

/// Mean linear colours of sky and sea as the camera sees them.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Means {
    sky: Vec3,
    horizon: Vec3,
    sea: Vec3,
}

/// Follows the light of the picture.
#[derive(Clone, Debug)]
pub struct LightMeter {
    sun_direction: DVec3,
    /// Whether the sea's tones are wanted: only reflections by brightness need them.
    wants_tones: bool,
    means: Option<(Time, Means)>,
    tones: Option<(Time, SeaTones)>,
}

impl LightMeter {
    /// A meter for a scene whose sun stands in `sun_direction` (unit vector, world).
    pub fn new(sun_direction: DVec3) -> Self {
        Self { sun_direction, wants_tones: false, means: None, tones: None }
    }

    /// The same that measures the sea's tones as well, where `wanted`.
    #[must_use]
    pub fn with_tones(mut self, wanted: bool) -> Self {
        self.wants_tones = wanted;
        self
    }

    /// Takes in a picture whose camera stood at `camera` with `lens` (the picture's own, not the screen's).
    pub fn observe(&mut self, time: Time, picture: &Picture, lens: &Lens, camera: &CameraPose) {
        if self.wants_tones
            && let Some(seen) = tones(picture, lens, camera)
        {
            let seen = match self.tones {
                None => seen,
                Some((since, old)) => old.towards(&seen, follow(since, time)),
            };
            self.tones = Some((time, seen));
        }
        let Some(seen) = measure(picture, lens, camera) else { return };
        let means = match self.means {
            None => seen,
            Some((since, old)) => {
                let share = follow(since, time);
                Means {
                    sky: old.sky.lerp(seen.sky, share),
                    horizon: old.horizon.lerp(seen.horizon, share),
                    sea: old.sea.lerp(seen.sea, share),
                }
            }
        };
        self.means = Some((time, means));
    }

    /// The sky that boats hide from the sea.
    pub fn sky(&self) -> SkyLight {
        let Light { horizon, sky, .. } = self.light();
        SkyLight::of_bands(horizon, sky)
    }

    /// How bright the sea is; a default where that is not measured.
    pub fn tones(&self) -> SeaTones {
        self.tones.map(|(_, tones)| tones).unwrap_or_default()
    }

    /// The light to draw boats with. Before the first picture: an overcast grey.
    pub fn light(&self) -> Light {
        let Means { sky, horizon, sea } = self.means.map_or(
            Means { sky: Vec3::splat(0.4), horizon: Vec3::splat(0.45), sea: Vec3::splat(0.1) },
            |(_, m)| m,
        );
        let sun = sun_colour(self.sun_direction.z) * sky.element_sum() / 3.0 * SUN_TO_SKY;
        Light { sun_direction: self.sun_direction, sun, sky, horizon, sea }
    }
}

/// Share of the way that the estimate goes to what is seen at `time`.
fn follow(since: Time, time: Time) -> f32 {
    (1.0 - (-time.secs_since(since).max(0.0) / FOLLOW_S).exp()) as f32
}

/// Sea is looked at from this far below the horizontal, tangent: what is nearer the horizon is haze and other boats.
const SEA_FROM: f64 = 0.008;
/// Pixels looked at along the picture's width, and from the horizon down.
const SEA_GRID: (usize, usize) = (24, 20);

fn tones(picture: &Picture, lens: &Lens, camera: &CameraPose) -> Option<SeaTones> {
    let (w, h) = (f64::from(lens.width), f64::from(lens.height));
    let down = |pixel: DVec2| {
        let up = (camera.world_from_camera * lens.unproject(pixel)).z;
        -up / (1.0 - up * up).max(1e-12).sqrt()
    };
    // Rows from the first that shows sea down to the lowest, closer to each other near the horizon. Tangents grow about evenly downwards.
    let middle = |y: f64| down(DVec2::new(w / 2.0, y * h));
    let (top, bottom) = (middle(0.0), middle(1.0));
    let first = ((SEA_FROM - top) / (bottom - top).max(1e-9)).clamp(0.0, 1.0);
    let mut samples = [Sample { tangent: 0.0, luma: 0.0 }; SEA_GRID.0 * SEA_GRID.1];
    let mut count = 0;
    for i in 0..samples.len() {
        let (column, row) = (i % SEA_GRID.0, i / SEA_GRID.0);
        let share = ((row as f64 + 0.5) / SEA_GRID.1 as f64).powi(2);
        let y = (first + share * (1.0 - first)) * h;
        let x = (column as f64 + 0.5 + 0.4 * (row % 2) as f64) / (SEA_GRID.0 as f64 + 0.5) * w;
        let tangent = down(DVec2::new(x, y));
        if tangent < SEA_FROM {
            continue;
        }
        let place = DVec2::new(x / w * f64::from(picture.width()), y / h * f64::from(picture.height()));
        let code = Vec3::from(picture.srgb_at(place.x as u32, place.y as u32));
        if let Some(sample) = samples.get_mut(count) {
            *sample = Sample { tangent, luma: f64::from(code.dot(LUMINANCE)) };
            count += 1;
        }
    }
    SeaTones::fit(samples.get(..count)?)
}

/// Colour of direct sun light relative to a high sun's green, for the sine of its elevation; black below the horizon.
fn sun_colour(sin_elevation: f64) -> Vec3 {
    let degrees = sin_elevation.clamp(-1.0, 1.0).asin().to_degrees();
    if degrees <= -0.6 {
        return Vec3::ZERO;
    }
    // Relative air mass, Kasten & Young 1989, eq. 3.
    let airmass = 1.0 / (sin_elevation.max(0.0) + 0.505_72 * (degrees + 6.079_95).powf(-1.636_4));
    let transmitted = (-OPTICAL_DEPTH * airmass as f32).exp();
    let overhead = (-OPTICAL_DEPTH).exp();
    let risen = ((degrees + 0.6) / 1.2).clamp(0.0, 1.0) as f32;
    transmitted / overhead * risen
}

fn measure(picture: &Picture, lens: &Lens, camera: &CameraPose) -> Option<Means> {
    let mut sums = [Vec3::ZERO; 3];
    let mut counts = [0u32; 3];
    for iy in 0..GRID.1 {
        for ix in 0..GRID.0 {
            let share = DVec2::new(
                (f64::from(ix) + 0.5) / f64::from(GRID.0),
                (f64::from(iy) + 0.5) / f64::from(GRID.1),
            );
            let pixel = share * DVec2::new(f64::from(lens.width), f64::from(lens.height));
            let up = (camera.world_from_camera * lens.unproject(pixel)).z;
            // Sky; the strip of 0.5 to 6 degrees over the horizon; sea from 2 degrees below it.
            let class = match up {
                u if u > 0.105 => 0,
                u if u > 0.009 => 1,
                u if u < -0.035 => 2,
                _ => continue,
            };
            let place = share * DVec2::new(f64::from(picture.width()), f64::from(picture.height()));
            let colour = picture.srgb_at(place.x as u32, place.y as u32).map(srgb_to_linear);
            sums[class] += Vec3::from_array(colour);
            counts[class] += 1;
        }
    }
    let mean = |class: usize| (counts[class] > 0).then(|| sums[class] / counts[class] as f32);
    let horizon = mean(1).or(mean(0));
    let sky = mean(0).or(mean(1));
    match (sky, horizon, mean(2)) {
        (Some(sky), Some(horizon), sea) => Some(Means { sky, horizon, sea: sea.unwrap_or(sky * 0.2) }),
        // Looking down, no sky: keep what was known of it.
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{event::PixelFormat, geometry::look};

    fn two_tone(sky: u8, sea: u8) -> Picture {
        let (w, h) = (64u32, 64u32);
        let bytes: Vec<u8> =
            (0..h).flat_map(|y| vec![if y < h / 2 { sky } else { sea }; w as usize * 3]).collect();
        Picture::new(PixelFormat::Rgb, w, h, bytes.into()).unwrap()
    }

    #[test]
    fn the_sky_above_the_horizon_is_what_is_measured() {
        let lens = Lens::pinhole(64, 64, 1.0);
        let camera = CameraPose { world_from_camera: look(0.0, 0.0, 0.0), position: DVec3::Z };
        let mut meter = LightMeter::new(DVec3::new(0.0, 0.6, 0.8));
        meter.observe(Time::from_ns(0), &two_tone(188, 99), &lens, &camera);
        let light = meter.light();
        assert!((light.sky.x - srgb_to_linear(188.0 / 255.0)).abs() < 1e-4);
        assert!((light.sea.y - srgb_to_linear(99.0 / 255.0)).abs() < 1e-4);
        // A dark picture ten time constants later is followed.
        meter.observe(Time::from_ns(0).plus_secs(10.0), &two_tone(60, 30), &lens, &camera);
        assert!(meter.light().sky.x < 0.06);
    }

    #[test]
    fn the_sun_reddens_sets_and_stays_finite() {
        let noon = sun_colour(1.0);
        assert!((noon - Vec3::ONE).abs().max_element() < 0.02);
        let low = sun_colour(3f64.to_radians().sin());
        assert!(low.x > 2.0 * low.z && low.x < 0.6);
        for tenth_degrees in -900..=900 {
            let c = sun_colour((f64::from(tenth_degrees) / 10.0).to_radians().sin());
            assert!(c.is_finite() && c.min_element() >= 0.0);
        }
        assert_eq!(sun_colour(-0.02), Vec3::ZERO);
    }
}
