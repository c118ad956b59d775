//! Pages of the wizard, made from its state.

use bowwave_core::{
    fault::{Fault, Severity},
    guide::{Coverage, Gauge, Guide},
};

use super::{
    Task, Wizard, WizardStep,
    aim::PULLS,
    gauges,
    live::Live,
    views::BoardShown,
    work::{Solved, pace},
};
use crate::{
    alignment::Movement,
    lens::{CELLS, enough},
    report::hud,
};

const GATHERING: &str = "Enter or trigger: result   b: back   q: end";
const PULLING: &str = "Enter: result   b: back   q: end";

pub(super) fn page(w: &Wizard) -> Guide {
    let guide = match w.step {
        WizardStep::Choose => choose(w),
        WizardStep::Gather => gather(w),
        WizardStep::Solve => Guide {
            says: "Wait: the result is computed".to_owned(),
            keys: "b: back   q: end",
            ..Guide::default()
        },
        WizardStep::Result => result(w),
        WizardStep::Saving => {
            Guide { says: "Wait: the calibration is written".to_owned(), ..Guide::default() }
        }
        WizardStep::Saved => saved(w),
        WizardStep::Over => Guide { says: "Ended".to_owned(), ..Guide::default() },
    };
    let title = match w.step {
        WizardStep::Choose => "Calibrate".to_owned(),
        _ => format!("Calibrate: {}", w.task),
    };
    Guide { title, ..guide }
}

fn choose(w: &Wizard) -> Guide {
    let line = |task: Task| {
        let mark = if task == w.task { '>' } else { ' ' };
        let done = if w.done[task as usize] { " (done)" } else { "" };
        format!("{mark} {} {task}{done}", task as usize + 1)
    };
    Guide {
        says: format!("Press Enter to begin with {}, or choose another by its number", w.task),
        problem: w.refused.clone().or_else(|| device(w)),
        lines: Task::ALL.into_iter().map(line).collect(),
        keys: "1 to 4: choose   Enter or trigger: begin   q: end",
        ..Guide::default()
    }
}

fn result(w: &Wizard) -> Guide {
    let result = |solved: &Solved| {
        let mut guide = hud::guide(&solved.report, solved.gauges.clone(), w.refused.clone(), w.has_ended);
        if guide.passed == Some(true) && w.setup.replaces {
            guide.says += "; what is replaced is kept";
        }
        guide
    };
    w.solved.as_deref().map(result).unwrap_or_default()
}

fn saved(w: &Wizard) -> Guide {
    let left = Task::ALL.into_iter().filter(|t| !w.done[*t as usize]).count();
    Guide {
        says: format!("Saved; press Enter to go on ({left} left)"),
        passed: Some(true),
        keys: "Enter or trigger: go on   q: end",
        ..Guide::default()
    }
}

/// A device that is gone or says nothing.
fn device(w: &Wizard) -> Option<String> {
    let needs_unit = matches!(w.task, Task::Alignment | Task::Trigger);
    // By the devices that the task is made with.
    let matters = |fault: &Fault| match fault.code().split('_').next() {
        Some("CAM") => w.task != Task::Trigger,
        Some("IMU") => needs_unit,
        // Nobody pulls the trigger of a gun that may not be inert.
        Some("TRG" | "NOT") => w.task.wants_pulls(),
        _ => false,
    };
    let raised = w.faults.active().filter(|f| f.severity() > Severity::Note).find(matters);
    let gathers = w.step == WizardStep::Gather && !w.has_ended;
    let silent = || {
        if gathers && w.live.no_pictures(w.since, w.now) && w.task != Task::Trigger {
            Some(Fault::CamStall)
        } else if gathers && needs_unit && w.live.no_samples(w.since, w.now) {
            Some(Fault::ImuLost)
        } else if gathers && w.live.is_other_size() {
            Some(Fault::CamFormat)
        } else {
            None
        }
    };
    let fault = raised.or_else(silent)?;
    Some(format!("{}: {}", fault.cause(), fault.action()))
}

fn gather(w: &Wizard) -> Guide {
    let guide = match w.task {
        Task::Lens => lens(w),
        Task::Alignment => alignment(w),
        Task::Boresight => boresight(w),
        Task::Trigger => trigger(w),
    };
    let keys = if w.task.wants_pulls() { PULLING } else { GATHERING };
    let problem = device(w).or(guide.problem);
    Guide { problem, keys, ..guide }
}

/// Advice and gauges of the newest solution; `None` before the first.
fn told(w: &Wizard) -> Option<(&str, &[Gauge])> {
    w.solved.as_ref().map(|s| (s.says.as_str(), s.gauges.as_slice()))
}

fn alignment(w: &Wizard) -> Guide {
    let counts = w.capture.counts();
    let (first_s, _) = pace(Task::Alignment);
    let begin = if w.setup.target.is_some() {
        "Swing the gun left and right, up and down, the board in view"
    } else {
        "Swing the gun left and right, up and down, the horizon in view"
    };
    let (says, gauges) = told(w).map_or_else(
        || (begin.to_owned(), gauges::of_nothing()),
        |(says, gauges)| (says.to_owned(), gauges.to_vec()),
    );
    let problem = if w.live.is_blurred() {
        Some("TOO FAST, PICTURES ARE SMEARED: MOVE MORE SLOWLY".to_owned())
    } else if w.live.is_blind() {
        Some(blind(w.setup.target.is_some()).to_owned())
    } else {
        lacking(w)
    };
    let seconds = w.capture.seconds();
    // In whole percent and seconds: the display is not to be drawn anew for each picture.
    let share = |count: usize| 100 * count / counts.pictures.max(1);
    let mut seen = format!("{seconds:.0} s, horizon in {} % of the pictures", share(counts.horizons));
    if counts.boards > 0 {
        seen += &format!(", board in {} %", share(counts.boards));
    }
    let lines = if w.solved.is_none() && seconds < first_s {
        vec![seen, format!("First result after {first_s:.0} s of movement")]
    } else {
        vec![seen]
    };
    Guide { says, problem, gauges, lines, ..Guide::default() }
}

const fn blind(has_board: bool) -> &'static str {
    if has_board {
        "NEITHER BOARD NOR HORIZON IS SEEN: TURN THE CAMERA TO THE BOARD"
    } else {
        "NO HORIZON IS SEEN: TURN THE CAMERA TO THE OPEN SEA"
    }
}

/// That the solver cannot tell all angles; what to do is the order's affair.
fn lacking(w: &Wizard) -> Option<String> {
    let missing = w.solved.as_ref()?.missing?;
    let only = w.live.only().filter(|only| *only != missing);
    Some(only.map_or_else(
        || "THE MOVEMENT DOES NOT TELL ALL ANGLES YET".to_owned(),
        |only| format!("ONLY {} SO FAR", word(only)),
    ))
}

const fn word(movement: Movement) -> &'static str {
    match movement {
        Movement::Traverse => "TRAVERSE",
        Movement::Elevation => "ELEVATION",
        Movement::Roll => "ROLL",
        Movement::Any => "LITTLE",
    }
}

fn lens(w: &Wizard) -> Guide {
    let views = &w.views;
    let coverage = views.coverage();
    let problem = match views.shown() {
        BoardShown::Absent => Some("THE BOARD IS NOT SEEN: HOLD IT INTO THE PICTURE, WHOLE AND LIT"),
        BoardShown::Far => Some("THE BOARD IS TOO FAR: BRING IT NEARER"),
        BoardShown::Moving => Some("HOLD THE BOARD STILL"),
        BoardShown::Known | BoardShown::New => None,
    };
    let count = views.kept().len();
    let first = || {
        if count < 3 {
            return "Hold the board so that it fills half of the picture, then tilt it to each side"
                .to_owned();
        }
        coverage
            .missing()
            .next()
            .map_or_else(|| "Tilt the board to all four sides".to_owned(), |m| m.to_string())
    };
    let (says, gauges) = match told(w).filter(|(_, gauges)| !gauges.is_empty()) {
        Some((says, gauges)) => (says.to_owned(), gauges.to_vec()),
        None => (
            first(),
            vec![
                gauges::of_share("parts seen", coverage.share, enough::SHARE, |s| {
                    format!("{:.0} %", s * 100.0)
                }),
                gauges::of_share("pictures", count as f64, enough::PICTURES as f64, |n| format!("{n:.0}")),
            ],
        ),
    };
    let mut lines = vec![format!("{count} pictures kept")];
    if let Some([least, most]) = views.filled() {
        lines.push(format!("board fills {:.0} to {:.0} % of the picture", least * 100.0, most * 100.0));
    }
    Guide {
        says: capital(&says),
        problem: problem.map(str::to_owned),
        gauges,
        coverage: Some(Coverage { columns: CELLS.0, cells: coverage.levels(), picture: views.size() }),
        lines,
        ..Guide::default()
    }
}

/// Sentences begin with one.
fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

fn boresight(w: &Wizard) -> Guide {
    let (aimed, pulled) = (w.aim.aimed(w.now).len(), w.aim.settled(w.now));
    let mut problem = None;
    if pulled > aimed {
        problem = Some("IN A PULL'S PICTURE THE MARK WAS NOT SEEN: KEEP IT IN VIEW, LIT".to_owned());
    } else if w.live.picture_came() && !w.aim.is_seen() {
        problem = Some("THE MARK IS NOT SEEN: AIM AT THE BOARD'S MARKED TAG".to_owned());
    }
    pulls(w, aimed, gauges::AIM, problem)
}

fn trigger(w: &Wizard) -> Guide {
    let problem = restless(&w.live).map(str::to_owned);
    pulls(w, w.aim.settled(w.now), gauges::DRY, problem)
}

fn restless(live: &Live) -> Option<&'static str> {
    (!live.is_still()).then_some("THE GUN MOVES: HOLD IT STILL")
}

fn pulls(w: &Wizard, count: usize, says: &str, problem: Option<String>) -> Guide {
    let mut gauges = vec![gauges::of_share("pulls", count as f64, PULLS as f64, |n| format!("{n:.0}"))];
    gauges.extend(told(w).iter().flat_map(|(_, gauges)| gauges.iter().cloned()));
    // Why what there is does not do.
    let lines = w.solved.iter().filter(|s| s.found.is_none()).map(|s| s.report.says.clone()).collect();
    Guide { says: says.to_owned(), problem, gauges, lines, ..Guide::default() }
}
