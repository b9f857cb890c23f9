//! Message definitions as ROS 2 logs carry them: one text for a type and all that it is made of.
//!
//! Kept as one small text per type and put together on demand, so that a field list is written
//! down once. Field names and types are those of the public ROS 2 packages.

/// What separates the texts of two types in a `ros2msg` schema.
pub const SEPARATOR: &str =
    "================================================================================";

/// Field lists by `package/Type`; types of other messages are always named with their package.
#[rustfmt::skip]
const TYPES: &[(&str, &str)] = &[
    ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec"),
    ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id"),
    ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z"),
    ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z"),
    ("geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w"),
    ("geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation"),
    ("geometry_msgs/PoseStamped", "std_msgs/Header header\ngeometry_msgs/Pose pose"),
    ("geometry_msgs/PoseWithCovariance", "geometry_msgs/Pose pose\nfloat64[36] covariance"),
    ("geometry_msgs/Twist", "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular"),
    ("geometry_msgs/TwistStamped", "std_msgs/Header header\ngeometry_msgs/Twist twist"),
    ("geometry_msgs/TwistWithCovariance", "geometry_msgs/Twist twist\nfloat64[36] covariance"),
    ("geometry_msgs/Accel", "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular"),
    ("geometry_msgs/Transform", "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation"),
    ("geometry_msgs/TransformStamped", "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform"),
    ("tf2_msgs/TFMessage", "geometry_msgs/TransformStamped[] transforms"),
    ("nav_msgs/Odometry", "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\ngeometry_msgs/TwistWithCovariance twist"),
    ("nav_msgs/Path", "std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses"),
    ("sensor_msgs/CompressedImage", "std_msgs/Header header\nstring format\nuint8[] data"),
    ("sensor_msgs/Image", "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\nuint8[] data"),
    ("sensor_msgs/RegionOfInterest", "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify"),
    ("sensor_msgs/CameraInfo", "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\nfloat64[9] k\nfloat64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\nsensor_msgs/RegionOfInterest roi"),
    ("sensor_msgs/PointField", "uint8 INT8=1\nuint8 UINT8=2\nuint8 INT16=3\nuint8 UINT16=4\nuint8 INT32=5\nuint8 UINT32=6\nuint8 FLOAT32=7\nuint8 FLOAT64=8\nstring name\nuint32 offset\nuint8 datatype\nuint32 count"),
    ("sensor_msgs/PointCloud2", "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\nbool is_bigendian\nuint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense"),
    ("sensor_msgs/Imu", "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\ngeometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\ngeometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance"),
    ("sensor_msgs/NavSatStatus", "int8 STATUS_NO_FIX=-1\nint8 STATUS_FIX=0\nint8 STATUS_SBAS_FIX=1\nint8 STATUS_GBAS_FIX=2\nuint16 SERVICE_GPS=1\nuint16 SERVICE_GLONASS=2\nuint16 SERVICE_COMPASS=4\nuint16 SERVICE_GALILEO=8\nint8 status\nuint16 service"),
    ("sensor_msgs/NavSatFix", "std_msgs/Header header\nsensor_msgs/NavSatStatus status\nfloat64 latitude\nfloat64 longitude\nfloat64 altitude\nfloat64[9] position_covariance\nuint8 COVARIANCE_TYPE_UNKNOWN=0\nuint8 COVARIANCE_TYPE_APPROXIMATED=1\nuint8 COVARIANCE_TYPE_DIAGONAL_KNOWN=2\nuint8 COVARIANCE_TYPE_KNOWN=3\nuint8 position_covariance_type"),
    ("ackermann_msgs/AckermannDrive", "float32 steering_angle\nfloat32 steering_angle_velocity\nfloat32 speed\nfloat32 acceleration\nfloat32 jerk"),
    ("ackermann_msgs/AckermannDriveStamped", "std_msgs/Header header\nackermann_msgs/AckermannDrive drive"),
    ("carla_msgs/CarlaEgoVehicleControl", "std_msgs/Header header\nfloat32 throttle\nfloat32 steer\nfloat32 brake\nbool hand_brake\nbool reverse\nint32 gear\nbool manual_gear_shift"),
    ("carla_msgs/CarlaEgoVehicleStatus", "std_msgs/Header header\nfloat32 velocity\ngeometry_msgs/Accel acceleration\ngeometry_msgs/Quaternion orientation\ncarla_msgs/CarlaEgoVehicleControl control"),
    ("carla_msgs/CarlaWeatherParameters", "float32 cloudiness\nfloat32 precipitation\nfloat32 precipitation_deposits\nfloat32 wind_intensity\nfloat32 fog_density\nfloat32 fog_distance\nfloat32 wetness\nfloat32 sun_azimuth_angle\nfloat32 sun_altitude_angle"),
    ("carla_msgs/CarlaWorldInfo", "string map_name\nstring opendrive"),
    ("geometry_msgs/Point32", "float32 x\nfloat32 y\nfloat32 z"),
    ("geometry_msgs/Polygon", "geometry_msgs/Point32[] points"),
    ("shape_msgs/SolidPrimitive", "uint8 BOX=1\nuint8 SPHERE=2\nuint8 CYLINDER=3\nuint8 CONE=4\nuint8 type\nfloat64[<=3] dimensions"),
    ("derived_object_msgs/Object", "std_msgs/Header header\nuint32 id\nuint8 OBJECT_DETECTED=0\nuint8 OBJECT_TRACKED=1\nuint8 detection_level\nbool object_classified\ngeometry_msgs/Pose pose\ngeometry_msgs/Twist twist\ngeometry_msgs/Accel accel\ngeometry_msgs/Polygon polygon\nshape_msgs/SolidPrimitive shape\nuint8 CLASSIFICATION_UNKNOWN=0\nuint8 CLASSIFICATION_UNKNOWN_SMALL=1\nuint8 CLASSIFICATION_UNKNOWN_MEDIUM=2\nuint8 CLASSIFICATION_UNKNOWN_BIG=3\nuint8 CLASSIFICATION_PEDESTRIAN=4\nuint8 CLASSIFICATION_BIKE=5\nuint8 CLASSIFICATION_CAR=6\nuint8 CLASSIFICATION_TRUCK=7\nuint8 CLASSIFICATION_MOTORCYCLE=8\nuint8 CLASSIFICATION_OTHER_VEHICLE=9\nuint8 CLASSIFICATION_BARRIER=10\nuint8 CLASSIFICATION_SIGN=11\nuint8 classification\nuint8 classification_certainty\nuint32 classification_age"),
    ("derived_object_msgs/ObjectArray", "std_msgs/Header header\nderived_object_msgs/Object[] objects"),
    ("pmp_msgs/Situation", "std_msgs/Header header\nbool in_junction\nfloat32 speed_limit_mps\nstring command"),
    ("radar_msgs/RadarReturn", "float32 range\nfloat32 azimuth\nfloat32 elevation\nfloat32 doppler_velocity\nfloat32 amplitude"),
    ("radar_msgs/RadarScan", "std_msgs/Header header\nradar_msgs/RadarReturn[] returns"),
];

/// The definition of `package/msg/Type` with all it depends on, as the data of a `ros2msg`
/// schema: the type's own text, then each dependency behind a separator and `MSG: package/Type`.
///
/// `None` for a type that pmp does not write.
///
/// ```
/// let text = pmp::log::definitions::definition("geometry_msgs/msg/TwistStamped").unwrap();
/// assert!(text.starts_with("std_msgs/Header header\n"));
/// assert!(text.contains("MSG: geometry_msgs/Vector3\nfloat64 x\n"));
/// ```
pub fn definition(schema: &str) -> Option<String> {
    let (package, name) = schema.split_once("/msg/")?;
    let own = fields(&format!("{package}/{name}"))?;
    let mut text = format!("{own}\n");
    let mut names = Vec::new();
    collect_dependencies(own, &mut names);
    for name in names {
        text += &format!("{SEPARATOR}\nMSG: {name}\n{}\n", fields(name)?);
    }
    Some(text)
}

fn fields(name: &str) -> Option<&'static str> {
    TYPES.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

/// Depth first, in order of first mention, each once.
fn collect_dependencies(text: &'static str, names: &mut Vec<&'static str>) {
    for line in text.lines() {
        let type_name = line.split([' ', '[']).next().unwrap_or_default();
        if type_name.contains('/') && !names.contains(&type_name) {
            names.push(type_name);
            collect_dependencies(fields(type_name).unwrap_or_default(), names);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_type_that_a_definition_mentions_is_defined() {
        for (name, _) in TYPES {
            let (package, short) = name.split_once('/').unwrap();
            let text = definition(&format!("{package}/msg/{short}")).unwrap();
            for line in text.lines() {
                let type_name = line.split([' ', '[']).next().unwrap();
                if type_name.contains('/') {
                    assert!(text.contains(&format!("MSG: {type_name}\n")), "{name}: {type_name}");
                }
            }
        }
    }
}
