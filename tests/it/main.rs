//! The tests of the whole, in one binary: linking the dependencies once is enough.

// clippy.toml allows this in test functions; the helpers beside them are tests as well.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

mod architecture;
mod schemas;
mod definitions;
mod fixtures;
mod foxglove_fixtures;
mod decoding;
mod ros1;
mod idl;
mod foxglove;
mod protobuf;
mod logs;
mod alignment;
mod ingest;
mod real_drive;
mod evaluation;
mod evaluation_report;
mod samples;
mod losses;
mod network;
mod training;
mod train_cli;
mod run_schema;
mod encoding;
mod recording;
mod stats;
mod whole_path;
