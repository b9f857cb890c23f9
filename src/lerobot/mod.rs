//! A dataset as LeRobot's readers want it: their layout v3.0, pictures embedded, no video.
//!
//! ```text
//! frames -> cut (stretches without a gap, with an action) -> table (rows) -> data/chunk-*/file-*.parquet
//!                  |                                      -> statistics   -> meta/stats.json
//!                  +-> meta/episodes/*, meta/tasks.parquet, meta/info.json (layout), which comes last
//! ```
//!
//! The layout is that of the LeRobot documentation (`lerobot-dataset-v3.mdx`) and of its reader,
//! version 0.4. LeRobot takes frame n of an episode to be n / fps from its start, so an episode ends
//! where frames are missing, and time begins at 0 in each.

pub mod layout;
pub mod statistics;
pub mod cut;
pub mod table;
pub mod export;
