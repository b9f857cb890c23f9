//! Batch norm, with the addition of a residual and a ReLU in the same pass.
//!
//! In training: [`Moments::of`] the activation, then [`Moments::map`] and [`apply`]; backwards
//! [`Backward::sums`], then [`Backward::input`]. In evaluation the moments are those kept.
//! Activations are `[.., C]`.

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use crate::{
    pieces::shares,
    simd::{load, store, widest},
};

/// Numbers of a piece: a part of a second-level cache.
const PIECE: usize = 1 << 15;

/// Vectors of a row whose sums are held at once.
const HELD: usize = 4;

/// `scale * x + shift`, both `[C]`.
#[derive(Clone, Copy, Debug)]
pub struct Affine<'a> {
    pub scale: &'a [f32],
    pub shift: &'a [f32],
}

/// An [`Affine`] that owns its numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    pub scale: Vec<f32>,
    pub shift: Vec<f32>,
}

impl Map {
    pub fn as_affine(&self) -> Affine<'_> {
        Affine { scale: &self.scale, shift: &self.shift }
    }
}

/// Mean and variance of each channel, `[C]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Moments {
    pub mean: Vec<f32>,
    /// Biased: divided by the number of pixels.
    pub variance: Vec<f32>,
}

impl Moments {
    /// Of an activation `[.., C]`.
    ///
    /// # Panics
    ///
    /// If `x` is empty or not made of whole pixels.
    pub fn of(channels: usize, x: &[f32]) -> Self {
        let rows = Rows::new(channels, x.len());
        let parts: Vec<(usize, Vec<f32>, Vec<f32>)> = rows
            .pieces()
            .into_par_iter()
            .map(|piece| {
                let x = &x[piece];
                let count = x.len() / channels;
                let mut mean = rows.sums(Sum::Plain, x, x);
                mean.iter_mut().for_each(|mean| *mean /= count as f32);
                let squares = rows.sums(Sum::Squares(&rows.repeat(&mean)), x, x);
                (count, mean, squares)
            })
            .collect();
        let (mut mean, mut variance) = (vec![], vec![]);
        let all = (x.len() / channels) as f64;
        for channel in 0..channels {
            let of = |part: &(usize, Vec<f32>, Vec<f32>)| {
                (part.0 as f64, f64::from(part.1[channel]), f64::from(part.2[channel]))
            };
            let whole: f64 = parts.iter().map(of).map(|(count, mean, _)| count * mean).sum();
            let whole = whole / all;
            let squares = parts.iter().map(of).map(|(count, mean, squares)| {
                let off = mean - whole;
                squares + count * off * off
            });
            variance.push((squares.sum::<f64>() / all) as f32);
            mean.push(whole as f32);
        }
        Self { mean, variance }
    }

    /// What normalises with these moments: `scale (x - mean) / sqrt(variance + eps) + shift`.
    pub fn map(&self, scale: &[f32], shift: &[f32], eps: f64) -> Map {
        let slope = |(scale, deviation): (&f32, f64)| (f64::from(*scale) / deviation) as f32;
        let scale: Vec<f32> = scale.iter().zip(self.deviations(eps)).map(slope).collect();
        let shift = scale.iter().zip(&self.mean).zip(shift);
        let shift = shift.map(|((scale, mean), shift)| {
            (f64::from(*shift) - f64::from(*scale) * f64::from(*mean)) as f32
        });
        Map { shift: shift.collect(), scale }
    }

    fn deviations(&self, eps: f64) -> impl Iterator<Item = f64> {
        self.variance.iter().map(move |variance| (f64::from(*variance) + eps).sqrt())
    }

    /// Move these, kept from step to step, towards those of a batch of `pixels`: by `momentum`,
    /// the variance of the batch made unbiased, as PyTorch does.
    pub fn follow(&mut self, batch: &Moments, pixels: usize, momentum: f64) {
        let unbiased = pixels as f64 / (pixels as f64 - 1.0).max(1.0);
        let step = |kept: &mut Vec<f32>, new: &[f32], factor: f64| {
            for (kept, new) in kept.iter_mut().zip(new) {
                let (old, new) = (f64::from(*kept), f64::from(*new) * factor);
                *kept = ((1.0 - momentum) * old + momentum * new) as f32;
            }
        };
        step(&mut self.mean, &batch.mean, 1.0);
        step(&mut self.variance, &batch.variance, unbiased);
    }
}

/// What is added before the ReLU.
#[derive(Clone, Copy, Debug)]
pub struct Residual<'a> {
    pub x: &'a [f32],
    /// Done to it first.
    pub affine: Option<Affine<'a>>,
}

/// `out = relu(map(x) + residual)`, without the ReLU if not `relu`.
///
/// # Panics
///
/// If lengths disagree.
pub fn apply(x: &[f32], map: Affine, residual: Option<Residual>, relu: bool, out: &mut [f32]) {
    assert_eq!(x.len(), out.len(), "results of the input's length");
    assert!(residual.is_none_or(|residual| residual.x.len() == x.len()), "residual's length");
    let rows = Rows::new(map.scale.len(), x.len());
    let (scale, shift) = (rows.repeat(map.scale), rows.repeat(map.shift));
    let map = Affine { scale: &scale, shift: &shift };
    let own = residual.and_then(|residual| residual.affine);
    let own = own.map(|own| (rows.repeat(own.scale), rows.repeat(own.shift)));
    let own = own.as_ref().map(|(scale, shift)| Affine { scale, shift });
    out.par_chunks_mut(rows.piece()).enumerate().for_each(|(i, out)| {
        let here = i * rows.piece()..i * rows.piece() + out.len();
        let added = residual.map(|residual| &residual.x[here.clone()]);
        widest(Apply { width: rows.width, x: &x[here], map, added, own, relu, out });
    });
}

/// Where the gradient passes a ReLU.
#[derive(Clone, Copy, Debug)]
pub enum Gate<'a> {
    /// There is no ReLU.
    Open,
    /// Where this, what came out of the ReLU, is above 0.
    Output(&'a [f32]),
    /// Where this map of the input is above 0: what came out of the ReLU was not kept.
    Map(Affine<'a>),
}

/// The backward pass of a norm: sums over the batch first, then the input's gradient.
#[derive(Clone, Debug)]
pub struct Backward {
    /// `[C]`.
    pub grad_scale: Vec<f32>,
    /// `[C]`.
    pub grad_shift: Vec<f32>,
    /// The input's gradient is `of_grad * gated gradient + of_input * input + constant`.
    of_grad: Vec<f32>,
    of_input: Vec<f32>,
    constant: Vec<f32>,
}

impl Backward {
    /// Close the gate in `grad` `[.., C]`, and take the sums of it.
    ///
    /// `moments` are those of the batch `x` (in evaluation, where they do not depend on the batch,
    /// `batch` is false) and `scale` `[C]` the factor of the forward pass.
    ///
    /// # Panics
    ///
    /// If lengths disagree or are 0.
    pub fn sums(
        x: &[f32],
        moments: &Moments,
        batch: bool,
        scale: &[f32],
        eps: f64,
        gate: Gate,
        grad: &mut [f32],
    ) -> Self {
        assert_eq!(x.len(), grad.len(), "the gradient has the input's length");
        let rows = Rows::new(scale.len(), x.len());
        if let Gate::Output(out) = gate {
            assert_eq!(x.len(), out.len(), "the output has the input's length");
        }
        let map = match gate {
            Gate::Map(map) => Some((rows.repeat(map.scale), rows.repeat(map.shift))),
            _ => None,
        };
        let mean = rows.repeat(&moments.mean);
        let parts: Vec<(Vec<f32>, Vec<f32>)> = grad
            .par_chunks_mut(rows.piece())
            .enumerate()
            .map(|(i, grad)| {
                let here = i * rows.piece()..i * rows.piece() + grad.len();
                let x = &x[here.clone()];
                match (gate, &map) {
                    (Gate::Output(out), _) => close(grad, &out[here]),
                    (_, Some((scale, shift))) => {
                        let map = Affine { scale, shift };
                        widest(CloseByMap { width: rows.width, x, map, grad });
                    }
                    _ => {}
                }
                (rows.sums(Sum::Plain, grad, grad), rows.sums(Sum::Products(&mean), x, grad))
            })
            .collect();
        let total = |channel: usize| {
            let wide = parts
                .iter()
                .map(|(plain, products)| (f64::from(plain[channel]), f64::from(products[channel])));
            wide.fold((0.0, 0.0), |sum, part| (sum.0 + part.0, sum.1 + part.1))
        };
        let count = (x.len() / scale.len()) as f64;
        let mut back = Self {
            grad_scale: vec![],
            grad_shift: vec![],
            of_grad: vec![],
            of_input: vec![],
            constant: vec![],
        };
        for (channel, deviation) in moments.deviations(eps).enumerate() {
            let (shift, products) = total(channel);
            let products = products / deviation;
            let of_grad = f64::from(scale[channel]) / deviation;
            let of_input = if batch { -of_grad * products / deviation / count } else { 0.0 };
            let mean = if batch { -of_grad * shift / count } else { 0.0 };
            back.grad_shift.push(shift as f32);
            back.grad_scale.push(products as f32);
            back.of_grad.push(of_grad as f32);
            back.of_input.push(of_input as f32);
            back.constant.push((mean - of_input * f64::from(moments.mean[channel])) as f32);
        }
        back
    }

    /// The gradient of the input `x`. `grad` is the gradient with its gate closed; without it,
    /// that is in `grad_x`, and replaced there.
    ///
    /// # Panics
    ///
    /// If lengths disagree.
    pub fn input(&self, x: &[f32], grad: Option<&[f32]>, grad_x: &mut [f32]) {
        assert_eq!(x.len(), grad_x.len(), "the gradient has the input's length");
        assert!(grad.is_none_or(|grad| grad.len() == x.len()), "the gradient's length");
        let rows = Rows::new(self.of_grad.len(), x.len());
        let factors = [&self.of_grad, &self.of_input, &self.constant].map(|f| rows.repeat(f));
        grad_x.par_chunks_mut(rows.piece()).enumerate().for_each(|(i, grad_x)| {
            let here = i * rows.piece()..i * rows.piece() + grad_x.len();
            let grad = grad.map(|grad| &grad[here.clone()]);
            widest(Combine { width: rows.width, factors: &factors, x: &x[here], grad, grad_x });
        });
    }
}

/// `sum += x`.
///
/// # Panics
///
/// If lengths disagree.
pub fn add(x: &[f32], sum: &mut [f32]) {
    assert_eq!(x.len(), sum.len(), "as many numbers");
    sum.par_chunks_mut(PIECE).zip(x.par_chunks(PIECE)).for_each(|(sum, x)| {
        sum.iter_mut().zip(x).for_each(|(sum, x)| *sum += x);
    });
}

/// No gradient where nothing came out of the ReLU.
fn close(grad: &mut [f32], out: &[f32]) {
    widest(Close { grad, out });
}

/// An activation as rows of some pixels, so that a row is as wide as some vectors.
struct Rows {
    channels: usize,
    /// Numbers of a row.
    width: usize,
    len: usize,
}

impl Rows {
    fn new(channels: usize, len: usize) -> Self {
        assert!(len > 0 && len.is_multiple_of(channels), "whole pixels, and some");
        let pixels = if channels >= 64 { 1 } else { 64 / channels };
        Self { channels, width: channels * pixels, len }
    }

    /// Numbers of a piece: whole rows.
    fn piece(&self) -> usize {
        PIECE.div_ceil(self.width) * self.width
    }

    fn pieces(&self) -> Vec<std::ops::Range<usize>> {
        shares(self.len, self.piece())
    }

    /// A number for each of a row.
    fn repeat(&self, per_channel: &[f32]) -> Vec<f32> {
        assert_eq!(per_channel.len(), self.channels, "a number for each channel");
        per_channel.repeat(self.width / self.channels)
    }

    /// Sums over the pixels of a piece, for each channel.
    fn sums(&self, what: Sum, x: &[f32], grad: &[f32]) -> Vec<f32> {
        let mut wide = vec![0.0; self.width];
        widest(Sums { width: self.width, what, x, grad, sums: &mut wide });
        let (sums, rest) = wide.split_at_mut(self.channels);
        for pixel in rest.chunks_exact(self.channels) {
            sums.iter_mut().zip(pixel).for_each(|(sum, x)| *sum += x);
        }
        wide.truncate(self.channels);
        wide
    }
}

/// What is summed.
#[derive(Clone, Copy)]
enum Sum<'a> {
    /// `x`.
    Plain,
    /// `(x - mean)^2`.
    Squares(&'a [f32]),
    /// `(x - mean) grad`.
    Products(&'a [f32]),
}

struct Sums<'a> {
    width: usize,
    what: Sum<'a>,
    x: &'a [f32],
    grad: &'a [f32],
    sums: &'a mut [f32],
}

impl WithSimd for Sums<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { width, what, x, grad, sums } = self;
        match what {
            Sum::Plain => {
                columns(simd, width, x, grad, None, sums, |_, x, _, sum| simd.add_f32s(sum, x))
            }
            Sum::Squares(mean) => {
                columns(simd, width, x, grad, Some(mean), sums, |mean, x, _, sum| {
                    let off = simd.sub_f32s(x, mean);
                    simd.mul_add_f32s(off, off, sum)
                })
            }
            Sum::Products(mean) => {
                columns(simd, width, x, grad, Some(mean), sums, |mean, x, grad, sum| {
                    simd.mul_add_f32s(simd.sub_f32s(x, mean), grad, sum)
                });
            }
        }
    }
}

/// Fold rows into `sums`, a few vectors of columns at a time. The last row may be cut short.
#[inline(always)]
fn columns<S: Simd>(
    simd: S,
    width: usize,
    x: &[f32],
    grad: &[f32],
    mean: Option<&[f32]>,
    sums: &mut [f32],
    fold: impl Fn(S::f32s, S::f32s, S::f32s, S::f32s) -> S::f32s,
) {
    let whole = x.len() / width * width;
    let zero = simd.splat_f32s(0.0);
    for first in (0..width).step_by(HELD * S::F32_LANES) {
        let held = (width - first).min(HELD * S::F32_LANES);
        let mut means = [zero; HELD];
        if let Some(mean) = mean {
            for (i, at) in (0..held).step_by(S::F32_LANES).enumerate() {
                means[i] = load(simd, mean, first + at);
            }
        }
        let mut sum = [zero; HELD];
        let rows = x[..whole].chunks_exact(width).zip(grad[..whole].chunks_exact(width));
        if held == HELD * S::F32_LANES {
            for (x, grad) in rows {
                let x = S::as_simd_f32s(&x[first..first + held]).0;
                let grad = S::as_simd_f32s(&grad[first..first + held]).0;
                for i in 0..HELD {
                    sum[i] = fold(means[i], x[i], grad[i], sum[i]);
                }
            }
        } else {
            for (x, grad) in rows {
                for (i, at) in (0..held).step_by(S::F32_LANES).enumerate() {
                    let (x, grad) = (load(simd, x, first + at), load(simd, grad, first + at));
                    sum[i] = fold(means[i], x, grad, sum[i]);
                }
            }
        }
        for (i, at) in (0..held).step_by(S::F32_LANES).enumerate() {
            store(simd, sums, first + at, sum[i]);
        }
    }
    // What is left of a row is folded number by number, in the first lane.
    for (at, (x, grad)) in x[whole..].iter().zip(&grad[whole..]).enumerate() {
        let lane = |x: f32| simd.splat_f32s(x);
        let mean = mean.map_or(0.0, |mean| mean[at]);
        let sum = fold(lane(mean), lane(*x), lane(*grad), lane(sums[at]));
        store(simd, &mut sums[at..=at], 0, sum);
    }
}

struct Apply<'a> {
    width: usize,
    x: &'a [f32],
    map: Affine<'a>,
    added: Option<&'a [f32]>,
    own: Option<Affine<'a>>,
    relu: bool,
    out: &'a mut [f32],
}

impl WithSimd for Apply<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { width, x, map, added, own, relu, out } = self;
        let least = simd.splat_f32s(if relu { 0.0 } else { f32::NEG_INFINITY });
        let line = |map: Affine, x, at| {
            simd.mul_add_f32s(x, load(simd, map.scale, at), load(simd, map.shift, at))
        };
        for (row, out) in out.chunks_mut(width).enumerate() {
            let here = row * width..row * width + out.len();
            let x = &x[here.clone()];
            match (added, own) {
                (None, _) => {
                    for at in (0..out.len()).step_by(S::F32_LANES) {
                        let value = line(map, load(simd, x, at), at);
                        store(simd, out, at, simd.max_f32s(value, least));
                    }
                }
                (Some(added), None) => {
                    let added = &added[here];
                    for at in (0..out.len()).step_by(S::F32_LANES) {
                        let value = line(map, load(simd, x, at), at);
                        let value = simd.add_f32s(value, load(simd, added, at));
                        store(simd, out, at, simd.max_f32s(value, least));
                    }
                }
                (Some(added), Some(own)) => {
                    let added = &added[here];
                    for at in (0..out.len()).step_by(S::F32_LANES) {
                        let value = line(map, load(simd, x, at), at);
                        let value = simd.add_f32s(value, line(own, load(simd, added, at), at));
                        store(simd, out, at, simd.max_f32s(value, least));
                    }
                }
            }
        }
    }
}

struct Close<'a> {
    grad: &'a mut [f32],
    out: &'a [f32],
}

impl WithSimd for Close<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let zero = simd.splat_f32s(0.0);
        for at in (0..self.grad.len()).step_by(S::F32_LANES) {
            let open = simd.less_than_f32s(zero, load(simd, self.out, at));
            let grad = simd.select_f32s(open, load(simd, self.grad, at), zero);
            store(simd, self.grad, at, grad);
        }
    }
}

struct CloseByMap<'a> {
    width: usize,
    x: &'a [f32],
    map: Affine<'a>,
    grad: &'a mut [f32],
}

impl WithSimd for CloseByMap<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { width, x, map, grad } = self;
        let zero = simd.splat_f32s(0.0);
        for (x, grad) in x.chunks(width).zip(grad.chunks_mut(width)) {
            for at in (0..grad.len()).step_by(S::F32_LANES) {
                let (scale, shift) = (load(simd, map.scale, at), load(simd, map.shift, at));
                let out = simd.mul_add_f32s(load(simd, x, at), scale, shift);
                let open = simd.less_than_f32s(zero, out);
                store(simd, grad, at, simd.select_f32s(open, load(simd, grad, at), zero));
            }
        }
    }
}

struct Combine<'a> {
    width: usize,
    factors: &'a [Vec<f32>; 3],
    x: &'a [f32],
    grad: Option<&'a [f32]>,
    grad_x: &'a mut [f32],
}

impl WithSimd for Combine<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { width, factors: [of_grad, of_input, constant], x, grad, grad_x } = self;
        for (row, (x, grad_x)) in x.chunks(width).zip(grad_x.chunks_mut(width)).enumerate() {
            let grad = grad.map(|grad| &grad[row * width..][..x.len()]);
            for at in (0..x.len()).step_by(S::F32_LANES) {
                let value = match grad {
                    Some(grad) => load(simd, grad, at),
                    None => load(simd, grad_x, at),
                };
                let rest = load(simd, constant, at);
                let rest = simd.mul_add_f32s(load(simd, x, at), load(simd, of_input, at), rest);
                store(simd, grad_x, at, simd.mul_add_f32s(value, load(simd, of_grad, at), rest));
            }
        }
    }
}
