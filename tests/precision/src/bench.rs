//! Times the ways of a scene in turns and by their own time on the processor, so that a busy machine is busy for all of them.

use std::hint::black_box;

use rustix::time::{ClockId, clock_gettime};

use crate::{
    HEAP,
    row::{ReportRow, RowKind, Timing},
};

/// One way of doing a thing with one setting, and how wrong it is.
pub struct Way<'a> {
    method: String,
    setting: String,
    error: f64,
    default: bool,
    excuse: String,
    held_bytes: usize,
    note: String,
    uses: f64,
    work: WayCall<'a>,
}

/// One call of a way: the nanoseconds that it took elsewhere.
type WayCall<'a> = Box<dyn FnMut() -> f64 + 'a>;

impl<'a> Way<'a> {
    /// A way that errs by `error`. One call of `work` is `uses` uses of it: what it returns is kept from being optimised away.
    /// Its time is the processor time of this thread.
    pub fn new<T>(
        method: &str,
        setting: &str,
        error: f64,
        uses: usize,
        mut work: impl FnMut() -> T + 'a,
    ) -> Self {
        let timed = move || {
            black_box(work());
            0.0
        };
        Self::telling(method, setting, error, uses, timed)
    }

    /// A way that works elsewhere too, on a GPU or other threads: each call tells the nanoseconds that it took there.
    pub fn telling(
        method: &str,
        setting: &str,
        error: f64,
        uses: usize,
        work: impl FnMut() -> f64 + 'a,
    ) -> Self {
        Self {
            method: method.into(),
            setting: setting.into(),
            error,
            default: false,
            excuse: String::new(),
            held_bytes: 0,
            note: String::new(),
            uses: uses.max(1) as f64,
            work: Box::new(work),
        }
    }

    /// Marks what the product uses.
    pub fn default_if(mut self, default: bool) -> Self {
        self.default = default;
        self
    }

    /// Marks what the product uses though something beats it in this scene, and says why.
    pub fn default_although(mut self, excuse: &str) -> Self {
        self.default = true;
        self.excuse = excuse.into();
        self
    }

    /// Bytes of state and tables that it holds between uses.
    pub fn holds(mut self, bytes: usize) -> Self {
        self.held_bytes = bytes;
        self
    }

    /// Anything else to say.
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }
}

/// A method under test: its name, its setting, whether the product uses it, and its code.
#[derive(Clone, Copy, Debug)]
pub struct PartMethod<F> {
    /// The method.
    pub method: &'static str,
    /// Its setting.
    pub setting: &'static str,
    /// Whether the product uses it.
    pub default: bool,
    /// Its code.
    pub run: F,
}

impl<F> PartMethod<F> {
    /// A method that the product does not use.
    pub const fn rival(method: &'static str, setting: &'static str, run: F) -> Self {
        Self { method, setting, default: false, run }
    }

    /// The method that the product uses.
    pub const fn product(method: &'static str, setting: &'static str, run: F) -> Self {
        Self { method, setting, default: true, run }
    }

    /// The method in a ranked scene; see [`Way::new`].
    pub fn way<'a, T>(&self, error: f64, uses: usize, work: impl FnMut() -> T + 'a) -> Way<'a> {
        Way::new(self.method, self.setting, error, uses, work).default_if(self.default)
    }

    /// The method in an extreme case.
    pub fn tried(&self, error: f64) -> ExtremeResult {
        ExtremeResult { default: self.default, ..ExtremeResult::rival(self.method, self.setting, error) }
    }
}

/// How long to measure.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Turns of each scene.
    pub rounds: usize,
    /// Time of one way in one turn, nanoseconds.
    pub slice_ns: f64,
    /// Time of one scene, nanoseconds: scenes of slow ways get fewer turns, though not fewer than five.
    pub scene_ns: f64,
}

impl Effort {
    /// For `./check`.
    pub const QUICK: Self = Self { rounds: 21, slice_ns: 2e5, scene_ns: 1.5e9 };
    /// For the report.
    pub const FULL: Self = Self { rounds: 101, slice_ns: 1e6, scene_ns: 4e9 };
}

/// Takes in the scenes and extreme cases of one part after another.
#[derive(Debug)]
pub struct PartBench {
    effort: Effort,
    part: &'static str,
    rows: Vec<ReportRow>,
}

impl PartBench {
    /// Nothing measured yet.
    pub fn new(effort: Effort) -> Self {
        Self { effort, part: "", rows: Vec::new() }
    }

    /// Rows that follow belong to this part.
    pub fn begin(&mut self, part: &'static str) {
        self.part = part;
    }

    /// Whether this is the short form: parts may then leave out their dearest settings.
    pub fn is_quick(&self) -> bool {
        self.effort.rounds < Effort::FULL.rounds
    }

    /// Times the `ways` of one scene against each other. Errors below `truth_error`, what the truth itself is uncertain by,
    /// count as equal.
    pub fn scene(&mut self, scene: &str, unit: &'static str, truth_error: f64, mut ways: Vec<Way<'_>>) {
        let twin = ways.iter().position(|w| w.default).unwrap_or(0);
        let memory: Vec<usize> = ways.iter_mut().map(|w| w.held_bytes + heap_taken(&mut w.work)).collect();
        let mut samples = take_turns(&mut ways, twin, self.effort);
        let twin_samples = samples.pop().unwrap_or_default();
        let noise = samples.get(twin).map_or(1.0, |own| noise(own, &twin_samples));
        for ((way, samples), memory_bytes) in ways.into_iter().zip(samples).zip(memory) {
            let timing = Timing { samples, noise };
            self.push(scene, unit, truth_error, way, RowKind::Ranked(timing), memory_bytes);
        }
    }

    /// Lists a stiff or extreme case: each way that was tried, with its worst error. Nothing is timed.
    pub fn extreme(&mut self, case: &str, unit: &'static str, tried: Vec<ExtremeResult>) {
        for t in tried {
            let way = Way::new(&t.method, &t.setting, t.error, 1, || ()).default_if(t.default).note(t.note);
            self.push(case, unit, 0.0, way, RowKind::Extreme, 0);
        }
    }

    /// Everything measured, the front marked.
    pub fn finish(mut self) -> Vec<ReportRow> {
        crate::front::mark(&mut self.rows);
        self.rows
    }

    fn push(
        &mut self,
        scene: &str,
        unit: &'static str,
        truth_error: f64,
        way: Way<'_>,
        kind: RowKind,
        memory_bytes: usize,
    ) {
        let uses = way.uses;
        let kind = match kind {
            RowKind::Ranked(mut timing) => {
                timing.samples.iter_mut().for_each(|ns| *ns /= uses);
                RowKind::Ranked(timing)
            }
            RowKind::Extreme => RowKind::Extreme,
        };
        self.rows.push(ReportRow {
            part: self.part,
            scene: scene.into(),
            method: way.method,
            setting: way.setting,
            error: way.error,
            error_unit: unit,
            truth_error,
            kind,
            memory_bytes,
            default: way.default,
            excuse: way.excuse,
            note: way.note,
            on_front: false,
        });
    }
}

/// Result of one way in an extreme case.
#[derive(Clone, Debug)]
pub struct ExtremeResult {
    /// The method.
    pub method: String,
    /// Its setting.
    pub setting: String,
    /// Its worst error.
    pub error: f64,
    /// Whether the product uses it.
    pub default: bool,
    /// Anything else to say.
    pub note: String,
}

impl ExtremeResult {
    /// A rival's worst error.
    pub fn rival(method: &str, setting: &str, error: f64) -> Self {
        Self { method: method.into(), setting: setting.into(), error, default: false, note: String::new() }
    }

    /// The worst error of what the product uses.
    pub fn product(method: &str, setting: &str, error: f64) -> Self {
        Self { default: true, ..Self::rival(method, setting, error) }
    }

    /// Anything else to say.
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }
}

/// Most heap that one call has at a time beyond what was there before.
fn heap_taken(work: &mut WayCall<'_>) -> usize {
    HEAP.reset_peak_usage();
    let before = HEAP.current_usage();
    work();
    HEAP.peak_usage().saturating_sub(before)
}

/// Nanoseconds of one call of each way in each turn; the last list is that of the way `twin` once more.
fn take_turns(ways: &mut [Way<'_>], twin: usize, effort: Effort) -> Vec<Vec<f64>> {
    if ways.is_empty() {
        return Vec::new();
    }
    let slots: Vec<usize> = (0..ways.len()).chain([twin]).collect();
    let mut calls = Vec::new();
    let mut turn_ns = 0.0;
    for &slot in &slots {
        let once = time_calls(&mut ways[slot].work, 1).max(1.0);
        let count = (effort.slice_ns / once).clamp(1.0, 1e6).round();
        turn_ns += once * count;
        calls.push(count as usize);
    }
    let rounds = ((effort.scene_ns / turn_ns) as usize).clamp(5, effort.rounds.max(5));
    let mut samples = vec![Vec::with_capacity(rounds); slots.len()];
    for round in 0..rounds {
        // Each turn begins with another way: who comes first after the change of turns is nobody's privilege.
        for i in 0..slots.len() {
            let slot = (i + round) % slots.len();
            samples[slot].push(time_calls(&mut ways[slots[slot]].work, calls[slot]));
        }
    }
    samples
}

/// Time that this thread has had of a processor, nanoseconds: what others take meanwhile does not count.
pub(crate) fn thread_ns() -> f64 {
    let now = clock_gettime(ClockId::ThreadCPUTime);
    now.tv_sec as f64 * 1e9 + now.tv_nsec as f64
}

/// Nanoseconds of one call: this thread's, and what the calls tell of elsewhere.
fn time_calls(work: &mut WayCall<'_>, calls: usize) -> f64 {
    let start = thread_ns();
    let elsewhere: f64 = (0..calls).map(|_| work()).sum();
    (thread_ns() - start + elsewhere) / calls as f64
}

/// Factor beyond which a way is faster: at least a tenth, more where a way timed against itself differs by more.
fn noise(own: &[f64], twin: &[f64]) -> f64 {
    let ratio = crate::front::Ratio::of(own, twin);
    (ratio.log.abs() + 2.0 * ratio.log_error).exp().max(1.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spin(n: u64) -> u64 {
        (0..n).fold(1, |a, i| black_box(a ^ i).wrapping_mul(0x9e37_79b9_7f4a_7c15))
    }

    #[test]
    fn ways_are_timed_in_turns_and_told_apart() {
        let mut bench = PartBench::new(Effort { rounds: 15, slice_ns: 5e4, scene_ns: 1e9 });
        bench.begin("spin");
        let way = |n: u64| Way::new("spin", &n.to_string(), 1.0, 1, move || spin(n));
        bench.scene("s", "-", 0.0, vec![way(2000).default_if(true), way(8000)]);
        let rows = bench.finish();
        let ratio = crate::front::ratio(&rows[1], &rows[0]).log.exp();
        assert!((2.0..8.0).contains(&ratio), "four times the work takes {ratio} times as long");
        assert!(rows[0].on_front && !rows[1].on_front);
    }

    #[test]
    fn time_elsewhere_counts() {
        let mut bench = PartBench::new(Effort { rounds: 5, slice_ns: 1e4, scene_ns: 1e8 });
        bench.scene("s", "-", 0.0, vec![Way::telling("gpu", "", 0.0, 2, || 5e6)]);
        let time = bench.finish()[0].time_ns().unwrap();
        assert!((2.5e6..2.6e6).contains(&time), "{time}");
    }

    #[test]
    fn a_scene_or_case_with_an_error_that_is_no_number_fails() {
        let mut bench = PartBench::new(Effort { rounds: 5, slice_ns: 1e4, scene_ns: 1e8 });
        bench.begin("part");
        bench.scene("s", "-", 0.0, vec![Way::new("broken", "", f64::NAN, 1, || ())]);
        bench.extreme(
            "e",
            "-",
            vec![ExtremeResult::rival("broken too", "", f64::NAN), ExtremeResult::rival("fine", "", 1.0)],
        );
        let told = crate::front::complaints(&bench.finish());
        assert_eq!(told.len(), 2, "{told:?}");
        assert!(told[0].starts_with("part: broken () on s") && told[1].contains("broken too"), "{told:?}");
    }

    #[test]
    fn the_heap_that_a_way_takes_is_told() {
        let mut bench = PartBench::new(Effort { rounds: 5, slice_ns: 1e4, scene_ns: 1e8 });
        let ways = vec![Way::new("vector", "", 0.0, 1, || vec![1_u8; 5_000_000]).holds(7)];
        bench.scene("s", "-", 0.0, ways);
        let memory = bench.finish()[0].memory_bytes;
        // Other tests run at the same time and take some too.
        assert!((5_000_007..7_000_000).contains(&memory), "{memory}");
    }
}
