//! Which cells of the searchlight's grid add any light.

use bowwave_core::frame::{
    scene::{PixelRect, Scene},
    searchlight::{BeamGrid, BeamLight, SEA_ALBEDO, SearchlightView},
};
use glam::Vec3;
use shaders_spirv::interface::{BeamBlock, BeamNode};

use crate::{
    passes::behind_hulls::{HullPiece, pieces},
    rects::cut,
};

/// Linear light below which nothing is drawn: a third of a code in the dark.
const LEAST: f32 = 1e-4;

/// A frame's light of the searchlight.
#[derive(Default)]
pub(crate) struct BeamPlan {
    grid: BeamGrid,
    pub(crate) nodes: Vec<BeamNode>,
    pub(crate) pieces: Vec<HullPiece<BeamBlock>>,
}

impl BeamPlan {
    /// One for a screen of that size.
    pub(crate) fn new(size: (u32, u32)) -> Self {
        let grid = BeamGrid::new(size);
        let room = grid.nodes().len();
        Self { grid, nodes: Vec::with_capacity(room), pieces: Vec::with_capacity(2 * room) }
    }

    pub(crate) fn clear(&mut self) {
        self.nodes.clear();
        self.pieces.clear();
    }

    /// Finds the light, and what of it lies under `hulls`; appends what it reaches to `touched`.
    pub(crate) fn make(
        &mut self,
        scene: &Scene,
        view: &SearchlightView,
        hulls: &[PixelRect],
        (rest, touched): (&mut Vec<PixelRect>, &mut Vec<PixelRect>),
    ) {
        self.grid.light(view, &scene.camera, &scene.lens);
        self.nodes.extend(self.grid.nodes().iter().map(|node| BeamNode { light: [node.haze, node.sea] }));
        let strength = view.strength as f32;
        let sea = SEA_ALBEDO * strength;
        let (columns, cell_px) = (self.grid.columns(), self.grid.cell_px());
        let cell = |pixel: u32| (f64::from(pixel) / cell_px) as i32;
        let block = BeamBlock {
            haze: Vec3::splat(strength).extend(cell_px as f32).to_array(),
            sea: sea.extend(0.0).to_array(),
            ..BeamBlock::default()
        };
        let is_seen = |node: &BeamLight| strength * node.haze + sea.max_element() * node.sea > LEAST;
        let rows = self.grid.nodes().chunks_exact(columns);
        for (row, (upper, lower)) in rows.clone().zip(rows.skip(1)).enumerate() {
            let lit = |column: &usize| {
                [&upper[*column], &upper[column + 1], &lower[*column], &lower[column + 1]]
                    .into_iter()
                    .any(is_seen)
            };
            let (Some(first), Some(last)) = ((0..columns - 1).find(lit), (0..columns - 1).rev().find(lit))
            else {
                continue;
            };
            let px = |cell: usize| (cell as f64 * cell_px) as u32;
            let (x, y) = (px(first), px(row));
            let whole = PixelRect { x, y, width: px(last + 1) - x, height: px(row + 1) - y };
            let Some(whole) = cut(whole, (scene.lens.width, scene.lens.height)) else { continue };
            touched.push(whole);
            pieces(whole, hulls, rest, |rect, hidden| {
                let first = cell(rect.x);
                let count = cell(rect.x + rect.width - 1) - first + 1;
                let cells = [first, row as i32, count, columns as i32];
                self.pieces.push(HullPiece {
                    rect,
                    hidden,
                    instances: count as u32,
                    block: BeamBlock { cells, ..block },
                });
            });
        }
    }
}
