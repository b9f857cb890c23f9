//! One training step of the paper's network, and one pass of a policy: CPU time, wall time, memory.
//!
//! `scripts/bench_train.sh` runs it beside PyTorch, with the weights and the batch that PyTorch
//! wrote: `train FOLDER train|forward THREADS WARM STEPS`. It prints a line of JSON. With `gradients`
//! it writes those of one step beside the weights, to be held against PyTorch's.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::{collections::HashMap, fs, path::Path, time::Instant};

use candle_core::{D, Device::Cpu, Tensor};
use candle_nn::{
    Linear, Module, VarBuilder,
    init::{NonLinearity, ZERO},
    ops::{log_softmax, softmax},
};
use pmp::model::{
    init::{Weights, kaiming},
    ops::{
        adam::{Moments, Step, adam_step},
        gradients::backward,
    },
    pass::Pass,
    resnet::ResNet34,
};

/// Modes of the mixture, and its steps of two numbers.
const MODES: usize = 6;
const STEPS: usize = 6;

struct Branch(ResNet34, Linear);

struct Net {
    camera: Branch,
    ralidar: Branch,
    route: [Linear; 2],
    velocity: [Linear; 2],
    attention: Linear,
    action: [Linear; 2],
    motion: [Linear; 2],
}

struct Batch {
    camera: Tensor,
    ralidar: Tensor,
    route: Tensor,
    velocity: Tensor,
    action: Tensor,
    motion: Tensor,
}

fn linear(from: usize, to: usize, vb: VarBuilder) -> Linear {
    let weight = vb.get_with_hints((to, from), "weight", kaiming(NonLinearity::ReLU)).unwrap();
    Linear::new(weight, Some(vb.get_with_hints(to, "bias", ZERO).unwrap()))
}

impl Net {
    fn new(width: usize, feature: usize, vb: VarBuilder) -> Self {
        let branch = |channels: usize, name: &str| {
            let net = ResNet34::new(channels, width, vb.pp(name)).unwrap();
            let fc = linear(net.width(), feature, vb.pp(name).pp("fc"));
            Branch(net, fc)
        };
        let two = |[a, b, c]: [usize; 3], name: &str| {
            let vb = vb.pp(name);
            [linear(a, b, vb.pp("0")), linear(b, c, vb.pp("1"))]
        };
        Self {
            camera: branch(3, "camera"),
            ralidar: branch(4, "ralidar"),
            route: two([260, 512, feature], "route"),
            velocity: two([2, 512, feature], "velocity"),
            attention: linear(feature, 1, vb.pp("attention")),
            action: two([feature, 256, 3], "action"),
            motion: two([feature, 256, MODES * (1 + 4 * STEPS)], "motion"),
        }
    }

    /// Action `[B, 3]` and mixture `[B, modes (1 + 4 steps)]`.
    fn forward(&self, batch: &Batch, pass: &Pass) -> candle_core::Result<[Tensor; 2]> {
        let picture = |Branch(net, fc): &Branch, x: &Tensor| {
            fc.forward(&net.forward(x, pass).unwrap())?.relu()
        };
        let two = |[a, b]: &[Linear; 2], x: &Tensor| b.forward(&a.forward(x)?.relu()?);
        let features = [
            picture(&self.camera, &batch.camera)?,
            picture(&self.ralidar, &batch.ralidar)?,
            two(&self.route, &batch.route)?.relu()?,
            two(&self.velocity, &batch.velocity)?.relu()?,
        ];
        let logits = features.iter().map(|f| self.attention.forward(f));
        let logits = Tensor::cat(&logits.collect::<Result<Vec<_>, _>>()?, 1)?;
        let weights = softmax(&logits, 1)?;
        let mut fused = features[0].broadcast_mul(&weights.narrow(1, 0, 1)?)?;
        for (i, feature) in features.iter().enumerate().skip(1) {
            fused = (fused + feature.broadcast_mul(&weights.narrow(1, i, 1)?)?)?;
        }
        Ok([two(&self.action, &fused)?, two(&self.motion, &fused)?])
    }
}

fn loss([action, motion]: &[Tensor; 2], batch: &Batch) -> candle_core::Result<Tensor> {
    let l1 = (action - &batch.action)?.abs()?.mean_all()?;
    let logits = log_softmax(&motion.narrow(1, 0, MODES)?, 1)?;
    let numbers = motion.narrow(1, MODES, MODES * 4 * STEPS)?.reshape(((), MODES, 4 * STEPS))?;
    let (mean, log_std) =
        (numbers.narrow(2, 0, 2 * STEPS)?, numbers.narrow(2, 2 * STEPS, 2 * STEPS)?);
    let off = batch.motion.unsqueeze(1)?.broadcast_sub(&mean)?;
    let off = (off * log_std.neg()?.exp()?)?;
    let half_log_tau = 0.5 * (2.0 * std::f64::consts::PI).ln();
    let each = (((off.sqr()? * -0.5)? - log_std)? - half_log_tau)?.sum(D::Minus1)?;
    let likelihood = (logits + each)?.log_sum_exp(1)?.mean_all()?;
    l1 - (likelihood * 0.1)?
}

/// CPU seconds of all threads; counted every few milliseconds.
fn cpu() -> f64 {
    let tasks = fs::read_dir("/proc/self/task").unwrap();
    let nanos = tasks.map(|task| {
        let text = fs::read_to_string(task.unwrap().path().join("schedstat")).unwrap_or_default();
        text.split(' ').next().and_then(|n| n.parse::<f64>().ok()).unwrap_or(0.0)
    });
    nanos.sum::<f64>() / 1e9
}

/// The most memory so far, MB.
fn peak() -> f64 {
    let text = fs::read_to_string("/proc/self/status").unwrap();
    let line = text.lines().find(|line| line.starts_with("VmHWM")).unwrap();
    line.split_whitespace().nth(1).unwrap().parse::<f64>().unwrap() / 1024.0
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|arg| arg != "--bench").collect();
    let [folder, mode, threads, warm, steps] = &args[..] else {
        return println!(
            "train FOLDER train|forward|gradients THREADS WARM STEPS; see scripts/bench_train.sh"
        );
    };
    let number = |text: &String| text.parse::<usize>().unwrap();
    let (threads, warm, steps) = (number(threads), number(warm), number(steps));
    pmp_kernels::buffers::keep_freed_memory();
    rayon::ThreadPoolBuilder::new().num_threads(threads).build_global().unwrap();
    let start = peak();

    let read =
        |name: &str| candle_core::safetensors::load(Path::new(folder).join(name), &Cpu).unwrap();
    let mut data: HashMap<String, Tensor> = read("batch.safetensors");
    let mut get = |name: &str| data.remove(name).unwrap();
    let batch = Batch {
        camera: get("camera"),
        ralidar: get("ralidar"),
        route: get("route"),
        velocity: get("velocity"),
        action: get("action"),
        motion: get("motion"),
    };
    let values = read("weights.safetensors");
    let width = values["camera.conv1.weight"].dims()[0];
    let feature = values["camera.fc.weight"].dims()[0];
    let (weights, net) = Weights::new(0, &Cpu, |vb| Ok(Net::new(width, feature, vb))).unwrap();
    weights.set(&values).unwrap();
    drop(values);
    let frozen = VarBuilder::from_tensors(
        weights.snapshot().unwrap().into_iter().collect(),
        candle_core::DType::F32,
        &Cpu,
    );
    let policy = (mode == "forward").then(|| Net::new(width, feature, frozen));
    let base = peak();

    if mode == "gradients" {
        let pass = Pass::Learn { seed: 0, step: 0, part: 0, activations: None };
        let grads = backward(&loss(&net.forward(&batch, &pass).unwrap(), &batch).unwrap()).unwrap();
        let of = |(name, var): (&str, &candle_core::Var)| {
            (name.to_string(), grads.get(var.as_tensor()).unwrap().clone())
        };
        let all: HashMap<String, Tensor> = weights.parameters().map(of).collect();
        let file = Path::new(folder).join("gradients.safetensors");
        return candle_core::safetensors::save(&all, file).unwrap();
    }
    let mut moments: Vec<_> = match mode.as_str() {
        "train" => weights.parameters().map(|(_, var)| Moments::zeros(var).unwrap()).collect(),
        _ => vec![],
    };
    let mut step = |number: u64| {
        if let Some(policy) = &policy {
            let [action, _] = policy.forward(&batch, &Pass::Judge).unwrap();
            return f64::from(action.sum_all().unwrap().to_scalar::<f32>().unwrap());
        }
        let pass = Pass::Learn { seed: 0, step: number, part: 0, activations: None };
        let loss = loss(&net.forward(&batch, &pass).unwrap(), &batch).unwrap();
        let mut grads = backward(&loss).unwrap();
        let adam = Step { number: number + 1, lr: 1e-4, ..Step::default() };
        for ((_, var), moments) in weights.parameters().zip(&mut moments) {
            let grad = grads.remove(var.as_tensor()).unwrap();
            adam_step(var, &grad, moments, &adam).unwrap();
        }
        f64::from(loss.to_scalar::<f32>().unwrap())
    };
    let mut losses: Vec<f64> = (0..warm as u64).map(&mut step).collect();
    let (clock, used) = (Instant::now(), cpu());
    losses.extend((warm as u64..(warm + steps) as u64).map(&mut step));
    let [used, wall] = [cpu() - used, clock.elapsed().as_secs_f64()].map(|x| x / steps as f64);
    println!(
        "{{\"cpu\": {used}, \"wall\": {wall}, \"start\": {start}, \"base\": {base}, \"peak\": {}, \
         \"losses\": {losses:?}}}",
        peak()
    );
}
