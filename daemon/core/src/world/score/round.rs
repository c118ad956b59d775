//! One round from the muzzle to its end.

use glam::DVec3;

use super::{
    closest::{Closest, closest_to_box, closest_to_surface},
    hit::{Moving, strike},
};
use crate::{
    model::Zone,
    world::{
        gunnery::{Flight, FlightSegment, FlightState},
        waves::WaveField,
    },
};

/// A round that struck nothing after this time is no longer followed, seconds.
const LIFE_S: f64 = 20.0;

/// A round in the air that may strike boats and the sea. All times are seconds on the clock that the boats are given in.
#[derive(Clone, Debug)]
pub struct Round {
    shot: u64,
    fired_s: f64,
    muzzle: DVec3,
    flight: Flight,
    nearest: Option<Approach>,
}

/// How close a round came to a boat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// Index of the boat among those given.
    pub boat: usize,
    /// Distance to its surface, metres.
    pub distance_m: f64,
    /// When.
    pub time_s: f64,
    /// Distance of the boat's middle from the muzzle then, metres: a round that falls short ends far from it.
    pub range_m: f64,
}

/// How a round ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum End {
    /// It struck a boat.
    Struck {
        /// Index of the boat among those given.
        boat: usize,
        /// The part.
        zone: Zone,
        /// When.
        time_s: f64,
        /// Distance from the muzzle, metres.
        range_m: f64,
        /// The place in the boat's space, metres.
        point: DVec3,
        /// The place in the world, metres.
        at: DVec3,
    },
    /// It struck the sea.
    Splashed {
        /// The place, metres.
        at: DVec3,
        /// When.
        time_s: f64,
    },
    /// It was followed for long enough.
    Spent {
        /// When.
        time_s: f64,
    },
}

impl Round {
    /// Round number `shot`, fired at `fired_s`.
    pub fn new(shot: u64, fired_s: f64, flight: Flight) -> Self {
        Self { shot, fired_s, muzzle: flight.state().position, flight, nearest: None }
    }

    /// The round goes on from the water at `at`, with another velocity: it has bounced. What it came closest to stays.
    #[must_use]
    pub fn bounced(&self, flight: Flight, time_s: f64) -> Self {
        Self { shot: self.shot, fired_s: time_s, muzzle: self.muzzle, flight, nearest: self.nearest }
    }

    /// The shot's number.
    pub const fn shot(&self) -> u64 {
        self.shot
    }

    /// When it left the muzzle.
    pub const fn fired_s(&self) -> f64 {
        self.fired_s
    }

    /// Where it left the muzzle, world, metres.
    pub const fn muzzle(&self) -> DVec3 {
        self.muzzle
    }

    /// The boat that the round came closest to up to now, and how close.
    pub const fn nearest(&self) -> Option<Approach> {
        self.nearest
    }

    /// Where the round is or was at `time_s` (within the last 0.6 s), its own time in seconds since the muzzle.
    pub fn state_at(&self, time_s: f64) -> FlightState {
        self.flight.state_at(time_s - self.fired_s)
    }

    /// Follows the round until `until_s`; the end, once there is one, after which the round must be dropped. `boats` are given
    /// over a span that ends at `until_s` or later.
    pub fn advance(&mut self, until_s: f64, boats: &[Moving<'_>], sea: &WaveField) -> Option<End> {
        while let Some(segment) = self.flight.next_segment((until_s - self.fired_s).min(LIFE_S)) {
            if let Some(end) = self.sweep(&segment, boats, sea) {
                return Some(end);
            }
        }
        let spent = self.flight.time_s() >= LIFE_S;
        spent.then_some(End::Spent { time_s: self.fired_s + LIFE_S })
    }

    fn sweep(&mut self, segment: &FlightSegment, boats: &[Moving<'_>], sea: &WaveField) -> Option<End> {
        let clock = |fraction: f64| {
            self.fired_s + segment.from.time_s + fraction * (segment.to.time_s - segment.from.time_s)
        };
        let (a, b) = (segment.from.position, segment.to.position);
        // Whatever comes first along the stretch ends the round; what lies behind it is never reached.
        let splash = water_fraction(segment, sea, clock(0.0), clock(1.0));
        let mut last = splash.unwrap_or(1.0);
        let mut end = splash.map(|s| End::Splashed { at: a.lerp(b, s), time_s: clock(s) });
        for (boat, moving) in boats.iter().enumerate() {
            if let Some((s, zone, point)) = sweep_boat(segment, moving, self.muzzle, clock(0.0), clock(1.0))
                && s <= last
            {
                let at = a.lerp(b, s);
                let range_m = at.distance(self.muzzle);
                last = s;
                end = Some(End::Struck { boat, zone, time_s: clock(s), range_m, point, at });
            }
        }
        let (from_s, to_s) = (clock(0.0), clock(last));
        for (boat, moving) in boats.iter().enumerate() {
            self.note_approach(boat, moving, [(from_s, a), (to_s, a.lerp(b, last))], end.is_some());
        }
        end
    }

    fn note_approach(&mut self, boat: usize, moving: &Moving<'_>, [from, to]: [(f64, DVec3); 2], ends: bool) {
        let poses = [from, to].map(|(time_s, _)| moving.pose_at(time_s, self.muzzle));
        let apart = |s: f64| from.1.lerp(to.1, s) - poses[0].position.lerp(poses[1].position, s);
        let least = distance_to_origin(apart(0.0), apart(1.0)) - moving.reach_m();
        let within_m = self.nearest.map_or(f64::INFINITY, |n| n.distance_m);
        if within_m <= least {
            return;
        }
        let (a, b) = (poses[0].to_body(from.1), poses[1].to_body(to.1));
        let by_box = closest_to_box(moving.model, a, b);
        // While it still approaches, the next stretch is closer.
        if by_box.distance_m >= within_m || (by_box.fraction >= 1.0 && !ends) {
            return;
        }
        let closest = closest_to_surface(moving.model, a, b, within_m);
        if let Some(Closest { fraction, distance_m }) = closest {
            let range_m = poses[0].position.lerp(poses[1].position, fraction).distance(self.muzzle);
            let time_s = from.0 + fraction * (to.0 - from.0);
            self.nearest = Some(Approach { boat, distance_m, time_s, range_m });
        }
    }
}

/// Where along the segment the round strikes the boat, which part, and the place in the boat's space.
fn sweep_boat(
    segment: &FlightSegment,
    moving: &Moving<'_>,
    eye: DVec3,
    from_s: f64,
    to_s: f64,
) -> Option<(f64, Zone, DVec3)> {
    /// The path may bend by so much in a turning boat's space before it is followed in shorter pieces, metres.
    const BEND_M: f64 = 0.005;
    /// Most pieces of a stretch.
    const PIECES_MAX: f64 = 32.0;
    let (a, b) = (segment.from.position, segment.to.position);
    let (p, q) = (moving.pose_at(from_s, eye), moving.pose_at(to_s, eye));
    let (near, far) = (a - p.position, b - q.position);
    if distance_to_origin(near, far) > moving.reach_m() {
        return None;
    }
    // Straight in the world is an arc in a boat that turns: an arc of length d that turns by w bends by w d / 4 from its chord, and
    // by the square of the pieces less.
    let bend_m = p.world_from_body.angle_between(q.world_from_body) * near.distance(far) / 4.0;
    let pieces = (bend_m / BEND_M).sqrt().ceil().clamp(1.0, PIECES_MAX);
    let in_body = |s: f64| moving.pose_at(from_s + s * (to_s - from_s), eye).to_body(a.lerp(b, s));
    let mut begin = p.to_body(a);
    for i in 0..pieces as u32 {
        let to = f64::from(i + 1) / pieces;
        let end = if to < 1.0 { in_body(to) } else { q.to_body(b) };
        if let Some(hit) = strike(moving.model, begin, end) {
            return Some(((f64::from(i) + hit.fraction) / pieces, hit.zone, hit.point));
        }
        begin = end;
    }
    None
}

/// Least distance of the stretch from `a` to `b` from the origin.
fn distance_to_origin(a: DVec3, b: DVec3) -> f64 {
    let ray = b - a;
    let length2 = ray.length_squared();
    let s = if length2 > 0.0 { (-a.dot(ray) / length2).clamp(0.0, 1.0) } else { 0.0 };
    (a + ray * s).length()
}

/// How far along the segment the round meets the water.
fn water_fraction(segment: &FlightSegment, sea: &WaveField, from_s: f64, to_s: f64) -> Option<f64> {
    /// Distance between the places at which a low round is held against the waves, metres.
    const WATER_STEP_M: f64 = 1.0;
    let (a, b) = (segment.from.position, segment.to.position);
    let crest = sea.crest_max_m();
    if a.z.min(b.z) > crest {
        return None;
    }
    let above = |s: f64| {
        let p = a.lerp(b, s);
        let trough = if p.z > crest { 0.0 } else { sea.height(p.truncate(), from_s + s * (to_s - from_s)) };
        p.z - trough
    };
    let pieces = if sea.is_flat() { 1.0 } else { (a.distance(b) / WATER_STEP_M).ceil().clamp(1.0, 100.0) };
    let mut low = 0.0;
    if above(low) <= 0.0 {
        return Some(0.0);
    }
    for i in 1..=pieces as u32 {
        let mut high = f64::from(i) / pieces;
        if above(high) > 0.0 {
            low = high;
            continue;
        }
        for _ in 0..30 {
            let middle = (low + high) / 2.0;
            if above(middle) > 0.0 { low = middle } else { high = middle }
        }
        return Some(high);
    }
    None
}

#[cfg(test)]
#[path = "round_tests.rs"]
mod tests;
