//! Perez and Preetham's sky and the product's, side by side, and boats in their light.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use anyhow::Result;
use bowwave_core::{
    colour::LUMINANCE,
    estimate::light::Light,
    own_ship::Phantoms,
    sky::{ClearSky, SkyLobes, SkyModel as _},
};
use bowwave_models::resolve;
use glam::{DVec3, Vec3};
use image::{Rgb, RgbImage};

use super::{
    Cell, Exhibit, Figure, Line, Table, Workshop,
    canvas::{SeaShot, around, crop},
};
use crate::{
    parts::ambient::spiral,
    path_traced::{Kind, TracedLight},
    sky::{direction, models::Preetham},
    truth::files::code,
};

/// Number of the product's clear sky, whose turbidity both have.
const NUMBER: usize = 4;
/// Turbidity of hazy air, within what Preetham fitted.
const HAZY: f64 = 8.0;
/// Suns, degrees.
const SUNS_DEG: [f64; 6] = [60.0, 20.0, 5.0, 1.0, -2.0, -6.0];
/// Lowest elevation of a picture, degrees.
const LOW_DEG: f64 = -6.0;

/// Luminance by equations 5 to 7 as printed, kcd/m^2: Perez's function with Preetham's coefficients, and his zenith.
fn printed(d: DVec3, sun: DVec3, turbidity: f64) -> f64 {
    let t = turbidity;
    let [a, b, c, dd, e] = [
        0.1787 * t - 1.4630,
        -0.3554 * t + 0.4275,
        -0.0227 * t + 5.3251,
        0.1206 * t - 2.5771,
        -0.0670 * t + 0.3703,
    ];
    let theta_sun = FRAC_PI_2 - sun.z.asin();
    let chi = (4.0 / 9.0 - t / 120.0) * (PI - 2.0 * theta_sun);
    let zenith = (4.0453 * t - 4.9710) * chi.tan() - 0.2155 * t + 2.4192;
    let perez = |cosine: f64, gamma: f64| {
        (1.0 + a * (b / cosine).exp()) * (1.0 + c * (dd * gamma).exp() + e * gamma.cos().powi(2))
    };
    zenith * perez(d.z, d.dot(sun).clamp(-1.0, 1.0).acos()) / perez(1.0, theta_sun)
}

/// Shares of directions at which a sky is negative, and infinite or more than a thousand times its own mean.
fn broken(luminance: impl Fn(DVec3) -> f64, low: f64) -> [f64; 2] {
    let all: Vec<f64> = spiral(8000).filter(|d| d.z > low).map(luminance).collect();
    let count = all.len() as f64;
    let share = |is: &dyn Fn(f64) -> bool| 100.0 * all.iter().filter(|v| is(**v)).count() as f64 / count;
    [share(&|v| v < 0.0), share(&|v| !v.is_finite() || v.abs() > 1e4)]
}

/// Tables and panoramas.
pub fn exhibits(_: &Workshop) -> Result<Vec<Exhibit>> {
    let turbidity = ClearSky::TURBIDITIES[NUMBER];
    let (mut lines, mut figures) = (Vec::new(), Vec::new());
    let low = LOW_DEG.to_radians().sin();
    for sun_deg in SUNS_DEG {
        let sun = direction(0.0, sun_deg.to_radians());
        let product = ClearSky::new(NUMBER, sun);
        let of_product = |d: DVec3| f64::from(product.radiance(d).dot(LUMINANCE));
        let of_printed = |turbidity: f64, low: f64| broken(move |d| printed(d, sun, turbidity), low);
        for (way, [negative, infinite], is_product) in [
            (format!("eq. 5 to 7 as printed, turbidity {turbidity}"), of_printed(turbidity, low), false),
            ("the same above the horizon alone".into(), of_printed(turbidity, 0.0), false),
            (format!("turbidity {HAZY}, above the horizon alone"), of_printed(HAZY, 0.0), false),
            ("the product's atmosphere".into(), broken(of_product, low), true),
        ] {
            let cells = [sun_deg.into(), Cell::Text(way), negative.into(), infinite.into()];
            lines.push(Line::new(cells).product_if(is_product));
        }
        if sun_deg != 1.0 {
            let preetham = Preetham::new(sun, turbidity);
            let caption = |whose: &str| format!("{whose}, sun at {sun_deg:.0} degrees");
            figures.push(Figure::new(
                caption("Preetham"),
                "a panorama of a sky, what is negative or infinite in magenta",
                &panorama(|d| (d.z > 0.0).then(|| preetham.radiance(d))),
            )?);
            figures.push(Figure::new(
                caption("The product"),
                "a panorama of a sky",
                &panorama(|d| Some(product.radiance(d))),
            )?);
        }
    }
    Ok(vec![
        Exhibit::Table(Table {
            caption: format!(
                "Directions from {LOW_DEG} degrees of elevation up at which the sky's luminance is no light"
            ),
            titles: vec!["sun, deg", "sky", "negative, %", "infinite or over 10^4, %"],
            lines,
        }),
        Exhibit::Figures(figures),
    ])
}

/// All azimuths from the lowest elevation to 60 degrees, exposed by its own mean; what is no light is magenta.
fn panorama(radiance: impl Fn(DVec3) -> Option<Vec3>) -> RgbImage {
    const PANORAMA: (u32, u32) = (360, 99);
    const TOP_DEG: f64 = 60.0;
    let of = |x: u32, y: u32| {
        let azimuth = (f64::from(x) + 0.5) / f64::from(PANORAMA.0) * TAU - PI;
        let elevation_deg = TOP_DEG - (f64::from(y) + 0.5) / f64::from(PANORAMA.1) * (TOP_DEG - LOW_DEG);
        radiance(direction(azimuth, elevation_deg.to_radians()))
    };
    let mut bright: Vec<f32> = (0..PANORAMA.0 * PANORAMA.1)
        .step_by(37)
        .filter_map(|i| of(i % PANORAMA.0, i / PANORAMA.0))
        .map(|l| l.max_element())
        .filter(|v| v.is_finite() && *v > 0.0)
        .collect();
    bright.sort_by(f32::total_cmp);
    let gain = 0.7 / bright.get(bright.len() * 3 / 4).copied().unwrap_or(1.0);
    RgbImage::from_fn(PANORAMA.0, PANORAMA.1, |x, y| match of(x, y) {
        Some(light) if light.is_finite() && light.dot(LUMINANCE) >= 0.0 => {
            Rgb((light * gain).clamp(Vec3::ZERO, Vec3::ONE).to_array().map(code))
        }
        _ => Rgb([255, 0, 255]),
    })
}

/// A boat in the whole sky's light, in an even one, and without what it hides of the sky from itself.
pub fn on_objects(_: &Workshop) -> Result<Vec<Exhibit>> {
    let models = [resolve("rhib", std::path::Path::new(""))?];
    let (mut figures, mut lines) = (Vec::new(), Vec::new());
    for (words, kind, sun_deg) in [
        ("clear, sun at 12 degrees", Kind::Clear, [12.0, 300.0]),
        ("overcast", Kind::Overcast, [40.0, 140.0]),
    ] {
        let shot = SeaShot::new(sun_deg, 20_000.0)?;
        let light = TracedLight::new(kind, shot.sun, 0.8)?.product();
        let pose = shot.afloat(30.0, 0.0, 75.0);
        let scene = |light: Light| shot.scene(light, &models, &[(0, pose)], 20_000.0);
        let draw = |light: Light| shot.draw(&scene(light)?, &models, Phantoms::default());
        let (whole, even) = (draw(light)?, draw(Light { dome: SkyLobes::even(light.sky), ..light })?);
        let part = around(&scene(light)?)?;
        let (a, b) = (crop(&whole, part, 3), crop(&even, part, 3));
        let off: Vec<f64> = a.iter().zip(b.iter()).map(|(a, b)| f64::from(a.abs_diff(*b))).collect();
        let worst = off.iter().copied().fold(0.0, f64::max);
        let changed = off.iter().filter(|v| **v > 2.0).count() as f64 / off.len() as f64 * 100.0;
        lines.push(Line::new([words.into(), changed.into(), worst.into()]));
        figures.push(Figure::new(format!("{words}: an even sky"), "a rubber boat in even light", &b)?);
        figures.push(Figure::new(
            format!("{words}: the sky's nine polynomials"),
            "a rubber boat in the sky's light",
            &a,
        )?);
    }
    Ok(vec![
        Exhibit::Table(Table {
            caption: "Change of the picture around the boat by the directions of the sky's light".into(),
            titles: vec!["light", "values off by more than two codes, %", "most, codes"],
            lines,
        }),
        Exhibit::Figures(figures),
    ])
}
