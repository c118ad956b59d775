//! The inertial unit's line: packets, whether they can be so, and how evenly they come.

use std::path::Path;

use bowwave_core::{
    estimate::plausibility::{Implausible, Plausibility},
    event::Event,
    fault::{Fault, FaultChange},
    time::Time,
};

use super::{
    ArrivalTiming, ImuSettings,
    feed::{IMU, LineFeed, LineKind},
    timing::Arrivals,
};
use crate::{
    imu::{Fields, ImuCounters, ImuDecoder, ImuEvent, ImuFormat},
    queue::NewestSender,
    report::Reporter,
};

/// Report of the inertial unit beside its samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ImuReport {
    /// The format, once it is known.
    pub format: Option<ImuFormat>,
    /// The fields that the unit sends.
    pub fields: Fields,
    /// How evenly samples arrive.
    pub timing: ArrivalTiming,
    /// Counts of the decoder.
    pub counters: ImuCounters,
    /// Samples that the unit's own clock shows to be missing.
    pub lost_samples: u64,
}

/// An inertial unit on a line.
#[derive(Debug)]
pub(super) struct ImuFeed {
    decoder: ImuDecoder,
    plausibility: Plausibility,
    implausible: bool,
    arrivals: Arrivals,
    late: bool,
}

impl ImuFeed {
    pub(super) fn new(settings: &ImuSettings) -> Self {
        Self {
            decoder: ImuDecoder::with(settings.format),
            plausibility: Plausibility::default(),
            implausible: false,
            arrivals: Arrivals::late_above(settings.late),
            late: false,
        }
    }
}

impl LineFeed for ImuFeed {
    type Report = ImuReport;

    const KIND: &'static LineKind = &IMU;

    fn take(&mut self, bytes: &[u8], arrival: Time, queue: &mut NewestSender<Event>) -> u64 {
        let before = self.decoder.counters();
        let Self { decoder, plausibility, arrivals, .. } = self;
        let mut bytes = bytes;
        while let Some(event) = decoder.next_event(&mut bytes, arrival) {
            match event {
                ImuEvent::Recognised(format) => log::info!("the inertial unit speaks {format}"),
                ImuEvent::Sample(sample) => {
                    plausibility.sample(&sample);
                    arrivals.sample(&sample);
                    queue.send(Event::Imu(sample));
                }
            }
        }
        let after = self.decoder.counters();
        if after.not_finite > before.not_finite {
            self.plausibility.bad(arrival, Implausible::NotFinite);
        } else if after.unusable > before.unusable && after.samples == before.samples {
            self.plausibility.bad(arrival, Implausible::Unusable);
        }
        after.packets - before.packets
    }

    fn restart(&mut self) {
        self.decoder.restart();
    }

    fn forget(&mut self) {
        self.plausibility.forget();
        self.arrivals.forget();
    }

    fn judge(&mut self, path: &Path, now: Time, reporter: &Reporter) {
        let verdict = self.plausibility.verdict(now);
        if let Some(implausible) = verdict
            && !self.implausible
        {
            let cause = format!("the inertial unit on {}: {implausible}", path.display());
            reporter.send(FaultChange::raised(now, Fault::ImuSanity, cause));
        } else if verdict.is_none() && self.implausible {
            reporter.send(FaultChange::cleared(now, Fault::ImuSanity));
        }
        self.implausible = verdict.is_some();
        let late = self.arrivals.look(now);
        let timing = self.arrivals.timing();
        reporter.follow(now, Fault::ImuLatency, &mut self.late, late, || {
            format!(
                "packets of {:.1} ms come up to {:.1} ms apart (99 %) on {}: set the adapter's latency timer to 1 ms",
                timing.period_ms,
                timing.gap_p99_ms,
                path.display()
            )
        });
    }

    fn report(&self) -> ImuReport {
        ImuReport {
            format: self.decoder.format(),
            fields: self.decoder.fields(),
            timing: self.arrivals.timing(),
            counters: self.decoder.counters(),
            lost_samples: self.arrivals.lost(),
        }
    }
}
