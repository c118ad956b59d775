//! Errors of models.

use std::io;

use bowwave_core::text::toml::TomlError;

/// Why a model cannot be used: which file, what is wrong, what to do.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// The model of a boat cannot be used.
    #[error("cannot load the model of {boat}")]
    OfBoat {
        /// Name of the boat.
        boat: String,
        /// The model's own error.
        source: Box<ModelError>,
    },
    /// More models than [`ModelId`](bowwave_core::model::ModelId) counts.
    #[error("more than {limit} models; leave boats out")]
    TooMany {
        /// Largest number.
        limit: u16,
    },
    /// No built-in model and no file of a known kind.
    #[error(
        "there is no model {name:?}; built in are {}; a file of your own ends in .glb, .gltf or .png", known.join(", ")
    )]
    Unknown {
        /// Name that was asked for.
        name: String,
        /// Names that would do.
        known: Vec<&'static str>,
    },
    /// A file cannot be read.
    #[error("{file}: {source}; check the path and the permissions")]
    Read {
        /// The file.
        file: String,
        /// The operating system's reason.
        source: io::Error,
    },
    /// A file asks for more than the trainer gives.
    #[error(
        "{file}: {what} is {value}, at most {limit} are taken; simplify the model or shrink its pictures"
    )]
    TooLarge {
        /// The file.
        file: String,
        /// The quantity, with its unit.
        what: &'static str,
        /// Its value.
        value: u64,
        /// Its limit.
        limit: u64,
    },
    /// Not glTF, or glTF that contradicts itself.
    #[error("{file}: no usable glTF: {problem}; export it again as glTF 2.0 (.glb) without compression")]
    Gltf {
        /// The file.
        file: String,
        /// The fault, and its place.
        problem: String,
    },
    /// Named parts are missing.
    #[error(
        "{file}: no triangles in a part named {}; the names found are: {}; name the nodes or meshes \"engine\" and \"helm\", \
         all else counts as hull", needed.join(" or "), list(found)
    )]
    MissingPart {
        /// The file.
        file: String,
        /// Parts that are missing.
        needed: Vec<&'static str>,
        /// Names of nodes and meshes in the file, at most twenty.
        found: Vec<String>,
    },
    /// Nothing lies in the water.
    #[error("{file}: the lowest point is {lowest_m:.2} m above the waterline; put the waterline at height 0")]
    Afloat {
        /// The file.
        file: String,
        /// Height of the lowest point, metres.
        lowest_m: f32,
    },
    /// Nothing lies above the water.
    #[error("{file}: the highest point is {:.2} m below the waterline; put the waterline at height 0", -highest_m)]
    Sunk {
        /// The file.
        file: String,
        /// Height of the highest point (not positive), metres.
        highest_m: f32,
    },
    /// The hull is not a body that the sea's surface cuts.
    #[error(
        "{file}: the hull leaves no outline on the water at height 0; give it sides that go through the surface"
    )]
    NoWaterline {
        /// The file.
        file: String,
    },
    /// Not the size of any boat.
    #[error(
        "{file}: the model is {length_m} m long, taken are {shortest_m} to {longest_m} m; glTF is in metres, scale the model"
    )]
    Size {
        /// The file.
        file: String,
        /// Length, metres.
        length_m: f32,
        /// Shortest length taken, metres.
        shortest_m: f32,
        /// Longest length taken, metres.
        longest_m: f32,
    },
    /// Wider than long.
    #[error(
        "{file}: the model is {length_m:.1} m long and {beam_m:.1} m wide; turn its bow to +z (glTF: y up, +z forward)"
    )]
    Across {
        /// The file.
        file: String,
        /// Length, metres.
        length_m: f32,
        /// Beam, metres.
        beam_m: f32,
    },
    /// A picture cannot be used.
    #[error("{file}: {problem}")]
    Picture {
        /// The file.
        file: String,
        /// The fault and its remedy.
        problem: String,
    },
    /// The file beside a picture is missing.
    #[error(
        "{file}: not there; a picture needs it beside itself to have a size: write \"length_m = 120.0\" (metres over all) and \
         \"waterline_row = {row}\" (the picture's row at which the sea begins) into it"
    )]
    SidecarMissing {
        /// The file that is missing.
        file: String,
        /// A row that would do for this picture.
        row: u32,
    },
    /// The file beside a picture says something that cannot be used.
    #[error("{0}")]
    Sidecar(TomlError),
}

fn list(found: &[String]) -> String {
    if found.is_empty() { "none".to_owned() } else { found.join(", ") }
}
