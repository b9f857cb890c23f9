//! `pmp-sim towns`: the towns of the package.

use std::path::PathBuf;

use clap::Args;
use pmp::{
    cli::{self, Outcome},
    error::Result,
    towns::catalogue::write_all,
};

/// Write seven towns as OpenDRIVE maps: Town01.xodr to Town07.xodr
///
/// Their paths go to stdout. A file that is there with other bytes is not overwritten.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Towns {
    /// Directory to put the maps in; made if it is missing
    #[arg(short, long, value_name = "DIR")]
    out: PathBuf,
}

const EXAMPLES: &str = "\
Examples:
  pmp-sim towns --out maps                                   seven files
  pmp-sim map maps/Town03.xodr --picture town3.png           what one looks like

Exit codes: 0 all towns are there; 1 error; 2 bad usage";

pub(crate) fn run(args: &Towns) -> Result<Outcome> {
    for map in write_all(&args.out)? {
        cli::print(&format!("{}\n", map.display()))?;
    }
    Ok(Outcome::Done)
}
