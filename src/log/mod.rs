//! Logs: MCAP files in and out, and what their messages say.
//!
//! ```text
//! file -> reader (records, damage) -> schema (definitions) -> cdr (values) -> signals (samples)
//!           mapping: which topic is which signal        transforms: where each sensor sits
//! file <- writer (records) <- encode (CDR) <- definitions
//! ```
//!
//! Nothing here knows about frames: it turns bytes into samples with units.

pub mod reader;
pub mod value;
pub mod schema;
pub mod cdr;
pub mod cloud;
pub mod signals;
pub mod transforms;
pub mod recording;
pub mod profile;
pub mod mapping;
pub mod definitions;
pub mod encode;
pub mod writer;
