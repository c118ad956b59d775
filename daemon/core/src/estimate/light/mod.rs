//! Light on the boats, taken from the picture itself so that they fit it.
//!
//! A few hundred pixels above the horizon are a part of some sky under the sun or, by night, the moon ([`SkyClock`]), at the camera's own
//! exposure and white balance ([`SkyFamily`]): it supplies the rest of the dome, the sun, and the luminance that is white. These are estimates for drawing, not
//! photometric measurements.

mod dome;
mod luminary;
mod noise;
mod sky;
mod tones;

pub use dome::{FittedSky, SkyFamily, SkyPixel};
pub use luminary::{Luminaries, SkyClock};
pub use noise::{CameraNoise, SeenNoise};
pub use sky::{SKY_SINES, SkyLight};
pub use tones::{SeaTones, ToneSample};

use glam::{DVec2, DVec3, Vec3};
use noise::NoiseMeter;

use crate::{
    colour::{LUMINANCE, srgb_to_linear},
    daylight::Daylight,
    event::{Picture, ShipFix},
    geometry::{CameraPose, Lens},
    sea::{Facets, rms_slope},
    sky::SkyLobes,
    time::Time,
};

/// The estimate follows the picture with this time constant, so that one dark wave or passing bird does not flicker boats.
const FOLLOW_S: f64 = 1.0;

/// Luminance of white in the picture of a camera at its utmost, cd/m^2: 30 pictures a second at f/1.4 with pixels of 2.9 um and a gain of 30 dB
/// collect 700 electrons for 1 cd/m^2, of 375 that are white then.
const WHITE_LEAST_CD_M2: f64 = 0.5;

/// Sine of the sun's elevation from which it is day under every cloud.
const DAY_ABOVE: f64 = 0.1;

/// Pixels sampled along the picture's width and height.
const GRID: (u32, u32) = (24, 18);

/// Least time between two fits of the whole sky, seconds: it changes slowly, and a fit takes a quarter of a millisecond.
const FIT_EVERY_S: f64 = 0.5;

/// Light that comes out of the sea over the light that falls on it: clear to coastal water, 0.01 to 0.03 under the surface (Mobley
/// 1994, section 3.3), of which the surface lets half out.
const WATER_ALBEDO: f32 = 0.015;

/// Tangents below the horizontal at which the sea is compared with the sky: farther up waves hide each other, farther down is more of
/// the water's own light.
const MIRROR_TANGENTS: [f64; 5] = [0.03, 0.045, 0.07, 0.11, 0.17];

/// Nodes of slope to either side that stand for the facets there.
const MIRROR_NODES: u8 = 8;

/// Bounds of what the sea may call for over what is seen above the horizon.
const MATCH: [f32; 2] = [0.3, 2.0];

/// Light, linear, in units in which the video's white is 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Unit vector towards the sun, world; by night towards the moon, where that gives more light.
    pub sun_direction: DVec3,
    /// Radiance of a white matt surface that faces it, without the sky; zero when it is down.
    pub sun: Vec3,
    /// Radiance of a white matt surface that lies level under the sky without the sun.
    pub sky: Vec3,
    /// The light of the whole sky by direction, world.
    pub dome: SkyLobes,
    /// Radiance of the sky at the horizon: what haze adds and what the sea's lower hemisphere is mixed from.
    pub horizon: Vec3,
    /// Radiance that a surface gets from the sea below.
    pub sea: Vec3,
}

impl Light {
    /// Radiance of a white matt surface that lies level under sun and sky.
    pub fn on_level(&self) -> Vec3 {
        self.sky + self.sun * self.sun_direction.z.max(0.0) as f32
    }

    /// Tests whether the sun shines so that its shadows are seen: on what faces it, it adds more than a fiftieth of the sky's light.
    pub fn sun_shines(&self) -> bool {
        const SHARE: f32 = 0.02;
        self.sun.max_element() > SHARE * self.sky.max_element()
    }
}

/// Agreement of a picture's light with the scenario's sun.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SkyAgreement {
    /// It may be that sun's.
    #[default]
    Plausible,
    /// The sun is below the horizon by more than six degrees, and the sky is bright.
    BrightAtNight,
    /// The sun stands above the horizon by more than six degrees, and the sky is dark.
    DarkByDay,
}

/// Mean linear colours of sky and sea as the camera sees them.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Means {
    sky: Vec3,
    horizon: Vec3,
    sea: Vec3,
}

/// The sky that was fitted, followed.
#[derive(Clone, Copy, Debug)]
struct FollowedSky {
    fitted: Time,
    dome: SkyLobes,
    sun: Vec3,
    /// The camera's light for a luminance of 1 cd/m^2.
    per_cd_m2: f64,
}

/// Follows the light of the picture.
#[derive(Clone, Debug)]
pub struct LightMeter {
    clock: SkyClock,
    family: SkyFamily,
    /// Direction of the body that the family's skies are for.
    family_of: DVec3,
    /// Skies of the family that are still for another.
    outdated: usize,
    sky: Option<FollowedSky>,
    /// Whether the sea's tones are wanted: only reflections by brightness need them.
    wants_tones: bool,
    means: Option<(Time, Means)>,
    tones: Option<(Time, SeaTones)>,
    /// Under a sun that stays up no camera has noise that is seen on boats.
    noise: Option<NoiseMeter>,
}

impl LightMeter {
    /// A meter for a scene of that daylight. The sea's brightness is measured only where it is wanted: reflections by brightness need it.
    pub fn new(daylight: &Daylight, wants_tones: bool) -> Self {
        let sun = daylight.sun_direction;
        Self {
            clock: SkyClock::new(daylight),
            family: SkyFamily::new(sun),
            family_of: sun,
            outdated: 0,
            sky: None,
            wants_tones,
            means: None,
            tones: None,
            noise: (!daylight.stays_up()).then(NoiseMeter::default),
        }
    }

    /// Takes in where the ship is, or what time it is.
    pub fn fix(&mut self, fix: &ShipFix) {
        self.clock.fix(fix);
    }

    /// Sun and moon at the newest picture.
    pub const fn luminaries(&self) -> &Luminaries {
        self.clock.luminaries()
    }

    /// Follows sun and moon, and the skies that they make: one of these a picture, each takes milliseconds.
    fn follow_luminaries(&mut self, time: Time) {
        /// Angle by which the family's body may be off, radians.
        const OFF: f64 = 0.25 * std::f64::consts::PI / 180.0;
        self.clock.follow(time);
        let brightest = self.luminaries().brightest();
        if self.family_of.angle_between(brightest) > OFF {
            self.family_of = brightest;
            self.outdated = self.family.count();
        }
        if let Some(number) = self.outdated.checked_sub(1) {
            self.family.renew(number, self.family_of);
            self.outdated = number;
        }
    }

    /// Takes in a picture whose camera stood at `camera` with `lens` (the picture's own, not the screen's).
    pub fn observe(&mut self, time: Time, picture: &Picture, lens: &Lens, camera: &CameraPose) {
        self.follow_luminaries(time);
        self.follow_noise(time, picture);
        if self.wants_tones
            && let Some(seen) = tones(picture, lens, camera)
        {
            let seen = match self.tones {
                None => seen,
                Some((since, old)) => old.towards(&seen, time.smoothing_since(since, FOLLOW_S)),
            };
            self.tones = Some((time, seen));
        }
        let mut pixels = self.is_fit_due(time).then(Vec::new);
        let Some(seen) = measure(picture, lens, camera, pixels.as_mut()) else { return };
        if let Some(pixels) = pixels {
            self.follow_sky(time, &pixels);
        }
        let means = match self.means {
            None => seen,
            Some((since, old)) => {
                let share = time.smoothing_since(since, FOLLOW_S);
                Means {
                    sky: old.sky.lerp(seen.sky, share),
                    horizon: old.horizon.lerp(seen.horizon, share),
                    sea: old.sea.lerp(seen.sea, share),
                }
            }
        };
        self.means = Some((time, means));
    }

    /// Looks at the camera's noise, unless the sun is well up.
    fn follow_noise(&mut self, time: Time, picture: &Picture) {
        let (is_day, on_level) = (self.luminaries().sun.z > DAY_ABOVE, self.light().on_level());
        match &mut self.noise {
            Some(noise) if is_day => *noise = NoiseMeter::default(),
            Some(noise) => noise.observe(time, picture, on_level),
            None => {}
        }
    }

    fn is_fit_due(&self, time: Time) -> bool {
        self.sky.is_none_or(|sky| !(0.0..FIT_EVERY_S).contains(&time.secs_since(sky.fitted)))
    }

    /// Fits the whole sky to the pixels of its part in view.
    fn follow_sky(&mut self, time: Time, pixels: &[SkyPixel]) {
        let Some(fitted) = self.family.fit(pixels) else { return };
        let sun = (fitted.sun + fitted.aureole) / std::f32::consts::PI;
        let per_cd_m2 = f64::from(fitted.gain.dot(LUMINANCE)) / self.luminaries().brightest_lux().max(1e-9);
        self.sky = Some(match self.sky {
            None => FollowedSky { fitted: time, dome: fitted.lobes, sun, per_cd_m2 },
            Some(old) => {
                let share = time.smoothing_since(old.fitted, FOLLOW_S);
                let dome = old.dome.towards(&fitted.lobes, share);
                let per_cd_m2 = old.per_cd_m2 + (per_cd_m2 - old.per_cd_m2) * f64::from(share);
                FollowedSky { fitted: time, dome, sun: old.sun.lerp(sun, share), per_cd_m2 }
            }
        });
    }

    /// Agreement of the sky in the pictures with the sun's elevation; `None` before a sky was seen.
    pub fn agreement(&self) -> Option<SkyAgreement> {
        /// Sine of the sun's elevation at the end of civil twilight.
        const NIGHT_BELOW: f64 = -0.1045;
        /// Radiance of a sky by day, that no camera makes of a night's, and of one that is none by day, over that of white.
        const BRIGHT: f32 = 0.2;
        const DARK: f32 = 0.01;
        let (_, means) = self.means?;
        let (sky, sine) = (means.sky.dot(LUMINANCE), self.luminaries().sun.z);
        Some(if sine < NIGHT_BELOW && sky > BRIGHT {
            SkyAgreement::BrightAtNight
        } else if sine > DAY_ABOVE && sky < DARK {
            SkyAgreement::DarkByDay
        } else {
            SkyAgreement::Plausible
        })
    }

    /// The sky that boats hide from a sea under a wind of `wind_m_s`: what is seen of it above the horizon, as bright and of the colour
    /// that the sea's own brightness calls for. The picture shows little of what the sea mirrors, and land before it, or none.
    pub fn sky(&self, wind_m_s: f64) -> SkyLight {
        let Means { sky, horizon, sea } = self.means();
        let seen = SkyLight::of_bands(horizon, sky);
        let Some((_, tones)) = self.tones else { return seen };
        let from_below = WATER_ALBEDO * self.light().on_level();
        let hue = sea / sea.dot(LUMINANCE).max(1e-4);
        let (mut found, mut expected) = (Vec3::ZERO, Vec3::ZERO);
        for tangent in MIRROR_TANGENTS {
            let Some(luma) = tones.mean_at(tangent) else { continue };
            let facets = Facets::seen(-tangent.atan(), 0.0, rms_slope(wind_m_s), MIRROR_NODES);
            let own = from_below * facets.through as f32;
            let mirrored = facets.mirrored.iter().map(|m| seen.at(m.sine) * m.share as f32).sum::<Vec3>();
            // Rows count alike, however bright they are.
            let scale = 1.0 / mirrored.dot(LUMINANCE).max(1e-4);
            found += (hue * srgb_to_linear(luma) - own) * scale;
            expected += mirrored * scale;
        }
        if expected.min_element() <= 0.0 {
            return seen;
        }
        let [least, most] = MATCH;
        seen.scaled((found / expected).clamp(Vec3::splat(least), Vec3::splat(most)))
    }

    /// The camera's noise, where it is seen on boats.
    pub fn noise(&self) -> Option<SeenNoise> {
        self.noise.as_ref().and_then(NoiseMeter::seen)
    }

    /// How bright the sea is; a default where that is not measured.
    pub fn tones(&self) -> SeaTones {
        self.tones.map(|(_, tones)| tones).unwrap_or_default()
    }

    /// Before the first picture: an overcast grey.
    fn means(&self) -> Means {
        self.means.map_or(
            Means { sky: Vec3::splat(0.4), horizon: Vec3::splat(0.45), sea: Vec3::splat(0.1) },
            |(_, m)| m,
        )
    }

    /// Luminance that the camera shows as white, cd/m^2: that of the fitted sky over how bright it is in the picture. Where it is too dark
    /// for a sky to be fitted, and beyond it, a camera's utmost.
    pub fn white_cd_m2(&self) -> f64 {
        self.sky.map_or(0.0, |sky| 1.0 / sky.per_cd_m2.max(1e-12)).max(WHITE_LEAST_CD_M2)
    }

    /// The light to draw boats with. Before a sky was seen, and where it is too dark to tell: as from everywhere what is seen of it, without
    /// a sun.
    pub fn light(&self) -> Light {
        let Means { sky, horizon, sea } = self.means();
        let (dome, sun) =
            self.sky.map_or_else(|| (SkyLobes::even(sky), Vec3::ZERO), |sky| (sky.dome, sky.sun));
        let level = dome.on_level().max(Vec3::ZERO) / std::f32::consts::PI;
        Light { sun_direction: self.luminaries().brightest(), sun, sky: level, dome, horizon, sea }
    }
}

/// Sea is looked at from this far below the horizontal, tangent: what is nearer the horizon is haze and other boats.
const SEA_FROM: f64 = 0.008;
/// Pixels looked at along the picture's width, and from the horizon down.
const SEA_GRID: (usize, usize) = (24, 20);

fn tones(picture: &Picture, lens: &Lens, camera: &CameraPose) -> Option<SeaTones> {
    let (w, h) = (f64::from(lens.width), f64::from(lens.height));
    let down = |pixel: DVec2| camera.tangent_below(lens, pixel);
    // Rows from the first that shows sea down to the lowest, closer to each other near the horizon. Tangents grow about evenly downwards.
    let middle = |y: f64| down(DVec2::new(w / 2.0, y * h));
    let (top, bottom) = (middle(0.0), middle(1.0));
    let first = ((SEA_FROM - top) / (bottom - top).max(1e-9)).clamp(0.0, 1.0);
    let mut samples = [ToneSample { tangent: 0.0, luma: 0.0 }; SEA_GRID.0 * SEA_GRID.1];
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
            *sample = ToneSample { tangent, luma: f64::from(code.dot(LUMINANCE)) };
            count += 1;
        }
    }
    SeaTones::fit(samples.get(..count)?)
}

/// Mean colours; the pixels of the sky are added to `pixels`.
fn measure(
    picture: &Picture,
    lens: &Lens,
    camera: &CameraPose,
    mut pixels: Option<&mut Vec<SkyPixel>>,
) -> Option<Means> {
    let mut sums = [Vec3::ZERO; 3];
    let mut counts = [0u32; 3];
    for iy in 0..GRID.1 {
        for ix in 0..GRID.0 {
            let share = DVec2::new(
                (f64::from(ix) + 0.5) / f64::from(GRID.0),
                (f64::from(iy) + 0.5) / f64::from(GRID.1),
            );
            let pixel = share * DVec2::new(f64::from(lens.width), f64::from(lens.height));
            let direction = camera.world_from_camera * lens.unproject(pixel);
            // Sky; the strip of 0.5 to 6 degrees over the horizon; sea from 2 degrees below it.
            let class = match direction.z {
                u if u > 0.105 => 0,
                u if u > 0.009 => 1,
                u if u < -0.035 => 2,
                _ => continue,
            };
            let place = share * DVec2::new(f64::from(picture.width()), f64::from(picture.height()));
            let colour = picture.srgb_at(place.x as u32, place.y as u32).map(srgb_to_linear);
            let radiance = Vec3::from_array(colour);
            sums[class] += radiance;
            counts[class] += 1;
            if let (0 | 1, Some(pixels)) = (class, &mut pixels) {
                pixels.push(SkyPixel { direction, radiance });
            }
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
    use crate::{colour::linear_to_srgb, event::PixelFormat, geometry::look};

    fn meter(sun_direction: DVec3, wants_tones: bool) -> LightMeter {
        LightMeter::new(&Daylight::fixed(sun_direction, 20_000.0), wants_tones)
    }

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
        let mut meter = meter(DVec3::new(0.0, 0.6, 0.8), false);
        meter.observe(Time::from_ns(0), &two_tone(188, 99), &lens, &camera);
        let light = meter.light();
        // A grey sky that is as bright everywhere is an overcast one, brighter above.
        let seen = srgb_to_linear(188.0 / 255.0);
        assert!(light.sky.x > 0.8 * seen && light.sky.x < 3.0 * seen, "{} {seen}", light.sky);
        assert!((light.horizon.x - seen).abs() < 1e-4);
        assert!((light.sea.y - srgb_to_linear(99.0 / 255.0)).abs() < 1e-4);
        // A dark picture ten time constants later is followed.
        meter.observe(Time::from_ns(0).plus_secs(10.0), &two_tone(60, 30), &lens, &camera);
        assert!(meter.light().sky.x < 0.06 * light.sky.x / seen);
    }

    #[test]
    fn a_sky_that_cannot_be_that_of_the_sun_is_told() {
        let lens = Lens::pinhole(64, 64, 1.0);
        let camera = CameraPose { world_from_camera: look(0.0, 0.0, 0.0), position: DVec3::Z };
        let of = |sine: f64, code: u8| {
            let mut meter = meter(DVec3::new((1.0 - sine * sine).sqrt(), 0.0, sine), false);
            assert_eq!(meter.agreement(), None);
            meter.observe(Time::from_ns(0), &two_tone(code, code / 2), &lens, &camera);
            meter.agreement().expect("a sky was seen")
        };
        assert_eq!(of(-0.2, 180), SkyAgreement::BrightAtNight);
        assert_eq!(of(0.5, 10), SkyAgreement::DarkByDay);
        // Dusk, an overcast day, a night.
        for (sine, code) in [(-0.08, 200), (0.3, 90), (-0.5, 60), (0.02, 20)] {
            assert_eq!(of(sine, code), SkyAgreement::Plausible, "{sine} {code}");
        }
    }

    #[test]
    fn noise_is_looked_for_by_night_even_where_nothing_but_sea_is_seen() {
        let lens = Lens::pinhole(96, 96, 0.5);
        let camera = CameraPose { world_from_camera: look(0.0, -0.9, 0.0), position: DVec3::Z };
        // Checks of 12 codes pass for noise.
        let code = |i: u32| 60 + 12 * (i.wrapping_mul(2_654_435_761) >> 31) as u8;
        let bytes: Vec<u8> = (0..96 * 96).flat_map(|i| [code(i); 3]).collect();
        let grainy = Picture::new(PixelFormat::Rgb, 96, 96, bytes.into()).unwrap();
        for (sine, is_seen) in [(-0.3, true), (0.3, false)] {
            let mut meter = meter(DVec3::new(1.0, 0.0, sine).normalize(), false);
            meter.observe(Time::from_ns(0), &grainy, &lens, &camera);
            assert_eq!(meter.noise().is_some(), is_seen, "{sine}");
        }
    }

    /// A sea that mirrors `share` of the sky that is seen above it.
    fn mirroring(share: f64, lens: &Lens, camera: &CameraPose, wind_m_s: f64) -> Picture {
        let above = srgb_to_linear(200.0 / 255.0);
        let row = |y: u32| {
            let up = (camera.world_from_camera * lens.unproject(DVec2::new(32.0, f64::from(y) + 0.5))).z;
            if up > 0.0 {
                return 200;
            }
            let facets = Facets::seen(up.asin(), 0.0, rms_slope(wind_m_s), MIRROR_NODES);
            let mirrored: f64 = facets.mirrored.iter().map(|m| m.share).sum();
            let light = above * (mirrored * share + facets.through * f64::from(WATER_ALBEDO)) as f32;
            (linear_to_srgb(light) * 255.0).round() as u8
        };
        let bytes: Vec<u8> = (0..64).flat_map(|y| vec![row(y); 64 * 3]).collect();
        Picture::new(PixelFormat::Rgb, 64, 64, bytes.into()).unwrap()
    }

    #[test]
    fn the_sky_that_the_sea_mirrors_is_as_bright_as_the_sea_says() {
        let lens = Lens::pinhole(64, 64, 0.5);
        let camera = CameraPose { world_from_camera: look(0.0, 0.0, 0.0), position: DVec3::Z };
        // The sun is down: nothing but the sky falls on the water.
        for share in [0.4, 1.0, 1.6] {
            let mut meter = meter(-DVec3::Z, true);
            meter.observe(Time::from_ns(0), &mirroring(share, &lens, &camera, 2.0), &lens, &camera);
            let times = meter.sky(2.0).at(0.1).y / srgb_to_linear(200.0 / 255.0);
            assert!((f64::from(times) / share - 1.0).abs() < 0.1, "{share}: {times}");
        }
        // However little the two have to do with each other, what is taken stays within bounds.
        let mut meter = meter(-DVec3::Z, true);
        meter.observe(Time::from_ns(0), &two_tone(0, 255), &lens, &camera);
        assert!(meter.sky(5.0).nodes.iter().all(|n| n.is_finite() && n.min_element() >= 0.0));
    }
}
