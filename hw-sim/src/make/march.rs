//! Draws the sea as a level camera sees it: every column walks outwards over the waves and paints each piece of water that
//! is not hidden by a nearer one over as much of the column as it covers.

use std::{
    f32::consts::TAU,
    ops::{Add, AddAssign, Mul, Range, Sub},
};

use bowwave_core::geometry::curvature_drop;
use glam::{Vec3, Vec4};

use super::{
    foam::Foam,
    patches::Patches,
    shade::{COLUMNS_PER_RADIAN, Glitter, Roughness, Slice, WaterTable},
};
use crate::ocean::{
    cloudy::{CloudyDome, CloudySky, Rgb},
    looped::{CASCADES, Covariance, LEVELS, LoopedSea, LoopedSurface},
};

/// Pieces of water per row of the picture where waves are drawn one by one.
const STEPS_PER_ROW: f32 = 1.1;
/// Longest step relative to range there: front and back of the waves must be met even where a row spans many of them.
const STEP_MAX: f32 = 0.008;
/// Beyond this range single waves only tint a row.
const FAR_M: f32 = 900.0;
/// Longest step relative to range beyond.
const STEP_FAR: f32 = 0.02;
/// Points of a tile are at least this share of a step apart.
const SHORTEST: f32 = 0.3;
/// Rows of the water table over range.
const TABLE_ROWS: usize = 32;
/// Columns between which the glitter's parameters are interpolated.
const GLITTER_STRIDE: usize = 32;
/// Columns drawn together.
const BLOCK: usize = 64;
/// Most columns from one look-up to the next; divides [`BLOCK`].
const STRIDE_MAX: usize = 16;

/// One distance from the camera.
struct MarchStep {
    range: f32,
    /// Metres from column to column.
    spacing: f32,
    drop: f32,
    table_row: f32,
    grazing: f32,
    transmittance: f32,
    roughness: Roughness,
    /// For each tile the level, the next one's share, and whether the tile still shows anything.
    levels: [(usize, f32, bool); CASCADES],
    foam_threshold: f32,
}

/// The surface that a level picture is drawn on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ViewShape {
    /// A plane: columns by the tangent of the angle off the axis.
    Plane,
    /// An upright cylinder: columns by azimuth, rows by the tangent of the elevation.
    Cylinder,
}

/// A camera without roll or elevation, looking along an azimuth.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LevelView {
    /// What it is drawn on.
    pub shape: ViewShape,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Focal length, pixels.
    pub focal: f32,
    /// Column of the view's axis.
    pub centre: f32,
    /// Row of level directions.
    pub level_row: f32,
    /// Radians clockwise from north.
    pub azimuth: f32,
}

/// The picture of the sea alone: linear colour times coverage, and coverage.
#[derive(Default)]
pub(crate) struct SeaPicture {
    pub texels: Vec<Vec4>,
    highest: Vec<f32>,
    columns: Vec<SeaColumn>,
}

#[derive(Clone, Copy)]
struct SeaColumn {
    east: f32,
    north: f32,
    /// Rows per tangent of elevation.
    scale: f32,
    table_column: f32,
    haze: Vec4,
}

/// Subject and eye of one frame.
struct SeaLook<'a> {
    surface: &'a LoopedSurface,
    sky: &'a CloudySky,
    view: &'a LevelView,
    eye_height: f32,
}

/// The part of the drawing that stays the same over a recording.
pub(crate) struct SeaShader {
    steps: Vec<MarchStep>,
    table: WaterTable,
    patches: Patches,
    foam: Option<Foam>,
    sun_irradiance: Vec4,
    haze: Vec<Vec4>,
}

/// Settings of a [`SeaShader`].
pub(crate) struct SeaShaderInput {
    pub eye_height: f32,
    pub focal: f32,
    /// Tangent of the steepest line of sight below the horizontal.
    pub steepest: f32,
    pub visibility_m: f32,
    /// Slope variance of the whole sea (upwind, crosswind) and where the wind comes from.
    pub slopes: [f64; 2],
    pub wind_from: f64,
    pub wind: f64,
    pub upwelling: Rgb,
    pub seed: u64,
}

impl SeaShader {
    pub fn new(input: &SeaShaderInput, sky: &CloudySky, dome: &CloudyDome, surface: &LoopedSurface) -> Self {
        let (resolved, height_variance) = LoopedSea::statistics(surface);
        let whole = rotate_slopes(input.slopes, input.wind_from);
        let crest = 3.0 * height_variance.sqrt() as f32;
        let start =
            ((input.eye_height - crest).max(0.3 * input.eye_height) / input.steepest.max(0.02)).max(0.5);
        let end = (2.0 * f64::from(input.eye_height) * 6.371e6 / 0.87).sqrt() as f32;
        let foam = Foam::new(input.wind, surface);
        let mut steps = Vec::new();
        let mut range = start * 0.85;
        while range < end {
            let step = step_at(input, range);
            steps.push(make_step(input, surface, &resolved, whole, foam.as_ref(), range, step));
            range += step;
        }
        let (first, last) = (start * 0.85, range);
        let rows: Vec<Roughness> = (0..TABLE_ROWS)
            .map(|i| {
                let range = first * (last / first).powf(i as f32 / (TABLE_ROWS - 1) as f32);
                make_step(input, surface, &resolved, whole, None, range, step_at(input, range)).roughness
            })
            .collect();
        for step in &mut steps {
            step.table_row = (step.range / first).ln() / (last / first).ln() * (TABLE_ROWS - 1) as f32;
        }
        let haze = (0..360)
            .map(|i| {
                let a = i as f32 * TAU / 360.0;
                Vec3::from(sky.haze(Vec3::new(a.sin(), a.cos(), 0.0))).extend(1.0)
            })
            .collect();
        Self {
            steps,
            table: WaterTable::new(&rows, dome, input.upwelling),
            patches: Patches::new(input.wind_from, input.seed),
            foam,
            sun_irradiance: Vec3::from(sky.sun_irradiance).extend(0.0),
            haze,
        }
    }

    /// Paints the sea of `surface` seen by `view` from `eye_height` metres into `picture`.
    pub fn draw(
        &self,
        surface: &LoopedSurface,
        sky: &CloudySky,
        view: &LevelView,
        eye_height: f32,
        picture: &mut SeaPicture,
    ) {
        picture.texels.clear();
        picture.texels.resize(view.width * view.height, Vec4::ZERO);
        picture.highest.clear();
        picture.highest.resize(view.width, f32::MAX);
        self.columns(view, &mut picture.columns);
        // Some columns at a time, so that the part of the tiles that they walk over stays in the nearest cache.
        let look = SeaLook { surface, sky, view, eye_height };
        for first in (0..view.width).step_by(BLOCK) {
            let block = first..(first + BLOCK).min(view.width);
            for step in &self.steps {
                self.ring(step, &look, block.clone(), picture);
            }
        }
    }

    fn columns(&self, view: &LevelView, columns: &mut Vec<SeaColumn>) {
        let (sin, cos) = view.azimuth.sin_cos();
        columns.clear();
        // The last block looks up to one column beyond itself.
        columns.extend((0..=view.width.next_multiple_of(BLOCK)).map(|x| {
            let off = (x as f32 + 0.5 - view.centre) / view.focal;
            let secant = (1.0 + off * off).sqrt();
            let turned = if view.shape == ViewShape::Plane { off.atan() } else { off };
            let azimuth = (view.azimuth + turned).rem_euclid(TAU);
            let (east, north, scale) = match view.shape {
                ViewShape::Plane => ((sin + off * cos) / secant, (cos - off * sin) / secant, secant),
                ViewShape::Cylinder => (azimuth.sin(), azimuth.cos(), 1.0),
            };
            let degree = azimuth.to_degrees();
            let (low, fraction) = (degree as usize % 360, degree.fract());
            let (a, b) = (self.haze[low], self.haze[(low + 1) % 360]);
            SeaColumn {
                east,
                north,
                scale: view.focal * scale,
                table_column: azimuth * COLUMNS_PER_RADIAN,
                haze: a.lerp(b, fraction),
            }
        }));
    }

    /// A block of columns at one distance.
    fn ring(&self, step: &MarchStep, look: &SeaLook<'_>, block: Range<usize>, picture: &mut SeaPicture) {
        let first = block.start;
        let columns = &picture.columns[first..=first + BLOCK];
        // All look-ups first: they wait for memory side by side, which the branches below would prevent.
        let mut waters = [Vec4::ZERO; BLOCK];
        sample(step, look.surface, columns, &mut waters);
        let mut patches = [0.0f32; BLOCK];
        let patch_stride = stride(step.spacing, 2.0 * Patches::SPACING_M);
        interpolate(step, columns, patch_stride, &mut patches, |e, n| self.patches.at(e, n));
        let glitter: [Glitter; BLOCK / GLITTER_STRIDE + 1] = std::array::from_fn(|i| {
            let column = columns[i * GLITTER_STRIDE];
            Glitter::new(&step.roughness, column.east, column.north, look.sky)
        });
        let glitters = glitter.iter().any(Glitter::within_reach);
        let slice = self.table.slice(step.table_row);
        let inverse_range = 1.0 / step.range;
        for x in block {
            let column = picture.columns[x];
            let water = waters[x - first];
            let tangent = (water.x - step.drop - look.eye_height) * inverse_range;
            let row = look.view.level_row - column.scale * tangent;
            let below = picture.highest[x];
            if row >= below {
                continue;
            }
            picture.highest[x] = row;
            // The first piece of a column has no lower edge yet; it lies below the picture.
            if below == f32::MAX || below <= 0.0 || row >= look.view.height as f32 {
                continue;
            }
            let shine = if glitters { Some((&glitter, x - first)) } else { None };
            let colour = self.colour(step, &column, water, patches[x - first], &slice, shine);
            paint(&mut picture.texels, look.view, x, row, below, colour);
        }
    }

    /// Light from one piece of water through the air to the eye; the fourth number is its coverage, 1.
    #[inline(always)]
    fn colour(
        &self,
        step: &MarchStep,
        column: &SeaColumn,
        water: Vec4,
        patch: f32,
        slice: &Slice<'_>,
        shine: Option<(&[Glitter; BLOCK / GLITTER_STRIDE + 1], usize)>,
    ) -> Vec4 {
        // Gusts raise the small waves, slicks smooth them; rougher water shows more of its faces (see `Patches`).
        let gain = 1.0 + 0.35 * patch.clamp(-1.5, 1.5);
        let along = gain * (water.y * column.east + water.z * column.north) + 0.012 * patch;
        let across = gain * (water.y * column.north - water.z * column.east);
        // A facet tilted sideways mirrors another azimuth.
        let turned = (-2.0 * (along + step.grazing).max(0.0) * across).clamp(-0.6, 0.6);
        let mut colour = slice.at(along, column.table_column + turned * COLUMNS_PER_RADIAN);
        if let Some((glitter, x)) = shine {
            let (node, between) = (x / GLITTER_STRIDE, x % GLITTER_STRIDE);
            let here = glitter[node].at(along, across, colour.w);
            let next = glitter[node + 1].at(along, across, colour.w);
            let t = between as f32 / GLITTER_STRIDE as f32;
            colour += (here + t * (next - here)) * self.sun_irradiance;
        }
        if let Some(foam) = &self.foam {
            colour = foam.cover(colour, water, step.foam_threshold, patch, column.haze);
        }
        column.haze.lerp(colour, step.transmittance).with_w(1.0)
    }
}

/// Height, slopes and squeeze under each of a block's columns at one distance.
fn sample(step: &MarchStep, surface: &LoopedSurface, columns: &[SeaColumn], waters: &mut [Vec4; BLOCK]) {
    for (tile, &(level, share, shows)) in surface.tiles.iter().zip(&step.levels) {
        if !shows {
            continue;
        }
        let fine = tile.level(level);
        let stride = stride(step.spacing, fine.spacing_m());
        if share > 0.0 {
            let coarse = tile.level(level + 1);
            interpolate(step, columns, stride, waters, |e, n| {
                fine.sample(e, n).lerp(coarse.sample(e, n), share)
            });
        } else {
            interpolate(step, columns, stride, waters, |e, n| fine.sample(e, n));
        }
    }
}

/// Columns from one look-up to the next, where neighbouring columns are `column_m` apart and a field's points `point_m`.
fn stride(column_m: f32, point_m: f32) -> usize {
    let points = (point_m / column_m) as usize;
    // The largest power of two that does not step over a point.
    1 << points.clamp(1, STRIDE_MAX).ilog2()
}

/// Adds `look_up` (of a place in metres east and north) to every column, looking up only every `stride` columns and going
/// straight between.
#[inline(always)]
fn interpolate<T>(
    step: &MarchStep,
    columns: &[SeaColumn],
    stride: usize,
    values: &mut [T; BLOCK],
    look_up: impl Fn(f32, f32) -> T,
) where
    T: Copy + Add<Output = T> + Sub<Output = T> + Mul<f32, Output = T> + AddAssign,
{
    let at = |x: usize| {
        let column = &columns[x];
        look_up(step.range * column.east, step.range * column.north)
    };
    if stride == 1 {
        for (x, value) in values.iter_mut().enumerate() {
            *value += at(x);
        }
        return;
    }
    let share = 1.0 / stride as f32;
    let mut from = at(0);
    for first in (0..BLOCK).step_by(stride) {
        let to = at(first + stride);
        let change = (to - from) * share;
        let mut value = from;
        for target in &mut values[first..first + stride] {
            *target += value;
            value += change;
        }
        from = to;
    }
}

/// Adds `colour` to column `x` between rows `upper` and `lower` (not whole numbers), by covered share.
#[inline(always)]
fn paint(texels: &mut [Vec4], view: &LevelView, x: usize, upper: f32, lower: f32, colour: Vec4) {
    let upper = upper.max(0.0);
    let lower = lower.min(view.height as f32);
    let mut row = upper as i32 as usize;
    let mut from = upper;
    while from < lower {
        let end = (row as f32 + 1.0).min(lower);
        if let Some(texel) = texels.get_mut(row * view.width + x) {
            *texel += (end - from) * colour;
        }
        from = end;
        row += 1;
    }
}

/// From one distance to the next.
fn step_at(input: &SeaShaderInput, range: f32) -> f32 {
    let row_span = range / (input.focal * input.eye_height) * range;
    let limit = if range < FAR_M { STEP_MAX } else { STEP_MAX + (range / FAR_M - 1.0) * 0.01 };
    (row_span / STEPS_PER_ROW).clamp(2e-4 * range, limit.min(STEP_FAR) * range)
}

fn make_step(
    input: &SeaShaderInput,
    surface: &LoopedSurface,
    resolved: &[[Covariance; LEVELS]; CASCADES],
    whole: Covariance,
    foam: Option<&Foam>,
    range: f32,
    step: f32,
) -> MarchStep {
    let spacing = range / input.focal;
    // Waves much shorter than a step would be met at random places: they belong to what is not resolved.
    let finest = spacing.max(SHORTEST * step);
    let mut seen = [0.0f32; 3];
    let levels = std::array::from_fn(|c| {
        let level = surface.tiles[c].level_for(finest).clamp(0.0, (LEVELS - 1) as f32);
        let low = (level as usize).min(LEVELS - 2);
        // Only the second half of the way to the next level is blended: the first half costs one look-up instead of two.
        let share = (2.0 * (level - low as f32) - 1.0).max(0.0);
        let blend: Covariance = std::array::from_fn(|i| {
            let (a, b) = (resolved[c][low][i], resolved[c][low + 1][i]);
            a + share * (b - a)
        });
        let shows = blend[0] + blend[1] > 2e-3 * (resolved[c][0][0] + resolved[c][0][1]);
        if shows {
            for i in 0..3 {
                seen[i] += blend[i];
            }
        }
        (low, share, shows)
    });
    let drop = curvature_drop(f64::from(range)) as f32;
    let floor = 0.06 * (whole[0] + whole[1]);
    let residual = [(whole[0] - seen[0]).max(floor), (whole[1] - seen[1]).max(floor), whole[2] - seen[2]];
    // A covariance may not outgrow what its variances allow.
    let limit = 0.8 * (residual[0] * residual[1]).sqrt();
    let residual = [residual[0], residual[1], residual[2].clamp(-limit, limit)];
    let slant = (input.eye_height + drop) / range;
    // The line of sight meets the curved sea at less than its depression.
    let bend = 2.0 * drop / range;
    let grazing = (slant - bend).max(2e-4);
    let grazing = grazing / (1.0 + grazing * grazing).sqrt();
    let transmittance = (-3.912 * range / input.visibility_m).exp();
    MarchStep {
        range,
        spacing,
        drop,
        table_row: 0.0,
        grazing,
        transmittance,
        roughness: Roughness { grazing, residual },
        levels,
        foam_threshold: foam.map_or(0.0, |f| f.threshold(&levels)),
    }
}

/// Slope variances up and across the wind as east, north and covariance.
fn rotate_slopes([up, cross]: [f64; 2], wind_from: f64) -> Covariance {
    let (e, n) = wind_from.sin_cos();
    [(up * e * e + cross * n * n) as f32, (up * n * n + cross * e * e) as f32, ((up - cross) * e * n) as f32]
}
