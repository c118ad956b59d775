//! The sequences of sections 4.4.4 and 4.4.5, stage by stage, by the report's own volumes.

use anyhow::{Context as _, Result};
use glam::{DVec3, Vec3};
use image::RgbImage;

use super::{
    Exhibit, Figure, Line, Table, Workshop,
    quay::{Quay, Standing, Surface, picture_of},
};
use crate::{
    shadows::{FIVE_STAGES, FOUR_STAGES, METHODS, NamedMethod, ShadowFrame, mesh::CasterMesh},
    truth::files::linear,
};

/// The factor of stages two and five.
const DARKENED: f32 = 0.35;
/// Light of sky and sun on the real quay, and what the virtual light adds to what faces it.
const AMBIENT: f32 = 0.5;
const LIGHT: f32 = 1.1;

fn towards() -> DVec3 {
    DVec3::new(0.72, -0.25, 0.62).normalize()
}

fn volumes(setting: &str) -> Result<&'static NamedMethod> {
    let is = |named: &&NamedMethod| {
        named.method == "shadow volumes" && named.setting.contains(setting) && !named.four_points
    };
    METHODS.iter().find(is).context("the report has no such shadow volumes")
}

/// Whether each pixel is in shadow of the things that a test says yes to, by volumes.
fn counted(
    quay: &Quay,
    named: &NamedMethod,
    surfaces: &[Option<Surface>],
    has: impl Fn(&Standing) -> bool,
) -> Vec<bool> {
    let seen = quay.seen(surfaces);
    let meshes: Vec<CasterMesh> = quay.things.iter().filter(|t| has(t)).map(|t| t.caster.clone()).collect();
    let mut method = (named.make)();
    method.prepare(&ShadowFrame { sun: towards().as_vec3(), meshes: &meshes, eye: quay.eye() }, &seen);
    let dark = |pixel: &[u32]| {
        seen.points[pixel[0] as usize..pixel[1] as usize].first().is_some_and(|p| method.share(p) < 0.5)
    };
    seen.first.windows(2).map(dark).collect()
}

/// The same by rays.
fn traced(quay: &Quay, surfaces: &[Option<Surface>], has: impl Fn(&Standing) -> bool) -> Vec<bool> {
    let dark = |s: &Surface| quay.blocks(s.at + s.normal * 1e-3, towards(), f64::INFINITY, &has);
    surfaces.iter().map(|s| s.as_ref().is_some_and(dark)).collect()
}

/// What the camera sees without anything virtual.
fn captured(surface: &Option<Surface>) -> Vec3 {
    surface.map_or(Vec3::new(0.5, 0.58, 0.68), |s| s.albedo * AMBIENT * (0.6 + 0.4 * s.normal.z as f32))
}

fn facing(s: &Surface) -> f32 {
    s.normal.dot(towards()).max(0.0) as f32
}

/// Pictures of all stages, and how many pixels both ways of counting have wrong.
pub fn volumes_exhibits(_: &Workshop) -> Result<Vec<Exhibit>> {
    let quay = Quay::new(true);
    let depth_fail = volumes("depth-fail, to infinity")?;
    let (five, left) = five_stages(&quay, depth_fail)?;
    let four = four_stages(&quay, depth_fail, &left)?;
    Ok(vec![errors(depth_fail)?, Exhibit::Figures(five), Exhibit::Figures(four)])
}

/// Virtual on real: each stage, and the picture that they leave.
fn five_stages(quay: &Quay, named: &NamedMethod) -> Result<(Vec<Figure>, RgbImage)> {
    let real = quay.look(|t| t.is_real);
    let shadow = counted(quay, named, &real, |t| !t.is_real);
    let seen = |i: usize| captured(&real[i]);
    let depth =
        picture_of(|i| real[i].map_or(Vec3::ZERO, |s| Vec3::splat((1.0 - s.depth / 40.0).max(0.02) as f32)));
    let darkened = |i: usize| if real[i].is_none() { seen(i) * DARKENED } else { seen(i) };
    let stencil = picture_of(|i| if shadow[i] { Vec3::new(0.8, 0.2, 0.1) } else { seen(i) * 0.25 });
    let lit = |i: usize| match real[i] {
        Some(s) if !shadow[i] => seen(i) * (DARKENED + LIGHT * facing(&s)),
        _ => darkened(i),
    };
    let last = |i: usize| if shadow[i] && real[i].is_some() { seen(i) * DARKENED } else { lit(i) };
    let pictures = [depth, picture_of(darkened), stencil, picture_of(lit), picture_of(last)];
    let mut figures =
        vec![Figure::new("4.4.4: the captured picture", "a quay with two crates", &picture_of(seen))?];
    for (i, (stage, picture)) in FIVE_STAGES.iter().zip(&pictures).enumerate() {
        figures.push(Figure::new(
            format!("4.4.4, stage {}: {}", i + 1, stage.task),
            format!("the quay after stage {}", i + 1),
            picture,
        )?);
    }
    Ok((figures, picture_of(last)))
}

/// On virtual: each stage over the picture of the first sequence.
fn four_stages(quay: &Quay, named: &NamedMethod, before: &RgbImage) -> Result<Vec<Figure>> {
    let whole = quay.look(|_| true);
    let boat = |i: usize| whole[i].filter(|s| s.thing.is_some_and(|t| !quay.things[t].is_real));
    let shadow = counted(quay, named, &whole, |_| true);
    let codes = before.as_raw();
    let back = |i: usize| Vec3::from_array([0, 1, 2].map(|c| linear(codes[3 * i + c])));
    let ambient = |i: usize| {
        boat(i).map_or_else(|| back(i), |s| s.albedo * AMBIENT * DARKENED * (0.6 + 0.4 * s.normal.z as f32))
    };
    let stencil =
        |i: usize| if shadow[i] && boat(i).is_some() { Vec3::new(0.8, 0.2, 0.1) } else { ambient(i) * 0.5 };
    let lit = |i: usize| match boat(i) {
        Some(s) if !shadow[i] => ambient(i) + s.albedo * AMBIENT * LIGHT * facing(&s),
        _ => ambient(i),
    };
    let pictures = [picture_of(back), picture_of(ambient), picture_of(stencil), picture_of(lit)];
    let mut figures = Vec::new();
    for (i, (stage, picture)) in FOUR_STAGES.iter().zip(&pictures).enumerate() {
        figures.push(Figure::new(
            format!("4.4.5, stage {}: {}", i + 1, stage.task),
            format!("the quay with the virtual boat after stage {}", i + 1),
            picture,
        )?);
    }
    Ok(figures)
}

/// Pixels that are wrongly lit or shaded, for an eye before the quay and for one within the boat's shadow.
fn errors(depth_fail: &NamedMethod) -> Result<Exhibit> {
    let printed = volumes("as printed")?;
    let boat = DVec3::new(-0.3, 13.5, 1.0);
    let shaded = boat - towards() * 2.2;
    let mut lines = Vec::new();
    for (words, quay) in [
        ("before the quay", Quay::new(true)),
        ("within the boat's shadow", Quay::new(true).from(shaded.with_z(shaded.z.max(0.15)), -0.9, -0.03)),
    ] {
        let whole = quay.look(|_| true);
        let truth = traced(&quay, &whole, |_| true);
        for (named, is_printed) in [(printed, true), (depth_fail, false)] {
            let made = counted(&quay, named, &whole, |_| true);
            let wrong =
                made.iter().zip(&truth).zip(&whole).filter(|((a, b), s)| s.is_some() && a != b).count();
            let all = whole.iter().flatten().count().max(1);
            let way = if is_printed {
                "counted before what is seen, as printed"
            } else {
                "counted behind it, to infinity, with caps"
            };
            lines.push(Line::new([words.into(), way.into(), (100.0 * wrong as f64 / all as f64).into()]));
        }
    }
    Ok(Exhibit::Table(Table {
        caption: "Pixels in shadow by volumes and not by rays, or the other way round".into(),
        titles: vec!["eye", "way", "wrong, %"],
        lines,
    }))
}
