//! The offline evaluation: plans beside what the recorded driver did.
//!
//! ```text
//! frames + policies -- evaluate --> errors per frame -- summary --> REPORT -- render --> md, csv, tex; plot --> svg
//!                                        |                            |
//!                             store: errors.parquet          store: report.json
//! ```
//!
//! [`metrics`] are pure functions of one frame and one plan; [`definitions`] is the one table that
//! says what each number is.

pub mod metrics;
pub mod definitions;
pub mod evaluate;
pub mod report;
pub mod summary;
pub mod render;
pub mod plot;
pub mod store;
