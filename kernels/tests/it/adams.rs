//! Adam and AdamW against their formulas.

use pmp_kernels::adam::{Step, sum_of_squares};

use crate::naive::{numbers, off, same_bits};

/// Weights after some steps, by the formula in f64.
fn formula(step: &Step, steps: u64, start: &[f32], grads: &[Vec<f32>]) -> Vec<f64> {
    let mut weights: Vec<f64> = start.iter().map(|w| f64::from(*w)).collect();
    let [beta1, beta2] = step.betas;
    for (i, weight) in weights.iter_mut().enumerate() {
        let (mut m, mut v) = (0.0, 0.0);
        for t in 1..=steps {
            let mut grad = f64::from(grads[t as usize - 1][i]) * step.grad_scale;
            if step.decoupled {
                *weight -= step.lr * step.weight_decay * *weight;
            } else {
                grad += step.weight_decay * *weight;
            }
            m = beta1 * m + (1.0 - beta1) * grad;
            v = beta2 * v + (1.0 - beta2) * grad * grad;
            let unbiased = |x: f64, beta: f64| x / (1.0 - beta.powi(t as i32));
            *weight -= step.lr * unbiased(m, beta1) / (unbiased(v, beta2).sqrt() + step.eps);
        }
    }
    weights
}

fn ours(step: &Step, steps: u64, start: &[f32], grads: &[Vec<f32>]) -> Vec<f32> {
    let mut weights = start.to_vec();
    let (mut first, mut second) = (vec![0.0; start.len()], vec![0.0; start.len()]);
    for t in 1..=steps {
        let grad = &grads[t as usize - 1];
        Step { number: t, ..*step }.take(&mut weights, grad, &mut first, &mut second);
    }
    weights
}

#[test]
fn steps_are_those_of_the_formula() {
    let start = numbers(1, 40_003);
    let grads: Vec<Vec<f32>> = (0..5).map(|t| numbers(10 + t, start.len())).collect();
    for decoupled in [false, true] {
        for weight_decay in [0.0, 0.1] {
            let step =
                Step { lr: 0.01, decoupled, weight_decay, grad_scale: 0.3, ..Step::default() };
            let (got, want) = (ours(&step, 5, &start, &grads), formula(&step, 5, &start, &grads));
            assert!(off(&got, &want) < 1e-6, "{step:?}");
            let moved = off(&start, &want);
            assert!(moved > 0.01, "the steps move something: {moved}");
        }
    }
    same_bits(|| ours(&Step::default(), 5, &start, &grads));
}

#[test]
fn squares_are_added_whole() {
    for len in [0, 1, 15, 64, 16_384, 50_001] {
        let x = numbers(len as u64, len);
        let want: f64 = x.iter().map(|x| f64::from(*x).powi(2)).sum();
        assert!((sum_of_squares(&x) - want).abs() <= 1e-6 * want, "{len}");
        same_bits(|| vec![sum_of_squares(&x) as f32]);
    }
    assert!(!sum_of_squares(&[1.0, f32::NAN]).is_finite());
    assert!(!sum_of_squares(&[1.0, f32::INFINITY]).is_finite());
}
