//! Datasets made of datasets: put together, thinned out, split anew. The originals stay as they are.
//!
//! ```text
//! source (a dataset to read from) -> trim (a log's record of some of its episodes)
//!   -> conflicts, merge | drop | resplit: which logs, on which side -> layout (which files) -> place (written)
//! ```
//!
//! `edit.json` is written first and `manifest.json` last, so a run that was killed has made nothing
//! that looks whole, and the same command goes on with it. No frame is decoded: files that stay as
//! they are, are copied, and row groups of others as they lie there, each checked against the
//! checksum that its manifest has.

pub mod source;
pub mod trim;
pub mod conflicts;
pub mod layout;
pub mod place;
pub mod merge;
pub mod drop;
pub mod resplit;
