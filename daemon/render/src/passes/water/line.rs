//! Where a boat's hull meets the water, on the screen.

use bowwave_core::{
    frame::scene::{BoatView, PixelRect, Scene},
    geometry::RigidPose,
    model::Model,
};
use glam::{DVec2, DVec3};
use shaders_spirv::interface::{HULL_LINE_COLUMNS, WaterBlock};

use crate::passes::boats::coverage::Cells;

/// A piece of the hull-water line counts as straight where it lies within so many pixels of its chord.
const STRAIGHT_PX: f64 = 0.15;

/// Where a boat's hull meets the water, on the screen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct HullLine {
    /// The point from which it is measured, pixels.
    pub(super) anchor: DVec2,
    /// Unit vector in which gravity pulls at the boat.
    pub(super) down: DVec2,
    /// Across position of the first column, pixels.
    pub(super) first: f64,
    /// Pixels from one column to the next.
    pub(super) pitch: f64,
    /// Pixels below the anchor, column by column.
    pub(super) below: [f64; HULL_LINE_COLUMNS],
    /// Height of the boat above its waterline, pixels.
    pub(crate) height: f64,
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

    /// Takes back the marks of cells that lie above the hull-water line, or below where reflection, `fade_px` long, and shadow have faded.
    pub(crate) fn unmark_dry(&self, cells: &mut Cells, block: &WaterBlock, fade_px: f64) {
        let reach = fade_px.max(f64::from(block.shadow / block.shadow_fall));
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
}
