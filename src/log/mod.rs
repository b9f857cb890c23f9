//! Logs: MCAP files in and out, and what their messages say.
//!
//! ```text
//! file -> reader (records, damage) -> decoder (values) -> signals, image, video, cloud (samples) -> scan (recordings)
//!           definitions: schema, idl, descriptors    messages: wire, cdr, ros1, protobuf, json
//!           clock: which instant, jumps: where it goes back
//!           rigs, profile -> mapping: which topic is which signal
//!           transforms: where each sensor sits
//! file <- writer (records) <- encode (CDR) <- definitions, protobuf_messages (Foxglove's types)
//! ```
//!
//! Nothing here knows about frames: it turns bytes into samples with units.

/// Name of the metadata record in which a log tells of its drive: `town`, `weather`,
/// `illumination` and `traffic` as in [`crate::frame::Conditions`], and [`APPLIED_CONTROL`].
pub const CONDITIONS_RECORD: &str = "pmp.conditions";

/// Key of [`CONDITIONS_RECORD`]: the topic of the controls that moved the car, where they are not
/// always those that the driver wanted because steering was disturbed on purpose.
pub const APPLIED_CONTROL: &str = "applied_control";

pub mod clock;
pub mod chunk;
pub mod hashed;
pub mod head;
pub mod reader;
pub mod value;
pub mod schema;
pub mod idl_tokens;
pub mod idl;
pub mod wire;
pub mod cdr;
pub mod ros1;
pub mod descriptors;
pub mod protobuf;
pub mod json;
pub mod signals;
pub mod image;
pub mod h264;
pub mod video;
pub mod cloud;
pub mod decoder;
pub mod transforms;
pub mod jumps;
pub mod recording;
pub mod scan;
pub mod topics;
pub mod conventions;
pub mod rigs;
pub mod profile;
pub mod candidates;
pub mod mapping;
pub mod definitions;
pub mod encode;
pub mod protobuf_messages;
pub mod writer;
