//! The offline evaluation: plans beside what the recorded driver did.
//!
//! ```text
//! frames + policies -- evaluate --> errors per frame -- summary --> REPORT -- render, html, plot --> md, csv, tex, html, svg
//!                                        |                            |
//!                             store: errors.parquet          store: report.json
//! ```
//!
//! [`metrics`] and what stands above it are pure functions of one frame and one plan; [`errors`] is
//! what is kept of them; [`definitions`] is the one table that says what each number is.

pub mod horizons;
pub mod mixture_errors;
pub mod steering;
pub mod pedals;
pub mod metrics;
pub mod errors;
pub mod evaluate;
pub mod measures;
pub mod definitions;
pub mod report;
pub mod estimate;
pub mod slices;
pub mod trust;
pub mod verdict;
pub mod summary;
pub mod render;
pub mod plot;
pub mod html;
pub mod errors_parquet;
pub mod store;
