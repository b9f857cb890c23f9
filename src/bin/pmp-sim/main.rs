//! `pmp-sim`: drives that the package makes itself, and the towns for them.

mod drill;
mod map;
mod record;
mod sheet;
mod towns;
mod traffic;

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use pmp::cli;

/// Make driving logs in an embedded simulator, look at maps and towns, and test what drives there
#[derive(Parser)]
#[command(version, after_help = EXAMPLES)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Record(record::Record),
    Map(map::Map),
    Towns(towns::Towns),
    Traffic(traffic::Traffic),
    Drill(drill::Drill),
    Sheet(sheet::Sheet),
}

const EXAMPLES: &str = "\
Examples:
  pmp-sim record --out logs                              9 drives of the expert in towns
  pmp-sim towns --out maps                               seven towns, as OpenDRIVE
  pmp-sim map maps/Town03.xodr --picture town3.png       what one looks like
  pmp-sim traffic maps/Town03.xodr                       an hour of its traffic
  pmp-sim drill --town Town03 --traffic dense            the expert drives there
  pmp-sim sheet --out weather.png                        the camera under 16 skies

Exit codes: 0 done; 1 error; 2 bad usage";

fn main() -> ExitCode {
    let Cli { command } = Cli::parse();
    cli::main(|| match command {
        Command::Record(args) => record::run(args),
        Command::Map(args) => map::run(args),
        Command::Towns(args) => towns::run(&args),
        Command::Traffic(args) => traffic::run(args),
        Command::Drill(args) => drill::run(&args),
        Command::Sheet(args) => sheet::run(&args),
    })
}
