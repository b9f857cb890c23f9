//! Policies in, numbers that can be trusted out.
//!
//! [`statistics`] says how far a number can be trusted, [`baseline`] what it has to be held against;
//! [`offline`] compares plans with what was recorded, [`calibration`] says how far a run's plans are to be
//! followed, [`table`] tells of driven episodes. Nothing here knows what a policy is made of.

pub mod statistics;
pub mod baseline;
pub mod quoting;
pub mod offline;
pub mod calibration;
pub mod table;
