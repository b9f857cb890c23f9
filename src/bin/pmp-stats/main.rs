//! `pmp-stats`: a dataset in, numbers, pictures and verdicts out.

mod check;
mod edit;
mod export;
#[cfg(feature = "reports")]
mod report;

use std::process::ExitCode;

use clap::{CommandFactory as _, Parser, Subcommand, error::ErrorKind};
use pmp::cli;

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
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
struct Args {
    #[cfg(feature = "reports")]
    #[command(flatten)]
    report: Option<report::Report>,

    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Subcommand)]
enum Command {
    Check(check::Check),
    /// Put datasets together into a new one; prints its identity
    Merge(edit::Merge),
    /// Make a new dataset without some episodes; prints its identity
    Drop(edit::Drop),
    /// Make a new dataset with other episodes to train and to judge; prints its identity
    Resplit(edit::Resplit),
    /// Write a dataset in the layout of other readers
    Export(export::Export),
}

const EXAMPLES: &str = "\
Examples:
  pmp-stats data                             one screen
  pmp-stats data --json > stats.json         the same as data
  pmp-stats data --json | jq .splits.train.hours
  pmp-stats data --html data.html            a page to look at
  pmp-stats check data                       what would hurt a training run
  pmp-stats merge monday tuesday --out week
  pmp-stats drop week --log tunnel.mcap --out week-2
  pmp-stats resplit week-2 --val-town Town02 --out week-3
  pmp-stats export week --format lerobot --out week-lerobot

Exit codes: 0 done; 1 failed, for example because the folder is no whole dataset; 2 misused";

fn main() -> ExitCode {
    cli::main(|| match Args::parse() {
        Args { command: Some(Command::Check(check)), .. } => check::run(&check),
        Args { command: Some(Command::Merge(merge)), .. } => edit::run_merge(&merge),
        Args { command: Some(Command::Drop(drop)), .. } => edit::run_drop(&drop),
        Args { command: Some(Command::Resplit(resplit)), .. } => edit::run_resplit(&resplit),
        Args { command: Some(Command::Export(export)), .. } => export::run(&export),
        #[cfg(feature = "reports")]
        Args { report: Some(report), .. } => report::run(&report),
        // Without a subcommand the report's dataset is required.
        _ => Args::command().error(ErrorKind::MissingSubcommand, "give a dataset").exit(),
    })
}
