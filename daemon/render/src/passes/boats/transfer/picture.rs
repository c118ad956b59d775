//! The boat seen from far away, with every layer of its surface: by it a place finds what stands between it and the light.

use bowwave_core::model::Model;
use glam::{Vec2, Vec3};

/// Texels along each side of a picture.
const TEXELS: usize = 256;
/// No layer.
const NONE: u32 = u32::MAX;

/// One face of the boat at one texel.
struct Layer {
    /// Way towards the light, metres.
    way: f32,
    /// The triangle.
    face: u32,
    /// The next layer of the texel, in no order.
    next: u32,
}

/// An orthographic picture of a boat from one direction that holds all layers of each texel (Carpenter 1984, "The A-buffer").
pub(super) struct LayeredPicture {
    middle: Vec3,
    radius: f32,
    across: Vec3,
    up: Vec3,
    towards: Vec3,
    first: Vec<u32>,
    layers: Vec<Layer>,
}

impl LayeredPicture {
    /// Takes no picture yet.
    pub(super) fn of(model: &Model) -> Self {
        let middle = 0.5 * (model.min + model.max);
        let radius = model.vertices.iter().map(|v| v.position.distance(middle)).fold(0.1, f32::max);
        Self {
            middle,
            radius,
            across: Vec3::X,
            up: Vec3::Y,
            towards: Vec3::Z,
            first: vec![NONE; TEXELS * TEXELS],
            layers: Vec::new(),
        }
    }

    /// Metres of a texel.
    fn texel_m(&self) -> f32 {
        2.0 * self.radius / (TEXELS - 4) as f32
    }

    /// Texel coordinates and way towards the light.
    fn place(&self, p: Vec3) -> Vec3 {
        let (p, half) = (p - self.middle, 0.5 * TEXELS as f32);
        let flat = Vec2::new(p.dot(self.across), p.dot(self.up)) / self.texel_m() + half;
        flat.extend(p.dot(self.towards))
    }

    /// Takes the picture that light from `towards` has of the boat.
    pub(super) fn take(&mut self, model: &Model, towards: Vec3) {
        (self.across, self.up) = towards.any_orthonormal_pair();
        self.towards = towards;
        self.first.fill(NONE);
        self.layers.clear();
        let placed: Vec<Vec3> = model.vertices.iter().map(|v| self.place(v.position)).collect();
        for (face, t) in model.indices.chunks_exact(3).enumerate() {
            self.draw(face as u32, [t[0], t[1], t[2]].map(|i| placed[i as usize]));
        }
    }

    fn draw(&mut self, face: u32, [a, b, c]: [Vec3; 3]) {
        let edge = |p: Vec3, q: Vec3| (q - p).truncate();
        let area = edge(a, b).perp_dot(edge(a, c));
        if area.abs() < 1e-6 {
            return;
        }
        let last = (TEXELS - 1) as f32;
        let low = a.min(b).min(c).clamp(Vec3::ZERO, Vec3::splat(last));
        let high = a.max(b).max(c).clamp(Vec3::ZERO, Vec3::splat(last));
        // Ways grow linearly over the triangle.
        let (of_b, of_c) = (edge(a, c).perp() / -area, edge(a, b).perp() / area);
        for y in low.y.floor() as usize..=high.y.floor() as usize {
            for x in low.x.floor() as usize..=high.x.floor() as usize {
                let p = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) - a.truncate();
                let (u, v) = (p.dot(of_b), p.dot(of_c));
                if u < 0.0 || v < 0.0 || u + v > 1.0 {
                    continue;
                }
                let way = a.z + u * (b.z - a.z) + v * (c.z - a.z);
                let first = &mut self.first[y * TEXELS + x];
                self.layers.push(Layer { way, face, next: *first });
                *first = self.layers.len() as u32 - 1;
            }
        }
    }

    /// The face that a place on the surface, on the side of `normal`, sees where the light would come from; `None` where it sees the light.
    pub(super) fn before(&self, p: Vec3, normal: Vec3) -> Option<u32> {
        /// Texels by which the place is lifted off its own surface, and by which something else must be nearer.
        const OFF: f32 = 1.5;
        const NEARER: f32 = 0.75;
        let at = self.place(p + normal * (OFF * self.texel_m()));
        let (x, y) = (at.x.max(0.0) as usize, at.y.max(0.0) as usize);
        let mut next = *self.first.get(y.min(TEXELS - 1) * TEXELS + x.min(TEXELS - 1))?;
        let mut nearest: Option<&Layer> = None;
        while let Some(layer) = self.layers.get(next as usize) {
            if layer.way > at.z + NEARER * self.texel_m() && nearest.is_none_or(|n| layer.way < n.way) {
                nearest = Some(layer);
            }
            next = layer.next;
        }
        nearest.map(|layer| layer.face)
    }
}
