//! A gunner's hands on the gun: the crossover model of manual control with its delay, a limited rate, and a tremor.

use std::collections::VecDeque;

use glam::DVec2;
use rand_pcg::Pcg64;

use super::{eye::normal, skill::Skill};

/// Time over which the aim wanders about the point that is aimed at, seconds.
const WANDER_S: f64 = 0.3;

/// Direction of the gun, and the errors that its gunner has seen. Angles are azimuth (clockwise from north) and elevation, radians.
#[derive(Clone, Debug)]
pub(super) struct Hand {
    /// Direction without the wander.
    guided: DVec2,
    wander: DVec2,
    /// Errors and rates of the last moments, newest last.
    seen: VecDeque<(DVec2, DVec2)>,
}

impl Hand {
    pub const fn at(azimuth: f64, elevation: f64) -> Self {
        Self { guided: DVec2::new(azimuth, elevation), wander: DVec2::ZERO, seen: VecDeque::new() }
    }

    /// Direction of the gun.
    pub fn bore(&self) -> DVec2 {
        self.guided + self.wander
    }

    /// Angle that it is off what it is to point at, as its gunner sees it.
    pub fn off(&self, wanted: DVec2) -> f64 {
        difference(wanted, self.guided).length()
    }

    /// Moves for a step of `span_s`. `wanted` is to be pointed at and moves at `rate`; the aim wanders by `wander` (standard deviation).
    pub fn follow(
        &mut self,
        skill: &Skill,
        (wanted, rate): (DVec2, DVec2),
        wander: f64,
        span_s: f64,
        random: &mut Pcg64,
    ) {
        self.seen.push_back((difference(wanted, self.guided), rate));
        let delay = (skill.delay_s / span_s).round() as usize;
        while self.seen.len() > delay + 1 {
            self.seen.pop_front();
        }
        let (error, known_rate) = self.seen.front().copied().unwrap_or_default();
        let most = 30f64.to_radians() / skill.shift_s;
        let turned = (error * skill.crossover + known_rate).clamp_length_max(most);
        self.guided += turned * span_s;
        // Ornstein and Uhlenbeck 1930, with the step's exact share.
        let kept = (-span_s / WANDER_S).exp();
        let fresh = DVec2::new(normal(random), normal(random)) * wander * (1.0 - kept * kept).sqrt();
        self.wander = self.wander * kept + fresh;
    }
}

/// Turn from `b` to `a`, azimuth and elevation, by the shorter way.
pub(super) fn difference(a: DVec2, b: DVec2) -> DVec2 {
    let turn = std::f64::consts::TAU;
    let azimuth = (a.x - b.x + 0.5 * turn).rem_euclid(turn) - 0.5 * turn;
    DVec2::new(azimuth, a.y - b.y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hands_settle_on_a_target_that_stands_and_stay_on_one_that_moves_steadily() {
        for (_, skill) in Skill::NAMED {
            let mut random = Pcg64::new(1, 2);
            let mut hand = Hand::at(6.2, 0.0);
            let rate = DVec2::new(0.03, 0.0);
            for step in 0..300 {
                let wanted = DVec2::new(0.1, -0.01) + rate * (f64::from(step) / 30.0);
                hand.follow(&skill, (wanted, rate), 0.0, 1.0 / 30.0, &mut random);
            }
            let off = hand.off(DVec2::new(0.1, -0.01) + rate * 10.0);
            assert!(off < 2e-3, "{off}: {skill:?}");
        }
    }

    #[test]
    fn the_aim_wanders_as_far_as_said() {
        let (mut random, mut hand) = (Pcg64::new(3, 2), Hand::at(0.0, 0.0));
        let mut square = 0.0;
        for _ in 0..30_000 {
            hand.follow(&Skill::EXPERT, (DVec2::ZERO, DVec2::ZERO), 4e-3, 1.0 / 30.0, &mut random);
            square += hand.bore().x.powi(2) / 30_000.0;
        }
        assert!((square.sqrt() / 4e-3 - 1.0).abs() < 0.1, "{}", square.sqrt());
    }
}
