//! `pmp-eval`: policies in, tables out.

mod policies;
mod offline;
mod calibrate;
mod drive;
mod table;

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use pmp::cli;

/// Measure policies, and make tables of what was measured
#[derive(Parser)]
#[command(version, after_help = AFTER)]
struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Offline(offline::Offline),
    Drive(drive::Drive),
    Calibrate(calibrate::Calibrate),
    Table(table::Table),
}

const AFTER: &str = "\
Examples:
  pmp-eval offline --policy runs/tiny --data data/town --out reports/tiny
  pmp-eval offline --policy runs/a runs/b recorded --data data/town --out reports/ab
  pmp-eval drive --policy runs/tiny expert --suite deeptest --quick --out drives/quick
  pmp-eval calibrate --policy runs/tiny --data data/town
  pmp-eval table reports/tiny reports/ab --format csv > table.csv
  pmp-eval table driven/ --reference paper

Exit codes: 0 done; 1 failed; 2 misused; 3 done, but not every held-out frame was evaluated";

fn main() -> ExitCode {
    pmp_kernels::buffers::keep_freed_memory();
    cli::main(|| match Args::parse().command {
        Command::Offline(args) => offline::run(&args),
        Command::Drive(args) => drive::run(&args),
        Command::Calibrate(args) => calibrate::run(&args),
        Command::Table(args) => table::run(&args),
    })
}
