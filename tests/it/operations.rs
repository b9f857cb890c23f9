//! Operations on tensors: convolution, batch norm, max-pool, Adam, ResNet34, each with its way back
//! through candle's graph. The numbers themselves are tested where they are computed, in `kernels`.
#![allow(clippy::unwrap_used)]

use std::collections::HashMap;

use candle_core::{DType, Device::Cpu, Tensor, Var};
use candle_nn::VarBuilder;
use pmp::model::{
    init::Weights,
    ops::{
        Conv, Norm,
        adam::{Moments, Step, adam_step, sums_of_squares},
        batch_norm, conv2d,
        gradients::backward,
        max_pool,
    },
    pass::Pass,
    resnet::ResNet34,
};

pub(crate) const LEARN: Pass = Pass::Learn { seed: 0, step: 0, part: 0, activations: None };

/// Numbers that look random, of a shape.
pub(crate) fn numbers(seed: u32, shape: &[usize]) -> Tensor {
    let wild = |i: usize| (i as u32 ^ seed).wrapping_mul(2_654_435_761).rotate_left(13);
    let number = |i: usize| wild(i).wrapping_mul(2_246_822_519) as f32 / 2_147_483_648.0 - 1.0;
    Tensor::from_iter((0..shape.iter().product()).map(number), &Cpu)
        .unwrap()
        .reshape(shape)
        .unwrap()
}

/// Largest difference as a share of the largest number.
pub(crate) fn off(got: &Tensor, want: &Tensor) -> f32 {
    assert_eq!(got.dims(), want.dims());
    let most = |t: &Tensor| t.abs().unwrap().flatten_all().unwrap().max(0).unwrap();
    let most = |t: &Tensor| most(t).to_scalar::<f32>().unwrap();
    most(&(got - want).unwrap()) / most(want)
}

/// PyTorch's file of a name.
pub(crate) fn pytorch(name: &str) -> HashMap<String, Tensor> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/kernels/tests/fixtures/torch");
    candle_core::safetensors::load(format!("{folder}/{name}.safetensors"), &Cpu).unwrap()
}

#[test]
fn convolution_and_its_gradients_are_pytorchs() {
    for (name, stride, padding) in
        [("conv_3x3", 1, 1), ("conv_3x3_stride2", 2, 1), ("conv_7x7_stride2", 2, 3)]
    {
        let file = pytorch(name);
        let [x, weight, bias] =
            ["x", "weight", "bias"].map(|name| Var::from_tensor(&file[name]).unwrap());
        let conv = Conv { stride, padding };
        // Not contiguous: as it comes of a picture of planes.
        let planes = x.permute((0, 3, 1, 2)).unwrap().contiguous().unwrap();
        let turned = planes.permute((0, 2, 3, 1)).unwrap();
        let out = conv2d(&turned, &weight, Some(&bias), conv).unwrap();
        assert!(off(&out, &file["out"]) < 1e-4);
        let (_, height, ..) = x.dims4().unwrap();
        assert_eq!(out.dims()[1], conv.out(height, weight.dims()[2]));
        let grads = backward(&(out * &file["grad"]).unwrap().sum_all().unwrap()).unwrap();
        for (var, name) in [(&x, "grad_x"), (&weight, "grad_weight"), (&bias, "grad_bias")] {
            assert!(off(grads.get(var.as_tensor()).unwrap(), &file[name]) < 1e-4, "{name}");
        }
    }
}

#[test]
fn convolution_of_another_type_is_candles() {
    let [x, weight] = [numbers(1, &[2, 6, 5, 3]), numbers(2, &[4, 3, 3, 3])];
    let conv = Conv { stride: 1, padding: 1 };
    let want = conv2d(&x, &weight, None, conv).unwrap();
    let [x, weight] = [x, weight].map(|t| t.to_dtype(DType::F64).unwrap());
    let got = conv2d(&x, &weight, None, conv).unwrap();
    assert!(off(&got.to_dtype(DType::F32).unwrap(), &want) < 1e-5);
}

#[test]
fn batch_norm_and_its_gradients_are_pytorchs() {
    for (name, training) in [("norm_train", true), ("norm_eval", false)] {
        let file = pytorch(name);
        let [x, scale, shift, residual] =
            ["x", "weight", "bias", "residual"].map(|name| Var::from_tensor(&file[name]).unwrap());
        let kept = ["mean", "var"].map(|name| file[name].clone());
        let norm = Norm { moments: (!training).then_some(kept), eps: 1e-5, relu: true };
        let (out, _) = batch_norm(&x, &scale, &shift, Some(&residual), &norm).unwrap();
        assert!(off(&out, &file["out"]) < 1e-5);
        let grads = backward(&(out * &file["grad"]).unwrap().sum_all().unwrap()).unwrap();
        for (var, name) in [
            (&x, "grad_x"),
            (&scale, "grad_weight"),
            (&shift, "grad_bias"),
            (&residual, "grad_residual"),
        ] {
            assert!(off(grads.get(var.as_tensor()).unwrap(), &file[name]) < 1e-5, "{name}");
        }
    }
}

#[test]
fn batch_norm_without_a_residual_closes_the_same_gate() {
    let x = Var::from_tensor(&numbers(3, &[3, 4, 5, 6])).unwrap();
    let [scale, shift] = [numbers(4, &[6]), numbers(5, &[6])];
    let norm = |relu: bool| Norm { moments: None, eps: 1e-5, relu };
    let grad_of = |out: Tensor| {
        let loss = (out * numbers(6, &[3, 4, 5, 6])).unwrap().sum_all().unwrap();
        backward(&loss).unwrap().get(x.as_tensor()).unwrap().clone()
    };
    let (ours, _) = batch_norm(&x, &scale, &shift, None, &norm(true)).unwrap();
    let (plain, _) = batch_norm(&x, &scale, &shift, None, &norm(false)).unwrap();
    assert!(off(&grad_of(ours), &grad_of(plain.relu().unwrap())) < 1e-5);
}

#[test]
fn max_pool_and_its_gradient_are_pytorchs() {
    let file = pytorch("max_pool");
    let x = Var::from_tensor(&file["x"]).unwrap();
    let out = max_pool(&x, 3, Conv { stride: 2, padding: 1 }).unwrap();
    assert!(off(&out, &file["out"]) == 0.0);
    let grads = backward(&(out * &file["grad"]).unwrap().sum_all().unwrap()).unwrap();
    assert!(off(grads.get(x.as_tensor()).unwrap(), &file["grad_x"]) < 1e-6);
}

#[test]
fn adam_on_variables_is_pytorchs() {
    let file = pytorch("adamw");
    let var = Var::from_tensor(&file["start"]).unwrap();
    let mut moments = Moments::zeros(&var).unwrap();
    for i in 0..10 {
        let (grad, want) = (file["grads"].get(i).unwrap(), file["steps"].get(i).unwrap());
        let [lr, weight_decay] = [0.01, 0.1];
        let step =
            Step { number: i as u64 + 1, lr, weight_decay, decoupled: true, ..Step::default() };
        adam_step(&var, &grad, &mut moments, &step).unwrap();
        assert!(off(&var, &want) < 1e-6);
        let squares = grad.sqr().unwrap().sum_all().unwrap().to_scalar::<f32>().unwrap();
        assert!((sums_of_squares(&[&grad]).unwrap()[0] as f32 / squares - 1.0).abs() < 1e-5);
    }
}

/// ResNet34 of 4 channels, 3 in the picture, with PyTorch's weights.
pub(crate) fn resnet(file: &HashMap<String, Tensor>) -> (Weights, ResNet34) {
    let (weights, net) = Weights::new(0, &Cpu, |vb| ResNet34::new(3, 4, vb)).unwrap();
    for (name, var) in weights.parameters() {
        var.set(&file[&format!("weights.{name}")]).unwrap();
    }
    (weights, net)
}

#[test]
fn resnet34_is_pytorchs_layer_by_layer() {
    let file = pytorch("resnet34");
    let (weights, net) = resnet(&file);
    let x = Var::from_tensor(&file["x"]).unwrap();
    let out = net.forward(&x, &LEARN).unwrap();
    assert!(off(&out, &file["out"]) < 1e-4);
    let grads = backward(&(out * &file["grad"]).unwrap().sum_all().unwrap()).unwrap();
    assert!(off(grads.get(x.as_tensor()).unwrap(), &file["grad_x"]) < 1e-4);
    assert_eq!(weights.parameters().count(), 36 * 3);
    for (name, var) in weights.parameters() {
        let grad = grads.get(var.as_tensor()).unwrap();
        assert!(off(grad, &file[&format!("grads.{name}")]) < 1e-4, "{name}");
    }
    for (name, var) in weights.iter().filter(|(name, _)| name.contains("running")) {
        assert!(off(var, &file[&format!("after.{name}")]) < 1e-4, "{name}");
    }
    let judged = net.forward(&file["x"], &Pass::Judge).unwrap();
    assert!(off(&judged, &file["out_eval"]) < 1e-4);

    let frozen = weights.snapshot().unwrap().into_iter().collect();
    let frozen = ResNet34::new(3, 4, VarBuilder::from_tensors(frozen, DType::F32, &Cpu)).unwrap();
    let out = frozen.forward(&file["x"], &Pass::Judge).unwrap();
    assert!(!out.track_op(), "nothing is kept for a way back that there is not");
    assert!(off(&out, &judged) == 0.0);
}

#[test]
fn resnet34_refuses_a_way_back_that_would_lose_gradients() {
    let file = pytorch("resnet34");
    let (_, net) = resnet(&file);
    let loss = net.forward(&file["x"], &LEARN).unwrap().sum_all().unwrap();
    let error = loss.backward().unwrap_err().to_string();
    assert!(error.contains("gradients::backward"), "{error}");
    let loss = net.forward(&file["x"], &LEARN).unwrap().sum_all().unwrap();
    backward(&loss).unwrap();
    let error = backward(&loss).unwrap_err().to_string();
    assert!(error.contains("second way back"), "{error}");
}

#[test]
fn layers_of_resnet34_have_the_sizes_of_the_paper() {
    let (weights, net) = Weights::new(0, &Cpu, |vb| ResNet34::new(3, 64, vb)).unwrap();
    let layers = net.layers("camera", [224, 224]);
    let parameters: usize = layers.iter().map(|layer| layer.parameters).sum();
    assert_eq!(parameters, weights.count());
    assert_eq!(parameters, 21_284_672); // torchvision's 21 797 672 less 513 000 of its classifier
    let cost: usize = layers.iter().map(|layer| layer.multiply_adds).sum();
    assert!((3.6e9..3.7e9).contains(&(cost as f64)), "3.6e9 in the paper, here {cost}");
    assert_eq!(layers.last().unwrap().output, [7, 7, 512]);
}

#[test]
fn shapes_that_do_not_fit_are_named() {
    let [x, weight] = [numbers(1, &[1, 4, 4, 3]), numbers(2, &[5, 2, 3, 3])];
    let error = conv2d(&x, &weight, None, Conv { stride: 1, padding: 1 }).unwrap_err().to_string();
    assert!(error.contains("[1, 4, 4, 3]") && error.contains("[5, 2, 3, 3]"), "{error}");
    let error = max_pool(&x, 7, Conv { stride: 1, padding: 0 }).unwrap_err().to_string();
    assert!(error.contains("[1, 4, 4, 3]"), "{error}");
    let (one, norm) = (numbers(1, &[2]), Norm { moments: None, eps: 1e-5, relu: true });
    let error = batch_norm(&x, &one, &one, None, &norm).unwrap_err().to_string();
    assert!(error.contains("[1, 4, 4, 3]"), "{error}");
}
