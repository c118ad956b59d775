//! Paths of light from the eye over a matt mesh to sun, sky and sea.

use std::f64::consts::TAU;

use glam::{DVec3, Vec3};
use hw_sim::ocean::{
    fresnel::reflectance,
    mesh::{BoatMesh, MeshHit},
    random::LightPath,
};

use super::{light::TracedLight, picture::Component};

/// Hulls that a path meets at most.
const BOUNCES: u32 = 5;
/// Radius of the disc of sun or moon, radians.
const DISC: f64 = 0.5 * 0.53 * std::f64::consts::PI / 180.0;
/// Rays start so far off a surface, metres.
const OFF_M: f64 = 0.002;

/// Light that a place sends to the eye, at once or by way of the hull, by where it came from.
#[derive(Clone, Copy, Debug, Default)]
pub struct Gathered {
    /// In the order of [`Component`].
    pub parts: [Vec3; 4],
}

/// A mesh in its light.
pub struct Tracer<'a> {
    /// The boat.
    pub mesh: &'a BoatMesh,
    /// What lights it.
    pub light: &'a TracedLight,
}

/// A place that a path has come to, and the unit normal on its side.
struct Place {
    at: DVec3,
    normal: DVec3,
    albedo: Vec3,
}

impl Place {
    fn of(hit: &MeshHit, from: DVec3, along: DVec3) -> Self {
        let normal = if hit.normal.dot(along) > 0.0 { -hit.normal } else { hit.normal };
        let at = from + along * hit.t - along * OFF_M + normal * (0.5 * OFF_M);
        Self { at, normal, albedo: hit.albedo.as_vec3() }
    }
}

/// What a ray meets.
enum Met {
    Hull(MeshHit),
    Sea(DVec3),
    Sky,
}

impl Tracer<'_> {
    /// Light that comes from `hit`, which a ray from `from` along unit `along` met, by one path.
    pub fn gather(&self, hit: &MeshHit, from: DVec3, along: DVec3, path: &mut LightPath) -> Gathered {
        let mut gathered = Gathered::default();
        let mut place = Place::of(hit, from, along);
        let mut carried = Vec3::ONE;
        for _ in 0..BOUNCES {
            carried *= place.albedo;
            let out = around(place.normal, path.unit(), path.unit());
            let direct = carried * self.sunlight(&place, path);
            gathered.parts[Component::Sun as usize] += direct;
            let hull = match self.meet(place.at, out) {
                Met::Hull(hull) => hull,
                Met::Sky => {
                    gathered.parts[Component::Sky as usize] += carried * self.light.sky(out);
                    break;
                }
                Met::Sea(at) => {
                    gathered.parts[Component::Sea as usize] += carried * self.light.sea;
                    gathered.parts[Component::HullInSea as usize] +=
                        carried * self.hull_in_sea(at, out, path);
                    break;
                }
            };
            place = Place::of(&hull, place.at, out);
        }
        gathered
    }

    /// Sunlight on a place over pi, by one ray to the disc.
    fn sunlight(&self, place: &Place, path: &mut LightPath) -> Vec3 {
        let (u, v) = (path.unit(), path.unit());
        let facing = place.normal.dot(self.light.sun_direction);
        if facing <= 0.0 || self.light.sun == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let (across, upwards) = self.light.sun_direction.any_orthonormal_pair();
        let (sin, cos) = (TAU * u).sin_cos();
        let off = (across * cos + upwards * sin) * (DISC * v.sqrt());
        let towards = (self.light.sun_direction + off).normalize();
        // The part of the disc below the horizon sends nothing.
        if towards.z <= 0.0 || self.mesh.blocks(place.at, towards) {
            return Vec3::ZERO;
        }
        self.light.sun * (facing / std::f64::consts::PI) as f32
    }

    fn meet(&self, from: DVec3, along: DVec3) -> Met {
        let to_sea = (along.z < 0.0).then(|| -from.z / along.z).filter(|t| *t >= 0.0);
        // No water stands within a hull.
        let sea = to_sea.map(|t| (t, from + along * t)).filter(|(_, at)| !self.mesh.holds_water(*at));
        let limit = sea.map_or(f64::INFINITY, |(t, _)| t);
        match (self.mesh.meet(from, along, limit), sea) {
            (Some(hit), _) => Met::Hull(hit),
            (None, Some((_, at))) => Met::Sea(at),
            (None, None) if along.z >= 0.0 => Met::Sky,
            // Down through the bilge.
            (None, None) => Met::Sea(from),
        }
    }

    /// What the boat's own mirror image in the sea adds to the sea's radiance: its first light in place of the sky's.
    fn hull_in_sea(&self, at: DVec3, along: DVec3, path: &mut LightPath) -> Vec3 {
        let mirrored = along * DVec3::new(1.0, 1.0, -1.0);
        let Some(hit) = self.mesh.meet(at, mirrored, f64::INFINITY) else { return Vec3::ZERO };
        let place = Place::of(&hit, at, mirrored);
        let out = around(place.normal, path.unit(), path.unit());
        let sky = match self.meet(place.at, out) {
            Met::Sky => self.light.sky(out),
            Met::Sea(_) => self.light.sea,
            Met::Hull(_) => Vec3::ZERO,
        };
        let hull = place.albedo * (sky + self.sunlight(&place, path));
        (hull - self.light.sky(mirrored)) * reflectance(mirrored.z as f32)
    }
}

/// Direction about a normal as often as its cosine (Malley's method).
fn around(normal: DVec3, u: f64, v: f64) -> DVec3 {
    let (across, upwards) = normal.any_orthonormal_pair();
    let (sin, cos) = (TAU * u).sin_cos();
    let radius = v.sqrt();
    (across * (radius * cos) + upwards * (radius * sin) + normal * (1.0 - v).sqrt()).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        path_traced::{Kind, light::TracedLight},
        reflection::scenes::{Afloats, grey_boat},
        sky::{direction, irradiance},
        truth::boat,
    };

    /// The top of a boat's mast has the whole sky and no hull before it: its light is known.
    #[test]
    fn a_face_that_sees_the_whole_sky_has_its_light() {
        let light = TracedLight::new(Kind::Overcast, direction(0.3, 0.7), 0.7).unwrap();
        let mesh = boat::mesh(&grey_boat(0.5), Afloats::at(10.0).pose());
        let from = DVec3::new(0.0, 10.0, 30.0);
        let hit = mesh.meet(from, -DVec3::Z, f64::INFINITY).unwrap();
        let tracer = Tracer { mesh: &mesh, light: &light };
        let sum: Vec3 = (0..4096)
            .map(|i| {
                let gathered = tracer.gather(&hit, from, -DVec3::Z, &mut LightPath::new(1, 2, i));
                gathered.parts.iter().sum::<Vec3>()
            })
            .sum();
        let expected = irradiance(DVec3::Z, |d| light.sky(d)) * (0.5 / std::f32::consts::PI)
            + light.sun * (0.5 * light.sun_direction.z as f32 / std::f32::consts::PI);
        let found = sum / 4096.0;
        assert!(((found - expected) / expected).abs().max_element() < 0.02, "{found}, not {expected}");
    }
}
