//! How fast one core makes batches: samples a CPU-second over the first epoch of a dataset.
//!
//! `scripts/bench_loader.sh` runs it, one thread, and nothing of it is in a cache yet. Arguments:
//! the dataset, height, width.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::{fs, path::Path, sync::Arc};

use candle_core::Device;
use pmp::dataset::{
    batch::Batches as _,
    loader::{SamplingConfig, TrainBatches},
    open::Dataset,
    sample::InputSize,
};

/// As the peer has it.
const BATCH: usize = 16;

/// A hundredth of a second, the kernel's clock of processes.
const TICKS_PER_S: f64 = 100.0;

fn main() {
    // As in training: a batch of these is 67 MB, which the kernel would hand out page by page anew.
    pmp_kernels::buffers::keep_freed_memory();
    let mut args = std::env::args().skip(1).filter(|arg| arg != "--bench");
    let data = args.next().expect("a dataset");
    let mut side = || args.next().map(|side| side.parse().unwrap());
    let size = side().zip(side()).map(|(height, width)| InputSize { height, width });
    let dataset = Arc::new(Dataset::open(Path::new(&data)).unwrap());
    let sampling = SamplingConfig::default();
    let mut batches = TrainBatches::new(dataset, size, BATCH, 0, &sampling, &Device::Cpu).unwrap();
    let (steps, before) = (batches.steps_per_epoch(), cpu_s());
    let mut sum = 0.0;
    for step in 0..steps {
        let batch = batches.batch(step).unwrap();
        sum += batch.targets.speed_mps.sum_all().unwrap().to_scalar::<f32>().unwrap();
    }
    let (samples, spent) = (steps * BATCH as u64, cpu_s() - before);
    println!("samples {samples} cpu_s {spent:.2} checksum {sum:.3}");
}

/// CPU time of this process, all threads, user and system.
fn cpu_s() -> f64 {
    let stat = fs::read_to_string("/proc/self/stat").unwrap();
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap().split_whitespace().collect();
    let ticks = |i: usize| fields[i].parse::<f64>().unwrap();
    (ticks(11) + ticks(12)) / TICKS_PER_S
}
