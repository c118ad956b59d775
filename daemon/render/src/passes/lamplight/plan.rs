//! Cells of the lamps' grid that add any light, and pools of light on the sea.

use std::f64::consts::FRAC_1_PI;

use bowwave_core::frame::{
    lamplight::{LightGrid, NodeLight},
    lamps::{LAMPS_MAX, LampView, foam_at},
    scene::{PixelRect, Scene},
    searchlight::SEA_ALBEDO,
    view::clip_to_screen,
};
use glam::{DVec2, DVec3, Vec3};
use shaders_spirv::interface::{LamplightBlock, LamplightNode, PoolBlock};

use crate::rects::cut;

/// Linear light below which nothing is drawn: a third of a code in the dark.
const LEAST: f32 = 1e-4;
/// A pool ends here at the latest, metres, and at this share of its distance.
const POOL_MOST_M: f64 = 80.0;
const POOL_SHARE: f64 = 0.5;

/// Cells of a row of the grid.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CellRow {
    pub(crate) rect: PixelRect,
    pub(crate) block: LamplightBlock,
}

/// A pool of light on the sea.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pool {
    pub(crate) rect: PixelRect,
    pub(crate) block: PoolBlock,
}

/// A frame's lamplight.
#[derive(Default)]
pub(crate) struct LamplightPlan {
    grid: LightGrid,
    pub(crate) nodes: Vec<LamplightNode>,
    /// Cells that get any light.
    pub(crate) cells: Vec<CellRow>,
    pub(crate) pools: Vec<Pool>,
}

impl LamplightPlan {
    /// One for a screen of that size.
    pub(crate) fn new(size: (u32, u32)) -> Self {
        let grid = LightGrid::new(size);
        let room = grid.nodes().len();
        let rows = room / grid.columns();
        Self {
            grid,
            nodes: Vec::with_capacity(room),
            cells: Vec::with_capacity(rows),
            pools: Vec::with_capacity(LAMPS_MAX),
        }
    }

    pub(crate) fn clear(&mut self) {
        self.nodes.clear();
        self.cells.clear();
        self.pools.clear();
    }

    /// Finds the light; appends what it reaches to `touched`.
    pub(crate) fn make(&mut self, scene: &Scene, touched: &mut Vec<PixelRect>) {
        self.grid.light(&scene.lamplight(), &scene.camera, &scene.lens);
        let light = |node: &NodeLight| (node.air + node.sea).extend(0.0).to_array();
        self.nodes.extend(self.grid.nodes().iter().map(|node| LamplightNode { light: light(node) }));
        rows_of(&self.grid, (scene.lens.width, scene.lens.height), &mut self.cells);
        self.pools
            .extend(scene.lamps.iter().filter(|lamp| !lamp.is_high).filter_map(|lamp| pool(scene, lamp)));
        touched.extend(self.cells.iter().map(|row| row.rect));
        touched.extend(self.pools.iter().map(|pool| pool.rect));
    }
}

impl LamplightPlan {
    /// Light of the air before a boat: the mean of the corners of its pixels, since a fire of its own outshines all in their middle. Zero while
    /// no lamp shines. It is that of whole lines of sight: what lies behind a boat is little.
    pub(crate) fn air_at(&self, rect: PixelRect) -> Vec3 {
        if self.nodes.is_empty() {
            return Vec3::ZERO;
        }
        let cell = |pixel: u32| (f64::from(pixel) / self.grid.cell_px()).round() as usize;
        let (columns, rows) =
            ([rect.x, rect.x + rect.width].map(cell), [rect.y, rect.y + rect.height].map(cell));
        let node = |column: usize, row: usize| self.grid.nodes().get(row * self.grid.columns() + column);
        let corners = rows.into_iter().flat_map(|row| columns.map(|column| node(column, row)));
        corners.flatten().map(|node| node.air * 0.25).sum()
    }
}

/// Cells of `grid` that get any light, row by row.
fn rows_of(grid: &LightGrid, size: (u32, u32), into: &mut Vec<CellRow>) {
    let (columns, cell_px) = (grid.columns(), grid.cell_px());
    let is_seen = |node: &NodeLight| (node.air + node.sea).max_element() > LEAST;
    let rows = grid.nodes().chunks_exact(columns);
    for (row, (upper, lower)) in rows.clone().zip(rows.skip(1)).enumerate() {
        let lit = |column: &usize| {
            [&upper[*column], &upper[column + 1], &lower[*column], &lower[column + 1]]
                .into_iter()
                .any(is_seen)
        };
        let (Some(first), Some(last)) = ((0..columns - 1).find(lit), (0..columns - 1).rev().find(lit)) else {
            continue;
        };
        let px = |cell: usize| (cell as f64 * cell_px) as u32;
        let (x, y) = (px(first), px(row));
        let whole = PixelRect { x, y, width: px(last + 1) - x, height: px(row + 1) - y };
        let Some(rect) = cut(whole, size) else { continue };
        let cells = [first as i32, row as i32, (last - first + 1) as i32, columns as i32];
        into.push(CellRow { rect, block: LamplightBlock { cells, cell_px: cell_px as f32 } });
    }
}

/// The pool of light on the sea about a lamp's foot, and the pixels that hold it; `None` where nothing of it is seen.
fn pool(scene: &Scene, lamp: &LampView) -> Option<Pool> {
    /// Corners of the rim by which its place on the screen is found.
    const CORNERS: u32 = 16;
    let camera = &scene.camera;
    let foot = lamp.at.with_z(0.0);
    let height_m = lamp.at.z.max(0.3);
    let range_m = camera.position.distance(foot);
    let air = (-lamp.extinction_per_m * range_m).exp() as f32;
    let light = lamp.strength * SEA_ALBEDO * (FRAC_1_PI as f32 * air);
    let strength = f64::from(light.max_element());
    let reach_m = (strength * height_m / f64::from(LEAST)).cbrt().min(POOL_MOST_M).min(POOL_SHARE * range_m);
    if reach_m.is_nan() || reach_m <= height_m {
        return None;
    }
    let rim = |i: u32| {
        let (sin, cos) = (f64::from(i) / f64::from(CORNERS) * std::f64::consts::TAU).sin_cos();
        let p = camera.to_camera(foot + DVec3::new(cos, sin, 0.0) * (1.03 * reach_m));
        (p.z > 1.0).then(|| scene.lens.project(p)).flatten()
    };
    let mut bounds = [DVec2::INFINITY, DVec2::NEG_INFINITY];
    for i in 0..CORNERS {
        let p = rim(i)?;
        bounds = [bounds[0].min(p), bounds[1].max(p)];
    }
    let rect = clip_to_screen(bounds[0] - 2.0, bounds[1] + 2.0, scene.lens.width, scene.lens.height)?;
    let level = |v: DVec3, w: f64| (camera.world_from_camera.inverse() * v).extend(w).as_vec4().to_array();
    let block = PoolBlock {
        foot: camera.to_camera(foot).extend(height_m).as_vec4().to_array(),
        aside: level(DVec3::X, reach_m),
        away: level(DVec3::Y, 0.0),
        light: light.extend(0.0).to_array(),
    };
    Some(Pool { rect, block })
}

/// Light that lamps give a white matt thing on the own ship, whose upper sides the camera sees; zero where nothing of it is seen.
pub(crate) fn on_own_ship(scene: &Scene) -> Vec3 {
    let flash = scene.flash.map_or(Vec3::ZERO, |flash| flash.on_gun);
    let sum = foam_at(&scene.lamps, scene.camera.position) + flash;
    if sum.max_element() > LEAST { sum } else { Vec3::ZERO }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;

    fn lamp(at: DVec3) -> LampView {
        LampView { at, strength: Vec3::splat(25_000.0), extinction_per_m: 2e-4, is_high: false }
    }

    #[test]
    fn a_pool_lies_about_the_foot_of_its_lamp() {
        let scene = testing::empty_scene(1280, 720);
        let Pool { rect, block } = pool(&scene, &lamp(DVec3::new(5.0, 200.0, 2.0))).unwrap();
        let foot = scene.lens.project(scene.camera.to_camera(DVec3::new(5.0, 200.0, 0.0))).unwrap();
        let inside = foot.x > f64::from(rect.x) && foot.x < f64::from(rect.x + rect.width);
        assert!(inside && rect.width > 100 && rect.height < rect.width, "{rect:?} {foot}");
        assert!(block.foot[3] == 2.0 && block.aside[3] > 10.0);
        for hidden in [DVec3::new(0.0, -200.0, 2.0), DVec3::new(0.0, 1e6, 2.0), DVec3::NAN] {
            assert!(pool(&scene, &lamp(hidden)).is_none(), "{hidden}");
        }
    }

    #[test]
    fn a_gun_is_lit_by_what_stands_over_it() {
        let mut scene = testing::empty_scene(1280, 720);
        assert_eq!(on_own_ship(&scene), Vec3::ZERO);
        scene.lamps = vec![lamp(scene.camera.position + DVec3::Z * 100.0)];
        // 2.5 of white at a hundred metres, over pi, less what 100 m of air take.
        assert!((on_own_ship(&scene).x - 2.5 * FRAC_1_PI as f32 * 0.98).abs() < 0.01);
        scene.lamps = vec![lamp(scene.camera.position - DVec3::Z * 100.0)];
        assert_eq!(on_own_ship(&scene), Vec3::ZERO, "from below");
    }
}
