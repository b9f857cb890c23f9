//! A dataset in numbers: what is in it, what is missing, what was left out.

pub mod summary;
pub mod frames;
pub mod query;
pub mod survey;
pub mod moments;
pub mod screen;
pub mod html;
