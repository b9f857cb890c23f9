//! PyTorch's numbers, written by `tests/peers/torch_fixtures.py`.

use std::{collections::BTreeMap, path::Path};

use pmp_kernels::{
    adam::Step,
    conv,
    norm::{self, Backward, Gate, Moments, Residual},
    pooling,
    resnet::{self, Mode, Network, Weights},
};
use safetensors::SafeTensors;

use crate::naive::{off, same_bits};

/// A file of tensors: shape and numbers of each.
struct File(BTreeMap<String, (Vec<usize>, Vec<f32>)>);

impl File {
    fn read(name: &str) -> Self {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/torch");
        let bytes = std::fs::read(folder.join(format!("{name}.safetensors"))).unwrap();
        let tensors = SafeTensors::deserialize(&bytes).unwrap();
        let numbers = |bytes: &[u8]| {
            bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
        };
        let tensor = |(name, tensor): (String, safetensors::tensor::TensorView)| {
            (name, (tensor.shape().to_vec(), numbers(tensor.data())))
        };
        Self(tensors.tensors().into_iter().map(tensor).collect())
    }

    fn shape(&self, name: &str) -> &[usize] {
        &self.0[name].0
    }

    fn get(&self, name: &str) -> &[f32] {
        &self.0[name].1
    }

    /// Asserts that these are the numbers of that name.
    fn is(&self, name: &str, got: &[f32], near: f64) {
        let want: Vec<f64> = self.get(name).iter().map(|x| f64::from(*x)).collect();
        let off = off(got, &want);
        assert!(off < near, "{name} is off by {off:e}");
    }
}

#[test]
fn convolutions_are_pytorchs() {
    for (name, stride, padding) in [
        ("conv_3x3", [1, 1], [1, 1]),
        ("conv_3x3_stride2", [2, 2], [1, 1]),
        ("conv_7x7_stride2", [2, 2], [3, 3]),
        ("conv_1x1_stride2", [2, 2], [0, 0]),
        ("conv_5x3", [1, 2], [0, 2]),
    ] {
        let file = File::read(name);
        let (x, weight) = (file.shape("x"), file.shape("weight"));
        let shape = conv::Shape {
            batch: x[0],
            height: x[1],
            width: x[2],
            channels: x[3],
            out_channels: weight[0],
            kernel: [weight[2], weight[3]],
            stride,
            padding,
        };
        let near = if shape.method() == conv::Method::Tiles4 { 1e-4 } else { 1e-5 };
        let (x, weight, grad) = (file.get("x"), file.get("weight"), file.get("grad"));
        let mut out = vec![0.0; shape.output_len()];
        conv::forward(&shape, x, weight, Some(file.get("bias")), &mut out);
        file.is("out", &out, near);
        let mut out = vec![0.0; shape.input_len()];
        conv::backward_input(&shape, grad, weight, &mut out);
        file.is("grad_x", &out, near);
        let mut out = vec![0.0; shape.weight_len()];
        conv::backward_weight(&shape, x, grad, &mut out);
        file.is("grad_weight", &out, near);
        let mut out = vec![0.0; shape.out_channels];
        conv::backward_bias(grad, &mut out);
        file.is("grad_bias", &out, 1e-5);
    }
}

#[test]
fn batch_norms_are_pytorchs() {
    for (name, training) in [("norm_train", true), ("norm_eval", false)] {
        let file = File::read(name);
        let (x, c) = (file.get("x"), file.shape("weight")[0]);
        let owned = |name: &str| file.get(name).to_vec();
        let mut kept = Moments { mean: owned("mean_before"), variance: owned("var_before") };
        let moments = if training {
            let moments = Moments::of(c, x);
            kept.follow(&moments, x.len() / c, 0.1);
            moments
        } else {
            kept.clone()
        };
        file.is("mean", &kept.mean, 1e-6);
        file.is("var", &kept.variance, 1e-6);
        let map = moments.map(file.get("weight"), file.get("bias"), 1e-5);
        let mut out = vec![0.0; x.len()];
        let residual = Residual { x: file.get("residual"), affine: None };
        norm::apply(x, map.as_affine(), Some(residual), true, &mut out);
        file.is("out", &out, 1e-5);
        let mut grad = owned("grad");
        let gate = Gate::Output(&out);
        let scale = file.get("weight");
        let back = Backward::sums(x, &moments, training, scale, 1e-5, gate, &mut grad);
        file.is("grad_residual", &grad, 1e-6);
        let mut grad_x = vec![0.0; x.len()];
        back.input(x, Some(&grad), &mut grad_x);
        file.is("grad_x", &grad_x, 1e-5);
        file.is("grad_weight", &back.grad_scale, 1e-5);
        file.is("grad_bias", &back.grad_shift, 1e-5);
    }
}

#[test]
fn max_pooling_is_pytorchs() {
    let file = File::read("max_pool");
    let x = file.shape("x");
    let shape = pooling::Shape {
        batch: x[0],
        height: x[1],
        width: x[2],
        channels: x[3],
        kernel: [3, 3],
        stride: [2, 2],
        padding: [1, 1],
    };
    let (mut out, mut which) = (vec![0.0; shape.output_len()], vec![0; shape.output_len()]);
    pooling::max(&shape, file.get("x"), &mut out, &mut which);
    assert_eq!(out, file.get("out"));
    let mut grad_x = vec![0.0; shape.input_len()];
    pooling::backward_max(&shape, file.get("grad"), &which, &mut grad_x);
    file.is("grad_x", &grad_x, 1e-6);
}

#[test]
fn adams_are_pytorchs() {
    for (name, decoupled) in [("adam", false), ("adamw", true)] {
        let file = File::read(name);
        let mut weights = file.get("start").to_vec();
        let count = weights.len();
        let (mut first, mut second) = (vec![0.0; count], vec![0.0; count]);
        for (i, want) in file.get("steps").chunks_exact(count).enumerate() {
            let step = Step { lr: 0.01, weight_decay: 0.1, decoupled, ..Step::default() };
            let grad = &file.get("grads")[i * count..][..count];
            Step { number: i as u64 + 1, ..step }.take(&mut weights, grad, &mut first, &mut second);
            let want: Vec<f64> = want.iter().map(|x| f64::from(*x)).collect();
            assert!(off(&weights, &want) < 1e-6, "{name}, step {i}");
        }
    }
}

/// The residual network's weights, and the moments of its norms before the first step.
fn network(file: &File) -> (Network, Vec<Weights<'_>>, Vec<Moments>) {
    let network = Network { channels: 3, width: 4, depths: [3, 4, 6, 3] };
    let of = |layer: &resnet::Layer| Weights {
        conv: file.get(&format!("weights.{}.weight", layer.conv)),
        scale: file.get(&format!("weights.{}.weight", layer.norm)),
        shift: file.get(&format!("weights.{}.bias", layer.norm)),
    };
    let start = |layer: &resnet::Layer| Moments {
        mean: vec![0.0; layer.out_channels],
        variance: vec![1.0; layer.out_channels],
    };
    let layers = network.layers();
    (network, layers.iter().map(of).collect(), layers.iter().map(start).collect())
}

#[test]
fn resnet34_is_pytorchs_layer_by_layer() {
    let file = File::read("resnet34");
    let (network, weights, mut kept) = network(&file);
    let x = file.shape("x");
    let (size, x) = ([x[0], x[1], x[2]], file.get("x"));
    let mode = Mode::Train(&mut kept);
    let (out, tape) = resnet::forward(&network, size, x, &weights, mode, true);
    file.is("out", &out, 1e-4);
    let (grads, grad_x) =
        resnet::backward(&network, tape.unwrap(), x, &weights, file.get("grad"), true);
    file.is("grad_x", &grad_x.unwrap(), 1e-4);
    for ((layer, grads), kept) in network.layers().iter().zip(&grads).zip(&kept) {
        file.is(&format!("grads.{}.weight", layer.conv), &grads.conv, 1e-4);
        file.is(&format!("grads.{}.weight", layer.norm), &grads.scale, 1e-4);
        file.is(&format!("grads.{}.bias", layer.norm), &grads.shift, 1e-4);
        file.is(&format!("after.{}.running_mean", layer.norm), &kept.mean, 1e-4);
        file.is(&format!("after.{}.running_var", layer.norm), &kept.variance, 1e-5);
    }
    let mode = Mode::Eval(&kept);
    let (out, tape) = resnet::forward(&network, size, x, &weights, mode, false);
    assert!(tape.is_none());
    file.is("out_eval", &out, 1e-4);
}

#[test]
fn resnet34_has_the_same_bits_on_any_number_of_threads() {
    let file = File::read("resnet34");
    let (network, weights, kept) = network(&file);
    let x = file.shape("x");
    let (size, x) = ([x[0], x[1], x[2]], file.get("x"));
    same_bits(|| {
        let mut kept = kept.clone();
        let mode = Mode::Train(&mut kept);
        let (mut out, tape) = resnet::forward(&network, size, x, &weights, mode, true);
        let grad = file.get("grad");
        let (grads, _) = resnet::backward(&network, tape.unwrap(), x, &weights, grad, false);
        grads.into_iter().for_each(|g| out.extend([g.conv, g.scale, g.shift].concat()));
        kept.into_iter().for_each(|kept| out.extend([kept.mean, kept.variance].concat()));
        out
    });
}
