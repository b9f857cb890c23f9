//! The network: sizes, masks, gradients, where it starts.

use std::collections::HashMap;

use candle_core::{DType, Device::Cpu, Tensor, Var};
use candle_nn::VarBuilder;
use pmp::{
    dataset::batch::{Batch, Inputs, Targets},
    model::{
        config::NetConfig,
        conv::conv3x3_stride2,
        init::Weights,
        loss::{LossSums, LossWeights},
        pmp::Pmp,
    },
};

use crate::{
    losses::check_gradient,
    training::{Synthetic, small},
};

fn fresh(cfg: &NetConfig) -> (Weights, Pmp) {
    Weights::new(0, &Cpu, |vb| Pmp::new(cfg, vb)).unwrap()
}

fn numbers(t: &Tensor) -> Vec<f32> {
    t.flatten_all().unwrap().to_vec1().unwrap()
}

fn batch() -> Batch {
    Synthetic::new(3).batch_of(0)
}

#[test]
fn presets_have_the_sizes_that_were_measured() {
    let count = |cfg: &NetConfig| fresh(cfg).0.count();
    assert_eq!(count(&NetConfig::nano()), 250_992);
    assert_eq!(count(&NetConfig::tiny()), 546_266);
    let names: Vec<String> =
        fresh(&NetConfig::tiny()).0.iter().map(|(name, _)| name.into()).collect();
    assert_eq!(
        names[..4],
        ["action.fc0.bias", "action.fc0.weight", "action.fc1.bias", "action.fc1.weight"]
    );
    assert!(names.contains(&"camera.conv0.weight".into()), "{names:?}");
    assert!(names.contains(&"gmm.fc1.bias".into()), "{names:?}");
}

#[test]
fn mixture_of_three_modes_is_363_numbers_and_the_outputs_are_in_range() {
    let (_, net) = fresh(&small().net);
    let out = net.forward(&batch().inputs).unwrap();
    assert_eq!(out.action.dims(), [3, 3]);
    assert_eq!(out.attention.dims(), [3, 4]);
    let motion = &out.motion;
    let all = [&motion.logits, &motion.mean, &motion.log_std];
    assert_eq!(all.iter().map(|t| t.elem_count()).sum::<usize>(), 3 * 363);
    for row in out.action.to_vec2::<f32>().unwrap() {
        assert!((-1.0..=1.0).contains(&row[0]) && row[1..].iter().all(|p| (0.0..=1.0).contains(p)));
    }
    for row in out.attention.to_vec2::<f32>().unwrap() {
        assert!((row.iter().sum::<f32>() - 1.0).abs() < 1e-6);
    }
}

#[test]
fn absent_sensor_changes_nothing_whatever_its_pixels() {
    let (_, net) = fresh(&small().net);
    let mut inputs = batch().inputs;
    inputs.present = Tensor::new(&[[1f32, 0.0], [0.0, 1.0], [0.0, 0.0]], &Cpu).unwrap();
    let clean = net.forward(&inputs).unwrap();
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
    let dirty = net.forward(&dirty).unwrap();
    assert_eq!(numbers(&clean.action), numbers(&dirty.action));
    assert_eq!(numbers(&clean.motion.mean), numbers(&dirty.motion.mean));
    let attention = dirty.attention.to_vec2::<f32>().unwrap();
    assert_eq!(net.branches(), ["camera", "ralidar", "velocity", "route"]);
    assert_eq!((attention[0][1], attention[1][0]), (0.0, 0.0));
    assert_eq!(attention[2][..2], [0.0, 0.0]);

    let both = Tensor::ones((3, 2), DType::F32, &Cpu).unwrap();
    let sighted = net.forward(&Inputs { present: both, ..inputs }).unwrap();
    assert_ne!(numbers(&clean.action), numbers(&sighted.action), "a sensor that is there counts");
}

#[test]
fn whole_network_has_the_gradient_of_finite_differences() {
    // In f64, where differences are exact enough to tell a wrong gradient from a rounded one.
    let cfg = small().net;
    let doubled = |t: &Tensor| t.to_dtype(DType::F64).unwrap();
    let start = fresh(&cfg).0.snapshot().unwrap();
    // Biases start at 0, where a masked picture would sit exactly in the kink of a ReLU.
    let start = start.iter().map(|(name, t)| (name.clone(), doubled(&(t + 0.013).unwrap())));
    let vars: HashMap<String, Var> =
        start.map(|(name, t)| (name, Var::from_tensor(&t).unwrap())).collect();
    let tensors = vars.iter().map(|(name, v)| (name.clone(), v.as_tensor().clone())).collect();
    let net = Pmp::new(&cfg, VarBuilder::from_tensors(tensors, DType::F64, &Cpu)).unwrap();
    let Batch { inputs, targets } = batch();
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
    };
    let weights = LossWeights { action: [0.5, 0.3, 0.2], motion: 0.7 };
    let loss = || {
        let sums = LossSums::new(&net.forward(&inputs).unwrap(), &targets).unwrap();
        sums.total(&weights).unwrap()
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
    let (weights, net) = fresh(&small().net);
    for far in [-12f32, 9.0] {
        let mut values: HashMap<_, _> = weights.snapshot().unwrap().into_iter().collect();
        values.insert("gmm.fc1.bias".into(), Tensor::full(far, 363, &Cpu).unwrap());
        weights.set(&values).unwrap();
        let Batch { inputs, targets } = batch();
        let out = net.forward(&inputs).unwrap();
        for log_std in numbers(&out.motion.log_std) {
            assert!((0.01f32.ln()..=5f32.ln()).contains(&log_std));
        }
        let weights_of_terms = LossWeights { action: [1.0; 3], motion: 1.0 };
        let sums = LossSums::new(&out, &targets).unwrap();
        let grads = sums.total(&weights_of_terms).unwrap().backward().unwrap();
        let (_, bias) = weights.iter().find(|(name, _)| *name == "gmm.fc1.bias").unwrap();
        let spread = numbers(&grads.get(bias.as_tensor()).unwrap().narrow(0, 183, 180).unwrap());
        assert!(spread.iter().all(|g| g.is_finite()));
        assert!(spread.iter().any(|g| g.abs() > 1e-9), "no way back from {far}");
    }
}

#[test]
fn start_of_a_parameter_depends_on_the_seed_and_its_name_alone() {
    let values = |cfg: &NetConfig, seed, name: &str| {
        let (weights, _) = Weights::new(seed, &Cpu, |vb| Pmp::new(cfg, vb)).unwrap();
        numbers(&weights.snapshot().unwrap()[name])
    };
    let (nano, tiny) = (NetConfig::nano(), NetConfig::tiny());
    let start = values(&nano, 1, "route.fc0.weight");
    assert_eq!(start, values(&tiny, 1, "route.fc0.weight"));
    assert_ne!(start, values(&nano, 2, "route.fc0.weight"));
    let bound = (6.0f32 / 260.0).sqrt();
    assert!(start.iter().all(|w| w.abs() <= bound));
    let variance = start.iter().map(|w| w * w).sum::<f32>() / start.len() as f32;
    assert!((variance / (2.0 / 260.0) - 1.0).abs() < 0.02, "{variance}");
    assert_eq!(values(&nano, 1, "route.fc0.bias"), [0.0; 128]);
}

#[test]
fn convolution_and_its_gradients_are_those_of_candle() {
    let noise = |count: usize, salt: u64| -> Vec<f64> {
        (0..count as u64)
            .map(|i| ((i * 7919 + salt * 104_729) % 1009) as f64 / 504.5 - 1.0)
            .collect()
    };
    let var = |shape: &[usize], salt| {
        Var::from_vec(noise(shape.iter().product(), salt), shape, &Cpu).unwrap()
    };
    let (x, weight, bias) = (var(&[2, 3, 6, 10], 1), var(&[5, 3, 3, 3], 2), var(&[5], 3));
    let theirs = x.conv2d(&weight, 1, 2, 1, 1).unwrap();
    let theirs = theirs.broadcast_add(&bias.reshape((1, 5, 1, 1)).unwrap()).unwrap();
    let ours = conv3x3_stride2(&x.transpose(0, 1).unwrap(), &weight, &bias).unwrap();
    let ours = ours.transpose(0, 1).unwrap();
    let weighing = Tensor::from_vec(noise(2 * 5 * 3 * 5, 4), (2, 5, 3, 5), &Cpu).unwrap();
    let all = |out: &Tensor| {
        let grads = (out * &weighing).unwrap().sum_all().unwrap().backward().unwrap();
        let of = |v: &Var| grads.get(v.as_tensor()).unwrap().clone();
        [out.clone(), of(&x), of(&weight), of(&bias)]
    };
    for (ours, theirs) in all(&ours).iter().zip(all(&theirs)) {
        assert_eq!(ours.dims(), theirs.dims());
        let off = (ours - theirs).unwrap().abs().unwrap().max_all().unwrap();
        assert!(off.to_scalar::<f64>().unwrap() < 1e-12);
    }
}

#[test]
fn batch_without_a_picture_that_the_network_needs_is_refused() {
    let (_, net) = fresh(&small().net);
    let inputs = Inputs { ralidar: None, ..batch().inputs };
    let error = net.forward(&inputs).unwrap_err().to_string();
    assert!(error.starts_with("net.ralidar: "), "{error}");
}
