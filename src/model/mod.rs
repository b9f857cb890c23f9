//! Batches in, a policy out.
//!
//! ```text
//! TOML -> config --+
//!                  +-> init -> pmp -> loss -> adam --+-> train -> run directory -> learned (a policy)
//! batches ---------+                    ^            |
//!                                       +------------+
//! ```
//!
//! Everything is a function of (configuration, data, step): a training that was stopped at any
//! moment and resumed ends with the weights, the moments and the curves of one that was not.

pub mod config;
pub mod init;
pub mod conv;
pub mod pmp;
pub mod loss;
pub mod adam;
pub mod run;
pub mod train;
pub mod learned;
