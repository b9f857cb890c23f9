//! The closed loop: a policy drives in the simulator, and what came of it is counted.
//!
//! ```text
//! suite -> episodes -> drive (world) -> observation -> pilot: policy + controller -> decision -+
//!                        ^                                                                    |
//!                        +--------------------------------------------------------------------+
//!            row <- scoring, safety, comfort <- drive, at every 0.1 s
//! ```
//!
//! An episode's sums are kept in one [`row`], from which every table can be made without driving
//! again.

pub mod row;
pub mod observation;
