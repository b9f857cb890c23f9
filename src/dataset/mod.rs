//! Logs in, batches out.

pub mod batch;
