//! Pictures by the product's renderer: phantoms, lamps, shadows, haze.

use anyhow::{Context as _, Result};
use bowwave_core::{
    estimate::light::Light,
    frame::{
        fires::Burning,
        lamps::LampView,
        scene::{LeftOut, Pass, PassDecision, Scene},
        searchlight::SearchlightView,
    },
    model::Model,
    own_ship::{Phantom, Phantoms},
    physics::haze_share,
    sky::SkyLobes,
    world::searchlight::SearchlightSpec,
};
use bowwave_models::resolve;
use glam::{DVec2, DVec3, Vec3};
use image::RgbImage;

use super::{
    Cell, Exhibit, Figure, Line, Table, Workshop,
    canvas::{SIZE, SeaShot, around, crop},
};
use crate::truth::files::{code, linear};

fn models(names: &[&str]) -> Result<Vec<Model>> {
    names.iter().map(|name| Ok(resolve(name, std::path::Path::new(""))?)).collect()
}

/// Barrel and front sight before the picture, as the outline has them.
fn gun() -> Vec<Phantom> {
    let phantom = |name, corners: &[[f64; 2]]| {
        Phantom::new(name, corners.iter().map(|c| DVec2::from_array(*c)).collect(), SIZE)
    };
    vec![
        phantom("barrel", &[[301.0, 205.0], [339.0, 205.0], [376.0, 360.0], [262.0, 360.0]]),
        phantom("sight", &[[313.0, 158.0], [324.0, 158.0], [326.0, 214.0], [311.0, 214.0]]),
    ]
}

/// Width of an edge in a picture of that height, pixels.
const SOFT_PX: f64 = 1.5 * SIZE.1 as f64 / 720.0;

/// Share of a pixel that the gun covers.
fn cover(gun: &[Phantom], x: u32, y: u32) -> f64 {
    let place = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
    let nearest = gun.iter().map(|p| p.distance(place)).fold(f64::INFINITY, f64::min);
    (0.5 - nearest / SOFT_PX).clamp(0.0, 1.0)
}

/// The picture with the gun before it, in round steel of that light.
fn with_gun(picture: &RgbImage, gun: &[Phantom], light: f32) -> RgbImage {
    let mut made = picture.clone();
    for (x, y, pixel) in made.enumerate_pixels_mut() {
        let share = cover(gun, x, y) as f32;
        let round = 1.0
            - 0.7
                * ((f64::from(x) - 319.0).abs() / (18.0 + 0.24 * (f64::from(y) - 205.0).max(0.0))).min(1.0)
                    as f32;
        for value in &mut pixel.0 {
            *value = code(linear(*value) * (1.0 - share) + light * 0.12 * round * share);
        }
    }
    made
}

/// A boat behind the gun, with the outline and without.
pub fn phantoms(_: &Workshop) -> Result<Vec<Exhibit>> {
    let mut shot = SeaShot::new([38.0, 112.0], 20_000.0)?;
    let (open, gun) = (shot.picture.clone(), gun());
    shot.picture = with_gun(&open, &gun, 0.6);
    let models = models(&["rhib"])?;
    let pose = shot.afloat(26.0, 0.0, 70.0);
    let mut scene = shot.scene(shot.light(0.9)?, &models, &[(0, pose)], 20_000.0)?;
    let none = Phantoms::default();
    let over = shot.draw(&scene, &models, none.clone())?;
    scene.passes[Pass::Phantoms as usize] = PassDecision::Run;
    let hidden =
        shot.draw(&scene, &models, Phantoms { parts: gun.clone().into(), bore: DVec2::new(319.0, 120.0) })?;
    let off = |drawn: &RgbImage| {
        let mut counts = [0_u32; 2];
        for (x, y, real) in shot.picture.enumerate_pixels() {
            if cover(&gun, x, y) >= 1.0 {
                counts[0] += 1;
                let now = drawn.get_pixel(x, y);
                counts[1] += u32::from((0..3).any(|c| real[c].abs_diff(now[c]) > 1));
            }
        }
        counts
    };
    let lines = [("without the outline", &over, false), ("outline in the picture", &hidden, true)].map(
        |(way, drawn, is)| {
            let [core, off] = off(drawn);
            Line::new([way.into(), f64::from(core).into(), f64::from(off).into()]).product_if(is)
        },
    );
    let part = [170, 90, 300, 240];
    Ok(vec![
        Exhibit::Table(Table {
            caption: "Pixels of the gun over which a boat is drawn".into(),
            titles: vec!["way", "pixels of the gun's core", "off by more than a code"],
            lines: lines.into(),
        }),
        Exhibit::Figures(vec![
            Figure::new(
                "Simulated camera, and the gun before it",
                "a barrel and its sight before the sea",
                &crop(&shot.picture, part, 1),
            )?,
            Figure::new(
                "Drawn without the outline: the boat covers the sight",
                "a boat drawn over the barrel",
                &crop(&over, part, 1),
            )?,
            Figure::new("Drawn with it: the gun stays", "a boat behind the barrel", &crop(&hidden, part, 1))?,
        ]),
    ])
}

/// Light of a night without a moon on boats, next to nothing.
fn night(mut light: Light) -> Light {
    for part in [&mut light.sun, &mut light.sky, &mut light.horizon, &mut light.sea] {
        *part *= 0.01;
    }
    light.sun = Vec3::ZERO;
    light.dome = SkyLobes::even(light.sky);
    light
}

/// A night with two boats, and the models they need.
struct Night {
    shot: SeaShot,
    models: Vec<Model>,
    scene: Scene,
}

const NIGHT_VISIBILITY_M: f64 = 6000.0;

impl Night {
    fn new(near_m: f64, far_m: f64) -> Result<Self> {
        let shot = SeaShot::new([20.0, 112.0], NIGHT_VISIBILITY_M)?.darkened(0.012, 0.6);
        let models = models(&["skiff", "dhow"])?;
        let boats = [(0, shot.afloat(near_m, -7.0, 60.0)), (1, shot.afloat(far_m, 9.0, 290.0))];
        let scene = shot.scene(night(shot.light(0.9)?), &models, &boats, NIGHT_VISIBILITY_M)?;
        Ok(Self { shot, models, scene })
    }

    fn draw(&self, scene: &Scene) -> Result<RgbImage> {
        self.shot.draw(scene, &self.models, Phantoms::default())
    }

    /// The skiff on fire at a luminance that is white in the picture.
    fn burning(&self, white_cd_m2: f64) -> Result<Scene> {
        let mut scene = self.scene.clone();
        let pose = scene.boats.iter().find(|b| b.boat == 0).context("the skiff is out of the picture")?.pose;
        let (eye, wind) = (scene.camera.position, DVec2::new(3.0, -1.0));
        let burning =
            Burning { boat: 0, since_s: 0.0, wind, eye, visibility_m: NIGHT_VISIBILITY_M, white_cd_m2 };
        let at = pose.position + DVec3::Z;
        burning.puffs(40.0, |_| Some(at), &mut scene.rounds);
        scene.rounds.sort_by(|a, b| b.place().distance(eye).total_cmp(&a.place().distance(eye)));
        let strength = Burning::colour() * (burning.candela(40.0) / white_cd_m2) as f32;
        let at = at + DVec3::Z * (0.5 * burning.flame_height_m(40.0));
        scene.lamps =
            vec![LampView { at, strength, extinction_per_m: 3.912 / NIGHT_VISIBILITY_M, is_high: false }];
        for pass in [Pass::Rounds, Pass::Lamplight] {
            scene.passes[pass as usize] = PassDecision::Run;
        }
        Ok(scene)
    }
}

/// A burning boat by night, with its light and without.
pub fn fire(_: &Workshop) -> Result<Vec<Exhibit>> {
    let night = Night::new(35.0, 55.0)?;
    let burning = night.burning(4.0)?;
    let mut unlit = burning.clone();
    unlit.lamps.clear();
    unlit.passes[Pass::Lamplight as usize] = PassDecision::LeftOut(LeftOut::NoLampShines);
    let mut flare = night.scene.clone();
    let ahead = night.shot.afloat(180.0, 8.0, 0.0).position;
    let strength = Vec3::splat(80_000.0 / 20.0);
    let extinction_per_m = 3.912 / NIGHT_VISIBILITY_M;
    flare.lamps = vec![LampView { at: ahead + DVec3::Z * 90.0, strength, extinction_per_m, is_high: true }];
    flare.passes[Pass::Lamplight as usize] = PassDecision::Run;
    let (dark, unlit, lit, flare) =
        (night.draw(&night.scene)?, night.draw(&unlit)?, night.draw(&burning)?, night.draw(&flare)?);
    let lines = [
        ("no lamp", &dark, false),
        ("flames without light", &unlit, false),
        ("flames and their lamp", &lit, true),
        ("a flare behind the boats", &flare, true),
    ]
    .map(|(way, drawn, is)| {
        Line::new([way.into(), mean_code(drawn).into(), brighter(&dark, drawn).into()]).product_if(is)
    });
    Ok(vec![
        Exhibit::Table(Table {
            caption: "Change of the whole picture by a lamp".into(),
            titles: vec!["drawn", "mean code", "pixels more than two codes brighter, %"],
            lines: lines.into(),
        }),
        Exhibit::Figures(vec![
            Figure::new("A night with two boats", "a nearly black sea", &dark)?,
            Figure::new(
                "The skiff burns, its light left out",
                "flames over a black boat on a black sea",
                &unlit,
            )?,
            Figure::new(
                "The skiff burns: its light on hulls, water and smoke",
                "flames that light their boat and the water around it",
                &lit,
            )?,
            Figure::new(
                "A flare 180 m off, 90 m high; white at five times the luminance",
                "two boats and the sea in the light of a flare",
                &flare,
            )?,
        ]),
    ])
}

fn mean_code(picture: &RgbImage) -> f64 {
    picture.iter().map(|v| f64::from(*v)).sum::<f64>() / picture.len() as f64
}

/// Pixels that are more than two codes brighter than before, %.
fn brighter(before: &RgbImage, after: &RgbImage) -> f64 {
    let pairs = before.pixels().zip(after.pixels());
    let count = pairs.filter(|(a, b)| (0..3).any(|c| b[c] > a[c].saturating_add(2))).count();
    100.0 * count as f64 / f64::from(before.width() * before.height())
}

/// The beam on and off, in two airs.
pub fn flashlight(_: &Workshop) -> Result<Vec<Exhibit>> {
    let night = Night::new(60.0, 110.0)?;
    let off = night.draw(&night.scene)?;
    let skiff = night.scene.boats.iter().find(|b| b.boat == 0).context("the skiff is out of the picture")?;
    let towards = night.shot.camera.to_camera(skiff.pose.position).normalize();
    let mut figures = vec![Figure::new("Off", "a nearly black sea", &off)?];
    let mut lines = vec![Line::new(["off".into(), Cell::Number(None), mean_code(&off).into(), 0.0.into()])];
    for visibility_m in [20_000.0, 2000.0] {
        let spec = SearchlightSpec { candela: 400_000.0, beam: 0.2, is_on: true };
        let mut scene = night.scene.clone();
        scene.searchlight = Some(SearchlightView::new(&spec, towards, 8.0, visibility_m));
        scene.passes[Pass::Lamplight as usize] = PassDecision::Run;
        let on = night.draw(&scene)?;
        let km = visibility_m / 1000.0;
        figures.push(Figure::new(
            format!("On, aimed at the skiff; visibility {km} km"),
            "a beam through the air onto a boat",
            &on,
        )?);
        lines.push(
            Line::new(["on".into(), km.into(), mean_code(&on).into(), brighter(&off, &on).into()])
                .product_if(true),
        );
    }
    Ok(vec![
        Exhibit::Table(Table {
            caption: "Change of the whole picture by the beam".into(),
            titles: vec!["beam", "visibility, km", "mean code", "pixels more than two codes brighter, %"],
            lines,
        }),
        Exhibit::Figures(figures),
    ])
}

/// A boat in a low sun with its shadow map and without.
pub fn shadow_maps(_: &Workshop) -> Result<Vec<Exhibit>> {
    let shot = SeaShot::new([24.0, 112.0], 20_000.0)?;
    let models = models(&["dhow"])?;
    let pose = shot.afloat(34.0, 0.0, 75.0);
    let scene = shot.scene(shot.light(0.9)?, &models, &[(0, pose)], 20_000.0)?;
    let mut bare = scene.clone();
    bare.passes[Pass::Shadow as usize] = PassDecision::LeftOut(LeftOut::NoSun);
    let draw = |scene: &Scene| shot.draw(scene, &models, Phantoms::default());
    let (with, without) = (draw(&scene)?, draw(&bare)?);
    let part = around(&scene)?;
    Ok(vec![Exhibit::Figures(vec![
        Figure::new(
            "Without a shadow map: the sun shines through",
            "a dhow whose inside is lit by the sun",
            &crop(&without, part, 2),
        )?,
        Figure::new("A shadow map a boat", "a dhow whose own parts shade it", &crop(&with, part, 2))?,
    ])])
}

/// A boat near, farther and far in two visibilities, and its contrast.
pub fn fog(_: &Workshop) -> Result<Vec<Exhibit>> {
    const RANGES_M: [f64; 3] = [60.0, 200.0, 600.0];
    const FOG_END_M: f64 = 1000.0;
    let models = models(&["dhow"])?;
    let (mut figures, mut lines) = (Vec::new(), Vec::new());
    for visibility_m in [20_000.0, 1200.0] {
        let shot = SeaShot::new([38.0, 300.0], visibility_m)?;
        let mut light = shot.light(0.9)?;
        light.horizon = horizon(&shot);
        let mut boats = Vec::new();
        for (range_m, right_deg) in RANGES_M.into_iter().zip([-12.0, 5.0, 15.0]) {
            let pose = shot.afloat(range_m, right_deg, 80.0);
            let draw = |visibility_m: f64| {
                let scene = shot.scene(light, &models, &[(0, pose)], visibility_m)?;
                let drawn = shot.draw(&scene, &models, Phantoms::default())?;
                let hull =
                    scene.boats.first().and_then(|b| b.hull).context("the dhow is out of the picture")?;
                Ok::<_, anyhow::Error>((drawn, [hull.x, hull.y, hull.width, hull.height]))
            };
            let ((clear, part), (hazy, _)) = (draw(1e9)?, draw(visibility_m)?);
            let left = contrast_left([&shot.picture, &clear, &hazy], part, light.horizon);
            boats.push((0, pose));
            lines.push(Line::new([
                (visibility_m / 1000.0).into(),
                range_m.into(),
                left.into(),
                (-3.912 * range_m / visibility_m).exp().into(),
                f64::from(1.0 - haze_share(range_m, visibility_m)).into(),
                (1.0 - range_m / FOG_END_M).clamp(0.0, 1.0).into(),
            ]));
        }
        let scene = shot.scene(light, &models, &boats, visibility_m)?;
        let drawn = shot.draw(&scene, &models, Phantoms::default())?;
        let [near, middle, far] = RANGES_M;
        let caption =
            format!("A dhow at {near}, {middle} and {far} m; visibility {} km", visibility_m / 1000.0);
        figures.push(Figure::new(
            caption,
            "three dhows, the farther the paler",
            &crop(&drawn, [0, 60, 640, 200], 1),
        )?);
    }
    Ok(vec![
        Exhibit::Table(Table {
            caption: "Contrast to the horizon that haze leaves of the drawn hull, by least squares over its pixels; Koschmieder's law; the product's own share; linear fog from \
                      0 to 1000 m as OpenGL has it"
                .into(),
            titles: vec!["visibility, km", "range, m", "contrast that is left", "exp(-3.912 d/V)", "1 - haze", "linear fog"],
            lines,
        }),
        Exhibit::Figures(figures),
    ])
}

/// Radiance just above the horizon in the picture's middle.
fn horizon(shot: &SeaShot) -> Vec3 {
    let ahead = (shot.camera.world_from_camera * DVec3::Z).truncate().normalize_or(DVec2::Y);
    let at = shot.camera.position + ahead.extend(0.012) * 1e5;
    let pixel = shot.lens.project(shot.camera.to_camera(at));
    let row = pixel.map_or(SIZE.1 / 3, |p| (p.y.max(1.0) as u32).min(SIZE.1 - 1));
    let light =
        (0..SIZE.0).map(|x| Vec3::from_array(shot.picture.get_pixel(x, row).0.map(linear))).sum::<Vec3>();
    light / SIZE.0 as f32
}

/// Share of contrast to the horizon that is left, over pixels in the upper part of a hull's rectangle that it covers wholly.
fn contrast_left(
    [before, clear, hazy]: [&RgbImage; 3],
    [x, y, width, height]: [u32; 4],
    horizon: Vec3,
) -> f64 {
    let light = |of: &RgbImage, x, y| f64::from(linear(of.get_pixel(x, y)[1]));
    let (mut both, mut square) = (0.0, 0.0);
    for y in y..(y + height * 3 / 4).min(SIZE.1) {
        for x in x..(x + width).min(SIZE.0) {
            let seen = light(clear, x, y);
            let is_hull = |x, y| (light(clear, x, y) - light(before, x, y)).abs() > 0.03;
            let sides = [(x, y), (x + 1, y), (x.saturating_sub(1), y), (x, y + 1), (x, y.saturating_sub(1))];
            // Pixels of the edge hold some of the picture, which stays as it is.
            if sides.into_iter().all(|(x, y)| is_hull(x.min(SIZE.0 - 1), y.min(SIZE.1 - 1))) {
                let apart = f64::from(horizon.y) - seen;
                both += apart * (f64::from(horizon.y) - light(hazy, x, y));
                square += apart * apart;
            }
        }
    }
    both / square
}
