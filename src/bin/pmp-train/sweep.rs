//! `pmp-train sweep`: a grid of runs, and a table of what came of them.

use std::{fs, path::PathBuf};

use clap::Args;
use pmp::{
    atomic,
    cli::{self, Outcome},
    error::{Error, Result},
    model::{
        net_config::{Model, Preset},
        run,
        sweep::{expand, table},
    },
};

use crate::{options::use_threads, train::watched};

/// Train every combination of some values, one run after the other
///
/// Each run has its directory in OUT, named by its values. Stopped at any moment, the same command
/// goes on where it was. The last validations are printed as a table, and kept as OUT/sweep.md.
#[derive(Args)]
#[command(after_help = GRID)]
pub(crate) struct Sweep {
    /// Dataset to train on
    #[arg(short, long, value_name = "DATASET")]
    data: PathBuf,

    /// Folder for the run directories
    #[arg(short, long, value_name = "OUT")]
    out: PathBuf,

    /// TOML file with the configuration and its grid
    #[arg(long, value_name = "FILE")]
    grid: PathBuf,

    /// Network to train [default: that of FILE, else pmp]
    #[arg(long, value_name = "NAME")]
    model: Option<Model>,

    /// Sizes to start from [default: those of FILE, else tiny]
    #[arg(long, value_name = "NAME")]
    preset: Option<Preset>,

    /// Threads; the weights do not depend on it [default: all cores]
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,
}

const GRID: &str = "\
FILE is a configuration (schemas/train.toml) with a table of lists:

  preset = \"tiny\"
  [grid]
  lr = [1e-3, 3e-4]
  \"net.modes\" = [1, 3]";

pub(crate) fn run(args: &Sweep) -> Result<Outcome> {
    use_threads(args.jobs)?;
    let text = fs::read_to_string(&args.grid).map_err(Error::io("read", &args.grid))?;
    let runs = expand(&text, args.model, args.preset)?;
    let (mut results, count) = (vec![], runs.len());
    for (i, grid_run) in (1..).zip(runs) {
        let out = args.out.join(&grid_run.name);
        eprintln!("run {i} of {count}: {}", grid_run.name);
        let last = watched(&grid_run.config, &args.data, &out, true, format!("{i}/{count}"))?;
        let last = match last {
            Some(last) => Some(last),
            None => run::last_validation(&out)?, // it was finished before
        };
        results.push((grid_run.name, last));
        let table = table(&results);
        atomic::write(&args.out.join("sweep.md"), table.as_bytes())?;
    }
    cli::print(&table(&results))?;
    Ok(Outcome::Done)
}
