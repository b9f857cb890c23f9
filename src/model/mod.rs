//! Batches in, a policy out.
//!
//! ```text
//! TOML -> net_config, config --+
//!                              +-> init -> network (pmp, cil, int) -> loss -> gradient -> adam --+-> train -> run directory -> learned (a policy)
//! batches ---------------------+             ^                                                  |      metrics, curves, events
//!                                            +---------------------- average -------------------+
//! ```
//!
//! Networks are made of `encoder` (strided convolutions, CIL's, `resnet`), `dense` and `mixture`, on
//! the operations of `ops`. Everything is a function of (configuration, data, step): a training that
//! was stopped at any moment and resumed ends with the weights, the moments and the curves of one
//! that was not. Bit for bit on the CPU; on a GPU (`device`) sums are taken in an order that changes.

pub mod net_config;
pub mod device;
pub mod config;
pub mod init;
pub mod pass;
pub mod describe;
pub mod ops;
pub mod batch_norm;
pub mod resnet;
pub mod dense;
pub mod encoder;
pub mod mixture;
pub mod output;
pub mod pmp;
pub mod cil;
pub mod int;
pub mod network;
pub mod loss;
pub mod metrics;
pub mod gradient;
pub mod adam;
pub mod average;
pub mod pretrained;
pub mod curves;
pub mod events;
pub mod run;
pub mod train;
pub mod sweep;
pub mod learned;
