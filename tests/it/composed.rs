//! Operations made of candle's own, as they run on a GPU, beside `pmp_kernels`: on the CPU, where
//! both run. What is left untested without a GPU is candle's own kernels there.
#![allow(clippy::unwrap_used)]

use candle_core::{DType, Device::Cpu, Tensor, Var};
use pmp::model::{
    adam::Adam,
    config::{Assign, TrainConfig},
    gradient::Gradient,
    init::Weights,
    loss::LossSums,
    net_config::{Encoder, NetConfig, PictureConfig, PmpConfig},
    network::Network,
    ops::{
        Conv, Norm,
        adam::{Moments, Step, adam_step, sums_of_squares},
        batch_norm, composed, conv2d,
        gradients::backward,
        max_pool,
    },
    pass::Pass,
};

use crate::{
    operations::{LEARN, numbers, off, pytorch, resnet},
    training::{Synthetic, small_net},
};

/// Height and width where a stride of 2 leaves a pixel over in both, in one and in none: those of
/// the paper's picture on its way.
const SIZES: [[usize; 2]; 3] = [[63, 150], [32, 75], [9, 11]];

fn var(seed: u32, shape: &[usize]) -> Var {
    Var::from_tensor(&numbers(seed, shape)).unwrap()
}

/// Gradients of a sum of what comes out, each number with a weight of its own.
fn gradients(out: &Tensor, vars: &[&Var]) -> Vec<Tensor> {
    let weights = numbers(77, out.dims()).to_dtype(out.dtype()).unwrap();
    let grads = backward(&(out * weights).unwrap().sum_all().unwrap()).unwrap();
    vars.iter().map(|var| grads.get(var.as_tensor()).unwrap().clone()).collect()
}

#[test]
fn convolution_is_that_of_the_kernels() {
    for [height, width] in SIZES {
        for (side, stride, padding) in
            [(1, 1, 0), (1, 2, 0), (3, 1, 1), (3, 2, 1), (7, 2, 3), (5, 2, 0), (4, 3, 2)]
        {
            let x = var(1, &[2, height, width, 3]);
            let (weight, bias) = (var(2, &[4, 3, side, side]), var(3, &[4]));
            let all = [&x, &weight, &bias];
            let ours = conv2d(&x, &weight, Some(&bias), Conv { stride, padding }).unwrap();
            let composed = composed::conv2d(&x, &weight, Some(&bias), stride, padding).unwrap();
            let what = format!("{height} x {width} by {side}, {stride}, {padding}");
            assert!(off(&composed, &ours) < 1e-5, "{what}");
            let each = gradients(&composed, &all).into_iter().zip(gradients(&ours, &all));
            for (i, (composed, ours)) in each.enumerate() {
                assert!(off(&composed, &ours) < 2e-5, "{what}: gradient {i}");
            }
        }
    }
}

#[test]
fn picture_and_frozen_weights_have_no_gradient() {
    let (x, weight) = (numbers(1, &[1, 9, 11, 3]), var(2, &[4, 3, 3, 3]));
    let out = composed::conv2d(&x, &weight, None, 2, 1).unwrap();
    let ours = conv2d(&x, &weight, None, Conv { stride: 2, padding: 1 }).unwrap();
    assert!(off(&gradients(&out, &[&weight])[0], &gradients(&ours, &[&weight])[0]) < 1e-5);
    let frozen = composed::conv2d(&x, &weight.as_detached_tensor(), None, 2, 1).unwrap();
    assert!(!frozen.track_op(), "nothing is kept for a way back that there is not");
    assert!(off(&frozen, &out) == 0.0);
}

#[test]
fn max_pool_is_that_of_the_kernels_and_gives_to_the_first_of_the_largest() {
    for [height, width] in SIZES {
        for (kernel, stride, padding) in [(3, 2, 1), (2, 2, 0), (3, 1, 1), (5, 3, 2)] {
            // Few different numbers: of most windows several pixels are the largest.
            let x = (numbers(4, &[2, height, width, 3]) * 2.0).unwrap().round().unwrap();
            let x = Var::from_tensor(&x).unwrap();
            let ours = max_pool(&x, kernel, Conv { stride, padding }).unwrap();
            let composed = composed::max_pool(&x, kernel, stride, padding).unwrap();
            let what = format!("{height} x {width} by {kernel}, {stride}, {padding}");
            assert!(off(&composed, &ours) == 0.0, "{what}");
            let [composed, ours] = [composed, ours].map(|out| gradients(&out, &[&x]).remove(0));
            assert!(off(&composed, &ours) < 1e-6, "{what}");
        }
    }
}

#[test]
fn batch_norm_is_that_of_the_kernels() {
    let [x, residual] = [5, 6].map(|seed| var(seed, &[2, 32, 75, 6]));
    let [scale, shift] = [7, 8].map(|seed| var(seed, &[6]));
    let both = Tensor::stack(&[scale.as_tensor(), shift.as_tensor()], 0).unwrap();
    let kept = [numbers(9, &[6]), numbers(10, &[6]).abs().unwrap()];
    let ways = (0..8).map(|i| [i & 1 > 0, i & 2 > 0, i & 4 > 0]);
    for way @ [of_batch, with_residual, relu] in ways {
        let mut vars = vec![&x, &scale, &shift];
        vars.extend(with_residual.then_some(&residual));
        let residual = with_residual.then_some(residual.as_tensor());
        let norm = Norm { moments: (!of_batch).then(|| kept.clone()), eps: 1e-5, relu };
        let (ours, moments) = batch_norm(&x, &scale, &shift, residual, &norm).unwrap();
        let (composed, its) =
            composed::batch_norm(&x, &both, residual, norm.moments.as_ref(), 1e-5, relu).unwrap();
        assert!(off(&composed, &ours) < 1e-5, "{way:?}");
        for (its, moment) in its.iter().zip(&moments) {
            assert!(off(its, moment) < 1e-5, "{way:?}");
        }
        let each = gradients(&composed, &vars).into_iter().zip(gradients(&ours, &vars));
        for (i, (composed, ours)) in each.enumerate() {
            assert!(off(&composed, &ours) < 2e-5, "{way:?}: gradient {i}");
        }
    }
}

#[test]
fn adam_is_that_of_the_kernels_and_its_moments_can_be_saved() {
    for (decoupled, grad_scale) in [(true, 1.0), (false, 0.5)] {
        let ours = var(11, &[5, 7]);
        // Of a type that the kernels do not have.
        let composed = Var::from_tensor(&ours.to_dtype(DType::F64).unwrap()).unwrap();
        let [mut one, mut other] = [&ours, &composed].map(|var| Moments::zeros(var).unwrap());
        for number in 1..=10 {
            let grad = numbers(number as u32, &[5, 7]);
            let step = Step { lr: 0.01, weight_decay: 0.1, number, decoupled, ..Step::default() };
            let step = Step { grad_scale, ..step };
            adam_step(&ours, &grad, &mut one, &step).unwrap();
            let wide = grad.to_dtype(DType::F64).unwrap();
            let [first, second] = other.tensors(&composed).unwrap();
            other = Moments::of(&composed, [&first, &second]).unwrap();
            adam_step(&composed, &wide, &mut other, &step).unwrap();
            let got = composed.to_dtype(DType::F32).unwrap();
            assert!(off(&got, &ours) < 1e-6, "step {number}");
            let [sum, wide] = [&grad, &wide].map(|grad| sums_of_squares(&[grad, grad]).unwrap());
            assert!((sum[1] / wide[1] - 1.0).abs() < 1e-6);
        }
        let [saved, kept] = [one.tensors(&ours).unwrap(), other.tensors(&composed).unwrap()];
        for (saved, kept) in saved.iter().zip(&kept) {
            assert!(off(&kept.to_dtype(DType::F32).unwrap(), saved) < 1e-6);
        }
        let short = numbers(1, &[5, 6]);
        let error = Moments::of(&ours, [&short, &saved[1]]).unwrap_err().to_string();
        assert!(error.contains("[5, 6]"), "{error}");
    }
}

#[test]
fn gradient_that_is_not_finite_is_seen() {
    let grads = [numbers(1, &[3]), (numbers(2, &[3]) / 0.0).unwrap()];
    let grads = grads.map(|grad| grad.to_dtype(DType::F64).unwrap());
    let sums = sums_of_squares(&[&grads[0], &grads[1]]).unwrap();
    assert!(sums[0].is_finite() && !sums[1].is_finite());
}

#[test]
fn resnet34_of_operations_is_pytorchs_layer_by_layer() {
    let file = pytorch("resnet34");
    let (weights, net) = resnet(&file);
    // Of a type that the kernels do not have: f64, so that what differs is PyTorch's rounding.
    let wide = |name: &str| file[name].to_dtype(DType::F64).unwrap();
    let narrow = |t: &Tensor| t.to_dtype(DType::F32).unwrap();
    let x = Var::from_tensor(&wide("x")).unwrap();
    let out = net.forward(&x, &LEARN).unwrap();
    assert_eq!(out.dtype(), DType::F64);
    assert!(off(&narrow(&out), &file["out"]) < 1e-5);
    let grads = backward(&(out * wide("grad")).unwrap().sum_all().unwrap()).unwrap();
    assert!(off(&narrow(grads.get(x.as_tensor()).unwrap()), &file["grad_x"]) < 1e-5);
    for (name, var) in weights.parameters() {
        let grad = grads.get(var.as_tensor()).unwrap();
        assert_eq!(grad.dtype(), DType::F32, "{name}: in the type of the weight");
        assert!(off(grad, &file[&format!("grads.{name}")]) < 1e-4, "{name}");
    }
    for (name, var) in weights.iter().filter(|(name, _)| name.contains("running")) {
        assert!(off(var, &file[&format!("after.{name}")]) < 1e-5, "{name}");
    }
    let judged = net.forward(&wide("x"), &Pass::Judge).unwrap();
    assert!(off(&narrow(&judged), &file["out_eval"]) < 1e-5);
}

#[test]
fn operations_of_bf16_are_those_of_f32_but_for_its_rounding() {
    let x = var(12, &[2, 15, 22, 8]);
    let (weight, bias) = (var(13, &[8, 8, 3, 3]), var(14, &[8]));
    let [scale, shift] = [15, 16].map(|seed| var(seed, &[8]));
    let vars = [&x, &weight, &bias, &scale, &shift];
    let conv = Conv { stride: 2, padding: 1 };
    let norm = Norm { moments: None, eps: 1e-5, relu: true };
    let through = |kind: DType| {
        let out = conv2d(&x.to_dtype(kind).unwrap(), &weight, Some(&bias), conv).unwrap();
        let (out, moments) = batch_norm(&out, &scale, &shift, None, &norm).unwrap();
        assert_eq!([moments[0].dtype(), moments[1].dtype()], [DType::F32; 2]);
        let out = max_pool(&out, 3, conv).unwrap();
        assert_eq!(out.dtype(), kind);
        let out = out.to_dtype(DType::F32).unwrap();
        (gradients(&out, &vars), out)
    };
    let ((want_grads, want), (got_grads, got)) = (through(DType::F32), through(DType::BF16));
    // 8 bits; where two pixels round to the same, the gradient goes to another.
    assert!(off(&got, &want) < 0.02, "{}", off(&got, &want));
    for (i, (got, want)) in got_grads.iter().zip(&want_grads).enumerate() {
        assert_eq!(got.dtype(), DType::F32);
        let length = |t: &Tensor| t.sqr().unwrap().sum_all().unwrap().to_scalar::<f32>().unwrap();
        let far = length(&(got - want).unwrap()) / length(want);
        // The bias is taken off again by the norm: its gradient is rounding alone.
        assert!(far < 0.01 || i == 2, "gradient {i}: {far}");
    }
}

/// A small network with encoders of a kind, its pictures of odd sizes, and its total loss with the
/// encoders in a type.
fn loss_in(encoder: Encoder, activations: Option<DType>) -> (Weights, Network, Tensor) {
    let channels = if encoder == Encoder::Resnet34 { vec![4] } else { vec![4, 8] };
    let picture = PictureConfig { height: 33, width: 46, encoder, channels, ..small_net().picture };
    let picture = PictureConfig { batch_norm: true, ..picture };
    let cfg = NetConfig::Pmp(PmpConfig { picture, ..small_net() });
    let (weights, net) = Weights::new(3, &Cpu, |vb| Network::new(&cfg, vb)).unwrap();
    let loss = loss_of(&net, 0, activations);
    (weights, net, loss)
}

fn loss_of(net: &Network, step: u64, activations: Option<DType>) -> Tensor {
    let batch = Synthetic::of_size(4, [33, 46]).batch_of(0);
    let pass = Pass::Learn { seed: 0, step, part: 0, activations };
    let output = net.forward(&batch.inputs, &pass).unwrap();
    assert_eq!(output.action.dtype(), DType::F32);
    let sums = LossSums::new(&output, &batch.targets, Assign::Soft).unwrap();
    sums.total(&TrainConfig::default().loss, &sums.known).unwrap()
}

#[test]
fn networks_learn_the_same_of_composed_encoders() {
    for encoder in [Encoder::Strided, Encoder::Resnet34] {
        let (ours, _, our_loss) = loss_in(encoder, None);
        let (theirs, _, their_loss) = loss_in(encoder, Some(DType::F64));
        let number = |loss: &Tensor| loss.to_scalar::<f32>().unwrap();
        assert!((number(&our_loss) / number(&their_loss) - 1.0).abs() < 1e-5);
        let [our_grads, their_grads] = [&our_loss, &their_loss].map(|loss| backward(loss).unwrap());
        for ((name, our), (_, their)) in ours.parameters().zip(theirs.parameters()) {
            let (our, their) = (our_grads.get(our).unwrap(), their_grads.get(their).unwrap());
            assert!(off(their, our) < 1e-3, "{name}: {}", off(their, our));
        }
        let statistics = ours.iter().zip(theirs.iter());
        for ((name, our), (_, their)) in
            statistics.filter(|((name, _), _)| name.contains("running"))
        {
            assert!(off(their, our) < 1e-4, "{name}");
        }
    }
}

#[test]
fn network_with_encoders_of_bf16_learns_by_heart_and_keeps_its_weights_in_f32() {
    let learned = |activations: Option<DType>| {
        let (weights, net, first) = loss_in(Encoder::Strided, activations);
        let mut adam = Adam::new(&weights, 0.0).unwrap();
        for step in 0..40 {
            let mut gradient = Gradient::default();
            let grads = backward(&loss_of(&net, step, activations)).unwrap();
            gradient.add(&weights, grads).unwrap();
            adam.step(&gradient, 3e-3, 5.0).unwrap();
        }
        assert!(weights.iter().all(|(_, var)| var.dtype() == DType::F32));
        let number = |loss: Tensor| loss.to_scalar::<f32>().unwrap();
        [number(first), number(loss_of(&net, 40, activations))]
    };
    let ([start, end], [rough_start, rough_end]) = (learned(None), learned(Some(DType::BF16)));
    assert!(start != rough_start && (start - rough_start).abs() < 0.02, "{start} {rough_start}");
    assert!((start - end) > 0.1 && (start - rough_end) > 0.9 * (start - end), "{end} {rough_end}");
}
