//! The rival of bending corners: the virtual layers drawn straight into a rectified picture, which is then warped onto the video.

use anyhow::{Context as _, Result};
use bowwave_core::{
    frame::scene::Scene,
    geometry::{Distortion, Lens},
    model::Model,
    water::ReflectionMethod,
};
use bowwave_render::SOFTWARE;
use glam::{DVec2, DVec3};
use image::RgbImage;

use super::{even, rms};
use crate::reflection::{
    cost::process_ms,
    draw::{Painter, bare_scene, picture},
};

/// Larger pictures are refused by drivers.
const SIZE_MAX: f64 = 16384.0;

/// Edges whose drawing is held against the truth.
const EDGES: u64 = 120;

/// Parts of a pixel's side that coverage is counted on.
const FINE: usize = 8;

/// A black edge on white, codes.
const CODES: f64 = 255.0;

/// A lens without distortion that sees all that `lens` sees, `scale` pixels for one of the middle; `None` where none can.
pub fn rectified(lens: &Lens, scale: f64) -> Option<Lens> {
    let size = DVec2::new(f64::from(lens.width), f64::from(lens.height));
    let rim = |i: u32| {
        let share = f64::from(i) / 64.0;
        [DVec2::new(share, 0.0), DVec2::new(share, 1.0), DVec2::new(0.0, share), DVec2::new(1.0, share)]
    };
    let mut reach = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for at in (0..=64).flat_map(rim) {
        let n = flat(lens.unproject(at * size))?;
        reach = (reach.0.min(n), reach.1.max(n));
    }
    let focal = lens.focal * scale;
    let size = ((reach.1 - reach.0) * focal).ceil();
    let straight = Lens {
        width: size.x as u32,
        height: size.y as u32,
        focal,
        centre: -reach.0 * focal,
        distortion: Distortion::None,
        ..*lens
    };
    (size.max_element() <= SIZE_MAX).then_some(straight)
}

/// Where a direction meets the plane at a distance of one before the camera.
fn flat(ray: DVec3) -> Option<DVec2> {
    (ray.z > 1e-3).then(|| ray.truncate() / ray.z)
}

/// A straight edge on the plane at a distance of one: what lies to its right is black.
#[derive(Clone, Copy)]
struct WarpEdge {
    ends: [DVec2; 2],
}

impl WarpEdge {
    /// The `i`th, up to `longest` pixels long in the picture.
    fn drawn(lens: &Lens, i: u64, longest: f64) -> Option<Self> {
        let draw = |k: u64| even(8 * i + k);
        let size = DVec2::new(f64::from(lens.width), f64::from(lens.height));
        let from = size * DVec2::new(draw(0), draw(1));
        let along =
            DVec2::from_angle(std::f64::consts::TAU * draw(2)) * longest * draw(3).mul_add(0.75, 0.25);
        Some(Self { ends: [flat(lens.unproject(from))?, flat(lens.unproject(from + along))?] })
    }

    fn is_black(&self, n: DVec2) -> bool {
        let [a, b] = self.ends;
        (b - a).perp_dot(n - a) > 0.0
    }
}

/// Share of a pixel's square about `centre` that is black.
fn coverage(centre: DVec2, is_black: impl Fn(DVec2) -> bool) -> f64 {
    let fine = |i: usize| (i as f64 + 0.5) / FINE as f64 - 0.5;
    let black = (0..FINE * FINE).filter(|i| is_black(centre + DVec2::new(fine(i % FINE), fine(i / FINE))));
    black.count() as f64 / (FINE * FINE) as f64
}

/// Value of a rectified picture at `at`, blended from the four pixels around.
fn blended(at: DVec2, edge: &WarpEdge, straight: &Lens) -> f64 {
    let first = (at - 0.5).floor() + 0.5;
    let share = at - first;
    let pixel = |x: f64, y: f64| {
        coverage(first + DVec2::new(x, y), |p| edge.is_black((p - straight.centre) / straight.focal))
    };
    let row = |y: f64| pixel(0.0, y) * (1.0 - share.x) + pixel(1.0, y) * share.x;
    row(0.0) * (1.0 - share.y) + row(1.0) * share.y
}

/// Root mean square by which pixels on black edges up to `longest` pixels long differ from the edges' own coverage through `lens`, codes:
/// drawn as chords between bent ends, then from rectified pictures of these scales.
pub fn edge_errors<const N: usize>(lens: &Lens, longest: f64, scales: [f64; N]) -> (f64, [f64; N]) {
    let straight = scales.map(|scale| rectified(lens, scale));
    let mut chords = Vec::new();
    let mut warped = [const { Vec::new() }; N];
    for edge in (0..EDGES).filter_map(|i| WarpEdge::drawn(lens, i, longest)) {
        let [Some(a), Some(b)] = edge.ends.map(|n| lens.project(n.extend(1.0))) else { continue };
        for centre in pixels_along(lens, a, b) {
            let seen = |p: DVec2| flat(lens.unproject(p));
            let truth = coverage(centre, |p| seen(p).is_some_and(|n| edge.is_black(n)));
            chords.push((coverage(centre, |p| (b - a).perp_dot(p - a) > 0.0) - truth) * CODES);
            for (off, straight) in warped.iter_mut().zip(&straight) {
                let (Some(straight), Some(n)) = (straight, seen(centre)) else { continue };
                off.push((blended(n * straight.focal + straight.centre, &edge, straight) - truth) * CODES);
            }
        }
    }
    (rms(chords), warped.map(rms))
}

/// Centres of pixels of the picture that lie within a pixel of the chord from `a` to `b`.
fn pixels_along(lens: &Lens, a: DVec2, b: DVec2) -> impl Iterator<Item = DVec2> {
    let size = DVec2::new(f64::from(lens.width), f64::from(lens.height));
    let (low, high) = (a.min(b).max(DVec2::ZERO).floor(), a.max(b).min(size).ceil());
    let (wide, tall) = ((high - low).x.max(0.0) as usize, (high - low).y.max(0.0) as usize);
    let along = (b - a).normalize_or(DVec2::X);
    let length = a.distance(b);
    let centre = move |i: usize| low + DVec2::new((i % wide) as f64, (i / wide) as f64) + 0.5;
    (0..wide * tall).map(centre).filter(move |p| {
        let off = *p - a;
        (0.0..=length).contains(&off.dot(along)) && off.perp_dot(along).abs() < 1.0
    })
}

/// The least that drawing through a rectified picture takes.
pub struct Warped {
    straight: Painter,
    scene: Scene,
    sea: bowwave_core::event::Picture,
    bare: Painter,
    empty: Scene,
    /// Pictures of the screen's size, and of another one.
    pictures: [bowwave_core::event::Picture; 2],
}

impl Warped {
    /// Boats of `scene_through` a rectified picture of `lens`, on a sea of one grey.
    pub fn new(
        lens: &Lens,
        models: &[Model],
        boats: usize,
        scene_through: impl FnOnce(&Lens) -> Result<Scene>,
    ) -> Result<Self> {
        let straight = rectified(lens, 1.0).context("no rectified picture holds it")?;
        let grey = |width, height| picture(&RgbImage::from_pixel(width, height, image::Rgb([110, 115, 120])));
        let painter =
            |size, boats| Painter::new(size, models, &[ReflectionMethod::Baked], (boats, Some(SOFTWARE)));
        let scene = scene_through(&straight)?;
        Ok(Self {
            straight: painter((straight.width, straight.height), boats)?,
            sea: grey(straight.width, straight.height)?,
            bare: painter((lens.width, lens.height), 1)?,
            empty: bare_scene(
                scene.camera,
                Lens { distortion: Distortion::None, ..*lens },
                scene.water,
                scene.light,
            ),
            scene,
            pictures: [grey(lens.width, lens.height)?, grey(lens.width * 2 / 3, lens.height * 2 / 3)?],
        })
    }

    /// Processor time of one frame, nanoseconds: the boats drawn straight, and what fetching four pixels for each of the screen's
    /// takes more than fetching one, which is a warp without its lookup, its blending and its layer of opacity.
    pub fn frame_ns(&mut self) -> Result<f64> {
        let timed = |painter: &mut Painter, scene, sea| -> Result<f64> {
            let before = process_ms();
            painter.frame(scene, sea)?;
            Ok(process_ms() - before)
        };
        let boats = timed(&mut self.straight, &self.scene, &self.sea)?;
        let [same, other] = &self.pictures;
        let unscaled = timed(&mut self.bare, &self.empty, same)?;
        let scaled = timed(&mut self.bare, &self.empty, other)?;
        Ok((boats + (scaled - unscaled).max(0.0)) * 1e6)
    }
}
