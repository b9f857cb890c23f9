//! Convolution as a matrix product: the pixels under the kernel, gathered into rows.
//!
//! Rows are made for a share of the pixels at a time, so that they stay in the cache. A row holds
//! the kernel's rows one after another, in each its pixels, in each the channels: what lies beside
//! one another in the picture stays so.

use std::ops::Range;

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use crate::{
    buffers::Buffer,
    conv::{Input, Shape},
    foreign::{Matrix, multiply},
    norm::Affine,
    pieces::{Block, add_up, blocks, shares, split},
    simd::{load, store, widest},
};

/// Channels of a result that are computed together, what `gemm` takes at once.
const TOGETHER: usize = 64;

/// Pixels that are few for a weight of rows at least [`LONG`].
const FEW_PIXELS: usize = 96;
const LONG: usize = 512;

/// Numbers of a share's rows: half a second-level cache.
const SHARE: usize = 1 << 17;

/// A picture to gather from.
#[derive(Clone, Copy)]
struct Picture<'a> {
    input: Input<'a>,
    height: usize,
    width: usize,
    channels: usize,
}

impl Picture<'_> {
    /// The `down` x `right` pixels of an image from (`top`, `left`) on, zeros outside of it.
    fn window(
        &self,
        image: usize,
        [top, left]: [isize; 2],
        [down, right]: [usize; 2],
        row: &mut [f32],
    ) {
        let c = self.channels;
        let (from, to) = (clamp(-left, right), clamp(self.width as isize - left, right));
        for (i, part) in row.chunks_exact_mut(right * c).enumerate().take(down) {
            let y = top + i as isize;
            if y < 0 || y >= self.height as isize || from >= to {
                part.fill(0.0);
                continue;
            }
            let pixel = (image * self.height + y as usize) * self.width;
            let first = (pixel as isize + left + from as isize) as usize * c;
            part[..from * c].fill(0.0);
            part[to * c..].fill(0.0);
            let inside = &mut part[from * c..to * c];
            inside.copy_from_slice(&self.input.x[first..][..inside.len()]);
            if let Some(map) = self.input.affine {
                widest(Relu { map, pixels: inside });
            }
        }
    }
}

/// The ReLU of a map of each channel, in place.
struct Relu<'a> {
    map: Affine<'a>,
    pixels: &'a mut [f32],
}

impl WithSimd for Relu<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { map: Affine { scale, shift }, pixels } = self;
        for pixel in pixels.chunks_exact_mut(scale.len()) {
            for at in (0..pixel.len()).step_by(S::F32_LANES) {
                let (scale, shift) = (load(simd, scale, at), load(simd, shift, at));
                let value = simd.mul_add_f32s(load(simd, pixel, at), scale, shift);
                store(simd, pixel, at, simd.max_f32s(value, simd.splat_f32s(0.0)));
            }
        }
    }
}

/// `x` within 0 ... `most`.
fn clamp(x: isize, most: usize) -> usize {
    x.clamp(0, most as isize) as usize
}

impl Shape {
    fn picture<'a>(&self, input: Input<'a>) -> Picture<'a> {
        Picture { input, height: self.height, width: self.width, channels: self.channels }
    }

    /// Rows of these results' pixels.
    fn gather(&self, picture: &Picture, pixels: Range<usize>, rows: &mut [f32]) {
        let [height, width] = self.out();
        let depth = self.taps() * self.channels;
        for (pixel, row) in pixels.zip(rows.chunks_exact_mut(depth)) {
            let (image, y, x) = (pixel / (height * width), pixel / width % height, pixel % width);
            let corner = [y * self.stride[0], x * self.stride[1]];
            let corner = [0, 1].map(|i| corner[i] as isize - self.padding[i] as isize);
            picture.window(image, corner, self.kernel, row);
        }
    }

    /// Whether a pixel is its own row.
    fn is_pointwise(&self) -> bool {
        self.kernel == [1, 1] && self.stride == [1, 1] && self.padding == [0, 0]
    }
}

pub(crate) fn forward(
    shape: &Shape,
    x: Input,
    weight: &[f32],
    bias: Option<&[f32]>,
    out: &mut [f32],
) {
    let (c, o, taps) = (shape.channels, shape.out_channels, shape.taps());
    let depth = taps * c;
    if out.is_empty() || depth == 0 {
        return fill_rows(out, o, bias);
    }
    if shape.batch * shape.out().iter().product::<usize>() <= FEW_PIXELS && depth >= LONG {
        return forward_few(shape, x, weight, bias, out);
    }
    let weight = pack(o, depth, |few, packed| {
        let weight = &weight[few.start * depth..few.end * depth];
        turn([few.len(), c, taps], |from, to| packed[to] = weight[from]);
    });
    let picture = shape.picture(x);
    let each = (SHARE / depth).clamp(16, 512);
    out.par_chunks_mut(each * o).enumerate().for_each(|(i, out)| {
        let pixels = i * each..i * each + out.len() / o;
        fill_rows(out, o, bias);
        let gathered = (!shape.is_pointwise() || x.affine.is_some()).then(|| {
            let mut rows = Buffer::any(pixels.len() * depth);
            shape.gather(&picture, pixels.clone(), &mut rows);
            rows
        });
        let rows = match &gathered {
            Some(rows) => rows,
            None => &x.x[pixels.start * depth..],
        };
        weight.times(rows, pixels.len(), out, true);
    });
}

/// For pixels so few that bringing the weight into another order would take longer than the product:
/// the rows are brought into its order.
fn forward_few(shape: &Shape, x: Input, weight: &[f32], bias: Option<&[f32]>, out: &mut [f32]) {
    const SIDE: usize = 16; // `gemm` multiplies up to 16 rows with up to 16 without packing them
    let (c, o, taps) = (shape.channels, shape.out_channels, shape.taps());
    let (depth, pixels) = (taps * c, out.len() / o);
    let mut gathered = Buffer::any(pixels * depth);
    shape.gather(&shape.picture(x), 0..pixels, &mut gathered);
    let mut rows = Buffer::any(pixels * depth);
    for (row, gathered) in rows.chunks_exact_mut(depth).zip(gathered.chunks_exact(depth)) {
        for (tap, pixel) in gathered.chunks_exact(c).enumerate() {
            pixel.iter().enumerate().for_each(|(channel, x)| row[channel * taps + tap] = *x);
        }
    }
    let few = shares(o, SIDE);
    let mut products = Buffer::any(pixels * o);
    let parts = split(&mut products, few.iter().map(|few| few.len() * pixels));
    few.par_iter().zip(parts).for_each(|(few, product)| {
        for some in shares(pixels, SIDE) {
            let numbers = &weight[few.start * depth..];
            let left = Matrix { numbers, down: depth, right: 1 };
            let right = Matrix { numbers: &rows[some.start * depth..], down: 1, right: depth };
            let product = &mut product[some.start * few.len()..];
            multiply([few.len(), some.len(), depth], left, right, product, few.len(), false);
        }
    });
    fill_rows(out, o, bias);
    for few in few {
        let product = &products[few.start * pixels..few.end * pixels];
        for (out, product) in out.chunks_exact_mut(o).zip(product.chunks_exact(few.len())) {
            out[few.clone()].iter_mut().zip(product).for_each(|(out, product)| *out += product);
        }
    }
}

/// Rows of the bias, or zeros.
fn fill_rows(out: &mut [f32], channels: usize, bias: Option<&[f32]>) {
    match bias {
        Some(bias) => out.chunks_exact_mut(channels).for_each(|out| out.copy_from_slice(bias)),
        None => out.fill(0.0),
    }
}

/// Factors `[channels / TOGETHER][depth][TOGETHER]`.
struct Packed {
    numbers: Buffer,
    channels: usize,
    depth: usize,
}

/// Let `fill` write the factors of each few channels.
fn pack(channels: usize, depth: usize, fill: impl Fn(Range<usize>, &mut [f32]) + Sync) -> Packed {
    let mut numbers = Buffer::any(channels * depth);
    let together = shares(channels, TOGETHER);
    let parts = split(&mut numbers, together.iter().map(|channels| channels.len() * depth));
    together.into_par_iter().zip(parts).for_each(|(channels, part)| fill(channels, part));
    Packed { numbers, channels, depth }
}

impl Packed {
    /// `count` rows `[depth]` to `[channels]`.
    fn times(&self, rows: &[f32], count: usize, out: &mut [f32], add: bool) {
        for few in shares(self.channels, TOGETHER) {
            let numbers = &self.numbers[few.start * self.depth..];
            let left = Matrix { numbers, down: 1, right: few.len() };
            let right = Matrix { numbers: rows, down: 1, right: self.depth };
            let sizes = [few.len(), count, self.depth];
            multiply(sizes, left, right, &mut out[few.start..], self.channels, add);
        }
    }
}

/// Pixels of the input that are `stride` apart see the same taps of the kernel: `stride`^2 small
/// convolutions of the result's gradient, each of stride 1.
pub(crate) fn backward_input(shape: &Shape, grad_out: &[f32], weight: &[f32], grad_x: &mut [f32]) {
    let (c, o, taps) = (shape.channels, shape.out_channels, shape.taps());
    let [height, width] = shape.out();
    let [down, right] = shape.stride;
    if grad_x.is_empty() || o == 0 {
        return grad_x.fill(0.0);
    }
    let phases: Vec<(usize, usize, [usize; 2], Packed)> = (0..down * right)
        .map(|phase| {
            let first = [phase / right, phase % right];
            let count =
                [0, 1].map(|i| shape.kernel[i].saturating_sub(first[i]).div_ceil(shape.stride[i]));
            let packed = pack(c, count[0] * count[1] * o, |channels, packed| {
                for o_i in 0..o {
                    let weight = &weight[(o_i * c + channels.start) * taps..];
                    for y in 0..count[0] {
                        for x in 0..count[1] {
                            // Backwards, so that the pixels gathered lie in their order.
                            let kernel_y = first[0] + down * (count[0] - 1 - y);
                            let kernel_x = first[1] + right * (count[1] - 1 - x);
                            let tap = kernel_y * shape.kernel[1] + kernel_x;
                            let at = ((y * count[1] + x) * o + o_i) * channels.len();
                            let row = &mut packed[at..at + channels.len()];
                            for (i, packed) in row.iter_mut().enumerate() {
                                *packed = weight[i * taps + tap];
                            }
                        }
                    }
                }
            });
            (first[0], first[1], count, packed)
        })
        .collect();
    let picture = Picture { input: grad_out.into(), height, width, channels: o };
    let depth = taps.div_ceil(down * right) * o;
    let pixels = (SHARE / depth).clamp(16, 256) * down * right;
    let each = (pixels / shape.width).max(1).next_multiple_of(down);
    let blocks = blocks(shape.batch, shape.height, each);
    let parts = split(grad_x, blocks.iter().map(|block| block.len() * shape.width * c));
    blocks.into_par_iter().zip(parts).for_each(|(Block { images, rows }, grad_x)| {
        for (y_phase, x_phase, count, weight) in &phases {
            let of = |i: usize, x: usize| (x + shape.padding[i]) % shape.stride[i];
            let ys: Vec<usize> = rows.clone().filter(|y| of(0, *y) == *y_phase).collect();
            let xs: Vec<usize> = (0..shape.width).filter(|x| of(1, *x) == *x_phase).collect();
            let places = || {
                let all = images.clone().flat_map(|image| ys.iter().map(move |y| (image, *y)));
                all.flat_map(|(image, y)| xs.iter().map(move |x| (image, y, *x)))
            };
            let row = |(image, y, x): (usize, usize, usize)| {
                (((image - images.start) * rows.len() + y - rows.start) * shape.width + x) * c
            };
            let here = images.len() * ys.len() * xs.len();
            if weight.depth == 0 || here == 0 {
                places().for_each(|place| grad_x[row(place)..][..c].fill(0.0));
                continue;
            }
            let mut gathered = Buffer::any(here * weight.depth);
            for ((image, y, x), gathered) in places().zip(gathered.chunks_exact_mut(weight.depth)) {
                let last = [(y + shape.padding[0]) / down, (x + shape.padding[1]) / right];
                let corner = [0, 1].map(|i| last[i] as isize - count[i] as isize + 1);
                picture.window(image, corner, *count, gathered);
            }
            let mut product = Buffer::any(here * c);
            weight.times(&gathered, here, &mut product, false);
            for (place, product) in places().zip(product.chunks_exact(c)) {
                grad_x[row(place)..][..c].copy_from_slice(product);
            }
        }
    });
}

/// Each few channels of the result by themselves; where those are not enough to share among
/// threads, the pixels in up to 8 pieces whose sums are added in their order.
pub(crate) fn backward_weight(shape: &Shape, x: Input, grad_out: &[f32], grad_weight: &mut [f32]) {
    let (c, o, taps) = (shape.channels, shape.out_channels, shape.taps());
    let depth = taps * c;
    if grad_out.is_empty() || depth == 0 {
        return grad_weight.fill(0.0);
    }
    let picture = shape.picture(x);
    let pixels = grad_out.len() / o;
    let together = shares(o, TOGETHER);
    let each = (SHARE / depth).clamp(16, 512);
    let pieces = (8 / together.len()).clamp(1, pixels.div_ceil(each));
    let pieces = shares(pixels, pixels.div_ceil(pieces));
    let mut sums = Buffer::any(pieces.len() * o * depth);
    let tasks = together.iter().flat_map(|few| pieces.iter().map(move |piece| (few, piece)));
    let parts = split(&mut sums, tasks.clone().map(|(few, _)| few.len() * depth));
    tasks.collect::<Vec<_>>().into_par_iter().zip(parts).for_each(|((few, piece), sum)| {
        let mut rows = Buffer::any(each * depth);
        for share in shares(piece.len(), each) {
            let pixels = piece.start + share.start..piece.start + share.end;
            let rows = if shape.is_pointwise() && x.affine.is_none() {
                &x.x[pixels.start * depth..]
            } else {
                shape.gather(&picture, pixels.clone(), &mut rows);
                &rows[..]
            };
            let grad = &grad_out[pixels.start * o + few.start..];
            let left = Matrix { numbers: grad, down: 1, right: o };
            let right = Matrix { numbers: rows, down: depth, right: 1 };
            let sizes = [few.len(), depth, pixels.len()];
            multiply(sizes, left, right, sum, few.len(), share.start > 0);
        }
    });
    let lens = together.iter().map(|few| few.len() * depth);
    let grads = split(grad_weight, lens.clone());
    let sums = split(&mut sums, lens.map(|len| len * pieces.len()));
    together.par_iter().zip(grads).zip(sums).for_each(|((few, grad), parts)| {
        let mut sum = Buffer::any(grad.len());
        add_up(parts, &mut sum);
        turn([few.len(), c, taps], |to, from| grad[to] = sum[from]);
    });
}

/// Calls `pair` with the places of each number in `[few][c][taps]` and in `[taps][c][few]`, a few
/// rows of both at a time, so that what is touched stays in the cache.
#[inline(always)]
fn turn([few, c, taps]: [usize; 3], mut pair: impl FnMut(usize, usize)) {
    for rows in shares(few, 16) {
        for channel in 0..c {
            for tap in 0..taps {
                for row in rows.clone() {
                    pair((row * c + channel) * taps + tap, (tap * c + channel) * few + row);
                }
            }
        }
    }
}
