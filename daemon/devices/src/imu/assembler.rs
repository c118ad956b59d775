//! From readings to samples: what a unit does not send is made here where it can be, in the same way for all formats.

use std::collections::VecDeque;

use bowwave_core::{event::ImuSample, geometry::rotation_vector, time::Time};
use glam::{DQuat, DVec3};

use super::{
    packet_clock::PacketClock,
    reading::{Fields, Reading, ReadingStamp},
};

/// Rates kept to carry an attitude forward.
const RATES: usize = 64;
/// An attitude of its own packet is carried for so long, nanoseconds: units send it ten times a second at least.
const CARRY_NS: i64 = 250_000_000;
/// Attitudes so far apart give a rate, nanoseconds: nearer ones only noise, farther ones a mean that says nothing.
const RATE_NS: std::ops::RangeInclusive<i64> = 500_000..=250_000_000;

/// Outcome of a packet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Assembled {
    /// It completed a sample.
    Sample(ImuSample),
    /// It is part of one, or about something else.
    Other,
    /// It cannot become one, nor can those before it: the unit's output lacks something.
    Unusable,
}

/// Makes samples of a unit's readings.
#[derive(Debug)]
pub(crate) struct SampleAssembler {
    clock: PacketClock,
    count: Option<i64>,
    fields: Fields,
    /// The newest attitude and its time.
    attitude: Option<(i64, DQuat)>,
    /// The newest rates and their times, oldest first.
    rates: VecDeque<(i64, DVec3)>,
    last_ns: Option<i64>,
    patience: u32,
    without_sample: u32,
}

impl SampleAssembler {
    /// For a unit that has sent nothing. `period_ns`: of a unit without a clock, where the format fixes it. `patience`: so
    /// many packets may come that complete no sample; with more the unit's output must lack something.
    pub(crate) fn new(period_ns: Option<u32>, patience: u32) -> Self {
        Self {
            patience,
            clock: PacketClock::new(period_ns),
            count: None,
            fields: Fields::default(),
            attitude: None,
            rates: VecDeque::new(),
            last_ns: None,
            without_sample: 0,
        }
    }

    /// The fields that the unit has sent so far.
    pub(crate) const fn fields(&self) -> Fields {
        self.fields
    }

    /// Takes in what a packet that arrived at `arrival` says; `None`: nothing that is used.
    pub(crate) fn take(&mut self, reading: Option<Reading>, arrival: Time) -> Assembled {
        match reading.and_then(|r| self.sample(&r, arrival)) {
            Some(sample) => {
                self.without_sample = 0;
                Assembled::Sample(sample)
            }
            None => {
                self.without_sample = self.without_sample.saturating_add(1);
                if self.without_sample > self.patience { Assembled::Unusable } else { Assembled::Other }
            }
        }
    }

    fn sample(&mut self, reading: &Reading, arrival: Time) -> Option<ImuSample> {
        self.fields.note(reading);
        let whole = reading.accel.is_some() && (reading.rate.is_some() || reading.world_from_imu.is_some());
        if !whole {
            if let (Some(attitude), None, None) = (reading.world_from_imu, reading.rate, reading.accel) {
                let time_ns = match reading.stamp {
                    ReadingStamp::Device { ns } => Some(ns),
                    // It belongs to the sample before it.
                    ReadingStamp::Count { .. } | ReadingStamp::Arrival => self.last_ns,
                };
                if let Some(time_ns) = time_ns {
                    self.keep_attitude(time_ns, attitude);
                }
            }
            return None;
        }
        let device_time_ns = self.time(reading.stamp, arrival);
        if self.last_ns.is_some_and(|last| device_time_ns < last) {
            // The unit began anew: what was before is of another turn of its clock.
            self.attitude = None;
            self.rates.clear();
        }
        self.last_ns = Some(device_time_ns);
        let rate = match reading.rate {
            Some(rate) => rate,
            None => {
                let attitude = reading.world_from_imu?;
                let rate = self.rate_to(device_time_ns, attitude);
                self.keep_attitude(device_time_ns, attitude);
                rate?
            }
        };
        self.keep_rate(device_time_ns, rate);
        let world_from_imu = match reading.world_from_imu {
            Some(attitude) => {
                self.keep_attitude(device_time_ns, attitude);
                Some(attitude)
            }
            None => self.carried(device_time_ns),
        };
        Some(ImuSample { arrival, device_time_ns, rate, accel: reading.accel?, world_from_imu })
    }

    fn time(&mut self, stamp: ReadingStamp, arrival: Time) -> i64 {
        match stamp {
            ReadingStamp::Device { ns } => ns,
            ReadingStamp::Count { n } => {
                let ticks = self.count.replace(n).map_or(1, |last| n.saturating_sub(last));
                self.clock.tick(ticks, arrival)
            }
            ReadingStamp::Arrival => self.clock.tick(1, arrival),
        }
    }

    /// Mean rate from the attitude before to this one, in the body's axes: half a period older than the sample that has it.
    fn rate_to(&self, time_ns: i64, attitude: DQuat) -> Option<DVec3> {
        let (before_ns, before) = self.attitude?;
        let dt_ns = time_ns.saturating_sub(before_ns);
        if !RATE_NS.contains(&dt_ns) {
            return None;
        }
        Some(rotation_vector(before.inverse() * attitude) / (dt_ns as f64 * 1e-9))
    }

    fn keep_attitude(&mut self, time_ns: i64, attitude: DQuat) {
        if attitude.is_finite() && attitude.length() > 0.5 {
            self.attitude = Some((time_ns, attitude.normalize()));
        }
    }

    fn keep_rate(&mut self, time_ns: i64, rate: DVec3) {
        if !rate.is_finite() {
            return;
        }
        if self.rates.len() >= RATES {
            self.rates.pop_front();
        }
        self.rates.push_back((time_ns, rate));
    }

    /// The attitude that came in a packet of its own, turned to `time_ns` by the rates since (trapezoids: what the unit
    /// measured, one to a few periods ago). Units send it less often than rates, and behind them.
    fn carried(&self, time_ns: i64) -> Option<DQuat> {
        let (mut at_ns, mut attitude) = self.attitude?;
        if time_ns.saturating_sub(at_ns) > CARRY_NS {
            return None;
        }
        let mut before: Option<DVec3> = None;
        for &(rate_ns, rate) in &self.rates {
            if rate_ns > at_ns {
                let dt_s = rate_ns.saturating_sub(at_ns) as f64 * 1e-9;
                let mean = before.map_or(rate, |before| (before + rate) * 0.5);
                attitude *= DQuat::from_scaled_axis(mean * dt_s);
                at_ns = rate_ns;
            }
            before = Some(rate);
        }
        let attitude = attitude.normalize();
        attitude.is_finite().then_some(attitude)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    fn turned(t_s: f64) -> DQuat {
        DQuat::from_rotation_x(0.3) * DQuat::from_rotation_z(0.8 * (2.0 * t_s).sin())
    }

    /// The body's rate of [`turned`].
    fn rate(t_s: f64) -> DVec3 {
        DVec3::Z * 1.6 * (2.0 * t_s).cos()
    }

    fn at(ms: i64) -> ReadingStamp {
        ReadingStamp::Device { ns: ms * MS }
    }

    fn motion(ms: i64) -> Reading {
        Reading { rate: Some(rate(ms as f64 * 1e-3)), accel: Some(DVec3::NEG_Z), ..Reading::at(at(ms)) }
    }

    fn attitude(ms: i64) -> Reading {
        Reading { world_from_imu: Some(turned(ms as f64 * 1e-3)), ..Reading::at(at(ms)) }
    }

    /// Rates at 200 Hz and attitudes at 20 Hz that come 12 ms late: every sample has the attitude of its own time.
    #[test]
    fn an_attitude_of_its_own_packet_is_carried_to_the_samples() {
        let mut assembler = SampleAssembler::new(None, 16);
        let mut worst: f64 = 0.0;
        for ms in (0..20_000).step_by(5) {
            let outcome = assembler.take(Some(motion(ms)), Time::from_ns(ms * MS));
            let Assembled::Sample(sample) = outcome else { panic!("{outcome:?}") };
            if ms > 100 {
                let got = sample.world_from_imu.expect("carried");
                worst = worst.max(got.angle_between(turned(ms as f64 * 1e-3)));
            }
            if ms % 50 == 15 {
                assert_eq!(assembler.take(Some(attitude(ms - 12)), Time::from_ns(ms * MS)), Assembled::Other);
            }
        }
        assert!(worst < 2e-5, "{worst} rad");
        // The attitude stays away: nothing is carried for ever.
        let Assembled::Sample(sample) = assembler.take(Some(motion(20_300)), Time::MIN) else {
            panic!("a sample")
        };
        assert_eq!(sample.world_from_imu, None);
    }

    #[test]
    fn a_unit_without_a_gyro_has_the_rate_of_its_attitudes() {
        let mut assembler = SampleAssembler::new(None, 16);
        for ms in (0..3_000).step_by(10) {
            let mut reading = Reading { accel: Some(DVec3::NEG_Z), ..attitude(ms) };
            if ms % 30 == 0 {
                reading.world_from_imu = reading.world_from_imu.map(|q| -q);
            }
            match assembler.take(Some(reading), Time::from_ns(ms * MS)) {
                Assembled::Sample(sample) => {
                    let middle_s = (ms as f64 - 5.0) * 1e-3;
                    assert!(sample.rate.abs_diff_eq(rate(middle_s), 1e-3), "{} at {ms} ms", sample.rate);
                }
                other => assert_eq!((other, ms), (Assembled::Other, 0)),
            }
        }
        // A gap has no rate, and the next attitude has one again.
        let late = Reading { accel: Some(DVec3::NEG_Z), ..attitude(9_000) };
        assert_eq!(assembler.take(Some(late), Time::MIN), Assembled::Other);
        let next = Reading { accel: Some(DVec3::NEG_Z), ..attitude(9_010) };
        assert!(matches!(assembler.take(Some(next), Time::MIN), Assembled::Sample(_)));
    }

    #[test]
    fn a_unit_that_begins_anew_carries_nothing_over() {
        let mut assembler = SampleAssembler::new(None, 16);
        for ms in (60_000..60_200).step_by(5) {
            assembler.take(Some(motion(ms)), Time::from_ns(ms * MS));
            assembler.take(Some(attitude(ms)), Time::from_ns(ms * MS));
        }
        let Assembled::Sample(sample) = assembler.take(Some(motion(3)), Time::from_ns(61_000 * MS)) else {
            panic!("a sample")
        };
        assert_eq!((sample.device_time_ns, sample.world_from_imu), (3 * MS, None));
    }

    #[test]
    fn packets_that_never_become_a_sample_are_unusable() {
        let mut assembler = SampleAssembler::new(None, 16);
        let outcomes: Vec<_> =
            (0..100).map(|ms| assembler.take(Some(attitude(ms * 5)), Time::from_ns(ms))).collect();
        assert!(outcomes[..16].iter().all(|o| *o == Assembled::Other));
        assert!(outcomes[16..].iter().all(|o| *o == Assembled::Unusable));
        assert_eq!(assembler.fields().missing(), ["acceleration"]);
    }
}
