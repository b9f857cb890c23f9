//! One binary for all integration tests: linking dominates.
#![allow(clippy::unwrap_used)] // a test fails by panicking

mod encoding;
mod recording;
