//! Resistance of a hull in calm water by its speed, and how it runs there: wetted length, keel depth, trim.
//!
//! A planing hull runs as Savitsky 1964 (Marine Technology 1, 71, eq. 15 to 37) has it, with all forces through the centre of mass. Below
//! planing, and for hulls that never plane, friction is ITTC 1957 with a form factor, and waves add what grows with the Froude number.

use crate::{
    physics::GRAVITY_M_S2,
    world::boats::{
        floating::ramp,
        hull::{HullForm, STRIPS, WATER_KG_M3},
    },
};

/// Kinematic viscosity of sea water at 15 degrees, m^2/s.
const VISCOSITY_M2_S: f64 = 1.19e-6;
/// Roughness allowance of Savitsky's table 1.
const ROUGHNESS: f64 = 4e-4;
/// Form factor of friction below planing, of 1.
const FORM: f64 = 0.2;
/// Volumetric Froude numbers between which a hull climbs onto the plane: the transom runs clear at 1, the bottom carries most at 2.2.
const PLANING: (f64, f64) = (1.0, 2.2);
/// Steepest trim that the planing formulas hold for, degrees.
const TRIM_MAX_DEG: f64 = 15.0;
/// Longest wetted length that they hold for, in beams.
const WETTED_MAX: f64 = 4.0;
/// Speeds in the table.
const SPEEDS: usize = 64;

/// How a hull runs at one speed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Running {
    /// Resistance, newtons.
    pub resistance_n: f64,
    /// Share of the weight that the bottom's lift carries in place of buoyancy, 0 to 1.
    pub planing: f64,
    /// Trim that comes with speed, radians, bow up.
    pub trim: f64,
    /// Wetted length of the keel from the transom, metres.
    pub keel_m: f64,
    /// Depth of the keel at its after end, metres.
    pub depth_m: f64,
}

impl Running {
    fn between(&self, next: &Self, share: f64) -> Self {
        let mix = |a: f64, b: f64| a + (b - a) * share;
        Self {
            resistance_n: mix(self.resistance_n, next.resistance_n),
            planing: mix(self.planing, next.planing),
            trim: mix(self.trim, next.trim),
            keel_m: mix(self.keel_m, next.keel_m),
            depth_m: mix(self.depth_m, next.depth_m),
        }
    }
}

/// A prismatic planing surface: Savitsky's idea of a hull.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaningSurface {
    /// Weight, newtons.
    pub weight_n: f64,
    /// Beam between the chines, metres.
    pub beam_m: f64,
    /// Rise of the bottom, radians.
    pub deadrise: f64,
    /// Centre of mass from the transom, metres.
    pub centre_m: f64,
}

impl PlaningSurface {
    /// How it runs at `speed_m_s`, wholly on its lift. Outside the formulas' range (wetted length of four beams, trim of 15 degrees) it is
    /// held to its edge.
    pub fn running(&self, speed_m_s: f64) -> Running {
        let Self { weight_n, beam_m, deadrise, centre_m } = *self;
        let speed = speed_m_s.max(0.1);
        let coefficient2 = speed * speed / (GRAVITY_M_S2 * beam_m);
        let wetted = wetted_length(centre_m / beam_m, coefficient2);
        let pressure = 0.5 * WATER_KG_M3 * speed * speed;
        let lift = flat_plate_lift(weight_n / (pressure * beam_m * beam_m), deadrise.to_degrees());
        let per_trim = 0.0120 * wetted.sqrt() + 0.0055 * wetted.powf(2.5) / coefficient2;
        let trim_deg = (lift / per_trim).powf(1.0 / 1.1).min(TRIM_MAX_DEG);
        let trim = trim_deg.to_radians();
        // The water under the bottom is slower than the boat, for it carries it.
        let slowed = 1.0 - 0.0120 * trim_deg.powf(1.1) / (wetted.sqrt() * trim.cos());
        let mean_speed = speed * slowed.max(0.25).sqrt();
        let skin = friction(mean_speed * wetted * beam_m / VISCOSITY_M2_S) + ROUGHNESS;
        let area_m2 = wetted * beam_m * beam_m / deadrise.cos();
        let drag = 0.5 * WATER_KG_M3 * mean_speed * mean_speed * area_m2 * skin;
        // Keel and chine are wetted unequally, by the spray's root line.
        let keel_m = beam_m * (wetted + deadrise.tan() / (std::f64::consts::TAU * trim.tan().max(1e-3)));
        Running {
            resistance_n: weight_n * trim.tan() + drag / trim.cos(),
            planing: 1.0,
            trim,
            keel_m,
            depth_m: keel_m * trim.sin(),
        }
    }
}

/// Mean wetted length in beams at which the centre of pressure lies `centre` beams from the transom.
fn wetted_length(centre: f64, coefficient2: f64) -> f64 {
    let pressure_at = |wetted: f64| wetted * (0.75 - 1.0 / (5.21 * coefficient2 / (wetted * wetted) + 2.39));
    let (mut low, mut high) = (0.05, WETTED_MAX);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if pressure_at(middle) < centre { low = middle } else { high = middle }
    }
    high
}

/// Lift coefficient of a flat plate that carries as much as one with that deadrise: the root of C = C0 - 0.0065 deadrise C0^0.6.
fn flat_plate_lift(lift: f64, deadrise_deg: f64) -> f64 {
    let mut flat = lift;
    for _ in 0..60 {
        flat = lift + 0.0065 * deadrise_deg * flat.powf(0.6);
    }
    flat
}

/// Friction coefficient of ITTC 1957 by Reynolds number.
fn friction(reynolds: f64) -> f64 {
    let log = reynolds.max(1e5).log10() - 2.0;
    0.075 / (log * log)
}

/// The running of one hull over its speeds.
#[derive(Clone, Debug, PartialEq)]
pub struct HullRunning {
    table: Vec<Running>,
    step_m_s: f64,
}

impl HullRunning {
    /// Of a hull up to one and a half times `speed_max_m_s`. Whether it planes follows from its size and that speed.
    pub fn of(form: &HullForm, speed_max_m_s: f64) -> Self {
        let step_m_s = 1.5 * speed_max_m_s.max(1.0) / (SPEEDS - 1) as f64;
        let planes = volume_froude(form, speed_max_m_s) > PLANING.1 * 0.8;
        let table = (0..SPEEDS).map(|i| running(form, planes, i as f64 * step_m_s)).collect();
        Self { table, step_m_s }
    }

    /// How it runs at a speed through the water, in either direction.
    pub fn at(&self, speed_m_s: f64) -> Running {
        let place = (speed_m_s.abs() / self.step_m_s).min((SPEEDS - 1) as f64);
        let index = (place as usize).min(SPEEDS - 2);
        match (self.table.get(index), self.table.get(index + 1)) {
            (Some(from), Some(to)) => from.between(to, place - index as f64),
            _ => Running::default(),
        }
    }
}

/// Speed by the root of g times the cube root of the volume.
fn volume_froude(form: &HullForm, speed_m_s: f64) -> f64 {
    speed_m_s / (GRAVITY_M_S2 * (form.mass_kg / WATER_KG_M3).cbrt()).sqrt()
}

fn running(form: &HullForm, planes: bool, speed_m_s: f64) -> Running {
    let afloat = displacing(form, planes, speed_m_s);
    let planing = ramp(volume_froude(form, speed_m_s), PLANING);
    if !planes || planing <= 0.0 {
        return afloat;
    }
    Running { planing, ..afloat.between(&surface(form).running(speed_m_s), planing) }
}

/// The planing surface of a hull: its after half.
fn surface(form: &HullForm) -> PlaningSurface {
    let after = &form.strips[..STRIPS / 2];
    let chine_m = after.iter().map(|s| s.chine_m).fold(0.0, f64::max);
    let deadrise = after.iter().map(|s| s.deadrise).sum::<f64>() / after.len() as f64;
    PlaningSurface {
        weight_n: form.weight_n(),
        beam_m: 2.0 * chine_m,
        deadrise: deadrise.atan().min(0.5),
        centre_m: form.centre_from_stern_m(),
    }
}

/// Friction and waves of a hull that floats.
fn displacing(form: &HullForm, planes: bool, speed_m_s: f64) -> Running {
    /// Wave resistance by weight at a Froude number of 0.5 and a slenderness (length by the cube root of the volume) of 5, about what
    /// the systematic series of fast round and hard-chine hulls show (Series 62 and 64, NPL); it falls with slenderness squared.
    const WAVES: f64 = 0.08;
    /// Drag coefficient of a square stern in dead water.
    const STERN: f64 = 0.2;
    let length_m = form.strip_m * STRIPS as f64;
    let volume_m3 = form.mass_kg / WATER_KG_M3;
    // A square stern drags dead water until the stream leaves it clean (Hoerner 1965, Fluid-Dynamic Drag, 3-12).
    let stern_m2 = if planes { form.half_beam_m * form.draught_m } else { 0.0 };
    let base = 0.5 * WATER_KG_M3 * STERN * stern_m2 * speed_m_s * speed_m_s;
    let wetted_m2 = 2.6 * (volume_m3 * length_m).sqrt();
    let skin = friction(speed_m_s * length_m / VISCOSITY_M2_S) * (1.0 + FORM) + ROUGHNESS;
    let rubbed = 0.5 * WATER_KG_M3 * wetted_m2 * skin * speed_m_s * speed_m_s;
    let hump = (speed_m_s / (GRAVITY_M_S2 * length_m).sqrt()) / 0.5;
    let slender = (length_m / volume_m3.cbrt() / 5.0).max(0.5);
    // Up to the hump waves grow steeply; what planes leaves them behind, what does not climbs on.
    let shape = if planes { 2.0 * hump.powi(4) / (1.0 + hump.powi(4)) } else { hump.powi(4) };
    let waves = WAVES / (slender * slender) * shape * form.weight_n();
    let trim = if planes { 0.07 * hump.powi(4) / (1.0 + hump.powi(4)) } else { 0.0 };
    Running {
        resistance_n: rubbed + waves + base,
        planing: 0.0,
        trim,
        keel_m: length_m,
        depth_m: form.draught_m,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_planing_surface_runs_as_an_independent_program_has_it() {
        let mut rows = 0;
        for line in include_str!("../../../../data/savitsky_planing.csv")
            .lines()
            .filter(|l| !l.starts_with('#'))
            .skip(1)
        {
            let cells: Vec<f64> = line.split(',').map(|c| c.parse().expect("a number")).collect();
            let [weight_n, beam_m, centre_m, deadrise_deg, speed_m_s, trim_deg, resistance_n] = cells[..]
            else {
                panic!("{line}")
            };
            let surface = PlaningSurface { weight_n, beam_m, centre_m, deadrise: deadrise_deg.to_radians() };
            let runs = surface.running(speed_m_s);
            assert!((runs.trim.to_degrees() - trim_deg).abs() < 0.2, "{line}: {}", runs.trim.to_degrees());
            assert!((runs.resistance_n / resistance_n - 1.0).abs() < 0.1, "{line}: {}", runs.resistance_n);
            rows += 1;
        }
        assert!(rows > 20, "{rows} rows");
    }

    #[test]
    fn resistance_grows_with_speed_in_steps_that_no_boat_feels() {
        let planing = HullForm::new((-3.5, 3.5), 0.3, 1.2, |x: f64| 0.9 * (1.0 - (x / 3.5).max(0.0).powi(3)));
        let ship = HullForm::new((-60.0, 60.0), 4.5, 1.1, |x: f64| 7.0 * (1.0 - (x / 60.0).powi(4)));
        for (form, top) in [(planing, 14.0), (ship, 14.0)] {
            let running = HullRunning::of(&form, top);
            let mut last = running.at(0.0).resistance_n;
            assert_eq!(last, 0.0);
            for i in 1..1400 {
                let now = running.at(0.01 * f64::from(i)).resistance_n;
                assert!((now - last).abs() < 0.003 * form.weight_n(), "{last} N, then {now} N");
                last = now;
            }
        }
    }
}
