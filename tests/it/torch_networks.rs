//! Every network, forward and backward, against PyTorch with the same weights.
//!
//! Weights and frames come from seeds, so that the fixtures need to hold PyTorch's answers only;
//! `tests/peers/torch_networks.py` says how they are made.

use std::{collections::BTreeMap, fs, path::Path};

use candle_core::{Device::Cpu, Tensor};
use pmp::{
    dataset::batch::Batch,
    model::{
        config::{Assign, TrainConfig},
        gradient::Gradient,
        init::Weights,
        loss::LossSums,
        net_config::{Model, NetConfig, Preset},
        network::Network,
        ops::gradients::backward,
        pass::Pass,
    },
};
use serde::Deserialize;

use crate::training::Synthetic;

#[derive(Deserialize)]
struct Fixture {
    loss: f64,
    action: Vec<Vec<f64>>,
    #[serde(default)]
    mean: Vec<f64>,
    #[serde(default)]
    speed: Vec<f64>,
    gradients: BTreeMap<String, Summary>,
}

/// What is kept of a gradient.
#[derive(Deserialize)]
struct Summary {
    norm: f64,
    sum: f64,
    entries: Vec<(usize, f64)>,
    /// How far PyTorch's own f32 is off from its f64, relative.
    f32_off: f64,
}

/// Name of the fixture, recipe, frames.
const CASES: [(&str, Model, Preset, usize); 6] = [
    ("pmp-paper", Model::Pmp, Preset::Paper, 2),
    ("pmp-small", Model::Pmp, Preset::Small, 3),
    ("pmp-tiny", Model::Pmp, Preset::Tiny, 3),
    ("cil-paper", Model::Cil, Preset::Paper, 4),
    ("cil-r-tiny", Model::CilR, Preset::Tiny, 4),
    ("int-tiny", Model::Int, Preset::Tiny, 3),
];

/// The recipe without what chance does.
fn recipe(model: Model, preset: Preset) -> TrainConfig {
    let mut config = TrainConfig::preset(model, preset);
    match &mut config.net {
        NetConfig::Pmp(net) => net.dropout = 0.0,
        NetConfig::Cil(net) => (net.image_dropout, net.branch_dropout) = (0.0, 0.0),
        NetConfig::Int(net) => net.dropout = 0.0,
    }
    config
}

fn made(config: &TrainConfig, frames: usize) -> (Weights, Network, Batch) {
    let (weights, net) = Weights::new(1, &Cpu, |vb| Network::new(&config.net, vb)).unwrap();
    let size = config.net.picture().map_or([8, 16], |p| [p.height, p.width]);
    let mut batch = Synthetic::of_size(frames, size).batch_of(0);
    let commands: Vec<u32> = (0..frames as u32).map(|i| i % 4).collect();
    batch.inputs.command = Tensor::new(commands, &Cpu).unwrap();
    (weights, net, batch)
}

#[test]
#[ignore = "writes what tests/peers/torch_networks.py needs into the folder PMP_EXPORT"]
fn networks_are_exported() {
    let folder = std::env::var_os("PMP_EXPORT").expect("PMP_EXPORT names a folder");
    let folder = Path::new(&folder);
    fs::create_dir_all(folder).unwrap();
    for (name, model, preset, frames) in CASES {
        let config = recipe(model, preset);
        let (weights, _, batch) = made(&config, frames);
        let weights = weights.snapshot().unwrap().into_iter().collect();
        let file = |what: &str| folder.join(format!("{name}.{what}"));
        candle_core::safetensors::save(&weights, file("weights.safetensors")).unwrap();
        let (inputs, targets) = (batch.inputs, batch.targets);
        let mut data = std::collections::HashMap::from([
            ("velocity", inputs.velocity),
            ("route", inputs.route),
            ("command", inputs.command),
            ("action", targets.action),
            ("motion", targets.motion),
        ]);
        data.extend(inputs.camera.map(|camera| ("camera", camera)));
        data.extend(inputs.ralidar.map(|ralidar| ("ralidar", ralidar)));
        candle_core::safetensors::save(&data, file("data.safetensors")).unwrap();
        fs::write(file("config.json"), serde_json::to_string(&config).unwrap()).unwrap();
    }
}

fn check(name: &str, model: Model, preset: Preset, frames: usize) {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/torch");
    let text = fs::read_to_string(fixtures.join(format!("{name}.json"))).unwrap();
    let torch: Fixture = serde_json::from_str(&text).unwrap();
    let config = recipe(model, preset);
    let (weights, net, batch) = made(&config, frames);
    let output = net
        .forward(&batch.inputs, &Pass::Learn { seed: 0, step: 0, part: 0, activations: None })
        .unwrap();
    let numbers = |t: &Tensor| t.flatten_all().unwrap().to_vec1::<f32>().unwrap();
    let near = |ours: &[f32], theirs: &[f64], what: &str| {
        assert_eq!(ours.len(), theirs.len(), "{name}: {what}");
        let size = theirs.iter().fold(0f64, |a, b| a.max(b.abs()));
        for (ours, theirs) in ours.iter().zip(theirs) {
            let off = (f64::from(*ours) - theirs).abs();
            assert!(off < 1e-4 * size, "{name}: {what}: {ours} {theirs}");
        }
    };
    near(&numbers(&output.action), &torch.action.concat(), "action");
    if let Some(motion) = &output.motion {
        let every_tenth = Tensor::new(&[0u32, 10, 20], &Cpu).unwrap();
        near(&numbers(&motion.mean.index_select(&every_tenth, 2).unwrap()), &torch.mean, "mean");
    }
    if let Some(speed) = &output.speed {
        near(&numbers(speed), &torch.speed, "speed");
    }
    let sums = LossSums::new(&output, &batch.targets, Assign::Soft).unwrap();
    let total = sums.total(&config.loss, &sums.known).unwrap();
    let loss = f64::from(total.to_scalar::<f32>().unwrap());
    assert!((loss - torch.loss).abs() < 1e-4 * torch.loss.abs(), "{name}: {loss} {}", torch.loss);

    let mut gradient = Gradient::default();
    gradient.add(&weights, backward(&total).unwrap()).unwrap();
    assert!(torch.gradients.len() >= weights.parameters().count(), "{name}");
    for (parameter, theirs) in &torch.gradients {
        let ours = numbers(gradient.get(parameter).unwrap());
        let norm = ours.iter().map(|g| f64::from(*g).powi(2)).sum::<f64>().sqrt();
        let what = format!("{name}: gradient of {parameter}");
        // No further off than f32 is in PyTorch, which is at times much.
        let near = (1e-4 + 2.0 * theirs.f32_off) * theirs.norm;
        assert!((norm - theirs.norm).abs() <= near, "{what}: {norm} {}", theirs.norm);
        let sum = ours.iter().map(|g| f64::from(*g)).sum::<f64>();
        let off = (sum - theirs.sum).abs();
        assert!(off <= near * (ours.len() as f64).sqrt(), "{what}: sum {sum} {}", theirs.sum);
        for (i, entry) in &theirs.entries {
            let off = (f64::from(ours[*i]) - entry).abs();
            assert!(off <= near, "{what}: entry {i}: {} {entry}", ours[*i]);
        }
    }
}

#[test]
fn every_small_network_is_pytorchs_forward_and_backward() {
    for (name, model, preset, frames) in CASES.into_iter().skip(1) {
        check(name, model, preset, frames);
    }
}

#[test]
fn paper_network_is_pytorchs_forward_and_backward() {
    let [(name, model, preset, frames), ..] = CASES;
    check(name, model, preset, frames);
}
