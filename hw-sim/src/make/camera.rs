//! From light to a JPEG: the camera with its roll and elevation, its lens, its noise and its transfer curve.

use bowwave_core::{
    colour::linear_to_srgb,
    geometry::{CameraPose, Lens, look},
};
use glam::{DQuat, DVec2, DVec3, Mat3, Vec3, Vec4};
use image::ImageError;
use rand_pcg::{Pcg32, rand_core::Rng};

use super::{
    march::{LevelView, SeaPicture, SeaShader, ViewShape},
    recipe::Recipe,
};
use crate::{
    jpeg,
    ocean::{
        cloudy::{CloudySky, Panorama, arctangent},
        looped::{LoopedSurface, split},
        noise::{smoothstep, upper_quantile},
        random::mix,
    },
};

/// Steps of the transfer table over 0 to [`LIGHT_MAX`].
const TRANSFER: usize = 8192;
/// Light at which the sensor is full, in units of white.
pub(crate) const LIGHT_MAX: f32 = 1.6;
/// Values of the noise table; 10 bits of a random number choose one.
const NOISE: usize = 1024;
/// Steps of the noise's deviation over 0 to [`LIGHT_MAX`].
const DEVIATIONS: usize = 128;

/// Everything to see but the waves.
pub(crate) struct SeaScene {
    pub sky: CloudySky,
    pub panorama: Panorama,
    pub water: SeaShader,
}

/// The properties of the camera that stay the same from frame to frame.
pub(crate) struct RecipeCamera {
    lens: Lens,
    /// Undistorted normalised coordinates of every pixel's centre, and its share of light.
    rays: Vec<[f32; 3]>,
    transfer: Vec<u8>,
    /// Deviation of the noise by light, in [`DEVIATIONS`] steps up to [`LIGHT_MAX`].
    deviation: Vec<f32>,
    normal: Vec<f32>,
    quality: u8,
    seed: u64,
    level_focal: f32,
    /// Seconds from one row to the next.
    row_s: f64,
}

/// Memory for one frame.
#[derive(Default)]
pub(crate) struct FrameMemory {
    sea: SeaPicture,
    pub rgb: Vec<u8>,
}

impl RecipeCamera {
    pub fn new(recipe: &Recipe) -> Self {
        let lens = recipe.lens();
        let rays = (0..lens.height)
            .flat_map(|y| (0..lens.width).map(move |x| (x, y)))
            .map(|(x, y)| {
                let ray = lens.unproject(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5));
                let fall_off = fall_off(recipe.camera.vignetting, ray);
                [(ray.x / ray.z) as f32, (ray.y / ray.z) as f32, fall_off as f32]
            })
            .collect();
        let transfer = (0..TRANSFER)
            .map(|i| (255.0 * transfer((i as f32 + 0.5) * LIGHT_MAX / TRANSFER as f32)).round() as u8)
            .collect();
        let (read, shot) = (recipe.camera.read_noise as f32, recipe.camera.shot_noise as f32);
        // Twice as long as used, so that its length is a power of two.
        let deviation = (0..2 * DEVIATIONS)
            .map(|i| (read + shot * (i as f32 + 0.5) * LIGHT_MAX / DEVIATIONS as f32).sqrt())
            .collect();
        let normal = normal_table(NOISE);
        Self {
            rays,
            transfer,
            deviation,
            normal,
            quality: recipe.camera.jpeg_quality,
            seed: mix(recipe.seed),
            level_focal: level_focal(&lens),
            row_s: recipe.camera.readout_ns as f64 * 1e-9 / f64::from(lens.height),
            lens,
        }
    }

    /// Draws the sea so many times as finely.
    pub fn refine(&mut self, detail: f32) {
        self.level_focal *= detail;
    }

    /// Draws what the camera sees of `scene` from `pose` into `memory.rgb`; `turned` is how it is turned so many seconds later.
    pub fn expose(
        &self,
        scene: &SeaScene,
        surface: &LoopedSurface,
        (pose, turned): (&CameraPose, &dyn Fn(f64) -> DQuat),
        frame: u32,
        memory: &mut FrameMemory,
    ) {
        let forward = pose.world_from_camera * DVec3::Z;
        let azimuth = forward.x.atan2(forward.y);
        let level_from_world = look(azimuth, 0.0, 0.0).inverse();
        let middle = f64::from(self.lens.height) / 2.0;
        let turn = |row: usize| {
            let world_from_camera = match self.row_s {
                0.0 => pose.world_from_camera,
                row_s => turned((row as f64 + 0.5 - middle) * row_s),
            };
            Mat3::from_quat((level_from_world * world_from_camera).normalize().as_quat())
        };
        let turns: Vec<Mat3> = (0..self.lens.height as usize).map(turn).collect();
        let eye_height = pose.position.z as f32;
        let view = self.level_view(&turns, azimuth as f32, eye_height);
        scene.water.draw(surface, &scene.sky, &view, eye_height, &mut memory.sea);
        let sun = (level_from_world * scene.sky.sun.as_dvec3()).as_vec3();
        let width = self.lens.width as usize;
        memory.rgb.resize(self.rays.len() * 3, 0);
        let rows = memory.rgb.chunks_mut(width * 3).zip(self.rays.chunks(width));
        for (y, ((row, rays), turn)) in rows.zip(turns).enumerate() {
            let mut random = Pcg32::new(mix(self.seed ^ u64::from(frame)), y as u64);
            for (pixel, ray) in row.chunks_exact_mut(3).zip(rays) {
                let light = light(scene, turn, *ray, &view, &memory.sea, sun);
                self.develop(light, ray[2], random.next_u32(), pixel);
            }
        }
    }

    /// A level camera that sees all of the sea that the camera sees, turned row by row.
    fn level_view(&self, turns: &[Mat3], azimuth: f32, eye_height: f32) -> LevelView {
        let (w, h) = (self.lens.width as usize, self.lens.height as usize);
        let (mut left, mut right, mut lowest) = (0.0f32, 0.0f32, 0.0f32);
        let border =
            (0..w).flat_map(|x| [(x, 0), (x, h - 1)]).chain((0..h).flat_map(|y| [(0, y), (w - 1, y)]));
        for (x, y) in border {
            let [nx, ny, _] = self.rays[y * w + x];
            let d = turns[y] * Vec3::new(nx, ny, 1.0);
            let (u, v) = (d.x / d.z.max(0.1), d.y / d.z.max(0.1));
            (left, right, lowest) = (left.min(u), right.max(u), lowest.max(v));
        }
        let focal = self.level_focal;
        // Crests of high seas may stand above the level of a low eye.
        let margin = 4.0 + focal * (0.5 / eye_height).min(0.2);
        LevelView {
            shape: ViewShape::Plane,
            width: ((right - left) * focal) as usize + 6,
            height: (lowest * focal + margin) as usize + 4,
            focal,
            centre: -left * focal + 3.0,
            level_row: margin.floor(),
            azimuth,
        }
    }

    #[inline(always)]
    fn develop(&self, light: Vec4, fall_off: f32, random: u32, pixel: &mut [u8]) {
        const PER_LIGHT: f32 = TRANSFER as f32 / LIGHT_MAX;
        let clean = (light * fall_off).clamp(Vec4::ZERO, Vec4::splat(LIGHT_MAX));
        let shades = (clean * (DEVIATIONS as f32 / LIGHT_MAX)).to_array();
        let noise = |c: usize| {
            let deviation = self.deviation[split(shades[c]).0 & (2 * DEVIATIONS - 1)];
            deviation * self.normal[(random >> (10 * c + 1)) as usize & (NOISE - 1)]
        };
        let exposed = clean + Vec4::new(noise(0), noise(1), noise(2), 0.0);
        let steps =
            (exposed * PER_LIGHT).clamp(Vec4::splat(0.5), Vec4::splat(TRANSFER as f32 - 0.5)).to_array();
        for (value, step) in pixel.iter_mut().zip(steps) {
            *value = self.transfer[split(step).0 & (TRANSFER - 1)];
        }
    }

    /// The JPEG of a drawn frame.
    pub fn encode(&self, rgb: &[u8]) -> Result<Vec<u8>, ImageError> {
        jpeg::encode(rgb, (self.lens.width, self.lens.height), self.quality)
    }
}

/// Light that falls on the sensor along a ray of the camera, turned into the level view.
#[inline(always)]
fn light(scene: &SeaScene, turn: Mat3, ray: [f32; 3], view: &LevelView, sea: &SeaPicture, sun: Vec3) -> Vec4 {
    let d = turn * Vec3::new(ray[0], ray[1], 1.0);
    let inverse = 1.0 / d.z;
    let (nx, ny) = (d.x * inverse, d.y * inverse);
    let water = bilinear(sea, view, nx * view.focal + view.centre, ny * view.focal + view.level_row);
    let open = 1.0 - water[3];
    if open < 1e-3 {
        return water;
    }
    let tangent = -ny / (1.0 + nx * nx).sqrt();
    let sky = open_sky(scene, view.azimuth + arctangent(nx), tangent, d, sun);
    water + open * sky
}

/// Light of the sky, with the sun's disc: `d` looks there and `sun` to the sun, in the same axes.
#[inline(always)]
pub(crate) fn open_sky(scene: &SeaScene, azimuth: f32, tangent: f32, d: Vec3, sun: Vec3) -> Vec4 {
    /// Half the sun's diameter, radians.
    const SUN_RADIUS: f32 = 0.004_65;
    let mut sky = scene.panorama.at(azimuth, tangent);
    let towards = d.dot(sun);
    if towards > 0.0 && towards * towards > d.length_squared() * (1.0 - 6.0 * SUN_RADIUS * SUN_RADIUS) {
        let off = d.normalize().cross(sun).length();
        let disc = 1.0 - smoothstep(0.9 * SUN_RADIUS, 1.15 * SUN_RADIUS, off);
        sky += 50.0 * disc;
    }
    sky
}

#[inline(always)]
fn bilinear(sea: &SeaPicture, view: &LevelView, u: f32, v: f32) -> Vec4 {
    let v = v - 0.5;
    if v <= -1.0 {
        return Vec4::ZERO;
    }
    let u = (u - 0.5).clamp(0.0, (view.width - 1) as f32 - 1e-2);
    let v = v.clamp(0.0, (view.height - 1) as f32 - 1e-2);
    let ((iu, fu), (iv, fv)) = (split(u), split(v));
    let at = iv.min(view.height - 2) * view.width + iu.min(view.width - 2);
    let Some(upper) = sea.texels.get(at..at + 2) else { return Vec4::ZERO };
    let lower = sea.texels.get(at + view.width..at + view.width + 2).unwrap_or(upper);
    upper[0].lerp(upper[1], fu).lerp(lower[0].lerp(lower[1], fu), fv)
}

/// Share of the light along a ray that a lens lets through: the natural fall-off (cosine to the fourth), or a part of it.
pub(crate) fn fall_off(vignetting: f64, ray: DVec3) -> f64 {
    1.0 - vignetting * (1.0 - ray.z.powi(4))
}

/// Standard normal numbers whose ranks are spread evenly.
pub(crate) fn normal_table(count: usize) -> Vec<f32> {
    (0..count)
        .map(|i| {
            let p = (i as f64 + 0.5) / count as f64;
            (if p < 0.5 { -upper_quantile(p) } else { upper_quantile(1.0 - p) }) as f32
        })
        .collect()
}

/// The camera's transfer curve: code of a light, 0 to 1.
pub(crate) fn transfer(light: f32) -> f32 {
    linear_to_srgb(shoulder(light))
}

/// Rolls highlights off from 70 % on instead of cutting them at white.
fn shoulder(light: f32) -> f32 {
    const KNEE: f32 = 0.7;
    if light < KNEE { light } else { KNEE + (1.0 - KNEE) * (1.0 - (-(light - KNEE) / (1.0 - KNEE)).exp()) }
}

/// Focal length of the level picture of the sea. A lens and a colour sensor do not resolve single pixels: drawing the sea a
/// little coarser than the picture costs a quarter less and looks the same.
pub(crate) fn level_focal(lens: &Lens) -> f32 {
    0.88 * lens.focal.x as f32
}

/// Extent of a whole recording's view: azimuths from the first to the last (clockwise), and the largest tangents
/// of elevation above and below the horizontal.
pub(crate) struct ViewCoverage {
    pub azimuth: [f32; 2],
    pub above: f32,
    pub below: f32,
}

impl ViewCoverage {
    pub fn new(recipe: &Recipe) -> Self {
        let (lens, motion) = (recipe.lens(), recipe.motion());
        let (w, h) = (f64::from(lens.width), f64::from(lens.height));
        let border: Vec<DVec3> = (0..=8)
            .flat_map(|i| {
                let (x, y) = (w * f64::from(i) / 8.0, h * f64::from(i) / 8.0);
                [DVec2::new(x, 0.0), DVec2::new(x, h), DVec2::new(0.0, y), DVec2::new(w, y)]
            })
            .map(|pixel| lens.unproject(pixel))
            .collect();
        let azimuth_of = |q: DQuat, d: DVec3| {
            let d = q * d;
            d.x.atan2(d.y)
        };
        let first = azimuth_of(motion.at(0.0).pose.world_from_camera, DVec3::Z);
        let (mut least, mut most, mut above, mut below) = (0.0f64, 0.0f64, 0.05f64, 0.05f64);
        for i in 0..recipe.frames() {
            let q = motion.at(f64::from(i) / recipe.frame_rate_hz).pose.world_from_camera;
            for &ray in &border {
                let off = azimuth_of(q, ray) - first;
                let off = off - (off / std::f64::consts::TAU).round() * std::f64::consts::TAU;
                (least, most) = (least.min(off), most.max(off));
                let d = q * ray;
                let tangent = d.z / d.x.hypot(d.y).max(1e-3);
                (above, below) = (above.max(tangent), below.max(-tangent));
            }
        }
        // A view past straight behind the first one needs the whole circle.
        let around = most - least > 5.0;
        let azimuth = if around { [-3.2, 3.2] } else { [first + least - 0.01, first + most + 0.01] };
        Self {
            azimuth: azimuth.map(|a| a as f32),
            above: (above * 1.02 + 0.01) as f32,
            below: (below * 1.02 + 0.01) as f32,
        }
    }
}
