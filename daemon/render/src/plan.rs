//! What one frame draws, decided before anything is recorded: blocks for the shaders, draws and rectangles, in lists that keep
//! their memory from frame to frame.

use ash::vk;
use bowwave_core::{
    frame::scene::{BoatView, Pass, PixelRect, Scene},
    model::Model,
    water::ReflectionMethod,
};
use glam::DVec2;
use shaders_spirv::interface::{
    BOAT_BLOCKS_MAX, BoatBlock, DrawBlock, LightBlock, LobeBlock, MethodBytes, PHYSICS_WAVES, ReflectBlock,
    RoundBlock, TRACK_POINTS, WATERS_MAX, WakeBlock, WaterBlock,
};

use crate::{
    frame_data::Capacity,
    frame_data::RECTS_MAX,
    passes::{
        atlas::{self, Placed},
        behind_hulls::{HullPiece, pieces},
        boats::{
            BoatDraw,
            coverage::{Boxes, Cells},
        },
        hud::layout::KINDS,
        lamplight::plan::LamplightPlan,
        lights::plan::{Mirror, light_block, mirrored_block},
        phantoms::PhantomLook,
        rounds::plan::round_block,
        shadow::plan::ShadowPlan,
        wake::{
            WakeDraw,
            plan::{WakePlan, spray_rect, strip_rects, wake_plan},
        },
        water::{
            WaterDraw,
            baked::{
                ReflectDraw,
                lobes::{STRIP_VECTORS_MAX, Waves, mark_strips, reflect_block, sea_block},
            },
            block::{mirror_scale, water_block},
            line::{HullLine, hull_line},
            physics::{PhysicsSea, physics_waves},
        },
    },
    rects::{around_all, corners, cut, joined, overlap, rect},
    view::{self, Shade},
};

/// Pixels beyond a reflection's rectangle at which the water shader still compares the video: nine gradients of at most eight
/// pixels' step, and the cells that they are taken in.
const GRADIENTS_REACH_PX: u32 = 84;

/// Pixels around a boat's boxes that its anti-aliased edges can touch.
const HULL_MARGIN_PX: f64 = 1.5;
/// A mirrored boat whose light is gathered to bands and to columns of two texels is drawn simplified by no more than this, texels.
const MIRRORED_DETAIL: f64 = 1.0;
/// Most rectangles for all hulls together, and for one boat's water.
const HULL_RECTS_MAX: usize = 512;
const WATER_RECTS_MAX: usize = 256;
/// Rounds in the air that are cut apart by hulls' own cells.
const ROUNDS_FEW: usize = 16;
/// Most rectangles that are copied to be blended into, and back.
const BLENDS_MAX: usize = 512;

/// `r` with the pixels that gradients starting in it can reach, on a screen of `size`.
pub(crate) fn with_gradients(r: PixelRect, size: (u32, u32)) -> PixelRect {
    let (x, y) = (r.x.saturating_sub(GRADIENTS_REACH_PX), r.y.saturating_sub(GRADIENTS_REACH_PX));
    let right = (r.x + r.width + GRADIENTS_REACH_PX).min(size.0);
    let lower = (r.y + r.height + GRADIENTS_REACH_PX).min(size.1);
    PixelRect { x, y, width: right - x, height: lower - y }
}

/// What of a model the frame's plan needs: no mesh and no texture.
pub(crate) struct Outline {
    model: Model,
    boxes: Boxes,
    /// What of it a reflection shows.
    solid: Boxes,
}

impl Outline {
    pub(crate) fn of(model: &Model) -> Self {
        let (boxes, solid) = (Boxes::of(model), Boxes::without_lines(model));
        let light = Model {
            vertices: Vec::new(),
            indices: Vec::new(),
            parts: Vec::new(),
            texture: None,
            ..model.clone()
        };
        Self { model: light, boxes, solid }
    }
}

/// One frame's draws.
#[derive(Default)]
pub(crate) struct Plan {
    pub(crate) boat_blocks: Vec<BoatBlock>,
    pub(crate) shadows: ShadowPlan,
    /// Boats get the camera's noise.
    pub(crate) noisy: bool,
    pub(crate) water_blocks: Vec<WaterBlock>,
    /// The method's own blocks of each of `water_blocks`, one after the other.
    pub(crate) method_blocks: Vec<f32>,
    pub(crate) round_blocks: Vec<RoundBlock>,
    pub(crate) boats: Vec<BoatDraw>,
    pub(crate) mirrors: Vec<BoatDraw>,
    /// Where each of `mirrors` lies in the mirror layer.
    pub(crate) mirror_places: Vec<Placed>,
    places: Vec<Placed>,
    pub(crate) waters: Vec<WaterDraw>,
    /// What the sea throws back of each of `waters`, where the method asks for it.
    pub(crate) lobe_blocks: Vec<LobeBlock>,
    /// Waves of the corrected Physics shader about the nearest boat.
    pub(crate) physics: Option<[[f32; 4]; PHYSICS_WAVES]>,
    /// For the method `Waves`: the strips of water that throw back light, and how bright the sea is there.
    pub(crate) reflects: Vec<ReflectDraw>,
    pub(crate) wake_blocks: Vec<WakeBlock>,
    pub(crate) wakes: Vec<WakeDraw>,
    pub(crate) lamplight: LamplightPlan,
    pub(crate) lights: Vec<HullPiece<LightBlock>>,
    /// Mirrored ones, each with the number of its boat in `mirrors`.
    pub(crate) mirror_lights: Vec<(usize, LightBlock)>,
    pub(crate) rounds: Vec<HullPiece<DrawBlock>>,
    /// Pixels that hulls can cover, each once.
    pub(crate) hulls: Vec<PixelRect>,
    /// Pixels where the boats' depth is known, each once: those of `hulls`, or, where much is drawn before and behind them, one rectangle about all.
    known: Vec<PixelRect>,
    /// Rectangles of `hulls`, for clearing.
    pub(crate) clears: Vec<vk::ClearRect>,
    /// Pixels beside hulls whose depth alone is asked for.
    pub(crate) depth_clears: Vec<vk::ClearRect>,
    /// The frame's list: rectangles of `hulls`, then for each of `waters` its strips and its rectangles.
    pub(crate) list: Vec<[f32; 4]>,
    /// What is blended into, as it comes: rectangles may overlap.
    touched: Vec<PixelRect>,
    /// The same, each pixel once.
    pub(crate) rects: Vec<PixelRect>,
    /// What of the video the water's shader compares.
    pub(crate) backdrop_regions: Vec<vk::ImageCopy>,
    /// Phantoms' recoil and light, where they hide something of it or lamps light them.
    pub(crate) phantoms: Option<PhantomLook>,
    /// Plates, shapes and glyphs of the head-up display that are drawn over the frame.
    pub(crate) quads: [u32; KINDS],
    /// Texels of the video pass that take the display from its layer instead, all others, and what is drawn anew in the layer.
    pub(crate) overlaid: Vec<PixelRect>,
    pub(crate) bare: Vec<PixelRect>,
    pub(crate) renewed: [u32; KINDS],
    cells: Cells,
    wanted: Vec<(PixelRect, f64)>,
    lines: Vec<(usize, HullLine)>,
    /// Boats of the scene beside whose hull foam stands.
    sprayed: Vec<(usize, PixelRect)>,
    rest: Vec<PixelRect>,
    outside: Vec<PixelRect>,
    waves: Option<Waves>,
    physics_sea: PhysicsSea,
}

impl Plan {
    pub(crate) fn with_capacity(capacity: Capacity, size: (u32, u32)) -> Self {
        let Capacity { boats, lights, lamps, rounds, lobes, wakes } = capacity;
        let touched =
            2 * HULL_RECTS_MAX + RECTS_MAX + lobes * WATER_RECTS_MAX + lights + rounds + wakes * TRACK_POINTS;
        // With the display's plates.
        let rects = BLENDS_MAX + 16;
        Self {
            boat_blocks: Vec::with_capacity(boats * 2),
            shadows: ShadowPlan::with_capacity(boats),
            noisy: false,
            water_blocks: Vec::with_capacity(boats),
            method_blocks: Vec::with_capacity(boats * MethodBytes::default().len()),
            round_blocks: Vec::with_capacity(rounds),
            boats: Vec::with_capacity(boats),
            mirrors: Vec::with_capacity(boats),
            places: Vec::with_capacity(boats),
            mirror_places: Vec::with_capacity(boats),
            waters: Vec::with_capacity(boats),
            lobe_blocks: Vec::with_capacity(lobes),
            physics: None,
            physics_sea: PhysicsSea::default(),
            reflects: Vec::with_capacity(lobes),
            waves: (lobes > 0).then(Waves::new),
            wake_blocks: Vec::with_capacity(wakes),
            wakes: Vec::with_capacity(wakes),
            lamplight: if lamps { LamplightPlan::new(size) } else { LamplightPlan::default() },
            lights: Vec::with_capacity(lights * 4),
            mirror_lights: Vec::with_capacity(lights),
            rounds: Vec::with_capacity(rounds * 4),
            hulls: Vec::with_capacity(HULL_RECTS_MAX),
            known: Vec::with_capacity(HULL_RECTS_MAX),
            clears: Vec::with_capacity(HULL_RECTS_MAX),
            depth_clears: Vec::with_capacity(HULL_RECTS_MAX),
            // The boat that is one too many is found once its strips are written.
            list: Vec::with_capacity(RECTS_MAX + STRIP_VECTORS_MAX),
            cells: Cells::new(size),
            touched: Vec::with_capacity(touched),
            rects: Vec::with_capacity(rects),
            backdrop_regions: Vec::with_capacity(boats),
            wanted: Vec::with_capacity(boats),
            lines: Vec::with_capacity(boats),
            sprayed: Vec::with_capacity(wakes),
            rest: Vec::with_capacity(WATER_RECTS_MAX.max(HULL_RECTS_MAX)),
            outside: Vec::with_capacity(HULL_RECTS_MAX),
            phantoms: None,
            quads: [0; KINDS],
            overlaid: Vec::with_capacity(16),
            bare: Vec::with_capacity(64),
            renewed: [0; KINDS],
        }
    }

    /// Decides anew for `scene` on a screen of `size` with a mirror layer of `atlas` texels.
    /// `lit` are pixels of real things that lamps light.
    pub(crate) fn make(
        &mut self,
        scene: &Scene,
        models: &[Outline],
        (size, atlas): ((u32, u32), (u32, u32)),
        lit: &[PixelRect],
    ) {
        self.clear();
        self.touched.extend_from_slice(lit);
        self.noisy = scene.runs(Pass::Noise);
        if scene.runs(Pass::Shadow) {
            self.shadows.make(scene, |id| models.get(usize::from(id.0)).map(|outline| &outline.model));
        }
        if scene.runs(Pass::Lamplight) {
            self.lamplight.make(scene, &mut self.touched);
        }
        if scene.runs(Pass::Boats) {
            self.plan_boats(scene, models, size);
        }
        if scene.runs(Pass::Water) {
            self.plan_water(scene, models, size, atlas);
        }
        if scene.runs(Pass::Wake) {
            self.plan_wakes(scene);
        }
        if scene.runs(Pass::Lights) {
            self.plan_lights(scene);
        }
        if scene.runs(Pass::Rounds) {
            self.plan_rounds(scene);
        }
        for r in &self.touched {
            self.cells.mark(*r);
        }
        self.cells.take(&mut self.rects, BLENDS_MAX);
    }

    fn clear(&mut self) {
        self.boat_blocks.clear();
        self.shadows.clear();
        self.water_blocks.clear();
        self.method_blocks.clear();
        self.round_blocks.clear();
        self.boats.clear();
        self.mirrors.clear();
        self.places.clear();
        self.mirror_places.clear();
        self.waters.clear();
        self.lobe_blocks.clear();
        self.reflects.clear();
        self.physics = None;
        self.wake_blocks.clear();
        self.wakes.clear();
        self.lamplight.clear();
        self.lights.clear();
        self.mirror_lights.clear();
        self.rounds.clear();
        self.hulls.clear();
        self.known.clear();
        self.clears.clear();
        self.depth_clears.clear();
        self.list.clear();
        self.touched.clear();
        self.rects.clear();
        self.wanted.clear();
        self.lines.clear();
        self.sprayed.clear();
    }

    fn plan_boats(&mut self, scene: &Scene, models: &[Outline], size: (u32, u32)) {
        for (i, boat) in scene.boats.iter().enumerate() {
            let Some(Outline { model, boxes, .. }) = models.get(usize::from(boat.model.0)) else { continue };
            let Some(hull) = boat.hull.and_then(|r| cut(r, size)) else { continue };
            // What stands beside the hull asks for its depth.
            let spray = spray_rect(scene, boat).filter(|_| scene.runs(Pass::Wake));
            let rect = spray.map_or(hull, |s| joined(hull, s));
            if self.boats.len() * 2 >= BOAT_BLOCKS_MAX {
                break;
            }
            let pose = view::drawn_pose(&scene.camera, boat, model.kind);
            let detail_m = view::detail_m(scene, boat);
            self.boats.push(BoatDraw {
                model: boat.model,
                index: self.boat_blocks.len() as u32,
                rect,
                detail_m,
            });
            let air = self.lamplight.air_at(hull).extend(0.0).to_array();
            let block = view::boat_block(scene, boat, &pose, self.shadows.shade(i), false);
            self.boat_blocks.push(BoatBlock { air, ..block });
            if let Some(spray) = spray {
                self.sprayed.push((i, spray));
            }
            boxes.mark(&mut self.cells, hull, DVec2::splat(HULL_MARGIN_PX), |p| {
                let world = pose.to_world(p);
                scene.lens.project(scene.camera.to_camera(world.with_z(world.z.max(boat.water_level))))
            });
        }
        self.cells.take(&mut self.hulls, HULL_RECTS_MAX);
        // Cells reach beyond the boats' rectangles; nothing is drawn there.
        let around = self.boats.iter().map(|b| b.rect).reduce(joined);
        self.hulls.retain_mut(|h| match around.and_then(|a| overlap(*h, a)) {
            Some(inside) => {
                *h = inside;
                true
            }
            None => false,
        });
        self.list.extend(self.hulls.iter().map(|h| corners(*h)));
        self.touched.extend_from_slice(&self.hulls);
        let clear = |h: &PixelRect| vk::ClearRect { rect: rect(*h), base_array_layer: 0, layer_count: 1 };
        self.clears.extend(self.hulls.iter().map(clear));
        // Beside a hull its depth is compared, but nothing of it is there to be put onto the screen.
        for (_, spray) in &self.sprayed {
            self.cells.mark(*spray);
        }
        self.rest.clear();
        self.cells.take(&mut self.rest, HULL_RECTS_MAX);
        let inside = |r: &PixelRect| around.and_then(|a| overlap(*r, a));
        for r in self.rest.iter().filter_map(inside) {
            // Each pixel once: what a hull can cover was cleared with it.
            around_all(r, &self.hulls, &mut self.outside);
            self.depth_clears.extend(self.outside.iter().map(clear));
        }
        self.touched.extend_from_slice(&self.rest);
        self.known.extend_from_slice(&self.hulls);
        // Puffs of smoke that are cut apart by each hull's cells cost more than a depth that is cleared farther out.
        if let Some(around) = around.filter(|_| scene.rounds.len() > ROUNDS_FEW) {
            self.known.clear();
            self.known.push(around);
            self.depth_clears.push(clear(&around));
        }
    }

    /// Boats whose waterline cannot be placed on the screen have no reflection.
    fn plan_water(&mut self, scene: &Scene, models: &[Outline], size: (u32, u32), atlas: (u32, u32)) {
        // Farthest first: where there are too many, the nearest count.
        let skipped = scene.boats.len().saturating_sub(WATERS_MAX);
        for (i, boat) in scene.boats.iter().enumerate().skip(skipped) {
            let Some(Outline { model, .. }) = models.get(usize::from(boat.model.0)) else { continue };
            // Beyond the horizon the sea that would mirror the boat is itself out of sight.
            let seen = boat.reflection.filter(|_| !boat.beyond_horizon);
            let Some(rect) = seen.and_then(|r| cut(r, size)) else { continue };
            let pose = view::drawn_pose(&scene.camera, boat, model.kind);
            let Some(line) = hull_line(scene, boat, &pose, model) else { continue };
            self.wanted.push((rect, mirror_scale(scene, &line)));
            self.lines.push((i, line));
        }
        atlas::place(atlas, &self.wanted, &mut self.places);
        let mirrored = scene.water.method != ReflectionMethod::Off;
        let waves = scene.water.method == ReflectionMethod::Baked;
        let sea = if waves { sea_block(scene) } else { ReflectBlock::default() };
        for n in 0..self.places.len() {
            let (placed, (i, line), (rect, _)) = (self.places[n], self.lines[n], self.wanted[n]);
            let boat = &scene.boats[i];
            let Some(Outline { model, solid, .. }) = models.get(usize::from(boat.model.0)) else { continue };
            let pose = view::drawn_pose(&scene.camera, boat, model.kind);
            let (block, method) = water_block(scene, boat, &line, &placed);
            let softened_px = match scene.water.method {
                ReflectionMethod::Full => 1.5 * f64::from(atlas::SOFT) / placed.scale,
                _ => 0.0,
            };
            let mut thrown = None;
            if waves {
                thrown = self.plan_thrown(scene, (boat, model), &line, &sea, size);
            } else if mirrored {
                solid.mark(&mut self.cells, rect, method.reach_px + softened_px + 2.0, |p| {
                    let world = pose.to_world(p);
                    let above = (world.z - boat.water_level).max(0.0);
                    scene.lens.project(scene.camera.to_camera(world.with_z(boat.water_level - above)))
                });
            }
            line.mark_shadow(&mut self.cells, rect, &block);
            if !waves {
                line.unmark_dry(&mut self.cells, &block, method.fade_px);
            }
            self.rest.clear();
            let marked = self.cells.take(&mut self.rest, WATER_RECTS_MAX);
            let Some(around) = marked.into_iter().chain(thrown.map(|t| t.1)).reduce(joined) else { continue };
            if self.list.len() + self.rest.len() > RECTS_MAX {
                continue;
            }
            self.reflects.extend(thrown.map(|t| t.0));
            self.waters.push(WaterDraw {
                index: self.water_blocks.len() as u32,
                rect: around,
                first: self.list.len() as u32,
                count: self.rest.len() as u32,
            });
            self.list.extend(self.rest.iter().map(|r| corners(*r)));
            self.touched.extend_from_slice(&self.rest);
            self.water_blocks.push(block);
            self.method_blocks.extend_from_slice(method.own());
            if mirrored {
                let index = self.boat_blocks.len() as u32;
                // Softened, or its light gathered to columns and bands, a mirrored boat shows less than the boat itself.
                let coarser = if waves {
                    MIRRORED_DETAIL / (view::DETAIL_PX * placed.scale)
                } else {
                    0.2 * softened_px
                };
                let detail_m = view::detail_m(scene, boat) * coarser.max(1.0);
                self.mirrors.push(BoatDraw { model: boat.model, index, rect: placed.place, detail_m });
                self.boat_blocks.push(view::boat_block(scene, boat, &pose, &Shade::NONE, true));
                if scene.runs(Pass::Lights) {
                    let number = self.mirror_places.len();
                    let top_m = boat.pose.position.z + f64::from(model.max.z) - boat.water_level;
                    let mirror = Mirror { water_level: boat.water_level, top_m, placed: &placed };
                    let own = scene.lights.iter().filter(|light| light.boat == Some(boat.boat));
                    let blocks = own.filter_map(|light| mirrored_block(scene, light, &mirror));
                    self.mirror_lights.extend(blocks.map(|block| (number, block)));
                }
                self.mirror_places.push(placed);
            }
        }
        if scene.water.method == ReflectionMethod::Physics {
            self.physics = scene.boats.last().map(|boat| physics_waves(&mut self.physics_sea, scene, boat));
        }
    }

    /// What the sea throws back of a boat, and the pixels about it; `None` where that is nothing.
    fn plan_thrown(
        &mut self,
        scene: &Scene,
        (boat, model): (&BoatView, &Model),
        line: &HullLine,
        sea: &ReflectBlock,
        size: (u32, u32),
    ) -> Option<(ReflectDraw, PixelRect)> {
        let (index, first) = (self.water_blocks.len(), self.list.len());
        // One that came to nothing after all leaves its block.
        self.lobe_blocks.truncate(index);
        self.lobe_blocks.push(LobeBlock::default());
        let (waves, out) = (self.waves.as_mut()?, self.lobe_blocks.last_mut()?);
        let reach = waves.block(scene, boat, line, model, out)?;
        let block = reflect_block(sea, out, &reach, (index as u32, first as u32));
        let strips = waves.strips(&reach, line, &mut self.list);
        if self.list.len() <= RECTS_MAX {
            let screen = PixelRect { x: 0, y: 0, width: size.0, height: size.1 };
            mark_strips(&self.list[first..], line, &mut self.cells, screen);
        }
        self.rest.clear();
        let Some(around) = self.cells.take(&mut self.rest, WATER_RECTS_MAX) else {
            self.list.truncate(first);
            return None;
        };
        self.touched.extend_from_slice(&self.rest);
        Some((ReflectDraw { block, strips }, around))
    }

    fn plan_wakes(&mut self, scene: &Scene) {
        for (i, boat) in scene.boats.iter().enumerate().filter(|(_, b)| !b.beyond_horizon) {
            let Some(wake) = &boat.wake else { continue };
            let thrown = self.shadows.thrown(i);
            let WakePlan { block, strips, covered } = wake_plan(scene, (boat, wake), thrown.as_ref());
            let before = self.touched.len();
            self.touched.extend(strip_rects(scene, wake).take(covered).flatten());
            let spray = self.sprayed.iter().any(|(n, _)| *n == i);
            let strips = if self.touched.len() > before { strips } else { 0 };
            if strips > 0 || spray {
                self.wakes.push(WakeDraw { index: self.wake_blocks.len() as u32, strips, spray });
                self.wake_blocks.push(block);
            }
        }
    }

    fn plan_lights(&mut self, scene: &Scene) {
        for light in &scene.lights {
            let Some((block, rect)) = light_block(scene, light) else { continue };
            self.touched.push(rect);
            let lights = &mut self.lights;
            pieces(rect, &self.known, &mut self.rest, |rect, hidden| {
                lights.push(HullPiece { rect, hidden, block: LightBlock { rect: corners(rect), ..block } });
            });
        }
    }

    fn plan_rounds(&mut self, scene: &Scene) {
        for (i, round) in scene.rounds.iter().enumerate() {
            // The golden ratio's multiples spread evenly: neighbours never look alike.
            let seed = (i as f32 * 0.618_034).fract() * 64.0;
            let Some((block, rect)) = round_block(scene, round, seed) else { continue };
            let index = self.round_blocks.len() as u32;
            self.round_blocks.push(block);
            self.touched.push(rect);
            let rounds = &mut self.rounds;
            pieces(rect, &self.known, &mut self.rest, |rect, hidden| {
                rounds.push(HullPiece {
                    rect,
                    hidden,
                    block: DrawBlock { rect: corners(rect), index, first: 0 },
                });
            });
        }
    }
}
