//! `key.csv`: what each picture is.

use std::path::Path;

use anyhow::{Context, Result};
use bowwave_core::water::ReflectionMethod;
use bowwave_files::plain_text;
use bowwave_models::Boat;
use image::RgbImage;
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use super::design::{CONDITIONS, Design, StudyItem};

/// One picture; the factors are empty for real ones.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct KeyRow {
    /// Its name.
    pub picture: String,
    /// "real" or "generated".
    pub kind: String,
    /// How the sea mirrors.
    pub method: String,
    /// "on" or "off".
    pub shadow: String,
    /// Which sea.
    pub background: String,
    /// "textured" or "virtual".
    pub boat_type: String,
    /// The boat, or the file of a real picture.
    pub source: String,
    /// The study's name; empty in keys of former versions.
    #[serde(default)]
    pub study: String,
}

/// How to read a factor from a row.
pub type FactorLevel = fn(&KeyRow) -> &str;

/// Names of the factors, and how to read each.
pub const FACTORS: [(&str, FactorLevel); 4] = [
    ("method", |row| row.method.as_str()),
    ("shadow", |row| row.shadow.as_str()),
    ("background", |row| row.background.as_str()),
    ("type", |row| row.boat_type.as_str()),
];

/// A study's name, a hash of its pictures' files: other studies' pictures have the same names.
pub fn study_of(files: &[Vec<u8>]) -> String {
    let mut hash = Sha256::new();
    files.iter().for_each(|file| hash.update(file));
    hash.finalize().iter().take(4).map(|byte| format!("{byte:02x}")).collect()
}

/// The key of a design.
pub fn rows(
    study: &str,
    design: &Design,
    backgrounds: &[String; 2],
    methods: [ReflectionMethod; 2],
    real: &[(String, RgbImage)],
) -> Vec<KeyRow> {
    let row = |(index, item): (usize, &StudyItem)| {
        let empty = KeyRow {
            picture: design.name(index),
            kind: "real".to_owned(),
            method: String::new(),
            shadow: String::new(),
            background: String::new(),
            boat_type: String::new(),
            source: String::new(),
            study: study.to_owned(),
        };
        match *item {
            StudyItem::Real(number) => KeyRow { source: real[number].0.clone(), ..empty },
            StudyItem::Generated { condition, replicate } => {
                let condition = CONDITIONS[condition];
                KeyRow {
                    kind: "generated".to_owned(),
                    method: methods[usize::from(condition.second_method)].name().to_owned(),
                    shadow: if condition.shadow { "on" } else { "off" }.to_owned(),
                    background: backgrounds[usize::from(condition.second_background)].clone(),
                    boat_type: if condition.textured { "textured" } else { "virtual" }.to_owned(),
                    source: Boat::ALL[replicate % Boat::ALL.len()].name().to_owned(),
                    ..empty
                }
            }
        }
    };
    design.items.iter().enumerate().map(row).collect()
}

/// Writes the key.
pub fn write(path: &Path, rows: &[KeyRow]) -> Result<()> {
    let told = || format!("cannot write {}; check the disk", path.display());
    let mut writer = csv::Writer::from_path(path).with_context(told)?;
    for row in rows {
        writer.serialize(row).with_context(told)?;
    }
    writer.flush().with_context(told)
}

/// The longest key, or file of answers, that is read: a hundred participants with a thousand pictures each.
pub const TABLE_BYTES_MAX: usize = 16 << 20;

/// Reads a key.
pub fn read(path: &Path) -> Result<Vec<KeyRow>> {
    let told = || format!("cannot read the key {}; name the key.csv of the study with --key", path.display());
    let text = plain_text(path, TABLE_BYTES_MAX).with_context(told)?;
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let rows: Vec<KeyRow> = reader.deserialize().collect::<Result<_, _>>().with_context(told)?;
    anyhow::ensure!(!rows.is_empty(), "the key {} names no picture", path.display());
    for row in &rows {
        anyhow::ensure!(
            matches!(row.kind.as_str(), "real" | "generated"),
            "the key {} calls {} '{}'; it must be real or generated",
            path.display(),
            row.picture,
            row.kind
        );
    }
    Ok(rows)
}
