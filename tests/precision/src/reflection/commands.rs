//! The commands that hold drawn reflections against the truth: every line of the table of targets by one of them.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use bowwave_core::water::ReflectionMethod;
use clap::{Args, Subcommand};

use super::{cell, cost, draw::DrawingStudio, gap, grid, singular, time, wrong};
use crate::truth::files;

/// Commands that hold drawn reflections against ray-traced ones.
#[derive(Debug, Subcommand)]
pub enum ReflectionStudy {
    /// FLIP and bias of every method on every cell
    Grid {
        /// Cells and method
        #[command(flatten)]
        cells: CellChoice,
        /// Folder to put what the methods draw into
        #[arg(long, value_name = "DIR")]
        pictures: Option<PathBuf>,
    },
    /// FLIP that the truth's own noise makes: renders every cell again with other paths
    Noise {
        /// Cells and method
        #[command(flatten)]
        cells: CellChoice,
    },
    /// FLIP of one method under wrongly estimated conditions
    Wrong {
        /// Cells and method
        #[command(flatten)]
        cells: CellChoice,
    },
    /// Frame-to-frame change against the truth's, of cells that differ in time alone
    Time {
        /// Cells and method
        #[command(flatten)]
        cells: CellChoice,
        /// Renders every frame again for what a method shows that is right but for the truth's noise
        #[arg(long)]
        noise: bool,
    },
    /// Pixels of bare water between hull and reflection
    Gap,
    /// Cases in which formulas break
    Singular {
        /// Times the grid's paths
        #[arg(long, default_value_t = 0.1)]
        paths: f64,
    },
    /// Time of every method on software Vulkan
    Cost {
        /// Turns
        #[arg(long, default_value_t = 21)]
        turns: usize,
    },
}

/// Cells that are judged, and the method.
#[derive(Debug, Args)]
pub struct CellChoice {
    /// Folder of the cells
    #[arg(default_value = "target/truth")]
    folder: PathBuf,
    /// Only cells whose name contains this
    #[arg(long, default_value = "")]
    only: String,
    /// One cell in this many
    #[arg(long, default_value_t = 1)]
    every: usize,
    /// The method that is judged
    #[arg(long, default_value = "baked")]
    ours: String,
    /// Folder for the table of all cells
    #[arg(long, value_name = "DIR", default_value = "target/precision/reflection")]
    out: PathBuf,
}

impl CellChoice {
    fn method(&self) -> Result<ReflectionMethod> {
        ReflectionMethod::of_name(&self.ours).with_context(|| {
            let names = ReflectionMethod::ALL.map(|m| m.name()).join(", ");
            format!("no method '{}'; there are: {names}", self.ours)
        })
    }

    fn folders(&self) -> Result<Vec<PathBuf>> {
        Ok(cell::folders(&self.folder, &self.only)?.into_iter().step_by(self.every.max(1)).collect())
    }

    /// Result of `measure` for every cell at time 0, those of one size after another.
    fn each<T>(
        &self,
        mut measure: impl FnMut(&mut DrawingStudio, &cell::TruthCell) -> Result<T>,
    ) -> Result<Vec<T>> {
        let mut sized = Vec::new();
        for folder in self.folders()? {
            let described = files::read(&folder)?;
            if described.spec.time_s == 0.0 {
                sized.push(((described.region.width, described.region.height), folder));
            }
        }
        if sized.is_empty() {
            bail!("{} holds no cell of time 0", self.folder.display());
        }
        sized.sort();
        let (mut studio, count) = (DrawingStudio::default(), sized.len());
        let mut rows = Vec::with_capacity(count);
        for (i, (_, folder)) in sized.iter().enumerate() {
            rows.push(measure(&mut studio, &cell::TruthCell::load(folder)?)?);
            if (i + 1) % 20 == 0 {
                eprintln!("reflection: {} of {count} cells", i + 1);
            }
        }
        Ok(rows)
    }

    fn put(&self, name: &str, csv: &[u8], summary: &str) -> Result<()> {
        make(&self.out)?;
        for (file, bytes) in [(format!("{name}.csv"), csv), (format!("{name}.txt"), summary.as_bytes())] {
            let path = self.out.join(file);
            std::fs::write(&path, bytes).with_context(|| format!("cannot write {}", path.display()))?;
        }
        print!("{summary}");
        Ok(())
    }
}

fn make(folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))
}

impl ReflectionStudy {
    /// Prints the tables that are asked for.
    pub fn run(&self) -> Result<()> {
        match self {
            Self::Grid { cells, pictures } => {
                let ours = cells.method()?;
                pictures.as_deref().map_or(Ok(()), make)?;
                let mut rows = cells.each(|studio, cell| grid::measure(studio, cell, pictures.as_deref()))?;
                rows.sort_by(|a, b| a.name.cmp(&b.name));
                cells.put("grid", &grid::csv(&rows)?, &grid::summary(&rows, ours)?)
            }
            Self::Noise { cells } => {
                let rows =
                    cells.each(|_, cell| Ok((cell.spec.range_m as u32, cell.spec.state, cell.noise()?)))?;
                print!("{}", grid::noise_summary(&rows));
                Ok(())
            }
            Self::Wrong { cells } => {
                let ours = cells.method()?;
                let mut rows = cells.each(|studio, cell| wrong::measure(studio, cell, ours))?;
                rows.sort_by(|a, b| a.name.cmp(&b.name));
                cells.put("wrong", &wrong::csv(&rows)?, &wrong::summary(&rows, ours))
            }
            Self::Time { cells, noise } => {
                let mut studio = DrawingStudio::default();
                let pairs = time::pairs(&cells.folders()?)?;
                let measured = pairs.iter().map(|pair| time::measure(&mut studio, pair, *noise));
                let rows = measured.collect::<Result<Vec<_>>>()?;
                print!("{}", time::summary(&rows));
                Ok(())
            }
            Self::Gap => {
                print!("{}", gap::table()?);
                Ok(())
            }
            Self::Singular { paths } => {
                print!("{}", singular::table(*paths)?);
                Ok(())
            }
            Self::Cost { turns } => {
                print!("{}", cost::table(*turns)?);
                Ok(())
            }
        }
    }
}
