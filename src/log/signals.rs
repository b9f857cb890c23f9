//! Values to samples: what each message type says about the drive.
//!
//! One function a message type. Types are recognised by the name of their definition and their
//! fields are found by name, so a definition with more fields, or in another order, still reads.

use glam::{DQuat, DVec3};

use crate::{
    error::{Error, Result},
    log::{
        schema::short_name,
        value::{Struct, Value},
    },
    projection::{Camera, Distortion},
};

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
    Transforms,
    Ackermann,
    CarlaControl,
    CarlaStatus,
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
            "geometry_msgs/PoseStamped" | "geometry_msgs/PoseWithCovarianceStamped" => Kind::Pose,
            "nav_msgs/Path" => Kind::Path,
            "sensor_msgs/Imu" => Kind::Imu,
            "tf2_msgs/TFMessage" | "tf/tfMessage" => Kind::Transforms,
            "ackermann_msgs/AckermannDriveStamped" => Kind::Ackermann,
            "carla_msgs/CarlaEgoVehicleControl" => Kind::CarlaControl,
            "carla_msgs/CarlaEgoVehicleStatus" => Kind::CarlaStatus,
            _ => return None,
        })
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
            "PoseInFrame" => Kind::Pose,
            "PosesInFrame" => Kind::Path,
            "FrameTransform" | "FrameTransforms" => Kind::Transforms,
            _ => return None,
        })
    }
}

/// `std_msgs/Header`, or the time and the frame that a Foxglove message begins with.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Header {
    /// Since the Unix epoch (or the simulator's start).
    pub stamp_ns: i64,
    pub frame_id: String,
}

/// A place and an attitude: `parent_from_child`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    pub position_m: DVec3,
    pub rotation: DQuat,
}

/// `nav_msgs/Odometry`: pose of the child frame, velocity in the child frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Odometry {
    pub pose: Pose,
    pub velocity_mps: DVec3,
}

/// What a driver did, as far as one message type says it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Control {
    /// In [-1, 1], positive = right.
    pub steer: Option<f64>,
    pub throttle: Option<f64>,
    pub brake: Option<f64>,
    /// Angle of the front wheels, rad, positive = left (REP-103).
    pub wheel_angle_rad: Option<f64>,
}

/// `carla_msgs/CarlaEgoVehicleStatus`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CarlaStatus {
    pub speed_mps: f64,
    pub control: Control,
}

/// One radar return or track, in the radar's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadarReturn {
    pub position_m: DVec3,
    /// Radial speed relative to the sensor, m/s, negative = approaching.
    pub radial_speed_mps: f64,
}

/// The header of a message that has one, or of a value that is one.
pub fn header(value: &Struct) -> Result<Header> {
    let header = value.part("header").unwrap_or(value);
    // A transform of Foxglove's says of which two frames it is, and the parent is the one it is in.
    let frame_id = header.text("parent_frame_id").or_else(|_| header.text("frame_id"))?;
    let stamp_field = if header.get("timestamp").is_some() { "timestamp" } else { "stamp" };
    let stamp_ns = header.optional_part(stamp_field)?.map(nanoseconds).transpose()?;
    let frame_id = frame_id.trim_start_matches('/').to_string();
    Ok(Header { stamp_ns: stamp_ns.unwrap_or_default(), frame_id })
}

/// An instant: ROS 2 calls its parts sec and nanosec, ROS 1 and JSON sec and nsec, protobuf
/// seconds and nanos.
fn nanoseconds(stamp: &Struct) -> Result<i64> {
    let seconds = stamp.int("sec").or_else(|_| stamp.int("seconds"))?;
    let nanos = ["nsec", "nanos"].iter().find_map(|name| stamp.int(name).ok());
    let nanos = nanos.map_or_else(|| stamp.int("nanosec"), Ok)?;
    Ok(seconds.saturating_mul(1_000_000_000).saturating_add(nanos))
}

/// `nav_msgs/Odometry` or `foxglove.Odometry`.
pub fn odometry(message: &Struct) -> Result<Odometry> {
    if message.get("linear_velocity").is_some() {
        let velocity = message.optional_part("linear_velocity")?.map(vector).transpose()?;
        let velocity_mps = velocity.unwrap_or(DVec3::ZERO);
        return Ok(Odometry { pose: pose(message.part("pose")?)?, velocity_mps });
    }
    let velocity_mps = vector(message.part("twist")?.part("twist")?.part("linear")?)?;
    Ok(Odometry { pose: pose(message.part("pose")?.part("pose")?)?, velocity_mps })
}

/// `nav_msgs/Odometry` or `foxglove.Odometry`: the frame that the pose is of.
pub fn child_frame<'m>(message: &'m Struct) -> Result<&'m str> {
    let frame = message.text("child_frame_id").or_else(|_| message.text("body_frame_id"))?;
    Ok(frame.trim_start_matches('/'))
}

/// `geometry_msgs/PoseStamped`, with or without covariance, or `foxglove.PoseInFrame`.
pub fn stamped_pose(message: &Struct) -> Result<Pose> {
    let part = message.part("pose")?;
    pose(part.part("pose").unwrap_or(part))
}

/// `geometry_msgs/TwistStamped`, with or without covariance: linear and angular velocity.
pub fn stamped_twist(message: &Struct) -> Result<(DVec3, DVec3)> {
    let part = message.part("twist")?;
    let twist = part.part("twist").unwrap_or(part);
    Ok((vector(twist.part("linear")?)?, vector(twist.part("angular")?)?))
}

/// `sensor_msgs/Imu`: angular velocity, rad/s.
pub fn angular_velocity(message: &Struct) -> Result<DVec3> {
    vector(message.part("angular_velocity")?)
}

/// `nav_msgs/Path` or `foxglove.PosesInFrame`: positions in the frame of its header.
pub fn path(message: &Struct) -> Result<Vec<DVec3>> {
    let one = |part: &Struct| match part.get("pose") {
        Some(_) => stamped_pose(part),
        None => pose(part),
    };
    message.parts("poses")?.map(|part| Ok(one(part)?.position_m)).collect()
}

/// `tf2_msgs/TFMessage`, `foxglove.FrameTransforms` or `foxglove.FrameTransform`: parent frame,
/// stamp, child frame, `parent_from_child`.
pub fn transforms(message: &Struct) -> Result<Vec<(Header, String, Pose)>> {
    let stamped = |part: &Struct| {
        let transform = part.part("transform").unwrap_or(part);
        let pose = placed(transform, "translation", "rotation")?;
        Ok((header(part)?, child_frame(part)?.to_string(), pose))
    };
    if message.get("parent_frame_id").is_some() {
        return Ok(vec![stamped(message)?]);
    }
    message.parts("transforms")?.map(stamped).collect()
}

/// `ackermann_msgs/AckermannDriveStamped`.
pub fn ackermann(message: &Struct) -> Result<Control> {
    let angle = message.part("drive")?.number("steering_angle")?;
    Ok(Control { steer: None, throttle: None, brake: None, wheel_angle_rad: Some(angle) })
}

/// `carla_msgs/CarlaEgoVehicleControl`.
pub fn carla_control(message: &Struct) -> Result<Control> {
    Ok(Control {
        steer: Some(message.number("steer")?),
        throttle: Some(message.number("throttle")?),
        brake: Some(message.number("brake")?),
        wheel_angle_rad: None,
    })
}

/// `carla_msgs/CarlaEgoVehicleStatus`.
pub fn carla_status(message: &Struct) -> Result<CarlaStatus> {
    let control = carla_control(message.part("control")?)?;
    Ok(CarlaStatus { speed_mps: message.number("velocity")?, control })
}

/// `sensor_msgs/CameraInfo` or `foxglove.CameraCalibration`; the intrinsics are those of the picture of its width and height.
pub fn camera_info(message: &Struct) -> Result<Camera> {
    // ROS 2 writes k and d, ROS 1 and Foxglove K and D.
    let numbers = |lower: &str, upper: &str| -> Result<Vec<f64>> {
        Ok(message.numbers(lower).or_else(|_| message.numbers(upper))?.iter().collect())
    };
    let (k, d) = (numbers("k", "K")?, numbers("d", "D")?);
    let fail = |what: String| Error::Decode { schema: message.name.to_string(), offset: 0, what };
    let model = message.text("distortion_model")?;
    let distortion = if d.iter().all(|coefficient| *coefficient == 0.0) {
        Distortion::None
    } else {
        let wrong = |_| fail(format!("{} coefficients for `{model}`", d.len()));
        match model {
            "plumb_bob" => Distortion::PlumbBob(d.clone().try_into().map_err(wrong)?),
            "rational_polynomial" => {
                Distortion::RationalPolynomial(d.clone().try_into().map_err(wrong)?)
            }
            "equidistant" | "fisheye" => {
                Distortion::Equidistant(d.clone().try_into().map_err(wrong)?)
            }
            _ => return Err(fail(format!("distortion model `{model}` is not known"))),
        }
    };
    let size = |field: &str| -> Result<usize> {
        usize::try_from(message.int(field)?)
            .map_err(|_error| fail(format!("`{field}` is negative")))
    };
    match k[..] {
        [fx, _, cx, _, fy, cy, ..] if fx > 0.0 && fy > 0.0 => Ok(Camera {
            width: size("width")?,
            height: size("height")?,
            fx,
            fy,
            cx,
            cy,
            distortion,
        }),
        _ => Err(fail("an uncalibrated camera: its focal length is 0".to_string())),
    }
}

/// `radar_msgs/RadarScan`: polar returns, elevation and azimuth as REP-103 turns them.
pub fn radar_scan(message: &Struct) -> Result<Vec<RadarReturn>> {
    let polar = |part: &Struct| {
        let (range, azimuth) = (part.number("range")?, part.number("azimuth")?);
        let (sin_elevation, cos_elevation) = part.number("elevation")?.sin_cos();
        let flat = range * cos_elevation;
        Ok(RadarReturn {
            position_m: DVec3::new(
                flat * azimuth.cos(),
                flat * azimuth.sin(),
                range * sin_elevation,
            ),
            radial_speed_mps: part.number("doppler_velocity")?,
        })
    };
    message.parts("returns")?.map(polar).collect()
}

/// `radar_msgs/RadarTracks`: the radial part of each track's velocity.
pub fn radar_tracks(message: &Struct) -> Result<Vec<RadarReturn>> {
    let track = |part: &Struct| {
        let (position_m, velocity) =
            (vector(part.part("position")?)?, vector(part.part("velocity")?)?);
        let radial_speed_mps = velocity.dot(position_m.normalize_or_zero());
        Ok(RadarReturn { position_m, radial_speed_mps })
    };
    message.parts("tracks")?.map(track).collect()
}

fn vector(part: &Struct) -> Result<DVec3> {
    Ok(DVec3::new(part.number("x")?, part.number("y")?, part.number("z")?))
}

/// `geometry_msgs/Pose` or `foxglove.Pose`.
pub fn pose(part: &Struct) -> Result<Pose> {
    placed(part, "position", "orientation")
}

/// What a message leaves out does not move or turn anything.
fn placed(part: &Struct, position: &str, rotation: &str) -> Result<Pose> {
    let position_m = part.optional_part(position)?.map(vector).transpose()?;
    let rotation = part.optional_part(rotation)?.map(quaternion).transpose()?;
    Ok(Pose {
        position_m: position_m.unwrap_or(DVec3::ZERO),
        rotation: rotation.unwrap_or(DQuat::IDENTITY),
    })
}

/// A rotation; the all-zero quaternion that careless writers leave is no rotation.
fn quaternion(part: &Struct) -> Result<DQuat> {
    let [x, y, z, w] = ["x", "y", "z", "w"].map(|axis| part.number(axis));
    let quaternion = DQuat::from_xyzw(x?, y?, z?, w?);
    let length = quaternion.length();
    if length > 0.1 && length.is_finite() {
        return Ok(quaternion / length);
    }
    Err(Error::Decode {
        schema: part.name.to_string(),
        offset: 0,
        what: format!("a rotation of length {length} is none"),
    })
}

/// A field of a value that may or may not be a struct: for headers read on their own.
pub fn header_of_first_field(value: &Value) -> Result<Header> {
    match value {
        Value::Struct(part) => header(part),
        _ => Err(Error::Decode {
            schema: String::new(),
            offset: 0,
            what: "the message does not begin with a header".to_string(),
        }),
    }
}
