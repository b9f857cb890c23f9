//! One step of Adam or AdamW, as PyTorch computes it, in one pass over memory.

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use crate::simd::{load, store, widest};

/// Numbers of a share.
const SHARE: usize = 1 << 14;

/// A step, the same for all parameters.
///
/// Adam: Kingma & Ba, 2015, arXiv:1412.6980; AdamW: Loshchilov & Hutter, 2019, arXiv:1711.05101.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// This one's number; the first is 1.
    pub number: u64,
    pub lr: f64,
    /// Decay of the first and second moment.
    pub betas: [f64; 2],
    /// Added to the root of the second moment.
    pub eps: f64,
    /// Adam adds this share of the weights to the gradient; AdamW takes it, times `lr`, off the
    /// weights.
    pub weight_decay: f64,
    /// Whether it is AdamW.
    pub decoupled: bool,
    /// What the gradient is multiplied with first, to clip it or to take a mean.
    pub grad_scale: f64,
}

impl Default for Step {
    /// PyTorch's defaults of Adam, the first step.
    fn default() -> Self {
        Self {
            number: 1,
            lr: 1e-3,
            betas: [0.9, 0.999],
            eps: 1e-8,
            weight_decay: 0.0,
            decoupled: false,
            grad_scale: 1.0,
        }
    }
}

impl Step {
    /// Move `weights` against `grad`; `first` and `second` are their moments, 0 before the first
    /// step.
    ///
    /// # Panics
    ///
    /// If lengths disagree.
    pub fn take(&self, weights: &mut [f32], grad: &[f32], first: &mut [f32], second: &mut [f32]) {
        let len = weights.len();
        assert_eq!([grad.len(), first.len(), second.len()], [len; 3], "a moment for each weight");
        let shares = weights.par_chunks_mut(SHARE).zip(grad.par_chunks(SHARE));
        let shares = shares.zip(first.par_chunks_mut(SHARE)).zip(second.par_chunks_mut(SHARE));
        shares.for_each(|(((weights, grad), first), second)| {
            widest(Share { step: self, weights, grad, first, second });
        });
    }
}

struct Share<'a> {
    step: &'a Step,
    weights: &'a mut [f32],
    grad: &'a [f32],
    first: &'a mut [f32],
    second: &'a mut [f32],
}

impl WithSimd for Share<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { step, weights, grad, first, second } = self;
        let all = |value: f64| simd.splat_f32s(value as f32);
        let [beta1, beta2] = step.betas;
        let [bias1, bias2] = step.betas.map(|beta| 1.0 - beta.powf(step.number as f64));
        let (old1, new1, old2, new2) = (all(beta1), all(1.0 - beta1), all(beta2), all(1.0 - beta2));
        let (root, eps) = (all(1.0 / bias2.sqrt()), all(step.eps));
        let (scale, stride) = (all(step.grad_scale), all(-step.lr / bias1));
        let (kept, added) = match step.decoupled {
            true => (all(1.0 - step.lr * step.weight_decay), all(0.0)),
            false => (all(1.0), all(step.weight_decay)),
        };
        for at in (0..weights.len()).step_by(S::F32_LANES) {
            let weight = load(simd, weights, at);
            let grad = simd.mul_f32s(load(simd, grad, at), scale);
            let grad = simd.mul_add_f32s(weight, added, grad);
            let m = simd.mul_f32s(load(simd, first, at), old1);
            let m = simd.mul_add_f32s(grad, new1, m);
            let v = simd.mul_f32s(load(simd, second, at), old2);
            let v = simd.mul_add_f32s(simd.mul_f32s(grad, grad), new2, v);
            let size = simd.mul_add_f32s(simd.sqrt_f32s(v), root, eps);
            let weight = simd.mul_f32s(weight, kept);
            let weight = simd.mul_add_f32s(simd.div_f32s(m, size), stride, weight);
            store(simd, first, at, m);
            store(simd, second, at, v);
            store(simd, weights, at, weight);
        }
    }
}

/// The sum of squares, in shares that are added in their order: not finite if any number is not.
pub fn sum_of_squares(x: &[f32]) -> f64 {
    let shares: Vec<f64> = x.par_chunks(SHARE).map(|x| widest(Squares(x))).collect();
    shares.iter().sum()
}

struct Squares<'a>(&'a [f32]);

impl WithSimd for Squares<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        const HELD: usize = 4;
        let mut sums = [simd.splat_f32s(0.0); HELD];
        for x in self.0.chunks(HELD * S::F32_LANES) {
            for (sum, at) in sums.iter_mut().zip((0..x.len()).step_by(S::F32_LANES)) {
                let x = load(simd, x, at);
                *sum = simd.mul_add_f32s(x, x, *sum);
            }
        }
        sums.into_iter().map(|sum| f64::from(simd.reduce_sum_f32s(sum))).sum()
    }
}
