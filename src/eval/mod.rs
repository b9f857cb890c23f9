//! Policies in, numbers that can be trusted out.
//!
//! ```text
//! frames + policies -- offline --> errors per frame -- summary --> REPORT -- render --> md, csv, tex; plot --> svg
//!            |                          |                            |
//!        baseline            store: errors.parquet          store: report.json
//! ```
//!
//! [`metrics`] are pure functions of one frame and one plan; [`definitions`] is the one table that
//! says what each number is; [`statistics`] says how far a number can be trusted. Nothing here
//! knows what a policy is made of.

pub mod metrics;
pub mod definitions;
pub mod statistics;
pub mod baseline;
pub mod offline;
pub mod report;
pub mod summary;
pub mod render;
pub mod plot;
pub mod store;
