//! Tells the guide on a terminal, or line by line where there is none; and hears the keys.

use std::{
    fmt::Write as _,
    io::{self, BufRead as _, IsTerminal as _, Read as _},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use anyhow::Result;
use bowwave_calibration::wizard::{Key, Task};
use bowwave_core::guide::{Cell, Coverage, Gauge, Guide, Rating, wrapped};
use console::{Style, Term};
use crossbeam_channel::{Receiver, Sender, TryRecvError, bounded};
use rustix::termios::{OptionalActions, Termios, tcgetattr, tcsetattr};

use crate::stdout;

/// A terminal is drawn anew this often at most.
const REDRAWN: Duration = Duration::from_millis(200);
/// Squares of a gauge.
const SQUARES: usize = 20;
/// Keys that wait.
const KEYS: usize = 16;
/// Bytes that a terminal sends for these keys.
const BACKSPACE: u8 = 0x7f;
const CONTROL_C: u8 = 3;

/// Where it is told.
enum TerminalKind {
    /// Drawn over itself again and again.
    Terminal { term: Term, lines: usize, drawn: Option<Instant>, before: Option<Termios> },
    /// A line for each change.
    Lines,
}

/// No key will ever come.
#[derive(Clone, Copy, Debug)]
pub struct StdinClosed;

/// Tells and hears.
pub struct TerminalUi {
    kind: TerminalKind,
    keys: Receiver<Key>,
    /// Control and C were pressed.
    interrupted: Arc<AtomicBool>,
    shown: Option<Guide>,
}

impl TerminalUi {
    /// On the terminal where standard input and output are one.
    pub fn new() -> Self {
        let (sender, keys) = bounded(KEYS);
        let interrupted = Arc::new(AtomicBool::new(false));
        let kind = if io::stdout().is_terminal() && io::stdin().is_terminal() {
            let before = make_raw();
            let told = Arc::clone(&interrupted);
            thread::spawn(move || listen(&sender, &told));
            TerminalKind::Terminal { term: Term::stdout(), lines: 0, drawn: None, before }
        } else {
            thread::spawn(move || hear_lines(&sender));
            TerminalKind::Lines
        };
        Self { kind, keys, interrupted, shown: None }
    }

    /// A key that was pressed, if any; an error where none will be.
    pub fn key(&self) -> Result<Option<Key>, StdinClosed> {
        match self.keys.try_recv() {
            Ok(key) => Ok(Some(key)),
            Err(TryRecvError::Empty) => Ok(None),
            Err(TryRecvError::Disconnected) => Err(StdinClosed),
        }
    }

    /// Whether Control and C were pressed.
    pub fn is_interrupted(&self) -> bool {
        self.interrupted.load(Ordering::Relaxed)
    }

    /// Waits for a key; `None` where none will come.
    pub fn wait_key(&self) -> Option<Key> {
        self.keys.recv().ok()
    }

    /// Shows what has changed.
    pub fn show(&mut self, guide: &Guide) -> Result<()> {
        if self.shown.as_ref() == Some(guide) {
            return Ok(());
        }
        let is_small = self.is_small_change(guide);
        match &mut self.kind {
            TerminalKind::Terminal { drawn: Some(at), .. } if is_small && at.elapsed() < REDRAWN => {
                return Ok(());
            }
            TerminalKind::Terminal { term, lines, drawn, .. } => {
                let text = screen(guide, usize::from(term.size().1));
                term.clear_last_lines(*lines)?;
                term.write_str(&text)?;
                *lines = text.matches('\n').count();
                *drawn = Some(Instant::now());
            }
            // Counts run on; they are told with what follows from them.
            TerminalKind::Lines if self.shown.as_ref().is_some_and(|s| is_all_but_lines(s, guide)) => {
                return Ok(());
            }
            TerminalKind::Lines => stdout::print(changes(self.shown.as_ref(), guide))?,
        }
        self.shown = Some(guide.clone());
        Ok(())
    }

    /// Whether only numbers have changed: what is said and what is asked for is shown at once.
    fn is_small_change(&self, guide: &Guide) -> bool {
        let same = |s: &Guide| {
            (&s.title, s.passed, s.keys, &s.says) == (&guide.title, guide.passed, guide.keys, &guide.says)
        };
        self.shown.as_ref().is_some_and(same)
    }

    /// Shows the last page and leaves the terminal as it was.
    pub fn finish(mut self, guide: &Guide) -> Result<()> {
        if let TerminalKind::Terminal { drawn, .. } = &mut self.kind {
            *drawn = None;
        }
        self.show(guide)
    }
}

impl Drop for TerminalUi {
    fn drop(&mut self) {
        if let TerminalKind::Terminal { before: Some(before), .. } = &self.kind
            && let Err(e) = tcsetattr(io::stdin(), OptionalActions::Now, before)
        {
            log::warn!("the terminal may behave oddly ({e}): type reset");
        }
    }
}

/// Keys of a terminal that hands over each at once.
fn listen(keys: &Sender<Key>, interrupted: &AtomicBool) {
    for byte in io::stdin().lock().bytes() {
        let key = match byte {
            Ok(b'\r' | b'\n') => Some(Key::Next),
            Ok(BACKSPACE) => Some(Key::Back),
            Ok(CONTROL_C) => {
                interrupted.store(true, Ordering::Relaxed);
                Some(Key::Quit)
            }
            Ok(byte) => of_letter(char::from(byte)),
            Err(_) => return,
        };
        if key.is_some_and(|key| keys.send(key).is_err()) {
            return;
        }
    }
}

/// Has the terminal hand over each key at once, unseen; gives the settings that it had.
fn make_raw() -> Option<Termios> {
    let before = tcgetattr(io::stdin()).ok()?;
    let mut raw = before.clone();
    raw.make_raw();
    // Lines still end as before.
    raw.output_modes = before.output_modes;
    tcsetattr(io::stdin(), OptionalActions::Now, &raw).ok()?;
    Some(before)
}

/// Keys by lines: an empty one is Enter.
fn hear_lines(keys: &Sender<Key>) {
    for line in io::stdin().lock().lines() {
        let Ok(line) = line else { return };
        let key = line.trim().chars().next().map_or(Some(Key::Next), of_letter);
        if key.is_some_and(|key| keys.send(key).is_err()) {
            return;
        }
    }
}

fn of_letter(letter: char) -> Option<Key> {
    match letter.to_ascii_lowercase() {
        'b' => Some(Key::Back),
        'q' => Some(Key::Quit),
        digit => {
            let number = digit.to_digit(10)?.checked_sub(1)?;
            Task::ALL.get(usize::try_from(number).ok()?).map(|task| Key::Pick(*task))
        }
    }
}

/// Whether nothing but the lines beside has changed.
fn is_all_but_lines(shown: &Guide, guide: &Guide) -> bool {
    let bare = |g: &Guide| Guide { lines: Vec::new(), ..g.clone() };
    bare(shown) == bare(guide)
}

/// The lines that are new.
fn changes(before: Option<&Guide>, guide: &Guide) -> String {
    let mut out = String::new();
    let is_new = |of: &dyn Fn(&Guide) -> bool| before.is_none_or(|b| !of(b));
    // Writing to a String cannot fail.
    if is_new(&|b| b.title == guide.title) && !guide.title.is_empty() {
        let _ = writeln!(out, "== {}", guide.title);
    }
    if let Some(verdict) = guide.verdict().filter(|_| is_new(&|b| b.passed == guide.passed)) {
        let _ = writeln!(out, "   {verdict}");
    }
    for line in &guide.lines {
        if is_new(&|b| b.lines.contains(line)) {
            let _ = writeln!(out, "   {line}");
        }
    }
    for gauge in &guide.gauges {
        if is_new(&|b| b.gauges.contains(gauge)) {
            let _ = writeln!(out, "   {}", plain(gauge));
        }
    }
    if let Some(coverage) = guide.coverage.as_ref().filter(|c| is_new(&|b| b.coverage.as_ref() == Some(c))) {
        let rows: Vec<String> = map(coverage).collect();
        let _ = writeln!(out, "   seen in {}", rows.join(" "));
    }
    match &guide.problem {
        Some(problem) if is_new(&|b| b.problem.as_ref() == Some(problem)) => {
            let _ = writeln!(out, "!! {problem}");
        }
        None if before.is_some_and(|b| b.problem.is_some()) => {
            let _ = writeln!(out, "   (well again)");
        }
        _ => {}
    }
    if is_new(&|b| b.says == guide.says) {
        let _ = writeln!(out, "-> {}", guide.says);
    }
    out
}

fn plain(gauge: &Gauge) -> String {
    let rating = gauge.rating.map_or("", Rating::word);
    format!("{}: {} {rating}", gauge.name, gauge.value).trim_end().to_owned()
}

/// A row of the picture's parts for each line.
fn map(coverage: &Coverage) -> impl Iterator<Item = String> + '_ {
    let sign = |cell: &Cell| match cell {
        Cell::Empty => '.',
        Cell::Few => '+',
        Cell::Many => '#',
    };
    coverage.cells.chunks(coverage.columns.max(1)).map(move |row| row.iter().map(sign).collect())
}

/// The whole page, `width` columns wide.
fn screen(guide: &Guide, width: usize) -> String {
    let (bold, dim) = (Style::new().bold(), Style::new().dim());
    let (green, red) = (Style::new().green().bold(), Style::new().red().bold());
    let mut out = String::new();
    // Lines that the terminal would break could not be cleared again.
    let mut line = |text: &str, style: &Style| {
        for part in wrapped(text, |line| line.chars().count() < width.max(21)) {
            let _ = writeln!(out, "{}", style.apply_to(part));
        }
    };
    line(&guide.title, &bold);
    if let Some(verdict) = guide.verdict() {
        line(verdict, if guide.passed == Some(true) { &green } else { &red });
    }
    for text in &guide.lines {
        line(text, &Style::new());
    }
    for gauge in &guide.gauges {
        let full = (gauge.share * SQUARES as f64).round() as usize;
        let bar = format!("{}{}", "#".repeat(full.min(SQUARES)), ".".repeat(SQUARES - full.min(SQUARES)));
        let rating = gauge.rating.map_or("", Rating::word);
        line(&format!("{:16} [{bar}] {:6} {}", gauge.name, rating, gauge.value), &Style::new());
    }
    for row in guide.coverage.iter().flat_map(map) {
        line(&format!("    {row}"), &Style::new());
    }
    if let Some(problem) = &guide.problem {
        line(problem, &red);
    }
    line(&format!("-> {}", guide.says), &bold);
    line(guide.keys, &dim);
    out
}
