//! Message definitions for tests, as recorders embed them: a type and all that it uses.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;

/// Type and fields. Written down from the public interface packages, comments left out.
#[rustfmt::skip]
const TYPES: &[(&str, &str)] = &[
    ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec"),
    ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id"),
    ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z"),
    ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z"),
    ("geometry_msgs/Point32", "float32 x\nfloat32 y\nfloat32 z"),
    ("geometry_msgs/Polygon", "geometry_msgs/Point32[] points"),
    ("geometry_msgs/Quaternion", "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1"),
    ("geometry_msgs/Pose", "Point position\nQuaternion orientation"),
    ("geometry_msgs/PoseStamped", "std_msgs/Header header\nPose pose"),
    ("geometry_msgs/PoseWithCovariance", "Pose pose\nfloat64[36] covariance"),
    ("geometry_msgs/PoseWithCovarianceStamped", "std_msgs/Header header\nPoseWithCovariance pose"),
    ("geometry_msgs/Twist", "Vector3 linear\nVector3 angular"),
    ("geometry_msgs/TwistStamped", "std_msgs/Header header\nTwist twist"),
    ("geometry_msgs/TwistWithCovariance", "Twist twist\nfloat64[36] covariance"),
    ("geometry_msgs/TwistWithCovarianceStamped", "std_msgs/Header header\nTwistWithCovariance twist"),
    ("geometry_msgs/Accel", "Vector3 linear\nVector3 angular"),
    ("geometry_msgs/AccelWithCovariance", "Accel accel\nfloat64[36] covariance"),
    ("geometry_msgs/Transform", "Vector3 translation\nQuaternion rotation"),
    ("geometry_msgs/TransformStamped", "std_msgs/Header header\nstring child_frame_id\nTransform transform"),
    ("tf2_msgs/TFMessage", "geometry_msgs/TransformStamped[] transforms"),
    ("nav_msgs/Odometry", "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\ngeometry_msgs/TwistWithCovariance twist"),
    ("nav_msgs/Path", "std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses"),
    ("sensor_msgs/CompressedImage", "std_msgs/Header header\nstring format\nuint8[] data"),
    ("ffmpeg_image_transport_msgs/FFMPEGPacket", "std_msgs/Header header\nint32 width\nint32 height\nstring encoding\nuint64 pts\nuint8 flags\nbool is_bigendian\nuint8[] data"),
    ("sensor_msgs/Image", "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\nuint8[] data"),
    ("sensor_msgs/RegionOfInterest", "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify"),
    ("sensor_msgs/CameraInfo", "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\nfloat64[9]  k # 3x3 row-major matrix\nfloat64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\nRegionOfInterest roi"),
    ("sensor_msgs/PointField", "uint8 INT8    = 1\nuint8 FLOAT32 = 7\nstring name\nuint32 offset\nuint8 datatype\nuint32 count"),
    ("sensor_msgs/PointCloud2", "std_msgs/Header header\nuint32 height\nuint32 width\nPointField[] fields\nbool is_bigendian\nuint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense"),
    ("sensor_msgs/Imu", "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\ngeometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\ngeometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance"),
    ("sensor_msgs/NavSatStatus", "int8 STATUS_NO_FIX=-1\nint8 status\nuint16 service"),
    ("sensor_msgs/NavSatFix", "std_msgs/Header header\nNavSatStatus status\nfloat64 latitude\nfloat64 longitude\nfloat64 altitude\nfloat64[9] position_covariance\nuint8 position_covariance_type"),
    ("unique_identifier_msgs/UUID", "uint8[16] uuid"),
    ("radar_msgs/RadarReturn", "float32 range\nfloat32 azimuth\nfloat32 elevation\nfloat32 doppler_velocity\nfloat32 amplitude"),
    ("radar_msgs/RadarScan", "std_msgs/Header header\nradar_msgs/RadarReturn[] returns"),
    ("radar_msgs/RadarTrack", "uint16 STATIC=1\nunique_identifier_msgs/UUID uuid\ngeometry_msgs/Point position\ngeometry_msgs/Vector3 velocity\ngeometry_msgs/Vector3 acceleration\ngeometry_msgs/Vector3 size\nuint16 classification\nfloat32[6] position_covariance\nfloat32[6] velocity_covariance\nfloat32[6] acceleration_covariance\nfloat32[6] size_covariance"),
    ("radar_msgs/RadarTracks", "std_msgs/Header header\nradar_msgs/RadarTrack[] tracks"),
    ("shape_msgs/SolidPrimitive", "uint8 BOX=1\nuint8 type\nfloat64[<=3] dimensions\ngeometry_msgs/Polygon polygon"),
    ("ackermann_msgs/AckermannDrive", "float32 steering_angle\nfloat32 steering_angle_velocity\nfloat32 speed\nfloat32 acceleration\nfloat32 jerk"),
    ("ackermann_msgs/AckermannDriveStamped", "std_msgs/Header header\nAckermannDrive drive"),
    ("carla_msgs/CarlaEgoVehicleControl", "std_msgs/Header header\nfloat32 throttle\nfloat32 steer\nfloat32 brake\nbool hand_brake\nbool reverse\nint32 gear\nbool manual_gear_shift"),
    ("carla_msgs/CarlaEgoVehicleStatus", "std_msgs/Header header\nfloat32 velocity\ngeometry_msgs/Accel acceleration\ngeometry_msgs/Quaternion orientation\nCarlaEgoVehicleControl control"),
    ("carla_msgs/CarlaWeatherParameters", "float32 cloudiness\nfloat32 precipitation\nfloat32 precipitation_deposits\nfloat32 wind_intensity\nfloat32 fog_density\nfloat32 fog_distance\nfloat32 wetness\nfloat32 sun_azimuth_angle\nfloat32 sun_altitude_angle"),
    ("carla_msgs/CarlaWorldInfo", "string map_name\nstring opendrive"),
    ("autoware_vehicle_msgs/VelocityReport", "std_msgs/Header header\nfloat32 longitudinal_velocity\nfloat32 lateral_velocity\nfloat32 heading_rate"),
    ("autoware_vehicle_msgs/SteeringReport", "builtin_interfaces/Time stamp\nfloat32 steering_tire_angle"),
    ("tier4_vehicle_msgs/ActuationStatus", "float64 accel_status\nfloat64 brake_status\nfloat64 steer_status"),
    ("tier4_vehicle_msgs/ActuationStatusStamped", "std_msgs/Header header\nActuationStatus status"),
];

/// Every type above that is a message of a topic that pmp reads.
pub(crate) const TOPIC_TYPES: [&str; 23] = [
    "sensor_msgs/CompressedImage",
    "sensor_msgs/Image",
    "sensor_msgs/CameraInfo",
    "sensor_msgs/PointCloud2",
    "radar_msgs/RadarScan",
    "radar_msgs/RadarTracks",
    "nav_msgs/Odometry",
    "geometry_msgs/TwistStamped",
    "geometry_msgs/TwistWithCovarianceStamped",
    "geometry_msgs/PoseStamped",
    "geometry_msgs/PoseWithCovarianceStamped",
    "nav_msgs/Path",
    "sensor_msgs/Imu",
    "tf2_msgs/TFMessage",
    "ackermann_msgs/AckermannDriveStamped",
    "carla_msgs/CarlaEgoVehicleControl",
    "carla_msgs/CarlaEgoVehicleStatus",
    "sensor_msgs/NavSatFix",
    "carla_msgs/CarlaWeatherParameters",
    "carla_msgs/CarlaWorldInfo",
    "autoware_vehicle_msgs/VelocityReport",
    "tier4_vehicle_msgs/ActuationStatusStamped",
    "std_msgs/Header",
];

/// The types above by name.
pub(crate) fn types() -> BTreeMap<String, String> {
    TYPES.iter().map(|(name, fields)| (name.to_string(), fields.to_string())).collect()
}

/// The definition of a type above.
pub(crate) fn definition(name: &str) -> String {
    concatenated(name, &types())
}

/// A type and all that it uses.
fn with_parts(name: &str, types: &BTreeMap<String, String>) -> Vec<String> {
    let mut order = vec![name.to_string()];
    let mut at = 0;
    while at < order.len() {
        let package = order[at].split('/').next().unwrap().to_string();
        for line in types[&order[at]].lines() {
            let used = line.split_whitespace().next().unwrap_or_default();
            let used = used.split('[').next().unwrap();
            let candidates =
                [used.to_string(), format!("{package}/{used}"), format!("std_msgs/{used}")];
            let known = candidates.into_iter().find(|name| types.contains_key(name));
            order.extend(known.filter(|name| !order.contains(name)));
        }
        at += 1;
    }
    order
}

/// A type with all that it uses, each after a separator line.
pub(crate) fn concatenated(name: &str, types: &BTreeMap<String, String>) -> String {
    let mut text = types[name].clone();
    for part in &with_parts(name, types)[1..] {
        text += &format!("\n\n{}\nMSG: {part}\n{}", "=".repeat(80), types[part]);
    }
    text
}

/// `pkg/msg/Type`, as ROS 2 names the schema of a topic.
pub(crate) fn schema_name(name: &str) -> String {
    name.replacen('/', "/msg/", 1)
}

/// The types above in the words of ROS 1.
fn ros1_types() -> BTreeMap<String, String> {
    let mut types = types();
    types.remove("builtin_interfaces/Time");
    for (name, text) in &mut types {
        let fields = text.lines().map(|line| {
            if line.contains('=') && !line.contains("<=") {
                return line.to_string();
            }
            let mut words = line.split_whitespace();
            let (kind, field) = (words.next().unwrap(), words.next().unwrap());
            let kind = match kind {
                "std_msgs/Header" => "Header",
                "float64[<=3]" => "float64[]",
                kind => kind,
            };
            match name.as_str() {
                "sensor_msgs/CameraInfo" if field.len() == 1 => {
                    format!("{kind} {}", field.to_uppercase())
                }
                _ => format!("{kind} {field}"),
            }
        });
        *text = fields.collect::<Vec<_>>().join("\n");
    }
    let header = "# Two-integer timestamp\nuint32 seq\ntime stamp\nstring frame_id";
    types.insert("std_msgs/Header".to_string(), header.to_string());
    types
}

/// The definition of a type above as ROS 1 has it.
pub(crate) fn ros1_definition(name: &str) -> String {
    concatenated(name, &ros1_types())
}

/// The definition of a type above in IDL.
pub(crate) fn idl_definition(name: &str) -> String {
    idl(name, &types())
}

/// A type with all that it uses in IDL, as rosidl turns ROS 2 definitions into it and rosbag2
/// stores it.
pub(crate) fn idl(name: &str, types: &BTreeMap<String, String>) -> String {
    let sections = with_parts(name, types).into_iter().map(|part| {
        let (package, short) = part.split_once('/').unwrap();
        let (mut typedefs, mut constants, mut members) =
            (String::new(), String::new(), String::new());
        for (index, line) in types[&part].lines().enumerate() {
            let code = line.split('#').next().unwrap().trim();
            if let Some((left, value)) = code.split_once('=').filter(|_| !code.contains("<=")) {
                let (kind, name) = left.trim().split_once(char::is_whitespace).unwrap();
                let kind = idl_type(kind, package, index);
                constants += &format!("      const {kind} {} = {};\n", name.trim(), value.trim());
            } else if let Some((kind, field)) = code.split_once(char::is_whitespace) {
                let mut words = field.split_whitespace();
                let field = words.next().unwrap();
                if let Some(default) = words.next() {
                    members += &format!("      @default (value={default})\n");
                }
                let (item, bound) = match kind.split_once('[') {
                    Some((item, bound)) => (item, bound.strip_suffix(']')),
                    None => (kind, None),
                };
                let item = idl_type(item, package, index);
                let kind = match bound {
                    None => item,
                    Some("") => format!("sequence<{item}>"),
                    Some(bound) => match bound.strip_prefix("<=") {
                        Some(most) => format!("sequence<{item}, {most}>"),
                        None => {
                            let short = item.replace("::", "__").replace([' ', '<', '>'], "_");
                            let alias = format!("{short}__{bound}");
                            typedefs += &format!("    typedef {item} {alias}[{bound}];\n");
                            alias
                        }
                    },
                };
                members += &format!(
                    "      @verbatim (language=\"comment\", text=\n        \"what (it) is; \\\"so\\\"\" \
                     \"\\n\" \"}}\")\n      @unit (value=\"m\")\n      {kind} {field};\n\n"
                );
            }
        }
        format!(
            "{}\nIDL: {package}/msg/{short}\n// generated from rosidl_adapter/resource/msg.idl.em\n\
             // with input from {package}/msg/{short}.msg\n\n#include \"std_msgs/msg/Header.idl\"\n\n\
             module {package} {{\n  module msg {{\n{typedefs}    module {short}_Constants {{\n\
             {constants}    }};\n    /* the type; struct of it */\n    struct {short} {{\n{members}    \
             }};\n  }};\n}};\n",
            "=".repeat(80),
        )
    });
    sections.collect::<Vec<_>>().join("\n")
}

/// Odd lines use the older words for a type, and short names where the scope allows them.
fn idl_type(kind: &str, package: &str, line: usize) -> String {
    let is_odd = line % 2 == 1;
    match kind {
        "bool" => "boolean".to_string(),
        "byte" => "octet".to_string(),
        "char" => "uint8".to_string(),
        "float32" => "float".to_string(),
        "float64" => "double".to_string(),
        "int16" if is_odd => "short".to_string(),
        "uint16" if is_odd => "unsigned short".to_string(),
        "int32" if is_odd => "long".to_string(),
        "uint32" if is_odd => "unsigned long".to_string(),
        "int64" if is_odd => "long long".to_string(),
        "uint64" if is_odd => "unsigned long long".to_string(),
        _ if kind.starts_with("string") || kind.starts_with("int") || kind.starts_with("uint") => {
            match kind.split_once("<=") {
                Some((kind, most)) => format!("{kind}<{most}>"),
                None => kind.to_string(),
            }
        }
        _ => match kind.split_once('/') {
            Some((package, name)) => format!("{package}::msg::{name}"),
            None if is_odd => kind.to_string(),
            None => format!("{package}::msg::{kind}"),
        },
    }
}
