// clippy.toml allows this in test functions; the helpers beside them are tests as well.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

mod samples;
mod losses;
mod network;
mod training;
mod train_cli;
