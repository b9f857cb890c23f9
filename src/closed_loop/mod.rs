//! The closed loop: a policy drives in the simulator, and what came of it is counted.
//!
//! An episode's sums are kept in one [`row`], from which every table can be made without driving
//! again; [`results`] keeps the rows.

pub mod row;
pub mod results;
