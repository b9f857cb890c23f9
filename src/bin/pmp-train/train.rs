//! One training, watched.

use std::{
    io::IsTerminal as _,
    path::{Path, PathBuf},
};

use candle_core::DeviceLocation;
use clap::Args;
use indicatif::ProgressBar;
use pmp::{
    cli::{self, Outcome},
    error::Result,
    model::{
        config::TrainConfig,
        metrics::ValidationLine,
        run,
        train::{Event, train_run},
    },
};

use crate::options::{Options, open_data, use_threads};

#[derive(Args)]
pub(crate) struct Train {
    /// Dataset to train on
    #[arg(short, long, value_name = "DATASET", required_unless_present = "describe")]
    data: Option<PathBuf>,

    /// Run directory to create, or to continue with --resume
    #[arg(short, long, value_name = "RUN", required_unless_present = "describe")]
    out: Option<PathBuf>,

    /// Continue a run from its last checkpoint, with the configuration it was started with
    /// (only --steps may be raised, --device changed); starts it if there is none yet
    #[arg(long)]
    resume: bool,

    /// Print the network's layers with shapes, parameters and operations, and train nothing
    #[arg(long)]
    pub(crate) describe: bool,

    #[command(flatten)]
    pub(crate) options: Options,

    /// Threads; the weights do not depend on it [default: all cores]
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,
}

pub(crate) fn run(args: &Train) -> Result<Outcome> {
    // clap sees to it that both are there.
    let (Some(data), Some(out)) = (&args.data, &args.out) else { return Ok(Outcome::Done) };
    use_threads(args.jobs)?;
    let saved = if args.resume { run::saved_config(out)? } else { None };
    let config = args.options.config(saved)?;
    watched(&config, data, out, args.resume, "training".into())?;
    Ok(Outcome::Done)
}

/// Train with a bar where stderr is a terminal, else with lines; the last validation.
pub(crate) fn watched(
    config: &TrainConfig,
    data: &Path,
    out: &Path,
    resume: bool,
    what: String,
) -> Result<Option<ValidationLine>> {
    let device = config.device.open()?;
    let mut data = open_data(data, config, &device)?;
    let bar = cli::progress(config.steps, "steps", what);
    let mut last = None;
    train_run(config, out, resume, &mut data, &device, &mut |event| {
        show(event, config, device.location(), &bar);
        if let Event::Validated { line, .. } = event {
            last = Some(line.clone());
        }
        Ok(())
    })?;
    bar.finish_and_clear();
    Ok(last)
}

fn show(event: &Event, config: &TrainConfig, place: DeviceLocation, bar: &ProgressBar) {
    let is_terminal = std::io::stderr().is_terminal();
    let say = |text: String| match is_terminal {
        true => bar.println(text),
        false => eprintln!("{text}"),
    };
    let number = |x: Option<f64>| x.map_or("-".into(), |x| format!("{x:.4}"));
    match event {
        Event::Started { step, parameters } => {
            bar.set_position(*step);
            let place = match place {
                DeviceLocation::Cuda { gpu_id } => format!("GPU {gpu_id}"),
                _ => "the CPU".to_string(),
            };
            let steps = config.steps;
            say(format!("{parameters} parameters, from step {step} of {steps}, on {place}"));
        }
        Event::Trained { line, log } => {
            bar.set_position(line.step);
            let terms = &line.terms;
            let (action, motion) = (number(terms.action), number(terms.motion));
            let text = format!("loss {:.4}, action {action}, motion {motion}", terms.total);
            if *log && !is_terminal {
                say(format!("step {}: {text}", line.step));
            }
            bar.set_message(text);
        }
        Event::Validated { line, best } => {
            let terms = &line.terms;
            let (action, motion) = (number(terms.action), number(terms.motion));
            let best = if *best { ", the best so far" } else { "" };
            say(format!("step {}: validation action {action}, motion {motion}{best}", line.step));
        }
        Event::StoppedEarly { step } => {
            let patience = config.patience;
            say(format!("ended at step {step}: {patience} validations did not improve"));
        }
        Event::Checkpoint { .. } => {}
    }
}
