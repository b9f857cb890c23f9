//! Logs in, batches out.

pub mod dead_reckoning;
pub mod ego;
pub mod future;
pub mod route;
pub mod control;
pub mod ralidar;
pub mod picture;
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
pub mod batch;
pub mod loader;
