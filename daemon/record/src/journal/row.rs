//! Rounds as rows, cells and JSON.

use std::borrow::Cow;

use bowwave_core::{
    model::Zone,
    time::Time,
    world::{
        scenario::Side,
        score::{NotScored, Outcome, ShotRecord},
    },
};
use glam::DVec3;
use rusqlite::{Connection, ErrorCode, Row, params};
use serde_json::{Value, json};

/// Columns of a round, in the order of the row functions below.
pub(super) const COLUMNS: &str = "run, shot, fired_ns, muzzle_x_m, muzzle_y_m, muzzle_z_m, bore_x, bore_y, bore_z, \
     pose_age_ns, outcome, boat, zone, time_ns, range_m, point_x_m, point_y_m, point_z_m, miss_m, cause, side";

/// The same for a journal of tables that old.
pub(super) fn columns_of(version: i64) -> String {
    if version >= 3 { COLUMNS.to_owned() } else { COLUMNS.replace(", side", ", NULL") }
}

/// A round as it is in the journal.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredShot {
    /// The run that it belongs to.
    pub run: i64,
    /// The round. Numbers that were not finite are NaN.
    pub record: ShotRecord,
}

/// The columns that make an outcome, in a database as in a table.
#[derive(Default)]
struct OutcomeColumns<'a> {
    outcome: Cow<'a, str>,
    boat: Option<Cow<'a, str>>,
    zone: Option<Cow<'a, str>>,
    time: Option<Time>,
    range_m: Option<f64>,
    point: Option<DVec3>,
    miss_m: Option<f64>,
    cause: Option<Cow<'a, str>>,
    side: Option<Cow<'a, str>>,
}

impl<'a> From<&'a Outcome> for OutcomeColumns<'a> {
    fn from(outcome: &'a Outcome) -> Self {
        match outcome {
            Outcome::Hit { boat, side, zone, time, range_m, point } => Self {
                outcome: "hit".into(),
                boat: Some(boat.into()),
                zone: Some(zone.name().into()),
                time: Some(*time),
                range_m: Some(*range_m),
                point: Some(*point),
                side: side.map(|side| side.name().into()),
                ..Self::default()
            },
            Outcome::Miss { boat, miss_m, time, range_m } => Self {
                outcome: "miss".into(),
                boat: boat.as_deref().map(Cow::from),
                time: Some(*time),
                range_m: Some(*range_m),
                miss_m: Some(*miss_m),
                ..Self::default()
            },
            Outcome::NotScored { cause } => {
                Self { outcome: "not_scored".into(), cause: Some(cause.name().into()), ..Self::default() }
            }
        }
    }
}

impl OutcomeColumns<'_> {
    /// The outcome, or what is wrong with the columns. Numbers that are absent are NaN.
    fn outcome(self) -> Result<Outcome, String> {
        let Self { outcome, boat, zone, cause, side, .. } = self;
        let (time, range_m) = (self.time.unwrap_or(Time::from_ns(0)), self.range_m.unwrap_or(f64::NAN));
        let boat = boat.map(Cow::into_owned);
        match &*outcome {
            "hit" => {
                let known = Zone::ALL.into_iter().find(|known| Some(known.name()) == zone.as_deref());
                let zone = known.ok_or_else(|| format!("unknown zone {zone:?}"))?;
                let boat = boat.ok_or("a hit without a boat")?;
                let side = match side {
                    None => None,
                    Some(side) => Some(
                        Side::ALL
                            .into_iter()
                            .find(|known| known.name() == side)
                            .ok_or_else(|| format!("unknown side {side:?}"))?,
                    ),
                };
                let point = self.point.unwrap_or(DVec3::NAN);
                Ok(Outcome::Hit { boat, side, zone, time, range_m, point })
            }
            "miss" => Ok(Outcome::Miss { boat, miss_m: self.miss_m.unwrap_or(f64::NAN), time, range_m }),
            "not_scored" => cause
                .as_deref()
                .and_then(NotScored::from_name)
                .map(|cause| Outcome::NotScored { cause })
                .ok_or_else(|| format!("unknown cause {cause:?}")),
            other => Err(format!("unknown outcome {other:?}")),
        }
    }
}

impl StoredShot {
    /// Names of [`StoredShot::cells`], units last.
    pub const COLUMNS: [&'static str; 21] = [
        "run",
        "shot",
        "fired_s",
        "outcome",
        "boat",
        "side",
        "zone",
        "time_s",
        "range_m",
        "miss_m",
        "cause",
        "muzzle_x_m",
        "muzzle_y_m",
        "muzzle_z_m",
        "bore_x",
        "bore_y",
        "bore_z",
        "point_x_m",
        "point_y_m",
        "point_z_m",
        "pose_age_ms",
    ];

    /// The round as text for tables and CSV, in the order of [`StoredShot::COLUMNS`]; empty where a column does not apply.
    /// Numbers have their full precision.
    pub fn cells(&self) -> [String; 21] {
        let record = &self.record;
        let parts = OutcomeColumns::from(&record.outcome);
        let text = |value: &Option<Cow<'_, str>>| value.as_deref().unwrap_or_default().to_owned();
        let number =
            |value: Option<f64>| value.filter(|v| v.is_finite()).map_or_else(String::new, |v| v.to_string());
        let [mx, my, mz] = record.muzzle.to_array().map(|v| number(Some(v)));
        let [bx, by, bz] = record.bore.to_array().map(|v| number(Some(v)));
        let [px, py, pz] = parts.point.map_or([None; 3], |p| p.to_array().map(Some)).map(number);
        [
            self.run.to_string(),
            record.shot.to_string(),
            seconds(record.fired),
            parts.outcome.to_string(),
            text(&parts.boat),
            text(&parts.side),
            text(&parts.zone),
            parts.time.map_or_else(String::new, seconds),
            number(parts.range_m),
            number(parts.miss_m),
            text(&parts.cause),
            mx,
            my,
            mz,
            bx,
            by,
            bz,
            px,
            py,
            pz,
            number(Some(record.pose_age_ns as f64 * 1e-6)),
        ]
    }

    /// The round as a JSON object; null where a column does not apply or a number is not finite.
    pub fn to_json(&self) -> Value {
        let record = &self.record;
        let parts = OutcomeColumns::from(&record.outcome);
        json!({
            "run": self.run,
            "shot": record.shot,
            "fired_ns": record.fired.ns(),
            "outcome": parts.outcome,
            "boat": parts.boat,
            "side": parts.side,
            "zone": parts.zone,
            "time_ns": parts.time.map(Time::ns),
            "range_m": parts.range_m,
            "miss_m": parts.miss_m,
            "cause": parts.cause,
            "muzzle_m": record.muzzle.to_array(),
            "bore": record.bore.to_array(),
            "point_m": parts.point.map(|point| point.to_array()),
            "pose_age_ns": record.pose_age_ns,
        })
    }
}

impl StoredShot {
    /// The line of JSON of a round that stands beside the database or in the log.
    pub fn line(run: i64, record: ShotRecord) -> String {
        Self { run, record }.to_json().to_string()
    }

    /// The round of an object as [`Self::to_json`] makes it, or what is wrong with it. Numbers that are absent are NaN.
    pub(super) fn from_json(value: &Value) -> Result<Self, String> {
        let whole = |key: &str| value[key].as_i64().ok_or_else(|| format!("\"{key}\" is no whole number"));
        let vector = |key: &str| {
            DVec3::from_array(std::array::from_fn(|i| value[key][i].as_f64().unwrap_or(f64::NAN)))
        };
        let text = |key: &str| value[key].as_str().map(Cow::from);
        let columns = OutcomeColumns {
            outcome: text("outcome").unwrap_or_default(),
            boat: text("boat"),
            zone: text("zone"),
            time: value["time_ns"].as_i64().map(Time::from_ns),
            range_m: value["range_m"].as_f64(),
            point: Some(vector("point_m")),
            miss_m: value["miss_m"].as_f64(),
            cause: text("cause"),
            side: text("side"),
        };
        let record = ShotRecord {
            shot: value["shot"].as_u64().ok_or("\"shot\" is no number of a round")?,
            fired: Time::from_ns(whole("fired_ns")?),
            muzzle: vector("muzzle_m"),
            bore: vector("bore"),
            pose_age_ns: whole("pose_age_ns")?,
            outcome: columns.outcome()?,
        };
        Ok(Self { run: whole("run")?, record })
    }
}

/// Seconds with nine digits, without a detour over floating point.
fn seconds(time: Time) -> String {
    let ns = time.ns();
    let sign = if ns < 0 { "-" } else { "" };
    let ns = ns.unsigned_abs();
    format!("{sign}{}.{:09}", ns / 1_000_000_000, ns % 1_000_000_000)
}

/// Adds a round; `false` where the run already has one of that number.
fn insert(connection: &Connection, run: i64, shot: &ShotRecord) -> rusqlite::Result<bool> {
    let parts = OutcomeColumns::from(&shot.outcome);
    let point = parts.point.map_or([None; 3], |p| p.to_array().map(Some));
    let sql = format!(
        "INSERT INTO shots ({COLUMNS}) VALUES \
         (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?14, ?15, ?16, ?17, ?18, ?19, ?20, ?21) \
         ON CONFLICT (run, shot) DO NOTHING"
    );
    let number =
        i64::try_from(shot.shot).map_err(|error| rusqlite::Error::ToSqlConversionFailure(error.into()))?;
    let rows = connection.prepare_cached(&sql)?.execute(params![
        run,
        number,
        shot.fired.ns(),
        shot.muzzle.x,
        shot.muzzle.y,
        shot.muzzle.z,
        shot.bore.x,
        shot.bore.y,
        shot.bore.z,
        shot.pose_age_ns,
        parts.outcome,
        parts.boat,
        parts.zone,
        parts.time.map(Time::ns),
        parts.range_m,
        point[0],
        point[1],
        point[2],
        parts.miss_m,
        parts.cause,
        parts.side,
    ])?;
    Ok(rows == 1)
}

/// Adds a round unless it is there already; the inner error says why the database refuses it for good.
pub(super) fn insert_once(
    connection: &Connection,
    run: i64,
    shot: &ShotRecord,
) -> rusqlite::Result<Result<(), String>> {
    match insert(connection, run, shot) {
        Ok(true) => Ok(Ok(())),
        // There already: after a COMMIT that failed and took effect all the same, or a number used twice.
        Ok(false) if stored(connection, run, shot)? => Ok(Ok(())),
        Ok(false) => Ok(Err("its number is taken by another shot".to_owned())),
        Err(error) if is_refusal(&error) => Ok(Err(error.to_string())),
        Err(error) => Err(error),
    }
}

/// Whether this very round is in the database.
fn stored(connection: &Connection, run: i64, shot: &ShotRecord) -> rusqlite::Result<bool> {
    let sql = format!("SELECT {COLUMNS} FROM shots WHERE run = ?1 AND shot = ?2");
    let (_, _, found) = connection.prepare_cached(&sql)?.query_row((run, shot.shot.cast_signed()), parse)?;
    // Compared as text: NaN is to equal NaN.
    Ok(found.is_ok_and(|record| {
        StoredShot { run, record }.to_json() == StoredShot { run, record: shot.clone() }.to_json()
    }))
}

/// Whether the database refuses the round itself: no other attempt will help.
fn is_refusal(error: &rusqlite::Error) -> bool {
    matches!(error, rusqlite::Error::ToSqlConversionFailure(_))
        || matches!(
            error.sqlite_error_code(),
            Some(ErrorCode::ConstraintViolation | ErrorCode::TooBig | ErrorCode::TypeMismatch)
        )
}

/// Number of run and round, and the round or what is wrong with it.
pub(super) type Parsed = (i64, i64, Result<ShotRecord, String>);

/// A row with the columns of [`COLUMNS`].
pub(super) fn parse(row: &Row<'_>) -> rusqlite::Result<Parsed> {
    let number = |column: usize| row.get::<_, Option<f64>>(column).map(|value| value.unwrap_or(f64::NAN));
    let vector = |column: usize| -> rusqlite::Result<DVec3> {
        Ok(DVec3::new(number(column)?, number(column + 1)?, number(column + 2)?))
    };
    let (run, shot): (i64, i64) = (row.get(0)?, row.get(1)?);
    let text = |column: usize| row.get::<_, Option<String>>(column).map(|text| text.map(Cow::from));
    let columns = OutcomeColumns {
        outcome: row.get::<_, String>(10)?.into(),
        boat: text(11)?,
        zone: text(12)?,
        time: row.get::<_, Option<i64>>(13)?.map(Time::from_ns),
        range_m: row.get(14)?,
        point: Some(vector(15)?),
        miss_m: row.get(18)?,
        cause: text(19)?,
        side: text(20)?,
    };
    let (fired, muzzle, bore) = (Time::from_ns(row.get(2)?), vector(3)?, vector(6)?);
    let pose_age_ns = row.get(9)?;
    let record = columns.outcome().and_then(|outcome| {
        let shot = u64::try_from(shot).map_err(|_| "a negative number".to_owned())?;
        Ok(ShotRecord { shot, fired, muzzle, bore, pose_age_ns, outcome })
    });
    Ok((run, shot, record))
}
