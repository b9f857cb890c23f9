//! `pmp-sim`: drives that the package makes itself, and the maps for them.

use std::{path::PathBuf, process::ExitCode};

use clap::{Args, Parser, Subcommand};
use pmp::{
    cli::{self, Outcome},
    error::Result,
    log::writer::LogOptions,
    map::{answers::MapAnswers, picture::draw, road_map::RoadMap},
    sim::record::{RecordConfig, record_all},
    towns::{
        catalogue::write_all,
        scenery::{collection::Scenery, drawing::outlines},
    },
    world::{
        density::Density,
        drill::{self, LENGTHS_M},
        expert::ExpertConfig,
        town::Town,
    },
};

/// Make driving logs in an embedded simulator, and look at maps
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
    Towns(Towns),
    Drill(Drill),
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

    /// Draw the map, north up; SVG or PNG by the ending of the name. Replaces what is there
    #[arg(long, value_name = "FILE.png|svg")]
    picture: Option<PathBuf>,

    /// Draw the buildings, trees and fields of this seed as well
    #[arg(long, value_name = "SEED", requires = "picture")]
    scenery: Option<u64>,
}

/// Write seven towns as OpenDRIVE maps: Town01.xodr to Town07.xodr
///
/// Their paths go to stdout. A file that is there with other bytes is not overwritten.
#[derive(Args)]
#[command(after_help = AFTER_TOWNS)]
struct Towns {
    /// Directory to put the maps in; made if it is missing
    #[arg(short, long, value_name = "DIR")]
    out: PathBuf,
}

/// Let the expert drive in towns with traffic, and say who arrived and why not
///
/// One line a drive goes to stdout, then the sums of each town and level of traffic. The same seed
/// gives the same drives on any number of threads; the hash of the last state tells.
#[derive(Args)]
#[command(after_help = AFTER_DRILL)]
struct Drill {
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
  pmp-sim map Town01.xodr --picture Town01.png           and what it looks like
  pmp-sim map Town01.xodr --picture Town01.png --scenery 1   with houses and trees
  pmp-sim map Town01.xodr --json --points places.json    the lanes that places lie on

JSON goes to stdout, notes on what was mended or left out to stderr.

Exit codes: 0 done; 1 error; 2 bad usage";

const AFTER_TOWNS: &str = "\
Examples:
  pmp-sim towns --out maps                                   seven files
  pmp-sim map maps/Town03.xodr --picture town3.png           what one looks like

Exit codes: 0 all towns are there; 1 error; 2 bad usage";

const AFTER_DRILL: &str = "\
Examples:
  pmp-sim drill                                              18 drives in each of 7 towns x 3 levels
  pmp-sim drill --town Town03 --traffic dense --episodes 4   a quick look
  pmp-sim drill --maps carla/maps --town Town01              on a map of your own

Exit codes: 0 driven, whether or not all arrived; 1 error; 2 bad usage";

fn main() -> ExitCode {
    let Cli { command } = Cli::parse();
    cli::main(|| match command {
        Command::Record(args) => record(args),
        Command::Map(args) => map(args),
        Command::Towns(args) => towns(&args),
        Command::Drill(args) => drill(&args),
    })
}

fn map(args: Map) -> Result<Outcome> {
    let Map { file, json, points, routes, picture, scenery } = args;
    let map = RoadMap::read(&file)?;
    let mut answers = MapAnswers::new(&map);
    if let Some(points) = points {
        answers = answers.with_points(&map, &points)?;
    }
    if let Some(routes) = routes {
        answers = answers.with_routes(&map, &routes)?;
    }
    if let Some(picture) = picture {
        let beside = scenery.map(|seed| outlines(&Scenery::derive(&map, seed)));
        draw(&map, &beside.unwrap_or_default(), &picture)?;
    }
    for note in map.notes() {
        eprintln!("note: {note}");
    }
    cli::print(&if json { answers.json() } else { answers.text(&map) })?;
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

fn towns(args: &Towns) -> Result<Outcome> {
    for map in write_all(&args.out)? {
        cli::print(&format!("{}\n", map.display()))?;
    }
    Ok(Outcome::Done)
}

fn drill(args: &Drill) -> Result<Outcome> {
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
