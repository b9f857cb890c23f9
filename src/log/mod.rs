//! Recorded logs: ROS 2 messages in MCAP files.

pub mod definitions;
pub mod encode;
pub mod writer;
