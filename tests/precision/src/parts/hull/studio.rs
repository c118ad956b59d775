//! One boat as the product draws it, and as paths of light show it.

use anyhow::{Context as _, Result};
use bowwave_core::{
    estimate::light::Light,
    frame::scene::{Pass, PassDecision, Scene},
    sky::SkyLobes,
};
use glam::{DVec2, Vec3};
use image::{Rgb, RgbImage};

use crate::{
    bench::ExtremeResult,
    metric::Cutout,
    parts::drawn_boat::{self, DrawnBoat, SIZE, towards, without_shadow},
    path_traced::{Kind, TracedLight, TracedPicture, View},
    reflection::{draw::picture, scenes::Afloats},
    truth::{boat, files},
};

/// Names of the ways in which the renderer draws, the product's first.
pub const WAYS: [&str; 3] = ["sky by lobes, baked; a map a boat", "no shadow", "even sky"];

/// A light by its sky and where its sun stands.
#[derive(Clone, Copy, Debug)]
pub struct Lit {
    /// For a table.
    pub name: &'static str,
    /// The sky.
    pub kind: Kind,
    /// Radiance of a matt white surface that faces the sun.
    pub white: f32,
    /// Elevation of sun or moon, and azimuth clockwise from the direction of view, degrees.
    pub towards_deg: [f64; 2],
}

impl Lit {
    /// A clear sky.
    pub const fn clear(name: &'static str, white: f32, towards_deg: [f64; 2]) -> Self {
        Self { name, kind: Kind::Clear, white, towards_deg }
    }

    /// The light itself.
    pub fn traced(&self) -> Result<TracedLight> {
        let [elevation_deg, azimuth_deg] = self.towards_deg;
        TracedLight::new(self.kind, towards(elevation_deg, azimuth_deg), self.white)
    }
}

/// A boat somewhere in some light.
#[derive(Clone, Copy)]
pub struct Cell<'a> {
    /// Metres ahead.
    pub range_m: f64,
    /// Where the bow points, degrees clockwise from the direction of view.
    pub heading_deg: f64,
    /// The light.
    pub light: &'a TracedLight,
}

impl Cell<'_> {
    fn afloat(&self) -> Afloats {
        drawn_boat::afloat(self.range_m, self.heading_deg)
    }
}

/// Mean FLIP over the boat's pixels.
#[derive(Clone, Copy, Debug, Default)]
pub struct HullErrors {
    /// Of what the renderer draws, by [`WAYS`].
    pub ways: [f64; WAYS.len()],
    /// Of Lambert's law and even light that reaches all.
    pub ambient: f64,
    /// Of the product where one part of its light is the truth's, by where it comes from.
    pub with: [f64; 4],
    /// Of the product with all parts of the light the truth's: edges, and the steps of eight bits.
    pub with_all: f64,
    /// Of the product over the pixels that show nothing but the boat, themselves and their neighbours.
    pub inner: f64,
}

impl HullErrors {
    fn values(&self) -> [f64; 10] {
        let [a, b, c] = self.ways;
        let [d, e, f, g] = self.with;
        [a, b, c, self.ambient, d, e, f, g, self.with_all, self.inner]
    }

    fn of_values([a, b, c, ambient, d, e, f, g, with_all, inner]: [f64; 10]) -> Self {
        Self { ways: [a, b, c], ambient, with: [d, e, f, g], with_all, inner }
    }

    /// Mean of several; nothing of none.
    pub fn mean<'a>(of: impl Iterator<Item = &'a Self>) -> Option<Self> {
        let (mut sums, mut count) = ([0.0; 10], 0.0);
        for errors in of {
            sums.iter_mut().zip(errors.values()).for_each(|(sum, value)| *sum += value);
            count += 1.0;
        }
        (count > 0.0).then(|| Self::of_values(sums.map(|sum| sum / count)))
    }

    /// Rows of a table.
    pub fn listed(&self) -> Vec<ExtremeResult> {
        let [sun, sky, sea, hull] = self.with;
        let product = |setting: &str, error| ExtremeResult::rival(WAYS[0], setting, error);
        let mut rows = vec![ExtremeResult::product(WAYS[0], "", self.ways[0])];
        rows.extend((1..WAYS.len()).map(|i| ExtremeResult::rival(WAYS[i], "", self.ways[i])));
        rows.extend([
            ExtremeResult::rival("Lambert and ambient", "", self.ambient),
            product("with the true sun", sun),
            product("with the true light of the sky", sky),
            product("with the true light of the sea", sea),
            product("with the hull's own image in the sea", hull),
            product("with all of these", self.with_all),
            product("inner pixels alone", self.inner),
        ]);
        rows
    }
}

/// Linear light of a part of a picture.
type Linear = Vec<Vec3>;

fn linear(picture: &RgbImage) -> Linear {
    picture.pixels().map(|p| Vec3::from_array(p.0.map(files::linear))).collect()
}

fn coded(light: &[Vec3], size: (u32, u32)) -> RgbImage {
    RgbImage::from_fn(size.0, size.1, |x, y| {
        let light = light[(y * size.0 + x) as usize].clamp(Vec3::ZERO, Vec3::ONE);
        Rgb(light.to_array().map(files::code))
    })
}

/// What draws one boat, and what its light is held against.
pub struct HullStudio(DrawnBoat);

impl HullStudio {
    /// For a boat of that name.
    pub fn new(boat: &str) -> Result<Self> {
        Ok(Self(DrawnBoat::new(boat)?))
    }

    fn scene(&self, cell: &Cell<'_>, light: Light) -> Result<Scene> {
        self.0.scene(cell.range_m, cell.afloat(), light)
    }

    /// The scenes of [`WAYS`].
    pub fn scenes(&self, cell: &Cell<'_>) -> Result<[Scene; WAYS.len()]> {
        let light = cell.light.product();
        let product = self.scene(cell, light)?;
        let bare = without_shadow(&product);
        let even = self.scene(cell, Light { dome: SkyLobes::even(light.sky), ..light })?;
        Ok([product, bare, even])
    }

    /// Draws a scene over black.
    pub fn paint(&self, scene: &Scene) -> Result<RgbImage> {
        self.0.paint(scene)
    }

    fn traced(
        &self,
        cell: &Cell<'_>,
        scene: &Scene,
        paths: u32,
        seed: u64,
    ) -> Result<(Cutout, TracedPicture)> {
        let within = scene.boats.first().and_then(|b| b.hull).context("the boat is out of the picture")?;
        let mesh = boat::mesh(&self.0.model, cell.afloat().pose());
        let view = View { camera: &scene.camera, lens: &scene.lens, within };
        let traced = TracedPicture::new(&view, &mesh, cell.light, (paths, seed));
        Ok((Cutout::new([within.x, within.y], [within.width, within.height], [SIZE.0, SIZE.1]), traced))
    }

    /// FLIP of one truth against another of other paths, over the root of two: what the truth itself is uncertain by.
    pub fn noise(&self, cell: &Cell<'_>, paths: u32) -> Result<f64> {
        let scene = self.scene(cell, cell.light.product())?;
        let [(cutout, one), (_, other)] =
            [self.traced(cell, &scene, paths, 1)?, self.traced(cell, &scene, paths, 2)?];
        let back = background(cell.light, &scene);
        let stand = Stand { cutout, back: cutout.cut(&back) };
        let (a, b) = (stand.truth(&one), stand.truth(&other));
        let off = cutout.flip_mean(&a, &b, one.pixels.iter().map(|p| p.covered > 0.0))?;
        Ok(off.unwrap_or(0.0) / std::f64::consts::SQRT_2)
    }

    /// Errors of all ways in a cell.
    pub fn errors(&self, cell: &Cell<'_>, paths: u32) -> Result<HullErrors> {
        let scenes = self.scenes(cell)?;
        let (cutout, traced) = self.traced(cell, &scenes[0], paths, 1)?;
        let back = background(cell.light, &scenes[0]);
        let before = picture(&back)?;
        let stand = Stand { cutout, back: cutout.cut(&back) };
        let truth = stand.truth(&traced);
        let mask = || traced.pixels.iter().map(|p| p.covered > 0.0);
        let error = |drawn: &RgbImage| {
            Ok::<_, anyhow::Error>(cutout.flip_mean(&truth, drawn, mask())?.unwrap_or(0.0))
        };
        let mut pictures = Vec::new();
        for scene in &scenes {
            pictures.push(cutout.cut(&self.0.paint_over(scene, &before)?));
        }
        let mut ways = [0.0; WAYS.len()];
        for (way, drawn) in ways.iter_mut().zip(&pictures) {
            *way = error(drawn)?;
        }
        let product = linear(&pictures[0]);
        let parts = self.parts(cell, &cutout)?;
        let with = |replaced: &[usize]| error(&stand.replaced(&product, &parts, &traced, replaced));
        let width = scenes[0].boats.first().and_then(|b| b.hull).map_or(1, |hull| hull.width) as usize;
        let inner = cutout.flip_mean(&truth, &pictures[0], inner(&traced, width))?;
        Ok(HullErrors {
            ways,
            ambient: error(&stand.ambient(&traced, &cell.light.product()))?,
            with: [with(&[0])?, with(&[1])?, with(&[2])?, with(&[3])?],
            with_all: with(&[0, 1, 2, 3])?,
            inner: inner.unwrap_or(0.0),
        })
    }

    /// The product's light by where it comes from, each drawn alone over black; the sea shows it no hull.
    fn parts(&self, cell: &Cell<'_>, cutout: &Cutout) -> Result<[Linear; 4]> {
        let light = cell.light.product();
        let none =
            Light { sun: Vec3::ZERO, sky: Vec3::ZERO, dome: SkyLobes::default(), sea: Vec3::ZERO, ..light };
        let drawn = |light: Light| {
            let mut scene = self.scene(cell, light)?;
            if light.sun != Vec3::ZERO && cell.light.product().sun_shines() {
                scene.passes[Pass::Shadow as usize] = PassDecision::Run;
            }
            Ok::<_, anyhow::Error>(linear(&cutout.cut(&self.paint(&scene)?)))
        };
        let sun = drawn(Light { sun: light.sun, ..none })?;
        let sky = drawn(Light { dome: light.dome, ..none })?;
        let sea = drawn(Light { sea: light.sea, ..none })?;
        let hull = vec![Vec3::ZERO; sun.len()];
        Ok([sun, sky, sea, hull])
    }
}

/// Pixels that show nothing but the boat, and whose neighbours do so too.
fn inner(traced: &TracedPicture, width: usize) -> impl Iterator<Item = bool> {
    let full: Vec<bool> = traced.pixels.iter().map(|p| p.covered >= 1.0).collect();
    (0..full.len()).map(move |i| {
        let (x, y) = (i % width, i / width);
        let rows = full.len() / width;
        x > 0 && y > 0 && x + 1 < width && y + 1 < rows && {
            (y - 1..=y + 1).all(|y| (x - 1..=x + 1).all(|x| full[y * width + x]))
        }
    })
}

/// The sky and the sea that a boat is drawn over.
fn background(light: &TracedLight, scene: &Scene) -> RgbImage {
    let rows: Vec<[u8; 3]> = (0..SIZE.1)
        .map(|y| {
            let at = DVec2::new(0.5 * f64::from(SIZE.0), f64::from(y) + 0.5);
            let along = (scene.camera.world_from_camera * scene.lens.unproject(at)).normalize();
            let seen = if along.z > 0.0 { light.sky(along) } else { light.sea };
            seen.clamp(Vec3::ZERO, Vec3::ONE).to_array().map(files::code)
        })
        .collect();
    RgbImage::from_fn(SIZE.0, SIZE.1, |_, y| Rgb(rows[y as usize]))
}

/// A cutout before which a boat stands.
struct Stand {
    cutout: Cutout,
    back: RgbImage,
}

impl Stand {
    /// The boat's light before the background.
    fn over(&self, traced: &TracedPicture, light: impl Fn(usize) -> Vec3) -> RgbImage {
        let (size, mut made) = (self.back.dimensions(), linear(&self.back));
        for (i, pixel) in traced.pixels.iter().enumerate().filter(|(_, p)| p.covered > 0.0) {
            let (x, y) = self.cutout.place(i);
            let at = &mut made[(y * size.0 + x) as usize];
            *at = *at * (1.0 - pixel.covered) + light(i);
        }
        coded(&made, size)
    }

    fn truth(&self, traced: &TracedPicture) -> RgbImage {
        self.over(traced, |i| traced.pixels[i].parts.iter().sum())
    }

    /// The sun without shadows, and the level's light everywhere.
    fn ambient(&self, traced: &TracedPicture, light: &Light) -> RgbImage {
        self.over(traced, |i| traced.pixels[i].facing * light.sun + traced.pixels[i].albedo * light.sky)
    }

    /// The product's picture with some of the light the truth's.
    fn replaced(
        &self,
        product: &Linear,
        parts: &[Linear; 4],
        traced: &TracedPicture,
        components: &[usize],
    ) -> RgbImage {
        let (size, mut made) = (self.back.dimensions(), product.clone());
        for (i, pixel) in traced.pixels.iter().enumerate().filter(|(_, p)| p.covered > 0.0) {
            let (x, y) = self.cutout.place(i);
            let at = (y * size.0 + x) as usize;
            for component in components {
                made[at] += pixel.parts[*component] - parts[*component][at];
            }
        }
        coded(&made, size)
    }
}
#[cfg(test)]
mod tests {
    use super::*;

    /// On the whole a boat gets as much light of each kind from the renderer as from paths, with what goes from hull to hull.
    #[test]
    fn a_boat_gets_as_much_light_as_paths_bring_it() {
        let light = Lit::clear("", 0.9, [40.0, 140.0]).traced().unwrap();
        let studio = HullStudio::new("skiff").unwrap();
        let cell = Cell { range_m: 100.0, heading_deg: 65.0, light: &light };
        let scene = studio.scene(&cell, light.product()).unwrap();
        let (cutout, traced) = studio.traced(&cell, &scene, 16, 1).unwrap();
        let parts = studio.parts(&cell, &cutout).unwrap();
        let width = scene.boats[0].hull.unwrap().width as usize;
        let wide = cutout.cut(&background(&light, &scene)).width();
        for (component, drawn) in parts.iter().enumerate() {
            let mut sums = [Vec3::ZERO; 2];
            for (i, _) in inner(&traced, width).enumerate().filter(|(_, is_inner)| *is_inner) {
                let (x, y) = cutout.place(i);
                sums[0] += traced.pixels[i].parts[component];
                sums[1] += drawn[(y * wide + x) as usize];
            }
            let ratio = sums[1] / sums[0];
            if component == 3 {
                assert_eq!(sums[1], Vec3::ZERO);
            } else {
                assert!((ratio - 1.0).abs().max_element() < 0.08, "{component}: {ratio}");
            }
        }
    }
}
