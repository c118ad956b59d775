//! The inertial unit's line: packets, whether they can be so, and how evenly they come.

use std::path::Path;

use bowwave_core::{
    estimate::clock::{ClockMap, ClockReport},
    event::Event,
    fault::{Fault, FaultChange},
    time::Time,
};

use super::{
    ArrivalTiming, ImuSettings,
    feed::{Feed, IMU, Kind},
    sanity::{Insane, Sanity},
    timing::Arrivals,
};
use crate::{
    imu::{Fields, ImuCounters, ImuDecoder, ImuEvent, ImuFormat},
    queue::NewestSender,
    report::Reporter,
};

/// How often the unit's clock is looked at.
const CLOCK_NS: i64 = 500_000_000;

/// What the unit tells beside its samples.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct ImuReport {
    pub(super) format: Option<ImuFormat>,
    pub(super) fields: Fields,
    pub(super) timing: ArrivalTiming,
    pub(super) counters: ImuCounters,
    pub(super) lost_samples: u64,
    pub(super) clock: Option<ClockReport>,
}

/// An inertial unit on a line.
pub(super) struct ImuFeed {
    decoder: ImuDecoder,
    sanity: Sanity,
    insane: bool,
    arrivals: Arrivals,
    late: bool,
    clock: ClockMap,
    reported: Option<ClockReport>,
    /// When that was.
    looked: Time,
}

impl ImuFeed {
    pub(super) fn new(settings: &ImuSettings) -> Self {
        Self {
            decoder: ImuDecoder::with(settings.format),
            sanity: Sanity::default(),
            insane: false,
            arrivals: Arrivals::late_above(settings.late),
            late: false,
            clock: ClockMap::new(),
            reported: None,
            looked: Time::MIN,
        }
    }
}

impl Feed for ImuFeed {
    type Status = ImuReport;

    const KIND: &'static Kind = &IMU;

    fn take(&mut self, bytes: &[u8], arrival: Time, queue: &mut NewestSender<Event>) -> u64 {
        let before = self.decoder.counters();
        let Self { decoder, sanity, arrivals, clock, .. } = self;
        let mut bytes = bytes;
        while let Some(event) = decoder.next_event(&mut bytes, arrival) {
            match event {
                ImuEvent::Recognised(format) => log::info!("the inertial unit speaks {format}"),
                ImuEvent::Sample(sample) => {
                    sanity.sample(&sample);
                    arrivals.sample(&sample);
                    clock.observe(sample.device_time_ns, sample.arrival);
                    queue.send(Event::Imu(sample));
                }
            }
        }
        let after = self.decoder.counters();
        if after.not_finite > before.not_finite {
            self.sanity.bad(arrival, Insane::NotFinite);
        } else if after.unusable > before.unusable && after.samples == before.samples {
            self.sanity.bad(arrival, Insane::Unusable);
        }
        after.packets - before.packets
    }

    fn restart(&mut self) {
        self.decoder.restart();
    }

    fn forget(&mut self) {
        self.sanity.forget();
        self.arrivals.forget();
        self.clock = ClockMap::new();
    }

    fn judge(&mut self, path: &Path, now: Time, reporter: &Reporter) {
        let verdict = self.sanity.verdict(now);
        if let Some(insane) = verdict
            && !self.insane
        {
            let cause = format!("the inertial unit on {}: {insane}", path.display());
            reporter.send(FaultChange::raised(now, Fault::ImuSanity, cause));
        } else if verdict.is_none() && self.insane {
            reporter.send(FaultChange::cleared(now, Fault::ImuSanity));
        }
        self.insane = verdict.is_some();
        let late = self.arrivals.look(now);
        if late && !self.late {
            let timing = self.arrivals.timing();
            let cause = format!(
                "packets of {:.1} ms come up to {:.1} ms apart (99 %) on {}: set the adapter's latency timer to 1 ms",
                timing.period_ms,
                timing.gap_p99_ms,
                path.display()
            );
            reporter.send(FaultChange::raised(now, Fault::ImuLatency, cause));
        } else if self.late && !late {
            reporter.send(FaultChange::cleared(now, Fault::ImuLatency));
        }
        self.late = late;
        if now.ns_since(self.looked) >= CLOCK_NS {
            self.looked = now;
            self.reported = self.clock.report();
        }
    }

    fn status(&self) -> ImuReport {
        ImuReport {
            format: self.decoder.format(),
            fields: self.decoder.fields(),
            timing: self.arrivals.timing(),
            counters: self.decoder.counters(),
            lost_samples: self.arrivals.lost(),
            clock: self.reported,
        }
    }
}
