//! The closed loop's tables: rows of `episodes.parquet` in, the paper's table I and what it leaves
//! out, without driving again.
//!
//! ```text
//! episodes.parquet ... -- episodes --> SYSTEMS -- summary, comparison --> TABLE -- markdown, csv, latex, json
//!                                       paper --------------------------------^
//! ```
//!
//! [`definitions`] says what each number is.

pub mod definitions;
pub mod report;
pub mod paper;
pub mod episodes;
pub mod comparison;
pub mod summary;
pub mod cells;
pub mod markdown;
pub mod csv;
pub mod latex;
pub mod store;

pub use store::{json, read, write};
