//! Topics and their ROS 2 message definitions, as `ros2 interface show` of the Jazzy distribution has them (comments left out). The
//! ship's lines are kept as the drivers of receivers publish them (package nmea_msgs).

/// The file's profile and the encodings of schemas and messages, by their names in the MCAP registry.
pub(crate) const PROFILE: &str = "ros2";
pub(crate) const SCHEMA_ENCODING: &str = "ros2msg";
pub(crate) const MESSAGE_ENCODING: &str = "cdr";
/// Metadata of a channel whose messages' publish time is their arrival. Files without it are ordered by arrival: their log time.
pub(crate) const ARRIVAL: (&str, &str) = ("arrival", "publish_time");

/// What a channel of ours carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Topic {
    Image,
    CameraInfo,
    Imu,
    Trigger,
    Ship,
    Mark,
    Act,
    Order,
    Truth,
    Pose,
    ImageRaw,
    ShipValues,
    ShipFix,
    Fault,
    Tick,
}

impl Topic {
    pub(crate) const ALL: [Self; 15] = [
        Self::Image,
        Self::CameraInfo,
        Self::Imu,
        Self::Trigger,
        Self::Ship,
        Self::Mark,
        Self::Act,
        Self::Order,
        Self::Truth,
        Self::Pose,
        Self::ImageRaw,
        Self::ShipValues,
        Self::ShipFix,
        Self::Fault,
        Self::Tick,
    ];

    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Image => "/camera/image",
            Self::CameraInfo => "/camera/info",
            Self::Imu => "/imu",
            Self::Trigger => "/trigger",
            Self::Ship => "/ship",
            Self::Mark => "/mark",
            Self::Act => "/act",
            Self::Order => "/order",
            Self::Truth => "/truth/pose",
            Self::Pose => "/pose",
            Self::ImageRaw => "/camera/image_raw",
            Self::ShipValues => "/ship/values",
            Self::ShipFix => "/ship/fix",
            Self::Fault => "/fault",
            Self::Tick => "/tick",
        }
    }

    pub(crate) const fn schema_name(self) -> &'static str {
        match self {
            Self::Image => "sensor_msgs/msg/CompressedImage",
            Self::CameraInfo => "sensor_msgs/msg/CameraInfo",
            Self::Imu => "sensor_msgs/msg/Imu",
            Self::Trigger => "std_msgs/msg/Bool",
            Self::Ship => "nmea_msgs/msg/Sentence",
            Self::Mark | Self::Act | Self::Order => "std_msgs/msg/String",
            Self::Truth | Self::Pose => "geometry_msgs/msg/PoseStamped",
            Self::ImageRaw => "sensor_msgs/msg/Image",
            Self::ShipValues => "bowwave_msgs/msg/ShipValues",
            Self::ShipFix => "bowwave_msgs/msg/ShipFix",
            Self::Fault => "diagnostic_msgs/msg/DiagnosticArray",
            Self::Tick => "bowwave_msgs/msg/Tick",
        }
    }

    pub(crate) fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|topic| topic.name() == name)
    }

    /// The message's definition, followed by those of all messages it is made of.
    pub(crate) fn definition(self) -> String {
        let parts: &[(&str, &str)] = match self {
            Self::Image => &[("", COMPRESSED_IMAGE), HEADER, TIME],
            Self::CameraInfo => &[("", CAMERA_INFO), HEADER, TIME, REGION_OF_INTEREST],
            Self::Imu => &[("", IMU), HEADER, TIME, QUATERNION, VECTOR3],
            Self::Trigger => &[("", "bool data\n")],
            Self::Ship => &[("", "std_msgs/Header header\nstring sentence\n"), HEADER, TIME],
            Self::Mark | Self::Act | Self::Order => &[("", "string data\n")],
            Self::Truth | Self::Pose => {
                &[("", "std_msgs/Header header\nPose pose\n"), HEADER, TIME, POSE, POINT, QUATERNION]
            }
            Self::ImageRaw => &[("", IMAGE), HEADER, TIME],
            Self::ShipValues => &[("", SHIP_VALUES), HEADER, TIME],
            Self::ShipFix => &[("", SHIP_FIX), HEADER, TIME],
            Self::Fault => &[("", DIAGNOSTIC_ARRAY), HEADER, TIME, DIAGNOSTIC_STATUS, KEY_VALUE],
            Self::Tick => &[("", TICK), HEADER, TIME],
        };
        let mut text = String::new();
        for (name, body) in parts {
            if !name.is_empty() {
                text.push_str(&"=".repeat(80));
                text.push_str("\nMSG: ");
                text.push_str(name);
                text.push('\n');
            }
            text.push_str(body);
        }
        text
    }
}

const COMPRESSED_IMAGE: &str = "std_msgs/Header header\nstring format\nuint8[] data\n";

const IMAGE: &str = "\
std_msgs/Header header
uint32 height
uint32 width
string encoding
uint8 is_bigendian
uint32 step
uint8[] data
";

/// NaN stands for what was not told; angles in radians.
const SHIP_VALUES: &str = "\
std_msgs/Header header
float64 heading
float64 roll
float64 pitch
float64 heading_sigma
bool reduced
";

/// NaN stands for a place that was not told, degrees north and east; milliseconds since 1970, where the time was told.
const SHIP_FIX: &str = "\
std_msgs/Header header
float64 latitude
float64 longitude
bool utc_told
int64 utc_ms
";

const DIAGNOSTIC_ARRAY: &str = "std_msgs/Header header\nDiagnosticStatus[] status\n";
const DIAGNOSTIC_STATUS: (&str, &str) = (
    "diagnostic_msgs/DiagnosticStatus",
    "byte level\nstring name\nstring message\nstring hardware_id\nKeyValue[] values\n",
);
const KEY_VALUE: (&str, &str) = ("diagnostic_msgs/KeyValue", "string key\nstring value\n");

/// The header's stamp is when the frame is seen; `records` and `scenes` are hashes over what the session gave before.
const TICK: &str = "std_msgs/Header header\nuint64 inputs\nuint64 records\nuint64 scenes\n";

const CAMERA_INFO: &str = "\
std_msgs/Header header
uint32 height
uint32 width
string distortion_model
float64[] d
float64[9] k
float64[9] r
float64[12] p
uint32 binning_x
uint32 binning_y
RegionOfInterest roi
";

const IMU: &str = "\
std_msgs/Header header
geometry_msgs/Quaternion orientation
float64[9] orientation_covariance
geometry_msgs/Vector3 angular_velocity
float64[9] angular_velocity_covariance
geometry_msgs/Vector3 linear_acceleration
float64[9] linear_acceleration_covariance
";

const HEADER: (&str, &str) = ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n");
const TIME: (&str, &str) = ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n");
const QUATERNION: (&str, &str) =
    ("geometry_msgs/Quaternion", "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n");
const VECTOR3: (&str, &str) = ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n");
const POINT: (&str, &str) = ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n");
const POSE: (&str, &str) = ("geometry_msgs/Pose", "Point position\nQuaternion orientation\n");
const REGION_OF_INTEREST: (&str, &str) = (
    "sensor_msgs/RegionOfInterest",
    "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n",
);
