//! `pmp-sim traffic`: towns without an ego vehicle.

use std::{path::PathBuf, time::Instant};

use clap::Args;
use pmp::{
    cli::{self, Outcome},
    error::Result,
    map::road_map::RoadMap,
    noise::{Noise, Purpose},
    world::{
        density::{Counts, Density},
        paving::pave,
        rush_hour::{Report, RushHour},
    },
};
use rayon::prelude::*;

/// Let towns live for an hour without an ego vehicle, and tell whether their traffic can be trusted
///
/// Speeds and stops by the minute, distance, gaps beside the car-following model's own, touches,
/// long stands, lane changes, and what people who cross do to drivers. The same seed gives the
/// same figures, whatever --jobs says.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Traffic {
    /// OpenDRIVE files
    #[arg(value_name = "FILE.xodr", required = true)]
    files: Vec<PathBuf>,

    /// Level of traffic that numbers are drawn for
    #[arg(long, value_name = "LEVEL", default_value = "dense")]
    traffic: Density,

    /// Vehicles, instead of a number drawn
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(..=9_000))]
    vehicles: Option<u16>,

    /// Pedestrians, instead of a number drawn
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16))]
    walkers: Option<u16>,

    /// How long, in minutes
    #[arg(long, value_name = "M", default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    minutes: u32,

    /// What everybody is drawn from
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,

    /// Towns at a time [default: one per core]
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,

    /// Print JSON, a list of one object a town
    #[arg(long)]
    json: bool,
}

const EXAMPLES: &str = "\
Examples:
  pmp-sim traffic Town01.xodr                            an hour of dense traffic
  pmp-sim traffic *.xodr --traffic few --json            an hour of little in each town

Exit codes: 0 done; 1 error; 2 bad usage";

pub(crate) fn run(args: Traffic) -> Result<Outcome> {
    let Traffic { files, traffic, vehicles, walkers, minutes, seed, jobs, json } = args;
    let drawn = traffic.draw(&mut Noise::new(seed, 0, Purpose::Scenery));
    let counts = Counts {
        vehicles: vehicles.map_or(drawn.vehicles, usize::from),
        walkers: walkers.map_or(drawn.walkers, usize::from),
    };
    let hour = RushHour { counts, minutes, seed };
    let total = u64::from(minutes) * files.len() as u64;
    let bar = cli::progress(total, "simulated minutes", "traffic");
    let (steps, begin) = (total * hour.steps_per_minute(), Instant::now());
    let run = |file: &PathBuf| {
        let streets = pave(&RoadMap::read(file)?);
        let name = file.file_stem().unwrap_or_default().to_string_lossy();
        Ok(hour.run(&name, &streets, &|| bar.inc(1)))
    };
    let pool = cli::thread_pool(jobs)?;
    let reports: Vec<Report> = pool.install(|| files.par_iter().map(run).collect::<Result<_>>())?;
    bar.finish_and_clear();
    eprintln!("{:.0} steps/s", steps as f64 / begin.elapsed().as_secs_f64());
    let text = match json {
        true => serde_json::to_string_pretty(&reports).unwrap_or_default() + "\n",
        false => reports.iter().map(ToString::to_string).collect(),
    };
    cli::print(&text)?;
    Ok(Outcome::Done)
}
