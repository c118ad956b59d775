//! Skies, and what water mirrors of them.

use glam::{DVec2, DVec3};
use hw_sim::ocean::{
    fresnel::{SEA_WATER_INDEX, fresnel},
    random::keyed_uniform,
    systems::SeaFacet,
};

/// The light of a scene. Luminances relative to the brightest part of the sky's gradient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SeaSky {
    /// Bright horizon that fades to a darker zenith, sun outside of the picture.
    Clear,
    /// The same with the sun this high (radians) straight ahead of the mean view: glitter.
    SunAhead(f64),
    /// CIE standard overcast sky: the zenith three times the horizon.
    Overcast,
    /// A clear sky with patches of cloud.
    Broken,
    /// A steep gradient over a bright band at the horizon.
    Dusk,
}

impl SeaSky {
    /// Luminance in a direction (unit vector; below the horizon: as at the horizon).
    pub fn luminance(self, d: DVec3) -> f64 {
        let e = d.z.clamp(0.0, 1.0).asin();
        let gradient = |top: f64, scale: f64| top + (1.0 - top) * (-e / scale).exp();
        match self {
            Self::Clear => gradient(0.35, 0.35),
            Self::SunAhead(sun) => {
                let toward = DVec3::new(0.0, sun.cos(), sun.sin());
                gradient(0.4, 0.35) * (1.0 + 1.5 * (-d.dot(toward).clamp(-1.0, 1.0).acos() / 0.4).exp())
            }
            Self::Overcast => (1.0 + 2.0 * e.sin()) / 3.0,
            Self::Broken => gradient(0.4, 0.4) * (0.75 + 0.6 * clouds(d, e)),
            Self::Dusk => gradient(0.12, 0.2),
        }
    }

    /// Direction of the sun and its illuminance over that of a sky of luminance 1.
    fn sun(self) -> Option<(DVec3, f64)> {
        match self {
            Self::SunAhead(e) => Some((DVec3::new(0.0, e.cos(), e.sin()), 6.0)),
            _ => None,
        }
    }
}

/// Smooth value noise over the dome, 0 to 1.
fn clouds(d: DVec3, e: f64) -> f64 {
    let p = DVec2::new(d.x.atan2(d.y) * 4.0, e * 9.0);
    let base = p.floor();
    let f = p - base;
    let f = f * f * (3.0 - 2.0 * f);
    let at = |dx: f64, dy: f64| {
        keyed_uniform(((base.x + dx) as i64 as u64).wrapping_mul(7919) ^ ((base.y + dy) as i64 as u64))
    };
    let (a, b) = (at(0.0, 0.0), at(1.0, 0.0));
    let (c, g) = (at(0.0, 1.0), at(1.0, 1.0));
    (a + (b - a) * f.x) * (1.0 - f.y) + (c + (g - c) * f.x) * f.y
}

/// Nodes and weights of Gauss and Hermite for a standard normal distribution, order 5 and 3.
const ALONG: [(f64, f64); 5] = [
    (-2.856_970, 0.011_257),
    (-1.355_626, 0.222_076),
    (0.0, 0.533_333),
    (1.355_626, 0.222_076),
    (2.856_970, 0.011_257),
];
const ACROSS: [(f64, f64); 3] = [(-1.732_051, 1.0 / 6.0), (0.0, 2.0 / 3.0), (1.732_051, 1.0 / 6.0)];

/// Light from a patch of water along `ray` (unit, from the eye), sky mirrored by its facets and light out of the water.
pub fn water(sky: SeaSky, ray: DVec3, facet: &SeaFacet, upwelling: f64) -> f64 {
    let view = ray.truncate().normalize_or(DVec2::Y);
    let sigma = facet.rough.sqrt();
    let (mut sum, mut weight) = (0.0, 0.0);
    for (u, p) in ALONG {
        for (v, q) in ACROSS {
            let slope = facet.slope + view * (u * sigma) + view.perp() * (v * sigma);
            let normal = DVec3::new(-slope.x, -slope.y, 1.0);
            // A facet is seen by its area across the ray.
            let seen = -normal.dot(ray);
            if seen <= 0.0 {
                continue;
            }
            let w = p * q * seen;
            let size = normal.length();
            let f = fresnel(seen / size, SEA_WATER_INDEX);
            let mirrored = ray + normal * (2.0 * seen / (size * size));
            // What is mirrored downwards meets the water again: darker.
            let light = sky.luminance(mirrored) * if mirrored.z > 0.0 { 1.0 } else { 0.5 };
            sum += w * (f * light + (1.0 - f) * upwelling);
            weight += w;
        }
    }
    let diffuse =
        if weight > 0.0 { sum / weight } else { 0.3 * sky.luminance(DVec3::new(view.x, view.y, 0.0)) };
    diffuse + glitter(sky, ray, facet)
}

/// The sun's light from the facets that mirror it (Cox and Munk 1954, eq. 9).
fn glitter(sky: SeaSky, ray: DVec3, facet: &SeaFacet) -> f64 {
    let Some((sun, illuminance)) = sky.sun() else { return 0.0 };
    let half = (sun - ray).normalize();
    if half.z <= 0.05 {
        return 0.0;
    }
    let slope = -half.truncate() / half.z;
    let rough = facet.rough + 1e-4;
    let density =
        (-(slope - facet.slope).length_squared() / (2.0 * rough)).exp() / (std::f64::consts::TAU * rough);
    let f = fresnel(-half.dot(ray), SEA_WATER_INDEX);
    illuminance * f * density / (4.0 * half.z.powi(4) * (-ray.z).max(0.02))
}
