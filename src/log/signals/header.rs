//! When a message was made, and in which frame it speaks.

use crate::{
    error::{Error, Result},
    log::value::{Struct, Value},
};

/// `std_msgs/Header`, or the time and the frame that a Foxglove message begins with.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Header {
    /// Since the Unix epoch (or the simulator's start).
    pub stamp_ns: i64,
    pub frame_id: String,
}

/// The header of a message that has one, or of a value that is one. Autoware's reports have a bare
/// stamp in its place, and so no frame.
pub fn header(value: &Struct) -> Result<Header> {
    let header = value.part("header").unwrap_or(value);
    if header.get("sec").is_some() {
        return Ok(Header { stamp_ns: nanoseconds(header)?, frame_id: String::new() });
    }
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
