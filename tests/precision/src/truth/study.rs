//! The truth's own error: noise between seeds, and what finer waves, cells and steps change.

use anyhow::Result;

use super::{
    cell::{CellPictures, CellSetup, CellSpec, luminance},
    files::coded,
    masks,
};
use crate::{metric::flip_mean, table};

/// One line of the study.
#[derive(Clone, Debug)]
pub struct StudyLine {
    /// The change.
    pub what: &'static str,
    /// Mean FLIP in the reflection's region, against the cell as the grid renders it, of the picture with the boat.
    pub flip: f64,
    /// The same of the picture without it.
    pub flip_without: f64,
    /// Mean change that the boat makes to the luminance there, over that of the grid's cell.
    pub change: f64,
    /// Processor time of the picture, seconds, over that of the grid's cell.
    pub cost: f64,
}

struct TimedPictures {
    pictures: CellPictures,
    seconds: f64,
}

fn made(spec: &CellSpec) -> Result<(CellSetup, TimedPictures)> {
    let setup = CellSetup::new(spec)?;
    let start = std::time::Instant::now();
    let pictures = setup.render();
    Ok((setup, TimedPictures { pictures, seconds: start.elapsed().as_secs_f64() }))
}

fn change(pictures: &CellPictures, mask: &[bool]) -> f64 {
    let value = |p: [f32; 3]| luminance(glam::Vec3::from_array(p).as_dvec3());
    let pairs = pictures.with.iter().zip(&pictures.without).zip(mask).filter(|(_, m)| **m);
    pairs.map(|((a, b), _)| value(*a) - value(*b)).sum()
}

/// Renders `spec` and its refinements.
pub fn lines(spec: &CellSpec) -> Result<Vec<StudyLine>> {
    let (setup, base) = made(spec)?;
    let mask = masks::reflection(&setup, &base.pictures);
    let size = base.pictures.size;
    let whole = change(&base.pictures, &mask);
    let variant = |what: &'static str, edit: &dyn Fn(&mut CellSpec)| -> Result<StudyLine> {
        let mut other = spec.clone();
        edit(&mut other);
        let (_, TimedPictures { pictures, seconds }) = made(&other)?;
        let flip = |a: &[[f32; 3]], b: &[[f32; 3]]| -> Result<f64> {
            Ok(flip_mean(&coded(a), &coded(b), size, &mask)?.unwrap_or(0.0))
        };
        Ok(StudyLine {
            what,
            flip: flip(&base.pictures.with, &pictures.with)?,
            flip_without: flip(&base.pictures.without, &pictures.without)?,
            change: change(&pictures, &mask) / whole,
            cost: seconds / base.seconds,
        })
    };
    Ok(vec![
        variant("a quarter of the paths", &|s| s.samples = (s.samples / 4).max(1))?,
        variant("other paths, as many", &|s| s.noise_seed += 1)?,
        variant("other paths, four times as many", &|s| {
            s.noise_seed += 2;
            s.samples *= 4;
        })?,
        variant("steps half as long", &|s| s.resolution.step_refine *= 2.0)?,
        variant("cells half as wide", &|s| s.resolution.oversample *= 2)?,
        variant("waves down to half the length", &|s| s.resolution.shortest_m /= 2.0)?,
        variant("waves only down to twice the length", &|s| s.resolution.shortest_m *= 2.0)?,
        variant("other waves", &|s| s.wave_seed += 1)?,
    ])
}

/// The lines as text.
pub fn table(name: &str, lines: &[StudyLine]) -> String {
    let titles = ["against the grid's cell", "FLIP", "without boat", "change", "cost"];
    let rows = lines.iter().map(|l| {
        vec![
            l.what.to_owned(),
            format!("{:.4}", l.flip),
            format!("{:.4}", l.flip_without),
            format!("{:.3}", l.change),
            format!("{:.2}", l.cost),
        ]
    });
    format!("{name}\n{}", table::markdown(&titles, rows))
}
