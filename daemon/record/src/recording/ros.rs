//! The ROS 2 messages and their CDR encoding (OMG CORBA 3.4 Interoperability, 9.3: plain CDR with a 4-byte encapsulation).

use std::sync::Arc;

use bowwave_core::{
    act::{Act, TraineeAct},
    ephemeris::{Place, Utc},
    event::{ImuSample, Mark, MarkKind, Picture, PixelFormat, ShipFix, ShipSample, Tick, TriggerEdge},
    fault::{Change, Fault, FaultChange},
    geometry::CameraPose,
    order::{InstructorOrder, Order},
    time::{NS_PER_S, Time},
};
use byteorder::{BigEndian, LittleEndian};
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize, Serializer};

use super::{
    CameraInfo, Entry, FaultEntry, FrameEntry, JPEG_MAX_BYTES, PictureEntry, PoseEntry, SENTENCE_MAX_BYTES,
    ShipEntry, TickEntry, schema::Topic,
};

const FRAME_CAMERA: &str = "camera";
const FRAME_IMU: &str = "imu";
const FRAME_WORLD: &str = "world";
const FRAME_SHIP: &str = "ship";

/// What the operator's presses are called.
const MARKS: [(MarkKind, &str); 2] = [(MarkKind::Stow, "stow"), (MarkKind::Landmark, "landmark")];

/// Layouts of pictures by their names in sensor_msgs/image_encodings.hpp.
const ENCODINGS: [(PixelFormat, &str); 3] =
    [(PixelFormat::Yuyv, "yuv422_yuy2"), (PixelFormat::Nv12, "nv12"), (PixelFormat::Rgb, "rgb8")];

/// Format of a picture that was coded for the recording; readers look for the word jpeg in it.
const RECODED: &str = "jpeg; recoded";

/// The key and the names of what happened to a fault.
const CHANGE: &str = "change";
const CHANGES: [&str; 3] = ["raised", "cleared", "noted"];

/// The longest cause of a fault that is kept, bytes.
const CAUSE_MAX_BYTES: usize = 4096;

#[derive(Serialize, Deserialize)]
struct Stamp {
    sec: i32,
    nanosec: u32,
}

#[derive(Serialize, Deserialize)]
struct Header {
    stamp: Stamp,
    frame_id: String,
}

#[derive(Serialize, Deserialize)]
struct Vector3 {
    x: f64,
    y: f64,
    z: f64,
}

#[derive(Serialize, Deserialize)]
struct Quaternion {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

#[derive(Serialize, Deserialize)]
struct Imu {
    header: Header,
    orientation: Quaternion,
    orientation_covariance: [f64; 9],
    angular_velocity: Vector3,
    angular_velocity_covariance: [f64; 9],
    linear_acceleration: Vector3,
    linear_acceleration_covariance: [f64; 9],
}

#[derive(Serialize, Deserialize)]
struct CompressedImage<'a> {
    header: Header,
    format: String,
    #[serde(borrow, serialize_with = "as_bytes")]
    data: &'a [u8],
}

#[derive(Serialize, Deserialize)]
struct Image<'a> {
    header: Header,
    height: u32,
    width: u32,
    encoding: String,
    is_bigendian: u8,
    step: u32,
    #[serde(borrow, serialize_with = "as_bytes")]
    data: &'a [u8],
}

#[derive(Serialize, Deserialize)]
struct ShipValues {
    header: Header,
    heading: f64,
    roll: f64,
    pitch: f64,
    heading_sigma: f64,
    reduced: bool,
}

#[derive(Serialize, Deserialize)]
struct ShipFixMessage {
    header: Header,
    latitude: f64,
    longitude: f64,
    utc_told: bool,
    utc_ms: i64,
}

#[derive(Serialize, Deserialize)]
struct DiagnosticArray {
    header: Header,
    status: Vec<DiagnosticStatus>,
}

#[derive(Serialize, Deserialize)]
struct DiagnosticStatus {
    level: u8,
    name: String,
    message: String,
    hardware_id: String,
    values: Vec<KeyValue>,
}

#[derive(Serialize, Deserialize)]
struct KeyValue {
    key: String,
    value: String,
}

#[derive(Serialize, Deserialize)]
struct TickMessage {
    header: Header,
    inputs: u64,
    records: u64,
    scenes: u64,
}

#[derive(Serialize, Deserialize)]
struct Bool {
    data: bool,
}

#[derive(Serialize, Deserialize)]
struct Text {
    data: String,
}

#[derive(Serialize, Deserialize)]
struct Sentence {
    header: Header,
    sentence: String,
}

#[derive(Serialize, Deserialize)]
struct PoseStamped {
    header: Header,
    position: Vector3,
    orientation: Quaternion,
}

#[derive(Serialize, Deserialize)]
struct CameraInfoMessage {
    header: Header,
    height: u32,
    width: u32,
    distortion_model: String,
    d: Vec<f64>,
    k: [f64; 9],
    r: [f64; 9],
    p: [f64; 12],
    binning_x: u32,
    binning_y: u32,
    roi: RegionOfInterest,
}

#[derive(Default, Serialize, Deserialize)]
struct RegionOfInterest {
    x_offset: u32,
    y_offset: u32,
    height: u32,
    width: u32,
    do_rectify: bool,
}

/// One block of bytes instead of an element at a time.
fn as_bytes<S: Serializer>(data: &&[u8], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_bytes(data)
}

/// The topic and sequence number of an entry, its message appended to the emptied `out`. The error says what cannot be
/// represented and what to do.
pub(crate) fn encode(entry: &Entry, out: &mut Vec<u8>) -> Result<Topic, String> {
    match entry {
        Entry::Imu(sample) => {
            write(out, &imu_message(sample)?)?;
            Ok(Topic::Imu)
        }
        Entry::Frame(frame) => {
            if frame.jpeg.is_empty() || frame.jpeg.len() > JPEG_MAX_BYTES {
                return Err(format!(
                    "a picture of {} bytes (1 to {JPEG_MAX_BYTES} can be recorded); lower the camera's quality or size",
                    frame.jpeg.len()
                ));
            }
            out.reserve(frame.jpeg.len() + 64);
            let header = header(frame.mid_exposure, FRAME_CAMERA)?;
            let format = if frame.is_recoded { RECODED } else { "jpeg" }.to_owned();
            write(out, &CompressedImage { header, format, data: &frame.jpeg })?;
            Ok(Topic::Image)
        }
        Entry::Trigger(edge) => {
            write(out, &Bool { data: edge.pressed })?;
            Ok(Topic::Trigger)
        }
        Entry::Ship(line) => {
            let sentence = sentence(&line.sentence)?.to_owned();
            write(out, &Sentence { header: header(line.arrival, FRAME_SHIP)?, sentence })?;
            Ok(Topic::Ship)
        }
        Entry::Mark(mark) => {
            let (_, name) = MARKS[usize::from(mark.kind == MarkKind::Landmark)];
            write(out, &Text { data: name.to_owned() })?;
            Ok(Topic::Mark)
        }
        Entry::Act(act) => {
            write(out, &Text { data: act.act.name().to_owned() })?;
            Ok(Topic::Act)
        }
        Entry::Order(order) => {
            let data = serde_json::to_string(&order.order).map_err(|e| e.to_string())?;
            write(out, &Text { data })?;
            Ok(Topic::Order)
        }
        Entry::Truth(pose) => {
            write(out, &pose_message(pose)?)?;
            Ok(Topic::Truth)
        }
        Entry::Pose(pose) => {
            write(out, &pose_message(pose)?)?;
            Ok(Topic::Pose)
        }
        Entry::Picture(picture) => {
            out.reserve(picture.picture.bytes().len() + 64);
            write(out, &image_message(picture)?)?;
            Ok(Topic::ImageRaw)
        }
        Entry::ShipValues(sample) => {
            write(out, &ship_message(sample)?)?;
            Ok(Topic::ShipValues)
        }
        Entry::ShipFix(fix) => {
            write(out, &fix_message(fix)?)?;
            Ok(Topic::ShipFix)
        }
        Entry::Fault(entry) => {
            write(out, &fault_message(&entry.change)?)?;
            Ok(Topic::Fault)
        }
        Entry::Tick(entry) => {
            let TickEntry { tick, inputs, records, scenes } = *entry;
            write(out, &TickMessage { header: header(tick.shown, "")?, inputs, records, scenes })?;
            Ok(Topic::Tick)
        }
    }
}

/// The message of `/camera/info`.
pub(crate) fn encode_camera_info(info: &CameraInfo, time: Time, out: &mut Vec<u8>) -> Result<(), String> {
    let k = info.k;
    let message = CameraInfoMessage {
        header: header(time, FRAME_CAMERA)?,
        height: info.height,
        width: info.width,
        distortion_model: if info.d.len() == 4 { "equidistant" } else { "plumb_bob" }.to_owned(),
        d: info.d.clone(),
        k,
        r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: [k[0], k[1], k[2], 0.0, k[3], k[4], k[5], 0.0, k[6], k[7], k[8], 0.0],
        binning_x: 0,
        binning_y: 0,
        roi: RegionOfInterest::default(),
    };
    write(out, &message)
}

/// The camera's numbers out of a message of `/camera/info`.
pub(crate) fn decode_camera_info(data: &[u8]) -> Result<CameraInfo, String> {
    let message: CameraInfoMessage = read(data)?;
    Ok(CameraInfo { width: message.width, height: message.height, k: message.k, d: message.d })
}

/// The entry of a message; `None` for `/camera/info`, which is a property. The error says what is wrong with the message.
pub(crate) fn decode(
    topic: Topic,
    arrival: Time,
    sequence: u32,
    data: &[u8],
) -> Result<Option<Entry>, String> {
    Ok(Some(match topic {
        Topic::CameraInfo => return Ok(None),
        Topic::Imu => Entry::Imu(imu_sample(&read(data)?, arrival)?),
        Topic::Image => {
            let message: CompressedImage<'_> = read(data)?;
            let format = message.format.to_ascii_lowercase();
            if !format.contains("jpeg") && !format.contains("jpg") {
                return Err(format!("a picture in format {:?}, not JPEG", message.format));
            }
            if message.data.is_empty() || message.data.len() > JPEG_MAX_BYTES {
                return Err(format!(
                    "a picture of {} bytes (1 to {JPEG_MAX_BYTES} are read)",
                    message.data.len()
                ));
            }
            Entry::Frame(FrameEntry {
                arrival,
                mid_exposure: time(&message.header.stamp)?,
                sequence,
                jpeg: Arc::from(message.data),
                is_recoded: format == RECODED,
            })
        }
        Topic::Trigger => Entry::Trigger(TriggerEdge { time: arrival, pressed: read::<Bool>(data)?.data }),
        Topic::Ship => {
            let message: Sentence = read(data)?;
            sentence(&message.sentence)?;
            Entry::Ship(ShipEntry { arrival, sentence: message.sentence })
        }
        Topic::Mark => {
            let name = read::<Text>(data)?.data;
            let known = MARKS.into_iter().find(|(_, known)| *known == name);
            let (kind, _) = known.ok_or_else(|| format!("a press at {name:?}, which is no mark"))?;
            Entry::Mark(Mark { time: arrival, kind })
        }
        Topic::Act => {
            let name = read::<Text>(data)?.data;
            let known = Act::ALL.into_iter().find(|act| act.name() == name);
            let act = known.ok_or_else(|| format!("an act {name:?}, which this version does not know"))?;
            Entry::Act(TraineeAct { time: arrival, act })
        }
        Topic::Order => {
            let known = serde_json::from_str::<Order>(&read::<Text>(data)?.data);
            let order = known.map_err(|e| format!("an order that this version does not know: {e}"))?;
            order.check().map_err(|e| format!("an order that is none: {e}"))?;
            Entry::Order(InstructorOrder { time: arrival, order })
        }
        Topic::Truth => Entry::Truth(pose_entry(&read(data)?, arrival)?),
        Topic::Pose => Entry::Pose(pose_entry(&read(data)?, arrival)?),
        Topic::ImageRaw => Entry::Picture(picture_entry(&read(data)?, arrival, sequence)?),
        Topic::ShipValues => Entry::ShipValues(ship_sample(&read(data)?, arrival)),
        Topic::ShipFix => Entry::ShipFix(ship_fix(&read(data)?, arrival)?),
        Topic::Fault => Entry::Fault(fault_entry(read(data)?, arrival)?),
        Topic::Tick => {
            let TickMessage { header, inputs, records, scenes } = read(data)?;
            let tick = Tick { time: arrival, shown: time(&header.stamp)? };
            Entry::Tick(TickEntry { tick, inputs, records, scenes })
        }
    }))
}

fn image_message(entry: &PictureEntry) -> Result<Image<'_>, String> {
    let picture = &entry.picture;
    let encoding = ENCODINGS.into_iter().find(|(format, _)| *format == picture.format());
    let (_, encoding) = encoding.ok_or("a picture of a layout without a name")?;
    Ok(Image {
        header: header(entry.mid_exposure, FRAME_CAMERA)?,
        height: picture.height(),
        width: picture.width(),
        encoding: encoding.to_owned(),
        is_bigendian: 0,
        step: picture.format().row_bytes(picture.width()) as u32,
        data: picture.bytes(),
    })
}

fn picture_entry(message: &Image<'_>, arrival: Time, sequence: u32) -> Result<PictureEntry, String> {
    let encoding = ENCODINGS.into_iter().find(|(_, name)| *name == message.encoding);
    let (format, _) =
        encoding.ok_or_else(|| format!("a picture in encoding {:?}, which is not read", message.encoding))?;
    let picture = Picture::new(format, message.width, message.height, Arc::from(message.data))
        .map_err(|e| e.to_string())?;
    Ok(PictureEntry { arrival, mid_exposure: time(&message.header.stamp)?, sequence, picture })
}

fn ship_message(sample: &ShipSample) -> Result<ShipValues, String> {
    let number = |value: Option<f64>| value.unwrap_or(f64::NAN);
    Ok(ShipValues {
        header: header(sample.arrival, FRAME_SHIP)?,
        heading: number(sample.heading),
        roll: number(sample.roll),
        pitch: number(sample.pitch),
        heading_sigma: number(sample.heading_sigma),
        reduced: sample.reduced,
    })
}

fn ship_sample(message: &ShipValues, arrival: Time) -> ShipSample {
    let told = |value: f64| value.is_finite().then_some(value);
    ShipSample {
        arrival,
        heading: told(message.heading),
        roll: told(message.roll),
        pitch: told(message.pitch),
        heading_sigma: told(message.heading_sigma),
        reduced: message.reduced,
    }
}

fn fix_message(fix: &ShipFix) -> Result<ShipFixMessage, String> {
    let place = fix.place.map_or([f64::NAN; 2], |place| [place.latitude_deg(), place.longitude_deg()]);
    Ok(ShipFixMessage {
        header: header(fix.arrival, FRAME_SHIP)?,
        latitude: place[0],
        longitude: place[1],
        utc_told: fix.utc.is_some(),
        utc_ms: fix.utc.map_or(0, Utc::ms),
    })
}

fn ship_fix(message: &ShipFixMessage, arrival: Time) -> Result<ShipFix, String> {
    let ShipFixMessage { latitude, longitude, utc_told, utc_ms, .. } = *message;
    let utc =
        utc_told.then(|| Utc::from_ms(utc_ms).ok_or_else(|| format!("a time of {utc_ms} ms since 1970")));
    Ok(ShipFix { arrival, place: Place::new(latitude, longitude), utc: utc.transpose()? })
}

fn fault_message(change: &FaultChange) -> Result<DiagnosticArray, String> {
    let (what, level, cause) = match &change.change {
        Change::Raised { cause } => (0, 2, cause.as_str()),
        Change::Cleared => (1, 0, ""),
        Change::Noted { cause } => (2, 1, cause.as_str()),
    };
    // The cause is for people: its first lines do.
    let end = cause
        .char_indices()
        .map(|(at, c)| at + c.len_utf8())
        .take_while(|end| *end <= CAUSE_MAX_BYTES)
        .last();
    Ok(DiagnosticArray {
        header: header(change.time, "")?,
        status: vec![DiagnosticStatus {
            level,
            name: change.fault.code().to_owned(),
            message: cause.get(..end.unwrap_or(0)).unwrap_or_default().to_owned(),
            hardware_id: String::new(),
            values: vec![KeyValue { key: CHANGE.to_owned(), value: CHANGES[what].to_owned() }],
        }],
    })
}

fn fault_entry(message: DiagnosticArray, logged: Time) -> Result<FaultEntry, String> {
    let when = time(&message.header.stamp)?;
    let [status] = <[DiagnosticStatus; 1]>::try_from(message.status)
        .map_err(|all| format!("{} states of faults in one message, not 1", all.len()))?;
    let fault = Fault::from_code(&status.name)
        .ok_or_else(|| format!("a fault {:?}, which is not known", status.name))?;
    let value = status.values.iter().find(|pair| pair.key == CHANGE).map_or("", |pair| pair.value.as_str());
    let change = match CHANGES.iter().position(|name| *name == value) {
        Some(0) => Change::Raised { cause: status.message },
        Some(1) => Change::Cleared,
        Some(2) => Change::Noted { cause: status.message },
        _ => return Err(format!("a fault that is {value:?}: neither raised, cleared nor noted")),
    };
    Ok(FaultEntry { logged, change: FaultChange { time: when, fault, change } })
}

/// A line that can be kept: one that a wire could have carried.
fn sentence(line: &str) -> Result<&str, String> {
    if line.is_empty() || line.len() > SENTENCE_MAX_BYTES || !line.is_ascii() {
        return Err(format!(
            "a line of the ship's instruments of {} bytes (1 to {SENTENCE_MAX_BYTES} of ASCII)",
            line.len()
        ));
    }
    Ok(line)
}

fn imu_message(sample: &ImuSample) -> Result<Imu, String> {
    let mut orientation_covariance = [0.0; 9];
    if sample.world_from_imu.is_none() {
        // sensor_msgs/Imu: "If you have no estimate for one of the data elements, please set element 0 of the associated
        // covariance matrix to -1".
        orientation_covariance[0] = -1.0;
    }
    Ok(Imu {
        header: header(Time::from_ns(sample.device_time_ns), FRAME_IMU)?,
        orientation: quaternion(sample.world_from_imu.unwrap_or(DQuat::IDENTITY)),
        orientation_covariance,
        angular_velocity: vector(sample.rate),
        angular_velocity_covariance: [0.0; 9],
        linear_acceleration: vector(sample.accel),
        linear_acceleration_covariance: [0.0; 9],
    })
}

fn imu_sample(message: &Imu, arrival: Time) -> Result<ImuSample, String> {
    let q = &message.orientation;
    Ok(ImuSample {
        arrival,
        device_time_ns: time(&message.header.stamp)?.ns(),
        rate: dvec3(&message.angular_velocity),
        accel: dvec3(&message.linear_acceleration),
        world_from_imu: (message.orientation_covariance[0] != -1.0)
            .then(|| DQuat::from_xyzw(q.x, q.y, q.z, q.w)),
    })
}

fn pose_message(entry: &PoseEntry) -> Result<PoseStamped, String> {
    check_pose(&entry.pose)?;
    Ok(PoseStamped {
        header: header(entry.time, FRAME_WORLD)?,
        position: vector(entry.pose.position),
        orientation: quaternion(entry.pose.world_from_camera),
    })
}

fn pose_entry(message: &PoseStamped, arrival: Time) -> Result<PoseEntry, String> {
    let time = time(&message.header.stamp)?;
    if time != arrival {
        return Err(format!("its header says {time}"));
    }
    let q = &message.orientation;
    let pose = CameraPose {
        world_from_camera: DQuat::from_xyzw(q.x, q.y, q.z, q.w),
        position: dvec3(&message.position),
    };
    check_pose(&pose)?;
    Ok(PoseEntry { time, pose })
}

fn check_pose(pose: &CameraPose) -> Result<(), String> {
    let length = pose.world_from_camera.length();
    // NaN fails the comparison too.
    if (length - 1.0).abs() < 1e-3 && pose.position.is_finite() {
        return Ok(());
    }
    Err(format!(
        "a pose at {} with a quaternion of length {length} (needs finite numbers and a unit quaternion)",
        pose.position
    ))
}

fn vector(v: DVec3) -> Vector3 {
    Vector3 { x: v.x, y: v.y, z: v.z }
}

fn dvec3(v: &Vector3) -> DVec3 {
    DVec3::new(v.x, v.y, v.z)
}

fn quaternion(q: DQuat) -> Quaternion {
    Quaternion { x: q.x, y: q.y, z: q.z, w: q.w }
}

fn header(time: Time, frame_id: &str) -> Result<Header, String> {
    let sec = i32::try_from(time.ns().div_euclid(NS_PER_S))
        .map_err(|_| format!("a stamp of {time} (ROS stamps end after 2^31 s); check the device's clock"))?;
    let nanosec = time.ns().rem_euclid(NS_PER_S) as u32;
    Ok(Header { stamp: Stamp { sec, nanosec }, frame_id: frame_id.to_owned() })
}

fn time(stamp: &Stamp) -> Result<Time, String> {
    if i64::from(stamp.nanosec) >= NS_PER_S {
        return Err(format!("a stamp with {} ns in a second", stamp.nanosec));
    }
    Ok(Time::from_ns(i64::from(stamp.sec) * NS_PER_S + i64::from(stamp.nanosec)))
}

fn write<T: Serialize>(out: &mut Vec<u8>, message: &T) -> Result<(), String> {
    out.clear();
    // Representation identifier CDR_LE, no options. Alignment counts from the byte after it.
    out.extend_from_slice(&[0, 1, 0, 0]);
    cdr_encoding::to_writer::<T, LittleEndian, _>(out, message).map_err(|e| format!("not encodable: {e}"))
}

fn read<'a, T: Deserialize<'a>>(data: &'a [u8]) -> Result<T, String> {
    let (encapsulation, body) =
        data.split_at_checked(4).ok_or_else(|| format!("{} bytes are no CDR message", data.len()))?;
    let result = match encapsulation {
        [0, 1, ..] => cdr_encoding::from_bytes::<T, LittleEndian>(body),
        [0, 0, ..] => cdr_encoding::from_bytes::<T, BigEndian>(body),
        other => return Err(format!("unknown CDR encapsulation {other:02x?}")),
    };
    result.map(|(message, _)| message).map_err(|e| format!("not decodable: {e}"))
}
