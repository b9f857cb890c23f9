//! A dataset in numbers: what is in it, what is missing, what was left out, what is wrong.

pub mod summary;
#[cfg(feature = "reports")]
pub mod frames;
#[cfg(feature = "reports")]
pub mod query;
#[cfg(feature = "reports")]
pub mod survey;
pub mod moments;
pub mod screen;
pub mod check;
#[cfg(feature = "reports")]
pub mod html;
