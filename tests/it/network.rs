//! The network: sizes, masks, gradients, where it starts.

use std::collections::HashMap;

use candle_core::{DType, Device::Cpu, Tensor, Var};
use candle_nn::VarBuilder;
use pmp::{
    dataset::batch::{Batch, Inputs, Targets},
    model::{
        config::{Assign, LossConfig, TrainConfig},
        init::Weights,
        loss::LossSums,
        net_config::{Model, NetConfig, PmpConfig, Preset},
        network::Network,
        output::Output,
        pass::Pass,
        pmp::Pmp,
    },
};

use crate::{
    losses::check_gradient,
    training::{Synthetic, small_net},
};

fn fresh(cfg: &PmpConfig) -> (Weights, Pmp) {
    Weights::new(0, &Cpu, |vb| Pmp::new(cfg, vb)).unwrap()
}

fn loss_config(action_weights: [f64; 3], motion_weight: f64) -> LossConfig {
    LossConfig { action_weights, motion_weight, ..TrainConfig::default().loss }
}

fn numbers(t: &Tensor) -> Vec<f32> {
    t.flatten_all().unwrap().to_vec1().unwrap()
}

fn batch() -> Batch {
    Synthetic::new(3).batch_of(0)
}

#[test]
fn presets_have_the_sizes_that_were_measured() {
    let count = |model, preset| {
        let cfg = NetConfig::preset(model, preset);
        Weights::new(0, &Cpu, |vb| Network::new(&cfg, vb)).unwrap().0.count()
    };
    assert_eq!(count(Model::Pmp, Preset::Nano), 250_992);
    assert_eq!(count(Model::Blind, Preset::Tiny), 250_992);
    assert_eq!(count(Model::Pmp, Preset::Tiny), 546_266);
    let (weights, _) = fresh(&small_net());
    let names: Vec<&str> = weights.iter().map(|(name, _)| name).collect();
    assert_eq!(
        names[..4],
        ["action.fc0.bias", "action.fc0.weight", "action.fc1.bias", "action.fc1.weight"]
    );
    assert!(names.contains(&"camera.conv0.weight"), "{names:?}");
    assert!(names.contains(&"gmm.fc1.bias"), "{names:?}");
}

#[test]
fn mixture_of_three_modes_is_363_numbers_and_the_outputs_are_in_range() {
    let (_, net) = fresh(&small_net());
    let out = net.forward(&batch().inputs, &Pass::Judge).unwrap();
    assert_eq!(out.action.dims(), [3, 3]);
    let (attention, motion) = (out.attention.unwrap(), out.motion.unwrap());
    assert_eq!(attention.dims(), [3, 4]);
    let all = [&motion.logits, &motion.mean, &motion.log_std];
    assert_eq!(all.iter().map(|t| t.elem_count()).sum::<usize>(), 3 * 363);
    for row in out.action.to_vec2::<f32>().unwrap() {
        assert!((-1.0..=1.0).contains(&row[0]) && row[1..].iter().all(|p| (0.0..=1.0).contains(p)));
    }
    for row in attention.to_vec2::<f32>().unwrap() {
        assert!((row.iter().sum::<f32>() - 1.0).abs() < 1e-6);
    }
}

#[test]
fn absent_sensor_changes_nothing_whatever_its_pixels() {
    let (_, net) = fresh(&small_net());
    let mut inputs = batch().inputs;
    inputs.present = Tensor::new(&[[1f32, 0.0], [0.0, 1.0], [0.0, 0.0]], &Cpu).unwrap();
    let clean = net.forward(&inputs, &Pass::Judge).unwrap();
    let wild = |picture: &Tensor, absent: [f32; 3]| {
        let mask = Tensor::new(&absent, &Cpu).unwrap().reshape((3, 1, 1, 1)).unwrap();
        let mask = mask.broadcast_as(picture.shape()).unwrap().gt(0f32).unwrap();
        let infinite = Tensor::full(f32::INFINITY, picture.shape(), &Cpu).unwrap();
        mask.where_cond(&infinite, picture).unwrap()
    };
    let dirty = Inputs {
        camera: inputs.camera.as_ref().map(|c| wild(c, [0.0, 1.0, 1.0])),
        ralidar: inputs.ralidar.as_ref().map(|r| wild(r, [1.0, 0.0, 1.0])),
        ..inputs.clone()
    };
    let dirty = net.forward(&dirty, &Pass::Judge).unwrap();
    assert_eq!(numbers(&clean.action), numbers(&dirty.action));
    let mean = |out: &Output| numbers(&out.motion.as_ref().unwrap().mean);
    assert_eq!(mean(&clean), mean(&dirty));
    let attention = dirty.attention.unwrap().to_vec2::<f32>().unwrap();
    assert_eq!(net.branches(), ["camera", "ralidar", "velocity", "route"]);
    assert_eq!((attention[0][1], attention[1][0]), (0.0, 0.0));
    assert_eq!(attention[2][..2], [0.0, 0.0]);

    let both = Tensor::ones((3, 2), DType::F32, &Cpu).unwrap();
    let sighted = net.forward(&Inputs { present: both, ..inputs }, &Pass::Judge).unwrap();
    assert_ne!(numbers(&clean.action), numbers(&sighted.action), "a sensor that is there counts");
}

#[test]
fn whole_network_has_the_gradient_of_finite_differences() {
    // In f64, where differences are exact enough to tell a wrong gradient from a rounded one.
    let cfg = small_net();
    let doubled = |t: &Tensor| t.to_dtype(DType::F64).unwrap();
    let start = fresh(&cfg).0.snapshot().unwrap();
    // Biases start at 0, where a masked picture would sit exactly in the kink of a ReLU.
    let start = start.iter().map(|(name, t)| (name.clone(), doubled(&(t + 0.013).unwrap())));
    let vars: HashMap<String, Var> =
        start.map(|(name, t)| (name, Var::from_tensor(&t).unwrap())).collect();
    let tensors = vars.iter().map(|(name, v)| (name.clone(), v.as_tensor().clone())).collect();
    let net = Pmp::new(&cfg, VarBuilder::from_tensors(tensors, DType::F64, &Cpu)).unwrap();
    let Batch { inputs, targets, .. } = batch();
    let inputs = Inputs {
        camera: inputs.camera.as_ref().map(doubled),
        ralidar: inputs.ralidar.as_ref().map(doubled),
        velocity: doubled(&inputs.velocity),
        route: doubled(&inputs.route),
        command: inputs.command,
        present: doubled(&Tensor::new(&[[1f32, 0.0], [1.0, 1.0], [0.0, 1.0]], &Cpu).unwrap()),
    };
    let targets = Targets {
        action: doubled(&targets.action),
        action_known: doubled(&targets.action_known),
        motion: doubled(&targets.motion),
        motion_valid: doubled(&targets.motion_valid),
        speed_mps: doubled(&targets.speed_mps),
    };
    let weights = loss_config([0.5, 0.3, 0.2], 0.7);
    let loss = || {
        let output = net.forward(&inputs, &Pass::Judge).unwrap();
        let sums = LossSums::new(&output, &targets, Assign::Soft).unwrap();
        sums.total(&weights, &sums.known).unwrap()
    };
    for name in [
        "camera.conv0.weight",
        "camera.conv1.bias",
        "camera.fc0.weight",
        "ralidar.conv1.weight",
        "velocity.fc0.weight",
        "route.fc0.weight",
        "route.fc1.bias",
        "attention.fc0.weight",
        "attention.fc1.bias",
        "action.fc1.weight",
        "gmm.fc0.weight",
        "gmm.fc1.bias",
    ] {
        let var = &vars[name];
        let step = var.elem_count().div_ceil(5);
        let which: Vec<_> = (0..var.elem_count()).step_by(step).collect();
        check_gradient(var, &loss, &which);
    }
}

#[test]
fn spread_far_out_of_range_still_has_a_way_back() {
    let (weights, net) = fresh(&small_net());
    for far in [-12f32, 9.0] {
        let mut values: HashMap<_, _> = weights.snapshot().unwrap().into_iter().collect();
        values.insert("gmm.fc1.bias".into(), Tensor::full(far, 363, &Cpu).unwrap());
        weights.set(&values).unwrap();
        let Batch { inputs, targets, .. } = batch();
        let out = net.forward(&inputs, &Pass::Judge).unwrap();
        for log_std in numbers(&out.motion.as_ref().unwrap().log_std) {
            assert!((0.01f32.ln()..=5f32.ln()).contains(&log_std));
        }
        let sums = LossSums::new(&out, &targets, Assign::Soft).unwrap();
        let total = sums.total(&loss_config([1.0; 3], 1.0), &sums.known).unwrap();
        let grads = total.backward().unwrap();
        let (_, bias) = weights.iter().find(|(name, _)| *name == "gmm.fc1.bias").unwrap();
        let spread = numbers(&grads.get(bias.as_tensor()).unwrap().narrow(0, 183, 180).unwrap());
        assert!(spread.iter().all(|g| g.is_finite()));
        assert!(spread.iter().any(|g| g.abs() > 1e-9), "no way back from {far}");
    }
}

#[test]
fn start_of_a_parameter_depends_on_the_seed_and_its_name_alone() {
    let values = |model, seed, name: &str| {
        let cfg = NetConfig::preset(model, Preset::Tiny);
        let (weights, _) = Weights::new(seed, &Cpu, |vb| Network::new(&cfg, vb)).unwrap();
        numbers(&weights.snapshot().unwrap()[name])
    };
    let start = values(Model::Blind, 1, "route.fc0.weight");
    assert_eq!(start, values(Model::Pmp, 1, "route.fc0.weight"));
    assert_ne!(start, values(Model::Blind, 2, "route.fc0.weight"));
    let bound = (6.0f32 / 260.0).sqrt();
    assert!(start.iter().all(|w| w.abs() <= bound));
    let variance = start.iter().map(|w| w * w).sum::<f32>() / start.len() as f32;
    assert!((variance / (2.0 / 260.0) - 1.0).abs() < 0.02, "{variance}");
    assert_eq!(values(Model::Blind, 1, "route.fc0.bias"), [0.0; 128]);
}

#[test]
fn batch_without_a_picture_that_the_network_needs_is_refused() {
    let (_, net) = fresh(&small_net());
    let inputs = Inputs { ralidar: None, ..batch().inputs };
    let error = net.forward(&inputs, &Pass::Judge).unwrap_err().to_string();
    assert!(error.starts_with("net.ralidar: "), "{error}");
}
