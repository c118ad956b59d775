//! The part of a hull that meets the water, as strips.

use glam::DVec2;

use crate::{model::Model, physics::GRAVITY_M_S2};

/// Density of sea water, kg/m^3.
pub(super) const WATER_KG_M3: f64 = 1025.0;
/// Strips along a hull.
pub(super) const STRIPS: usize = 11;
/// Draughts that models may have, in half beams: what is drawn below the water need not be the whole hull.
const DRAUGHT_RANGE: (f64, f64) = (0.15, 1.2);
/// Half the beam at the chine by that at the water, least and most.
const CHINE_RANGE: (f64, f64) = (1.05, 1.4);
/// A pointed end is not sharper than this share of the beam.
const POINTED: f64 = 0.1;
/// Radius of gyration in roll with the water that goes along, by the beam at the chine (IMO 2008 IS Code, 2.3, about).
const ROLL_GYRATION: f64 = 0.4;
/// Radius of gyration in pitch by the length.
const PITCH_GYRATION: f64 = 0.25;
/// Height of the centre of mass above the water by the beam.
const MASS_ABOVE: f64 = 0.1;
/// Least share of the waterplane's stiffness in roll that the height of the centre of mass leaves.
const STIFFNESS_LEAST: f64 = 0.3;

/// The size of a hull at the waterline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hull {
    /// Metres along x.
    pub length_m: f64,
    /// Metres along y.
    pub beam_m: f64,
}

impl Hull {
    /// The extent of the model's waterline; of its bounding box where it has none.
    pub fn of(model: &Model) -> Self {
        let (low, high) = extent(model);
        Self { length_m: high.x - low.x, beam_m: high.y - low.y }
    }
}

/// Smallest and largest x and y of the waterline, of the bounding box where there is none.
fn extent(model: &Model) -> (DVec2, DVec2) {
    let low = model.waterline.iter().copied().fold(DVec2::INFINITY, DVec2::min);
    let high = model.waterline.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
    let size = high - low;
    if size.is_finite() && size.min_element() > 0.0 {
        return (low, high);
    }
    let corner = |c: glam::Vec3| c.as_dvec3().truncate();
    (corner(model.min), corner(model.max))
}

/// A slice of the hull: a V with vertical sides above its chines, cut in two halves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Strip {
    /// Middle, metres forward of the centre of buoyancy.
    pub x_m: f64,
    /// Half the beam at the chine, metres.
    pub chine_m: f64,
    /// Rise of the bottom per metre outwards.
    pub deadrise: f64,
    /// Where each half's water acts, metres from the middle: a root of three of the half beam at rest, which gives the waterplane
    /// of both halves its moment of inertia.
    pub lever_m: f64,
}

impl Strip {
    /// Water that one half displaces, m^2, with its keel `depth_m` (positive) under water.
    pub fn half_area_m2(&self, depth_m: f64) -> f64 {
        let chine_depth = self.chine_m * self.deadrise;
        let below = depth_m.min(chine_depth);
        below * below / (2.0 * self.deadrise) + self.chine_m * (depth_m - below)
    }

    /// Half the beam at the water, metres.
    pub fn half_beam_m(&self, depth_m: f64) -> f64 {
        (depth_m / self.deadrise).min(self.chine_m)
    }
}

/// A hull that waves move. Its weight is that of the water which it displaces at its waterline.
#[derive(Clone, Debug, PartialEq)]
pub struct HullForm {
    pub(super) strips: [Strip; STRIPS],
    /// Length of a strip, metres.
    pub(super) strip_m: f64,
    /// Depth of the keel at rest, metres.
    pub(super) draught_m: f64,
    /// Greatest half beam at rest, metres.
    pub(super) half_beam_m: f64,
    /// Centre of buoyancy forward of the boat's origin, metres.
    pub(super) centre_m: f64,
    pub(super) mass_kg: f64,
    /// About the long axis, with the water that goes along.
    pub(super) roll_inertia_kg_m2: f64,
    /// About the cross axis, without water.
    pub(super) pitch_inertia_kg_m2: f64,
    /// Share of the waterplane's stiffness in roll that the height of the centre of mass leaves.
    pub(super) roll_stiffness: f64,
}

impl HullForm {
    /// A hull between `x` (metres, aft and forward), of keel depth `draught_m`, whose half beam at the water is `half_beam` of x;
    /// at the chine it is `flare` times as wide. Everything is held to sizes at which it floats upright.
    pub fn new(x: (f64, f64), draught_m: f64, flare: f64, half_beam: impl Fn(f64) -> f64) -> Self {
        let length_m = (x.1 - x.0).max(0.1);
        let strip_m = length_m / STRIPS as f64;
        let places: [f64; STRIPS] = std::array::from_fn(|i| x.0 + (i as f64 + 0.5) * strip_m);
        let raw = places.map(|at| half_beam(at).max(0.0));
        let widest = raw.into_iter().fold(0.0, f64::max).max(0.01 * length_m);
        let beams = raw.map(|b| b.max(POINTED * widest));
        let draught_m = draught_m.clamp(DRAUGHT_RANGE.0 * widest, DRAUGHT_RANGE.1 * widest);
        let flare = flare.clamp(CHINE_RANGE.0, CHINE_RANGE.1);
        // Areas of a V go with its beam.
        let centre_m = places.iter().zip(beams).map(|(x, b)| x * b).sum::<f64>() / beams.iter().sum::<f64>();
        let strips = std::array::from_fn(|i| Strip {
            x_m: places[i] - centre_m,
            chine_m: flare * beams[i],
            deadrise: draught_m / beams[i],
            lever_m: beams[i] / 3f64.sqrt(),
        });
        let volume_m3 = beams.iter().map(|b| b * draught_m * strip_m).sum::<f64>();
        let mass_kg = WATER_KG_M3 * volume_m3;
        let beam_m = 2.0 * flare * widest;
        // Metacentric radius, and how far the centre of mass lies above that of buoyancy, two thirds of the draught up.
        let radius_m = beams.iter().map(|b| 2.0 / 3.0 * b.powi(3) * strip_m).sum::<f64>() / volume_m3;
        let above_m = draught_m / 3.0 + MASS_ABOVE * 2.0 * widest;
        Self {
            strips,
            strip_m,
            draught_m,
            half_beam_m: widest,
            centre_m,
            mass_kg,
            roll_inertia_kg_m2: mass_kg * (ROLL_GYRATION * beam_m).powi(2),
            pitch_inertia_kg_m2: mass_kg * (PITCH_GYRATION * length_m).powi(2),
            roll_stiffness: (1.0 - above_m / radius_m).max(STIFFNESS_LEAST),
        }
    }

    /// The hull of a model: its waterline's outline, as deep as it is drawn and as wide above the water.
    pub fn of(model: &Model) -> Self {
        let (low, high) = extent(model);
        let half_beam = |x: f64| half_width(&model.waterline, x).unwrap_or(0.5 * (high.y - low.y));
        let flare = model.beam_m() / (high.y - low.y).max(1e-3);
        Self::new((low.x, high.x), -f64::from(model.min.z), flare, half_beam)
    }

    /// Centre of buoyancy forward of the hull's after end, metres.
    pub(super) fn centre_from_stern_m(&self) -> f64 {
        self.strip_m / 2.0 - self.strips[0].x_m
    }

    /// Weight, newtons.
    pub(super) fn weight_n(&self) -> f64 {
        self.mass_kg * GRAVITY_M_S2
    }
}

/// Half the width of a closed outline at `x`; `None` where it does not reach there.
fn half_width(outline: &[DVec2], x: f64) -> Option<f64> {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for (i, &a) in outline.iter().enumerate() {
        let b = outline[(i + 1) % outline.len()];
        if (a.x <= x) != (b.x <= x) {
            let y = a.y + (b.y - a.y) * (x - a.x) / (b.x - a.x);
            (low, high) = (low.min(y), high.max(y));
        }
    }
    (high > low).then_some(0.5 * (high - low))
}
