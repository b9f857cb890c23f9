//! Vectors, rotations and poses.

use glam::{DQuat, DVec3};

use crate::{
    error::{Error, Result},
    log::value::Struct,
};

/// A place and an attitude: `parent_from_child`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    pub position_m: DVec3,
    pub rotation: DQuat,
}

/// `geometry_msgs/Vector3`, `geometry_msgs/Point` or their namesakes of Foxglove.
pub fn vector(part: &Struct) -> Result<DVec3> {
    Ok(DVec3::new(part.number("x")?, part.number("y")?, part.number("z")?))
}

/// `geometry_msgs/Pose` or `foxglove.Pose`.
pub fn pose(part: &Struct) -> Result<Pose> {
    placed(part, "position", "orientation")
}

/// A pose by the names of its parts. What a message leaves out does not move or turn anything.
pub fn placed(part: &Struct, position: &str, rotation: &str) -> Result<Pose> {
    let position_m = part.optional_part(position)?.map(vector).transpose()?;
    let rotation = part.optional_part(rotation)?.map(quaternion).transpose()?;
    Ok(Pose {
        position_m: position_m.unwrap_or(DVec3::ZERO),
        rotation: rotation.unwrap_or(DQuat::IDENTITY),
    })
}

/// A rotation; the all-zero quaternion that careless writers leave is no rotation.
pub fn quaternion(part: &Struct) -> Result<DQuat> {
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
