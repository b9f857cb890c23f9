//! How frames lie to one another.

use crate::{
    error::Result,
    log::{
        signals::{
            ego::child_frame,
            geometry::{Pose, placed},
            header::{Header, header},
        },
        value::Struct,
    },
};

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
