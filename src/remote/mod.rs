//! Logs and datasets in object stores: `s3://`, `gs://`, `az://`.
//!
//! ```text
//! location (a path or a URL) -> bucket (lists, reads, sends) -> spool (where copies lie for a while)
//! ```
//!
//! Everything else works on local files: a log is copied, read and removed again; a dataset is made
//! in a local folder and sent when it is whole.

pub mod location;
#[cfg(feature = "remote")]
pub mod bucket;
#[cfg(not(feature = "remote"))]
pub mod no_bucket;
pub mod spool;

#[cfg(not(feature = "remote"))]
pub use no_bucket as bucket;
