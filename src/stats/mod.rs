//! A dataset in numbers: what is in it, what is missing, what was left out.

pub mod summary;
#[cfg(feature = "reports")]
pub mod query;
pub mod screen;
pub mod check;
