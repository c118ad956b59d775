//! From a boat's track to what the wake's shaders read: relative to the camera before it is rounded.

use bowwave_core::{
    estimate::light::Light,
    frame::{
        lamps::foam_at,
        scene::{BoatView, PixelRect, Scene},
        view::{bounds, clip_to_screen},
        wake::{FOAM_FROUDE, FOLLOWED_S, SPEED_MIN_M_S, TrackPoint, Wake, froude, height_m},
    },
    geometry::CameraPose,
    sea::{fresnel, mean_square_slope},
};
use glam::{DMat3, DVec2, DVec3, Vec3};
use shaders_spirv::interface::{TRACK_POINTS, WakeBlock, WakeHead, WakePoint};

use crate::passes::{
    shadow::plan::ThrownShadow,
    water::{SEEN_DOWN, block::mirrored_sky},
};

const _: () = assert!(TRACK_POINTS == bowwave_core::frame::wake::TRACK_POINTS);

/// Foam is no brighter than this share of the video's white.
const FOAM_MAX: f32 = 0.85;

/// What is drawn of a boat's wake.
pub(crate) struct WakePlan {
    pub(crate) block: WakeBlock,
    /// Strips of the block that are drawn.
    pub(crate) strips: u32,
    /// Strips of the track that they cover.
    pub(crate) covered: usize,
}

/// What is drawn of a boat's wake: where points of the track are seen close to each other, some are left out.
/// The boat's shadow on it falls by `thrown`.
pub(crate) fn wake_plan(
    scene: &Scene,
    (boat, wake): (&BoatView, &Wake),
    thrown: Option<&ThrownShadow>,
) -> WakePlan {
    let camera = &scene.camera;
    let camera_from_world = DMat3::from_quat(camera.world_from_camera.inverse());
    let with = |v: DVec3, w: f64| v.extend(w).as_vec4().to_array();
    let light = |v: Vec3, w: f64| v.extend(w as f32).to_array();
    let (high, sprayed) = spray(scene, boat, wake);
    let lamps = foam_at(&scene.lamps, boat.pose.position);
    let rough = mean_square_slope(scene.wind.length()).sqrt();
    let head = WakeHead {
        up: with(camera_from_world * DVec3::Z, rough),
        hull: [wake.hull.length_m as f32, wake.hull.beam_m as f32, boat.haze, high as f32],
        foam: light(foam_light(scene.light.on_level() + lamps), sprayed),
        sea: light(sea_fit(&scene.light, rough), 0.0),
        ..thrown.map_or_else(WakeHead::default, |thrown| WakeHead {
            shade_foam: light(foam_light(scene.light.sky + lamps), 0.0),
            ..shade(thrown, camera)
        })
    };
    let mut block = WakeBlock { head, ..WakeBlock::default() };
    let points = wake.points();
    let (mut count, mut covered) = (0, 0);
    let mut kept: Option<&TrackPoint> = None;
    for (i, point) in points.iter().enumerate() {
        let share = share(scene, wake, point);
        if share > 0.0 && kept.is_some_and(|before| is_thin(scene, wake, before, &points[i..])) {
            continue;
        }
        kept = Some(point);
        let Some(out) = block.points.get_mut(count) else { break };
        let starboard = point.starboard;
        let height = height_m(point.speed_m_s, &wake.hull, wake.draught_m);
        let pair = |a: DVec2, b: DVec2| [a.x, a.y, b.x, b.y].map(|v| v as f32);
        *out = WakePoint {
            place: with(camera_from_world * (point.position - camera.position), wake.half_width_m(point)),
            side: with(camera_from_world * starboard.extend(0.0), height),
            world: pair(point.position.truncate(), starboard),
            track: [point.along_m, point.speed_m_s, point.age_s, share].map(|v| v as f32),
        };
        count += 1;
        if share > 0.0 {
            covered = i + 1;
        }
    }
    let drawn = |p: &&WakePoint| p.track[3] > 0.0;
    let last = block.points[..count].iter().rposition(|p| drawn(&p)).map_or(0, |i| i + 1);
    WakePlan {
        block,
        strips: last.min(count.saturating_sub(1)) as u32,
        covered: covered.min(points.len().saturating_sub(1)),
    }
}

/// A boat's shadow as the wake's shaders look it up: from camera space, in which their places are exact.
fn shade(thrown: &ThrownShadow, camera: &CameraPose) -> WakeHead {
    let world_from_camera = DMat3::from_quat(camera.world_from_camera);
    let shade_rows = thrown.from_world.map(|row| {
        let along = DVec3::new(row[0], row[1], row[2]);
        let at_camera = along.dot(camera.position) + row[3];
        (world_from_camera.transpose() * along).extend(at_camera).as_vec4().to_array()
    });
    WakeHead { shade_rows, shade_box: thrown.texels, ..WakeHead::default() }
}

/// Whether the strip from a point to the next is seen so thin that it may go on to the one after that.
fn is_thin(scene: &Scene, wake: &Wake, before: &TrackPoint, points: &[TrackPoint]) -> bool {
    /// A strip is no thinner than this where it can be longer instead, pixels: what runs on the processor shades whole blocks of four by four,
    /// and has more to do for a triangle than for its pixels.
    const THIN_PX: f64 = 16.0;
    /// No strip is longer than this for that, seconds: in between, foam's decay is taken for straight, which errs by a thirtieth.
    const LONG_S: f64 = 1.8;
    /// One that is seen so short has no such bound, pixels.
    const SHORT_PX: f64 = 3.0;
    /// The track of a turning boat is cut off by no more than this, pixels.
    const CUT_PX: f64 = 0.3;
    let [point, after, ..] = points else { return false };
    let on_screen = |p: DVec3| scene.lens.project(scene.camera.to_camera(p));
    let aside = (point.starboard * wake.half_width_m(point)).extend(0.0);
    let (Some(from), Some(to), Some(next), Some(side)) = (
        on_screen(before.position),
        on_screen(point.position),
        on_screen(after.position),
        on_screen(point.position + aside),
    ) else {
        return false;
    };
    let across = (side - to).normalize_or_zero();
    let is_short = (to - from).length() < SHORT_PX;
    let is_straight = (to - from).perp_dot((next - from).normalize_or_zero()).abs() < CUT_PX;
    let is_fresh = is_short || after.age_s - before.age_s <= LONG_S;
    is_straight && is_fresh && (to - from).perp_dot(across).abs() < THIN_PX
}

/// Height of what the bow throws up, metres, and how much of it is drawn.
fn spray(scene: &Scene, boat: &BoatView, wake: &Wake) -> (f64, f64) {
    /// The bow's crest stands so much higher at the hull than waves one length off: the power law of their distance, from there to a
    /// fifth of the length.
    const AT_HULL: f64 = 1.7;
    /// Spray of fewer rows of pixels fades, and of fewer than the first is none.
    const SPRAY_ROWS: (f64, f64) = (0.2, 0.6);
    let Some(now) = wake.points().first().filter(|p| p.speed_m_s >= SPEED_MIN_M_S) else { return (0.0, 0.0) };
    let high = AT_HULL * height_m(now.speed_m_s, &wake.hull, wake.draught_m);
    let grown = |v: f64, (from, to): (f64, f64)| {
        let t = ((v - from) / (to - from)).clamp(0.0, 1.0);
        t * t * (3.0 - 2.0 * t)
    };
    let rows = high / boat.range_m.max(0.1) * scene.lens.focal.max_element();
    (high, grown(froude(now.speed_m_s, wake.hull.length_m), FOAM_FROUDE) * grown(rows, SPRAY_ROWS))
}

/// The pixels that what stands beside a hull can take; `None` where there is none or it is out of view.
pub(crate) fn spray_rect(scene: &Scene, boat: &BoatView) -> Option<PixelRect> {
    /// What stands beside a hull reaches so far along it: from ahead of the bow, to behind it, in lengths.
    const SPRAY_ALONG: (f64, f64) = (-0.02, 2.2);
    let wake = boat.wake.as_ref().filter(|_| !boat.beyond_horizon)?;
    let (high, thrown) = spray(scene, boat, wake);
    let [bow, middle] = [1, 3].map(|i| wake.points().get(i));
    let (bow, middle) = (bow?, middle?);
    if thrown <= 0.0 {
        return None;
    }
    let back = (middle.position - bow.position).try_normalize()?;
    let (mut low, mut up) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    let aside = 0.6 * wake.hull.beam_m + 0.06 * wake.hull.length_m + 0.4 * high;
    for i in 0..8 {
        let pick = |bit: usize, a: f64, b: f64| if i & bit == 0 { a } else { b };
        let along = pick(1, SPRAY_ALONG.0, SPRAY_ALONG.1) * wake.hull.length_m;
        let across = middle.starboard * pick(2, -aside, aside);
        let place = bow.position + back * along + across.extend(0.0) + DVec3::Z * pick(4, -0.1 * high, high);
        // Beside the camera it would fill the picture: left out.
        let p = scene.lens.project(scene.camera.to_camera(place))?;
        (low, up) = (low.min(p), up.max(p));
    }
    clip_to_screen(low - 4.0, up + 4.0, scene.lens.width, scene.lens.height)
}

/// How much of a point's wake is drawn: less with its age, and none of what would be finer than the picture.
fn share(scene: &Scene, wake: &Wake, point: &TrackPoint) -> f64 {
    /// Where a stretch of wake as long as it is wide takes up fewer rows of pixels, nothing is drawn, and from the second on all of it: in
    /// between it fades, so that what shrinks below a pixel does not flicker.
    const ROWS: (f64, f64) = (0.35, 1.5);
    /// Less of a wake is not seen, and its end not either.
    const SHARE_MIN: f64 = 0.02;
    let to = point.position - scene.camera.position;
    let eye_m = -to.z;
    if eye_m <= 0.05 || point.speed_m_s < SPEED_MIN_M_S {
        return 0.0;
    }
    let fresh = (1.0 - point.age_s.max(0.0) / FOLLOWED_S).clamp(0.0, 1.0);
    let rows = 2.0 * wake.half_width_m(point) * eye_m / to.length_squared() * scene.lens.focal.max_element();
    let seen = ((rows - ROWS.0) / (ROWS.1 - ROWS.0)).clamp(0.0, 1.0);
    let share = fresh * fresh * seen;
    if share < SHARE_MIN { 0.0 } else { share }
}

/// The rectangles of the screen that hold the strips of a wake; `None` out of view.
pub(crate) fn strip_rects(scene: &Scene, wake: &Wake) -> impl Iterator<Item = Option<PixelRect>> {
    /// Pixels added around a strip, whose sides bulge a little between its corners under a bent lens.
    const STRIP_MARGIN_PX: f64 = 3.0;
    wake.strips().map(|corners| bounds(&scene.camera, &scene.lens, &corners, STRIP_MARGIN_PX))
}

/// Light of whole foam, which lies flat. A camera bends bright light over before it is white.
fn foam_light(on_level: Vec3) -> Vec3 {
    /// Share of the light that fresh foam throws back (Whitlock, Bartlett & Gurganus 1982).
    const FOAM_ALBEDO: f32 = 0.55;
    let whole = FOAM_ALBEDO * on_level;
    whole * (FOAM_MAX / whole.max_element().max(FOAM_MAX))
}

/// What brings the shader's sea to the picture's mean sea.
fn sea_fit(light: &Light, rough: f64) -> Vec3 {
    /// The shader's sea is brought to the picture's by no more than this factor and no less than its inverse.
    const FIT_MAX: f32 = 4.0;
    let model = flat_sea(light, SEEN_DOWN, rough);
    (light.sea / model.max(Vec3::splat(1e-4))).clamp(Vec3::splat(1.0 / FIT_MAX), Vec3::splat(FIT_MAX))
}

/// Light of an untilted sea, as `wake.frag` has it.
fn flat_sea(light: &Light, down: f64, rough: f64) -> Vec3 {
    let mirrored = fresnel(0.5 * (down + (down * down + rough * rough).sqrt())) as f32;
    let body = Vec3::new(0.008, 0.016, 0.018) * (light.sun + light.sky);
    mirrored_sky(light, down, rough) + (1.0 - mirrored) * body
}

#[cfg(test)]
mod tests {
    use bowwave_core::world::boats::{CourseState, Hull};

    use super::*;
    use crate::testing;

    fn wake(range: f64, speed: f64) -> Wake {
        let hull = Hull { length_m: 8.0, beam_m: 2.4 };
        let state = |t: f64| CourseState {
            position: DVec2::new(speed * (t - 50.0), range),
            heading: std::f64::consts::FRAC_PI_2,
            speed_m_s: speed,
            sway_m_s: 0.0,
            turn_rate: 0.0,
        };
        Wake::of(hull, 0.5, 50.0, state, |_| 0.0).unwrap()
    }

    fn seen(range: f64) -> (Scene, BoatView) {
        let models = [testing::box_model("b", [8.0, 2.4, 1.5], [0.5; 3])];
        let mut scene = testing::empty_scene(640, 360);
        testing::add_boat(&mut scene, &models, 0, range, 0.0, 0.0);
        let boat = scene.boats.remove(0);
        (scene, boat)
    }

    #[test]
    fn a_wake_finer_than_the_picture_is_left_out_and_fades_before() {
        let share_at = |range: f64| {
            let (scene, boat) = seen(range);
            wake_plan(&scene, (&boat, &wake(range, 7.0)), None).block.points[3].track[3]
        };
        let (near, far, gone) = (share_at(60.0), share_at(200.0), share_at(900.0));
        assert!(near > 0.9 && far < near && far > 0.0, "{near} {far}");
        assert_eq!(gone, 0.0);
    }

    #[test]
    fn rectangles_hold_the_ribbon() {
        let models = [testing::box_model("b", [8.0, 2.4, 1.5], [0.5; 3])];
        let mut scene = testing::empty_scene(640, 360);
        testing::add_moving_boat(&mut scene, &models, 0, [70.0, 0.0, 0.4], [7.0, 0.1]);
        let boat = scene.boats.remove(0);
        let wake = boat.wake.unwrap();
        let plan = wake_plan(&scene, (&boat, &wake), None);
        assert!(plan.strips >= 8 && (plan.strips as usize) < plan.covered, "{}", plan.strips);
        let rects: Vec<_> = strip_rects(&scene, &wake).take(plan.covered).flatten().collect();
        for p in &plan.block.points[..plan.strips as usize] {
            for side in [-0.99, 0.0, 0.99] {
                let at = Vec3::from_slice(&p.place) + Vec3::from_slice(&p.side) * (side * p.place[3]);
                let Some(pixel) = scene.lens.project(at.as_dvec3()) else { continue };
                if pixel.cmplt(DVec2::ZERO).any() || pixel.x >= 640.0 || pixel.y >= 360.0 {
                    continue;
                }
                let holds = rects.iter().any(|r| {
                    pixel.x >= f64::from(r.x)
                        && pixel.y >= f64::from(r.y)
                        && pixel.x <= f64::from(r.x + r.width)
                        && pixel.y <= f64::from(r.y + r.height)
                });
                assert!(holds, "{pixel} not in {rects:?}");
            }
        }
    }

    #[test]
    fn foam_is_as_bright_as_its_albedo_and_the_sea_as_the_pictures() {
        let (scene, _) = seen(70.0);
        let white = scene.light.sun * scene.light.sun_direction.z as f32 + scene.light.sky;
        assert!((foam_light(scene.light.on_level()) / white - Vec3::splat(0.55)).abs().max_element() < 1e-6);
        let mut bright = scene.light;
        bright.sky *= 9.0;
        assert!((foam_light(bright.on_level()).max_element() - FOAM_MAX).abs() < 1e-6);
        let rough = 0.08;
        let fitted = sea_fit(&scene.light, rough) * flat_sea(&scene.light, SEEN_DOWN, rough);
        assert!((fitted - scene.light.sea).abs().max_element() < 1e-6);
    }
}
