//! Equation 1 on a picture of a quay by night.

use anyhow::Result;
use glam::{DVec3, Vec3};
use image::{Rgb, RgbImage};

use super::{
    Exhibit, Figure, Line, Table, Workshop,
    canvas::brightened,
    quay::{Quay, SIZE, Surface, picture_of},
};
use crate::{
    parts::relight::{LitPixel, WAYS, bell},
    truth::files::{code, linear},
};

/// Radiance of white in the night's own light, and how far the lamp's reaches.
const WHITE: f32 = 0.02;
const LAMP: f64 = 9.0;

fn lamp() -> DVec3 {
    DVec3::new(1.6, 10.5, 2.6)
}

/// Radiance that the lamp gives white here; crates shade it.
fn lit(quay: &Quay, s: &Surface) -> f32 {
    let to = lamp() - s.at;
    let cosine = s.normal.dot(to.normalize()).max(0.0);
    if cosine == 0.0 || quay.blocks(s.at + s.normal * 1e-3, to.normalize(), to.length(), |_| true) {
        return 0.0;
    }
    (LAMP * cosine / to.length_squared()) as f32
}

/// Errors of all ways over the picture, and their pictures.
pub fn exhibits(_: &Workshop) -> Result<Vec<Exhibit>> {
    let quay = Quay::new(false);
    let surfaces = quay.look(|_| true);
    let lights: Vec<f32> = surfaces.iter().map(|s| s.as_ref().map_or(0.0, |s| lit(&quay, s))).collect();
    let albedo = |i: usize| surfaces[i].map_or(Vec3::splat(0.3), |s| s.albedo);
    let mut seen = picture_of(|i| albedo(i) * WHITE);
    for (i, value) in seen.iter_mut().enumerate() {
        *value = (f32::from(*value) + 1.5 * bell(i as u64) as f32).round().clamp(0.0, 255.0) as u8;
    }
    let truth = picture_of(|i| albedo(i) * (WHITE + lights[i]));
    let mut lines = Vec::new();
    let mut figures = vec![
        Figure::new(
            "The picture, eight times as bright as it is",
            "a quay by night, grainy",
            &brightened(&seen, 8.0),
        )?,
        Figure::new("Truth: the same with a real lamp", "a quay lit by a lamp", &truth)?,
    ];
    for (number, (method, setting, relight)) in WAYS.iter().enumerate() {
        let made = RgbImage::from_fn(SIZE.0, SIZE.1, |x, y| {
            let lit = lights[(y * SIZE.0 + x) as usize];
            Rgb(seen.get_pixel(x, y).0.map(|seen| relight(LitPixel { seen, white: WHITE, lit })))
        });
        let off: Vec<f64> = made.iter().zip(truth.iter()).map(|(a, b)| f64::from(a.abs_diff(*b))).collect();
        let mean = off.iter().sum::<f64>() / off.len() as f64;
        let worst = off.iter().copied().fold(0.0, f64::max);
        lines.push(
            Line::new([(*method).into(), (*setting).into(), mean.into(), worst.into()])
                .product_if(number == 0),
        );
        figures.push(Figure::new(format!("{method}, {setting}"), "the same lit by that way", &made)?);
    }
    let mut exhibits = vec![Exhibit::Table(Table {
        caption: "A virtual lamp over a picture of a quay by night, against the same quay with a real one"
            .into(),
        titles: vec!["method", "setting", "codes, mean", "worst code"],
        lines,
    })];
    exhibits.push(Exhibit::Figures(figures));
    exhibits.push(darkened());
    Ok(exhibits)
}

/// The nearest number of sixteen bits of floating point, as far as their mantissa goes.
fn half(value: f32) -> f32 {
    let bits = value.to_bits();
    f32::from_bits((bits + 0xfff + ((bits >> 13) & 1)) & !0x1fff)
}

/// Darkened and restored: what eight bits between cost.
fn darkened() -> Exhibit {
    let mut lines = Vec::new();
    for factor in [0.5_f32, 0.25, 0.1] {
        let in_codes = |c: u8| {
            let dark = (f32::from(c) * factor).round();
            (dark / factor).round().min(255.0) as u8
        };
        let in_linear = |c: u8| code((linear(code(linear(c) * factor)) / factor).min(1.0));
        let in_halves = |c: u8| code((half(linear(c) * factor) / factor).min(1.0));
        for (way, restore) in [
            ("in codes, eight bits between", &in_codes as &dyn Fn(u8) -> u8),
            ("in linear light, coded in eight bits between", &in_linear),
            ("in linear light, sixteen bits of floating point between", &in_halves),
        ] {
            let off: Vec<f64> = (0..=255).map(|c| f64::from(restore(c).abs_diff(c))).collect();
            let (mean, worst) = (off.iter().sum::<f64>() / 256.0, off.iter().copied().fold(0.0, f64::max));
            lines.push(Line::new([f64::from(factor).into(), way.into(), mean.into(), worst.into()]));
        }
    }
    Exhibit::Table(Table {
        caption: "All 256 codes darkened by F and restored. The product darkens nothing".into(),
        titles: vec!["F", "way", "codes, mean", "worst code"],
        lines,
    })
}
