//! How the ego vehicle moves: poses, velocities, rates of turn.

use glam::DVec3;

use crate::{
    error::Result,
    log::{
        signals::geometry::{Pose, pose, vector},
        value::Struct,
    },
};

/// `nav_msgs/Odometry`: pose of the child frame, velocity in the child frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Odometry {
    pub pose: Pose,
    pub velocity_mps: DVec3,
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
