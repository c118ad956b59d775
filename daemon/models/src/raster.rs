//! A small software rasteriser: pictures of models without a GPU, the same on every machine.
//!
//! It makes the built-in picture model and contact sheets; the trainer's own pictures come from the renderer.

use bowwave_core::{
    colour::{linear_to_srgb, srgb_to_linear},
    model::{Model, Texture, Vertex},
};
use glam::{Mat4, Vec2, Vec3, Vec4};
use image::{Rgba, RgbaImage};

/// A picture in the making: linear colour, coverage and depth, several samples a pixel.
pub struct SideCanvas {
    width: u32,
    height: u32,
    /// Samples along each side of a pixel.
    samples: u32,
    colour: Vec<Vec4>,
    depth: Vec<f32>,
}

impl SideCanvas {
    /// An empty, see-through canvas with `samples` x `samples` samples a pixel.
    pub fn new(width: u32, height: u32, samples: u32) -> Self {
        let (width, height, samples) = (width.max(1), height.max(1), samples.max(1));
        let count = (width * samples) as usize * (height * samples) as usize;
        Self { width, height, samples, colour: vec![Vec4::ZERO; count], depth: vec![f32::INFINITY; count] }
    }

    /// Fills everything that is behind all models: `at` gives the linear colour for a point from (0, 0) upper left to
    /// (1, 1) lower right.
    pub fn backdrop(&mut self, at: impl Fn(Vec2) -> Vec3) {
        let size = Vec2::new((self.width * self.samples) as f32, (self.height * self.samples) as f32);
        let across = (self.width * self.samples) as usize;
        for (i, colour) in self.colour.iter_mut().enumerate() {
            *colour = at((Vec2::new((i % across) as f32, (i / across) as f32) + 0.5) / size).extend(1.0);
        }
    }

    /// Draws the front faces of `model`. `clip_from_model` maps to x right, y up, both -1 to 1, and z growing with
    /// distance; triangles that reach behind the eye are left out. `shade` turns a surface point (in the model's space),
    /// its unit normal and its albedo into linear colour; `None` leaves the point out.
    pub fn draw(
        &mut self,
        model: &Model,
        clip_from_model: Mat4,
        shade: impl Fn(Vec3, Vec3, Vec3) -> Option<Vec3>,
    ) {
        for corners in model.indices.chunks_exact(3) {
            let Some(corners) = corner_triple(model, corners) else { continue };
            let clip = corners.map(|v| clip_from_model * v.position.extend(1.0));
            if clip.iter().any(|c| c.w <= 1e-6) {
                continue;
            }
            let screen = clip.map(|c| self.to_screen(c));
            self.triangle(&corners, screen, model.texture.as_ref(), &shade);
        }
    }

    fn to_screen(&self, c: Vec4) -> Vec3 {
        let (w, h) = ((self.width * self.samples) as f32, (self.height * self.samples) as f32);
        Vec3::new((c.x / c.w * 0.5 + 0.5) * w, (0.5 - c.y / c.w * 0.5) * h, c.z / c.w)
    }

    fn triangle(
        &mut self,
        corners: &[&Vertex; 3],
        s: [Vec3; 3],
        texture: Option<&Texture>,
        shade: &impl Fn(Vec3, Vec3, Vec3) -> Option<Vec3>,
    ) {
        let edge = |a: Vec3, b: Vec3, p: Vec2| (b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x);
        let area = edge(s[0], s[1], s[2].truncate());
        // Rows run downwards: a front face, counter-clockwise to the eye, has a negative area here.
        if area >= 0.0 || !area.is_finite() {
            return;
        }
        let (across, down) = (self.width * self.samples, self.height * self.samples);
        let low = s[0].min(s[1]).min(s[2]).floor().max(Vec3::ZERO);
        let high = s[0].max(s[1]).max(s[2]).ceil();
        let (x1, y1) = ((high.x as u32).min(across), (high.y as u32).min(down));
        for y in low.y as u32..y1 {
            for x in low.x as u32..x1 {
                let p = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                let w = [edge(s[1], s[2], p), edge(s[2], s[0], p), edge(s[0], s[1], p)].map(|e| e / area);
                if w.iter().any(|&w| w < 0.0) {
                    continue;
                }
                let depth = s[0].z * w[0] + s[1].z * w[1] + s[2].z * w[2];
                let i = y as usize * across as usize + x as usize;
                if depth >= self.depth[i] {
                    continue;
                }
                let mix = |f: fn(&Vertex) -> Vec3| {
                    f(corners[0]) * w[0] + f(corners[1]) * w[1] + f(corners[2]) * w[2]
                };
                let mut albedo = mix(|v| v.albedo);
                if let Some(texture) = texture {
                    let texel = sample(texture, mix(|v| v.uv.extend(0.0)).truncate());
                    if texel.w < 0.5 {
                        continue;
                    }
                    albedo *= texel.truncate();
                }
                let normal = mix(|v| v.normal).normalize_or(Vec3::Z);
                if let Some(colour) = shade(mix(|v| v.position), normal, albedo) {
                    self.depth[i] = depth;
                    self.colour[i] = colour.extend(1.0);
                }
            }
        }
    }

    /// The finished picture, sRGB-coded with straight alpha. See-through pixels take the colour of their nearest covered
    /// neighbours, so that filtering finds no dark fringe.
    pub fn finish(&self) -> RgbaImage {
        let mut picture = RgbaImage::from_fn(self.width, self.height, |x, y| self.pixel(x, y));
        bleed(&mut picture, 3);
        picture
    }

    fn pixel(&self, x: u32, y: u32) -> Rgba<u8> {
        let across = (self.width * self.samples) as usize;
        let mut sum = Vec4::ZERO;
        for row in 0..self.samples {
            let start = (y * self.samples + row) as usize * across + (x * self.samples) as usize;
            sum += self.colour[start..start + self.samples as usize].iter().sum::<Vec4>();
        }
        let alpha = sum.w / (self.samples * self.samples) as f32;
        let colour = if sum.w > 0.0 { sum.truncate() / sum.w } else { Vec3::ZERO };
        let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
        let [r, g, b] = colour.to_array().map(|c| byte(linear_to_srgb(c.clamp(0.0, 1.0))));
        Rgba([r, g, b, byte(alpha)])
    }
}

fn corner_triple<'a>(model: &'a Model, indices: &[u32]) -> Option<[&'a Vertex; 3]> {
    let at = |k: usize| model.vertices.get(*indices.get(k)? as usize);
    Some([at(0)?, at(1)?, at(2)?])
}

/// Nearest texel, linear with alpha.
fn sample(texture: &Texture, uv: Vec2) -> Vec4 {
    let column = ((uv.x.clamp(0.0, 1.0) * texture.width as f32) as usize)
        .min(texture.width.saturating_sub(1) as usize);
    let row = ((uv.y.clamp(0.0, 1.0) * texture.height as f32) as usize)
        .min(texture.height.saturating_sub(1) as usize);
    let start = (row * texture.width as usize + column) * 4;
    match texture.rgba.get(start..start + 4) {
        Some(&[r, g, b, a]) => {
            let [r, g, b] = [r, g, b].map(|v| srgb_to_linear(f32::from(v) / 255.0));
            Vec4::new(r, g, b, f32::from(a) / 255.0)
        }
        _ => Vec4::ZERO,
    }
}

/// Lets colour, not alpha, run into see-through pixels, `rounds` pixels far.
fn bleed(picture: &mut RgbaImage, rounds: u32) {
    let (width, height) = picture.dimensions();
    let mut known: Vec<bool> = picture.pixels().map(|p| p.0[3] > 0).collect();
    for _ in 0..rounds {
        let before = picture.clone();
        let was = known.clone();
        for y in 0..height {
            for x in 0..width {
                if was[(y * width + x) as usize] {
                    continue;
                }
                let near = [(-1, 0), (1, 0), (0, -1), (0, 1)].into_iter().find_map(|(dx, dy)| {
                    let (nx, ny) = (x.checked_add_signed(dx)?, y.checked_add_signed(dy)?);
                    let covered = nx < width && ny < height && was[(ny * width + nx) as usize];
                    covered.then(|| *before.get_pixel(nx, ny))
                });
                if let Some(Rgba([r, g, b, _])) = near {
                    picture.put_pixel(x, y, Rgba([r, g, b, 0]));
                    known[(y * width + x) as usize] = true;
                }
            }
        }
    }
}
