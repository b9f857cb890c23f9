//! How the ego vehicle moves: poses, velocities, rates of turn.

use glam::{DQuat, DVec3};

use crate::{
    error::Result,
    log::{
        signals::geometry::{Pose, pose, quaternion, vector},
        value::Struct,
    },
};

/// `nav_msgs/Odometry`: pose of the child frame, velocity in the child frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Odometry {
    pub pose: Pose,
    pub velocity_mps: DVec3,
    pub angular_velocity_radps: DVec3,
}

/// `sensor_msgs/Imu`, in the sensor's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertial {
    pub angular_velocity_radps: DVec3,
    /// World from sensor; `None` where the sensor does not measure it.
    pub attitude: Option<DQuat>,
}

/// `sensor_msgs/NavSatFix` or `foxglove.LocationFix`: WGS 84.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fix {
    pub latitude_deg: f64,
    pub longitude_deg: f64,
    /// Above the ellipsoid.
    pub altitude_m: f64,
    /// The receiver knew where it was.
    pub is_valid: bool,
}

/// `nav_msgs/Odometry` or `foxglove.Odometry`.
pub fn odometry(message: &Struct) -> Result<Odometry> {
    let (pose_part, twist, [linear, angular]) = if message.get("linear_velocity").is_some() {
        (message.part("pose")?, message, ["linear_velocity", "angular_velocity"])
    } else {
        let twist = message.part("twist")?.part("twist")?;
        (message.part("pose")?.part("pose")?, twist, ["linear", "angular"])
    };
    let velocity = |name: &str| -> Result<DVec3> {
        let velocity = twist.optional_part(name)?.map(vector).transpose()?;
        Ok(velocity.unwrap_or(DVec3::ZERO))
    };
    Ok(Odometry {
        pose: pose(pose_part)?,
        velocity_mps: velocity(linear)?,
        angular_velocity_radps: velocity(angular)?,
    })
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

/// `geometry_msgs/TwistStamped`, with or without covariance, or Autoware's `VelocityReport`: linear
/// and angular velocity.
pub fn stamped_twist(message: &Struct) -> Result<(DVec3, DVec3)> {
    if message.get("longitudinal_velocity").is_some() {
        let forward = message.number("longitudinal_velocity")?;
        let left = message.number("lateral_velocity")?;
        let turn = message.number("heading_rate")?;
        return Ok((DVec3::new(forward, left, 0.0), DVec3::new(0.0, 0.0, turn)));
    }
    let part = message.part("twist")?;
    let twist = part.part("twist").unwrap_or(part);
    Ok((vector(twist.part("linear")?)?, vector(twist.part("angular")?)?))
}

/// `sensor_msgs/Imu`. An attitude that is not measured has -1 as its first covariance, says the
/// definition; careless drivers leave the quaternion at zero instead.
pub fn inertial(message: &Struct) -> Result<Inertial> {
    let is_measured = message
        .numbers("orientation_covariance")
        .map_or(true, |covariance| covariance.iter().next() != Some(-1.0));
    let attitude = match message.optional_part("orientation") {
        Ok(Some(part)) if is_measured => quaternion(part).ok(),
        _ => None,
    };
    Ok(Inertial { angular_velocity_radps: vector(message.part("angular_velocity")?)?, attitude })
}

/// `sensor_msgs/NavSatFix` (whose status is negative without a fix) or `foxglove.LocationFix`.
pub fn fix(message: &Struct) -> Result<Fix> {
    let status = message.part("status").and_then(|status| status.int("status")).unwrap_or(0);
    let (latitude_deg, longitude_deg) = (message.number("latitude")?, message.number("longitude")?);
    // Receivers without a height say NaN.
    let altitude_m = message.number("altitude").ok().filter(|m| m.is_finite()).unwrap_or(0.0);
    let on_earth = latitude_deg.abs() <= 90.0 && longitude_deg.abs() <= 360.0;
    Ok(Fix { latitude_deg, longitude_deg, altitude_m, is_valid: status >= 0 && on_earth })
}
