//! `pmp-train`: a dataset in, a run directory out.

mod describe;
mod options;
mod sweep;
mod train;

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use pmp::cli;

/// Train a driving policy on a dataset made by pmp-ingest
///
/// The run directory holds the configuration, checkpoints and the curves (metrics.jsonl,
/// curves.svg, and a file for TensorBoard). It can drive as soon as it has a checkpoint. Training
/// can be stopped at any moment: with --resume it ends with the same weights, on the CPU bit for
/// bit, as if it never was.
#[derive(Parser)]
#[command(version, after_help = AFTER, args_conflicts_with_subcommands = true)]
struct Args {
    #[command(subcommand)]
    command: Option<Command>,

    #[command(flatten)]
    train: train::Train,
}

#[derive(Subcommand)]
enum Command {
    Sweep(sweep::Sweep),
}

const AFTER: &str = "\
Examples:
  pmp-train --data data/ --out runs/first
  pmp-train --data data/ --out runs/blind --model blind --seed 1
  pmp-train --data data/ --out runs/no-camera --disable camera
  pmp-train --data data/ --out runs/first --resume --steps 6000
  pmp-train --data data/ --out runs/mine --config mine.toml
  pmp-train --data data/ --out runs/paper --preset paper --device cuda
  pmp-train --describe --model int --preset paper
  pmp-train sweep --data data/ --out runs/grid --grid grid.toml

mine.toml, to plan with more modes:
  preset = \"tiny\"
  [loss]
  motion_weight = 0.2
  [net]
  modes = 6

Every key with its meaning is in schemas/train.toml, every key with its value in RUN/config.json.

Exit codes: 0 trained; 1 error, the run stands at its last checkpoint; 2 bad usage";

fn main() -> ExitCode {
    // Before there are other threads: a step frees and takes the same large buffers as the last.
    pmp_kernels::buffers::keep_freed_memory();
    let Args { command, train } = Args::parse();
    cli::main(|| match command {
        Some(Command::Sweep(args)) => sweep::run(&args),
        None if train.describe => describe::run(&train.options),
        None => train::run(&train),
    })
}
