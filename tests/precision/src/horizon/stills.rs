//! Stills of other cameras, none of whose lenses is known: how many horizons are found, how wrong they are, and how many shores are
//! taken for one.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
};

use anyhow::{Context as _, Result};
use bowwave_core::estimate::horizon::{HorizonFinder, NoHorizon, Prior};
use glam::{DVec2, DVec3};

use super::{
    frames::{self, SeaFrame},
    overlay,
    report::{HorizonAnswer, described, laid},
    score::{WIDTH, find, miss, predicted},
};
use crate::{front::quantile, recorded};

/// How much of a picture's horizon is free.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum HorizonKind {
    /// All of its width, ships before it left aside.
    Free,
    /// Part of its width; land hides the rest.
    Partial,
    /// None: the water ends at a shore, a wall or a bank.
    Shore,
}

/// A picture and what its marker said of it.
#[derive(Clone, Debug)]
pub struct Still {
    /// The picture, with its mark where it has one.
    pub frame: SeaFrame,
    /// How much of its horizon is free.
    pub kind: HorizonKind,
    /// Uncertainty of the mark, pixels at [`WIDTH`].
    pub uncertainty_px: f64,
    /// Whose camera took it: pictures of one source are left out together.
    pub source: String,
}

/// All stills, and the marked frames and shores of before; none, with a word of it, where they are absent.
pub fn all() -> Result<Vec<Still>> {
    let mut stills = listed()?;
    let before = |frame: SeaFrame, kind: HorizonKind| {
        let source = frame.name.split('_').next().unwrap_or_default().to_owned();
        Still { frame, kind, uncertainty_px: 1.0, source }
    };
    for frame in frames::marked()? {
        // The drone's horizon ends at a cliff, that of the ship is free.
        let kind = if frame.name.starts_with("karma") { HorizonKind::Partial } else { HorizonKind::Free };
        stills.push(before(frame, kind));
    }
    stills.extend(frames::without_horizon()?.into_iter().map(|f| before(f, HorizonKind::Shore)));
    Ok(stills)
}

/// The stills of the folder.
pub fn listed() -> Result<Vec<Still>> {
    let Some(folder) = recorded::find("sea/stills") else { return Ok(Vec::new()) };
    let marks: BTreeMap<String, [f64; 4]> = rows(&folder.join("marks.csv"))?
        .into_iter()
        .map(|cells| (cells.first().cloned().unwrap_or_default(), [1, 2, 3, 4].map(|i| number(&cells, i))))
        .collect();
    rows(&folder.join("pictures.csv"))?.iter().map(|cells| still(&folder, cells, &marks)).collect()
}

/// Cells of a table's rows, without its remarks and its header.
fn rows(path: &Path) -> Result<Vec<Vec<String>>> {
    let mut table = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .flexible(true)
        .from_path(path)
        .with_context(|| format!("cannot read {}", path.display()))?;
    let cells = |row: csv::Result<csv::StringRecord>| Ok(row?.iter().map(str::to_owned).collect());
    table.records().map(cells).collect()
}

fn number(cells: &[String], i: usize) -> f64 {
    cells.get(i).and_then(|c| c.trim().parse().ok()).unwrap_or(f64::NAN)
}

fn still(folder: &Path, cells: &[String], marks: &BTreeMap<String, [f64; 4]>) -> Result<Still> {
    let text = |i: usize| cells.get(i).map(String::as_str).unwrap_or_default();
    let stem = text(0).split('.').next().unwrap_or_default();
    let mut frame = frames::still(stem, &folder.join(text(0)))?;
    // The marks count from the centre of the first pixel.
    frame.mark = marks.get(text(0)).map(|m| [DVec2::new(m[0], m[1]) + 0.5, DVec2::new(m[2], m[3]) + 0.5]);
    let kind = match text(1) {
        "free" => HorizonKind::Free,
        "partial" => HorizonKind::Partial,
        _ => HorizonKind::Shore,
    };
    let uncertainty_px = number(cells, 5) * WIDTH / frame.size.0 as f64;
    // Pictures of the collection "moc" are of as many photographers, those of the others of one.
    let (collection, _) = stem.split_once('_').unwrap_or((stem, ""));
    let source = if collection == "moc" { stem } else { collection };
    Ok(Still { frame, kind, uncertainty_px, source: source.to_owned() })
}

/// Stills of strangers' cameras.
#[derive(Debug, clap::Args)]
pub struct StillsStudy {
    /// Folder for one sheet of all pictures of a kind, with the mark in green and what was found in red
    #[arg(long, value_name = "DIR")]
    overlays: Option<PathBuf>,
    /// Only pictures whose name contains this
    #[arg(long, value_name = "NAME")]
    only: Option<String>,
}

/// What the finder made of a still.
struct StillAnswer<'a> {
    still: &'a Still,
    answer: HorizonAnswer,
    /// Error, pixels at [`WIDTH`].
    px: Option<f64>,
}

impl StillAnswer<'_> {
    /// Its score; nothing where it is refused for another reason.
    fn score(&self) -> f64 {
        match &self.answer {
            Ok(found) => found.quality.score,
            Err(NoHorizon::Unclear(quality)) => quality.score,
            Err(_) => 0.0,
        }
    }

    fn source(&self) -> (&str, bool) {
        (&self.still.source, self.still.kind == HorizonKind::Shore)
    }
}

impl StillsStudy {
    /// Prints all of it.
    pub fn run(&self) -> Result<()> {
        let mut stills = all()?;
        if let Some(only) = &self.only {
            stills.retain(|s| s.frame.name.contains(only.as_str()));
        }
        let mut finder = HorizonFinder::new();
        let mut answers = Vec::new();
        for still in &stills {
            let answer = find(&mut finder, &still.frame, None)?;
            let px = answer.as_ref().ok().and_then(|h| miss(&still.frame, h.up)).map(|m| m.px);
            let told = match (px, &answer) {
                (Some(px), _) => format!("{px:.2} px"),
                (None, Ok(_)) => "TAKEN".into(),
                (None, Err(_)) => "none".into(),
            };
            println!("{:18} {:8?} {told:9} {}", still.frame.name, still.kind, described(&answer));
            answers.push(StillAnswer { still, answer, px });
        }
        summary("no prediction", &answers);
        with_predictions(&stills)?;
        left_out(&answers);
        if let Some(folder) = &self.overlays {
            sheets(folder, &answers)?;
        }
        Ok(())
    }
}

/// Found, error and shores taken, by kind.
fn summary(told: &str, answers: &[StillAnswer<'_>]) {
    for kind in [HorizonKind::Free, HorizonKind::Partial, HorizonKind::Shore] {
        for (set, of_stills) in [("stills", true), ("of before", false)] {
            let of_kind: Vec<_> = answers
                .iter()
                .filter(|a| a.still.kind == kind && is_of_stills(a.still) == of_stills)
                .collect();
            let found = of_kind.iter().filter(|a| a.answer.is_ok()).count();
            let share = 100.0 * found as f64 / of_kind.len().max(1) as f64;
            print!("{told}, {kind:?}, {set}: {found} of {} ({share:.0} %)", of_kind.len());
            if kind != HorizonKind::Shore {
                let px: Vec<f64> = of_kind.iter().filter_map(|a| a.px).collect();
                let beyond: Vec<f64> =
                    of_kind.iter().filter_map(|a| Some(a.px? - a.still.uncertainty_px)).collect();
                print!(
                    "; px median {:.2}, p95 {:.2}; worst beyond the mark's uncertainty {:.2}",
                    quantile(&px, 0.5),
                    quantile(&px, 0.95),
                    quantile(&beyond, 1.0)
                );
            }
            println!();
        }
    }
}

fn is_of_stills(still: &Still) -> bool {
    !["schw", "karma", "wasr", "davis"].contains(&still.source.as_str())
}

/// The same with predictions: of marked ones eight draws, of shores sixty laid all over the picture.
fn with_predictions(stills: &[Still]) -> Result<()> {
    let mut finder = HorizonFinder::new();
    for kind in [HorizonKind::Free, HorizonKind::Partial, HorizonKind::Shore] {
        let (mut tries, mut found, mut px, mut beyond) = (0, 0, Vec::new(), Vec::new());
        for (i, still) in stills.iter().enumerate().filter(|(_, s)| s.kind == kind && is_of_stills(s)) {
            let priors: Vec<Prior> = match still.frame.marked_up() {
                Some(up) => (0..8).map(|draw| predicted(up, 8 * i as u64 + draw)).collect(),
                None => laid(&still.frame),
            };
            for prior in priors {
                tries += 1;
                let Ok(horizon) = find(&mut finder, &still.frame, Some(prior))? else { continue };
                found += 1;
                if let Some(m) = miss(&still.frame, horizon.up) {
                    px.push(m.px);
                    beyond.push(m.px - still.uncertainty_px);
                }
            }
        }
        println!(
            "prediction, {kind:?}, stills: {found} of {tries} ({:.1} %); px median {:.2}, p95 {:.2}; worst beyond the mark's \
             uncertainty {:.2}",
            100.0 * f64::from(found) / f64::from(tries.max(1)),
            quantile(&px, 0.5),
            quantile(&px, 0.95),
            quantile(&beyond, 1.0)
        );
    }
    Ok(())
}
/// The score's threshold chosen anew without each source in turn, and that source judged by it.
fn left_out(answers: &[StillAnswer<'_>]) {
    let mut per_source: BTreeMap<(&str, bool), f64> = BTreeMap::new();
    for a in answers {
        *per_source.entry(a.source()).or_default() += 1.0;
    }
    let scored: Vec<ScoredStill<'_>> = answers
        .iter()
        .map(|a| ScoredStill { source: a.source(), score: a.score(), weight: 1.0 / per_source[&a.source()] })
        .collect();
    let (mut thresholds, mut counts) = (Vec::new(), [[0.0; 2]; 2]);
    for left in per_source.keys().map(|(source, _)| *source).collect::<BTreeSet<_>>() {
        let least = threshold(&scored, left);
        thresholds.push(least);
        for still in scored.iter().filter(|s| s.source.0 == left) {
            let [all, found] = &mut counts[usize::from(still.source.1)];
            *all += 1.0;
            *found += f64::from(u8::from(still.score >= least));
        }
    }
    let share = |[all, found]: [f64; 2]| 100.0 * found / f64::max(all, 1.0);
    println!(
        "threshold chosen without the source it judges ({} sources): {:.2} to {:.2}; found {:.0} % of marked, taken {:.1} % of shores",
        thresholds.len(),
        quantile(&thresholds, 0.0),
        quantile(&thresholds, 1.0),
        share(counts[0]),
        share(counts[1])
    );
}

/// What the choice of a threshold needs of a still.
struct ScoredStill<'a> {
    /// Source, and whether it shows a shore.
    source: (&'a str, bool),
    score: f64,
    /// Pictures of one source weigh as much as one.
    weight: f64,
}

/// The threshold that costs least on all sources but `left`; the middle of those that cost the same.
fn threshold(scored: &[ScoredStill<'_>], left: &str) -> f64 {
    /// A shore that is taken costs as much as so many horizons that are missed.
    const SHORE_COST: f64 = 5.0;
    let cost = |least: f64| {
        let others = scored.iter().filter(|s| s.source.0 != left);
        let costs = others.map(|s| match (s.source.1, s.score >= least) {
            (true, true) => SHORE_COST * s.weight,
            (false, false) => s.weight,
            _ => 0.0,
        });
        costs.sum::<f64>()
    };
    let tried: Vec<(f64, f64)> = (5..200).map(|i| f64::from(i) / 100.0).map(|t| (t, cost(t))).collect();
    let least = tried.iter().map(|t| t.1).fold(f64::INFINITY, f64::min);
    let best: Vec<f64> = tried.iter().filter(|t| t.1 < least + 1e-9).map(|t| t.0).collect();
    best.iter().sum::<f64>() / best.len().max(1) as f64
}

fn sheets(folder: &Path, answers: &[StillAnswer<'_>]) -> Result<()> {
    fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
    for kind in [HorizonKind::Free, HorizonKind::Partial, HorizonKind::Shore] {
        let of_kind: Vec<(&SeaFrame, Option<DVec3>)> = answers
            .iter()
            .filter(|a| a.still.kind == kind)
            .map(|a| (&a.still.frame, a.answer.as_ref().ok().map(|h| h.up)))
            .collect();
        for (page, pictures) in of_kind.chunks(overlay::SHEET).enumerate() {
            overlay::sheet(&folder.join(format!("{kind:?}_{page}.png").to_lowercase()), pictures)?;
        }
    }
    Ok(())
}
