//! The paints that the built-in boats are made of.

use bowwave_core::colour::srgb_to_linear;
use glam::Vec3;

/// A surface: one glTF material.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Paint {
    /// Sun-bleached white gel coat.
    WhiteHull,
    /// Fishing-boat blue.
    BlueHull,
    /// Inside of an open boat: worn, dirty pale blue.
    Inside,
    /// Dark red antifouling below the waterline.
    Antifouling,
    /// Black boot-topping.
    BootTop,
    /// Inflated tube of a rigid inflatable.
    Tube,
    /// Rubbing strake, tyres, mats.
    Rubber,
    /// Grey gel coat of a rigid inflatable.
    GreyHull,
    /// Non-slip deck of a small boat.
    SoleGrey,
    /// Warship's haze grey.
    Haze,
    /// Warship's deck, darker.
    DeckGrey,
    /// Windows and openings, nearly black.
    Glass,
    /// Bare galvanised or stainless steel.
    Steel,
    /// Engine cowling, nearly black.
    Cowl,
    /// Light band on an engine cowling.
    CowlBand,
    /// Oiled teak.
    Teak,
    /// Weathered deck planks.
    Planks,
    /// Green strake of a dhow.
    GreenStrake,
    /// Off-white of a dhow's deckhouse.
    DeckHouse,
    /// Faded canvas of an awning.
    Canvas,
    /// Fishing net, heaped.
    Net,
    /// Orange buoys and life jackets.
    Orange,
    /// Yellow jerrycans and fish boxes.
    Yellow,
    /// Blue drums.
    BlueDrum,
    /// Skin.
    Skin,
    /// Dark hair.
    Hair,
    /// Faded red shirt.
    RedShirt,
    /// Sand-coloured cloth.
    Sand,
    /// Dark blue cloth.
    Navy,
    /// Dark olive cloth.
    Olive,
    /// Black cloth, boots.
    Black,
    /// White cloth, helmets, radomes.
    White,
    /// White of markings on a warship.
    Marking,
}

impl Paint {
    /// Name of the glTF material.
    pub(crate) fn name(self) -> String {
        format!("{self:?}")
    }

    /// sRGB-coded colour.
    const fn srgb(self) -> [u8; 3] {
        match self {
            Self::WhiteHull => [222, 221, 212],
            Self::BlueHull => [42, 92, 140],
            Self::Inside => [134, 160, 168],
            Self::Antifouling => [112, 44, 38],
            Self::BootTop => [30, 31, 33],
            Self::Tube => [52, 55, 58],
            Self::Rubber => [34, 34, 35],
            Self::GreyHull => [128, 134, 138],
            Self::SoleGrey => [98, 102, 103],
            Self::Haze => [150, 157, 162],
            Self::DeckGrey => [92, 98, 102],
            Self::Glass => [26, 32, 38],
            Self::Steel => [158, 160, 160],
            Self::Cowl => [38, 41, 47],
            Self::CowlBand => [186, 190, 194],
            Self::Teak => [112, 72, 43],
            Self::Planks => [146, 121, 92],
            Self::GreenStrake => [52, 112, 92],
            Self::DeckHouse => [212, 205, 184],
            Self::Canvas => [176, 168, 140],
            Self::Net => [62, 92, 78],
            Self::Orange => [222, 96, 34],
            Self::Yellow => [214, 170, 48],
            Self::BlueDrum => [36, 82, 160],
            Self::Skin => [126, 86, 62],
            Self::Hair => [30, 25, 22],
            Self::RedShirt => [156, 52, 46],
            Self::Sand => [178, 158, 122],
            Self::Navy => [38, 46, 66],
            Self::Olive => [76, 80, 56],
            Self::Black => [28, 28, 29],
            Self::White => [230, 229, 222],
            Self::Marking => [226, 228, 228],
        }
    }

    /// Diffuse reflectance, linear.
    pub(crate) fn albedo(self) -> Vec3 {
        Vec3::from_array(self.srgb().map(|c| srgb_to_linear(f32::from(c) / 255.0)))
    }

    /// glTF roughness, 0 to 1.
    pub(crate) const fn roughness(self) -> f32 {
        match self {
            Self::Glass => 0.1,
            Self::Steel | Self::Cowl | Self::CowlBand => 0.4,
            Self::WhiteHull | Self::BlueHull | Self::GreyHull | Self::White => 0.5,
            _ => 0.9,
        }
    }
}
