//! How a crew keeps clear of others: velocity obstacles over the courses and speeds that the boat can turn to.
//!
//! Fiorini & Shiller 1998 (Int. J. Robotics Research 17, 760) for the obstacles, Kuwata et al. 2014 (IEEE J. Oceanic Eng. 39, 110) for the
//! grid of courses and speeds and for the rules of the road. A boat does not change its velocity at once: each course is tried as the turn
//! that leads to it and what follows.

use std::f64::consts::PI;

use glam::DVec2;

use crate::{
    geometry::{ahead, heading_of},
    world::boats::path::wrap,
};

/// How far ahead crews look, seconds.
const HORIZON_S: f64 = 20.0;
/// Vessels that a crew heeds at a time: the nearest.
const HEEDED: usize = 10;
/// Courses tried, to each side of the one that is wanted, radians.
const COURSES: [f64; 9] = [0.0, 0.17, 0.35, 0.61, 0.87, 1.22, 1.57, 2.2, PI];
/// Shares of the wanted speed that are tried.
const SPEEDS: [f64; 3] = [1.0, 0.5, 0.0];
/// Steps into which the turn is cut.
const TURN_STEPS: usize = 6;
/// Share of the distance that there is to which a turn away may shrink it, where it is too small already.
const STILL_CLOSER: f64 = 0.8;
/// A vessel that must stand on acts by herself once the other is this close, seconds (Rule 17 (b)).
const LAST_MOMENT_S: f64 = 8.0;

/// Another vessel, or this one, as others see it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Traffic {
    /// World x and y, metres.
    pub position: DVec2,
    /// Over the ground, m/s.
    pub velocity: DVec2,
    /// Radians clockwise from north.
    pub heading: f64,
    /// Distance from its middle that others keep clear of, metres.
    pub radius_m: f64,
}

/// A course and a speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bound {
    /// Radians clockwise from north.
    pub course: f64,
    /// m/s ahead.
    pub speed_m_s: f64,
}

/// What a boat can do and what it heeds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Helmsman {
    /// Turn that it can hold, rad/s.
    pub turn_rate: f64,
    /// Space that it leaves besides both vessels' own, metres.
    pub margin_m: f64,
    /// Whether it keeps to the rules of the road (COLREGS rules 13 to 17).
    pub keeps_rules: bool,
}

/// The part of the rules that holds against another vessel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Encounter {
    /// Alter to starboard.
    HeadOn,
    /// Keep out of the way, and do not cross ahead.
    GiveWay,
    /// Keep course and speed.
    StandOn,
    /// Keep clear on either side.
    Free,
}

impl Helmsman {
    /// The course and speed next to `wanted` that keep clear of `others`.
    pub fn clear(&self, me: &Traffic, wanted: Bound, others: &[Traffic]) -> Bound {
        let mut near: Vec<(Traffic, Encounter)> = others
            .iter()
            .filter(|other| self.concerns(me, wanted.speed_m_s, other))
            .map(|other| (*other, self.encounter(me, other)))
            .collect();
        if near.len() > HEEDED {
            let gap_m =
                |(other, _): &(Traffic, Encounter)| me.position.distance(other.position) - other.radius_m;
            near.sort_by(|a, b| gap_m(a).total_cmp(&gap_m(b)));
            near.truncate(HEEDED);
        }
        if near.is_empty() || self.soonest(me, wanted, &near) >= HORIZON_S {
            return wanted;
        }
        let mut best = (f64::INFINITY, wanted);
        for off in COURSES {
            for side in [1.0, -1.0] {
                for share in SPEEDS {
                    let tried =
                        Bound { course: wanted.course + side * off, speed_m_s: wanted.speed_m_s * share };
                    let cost = self.cost(me, wanted, tried, &near);
                    if cost < best.0 {
                        best = (cost, tried);
                    }
                }
                if off == 0.0 {
                    break;
                }
            }
        }
        best.1
    }

    /// The way from a vessel beside this one that comes no farther off: the course on which one that lies still makes room, radians.
    pub fn room(&self, me: &Traffic, others: &[Traffic]) -> Option<f64> {
        /// Speed at which two drift apart by themselves, m/s.
        const OPENS_M_S: f64 = 0.2;
        let gap_m = |other: &Traffic| me.position.distance(other.position) - me.radius_m - other.radius_m;
        let nearest = others.iter().min_by(|a, b| gap_m(a).total_cmp(&gap_m(b)))?;
        let away = (me.position - nearest.position).try_normalize()?;
        let opens = (me.velocity - nearest.velocity).dot(away) > OPENS_M_S;
        (gap_m(nearest) < 0.5 * self.margin_m && !opens).then(|| heading_of(away))
    }

    /// Whether another is close enough to meet within the time that is looked ahead.
    fn concerns(&self, me: &Traffic, speed_m_s: f64, other: &Traffic) -> bool {
        let speeds = speed_m_s.max(me.velocity.length()) + other.velocity.length();
        let reach = self.space(me, other) + speeds * HORIZON_S;
        me.position.distance_squared(other.position) < reach * reach
    }

    fn space(&self, me: &Traffic, other: &Traffic) -> f64 {
        me.radius_m + other.radius_m + self.margin_m
    }

    fn encounter(&self, me: &Traffic, other: &Traffic) -> Encounter {
        /// A vessel under way, m/s.
        const UNDER_WAY: f64 = 0.5;
        /// Two and a quarter points abaft the beam: where a vessel that comes up is overtaking (Rule 13).
        const OVERTAKING: f64 = 112.5 * PI / 180.0;
        if !self.keeps_rules || other.velocity.length() < UNDER_WAY {
            return Encounter::Free;
        }
        let bearing = wrap(heading_of(other.position - me.position) - me.heading);
        let theirs = wrap(heading_of(me.position - other.position) - other.heading);
        if theirs.abs() > OVERTAKING {
            return Encounter::Free;
        }
        if bearing.abs() > OVERTAKING {
            return Encounter::StandOn;
        }
        let opposed = wrap(other.heading - me.heading).abs() > 165_f64.to_radians();
        if opposed && bearing.abs() < 15_f64.to_radians() {
            return Encounter::HeadOn;
        }
        if bearing > 0.0 { Encounter::GiveWay } else { Encounter::StandOn }
    }

    fn cost(&self, me: &Traffic, wanted: Bound, tried: Bound, near: &[(Traffic, Encounter)]) -> f64 {
        /// Weight of a turn by pi.
        const TURN: f64 = 2.0;
        /// Weight of a stop.
        const SLOW: f64 = 1.0;
        /// Weight of a meeting at once.
        const MEET: f64 = 40.0;
        /// Weight of breaking a rule.
        const RULE: f64 = 3.0;
        let turned = wrap(tried.course - wanted.course) / PI;
        let slower = 1.0 - tried.speed_m_s / wanted.speed_m_s.max(0.1);
        let meeting = 1.0 - (self.soonest(me, tried, near) / HORIZON_S).min(1.0);
        let broken = near.iter().any(|(other, encounter)| match encounter {
            Encounter::HeadOn => turned < 0.0,
            Encounter::GiveWay => turned < 0.0 || crosses_ahead(me, tried, other),
            Encounter::StandOn | Encounter::Free => false,
        });
        TURN * turned * turned + SLOW * slower * slower + MEET * meeting + if broken { RULE } else { 0.0 }
    }

    /// When the boat on a course first comes within the space of one of `near`, seconds; the horizon where it does not.
    fn soonest(&self, me: &Traffic, tried: Bound, near: &[(Traffic, Encounter)]) -> f64 {
        let (from, start_m_s) = (heading_or(me), me.velocity.length());
        let turn = wrap(tried.course - from);
        let step_s = turn.abs() / self.turn_rate.max(0.01) / TURN_STEPS as f64;
        // Velocity in each step of the turn, and after it: the same whoever is near.
        let way: [DVec2; TURN_STEPS + 1] = std::array::from_fn(|i| {
            if i == TURN_STEPS {
                return ahead(tried.course) * tried.speed_m_s;
            }
            let share = (i as f64 + 0.5) / TURN_STEPS as f64;
            ahead(from + turn * share) * (start_m_s + (tried.speed_m_s - start_m_s) * share)
        });
        let mut soonest = HORIZON_S;
        for (other, encounter) in near {
            let (mut off, mut time) = (me.position - other.position, 0.0);
            // Who is too close already looks for a way that leads no closer.
            let space = self.space(me, other).min(STILL_CLOSER * off.length());
            let mut met = None;
            for (i, velocity) in way.iter().enumerate() {
                let span = if i == TURN_STEPS { HORIZON_S - time } else { step_s };
                let relative = *velocity - other.velocity;
                if let Some(after) = enters(off, relative, space, span) {
                    met = Some(time + after);
                    break;
                }
                off += relative * span;
                time += span;
                if time >= HORIZON_S {
                    break;
                }
            }
            let stands_on = *encounter == Encounter::StandOn;
            if let Some(met) = met.filter(|met| !stands_on || *met < LAST_MOMENT_S) {
                soonest = soonest.min(met);
            }
        }
        soonest
    }
}

/// The course over the ground; the heading of a boat that lies still.
fn heading_or(me: &Traffic) -> f64 {
    if me.velocity.length() > 0.5 { heading_of(me.velocity) } else { me.heading }
}

/// When a point that starts at `off` and goes at `velocity` comes within `space` of the origin, if that is before `span`. One that is
/// within already meets at once, unless it goes away.
fn enters(off: DVec2, velocity: DVec2, space: f64, span: f64) -> Option<f64> {
    let (closing, gap2) = (off.dot(velocity), off.length_squared() - space * space);
    if gap2 <= 0.0 {
        return (closing < 0.0).then_some(0.0);
    }
    let speed2 = velocity.length_squared();
    let under = closing * closing - speed2 * gap2;
    if closing >= 0.0 || under < 0.0 {
        return None;
    }
    let time = (-closing - under.sqrt()) / speed2;
    (time <= span).then_some(time)
}

/// Whether a boat on that course passes ahead of the other's bow.
fn crosses_ahead(me: &Traffic, tried: Bound, other: &Traffic) -> bool {
    let off = me.position - other.position;
    let relative = ahead(tried.course) * tried.speed_m_s - other.velocity;
    let speed2 = relative.length_squared();
    if speed2 < 1e-6 {
        return false;
    }
    let nearest = off - relative * (off.dot(relative) / speed2);
    nearest.dot(ahead(other.heading)) > 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const HELM: Helmsman = Helmsman { turn_rate: 0.3, margin_m: 5.0, keeps_rules: false };

    fn boat(x: f64, y: f64, heading: f64, speed: f64) -> Traffic {
        Traffic { position: DVec2::new(x, y), velocity: ahead(heading) * speed, heading, radius_m: 4.0 }
    }

    #[test]
    fn without_danger_a_boat_goes_where_it_wants() {
        let wanted = Bound { course: 0.3, speed_m_s: 8.0 };
        let me = boat(0.0, 0.0, 0.3, 8.0);
        assert_eq!(HELM.clear(&me, wanted, &[]), wanted);
        assert_eq!(
            HELM.clear(&me, wanted, &[boat(0.0, -60.0, 0.3, 5.0)]),
            wanted,
            "it leaves that one astern"
        );
        assert_eq!(HELM.clear(&me, wanted, &[boat(4000.0, 0.0, -1.5, 20.0)]), wanted);
    }

    #[test]
    fn vessels_that_keep_the_rules_give_way_to_starboard_and_stand_on() {
        let rules = Helmsman { keeps_rules: true, ..HELM };
        let wanted = Bound { course: 0.0, speed_m_s: 6.0 };
        let me = boat(0.0, 0.0, 0.0, 6.0);
        let head_on = rules.clear(&me, wanted, &[boat(0.0, 150.0, PI, 6.0)]);
        assert!(wrap(head_on.course) > 0.05, "{head_on:?}");
        let from_starboard = boat(90.0, 90.0, -PI / 2.0, 6.0);
        let gives = rules.clear(&me, wanted, &[from_starboard]);
        assert!(gives != wanted && !crosses_ahead(&me, gives, &from_starboard), "{gives:?}");
        let from_port = boat(-90.0, 90.0, PI / 2.0, 6.0);
        assert_eq!(rules.clear(&me, wanted, &[from_port]), wanted, "it stands on");
        let too_close = boat(-30.0, 30.0, PI / 2.0, 6.0);
        assert_ne!(rules.clear(&me, wanted, &[too_close]), wanted, "at the last moment it acts");
    }

    proptest! {
        /// Boats of full agility that all keep clear of each other never meet, whatever way they come from.
        #[test]
        fn two_boats_that_cross_keep_their_space(from in 0.0..PI * 2.0, speed in 2.0..15.0_f64, aside in -20.0..20.0_f64) {
            let goal = DVec2::ZERO;
            let mut boats = [
                boat(0.0, -200.0, 0.0, 8.0),
                {
                    let start = ahead(from) * 250.0 + ahead(from + 1.57) * aside;
                    Traffic { position: start, ..boat(0.0, 0.0, heading_of(goal - start), speed) }
                },
            ];
            prop_assume!(boats[0].position.distance(boats[1].position) > 60.0);
            let wanted = boats.map(|b| Bound { course: b.heading, speed_m_s: b.velocity.length() });
            for _ in 0..600 {
                let next = [0, 1].map(|i| {
                    let bound = HELM.clear(&boats[i], wanted[i], &[boats[1 - i]]);
                    let turn = wrap(bound.course - boats[i].heading).clamp(-0.03, 0.03);
                    let heading = boats[i].heading + turn;
                    let speed = boats[i].velocity.length();
                    let speed = speed + (bound.speed_m_s - speed).clamp(-0.3, 0.3);
                    let velocity = ahead(heading) * speed;
                    Traffic { position: boats[i].position + velocity * 0.1, velocity, heading, ..boats[i] }
                });
                boats = next;
                let apart = boats[0].position.distance(boats[1].position);
                prop_assert!(apart > 8.0, "{apart} m apart");
            }
        }
    }
}
