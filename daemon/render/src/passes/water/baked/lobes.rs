//! The numbers of the method `Waves` for one boat in one frame: what `core::reflection` says of it, as the shaders read it.

use bowwave_core::{
    frame::{
        reflection::{
            BANDS, HALF_WIDTH_MIN_PX, Lobes, ReflectionTable, ReflectionTransfer, ReflectionView, STEPS,
            SeaLobes,
            grid::{TONE_GAIN, TONE_OUTER},
            tilt_away, water_light, wind_to_view,
        },
        scene::{BoatView, PixelRect, Scene},
    },
    geometry::curvature_drop,
    model::Model,
};
use glam::{DVec2, DVec3};
use shaders_spirv::interface::{HULL_LINE_COLUMNS, LAYER_COLUMNS, LOBE_COLUMNS, LobeBlock, ReflectBlock};

use crate::passes::{boats::coverage::Cells, water::line::HullLine};

/// Pieces of a reflection's outline beside the hull, and of what is marked of it.
const PIECES: usize = 8;
/// Most vectors of the frame's list that a boat's strips take.
pub(crate) const STRIP_VECTORS_MAX: usize = 2 * (HULL_LINE_COLUMNS - 1 + 2 * PIECES);
/// Pixels to a column of the boat's picture and of the layers, where there are columns enough; and the fewest columns.
const COLUMN_PX: f64 = 2.0;
const COLUMNS_MIN: u32 = 12;

/// The sea of the frames, and room for one boat's lobes.
pub(crate) struct Waves {
    table: ReflectionTable,
    sea: SeaLobes,
    wind_m_s: f64,
    lobes: Lobes,
}

impl Waves {
    pub(crate) fn new() -> Self {
        let table = ReflectionTable::baked();
        let sea = table.sea(0.0);
        let mut lobes = Lobes::default();
        lobes.steps.reserve_exact(STEPS);
        lobes.aside_m.reserve_exact(STEPS);
        Self { table, sea, wind_m_s: 0.0, lobes }
    }

    /// What the sea throws back of a boat; `None` where that is nothing.
    pub(crate) fn block(
        &mut self,
        scene: &Scene,
        boat: &BoatView,
        line: &HullLine,
        model: &Model,
        out: &mut LobeBlock,
    ) -> Option<Reach> {
        /// Beyond the ends of the hull the picture of the boat goes on by this share of its width: what overhangs the water line.
        const OVERHANG: f64 = 0.12;
        /// Stands for the width of the band after the last that is looked up.
        const NO_MORE: f32 = -1.0;
        let wind_m_s = scene.wind.length();
        if wind_m_s != self.wind_m_s {
            self.table.set_sea(&mut self.sea, wind_m_s);
            self.wind_m_s = wind_m_s;
        }
        let away = (boat.pose.position - scene.camera.position).truncate();
        let eye_m = scene.camera.position.z - boat.water_level;
        let focal = focal_px(scene, boat)?;
        let tangent = eye_m / away.length();
        let pixels = focal / away.length();
        let (first, last) = line.ends();
        let seen = ReflectionView {
            wind_to_view: wind_to_view(scene.wind, away),
            sky: scene.sky,
            water: water_light(&scene.light),
            level_m: boat.water_level - boat.hidden_m + curvature_drop(away.length()),
            tilt: tilt_away(&boat.pose, away),
            eye_m,
            range_m: away.length(),
            height_m: (model.height_m() - boat.hidden_m).max(0.3),
            width_m: (last - first) / pixels,
            pixel: 1.0 / focal,
        };
        self.lobes.set(&self.sea, &seen);
        if self.lobes.reach_m <= 0.0 {
            return None;
        }
        let overhang = OVERHANG * (last - first) + 2.0;
        let board = last - first + 2.0 * overhang;
        let columns = columns_for(board, LOBE_COLUMNS);
        let pitch = board / f64::from(columns);
        out.place = [tangent, 1.0 / focal].map(|v| v as f32);
        let reach_m = self.lobes.reach_m;
        let reach = Reach { tangent, focal, pixels, overhang, eye_m, reach_m, sky_most: self.sky_most() };
        let (side, more) = self.sides(&reach);
        let steps = self.lobes.steps.len();
        let widest = last - first + 2.0 * (side + more * steps as f64);
        let counts = [self.lobes.bands as u32, steps as u32, columns, columns_for(widest, LAYER_COLUMNS)];
        out.sizes = counts.map(|n| n as i32);
        out.span = [first, last - first, side, more].map(|v| v as f32);
        out.board = [seen.height_m, first - overhang, pitch, pixels].map(|v| v as f32);
        for (step, bands) in out.lobes.iter_mut().zip(&self.lobes.steps) {
            let seen = seen_bands(bands);
            for (vectors, lobe) in step.iter_mut().zip(&bands[..seen]) {
                let ReflectionTransfer { thrown, taken, aside_m, half_width_m, hue, .. } = *lobe;
                *vectors = [
                    [thrown.mean, thrown.slope, aside_m, half_width_m],
                    (hue * taken.mean).extend(taken.slope).to_array(),
                ];
            }
            if let Some(end) = step.get_mut(seen) {
                end[0][3] = NO_MORE;
            }
        }
        Some(reach)
    }

    /// The luminance above which light is the sun's, as a parabola through that of the first, the middle and the last step: the
    /// coefficients of the powers of the step over the last.
    fn sky_most(&self) -> [f32; 3] {
        let last = self.lobes.steps.len() - 1;
        let [a, b, c] = [0, last / 2, last].map(|step| self.lobes.steps[step][0].sky_most);
        // Where the middle one stands.
        let x = (last / 2) as f32 / last as f32;
        let bend = ((b - a) / x - (c - a)) / (x - 1.0);
        [a, c - a - bend, bend]
    }

    /// How much farther than the hull the last block's reflection goes to each side at a step, pixels.
    fn side(&self, reach: &Reach, step: usize) -> f64 {
        /// Pixels beyond the farthest light of a reflection.
        const SIDE_MARGIN_PX: f64 = 4.0;
        let aside = self.lobes.aside_m.get(step).map_or(0.0, |m| m * reach.pixels);
        aside.max(HALF_WIDTH_MIN_PX) + reach.overhang + SIDE_MARGIN_PX
    }

    /// The same at the hull, and what each step adds so that all steps have room.
    fn sides(&self, reach: &Reach) -> (f64, f64) {
        let at_hull = self.side(reach, 0);
        let more = (1..self.lobes.steps.len()).map(|step| (self.side(reach, step) - at_hull) / step as f64);
        (at_hull, more.fold(0.0, f64::max))
    }

    /// Appends the strips of water that the last block's reflection is drawn on, as `reflect.vert` takes them; says how many.
    pub(crate) fn strips(&self, reach: &Reach, line: &HullLine, out: &mut Vec<[f32; 4]>) -> u32 {
        /// Pixels above the hull-water line that are drawn along the hull, so that no bare water shows between hull and reflection.
        const FOOT_PX: f64 = 3.0;
        /// No piece of the outline is lower than so many pixels.
        const PIECE_PX: f64 = 8.0;
        let before = out.len();
        let mut strip = |x: [f64; 2], y: [f64; 2], below: [f64; 3]| {
            out.push([x[0], x[1], y[0], y[1]].map(|v| v as f32));
            out.push([below[0], below[1], below[2], 0.0].map(|v| v as f32));
        };
        let lower = |y: f64| reach.below(y, reach.reach_m);
        for (a, b) in line.corners().zip(line.corners().skip(1)) {
            strip([a.x, b.x], [a.y, b.y], [-FOOT_PX, lower(a.y), lower(b.y)]);
        }
        // Beside the hull there is sea above the line, farther off than the boat.
        let [left, right] = [0, HULL_LINE_COLUMNS - 1].map(|column| line.corner(column));
        let pieces = ((lower(0.0) / PIECE_PX) as usize).clamp(1, PIECES);
        for piece in 0..pieces {
            let steps = [piece, piece + 1].map(|p| p * (self.lobes.steps.len() - 1) / pieces);
            let side = (steps[0]..=steps[1]).map(|s| self.side(reach, s)).fold(0.0, f64::max);
            for (x, y) in [([left.x - side, left.x], left.y), ([right.x, right.x + side], right.y)] {
                let [from, to] = steps.map(|s| reach.below(y, self.lobes.step_m(s)));
                strip(x, [y, y], [from, to, to]);
            }
        }
        ((out.len() - before) / 2) as u32
    }
}

/// Marks the cells that strips touch.
pub(crate) fn mark_strips(strips: &[[f32; 4]], line: &HullLine, cells: &mut Cells, within: PixelRect) {
    for strip in strips.chunks_exact(2) {
        let ([left, right, a, b], [upper, lower_a, lower_b, _]) =
            (strip[0].map(f64::from), strip[1].map(f64::from));
        let (from, to) = (a.min(b) + upper, (a + lower_a).max(b + lower_b));
        // In pieces: seen with a tilted head, a tall strip's box is wide.
        let at = |piece: usize| from + (to - from) * piece as f64 / PIECES as f64;
        for piece in 0..PIECES {
            line.mark([left, right], [at(piece), at(piece + 1)], cells, within);
        }
    }
}

/// How far a reflection goes on the screen, and up to which light it is the sky that the boat hides.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reach {
    tangent: f64,
    focal: f64,
    pixels: f64,
    overhang: f64,
    eye_m: f64,
    reach_m: f64,
    sky_most: [f32; 3],
}

impl Reach {
    /// Pixels below the hull-water line of the water at a distance from the hull, where the line lies so far below the anchor.
    fn below(&self, line: f64, distance_m: f64) -> f64 {
        let near = (self.tangent + line / self.focal).max(1e-5);
        let range = self.eye_m / near;
        let tangent = self.eye_m / (range - distance_m).max(0.05 * range);
        (tangent - near) * self.focal
    }
}

/// Pixels to a tangent of 1 downwards, about where a boat is seen.
fn focal_px(scene: &Scene, boat: &BoatView) -> Option<f64> {
    let foot = boat.pose.position.with_z(boat.water_level);
    let at = |p: DVec3| scene.lens.project(scene.camera.to_camera(p));
    let lift = 0.002 * boat.range_m;
    let pixels = (at(foot - DVec3::Z * lift)? - at(foot)?).length() / lift;
    let focal = pixels * (foot - scene.camera.position).truncate().length();
    (focal.is_finite() && focal > 1.0).then_some(focal)
}

/// How many bands from the water up are seen: close to the hull, water that is seen from above mirrors little that is high.
fn seen_bands(bands: &[ReflectionTransfer; BANDS]) -> usize {
    /// Bands that together throw back or take away less are not looked up: of a boat as bright as white, on water a tenth as bright, less
    /// than half a code of 256.
    const UNSEEN: f32 = 1e-3;
    let above = bands.iter().rev().scan(0.0, |sum, l| {
        *sum += l.thrown.most().max(l.taken.most());
        Some(*sum)
    });
    BANDS - above.take_while(|sum| *sum < UNSEEN).count()
}

/// Columns for so many pixels.
fn columns_for(pixels: f64, most: u32) -> u32 {
    ((pixels / COLUMN_PX).ceil() as u32).clamp(COLUMNS_MIN, most)
}

/// How bright the sea of a scene is, as the shaders take it, for any boat.
pub(crate) fn sea_block(scene: &Scene) -> ReflectBlock {
    let size = DVec2::new(f64::from(scene.lens.width), f64::from(scene.lens.height));
    let down = |pixel: DVec2| scene.camera.tangent_below(&scene.lens, pixel);
    // The plane through the tangents about the middle of the screen: bent by less than a pixel's worth within a usual lens.
    let (middle, arm) = (size / 2.0, size / 8.0);
    let slope = |axis: DVec2| {
        let arm = axis * arm;
        (down(middle + arm) - down(middle - arm)) / (2.0 * arm.length())
    };
    let (right, below) = (slope(DVec2::X), slope(DVec2::Y));
    let start = down(middle) - right * middle.x - below * middle.y;
    let tones = &scene.tones;
    let with = |c: [f32; 3], last: f32| [c[0], c[1], c[2], last];
    ReflectBlock {
        tangent: [right as f32, below as f32, start as f32, 0.0],
        mean: with(tones.mean, tones.roots[0]),
        spread: with(tones.spread.map(|c| c * (TONE_OUTER as f32 / TONE_GAIN)), tones.roots[1]),
        ..ReflectBlock::default()
    }
}

/// What puts the layers of a boat onto a sea: `at` is the index of its blocks and the first vector of its strips.
pub(crate) fn reflect_block(
    sea: &ReflectBlock,
    lobes: &LobeBlock,
    reach: &Reach,
    at: (u32, u32),
) -> ReflectBlock {
    let [_, steps, _, columns] = lobes.sizes;
    let last = (steps - 1) as f32;
    let [tangent, per_pixel] = lobes.place;
    let [sky, sky_1, sky_2] = reach.sky_most;
    let step_squared = (reach.eye_m / (reach.focal * reach.reach_m)) as f32 * last * last;
    let [right, below, start, _] = sea.tangent;
    ReflectBlock {
        index: at.0,
        first: at.1,
        last_step: last,
        first_row: (at.0 as usize * STEPS) as f32 + 0.5,
        tangent: [right, below, start, (columns - 1) as f32],
        place: [tangent, per_pixel, step_squared, 0.0],
        span: lobes.span,
        sky_most: [sky, sky_1 / last, sky_2 / (last * last), 0.0],
        ..*sea
    }
}
