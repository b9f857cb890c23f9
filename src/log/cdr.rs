//! CDR messages to values, by the definition that the log carries.
//!
//! OMG DDS-XTypes 1.3 section 7.4 (plain CDR, encoding versions 1 and 2), as ROS 2 middlewares
//! write it: a 4-byte encapsulation header says byte order and version, and every number is
//! aligned to its size (at most 8 in version 1, 4 in version 2), counted from behind the header.

use crate::{
    error::{Error, Result},
    log::{
        schema::Schema,
        value::{Endian, Struct, Value},
        wire::{self, Layout},
    },
};

const ENCAPSULATION_BYTES: usize = 4;

/// Decode a whole message.
///
/// # Errors
///
/// [`Error::Decode`] with the byte: an unknown encapsulation, or as [`wire::decode`].
pub fn decode<'a>(schema: &'a Schema, message: &'a [u8]) -> Result<Struct<'a>> {
    wire::decode(layout(schema, message)?, schema, message)
}

/// Decode the first field of a message alone: its header, where it has one.
///
/// # Errors
///
/// As [`decode`]; also if the message type has no fields.
pub fn decode_first_field<'a>(schema: &'a Schema, message: &'a [u8]) -> Result<Value<'a>> {
    wire::decode_first_field(layout(schema, message)?, schema, message)
}

/// What the encapsulation header says.
fn layout(schema: &Schema, message: &[u8]) -> Result<Layout> {
    let fail = |what: String| Error::Decode {
        schema: schema.types[0].name.clone(),
        offset: ENCAPSULATION_BYTES,
        what,
    };
    let (endian, max_align) = match message.first_chunk::<ENCAPSULATION_BYTES>() {
        None => return Err(fail("shorter than its encapsulation header".to_string())),
        Some([0, 0, ..]) => (Endian::Big, 8),
        Some([0, 1, ..]) => (Endian::Little, 8),
        Some([0, 6, ..]) => (Endian::Big, 4),
        Some([0, 7, ..]) => (Endian::Little, 4),
        Some([a, b, ..]) => {
            return Err(fail(format!("encapsulation {a:#04x} {b:#04x} is not plain CDR")));
        }
    };
    Ok(Layout {
        head_bytes: ENCAPSULATION_BYTES,
        endian,
        max_align,
        has_nul: true,
        // rosidl gives a type without members one byte.
        empty_type_bytes: 1,
    })
}
