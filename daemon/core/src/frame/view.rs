//! Projection of boats onto the screen: the rectangles that limit every pass.

use glam::{DVec2, DVec3};

use crate::{
    frame::{
        reflection::{Sighted, hidden_m, tilt_away, wind_to_view},
        scene::{BoatView, PixelRect, RoundView},
        wake::Wake,
    },
    geometry::{CameraPose, Lens, RigidPose, curvature_drop, horizon_distance},
    model::{Model, ModelKind},
    physics::haze_share,
    world::fleet::Afloat,
};

/// Geometry nearer than this to the camera's plane is cut off, metres: nothing virtual is closer to the muzzle's camera.
/// Depth is this over the distance.
pub const NEAR_M: f64 = 0.1;

/// Pixels added around a hull: half of an edge's filter and rounding.
const HULL_MARGIN_PX: f64 = 2.0;

/// Share of a reflection's height by which distortion can push it outside its own outline.
const DISTORTION_SHARE: f64 = 0.25;

/// Pixels added around a reflection for its blur and the largest shift in pixels.
const REFLECTION_MARGIN_PX: f64 = 12.0;

/// Waves hide no more of a boat's height: in the mean over their phases something of it is always seen.
const HIDDEN_SHARE_MAX: f64 = 0.7;

/// The view frustum of a camera, and how far it sees over which sea.
#[derive(Clone, Copy, Debug)]
pub struct ViewFrustum<'a> {
    /// The camera.
    pub camera: &'a CameraPose,
    /// The lens as seen on the screen.
    pub lens: &'a Lens,
    /// Meteorological visibility, metres.
    pub visibility_m: f64,
    /// The wind whose waves stand before boats: where it blows (east, north), m/s; none where the picture says where hulls end.
    pub wind: DVec2,
    /// Whether reflections or shadows are drawn at all.
    pub reflections: bool,
    /// Whether wakes are drawn at all.
    pub wakes: bool,
    /// Boats beyond this have neither, metres.
    pub water_within_m: f64,
}

impl ViewFrustum<'_> {
    /// The boat as it is seen; `None` where neither hull nor reflection touches the screen.
    pub fn see(&self, boat: &Afloat<'_>) -> Option<BoatView> {
        self.see_with_wake(boat, || None)
    }

    /// The same of a boat that leaves a wake, which is asked for where it can be seen; `None` where that does not touch the screen
    /// either.
    pub fn see_with_wake(&self, boat: &Afloat<'_>, wake: impl FnOnce() -> Option<Wake>) -> Option<BoatView> {
        let offset = boat.pose.position - self.camera.position;
        let range_m = offset.length();
        let beyond_horizon = offset.truncate().length() > horizon_distance(self.camera.position.z);
        let is_water_drawn = range_m <= self.water_within_m;
        let wake = if self.wakes && is_water_drawn && !beyond_horizon {
            wake().and_then(|w| self.see_wake(w))
        } else {
            None
        };
        if !range_m.is_finite() || (wake.is_none() && !self.may_see(offset, range_m, boat.model.radius_m())) {
            return None;
        }
        let drop = curvature_drop(offset.truncate().length());
        let pose = RigidPose { position: boat.pose.position - DVec3::Z * drop, ..boat.pose };
        let hidden_m = self.hidden_m(boat, offset);
        let water_level = boat.water_level - drop + hidden_m;
        let corners = corners_above(boat.model, &pose, water_level);
        let hull = bounds(self.camera, self.lens, &corners, HULL_MARGIN_PX);
        let reflection = if self.reflections && is_water_drawn {
            let mirrored = corners.map(|c| DVec3::new(c.x, c.y, 2.0 * water_level - c.z));
            let height = self.apparent_height_px(range_m, &corners, water_level);
            bounds(self.camera, self.lens, &mirrored, REFLECTION_MARGIN_PX + DISTORTION_SHARE * height)
        } else {
            None
        };
        if hull.is_none() && reflection.is_none() && wake.is_none() {
            return None;
        }
        Some(BoatView {
            boat: boat.boat,
            model: boat.model_id,
            pose,
            water_level,
            hidden_m,
            hull,
            reflection,
            wake,
            range_m,
            haze: haze_share(range_m, self.visibility_m),
            beyond_horizon,
        })
    }

    /// How much of a boat's hull waves before it hide; `offset` leads to it.
    fn hidden_m(&self, boat: &Afloat<'_>, offset: DVec3) -> f64 {
        let (away, eye_m) = (offset.truncate(), self.camera.position.z - boat.water_level);
        let hidden = hidden_m(&Sighted {
            wind_m_s: self.wind.length(),
            wind_to_view: wind_to_view(self.wind, away),
            elevation: eye_m.atan2(away.length()),
            level_m: boat.water_level,
            tilt: tilt_away(&boat.pose, away),
        });
        hidden.min(HIDDEN_SHARE_MAX * boat.model.height_m().max(0.0))
    }

    /// A wake with the sea's curvature taken off, where any of it can touch the screen.
    fn see_wake(&self, wake: Wake) -> Option<Wake> {
        let wake = wake.lifted(|p| -curvature_drop((p - self.camera.position.truncate()).length()));
        let seen = wake.strips().any(|corners| bounds(self.camera, self.lens, &corners, 0.0).is_some());
        seen.then_some(wake)
    }

    /// Cheap first test: whether a sphere, and its mirror image close below it, can touch the field of view.
    pub(super) fn may_see(&self, offset: DVec3, range_m: f64, radius_m: f64) -> bool {
        let reach = 2.0 * radius_m;
        if range_m <= reach {
            return true;
        }
        let forward = self.camera.world_from_camera * DVec3::Z;
        let angle = (forward.dot(offset) / range_m).clamp(-1.0, 1.0).acos();
        angle - (reach / range_m).asin() <= self.lens.half_diagonal()
    }

    fn apparent_height_px(&self, range_m: f64, corners: &[DVec3; 8], water_level: f64) -> f64 {
        let top = corners.iter().map(|c| c.z - water_level).fold(0.0, f64::max);
        self.lens.focal.y * top / range_m.max(NEAR_M)
    }

    /// Whether a tracer, splash or strike can touch the screen.
    pub fn sees_round(&self, round: &RoundView) -> bool {
        let (a, b, radius) = match *round {
            RoundView::Tracer { from, to, .. } => (from, to, 0.5),
            RoundView::Splash { at, height_m, radius_m, .. } => {
                (at, at + DVec3::Z * f64::from(height_m), f64::from(radius_m))
            }
            RoundView::Strike { at, radius_m, .. } => (at, at, f64::from(radius_m)),
            RoundView::Smoke { at, radius_m, .. } | RoundView::Flame { at, radius_m, .. } => {
                (at, at, 2.0 * f64::from(radius_m))
            }
        };
        let low = a.min(b) - radius;
        let high = a.max(b) + radius;
        bounds(self.camera, self.lens, &box_corners(low, high), HULL_MARGIN_PX).is_some()
    }
}

/// Smallest rectangle of the screen that holds a box in the world and `margin` pixels around it; `None` out of view. Corners whose
/// numbers differ in one bit are joined by an edge.
pub fn bounds(camera: &CameraPose, lens: &Lens, corners: &[DVec3; 8], margin: f64) -> Option<PixelRect> {
    let c = corners.map(|p| camera.to_camera(p));
    let mut low = DVec2::INFINITY;
    let mut high = DVec2::NEG_INFINITY;
    let mut take = |p: DVec3| {
        let pixel = project_clamped(lens, p);
        low = low.min(pixel);
        high = high.max(pixel);
    };
    for i in 0..8 {
        if c[i].z >= NEAR_M {
            take(c[i]);
        }
        // Edges join corners that differ in one bit; each is cut where it passes the near plane.
        for bit in [1, 2, 4] {
            let (a, b) = (c[i], c[i ^ bit]);
            if i & bit == 0 && (a.z < NEAR_M) != (b.z < NEAR_M) {
                take(a.lerp(b, (NEAR_M - a.z) / (b.z - a.z)));
            }
        }
    }
    clip_to_screen(low - margin, high + margin, lens.width, lens.height)
}

/// Projection that pulls directions outside of the lens model's reach back to its rim instead of losing them.
fn project_clamped(lens: &Lens, camera: DVec3) -> DVec2 {
    if let Some(pixel) = lens.project(camera) {
        return pixel;
    }
    // Far beyond the screen in the right direction is all that a bound needs.
    let sideways = camera.truncate().normalize_or_zero();
    lens.centre + sideways * 4.0 * f64::from(lens.width.max(lens.height))
}

fn box_corners(low: DVec3, high: DVec3) -> [DVec3; 8] {
    std::array::from_fn(|i| {
        DVec3::new(
            if i & 1 == 0 { low.x } else { high.x },
            if i & 2 == 0 { low.y } else { high.y },
            if i & 4 == 0 { low.z } else { high.z },
        )
    })
}

/// Corners of the model's box in the world, none lower than the water.
fn corners_above(model: &Model, pose: &RigidPose, water_level: f64) -> [DVec3; 8] {
    let (mut low, mut high) = (model.min.as_dvec3(), model.max.as_dvec3());
    if model.kind == ModelKind::Quad {
        // A picture turns about z: any horizontal direction can be its own.
        let reach = low.truncate().abs().max(high.truncate().abs()).max_element();
        low = DVec3::new(-reach, -reach, low.z);
        high = DVec3::new(reach, reach, high.z);
    }
    box_corners(low, high).map(|corner| {
        let world = pose.to_world(corner);
        DVec3::new(world.x, world.y, world.z.max(water_level))
    })
}

/// The whole pixels of the screen that hold a span of it; `None` where there is none.
pub fn clip_to_screen(low: DVec2, high: DVec2, width: u32, height: u32) -> Option<PixelRect> {
    let screen = DVec2::new(f64::from(width), f64::from(height));
    let low = low.floor().max(DVec2::ZERO);
    let high = high.ceil().min(screen);
    let rect = PixelRect {
        x: low.x as u32,
        y: low.y as u32,
        width: (high.x - low.x) as u32,
        height: (high.y - low.y) as u32,
    };
    low.cmplt(high).all().then_some(rect)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{geometry::look, model::ModelId};
    use glam::{DQuat, Vec3};
    use proptest::prelude::*;

    fn block() -> Model {
        let corner = |p: [f32; 3]| crate::model::Vertex {
            position: Vec3::from_array(p),
            normal: Vec3::Z,
            uv: glam::Vec2::ZERO,
            albedo: Vec3::ONE,
        };
        Model {
            name: "block".into(),
            kind: ModelKind::Mesh,
            vertices: vec![corner([-4.0, -1.0, -0.5]), corner([4.0, 1.0, 2.0])],
            indices: vec![],
            parts: vec![],
            texture: None,
            waterline: vec![],
            min: Vec3::new(-4.0, -1.0, -0.5),
            max: Vec3::new(4.0, 1.0, 2.0),
        }
    }

    fn camera(azimuth: f64, elevation: f64, roll: f64) -> CameraPose {
        CameraPose { world_from_camera: look(azimuth, elevation, roll), position: DVec3::new(0.0, 0.0, 8.0) }
    }

    proptest! {
        /// Every visible point of the hull lies in the hull's rectangle, and of its mirror image in the reflection's.
        #[test]
        fn rectangles_hold_what_is_seen(
            x in -200.0..200.0f64, y in -200.0..200.0f64, heading in 0.0..6.3f64, tilt in -0.3..0.3f64,
            az in -0.5..0.5f64, el in -0.4..0.2f64, roll in -3.2..3.2f64,
            u in 0.0..1.0f64, v in 0.0..1.0f64, w in 0.0..1.0f64,
        ) {
            let model = block();
            let lens = Lens::pinhole(640, 360, 1.0);
            let camera = camera(az, el, roll);
            let eye = ViewFrustum { camera: &camera, lens: &lens, visibility_m: 2e4, wind: DVec2::ZERO, reflections: true, wakes: true, water_within_m: f64::INFINITY };
            let pose = RigidPose {
                world_from_body: DQuat::from_rotation_z(heading) * DQuat::from_rotation_x(tilt),
                position: DVec3::new(x, y, 0.0),
            };
            let seen = eye.see(&Afloat { boat: 0, model_id: ModelId(0), model: &model, pose, water_level: 0.0 });
            let (low, high) = (model.min.as_dvec3(), model.max.as_dvec3());
            let body = low + (high - low) * DVec3::new(u, v, w);
            let on = |rect: Option<PixelRect>, p: DVec2| rect.is_some_and(|r| {
                let (lx, ly) = (f64::from(r.x), f64::from(r.y));
                p.x >= lx && p.y >= ly && p.x <= lx + f64::from(r.width) && p.y <= ly + f64::from(r.height)
            });
            let world = match &seen {
                Some(view) => view.pose.to_world(body),
                None => pose.to_world(body),
            };
            if world.z > 0.0 {
                let screen = |p: DVec2| p.x >= 0.0 && p.y >= 0.0 && p.x <= 640.0 && p.y <= 360.0;
                let level = seen.as_ref().map_or(0.0, |v| v.water_level);
                if let Some(p) = lens.project(camera.to_camera(world)).filter(|p| screen(*p)) {
                    prop_assert!(on(seen.as_ref().and_then(|v| v.hull), p), "hull {p} {seen:?}");
                }
                let mirrored = DVec3::new(world.x, world.y, 2.0 * level - world.z);
                if let Some(p) = lens.project(camera.to_camera(mirrored)).filter(|p| screen(*p)) {
                    prop_assert!(on(seen.as_ref().and_then(|v| v.reflection), p), "mirror {p} {seen:?}");
                }
            }
        }
    }

    #[test]
    fn a_boat_behind_the_camera_is_not_seen() {
        let (model, lens, camera) = (block(), Lens::pinhole(640, 360, 1.0), camera(0.0, 0.0, 0.0));
        let eye = ViewFrustum {
            camera: &camera,
            lens: &lens,
            visibility_m: 2e4,
            wind: DVec2::ZERO,
            reflections: true,
            wakes: true,
            water_within_m: f64::INFINITY,
        };
        let at = |y: f64| {
            let pose = RigidPose { world_from_body: DQuat::IDENTITY, position: DVec3::new(0.0, y, 0.0) };
            eye.see(&Afloat { boat: 0, model_id: ModelId(0), model: &model, pose, water_level: 0.0 })
        };
        assert!(at(100.0).is_some());
        assert!(at(-100.0).is_none());
        assert!(!at(100.0).unwrap().beyond_horizon);
        assert!(at(15_000.0).unwrap().beyond_horizon);
    }

    #[test]
    fn haze_grows_from_nothing_to_all() {
        assert_eq!(haze_share(0.0, 1e4), 0.0);
        assert!((haze_share(1e4, 1e4) - 0.98).abs() < 0.001);
        assert_eq!(haze_share(10.0, 0.0), 1.0);
    }
}
