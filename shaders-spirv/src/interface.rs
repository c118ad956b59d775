//! What host and shaders pass to each other: one plain struct for each block of `glsl/`. The layout is asserted here and
//! held against the compiled SPIR-V by `tests/interface.rs`.

use bytemuck::{Pod, Zeroable};

/// Asserts the byte offset of each field, and the size, at compile time.
macro_rules! layout {
    ($type:ty, $size:expr, $($field:ident = $offset:expr),+ $(,)?) => {
        const _: () = {
            assert!(size_of::<$type>() == $size);
            $(assert!(std::mem::offset_of!($type, $field) == $offset);)+
        };
        impl $type {
            /// Name and byte offset of each field, in order.
            pub const FIELDS: &'static [(&'static str, u32)] = &[$((stringify!($field), $offset)),+];
        }
    };
}

/// Light and lens of one frame: `FrameBlock`, set 0, binding 0, std140.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
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
    /// The camera's turn from row to row while a rolling shutter reads, radians about its axes; the last is unused.
    pub row_turn: [f32; 4],
}
layout!(
    FrameBlock,
    128,
    focal = 0,
    centre = 8,
    bend = 16,
    size = 32,
    near = 40,
    r2_max = 44,
    sun = 48,
    sky = 64,
    sea = 80,
    horizon = 96,
    row_turn = 112,
);

/// One drawn boat: `BoatBlock`, set 0, binding 1, std140. Planes and directions are in the boat's space.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct BoatBlock {
    /// Rows of the matrix from the boat's space to the camera's.
    pub camera_from_boat: [[f32; 4]; 3],
    /// Plane whose value is the height above the mean water, metres.
    pub water_plane: [f32; 4],
    /// Plane that is positive above the line of sight over the sea's horizon.
    pub horizon_plane: [f32; 4],
    /// Unit vector towards the sun; the last is unused.
    pub sun: [f32; 4],
    /// The eye, metres; the last is the share of the light that haze replaces.
    pub eye: [f32; 4],
}
layout!(BoatBlock, 112, camera_from_boat = 0, water_plane = 48, horizon_plane = 64, sun = 80, eye = 96);

/// Most [`BoatBlock`]s in a frame: each boat's own and its mirror image's.
pub const BOAT_BLOCKS_MAX: usize = 128;

/// Most [`WaterBlock`]s in a frame.
pub const WATERS_MAX: usize = 64;

/// Columns of the table that a [`WaterBlock`] holds.
pub const HULL_LINE_COLUMNS: usize = 32;

/// How one boat is put onto the sea: `WaterBlock`, set 0, binding 2, std140. Pixels are the screen's.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct WaterBlock {
    /// Where the hull-water line is measured from, pixels.
    pub anchor: [f32; 2],
    /// Unit vector on the screen in which gravity pulls at the boat.
    pub down: [f32; 2],
    /// Across position of the table's first column and columns for each pixel.
    pub columns: [f32; 2],
    /// Texture coordinates of the mirror layer for each pixel.
    pub mirror_scale: [f32; 2],
    /// Texture coordinates of the mirror layer at pixel (0, 0).
    pub mirror_offset: [f32; 2],
    /// Step of the box blur, texture coordinates.
    pub blur: [f32; 2],
    /// Smallest and largest texture coordinates that belong to this boat.
    pub mirror_bounds: [f32; 4],
    /// Thresholds of the wave pass-through: from none to all when dark, from all to none when bright.
    pub passes: [f32; 4],
    /// Share of the mirrored light at the hull-water line.
    pub alpha: f32,
    /// 1 / k of eq. 6, per pixel.
    pub alpha_fall: f32,
    /// i of eq. 7.
    pub shadow: f32,
    /// 1 / k of eq. 7, per pixel.
    pub shadow_fall: f32,
    /// Largest shift of the mirror coordinate, pixels.
    pub shift: f32,
    /// Shift beyond which the reflection is discarded, pixels.
    pub shift_limit: f32,
    /// Pixels between the nine gradients' places.
    pub step: f32,
    /// Spread of the gradients below which a patch counts as flat, in sRGB codes 0 to 1.
    pub flat_spread: f32,
    /// Share of the largest shift at the hull-water line.
    pub shift_near: f32,
    /// How that share grows, per pixel below the line.
    pub shift_grow: f32,
    /// Keeps the array's stride.
    pub pad0: f32,
    /// Keeps the array's stride.
    pub pad1: f32,
    /// Pixels below [`WaterBlock::anchor`] of the hull-water line, column by column.
    pub hull_line: [f32; HULL_LINE_COLUMNS],
}
layout!(
    WaterBlock,
    256,
    anchor = 0,
    down = 8,
    columns = 16,
    mirror_scale = 24,
    mirror_offset = 32,
    blur = 40,
    mirror_bounds = 48,
    passes = 64,
    alpha = 80,
    alpha_fall = 84,
    shadow = 88,
    shadow_fall = 92,
    shift = 96,
    shift_limit = 100,
    step = 104,
    flat_spread = 108,
    shift_near = 112,
    shift_grow = 116,
    pad0 = 120,
    pad1 = 124,
    hull_line = 128,
);

impl Default for WaterBlock {
    fn default() -> Self {
        Self::zeroed()
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

/// What the sea throws back of one boat: `LobeBlock`, set 0, binding 6, std430. Goes with the [`WaterBlock`] of the same index.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
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
layout!(
    LobeBlock,
    64 + LOBE_STEPS * 32 * LOBE_BANDS,
    place = 0,
    pad = 8,
    board = 16,
    span = 32,
    sizes = 48,
    lobes = 64
);

impl Default for LobeBlock {
    fn default() -> Self {
        Self::zeroed()
    }
}

/// Points of a boat's track on the GPU.
pub const TRACK_POINTS: usize = 32;

/// A point of a boat's track: `WakePoint`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
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
layout!(WakePoint, 64, place = 0, side = 16, world = 32, track = 48);

/// What is the same for all of a boat's wake: `WakeHead`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct WakeHead {
    /// Unit vector upwards, camera space; root of the sea's mean square slope.
    pub up: [f32; 4],
    /// Length and beam at the water line, metres; share of light that haze replaces; height of what the bow throws up, metres.
    pub hull: [f32; 4],
    /// Light of whole foam; how much of it the hull throws up.
    pub foam: [f32; 4],
    /// What the shader's sea is multiplied with to give the picture's; unused.
    pub sea: [f32; 4],
}
layout!(WakeHead, 64, up = 0, hull = 16, foam = 32, sea = 48);

/// What one boat leaves on the water: `WakeBlock`, set 0, binding 7, std430.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct WakeBlock {
    /// What is the same everywhere.
    pub head: WakeHead,
    /// The track from ahead of the bow backwards.
    pub points: [WakePoint; TRACK_POINTS],
}
layout!(WakeBlock, 2112, head = 0, points = 64);

impl Default for WakeBlock {
    fn default() -> Self {
        Self::zeroed()
    }
}

/// One tracer, splash or strike: `RoundBlock`, set 0, binding 3, std430.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct RoundBlock {
    /// One end of the axis: pixels, and depth (near / distance).
    pub from: [f32; 4],
    /// The other end.
    pub to: [f32; 4],
    /// Linear light and opacity.
    pub colour: [f32; 4],
    /// Half widths at both ends, pixels.
    pub half_width: [f32; 2],
    /// What it is: one of the `ROUND_` constants.
    pub kind: u32,
    /// Tells one from another: no two splashes are torn alike.
    pub seed: f32,
}
layout!(RoundBlock, 64, from = 0, to = 16, colour = 32, half_width = 48, kind = 56, seed = 60);

/// [`RoundBlock::kind`]: the streak of a tracer.
pub const ROUND_TRACER: u32 = 0;
/// [`RoundBlock::kind`]: a column of water.
pub const ROUND_SPLASH: u32 = 1;
/// [`RoundBlock::kind`]: sparks on a boat.
pub const ROUND_STRIKE: u32 = 2;

/// One rectangle of the head-up display: `HudQuad`, set 0, binding 4, std430.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
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
layout!(HudQuad, 64, rect = 0, uv = 16, colour = 32, shape = 48, edge = 52, pad0 = 56, pad1 = 60);

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

/// Push constants of the video pass: `VideoBlock`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct VideoBlock {
    /// Picture pixels for each screen pixel.
    pub scale: [f32; 2],
    /// Picture position of the screen's upper left corner.
    pub offset: [f32; 2],
    /// The picture, pixels.
    pub size: [i32; 2],
}
layout!(VideoBlock, 24, scale = 0, offset = 8, size = 16);

/// Push constants of everything that is drawn boat by boat: `DrawBlock`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct DrawBlock {
    /// x0, y0, x1, y1 in pixels: the quad, or what is added to each quad of the frame's list.
    pub rect: [f32; 4],
    /// Which boat or round.
    pub index: u32,
    /// First quad of the frame's list: instances count from there.
    pub first: u32,
}
layout!(DrawBlock, 24, rect = 0, index = 16, first = 20);

/// Push constants of what puts the layers onto the sea: `ReflectBlock`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
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
layout!(
    ReflectBlock,
    128,
    index = 0,
    first = 4,
    last_step = 8,
    first_row = 12,
    tangent = 16,
    mean = 32,
    spread = 48,
    place = 64,
    span = 80,
    sky_most = 96,
    texel = 112,
    pad = 120,
);

/// A corner of a boat's mesh: vertex inputs 0 to 3 of `boat.vert`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct MeshVertex {
    /// Metres, boat's space.
    pub position: [f32; 3],
    /// Unit outward normal.
    pub normal: [f32; 3],
    /// Texture coordinate.
    pub uv: [f32; 2],
    /// Linear diffuse reflectance.
    pub albedo: [f32; 3],
}
layout!(MeshVertex, 44, position = 0, normal = 12, uv = 24, albedo = 32);
