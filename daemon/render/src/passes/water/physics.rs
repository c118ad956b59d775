//! Nelson 2009's Physics shader, eq. 9-16: as published, and corrected.

use std::f64::consts::TAU;

use bowwave_core::{
    frame::scene::{BoatView, Scene},
    sea::BeaufortForce,
    world::waves::{Spectrum, WaveField, WaveSpec},
};
use glam::DVec2;
use shaders_spirv::interface::{PHYSICS_WAVES, PhysicsBlock, PhysicsPublishedBlock};

use super::{
    block::{
        FORCE_MAX, MethodPlan, force, largest_shift_px, mirrored_share, published_shift_px, shift_reach,
    },
    line::HullLine,
};

/// As published: height and frequency of wave and swell (metres, radians a metre), by wind force. The thesis names but does not state
/// them: amplitudes of the force's probable wave height, lengths of its peak and of a fifth of it.
const PUBLISHED_WAVES: [[f64; 4]; FORCE_MAX + 1] = [
    [0.002, 12.0, 0.002, 3.0],
    [0.008, 8.0, 0.015, 1.6],
    [0.02, 4.0, 0.03, 0.8],
    [0.05, 1.6, 0.09, 0.27],
    [0.08, 0.9, 0.15, 0.16],
];

/// Tangent below the horizontal at the anchor, its change by pixel, height of the eye and of the ship, metres.
fn sight(scene: &Scene, boat: &BoatView, line: &HullLine) -> [f32; 4] {
    let eye = (scene.camera.position.z - boat.water_level).max(0.01);
    let range = (boat.pose.position - scene.camera.position).truncate().length().max(0.1);
    // The hull stands on the line: so many pixels are its height in metres.
    let focal = scene.lens.focal.y;
    [eye / range, 1.0 / focal, eye, line.height * range / focal].map(|v| v as f32)
}

/// As published. It does not fade: it ends where nothing is mirrored.
pub(crate) fn as_published(scene: &Scene, boat: &BoatView, line: &HullLine) -> MethodPlan {
    let (shift, limit) = published_shift_px(scene);
    let [height, frequency, swell, swell_frequency] = PUBLISHED_WAVES[force(scene)].map(|v| v as f32);
    let block = PhysicsPublishedBlock {
        height,
        frequency,
        swell,
        swell_frequency,
        shift: shift as f32,
        shift_limit: limit as f32,
        sight: sight(scene, boat, line),
        ..PhysicsPublishedBlock::default()
    };
    // Both coordinates shift by as much, and the kernel takes the neighbours.
    MethodPlan::new(&block, f64::INFINITY, DVec2::splat(limit + 1.0))
}

/// Corrected: the normal from the slope, waves of the spectrum, and phases that hold at any distance.
pub(crate) fn corrected(scene: &Scene, boat: &BoatView, line: &HullLine) -> MethodPlan {
    let (shift, limit) = largest_shift_px(scene, line);
    let block = PhysicsBlock {
        share: mirrored_share(scene, boat) as f32,
        shift: shift as f32,
        shift_limit: limit as f32,
        sight: sight(scene, boat, line),
        ..PhysicsBlock::default()
    };
    MethodPlan::new(&block, f64::INFINITY, shift_reach(line, limit))
}

/// The sea of the corrected Physics shader, made anew only when force or wind change: context it allocates.
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

/// Waves of the sea's spectrum for the corrected Physics shader: radians a metre away from the eye and to the right, amplitude, and phase at
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
    let mut out = [[0.0; 4]; PHYSICS_WAVES];
    // All waves carry the same energy: so few of them stand for all with the root of the ratio of their numbers.
    let every = (field.waves().len() / PHYSICS_WAVES).max(1);
    for (slot, wave) in out.iter_mut().zip(field.waves().iter().step_by(every)) {
        let k = wave.cycles_per_m * TAU;
        let amplitude = wave.amplitude_m * (every as f64).sqrt();
        *slot = [k.dot(away), k.dot(right), amplitude, wave.phase(at, scene.time_s)].map(|v| v as f32);
    }
    out
}
