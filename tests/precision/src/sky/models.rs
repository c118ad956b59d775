//! Published sky models that the product does not use.

use std::f64::consts::{FRAC_PI_2, PI};

use bowwave_core::sky::{SkyModel, sunlight};
use glam::{DVec3, Vec3};
use hw_skymodel::rgb::{Channel, SkyParams, SkyState};

use super::irradiance;

/// Hosek and Wilkie 2012 in linear sRGB; a sun below one degree stands there.
pub struct Hosek {
    state: Option<Box<SkyState>>,
    sun: DVec3,
    sunlight: Vec3,
    ground: Vec3,
}

impl Hosek {
    /// For that sun.
    pub fn new(sun: DVec3, turbidity: f32) -> Self {
        let elevation = (sun.z.asin() as f32).clamp(0.017, 1.55);
        let params = SkyParams { elevation, turbidity: turbidity.clamp(1.0, 10.0), albedo: [0.06; 3] };
        let mut sky = Self {
            state: SkyState::new(&params).ok().map(Box::new),
            sun,
            sunlight: sunlight(sun.z, f64::from(turbidity)),
            ground: Vec3::ZERO,
        };
        sky.ground = irradiance(DVec3::Z, |d| sky.radiance(d)) + sky.sunlight * sun.z.max(0.0) as f32;
        sky
    }

    /// Irradiance on level ground, sun and sky.
    pub const fn ground(&self) -> Vec3 {
        self.ground
    }
}

impl SkyModel for Hosek {
    fn radiance(&self, direction: DVec3) -> Vec3 {
        /// The model's unit over that of the sun's irradiance above the air: W/(m^2 sr), weighted, over 128 klx of 683 lm/W.
        const UNIT: f32 = 683.0 / 128_000.0;
        let theta = (FRAC_PI_2 - direction.z.clamp(0.0, 1.0).asin()) as f32;
        let gamma = direction.dot(self.sun).clamp(-1.0, 1.0).acos() as f32;
        let value = |c| self.state.as_ref().map_or(0.0, |s| s.radiance(theta, gamma, c).max(0.0)) * UNIT;
        Vec3::new(value(Channel::R), value(Channel::G), value(Channel::B))
    }

    fn sunlight(&self) -> Vec3 {
        self.sunlight
    }
}

/// Perez' sky with Preetham's numbers (Preetham, Shirley and Smits 1999, appendix), as the seed prints it in its eq. 5 to 9.
pub struct Preetham {
    sun: DVec3,
    zenith: DVec3,
    /// A to E of luminance and of both chromaticities.
    perez: [[f64; 5]; 3],
    sunlight: Vec3,
}

impl Preetham {
    /// For that sun. Its numbers are for suns above the horizon.
    pub fn new(sun: DVec3, turbidity: f64) -> Self {
        let t = turbidity;
        let s = FRAC_PI_2 - sun.z.asin();
        let perez = [
            [
                0.1787 * t - 1.4630,
                -0.3554 * t + 0.4275,
                -0.0227 * t + 5.3251,
                0.1206 * t - 2.5771,
                -0.0670 * t + 0.3703,
            ],
            [
                -0.0193 * t - 0.2592,
                -0.0665 * t + 0.0008,
                -0.0004 * t + 0.2125,
                -0.0641 * t - 0.8989,
                -0.0033 * t + 0.0452,
            ],
            [
                -0.0167 * t - 0.2608,
                -0.0950 * t + 0.0092,
                -0.0079 * t + 0.2102,
                -0.0441 * t - 1.6537,
                -0.0109 * t + 0.0529,
            ],
        ];
        let chi = (4.0 / 9.0 - t / 120.0) * (PI - 2.0 * s);
        let luminance = (4.0453 * t - 4.9710) * chi.tan() - 0.2155 * t + 2.4192;
        let cubic = |m: [[f64; 4]; 3]| {
            let row = |m: [f64; 4]| ((m[0] * s + m[1]) * s + m[2]) * s + m[3];
            t * t * row(m[0]) + t * row(m[1]) + row(m[2])
        };
        let x = cubic([
            [0.001_66, -0.003_75, 0.002_09, 0.0],
            [-0.029_03, 0.063_77, -0.032_02, 0.003_94],
            [0.116_93, -0.211_96, 0.060_52, 0.258_86],
        ]);
        let y = cubic([
            [0.002_75, -0.006_10, 0.003_17, 0.0],
            [-0.042_14, 0.089_70, -0.041_53, 0.005_16],
            [0.153_46, -0.267_56, 0.066_70, 0.266_88],
        ]);
        Self { sun, zenith: DVec3::new(luminance, x, y), perez, sunlight: sunlight(sun.z, turbidity) }
    }
}

impl SkyModel for Preetham {
    fn radiance(&self, direction: DVec3) -> Vec3 {
        let cosine = direction.z.clamp(1e-3, 1.0);
        let gamma = direction.dot(self.sun).clamp(-1.0, 1.0).acos();
        let theta_sun = FRAC_PI_2 - self.sun.z.asin();
        let f = |p: [f64; 5], cosine: f64, gamma: f64| {
            (1.0 + p[0] * (p[1] / cosine).exp())
                * (1.0 + p[2] * (p[3] * gamma).exp() + p[4] * gamma.cos().powi(2))
        };
        let value: [f64; 3] = std::array::from_fn(|i| {
            self.zenith[i] * f(self.perez[i], cosine, gamma) / f(self.perez[i], 1.0, theta_sun)
        });
        // kcd/m^2 over 128 klx.
        let luminance = value[0] / 128.0;
        let (x, y) = (value[1], value[2]);
        let (big_x, big_z) = (x / y * luminance, (1.0 - x - y) / y * luminance);
        DVec3::new(
            3.2406 * big_x - 1.5372 * luminance - 0.4986 * big_z,
            -0.9689 * big_x + 1.8758 * luminance + 0.0415 * big_z,
            0.0557 * big_x - 0.2040 * luminance + 1.0570 * big_z,
        )
        .as_vec3()
    }

    fn sunlight(&self) -> Vec3 {
        self.sunlight
    }
}

/// One of the CIE's standard general skies (ISO 15469:2004), luminance alone.
pub struct Cie {
    number: usize,
    sun: DVec3,
}

impl Cie {
    /// Number 1 (overcast, steep) to 15 (white-blue, turbid).
    pub const fn new(number: usize, sun: DVec3) -> Self {
        Self { number, sun }
    }

    /// 0 under closed clouds to 1 where it is clear.
    pub fn clearness(&self) -> f32 {
        ((self.number as f32 - 6.0) / 6.0).clamp(0.0, 1.0)
    }

    /// Relative luminance.
    pub fn radiance(&self, direction: DVec3) -> f32 {
        const TYPES: [[f64; 5]; 15] = [
            [4.0, -0.70, 0.0, -1.0, 0.0],
            [4.0, -0.70, 2.0, -1.5, 0.15],
            [1.1, -0.8, 0.0, -1.0, 0.0],
            [1.1, -0.8, 2.0, -1.5, 0.15],
            [0.0, -1.0, 0.0, -1.0, 0.0],
            [0.0, -1.0, 2.0, -1.5, 0.15],
            [0.0, -1.0, 5.0, -2.5, 0.30],
            [0.0, -1.0, 10.0, -3.0, 0.45],
            [-1.0, -0.55, 2.0, -1.5, 0.15],
            [-1.0, -0.55, 5.0, -2.5, 0.30],
            [-1.0, -0.55, 10.0, -3.0, 0.45],
            [-1.0, -0.32, 10.0, -3.0, 0.45],
            [-1.0, -0.32, 16.0, -3.0, 0.30],
            [-1.0, -0.15, 16.0, -3.0, 0.30],
            [-1.0, -0.15, 24.0, -2.8, 0.15],
        ];
        let [a, b, c, d, e] = TYPES[(self.number - 1).min(14)];
        let gamma = direction.dot(self.sun).clamp(-1.0, 1.0).acos();
        let gradation = 1.0 + a * (b / direction.z.max(0.01)).exp();
        let indicatrix = 1.0 + c * ((d * gamma).exp() - (d * FRAC_PI_2).exp()) + e * gamma.cos().powi(2);
        (gradation * indicatrix) as f32
    }
}
