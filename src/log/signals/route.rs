//! Planned ways.

use glam::DVec3;

use crate::{
    error::Result,
    log::{
        signals::{ego::stamped_pose, geometry::pose},
        value::Struct,
    },
};

/// `nav_msgs/Path` or `foxglove.PosesInFrame`: positions in the frame of its header.
pub fn path(message: &Struct) -> Result<Vec<DVec3>> {
    let one = |part: &Struct| match part.get("pose") {
        Some(_) => stamped_pose(part),
        None => pose(part),
    };
    message.parts("poses")?.map(|part| Ok(one(part)?.position_m)).collect()
}
