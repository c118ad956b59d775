//! Rows of Hughes, Konttinen and Pattanaik 2004.

use super::{DocumentRow, PartTable, Source, at_sea, contact, crews, relit, review, stages};

/// Rows in the document's order.
pub const ROWS: &[DocumentRow] = &[
    DocumentRow {
        id: "phantoms",
        source: Source::Hughes,
        name: "Phantom models",
        passage: "4.1: meshes of real things, never drawn on screen, drawn to depth so that they hide what is virtual behind them",
        printed: "A triangle mesh of each real thing at its tracked pose fills the depth buffer before virtual things are drawn. The edge is the mesh's: a pixel is real or \
                  virtual.",
        breaks: "On a gun the mesh has to be modelled and its pose to be known. A hard edge leaves a rim of real sea before a virtual hull, where the picture mixes gun and sea.",
        product: "An outline in the picture, which needs no depth and no pose, found by what keeps still while the gun turns. Its edge is as soft as the lens makes it and takes \
                  the gun's light from further inside. Recoil is followed.",
        commands: &[
            "cargo run --release -p precision -- documents --only phantoms",
            "cargo run --release -p precision -- --part phantom",
        ],
        tables: &[PartTable {
            part: "phantom",
            caption: "The outline against the one that the simulated camera draws by",
            scenes: &[],
            methods: &[],
        }],
        exhibits: Some(at_sea::phantoms),
    },
    DocumentRow {
        id: "equation-1",
        source: Source::Hughes,
        name: "Light on real pixels",
        passage: "4.3, eq. 1: C = D + D * S, with the picture's own colour D for the unknown reflectance; darken by F and restore; undo the camera's gamma first",
        printed: "Alpha blending of the light S, between 0 and 1, with source factor destination colour and destination factor one. Darkening scales all channels by a \
                  factor; light is then given back by the same blending.",
        breaks: "A virtual light may be many times as strong as the real one: S of 0 to 1 at most doubles a pixel. Without the gamma undone light adds up wrongly. A sum that is not \
                 limited wraps in eight bits. By night D is noise, and D * S is noise made bright.",
        product: "In linear light: the picture over the light that it was taken in is the reflectance, held between .02 and .6, and in the dark it is grey paint's; that times the \
                  lamps' light is added, in a target that holds more than white. In half dark the grey costs colour and texture, as the pictures show.",
        commands: &[
            "cargo run --release -p precision -- --part relight",
            "cargo run --release -p precision -- documents --only equation-1",
        ],
        tables: &[PartTable {
            part: "relight",
            caption: "Error of a pixel to which a virtual light is added",
            scenes: &[],
            methods: &[],
        }],
        exhibits: Some(relit::exhibits),
    },
    DocumentRow {
        id: "fire",
        source: Source::Hughes,
        name: "Virtual fire",
        passage: "4.3, figure 2: particles sorted into groups by remaining life, a point light for each group at mean position and intensity",
        printed: "The light of a fire on its surroundings is the sum of some point lights, one for each group of particles.",
        breaks: "Particles and their groups have a state that depends on the pace of frames. The mean of positions does not weigh bright particles more. Close to the fire, few groups are too \
                 few.",
        product: "Flames and smoke are functions of time. A fire is one lamp at half the height of its flames, as strong as its heat; it lights hulls, sea, air and gun.",
        commands: &[
            "cargo run --release -p precision -- --part fires",
            "bowwave play tests/data/night-scene.toml --aim trained --headless --duration 20 --stills 300 --out target/night",
        ],
        tables: &[PartTable {
            part: "fires",
            caption: "Irradiance at places around a fire against that of all its particles",
            scenes: &[],
            methods: &[],
        }],
        exhibits: Some(at_sea::fire),
    },
    DocumentRow {
        id: "flashlight",
        source: Source::Hughes,
        name: "Virtual flashlight",
        passage: "4.4.5, figure 3: a marker is tracked as a flashlight, whose light falls on real and virtual things",
        printed: "A spot light at the marker's pose; real things are lit by way of their phantoms.",
        breaks: "At sea there are no phantoms but the gun: most of what a beam shows is air and water.",
        product: "A searchlight whose axis is the barrel's. It lights boats, and adds to the real picture what air scatters back and what comes out of the water. Crews that it lights \
                  know it.",
        commands: &[
            "cargo run --release -p precision -- --part beam",
            "bowwave play night-intruder --aim expert --headless --duration 10 --stills 200 --out target/intruder",
        ],
        tables: &[PartTable {
            part: "beam",
            caption: "The beam's light in the air before the camera",
            scenes: &[],
            methods: &[],
        }],
        exhibits: Some(at_sea::flashlight),
    },
    DocumentRow {
        id: "volumes",
        source: Source::Hughes,
        name: "Shadow volumes",
        passage: "4.4.1 to 4.4.5: silhouette edges drawn out away from the light, counted in the stencil buffer; five stages for virtual on real, four for shadows on virtual",
        printed: "Edges are drawn out by some length; faces before what is seen are counted, front faces up and back faces down; what counts to other than zero is in shadow.",
        breaks: "Counting before what is seen is wrong for an eye that is itself in a shadow. A length ends before the shadow of a low sun does.",
        product: "A shadow map a boat. Volumes are built as printed and as they should be (to infinity, counted behind what is seen, with caps) to be held against it: they err less at \
                  several times the cost.",
        commands: &[
            "cargo run --release -p precision -- --part shadow",
            "cargo run --release -p precision -- documents --only volumes",
        ],
        tables: &[
            PartTable {
                part: "shadow",
                caption: "A boat's shadows on itself",
                scenes: &["a boat at", "eye within", "horizon, abeam"],
                methods: &["shadow volumes", "no shadow"],
            },
            PartTable {
                part: "shadow",
                caption: "Drawings of both sequences",
                scenes: &["what a frame draws"],
                methods: &[],
            },
        ],
        exhibits: Some(stages::volumes_exhibits),
    },
    DocumentRow {
        id: "environment",
        source: Source::Hughes,
        name: "Environment light",
        passage: "4.5, figure 4: spherical harmonics of captured light, their effect stored at each vertex; at phantom vertices the ratio of the coefficients with and without the object",
        printed: "Each vertex holds what it gets of each harmonic; a vertex of the phantom holds the ratio of these with and without the virtual object, by which the real pixel is made \
                  darker: a soft contact shadow.",
        breaks: "On a level plane without an object most coefficients are zero, so that their ratio is none. Low orders ring: their light is negative opposite a bright sun.",
        product: "Ten products a corner: nine polynomials fitted to the upper half of the sky, damped so that no clear sky is negative, and the sea. The ship's own deck has no contact \
                  shadow, since boats float on water: their reflection is what darkens it.",
        commands: &[
            "cargo run --release -p precision -- --part ambient",
            "cargo run --release -p precision -- documents --only environment",
        ],
        tables: &[
            PartTable {
                part: "ambient",
                caption: "Light of the whole sky on a boat's corners, and the contact shadow on a plane under it",
                scenes: &[],
                methods: &[],
            },
            PartTable {
                part: "skylight",
                caption: "The sky that is guessed from what is seen of it",
                scenes: &["median"],
                methods: &[],
            },
        ],
        exhibits: Some(contact::exhibits),
    },
    DocumentRow {
        id: "shadow-maps",
        source: Source::Hughes,
        name: "Shadow maps",
        passage: "4.6: the alternative for dynamic scenes of many polygons: real and virtual things drawn to a map as the light sees them",
        printed: "One map of finite resolution for the light; blocky edges where one looks closely.",
        breaks: "A map of the whole scene has most of its texels where nothing is seen.",
        product: "A place a boat in one map, a texel for a pixel of the screen, far sides drawn so that no bias is needed.",
        commands: &[
            "cargo run --release -p precision -- --part shadow",
            "cargo run --release -p precision -- documents --only shadow-maps",
        ],
        tables: &[PartTable {
            part: "shadow",
            caption: "A boat's shadows on itself by maps",
            scenes: &["a boat at", "light along the view"],
            methods: &["a map a boat", "one map", "no shadow"],
        }],
        exhibits: Some(at_sea::shadow_maps),
    },
    DocumentRow {
        id: "tracing",
        source: Source::Hughes,
        name: "Phantom tracing",
        passage: "5: a concave polygon traced in the picture; the homography of the marker's plane gives its shape in the world; triangulation",
        printed: "Each corner's place on the plane Z = 0 is solved for by two equations with two unknowns; the polygon is then triangulated.",
        breaks: "A plane that is seen edge on makes the two equations nearly the same: a pixel becomes metres. Only planes can be traced.",
        product: "A flat part of the gun is traced in the picture and taken to its plane by a homography of four points or more (normalised direct linear transform). It is refused above a \
                  condition number at which half a pixel would be a tenth of the part. The outline is triangulated and written as a model, and models are seen as outlines through the \
                  lens. The same outlines are traced with mouse and keys, or found while the gun turns.",
        commands: &[
            "bowwave calibrate phantom gun.png --calibration calibration.toml --trace",
            "bowwave calibrate phantom gun.png --calibration calibration.toml --plane \"500,300=0,0 700,300=0.4,0 690,420=0.4,0.3 505,415=0,0.3\" \
             --outline \"shield=500,300 700,300 690,420 600,350 505,415\" --glb shield.glb",
            "bowwave calibrate phantom --calibration calibration.toml --model shield.glb",
            "cargo run --release -p precision -- --part phantom",
        ],
        tables: &[
            PartTable {
                part: "phantom",
                caption: "Places on a plate that is turned away, half a pixel off, as printed and normalised",
                scenes: &["plate of"],
                methods: &["as printed"],
            },
            PartTable {
                part: "phantom",
                caption: "A model's outline through the lens, and outlines that were found",
                scenes: &["outline"],
                methods: &[],
            },
        ],
        exhibits: None,
    },
    DocumentRow {
        id: "after-action",
        source: Source::Hughes,
        name: "Capture for after-action review",
        passage: "6: actions are captured and replayed; the viewpoint of the replay may be changed",
        printed: "A capture shows trainees where they missed cues; seen from elsewhere it shows what they could have had.",
        breaks: "A replay that is not the same run shows what never was.",
        product: "A recording holds all inputs with their ticks; a session that is stepped through them gives the same records and scenes to the bit, or the replay says so. The chart is the \
                  run from above.",
        commands: &[
            "bowwave play tests/data/night-scene.toml --aim trained --headless --duration 20 --record --out target/review",
            "bowwave replay target/review/recording.mcap --chart target/review.svg",
        ],
        tables: &[],
        exhibits: Some(review::exhibits),
    },
    DocumentRow {
        id: "story",
        source: Source::Hughes,
        name: "Story engine with agents that know of light",
        passage: "6 and 7: agents know what stands in their line of sight; that they know light and shadow is named as work to be done",
        printed: "Rays tell agents what is in their line of sight.",
        breaks: "A line of sight says nothing of light: by night a dark skiff two kilometres off would be seen.",
        product: "Crews see the gun, and boats could be seen from the gun, by what eyes need of contrast in the light that there is; a crew that stands in the searchlight is warned. Times to \
                  detect are scored from when a boat could be seen.",
        commands: &[
            "cargo run --release -p precision -- --part seeing",
            "bowwave scenario check night-intruder",
            "bowwave score bowwave-out",
        ],
        tables: &[PartTable {
            part: "seeing",
            caption: "Thresholds of sight, and distances that follow from them",
            scenes: &[],
            methods: &[],
        }],
        exhibits: Some(crews::exhibits),
    },
    DocumentRow {
        id: "thirty",
        source: Source::Hughes,
        name: "Thirty frames a second",
        passage: "Abstract: visual realism requires all interactions at interactive rates of more than 30 frames a second",
        printed: "As fast as it goes, at 30 frames a second or more.",
        breaks: "A mean rate says nothing of frames that come late or twice.",
        product: "A tick locked to camera and display, 30 a second; what a busy computer leaves out is left out before a frame is late.",
        commands: &[
            "cargo run --release -p precision -- --part pacing",
            "bowwave simulate --realtime --duration 60 --out target/realtime",
        ],
        tables: &[PartTable {
            part: "pacing",
            caption: "Time from a picture's arrival to the blank that shows it, with uneven frames counted",
            scenes: &[],
            methods: &[],
        }],
        exhibits: None,
    },
];
