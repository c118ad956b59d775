//! Steps a session through the inputs of its own recording: the same records and scenes must come out.

use std::{collections::BTreeMap, path::Path};

use anyhow::{Context, Result, bail};
use bowwave_calibration::parse;
use bowwave_core::{
    estimate::{HeadingSettings, Landmark, ShipHeadings, Stow, attitude::Source as OrientationSource},
    event::{CameraFrame, Event, Input, PixelFormat},
    model::Model,
    session::{Digest, Session, SessionDigest, Setup},
    time::Time,
    world::{
        World,
        exercise::ExerciseEvent,
        scenario::Scenario,
        score::{ScoreFold, ScoreSheet, ShotRecord},
    },
};
use bowwave_devices::camera::jpeg::Decoder;
use bowwave_models::BoatModels;
use bowwave_record::{Entry, Properties, RecordError, RecordingReader};

/// Version of the properties that a session's settings are kept in.
const FORMAT: &str = "1";

const ORIENTATIONS: [(OrientationSource, &str); 2] =
    [(OrientationSource::Auto, "auto"), (OrientationSource::Fused, "fused")];
const LAYOUTS: [(PixelFormat, &str); 3] =
    [(PixelFormat::Yuyv, "yuyv"), (PixelFormat::Nv12, "nv12"), (PixelFormat::Rgb, "rgb")];

/// Result of a replay.
#[derive(Clone, Debug)]
pub struct Replayed {
    /// Ticks that were stepped.
    pub ticks: u64,
    /// Inputs that were read, ticks included.
    pub inputs: u64,
    /// Inputs that the session had met and that the recording lacks.
    pub missing: u64,
    /// Pictures that were coded anew for the recording, so that their pixels are not those that the session saw.
    pub recoded: u64,
    /// When records or scenes were first found to differ.
    pub differs_from: Option<Time>,
    /// Over all that came out.
    pub digest: SessionDigest,
    /// Rounds fired and rounds that struck.
    pub score: (u64, u64),
    /// The score of the run.
    pub sheet: ScoreSheet,
    /// Where the file was cut short.
    pub cut: bool,
}

impl Replayed {
    /// Whether the recording holds all that the session met.
    pub const fn is_complete(&self) -> bool {
        self.missing == 0 && self.recoded == 0 && !self.cut
    }
}

/// Replays `path`. Models of boats that are files are looked for where they lay.
pub fn replay(path: &Path) -> Result<Replayed> {
    replay_noting(path, &mut |_, _, _| {})
}

/// Meets the world with the records of rounds and the events of the exercise that a tick gave.
pub type TickNote<'a> = dyn FnMut(&World, &[ShotRecord], &[ExerciseEvent]) + 'a;

/// The same; `note` is called after each tick and at the end.
pub fn replay_noting(path: &Path, note: &mut TickNote<'_>) -> Result<Replayed> {
    let reader = RecordingReader::open(path)?;
    if reader.counts().ticks == 0 {
        bail!(
            "{}: it holds no ticks, so that it does not tell what a session met when: it was imported, or made before ticks were recorded; \
             `bowwave simulate` plays it with ticks of its own",
            path.display()
        );
    }
    let setup = setup_of(reader.properties(), path)?;
    let mut session = Session::new(setup)?;
    let mut decoder = Decoder::for_recordings();
    let mut fold = ScoreFold::default();
    let mut result = Replayed {
        ticks: 0,
        inputs: 0,
        missing: 0,
        recoded: 0,
        differs_from: None,
        digest: SessionDigest::default(),
        score: (0, 0),
        sheet: ScoreFold::default().sheet(),
        cut: false,
    };
    for entry in reader.entries_as_written()? {
        let input = match entry {
            Err(RecordError::Truncated { .. }) => {
                result.cut = true;
                break;
            }
            entry => {
                let entry = entry?;
                result.recoded += u64::from(matches!(&entry, Entry::Frame(frame) if frame.is_recoded));
                match input_of(entry, &mut decoder, path)? {
                    Some(input) => input,
                    None => continue,
                }
            }
        };
        match input {
            RecordedInput::Event(event) => {
                session.event(&event);
            }
            RecordedInput::Tick(entry) => {
                result.missing = entry.inputs.saturating_sub(result.inputs);
                let digest = session.digest();
                if (digest.records.get(), digest.scenes.get()) != (entry.records, entry.scenes) {
                    result.differs_from.get_or_insert(entry.tick.time);
                }
                if let Some(answer) = session.input(&Input::Tick(entry.tick)) {
                    let (records, events) = (answer.records.to_vec(), answer.events.to_vec());
                    fold.take(&records, &events);
                    note(session.world(), &records, &events);
                }
                result.ticks += 1;
            }
        }
        result.inputs += 1;
    }
    let (records, events) = session.finish();
    let (records, events) = (records.to_vec(), events.to_vec());
    fold.take(&records, &events);
    note(session.world(), &records, &events);
    result.sheet = fold.sheet();
    result.digest = session.digest();
    result.score = session.score();
    Ok(result)
}

enum RecordedInput {
    Event(Event),
    Tick(bowwave_record::TickEntry),
}

/// The input that an entry is; `None` for what a session does not meet.
fn input_of(entry: Entry, decoder: &mut Decoder, path: &Path) -> Result<Option<RecordedInput>> {
    Ok(Some(RecordedInput::Event(match entry {
        Entry::Tick(entry) => return Ok(Some(RecordedInput::Tick(entry))),
        Entry::Imu(sample) => Event::Imu(sample),
        Entry::Trigger(edge) => Event::Trigger(edge),
        Entry::Mark(mark) => Event::Mark(mark),
        Entry::Act(act) => Event::Act(act),
        Entry::Order(order) => Event::Order(order),
        Entry::ShipValues(sample) => Event::Ship(sample),
        Entry::ShipFix(fix) => Event::ShipFix(fix),
        Entry::Fault(entry) => Event::Fault(entry.change),
        Entry::Picture(picture) => Event::Frame(picture.into()),
        Entry::Frame(frame) => {
            let picture = decoder
                .decode(&frame.jpeg, None)
                .with_context(|| format!("{}: the picture of {}", path.display(), frame.arrival))?;
            Event::Frame(CameraFrame {
                arrival: frame.arrival,
                mid_exposure: frame.mid_exposure,
                sequence: frame.sequence,
                picture,
                jpeg: None,
            })
        }
        Entry::Ship(_) | Entry::Truth(_) | Entry::Pose(_) => return Ok(None),
    })))
}

/// Settings of a session as properties of its recording, beside scenario and calibration. `models_base` is the folder that the paths of
/// the scenario's models start from.
pub fn session_properties(setup: &Setup, models_base: &Path) -> BTreeMap<String, String> {
    [
        ("format", FORMAT.to_owned()),
        ("seed", setup.scenario.seed.to_string()),
        ("eye_height_m", format!("{:?}", setup.scenario.eye_height_m)),
        ("screen", format!("{}x{}", setup.screen.0, setup.screen.1)),
        ("video", name_of(&LAYOUTS, setup.video).to_owned()),
        ("orientation", name_of(&ORIENTATIONS, setup.orientation).to_owned()),
        ("models_base", models_base.display().to_string()),
        ("models", models_digest(&setup.models)),
    ]
    .into_iter()
    .chain(heading_properties(&setup.heading))
    .map(|(key, value)| (format!("session.{key}"), value))
    .collect()
}

fn heading_properties(heading: &HeadingSettings) -> [(&'static str, String); 7] {
    // The shortest text that gives back the same bits.
    let number = |value: f64| format!("{value:?}");
    let optional = |value: Option<f64>| value.map_or_else(String::new, number);
    let stow = heading.stow.map_or_else(String::new, |s| {
        format!("{},{},{}", optional(s.from_bow), optional(s.from_north), number(s.sigma))
    });
    let landmarks: Vec<String> =
        heading.landmarks.iter().map(|l| format!("{},{}", number(l.bearing), number(l.sigma))).collect();
    [
        ("heading.ship_latency_ns", heading.ship.latency_ns.to_string()),
        ("heading.ship_sigma", number(heading.ship.sigma)),
        ("heading.stow", stow),
        ("heading.landmarks", landmarks.join(";")),
        ("heading.own_growth", optional(heading.own_growth)),
        ("heading.sky_drift", number(heading.sky_drift)),
        ("heading.shown_above", number(heading.shown_above)),
    ]
}

fn name_of<T: Copy + PartialEq>(names: &[(T, &'static str)], value: T) -> &'static str {
    names.iter().find(|(known, _)| *known == value).map_or("", |(_, name)| name)
}

fn models_digest(models: &[Model]) -> String {
    let mut digest = Digest::default();
    for model in models {
        digest.take(&(&model.name, model.kind, model.min, model.max, &model.vertices, &model.indices));
    }
    format!("{:016x}", digest.get())
}

/// The scenario that the run at `path` played.
pub fn scenario_of(path: &Path) -> Result<Scenario> {
    scenario_in(RecordingReader::open(path)?.properties(), path)
}

fn scenario_in(properties: &Properties, path: &Path) -> Result<Scenario> {
    let origin = path.display();
    let toml =
        properties.scenario_toml.as_deref().with_context(|| format!("{origin}: it holds no scenario"))?;
    Ok(Scenario::parse(toml, &format!("{origin} (its scenario)"))?)
}

/// A session's settings out of its recording.
fn setup_of(properties: &Properties, path: &Path) -> Result<Setup> {
    let origin = path.display();
    let text = |key: &str| {
        properties.extra.get(&format!("session.{key}")).map(String::as_str).with_context(|| {
            format!("{origin}: its property session.{key} is missing: the session's settings are not known")
        })
    };
    let wrong = |key: &str, value: &str| {
        format!("{origin}: its property session.{key} is {value:?}, which is not understood")
    };
    let number = |key: &str| -> Result<f64> {
        let value = text(key)?;
        value.parse().with_context(|| wrong(key, value))
    };
    let format = text("format")?;
    anyhow::ensure!(format == FORMAT, wrong("format", format));
    let file = parse(&properties.calibration_toml, &format!("{origin} (its calibration)"))?;
    let mut scenario = scenario_in(properties, path)?;
    let seed = text("seed")?;
    scenario.seed = seed.parse().with_context(|| wrong("seed", seed))?;
    scenario.eye_height_m = number("eye_height_m")?;
    let boats = scenario.boats.iter().map(|b| (b.name.as_str(), b.model.as_str()));
    let models = BoatModels::load(boats, Path::new(text("models_base")?))?;
    let digest = models_digest(&models.list);
    anyhow::ensure!(
        digest == text("models")?,
        "{origin}: the models of its boats are others now than when it was recorded, so that rounds strike other places"
    );
    let screen = text("screen")?;
    let sides = screen.split_once('x').and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    let (video, orientation) = (text("video")?, text("orientation")?);
    let value_of = |name: &str| LAYOUTS.into_iter().find(|(_, known)| *known == name);
    let source_of = |name: &str| ORIENTATIONS.into_iter().find(|(_, known)| *known == name);
    Ok(Setup {
        scenario,
        own_ship: file.own_ship(),
        calibration: file.calibration,
        models: models.list.into(),
        boat_models: models.of_boats,
        screen: sides.with_context(|| wrong("screen", screen))?,
        video: value_of(video).with_context(|| wrong("video", video))?.0,
        orientation: source_of(orientation).with_context(|| wrong("orientation", orientation))?.0,
        heading: heading_of(&text, &wrong)?,
    })
}

fn heading_of<'a>(
    text: &impl Fn(&str) -> Result<&'a str>,
    wrong: &impl Fn(&str, &str) -> String,
) -> Result<HeadingSettings> {
    let parse = |key: &str, value: &str| value.parse::<f64>().with_context(|| wrong(key, value));
    let number = |key: &str| parse(key, text(key)?);
    let optional =
        |key: &str, value: &str| if value.is_empty() { Ok(None) } else { parse(key, value).map(Some) };
    let list = |key: &str, value: &'a str, parts: usize| -> Result<Vec<&'a str>> {
        let found: Vec<&str> = value.split(',').collect();
        anyhow::ensure!(found.len() == parts, wrong(key, value));
        Ok(found)
    };
    let latency = text("heading.ship_latency_ns")?;
    let stow = match text("heading.stow")? {
        "" => None,
        value => {
            let key = "heading.stow";
            let parts = list(key, value, 3)?;
            Some(Stow {
                from_bow: optional(key, parts[0])?,
                from_north: optional(key, parts[1])?,
                sigma: parse(key, parts[2])?,
            })
        }
    };
    let landmarks = text("heading.landmarks")?.split(';').filter(|one| !one.is_empty()).map(|one| {
        let key = "heading.landmarks";
        let parts = list(key, one, 2)?;
        Ok(Landmark { bearing: parse(key, parts[0])?, sigma: parse(key, parts[1])? })
    });
    Ok(HeadingSettings {
        ship: ShipHeadings {
            latency_ns: latency.parse().with_context(|| wrong("heading.ship_latency_ns", latency))?,
            sigma: number("heading.ship_sigma")?,
        },
        stow,
        landmarks: landmarks.collect::<Result<_>>()?,
        own_growth: optional("heading.own_growth", text("heading.own_growth")?)?,
        sky_drift: number("heading.sky_drift")?,
        shown_above: number("heading.shown_above")?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heading_settings_come_back_to_the_last_bit() {
        let heading = HeadingSettings {
            ship: ShipHeadings { latency_ns: -3, sigma: 0.1 + 0.2 },
            stow: Some(Stow { from_bow: None, from_north: Some(1.0 / 3.0), sigma: 1e-300 }),
            landmarks: vec![Landmark { bearing: 0.1, sigma: 0.2 }, Landmark { bearing: 6.2, sigma: 1e-3 }],
            own_growth: Some(f64::MIN_POSITIVE),
            sky_drift: 0.7,
            shown_above: 0.017,
        };
        let kept = BTreeMap::from(heading_properties(&heading));
        let text = |key: &str| Ok(kept.get(key).map_or("", String::as_str));
        assert_eq!(heading_of(&text, &|key, value| format!("{key} {value}")).unwrap(), heading);
    }
}
