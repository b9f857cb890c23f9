//! The maximum of windows.

use candle_core::{Shape, Tensor};
use pmp_kernels::pooling;

use crate::{
    error::Result,
    model::ops::{
        composed,
        conv::Conv,
        numbers::{Numbers, is_for_kernels},
        ready::with_gradient,
    },
};

/// The largest number of each window of `kernel` x `kernel` pixels: `x` `[B, H, W, C]` to
/// `[B, OH, OW, C]`. Padding is never the largest.
///
/// # Errors
///
/// [`Error::Tensor`](crate::error::Error::Tensor) if the padded picture is smaller than the
/// window, the padding not smaller than it, or the window larger than 16 x 16.
pub fn max_pool(x: &Tensor, kernel: usize, conv: Conv) -> Result<Tensor> {
    let (batch, height, width, channels) = x.dims4()?;
    let shape = pooling::Shape {
        batch,
        height,
        width,
        channels,
        kernel: [kernel; 2],
        stride: [conv.stride; 2],
        padding: [conv.padding; 2],
    };
    let fits = (1..=16).contains(&kernel) && conv.padding < kernel && conv.stride > 0;
    let Some([out_height, out_width]) = shape.out_size().filter(|_| fits) else {
        let what = format!("maximum of {kernel} x {kernel} of {:?}, {conv:?}", x.dims());
        return Err(candle_core::Error::msg(what).into());
    };
    if !is_for_kernels(x) {
        return composed::max_pool(x, kernel, conv.stride, conv.padding);
    }
    let mut out = vec![0.0; shape.output_len()];
    let mut which = vec![0; out.len()];
    Numbers::of([x])?.read(|slices| pooling::max(&shape, slices[0], &mut out, &mut which));
    let (x_shape, device) = (x.shape().clone(), x.device().clone());
    let back = move |grad: &Tensor| {
        let mut grad_x = vec![0.0; shape.input_len()];
        Numbers::of([grad])?.read(|slices| {
            pooling::backward_max(&shape, slices[0], &which, &mut grad_x);
        });
        Ok(vec![Some(Tensor::from_vec(grad_x, &x_shape, &device)?)])
    };
    let shape = Shape::from((batch, out_height, out_width, channels));
    with_gradient("max-pool", (out, shape), &[x], Box::new(back))
}
