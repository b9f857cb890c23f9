//! Logs in, batches out.
//!
//! ```text
//! samples -> motion -> ego (pose, velocity) -> future, route, control, conditions   labels
//!            odometry, /tf, dead_reckoning, gnss (heading); world, base_frame
//!         -> align (grid) -> senses (picture, ralidar) -> shown -> drive (frames) -> columns (halves) -> shard
//!            ahead: what frames need, made during the scan and kept in stock
//! episode: a drive made and written; record: of all of a log's; claim: who writes; account: what became of its messages; skew
//! logs: given or found, here or in a store; plan: which are the work, told apart by their bytes
//! ingest: one log after the other, each committed alone; publish: a whole dataset sent to a store; split, manifest, episodes, card, summary, inspect
//! edit: datasets made of datasets (merge, drop, resplit), each a whole new one
//! open (which frames train, which judge; traits: what kind of moment each is)
//!   -> balance -> order -> sample -> augment -> batch, by loader
//! ```

pub mod ego;
pub mod world;
pub mod base_frame;
pub mod dead_reckoning;
pub mod heading;
pub mod gnss;
pub mod velocity;
pub mod motion;
pub mod future;
pub mod route;
pub mod control;
pub mod conditions;
pub mod radar;
pub mod ralidar;
pub mod picture;
pub mod footage;
pub mod align;
pub mod clocks;
pub mod senses;
pub mod stock;
pub mod shown;
pub mod drive;
pub mod ahead;
pub mod columns;
pub mod traits;
pub mod halves;
pub mod shard;
pub mod split;
pub mod account;
pub mod skew;
pub mod manifest;
pub mod episodes;
pub mod card;
pub mod summary;
pub mod episode;
pub mod record;
pub mod claim;
pub mod compaction;
pub mod logs;
pub mod ingest_event;
pub mod plan;
pub mod ingest;
pub mod publish;
pub mod edit;
pub mod inspect;
pub mod open;
pub mod balance;
pub mod order;
pub mod sample;
#[cfg(feature = "learning")]
pub mod augment;
#[cfg(feature = "learning")]
pub mod batch;
#[cfg(feature = "learning")]
pub mod loader;
