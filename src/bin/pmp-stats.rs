//! `pmp-stats`: a dataset in, one screen of numbers out.

use std::{path::PathBuf, process::ExitCode};

use clap::Parser;
use pmp::{
    cli::{self, Outcome},
    stats::query,
};

/// Show what is in a dataset, what is missing, and what was left out
///
/// One screen: amounts by split, shares of frames that have each signal, quantiles of speed,
/// controls and time skews over all frames, frames by command, route and conditions, and what of
/// the logs did not make it into the dataset. `–` stands for what does not exist.
///
/// A skew is sample time minus frame time; its mean is signed, its quantiles are of the absolute
/// value. A share counts the frames whose value is not null.
#[derive(Parser)]
#[command(version, after_help = EXAMPLES)]
struct Args {
    /// Dataset made by pmp-ingest
    dataset: PathBuf,

    /// Print one JSON object; its fields are described in schemas/stats.v1.json
    #[arg(long)]
    json: bool,
}

const EXAMPLES: &str = "\
Examples:
  pmp-stats data                             one screen
  pmp-stats data --json > stats.json         the same as data
  pmp-stats data --json | jq .splits.train.hours

Exit codes: 0 done; 1 failed, for example because the folder is no whole dataset; 2 misused";

fn main() -> ExitCode {
    let args = Args::parse();
    cli::main(|| {
        let summary = query::summarise(&args.dataset)?;
        cli::print(&if args.json { summary.json() } else { summary.screen().to_string() })?;
        Ok(Outcome::Done)
    })
}
