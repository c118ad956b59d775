//! Materials and their pictures.

use std::{collections::HashMap, io::Cursor};

use bowwave_core::colour::srgb_to_linear;
use glam::{Mat3, Vec2, Vec3};
use gltf::material::AlphaMode;
use image::RgbaImage;

use super::{
    TEXTURE_SIDE_MAX,
    source::{ModelSource, limit},
};
use crate::error::ModelError;

/// Most pixels of all pictures together.
const PIXELS_MAX: u64 = 4 * (TEXTURE_SIDE_MAX as u64) * (TEXTURE_SIDE_MAX as u64);

/// The properties of a material that are used.
#[derive(Clone, Copy)]
pub(crate) struct Surface {
    /// Linear base colour.
    pub(crate) albedo: Vec3,
    /// The picture, where there is one.
    pub(crate) picture: Option<Mapped>,
}

/// How a picture is laid on.
#[derive(Clone, Copy)]
pub(crate) struct Mapped {
    /// Index into [`TexturePictures::all`].
    pub(crate) picture: usize,
    /// Which set of texture coordinates.
    pub(crate) set: u32,
    /// Maps them (`KHR_texture_transform`).
    transform: Mat3,
}

impl Mapped {
    /// The texture coordinate that is looked up.
    pub(crate) fn apply(&self, uv: Vec2) -> Vec2 {
        self.transform.transform_point2(uv)
    }
}

/// A decoded picture, sRGB-coded.
pub(crate) struct TexturePicture {
    pub(crate) rgba: RgbaImage,
}

impl TexturePicture {
    /// Mean linear colour of what is not see-through.
    pub(crate) fn mean(&self) -> Vec3 {
        let (mut sum, mut weight) = (Vec3::ZERO, 0.0_f32);
        for p in self.rgba.pixels() {
            let [r, g, b, a] = p.0.map(|v| f32::from(v) / 255.0);
            sum += Vec3::new(srgb_to_linear(r), srgb_to_linear(g), srgb_to_linear(b)) * a;
            weight += a;
        }
        if weight > 0.0 { sum / weight } else { Vec3::ONE }
    }
}

/// Pictures that have been met, each decoded once for each way that its alpha is used.
#[derive(Default)]
pub(crate) struct TexturePictures {
    /// All of them.
    pub(crate) all: Vec<TexturePicture>,
    known: HashMap<(usize, u16), usize>,
    pixels: u64,
}

impl TexturePictures {
    /// Surface of `material`.
    pub(crate) fn surface(
        &mut self,
        source: &ModelSource<'_>,
        material: &gltf::Material<'_>,
    ) -> Result<Surface, ModelError> {
        let pbr = material.pbr_metallic_roughness();
        let [r, g, b, alpha] = pbr.base_color_factor();
        let albedo = Vec3::new(r, g, b);
        if !albedo.is_finite() || albedo.min_element() < 0.0 {
            let i = material.index().unwrap_or_default();
            return Err(source.error(format!("material {i} has a base colour that is no colour")));
        }
        let picture = match pbr.base_color_texture() {
            None => None,
            Some(info) => {
                let image = info.texture().source().index();
                let picture = self.picture(source, image, material, alpha)?;
                let transform = info.texture_transform().map_or(Mat3::IDENTITY, |t| {
                    // The specification's matrix turns clockwise in a space whose v points down.
                    Mat3::from_scale_angle_translation(
                        Vec2::from_array(t.scale()),
                        -t.rotation(),
                        Vec2::from_array(t.offset()),
                    )
                });
                let set = info.texture_transform().and_then(|t| t.tex_coord()).unwrap_or(info.tex_coord());
                Some(Mapped { picture, set, transform })
            }
        };
        Ok(Surface { albedo: albedo.min(Vec3::ONE), picture })
    }

    fn picture(
        &mut self,
        source: &ModelSource<'_>,
        image: usize,
        material: &gltf::Material<'_>,
        alpha: f32,
    ) -> Result<usize, ModelError> {
        // What alpha becomes: always 1, or 0 and 1 about a limit, or itself (limit coded as 1 + 255 steps).
        let cutoff = match material.alpha_mode() {
            AlphaMode::Opaque => 0,
            AlphaMode::Mask => {
                1 + (material.alpha_cutoff().unwrap_or(0.5) / alpha.max(1e-3) * 255.0).clamp(0.0, 255.0)
                    as u16
            }
            AlphaMode::Blend => 1 + 128,
        };
        if let Some(&known) = self.known.get(&(image, cutoff)) {
            return Ok(known);
        }
        let mut rgba = decode(source, image)?;
        self.pixels += u64::from(rgba.width()) * u64::from(rgba.height());
        limit(source.file, "the sum of its pictures in pixels", self.pixels, PIXELS_MAX)?;
        for p in rgba.pixels_mut() {
            let opaque = cutoff == 0 || u16::from(p.0[3]) >= cutoff - 1;
            p.0[3] = if opaque { 255 } else { 0 };
        }
        self.all.push(TexturePicture { rgba });
        self.known.insert((image, cutoff), self.all.len() - 1);
        Ok(self.all.len() - 1)
    }
}

fn decode(source: &ModelSource<'_>, index: usize) -> Result<RgbaImage, ModelError> {
    let missing = || source.error(format!("picture {index} is not there"));
    let image = source.root().images.get(index).ok_or_else(missing)?;
    let fetched;
    let bytes = match (&image.buffer_view, &image.uri) {
        (Some(view), _) => source.view(view.value())?,
        (None, Some(uri)) => {
            fetched = source.fetch(uri)?;
            &fetched
        }
        (None, None) => return Err(missing()),
    };
    let name = image.uri.as_deref().filter(|u| !u.starts_with("data:"));
    let what =
        name.map_or_else(|| format!("{}: picture {index}", source.file), |u| format!("{}: {u}", source.file));
    decode_bounded(bytes, &what)
}

/// Decodes a PNG or JPEG of at most [`TEXTURE_SIDE_MAX`] pixels a side.
pub(crate) fn decode_bounded(bytes: &[u8], what: &str) -> Result<RgbaImage, ModelError> {
    let bad = |problem: String| ModelError::Picture { file: what.to_owned(), problem };
    let reader = image::ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|e| bad(format!("cannot be read: {e}")))?;
    let (width, height) =
        reader.into_dimensions().map_err(|e| bad(format!("no PNG or JPEG: {e}; save it again as PNG")))?;
    if width > TEXTURE_SIDE_MAX || height > TEXTURE_SIDE_MAX || width == 0 || height == 0 {
        return Err(bad(format!("{width}x{height} pixels; scale it to at most {TEXTURE_SIDE_MAX} a side")));
    }
    let mut reader = image::ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|e| bad(format!("cannot be read: {e}")))?;
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(TEXTURE_SIDE_MAX);
    limits.max_image_height = Some(TEXTURE_SIDE_MAX);
    limits.max_alloc = Some(512 << 20);
    reader.limits(limits);
    Ok(reader.decode().map_err(|e| bad(format!("broken: {e}; save it again as PNG")))?.into_rgba8())
}
