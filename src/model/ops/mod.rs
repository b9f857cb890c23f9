//! Operations that candle lacks, or whose way back it computes slowly: `pmp_kernels` on tensors.
//!
//! Activations are `[B, H, W, C]`, contiguous or not, f32, on the CPU; on another device or of
//! another type they are refused, but for
//! [`conv2d`], which candle has as well. Results have the same bits on any number of threads.

mod numbers;
mod ready;
pub mod gradients;
mod conv;
mod norm;
mod pool;
pub mod adam;

pub use conv::{Conv, conv2d};
pub use norm::{Norm, batch_norm};
pub use numbers::Numbers;
pub use pool::max_pool;
pub use ready::with_gradient;
