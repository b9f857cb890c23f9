//! `pmp-ingest`: driving logs in, a sharded dataset out.

use std::{path::PathBuf, process::ExitCode};

use clap::{Args, Parser, Subcommand};
use pmp::{
    cli::{self, Outcome},
    dataset::{
        ingest::{self, Event, Share},
        inspect, manifest,
    },
    error::Result,
    frame::GRID_HZ,
    log::{
        clock::{self, Clock},
        profile::Profile,
        rigs::Rig,
    },
};

/// Turn MCAP driving logs into a sharded Parquet dataset
///
/// Topics are found by their type (`pmp-ingest inspect LOG` shows which), aligned by header stamp
/// (or as `--clock` and `--offset` say) to a 10 Hz grid, and written as frames: camera, lidar and radar on the picture, ego motion,
/// route, what the driver did, and 3 s of what the car did next. Ticks where a needed signal has a
/// gap are left out and counted, never filled.
///
/// Each log commits alone. Give the same command again after a kill, and it goes on where it was;
/// the bytes are the same as without the kill, for any number of jobs.
#[derive(Parser)]
#[command(version, after_help = EXAMPLES, args_conflicts_with_subcommands = true)]
struct Cli {
    #[command(subcommand)]
    command: Option<Inspect>,

    #[command(flatten)]
    ingest: Option<Ingest>,
}

#[derive(Subcommand)]
enum Inspect {
    /// Show topics, types and rates of a log, and the mapping that ingest would use
    Inspect {
        /// MCAP file
        log: PathBuf,
        #[arg(long, default_value = "auto", value_name = "NAME|FILE.toml", help = profile_help())]
        profile: String,
        #[command(flatten)]
        reading: Reading,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
}

/// What flags say of how to read a log.
#[derive(Args)]
#[group(skip)]
struct Reading {
    /// Name the topic of a signal, as camera=/front/image; may be given again
    #[arg(long = "topic", value_name = "SIGNAL=NAME")]
    topics: Vec<String>,

    /// Stamp a topic's messages by another instant than their header's
    #[arg(long, value_name = CLOCK, value_parser = clock::parse_clock)]
    clock: Vec<(String, Clock)>,

    /// Add to the stamps of a topic, as in `--offset /gps=-66.14s` (s, ms, us or ns)
    #[arg(long, value_name = "TOPIC=TIME", value_parser = clock::parse_offset)]
    offset: Vec<(String, f64)>,
}

// Named, since clap does not count the arguments of a struct that has flattened ones in it.
#[derive(Args)]
#[group(args = ["logs", "out"])]
struct Ingest {
    /// MCAP files, or folders searched for `*.mcap`
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<PathBuf>,

    /// Folder to make the dataset in
    #[arg(short, long, value_name = "DATASET")]
    out: PathBuf,

    #[arg(long, default_value = "auto", value_name = "NAME|FILE.toml", help = profile_help())]
    profile: String,

    #[command(flatten)]
    reading: Reading,

    /// Ticks a second
    #[arg(long, default_value_t = GRID_HZ, value_name = "HZ")]
    rate: f64,

    /// Commit only the i-th of n parts of the logs; when all parts are done, the same command
    /// without --shard finishes the dataset
    #[arg(long, value_name = "i/n", value_parser = Share::parse)]
    shard: Option<Share>,

    /// Threads [default: all cores]
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,
}

/// A profile, with what flags say of topics and clocks in place of what it says.
fn profile(name: &str, reading: &Reading) -> Result<Profile> {
    let mut profile = Profile::load(name)?;
    for topic in &reading.topics {
        profile.topics.set(topic)?;
    }
    profile.clock.topics.extend(reading.clock.iter().cloned());
    profile.clock.offset_s.extend(reading.offset.iter().cloned());
    profile.clock.check()?;
    Ok(profile)
}

fn profile_help() -> String {
    let names: Vec<_> = Rig::names().collect();
    format!(
        "How to read the logs: `auto` recognises the rig; a name of one forces it ({}); or a \
         FILE.toml of your own",
        names.join(", ")
    )
}

const CLOCK: &str = "TOPIC=header|log|publish";

const EXAMPLES: &str = "\
Examples:
  pmp-ingest --out data drives/              all logs below a folder
  pmp-ingest --out data a.mcap b.mcap --profile my-car.toml
  pmp-ingest --out data drives/ --shard 2/8  the second of eight processes that share the work
  pmp-ingest --out data a.mcap --topic camera=/front_left/image
  pmp-ingest inspect a.mcap                  what is in a log, and what would be used

Exit codes: 0 everything was used; 3 something was left out, the report says what; 1 failed; 2 misused";

fn main() -> ExitCode {
    let cli = Cli::parse();
    cli::main(|| match (cli.command, cli.ingest) {
        (Some(Inspect::Inspect { log, profile: name, reading, json }), _) => {
            let report = inspect::inspect(&log, &profile(&name, &reading)?)?;
            cli::print(&if json { report.json() } else { report.to_string() })?;
            report.open_question.map_or(Ok(Outcome::Done), Err)
        }
        (None, Some(args)) => run(&args),
        (None, None) => unreachable!("clap asks for LOG"),
    })
}

fn run(args: &Ingest) -> Result<Outcome> {
    let logs = ingest::find_logs(&args.logs)?;
    let profile = profile(&args.profile, &args.reading)?;
    let config = manifest::IngestConfig::new(profile, args.rate)?;
    let bar = cli::progress(0, "frames", "ingest");
    let on = |event| match event {
        Event::Opened { ticks } => bar.inc_length(ticks),
        Event::Made { ticks } => bar.inc(ticks),
    };
    let manifest = cli::thread_pool(args.jobs)?
        .install(|| ingest::ingest(&logs, &args.out, &config, args.shard, &on))?;
    bar.finish_and_clear();
    eprint!("{}", manifest.report());
    let loss = !manifest.failed.is_empty() || manifest.logs.iter().any(|log| log.has_loss());
    Ok(if loss { Outcome::DoneWithLoss } else { Outcome::Done })
}
