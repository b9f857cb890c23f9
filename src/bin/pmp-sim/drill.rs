//! `pmp-sim drill`: the expert in all towns.

use std::path::PathBuf;

use clap::Args;
use pmp::{
    cli::{self, Outcome},
    error::Result,
    world::{
        density::Density,
        drill,
        expert::ExpertConfig,
        town::{LENGTHS_M, Town},
    },
};

/// Let the expert drive in towns with traffic, and say who arrived and why not
///
/// One line a drive goes to stdout, then the sums of each town and level of traffic. The same seed
/// gives the same drives on any number of threads; the hash of the last state tells.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Drill {
    /// Town to drive in; may be given again [default: all]
    #[arg(long = "town", value_name = "T")]
    towns: Vec<String>,

    /// Folder of OpenDRIVE files to drive in, in place of the built-in towns
    #[arg(long, value_name = "DIR")]
    maps: Option<PathBuf>,

    /// Level of traffic; may be given again [default: empty, regular and dense]
    #[arg(long = "traffic", value_name = "LEVEL")]
    densities: Vec<Density>,

    /// Drives in each town and level
    #[arg(long, value_name = "N", default_value_t = 18, value_parser = clap::value_parser!(u32).range(1..))]
    episodes: u32,

    /// What routes, traffic and people are drawn from
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,

    /// Probability of a steering burst in each tenth of a second, for data with recovery
    #[arg(long, value_name = "P", default_value_t = 0.0)]
    perturb: f64,

    /// Threads [default: all cores]
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,

    /// Print JSON lines, one a drive
    #[arg(long)]
    json: bool,
}

const EXAMPLES: &str = "\
Examples:
  pmp-sim drill                                              18 drives in each of 7 towns x 3 levels
  pmp-sim drill --town Town03 --traffic dense --episodes 4   a quick look
  pmp-sim drill --maps carla/maps --town Town01              on a map of your own

Exit codes: 0 driven, whether or not all arrived; 1 error; 2 bad usage";

pub(crate) fn run(args: &Drill) -> Result<Outcome> {
    let towns = Town::choose(args.maps.as_deref(), &args.towns)?;
    let densities = match &args.densities[..] {
        [] => vec![Density::Empty, Density::Regular, Density::Dense],
        chosen => chosen.to_vec(),
    };
    let total = towns.len() as u64 * densities.len() as u64 * u64::from(args.episodes);
    let expert = ExpertConfig { burst_chance: args.perturb, ..ExpertConfig::default() };
    let (episodes, seed) = (args.episodes, args.seed);
    let drill = drill::Drill { densities, episodes, lengths_m: LENGTHS_M, seed, expert };
    let bar = cli::progress(total, "drives", "drill");
    let drives =
        cli::thread_pool(args.jobs)?.install(|| drill::run(&towns, &drill, &|_| bar.inc(1)));
    bar.finish_and_clear();
    let report = drill::Report::new(drives);
    cli::print(&if args.json { report.json_lines() } else { report.to_string() })?;
    Ok(Outcome::Done)
}
