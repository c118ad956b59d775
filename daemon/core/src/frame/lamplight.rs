//! Lamplight: the light that searchlight, flares and fires add to the real air and sea, at the nodes of a grid over the screen.

mod air;
mod glitter;

use air::AirGlow;
use glam::{DVec2, DVec3, Vec3};
use glitter::Glitter;

use super::{
    lamps::LampView,
    searchlight::{SEA_ALBEDO, SearchlightView},
};
use crate::{
    geometry::{CameraPose, Lens},
    sea::mean_square_slope,
};

/// Most nodes of a grid.
pub const NODES_MAX: usize = 8192;
/// Beyond this the air in a beam adds nothing that is seen, metres.
const FAR_M: f64 = 2e4;

/// Linear light at a node, white in the picture being 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NodeLight {
    /// Of the air before what the camera sees.
    pub air: Vec3,
    /// Of the sea.
    pub sea: Vec3,
}

/// Lamps of a frame, and what they light.
#[derive(Clone, Copy, Debug)]
pub struct Lamplight<'a> {
    /// The gun's searchlight, while it is on.
    pub searchlight: Option<&'a SearchlightView>,
    /// All other lamps.
    pub lamps: &'a [LampView],
    /// Speed of the wind, m/s: the waves' slopes follow from it.
    pub wind_m_s: f64,
}

/// The light at nodes `cell_px` pixels apart. The air's part of a searchlight does not change from frame to frame while lamp, lens
/// and air stay the same, and is kept.
#[derive(Clone, Debug, Default)]
pub struct LightGrid {
    columns: usize,
    cell_px: f64,
    lens: Option<Lens>,
    /// The searchlight whose air is kept, of strength 1, and that air's light.
    beam: Option<SearchlightView>,
    haze: Vec<f32>,
    rays: Vec<DVec3>,
    glow: AirGlow,
    /// One row after the other.
    nodes: Vec<NodeLight>,
}

impl LightGrid {
    /// A grid over a screen of that size.
    pub fn new((width, height): (u32, u32)) -> Self {
        /// A beam of half a degree is some ten pixels wide.
        const LEAST_PX: f64 = 16.0;
        let (width, height) = (f64::from(width), f64::from(height));
        let cells = |px: f64, length: f64| (length / px).ceil() as usize + 1;
        let mut cell_px = LEAST_PX;
        while cells(cell_px, width) * cells(cell_px, height) > NODES_MAX {
            cell_px += 1.0;
        }
        let (columns, rows) = (cells(cell_px, width), cells(cell_px, height));
        let count = columns * rows;
        Self {
            columns,
            cell_px,
            haze: vec![0.0; count],
            rays: Vec::with_capacity(count),
            nodes: vec![NodeLight::default(); count],
            ..Self::default()
        }
    }

    /// Finds the light for that camera and lens.
    pub fn light(&mut self, light: &Lamplight<'_>, camera: &CameraPose, lens: &Lens) {
        // Of a rolling shutter's turn light this soft shows nothing.
        let lens = Lens { row_turn: DVec3::ZERO, ..*lens };
        if self.lens != Some(lens) {
            (self.lens, self.beam) = (Some(lens), None);
            let pixel =
                |i: usize| DVec2::new((i % self.columns) as f64, (i / self.columns) as f64) * self.cell_px;
            self.rays.clear();
            self.rays.extend((0..self.nodes.len()).map(|i| lens.unproject(pixel(i)).normalize()));
        }
        self.nodes.fill(NodeLight::default());
        let down = camera.world_from_camera.inverse() * DVec3::NEG_Z;
        if let Some(view) = light.searchlight {
            self.add_beam(view, down, camera.position.z);
        }
        for lamp in light.lamps {
            self.add_lamp(lamp, camera, down, light.wind_m_s);
        }
    }

    fn add_beam(&mut self, view: &SearchlightView, down: DVec3, eye_height_m: f64) {
        let key = SearchlightView { strength: 1.0, ..*view };
        if self.beam != Some(key) {
            self.beam = Some(key);
            for (haze, ray) in self.haze.iter_mut().zip(&self.rays) {
                *haze = view.haze(*ray, FAR_M) as f32;
            }
        }
        let strength = view.strength as f32;
        for ((node, haze), ray) in self.nodes.iter_mut().zip(&self.haze).zip(&self.rays) {
            node.air += Vec3::splat(strength * haze);
            node.sea += SEA_ALBEDO * (strength * view.sea(*ray, down, eye_height_m) as f32);
        }
    }

    fn add_lamp(&mut self, lamp: &LampView, camera: &CameraPose, down: DVec3, wind_m_s: f64) {
        let at = camera.to_camera(lamp.at);
        let range_m = at.length();
        if range_m.is_nan() || range_m <= 1.0 || !lamp.strength.is_finite() {
            return;
        }
        // Within half a cell of the lamp its glow is what a lens makes of it.
        let focal = self.lens.map_or(1.0, |lens| lens.focal.max_element());
        self.glow.prepare(range_m, lamp.extinction_per_m, 0.5 * self.cell_px / focal);
        let towards = at / range_m;
        let glitter = Glitter {
            lamp: at,
            up: -down,
            eye_height_m: camera.position.z,
            extinction_per_m: lamp.extinction_per_m,
            slope_variance: 0.5 * mean_square_slope(wind_m_s),
        };
        for (node, ray) in self.nodes.iter_mut().zip(&self.rays) {
            let slope = ray.dot(down);
            let end_m = if slope > 0.0 { camera.position.z / slope } else { f64::INFINITY };
            node.air += lamp.strength * self.glow.towards(ray.dot(towards), end_m) as f32;
            if lamp.is_high && slope > 0.0 {
                let (mirrored, matt) = glitter.sea(*ray, slope);
                node.sea += lamp.strength * (Vec3::splat(mirrored as f32) + SEA_ALBEDO * matt as f32);
            }
        }
    }

    /// Nodes of a row.
    pub const fn columns(&self) -> usize {
        self.columns
    }

    /// Pixels from one to the next.
    pub const fn cell_px(&self) -> f64 {
        self.cell_px
    }

    /// The light at the nodes, one row after the other.
    pub fn nodes(&self) -> &[NodeLight] {
        &self.nodes
    }
}

#[cfg(test)]
#[path = "lamplight/tests.rs"]
mod tests;
