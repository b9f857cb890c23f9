//! The kernels against the plainest code there is, in f64; against PyTorch's numbers; and against
//! themselves on other numbers of threads.
#![allow(clippy::unwrap_used)]

mod naive;
mod convolutions;
mod norms;
mod poolings;
mod adams;
mod memory;
mod pytorch;
