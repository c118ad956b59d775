//! The documents' section alone.

use std::path::PathBuf;

use anyhow::{Context as _, Result, bail};

use super::{DocumentRow, Section, Workshop, rows};
use crate::{
    bench::{Effort, PartBench},
    page,
    parts::PARTS,
};

/// Goes through both documents on light and shadow row by row.
#[derive(Debug, clap::Args)]
pub struct DocumentsStudy {
    /// Only this row; more than once for several. An unknown name lists all
    #[arg(long, value_name = "ROW")]
    only: Vec<String>,
    /// As many turns as the report takes
    #[arg(long)]
    full: bool,
    /// Folder for documents.html
    #[arg(long, value_name = "DIR", default_value = "target/precision")]
    out: PathBuf,
    /// The trainer's program, for rows that are about a whole run
    #[arg(long, default_value = "target/release/bowwave")]
    program: PathBuf,
}

impl DocumentsStudy {
    /// Measures and draws what the rows need, and writes the page.
    pub fn run(&self) -> Result<()> {
        let chosen = self.chosen()?;
        let mut bench = PartBench::new(if self.full { Effort::FULL } else { Effort::QUICK });
        let is_asked =
            |part: &str| chosen.iter().any(|row| row.tables.iter().any(|table| table.part == part));
        for part in PARTS.iter().filter(|part| is_asked(part.about.part)) {
            eprintln!("documents: part {}", part.about.part);
            bench.begin(part.about.part);
            (part.measure)(&mut bench).with_context(|| format!("part {}", part.about.part))?;
        }
        let section = Section::of(chosen.iter().copied(), Some(&Workshop { program: self.program.clone() }))?;
        let file = self.out.join("documents.html");
        std::fs::create_dir_all(&self.out)
            .with_context(|| format!("cannot make the folder {}", self.out.display()))?;
        std::fs::write(&file, page::documents_alone(&section, &bench.finish())?)
            .with_context(|| format!("cannot write {}", file.display()))?;
        println!("{} rows: {}", chosen.len(), file.display());
        Ok(())
    }

    fn chosen(&self) -> Result<Vec<&'static DocumentRow>> {
        if let Some(unknown) = self.only.iter().find(|name| !rows().any(|row| row.id == **name)) {
            let known: Vec<&str> = rows().map(|row| row.id).collect();
            bail!("no row '{unknown}'; there are: {}", known.join(", "));
        }
        Ok(rows().filter(|row| self.only.is_empty() || self.only.iter().any(|name| name == row.id)).collect())
    }
}
