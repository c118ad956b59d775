//! The numbers of Nelson 2009's Full Reflection shader (eq. 4-8) for one boat in one frame. The thesis gives the formulas but not
//! their constants; those here were chosen by eye against photographs, for each wind force 0 to 4.

use std::f64::consts::TAU;

use bowwave_core::{
    colour::LUMINANCE,
    estimate::light::Light,
    frame::scene::{BoatView, PixelRect, Scene},
    geometry::RigidPose,
    model::Model,
    sea::{BeaufortForce, fresnel, mean_square_slope},
    water::{ReflectionMethod, ShadowLevel},
    world::waves::{Spectrum, WaveField, WaveSpec},
};
use glam::{DVec2, DVec3, Vec3};
use shaders_spirv::interface::{HULL_LINE_COLUMNS, LOBE_COLUMNS, WaterBlock};

use crate::{
    atlas::{Placed, SCALE_MAX},
    coverage::Cells,
};

/// Highest wind force at which a reflection is seen.
const FORCE_MAX: usize = 4;

/// k of eq. 6 as printed: pixels over which the reflection fades, by wind force.
const PRINTED_FADE_PX: [f64; FORCE_MAX + 1] = [500.0, 320.0, 200.0, 120.0, 70.0];
/// As printed: the sine moves the mirror coordinate by up to this, pixels.
const PRINTED_SHIFT_PX: [f64; FORCE_MAX + 1] = [4.0, 7.0, 10.0, 13.0, 16.0];
/// As printed: share of the largest shift beyond which the reflection is discarded.
const PRINTED_LIMIT: f64 = 0.7;
/// As printed: brightness below and above which the video passes through.
const PRINTED_PASSES: (f64, f64) = (0.10, 0.85);
/// As printed: i and k (pixels) of eq. 7 for levels 1 and 2.
const PRINTED_SHADOW: [(f64, f64); 2] = [(0.5, 120.0), (0.9, 25.0)];

/// Mended: k of eq. 6 in heights of the boat on the screen, by wind force.
const FADE_HEIGHTS: [f64; FORCE_MAX + 1] = [2.4, 1.6, 1.15, 0.8, 0.55];
/// Mended: largest shift in heights of the boat.
const SHIFT_HEIGHTS: [f64; FORCE_MAX + 1] = [0.08, 0.20, 0.26, 0.29, 0.30];
/// Mended: share of the largest shift at which it stops.
const LIMIT: f64 = 0.5;
/// Mended: how far sideways a wave moves the reflection, in parts of how far down; as `water.frag` has it.
const SIDEWAYS: f64 = 0.35;
/// Mended: width of the box blur in heights of the boat.
const BLUR_HEIGHTS: [f64; FORCE_MAX + 1] = [0.018, 0.035, 0.06, 0.09, 0.12];
/// Mended: brightness over which the video begins to pass through, and over which it passes whole; dark, then bright.
const PASSES: [f64; 4] = [0.02, 0.08, 0.80, 0.95];
/// Mended: i and k (heights of the boat) of eq. 7 for levels 1 and 2.
const SHADOW: [(f64, f64); 2] = [(0.35, 0.55), (0.7, 0.16)];
/// Mended: spread of the nine gradients, in codes 0 to 1, that a camera's noise alone makes.
const NOISE_SPREAD: f64 = 0.03;

/// Mended: pixels between the nine gradients' places, in heights of the boat, and at most.
const STEP_HEIGHTS: f64 = 0.012;
const STEP_MAX_PX: f64 = 8.0;
/// Mended: share of the largest shift at the hull, and over how many heights of the boat it grows to the whole: a wave's slope
/// moves what stands high above the water more.
const SHIFT_NEAR: f64 = 0.15;
const SHIFT_GROWN_HEIGHTS: f64 = 0.8;

/// Physics as printed: height and frequency of wave and swell (metres, radians a metre), by wind force. The thesis names but does not
/// state them: amplitudes of the force's probable wave height, lengths of its peak and of a fifth of it.
const PRINTED_WAVES: [[f64; 4]; FORCE_MAX + 1] = [
    [0.002, 12.0, 0.002, 3.0],
    [0.008, 8.0, 0.015, 1.6],
    [0.02, 4.0, 0.03, 0.8],
    [0.05, 1.6, 0.09, 0.27],
    [0.08, 0.9, 0.15, 0.16],
];

/// Wind speed in the middle of each force, m/s (WMO-No. 306, code table 1100).
const WIND_M_S: [f64; FORCE_MAX + 1] = [0.1, 0.9, 2.5, 4.4, 6.7];

/// The hull's shadow is followed so far, in its heights: there a wall hides a hundredth of the sky.
const CONTACT_HEIGHTS: f64 = 2.5;
/// What comes out of clear water, as a share of a white matt surface (Mobley 1994, fig. 3.27): no less does.
const CLEAR_WATER: f64 = 0.015;
/// A shadow of less is not seen: half a code of a mid grey.
const CONTACT_SEEN: f64 = 0.01;
/// The sea's mean in the picture stands for a line of sight so far below the horizontal, tangent.
pub(crate) const SEEN_DOWN: f64 = 0.12;

/// Waves of the mended Physics shader, as `water.frag` has it.
pub(crate) const PHYSICS_WAVES: usize = 8;

/// A piece of the hull-water line counts as straight where it lies within so many pixels of its chord.
const STRAIGHT_PX: f64 = 0.15;

/// Where a boat's hull meets the water, on the screen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct HullLine {
    /// The point from which it is measured, pixels.
    anchor: DVec2,
    /// Unit vector in which gravity pulls at the boat.
    down: DVec2,
    /// Across position of the first column, pixels.
    first: f64,
    /// Pixels from one column to the next.
    pitch: f64,
    /// Pixels below the anchor, column by column.
    below: [f64; HULL_LINE_COLUMNS],
    /// Height of the boat above its waterline, pixels.
    height: f64,
}

/// Projects the model's outline at the water's level. `None` where too little of it is before the camera.
pub(crate) fn hull_line(scene: &Scene, boat: &BoatView, pose: &RigidPose, model: &Model) -> Option<HullLine> {
    let project = |world: DVec3| scene.lens.project(scene.camera.to_camera(world));
    let at_water = |body: DVec2| pose.to_world(body.extend(0.0)).with_z(boat.water_level);
    let foot = pose.position.with_z(boat.water_level);
    let anchor = project(foot)?;
    let top = project(foot + DVec3::Z * model.height_m().max(0.1))?;
    let height = (anchor - top).length();
    let down = (anchor - top).try_normalize()?;
    let across = DVec2::new(down.y, -down.x);
    let local = |body: &DVec2| {
        let p = project(at_water(*body))? - anchor;
        Some(DVec2::new(p.dot(across), p.dot(down)))
    };
    let (mut first, mut last) = (f64::INFINITY, f64::NEG_INFINITY);
    for p in model.waterline.iter().filter_map(local) {
        (first, last) = (first.min(p.x), last.max(p.x));
    }
    if !(first.is_finite() && last.is_finite() && height.is_finite()) {
        return None;
    }
    let pitch = ((last - first) / (HULL_LINE_COLUMNS - 1) as f64).max(1e-3);
    let mut below = [f64::NEG_INFINITY; HULL_LINE_COLUMNS];
    let ends = model.waterline.iter().zip(model.waterline.iter().cycle().skip(1));
    for (a, b) in ends {
        if let (Some(a), Some(b)) = (local(a), local(b)) {
            lower(
                &mut below,
                (a - DVec2::X * first) / DVec2::new(pitch, 1.0),
                (b - DVec2::X * first) / DVec2::new(pitch, 1.0),
            );
        }
    }
    // A column that no edge crosses (part of the outline is behind the camera) takes its neighbour's.
    let known = below.iter().copied().find(|b| b.is_finite())?;
    let mut before = known;
    for b in &mut below {
        *b = if b.is_finite() { *b } else { before };
        before = *b;
    }
    Some(HullLine { anchor, down, first, pitch, below, height })
}

impl HullLine {
    /// Marks the cells that the boat's shadow can darken.
    pub(crate) fn mark_shadow(&self, cells: &mut Cells, within: PixelRect, block: &WaterBlock) {
        if block.shadow <= 0.0 {
            return;
        }
        let depth = f64::from(block.shadow / block.shadow_fall);
        let ((low, high), (left, right)) = (self.extent(), self.ends());
        self.mark([left - 0.25 * depth, right + 0.25 * depth], [low, high + depth], cells, within);
    }

    /// Takes back the marks of cells that lie above the hull-water line, or below where reflection and shadow have faded.
    pub(crate) fn unmark_dry(&self, cells: &mut Cells, block: &WaterBlock, method: ReflectionMethod) {
        let faded = match method {
            // These do not fade: they end where nothing is mirrored.
            ReflectionMethod::Physics | ReflectionMethod::PhysicsAsPrinted => f64::INFINITY,
            _ => f64::from(block.alpha / block.alpha_fall),
        };
        let reach = faded.max(f64::from(block.shadow / block.shadow_fall));
        let (low, high) = self.extent();
        cells.unmark(|corners| {
            let below = corners.map(|c| (c - self.anchor).dot(self.down));
            below.iter().all(|b| *b < low - 1.0) || below.iter().all(|b| *b > high + reach + 1.0)
        });
    }

    /// Marks the cells of a span: from and to right of the anchor, from and to below it, pixels.
    pub(crate) fn mark(&self, across: [f64; 2], below: [f64; 2], cells: &mut Cells, within: PixelRect) {
        let right = DVec2::new(self.down.y, -self.down.x);
        let (mut from, mut to) = (DVec2::MAX, DVec2::MIN);
        for x in across {
            for y in below {
                let p = self.anchor + right * x + self.down * y;
                (from, to) = (from.min(p), to.max(p));
            }
        }
        cells.mark_span(from - 1.0, to + 1.0, within);
    }

    /// Left and right end of the line, pixels right of the anchor.
    pub(crate) fn ends(&self) -> (f64, f64) {
        (self.first, self.corner(HULL_LINE_COLUMNS - 1).x)
    }

    /// The line as straight pieces, none farther from it than [`STRAIGHT_PX`]: their ends from left to right, pixels right of the
    /// anchor and below it.
    pub(crate) fn corners(&self) -> impl Iterator<Item = DVec2> {
        let last = HULL_LINE_COLUMNS - 1;
        let columns = std::iter::successors(Some(0), move |from| {
            let straight = |to: &usize| self.is_straight(*from, *to);
            (*from < last).then(|| (from + 2..=last).take_while(straight).last().unwrap_or(from + 1))
        });
        columns.map(|column| self.corner(column))
    }

    /// The line at a column of its table.
    pub(crate) fn corner(&self, column: usize) -> DVec2 {
        DVec2::new(self.first + self.pitch * column as f64, self.below[column])
    }

    fn is_straight(&self, from: usize, to: usize) -> bool {
        let (a, b) = (self.below[from], self.below[to]);
        (from + 1..to).all(|column| {
            let chord = a + (b - a) * (column - from) as f64 / (to - from) as f64;
            (self.below[column] - chord).abs() <= STRAIGHT_PX
        })
    }

    /// Highest and lowest point of the line, pixels below the anchor.
    pub(crate) fn extent(&self) -> (f64, f64) {
        self.below.iter().fold((f64::MAX, f64::MIN), |(low, high), b| (low.min(*b), high.max(*b)))
    }
}

/// How far from where the mirror has a boat its light can be seen in the water, pixels right or left and up or down;
/// `softened_px` is how far the layer itself is smeared.
pub(crate) fn reach_px(block: &WaterBlock, method: ReflectionMethod, softened_px: f64) -> DVec2 {
    let limit = f64::from(block.shift_limit);
    let blur = f64::from(block.blur[0] / block.mirror_scale[0]) + softened_px;
    let shift = match method {
        ReflectionMethod::Off | ReflectionMethod::Mirror | ReflectionMethod::Waves => DVec2::ZERO,
        // Both coordinates shift by as much.
        ReflectionMethod::FullAsPrinted | ReflectionMethod::PhysicsAsPrinted => DVec2::splat(limit),
        ReflectionMethod::Full | ReflectionMethod::Physics => {
            let down = DVec2::from(block.down.map(f64::from)).abs();
            (down + SIDEWAYS * DVec2::new(down.y, down.x)) * limit
        }
    };
    shift + blur + 2.0
}

/// Lowers the columns that the edge from `a` to `b` crosses; x counts columns.
fn lower(below: &mut [f64; HULL_LINE_COLUMNS], a: DVec2, b: DVec2) {
    let (left, right) = if a.x <= b.x { (a, b) } else { (b, a) };
    // Half a thousandth of a column covers what rounding takes off the outermost points.
    for (column, value) in below.iter_mut().enumerate() {
        let x = column as f64;
        if x < left.x - 5e-4 || x > right.x + 5e-4 {
            continue;
        }
        let width = right.x - left.x;
        let y = if width > 1e-9 {
            left.y + (right.y - left.y) * ((x - left.x) / width).clamp(0.0, 1.0)
        } else {
            left.y.max(right.y)
        };
        *value = value.max(y);
    }
}

/// Texels of the mirror layer for each pixel that a boat needs: softened, three for each step of the blur.
pub(crate) fn mirror_scale(scene: &Scene, line: &HullLine) -> f64 {
    match scene.water.method {
        ReflectionMethod::Full => SCALE_MAX / blur_px(scene, line).max(1.0),
        // Its bands have so many columns; twice as many texels keep what is thin.
        ReflectionMethod::Waves => {
            let (left, right) = line.ends();
            (2.0 * f64::from(LOBE_COLUMNS) / (right - left).max(1.0)).min(1.0)
        }
        _ => 1.0,
    }
}

fn force(scene: &Scene) -> usize {
    usize::from(scene.water.force.get()).min(FORCE_MAX)
}

fn blur_px(scene: &Scene, line: &HullLine) -> f64 {
    BLUR_HEIGHTS[force(scene)] * line.height
}

/// The block of one boat whose mirror image lies at `placed`.
pub(crate) fn water_block(scene: &Scene, boat: &BoatView, line: &HullLine, placed: &Placed) -> WaterBlock {
    let force = force(scene);
    let height = line.height.max(1.0);
    let mended =
        !matches!(scene.water.method, ReflectionMethod::FullAsPrinted | ReflectionMethod::PhysicsAsPrinted);
    let shadow_level = match scene.water.shadow {
        ShadowLevel::None => None,
        ShadowLevel::Gradual => Some(0),
        ShadowLevel::Strong => Some(1),
    };
    let (shadow, shadow_px) = match (shadow_level, mended) {
        (None, _) => (0.0, 1.0),
        (Some(level), true) => (SHADOW[level].0, SHADOW[level].1 * height),
        (Some(level), false) => PRINTED_SHADOW[level],
    };
    let (alpha, fade_px, shift, limit) = if mended {
        let shift = SHIFT_HEIGHTS[force] * height;
        (mirrored_share(scene, boat), FADE_HEIGHTS[force] * height, shift, shift * LIMIT)
    } else {
        (1.0, PRINTED_FADE_PX[force], PRINTED_SHIFT_PX[force], PRINTED_SHIFT_PX[force] * PRINTED_LIMIT)
    };
    let (dark, bright) = PRINTED_PASSES;
    let passes = if mended { PASSES } else { [dark, dark, bright, bright] };
    let step = if mended { (STEP_HEIGHTS * height).clamp(1.0, STEP_MAX_PX) } else { 1.0 };
    // Mended, the layer is softened before.
    let blur = if mended { 0.0 } else { 1.0 };
    let texels = DVec2::new(f64::from(placed.atlas.0), f64::from(placed.atlas.1));
    let scale = DVec2::splat(placed.scale) / texels;
    let pair = |v: DVec2| v.as_vec2().to_array();
    let block = WaterBlock {
        anchor: pair(line.anchor),
        down: pair(line.down),
        columns: [line.first as f32, (1.0 / line.pitch) as f32],
        mirror_scale: pair(scale),
        mirror_offset: pair(placed.offset / texels),
        blur: pair(scale * blur),
        mirror_bounds: placed.bounds(),
        passes: passes.map(|p| p as f32),
        alpha: alpha as f32,
        alpha_fall: (alpha / fade_px) as f32,
        shadow: shadow as f32,
        shadow_fall: (1.0 / shadow_px) as f32 * if mended { shadow as f32 } else { 1.0 },
        shift: shift as f32,
        shift_limit: limit as f32,
        step: step as f32,
        flat_spread: NOISE_SPREAD as f32,
        shift_near: SHIFT_NEAR as f32,
        shift_grow: ((1.0 - SHIFT_NEAR) / (SHIFT_GROWN_HEIGHTS * height)) as f32,
        pad0: 0.0,
        pad1: 0.0,
        hull_line: line.below.map(|b| b as f32),
    };
    match scene.water.method {
        ReflectionMethod::PhysicsAsPrinted | ReflectionMethod::Physics => {
            physics_block(scene, boat, line, block)
        }
        ReflectionMethod::Waves if shadow_level.is_some() => contact_block(scene, boat, line, block),
        _ => block,
    }
}

/// What the Physics shaders read in place of what is the other shader's alone.
fn physics_block(scene: &Scene, boat: &BoatView, line: &HullLine, block: WaterBlock) -> WaterBlock {
    let eye = (scene.camera.position.z - boat.water_level).max(0.01);
    let range = (boat.pose.position - scene.camera.position).truncate().length().max(0.1);
    let tangent = eye / range;
    // The hull stands on the line: so many pixels are its height in metres.
    let focal = scene.lens.focal.y;
    let height = line.height * range / focal;
    let block = WaterBlock { passes: [tangent, 1.0 / focal, eye, height].map(|v| v as f32), ..block };
    if scene.water.method == ReflectionMethod::Physics {
        return block;
    }
    let [alpha, alpha_fall, shift_near, shift_grow] = PRINTED_WAVES[force(scene)].map(|v| v as f32);
    WaterBlock { alpha, alpha_fall, shift_near, shift_grow, ..block }
}

/// The shadow of a hull on the water by the scene's own light, in place of eq. 7: what the shader's `kept_off` reads.
fn contact_block(scene: &Scene, boat: &BoatView, line: &HullLine, block: WaterBlock) -> WaterBlock {
    let eye = (scene.camera.position.z - boat.water_level).max(0.01);
    let away = (boat.pose.position - scene.camera.position).truncate();
    let range = away.length().max(0.1);
    let (tangent, per_pixel) = (eye / range, 1.0 / scene.lens.focal.y);
    let high = line.height * range * per_pixel;
    let contact = Contact::of(&scene.light, away / range, tangent, high, scene.wind.length());
    let reach = contact.sun_m.max(CONTACT_HEIGHTS * high).min(0.8 * range);
    let reach_px = (eye / (range - reach) - tangent) / per_pixel;
    let seen = contact.sky * 0.5 + contact.sun > CONTACT_SEEN;
    WaterBlock {
        passes: [tangent, per_pixel, eye, high].map(|v| v as f32),
        alpha: contact.sky as f32,
        alpha_fall: contact.sun as f32,
        shift: contact.sun_m as f32,
        shadow: if seen { 1.0 } else { 0.0 },
        shadow_fall: (1.0 / reach_px.max(1.0)) as f32,
        ..block
    }
}

/// What a hull can keep from the water before it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Contact {
    /// Share of the sea's light that the sky made within the water.
    sky: f64,
    /// The same of the sun, where the hull's shadow lies on this side of it.
    sun: f64,
    /// How far towards the eye that shadow reaches, metres.
    sun_m: f64,
}

impl Contact {
    /// For a hull of a height that is seen along the unit vector `away` with that tangent below the horizontal.
    fn of(light: &Light, away: DVec2, tangent: f64, high_m: f64, wind_m_s: f64) -> Self {
        let rough = mean_square_slope(wind_m_s).sqrt();
        let luminance = |v: Vec3| f64::from(v.dot(LUMINANCE));
        // What the picture's sea holds beyond the mirrored sky has come out of the water.
        let mirrored = |down: f64| luminance(mirrored_sky(light, down, rough));
        let up = light.sun_direction.z.max(0.0);
        let (sun, sky) = (luminance(light.sun) * up, luminance(light.sky));
        let body = (luminance(light.sea) - mirrored(SEEN_DOWN)).max(CLEAR_WATER * (sun + sky));
        let share = body / (body + mirrored(tangent)).max(1e-6);
        let of_sun = sun / (sun + sky).max(1e-6);
        // Away from the sun the shadow falls; towards the eye where the sun stands behind the boat.
        let towards_eye = light.sun_direction.truncate().dot(away);
        let sun_m = if towards_eye > 0.0 { high_m * towards_eye / up.max(0.02) } else { 0.0 };
        let sun = if sun_m > 0.0 { share * of_sun } else { 0.0 };
        Self { sky: share * (1.0 - of_sun), sun, sun_m }
    }
}

/// Light of the sky that an untilted sea mirrors under a tangent below the horizontal.
pub(crate) fn mirrored_sky(light: &Light, down: f64, rough: f64) -> Vec3 {
    let up = 0.5 * (down + (down * down + rough * rough).sqrt());
    let t = (up / 0.6).clamp(0.0, 1.0) as f32;
    fresnel(up) as f32 * light.horizon.lerp(light.sky, t * t * (3.0 - 2.0 * t))
}

/// The sea of the mended Physics shader, made anew only when force or wind change: context it allocates.
#[derive(Default)]
pub(crate) struct PhysicsSea(Option<(BeaufortForce, f64, WaveField)>);

impl PhysicsSea {
    fn field(&mut self, scene: &Scene) -> &WaveField {
        let (force, wind_from) = (scene.water.force, (-scene.wind.x).atan2(-scene.wind.y));
        let kept = self.0.take().filter(|(f, w, _)| (*f, w.to_bits()) == (force, wind_from.to_bits()));
        let (_, _, field) = self.0.insert(kept.unwrap_or_else(|| {
            let spec = WaveSpec { spectrum: Spectrum::of_force(force), wind_from };
            (force, wind_from, WaveField::new(&spec, 0))
        }));
        field
    }
}

/// Waves of the sea's spectrum for the mended Physics shader: radians a metre away from the eye and to the right, amplitude, and phase at
/// the boat.
pub(crate) fn physics_waves(
    sea: &mut PhysicsSea,
    scene: &Scene,
    boat: &BoatView,
) -> [[f32; 4]; PHYSICS_WAVES] {
    let field = sea.field(scene);
    let away = (boat.pose.position - scene.camera.position).truncate();
    let away = away.try_normalize().unwrap_or(DVec2::Y);
    let right = DVec2::new(away.y, -away.x);
    let at = boat.pose.position.truncate();
    let time_s = scene.frame as f64 / 30.0;
    let mut out = [[0.0; 4]; PHYSICS_WAVES];
    // All waves carry the same energy: so few of them stand for all with the root of the ratio of their numbers.
    let every = (field.waves().len() / PHYSICS_WAVES).max(1);
    for (slot, wave) in out.iter_mut().zip(field.waves().iter().step_by(every)) {
        let k = wave.cycles_per_m * TAU;
        let amplitude = wave.amplitude_m * (every as f64).sqrt();
        *slot = [k.dot(away), k.dot(right), amplitude, wave.phase(at, time_s)].map(|v| v as f32);
    }
    out
}

/// Share of a boat's light that the sea throws back at the boat's range: Fresnel's formula for unpolarised light, at the
/// grazing angle of the view plus half the waves' typical slope, since it is the slopes that face the eye that are seen.
fn mirrored_share(scene: &Scene, boat: &BoatView) -> f64 {
    let eye = (scene.camera.position.z - boat.water_level).max(0.0);
    let grazing = eye.atan2(boat.range_m.max(1.0));
    // Cox and Munk 1954, upwind.
    let slope = (0.00316 * WIND_M_S[force(scene)]).sqrt();
    fresnel((grazing + 0.5 * slope).min(std::f64::consts::FRAC_PI_2).sin()).sqrt()
}

#[cfg(test)]
mod tests {
    use bowwave_core::geometry::look;

    use super::*;
    use crate::testing;

    #[test]
    fn hull_line_is_the_near_edge_of_the_outline_at_any_roll() {
        let models = [testing::box_model("b", [8.0, 2.4, 1.5], [0.5; 3])];
        for roll in [0.0, 0.4, std::f64::consts::FRAC_PI_2, -2.5] {
            let mut scene = testing::empty_scene(640, 480);
            scene.camera.world_from_camera = look(0.0, -0.1, roll);
            testing::add_boat(&mut scene, &models, 0, 60.0, 0.02, 0.7);
            let boat = &scene.boats[0];
            let line = hull_line(&scene, boat, &boat.pose, &models[0]).unwrap();
            // Every point of the outline lies on the line or above it, and the nearest corner lies on it.
            let across = DVec2::new(line.down.y, -line.down.x);
            let mut nearest = f64::INFINITY;
            for corner in &models[0].waterline {
                let p = scene
                    .lens
                    .project(scene.camera.to_camera(boat.pose.to_world(corner.extend(0.0))))
                    .unwrap();
                let local = p - line.anchor;
                let column = ((local.dot(across) - line.first) / line.pitch).clamp(0.0, 30.999);
                let (i, part) = (column as usize, column.fract());
                let edge = line.below[i] * (1.0 - part) + line.below[i + 1] * part;
                let gap = edge - local.dot(line.down);
                assert!(gap > -0.3, "roll {roll}: corner {corner} is {gap} px below the line");
                nearest = nearest.min(gap);
            }
            assert!(nearest < 0.3, "roll {roll}: {nearest}");
            // Gravity on a picture rolled clockwise by `roll` points to the lower right.
            let want = DVec2::new(roll.sin(), roll.cos());
            assert!((line.down - want).length() < 0.05, "roll {roll}: {} {want}", line.down);
        }
    }

    #[test]
    fn a_hull_keeps_from_the_water_what_had_come_out_of_it() {
        let mut light = testing::empty_scene(64, 64).light;
        let of = |light: &Light| Contact::of(light, DVec2::Y, 0.1, 2.0, 3.0);
        // The sun stands to the south, behind the eye: no shadow on this side, and the sky's part of the water's light.
        light.sea = Vec3::splat(0.4);
        light.sun_direction = DVec3::new(0.0, -0.8, 0.6);
        let behind_eye = of(&light);
        assert_eq!((behind_eye.sun, behind_eye.sun_m), (0.0, 0.0));
        assert!(behind_eye.sky > 0.0 && behind_eye.sky < 0.5, "{behind_eye:?}");
        // Behind the boat it throws the hull's shadow 2 m * 0.8 / 0.6 towards the eye.
        light.sun_direction = DVec3::new(0.0, 0.8, 0.6);
        let behind_boat = of(&light);
        assert!((behind_boat.sun_m - 2.0 * 0.8 / 0.6).abs() < 1e-9);
        assert!(behind_boat.sun > behind_boat.sky);
        // Of a sea that is darker than the sky that it mirrors, what clear water gives is kept off: a few hundredths.
        light.sea = Vec3::splat(1e-3);
        let dark = of(&light);
        assert!(
            dark.sky > 0.0 && dark.sky + dark.sun < 0.15 * (behind_boat.sky + behind_boat.sun),
            "{dark:?}"
        );
        light.sun_direction = DVec3::new(0.0, 0.0, -1.0);
        assert!(of(&light).sun_m.is_finite());
    }

    #[test]
    fn mended_distances_follow_the_boats_size_and_printed_ones_do_not() {
        let models = [testing::box_model("b", [8.0, 2.4, 1.5], [0.5; 3])];
        let block = |range: f64, method| {
            let mut scene = testing::empty_scene(640, 480);
            scene.water.method = method;
            testing::add_boat(&mut scene, &models, 0, range, 0.0, 0.7);
            let boat = &scene.boats[0];
            let line = hull_line(&scene, boat, &boat.pose, &models[0]).unwrap();
            let placed = Placed { atlas: (640, 240), ..Placed::default() };
            (line.height, water_block(&scene, boat, &line, &placed))
        };
        let (h1, near) = block(40.0, ReflectionMethod::Full);
        let (h2, far) = block(80.0, ReflectionMethod::Full);
        assert!((h1 / h2 - 2.0).abs() < 0.1);
        assert!((f64::from(near.shift / far.shift) - h1 / h2).abs() < 0.01);
        assert!(far.alpha > near.alpha, "the sea mirrors more at a grazing angle");
        let reach = |b: &WaterBlock| f64::from(b.alpha / b.alpha_fall);
        assert!((reach(&near) / reach(&far) - h1 / h2).abs() < 0.01);
        let (_, near) = block(40.0, ReflectionMethod::FullAsPrinted);
        let (_, far) = block(80.0, ReflectionMethod::FullAsPrinted);
        assert_eq!((near.shift, reach(&near)), (far.shift, reach(&far)));
    }
}
