//! What host and shaders pass to each other: one plain struct for each block of `glsl/`. Their layouts are
//! held against the compiled SPIR-V by `tests/interface.rs`. Numbers that both sides know by name stand in `glsl/` and are read from there.

use bytemuck::{Pod, Zeroable};

/// A plain struct with the fields of a block of `glsl/`, in order; all of them zero by default.
macro_rules! block {
    ($(#[$doc:meta])* pub struct $name:ident { $($(#[$of:meta])* pub $field:ident: $type:ty,)+ }) => {
        $(#[$doc])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
        pub struct $name {
            $($(#[$of])* pub $field: $type,)+
        }

        impl $name {
            /// Name and byte offset of each field, in order.
            pub const FIELDS: &'static [(&'static str, u32)] =
                &[$((stringify!($field), std::mem::offset_of!(Self, $field) as u32)),+];
        }

        impl Default for $name {
            fn default() -> Self {
                Self::zeroed()
            }
        }
    };
}

/// Most lamps that light one boat.
pub const BOAT_LAMPS: usize = crate::glsl::number(crate::glsl::BOAT, "const int BOAT_LAMPS") as usize;
/// Rings of a pool of light...
pub const POOL_RINGS: u32 = crate::glsl::number(crate::glsl::POOL, "const int POOL_RINGS");
/// ...and its sectors.
pub const POOL_SECTORS: u32 = crate::glsl::number(crate::glsl::POOL, "const int POOL_SECTORS");

block! {
    /// Light and lens of one frame: `FrameBlock`, set 0, binding 0, std140.
    pub struct FrameBlock {
        /// Focal lengths, pixels.
        pub focal: [f32; 2],
        /// Principal point, pixels.
        pub centre: [f32; 2],
        /// k1, k2, p1, p2, or a fisheye's k1 to k4.
        pub bend: [f32; 4],
        /// The screen, pixels.
        pub size: [f32; 2],
        /// Near plane, metres; depth is near / distance.
        pub near: f32,
        /// Squared tangent of the angle from the axis beyond which the distortion stays as it is there.
        pub r2_max: f32,
        /// Linear radiance of a white matt surface that faces the sun.
        pub sun: [f32; 4],
        /// The same, seeing only the upper sky.
        pub sky: [f32; 4],
        /// The same, seeing only the sea.
        pub sea: [f32; 4],
        /// Radiance of the horizon.
        pub horizon: [f32; 4],
        /// The searchlight, camera's axes, metres; the last is how its light falls off its axis, 1/rad^2.
        pub lamp: [f32; 4],
        /// Its axis, camera's axes; the last is the linear radiance of a white matt surface that faces it a metre off, 0 while it is off.
        pub beam: [f32; 4],
        /// The camera's turn from row to row while a rolling shutter reads, radians about its axes; the last is unused.
        pub row_turn: [f32; 4],
        /// The camera's noise: its variance in the dark, squared light; its growth with light; red's share of green's noise and its own, blue's
        /// share of green's and of red's own; and the picture's number, whole and below 2^24, pixels of the picture for one of the screen, at
        /// most 1, and 1 where pairs of pixels share the noise of their colour.
        pub noise: [[f32; 4]; 4],
    }
}

block! {
    /// One drawn boat: `BoatBlock`, set 0, binding 1, std430. Planes and directions are in the boat's space.
    pub struct BoatBlock {
        /// Rows of the matrix from the boat's space to the camera's.
        pub camera_from_boat: [[f32; 4]; 3],
        /// Plane whose value is the height above the mean water, metres.
        pub water_plane: [f32; 4],
        /// Plane that is positive above the line of sight over the sea's horizon.
        pub horizon_plane: [f32; 4],
        /// Unit vector towards the sun; the last is how far off the surface its shadow is looked up, metres.
        pub sun: [f32; 4],
        /// The eye, metres; the last is the share of the light that haze replaces.
        pub eye: [f32; 4],
        /// The light of the whole sky: its lobes' radiances, boat's axes.
        pub lobes: [[f32; 4]; 9],
        /// Rows of the matrix from the boat's space to texels of the shadow map and nearness to the sun, 0 to 1; nearness 2 where
        /// nothing shades the boat.
        pub shadow_from_boat: [[f32; 4]; 3],
        /// Lowest and highest place in texels at which the map is looked up: the four texels about each are the boat's own.
        pub shadow_box: [f32; 4],
        /// Lamps that light it, metres; the last is unused.
        pub lamps: [[f32; 4]; BOAT_LAMPS],
        /// Linear radiance of a white matt surface that faces each a metre off, less what air takes on the way; the last is unused.
        pub lamp_lights: [[f32; 4]; BOAT_LAMPS],
        /// Lamplight of the air before it; the last is unused.
        pub air: [f32; 4],
    }
}

block! {
    /// A point of light on an image: `LightBlock`, push constants.
    pub struct LightBlock {
        /// The pixels of the screen that it can reach.
        pub rect: [f32; 4],
        /// Its place, the image's own pixels.
        pub at: [f32; 2],
        /// Near plane over its distance.
        pub depth: f32,
        /// 1 / (2 sigma^2) of its core, per squared pixel of the image.
        pub sharp: f32,
        /// Linear light in the middle of the core; the last is unused.
        pub core: [f32; 4],
        /// That of the glow about it; the last is 1 / its squared radius, per squared pixel.
        pub glow: [f32; 4],
    }
}

block! {
    /// Cells of the lamps' grid: `LamplightBlock`, push constants.
    pub struct LamplightBlock {
        /// Column and row of the first one, how many of its row, and nodes of a row.
        pub cells: [i32; 4],
        /// Pixels from node to node.
        pub cell_px: f32,
    }
}

block! {
    /// A node of that grid: `LamplightNode`, set 0, binding 10, std430.
    pub struct LamplightNode {
        /// Light of air and sea; the last is unused.
        pub light: [f32; 4],
    }
}

block! {
    /// A pool of light on the sea: `PoolBlock`, push constants.
    pub struct PoolBlock {
        /// Its middle, camera's axes, metres; the last is the lamp's height over it.
        pub foot: [f32; 4],
        /// A level unit vector, camera's axes; the last is the pool's radius, metres.
        pub aside: [f32; 4],
        /// The level unit vector across that; the last is unused.
        pub away: [f32; 4],
        /// Light of the sea for a unit of what falls flat on it; the last is unused.
        pub light: [f32; 4],
    }
}

block! {
    /// A boat drawn as the sun sees it: `ShadowBlock`, push constants.
    pub struct ShadowBlock {
        /// Rows of the matrix from its space to clip space, on the place of the boat that it may shade.
        pub clip_from_boat: [[f32; 4]; 3],
    }
}

/// Most [`BoatBlock`]s in a frame: each boat's own and its mirror image's.
pub const BOAT_BLOCKS_MAX: usize = 128;

/// Most [`WaterBlock`]s in a frame.
pub const WATERS_MAX: usize = 64;

/// Columns of the table that a [`WaterBlock`] holds.
pub const HULL_LINE_COLUMNS: usize = 32;

block! {
    /// How one boat is put onto the sea: `WaterBlock`, set 0, binding 2, std140. Pixels are the screen's.
    pub struct WaterBlock {
        /// Point from which the hull-water line is measured, pixels.
        pub anchor: [f32; 2],
        /// Unit vector on the screen in which gravity pulls at the boat.
        pub down: [f32; 2],
        /// Across position of the table's first column and columns for each pixel.
        pub columns: [f32; 2],
        /// Texture coordinates of the mirror layer for each pixel.
        pub mirror_scale: [f32; 2],
        /// Texture coordinates of the mirror layer at pixel (0, 0).
        pub mirror_offset: [f32; 2],
        /// Aligns the next field.
        pub pad: [f32; 2],
        /// Smallest and largest texture coordinates that belong to this boat.
        pub mirror_bounds: [f32; 4],
        /// Thresholds of the wave pass-through: from none to all when dark, from all to none when bright.
        pub passes: [f32; 4],
        /// i of eq. 7.
        pub shadow: f32,
        /// 1 / k of eq. 7, per pixel.
        pub shadow_fall: f32,
        /// Pixels between the nine gradients' places.
        pub step: f32,
        /// Spread of the gradients below which a patch counts as flat, in sRGB codes 0 to 1.
        pub flat_spread: f32,
        /// Pixels below [`WaterBlock::anchor`] of the hull-water line, column by column.
        pub hull_line: [f32; HULL_LINE_COLUMNS],
    }
}

/// A reflection method's own block beside a [`WaterBlock`], set 0, binding 8, std140: the bytes of one of the blocks below. A frame has
/// those of its one method, one after the other without room between them.
pub type MethodBytes = [f32; 12];

/// `block` as [`MethodBytes`].
pub fn method_bytes<T: Pod>(block: &T) -> (MethodBytes, usize) {
    let mut bytes = MethodBytes::default();
    let own: &[f32] = bytemuck::cast_slice(std::slice::from_ref(block));
    bytes[..own.len()].copy_from_slice(own);
    (bytes, own.len())
}

block! {
    /// The plain mirror picture: `MirrorBlock`.
    pub struct MirrorBlock {
        /// Share of the mirrored light at the hull-water line.
        pub alpha: f32,
        /// `alpha` / k of eq. 6, per pixel.
        pub alpha_fall: f32,
        /// Keeps the array's stride.
        pub pad: [f32; 2],
    }
}

block! {
    /// Full Reflection as published: `FullPublishedBlock`.
    pub struct FullPublishedBlock {
        /// Share of the mirrored light at the hull-water line.
        pub alpha: f32,
        /// `alpha` / k of eq. 6, per pixel.
        pub alpha_fall: f32,
        /// Largest shift of the mirror coordinate, pixels.
        pub shift: f32,
        /// Shift beyond which the reflection is discarded, pixels.
        pub shift_limit: f32,
        /// Step of the box blur, texture coordinates.
        pub blur: [f32; 2],
        /// Brightness below and above which the video passes through.
        pub bright: [f32; 2],
    }
}

block! {
    /// Full Reflection corrected: `FullBlock`.
    pub struct FullBlock {
        /// Share of the mirrored light at the hull-water line.
        pub alpha: f32,
        /// `alpha` / k of eq. 6, per pixel.
        pub alpha_fall: f32,
        /// Largest shift of the mirror coordinate, pixels.
        pub shift: f32,
        /// Shift at which it stops, pixels.
        pub shift_limit: f32,
        /// Share of the largest shift at the hull-water line.
        pub shift_near: f32,
        /// Growth of that share, per pixel below the line.
        pub shift_grow: f32,
        /// Keeps the array's stride.
        pub pad: [f32; 2],
    }
}

block! {
    /// Physics as published: `PhysicsPublishedBlock`.
    pub struct PhysicsPublishedBlock {
        /// Height of the waves, metres.
        pub height: f32,
        /// Their frequency, radians a metre.
        pub frequency: f32,
        /// Height of the swell, metres.
        pub swell: f32,
        /// Its frequency, radians a metre.
        pub swell_frequency: f32,
        /// Largest shift of the mirror coordinate, pixels.
        pub shift: f32,
        /// Shift beyond which the reflection is discarded, pixels.
        pub shift_limit: f32,
        /// Aligns the next field.
        pub pad: [f32; 2],
        /// Tangent below the horizontal at the anchor, its change by pixel; height of the eye and of the ship, metres.
        pub sight: [f32; 4],
    }
}

block! {
    /// Physics corrected: `PhysicsBlock`.
    pub struct PhysicsBlock {
        /// Share of the light that is mirrored.
        pub share: f32,
        /// Largest shift of the mirror coordinate, pixels.
        pub shift: f32,
        /// Shift at which it stops, pixels.
        pub shift_limit: f32,
        /// Aligns the next field.
        pub pad: f32,
        /// Tangent below the horizontal at the anchor, its change by pixel; height of the eye and of the ship, metres.
        pub sight: [f32; 4],
    }
}

/// Waves of the corrected Physics shader: set 0, binding 9.
pub const PHYSICS_WAVES: usize =
    crate::glsl::number(crate::glsl::PHYSICS, "const int PHYSICS_WAVES") as usize;

block! {
    /// Shadow of a hull by the scene's own light: `ContactBlock`.
    pub struct ContactBlock {
        /// Tangent below the horizontal at the anchor, its change by pixel; height of the eye and of the hull, metres.
        pub sight: [f32; 4],
        /// Share of the sea's light that the sky made within the water.
        pub sky: f32,
        /// The same of the sun, where the hull's shadow lies on this side of it.
        pub sun: f32,
        /// Distance towards the eye that the shadow reaches, metres.
        pub sun_m: f32,
        /// Keeps the array's stride.
        pub pad: f32,
    }
}

/// Bands of height that a [`LobeBlock`] holds a boat in, at most.
pub const LOBE_BANDS: usize = 10;
/// Distances from the hull that a [`LobeBlock`] knows, at most.
pub const LOBE_STEPS: usize = 20;
/// Columns of a boat's bands on the GPU, at most.
pub const LOBE_COLUMNS: u32 = 42;
/// Columns of what the sea throws back of a boat on the GPU, at most.
pub const LAYER_COLUMNS: u32 = 64;

block! {
    /// What the sea throws back of one boat: `LobeBlock`, set 0, binding 6, std430. Goes with the [`WaterBlock`] of the same index.
    pub struct LobeBlock {
        /// Tangent below the horizontal at the anchor; 1 / pixels to a tangent of 1.
        pub place: [f32; 2],
        /// Keeps the size.
        pub pad: [f32; 2],
        /// Height of the boat, m; across position of its picture's first column, pixels to a column; pixels to a metre at the anchor.
        pub board: [f32; 4],
        /// Across position of the hull's left end; its width; how much farther the reflection goes to each side, at the hull and more with
        /// each step; pixels.
        pub span: [f32; 4],
        /// Bands, steps, columns of its picture and columns of its layers, as many as this boat has.
        pub sizes: [i32; 4],
        /// By distance and band: light thrown back, what a bright pixel has more of it, metres aside, half width in metres (less than 0: no
        /// more bands); share of a pixel's light taken away, by channel, and what a bright pixel has more of it.
        pub lobes: [[[[f32; 4]; 2]; LOBE_BANDS]; LOBE_STEPS],
    }
}

/// Points of a boat's track on the GPU.
pub const TRACK_POINTS: usize = 32;

block! {
    /// A point of a boat's track: `WakePoint`.
    pub struct WakePoint {
        /// Camera space; how far the track reaches to each side, metres.
        pub place: [f32; 4],
        /// Unit vector to starboard, camera space; height of the highest waves one length off, metres.
        pub side: [f32; 4],
        /// Place on the water modulo the foam's repeat, metres; unit vector to starboard there.
        pub world: [f32; 4],
        /// Metres behind the bow, m/s, seconds since the boat's middle was here, share that is drawn.
        pub track: [f32; 4],
    }
}

block! {
    /// What is the same for all of a boat's wake: `WakeHead`.
    pub struct WakeHead {
        /// Unit vector upwards, camera space; root of the sea's mean square slope.
        pub up: [f32; 4],
        /// Length and beam at the water line, metres; share of light that haze replaces; height of what the bow throws up, metres.
        pub hull: [f32; 4],
        /// Light of whole foam; how much of it the hull throws up.
        pub foam: [f32; 4],
        /// What the shader's sea is multiplied with to give the picture's; unused.
        pub sea: [f32; 4],
        /// Rows of the matrix from camera space to texels of the shadow map and nearness to the sun.
        pub shade_rows: [[f32; 4]; 3],
        /// First and last texels, each way, that are the boat's: none where it throws no shadow.
        pub shade_box: [f32; 4],
        /// Light of whole foam in the boat's shadow; unused.
        pub shade_foam: [f32; 4],
    }
}

block! {
    /// What one boat leaves on the water: `WakeBlock`, set 0, binding 7, std430.
    pub struct WakeBlock {
        /// What is the same everywhere.
        pub head: WakeHead,
        /// The track from ahead of the bow backwards.
        pub points: [WakePoint; TRACK_POINTS],
    }
}

block! {
    /// One tracer, splash or strike: `RoundBlock`, set 0, binding 3, std430.
    pub struct RoundBlock {
        /// One end of the axis: pixels, depth (near / distance), and how far before and behind that it reaches, metres.
        pub from: [f32; 4],
        /// The other end.
        pub to: [f32; 4],
        /// Linear light and opacity, or optical depth.
        pub colour: [f32; 4],
        /// Half widths at both ends, pixels; of smoke the second is the radius at which it ends, half widths.
        pub half_width: [f32; 2],
        /// What it is: one of the `ROUND_` constants.
        pub kind: u32,
        /// Tells one from another: no two splashes are torn alike.
        pub seed: f32,
    }
}

/// [`RoundBlock::kind`]: the streak of a tracer.
pub const ROUND_TRACER: u32 = 0;
/// [`RoundBlock::kind`]: a column of water.
pub const ROUND_SPLASH: u32 = 1;
/// [`RoundBlock::kind`]: sparks on a boat.
pub const ROUND_STRIKE: u32 = 2;
/// [`RoundBlock::kind`]: a puff of smoke.
pub const ROUND_SMOKE: u32 = 3;
/// [`RoundBlock::kind`]: a flame.
pub const ROUND_FLAME: u32 = 4;

block! {
    /// One rectangle of the head-up display: `HudQuad`, set 0, binding 4, std430.
    pub struct HudQuad {
        /// x0, y0, x1, y1 in pixels.
        pub rect: [f32; 4],
        /// The same corners in the glyph atlas, texels.
        pub uv: [f32; 4],
        /// Linear light, straight alpha.
        pub colour: [f32; 4],
        /// What fills it: one of the `SHAPE_` constants.
        pub shape: u32,
        /// Radius of a plate's corners, pixels.
        pub edge: f32,
        /// Keeps the array's stride.
        pub pad0: f32,
        /// Keeps the array's stride.
        pub pad1: f32,
    }
}

/// [`HudQuad::shape`]: a glyph of the atlas.
pub const SHAPE_GLYPH: u32 = 0;
/// [`HudQuad::shape`]: a rectangle with round corners.
pub const SHAPE_PLATE: u32 = 1;
/// [`HudQuad::shape`]: a disc.
pub const SHAPE_DISC: u32 = 2;
/// [`HudQuad::shape`]: a ring.
pub const SHAPE_RING: u32 = 3;
/// [`HudQuad::shape`]: a slanting cross.
pub const SHAPE_CROSS: u32 = 4;
/// [`HudQuad::shape`]: a triangle that stands on its side.
pub const SHAPE_TRIANGLE: u32 = 5;
/// [`HudQuad::shape`]: a square.
pub const SHAPE_SQUARE: u32 = 6;
/// [`HudQuad::shape`]: a square on its corner.
pub const SHAPE_DIAMOND: u32 = 7;
/// A ring with a bar across.
pub const SHAPE_BARRED: u32 = 8;

block! {
    /// Push constants of the video pass: `VideoBlock`.
    pub struct VideoBlock {
        /// Picture pixels for each screen pixel.
        pub scale: [f32; 2],
        /// Picture position of the screen's upper left corner.
        pub offset: [f32; 2],
        /// The picture, pixels.
        pub size: [i32; 2],
    }
}

block! {
    /// Push constants of the phantoms' pass: `PhantomBlock`.
    pub struct PhantomBlock {
        /// Screen position of the upper left corner of its textures, pixels.
        pub origin: [f32; 2],
        /// Their size, pixels.
        pub size: [f32; 2],
        /// Screen position at which the bore vanishes.
        pub bore: [f32; 2],
        /// What recoils is seen so many times as far from there as it rests.
        pub recoil: f32,
        /// Width of an edge, pixels.
        pub soft: f32,
        /// Light of lamps on a white matt thing; the last is the luminance that the picture shows of one, lit as it is.
        pub lit: [f32; 4],
    }
}

block! {
    /// Push constants of everything that is drawn boat by boat: `DrawBlock`.
    pub struct DrawBlock {
        /// x0, y0, x1, y1 in pixels: the quad, or what is added to each quad of the frame's list.
        pub rect: [f32; 4],
        /// Which boat or round.
        pub index: u32,
        /// First quad of the frame's list: instances count from there.
        pub first: u32,
    }
}

block! {
    /// Push constants of what puts the layers onto the sea: `ReflectBlock`.
    pub struct ReflectBlock {
        /// Index of the boat's [`WaterBlock`] and [`LobeBlock`].
        pub index: u32,
        /// First vector of the frame's list.
        pub first: u32,
        /// The boat's last step.
        pub last_step: f32,
        /// Middle of the boat's first row of the layers, texels.
        pub first_row: f32,
        /// Tangent below the horizontal: for each pixel right and down, at pixel (0, 0); last column of the boat's layers.
        pub tangent: [f32; 4],
        /// Mean of the sea's luma: coefficients of the tangent's root's powers 0 to 2; smallest root.
        pub mean: [f32; 4],
        /// How much brighter than that a pixel is which has as much more as an outer brightness; largest root.
        pub spread: [f32; 4],
        /// Tangent below the horizontal at the anchor, its change by pixel, square of the step by pixel and over the tangent's square.
        pub place: [f32; 4],
        /// The same as in the [`LobeBlock`].
        pub span: [f32; 4],
        /// Luminance above which light is the sun's: coefficients of the powers of the step.
        pub sky_most: [f32; 4],
        /// Size of the layers' texels, texture coordinates.
        pub texel: [f32; 2],
        /// Keeps the size.
        pub pad: [f32; 2],
    }
}

block! {
    /// A corner of a boat's mesh: vertex inputs 0 to 6 of `boat.vert`.
    pub struct MeshVertex {
        /// Metres, boat's space.
        pub position: [f32; 3],
        /// Unit outward normal.
        pub normal: [f32; 3],
        /// Texture coordinate.
        pub uv: [f32; 2],
        /// Linear diffuse reflectance.
        pub albedo: [f32; 3],
        /// Radiance of the corner, were it white, over that of each of the sky's lobes 0 to 3, ...
        pub sky0: [f32; 4],
        /// ...4 to 7, ...
        pub sky1: [f32; 4],
        /// ...8, and over that of the sea.
        pub sky2: [f32; 2],
        /// The sun's light by way of the boat's other faces, over the radiance of white that faces the sun: the product with 1 and the unit
        /// vector towards the sun.
        pub thrown: [f32; 4],
    }
}
