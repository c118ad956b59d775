//! What one frame draws, decided before anything is recorded: blocks for the shaders, draws and rectangles, in lists that keep
//! their memory from frame to frame.

use ash::vk;
use bowwave_core::{
    model::Model,
    scene::{Pass, PixelRect, ReflectionMethod, Scene},
};
use shaders_spirv::interface::{BoatBlock, RoundBlock, WaterBlock};

use crate::{
    atlas::{self, Placed},
    frame_data::Capacity,
    passes::{
        boats::BoatDraw,
        mirror::MirrorDraw,
        rounds::{RoundDraw, pieces},
        water::WaterDraw,
    },
    pipeline::{cut, disjoint},
    rounds::round_block,
    view,
    water::{HullLine, hull_line, mirror_scale, water_block},
};

/// Pixels beyond a reflection's rectangle at which the water shader still compares the video: nine gradients of at most eight
/// pixels' step, and the cells that they are taken in.
const GRADIENTS_REACH_PX: u32 = 84;

/// `r` with the pixels that gradients starting in it can reach, on a screen of `size`.
pub(crate) fn with_gradients(r: PixelRect, size: (u32, u32)) -> PixelRect {
    let (x, y) = (r.x.saturating_sub(GRADIENTS_REACH_PX), r.y.saturating_sub(GRADIENTS_REACH_PX));
    let right = (r.x + r.width + GRADIENTS_REACH_PX).min(size.0);
    let lower = (r.y + r.height + GRADIENTS_REACH_PX).min(size.1);
    PixelRect { x, y, width: right - x, height: lower - y }
}

/// What of a model the frame's plan needs: all but its mesh and texture.
pub(crate) struct Outline(Model);

impl Outline {
    pub(crate) fn of(model: &Model) -> Self {
        Self(Model {
            vertices: Vec::new(),
            indices: Vec::new(),
            parts: Vec::new(),
            texture: None,
            ..model.clone()
        })
    }
}

/// One frame's draws.
#[derive(Default)]
pub(crate) struct Plan {
    pub(crate) boat_blocks: Vec<BoatBlock>,
    pub(crate) water_blocks: Vec<WaterBlock>,
    pub(crate) round_blocks: Vec<RoundBlock>,
    pub(crate) boats: Vec<BoatDraw>,
    pub(crate) mirrors: Vec<MirrorDraw>,
    /// Where each of `mirrors` lies in the mirror layer.
    pub(crate) places: Vec<Placed>,
    pub(crate) waters: Vec<WaterDraw>,
    pub(crate) rounds: Vec<RoundDraw>,
    /// Pixels that hulls can cover, cut apart.
    pub(crate) hulls: Vec<PixelRect>,
    /// Every rectangle that something is blended into.
    pub(crate) rects: Vec<PixelRect>,
    /// The same as copies between buffer and screen.
    pub(crate) regions: Vec<vk::BufferImageCopy>,
    /// What of the video the water's shader compares.
    pub(crate) backdrop_regions: Vec<vk::BufferImageCopy>,
    pub(crate) quads: u32,
    wanted: Vec<(PixelRect, f64)>,
    lines: Vec<(usize, HullLine)>,
    rest: Vec<PixelRect>,
}

impl Plan {
    pub(crate) fn with_capacity(capacity: Capacity) -> Self {
        let Capacity { boats, rounds } = capacity;
        Self {
            boat_blocks: Vec::with_capacity(boats * 2),
            water_blocks: Vec::with_capacity(boats),
            round_blocks: Vec::with_capacity(rounds),
            boats: Vec::with_capacity(boats),
            mirrors: Vec::with_capacity(boats),
            places: Vec::with_capacity(boats),
            waters: Vec::with_capacity(boats),
            rounds: Vec::with_capacity(rounds * 4),
            hulls: Vec::with_capacity(boats * 8),
            rects: Vec::with_capacity(boats * 2 + rounds + 8),
            regions: Vec::with_capacity(boats * 2 + rounds + 8),
            backdrop_regions: Vec::with_capacity(boats),
            wanted: Vec::with_capacity(boats),
            lines: Vec::with_capacity(boats),
            rest: Vec::with_capacity(64),
            quads: 0,
        }
    }

    /// Decides anew for `scene` on a screen of `size` with a mirror layer of `atlas` texels.
    pub(crate) fn make(&mut self, scene: &Scene, models: &[Outline], size: (u32, u32), atlas: (u32, u32)) {
        self.clear();
        if scene.runs(Pass::Boats) {
            self.plan_boats(scene, models, size);
        }
        if scene.runs(Pass::Water) {
            self.plan_water(scene, models, size, atlas);
        }
        disjoint(self.boats.iter().map(|b| b.rect), &mut self.hulls);
        if scene.runs(Pass::Rounds) {
            self.plan_rounds(scene);
        }
    }

    fn clear(&mut self) {
        self.boat_blocks.clear();
        self.water_blocks.clear();
        self.round_blocks.clear();
        self.boats.clear();
        self.mirrors.clear();
        self.places.clear();
        self.waters.clear();
        self.rounds.clear();
        self.hulls.clear();
        self.rects.clear();
        self.wanted.clear();
        self.lines.clear();
    }

    fn plan_boats(&mut self, scene: &Scene, models: &[Outline], size: (u32, u32)) {
        for boat in &scene.boats {
            let Some(Outline(model)) = models.get(usize::from(boat.model.0)) else { continue };
            let Some(rect) = boat.hull.and_then(|r| cut(r, size)) else { continue };
            let pose = view::drawn_pose(&scene.camera, boat, model.kind);
            self.boats.push(BoatDraw { model: boat.model, index: self.boat_blocks.len() as u32, rect });
            self.boat_blocks.push(view::boat_block(scene, boat, &pose, false));
            self.rects.push(rect);
        }
    }

    /// Boats whose waterline cannot be placed on the screen have no reflection.
    fn plan_water(&mut self, scene: &Scene, models: &[Outline], size: (u32, u32), atlas: (u32, u32)) {
        for (i, boat) in scene.boats.iter().enumerate() {
            let Some(Outline(model)) = models.get(usize::from(boat.model.0)) else { continue };
            let Some(rect) = boat.reflection.and_then(|r| cut(r, size)) else { continue };
            let pose = view::drawn_pose(&scene.camera, boat, model.kind);
            let Some(line) = hull_line(scene, boat, &pose, model) else { continue };
            self.wanted.push((rect, mirror_scale(scene, &line)));
            self.lines.push((i, line));
        }
        atlas::place(atlas, &self.wanted, &mut self.places);
        let mirrored = scene.water.method != ReflectionMethod::Off;
        for (((i, line), placed), (rect, _)) in self.lines.iter().zip(&self.places).zip(&self.wanted) {
            let boat = &scene.boats[*i];
            self.waters.push(WaterDraw { index: self.water_blocks.len() as u32, rect: *rect });
            self.water_blocks.push(water_block(scene, boat, line, placed));
            self.rects.push(*rect);
            if let Some(Outline(model)) = models.get(usize::from(boat.model.0)).filter(|_| mirrored) {
                let pose = view::drawn_pose(&scene.camera, boat, model.kind);
                self.mirrors.push(MirrorDraw { model: boat.model, index: self.boat_blocks.len() as u32 });
                self.boat_blocks.push(view::boat_block(scene, boat, &pose, true));
            }
        }
    }

    fn plan_rounds(&mut self, scene: &Scene) {
        for (i, round) in scene.rounds.iter().enumerate() {
            // The golden ratio's multiples spread evenly: neighbours never look alike.
            let seed = (i as f32 * 0.618_034).fract() * 64.0;
            let Some((block, rect)) = round_block(scene, round, seed) else { continue };
            let index = self.round_blocks.len() as u32;
            self.round_blocks.push(block);
            self.rects.push(rect);
            pieces(index, rect, &self.hulls, &mut self.rest, &mut self.rounds);
        }
    }
}
