//! Driving logs in, policies that drive out, with numbers that can be trusted.
//!
//! ```text
//! drive.mcap --+
//!              +- log -> samples -> FRAMES -> episodes -> shards -> batches -> net --+
//!   record ----+                      ^                                              |
//!     ^                               | sensors             baselines, expert -------+- POLICY -+- offline ----+
//!     |                               |                     a recorded human --------+          |              +- tables
//!     +------------- simulator -------+                                                         +- closed loop +
//! ```
//!
//! Modules are declared in the order of the flow, and a file uses only what is declared above it
//! (`tests/it/architecture.rs` checks that).

pub mod error;
pub mod digits;
pub mod atomic;
pub mod table_file;
pub mod claim;
pub mod remote;
pub mod projection;
pub mod geodesy;
pub mod drops;
pub mod frame;
pub mod log;
pub mod noise;
pub mod footprint;
pub mod policy;
pub mod control;
pub mod dataset;
pub mod lerobot;
pub mod map;
pub mod towns;
pub mod world;
pub mod scene;
pub mod sensors;
pub mod sim;
pub mod closed_loop;
pub mod chart;
pub mod page;
#[cfg(feature = "learning")]
pub mod model;
#[cfg(feature = "checks")]
pub mod stats;
pub mod eval;
pub mod cli;
pub mod ingest_progress;
