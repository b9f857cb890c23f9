//! Pages for people: sections, tables and charts in one HTML file.
//!
//! ```text
//! numbers, charts -> tags (sections, tables) -> document -> FILE.html
//! ```

pub mod tags;
pub mod document;
