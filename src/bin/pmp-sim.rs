//! `pmp-sim`: drives that the package makes itself.

use std::{path::PathBuf, process::ExitCode, time::Instant};

use clap::{Args, Parser, Subcommand};
use pmp::{
    cli::{self, Outcome},
    error::Result,
    log::writer::LogOptions,
    map::{answers::MapAnswers, road_map::RoadMap},
    noise::{Noise, Purpose},
    sim::record::{RecordConfig, record_all},
    world::{
        density::{Counts, Density},
        paving::pave,
        rush_hour::{Report, RushHour},
    },
};
use rayon::prelude::*;

/// Make driving logs in an embedded simulator
#[derive(Parser)]
#[command(version, after_help = AFTER)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Record(Record),
    Map(Map),
    Traffic(Traffic),
}

/// Drive on a plain country road and record what the car senses, one MCAP file a drive
///
/// Camera, lidar, radar, odometry, inertial unit, controls and transforms, as ROS 2 messages.
/// The same seed gives the same bytes, whatever --jobs says. Logs that are there already are
/// not overwritten.
#[derive(Args)]
#[command(after_help = AFTER)]
struct Record {
    /// Directory to put the logs in; made if it is missing
    #[arg(short, long, value_name = "LOGS")]
    out: PathBuf,

    /// Drives to record
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..))]
    episodes: u32,

    /// What road, traffic, driver and noise are drawn from
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,

    /// Length of each drive, in seconds
    #[arg(long, value_name = "S", default_value_t = 60.0)]
    seconds: f64,

    /// Drives at a time [default: one per core]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    jobs: usize,
}

/// Read an OpenDRIVE map: its figures, nearest lanes, routes and a picture of it
///
/// Places are in the map's frame: x east, y north, metres (CARLA's y has the opposite sign).
/// Lanes are named road/section/lane. Lengths and costs are counted as CARLA counts its
/// waypoints, between the first and the last half metre of each lane.
#[derive(Args)]
#[command(after_help = AFTER_MAP)]
struct Map {
    /// OpenDRIVE file
    #[arg(value_name = "FILE.xodr")]
    file: PathBuf,

    /// Print JSON; answers to --points and --routes are in it as `points` and `routes`
    #[arg(long)]
    json: bool,

    /// Find the nearest driving lane to each place of a file: [[x, y], ...]
    #[arg(long, value_name = "FILE.json")]
    points: Option<PathBuf>,

    /// Plan the ways of a file: [{"start": "road/section/lane", "goal": "road/section/lane",
    /// "lane_change_m": 30.0}, ...], from lane start to lane start
    #[arg(long, value_name = "FILE.json")]
    routes: Option<PathBuf>,
}

/// Let towns live for an hour without an ego vehicle, and tell whether their traffic can be trusted
///
/// Speeds and stops by the minute, distance, gaps beside the car-following model's own, touches,
/// long stands, lane changes, and what people who cross do to drivers. The same seed gives the
/// same figures, whatever --jobs says.
#[derive(Args)]
#[command(after_help = AFTER_TRAFFIC)]
struct Traffic {
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

const AFTER: &str = "\
Examples:
  pmp-sim record --out logs                              8 drives of a minute each
  pmp-sim record --out logs --seed 7 --episodes 32       32 others
  pmp-sim record --out smoke --episodes 1 --seconds 5    a quick look

The files are named plain-road-SEED-EPISODE.mcap; their paths go to stdout.

Exit codes: 0 all drives recorded; 1 error; 2 bad usage";

const AFTER_MAP: &str = "\
Examples:
  pmp-sim map Town01.xodr                                what the map has
  pmp-sim map Town01.xodr --json --points places.json    the lanes that places lie on

Exit codes: 0 done; 1 error; 2 bad usage";

const AFTER_TRAFFIC: &str = "\
Examples:
  pmp-sim traffic Town01.xodr                            an hour of dense traffic
  pmp-sim traffic *.xodr --traffic few --json            an hour of little in each town

Exit codes: 0 done; 1 error; 2 bad usage";

fn main() -> ExitCode {
    let Cli { command } = Cli::parse();
    cli::main(|| match command {
        Command::Record(args) => record(args),
        Command::Map(args) => map(args),
        Command::Traffic(args) => traffic(args),
    })
}

fn map(args: Map) -> Result<Outcome> {
    let Map { file, json: _, points, routes } = args;
    let map = RoadMap::read(&file)?;
    let mut answers = MapAnswers::new(&map);
    if let Some(points) = points {
        answers = answers.with_points(&map, &points)?;
    }
    if let Some(routes) = routes {
        answers = answers.with_routes(&map, &routes)?;
    }
    cli::print(&(serde_json::to_string_pretty(&answers).unwrap_or_default()))?;
    Ok(Outcome::Done)
}

fn traffic(args: Traffic) -> Result<Outcome> {
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

fn record(args: Record) -> Result<Outcome> {
    let Record { out, episodes, seed, seconds, jobs } = args;
    let total = u64::from(episodes) * seconds.max(0.0) as u64;
    let bar = cli::progress(total, "simulated seconds", "record");
    let config = RecordConfig { out, seed, episodes, seconds, jobs, log: LogOptions::default() };
    let logs = record_all(&config, &|| bar.inc(1))?;
    bar.finish_and_clear();
    for log in logs {
        cli::print(&format!("{}\n", log.display()))?;
    }
    Ok(Outcome::Done)
}
