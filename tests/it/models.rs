//! Every network: what it takes and says, what it can do without, and that it learns.

use std::collections::HashMap;

use candle_core::{DType, Device::Cpu, Tensor, Var};
use clap::ValueEnum as _;
use pmp::{
    dataset::batch::{Batch, Inputs},
    error::Result,
    model::{
        adam::Adam,
        config::{Assign, TrainConfig},
        gradient::Gradient,
        init::Weights,
        loss::{LossSums, motion_nll},
        mixture::Mixture,
        net_config::{ActionRange, Model, NetConfig, Part, PmpConfig, Preset, Ranging},
        network::Network,
        ops::gradients::backward,
        output::{self, Output},
        pass::Pass,
        pretrained,
    },
};
use rand_chacha::{
    ChaCha8Rng,
    rand_core::{Rng as _, SeedableRng as _},
};

use crate::training::{Synthetic, small_net};

fn fresh(cfg: &NetConfig) -> (Weights, Network) {
    Weights::new(0, &Cpu, |vb| Network::new(cfg, vb)).unwrap()
}

/// Frames as the smallest preset of a model sees them, with every command.
fn batch(cfg: &NetConfig, frames: usize) -> Batch {
    let size = cfg.picture().map_or([8, 16], |p| [p.height, p.width]);
    let mut batch = Synthetic::of_size(frames, size).batch_of(0);
    let commands: Vec<u32> = (0..frames as u32).map(|i| i % 4).collect();
    batch.inputs.command = Tensor::new(commands, &Cpu).unwrap();
    batch
}

fn numbers(t: &Tensor) -> Vec<f32> {
    t.flatten_all().unwrap().to_vec1().unwrap()
}

fn said(net: &Network, inputs: &Inputs) -> Output {
    net.forward(inputs, &Pass::Judge).unwrap()
}

#[test]
fn every_model_says_actions_in_range_and_pmp_plans() {
    for model in Model::value_variants() {
        let cfg = NetConfig::preset(*model, Preset::Nano);
        let (_, net) = fresh(&cfg);
        let out = said(&net, &batch(&cfg, 5).inputs);
        for row in out.action.to_vec2::<f32>().unwrap() {
            assert!((-1.0..=1.0).contains(&row[0]), "{model:?}");
            assert!(row[1..].iter().all(|pedal| (0.0..=1.0).contains(pedal)), "{model:?}");
        }
        let plans = matches!(model, Model::Pmp | Model::Blind);
        assert_eq!(out.motion.is_some(), plans, "{model:?}");
        assert_eq!(out.attention.is_some(), plans, "{model:?}");
        let guesses = matches!(model, Model::Cil | Model::CilR);
        assert_eq!(out.speed.is_some(), guesses, "{model:?}");
    }
}

#[test]
fn description_counts_the_parameters_that_are_there() {
    for model in Model::value_variants() {
        for preset in [Preset::Nano, Preset::Tiny, Preset::Small] {
            let (weights, net) = fresh(&NetConfig::preset(*model, preset));
            let described: usize = net.layers().iter().map(|layer| layer.parameters).sum();
            assert_eq!(described, weights.count(), "{model:?} {preset:?}");
        }
    }
}

#[test]
fn only_the_branch_of_the_command_answers_and_learns() {
    let cfg = NetConfig::preset(Model::Cil, Preset::Nano);
    let (weights, net) = fresh(&cfg);
    let mut batch = batch(&cfg, 4);
    let answers: Vec<_> = (0..4u32)
        .map(|command| {
            batch.inputs.command = Tensor::new(vec![command; 4], &Cpu).unwrap();
            numbers(&said(&net, &batch.inputs).action)
        })
        .collect();
    for other in 1..4 {
        assert_ne!(answers[0], answers[other]);
    }
    batch.inputs.command = Tensor::new(vec![2u32; 4], &Cpu).unwrap();
    let grads = said(&net, &batch.inputs).action.sqr().unwrap().sum_all().unwrap();
    let grads = grads.backward().unwrap();
    for (name, command) in [("follow", 0), ("left", 1), ("right", 2), ("straight", 3)] {
        let name = format!("branch.{name}.fc1.weight");
        let (_, var) = weights.iter().find(|(n, _)| *n == name).unwrap();
        let learns = numbers(grads.get(var.as_tensor()).unwrap()).iter().any(|g| *g != 0.0);
        assert_eq!(learns, command == 2, "{name}");
    }
}

#[test]
fn network_does_without_each_part_that_is_disabled() {
    let every = [Part::Camera, Part::Ralidar, Part::Velocity, Part::Route];
    let names = ["camera", "ralidar", "velocity", "route"];
    for (i, part) in every.into_iter().enumerate() {
        let cfg = NetConfig::Pmp(PmpConfig { disable: vec![part], ..small_net() });
        let (weights, net) = fresh(&cfg);
        let rest: Vec<_> = names.iter().filter(|name| **name != names[i]).copied().collect();
        assert_eq!(net.branches(), rest);
        assert!(!weights.iter().any(|(name, _)| name.starts_with(names[i])), "{part:?}");
        let inputs = batch(&cfg, 2).inputs;
        let twice = |t: &Tensor| (t * 2.0).unwrap();
        let moved = match part {
            Part::Camera => Inputs { camera: inputs.camera.as_ref().map(twice), ..inputs.clone() },
            Part::Ralidar => {
                Inputs { ralidar: inputs.ralidar.as_ref().map(twice), ..inputs.clone() }
            }
            Part::Velocity => Inputs { velocity: twice(&inputs.velocity), ..inputs.clone() },
            _ => Inputs { route: twice(&inputs.route), ..inputs.clone() },
        };
        let action = |inputs: &Inputs| numbers(&said(&net, inputs).action);
        assert_eq!(action(&inputs), action(&moved), "{part:?}");
        let whole = fresh(&NetConfig::Pmp(small_net())).1;
        let action = |inputs: &Inputs| numbers(&said(&whole, inputs).action);
        assert_ne!(action(&inputs), action(&moved), "{part:?}");
    }
    let alike = PmpConfig { disable: vec![Part::Attention], ..small_net() };
    let (_, net) = fresh(&NetConfig::Pmp(alike));
    let mut inputs = batch(&NetConfig::Pmp(small_net()), 2).inputs;
    inputs.present = Tensor::new(&[[1f32, 1.0], [0.0, 1.0]], &Cpu).unwrap();
    let attention = said(&net, &inputs).attention.unwrap().to_vec2::<f32>().unwrap();
    assert_eq!(attention[0], [0.25; 4]);
    assert_eq!(attention[1][0], 0.0);
    assert!((attention[1][1] - 1.0 / 3.0).abs() < 1e-6);
    let mut int = NetConfig::preset(Model::Int, Preset::Nano);
    let error = int.disable(&[Part::Camera]).unwrap_err().to_string();
    assert_eq!(error, "disable: only the networks `pmp` and `blind` can do without a part");
}

/// A batch's lidar and radar `[B, H, W, 4]` with each pixel through `change`.
fn with_ralidar(inputs: &Inputs, change: impl Fn([f32; 4]) -> [f32; 4]) -> Inputs {
    let ralidar = inputs.ralidar.as_ref().unwrap();
    let pixels = numbers(ralidar).as_chunks().0.iter().copied().flat_map(change).collect();
    let changed = Tensor::from_vec::<_, f32>(pixels, ralidar.shape(), &Cpu).unwrap();
    Inputs { ralidar: Some(changed), ..inputs.clone() }
}

#[test]
fn nearness_is_the_same_network_on_other_numbers() {
    let fresh = |ranging| fresh(&NetConfig::Pmp(PmpConfig { ranging, ..small_net() })).1;
    let (metres, nearness) = (fresh(Ranging::Metres), fresh(Ranging::Nearness));
    let sparse = batch(&NetConfig::Pmp(small_net()), 2).inputs;
    let sparse = with_ralidar(&sparse, |[x, y, z, v]| match z > 0.5 {
        true => [x, y, 40.0 * z, v],
        false => [0.0; 4],
    });
    // What nearness makes of a pixel, in the units of the other: a return at 5 m is at a half.
    let told = with_ralidar(&sparse, |[x, y, z, v]| {
        let near = if z > 0.0 { 1.0 / (1.0 + z / 5.0) } else { 0.0 };
        [x * 50.0 / 10.0, y * 50.0 / 2.0, near * 50.0, v * 20.0 / 10.0]
    });
    let action = |net: &Network, inputs: &Inputs| numbers(&said(net, inputs).action);
    let pairs = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5);
    assert!(pairs(&action(&nearness, &sparse), &action(&metres, &told)));
    assert!(!pairs(&action(&nearness, &sparse), &action(&metres, &sparse)));
}

#[test]
fn without_radar_its_speeds_tell_nothing_and_lidar_still_does() {
    for ranging in [Ranging::Metres, Ranging::Nearness] {
        let net = PmpConfig { ranging, disable: vec![Part::Radar], ..small_net() };
        let (weights, net) = fresh(&NetConfig::Pmp(net));
        let inputs = batch(&NetConfig::Pmp(small_net()), 2).inputs;
        let action = |inputs: &Inputs| numbers(&said(&net, inputs).action);
        let faster = with_ralidar(&inputs, |[x, y, z, v]| [x, y, z, v + 3.0]);
        let further = with_ralidar(&inputs, |[x, y, z, v]| [x, y, z + 3.0, v]);
        assert_eq!(action(&inputs), action(&faster));
        assert_ne!(action(&inputs), action(&further));
        let (_, first) = weights.iter().find(|(name, _)| *name == "ralidar.conv0.weight").unwrap();
        assert_eq!(first.dims()[1], 3);
    }
}

#[test]
fn actions_are_in_their_range_when_used_and_free_to_return_to_it_while_learning() {
    let raw = Tensor::new(&[[-1.5f32, -0.2, 0.3], [0.4, 1.7, 0.0]], &Cpu).unwrap();
    let said = |range, pass: &Pass| output::action(&raw, range, pass).unwrap();
    let learn = Pass::Learn { seed: 0, step: 0, part: 0, activations: None };
    assert_eq!(numbers(&said(ActionRange::Cut, &Pass::Judge)), [-1.0, 0.0, 0.3, 0.4, 1.0, 0.0]);
    assert_eq!(numbers(&said(ActionRange::Cut, &learn)), numbers(&raw));
    let squashed = numbers(&said(ActionRange::Squashed, &learn));
    assert_eq!(squashed, numbers(&said(ActionRange::Squashed, &Pass::Judge)));
    assert_eq!(squashed[0], (-1.5f32).tanh());
    assert!((squashed[5] - 0.5).abs() < 1e-6);
}

#[test]
fn dropout_depends_on_seed_step_part_and_place_and_keeps_the_mean() {
    let x = Tensor::ones((100, 100), DType::F32, &Cpu).unwrap();
    let drop = |pass: Pass, layer: &str| numbers(&pass.dropout(&x, 0.3, layer).unwrap());
    let learn = |seed, step, part| Pass::Learn { seed, step, part, activations: None };
    let first = drop(learn(1, 2, 3), "a");
    assert_eq!(first, drop(learn(1, 2, 3), "a"));
    for other in [learn(0, 2, 3), learn(1, 0, 3), learn(1, 2, 0)] {
        assert_ne!(first, drop(other, "a"));
    }
    assert_ne!(first, drop(learn(1, 2, 3), "b"));
    assert_eq!(drop(Pass::Judge, "a"), vec![1.0; 10_000]);
    let dropped = first.iter().filter(|x| **x == 0.0).count() as f32 / 1e4;
    assert!((dropped - 0.3).abs() < 0.02, "{dropped}");
    let mean = first.iter().sum::<f32>() / 1e4;
    assert!((mean - 1.0).abs() < 0.03, "{mean}");
}

#[test]
fn every_model_learns_a_batch_by_heart() {
    for model in Model::value_variants() {
        let cfg = NetConfig::preset(*model, Preset::Nano);
        let ((weights, net), batch) = (fresh(&cfg), batch(&cfg, 4));
        let loss_config = TrainConfig::default().loss;
        let mut adam = Adam::new(&weights, 0.0).unwrap();
        let mut action = f64::INFINITY;
        for step in 0..400 {
            let pass = Pass::Learn { seed: 0, step, part: 0, activations: None };
            let output = net.forward(&batch.inputs, &pass).unwrap();
            let sums = LossSums::new(&output, &batch.targets, Assign::Soft).unwrap();
            action = sums.read().unwrap().terms(&loss_config).action.unwrap();
            if action < 0.01 {
                break;
            }
            let mut gradient = Gradient::default();
            let total = sums.total(&loss_config, &sums.known).unwrap();
            gradient.add(&weights, backward(&total).unwrap()).unwrap();
            adam.step(&gradient, 2e-3 * (1.0 - step as f64 / 400.0), 5.0).unwrap();
        }
        assert!(action < 0.01, "{model:?}: {action}");
    }
}

/// Motions of two manoeuvres: 3 of 10 brake.
struct TwoManoeuvres(ChaCha8Rng);

/// Mean speed (10 m/s) and yaw (rad), and their standard deviations, of going on and of braking.
const GO: [[f64; 2]; 2] = [[1.2, 0.1], [0.05, 0.02]];
const BRAKE: [[f64; 2]; 2] = [[0.3, 0.0], [0.15, 0.01]];
const SHARE_BRAKING: f64 = 0.3;

impl TwoManoeuvres {
    fn uniform(&mut self) -> f64 {
        (f64::from(self.0.next_u32()) + 0.5) / (f64::from(u32::MAX) + 1.0)
    }

    fn normal(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (std::f64::consts::TAU * self.uniform()).cos()
    }

    /// `[B, 30, 2]`: m/s and rad.
    fn motions(&mut self, count: usize) -> Tensor {
        let mut values = vec![];
        for _ in 0..count {
            let [mean, std] = if self.uniform() < SHARE_BRAKING { BRAKE } else { GO };
            for _ in 0..30 {
                for d in 0..2 {
                    let value = mean[d] + std[d] * self.normal();
                    values.push((value * [10.0, 1.0][d]) as f32);
                }
            }
        }
        Tensor::from_vec(values, (count, 30, 2), &Cpu).unwrap()
    }
}

#[test]
fn mixture_recovers_the_distribution_that_it_is_shown() {
    let mut source = TwoManoeuvres(ChaCha8Rng::seed_from_u64(1));
    // Both modes start near each other: means 0.8 and 0.6, deviations 0.4.
    let start = |shape: &[usize], at: fn(usize) -> f32| {
        let count = shape.iter().product();
        Tensor::from_vec((0..count).map(at).collect::<Vec<f32>>(), shape, &Cpu).unwrap()
    };
    let values = HashMap::from([
        ("logits".to_string(), start(&[1, 2, 1], |_| 0.0)),
        ("mean".to_string(), start(&[1, 2, 30, 2], |i| if i < 60 { 0.8 } else { 0.6 })),
        ("log_std".to_string(), start(&[1, 2, 30, 2], |_| -0.9)),
    ]);
    let (weights, parts) = Weights::new(0, &Cpu, |vb| -> Result<[Tensor; 3]> {
        let zero = || candle_nn::Init::Const(0.0);
        Ok([
            vb.get_with_hints((1, 2, 1), "logits", zero())?,
            vb.get_with_hints((1, 2, 30, 2), "mean", zero())?,
            vb.get_with_hints((1, 2, 30, 2), "log_std", zero())?,
        ])
    })
    .unwrap();
    weights.set(&values).unwrap();
    let mut adam = Adam::new(&weights, 0.0).unwrap();
    let valid = Tensor::ones((256, 30), DType::F32, &Cpu).unwrap();
    let steps = 900;
    for step in 0..steps {
        let [logits, mean, log_std] = parts.clone().map(|part| {
            let mut shape = part.dims().to_vec();
            shape[0] = 256;
            part.broadcast_as(shape).unwrap()
        });
        let mixture = Mixture { logits, mean, log_std };
        let loss = motion_nll(&mixture, &source.motions(256), &valid, Assign::Soft).unwrap();
        let mut gradient = Gradient::default();
        gradient.add(&weights, loss.backward().unwrap()).unwrap();
        adam.step(&gradient, 0.02 * (1.0 - step as f64 / steps as f64), 0.0).unwrap();
    }
    let [logits, mean, log_std] = parts.map(|part| numbers(&part));
    let share = |k: usize| f64::from(logits[k].exp() / (logits[0].exp() + logits[1].exp()));
    let braking = usize::from(mean[0] > mean[60]);
    assert!((share(braking) - SHARE_BRAKING).abs() < 0.03, "{}", share(braking));
    for (mode, [means, stds]) in [(braking, BRAKE), (1 - braking, GO)] {
        for i in 0..60 {
            let (d, at) = (i % 2, mode * 60 + i);
            let off = (f64::from(mean[at]) - means[d]).abs();
            assert!(off < 0.15 * stds[d], "mode {mode}, number {i}: mean {}", mean[at]);
            let ratio = f64::from(log_std[at].exp()) / stds[d];
            assert!((0.9..1.1).contains(&ratio), "mode {mode}, number {i}: std ratio {ratio}");
        }
    }

    // Where new motions fall in the distribution of each number: uniformly, if it is right.
    let motions = numbers(&source.motions(2000));
    let mut tenths = [0usize; 10];
    for (i, value) in motions.iter().enumerate() {
        let (d, value) = (i % 2, f64::from(*value) / [10.0, 1.0][i % 2]);
        let below = |k: usize| {
            let at = k * 60 + i % 60;
            let z = (value - f64::from(mean[at])) / f64::from(log_std[at].exp());
            share(k) * 0.5 * (1.0 + libm::erf(z / std::f64::consts::SQRT_2))
        };
        let place = below(0) + below(1);
        tenths[((place * 10.0) as usize).min(9)] += usize::from(d < 2);
    }
    for (i, count) in tenths.iter().enumerate() {
        let share = *count as f64 / motions.len() as f64;
        assert!((share - 0.1).abs() < 0.012, "tenth {i}: {share}, all {tenths:?}");
    }
}

#[test]
fn pretrained_weights_start_every_resnet_and_need_names_and_shapes_of_torchvision() {
    let dir = tempfile::tempdir().unwrap();
    let cfg = NetConfig::preset(Model::Int, Preset::Nano);
    let (donor, _) = Weights::new(7, &Cpu, |vb| Network::new(&cfg, vb)).unwrap();
    let mut file: HashMap<String, Tensor> = donor
        .iter()
        .filter_map(|(name, var)| {
            let name = name.strip_prefix("camera.").filter(|name| !name.starts_with("fc"))?;
            Some((name.to_string(), var.as_detached_tensor()))
        })
        .collect();
    file.insert("fc.weight".into(), Tensor::zeros((1000, 512), DType::F32, &Cpu).unwrap());
    let path = dir.path().join("resnet34.safetensors");
    candle_core::safetensors::save(&file, &path).unwrap();

    let picture = cfg.picture().unwrap().clone();
    let pmp = NetConfig::Pmp(PmpConfig { picture, ..small_net() });
    let (weights, _) = fresh(&pmp);
    pretrained::load(&path, &weights).unwrap();
    let value = |name: &str| -> Var { weights.iter().find(|(n, _)| *n == name).unwrap().1.clone() };
    for branch in ["camera", "ralidar"] {
        let got = numbers(value(&format!("{branch}.layer3.2.conv1.weight")).as_tensor());
        assert_eq!(got, numbers(&file["layer3.2.conv1.weight"]));
    }
    let (three, four) = (file["conv1.weight"].clone(), value("ralidar.conv1.weight"));
    assert_eq!(numbers(&four.narrow(1, 0, 3).unwrap()), numbers(&three));
    let mean = numbers(&three.mean_keepdim(1).unwrap());
    assert_eq!(numbers(&four.narrow(1, 3, 1).unwrap()), mean);

    let error = |file: &HashMap<String, Tensor>, cfg: &NetConfig| {
        candle_core::safetensors::save(file, &path).unwrap();
        let error = pretrained::load(&path, &fresh(cfg).0).unwrap_err().to_string();
        error.replace(&path.display().to_string(), "FILE")
    };
    let tiny = NetConfig::preset(Model::Pmp, Preset::Tiny);
    let none = "pretrained: the network has no ResNet34 to start from: FILE";
    assert_eq!(error(&file, &tiny), none);
    file.insert("bn1.weight".into(), Tensor::zeros(9, DType::F32, &Cpu).unwrap());
    let wrong = "pretrained: bn1.weight is [9], the network needs [4]: FILE";
    assert_eq!(error(&file, &cfg), wrong);
    file.remove("layer1.0.conv1.weight");
    file.remove("bn1.weight");
    assert_eq!(error(&file, &cfg), "pretrained: has no bn1.weight: FILE");
}
