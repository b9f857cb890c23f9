//! The tests of the whole, in one binary: linking the dependencies once is enough.

// clippy.toml allows this in test functions; the helpers beside them are tests as well.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

mod architecture;
#[cfg(feature = "learning")]
mod augment;
mod schemas;
mod definitions;
mod fixtures;
mod foxglove_fixtures;
mod rig_fixtures;
mod decoding;
mod ros1;
mod idl;
mod foxglove;
mod pictures;
#[cfg(feature = "h264")]
mod video_fixtures;
#[cfg(feature = "h264")]
mod video;
mod protobuf;
mod logs;
mod fuzz_corpus;
mod alignment;
mod ahead;
mod ingest;
mod collection;
mod compaction;
mod card;
mod memory;
mod writers;
mod clocks;
mod accounts;
mod shares;
mod progress;
#[cfg(feature = "remote")]
mod remote;
mod rigs;
mod control;
mod conventions;
mod readers;
mod real_drive;
mod evaluation;
mod offline_metrics;
mod calibration;
mod evaluation_report;
mod chart;
#[cfg(feature = "learning")]
mod evaluation_cli;
#[cfg(feature = "learning")]
mod samples;
#[cfg(feature = "learning")]
mod losses;
#[cfg(feature = "learning")]
mod models;
#[cfg(feature = "learning")]
mod network;
#[cfg(feature = "learning")]
mod recipe;
#[cfg(feature = "learning")]
mod training;
#[cfg(feature = "learning")]
mod train_cli;
#[cfg(feature = "learning")]
mod run_schema;
mod sampling;
mod statistics;
mod tables;
#[cfg(feature = "learning")]
mod tables_cli;
mod world;
mod encoding;
#[cfg(feature = "learning")]
mod torch_networks;
mod towns;
mod scenery;
mod scene;
mod flow;
mod recording;
mod one_pixel;
#[cfg(feature = "learning")]
mod operations;
#[cfg(feature = "learning")]
mod composed;
mod replay;
mod closed_loop;
mod ranging;
mod camera;
mod map_fixtures;
mod map_geometry;
mod map_traps;
mod maps;
#[cfg(feature = "reports")]
mod stats;
#[cfg(feature = "reports")]
mod stats_page;
mod notebook;
#[cfg(feature = "checks")]
mod checks;
#[cfg(feature = "checks")]
mod check_faults;
#[cfg(feature = "checks")]
mod edit;
#[cfg(feature = "checks")]
mod lerobot;
#[cfg(feature = "checks")]
mod tables_of_frames;
#[cfg(feature = "learning")]
mod drive_cli;
#[cfg(feature = "learning")]
mod whole_path;
