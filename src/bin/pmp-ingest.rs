//! `pmp-ingest`: driving logs in, a sharded dataset out.

use std::{path::PathBuf, process::ExitCode};

use clap::{Args, Parser, Subcommand};
use mimalloc::MiMalloc;
use pmp::{
    cli::{self, Outcome},
    dataset::{
        ingest::ingest,
        ingest_event::Event,
        inspect,
        logs::{GivenLog, find_logs},
        manifest,
        plan::Share,
        publish::ingest_to,
    },
    error::{Error, Result},
    frame::GRID_HZ,
    ingest_progress::IngestProgress,
    log::{
        clock::{self, Clock},
        profile::Profile,
        rigs::Rig,
    },
    remote::{location::Location, spool},
};

#[global_allocator]
static ALLOCATOR: MiMalloc = MiMalloc;

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
        /// MCAP file, or its URL
        log: Location,
        #[arg(long, default_value = "auto", value_name = "NAME|FILE.toml", help = profile_help())]
        profile: String,
        #[command(flatten)]
        reading: Reading,
        #[command(flatten)]
        spooling: Spooling,
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

/// Where what comes from object stores, or goes there, lies for a while.
#[derive(Args)]
#[group(skip)]
struct Spooling {
    /// Folder for copies of remote logs, one a thread at a time, and for a dataset that goes to a
    /// URL; it needs the room, and is what a killed run goes on from [default: pmp-spool in the
    /// system's temporary folder]
    #[arg(long, value_name = "DIR")]
    spool: Option<PathBuf>,
}

impl Spooling {
    fn folder(&self) -> PathBuf {
        self.spool.clone().unwrap_or_else(spool::default_folder)
    }
}

// Named, since clap does not count the arguments of a struct that has flattened ones in it.
#[derive(Args)]
#[group(args = ["logs", "out"])]
struct Ingest {
    /// MCAP files, or folders searched for `*.mcap`; either may be a URL (s3://, gs://, az://)
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<Location>,

    /// Folder to make the dataset in, or the URL to send it to when it is whole
    #[arg(short, long, value_name = "DATASET")]
    out: Location,

    #[arg(long, default_value = "auto", value_name = "NAME|FILE.toml", help = profile_help())]
    profile: String,

    #[command(flatten)]
    reading: Reading,

    #[command(flatten)]
    spooling: Spooling,

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
  pmp-ingest --out s3://bucket/data s3://bucket/drives gs://other/a.mcap
                                             logs from object stores, and the dataset into one
  pmp-ingest inspect a.mcap                  what is in a log, and what would be used

Object stores take credentials and endpoints from the environment: AWS_ACCESS_KEY_ID,
AWS_SECRET_ACCESS_KEY, AWS_REGION, AWS_ENDPOINT_URL (with AWS_ALLOW_HTTP=true for http://);
GOOGLE_APPLICATION_CREDENTIALS; AZURE_STORAGE_ACCOUNT_NAME, AZURE_STORAGE_ACCOUNT_KEY.

Exit codes: 0 everything was used; 3 something was left out, the report says what; 1 failed; 2 misused";

fn main() -> ExitCode {
    let cli = Cli::parse();
    cli::main(|| match (cli.command, cli.ingest) {
        (Some(Inspect::Inspect { log, profile: name, reading, spooling, json }), _) => {
            let local = one_log(log, &spooling)?.fetch(&|_| ())?;
            let report = inspect::inspect(local.path(), &profile(&name, &reading)?);
            let report = report.map_err(|error| local.own(error))?;
            cli::print(&if json { report.json() } else { report.to_string() })?;
            report.open_question.map_or(Ok(Outcome::Done), |error| Err(local.own(error)))
        }
        (None, Some(args)) => run(&args),
        (None, None) => unreachable!("clap asks for LOG"),
    })
}

/// The log to look at.
fn one_log(place: Location, spooling: &Spooling) -> Result<GivenLog> {
    if let Location::Local(path) = place {
        return Ok(GivenLog::local(path));
    }
    let mut logs = find_logs(&[place], &spooling.folder())?;
    match logs.len() {
        1 => Ok(logs.remove(0)),
        count => Err(Error::Config {
            key: "LOG".into(),
            what: format!("there are {count} logs below this URL, the first is {}", logs[0].name()),
            hint: Some("give the URL of one".into()),
        }),
    }
}

fn run(args: &Ingest) -> Result<Outcome> {
    let profile = profile(&args.profile, &args.reading)?;
    let config = manifest::IngestConfig::new(profile, args.rate)?;
    let spool = args.spooling.folder();
    let logs = find_logs(&args.logs, &spool)?;
    let progress = IngestProgress::default();
    let on = |event: Event| progress.tell(event);
    let manifest = cli::thread_pool(args.jobs)?.install(|| match &args.out {
        Location::Local(out) => ingest(&logs, out, &config, args.shard, &on),
        Location::Remote(url) => ingest_to(url, &logs, &spool, &config, args.shard, &on),
    });
    progress.finish();
    let manifest = manifest?;
    eprint!("{}", manifest.report());
    let loss = !manifest.failed.is_empty() || manifest.logs.iter().any(|log| log.has_loss());
    Ok(if loss { Outcome::DoneWithLoss } else { Outcome::Done })
}
