//! Logs in, batches out.
//!
//! ```text
//! samples -> ego (pose, velocity) -> future, route, control   labels
//!         -> align (grid) -> drive (frames: picture, ralidar) -> columns -> shard
//! ingest: one log after the other, each committed alone; split, manifest, summary, inspect
//! open (which frames train, which judge) -> order -> sample -> batch, by loader
//! ```

pub mod dead_reckoning;
pub mod ego;
pub mod future;
pub mod route;
pub mod control;
pub mod ralidar;
pub mod picture;
pub mod footage;
pub mod align;
pub mod drive;
pub mod columns;
pub mod shard;
pub mod split;
pub mod manifest;
pub mod summary;
pub mod ingest;
pub mod inspect;
pub mod open;
pub mod order;
pub mod sample;
#[cfg(feature = "learning")]
pub mod batch;
#[cfg(feature = "learning")]
pub mod loader;
