//! A boat cut out of its photograph, as a picture boat of the product.

use anyhow::{Context, Result};
use bowwave_core::{
    frame::scene::Scene,
    geometry::horizon_dip,
    model::ModelId,
    water::{ReflectionMethod, ShadowLevel},
};
use bowwave_lab::{OffscreenRenderer, Photo, still::Still};
use bowwave_models::{BoatModels, Bow, QuadSpec, quad};
use glam::{DVec2, DVec3, Vec3};
use image::{RgbImage, Rgba, RgbaImage};

use super::{
    mask,
    spec::{Assumed, PhotographView, Polygon},
};

/// A boat cut out above its water line.
#[derive(Clone, Debug)]
pub struct CutOut {
    picture: RgbaImage,
    /// Columns of the photograph that its opaque pixels span.
    columns: [f64; 2],
    /// Row of the photograph at which `picture` begins.
    top: f64,
}

/// Draws the boat and its reflection over `cleaned` by one method.
pub fn draw(
    (view, index): (&PhotographView, usize),
    assumed: &Assumed,
    method: ReflectionMethod,
    cleaned: &RgbImage,
    cut: &CutOut,
) -> Result<RgbImage> {
    let waterline = view.waterline(index);
    let [left, right] = cut.columns;
    let foot = DVec2::new((left + right) / 2.0, waterline);
    let mut still = still(view, index, assumed, cleaned.dimensions(), foot)?;
    still.water.method = method;
    still.water.shadow = ShadowLevel::None;
    let canvas = Photo::new(cleaned.clone(), &view.series, None)?;
    // Metres a pixel at the boat: its depth over the focal length.
    let (lens, camera) = still.sight(cleaned.dimensions(), None)?;
    let ray = camera.world_from_camera * lens.unproject(foot);
    let place = camera.position + ray * (camera.position.z / -ray.z);
    let m_per_px = camera.to_camera(place).z / lens.focal.x;
    let spec = QuadSpec {
        length_m: (right - left) * m_per_px,
        waterline_row: waterline - cut.top,
        bow: Bow::Right,
        engine: None,
        helm: None,
    };
    let model = quad(&view.series, "cut-out", cut.picture.clone(), &spec)?;
    let models = BoatModels { list: vec![model], of_boats: vec![ModelId(0)] };
    let mut composed = still.compose(&canvas.picture, 0, (&models.list, &models.of_boats), None)?;
    shine_as_photographed(&mut composed.scene);
    OffscreenRenderer::new(models, None, false)
        .draw(&composed, &canvas.picture)
        .context("cannot draw the boat")
}

/// The camera and the boat's place, as a user of `bowwave compose` writes them. The optical axis goes level to the horizon above
/// the boat: upright and seen square, the cut-out falls on its own pixels, whatever the camera's perspective did to it already.
fn still(
    view: &PhotographView,
    index: usize,
    assumed: &Assumed,
    size: (u32, u32),
    foot: DVec2,
) -> Result<Still> {
    let horizon = view.waterline(index) - (view.waterline(index) - view.horizon(index)) * assumed.height;
    let eye_height_m = view.eye_height_m * assumed.height;
    let focal_px = f64::from(size.0) / 2.0 / (view.hfov_deg * assumed.hfov / 2.0).to_radians().tan();
    let level = horizon - focal_px * horizon_dip(eye_height_m).tan();
    let text = format!(
        "picture = \"photograph\"\n[camera]\neye_height_m = {eye_height_m}\nfocal_px = {focal_px}\ncentre_px = [{}, {level}]\npitch_deg = 0\n\
         [[boat]]\nmodel = \"cut-out.png\"\nwaterline_px = [{}, {}]\nheading_deg = 90\n\
         [sea]\nbeaufort = {}\nwind_from_deg = {}\n[light]\nvisibility_km = 200\n",
        foot.x,
        foot.x,
        foot.y,
        view.beaufort + assumed.force,
        view.wind_from_deg,
    );
    Still::parse(&text, "photograph").context("the estimate is no scene")
}

impl CutOut {
    /// Cuts `boat` out of `photo`; edges get the alpha of what they cover.
    pub fn new(photo: &RgbImage, boat: &[Polygon]) -> Self {
        let [left, top, right, bottom] = mask::bounds(boat);
        let limit = |v: f64, most: u32| (v.max(0.0) as u32).min(most);
        let (x0, y0) = (limit(left - 2.0, photo.width()), limit(top - 2.0, photo.height()));
        let (x1, y1) = (limit(right + 3.0, photo.width()), limit(bottom + 3.0, photo.height()));
        let picture = RgbaImage::from_fn(x1 - x0, y1 - y0, |x, y| {
            let [r, g, b] = photo.get_pixel(x0 + x, y0 + y).0;
            Rgba([r, g, b, (255.0 * mask::coverage(boat, x0 + x, y0 + y)).round() as u8])
        });
        let opaque = || picture.enumerate_pixels().filter(|p| p.2.0[3] >= 128).map(|p| p.0);
        let (first, last) = (opaque().min().unwrap_or(0), opaque().max().unwrap_or(0));
        let columns = [f64::from(x0 + first), f64::from(x0 + last + 1)];
        Self { picture, columns, top: f64::from(y0) }
    }
}

/// The photograph holds the boat's light already: a sun behind the camera adds to sky and sea just what makes white paper 1.
fn shine_as_photographed(scene: &mut Scene) {
    let Some(boat) = scene.boats.first() else { return };
    let towards = (scene.camera.position - boat.pose.position).with_z(0.0).normalize_or(DVec3::NEG_Y);
    let light = &mut scene.light;
    light.sun_direction = towards;
    light.sun = (Vec3::ONE - (light.sky + light.sea) / 2.0).max(Vec3::ZERO);
}
