//! The shaders as SPIR-V, and the structs that they share with the host.
//!
//! `glsl/` holds the sources, `spv/` what `./build` made of them. Variants are chosen by specialisation constants, so what a
//! variant leaves out is not compiled by the driver.

#![forbid(unsafe_code)]

pub mod glsl;
pub mod interface;

/// One compiled shader.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shader {
    /// Its file's name in `glsl/`.
    pub name: &'static str,
    /// SPIR-V, little endian words.
    pub bytes: &'static [u8],
}

impl Shader {
    /// The SPIR-V as words.
    pub fn words(&self) -> Vec<u32> {
        self.bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
    }
}

macro_rules! shaders {
    ($($(#[$doc:meta])* $constant:ident = $name:literal;)+) => {
        $($(#[$doc])* pub const $constant: Shader =
            Shader { name: $name, bytes: include_bytes!(concat!("../spv/", $name, ".spv")) };)+
        /// All of them.
        pub const ALL: &[Shader] = &[$($constant),+];
    };
}

shaders! {
    /// A triangle that covers the screen.
    SCREEN_VERT = "screen.vert";
    /// Camera bytes to packed sRGB codes. Constants: 0 format (0 YUYV, 1 NV12, 2 RGB), 1 scaled, 2 pixels a fragment.
    VIDEO_FRAG = "video.frag";
    /// The same with what lies over the picture.
    VIDEO_OVERLAID_FRAG = "video_overlaid.frag";
    /// A corner of a boat without a texture to clip space, and its light.
    BOAT_VERT = "boat.vert";
    /// The same with a texture.
    BOAT_TEXTURED_VERT = "boat_textured.vert";
    /// A boat without a texture. Constant: 0 whether the layer holds roots of light.
    BOAT_FRAG = "boat.frag";
    /// A boat with a texture. Constants: 0 whether the layer holds roots of light, 1 samples.
    BOAT_TEXTURED_FRAG = "boat_textured.frag";
    /// A corner of a boat without a texture, mirrored in the sea: its light is one colour, without shadows.
    BOAT_MIRRORED_VERT = "boat_mirrored.vert";
    /// The same with its place in the texture.
    BOAT_TEXTURED_MIRRORED_VERT = "boat_textured_mirrored.vert";
    /// A boat without a texture, mirrored in the sea. Constant: 0 whether the layer holds roots of light.
    BOAT_MIRRORED_FRAG = "boat_mirrored.frag";
    /// A boat with a texture, mirrored in the sea. Constants: 0 whether the layer holds roots of light, 1 samples.
    BOAT_TEXTURED_MIRRORED_FRAG = "boat_textured_mirrored.frag";
    /// A corner of a boat as the sun sees it.
    SHADOW_VERT = "shadow.vert";
    /// A rectangle given in pixels.
    RECT_VERT = "rect.vert";
    /// A strip of water below a hull, given by where the hull-water line is.
    REFLECT_VERT = "reflect.vert";
    /// The boats' layer, averaged. Constant: 0 samples.
    COMPOSITE_FRAG = "composite.frag";
    /// The same with the camera's noise. Constant: 0 samples.
    COMPOSITE_NOISY_FRAG = "composite_noisy.frag";
    /// The mirror layer, softened.
    SOFTEN_FRAG = "soften.frag";
    /// How the video's brightness changes downwards.
    FIELD_FRAG = "field.frag";
    /// A boat's light on the sea. Constants: 0 method, 1 shadow level, both as `glsl/water_methods.glsl` numbers them.
    WATER_FRAG = "water.frag";
    /// A boat's mirror image collapsed to bands of height.
    BANDS_FRAG = "bands.frag";
    /// Running sums along the bands.
    SUMS_FRAG = "sums.frag";
    /// What the sea throws back of a boat and takes away, and how that changes with a pixel's brightness.
    LAYERS_FRAG = "layers.frag";
    /// The layers put onto the sea.
    REFLECT_FRAG = "reflect.frag";
    /// A strip across a boat's track.
    WAKE_VERT = "wake.vert";
    /// Waves and foam that a boat leaves on the water.
    WAKE_FRAG = "wake.frag";
    /// A sheet of foam beside or behind a hull.
    SPRAY_VERT = "spray.vert";
    /// Foam that stands on the water, where no hull hides it.
    SPRAY_FRAG = "spray.frag";
    /// The rectangle of a tracer, splash or strike.
    ROUND_VERT = "round.vert";
    /// A tracer, splash or strike.
    ROUND_FRAG = "round.frag";
    /// The same where a hull may stand before it: compares depth.
    ROUND_HIDDEN_FRAG = "round_hidden.frag";
    /// The rectangle that a point of light can reach.
    LIGHT_VERT = "light.vert";
    /// A point of light.
    LIGHT_FRAG = "light.frag";
    /// The same where a hull may stand before it: compares depth.
    LIGHT_HIDDEN_FRAG = "light_hidden.frag";
    /// A cell of the lamps' grid.
    LAMPLIGHT_VERT = "lamplight.vert";
    /// The pool of light about a low lamp's foot on the sea.
    POOL_VERT = "pool.vert";
    /// The light of lamps on sea and air.
    LAMPLIGHT_FRAG = "lamplight.frag";
    /// The own gun and ship in the picture, laid over what was drawn.
    PHANTOM_FRAG = "phantom.frag";
    /// A rectangle of the head-up display.
    HUD_VERT = "hud.vert";
    /// What fills a rectangle of the head-up display. Constant: 0 plates, shapes or glyphs.
    HUD_FRAG = "hud.frag";
}
