//! `pmp-eval`: policies in, tables out.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use candle_core::Device;
use clap::{Parser, Subcommand, ValueEnum};
use pmp::{
    cli::{self, Outcome},
    dataset::open,
    error::{Error, Result},
    eval::{
        baseline,
        offline::{
            evaluate::evaluate,
            render,
            report::{Dataset, Holdout, HoldoutKind, Report},
            store, summary,
        },
        statistics::Bootstrap,
    },
    model::learned::Learned,
    policy::Policy,
};

/// Measure policies, and make tables of what was measured
#[derive(Parser)]
#[command(version, after_help = AFTER)]
struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Compare plans with what the recorded driver did, on the frames held out from training
    ///
    /// `constant-velocity` and `stand-still` are always evaluated too: a number means little
    /// without them. DIR gets table.md, table.csv, table.tex, speed.svg, errors.parquet (one row
    /// per policy and frame) and report.json, written last. A report that is already there is kept.
    #[command(after_help = AFTER)]
    Offline {
        /// Run directory, or `constant-velocity`, `stand-still`, `recorded` (an oracle); repeatable
        #[arg(long = "policy", value_name = "P", num_args = 1.., required = true)]
        policies: Vec<String>,
        /// Dataset made by pmp-ingest
        #[arg(long, value_name = "DATASET")]
        data: PathBuf,
        /// Directory to write the report to
        #[arg(short, long, value_name = "DIR")]
        out: PathBuf,
        /// Threads; 0 is one per core. Numbers do not depend on it
        #[arg(long, value_name = "N", default_value_t = 0)]
        jobs: usize,
    },
    /// Print one table of one or more reports of the same dataset and frames
    #[command(after_help = AFTER)]
    Table {
        /// Directories that `pmp-eval offline` wrote
        #[arg(value_name = "DIR", required = true)]
        reports: Vec<PathBuf>,
        /// What to print
        #[arg(long, value_name = "FORMAT", default_value = "md")]
        format: Format,
    },
}

#[derive(Clone, Copy, ValueEnum)]
enum Format {
    Md,
    Csv,
    Tex,
    Json,
}

const AFTER: &str = "\
Examples:
  pmp-eval offline --policy runs/tiny --data data/town --out reports/tiny
  pmp-eval offline --policy runs/a runs/b recorded --data data/town --out reports/ab
  pmp-eval table reports/tiny reports/ab --format csv > table.csv

Exit codes: 0 done; 1 failed; 2 misused; 3 done, but not every held-out frame was evaluated";

/// A baseline of that name, or the policy in that run directory.
fn open_policy(name: &str) -> Result<Box<dyn Policy>> {
    if let Some(baseline) = baseline::baseline(name) {
        return Ok(baseline);
    }
    if !Path::new(name).is_dir() {
        return Err(Error::Run {
            path: name.into(),
            what: "neither a run directory nor a baseline".to_string(),
            hint: Some(format!("baselines are {}", baseline::NAMES.join(", "))),
        });
    }
    Ok(Box::new(Learned::open(Path::new(name), &Device::Cpu)?))
}

/// The frames that no policy was trained on, as the report tells of them.
fn holdout(dataset: &open::Dataset) -> Result<Holdout> {
    if dataset.val.is_empty() {
        return Err(Error::Dataset {
            path: dataset.path.clone(),
            what: "no frames are held out: the only episode is too short".to_string(),
            hint: Some("ingest more logs".to_string()),
        });
    }
    let time_block = dataset.holdout.is_time_block;
    Ok(Holdout {
        kind: if time_block { HoldoutKind::TimeBlock } else { HoldoutKind::Episodes },
        how: dataset.holdout.how.clone(),
        weak: time_block,
        frames: dataset.val.len() as u64,
        episodes: dataset.val.episodes as u64,
    })
}

fn offline(policies: &[String], data: &Path, out: &Path, jobs: usize) -> Result<Outcome> {
    store::refuse_existing(out)?;
    let threads = rayon::ThreadPoolBuilder::new().num_threads(jobs).build_global();
    threads.map_err(|error| Error::Config {
        key: "--jobs".to_string(),
        what: error.to_string(),
        hint: None,
    })?;
    let mut names: Vec<&str> = policies.iter().map(String::as_str).collect();
    let missing = ["constant-velocity", "stand-still"].into_iter().filter(|n| !names.contains(n));
    names.extend(missing.collect::<Vec<_>>());
    let mut policies = names.into_iter().map(open_policy).collect::<Result<Vec<_>>>()?;
    let dataset = open::Dataset::open(data)?;
    let holdout = holdout(&dataset)?;
    let bar = cli::progress(holdout.frames, "frames", "evaluating");
    let frames = dataset.frames(&dataset.val).inspect(|_| bar.inc(1));
    let errors = evaluate(&mut policies, frames)?;
    bar.finish_and_clear();
    let report = summary::summarise(Dataset::of(data)?, holdout, &errors, Bootstrap::default());
    store::write(out, &report, &errors)?;
    cli::print(&render::markdown(&report))?;
    let all = report.evaluated.frames == report.holdout.frames;
    Ok(if all { Outcome::Done } else { Outcome::DoneWithLoss })
}

fn table(directories: Vec<PathBuf>, format: Format) -> Result<Outcome> {
    let read = |directory: PathBuf| store::read(&directory).map(|report| (directory, report));
    let report = Report::merge(directories.into_iter().map(read).collect::<Result<_>>()?)?;
    cli::print(&match format {
        Format::Md => render::markdown(&report),
        Format::Csv => render::csv(&report),
        Format::Tex => render::latex(&report),
        Format::Json => store::json(&report)?,
    })?;
    Ok(Outcome::Done)
}

fn main() -> ExitCode {
    cli::main(|| match Args::parse().command {
        Command::Offline { policies, data, out, jobs } => offline(&policies, &data, &out, jobs),
        Command::Table { reports, format } => table(reports, format),
    })
}
