//! The simulated gun without a clock: the same script gives the same events.

use std::collections::VecDeque;

use bowwave_core::{event::Event, geometry::CameraPose, time::Time};
use bowwave_devices::imu::{ImuDecoder, ImuFormat};

use super::{LiveStats, TruePoses, bench::Bench, sensor::Sensor};
use crate::replay::ReplayError;

/// A simulated gun in process.
pub(super) struct FastLive {
    bench: Bench,
    sensor: Sensor,
    decoder: ImuDecoder,
    packet: Vec<u8>,
    /// Events that have not been asked for, by arrival.
    waiting: VecDeque<Event>,
    truth: TruePoses,
    stats: LiveStats,
}

impl FastLive {
    pub fn new(bench: Bench, sensor: Sensor) -> Self {
        Self {
            bench,
            sensor,
            // What is simulated is known: no sample waits for a proof of its format.
            decoder: ImuDecoder::fixed(ImuFormat::VectorNav),
            packet: Vec::new(),
            waiting: VecDeque::new(),
            truth: TruePoses::default(),
            stats: LiveStats::default(),
        }
    }

    /// Appends the events that arrive up to and with `until`.
    pub fn collect(&mut self, until: Time, out: &mut Vec<Event>) -> Result<(), ReplayError> {
        while self.bench.next_sample() <= until {
            self.sample();
            while self.bench.gun.time_s() >= self.bench.exposure_end_s(&self.bench.next_frame()) {
                self.frame()?;
            }
        }
        let ready = self.waiting.partition_point(|event| event.arrival() <= until);
        out.extend(self.waiting.drain(..ready));
        Ok(())
    }

    pub fn truth_at(&self, stamp: Time) -> Option<(CameraPose, f64)> {
        self.truth.at(stamp)
    }

    pub fn stats(&self) -> LiveStats {
        LiveStats { imu: self.decoder.counters(), ..self.stats }
    }

    fn sample(&mut self) {
        let mut events = Vec::new();
        let arrival = self.bench.sample(&mut self.packet, &mut events);
        events.extend(self.decoder.samples(&self.packet, arrival).map(Event::Imu));
        events.into_iter().for_each(|event| self.wait(event));
    }

    fn frame(&mut self) -> Result<(), ReplayError> {
        let frame = self.bench.next_frame();
        let recoil = self.bench.recoil(frame.exposed_s);
        self.truth.push(frame.stamp, self.bench.pose(frame.exposed_s), recoil);
        let arrival = self.bench.frame_taken();
        let (bench, rows) = (&self.bench, self.sensor.rows_s());
        let turned = rows.map(|row_s| bench.pose(frame.exposed_s + row_s).world_from_camera);
        let picture = self.sensor.expose(&frame, turned, recoil, arrival)?;
        self.stats.frames += 1;
        self.wait(Event::Frame(picture));
        Ok(())
    }

    fn wait(&mut self, event: Event) {
        let at = self.waiting.partition_point(|other| other.arrival() <= event.arrival());
        self.waiting.insert(at, event);
    }
}
