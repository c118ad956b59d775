//! Water in a hull that was struck: how it settles, lists, loses its engine and sinks.

use glam::{DVec2, DVec3};

use super::{
    floating::WayAttitude,
    hull::{HullForm, STRIPS, WATER_KG_M3},
};
use crate::physics::GRAVITY_M_S2;

/// Holes that are told apart; of more the oldest two count as one.
const HOLES_MAX: usize = 24;
/// Water by the boat's mass at which its engine drowns.
const DROWNS_ENGINE: f64 = 0.4;
/// Freeboard by half the beam.
const FREEBOARD: f64 = 0.45;
/// Depth to which a boat that sinks is followed, metres.
const DEPTH_MOST_M: f64 = 20.0;

/// A hole in a hull.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Hole {
    time_s: f64,
    /// Water that it lets in, kg/s.
    flow_kg_s: f64,
    /// Its place: forward of the centre of buoyancy, and to port, metres.
    lever_m: DVec2,
}

impl Hole {
    /// Water that it has let in, kg.
    fn let_in_kg(&self, time_s: f64) -> f64 {
        self.flow_kg_s * (time_s - self.time_s).max(0.0)
    }

    /// Both as one, which from the later of both on has let in as much water.
    fn with(&self, other: &Self) -> Self {
        let flow_kg_s = self.flow_kg_s + other.flow_kg_s;
        Self {
            time_s: (self.time_s * self.flow_kg_s + other.time_s * other.flow_kg_s) / flow_kg_s,
            flow_kg_s,
            lever_m: (self.lever_m * self.flow_kg_s + other.lever_m * other.flow_kg_s) / flow_kg_s,
        }
    }
}

/// Water in a hull, in closed form: how it lies at a time does not depend on how it was asked for.
///
/// A hole lets in water as it runs out of a tank (Torricelli), with the head of its depth below the wash of the sea; rounds go in on one side and out,
/// lower, on the other.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Flooding {
    holes: Vec<Hole>,
    reserve_kg: f64,
    /// When the engine drowns and when it sinks, by the holes that it has.
    drowns_s: Option<f64>,
    sinks_s: Option<f64>,
}

impl Flooding {
    /// Takes in that a round made a hole of `hole_m2` at `point` of the boat's space. Above what the sea washes it lets in nothing; says
    /// whether it does.
    pub fn add(&mut self, form: &HullForm, point: DVec3, hole_m2: f64, time_s: f64) -> bool {
        /// Height above the water at rest up to which waves and wash come, metres.
        const WASH_M: f64 = 0.3;
        /// Discharge through a sharp edge.
        const DISCHARGE: f64 = 0.6;
        let head_m = (WASH_M - point.z).min(form.draught_m + WASH_M);
        if !(head_m > 0.0 && hole_m2 > 0.0) {
            return false;
        }
        let flow_kg_s = WATER_KG_M3 * DISCHARGE * hole_m2 * (2.0 * GRAVITY_M_S2 * head_m).sqrt();
        self.reserve_kg = form.reserve_kg();
        let hole = Hole { time_s, flow_kg_s, lever_m: DVec2::new(point.x - form.centre_m, point.y) };
        if self.holes.len() == HOLES_MAX {
            let second = self.holes.remove(1);
            self.holes[0] = self.holes[0].with(&second);
        }
        self.holes.push(hole);
        // What is past stays as it was.
        let past = |known: Option<f64>| known.filter(|at| *at <= time_s);
        let drowns_kg = (DROWNS_ENGINE * form.mass_kg).min(self.reserve_kg);
        self.drowns_s = past(self.drowns_s).or_else(|| self.reaches(drowns_kg));
        self.sinks_s = past(self.sinks_s).or_else(|| self.reaches(self.reserve_kg));
        true
    }

    /// Tests whether it is dry.
    pub fn is_dry(&self) -> bool {
        self.holes.is_empty()
    }

    /// Water in it, kg.
    fn water_kg(&self, time_s: f64) -> f64 {
        self.holes.iter().map(|hole| hole.let_in_kg(time_s)).sum()
    }

    /// When the water in it reaches `kg`, seconds, by the holes that it has.
    fn reaches(&self, kg: f64) -> Option<f64> {
        let (mut flow, mut water, mut since) = (0.0, 0.0, f64::NEG_INFINITY);
        let mut holes: Vec<&Hole> = self.holes.iter().collect();
        holes.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        for hole in holes {
            let gained = if flow > 0.0 { flow * (hole.time_s - since) } else { 0.0 };
            if flow > 0.0 && water + gained >= kg {
                break;
            }
            (water, since) = (water + gained, hole.time_s);
            flow += hole.flow_kg_s;
        }
        (flow > 0.0).then(|| since + (kg - water) / flow)
    }

    /// When its engine drowns, seconds; `None` while it is dry.
    pub const fn engine_drowns_s(&self) -> Option<f64> {
        self.drowns_s
    }

    /// When it is full and sinks, seconds; `None` while it is dry.
    pub const fn sinks_s(&self) -> Option<f64> {
        self.sinks_s
    }

    /// What the water does to the attitude of a hull.
    pub fn attitude(&self, form: &HullForm, time_s: f64) -> WayAttitude {
        /// Greatest list and trim of a hull that still floats, radians.
        const LIST_MOST: f64 = 0.45;
        const TRIM_MOST: f64 = 0.15;
        /// Holes have to be farther forward than this share of the length for the bow to go down first: the engine's weight lies aft.
        const ENGINE_AFT: f64 = 0.12;
        /// How fast a hull goes down in the end, m/s, and the time in which it gets there, seconds.
        const SINKS_M_S: f64 = 0.4;
        const BEGINS_S: f64 = 4.0;
        // Once it is full, it lies as it lay then.
        let full_s = self.sinks_s.map_or(time_s, |sinks| time_s.min(sinks));
        let let_in_kg = self.water_kg(full_s);
        if let_in_kg <= 0.0 {
            return WayAttitude::default();
        }
        let water_kg = let_in_kg.min(self.reserve_kg);
        let lever_m =
            self.holes.iter().map(|hole| hole.lever_m * hole.let_in_kg(full_s)).sum::<DVec2>() / let_in_kg;
        let share = water_kg / self.reserve_kg;
        let settled_m = water_kg / (WATER_KG_M3 * form.waterplane_m2());
        // The moment of the water's weight on the side of the holes against the hull's own, which the water's free surface takes from.
        let stiffness = form.mass_kg * form.metacentre_m() * (1.0 - 0.5 * share);
        let port_down = water_kg * 0.5 * lever_m.y / stiffness;
        let length_m = form.strip_m * STRIPS as f64;
        let bow_down = water_kg * 0.3 * lever_m.x / (form.mass_kg * length_m);
        // A full hull goes down by the end that is heavier.
        let down_s = time_s - full_s;
        let grown = 1.0 - (-down_s / BEGINS_S).exp();
        let sunk_m = SINKS_M_S * (down_s - BEGINS_S * grown);
        let is_by_bow = lever_m.x > ENGINE_AFT * length_m;
        let end = if is_by_bow { -1.0 } else { 1.0 };
        WayAttitude {
            trim: (-bow_down).clamp(-TRIM_MOST, TRIM_MOST) + end * 0.5 * grown,
            lean: (-port_down).atan().clamp(-LIST_MOST, LIST_MOST) * (1.0 + 0.5 * grown),
            rise_m: -(settled_m + sunk_m).min(DEPTH_MOST_M),
        }
    }
}

impl HullForm {
    /// Area of the waterplane at rest, m^2.
    fn waterplane_m2(&self) -> f64 {
        self.strips.iter().map(|strip| 2.0 * strip.half_beam_m(self.draught_m) * self.strip_m).sum()
    }

    /// Water that a hull bears before its deck is awash, kg.
    fn reserve_kg(&self) -> f64 {
        WATER_KG_M3 * self.waterplane_m2() * FREEBOARD * self.half_beam_m
    }

    /// Height of the metacentre above the centre of mass, metres.
    fn metacentre_m(&self) -> f64 {
        let volume_m3 = self.mass_kg / WATER_KG_M3;
        let inertia = |half_beam: f64| 2.0 / 3.0 * half_beam.powi(3) * self.strip_m;
        let moment: f64 = self.strips.iter().map(|strip| inertia(strip.half_beam_m(self.draught_m))).sum();
        self.roll_stiffness * moment / volume_m3
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn skiff() -> HullForm {
        HullForm::new((-3.0, 3.0), 0.35, 1.2, |_| 0.9)
    }

    /// Twenty rounds of a heavy machine gun into the starboard side.
    fn holed(form: &HullForm) -> Flooding {
        let mut flooding = Flooding::default();
        for i in 0..20 {
            let point = DVec3::new(-1.0, -0.8, 0.0);
            assert!(flooding.add(form, point, 10e-4, 5.0 + 0.1 * f64::from(i)));
        }
        flooding
    }

    #[test]
    fn a_holed_skiff_settles_lists_loses_its_engine_and_sinks_within_minutes() {
        let form = skiff();
        let flooding = holed(&form);
        let (drowns, sinks) = (flooding.engine_drowns_s().unwrap(), flooding.sinks_s().unwrap());
        assert!(drowns < sinks && (30.0..300.0).contains(&sinks), "{drowns} s, {sinks} s");
        assert!((flooding.water_kg(sinks) - form.reserve_kg()).abs() < 1e-6);
        assert_eq!(flooding.attitude(&form, 5.0), WayAttitude::default());
        let half = flooding.attitude(&form, 0.5 * sinks);
        assert!(half.lean > 0.02 && half.rise_m < -0.05, "port is up: {half:?}");
        assert!(flooding.attitude(&form, sinks + 60.0).rise_m < -10.0);
        assert_eq!(flooding.attitude(&form, 1e9).rise_m, -DEPTH_MOST_M);
    }

    #[test]
    fn it_sinks_without_a_jump() {
        let form = skiff();
        let flooding = holed(&form);
        let mut last = flooding.attitude(&form, 0.0);
        for i in 1..6000 {
            let now = flooding.attitude(&form, f64::from(i) * 0.05);
            assert!((now.rise_m - last.rise_m).abs() < 0.05, "at {} s", f64::from(i) * 0.05);
            assert!((now.lean - last.lean).abs() < 0.02 && (now.trim - last.trim).abs() < 0.02);
            last = now;
        }
    }

    #[test]
    fn holes_above_the_wash_let_in_nothing_and_many_holes_are_no_more_than_the_sum() {
        let form = skiff();
        let mut flooding = Flooding::default();
        assert!(!flooding.add(&form, DVec3::Z, 10e-4, 1.0) && flooding.is_dry());
        assert_eq!((flooding.engine_drowns_s(), flooding.sinks_s()), (None, None));
        for _ in 0..200 {
            flooding.add(&form, DVec3::ZERO, 1e-4, 1.0);
        }
        assert_eq!(flooding.holes.len(), HOLES_MAX);
        let one = 1025.0 * 0.6 * 1e-4 * (2.0 * GRAVITY_M_S2 * 0.3_f64).sqrt();
        assert!((flooding.water_kg(11.0) - 2000.0 * one).abs() < 1e-6);
    }
}
