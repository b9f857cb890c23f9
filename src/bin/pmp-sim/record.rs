//! `pmp-sim record`: a collection of drives.

use std::path::PathBuf;

use clap::Args;
use pmp::{
    cli::{self, Outcome},
    error::Result,
    scene::conditions::{Illumination, Weather},
    sim::{
        collection::{Collection, Progress, table},
        message::Encoding,
        plan::{Plan, TRAINING_TOWNS},
        record::Recipe,
        rig::Rig,
    },
    world::{density::Density, town::Town},
};

/// Let the expert drive in towns and record what its car senses, one MCAP file a drive
///
/// Camera, lidar, radar, odometry, inertial unit, satellites, route, what the driver wanted and what
/// moved the car, and boxes of all others. Towns, weathers, illuminations and levels of traffic are
/// drawn evenly. The same settings give the same bytes, whatever --jobs says; the same command again
/// goes on where it was stopped, and a larger --episodes adds to what is there.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Record {
    /// Directory to put the logs in; made if it is missing
    #[arg(short, long, value_name = "LOGS")]
    out: PathBuf,

    /// Drives to record; of 9, each of the usual conditions comes once
    #[arg(long, value_name = "N", default_value_t = 9, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    episodes: u32,

    /// What routes, conditions, traffic, people and noise are drawn from
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,

    /// Town to drive in; may be given again [default: Town01 to Town05, or all of --maps]
    #[arg(long = "town", value_name = "T")]
    towns: Vec<String>,

    /// Folder of OpenDRIVE files to drive in, in place of the built-in towns
    #[arg(long, value_name = "DIR")]
    maps: Option<PathBuf>,

    /// Weather; may be given again [default: clear, drizzle and rainy]
    #[arg(long = "weather", value_name = "W")]
    weathers: Vec<Weather>,

    /// Illumination; may be given again [default: daytime, sunset and night]
    #[arg(long = "illumination", value_name = "I")]
    illuminations: Vec<Illumination>,

    /// Level of traffic; may be given again [default: all]
    #[arg(long = "traffic", value_name = "LEVEL")]
    densities: Vec<Density>,

    /// Cut drives off after so many seconds [default: they end at the goal]
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,

    /// Probability of a steering burst in each tenth of a second, for data with recovery
    #[arg(long, value_name = "P", default_value_t = 0.0)]
    perturb: f64,

    /// Messages of Foxglove's schemas, or ROS 2 ones under the names of CARLA's bridge
    #[arg(long, value_name = "E", default_value = "foxglove")]
    encoding: Encoding,

    /// Beams of the lidar
    #[arg(long, value_name = "N", default_value = "32", value_parser = ["32", "64"])]
    beams: String,

    /// Drives at a time [default: one per core]
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,

    /// Print the list of drives, tabs between its columns, and record nothing
    #[arg(long)]
    dry_run: bool,
}

const EXAMPLES: &str = "\
Examples:
  pmp-sim record --out logs --episodes 360                    as much as the paper drove
  pmp-sim record --out logs --episodes 360 --dry-run          which drives these are
  pmp-sim record --out storm --town Town03 --weather storm --illumination night --traffic dense
  pmp-sim record --out ros --encoding ros2 --episodes 1       for tools that know CARLA's bridge
  pmp-sim record --out smoke --episodes 1 --seconds 5         a quick look

The files are named TOWN-WEATHER-ILLUMINATION-TRAFFIC-NUMBER.mcap; their paths go to stdout.

Exit codes: 0 all drives are recorded; 1 error; 2 bad usage";

impl Record {
    fn collection(self) -> Result<Collection> {
        let towns = match (&self.maps, self.towns.is_empty()) {
            (None, true) => TRAINING_TOWNS.map(str::to_string).to_vec(),
            (maps, _) => Town::names(maps.as_deref(), &self.towns)?,
        };
        let usual = Plan::training(self.seed);
        let plan = Plan {
            seed: self.seed,
            towns,
            weathers: chosen(self.weathers, usual.weathers),
            illuminations: chosen(self.illuminations, usual.illuminations),
            densities: chosen(self.densities, usual.densities),
        };
        let mut rig = Rig::default();
        rig.lidar.beams = if self.beams == "64" { 64 } else { 32 };
        let recipe = Recipe {
            rig,
            encoding: self.encoding,
            seconds: self.seconds,
            burst_chance: self.perturb,
        };
        let (out, maps, episodes) = (self.out, self.maps, self.episodes);
        Ok(Collection { out, maps, plan, episodes, recipe })
    }
}

/// What was asked for, each once and in order, or the usual.
fn chosen<T: Ord>(mut asked: Vec<T>, usual: Vec<T>) -> Vec<T> {
    asked.sort();
    asked.dedup();
    if asked.is_empty() { usual } else { asked }
}

pub(crate) fn run(args: Record) -> Result<Outcome> {
    let (jobs, is_dry) = (args.jobs, args.dry_run);
    let collection = args.collection()?;
    if is_dry {
        let episodes = collection.plan.episodes(collection.episodes);
        cli::print(&table(&episodes))?;
        return Ok(Outcome::Done);
    }
    let bar = cli::progress(0, "simulated seconds", "record");
    let tell = |progress| match progress {
        Progress::ToDo(seconds) => bar.set_length(seconds),
        Progress::Second => bar.inc(1),
        Progress::Over { reckoned, driven } => {
            bar.inc_length(driven);
            bar.dec_length(reckoned);
        }
    };
    let logs = cli::thread_pool(jobs)?.install(|| collection.record(&tell))?;
    bar.finish_and_clear();
    for log in logs {
        cli::print(&format!("{}\n", log.display()))?;
    }
    Ok(Outcome::Done)
}
