//! How far a number can be trusted, and whether two go together.

pub mod bootstrap;

pub use bootstrap::{Bootstrap, FEWEST_UNITS, Unit, mean, units_with_a_value};
