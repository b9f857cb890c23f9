//! How far a number can be trusted, and whether two go together.

pub mod mixture;
pub mod rank;
pub mod bootstrap;
pub mod proportion;
pub mod paired;
pub mod ratio;

pub use bootstrap::{Bootstrap, FEWEST_UNITS, Unit, mean, units_with_a_value};
