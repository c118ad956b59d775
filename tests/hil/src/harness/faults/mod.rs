//! The faults of the field, as a table: how each is injected, what must be seen, how soon.

mod camera;
mod computer;
mod guide;
mod registration;
mod replayed;
mod ship;
mod trigger;
mod unit;

use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use bowwave_hil::protocol::{AgentCommand, PlayerFeed};

use crate::{
    bench::{HilBench, JournalChange, PICTURE},
    lcd::Plate,
};

/// Indication that the LCD must show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LcdShown {
    /// Amber NOT SCORED with this cause; an empty one where it may be over before anybody can ask which.
    NotScored(&'static str),
    /// Red FAULT with this cause.
    Fault(&'static str),
    /// A warning with this cause, training goes on.
    Warning(&'static str),
    /// Nothing: training goes on as if nothing were.
    Nothing,
}

/// A row that is injected, seen, ended and recovered from.
pub struct FaultCase {
    /// Number in the list of faults, and a letter where there are several.
    pub number: &'static str,
    /// The fault.
    pub fault: &'static str,
    /// How it is injected.
    pub injected: &'static str,
    /// Code that the journal must carry.
    pub code: &'static str,
    /// Indication that the LCD must show.
    pub shown: LcdShown,
    /// Within so many seconds on a gun computer it must be seen.
    pub seen_s: Option<f64>,
    /// Within so many seconds after the cause is gone it must be over.
    pub back_s: Option<f64>,
    /// Whether it lasts (raised and cleared) or only happens (noted).
    pub lasts: bool,
    /// For so long the cause stays after it was seen, seconds.
    pub stays_s: f64,
    /// Brings the cause about; the machine's time of that.
    pub inject: fn(&mut HilBench) -> Result<i64>,
    /// Takes the cause away; the machine's time of that. 0 where it goes by itself: then times count from its coming.
    pub end: fn(&mut HilBench) -> Result<i64>,
}

impl FaultCase {
    /// A fault that lasts, has no target in seconds, stays for half a second after it was seen and goes by itself.
    const USUAL: Self = Self {
        number: "",
        fault: "",
        injected: "",
        code: "-",
        shown: LcdShown::Nothing,
        seen_s: None,
        back_s: None,
        lasts: true,
        stays_s: 0.5,
        inject: |bench| Ok(bench.machine.guest.now_ns()),
        end: |_| Ok(0),
    };
}

/// A row of another kind.
pub struct SpecialCase {
    /// As for [`FaultCase`].
    pub number: &'static str,
    /// The fault.
    pub fault: &'static str,
    /// How it is injected.
    pub injected: &'static str,
    /// Code that the journal must carry; "-" for none.
    pub code: &'static str,
    /// The target, in words.
    pub target: &'static str,
    /// Does all of it.
    pub run: fn(&mut HilBench) -> Result<CaseResult>,
}

/// Result of a row of another kind.
#[derive(Clone, Debug, Default)]
pub struct CaseResult {
    /// Indication that was seen on the LCD.
    pub lcd: String,
    /// Seconds until it was seen.
    pub seen_s: Option<f64>,
    /// Seconds from the end of the cause to the end of the fault.
    pub back_s: Option<f64>,
    /// Within so many seconds on a gun computer the fault must be over, or seen where its end is not timed.
    pub within_s: Option<f64>,
    /// Whether all else was as it must be.
    pub met: bool,
    /// Whether that is so only for a machine as slow as this one.
    pub scaled: bool,
    /// Anything else to say.
    pub note: String,
}

impl CaseResult {
    /// All was as it must be.
    pub fn met(note: String) -> Self {
        Self { met: true, note, ..Self::default() }
    }
}

/// One of both.
pub enum FaultRow {
    /// The usual kind.
    Case(FaultCase),
    /// Another kind.
    Own(SpecialCase),
    /// It cannot be brought about: number, fault, why.
    Not(&'static str, &'static str, &'static str),
}

/// A line of the table.
#[derive(Clone, Debug)]
pub struct FaultLine {
    /// Number, fault, way of injection and the journal's code.
    pub row: [&'static str; 4],
    /// What became of it.
    pub seen: CaseResult,
    /// The target.
    pub target: String,
    /// Its verdict.
    pub verdict: FaultVerdict,
}

impl FaultLine {
    /// Its cells, in the order of both tables' columns.
    pub fn cells(&self) -> [String; 10] {
        let seconds = |value: Option<f64>| value.map_or_else(|| "-".into(), |v| format!("{v:.2}"));
        let ([number, fault, injected, code], seen) = (self.row.map(str::to_owned), &self.seen);
        [
            number,
            fault,
            injected,
            seen.lcd.clone(),
            code,
            seconds(seen.seen_s),
            seconds(seen.back_s),
            self.target.clone(),
            self.verdict.text().into(),
            seen.note.clone(),
        ]
    }
}

/// Verdict of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultVerdict {
    /// The target was met as it stands.
    Met,
    /// It was met, in the machine's terms.
    MetScaled,
    /// It was not.
    Missed,
    /// It was not tried, for the reason given.
    Not,
}

impl FaultVerdict {
    /// For the table.
    pub const fn text(self) -> &'static str {
        match self {
            Self::Met => "met",
            Self::MetScaled => "met, scaled",
            Self::Missed => "MISSED",
            Self::Not => "not injectable",
        }
    }
}

/// Every row, in the order in which they are tried.
pub fn rows() -> Vec<FaultRow> {
    let mut all = Vec::new();
    all.extend(trigger::first());
    all.extend(camera::rows());
    all.extend(unit::rows());
    all.extend(ship::rows());
    all.extend(guide::rows());
    all.extend(replayed::rows());
    all.extend(registration::rows());
    all.extend(trigger::rows());
    all.extend(computer::rows());
    all
}

impl FaultRow {
    /// Its number.
    pub const fn number(&self) -> &'static str {
        match self {
            Self::Case(c) => c.number,
            Self::Own(o) => o.number,
            Self::Not(number, ..) => number,
        }
    }

    /// Whether what it needs is used up by trying it: the clock is set then.
    pub fn only_once(&self) -> bool {
        self.number() == "26"
    }

    /// Tries it.
    pub fn run(&self, bench: &mut HilBench) -> FaultLine {
        match self {
            Self::Case(case) => case.line(bench),
            Self::Own(own) => own.line(bench),
            Self::Not(number, fault, why) => FaultLine {
                row: [number, fault, "-", "-"],
                seen: CaseResult { lcd: "-".into(), note: (*why).into(), ..CaseResult::default() },
                target: "-".into(),
                verdict: FaultVerdict::Not,
            },
        }
    }
}

impl SpecialCase {
    fn line(&self, bench: &mut HilBench) -> FaultLine {
        let mut seen = (self.run)(bench).unwrap_or_else(|e| {
            bench.keep_picture(&format!("row-{}-missed", self.number));
            CaseResult { note: format!("{e:#}"), ..CaseResult::default() }
        });
        if let Err(e) = bench.settle() {
            seen.note = format!("{}; afterwards: {e:#}", seen.note);
        }
        let within = |factor: f64| {
            seen.within_s.is_none_or(|t| seen.back_s.or(seen.seen_s).is_some_and(|v| v <= t * factor))
        };
        let verdict = match (seen.met, within(1.0) && !seen.scaled, within(bench.slow)) {
            (true, true, _) => FaultVerdict::Met,
            (true, _, true) => FaultVerdict::MetScaled,
            _ => FaultVerdict::Missed,
        };
        let row = [self.number, self.fault, self.injected, self.code];
        FaultLine { row, seen, target: self.target.into(), verdict }
    }
}

/// Beyond scaled targets nobody waits this much longer.
const EXTRA: Duration = Duration::from_secs(20);

impl FaultCase {
    fn line(&self, bench: &mut HilBench) -> FaultLine {
        let mut seen = CaseResult::default();
        let verdict = match self.try_it(bench, &mut seen) {
            Ok(()) => self.verdict(bench, &seen),
            Err(e) => {
                seen.note = format!("{e:#}");
                bench.keep_picture(&format!("row-{}-missed", self.number));
                FaultVerdict::Missed
            }
        };
        // Whatever became of it: the next row begins in peace.
        if let Err(e) = bench.settle() {
            seen.note = format!("{}; afterwards: {e:#}", seen.note);
        }
        let row = [self.number, self.fault, self.injected, self.code];
        FaultLine { row, seen, target: self.target(), verdict }
    }

    fn target(&self) -> String {
        let part = |what: &str, s: Option<f64>| s.map(|s| format!("{what} {s} s"));
        let all: Vec<String> =
            [part("seen", self.seen_s), part("back", self.back_s)].into_iter().flatten().collect();
        if all.is_empty() { "-".into() } else { all.join(", ") }
    }

    fn verdict(&self, bench: &HilBench, seen: &CaseResult) -> FaultVerdict {
        let within = |value: Option<f64>, target: Option<f64>, factor: f64| match (value, target) {
            (Some(v), Some(t)) => v <= t * factor,
            (None, Some(_)) => false,
            _ => true,
        };
        let all =
            |factor| within(seen.seen_s, self.seen_s, factor) && within(seen.back_s, self.back_s, factor);
        match (all(1.0), all(bench.slow)) {
            (true, _) => FaultVerdict::Met,
            (_, true) => FaultVerdict::MetScaled,
            _ => FaultVerdict::Missed,
        }
    }

    fn try_it(&self, bench: &mut HilBench, result: &mut CaseResult) -> Result<()> {
        bench.ready(bench.scaled(2.0) + EXTRA)?;
        let from = bench.machine.guest.now_ns();
        let caused = (self.inject)(bench)?;
        let at = bench.machine.guest.host_time(caused);
        let patience = bench.scaled(self.seen_s.unwrap_or(1.0)) + EXTRA;
        let came = bench.told(self.code, JournalChange::Came, from, patience)?;
        if let Some(seen) = bench.shown(self.shown, at, patience)? {
            result.seen_s = Some(seen.saturating_duration_since(at).as_secs_f64());
        }
        let cause = match self.shown {
            LcdShown::NotScored(cause) | LcdShown::Fault(cause) | LcdShown::Warning(cause) => cause,
            LcdShown::Nothing => "",
        };
        result.lcd = bench.says(cause)?;
        bench.keep_picture(&format!("row-{}", self.number));
        std::thread::sleep(Duration::from_secs_f64(self.stays_s));
        // It may be over with the first thing that is done to end it, or by itself.
        let ending = bench.machine.guest.now_ns();
        let (ended, over_from) = match (self.end)(bench)? {
            0 => (caused, came),
            ended => (ended, came.max(ending)),
        };
        if self.lasts {
            let patience = bench.scaled(self.back_s.unwrap_or(2.0)) + EXTRA;
            let went = bench.told(self.code, JournalChange::Went, over_from, patience)?;
            let over = bench.machine.guest.host_time(ended);
            let mut back = (went - ended) as f64 * 1e-9;
            if self.shown != LcdShown::Nothing {
                let lcd = bench.lcd(over, patience, "READY", |p, _| p == Plate::Ready)?;
                back = back.max(lcd.saturating_duration_since(over).as_secs_f64());
            }
            result.back_s = Some(back.max(0.0));
        }
        Ok(())
    }
}

/// Ends what the tape's player does to pictures and packets.
fn quiet(bench: &mut HilBench) -> Result<i64> {
    bench.feed(|f| *f = PlayerFeed { trigger: f.trigger, ..PlayerFeed::default() })
}

impl HilBench {
    /// Fires for `ms` while a cause stands, some time after it came: none of these rounds may be scored.
    fn shoot_blind(&mut self, after: Duration, ms: u64) -> Result<()> {
        std::thread::sleep(after);
        let from = self.shoot(ms)?;
        self.blind.push((from, self.machine.guest.now_ns()));
        Ok(())
    }

    /// Waits until the LCD gives `cause`; all that it says then, by the service's status line, which follows a frame later.
    pub fn says(&mut self, cause: &str) -> Result<String> {
        self.says_within(cause, self.scaled(0.2))
    }

    /// The same, with so much patience.
    pub fn says_within(&mut self, cause: &str, patience: Duration) -> Result<String> {
        let until = Instant::now() + patience;
        loop {
            let status = self.status()?;
            if status.contains(cause) {
                return Ok(status);
            }
            if Instant::now() > until {
                bail!("the LCD says \"{status}\", not {cause}");
            }
        }
    }

    /// Waits until the LCD itself shows it; nothing to wait for where it must go on as if nothing were.
    fn shown(&self, shown: LcdShown, since: Instant, patience: Duration) -> Result<Option<Instant>> {
        let seen = match shown {
            LcdShown::NotScored(_) => {
                self.lcd(since, patience, "NOT SCORED", |p, _| p == Plate::NotScored)?
            }
            LcdShown::Fault(_) => self.lcd(since, patience, "FAULT", |p, _| p == Plate::Fault)?,
            LcdShown::Warning(_) => {
                self.lcd(since, patience, "a warning", |p, w| w && p != Plate::NotScored)?
            }
            LcdShown::Nothing => return Ok(None),
        };
        Ok(Some(seen))
    }

    /// Takes all causes away and waits for READY.
    pub fn settle(&mut self) -> Result<()> {
        let trigger = self.feed.trigger;
        self.feed(|feed| *feed = PlayerFeed { trigger, ..PlayerFeed::default() })?;
        self.pull(0, false)?;
        self.pull(1, true)?;
        self.pull(2, false)?;
        for line in ["fail streamon 0", "fail control 0", "bandwidth 0"] {
            self.camera(line)?;
        }
        let state = self.machine.guest.call(AgentCommand::CameraState)?;
        if state["plugged"] == 0 || state["fourcc"] != "YUYV" || state["width"] != PICTURE.0 {
            if state["plugged"] != 0 {
                self.camera("unplug")?;
            }
            self.camera(&format!("modes {}", camera::modes()))?;
            self.camera("plug 0")?;
        }
        self.machine.unit.pass(crate::unit::Passage::Straight);
        self.machine.unit.set_baud(921_600);
        let state =
            self.machine.guest.run(&["/bin/systemctl", "show", "-P", "ActiveState", "bowwave.service"])?;
        if matches!(state.trim(), "inactive" | "failed") {
            self.service("start")?;
            return self.ready(self.scaled(15.0)).map(|_| ());
        }
        self.ready(self.scaled(3.0) + EXTRA).map(|_| ())
    }
}
