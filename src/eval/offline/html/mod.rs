//! A report as one page: no script, no network, nothing beside the file.
//!
//! ```text
//! report -> headline, horizons, mixtures, variance, slices, attention, definitions -> page
//! ```

pub mod cell;
pub mod headline;
pub mod horizons;
pub mod mixtures;
pub mod variance;
pub mod slices;
pub mod attention;
pub mod definitions;
pub mod page;
