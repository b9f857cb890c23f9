//! Batch norm with residual and ReLU, forwards and backwards.

use pmp_kernels::norm::{self, Backward, Gate, Map, Moments, Residual, apply};
use proptest::prelude::*;

use crate::naive::{numbers, off, same_bits};

const EPS: f64 = 1e-5;

/// A batch: channels, pixels, and the numbers of everything.
struct Case {
    c: usize,
    n: usize,
    x: Vec<f32>,
    residual: Vec<f32>,
    scale: Vec<f32>,
    shift: Vec<f32>,
    grad: Vec<f32>,
}

fn case(c: usize, n: usize, seed: u64) -> Case {
    let offset = |x: &f32| 3.0 + 0.5 * x; // a mean well away from 0
    Case {
        c,
        n,
        x: numbers(seed, n * c).iter().map(offset).collect(),
        residual: numbers(seed ^ 1, n * c),
        scale: numbers(seed ^ 2, c),
        shift: numbers(seed ^ 3, c),
        grad: numbers(seed ^ 4, n * c),
    }
}

impl Case {
    /// `relu(norm(x) + residual)` by definition, from any input; the mean and variance.
    fn forward(&self, x: &[f64], residual: bool, relu: bool) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let of = |channel: usize| x.iter().skip(channel).step_by(self.c);
        let n = self.n as f64;
        let mean: Vec<f64> = (0..self.c).map(|c| of(c).sum::<f64>() / n).collect();
        let squares = |c: usize| of(c).map(|x| (x - mean[c]).powi(2)).sum::<f64>();
        let variance: Vec<f64> = (0..self.c).map(|c| squares(c) / n).collect();
        let out = x.iter().enumerate().map(|(i, x)| {
            let c = i % self.c;
            let unit = (x - mean[c]) / (variance[c] + EPS).sqrt();
            let added = if residual { f64::from(self.residual[i]) } else { 0.0 };
            let sum = unit * f64::from(self.scale[c]) + f64::from(self.shift[c]) + added;
            if relu { sum.max(0.0) } else { sum }
        });
        (out.collect(), mean, variance)
    }

    fn wide(&self) -> Vec<f64> {
        self.x.iter().map(|x| f64::from(*x)).collect()
    }

    fn ours(&self, residual: bool, relu: bool) -> (Moments, Map, Vec<f32>) {
        let moments = Moments::of(self.c, &self.x);
        let map = moments.map(&self.scale, &self.shift, EPS);
        let mut out = vec![f32::NAN; self.x.len()];
        let residual = residual.then_some(Residual { x: &self.residual, affine: None });
        apply(&self.x, map.as_affine(), residual, relu, &mut out);
        (moments, map, out)
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..Default::default() })]

    #[test]
    fn norm_is_that_of_the_definition(
        c in prop_oneof![1..20usize, 60..70usize, Just(130)], n in 2..400usize,
        residual: bool, relu: bool, seed: u64,
    ) {
        let case = case(c, n, seed);
        let (want, mean, variance) = case.forward(&case.wide(), residual, relu);
        let (moments, _, out) = case.ours(residual, relu);
        prop_assert!(off(&moments.mean, &mean) < 1e-5);
        prop_assert!(off(&moments.variance, &variance) < 1e-5);
        prop_assert!(off(&out, &want) < 2e-5, "{:e}", off(&out, &want));
    }

    #[test]
    fn gradients_are_finite_differences(
        c in 1..5usize, n in 6..40usize, residual: bool, relu: bool, in_place: bool, seed: u64,
    ) {
        let case = case(c, n, seed);
        let (moments, map, out) = case.ours(residual, relu);
        let gate = match (relu, residual || in_place) {
            (false, _) => Gate::Open,
            (true, true) => Gate::Output(&out),
            (true, false) => Gate::Map(map.as_affine()),
        };
        let mut grad = case.grad.clone();
        let back = Backward::sums(&case.x, &moments, true, &case.scale, EPS, gate, &mut grad);
        let mut grad_x = grad.clone();
        back.input(&case.x, (!in_place).then_some(&grad), &mut grad_x);

        let loss = |case: &Case, x: &[f64]| {
            let (out, ..) = case.forward(x, residual, relu);
            out.iter().zip(&case.grad).map(|(out, grad)| out * f64::from(*grad)).sum::<f64>()
        };
        let step = 1e-6;
        let differences: Vec<f64> = (0..case.x.len()).map(|i| {
            let moved = |by: f64| {
                let mut x = case.wide();
                x[i] += by;
                loss(&case, &x)
            };
            (moved(step) - moved(-step)) / (2.0 * step)
        }).collect();
        // A number that the ReLU is about to let through makes a corner: leave such cases out.
        let (sums, ..) = case.forward(&case.wide(), residual, false);
        prop_assume!(!relu || sums.iter().all(|sum| sum.abs() > 1e-4));
        prop_assert!(off(&grad_x, &differences) < 1e-3, "{:e}", off(&grad_x, &differences));

        let (x, ..) = case.forward(&case.wide(), residual, relu);
        let open = |i: usize| !relu || x[i] > 0.0;
        let mut of_shift = vec![0.0; c];
        for (i, grad) in case.grad.iter().enumerate().filter(|(i, _)| open(*i)) {
            of_shift[i % c] += f64::from(*grad);
        }
        prop_assert!(off(&back.grad_shift, &of_shift) < 1e-5);
        let (_, mean, variance) = case.forward(&case.wide(), false, false);
        let mut of_scale = vec![0.0; c];
        for (i, grad) in case.grad.iter().enumerate().filter(|(i, _)| open(*i)) {
            let unit = (f64::from(case.x[i]) - mean[i % c]) / (variance[i % c] + EPS).sqrt();
            of_scale[i % c] += f64::from(*grad) * unit;
        }
        prop_assert!(off(&back.grad_scale, &of_scale) < 1e-4);
    }
}

#[test]
fn norm_has_the_same_bits_on_any_number_of_threads() {
    for (c, n) in [(16, 20_000), (64, 3_000), (7, 9_999)] {
        let case = case(c, n, 5);
        same_bits(|| {
            let (moments, map, out) = case.ours(true, true);
            [moments.mean, moments.variance, map.scale, map.shift, out].concat()
        });
        same_bits(|| {
            let (moments, _, out) = case.ours(true, true);
            let mut grad = case.grad.clone();
            let gate = Gate::Output(&out);
            let back = Backward::sums(&case.x, &moments, true, &case.scale, EPS, gate, &mut grad);
            let mut grad_x = vec![0.0; grad.len()];
            back.input(&case.x, Some(&grad), &mut grad_x);
            [back.grad_scale, back.grad_shift, grad, grad_x].concat()
        });
    }
}

#[test]
fn addition_is_of_each_number_and_has_the_same_bits_on_any_number_of_threads() {
    let (x, sum) = (numbers(1, 100_003), numbers(2, 100_003)); // several pieces, the last not full
    same_bits(|| {
        let mut sum = sum.clone();
        norm::add(&x, &mut sum);
        sum
    });
    let mut added = sum.clone();
    norm::add(&x, &mut added);
    assert!(added.iter().zip(x.iter().zip(&sum)).all(|(added, (x, sum))| *added == x + sum));
}

#[test]
fn variance_far_from_zero_keeps_its_digits() {
    let x: Vec<f32> = numbers(1, 100_000).iter().map(|x| 1000.0 + x).collect();
    let wide: Vec<f64> = x.iter().map(|x| f64::from(*x)).collect();
    let mean = wide.iter().sum::<f64>() / wide.len() as f64;
    let variance = wide.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / wide.len() as f64;
    let moments = Moments::of(1, &x);
    assert!((f64::from(moments.variance[0]) / variance - 1.0).abs() < 1e-4, "{moments:?}");
}

#[test]
fn residual_that_is_mapped_while_read_is_the_mapped_residual() {
    let case = case(20, 100, 9);
    let (_, map, _) = case.ours(false, false);
    let own = Map { scale: numbers(7, 20), shift: numbers(8, 20) };
    let mut written = vec![0.0; case.x.len()];
    apply(&case.residual, own.as_affine(), None, false, &mut written);
    let (mut one, mut two) = (written.clone(), written.clone());
    let residual = Residual { x: &written, affine: None };
    apply(&case.x, map.as_affine(), Some(residual), true, &mut one);
    let residual = Residual { x: &case.residual, affine: Some(own.as_affine()) };
    apply(&case.x, map.as_affine(), Some(residual), true, &mut two);
    assert_eq!(one, two);
}
