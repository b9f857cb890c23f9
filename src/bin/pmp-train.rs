//! `pmp-train`: a dataset in, a run directory out.

use std::{
    fs,
    io::IsTerminal as _,
    path::{Path, PathBuf},
    process::ExitCode,
    sync::Arc,
};

use candle_core::Device;
use clap::Parser;
use pmp::{
    cli::{self, Outcome},
    dataset::{
        loader::{TrainBatches, ValidationBatches},
        open::Dataset,
    },
    error::{Error, Result},
    model::{
        config::{Model, Preset, TrainConfig},
        run,
        train::{Data, Event, train_run},
    },
};

/// Train a driving policy on a dataset made by pmp-ingest
///
/// The run directory holds the configuration, the last checkpoint and the curves
/// (metrics.jsonl). It can drive as soon as it has a checkpoint. Training can be stopped at
/// any moment: with --resume it ends with the same weights, bit for bit, as if it never was.
#[derive(Parser)]
#[command(version, after_help = AFTER)]
struct Args {
    /// Dataset to train on
    #[arg(short, long, value_name = "DATASET")]
    data: PathBuf,

    /// Run directory to create, or to continue with --resume
    #[arg(short, long, value_name = "RUN")]
    out: PathBuf,

    /// Continue a run from its last checkpoint, with the configuration it was started with
    /// (only --steps may be raised); starts it if there is none yet
    #[arg(long)]
    resume: bool,

    /// Network to train [default: pmp]
    #[arg(long, value_name = "NAME", help_heading = "Configuration")]
    model: Option<Model>,

    /// Sizes to start from [default: tiny]
    #[arg(long, value_name = "NAME", help_heading = "Configuration")]
    preset: Option<Preset>,

    /// TOML file with what differs from the preset; the options below win over it
    #[arg(long, value_name = "FILE", help_heading = "Configuration")]
    config: Option<PathBuf>,

    /// Optimiser steps, in all [default: 3000]
    #[arg(long, value_name = "N", help_heading = "Configuration")]
    steps: Option<u64>,

    /// Seed of the weights and of the order of frames [default: 0]
    #[arg(long, value_name = "S", help_heading = "Configuration")]
    seed: Option<u64>,

    /// Frames per step [default: 32]
    #[arg(long, value_name = "N", help_heading = "Configuration")]
    batch_size: Option<usize>,

    /// Threads; the weights do not depend on it [default: all cores]
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,
}

const AFTER: &str = "\
Examples:
  pmp-train --data data/ --out runs/first
  pmp-train --data data/ --out runs/blind --preset nano --seed 1
  pmp-train --data data/ --out runs/first --resume --steps 6000
  pmp-train --data data/ --out runs/mine --config mine.toml

mine.toml, to do without ralidar and plan with more modes:
  preset = \"tiny\"
  motion_weight = 0.2
  [net]
  ralidar = false
  modes = 6

Every key with its value is in RUN/config.json.

Exit codes: 0 trained; 1 error, the run stands at its last checkpoint; 2 bad usage";

impl Args {
    fn config(&self) -> Result<TrainConfig> {
        let saved = if self.resume { run::saved_config(&self.out)? } else { None };
        let mut config = match (&self.config, saved) {
            (Some(file), _) => {
                let text = fs::read_to_string(file).map_err(Error::io("read", file))?;
                TrainConfig::from_toml(&text, self.preset)?
            }
            (None, Some(saved)) => saved,
            (None, None) => TrainConfig::preset(self.preset.unwrap_or_default()),
        };
        config.model = self.model.unwrap_or(config.model);
        config.preset = self.preset.unwrap_or(config.preset);
        config.steps = self.steps.unwrap_or(config.steps);
        config.seed = self.seed.unwrap_or(config.seed);
        config.batch_size = self.batch_size.unwrap_or(config.batch_size);
        Ok(config)
    }
}

fn open_data(path: &Path, config: &TrainConfig, device: &Device) -> Result<Data> {
    let dataset = Arc::new(Dataset::open(path)?);
    let size = config.net.input_size();
    let (batch_size, seed) = (config.batch_size, config.seed);
    let train = TrainBatches::new(dataset.clone(), size, batch_size, seed, device)?;
    let validation = ValidationBatches::new(dataset.clone(), size, device);
    Ok(Data {
        validation_batches: validation.count().min(config.eval_batches),
        train: Box::new(train),
        validation: Box::new(validation),
        identity: dataset.manifest.identity(),
    })
}

fn main() -> ExitCode {
    cli::main(|| {
        let args = Args::parse();
        if let Some(jobs) = args.jobs {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(jobs).build_global();
            pool.map_err(|e| Error::Config {
                key: "jobs".into(),
                what: e.to_string(),
                hint: None,
            })?;
        }
        let (config, device) = (args.config()?, Device::Cpu);
        config.validate()?;
        let mut data = open_data(&args.data, &config, &device)?;

        let bar = cli::progress(config.steps, "steps", "training");
        let say = |text: String| match std::io::stderr().is_terminal() {
            true => bar.println(text),
            false => eprintln!("{text}"),
        };
        let number = |x: Option<f64>| x.map_or("-".into(), |x| format!("{x:.4}"));
        train_run(&config, &args.out, args.resume, &mut data, &device, &mut |event| {
            match event {
                Event::Started { step, parameters } => {
                    bar.set_position(*step);
                    say(format!("{parameters} parameters, from step {step} of {}", config.steps));
                }
                Event::Trained { line, log } => {
                    bar.set_position(line.step);
                    let terms = &line.terms;
                    let (action, motion) = (number(terms.action), number(terms.motion));
                    let text = format!("loss {:.4}, action {action}, motion {motion}", terms.total);
                    if *log && !std::io::stderr().is_terminal() {
                        say(format!("step {}: {text}", line.step));
                    }
                    bar.set_message(text);
                }
                Event::Validated(line) => {
                    let terms = &line.terms;
                    let (action, motion) = (number(terms.action), number(terms.motion));
                    say(format!("step {}: validation action {action}, motion {motion}", line.step));
                }
                Event::Checkpoint { .. } => {}
            }
            Ok(())
        })?;
        bar.finish_and_clear();
        Ok(Outcome::Done)
    })
}
