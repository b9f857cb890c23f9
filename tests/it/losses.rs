//! Both losses and the optimiser against arithmetic done here in f64, and finite differences.

use candle_core::{DType, Device::Cpu, Tensor, Var};
use pmp::{
    error::{Error, Result},
    model::{
        adam::Adam,
        config::Assign,
        gradient::Gradient,
        init::{Weights, kaiming},
        loss::{action_l1, motion_nll},
        mixture::Mixture,
    },
};

/// Numbers without a pattern, in -1 ... 1.
fn noise(count: usize, salt: u64) -> Vec<f64> {
    let mut state = 0x9E37_79B9_7F4A_7C15_u64.wrapping_mul(salt + 1);
    let mut draw = || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    (0..count).map(|_| draw()).collect()
}

fn var(values: Vec<f64>, shape: &[usize]) -> Var {
    Var::from_vec(values, shape, &Cpu).unwrap()
}

fn scalar(t: &Tensor) -> f64 {
    t.to_dtype(DType::F64).unwrap().to_scalar::<f64>().unwrap()
}

/// The gradient of every number of `var` against central differences of `loss`.
pub(crate) fn check_gradient(var: &Var, loss: &dyn Fn() -> Tensor, which: &[usize]) {
    let grads = loss().backward().unwrap();
    let gradient = grads.get(var.as_tensor()).unwrap().flatten_all().unwrap();
    let gradient = gradient.to_vec1::<f64>().unwrap();
    let start = var.flatten_all().unwrap().to_vec1::<f64>().unwrap();
    for &i in which {
        let at = |offset: f64| {
            let mut moved = start.clone();
            moved[i] += offset;
            var.set(&Tensor::from_vec(moved, var.shape(), &Cpu).unwrap()).unwrap();
            scalar(&loss())
        };
        let h = 1e-5;
        let slope = (at(h) - at(-h)) / (2.0 * h);
        at(0.0);
        let tolerance = 1e-6 * (1.0 + slope.abs());
        assert!((gradient[i] - slope).abs() < tolerance, "number {i}: {} {slope}", gradient[i]);
    }
}

struct Case {
    /// Of manoeuvres `[B, K, 1]`, or of a mixture at each step `[B, K, 30]`.
    logits: Var,
    mean: Var,
    log_std: Var,
    target: Tensor,
    valid: Tensor,
}

const B: usize = 4;
const K: usize = 3;

impl Case {
    /// Samples with 30, 7, 1 and 0 valid steps, `weights` a mode.
    fn new(weights: usize) -> Self {
        let wide = |salt| noise(B * K * 60, salt);
        let target: Vec<f64> = noise(B * 60, 4).iter().map(|x| x * 6.0).collect();
        let valid: Vec<f64> = [30, 7, 1, 0]
            .iter()
            .flat_map(|n| (0..30).map(|t| f64::from(u8::from(t < *n))))
            .collect();
        Self {
            logits: var(noise(B * K * weights, 1), &[B, K, weights]),
            mean: var(wide(2), &[B, K, 30, 2]),
            log_std: var(wide(3), &[B, K, 30, 2]),
            target: Tensor::from_vec(target, (B, 30, 2), &Cpu).unwrap(),
            valid: Tensor::from_vec(valid, (B, 30), &Cpu).unwrap(),
        }
    }

    fn mixture(&self) -> Mixture {
        Mixture {
            logits: self.logits.as_tensor().clone(),
            mean: self.mean.as_tensor().clone(),
            log_std: self.log_std.as_tensor().clone(),
        }
    }

    fn loss(&self, assign: Assign) -> Tensor {
        motion_nll(&self.mixture(), &self.target, &self.valid, assign).unwrap()
    }

    /// The definition, number by number, without any trick.
    fn slow(&self, assign: Assign) -> f64 {
        let flat = |t: &Tensor| t.flatten_all().unwrap().to_vec1::<f64>().unwrap();
        let (logits, mean, log_std) = (flat(&self.logits), flat(&self.mean), flat(&self.log_std));
        let (target, valid) = (flat(&self.target), flat(&self.valid));
        let weights = logits.len() / (B * K);
        let weight = |b: usize, k: usize, s: usize| {
            let all: f64 = (0..K).map(|k| logits[(b * K + k) * weights + s].exp()).sum();
            logits[(b * K + k) * weights + s].exp() / all
        };
        // Likelihood of the numbers of some steps in a mode, and how far they are from its means.
        let of_steps = |b: usize, k: usize, steps: &[usize]| {
            let (mut density, mut distance) = (1.0, 0.0);
            for (&t, d) in steps.iter().flat_map(|t| [(t, 0), (t, 1)]) {
                let at = ((b * K + k) * 30 + t) * 2 + d;
                let (x, std) = (target[(b * 30 + t) * 2 + d], log_std[at].exp());
                let off = x / [10.0, 1.0][d] - mean[at];
                density *=
                    (-(off / std).powi(2) / 2.0).exp() / (std * std::f64::consts::TAU.sqrt());
                distance += off * off;
            }
            (density, distance)
        };
        let likelihood = |b: usize, steps: &[usize], s: usize| -> f64 {
            let modes = (0..K).map(|k| (weight(b, k, s), of_steps(b, k, steps)));
            match assign {
                Assign::Soft => modes.map(|(weight, (density, _))| weight * density).sum(),
                Assign::Nearest => {
                    let nearest = modes.min_by(|a, b| a.1.1.total_cmp(&b.1.1)).unwrap();
                    nearest.0 * nearest.1.0
                }
            }
        };
        let (mut sum, mut samples) = (0.0, 0.0);
        for b in 0..B {
            let steps: Vec<usize> = (0..30).filter(|t| valid[b * 30 + t] == 1.0).collect();
            if steps.is_empty() {
                continue;
            }
            let log_likelihood: f64 = match weights {
                1 => likelihood(b, &steps, 0).ln(),
                _ => steps.iter().map(|&t| likelihood(b, &[t], t).ln()).sum(),
            };
            sum -= log_likelihood / (2 * steps.len()) as f64;
            samples += 1.0;
        }
        sum / samples
    }
}

/// Manoeuvres and mixtures at each step, soft and nearest.
fn every_kind() -> impl Iterator<Item = (Case, Assign)> {
    let kinds =
        [(1, Assign::Soft), (1, Assign::Nearest), (30, Assign::Soft), (30, Assign::Nearest)];
    kinds.into_iter().map(|(weights, assign)| (Case::new(weights), assign))
}

#[test]
fn motion_nll_is_the_definition_evaluated_number_by_number() {
    for (case, assign) in every_kind() {
        let (fast, slow) = (scalar(&case.loss(assign)), case.slow(assign));
        assert!((fast - slow).abs() < 1e-12 * slow.abs(), "{assign:?}: {fast} {slow}");
    }
}

#[test]
fn motion_nll_has_the_gradient_of_finite_differences() {
    for (case, assign) in every_kind() {
        let loss = || case.loss(assign);
        let weights = case.logits.elem_count();
        check_gradient(
            &case.logits,
            &loss,
            &(0..weights).step_by(weights / 12).collect::<Vec<_>>(),
        );
        let some: Vec<_> = (0..B * K * 60).step_by(17).collect();
        check_gradient(&case.mean, &loss, &some);
        check_gradient(&case.log_std, &loss, &some);
    }
}

#[test]
fn motion_that_is_certain_and_right_costs_half_of_log_2_pi_per_number() {
    let zero = |shape: &[usize]| Tensor::zeros(shape, DType::F32, &Cpu).unwrap();
    let mean = zero(&[1, 2, 30, 2]);
    let mixture = Mixture { logits: zero(&[1, 2, 1]), mean: mean.clone(), log_std: mean };
    let valid = zero(&[1, 30]).ones_like().unwrap();
    let loss = scalar(&motion_nll(&mixture, &zero(&[1, 30, 2]), &valid, Assign::Soft).unwrap());
    assert!((loss - 0.918_938_533).abs() < 1e-6, "two equal modes are as good as one: {loss}");

    // 20 m/s are 2 units: (2^2 / 2) more for each of the 30 speeds, half of the numbers.
    let fast = Tensor::new(&[20f32, 0.0], &Cpu).unwrap().broadcast_as((1, 30, 2)).unwrap();
    let loss = scalar(&motion_nll(&mixture, &fast, &valid, Assign::Soft).unwrap());
    assert!((loss - 1.918_938_533).abs() < 1e-6, "{loss}");
}

#[test]
fn motion_nll_stays_finite_where_every_mode_is_hopeless() {
    let near = Tensor::full(-4.6f32, (1, 3, 30, 2), &Cpu).unwrap(); // std 0.01
    let logits = Tensor::new(&[[[80f32], [-80.0], [0.0]]], &Cpu).unwrap();
    let mean = Var::zeros((1, 3, 30, 2), DType::F32, &Cpu).unwrap();
    let mixture = Mixture { logits, mean: mean.as_tensor().clone(), log_std: near };
    let target = Tensor::full(50f32, (1, 30, 2), &Cpu).unwrap();
    let valid = Tensor::ones((1, 30), DType::F32, &Cpu).unwrap();
    let loss = motion_nll(&mixture, &target, &valid, Assign::Soft).unwrap();
    assert!(scalar(&loss).is_finite());
    let grads = loss.backward().unwrap();
    let largest = grads.get(mean.as_tensor()).unwrap().abs().unwrap().max_all().unwrap();
    assert!(scalar(&largest).is_finite());
}

#[test]
fn action_l1_is_the_weighted_mean_over_what_is_known() {
    let pred = var(vec![0.5, 0.2, 0.9, -0.5, 0.6, 0.1], &[2, 3]);
    let target = Tensor::new(&[[0.0f64, 0.4, 0.0], [0.5, 0.0, 0.0]], &Cpu).unwrap();
    let known = Tensor::new(&[[1.0f64, 1.0, 0.0], [1.0, 0.0, 0.0]], &Cpu).unwrap();
    let loss = || action_l1(pred.as_tensor(), &target, &known, [0.5, 0.45, 0.05]).unwrap();
    let by_hand = (0.5 * 0.5 + 0.45 * 0.2 + 0.5 * 1.0) / (0.5 + 0.45 + 0.5);
    assert!((scalar(&loss()) - by_hand).abs() < 1e-12);
    check_gradient(&pred, &loss, &[0, 1, 2, 3, 4, 5]);
}

#[test]
fn what_is_masked_has_no_gradient_and_a_batch_of_nothing_costs_nothing() {
    let case = Case::new(1);
    let nothing = case.valid.zeros_like().unwrap();
    let loss = motion_nll(&case.mixture(), &case.target, &nothing, Assign::Soft).unwrap();
    assert_eq!(scalar(&loss), 0.0);
    let grads = loss.backward().unwrap();
    for v in [&case.logits, &case.mean, &case.log_std] {
        let g = grads.get(v.as_tensor()).unwrap().abs().unwrap().max_all().unwrap();
        assert_eq!(scalar(&g), 0.0);
    }
    // A sample with 7 valid steps: nothing after the seventh.
    let grads = case.loss(Assign::Soft).backward().unwrap();
    let g = grads.get(case.mean.as_tensor()).unwrap().narrow(0, 1, 1).unwrap();
    let largest =
        |from, len| scalar(&g.narrow(2, from, len).unwrap().abs().unwrap().max_all().unwrap());
    assert!(largest(6, 1) > 0.0);
    assert_eq!(largest(7, 23), 0.0);

    let pred = var(vec![0.5, 0.2, 0.9], &[1, 3]);
    let zero = Tensor::zeros((1, 3), DType::F64, &Cpu).unwrap();
    let loss = action_l1(pred.as_tensor(), &zero, &zero, [1.0; 3]).unwrap();
    assert_eq!(scalar(&loss), 0.0);
    let g = loss.backward().unwrap();
    assert_eq!(g.get(pred.as_tensor()).unwrap().to_vec2::<f64>().unwrap(), [[0.0; 3]]);
}

fn two_parameters() -> (Weights, [Tensor; 2]) {
    let start = || kaiming(candle_nn::init::NonLinearity::ReLU);
    let network = |vb: candle_nn::VarBuilder| -> Result<[Tensor; 2]> {
        Ok([vb.get_with_hints((2, 3), "b", start())?, vb.get_with_hints((1, 4), "a", start())?])
    };
    Weights::new(5, &Cpu, network).unwrap()
}

#[test]
fn adamw_takes_the_steps_of_its_formula() {
    let (weights, [b, a]) = two_parameters();
    let mut adam = Adam::new(&weights, 0.1).unwrap();
    let flat = |t: &Tensor| -> Vec<f64> {
        let t = t.flatten_all().unwrap().to_dtype(DType::F64).unwrap();
        t.to_vec1().unwrap()
    };
    let mut p: Vec<f64> = [flat(&a), flat(&b)].concat();
    let (mut m, mut v) = (vec![0.0; 10], vec![0.0; 10]);
    for t in 1..=20 {
        // The gradient of sum(c p) is c; its norm is above 1 at times, below at others.
        let c: Vec<f64> = noise(10, t).iter().map(|x| x * f64::from(t as u32) / 10.0).collect();
        let as_tensor = |c: &[f64], like: &Tensor| {
            let c: Vec<f32> = c.iter().map(|x| *x as f32).collect();
            Tensor::from_vec(c, like.shape(), &Cpu).unwrap()
        };
        let loss_a = (&a * as_tensor(&c[..4], &a)).unwrap().sum_all().unwrap();
        let loss_b = (&b * as_tensor(&c[4..], &b)).unwrap().sum_all().unwrap();
        let grads = (loss_a + loss_b).unwrap().backward().unwrap();
        let mut gradient = Gradient::default();
        gradient.add(&weights, grads).unwrap();
        let lr = 0.01 / t as f64;
        let norm = adam.step(&gradient, lr, 1.0).unwrap();

        let by_hand = c.iter().map(|g| g * g).sum::<f64>().sqrt();
        assert!((norm - by_hand).abs() < 1e-6);
        let scale = (1.0 / (by_hand + 1e-6)).min(1.0);
        for i in 0..10 {
            let g = c[i] * scale;
            m[i] = 0.9 * m[i] + 0.1 * g;
            v[i] = 0.999 * v[i] + 0.001 * g * g;
            let m_hat = m[i] / (1.0 - 0.9f64.powi(t as i32));
            let v_hat = v[i] / (1.0 - 0.999f64.powi(t as i32));
            p[i] = p[i] - lr * 0.1 * p[i] - lr * m_hat / (v_hat.sqrt() + 1e-8);
        }
    }
    let got = [flat(&a), flat(&b)].concat();
    for (got, want) in got.iter().zip(&p) {
        assert!((got - want).abs() < 1e-6, "{got} {want}");
    }
    assert_eq!(adam.steps(), 20);
}

#[test]
fn gradient_that_is_not_finite_is_named_and_changes_nothing() {
    let (weights, [b, a]) = two_parameters();
    let before = weights.snapshot().unwrap();
    let mut adam = Adam::new(&weights, 0.0).unwrap();
    let loss = (a.sum_all().unwrap() + (b.sum_all().unwrap() * f64::INFINITY).unwrap()).unwrap();
    let mut gradient = Gradient::default();
    gradient.add(&weights, loss.backward().unwrap()).unwrap();
    let error = adam.step(&gradient, 1e-3, 1.0).unwrap_err();
    assert!(matches!(error, Error::Diverged { .. }));
    assert_eq!(error.to_string(), "training diverged at step 1: gradient of b is not finite");
    let after = weights.snapshot().unwrap();
    assert_eq!(before["a"].to_vec2::<f32>().unwrap(), after["a"].to_vec2::<f32>().unwrap());
}
