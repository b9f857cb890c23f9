//! A plan in, steering and pedals out (paper §III.C4).
//!
//! ```text
//! plan - strongest mode -> target (5 m ahead) -> pid -> a2 -+
//!   |         |                                            +- fusion (eq. 3) -> rules -> action
//!   |         +- variances up to the target -> lambda -----+
//!   +- a1 -------------------------------------------------+
//! ```

pub mod pid;
pub mod target;
pub mod fusion;
pub mod driver;
