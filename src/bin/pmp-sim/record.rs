//! `pmp-sim record`: recorded drives.

use std::path::PathBuf;

use clap::Args;
use pmp::{
    cli::{self, Outcome},
    error::Result,
    log::writer::LogOptions,
    sim::record::{RecordConfig, record_all},
};

/// Drive on a plain country road and record what the car senses, one MCAP file a drive
///
/// Camera, lidar, radar, odometry, inertial unit, controls and transforms, as ROS 2 messages.
/// The same seed gives the same bytes, whatever --jobs says. Logs that are there already are
/// not overwritten.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Record {
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

const EXAMPLES: &str = "\
Examples:
  pmp-sim record --out logs                              8 drives of a minute each
  pmp-sim record --out logs --seed 7 --episodes 32       32 others
  pmp-sim record --out smoke --episodes 1 --seconds 5    a quick look

The files are named plain-road-SEED-EPISODE.mcap; their paths go to stdout.

Exit codes: 0 all drives recorded; 1 error; 2 bad usage";

pub(crate) fn run(args: Record) -> Result<Outcome> {
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
