//! The sky's light by elevation, so that boats fit the picture: exposure and white balance are the camera's own.

use glam::{DQuat, DVec2, DVec3, Vec3};

use super::{
    grid::azimuth_of,
    radiance::{Radiance, RadianceRow},
};
use crate::geometry::{CameraPose, Lens};

/// Elevations looked at, radians; negative ones are water.
const ELEVATIONS: [f64; 20] = [
    -0.5, -0.36, -0.26, -0.19, -0.14, -0.1, -0.07, -0.05, 0.01, 0.02, 0.035, 0.05, 0.07, 0.1, 0.13, 0.17,
    0.22, 0.28, 0.36, 0.45,
];
/// Azimuths looked at, radians from the middle of the view.
const SIDES: [f64; 5] = [-0.4, -0.2, 0.0, 0.2, 0.4];
/// Share of the old value kept at each look.
const KEEP: f64 = 0.85;
/// A channel above this is taken for cut off (sRGB code 247).
const CUT_OFF: f32 = 0.93;
/// A row whose looks were cut off this often is not used.
const CUT_OFF_SHARE: f64 = 0.3;
/// Weight of one look at the sky against one at the water, which is the mean over waves.
const SKY_WEIGHT: f64 = 0.3;

/// Running means of one direction.
#[derive(Clone, Copy, Debug, Default)]
struct SkyMean {
    light: [f64; 3],
    seen: bool,
    cut_off: f64,
}

/// Mean light by elevation and side.
#[derive(Clone, Debug, Default)]
pub(super) struct SkyRows {
    looks: [[SkyMean; SIDES.len()]; ELEVATIONS.len()],
}

impl SkyRows {
    /// Takes a picture in, water only where asked for. Azimuths count from `azimuth`.
    pub fn observe(
        &mut self,
        camera: &CameraPose,
        lens: &Lens,
        azimuth: f64,
        water: bool,
        colour: &dyn Fn(DVec2) -> Option<[f32; 3]>,
    ) {
        let camera_from_world: DQuat = camera.world_from_camera.inverse();
        for (row, e) in self.looks.iter_mut().zip(ELEVATIONS).filter(|(_, e)| water || *e > 0.0) {
            for (look, side) in row.iter_mut().zip(SIDES) {
                let flat = DVec2::new((azimuth + side).sin(), (azimuth + side).cos()) * e.cos();
                let ray: DVec3 = camera_from_world * flat.extend(e.sin());
                let Some(light) = lens.project(ray).and_then(colour) else { continue };
                if light.iter().any(|l| !l.is_finite() || *l < 0.0) {
                    continue;
                }
                let share = if look.seen { 1.0 - KEEP } else { 1.0 };
                let cut_off = light.iter().any(|l| *l > CUT_OFF);
                look.cut_off += (f64::from(u8::from(cut_off)) - look.cut_off) * share;
                for (old, new) in look.light.iter_mut().zip(light) {
                    *old += (f64::from(new) - *old) * share;
                }
                look.seen = true;
            }
        }
    }

    /// What was seen of one channel, where it was not cut off.
    pub fn rows(&self, channel: usize) -> Vec<RadianceRow> {
        let mut rows = Vec::new();
        for (looks, elevation) in self.looks.iter().zip(ELEVATIONS) {
            for look in looks {
                let light = look.light[channel];
                let fits = look.seen && look.cut_off < CUT_OFF_SHARE && light > 1e-5;
                if fits {
                    let weight = if elevation > 0.0 { SKY_WEIGHT } else { 1.0 };
                    rows.push(RadianceRow { elevation, light, weight });
                }
            }
        }
        rows
    }

    /// Share of the sky looked at that was cut off; 0 where none was looked at.
    fn cut_off_share(&self) -> f64 {
        let sky = self.looks.iter().zip(ELEVATIONS).filter(|(_, e)| *e > 0.0).flat_map(|(looks, _)| looks);
        let (sum, count) = sky.filter(|l| l.seen).fold((0.0, 0.0), |(s, n), l| (s + l.cut_off, n + 1.0));
        if count > 0.0 { sum / count } else { 0.0 }
    }
}

/// One picture as the sky's meter sees it.
pub struct SkyFrame<'a> {
    /// The camera; its z is the height of the eye above the mean sea.
    pub camera: CameraPose,
    /// The picture's lens.
    pub lens: &'a Lens,
    /// Linear colour at a pixel, 1 where the camera is white; `None` where something else than sky or water covers it.
    pub colour: &'a dyn Fn(DVec2) -> Option<[f32; 3]>,
}

/// Looks at sky and water of a picture now and then.
#[derive(Clone, Debug, Default)]
pub struct SkyMeter {
    rows: SkyRows,
    azimuth: Option<f64>,
    eye_m: f64,
}

/// A camera that has turned by more than this, radians, looks at another sky.
const TURNED: f64 = 0.3;

impl SkyMeter {
    /// A meter that has seen nothing.
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes a picture in: a hundred looks. Once or twice a second is enough; the means follow over about seven of them.
    pub fn observe(&mut self, frame: &SkyFrame<'_>) {
        if !(frame.camera.world_from_camera.is_finite() && frame.camera.position.is_finite()) {
            return;
        }
        let Some(azimuth) = azimuth_of(&frame.camera) else { return };
        if self.azimuth.is_none_or(|old| (azimuth - old).sin().abs() > TURNED || (azimuth - old).cos() < 0.0)
        {
            *self = Self { rows: SkyRows::default(), azimuth: Some(azimuth), eye_m: 0.0 };
        }
        self.eye_m = frame.camera.position.z.max(0.1);
        let middle = self.azimuth.unwrap_or(azimuth);
        self.rows.observe(&frame.camera, frame.lens, middle, true, frame.colour);
    }

    /// Sky and water that explain what was seen; `None` while too little water was seen. Takes about 20 ms.
    pub fn estimate(&self) -> Option<SkyEstimate> {
        let middle_azimuth_rad = self.azimuth?;
        let green = Radiance::fit(&self.rows.rows(1), self.eye_m)?;
        let of = |channel: usize| green.recolour(&self.rows.rows(channel));
        Some(SkyEstimate {
            channels: [of(0)?, green, of(2)?],
            middle_azimuth_rad,
            cut_off_share: self.rows.cut_off_share(),
            misfit: green.misfit,
        })
    }
}

/// The light of sky and water in the camera's own exposure and white balance.
///
/// Limits: one smooth fall from horizon to zenith (single clouds are averaged), even over azimuth; where the sky is cut off,
/// it follows from its reflection alone, which a lens's flare or vignetting bends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkyEstimate {
    channels: [Radiance; 3],
    /// Azimuth of the middle of the view it was seen in, radians clockwise from north.
    pub middle_azimuth_rad: f64,
    /// Share of the sky in the picture that was cut off at white.
    pub cut_off_share: f64,
    /// Root mean square of the relative misfit: a measure of the error.
    pub misfit: f64,
}

impl SkyEstimate {
    fn each(&self, value: impl Fn(&Radiance) -> f64) -> Vec3 {
        Vec3::from_array(self.channels.each_ref().map(|c| value(c) as f32))
    }

    /// Light of the sky at an elevation above the horizon, radians; linear, 1 where the camera is white. It may exceed 1.
    pub fn radiance(&self, elevation: f64) -> Vec3 {
        self.each(|c| c.light(elevation.clamp(1e-6, std::f64::consts::FRAC_PI_2)))
    }

    /// Mean light of water at a depression below the horizon, radians.
    pub fn water(&self, depression: f64) -> Vec3 {
        self.each(|c| c.light(-depression.clamp(1e-3, std::f64::consts::FRAC_PI_2)))
    }

    /// What a white matt deck under the whole sky would look like: the sky's mean by the cosine of the zenith angle.
    pub fn white_deck(&self) -> Vec3 {
        let n = 64;
        let ring = |i: i32| {
            // Even steps of sin^2(elevation) hold equal shares of what a deck receives.
            let sine = ((f64::from(i) + 0.5) / f64::from(n)).sqrt();
            self.radiance(sine.asin()) / n as f32
        };
        (0..n).map(ring).sum()
    }

    /// Light that comes out of the water itself.
    pub fn upwelling(&self) -> Vec3 {
        self.each(|c| c.parts[2])
    }

    /// Root mean square slope per axis of the water.
    pub fn rough_slope(&self) -> f64 {
        self.channels[1].rough
    }
}
