//! 2-D convolution (cross-correlation, as everywhere) and its gradients.
//!
//! 3 x 3 kernels of stride 1 go by Winograd's minimal filtering where the sizes make that pay,
//! everything else by gathering the pixels under the kernel into a matrix.

mod direct;
mod tile;
mod winograd;

use rayon::prelude::*;

use crate::{norm::Affine, pieces, window::out_size};

/// Sizes of a convolution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    pub batch: usize,
    /// Of the input, pixels.
    pub height: usize,
    pub width: usize,
    pub channels: usize,
    pub out_channels: usize,
    /// Down, right.
    pub kernel: [usize; 2],
    pub stride: [usize; 2],
    /// Zeros on each side.
    pub padding: [usize; 2],
}

/// How a convolution is computed. All give the same up to rounding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Pixels gathered into a matrix: any kernel, stride and padding.
    Direct,
    /// Winograd with tiles of 2 x 2 results: 2.25 times fewer multiplications; 3 x 3, stride 1.
    Tiles2,
    /// Winograd with tiles of 4 x 4 results: 4 times fewer, a digit less exact; 3 x 3, stride 1.
    Tiles4,
}

/// An activation, and what is done to it while it is read.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a> {
    /// `[B, H, W, C]`.
    pub x: &'a [f32],
    /// If given, what is convolved is the ReLU of this map of each channel, padded with zeros:
    /// a normalised activation need not be written down.
    pub affine: Option<Affine<'a>>,
}

impl<'a> From<&'a [f32]> for Input<'a> {
    fn from(x: &'a [f32]) -> Self {
        Self { x, affine: None }
    }
}

impl Shape {
    /// Height and width of the result; `None` if the padded picture is smaller than the kernel.
    pub fn out_size(&self) -> Option<[usize; 2]> {
        out_size([self.height, self.width], self.kernel, self.stride, self.padding)
    }

    /// Numbers of the input.
    pub fn input_len(&self) -> usize {
        self.batch * self.height * self.width * self.channels
    }

    /// Numbers of the weight.
    pub fn weight_len(&self) -> usize {
        self.out_channels * self.channels * self.taps()
    }

    /// Numbers of the result.
    ///
    /// # Panics
    ///
    /// If the padded picture is smaller than the kernel.
    pub fn output_len(&self) -> usize {
        let [height, width] = self.out();
        self.batch * height * width * self.out_channels
    }

    /// The convolution whose forward pass is the gradient of this one's input, the kernel turned
    /// round and its channels swapped; for stride 1 only.
    fn turned(&self) -> Shape {
        let [height, width] = self.out();
        let padding = [0, 1].map(|i| self.kernel[i] - 1 - self.padding[i]);
        let (channels, out_channels) = (self.out_channels, self.channels);
        Shape { height, width, channels, out_channels, padding, ..*self }
    }

    fn out(&self) -> [usize; 2] {
        self.out_size().expect("the padded picture is at least of the size of the kernel")
    }

    fn taps(&self) -> usize {
        self.kernel[0] * self.kernel[1]
    }

    /// Whether Winograd's tiles can compute it, and its gradients.
    fn tiles(&self) -> bool {
        self.kernel == [3, 3] && self.stride == [1, 1] && self.padding.iter().all(|p| *p <= 2)
    }

    /// The quickest way for this size, as measured (`examples/layers.rs`).
    pub fn method(&self) -> Method {
        if !self.tiles() || self.channels.min(self.out_channels) < 8 {
            return Method::Direct;
        }
        let [height, width] = self.out();
        let tiles = |side: usize| height.div_ceil(side) * width.div_ceil(side) * self.batch;
        // Multiplications of each pair of channels, and the kernel moved to and from the tiles.
        let cost = |side: usize, planes: usize| planes * tiles(side) + 24 * planes;
        let direct = 9 * height * width * self.batch + 100;
        match (cost(4, 36), cost(2, 16)) {
            (four, two) if four <= two && four < direct => Method::Tiles4,
            (_, two) if two < direct => Method::Tiles2,
            _ => Method::Direct,
        }
    }
}

/// `out = x * weight + bias`.
///
/// # Shapes
///
/// | name     | shape               |
/// |----------|---------------------|
/// | `x`      | `[B, H, W, C]`      |
/// | `weight` | `[O, C, KH, KW]`    |
/// | `bias`   | `[O]`               |
/// | `out`    | `[B, OH, OW, O]`    |
///
/// # Panics
///
/// If a length is not that of `shape`, or the padded picture is smaller than the kernel.
pub fn forward<'a>(
    shape: &Shape,
    x: impl Into<Input<'a>>,
    weight: &[f32],
    bias: Option<&[f32]>,
    out: &mut [f32],
) {
    forward_by(shape.method(), shape, x.into(), weight, bias, out);
}

/// [`forward`] by a given method.
///
/// # Panics
///
/// As [`forward`]; also if the method cannot compute the shape.
pub fn forward_by(
    method: Method,
    shape: &Shape,
    x: Input,
    weight: &[f32],
    bias: Option<&[f32]>,
    out: &mut [f32],
) {
    check(shape, x.x, weight, out);
    assert!(bias.is_none_or(|bias| bias.len() == shape.out_channels), "a bias for each channel");
    match method {
        Method::Direct => direct::forward(shape, x, weight, bias, out),
        Method::Tiles2 => winograd::forward::<4, 2>(shape, x, weight, false, bias, out),
        Method::Tiles4 => winograd::forward::<6, 4>(shape, x, weight, false, bias, out),
    }
}

/// The gradient of the input: `grad_out` `[B, OH, OW, O]` to `grad_x` `[B, H, W, C]`.
///
/// # Panics
///
/// As [`forward`].
pub fn backward_input(shape: &Shape, grad_out: &[f32], weight: &[f32], grad_x: &mut [f32]) {
    backward_input_by(shape.method(), shape, grad_out, weight, grad_x);
}

/// [`backward_input`] by a given method.
///
/// # Panics
///
/// As [`forward_by`].
pub fn backward_input_by(
    method: Method,
    shape: &Shape,
    grad_out: &[f32],
    weight: &[f32],
    grad_x: &mut [f32],
) {
    check(shape, grad_x, weight, grad_out);
    let grad = grad_out.into();
    match method {
        Method::Direct => direct::backward_input(shape, grad_out, weight, grad_x),
        Method::Tiles2 => {
            winograd::forward::<4, 2>(&shape.turned(), grad, weight, true, None, grad_x);
        }
        Method::Tiles4 => {
            winograd::forward::<6, 4>(&shape.turned(), grad, weight, true, None, grad_x);
        }
    }
}

/// The gradient of the weight `[O, C, KH, KW]`, of the input `x` of the forward pass.
///
/// # Panics
///
/// As [`forward`].
pub fn backward_weight<'a>(
    shape: &Shape,
    x: impl Into<Input<'a>>,
    grad_out: &[f32],
    grad_weight: &mut [f32],
) {
    backward_weight_by(shape.method(), shape, x.into(), grad_out, grad_weight);
}

/// [`backward_weight`] by a given method.
///
/// # Panics
///
/// As [`forward_by`].
pub fn backward_weight_by(
    method: Method,
    shape: &Shape,
    x: Input,
    grad_out: &[f32],
    grad_weight: &mut [f32],
) {
    check(shape, x.x, grad_weight, grad_out);
    match method {
        Method::Direct => direct::backward_weight(shape, x, grad_out, grad_weight),
        Method::Tiles2 => winograd::backward_weight::<4, 2>(shape, x, grad_out, grad_weight),
        Method::Tiles4 => winograd::backward_weight::<6, 4>(shape, x, grad_out, grad_weight),
    }
}

/// The gradient of the bias `[O]`: the sum of `grad_out` `[.., O]` over all pixels.
///
/// # Panics
///
/// If `grad_out` is not made of whole pixels.
pub fn backward_bias(grad_out: &[f32], grad_bias: &mut [f32]) {
    let channels = grad_bias.len();
    assert!(grad_out.len().is_multiple_of(channels), "whole pixels");
    let pixels = grad_out.len() / channels;
    let each = pixels.div_ceil(64).max(4096_usize.div_ceil(channels));
    let parts: Vec<Vec<f64>> = pieces::shares(pixels, each)
        .into_par_iter()
        .map(|rows| {
            let mut sum = vec![0.0; channels];
            for pixel in grad_out[rows.start * channels..rows.end * channels].chunks(channels) {
                sum.iter_mut().zip(pixel).for_each(|(sum, x)| *sum += f64::from(*x));
            }
            sum
        })
        .collect();
    for (channel, grad) in grad_bias.iter_mut().enumerate() {
        *grad = parts.iter().map(|part| part[channel]).sum::<f64>() as f32;
    }
}

fn check(shape: &Shape, x: &[f32], weight: &[f32], out: &[f32]) {
    assert_eq!(x.len(), shape.input_len(), "input of {shape:?}");
    assert_eq!(weight.len(), shape.weight_len(), "weight of {shape:?}");
    assert_eq!(out.len(), shape.output_len(), "output of {shape:?}");
}
