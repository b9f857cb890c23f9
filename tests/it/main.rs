//! All integration tests, as one binary: linking it once is what takes the time.

mod architecture;
mod schemas;
mod definitions;
mod fixtures;
mod decoding;
mod logs;
mod alignment;
mod ingest;
mod real_drive;
mod evaluation;
mod evaluation_report;
