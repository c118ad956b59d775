//! Error against run time of every numerical part, and the studies behind single parts.

#![forbid(unsafe_code)]

use std::{path::PathBuf, process::ExitCode};

use anyhow::{Context, Result, bail};
use clap::{Args, Parser, Subcommand};
use precision::{
    alignment::CalibrationStudy,
    bench::{Effort, PartBench},
    documents::{DocumentsStudy, Section, Workshop},
    front,
    horizon::report::HorizonStudy,
    karma::report::KarmaStudy,
    overload::OverloadStudy,
    page,
    parts::{About, NumericalPart, PARTS},
    photograph::PhotographStudy,
    reflection::commands::ReflectionStudy,
    registration::RegistrationStudy,
    row,
    sea_video::score::SeaVideoStudy,
    setups::SetUpStudy,
    truth::commands::TruthStudy,
};

/// Measures the numerical parts against truths that share no code with them: all of them in a report (`precision.csv` and one HTML
/// page), or one of them in a study.
#[derive(Debug, Parser)]
#[command(args_conflicts_with_subcommands = true)]
struct PrecisionArgs {
    #[command(subcommand)]
    study: Option<PrecisionStudy>,
    #[command(flatten)]
    report: ReportArgs,
}

#[derive(Debug, Args)]
struct ReportArgs {
    /// Only these parts; one that a study is named like is named by --part
    part: Vec<String>,
    /// Only this part; more than once for several
    #[arg(long = "part", value_name = "PART")]
    only: Vec<String>,
    /// Fewer turns
    #[arg(long)]
    quick: bool,
    /// Folder for precision.csv and index.html
    #[arg(long, value_name = "DIR", default_value = "target/precision")]
    out: PathBuf,
    /// The trainer's program, for rows of the source documents that are about a whole run
    #[arg(long, default_value = "target/release/bowwave")]
    program: PathBuf,
}

#[derive(Debug, Subcommand)]
enum PrecisionStudy {
    /// Calibration of many simulated recordings: percentiles of the errors, and how often the stated uncertainty holds
    Calibration(CalibrationStudy),
    /// Both source documents on light and shadow, row by row, with tables and pictures
    Documents(DocumentsStudy),
    /// The horizon in real frames and drawn pictures: errors frame by frame, false ones, the time of a picture
    Horizon(HorizonStudy),
    /// A camera calibrated from its own film and gyro, and how far an overlay would drift
    Karma(KarmaStudy),
    /// The program beside busy loops: how soon it says so, what it leaves out, how soon all is back
    Overload(OverloadStudy),
    /// Reflections of photographed boats drawn anew and held against the real ones
    Photograph(PhotographStudy),
    /// Drawn reflections against ray-traced ones
    #[command(subcommand)]
    Reflection(ReflectionStudy),
    /// Registration of whole sessions on simulated recordings with truth
    Registration(RegistrationStudy),
    /// What a trainer says that is set up wrongly, and how soon
    SetUps(SetUpStudy),
    /// The sea's state from simulated video: errors by class of clip, and the time of a picture
    #[command(alias = "sea_video")]
    SeaVideo(SeaVideoStudy),
    /// The ray-traced sea with a boat on it that reflections are held against
    #[command(subcommand)]
    Truth(TruthStudy),
}

impl PrecisionStudy {
    fn run(&self) -> Result<()> {
        match self {
            Self::Calibration(study) => study.run(),
            Self::Documents(study) => study.run(),
            Self::Horizon(study) => study.run(),
            Self::Karma(study) => study.run(),
            Self::Overload(study) => study.run(),
            Self::Photograph(study) => study.run(),
            Self::Reflection(study) => study.run(),
            Self::Registration(study) => study.run(),
            Self::SetUps(study) => study.run(),
            Self::SeaVideo(study) => study.run(),
            Self::Truth(study) => study.run(),
        }
    }
}

impl ReportArgs {
    fn parts(&self) -> Result<Vec<&'static NumericalPart>> {
        let names: Vec<&String> = self.part.iter().chain(&self.only).collect();
        if let Some(unknown) = names.iter().find(|n| !PARTS.iter().any(|p| p.about.part == ***n)) {
            let known: Vec<&str> = PARTS.iter().map(|p| p.about.part).collect();
            bail!("no part '{unknown}'; there are: {}", known.join(", "));
        }
        Ok(PARTS.iter().filter(|p| names.is_empty() || names.iter().any(|n| *n == p.about.part)).collect())
    }

    /// The source documents: all of them where all parts are measured, with pictures where there is time for them.
    fn documents(&self) -> Result<Section> {
        if !(self.part.is_empty() && self.only.is_empty()) {
            return Ok(Section::default());
        }
        let workshop = Workshop { program: self.program.clone() };
        Section::of_all((!self.quick).then_some(&workshop))
    }

    fn run(&self) -> Result<()> {
        let parts = self.parts()?;
        let mut bench = PartBench::new(if self.quick { Effort::QUICK } else { Effort::FULL });
        for part in &parts {
            eprintln!("precision: {}", part.about.part);
            bench.begin(part.about.part);
            (part.measure)(&mut bench).with_context(|| format!("part {}", part.about.part))?;
        }
        let rows = bench.finish();
        std::fs::create_dir_all(&self.out)
            .with_context(|| format!("cannot make the folder {}", self.out.display()))?;
        row::write_csv(&self.out.join("precision.csv"), &rows)?;
        let abouts: Vec<About> = parts.iter().map(|p| p.about).collect();
        page::write(&self.out.join("index.html"), &abouts, &rows, &self.documents()?)?;
        println!("{} rows: {}", rows.len(), self.out.join("index.html").display());
        let complaints = front::complaints(&rows);
        if !complaints.is_empty() {
            bail!("{} complaints:\n{}", complaints.len(), complaints.join("\n"));
        }
        Ok(())
    }
}

fn main() -> ExitCode {
    let arguments = PrecisionArgs::parse();
    match arguments.study.map_or_else(|| arguments.report.run(), |study| study.run()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("precision: {e:#}");
            ExitCode::FAILURE
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::*;

    fn parsed(line: &str) -> PrecisionArgs {
        PrecisionArgs::try_parse_from(["precision"].into_iter().chain(line.split_whitespace())).unwrap()
    }

    #[test]
    fn parts_and_studies_are_told_apart() {
        PrecisionArgs::command().debug_assert();
        let report = parsed("clock --quick --part horizon");
        assert!(report.study.is_none() && report.report.quick);
        let names: Vec<&str> = report.report.parts().unwrap().iter().map(|p| p.about.part).collect();
        assert_eq!(names, ["clock", "horizon"]);
        assert!(parsed("--part nothing").report.parts().is_err());
        assert!(matches!(parsed("horizon --drawn 3").study, Some(PrecisionStudy::Horizon(_))));
        assert!(matches!(parsed("sea_video --cost").study, Some(PrecisionStudy::SeaVideo(_))));
        assert!(matches!(parsed("reflection gap").study, Some(PrecisionStudy::Reflection(_))));
        assert!(matches!(parsed("truth cell --range 60").study, Some(PrecisionStudy::Truth(_))));
    }
}
