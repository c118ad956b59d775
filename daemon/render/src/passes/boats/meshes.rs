//! All models on the device: one vertex buffer, one index buffer, a texture each where there is one.

use std::{ops::Range, panic::resume_unwind, sync::Arc, thread};

use ash::vk;
use bowwave_core::{
    colour::{linear_to_srgb, srgb_to_linear},
    geometry::Bend,
    model::{Model, ModelId, Texture},
};

use crate::{
    encoder::CommandEncoder,
    error::RenderError,
    gpu::Gpu,
    memory::{Access, Buffer, Image, ImageShape},
    passes::PassContext,
    passes::boats::simplify::{Level, Simplified, simplify},
    pipeline::{Bound, SRGB, Sampler, SetLayout},
    upload::upload_image,
};

/// Triangles that a pass draws, where it can do with as few: of three large boats close by. Their number is what a crowd of small boats costs.
const TRIANGLES_MAX: u32 = 24_000;
/// A crowd is simplified by no more than so many times what goes unseen.
const COARSER_MAX: f64 = 3.0;

/// One model's place in the shared buffers.
struct Mesh {
    first_index: u32,
    first_vertex: i32,
    levels: Vec<Level>,
    /// Levels of its shape alone.
    casters: Vec<Level>,
    /// Set 1, where the model has a texture.
    skin: Option<vk::DescriptorSet>,
    _texture: Option<Image>,
}

/// The models.
pub(crate) struct Meshes {
    meshes: Vec<Mesh>,
    vertices: Buffer,
    indices: Buffer,
    pub(crate) skin_layout: SetLayout,
    _sampler: Sampler,
}

/// Simplifies each of `models` on a thread of its own: what its corners see of the sky takes half a second a boat, and nobody trains
/// before that is done.
fn simplify_all(models: &[Model], bent: bool) -> Vec<Simplified> {
    thread::scope(|scope| {
        let jobs: Vec<_> = models.iter().map(|model| scope.spawn(move || simplify(model, bent))).collect();
        let done = jobs.into_iter().map(|job| job.join().unwrap_or_else(|panic| resume_unwind(panic)));
        done.collect()
    })
}

impl Meshes {
    pub(crate) fn new(context: &PassContext<'_>, models: &[Model]) -> Result<Self, RenderError> {
        let gpu = context.gpu;
        let kinds = [vk::DescriptorType::COMBINED_IMAGE_SAMPLER];
        let skin_layout = SetLayout::new(gpu, &kinds, vk::ShaderStageFlags::FRAGMENT)?;
        let sampler = Sampler::new(gpu, vk::Filter::LINEAR, true)?;
        let skin_of = |image: &Image| {
            let layout = vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL;
            context
                .pool
                .set(&skin_layout, &[Bound::Texture { view: image.view, sampler: sampler.raw, layout }])
        };
        let (mut vertices, mut indices, mut meshes) = (Vec::new(), Vec::new(), Vec::new());
        models.iter().try_for_each(check)?;
        let made = simplify_all(models, context.optics.bend != Bend::None);
        for (model, made) in models.iter().zip(made) {
            let texture = model.texture.as_ref().map(|t| upload_texture(gpu, &model.name, t)).transpose()?;
            let skin = texture.as_ref().map(skin_of).transpose()?;
            let too_big =
                |_| RenderError::Model { name: model.name.clone(), why: "too many corners".to_owned() };
            meshes.push(Mesh {
                first_index: u32::try_from(indices.len()).map_err(too_big)?,
                first_vertex: i32::try_from(vertices.len()).map_err(too_big)?,
                levels: made.levels,
                casters: made.casters,
                skin,
                _texture: texture,
            });
            indices.extend_from_slice(&made.indices);
            vertices.extend_from_slice(&made.vertices);
        }
        let of = vk::BufferUsageFlags::VERTEX_BUFFER;
        let vertices = filled(gpu, "models' corners", bytemuck::cast_slice(&vertices), of)?;
        let of = vk::BufferUsageFlags::INDEX_BUFFER;
        let indices = filled(gpu, "models' triangles", bytemuck::cast_slice(&indices), of)?;
        Ok(Self { meshes, vertices, indices, skin_layout, _sampler: sampler })
    }

    /// Descriptor set of a model's texture, where it has one.
    pub(crate) fn skin(&self, model: ModelId) -> Option<vk::DescriptorSet> {
        self.meshes.get(usize::from(model.0)).and_then(|m| m.skin)
    }

    /// Binds the shared buffers.
    pub(crate) fn bind(&self, to: CommandEncoder<'_>) {
        // SAFETY: both buffers are live and have the usage.
        unsafe {
            to.gpu.device.cmd_bind_vertex_buffers(to.cmd, 0, &[self.vertices.raw], &[0]);
            to.gpu.device.cmd_bind_index_buffer(to.cmd, self.indices.raw, 0, vk::IndexType::UINT32);
        }
    }

    /// The coarsest level of a model that lies within `detail_m` of the whole.
    pub(crate) fn level(&self, model: ModelId, detail_m: f64) -> Option<&Level> {
        coarsest(&self.meshes.get(usize::from(model.0))?.levels, detail_m)
    }

    /// The same of a model's shape alone: what throws its shadow.
    pub(crate) fn caster(&self, model: ModelId, detail_m: f64) -> Option<&Level> {
        coarsest(&self.meshes.get(usize::from(model.0))?.casters, detail_m)
    }

    /// By how many times the detail of boats is coarser than what each gives, so that all have at most [`TRIANGLES_MAX`] triangles; at most
    /// [`COARSER_MAX`]. `level` is [`Self::level`] or [`Self::caster`].
    pub(crate) fn coarser<'a>(
        &'a self,
        level: impl Fn(&'a Self, ModelId, f64) -> Option<&'a Level>,
        draws: impl Iterator<Item = (ModelId, f64)> + Clone,
    ) -> f64 {
        coarser(|factor| {
            let levels = draws.clone().filter_map(|(model, detail_m)| level(self, model, factor * detail_m));
            levels.map(|level| (level.open.end - level.closed.start) / 3).sum()
        })
    }

    /// Draws some of a model's triangles.
    pub(crate) fn draw(&self, to: CommandEncoder<'_>, model: ModelId, indices: &Range<u32>) {
        let Some(mesh) = self.meshes.get(usize::from(model.0)) else { return };
        let (count, first) = (indices.end - indices.start, mesh.first_index + indices.start);
        // SAFETY: within a rendering, with buffers and pipeline bound; the ranges were checked when the model was taken.
        unsafe { to.gpu.device.cmd_draw_indexed(to.cmd, count, 1, first, mesh.first_vertex, 0) };
    }
}

/// The coarsest of `levels` that lies within `detail_m` of the whole.
fn coarsest(levels: &[Level], detail_m: f64) -> Option<&Level> {
    levels.iter().rev().find(|l| l.error_m() <= detail_m).or_else(|| levels.first())
}

/// The same by how many triangles there are at a factor.
fn coarser(triangles: impl Fn(f64) -> u32) -> f64 {
    let mut factor = 1.0;
    while factor < COARSER_MAX && triangles(factor) > TRIANGLES_MAX {
        factor = f64::min(1.2 * factor, COARSER_MAX);
    }
    factor
}

/// Refuses what would make the GPU read beyond its buffers.
fn check(model: &Model) -> Result<(), RenderError> {
    let bad = |why: String| Err(RenderError::Model { name: model.name.clone(), why });
    if let Some(i) = model.indices.iter().find(|i| **i as usize >= model.vertices.len()) {
        return bad(format!("a triangle names corner {i} of {}", model.vertices.len()));
    }
    if !model.indices.len().is_multiple_of(3) {
        return bad(format!("{} indices are no whole triangles", model.indices.len()));
    }
    if model.vertices.iter().any(|v| !(v.position.is_finite() && v.normal.is_finite() && v.uv.is_finite())) {
        return bad("a corner is not finite".to_owned());
    }
    if let Some(t) = &model.texture {
        let expected = t.width as usize * t.height as usize * 4;
        if t.width == 0 || t.height == 0 || t.rgba.len() != expected {
            return bad(format!("its {}x{} texture has {} bytes", t.width, t.height, t.rgba.len()));
        }
    }
    Ok(())
}

fn filled(
    gpu: &Arc<Gpu>,
    what: &'static str,
    bytes: &[u8],
    usage: vk::BufferUsageFlags,
) -> Result<Buffer, RenderError> {
    let mut buffer = Buffer::new(gpu, what, bytes.len() as u64, usage, Access::Upload)?;
    buffer.write(0, bytes);
    Ok(buffer)
}

fn upload_texture(gpu: &Arc<Gpu>, name: &str, texture: &Texture) -> Result<Image, RenderError> {
    let max = gpu.limits.max_image_dimension2_d;
    if texture.width > max || texture.height > max {
        let why = format!("its {}x{} texture exceeds the GPU's {max} pixels", texture.width, texture.height);
        return Err(RenderError::Model { name: name.to_owned(), why });
    }
    let levels = smaller_levels(texture);
    let usage = vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST;
    let mut shape = ImageShape::new((texture.width, texture.height), SRGB, usage);
    shape.levels = u32::try_from(levels.len() + 1).unwrap_or(1);
    let image = Image::new(gpu, "models' textures", shape)?;
    let all: Vec<&[u8]> =
        std::iter::once(&texture.rgba[..]).chain(levels.iter().map(Vec::as_slice)).collect();
    upload_image(gpu, &image, &all)?;
    Ok(image)
}

/// Levels 1 and on: each the mean of 2 x 2 pixels of the one before, in linear light and weighted by alpha, so that what lies
/// under transparent pixels does not bleed in.
fn smaller_levels(texture: &Texture) -> Vec<Vec<u8>> {
    let mut levels: Vec<Vec<u8>> = Vec::new();
    let (mut width, mut height) = (texture.width as usize, texture.height as usize);
    while width > 1 || height > 1 {
        let from = levels.last().map_or(&texture.rgba[..], Vec::as_slice);
        let (w, h) = ((width / 2).max(1), (height / 2).max(1));
        let mut next = Vec::with_capacity(w * h * 4);
        for y in 0..h {
            for x in 0..w {
                next.extend_from_slice(&mean(from, (width, height), (x * 2, y * 2)));
            }
        }
        levels.push(next);
        (width, height) = (w, h);
    }
    levels
}

fn mean(from: &[u8], (width, height): (usize, usize), (x, y): (usize, usize)) -> [u8; 4] {
    let (mut light, mut alpha) = ([0.0_f32; 3], 0.0_f32);
    for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let i = ((y + dy).min(height - 1) * width + (x + dx).min(width - 1)) * 4;
        let a = f32::from(from[i + 3]) / 255.0;
        for (sum, code) in light.iter_mut().zip(&from[i..i + 3]) {
            *sum += linear(*code) * a;
        }
        alpha += a;
    }
    let rgb = light.map(|sum| code(sum / alpha.max(1e-6)));
    [rgb[0], rgb[1], rgb[2], (alpha / 4.0 * 255.0).round() as u8]
}

fn linear(code: u8) -> f32 {
    srgb_to_linear(f32::from(code) / 255.0)
}

fn code(linear: f32) -> u8 {
    (linear_to_srgb(linear) * 255.0).round().clamp(0.0, 255.0) as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;

    #[test]
    fn a_crowd_is_drawn_coarser_until_it_is_cheap_or_would_show() {
        assert_eq!(coarser(|_| TRIANGLES_MAX), 1.0);
        // Triangles fall with the square of the detail.
        let crowd = |factor: f64| (60_000.0 / (factor * factor)) as u32;
        let factor = coarser(crowd);
        assert!(crowd(factor) <= TRIANGLES_MAX && crowd(factor / 1.2) > TRIANGLES_MAX, "{factor}");
        assert_eq!(coarser(|_| u32::MAX), COARSER_MAX);
    }

    #[test]
    fn smaller_levels_keep_light_and_ignore_what_is_transparent() {
        let mut rgba = Vec::new();
        for i in 0..16 {
            // A white and black board, in light half as bright, with one transparent red pixel.
            let on = (i / 4 + i % 4) % 2 == 0;
            rgba.extend_from_slice(if i == 15 {
                &[255, 0, 0, 0]
            } else if on {
                &[255; 4]
            } else {
                &[0, 0, 0, 255]
            });
        }
        let levels = smaller_levels(&Texture { width: 4, height: 4, rgba });
        assert_eq!(levels.iter().map(Vec::len).collect::<Vec<_>>(), [16, 4]);
        assert_eq!(levels[0][..4], [188, 188, 188, 255]);
        assert_eq!(levels[0][12..], [code(1.0 / 3.0), code(1.0 / 3.0), code(1.0 / 3.0), 191]);
    }

    #[test]
    fn models_that_would_be_read_out_of_bounds_are_refused() {
        let good = testing::box_model("box", [4.0, 2.0, 1.5], [0.5; 3]);
        assert_eq!(check(&good), Ok(()));
        let mut bad = good.clone();
        bad.indices[4] = 9999;
        assert!(check(&bad).unwrap_err().to_string().contains("corner 9999"));
        let mut bad = good.clone();
        bad.indices.pop();
        assert!(check(&bad).is_err());
        let mut bad = good.clone();
        bad.texture = Some(Texture { width: 2, height: 2, rgba: vec![0; 15] });
        assert!(check(&bad).unwrap_err().to_string().contains("2x2"));
        let mut bad = good;
        bad.vertices[0].position.x = f32::NAN;
        assert!(check(&bad).is_err());
    }
}
