//! The JSON schema of a scenario, for editors that complete and check while one types.
//!
//! It says what a schema can: keys, types, names and ranges. What goes with what is the reader's affair. Tests hold it against the reader: each
//! table has the same keys, and both refuse the same values.

use bowwave_core::{
    act::Act,
    side::Side,
    water::ReflectionMethod,
    world::{
        boats::{LightsKept, Propulsor},
        exercise::Engagement,
        gunnery::DragTable,
        scenario::built_in_weapons,
    },
};
use serde_json::{Map, Value, json};

/// The whole schema.
pub fn scenario() -> Value {
    let mut root = table(
        "A scenario for Bowwave",
        vec![
            ("name", text("Its name")),
            ("seed", whole(0, i64::MAX, "Seed of all chance")),
            ("duration_s", number(0.1, 86_400.0, "When it is over, seconds; without it, it goes on")),
            ("briefing", briefing()),
            ("sea", sea()),
            (
                "mount",
                table(
                    "The gun's mount",
                    vec![("eye_height_m", number(0.5, 100.0, "Height of the camera over the sea"))],
                    &[],
                ),
            ),
            ("light", light()),
            ("reflection", reflection()),
            ("weapon", weapon()),
            ("searchlight", searchlight()),
            ("rules", rules()),
            ("goals", goals()),
            ("call", list(call(), 64)),
            ("event", list(event(), 64)),
            ("crew", list(crew(), 32)),
            ("boat", list(boat(), 64)),
        ],
        &[],
    );
    root["$schema"] = json!("https://json-schema.org/draft/2020-12/schema");
    root["title"] = json!("Bowwave scenario");
    root
}

fn table(what: &str, keys: Vec<(&str, Value)>, required: &[&str]) -> Value {
    let properties: Map<String, Value> =
        keys.into_iter().map(|(key, value)| (key.to_owned(), value)).collect();
    json!({
        "type": "object", "description": what, "properties": properties, "additionalProperties": false,
        "required": required,
    })
}

fn list(item: Value, most: usize) -> Value {
    json!({ "type": "array", "items": item, "maxItems": most })
}

fn number(low: f64, high: f64, what: &str) -> Value {
    json!({ "type": "number", "minimum": low, "maximum": high, "description": what })
}

fn whole(low: i64, high: i64, what: &str) -> Value {
    json!({ "type": "integer", "minimum": low, "maximum": high, "description": what })
}

fn flag(what: &str) -> Value {
    json!({ "type": "boolean", "description": what })
}

/// A condition that is asked for, or left out.
fn asked(what: &str) -> Value {
    json!({ "const": true, "description": what })
}

fn text(what: &str) -> Value {
    json!({ "type": "string", "minLength": 1, "maxLength": 200, "description": what })
}

fn one_of<'a>(names: impl IntoIterator<Item = &'a str>, what: &str) -> Value {
    json!({ "enum": names.into_iter().collect::<Vec<_>>(), "description": what })
}

fn briefing() -> Value {
    json!({ "type": "string", "minLength": 1, "maxLength": 4000, "description": "Text that the trainee reads beforehand" })
}

/// A bearing in degrees and a range in metres.
fn points() -> Value {
    json!({
        "type": "array", "minItems": 1, "maxItems": 200, "description": "Points [bearing_deg, range_m]",
        "items": { "type": "array", "minItems": 2, "maxItems": 2, "items": { "type": "number" } },
    })
}

fn angle(what: &str) -> Value {
    number(-360.0, 360.0, what)
}

fn sea() -> Value {
    table(
        "Wind and waves",
        vec![
            ("beaufort", whole(0, 12, "Wind force")),
            ("wind_from_deg", angle("Where the wind comes from, clockwise from north")),
            (
                "significant_wave_height_m",
                number(0.0, 20.0, "With peak_period_s; of the wind force without it"),
            ),
            ("peak_period_s", number(0.5, 30.0, "Period of the highest waves")),
            ("source", one_of(["scenario", "video"], "Whether the sea is measured in the video")),
        ],
        &[],
    )
}

fn light() -> Value {
    table(
        "Sun and visibility",
        vec![
            ("sun_azimuth_deg", angle("Where the sun stands, clockwise from north")),
            ("sun_elevation_deg", number(-90.0, 90.0, "How high it stands")),
            ("latitude_deg", number(-90.0, 90.0, "With longitude_deg and utc, in place of the sun's place")),
            ("longitude_deg", number(-180.0, 180.0, "East")),
            ("utc", json!({ "description": "Date and time, as 2026-06-01T12:00:00Z" })),
            ("visibility_km", number(0.05, 200.0, "Meteorological visibility")),
            (
                "source",
                one_of(
                    ["scenario", "ship"],
                    "Whether place and time come from the ship's instruments once these tell them; ship where no sun is named",
                ),
            ),
        ],
        &[],
    )
}

fn reflection() -> Value {
    table(
        "How the sea mirrors",
        vec![
            ("method", one_of(ReflectionMethod::names(), "Method of reflection")),
            ("shadow_level", whole(0, 2, "How strong the shadow is")),
        ],
        &[],
    )
}

fn searchlight() -> Value {
    table(
        "A searchlight on the gun; the act light switches it",
        vec![
            ("candela", number(100.0, 1e8, "Luminous intensity on its axis")),
            ("beam_deg", number(0.5, 60.0, "Width of its beam between where it has half of that")),
            ("on", flag("Whether it is on as the exercise begins")),
        ],
        &[],
    )
}

fn weapon() -> Value {
    let kinds: Vec<String> =
        built_in_weapons().unwrap_or_default().into_iter().map(|(name, _)| name).collect();
    table(
        "The virtual weapon",
        vec![
            ("kind", one_of(kinds.iter().map(String::as_str), "A built-in weapon; keys beside it change it")),
            ("rounds_per_minute", number(1.0, 6000.0, "Cyclic rate")),
            ("belt", whole(0, 100_000, "Rounds in the belt")),
            ("spare_belts", whole(0, 1000, "Belts besides that")),
            ("reload_s", number(0.0, 600.0, "Time that a belt takes to put in")),
            (
                "stoppage_every",
                number(0.0, 1e6, "Rounds from one stoppage to the next on average; 0 for none"),
            ),
            ("muzzle_velocity_m_s", number(50.0, 2000.0, "Speed at the muzzle")),
            ("ballistic_coefficient_g7_lb_in2", number(0.05, 2.0, "G7 ballistic coefficient")),
            ("ballistic_coefficient_g1_lb_in2", number(0.05, 2.0, "G1 ballistic coefficient, instead")),
            ("ballistic_coefficient_sphere_lb_in2", number(0.05, 2.0, "The same of a ball, instead")),
            (
                "sectional_density_lb_in2",
                number(0.05, 2.0, "Weight by the square of the diameter, for drag_table"),
            ),
            ("drag_table", drag_table()),
            ("dispersion_mrad", number(0.0, 50.0, "Scatter, standard deviation along each of two axes")),
            ("tracer_every", whole(0, 1000, "Every how many rounds one is a tracer; 0 for none")),
            ("tracer_burnout_m", number(0.0, 20_000.0, "Where a tracer burns out")),
            ("splash_height_m", number(0.0, 60.0, "Height of a splash")),
            ("splash_life_s", number(0.1, 10.0, "How long a splash stands")),
            ("ricochet_below_deg", number(0.0, 45.0, "Angle to the water below which a round bounces")),
            (
                "barrel_heat_k",
                number(0.0, 100.0, "Rise of the barrel's temperature with each round; 0: it stays cold"),
            ),
            ("barrel_cooling_s", number(1.0, 1e5, "Time constant with which the barrel cools")),
            ("barrel_hot_k", number(1.0, 2000.0, "Rise above which rounds scatter more")),
            (
                "hole_cm2",
                number(0.0, 10_000.0, "Area that a round opens in a hull, where it goes in and out"),
            ),
            (
                "fragments_m",
                number(0.0, 30.0, "Where half of the people in the open are struck; 0: solid rounds"),
            ),
            ("arming_m", number(0.0, 1000.0, "Distance from the muzzle before which a round does not burst")),
        ],
        &[],
    )
}

fn axes() -> Value {
    json!({
        "type": "array", "minItems": 1, "maxItems": 8,
        "items": { "type": "number", "minimum": -360, "maximum": 360 },
        "description": "Bearings that the boats come from, as many on each, in place of bearing_deg",
    })
}

fn drag_table() -> Value {
    let pair = json!({ "type": "array", "minItems": 2, "maxItems": 2, "items": { "type": "number" } });
    json!({
        "type": "array", "minItems": 2, "maxItems": DragTable::MOST, "items": pair,
        "description": "Drag coefficient by Mach number, instead: [[mach, coefficient], ...]",
    })
}

fn engagement(what: &str) -> Value {
    one_of(Engagement::ALL.map(Engagement::name), what)
}

fn rules() -> Value {
    table(
        "Rules of engagement",
        vec![
            ("engagement", engagement("The rules as the exercise begins")),
            (
                "self_defence_m",
                number(0.0, 20_000.0, "Range within which a hostile boat may be fired at under any rules"),
            ),
        ],
        &["engagement"],
    )
}

fn goals() -> Value {
    let par = json!({
        "type": "array", "minItems": 2, "maxItems": 2, "items": { "type": "number", "minimum": 0, "maximum": 100 },
        "description": "Points of the simulated novice and expert on average",
    });
    table(
        "What is to be reached",
        vec![
            ("keep_off_m", number(0.0, 20_000.0, "Range that hostile boats are to be kept beyond")),
            ("stop", whole(0, 64, "Hostile boats that are to be stopped or turned away; without it all")),
            ("par", par),
        ],
        &[],
    )
}

fn about() -> Value {
    text("hostile, neutral, or the name of a boat or a group")
}

fn call() -> Value {
    let calls = Act::calls().map(Act::name);
    let mut call = table(
        "A call that is to be made",
        vec![
            ("say", one_of(calls, "What is to be called")),
            ("about", about()),
            ("before_m", number(1.0, 20_000.0, "Before the boat is nearer than that")),
            ("within_s", number(1.0, 86_400.0, "Within so many seconds after it came in view")),
        ],
        &["say", "about"],
    );
    call["anyOf"] = json!([{ "required": ["before_m"] }, { "required": ["within_s"] }]);
    call
}

fn event() -> Value {
    let message = json!({
        "type": "string", "pattern": "^[ -~]{1,60}$", "description": "Text that the display shows for six seconds",
    });
    let mut event = table(
        "Something that happens once",
        vec![
            ("at_s", number(0.0, 86_400.0, "So many seconds after the beginning")),
            ("boat", about()),
            ("within_m", number(1.0, 20_000.0, "Once one of the boats is within that range")),
            ("struck", asked("Once one of the boats was struck")),
            ("rules", engagement("Rules of engagement from then on")),
            ("stoppage", flag("The weapon stops with its next round")),
            ("message", message),
            ("flare", flare()),
        ],
        &[],
    );
    event["oneOf"] = json!([{ "required": ["at_s"] }, { "required": ["within_m", "boat"] }, { "required": ["struck", "boat"] }]);
    event["anyOf"] = json!([{ "required": ["rules"] }, { "required": ["stoppage"] }, { "required": ["message"] }, { "required": ["flare"] }]);
    event
}

fn flare() -> Value {
    table(
        "An illuminating flare under a parachute is lit; by night it lights all that is about it",
        vec![
            ("bearing_deg", angle("Bearing of the place under it, clockwise from north")),
            ("range_m", number(1.0, 20_000.0, "Distance of that place from the camera")),
            ("height_m", number(10.0, 2000.0, "Height over the sea")),
            ("candela", number(100.0, 5e6, "Luminous intensity")),
            ("burns_s", number(1.0, 600.0, "Time that it burns")),
            ("falls_m_s", number(0.0, 50.0, "Speed at which it sinks")),
        ],
        &["bearing_deg", "range_m"],
    )
}

fn crew() -> Value {
    table(
        "A crew",
        vec![("name", text("Its name, for boats")), ("state", list(state(), 32))],
        &["name", "state"],
    )
}

fn state() -> Value {
    const ACTS: [&str; 14] = [
        "transit",
        "loiter",
        "fish",
        "anchor",
        "approach",
        "probe",
        "feint",
        "attack",
        "circle",
        "flee",
        "stop",
        "surrender",
        "drift",
        "driven",
    ];
    table(
        "A state of a crew; the first is the one that it begins in",
        vec![
            ("name", text("Its name, for ways out")),
            ("does", one_of(ACTS, "What the crew does")),
            ("speed_kn", number(0.1, 100.0, "Speed that is kept")),
            ("radius_m", number(10.0, 20_000.0, "Of loiter and circle")),
            ("stop_m", number(20.0, 20_000.0, "Of approach and attack: the range at which it stops")),
            ("turn_m", number(40.0, 20_000.0, "Of probe and feint: the range at which it turns away")),
            ("clockwise", flag("Of circle")),
            ("rams", flag("Of attack")),
            ("waypoints", points()),
            ("repeat", flag("Of transit: back to the first point after the last")),
            ("next", list(exit(), 32)),
        ],
        &["name", "does"],
    )
}

fn exit() -> Value {
    let guards = [
        ("after_s", number(0.0, 86_400.0, "Seconds in the state, at least")),
        ("within_m", number(0.0, 20_000.0, "Range from the gun, at most")),
        ("beyond_m", number(0.0, 20_000.0, "Range from the gun, at least")),
        ("arrived", asked("What the state does is done")),
        ("warned", asked("The boat was warned")),
        ("hit", asked("The boat was struck")),
        ("neighbour_hit", asked("A boat of its side within 300 m was struck")),
        ("lit", asked("A searchlight is on it")),
        (
            "sees_gun",
            asked(
                "It sees the ship that the gun stands on: neither a vessel nor haze nor the dark hides her",
            ),
        ),
    ];
    let any: Vec<Value> = guards.iter().map(|(key, _)| json!({ "required": [key] })).collect();
    let mut keys = vec![
        ("to", text("The next state")),
        ("chance", number(0.0, 1.0, "How likely it is taken, once it holds")),
    ];
    keys.extend(guards);
    let mut exit = table("A way out of a state; all that is named must hold", keys, &["to"]);
    exit["anyOf"] = json!(any);
    exit
}

fn boat() -> Value {
    let courses = ["still", "straight", "weave", "waypoints", "closing"];
    let mut boat = table(
        "A boat, or a group of boats",
        vec![
            ("name", text("Its name; boats of a group have numbers behind it")),
            (
                "model",
                text("skiff, rhib, dhow, frigate, frigate-quad, or the path of a .glb, .gltf or .png file"),
            ),
            ("side", one_of(Side::ALL.map(Side::name), "Whom it belongs to")),
            ("course", one_of(courses, "A course that is known beforehand")),
            ("crew", text("The crew that drives it, in place of a course")),
            ("engine", one_of(Propulsor::ALL.map(Propulsor::name), "How it is driven, with a crew")),
            ("speed_max_kn", number(1.0, 60.0, "Greatest speed in calm water, with a crew")),
            ("keeps_rules", flag("Whether it keeps to the rules of the road, with a crew")),
            (
                "lights",
                one_of(
                    LightsKept::NAMES.map(|(name, _)| name),
                    "Its lights by night: of what it does (rules, where it is neutral), off (else), or always the same",
                ),
            ),
            ("burns_at_s", number(0.0, 86_400.0, "On fire from then on, without being hit")),
            ("reserve", flag("Whether it waits until an instructor has it join")),
            ("count", whole(1, 40, "Boats of the group")),
            ("axes_deg", axes()),
            ("on_target_s", number(1.0, 86_400.0, "When they are to be where they attack from")),
            ("formation", one_of(["abreast", "column", "wedge", "scattered"], "How the group stands")),
            ("spacing_m", number(10.0, 2000.0, "Distance from one to the next")),
            ("range_m", number(1.0, 20_000.0, "Distance from the camera")),
            ("bearing_deg", angle("Bearing from the camera, clockwise from north")),
            ("heading_deg", angle("Where it heads, clockwise from north")),
            ("speed_kn", number(0.0, 100.0, "Its speed")),
            ("weave_amplitude_m", number(0.0, 500.0, "Of weave")),
            ("weave_period_s", number(1.0, 600.0, "Of weave")),
            ("waypoints", points()),
            ("repeat", flag("Of waypoints: back to the first point after the last")),
            ("stop_m", number(5.0, 5000.0, "Of closing: the range at which it arrives")),
            ("arrival", one_of(["stop", "circle"], "Of closing: what it does there")),
        ],
        &["name", "model", "range_m"],
    );
    boat["oneOf"] = json!([{ "required": ["course"] }, { "required": ["crew"] }]);
    boat["anyOf"] = json!([{ "required": ["bearing_deg"] }, { "required": ["axes_deg", "crew"] }]);
    boat
}
