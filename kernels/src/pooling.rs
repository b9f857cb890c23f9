//! The maximum of windows and the mean of pictures.

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use crate::{
    conv::Input,
    norm::Affine,
    simd::{load, store, widest},
    window::out_size,
};

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
        out_size([self.height, self.width], self.kernel, self.stride, self.padding)
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
        widest(Row { shape, x, affine, image: row / height, row: row % height, out, which });
    });
}

/// A row of maxima.
struct Row<'a> {
    shape: &'a Shape,
    x: &'a [f32],
    affine: Option<Affine<'a>>,
    image: usize,
    row: usize,
    out: &'a mut [f32],
    which: &'a mut [u8],
}

impl WithSimd for Row<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { shape, x, affine, image, row, out, which } = self;
        let c = shape.channels;
        let inside = |at: usize, i: usize, side: usize| {
            let first = at * shape.stride[i];
            let from = shape.padding[i].saturating_sub(first);
            from..(side + shape.padding[i] - first).min(shape.kernel[i])
        };
        let ys = inside(row, 0, shape.height);
        for (column, out) in out.chunks_exact_mut(c).enumerate() {
            let xs = inside(column, 1, shape.width);
            let y = image * shape.height + row * shape.stride[0] + ys.start - shape.padding[0];
            let left = column * shape.stride[1] + xs.start - shape.padding[1];
            for channel in (0..c).step_by(S::F32_LANES) {
                let mut most = simd.splat_f32s(f32::NEG_INFINITY);
                let mut from = simd.splat_u32s((ys.start * shape.kernel[1] + xs.start) as u32);
                for (down, tap_y) in ys.clone().enumerate() {
                    for (right, tap_x) in xs.clone().enumerate() {
                        let pixel = (y + down) * shape.width + left + right;
                        let mut value = load(simd, x, pixel * c + channel);
                        if let Some(Affine { scale, shift }) = affine {
                            let (scale, shift) =
                                (load(simd, scale, channel), load(simd, shift, channel));
                            value = simd.mul_add_f32s(value, scale, shift);
                            value = simd.max_f32s(value, simd.splat_f32s(0.0));
                        }
                        let tap = simd.splat_u32s((tap_y * shape.kernel[1] + tap_x) as u32);
                        // Larger, or not a number.
                        let kept = simd.less_than_or_equal_f32s(value, most);
                        let broken = simd.not_m32s(simd.equal_f32s(most, most));
                        let kept = simd.or_m32s(kept, broken);
                        most = simd.select_f32s(kept, most, value);
                        from = simd.select_u32s(kept, from, tap);
                    }
                }
                store(simd, out, channel, most);
                let from = [from];
                let from: &[u32] = pulp::bytemuck::cast_slice(&from);
                let which = &mut which[column * c + channel..(column + 1) * c];
                for (which, from) in which.iter_mut().zip(from) {
                    *which = *from as u8;
                }
            }
        }
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
                    let (grad, which) = (&grad_out[at..][..c], &which[at..][..c]);
                    widest(Hand { tap, which, grad, grad_x });
                }
            }
        }
    });
}

/// Adds the gradients of a window to the pixel that they come from.
struct Hand<'a> {
    tap: u8,
    which: &'a [u8],
    grad: &'a [f32],
    grad_x: &'a mut [f32],
}

impl WithSimd for Hand<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for ((grad_x, grad), which) in self.grad_x.iter_mut().zip(self.grad).zip(self.which) {
            *grad_x += if *which == self.tap { *grad } else { 0.0 };
        }
    }
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
        for pixel in x.chunks_exact(channels) {
            out.iter_mut().zip(pixel).for_each(|(sum, x)| *sum += x);
        }
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
