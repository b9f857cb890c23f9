//! Which message types pmp knows how to use, by the names of their definitions.

use crate::log::schema::short_name;

/// Message types that pmp knows how to use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    CompressedImage,
    CompressedVideo,
    Image,
    CameraInfo,
    PointCloud,
    RadarScan,
    RadarTracks,
    Odometry,
    Twist,
    Pose,
    Path,
    Imu,
    Fix,
    Transforms,
    Ackermann,
    CarlaControl,
    CarlaStatus,
    /// Angle of the wheels alone.
    Steering,
    /// Positions of the pedals alone.
    Actuation,
    Weather,
    WorldInfo,
    /// What a map and a route tell of the place where the car is.
    Situation,
}

impl Kind {
    /// The kind of a message type, by its name.
    pub fn of(schema_name: &str) -> Option<Kind> {
        let name = short_name(schema_name);
        let foxglove =
            name.strip_prefix("foxglove.").or_else(|| name.strip_prefix("foxglove_msgs/"));
        if let Some(name) = foxglove {
            return Kind::of_foxglove(name);
        }
        Some(match name.as_str() {
            "sensor_msgs/CompressedImage" => Kind::CompressedImage,
            "ffmpeg_image_transport_msgs/FFMPEGPacket" => Kind::CompressedVideo,
            "sensor_msgs/Image" => Kind::Image,
            "sensor_msgs/CameraInfo" => Kind::CameraInfo,
            "sensor_msgs/PointCloud2" => Kind::PointCloud,
            "radar_msgs/RadarScan" => Kind::RadarScan,
            "radar_msgs/RadarTracks" => Kind::RadarTracks,
            "nav_msgs/Odometry" => Kind::Odometry,
            "geometry_msgs/TwistStamped" | "geometry_msgs/TwistWithCovarianceStamped" => {
                Kind::Twist
            }
            "autoware_vehicle_msgs/VelocityReport"
            | "autoware_auto_vehicle_msgs/VelocityReport" => Kind::Twist,
            "autoware_vehicle_msgs/SteeringReport"
            | "autoware_auto_vehicle_msgs/SteeringReport" => Kind::Steering,
            "tier4_vehicle_msgs/ActuationStatusStamped" => Kind::Actuation,
            "geometry_msgs/PoseStamped" | "geometry_msgs/PoseWithCovarianceStamped" => Kind::Pose,
            "nav_msgs/Path" => Kind::Path,
            "sensor_msgs/Imu" | "pmp.Imu" => Kind::Imu,
            "sensor_msgs/NavSatFix" => Kind::Fix,
            "tf2_msgs/TFMessage" | "tf/tfMessage" => Kind::Transforms,
            "ackermann_msgs/AckermannDriveStamped" => Kind::Ackermann,
            "carla_msgs/CarlaEgoVehicleControl" | "pmp.Control" => Kind::CarlaControl,
            "carla_msgs/CarlaEgoVehicleStatus" => Kind::CarlaStatus,
            "carla_msgs/CarlaWeatherParameters" => Kind::Weather,
            "carla_msgs/CarlaWorldInfo" => Kind::WorldInfo,
            "pmp.Situation" | "pmp_msgs/Situation" => Kind::Situation,
            _ => return None,
        })
    }

    /// Whether its messages say when they were made; else the log's time has to do.
    pub fn has_header(self) -> bool {
        !matches!(self, Kind::Weather | Kind::WorldInfo)
    }

    /// The kinds of Foxglove's well-known schemas, <https://docs.foxglove.dev/docs/sdk/schemas>:
    /// the same names in protobuf and JSON (`foxglove.X`) and in ROS (`foxglove_msgs/msg/X`).
    fn of_foxglove(name: &str) -> Option<Kind> {
        Some(match name {
            "CompressedImage" => Kind::CompressedImage,
            "CompressedVideo" => Kind::CompressedVideo,
            "RawImage" => Kind::Image,
            "CameraCalibration" => Kind::CameraInfo,
            "PointCloud" => Kind::PointCloud,
            "Odometry" => Kind::Odometry,
            "LocationFix" => Kind::Fix,
            "PoseInFrame" => Kind::Pose,
            "PosesInFrame" => Kind::Path,
            "FrameTransform" | "FrameTransforms" => Kind::Transforms,
            _ => return None,
        })
    }
}
