//! The embedded simulator's recorder: episodes of a plan, driven by the expert in towns, as logs.
//!
//! ```text
//! plan -> episode -> drive (world, expert) -> senses, each on its clock -> readings
//!                                                                             |
//! collection (folder) <- record (file) <- messages: Foxglove's or ROS 2 <----+
//! ```
//!
//! Nothing in a log comes from outside the simulated world. Every random number is drawn from a
//! stream keyed by (seed, episode, purpose), so one build makes the same bytes of the same drive,
//! however many threads it has.

pub mod plan;
pub mod clocks;
pub mod drive;
pub mod stage;
pub mod rig;
pub mod reading;
pub mod senses;
pub mod clouds;
pub mod message;
pub mod foxglove_messages;
pub mod ros2_messages;
pub mod record;
pub mod collection;
pub mod sheet;
pub mod senses_sheet;
