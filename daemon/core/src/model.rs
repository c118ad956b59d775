//! Models of boats, their looks and the parts that can be hit: plain data, filled by the model loader.

use glam::{DVec2, DVec3, Vec2, Vec3};

use crate::colour::{LUMINANCE, srgb_to_linear};

/// Index of a model in the list that a session and the renderer were both made with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ModelId(pub u16);

/// A part that hits are counted on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Zone {
    /// Anything that is no other zone.
    Hull,
    /// Outboard or engine space: a hit stops the boat.
    Engine,
    /// Helm and helmsman: a hit stops the attack.
    Helm,
}

impl Zone {
    /// All zones.
    pub const ALL: [Self; 3] = [Self::Hull, Self::Engine, Self::Helm];

    /// The name used in models, databases and tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Hull => "hull",
            Self::Engine => "engine",
            Self::Helm => "helm",
        }
    }
}

/// One corner of a triangle, in the boat's space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vertex {
    /// Metres: x forward, y to port, z up from the waterline.
    pub position: Vec3,
    /// Unit outward normal.
    pub normal: Vec3,
    /// Texture coordinate, (0, 0) at the texture's upper left.
    pub uv: Vec2,
    /// Diffuse reflectance, linear, multiplied with the texture.
    pub albedo: Vec3,
}

/// A run of triangles that belong to one zone.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// Which zone a hit on these triangles counts for.
    pub zone: Zone,
    /// Range into [`Model::indices`]; a multiple of three at both ends.
    pub indices: std::ops::Range<u32>,
}

/// An sRGB-coded picture with straight alpha, rows from the top, four bytes a pixel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Texture {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// R, G, B, A bytes.
    pub rgba: Vec<u8>,
}

impl Texture {
    /// Mean luminance of what is not transparent, linear, of some thousand pixels.
    fn reflectance(&self) -> f64 {
        const LOOKED_AT: usize = 4096;
        let step = (self.rgba.len() / 4 / LOOKED_AT).max(1);
        let pixels = self.rgba.chunks_exact(4).step_by(step).map(|pixel| {
            let [r, g, b, a] = [0, 1, 2, 3].map(|i| f32::from(pixel[i]) / 255.0);
            let linear = Vec3::new(srgb_to_linear(r), srgb_to_linear(g), srgb_to_linear(b));
            (f64::from(linear.dot(LUMINANCE) * a), f64::from(a))
        });
        let (light, cover) = pixels.fold((0.0, 0.0), |(light, cover), (l, a)| (light + l, cover + a));
        if cover > 0.0 { light / cover } else { 0.0 }
    }
}

/// Whether a model has a shape or is a picture that turns towards the camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModelKind {
    /// A closed or open mesh.
    Mesh,
    /// A flat picture in the x-z plane that is turned about z to face the camera (the thesis's textured quad).
    Quad,
}

/// A boat.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Name, as scenarios call it.
    pub name: String,
    /// Shape or picture.
    pub kind: ModelKind,
    /// Corners.
    pub vertices: Vec<Vertex>,
    /// Three a triangle, counter-clockwise seen from outside.
    pub indices: Vec<u32>,
    /// Runs of triangles by zone; together they cover all indices once.
    pub parts: Vec<Part>,
    /// The one texture, where there is one.
    pub texture: Option<Texture>,
    /// Convex outline of the hull at z = 0 seen from above, counter-clockwise, metres.
    pub waterline: Vec<DVec2>,
    /// Smallest corner of the bounding box, metres.
    pub min: Vec3,
    /// Largest corner of the bounding box, metres.
    pub max: Vec3,
}

impl Model {
    /// Length over all, metres.
    pub fn length_m(&self) -> f64 {
        f64::from(self.max.x - self.min.x)
    }

    /// Middle of helm and helmsman; of the whole where no part is one. Metres, the boat's space.
    pub fn helm_middle(&self) -> DVec3 {
        self.middle_of(Zone::Helm)
    }

    /// Middle of a zone's parts; of the whole where no part is one. Metres, the boat's space.
    pub fn middle_of(&self, zone: Zone) -> DVec3 {
        let parts = self.parts.iter().filter(|part| part.zone == zone);
        let corners = parts.flat_map(|part| part.indices.clone());
        let places = corners.filter_map(|i| {
            let corner = *self.indices.get(usize::try_from(i).ok()?)?;
            Some(self.vertices.get(usize::try_from(corner).ok()?)?.position.as_dvec3())
        });
        let (sum, count) = places.fold((DVec3::ZERO, 0.0), |(sum, count), at| (sum + at, count + 1.0));
        if count > 0.0 { sum / count } else { 0.5 * (self.min + self.max).as_dvec3() }
    }

    /// Greatest beam, metres.
    pub fn beam_m(&self) -> f64 {
        f64::from(self.max.y - self.min.y)
    }

    /// Highest point above the waterline, metres.
    pub fn height_m(&self) -> f64 {
        f64::from(self.max.z)
    }

    /// Share of light that its surface throws back in the mean over all triangles, 0 to 1; of a textured one with that of the whole texture.
    pub fn reflectance(&self) -> f64 {
        let corner = |i: &u32| self.vertices.get(usize::try_from(*i).ok()?);
        let of_triangle = |triangle: &[u32]| {
            let corners = [corner(triangle.first()?)?, corner(triangle.get(1)?)?, corner(triangle.get(2)?)?];
            let [a, b, c] = corners.map(|corner| corner.position);
            let albedo = corners.iter().map(|corner| corner.albedo.dot(LUMINANCE)).sum::<f32>() / 3.0;
            Some((f64::from((b - a).cross(c - a).length()), f64::from(albedo)))
        };
        let triangles = self.indices.chunks_exact(3).filter_map(of_triangle);
        let (area, thrown) =
            triangles.fold((0.0, 0.0), |(sum, all), (area, albedo)| (sum + area, all + area * albedo));
        let surface = if area > 0.0 { thrown / area } else { 0.0 };
        (surface * self.texture.as_ref().map_or(1.0, Texture::reflectance)).clamp(0.0, 1.0)
    }

    /// Radius about the boat's origin that holds every corner, metres.
    pub fn radius_m(&self) -> f64 {
        self.vertices.iter().map(|v| f64::from(v.position.length())).fold(0.0, f64::max)
    }
}
