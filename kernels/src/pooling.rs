//! The maximum of windows and the mean of pictures.

use rayon::prelude::*;

use crate::{conv::Input, norm::Affine, simd::widest};

/// Sizes of a pooling by maximum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    pub batch: usize,
    /// Of the input, pixels.
    pub height: usize,
    pub width: usize,
    pub channels: usize,
    /// Down, right; at most 256 pixels in all.
    pub kernel: [usize; 2],
    pub stride: [usize; 2],
    /// On each side, less than the kernel: no window lies wholly in it.
    pub padding: [usize; 2],
}

impl Shape {
    /// Height and width of the result; `None` if the padded picture is smaller than the kernel.
    pub fn out_size(&self) -> Option<[usize; 2]> {
        let side = |side: usize, i: usize| {
            let room = (side + 2 * self.padding[i]).checked_sub(self.kernel[i])?;
            Some(room / self.stride[i] + 1)
        };
        Some([side(self.height, 0)?, side(self.width, 1)?])
    }

    /// Numbers of the input.
    pub fn input_len(&self) -> usize {
        self.batch * self.height * self.width * self.channels
    }

    /// Numbers of the result.
    ///
    /// # Panics
    ///
    /// If the padded picture is smaller than the kernel.
    pub fn output_len(&self) -> usize {
        let [height, width] = self.out();
        self.batch * height * width * self.channels
    }

    fn out(&self) -> [usize; 2] {
        self.out_size().expect("the padded picture is at least of the size of the kernel")
    }

    fn check(&self) {
        assert!(self.kernel[0] * self.kernel[1] <= 256, "a window of at most 256 pixels");
        assert!((0..2).all(|i| self.padding[i] < self.kernel[i]), "less padding than kernel");
    }
}

/// The maximum of each window, and which of its pixels that is, the first of equals. A number
/// that is not one is above all others, as in PyTorch.
///
/// `x` is `[B, H, W, C]`, `out` and `which` are `[B, OH, OW, C]`.
///
/// # Panics
///
/// If lengths disagree, or the shape is not as it says.
pub fn max<'a>(shape: &Shape, x: impl Into<Input<'a>>, out: &mut [f32], which: &mut [u8]) {
    shape.check();
    let Input { x, affine } = x.into();
    assert_eq!(x.len(), shape.input_len(), "input of {shape:?}");
    assert_eq!(out.len(), shape.output_len(), "output of {shape:?}");
    assert_eq!(which.len(), out.len(), "a pixel for each maximum");
    let ([height, width], c) = (shape.out(), shape.channels);
    let rows = out.par_chunks_mut(width * c).zip(which.par_chunks_mut(width * c));
    rows.enumerate().for_each(|(row, (out, which))| {
        let (image, top) = (row / height, row % height * shape.stride[0]);
        let pixels = out.chunks_exact_mut(c).zip(which.chunks_exact_mut(c));
        for (column, (out, which)) in pixels.enumerate() {
            let left = column * shape.stride[1];
            let mut first = true;
            for tap in 0..shape.kernel[0] * shape.kernel[1] {
                let y = (top + tap / shape.kernel[1]).checked_sub(shape.padding[0]);
                let x_at = (left + tap % shape.kernel[1]).checked_sub(shape.padding[1]);
                let (Some(y), Some(x_at)) = (y, x_at) else { continue };
                if y >= shape.height || x_at >= shape.width {
                    continue;
                }
                let pixel = &x[((image * shape.height + y) * shape.width + x_at) * c..][..c];
                widest(|| match affine {
                    None => larger(pixel.iter().copied(), tap as u8, first, out, which),
                    Some(Affine { scale, shift }) => {
                        let lines = pixel.iter().zip(scale).zip(shift);
                        let relu = lines.map(|((x, a), b)| x.mul_add(*a, *b).max(0.0));
                        larger(relu, tap as u8, first, out, which);
                    }
                });
                first = false;
            }
        }
    });
}

#[inline(always)]
fn larger(
    pixel: impl Iterator<Item = f32>,
    tap: u8,
    first: bool,
    out: &mut [f32],
    which: &mut [u8],
) {
    for ((x, out), which) in pixel.zip(out).zip(which) {
        let take = first | (x > *out) | x.is_nan();
        *which = if take { tap } else { *which };
        *out = if take { x } else { *out };
    }
}

/// The gradient of the input of [`max`]: each maximum's goes to its pixel.
///
/// # Panics
///
/// As [`max`].
pub fn backward_max(shape: &Shape, grad_out: &[f32], which: &[u8], grad_x: &mut [f32]) {
    shape.check();
    assert_eq!(grad_x.len(), shape.input_len(), "input of {shape:?}");
    assert_eq!(grad_out.len(), shape.output_len(), "output of {shape:?}");
    assert_eq!(which.len(), grad_out.len(), "a pixel for each maximum");
    let ([height, width], c) = (shape.out(), shape.channels);
    // Of a side, the windows that hold a pixel, and which of theirs it is.
    let windows = |at: usize, i: usize, windows: usize| {
        let at = at + shape.padding[i];
        let first = (at + 1).saturating_sub(shape.kernel[i]).div_ceil(shape.stride[i]);
        (first..(at / shape.stride[i] + 1).min(windows))
            .map(move |window| (window, at - window * shape.stride[i]))
    };
    grad_x.par_chunks_mut(shape.width * c).enumerate().for_each(|(row, grad_x)| {
        let (image, y) = (row / shape.height, row % shape.height);
        for (x, grad_x) in grad_x.chunks_exact_mut(c).enumerate() {
            grad_x.fill(0.0);
            for (down, tap_y) in windows(y, 0, height) {
                for (across, tap_x) in windows(x, 1, width) {
                    let tap = (tap_y * shape.kernel[1] + tap_x) as u8;
                    let at = ((image * height + down) * width + across) * c;
                    let window = grad_out[at..][..c].iter().zip(&which[at..][..c]);
                    widest(|| {
                        for (grad_x, (grad, which)) in grad_x.iter_mut().zip(window) {
                            *grad_x += if *which == tap { *grad } else { 0.0 };
                        }
                    });
                }
            }
        }
    });
}

/// The mean of each picture: `[B, pixels, C]` to `[B, C]`.
///
/// # Panics
///
/// If lengths disagree.
pub fn mean(pixels: usize, channels: usize, x: &[f32], out: &mut [f32]) {
    assert_eq!(x.len(), pixels * out.len(), "pixels of each mean");
    let images = out.par_chunks_exact_mut(channels).zip(x.par_chunks_exact(pixels * channels));
    images.for_each(|(out, x)| {
        out.fill(0.0);
        widest(|| {
            for pixel in x.chunks_exact(channels) {
                out.iter_mut().zip(pixel).for_each(|(sum, x)| *sum += x);
            }
        });
        out.iter_mut().for_each(|sum| *sum /= pixels as f32);
    });
}

/// The gradient of the input of [`mean`].
///
/// # Panics
///
/// If lengths disagree.
pub fn backward_mean(pixels: usize, channels: usize, grad_out: &[f32], grad_x: &mut [f32]) {
    assert_eq!(grad_x.len(), pixels * grad_out.len(), "pixels of each mean");
    for (grad_x, grad) in
        grad_x.chunks_exact_mut(pixels * channels).zip(grad_out.chunks_exact(channels))
    {
        for pixel in grad_x.chunks_exact_mut(channels) {
            pixel.iter_mut().zip(grad).for_each(|(x, grad)| *x = grad / pixels as f32);
        }
    }
}
