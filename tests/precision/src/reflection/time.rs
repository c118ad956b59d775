//! How reflections move: frame-to-frame change against the truth's.

use std::{collections::BTreeMap, path::PathBuf};

use anyhow::{Context, Result, ensure};
use bowwave_core::water::ReflectionMethod;
use image::RgbImage;

use super::{
    cell::TruthCell,
    draw::{Beliefs, DrawingStudio},
    grid::METHODS,
    methods_table,
};
use crate::truth::{cell::CellSpec, files, grid::name};

/// Frames this far apart or closer are neighbours, seconds.
const STEP_MAX_S: f64 = 0.15;

/// Two frames of one scene, the earlier one first.
#[derive(Clone, Debug, PartialEq)]
pub struct FramePair {
    /// Distance of the boat, whole metres.
    pub range_m: u32,
    /// Sea state of the thesis.
    pub state: u8,
    /// Their folders.
    pub folders: [PathBuf; 2],
}

/// Finds the frames among some cells that follow each other.
pub fn pairs(folders: &[PathBuf]) -> Result<Vec<FramePair>> {
    let mut scenes: BTreeMap<String, Vec<(CellSpec, PathBuf)>> = BTreeMap::new();
    for folder in folders {
        let spec = files::read(folder)?.spec;
        let key = name(&CellSpec { time_s: 0.0, ..spec.clone() });
        scenes.entry(key).or_default().push((spec, folder.clone()));
    }
    let mut found = Vec::new();
    for frames in scenes.values_mut() {
        frames.sort_by(|a, b| a.0.time_s.total_cmp(&b.0.time_s));
        for two in frames.windows(2) {
            let [(a, first), (b, second)] = two else { continue };
            if b.time_s - a.time_s > STEP_MAX_S {
                continue;
            }
            let alike = CellSpec { time_s: b.time_s, ..a.clone() };
            ensure!(alike == *b, "{} and {} differ in more than time", first.display(), second.display());
            let folders = [first.clone(), second.clone()];
            found.push(FramePair { range_m: a.range_m.round() as u32, state: a.state, folders });
        }
    }
    ensure!(
        !found.is_empty(),
        "no two cells are neighbours in time; `precision truth cell --time 0.1` makes the second of two"
    );
    Ok(found)
}

/// ChangeSums over pixels of a change `a` and the truth's change `b`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ChangeSums {
    count: f64,
    a: f64,
    b: f64,
    aa: f64,
    bb: f64,
    ab: f64,
}

impl ChangeSums {
    fn add(&mut self, a: f64, b: f64) {
        *self = self.and(&Self { count: 1.0, a, b, aa: a * a, bb: b * b, ab: a * b });
    }

    fn and(&self, o: &Self) -> Self {
        Self {
            count: self.count + o.count,
            a: self.a + o.a,
            b: self.b + o.b,
            aa: self.aa + o.aa,
            bb: self.bb + o.bb,
            ab: self.ab + o.ab,
        }
    }

    /// Pearson's correlation; 0 where one of them does not change.
    pub fn correlation(&self) -> f64 {
        let covariance = self.ab - self.a * self.b / self.count;
        let variances = (self.aa - self.a * self.a / self.count) * (self.bb - self.b * self.b / self.count);
        if variances > 0.0 { covariance / variances.sqrt() } else { 0.0 }
    }

    /// Mean square change over the truth's.
    pub fn energy(&self) -> f64 {
        self.aa / self.bb
    }
}

/// One pair by method: how the picture changes, and how what the boat adds to it does. Both in luma of sRGB codes, over the pixels of
/// either region that the hull leaves free in both frames.
#[derive(Clone, Debug)]
pub struct ChangeRow {
    /// Distance of the boat, whole metres.
    pub range_m: u32,
    /// Sea state of the thesis.
    pub state: u8,
    /// The picture.
    pub picture: [ChangeSums; METHODS],
    /// The part that the boat adds.
    pub added: [ChangeSums; METHODS],
    /// Picture and what the boat adds of a method that is right but for the truth's noise, where that was asked for.
    pub noise: Option<[ChangeSums; 2]>,
}

/// Draws both frames with every method; `noise` renders them again.
pub fn measure(studio: &mut DrawingStudio, pair: &FramePair, noise: bool) -> Result<ChangeRow> {
    let [first, second] = [TruthCell::load(&pair.folders[0])?, TruthCell::load(&pair.folders[1])?];
    ensure!(first.size() == second.size(), "{} and its neighbour have different sizes", first.name);
    let open = |cell: &TruthCell, i: usize| cell.hull.as_raw()[i] == 0;
    let judged: Vec<usize> = (0..first.region.len())
        .filter(|&i| (first.region[i] || second.region[i]) && open(&first, i) && open(&second, i))
        .collect();
    let change = |a: &RgbImage, b: &RgbImage| -> Vec<f64> {
        let luma = |p: &RgbImage, i: usize| luma(&p.as_raw()[3 * i..3 * i + 3]);
        judged.iter().map(|&i| luma(b, i) - luma(a, i)).collect()
    };
    let truth = change(&first.with, &second.with);
    let sea = change(&first.without, &second.without);
    let sums = |a: &RgbImage, b: &RgbImage| {
        let (mut whole, mut part) = (ChangeSums::default(), ChangeSums::default());
        for ((got, want), sea) in change(a, b).iter().zip(&truth).zip(&sea) {
            whole.add(*got, *want);
            part.add(got - sea, want - sea);
        }
        [whole, part]
    };
    let mut picture = Vec::with_capacity(METHODS);
    let mut added = Vec::with_capacity(METHODS);
    for method in ReflectionMethod::ALL {
        let [a, b] = [&first, &second].map(|cell| studio.draw(cell, method, &Beliefs::right(cell)));
        let [whole, part] = sums(&a?, &b?);
        picture.push(whole);
        added.push(part);
    }
    let noise = if noise { Some(sums(&first.renewed()?, &second.renewed()?)) } else { None };
    Ok(ChangeRow {
        range_m: pair.range_m,
        state: pair.state,
        picture: picture.try_into().ok().context("a method is missing")?,
        added: added.try_into().ok().context("a method is missing")?,
        noise,
    })
}

/// BT.709 luma, codes 0 to 255.
fn luma(p: &[u8]) -> f64 {
    0.212_6 * f64::from(p[0]) + 0.715_2 * f64::from(p[1]) + 0.072_2 * f64::from(p[2])
}

/// Correlation and energy by range and state, the pairs of each taken together.
pub fn summary(rows: &[ChangeRow]) -> String {
    let mut text = format!(
        "{} pairs of frames; correlation with the truth's change (mean square change over the truth's)\n",
        rows.len()
    );
    for (part, what) in ["picture", "what the boat adds"].into_iter().enumerate() {
        let mut groups: BTreeMap<(u32, u8), [ChangeSums; METHODS + 1]> = BTreeMap::new();
        for row in rows {
            let sums = groups.entry((row.range_m, row.state)).or_default();
            let noise = row.noise.map(|noise| noise[part]);
            let of = if part == 0 { &row.picture } else { &row.added };
            sums.iter_mut().zip(of.iter().chain(&noise)).for_each(|(sum, one)| *sum = sum.and(one));
        }
        let mut table = methods_table(what, 20, &[("right but for noise", 19)]);
        for ((range, state), sums) in groups {
            let cells = sums.map(|s| match s.count {
                0.0 => "-".to_owned(),
                _ => format!("{:.3} ({:.2})", s.correlation(), s.energy()),
            });
            table.row([format!("{range} m, state {state}")].into_iter().chain(cells));
        }
        text = text + "\n" + &table.take();
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_twice_as_great_correlates_wholly_and_has_four_times_the_energy() {
        let mut sums = ChangeSums::default();
        (0..50).for_each(|i| sums.add(2.0 * f64::from(i - 20), f64::from(i - 20)));
        assert!((sums.correlation() - 1.0).abs() < 1e-12 && (sums.energy() - 4.0).abs() < 1e-12);
        let mut none = ChangeSums::default();
        (0..50).for_each(|i| none.add(0.0, f64::from(i)));
        assert_eq!((none.correlation(), none.energy()), (0.0, 0.0));
        // Every second one against: half of 50 squares agree.
        let mut half = ChangeSums::default();
        (0..50)
            .for_each(|i| half.add(if i % 2 == 0 { 1.0 } else { -1.0 }, if i % 4 < 2 { 1.0 } else { -1.0 }));
        assert!(half.correlation().abs() < 0.05, "{}", half.correlation());
    }
}
