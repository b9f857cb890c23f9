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
//! again; [`results`] keeps the rows.

pub mod row;
pub mod suite;
pub mod observation;
pub mod pilot;
pub mod oracle;
pub mod safety;
pub mod comfort;
pub mod tally;
pub mod film;
pub mod strip;
pub mod thought;
pub mod recorder;
pub mod outing;
pub mod timing;
pub mod results;
pub mod contest;
