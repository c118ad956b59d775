//! Rounds against boats that move: hit or miss.

use std::f64::consts::TAU;

use anyhow::{Context, Result, anyhow};
use bowwave_core::{
    geometry::RigidPose,
    model::{Model, ModelKind, Part, Vertex, Zone},
    world::{
        gunnery::{Atmosphere, DragModel, Flight, Projectile, aim_to_hit},
        score::{End, Moving, Round},
        waves::WaveField,
    },
};
use differential_equations::prelude::*;
use glam::{DQuat, DVec3, Vec2, Vec3};
use rayon::prelude::*;

use super::{
    About, even,
    flight::{FlownRound, Mass},
};
use crate::bench::{ExtremeResult, PartBench, Way};

/// Description of this part.
pub const ABOUT: About = About {
    part: "hits",
    what: "Decides whether a round strikes a boat that goes, turns and rolls.",
    truth: "DOP853 at 1e-12 of the crate differential-equations up to the boat, its path there to the third order, and the least signed distance to \
            the box, whose pose is a closed function of time, by sampling and golden section; shots within a centimetre of the box's surface \
            count as right either way",
    rivals: "the boat as it lies at the picture's begin; the round's place each millisecond",
    why: "The stretch is swept in the boat's own space, in pieces where the boat turns: it costs no more than a boat that is taken for still, \
          and no shot is decided wrongly",
};

/// A span over which boats count as going straight, as the product has it.
const SPAN_S: f64 = 1.0 / 30.0;
/// Half the box's size, and the height of its middle over its origin, metres.
const HALF: DVec3 = DVec3::new(3.5, 1.0, 0.85);
const MIDDLE: DVec3 = DVec3::new(0.0, 0.0, 0.55);
/// Shots this close to the surface may go either way, metres.
const BAND_M: f64 = 0.01;

/// A box of the size of a skiff.
fn skiff() -> Model {
    let (min, max) = ((MIDDLE - HALF).as_vec3(), (MIDDLE + HALF).as_vec3());
    let corner = |i: u32| {
        let pick = |bit: u32, low: f32, high: f32| if i & bit == 0 { low } else { high };
        let position = Vec3::new(pick(1, min.x, max.x), pick(2, min.y, max.y), pick(4, min.z, max.z));
        Vertex { position, normal: Vec3::Z, uv: Vec2::ZERO, albedo: Vec3::ONE }
    };
    let faces = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
    let indices: Vec<u32> = faces.iter().flat_map(|&[a, b, c, d]| [a, b, c, a, c, d]).collect();
    let parts = vec![Part { zone: Zone::Hull, indices: 0..indices.len() as u32 }];
    Model {
        name: "box".into(),
        kind: ModelKind::Mesh,
        vertices: (0..8).map(corner).collect(),
        indices,
        parts,
        texture: None,
        waterline: Vec::new(),
        min,
        max,
    }
}

/// A boat and a round at it; the boat is high above the water, which plays no part.
#[derive(Clone, Copy)]
struct Shot {
    muzzle: DVec3,
    direction: DVec3,
    round: FlownRound,
    speed_m_s: f64,
    near_s: f64,
    begin: DVec3,
    velocity: DVec3,
    acceleration: DVec3,
    heading: [f64; 2],
    roll: [f64; 3],
}

impl Shot {
    /// The shot of that number, aimed within some metres of the boat; `None` where the boat is out of range.
    fn of(number: u64) -> Option<Self> {
        let draw = |what: u64| even(number * 32 + what);
        let between = |what: u64, low: f64, high: f64| low + draw(what) * (high - low);
        let (bearing, range) = (between(0, 0.0, TAU), between(1, 40.0, 900.0));
        let wind = DVec3::new(between(2, -10.0, 10.0), between(3, -10.0, 10.0), 0.0);
        let (bc, speed_m_s) =
            [(0.337, 893.0), (0.2, 853.0), (0.089, 241.0), (0.4, 1100.0)][(draw(4) * 4.0) as usize % 4];
        let mut shot = Self {
            muzzle: DVec3::new(0.3, -0.2, 8.0),
            direction: DVec3::X,
            round: FlownRound { drag: DragModel::G7, bc, wind },
            speed_m_s,
            near_s: 0.0,
            begin: DVec3::new(bearing.sin() * range, bearing.cos() * range, between(5, 60.0, 70.0)),
            velocity: DVec3::new(between(6, -18.0, 18.0), between(7, -18.0, 18.0), between(8, -2.0, 2.0)),
            acceleration: DVec3::new(between(9, -5.0, 5.0), between(10, -5.0, 5.0), between(11, -0.5, 0.5)),
            heading: [between(12, 0.0, TAU), between(13, -0.8, 0.8)],
            roll: [between(14, 0.0, 0.4), between(15, 0.5, 3.0), between(16, 0.0, TAU)],
        };
        let off = DVec3::new(between(17, -4.5, 4.5), between(18, -2.0, 2.0), between(19, -1.5, 1.5));
        let projectile = Projectile::new(bc, speed_m_s)?;
        let target = |s: f64| shot.pose(s).to_world(MIDDLE + off);
        let aim = aim_to_hit(projectile, shot.muzzle, wind, target)?;
        (shot.direction, shot.near_s) = (aim.direction, aim.time_s);
        Some(shot)
    }

    /// The boat's pose, a closed function of time.
    fn pose(&self, s: f64) -> RigidPose {
        let position = self.begin + self.velocity * s + self.acceleration * (0.5 * s * s);
        let heading = self.heading[0] + self.heading[1] * s;
        let roll = self.roll[0] * (self.roll[1] * s + self.roll[2]).sin();
        let world_from_body = DQuat::from_rotation_z(heading) * DQuat::from_rotation_x(roll);
        RigidPose { world_from_body, position }
    }

    fn flight(&self) -> Option<Flight> {
        let projectile = Projectile::new(self.round.bc, self.speed_m_s)?;
        Flight::new(projectile, &Atmosphere::ICAO, self.muzzle, self.direction, self.round.wind)
    }

    /// Least signed distance of the round from the box, metres, by the truth.
    fn distance_m(&self) -> Result<f64> {
        let start = self.begin_state();
        let method = ExplicitRungeKutta::dop853().rtol(1e-12).atol(1e-12).max_steps(1_000_000);
        let solution = IVP::ode(&self.round, 0.0, self.near_s, start)
            .method(method)
            .solve()
            .map_err(|e| anyhow!("DOP853 gave up: {e:?}"))?;
        let state = *solution.y.last().context("DOP853 returned nothing")?;
        let vector = |s: &Mass, i: usize| DVec3::new(s[i], s[i + 1], s[i + 2]);
        let (x, v, a) = (vector(&state, 0), vector(&state, 3), vector(&self.round.rate(&state), 3));
        // The change of the acceleration along the path.
        const APART_S: f64 = 1e-4;
        let moved = |s: f64| {
            let (x, v) = (x + v * s + a * (0.5 * s * s), v + a * s);
            vector(&self.round.rate(&[x.x, x.y, x.z, v.x, v.y, v.z]), 3)
        };
        let jerk = (moved(APART_S) - moved(-APART_S)) / (2.0 * APART_S);
        let off = |s: f64| {
            let at = x + v * s + a * (0.5 * s * s) + jerk * (s * s * s / 6.0);
            signed_distance(self.pose(self.near_s + s).to_body(at) - MIDDLE)
        };
        Ok(least(off, 12.0 / v.length()))
    }

    fn begin_state(&self) -> Mass {
        let v = self.direction.normalize() * self.speed_m_s;
        [self.muzzle.x, self.muzzle.y, self.muzzle.z, v.x, v.y, v.z]
    }

    /// The product's verdict; `hold` takes the boat as it lies at each span's begin.
    fn swept(&self, model: &Model, hold: bool) -> bool {
        let Some(flight) = self.flight() else { return false };
        let mut round = Round::new(1, 0.0, flight);
        let mut from_s = 0.0;
        while from_s < self.near_s + 0.1 {
            let to_s = from_s + SPAN_S;
            let from = self.pose(from_s);
            let to = if hold { from } else { self.pose(to_s) };
            let moving = [Moving { model, from_s, from, to_s, to }];
            match round.advance(to_s, &moving, &WaveField::FLAT) {
                Some(End::Struck { .. }) => return true,
                Some(_) => return false,
                None => from_s = to_s,
            }
        }
        false
    }

    /// Whether the round is within the box at one of the times `step_s` apart.
    fn sampled(&self, step_s: f64) -> bool {
        let Some(mut flight) = self.flight() else { return false };
        let mut s = 0.0;
        while s < self.near_s + 0.05 {
            flight.advance(step_s);
            s += step_s;
            let at = self.pose(s).to_body(flight.state().position) - MIDDLE;
            if signed_distance(at) < 0.0 {
                return true;
            }
        }
        false
    }
}

/// Distance of a point from the box's surface, negative within.
fn signed_distance(at: DVec3) -> f64 {
    let beyond = at.abs() - HALF;
    beyond.max(DVec3::ZERO).length() + beyond.max_element().min(0.0)
}

/// The least value within `reach` of 0: of samples, refined by golden section about the least of them.
fn least(off: impl Fn(f64) -> f64, reach: f64) -> f64 {
    const SAMPLES: i32 = 400;
    const GOLDEN: f64 = 0.618_033_988_749_894_8;
    let at = |i: i32| reach * f64::from(i) / f64::from(SAMPLES);
    let best = (-SAMPLES..=SAMPLES).min_by(|a, b| off(at(*a)).total_cmp(&off(at(*b)))).unwrap_or(0);
    let (mut low, mut high) = (at(best - 1), at(best + 1));
    for _ in 0..60 {
        let (a, b) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
        if off(a) < off(b) { high = b } else { low = a }
    }
    off(0.5 * (low + high))
}

/// Shots that are decided otherwise than by the truth, and are not within the band, a million.
fn wrong(shots: &[(Shot, f64)], verdict: impl Fn(&Shot) -> bool + Sync) -> f64 {
    let is_wrong =
        |(shot, distance): &&(Shot, f64)| distance.abs() > BAND_M && verdict(shot) != (*distance < 0.0);
    1e6 * shots.par_iter().filter(is_wrong).count() as f64 / shots.len() as f64
}

/// Measures the scenes and extreme cases.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    let count: u64 = if bench.is_quick() { 20_000 } else { 1_000_000 };
    let model = skiff();
    let shots = (0..count)
        .into_par_iter()
        .filter_map(Shot::of)
        .map(|shot| Ok((shot, shot.distance_m()?)))
        .collect::<Result<Vec<_>>>()?;
    let hits = shots.iter().filter(|(_, distance)| *distance < 0.0).count();
    let case =
        format!("{} random shots, {hits} of them hits; decided wrongly beyond a centimetre", shots.len());
    bench.extreme(
        &case,
        "in a million",
        vec![
            ExtremeResult::product(
                "swept in the boat's space",
                "1/30 s",
                wrong(&shots, |s| s.swept(&model, false)),
            ),
            ExtremeResult::rival(
                "the boat as at the span's begin",
                "1/30 s",
                wrong(&shots, |s| s.swept(&model, true)),
            ),
        ],
    );
    let few = &shots[..shots.len().min(400)];
    let scene = "400 shots at a skiff that goes, turns and rolls";
    let each = |verdict: &dyn Fn(&Shot) -> bool| few.iter().filter(|(shot, _)| verdict(shot)).count();
    let ways = vec![
        Way::new(
            "swept in the boat's space",
            "1/30 s",
            wrong(few, |s| s.swept(&model, false)),
            few.len(),
            || each(&|s| s.swept(&model, false)),
        )
        .default_if(true),
        Way::new(
            "the boat as at the span's begin",
            "1/30 s",
            wrong(few, |s| s.swept(&model, true)),
            few.len(),
            || each(&|s| s.swept(&model, true)),
        ),
        Way::new("the round's places", "1 ms", wrong(few, |s| s.sampled(1e-3)), few.len(), || {
            each(&|s| s.sampled(1e-3))
        }),
    ];
    bench.scene(scene, "in a million", 0.0, ways);
    Ok(())
}
