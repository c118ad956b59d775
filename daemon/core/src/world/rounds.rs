//! Virtual rounds in the air and what they leave on the sea.

use glam::DVec3;

use crate::{
    chance::drawn,
    model::Zone,
    time::Time,
    world::{
        boats::RoundStrike,
        burst::FragmentStrike,
        fleet::Fleet,
        gunnery::{Atmosphere, Flight, FlightState, Projectile, dispersed},
        scenario::WeaponSpec,
        score::{
            Approach, BoreSample, End, MissExplanation, MissedRound, Moving, Outcome, Round, ShotRecord,
        },
        track::RoundPath,
        waves::WaveField,
    },
};

/// Draws of bounces are numbered from here.
const BOUNCE: u64 = 1 << 32;
/// Height of the splash of a round that bounces, as a share of one that enters.
const GRAZED: f64 = 0.6;
/// A stretch of time over which a boat's motion counts as straight, seconds.
const SPAN_S: f64 = 1.0 / 30.0;
/// A tracer lights up this far from the muzzle, metres.
const TRACER_LIT_M: f64 = 25.0;
/// Strikes are kept so long, seconds, and splashes as long as they stand.
const STRIKE_KEPT_S: f64 = 1.6;

/// The ammunition, its dispersion and the wind.
#[derive(Clone, Debug)]
pub struct Ammunition {
    /// The weapon that fires it.
    pub weapon: WeaponSpec,
    /// Velocity of the air, world, m/s.
    pub wind: DVec3,
    /// Seed of the dispersion.
    pub seed: u64,
}

/// Draws of fires are numbered from here.
const FIRE: u64 = 1 << 48;

impl Ammunition {
    /// Strike of round `shot` on a part of a boat, at `point` of its space.
    fn strike(&self, shot: u64, zone: Zone, point: DVec3) -> RoundStrike {
        /// Chance that a solid round sets fire to an engine, and that one which bursts does.
        const IGNITES: (f64, f64) = (0.15, 0.6);
        let chance = if self.weapon.burst.is_some() { IGNITES.1 } else { IGNITES.0 };
        let ignites = zone == Zone::Engine && drawn(self.seed, [shot, FIRE]) < chance;
        RoundStrike { zone, hole: Some((point, 1e-4 * self.weapon.hole_cm2)), ignites }
    }
}

/// A round as it left the muzzle.
#[derive(Clone, Copy, Debug)]
pub struct Launch {
    /// Its number.
    pub shot: u64,
    /// When.
    pub fired: Time,
    /// Where, world, metres.
    pub muzzle: DVec3,
    /// Direction of the barrel, world, unit vector.
    pub bore: DVec3,
    /// Age of the pose used, nanoseconds.
    pub pose_age_ns: i64,
    /// Scatter by that of the weapon's data: more where its barrel is hot.
    pub scatter: f64,
}

/// A boat that fragments of a round have struck, whose record names another or none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FragmentHit {
    /// The round's number.
    pub shot: u64,
    /// When.
    pub time: Time,
    /// The boat.
    pub boat: usize,
}

impl Launch {
    fn record(&self, outcome: Outcome) -> ShotRecord {
        let Self { shot, fired, muzzle, bore, pose_age_ns, .. } = *self;
        ShotRecord { shot, fired, muzzle, bore, pose_age_ns, outcome }
    }
}

#[derive(Clone, Debug)]
struct InFlight {
    launch: Launch,
    /// Direction in which it left, scatter included.
    flown: DVec3,
    /// The barrel before, oldest first.
    before: Vec<BoreSample>,
    round: Round,
    path: RoundPath,
    tracer: bool,
    bounces: u32,
}

/// A round that missed a boat, and why.
#[derive(Clone, Debug, PartialEq)]
pub struct ExplainedMiss {
    /// The round's number.
    pub shot: u64,
    /// When it was closest to the boat.
    pub time: Time,
    /// The boat.
    pub boat: usize,
    /// Why.
    pub why: MissExplanation,
}

impl InFlight {
    /// Seconds from when it was fired to `time_s` on the rounds' clock.
    fn after_s(&self, time_s: f64, start: Time) -> f64 {
        time_s - self.launch.fired.secs_since(start)
    }

    /// Its path up to where it ends at `at`.
    fn ended_path(&mut self, time_s: f64, at: DVec3, start: Time) -> RoundPath {
        let after_s = self.after_s(time_s, start);
        self.path.push(after_s, FlightState { position: at, ..self.round.state_at(time_s) });
        std::mem::replace(&mut self.path, RoundPath { shot: 0, fired_ns: 0, points: Vec::new() })
    }

    /// The round as it goes on where it meets the water so flatly that it bounces.
    ///
    /// It keeps .9 to .5 of its speed, less the steeper it came, and leaves at its angle to half as much more (Haag, Shooting Incident
    /// Reconstruction, on water); tumbling, with twice the drag, a little aside. Below the critical angle it always does: that is what the
    /// angle means in the sources.
    fn ricochet(&self, ammunition: &Ammunition, sea: &WaveField, at: DVec3, time_s: f64) -> Option<Round> {
        const BOUNCES_MAX: u32 = 5;
        const SLOWEST_M_S: f64 = 60.0;
        let critical = ammunition.weapon.ricochet_below_deg.to_radians();
        if critical <= 0.0 || self.bounces >= BOUNCES_MAX {
            return None;
        }
        let velocity = self.round.state_at(time_s).velocity;
        let (speed, slope) = (velocity.length(), sea.slope(at.truncate(), time_s));
        let up = DVec3::new(-slope.x, -slope.y, 1.0).normalize();
        let angle = (-velocity.dot(up) / speed.max(1e-9)).asin();
        if !(0.0..critical).contains(&angle) {
            return None;
        }
        let chance = |what: u64| {
            drawn(ammunition.seed, [self.launch.shot, BOUNCE | u64::from(self.bounces) << 8 | what])
        };
        let along = (velocity + up * speed * angle.sin()).try_normalize()?;
        let aside = 0.1 * (chance(0) - 0.5);
        let leaves = angle.max(0.01) * (1.0 + 0.5 * chance(1));
        let across = along.cross(up);
        let direction = (along + across * aside) * leaves.cos() + up * leaves.sin();
        let kept = speed * (0.9 - 0.4 * angle / critical);
        let round = &ammunition.weapon.projectile;
        let coefficient = 0.5 * round.ballistic_coefficient_lb_in2();
        let projectile =
            Projectile::with_drag(*round.drag(), coefficient, kept).filter(|_| kept > SLOWEST_M_S)?;
        // A little over the water, which it would meet again at once.
        let flight = Flight::new(projectile, &Atmosphere::ICAO, at + up * 0.01, direction, ammunition.wind)?;
        Some(self.round.bounced(flight, time_s))
    }

    /// Boats whose crews its fragments strike where it ends.
    fn fragments(&self, ammunition: &Ammunition, end: &End, boats: &[Moving<'_>]) -> Vec<FragmentStrike> {
        let (End::Struck { at, time_s, .. } | End::Splashed { at, time_s }) = *end else { return Vec::new() };
        let muzzle = self.launch.muzzle;
        let burst = ammunition.weapon.burst.filter(|burst| burst.is_armed(muzzle, at));
        burst.map_or_else(Vec::new, |burst| {
            burst.strikes(ammunition.seed, self.launch.shot, (at, time_s), muzzle, boats)
        })
    }

    /// Height of the splash that the round throws up: the steeper it comes, the higher.
    fn splash_m(&self, ammunition: &Ammunition, time_s: f64) -> f64 {
        let velocity = self.round.state_at(time_s).velocity;
        let steep = (-velocity.z / velocity.length().max(1e-9)).max(0.0);
        ammunition.weapon.splash_height_m * (0.85 + 0.5 * steep)
    }

    /// Why the round missed the boat that it came closest to.
    fn explain(
        &self,
        ammunition: &Ammunition,
        nearest: Approach,
        start: Time,
        fleet: &Fleet,
    ) -> Option<ExplainedMiss> {
        let Launch { shot, fired, muzzle, bore, .. } = self.launch;
        let boat = nearest.boat;
        let target = |s: f64| fleet.middle(boat, fired.plus_secs(s)).unwrap_or(DVec3::NAN);
        let (projectile, wind) = (ammunition.weapon.projectile, ammunition.wind);
        let round = MissedRound { projectile, wind, muzzle, bore, flown: self.flown, before: &self.before };
        let why = MissExplanation::of(&round, target)?;
        Some(ExplainedMiss { shot, time: start.plus_secs(nearest.time_s), boat, why })
    }
}

/// A round that has ended.
#[derive(Debug)]
struct EndedRound {
    launch: Launch,
    nearest: Option<Approach>,
    end: End,
    splash_m: f64,
    /// Further boats that its fragments struck.
    fragments: Vec<FragmentStrike>,
    /// It burst beside the boat that it struck.
    beside: bool,
}

/// The end of a round that burst in the water beside a boat and struck its crew: it has struck the nearest of those.
fn burst_beside(end: End, fragments: &mut Vec<FragmentStrike>, muzzle: DVec3) -> End {
    let End::Splashed { at, time_s } = end else { return end };
    if fragments.is_empty() {
        return end;
    }
    let FragmentStrike { boat, point, .. } = fragments.remove(0);
    End::Struck { boat, zone: Zone::Helm, time_s, range_m: at.distance(muzzle), point, at }
}

/// Where a round ended.
#[derive(Clone, Copy, Debug)]
enum ImpactMark {
    Splash {
        at: DVec3,
        height_m: f64,
    },
    /// In the boat's own space: it moves with the boat.
    Strike {
        boat: usize,
        point: DVec3,
    },
}

/// All rounds of a session.
#[derive(Clone, Debug)]
pub struct Rounds {
    ammunition: Ammunition,
    sea: WaveField,
    in_flight: Vec<InFlight>,
    marks: Vec<(Time, ImpactMark)>,
    explained: Vec<ExplainedMiss>,
    fragments: Vec<FragmentHit>,
    paths: Vec<RoundPath>,
    advanced_to: Time,
}

impl Rounds {
    /// No round has been fired at `start`.
    pub fn new(ammunition: Ammunition, sea: WaveField, start: Time) -> Self {
        Self {
            ammunition,
            sea,
            in_flight: Vec::new(),
            marks: Vec::new(),
            explained: Vec::new(),
            fragments: Vec::new(),
            paths: Vec::new(),
            advanced_to: start,
        }
    }

    /// The sea is another from now on.
    pub fn set_sea(&mut self, sea: WaveField) {
        self.sea = sea;
    }

    /// Fires a round; `before` has the barrel before that, oldest first. One whose flight cannot be computed (a number is not finite) is
    /// recorded as a miss at once.
    pub fn launch(
        &mut self,
        launch: Launch,
        before: Vec<BoreSample>,
        start: Time,
        records: &mut Vec<ShotRecord>,
    ) {
        let a = &self.ammunition;
        let flown = dispersed(launch.bore, launch.scatter * a.weapon.dispersion_mrad, a.seed, launch.shot);
        match Flight::new(a.weapon.projectile, &Atmosphere::ICAO, launch.muzzle, flown, a.wind) {
            Some(flight) => {
                let tracer = a.weapon.is_tracer(launch.shot);
                let path = RoundPath::begin(launch.shot, launch.fired, flight.state());
                let round = Round::new(launch.shot, launch.fired.secs_since(start), flight);
                self.in_flight.push(InFlight { launch, flown, before, round, path, tracer, bounces: 0 });
            }
            None => records.push(launch.record(Outcome::Miss {
                boat: None,
                miss_m: f64::INFINITY,
                time: launch.fired,
                range_m: 0.0,
            })),
        }
    }

    /// Follows all boats and rounds until `until`. Boats that are struck are told; ended rounds are recorded in the order in which they
    /// were fired.
    pub fn advance(&mut self, until: Time, start: Time, fleet: &mut Fleet, records: &mut Vec<ShotRecord>) {
        while self.advanced_to < until {
            let to = self.advanced_to.plus_secs(SPAN_S).min(until);
            fleet.follow(to);
            if !self.in_flight.is_empty() {
                self.advance_span(self.advanced_to, to, start, fleet, records);
            }
            self.advanced_to = to;
        }
        let life_s = self.ammunition.weapon.splash_life_s;
        self.marks.retain(|(since, mark)| {
            let kept_s = if matches!(mark, ImpactMark::Splash { .. }) { life_s } else { STRIKE_KEPT_S };
            until.secs_since(*since) < kept_s
        });
    }

    fn advance_span(
        &mut self,
        from: Time,
        to: Time,
        start: Time,
        fleet: &mut Fleet,
        records: &mut Vec<ShotRecord>,
    ) {
        let (from_s, to_s) = (from.secs_since(start), to.secs_since(start));
        let mut struck: Vec<(usize, RoundStrike, Time)> = Vec::new();
        let ended = {
            let boats: Vec<Moving<'_>> = (0..fleet.len())
                .filter_map(|boat| {
                    let (a, b) = (fleet.pose(boat, from)?, fleet.pose(boat, to)?);
                    Some(Moving { model: fleet.model(boat)?, from_s, from: a, to_s, to: b })
                })
                .collect();
            let mut ended = Vec::new();
            let Self { in_flight, sea, explained, ammunition, marks, paths, .. } = self;
            in_flight.retain_mut(|f| match f.round.advance(to_s, &boats, sea) {
                Some(End::Splashed { at, time_s })
                    if let Some(next) = f.ricochet(ammunition, sea, at, time_s) =>
                {
                    let height_m = GRAZED * f.splash_m(ammunition, time_s);
                    marks.push((start.plus_secs(time_s), ImpactMark::Splash { at, height_m }));
                    let after_s = f.after_s(time_s, start);
                    f.path.push(after_s, FlightState { position: at, ..f.round.state_at(time_s) });
                    f.round = next;
                    f.path.push(after_s, f.round.state_at(time_s));
                    f.bounces += 1;
                    true
                }
                Some(end) => {
                    let nearest = f.round.nearest();
                    let mut fragments = f.fragments(ammunition, &end, &boats);
                    let struck = matches!(end, End::Struck { .. });
                    let end = burst_beside(end, &mut fragments, f.launch.muzzle);
                    let beside = !struck && matches!(end, End::Struck { .. });
                    if let (Some(nearest), false) = (nearest, struck || beside) {
                        explained.extend(f.explain(ammunition, nearest, start, fleet));
                    }
                    let (time_s, at) = match end {
                        End::Splashed { time_s, at } | End::Struck { time_s, at, .. } => (time_s, at),
                        End::Spent { time_s } => (time_s, f.round.state_at(time_s).position),
                    };
                    paths.push(f.ended_path(time_s, at, start));
                    let splash_m = match end {
                        End::Splashed { time_s, .. } | End::Struck { time_s, .. } => {
                            f.splash_m(ammunition, time_s)
                        }
                        End::Spent { .. } => 0.0,
                    };
                    ended.push(EndedRound { launch: f.launch, nearest, end, splash_m, fragments, beside });
                    false
                }
                None => {
                    let (after_s, state) = (f.after_s(to_s, start), f.round.state_at(to_s));
                    f.path.follow(after_s, state);
                    true
                }
            });
            ended
        };
        for EndedRound { launch, nearest, end, splash_m: height_m, fragments, beside } in ended {
            let time_of = |s: f64| start.plus_secs(s);
            let miss = |time: Time, at: DVec3| match nearest {
                Some(n) => Outcome::Miss {
                    boat: Some(fleet.name(n.boat).to_owned()),
                    miss_m: n.distance_m,
                    time: time_of(n.time_s),
                    range_m: n.range_m,
                },
                None => Outcome::Miss {
                    boat: None,
                    miss_m: f64::INFINITY,
                    time,
                    range_m: at.distance(launch.muzzle),
                },
            };
            let outcome = match end {
                End::Struck { boat, zone, time_s, range_m, point, at } => {
                    let time = time_of(time_s);
                    let (strike, mark) = if beside {
                        (zone.into(), ImpactMark::Splash { at, height_m })
                    } else {
                        let strike = self.ammunition.strike(launch.shot, zone, point);
                        (strike, ImpactMark::Strike { boat, point })
                    };
                    struck.push((boat, strike, time));
                    self.marks.push((time, mark));
                    for also in fragments {
                        struck.push((also.boat, Zone::Helm.into(), time));
                        if also.boat != boat {
                            self.fragments.push(FragmentHit { shot: launch.shot, time, boat: also.boat });
                        }
                    }
                    let (name, side) = (fleet.name(boat).to_owned(), fleet.side(boat));
                    Outcome::Hit { boat: name, side, zone, time, range_m, point }
                }
                End::Splashed { at, time_s } => {
                    self.marks.push((time_of(time_s), ImpactMark::Splash { at, height_m }));
                    miss(time_of(time_s), at)
                }
                End::Spent { time_s } => miss(time_of(time_s), launch.muzzle),
            };
            records.push(launch.record(outcome));
        }
        for (boat, strike, time) in struck {
            fleet.strike(boat, &strike, time);
        }
    }

    /// Boats that fragments have struck since this was last asked, beside those that records name.
    pub fn take_fragments(&mut self) -> std::vec::Drain<'_, FragmentHit> {
        self.fragments.drain(..)
    }

    /// Paths of rounds that have ended since this was last asked.
    pub fn take_paths(&mut self) -> std::vec::Drain<'_, RoundPath> {
        self.paths.drain(..)
    }

    /// Misses that were explained since this was last asked.
    pub fn take_explained(&mut self) -> std::vec::Drain<'_, ExplainedMiss> {
        self.explained.drain(..)
    }

    /// The tracers that glow at `time`, up to which rounds have been followed, each with its path over the last `exposure_s`.
    pub fn tracers(&self, time: Time, start: Time, exposure_s: f64) -> impl Iterator<Item = TracerPath> {
        let now_s = time.secs_since(start);
        let burnout_m = self.ammunition.weapon.tracer_burnout_m;
        self.in_flight.iter().filter(|f| f.tracer).filter_map(move |f| {
            let at = |time_s: f64| f.round.state_at(time_s).position;
            let path = TracerPath { from: at(now_s - exposure_s), to: at(now_s) };
            let far_m = path.to.distance(f.launch.muzzle);
            (TRACER_LIT_M..burnout_m).contains(&far_m).then_some(path)
        })
    }

    /// Where rounds have ended in the last seconds before `time`.
    pub fn impacts(&self, time: Time, fleet: &Fleet) -> impl Iterator<Item = Impact> {
        self.marks.iter().filter_map(move |(since, mark)| {
            let age_s = time.secs_since(*since);
            let (at, kind) = match *mark {
                ImpactMark::Splash { at, height_m } => {
                    (at, ImpactKind::Splash { height_m, life_s: self.ammunition.weapon.splash_life_s })
                }
                ImpactMark::Strike { boat, point } => {
                    (fleet.pose(boat, time)?.to_world(point), ImpactKind::Strike)
                }
            };
            (age_s >= 0.0).then_some(Impact { at, kind, age_s })
        })
    }
}

/// The path of a tracer over a picture's exposure, world, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TracerPath {
    /// Where it was as the exposure began.
    pub from: DVec3,
    /// Where it is.
    pub to: DVec3,
}

/// Where a round ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Impact {
    /// The place now, world, metres: on a boat it moves with the boat.
    pub at: DVec3,
    /// What it struck.
    pub kind: ImpactKind,
    /// Seconds since then.
    pub age_s: f64,
}

/// What a round has struck.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ImpactKind {
    /// A boat.
    Strike,
    /// The sea.
    Splash {
        /// Height of the splash at its highest, metres.
        height_m: f64,
        /// How long it stands, seconds.
        life_s: f64,
    },
}

#[cfg(test)]
#[path = "rounds_tests.rs"]
mod tests;
