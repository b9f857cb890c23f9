//! Logs in, batches out.

pub mod sample;
pub mod batch;
