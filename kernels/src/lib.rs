//! What trains a convolutional network on the CPU: slices in, slices out.
//!
//! ```text
//! buffers, pieces, simd, matrix products, windows
//!   -> conv    forward, gradients of input, weight and bias
//!   -> norm    batch norm with residual addition and ReLU, both passes
//!   -> pooling maximum and mean
//!   -> adam    one step, sum of squares
//!   -> resnet  a whole residual network, both passes
//! ```
//!
//! Activations are `[B, H, W, C]`, the channel fastest; weights come and go in PyTorch's order
//! `[O, C, KH, KW]`; all numbers are f32.
//!
//! Work is shared by the threads of the current rayon pool in pieces whose number and bounds
//! depend on shapes only, and sums over pieces are added in their order: the same bits come out
//! of any number of threads. They may differ between processors, whose vectors have other widths.
//!
//! Slices of a wrong length are bugs of the caller: all functions panic on them.

mod foreign;
pub mod buffers;
mod pieces;
mod simd;
mod window;
pub mod conv;
pub mod norm;
pub mod pooling;
pub mod adam;
pub mod resnet;
