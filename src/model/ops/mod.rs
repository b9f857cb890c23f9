//! Operations that candle lacks, or whose way back it computes slowly or wrongly.
//!
//! Activations are `[B, H, W, C]`, contiguous or not. Those of f32 on the CPU are worked on by
//! `pmp_kernels`, and results have the same bits on any number of threads; on other devices and
//! for other types the operations are `composed` of candle's own, and bits are not promised.

mod numbers;
mod ready;
pub mod gradients;
pub mod composed;
mod conv;
mod norm;
mod pool;
pub mod adam;

pub use conv::{Conv, conv2d};
pub use norm::{Norm, batch_norm, moments_of, tensors_of};
pub use numbers::{Numbers, is_for_kernels, wide};
pub use pool::max_pool;
pub use ready::with_gradient;
