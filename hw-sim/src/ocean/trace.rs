//! Paths of light: one path tells the picture without the boat and the one with it.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};

use super::{
    fresnel::{SEA_WATER_INDEX, fresnel},
    mesh::{BoatMesh, MeshHit},
    micro::Micro,
    random::LightPath,
    sky::Daylight,
    waves::{WaterHit, Waves},
};

/// Bounces of a path over the resolved water.
const BOUNCES: usize = 6;
/// Strikes of one bounce on the unresolved surface.
const STRIKES: usize = 6;
/// Contributions below this share of white are not followed further.
const FAINT: f64 = 2e-3;

/// The water below the surface, which sends light back out.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct WaterBody {
    /// Diffuse reflectance of the water below the surface (linear sRGB), as seen from above without the surface's own reflection.
    pub reflectance: [f64; 3],
    /// Light scatters back from this depth on average, metres.
    pub depth_m: f64,
}

impl Default for WaterBody {
    /// Clear coastal water: green-blue, 1 to 3 % (Mobley 1994, section 3.8).
    fn default() -> Self {
        Self { reflectance: [0.006, 0.022, 0.030], depth_m: 3.0 }
    }
}

/// Light on boats as the trainer shades them: `albedo * (sun * max(n.s, 0) + mix(sea, sky, (1 + n.z) / 2))`, without a shadow of the boat
/// on itself (boat_body.glsl). Radiances of a white matt surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoatLight {
    /// Facing the sun.
    pub sun: DVec3,
    /// Facing up, by the sky alone.
    pub sky: DVec3,
    /// Facing down, by the sea.
    pub sea: DVec3,
}

/// Everything that light meets.
pub struct TracedScene {
    /// Sky and sun.
    pub sky: Daylight,
    /// Water surface.
    pub waves: Waves,
    /// Water below it.
    pub body: WaterBody,
    /// The boat, where there is one.
    pub boat: Option<BoatMesh>,
    /// Light on it.
    pub light: BoatLight,
}

/// Radiance along one path.
#[derive(Clone, Copy, Debug, Default)]
pub struct TracedSample {
    /// Without the boat.
    pub without: DVec3,
    /// With it.
    pub with: DVec3,
    /// Whether the eye sees the boat itself.
    pub hull: bool,
}

struct TraceState {
    sample: TracedSample,
    through: DVec3,
    /// Whether the boat has not yet ended the path of the picture with it.
    open: bool,
}

impl TraceState {
    fn add(&mut self, radiance: DVec3, boat_visibility: f64) {
        self.sample.without += self.through * radiance;
        if self.open {
            self.sample.with += self.through * radiance * boat_visibility;
        }
    }
}

impl TracedScene {
    /// Light on boats of this scene: sun and sky on matt white; the sea as a flat one reflects the mean sky (6.6 % diffuse) and its body.
    pub fn boat_light(sky: &Daylight, body: &WaterBody) -> BoatLight {
        let down = sky.sky_irradiance + sky.sun_horizontal();
        let sea = sky.sky_irradiance / PI * 0.066 + down / PI * DVec3::from_array(body.reflectance);
        BoatLight { sun: sky.sun / PI, sky: sky.sky_irradiance / PI, sea }
    }

    /// Follows light back from the eye.
    pub fn trace(&self, mut origin: DVec3, mut direction: DVec3, path: &mut LightPath) -> TracedSample {
        let mut state =
            TraceState { sample: TracedSample::default(), through: DVec3::ONE, open: self.boat.is_some() };
        let mut disc_counts = true;
        for bounce in 0..BOUNCES {
            let from = if bounce == 0 { 0.0 } else { 1e-4 };
            let water = self.waves.meet(origin, direction, from);
            if state.open
                && let Some(hit) = self.boat_before(origin, direction, water.as_ref())
            {
                let shade = self.shade(&hit, direction);
                state.sample.with += state.through * shade;
                state.sample.hull = bounce == 0;
                state.open = false;
            }
            let Some(hit) = water else {
                state.add(self.sky.radiance(direction), 1.0);
                if disc_counts {
                    state.add(self.sky.sun_disc(direction), 1.0);
                }
                break;
            };
            let micro = Micro::new(&hit.unresolved, hit.slope);
            disc_counts = micro.is_mirror();
            origin = hit.point;
            let Some(onward) = self.scatter(&mut state, &micro, &hit, -direction, path) else { break };
            direction = onward;
            let strength = state.through.max_element();
            if strength < FAINT {
                break;
            }
            // Later bounces are weak: most end here, the rest stand for them.
            if bounce > 0 {
                let stay = (strength * 10.0).min(1.0);
                if path.unit() > stay {
                    break;
                }
                state.through /= stay;
            }
        }
        if self.boat.is_none() {
            state.sample.with = state.sample.without;
        }
        state.sample
    }

    fn boat_before(&self, origin: DVec3, direction: DVec3, water: Option<&WaterHit>) -> Option<MeshHit> {
        let boat = self.boat.as_ref()?;
        let limit = match water {
            Some(hit) if !boat.holds_water(hit.point) => hit.t,
            _ => f64::INFINITY,
        };
        boat.meet(origin, direction, limit)
    }

    fn shade(&self, hit: &MeshHit, direction: DVec3) -> DVec3 {
        let n = if hit.normal.dot(direction) > 0.0 { -hit.normal } else { hit.normal };
        let ambient = self.light.sea.lerp(self.light.sky, 0.5 + 0.5 * n.z);
        hit.albedo * (self.light.sun * n.dot(self.sky.sun_direction).max(0.0) + ambient)
    }

    /// Adds what the water at `hit` itself sends to the eye, and says where the mirrored light comes from.
    fn scatter(
        &self,
        state: &mut TraceState,
        micro: &Micro,
        hit: &WaterHit,
        to_eye: DVec3,
        path: &mut LightPath,
    ) -> Option<DVec3> {
        let mut to_eye = to_eye;
        let mut height = 1.0;
        let mut sunlit = None;
        for strike in 0..STRIKES {
            height = match micro.strike(-to_eye, height, path) {
                Some(height) => height,
                None if strike > 0 => return Some(-to_eye),
                // The eye's ray cannot miss the surface that it has met; a facet seen from behind ends the path.
                None => return None,
            };
            self.add_sun(state, micro, hit, to_eye, height, &mut sunlit);
            let normal = micro.visible_normal(to_eye, path);
            let cos = to_eye.dot(normal).clamp(0.0, 1.0);
            let mirrored = fresnel(cos, SEA_WATER_INDEX);
            self.add_body(state, hit, to_eye, normal, 1.0 - mirrored, path);
            state.through *= mirrored;
            to_eye -= 2.0 * cos * normal;
        }
        None
    }

    fn add_sun(
        &self,
        state: &mut TraceState,
        micro: &Micro,
        hit: &WaterHit,
        to_eye: DVec3,
        height: f64,
        sunlit: &mut Option<(f64, f64)>,
    ) {
        let light = self.sky.sun_direction;
        if self.sky.sun == DVec3::ZERO || light.z <= 0.0 {
            return;
        }
        let glint = micro.glint(to_eye, light, height);
        if (glint * self.sky.sun * state.through).max_element() < 1e-4 {
            return;
        }
        let (water, boat) = *sunlit.get_or_insert_with(|| {
            let water = self.waves.meet(hit.point, light, 1e-4).is_none();
            let boat = self.boat.as_ref().is_none_or(|b| !b.blocks(hit.point, light));
            (f64::from(water), f64::from(boat))
        });
        state.add(self.sky.sun * glint * water, boat);
    }

    /// Light that went into the water, scattered once at a depth and came back: the boat takes sun and sky away from where it entered.
    fn add_body(
        &self,
        state: &mut TraceState,
        hit: &WaterHit,
        to_eye: DVec3,
        normal: DVec3,
        passed: f64,
        path: &mut LightPath,
    ) {
        let shares = DVec3::from_array(self.body.reflectance) / PI * passed;
        let (sun, sky) = (self.sky.sun_horizontal() * shares, self.sky.sky_irradiance * shares);
        state.sample.without += state.through * (sun + sky);
        if !state.open {
            return;
        }
        let (mut sun_seen, mut sky_seen) = (1.0, 1.0);
        if let Some(boat) = &self.boat {
            let draw = [path.unit(), path.unit(), path.unit()];
            let near = (hit.point - boat.frame().position).length() < 60.0 && hit.t < self.waves.far_m;
            if near {
                let depth = -self.body.depth_m * draw[0].ln();
                let up = refracted(to_eye, normal);
                let place = hit.point - up * (depth / up.z.max(0.2));
                let rise = |towards: DVec3| {
                    let inside = refracted(towards, DVec3::Z);
                    let surface = place + inside * ((hit.point.z - place.z) / inside.z.max(0.2));
                    f64::from(!boat.holds_water(surface) && !boat.blocks(surface, towards))
                };
                if sun != DVec3::ZERO {
                    sun_seen = rise(self.sky.sun_direction);
                }
                let sin = draw[1].sqrt();
                let flat = DVec2::from_angle(TAU * draw[2]) * (1.0 - sin * sin).sqrt();
                sky_seen = rise(flat.extend(sin));
            }
        }
        state.sample.with += state.through * (sun * sun_seen + sky * sky_seen);
    }
}

/// Direction inside the water of light that comes from or goes to `outside` over the surface's `normal`.
fn refracted(outside: DVec3, normal: DVec3) -> DVec3 {
    let cos = outside.dot(normal).clamp(0.0, 1.0);
    let tangent = (outside - normal * cos) / SEA_WATER_INDEX;
    (tangent + normal * (1.0 - tangent.length_squared()).max(0.0).sqrt()).normalize()
}
