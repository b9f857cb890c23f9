//! The decoder of a channel: which encoding its definition and its messages have.
//!
//! Everything behind it sees [`Struct`]s and cannot tell encodings apart.

use crate::{
    error::{Error, Result},
    log::{
        cdr, descriptors, idl, json, protobuf,
        reader::Channel,
        ros1,
        schema::{self, Schema},
        signals::{self, Header},
        value::Struct,
    },
};

/// Decodes the messages of one channel by the definition that the log carries.
#[derive(Clone, Debug)]
pub enum Decoder {
    /// ROS 2: `ros2msg` or `ros2idl` definitions, CDR messages.
    Cdr(Schema),
    /// ROS 1: `ros1msg` definitions, messages in its own serialisation.
    Ros1(Schema),
    /// Protobuf: a descriptor set as definition.
    Protobuf(descriptors::Schema),
    /// JSON, with a JSON Schema or an empty one.
    Json(json::Schema),
}

impl Decoder {
    /// The decoder of a channel.
    ///
    /// # Errors
    ///
    /// A sentence: why messages of this channel cannot be decoded.
    pub fn of(channel: &Channel) -> Result<Decoder, String> {
        let record = channel.schema.as_ref().ok_or("the log has no definition for it")?;
        let (definition, message) = (record.encoding.as_str(), channel.message_encoding.as_str());
        let text = || std::str::from_utf8(&record.data).map_err(|error| error.to_string());
        let said = |error: Error| error.to_string();
        match (definition, message) {
            ("ros2msg", "cdr") => {
                schema::parse(&record.name, text()?).map(Decoder::Cdr).map_err(said)
            }
            ("ros2idl", "cdr") => idl::parse(&record.name, text()?).map(Decoder::Cdr).map_err(said),
            ("ros1msg", "ros1") => {
                schema::parse_ros1(&record.name, text()?).map(Decoder::Ros1).map_err(said)
            }
            ("protobuf", "protobuf") => {
                descriptors::parse(&record.name, &record.data).map(Decoder::Protobuf)
            }
            ("jsonschema" | "", "json") => {
                json::parse(&record.name, &record.data).map(Decoder::Json)
            }
            _ => Err(format!("`{definition}` definitions of `{message}` messages are not read")),
        }
    }

    /// Decode a whole message.
    ///
    /// # Errors
    ///
    /// [`Error::Decode`] if its bytes do not follow the definition.
    pub fn decode<'a>(&'a self, message: &'a [u8]) -> Result<Struct<'a>> {
        match self {
            Decoder::Cdr(schema) => cdr::decode(schema, message),
            Decoder::Ros1(schema) => ros1::decode(schema, message),
            Decoder::Protobuf(schema) => protobuf::decode(schema, message),
            Decoder::Json(schema) => json::decode(schema, message, None),
        }
    }

    /// Decode the header of a message alone, where the encoding allows that.
    ///
    /// # Errors
    ///
    /// As [`decode`](Decoder::decode); also if the message has no header.
    pub fn header(&self, message: &[u8]) -> Result<Header> {
        match self {
            // Foxglove's messages begin with the parts of a header. Nothing large is copied.
            Decoder::Cdr(schema)
                if schema.types[0].fields.iter().any(|f| f.name == "timestamp") =>
            {
                signals::header(&cdr::decode(schema, message)?)
            }
            Decoder::Cdr(schema) => {
                signals::header_of_first_field(&cdr::decode_first_field(schema, message)?)
            }
            Decoder::Ros1(schema) => {
                signals::header_of_first_field(&ros1::decode_first_field(schema, message)?)
            }
            Decoder::Protobuf(schema) => signals::header(&protobuf::decode(schema, message)?),
            Decoder::Json(schema) => {
                let fields = ["header", "timestamp", "frame_id"];
                signals::header(&json::decode(schema, message, Some(&fields))?)
            }
        }
    }
}
