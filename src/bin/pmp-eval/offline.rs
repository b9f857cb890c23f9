//! `pmp-eval offline`: policies and a dataset in, a report out.

use std::path::PathBuf;

use clap::Args;
use pmp::{
    cli::{self, Outcome},
    dataset::open,
    error::{Error, Result},
    eval::{
        offline::{
            evaluate::evaluate,
            render,
            report::{Dataset, Holdout, HoldoutKind},
            store, summary,
        },
        statistics::Bootstrap,
    },
};

use crate::policies;

/// Compare plans with what the recorded driver did, on the frames held out from training
///
/// `constant-velocity` and `stand-still` are always evaluated too: a number means little
/// without them. DIR gets table.md, table.csv, table.tex, speed.svg, errors.parquet (one row
/// per policy and frame) and report.json, written last. A report that is already there is kept.
#[derive(Args)]
#[command(after_help = crate::AFTER)]
pub(crate) struct Offline {
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
}

/// The frames that no policy was trained on, as the report tells of them.
pub(crate) fn holdout(dataset: &open::Dataset) -> Result<Holdout> {
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

pub(crate) fn run(args: &Offline) -> Result<Outcome> {
    store::refuse_existing(&args.out)?;
    let threads = rayon::ThreadPoolBuilder::new().num_threads(args.jobs).build_global();
    threads.map_err(|error| Error::Config {
        key: "--jobs".to_string(),
        what: error.to_string(),
        hint: None,
    })?;
    let mut names: Vec<&str> = args.policies.iter().map(String::as_str).collect();
    let missing = ["constant-velocity", "stand-still"].into_iter().filter(|n| !names.contains(n));
    names.extend(missing.collect::<Vec<_>>());
    let mut policies = names.into_iter().map(policies::open).collect::<Result<Vec<_>>>()?;
    let dataset = open::Dataset::open(&args.data)?;
    let holdout = holdout(&dataset)?;
    let bar = cli::progress(holdout.frames, "frames", "evaluating");
    let frames = dataset.frames(&dataset.val).inspect(|_| bar.inc(1));
    let errors = evaluate(&mut policies, frames)?;
    bar.finish_and_clear();
    let report =
        summary::summarise(Dataset::of(&args.data)?, holdout, &errors, Bootstrap::default());
    store::write(&args.out, &report, &errors)?;
    cli::print(&render::markdown(&report))?;
    let all = report.evaluated.frames == report.holdout.frames;
    Ok(if all { Outcome::Done } else { Outcome::DoneWithLoss })
}
