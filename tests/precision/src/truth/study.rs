//! The truth's own error: noise between seeds, and what finer waves, cells and steps change.

use anyhow::Result;

use super::{
    cell::{CellSpec, Pictures, Setup, luminance},
    files::coded,
    masks,
};
use crate::metric::flip_mean;

/// One line of the study.
#[derive(Clone, Debug)]
pub struct Line {
    /// What was changed.
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

struct Made {
    pictures: Pictures,
    seconds: f64,
}

fn made(spec: &CellSpec) -> Result<(Setup, Made)> {
    let setup = Setup::new(spec)?;
    let start = std::time::Instant::now();
    let pictures = setup.render();
    Ok((setup, Made { pictures, seconds: start.elapsed().as_secs_f64() }))
}

fn change(pictures: &Pictures, mask: &[bool]) -> f64 {
    let value = |p: [f32; 3]| luminance(glam::Vec3::from_array(p).as_dvec3());
    let pairs = pictures.with.iter().zip(&pictures.without).zip(mask).filter(|(_, m)| **m);
    pairs.map(|((a, b), _)| value(*a) - value(*b)).sum()
}

/// Renders `spec` and its refinements.
pub fn lines(spec: &CellSpec) -> Result<Vec<Line>> {
    let (setup, base) = made(spec)?;
    let mask = masks::reflection(&setup, &base.pictures);
    let size = base.pictures.size;
    let whole = change(&base.pictures, &mask);
    let variant = |what: &'static str, edit: &dyn Fn(&mut CellSpec)| -> Result<Line> {
        let mut other = spec.clone();
        edit(&mut other);
        let (_, Made { pictures, seconds }) = made(&other)?;
        let flip = |a: &[[f32; 3]], b: &[[f32; 3]]| -> Result<f64> {
            Ok(flip_mean(&coded(a), &coded(b), size, &mask)?.unwrap_or(0.0))
        };
        Ok(Line {
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
pub fn table(name: &str, lines: &[Line]) -> String {
    let mut text = format!(
        "{name}\n| against the grid's cell | FLIP | without boat | change | cost |\n|---|---|---|---|---|\n"
    );
    for l in lines {
        text.push_str(&format!(
            "| {} | {:.4} | {:.4} | {:.3} | {:.2} |\n",
            l.what, l.flip, l.flip_without, l.change, l.cost
        ));
    }
    text
}
