//! Public recordings beside the repository, which are not part of it: what needs one is left out, with a word, where it is absent.

use std::{fs::File, path::Path, path::PathBuf};

use anyhow::{Context as _, Result, anyhow, bail};
use matfile::{MatFile, NumericData};

/// A file or folder of the public recordings (`../shared/data` beside the repository); `None`, and a word of it, where it is absent.
pub fn find(name: &str) -> Option<PathBuf> {
    beside(&format!("data/{name}"))
}

/// A file or folder of the tables of reference (`../shared/reference` beside the repository); `None`, and a word of it, where it is
/// absent.
pub fn find_reference(name: &str) -> Option<PathBuf> {
    beside(&format!("reference/{name}"))
}

fn beside(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared").join(name);
    if path.exists() {
        return Some(path);
    }
    println!("skipped: ../shared/{name} is absent, and with it what is measured on it");
    None
}

/// An array of a MATLAB file.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// Its size along each dimension.
    pub size: Vec<usize>,
    /// Its values, the first dimension fastest.
    pub values: Vec<f64>,
}

impl Array {
    /// Rows of an array of two dimensions, each of `N` numbers.
    pub fn rows<const N: usize>(&self) -> Result<Vec<[f64; N]>> {
        let [rows, columns] = self.size[..] else { bail!("an array of size {:?} has no rows", self.size) };
        if columns != N || self.values.len() != rows * columns {
            bail!("an array of size {:?} does not have {N} columns", self.size);
        }
        Ok((0..rows).map(|row| std::array::from_fn(|column| self.values[column * rows + row])).collect())
    }
}

/// The arrays of a MATLAB file (format 5) by these names.
pub fn arrays<const N: usize>(path: &Path, names: [&str; N]) -> Result<[Array; N]> {
    let file = File::open(path).with_context(|| format!("cannot open {}", path.display()))?;
    let file = MatFile::parse(file).map_err(|e| anyhow!("{} is no MATLAB file: {e}", path.display()))?;
    let mut found = Vec::with_capacity(N);
    for name in names {
        let array = file.find_by_name(name).with_context(|| format!("{} has no {name}", path.display()))?;
        let values = reals(array.data());
        found.push(Array { size: array.size().clone(), values });
    }
    found.try_into().map_err(|_| anyhow!("as many arrays as names"))
}

fn reals(data: &NumericData) -> Vec<f64> {
    match data {
        NumericData::Int8 { real, .. } => real.iter().map(|v| f64::from(*v)).collect(),
        NumericData::UInt8 { real, .. } => real.iter().map(|v| f64::from(*v)).collect(),
        NumericData::Int16 { real, .. } => real.iter().map(|v| f64::from(*v)).collect(),
        NumericData::UInt16 { real, .. } => real.iter().map(|v| f64::from(*v)).collect(),
        NumericData::Int32 { real, .. } => real.iter().map(|v| f64::from(*v)).collect(),
        NumericData::UInt32 { real, .. } => real.iter().map(|v| f64::from(*v)).collect(),
        NumericData::Int64 { real, .. } => real.iter().map(|v| *v as f64).collect(),
        NumericData::UInt64 { real, .. } => real.iter().map(|v| *v as f64).collect(),
        NumericData::Single { real, .. } => real.iter().map(|v| f64::from(*v)).collect(),
        NumericData::Double { real, .. } => real.clone(),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
mod tests {
    use super::*;

    #[test]
    fn reads_a_trial_and_a_video() {
        let Some(folder) = find("imu_groundtruth/broad") else { return };
        let trial = folder.join("02_undisturbed_slow_rotation_B.mat");
        let [gyro, truth, rate] = arrays(&trial, ["imu_gyr", "opt_quat", "sampling_rate"]).unwrap();
        assert!((rate.values[0] - 285.714).abs() < 0.01, "{rate:?}");
        assert_eq!(gyro.rows::<3>().unwrap().len(), truth.rows::<4>().unwrap().len());
        assert!(gyro.rows::<4>().is_err());
        let Some(video) = find("sea/schwendeman_ship_horizon/SampleVideoFrames.mat") else { return };
        let [frames] = arrays(&video, ["VideoFrames"]).unwrap();
        assert_eq!(frames.size, [480, 720, 13]);
    }
}
