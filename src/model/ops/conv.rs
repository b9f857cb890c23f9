//! 2-D convolution.

use candle_core::{Shape, Tensor};
use pmp_kernels::conv;

use crate::{
    error::Result,
    model::ops::{
        composed,
        numbers::{Numbers, is_for_kernels},
        ready::with_gradient,
    },
};

/// How a kernel moves over a picture, the same down and right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Conv {
    pub stride: usize,
    /// Zeros on each side.
    pub padding: usize,
}

impl Conv {
    /// A side of the result, of a side of the picture, which with its padding is not smaller than
    /// that of the kernel.
    pub fn out(self, side: usize, kernel: usize) -> usize {
        (side + 2 * self.padding - kernel) / self.stride + 1
    }
}

/// Writes a gradient of one argument: from all arguments and the gradient of the result.
type Fill<'f> = &'f dyn Fn(&[&[f32]], &[f32], &mut [f32]);

/// Convolve (cross-correlate, as everywhere).
///
/// # Shapes
///
/// | name     | shape              | note                          |
/// |----------|--------------------|-------------------------------|
/// | `x`      | `[B, H, W, C]`     | channels last                 |
/// | `weight` | `[O, C, KH, KW]`   | as PyTorch and candle have it |
/// | `bias`   | `[O]`              |                               |
/// | returns  | `[B, OH, OW, O]`   |                               |
///
/// # Errors
///
/// [`Error::Tensor`](crate::error::Error::Tensor) if shapes disagree, the padded picture is
/// smaller than the kernel; where it is composed, also for a kernel that is not square or not
/// larger than the padding.
pub fn conv2d(x: &Tensor, weight: &Tensor, bias: Option<&Tensor>, conv: Conv) -> Result<Tensor> {
    let (batch, height, width, channels) = x.dims4()?;
    let (out_channels, of_weight, down, right) = weight.dims4()?;
    let shape = conv::Shape {
        batch,
        height,
        width,
        channels,
        out_channels,
        kernel: [down, right],
        stride: [conv.stride; 2],
        padding: [conv.padding; 2],
    };
    let fits = of_weight == channels && bias.is_none_or(|bias| bias.dims() == [out_channels]);
    let Some([out_height, out_width]) = shape.out_size().filter(|_| fits && conv.stride > 0) else {
        let (weight, bias) = (weight.dims(), bias.map(Tensor::dims));
        let what = format!("convolution of {:?} by {weight:?}, {bias:?}, {conv:?}", x.dims());
        return Err(candle_core::Error::msg(what).into());
    };
    if !is_for_kernels(x) {
        if down != right || conv.padding >= down {
            let what = format!("convolution by {down} x {right}, {conv:?} is not composed");
            return Err(candle_core::Error::msg(what).into());
        }
        return composed::conv2d(x, weight, bias, conv.stride, conv.padding);
    }
    let arguments: Vec<&Tensor> = [x, weight].into_iter().chain(bias).collect();
    let numbers = Numbers::of(arguments.iter().copied())?;
    let mut out = vec![0.0; shape.output_len()];
    numbers.read(|slices| {
        let bias = slices.get(2).copied();
        conv::forward(&shape, slices[0], slices[1], bias, &mut out);
    });
    let wanted = [x.track_op(), weight.track_op(), bias.is_some_and(Tensor::track_op)];
    let (x_shape, weight_shape) = (x.shape().clone(), weight.shape().clone());
    let (count, device) = (arguments.len(), x.device().clone());
    let back = move |grad: &Tensor| {
        let grads = Numbers::of([grad])?;
        let tensor = |wanted: bool, shape: &Shape, fill: Fill| {
            if !wanted {
                return Ok(None);
            }
            let mut out = vec![0.0; shape.elem_count()];
            numbers.read(|slices| grads.read(|grads| fill(slices, grads[0], &mut out)));
            Ok::<_, candle_core::Error>(Some(Tensor::from_vec(out, shape, &device)?))
        };
        let of_x = tensor(wanted[0], &x_shape, &|slices, grad, out| {
            conv::backward_input(&shape, grad, slices[1], out);
        })?;
        let of_weight = tensor(wanted[1], &weight_shape, &|slices, grad, out| {
            conv::backward_weight(&shape, slices[0], grad, out);
        })?;
        let of_bias = tensor(wanted[2], &Shape::from(out_channels), &|_, grad, out| {
            conv::backward_bias(grad, out);
        })?;
        let mut all = vec![of_x, of_weight, of_bias];
        all.truncate(count);
        Ok(all)
    };
    let shape = Shape::from((batch, out_height, out_width, out_channels));
    with_gradient("conv2d", (out, shape), &arguments, Box::new(back))
}
