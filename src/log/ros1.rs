//! ROS 1 messages to values, by the definition that the log carries.
//!
//! The serialisation of `roscpp` and `rospy`, <https://wiki.ros.org/msg>: little-endian fields one
//! after another without padding, a length of 4 bytes before the bytes of a string and before the
//! elements of a list of any length.

use crate::{
    error::Result,
    log::{
        schema::Schema,
        value::{Endian, Struct, Value},
        wire::{self, Layout},
    },
};

const LAYOUT: Layout = Layout {
    head_bytes: 0,
    endian: Endian::Little,
    max_align: 1,
    has_nul: false,
    empty_type_bytes: 0,
};

/// Decode a whole message.
///
/// # Errors
///
/// As [`wire::decode`].
pub fn decode<'a>(schema: &'a Schema, message: &'a [u8]) -> Result<Struct<'a>> {
    wire::decode(LAYOUT, schema, message)
}

/// Decode the first field of a message alone: its header, where it has one.
///
/// # Errors
///
/// As [`wire::decode_first_field`].
pub fn decode_first_field<'a>(schema: &'a Schema, message: &'a [u8]) -> Result<Value<'a>> {
    wire::decode_first_field(LAYOUT, schema, message)
}
