//! Models of boats, their looks and the parts that can be hit: plain data, filled by the model loader.

use glam::{DVec2, DVec3, Vec2, Vec3};

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

    /// Radius about the boat's origin that holds every corner, metres.
    pub fn radius_m(&self) -> f64 {
        self.vertices.iter().map(|v| f64::from(v.position.length())).fold(0.0, f64::max)
    }
}
