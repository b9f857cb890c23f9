//! `pmp-eval`: policies in, tables out.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use candle_core::Device;
use clap::{Parser, Subcommand, ValueEnum};
use pmp::{
    cli::{self, Outcome},
    closed_loop::results,
    dataset::open,
    error::{Error, Result},
    eval::{
        baseline,
        offline::{
            self,
            evaluate::evaluate,
            render,
            report::{Dataset, Holdout, HoldoutKind, Report},
            store,
        },
        statistics::Bootstrap,
        table::{self, csv, episodes::Group, latex, markdown, paper::Paper, summary},
    },
    model::learned::Learned,
    policy::Policy,
};

/// Measure policies, and make tables of what was measured
#[derive(Parser)]
#[command(version, after_help = AFTER)]
struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Compare plans with what the recorded driver did, on the frames held out from training
    ///
    /// `constant-velocity` and `stand-still` are always evaluated too: a number means little
    /// without them. DIR gets table.md, table.csv, table.tex, speed.svg, errors.parquet (one row
    /// per policy and frame) and report.json, written last. A report that is already there is kept.
    #[command(after_help = AFTER)]
    Offline {
        /// Run directory, or `constant-velocity`, `stand-still`, `recorded` (an oracle); repeatable
        #[arg(long = "policy", value_name = "P", num_args = 1.., required = true)]
        policies: Vec<String>,
        /// Dataset made by pmp-ingest
        #[arg(long, value_name = "DATASET")]
        data: PathBuf,
        /// Directory to write the report to
        #[arg(short, long, value_name = "DIR")]
        out: PathBuf,
        /// Threads; 0 is one per core. Numbers do not depend on it
        #[arg(long, value_name = "N", default_value_t = 0)]
        jobs: usize,
    },
    /// Print one table of what was evaluated: reports of the same dataset and frames, or driven
    /// episodes of the same suite
    #[command(after_help = AFTER)]
    Table(Table),
}

#[derive(clap::Args)]
struct Table {
    /// Directories that `pmp-eval offline` wrote, or that `pmp-eval drive` wrote
    #[arg(value_name = "DIR", required_unless_present = "reference")]
    directories: Vec<PathBuf>,
    /// What to print
    #[arg(long, value_name = "FORMAT", default_value = "md")]
    format: Format,
    /// Of driven episodes: set the paper's own numbers beside them; without DIR, print them alone
    #[arg(long, value_name = "WHOSE")]
    reference: Option<Reference>,
    /// Of driven episodes: policies that are one model trained from several seeds; repeatable
    #[arg(long = "group", value_name = "NAME=P1,P2,...", value_parser = group)]
    groups: Vec<Group>,
}

#[derive(Clone, Copy, ValueEnum)]
enum Reference {
    Paper,
}

#[derive(Clone, Copy, ValueEnum)]
enum Format {
    Md,
    Csv,
    Tex,
    Json,
}

const AFTER: &str = "\
Examples:
  pmp-eval offline --policy runs/tiny --data data/town --out reports/tiny
  pmp-eval offline --policy runs/a runs/b recorded --data data/town --out reports/ab
  pmp-eval table reports/tiny reports/ab --format csv > table.csv
  pmp-eval table driven/ --reference paper

Exit codes: 0 done; 1 failed; 2 misused; 3 done, but not every held-out frame was evaluated";

/// A baseline of that name, or the policy in that run directory.
fn open_policy(name: &str) -> Result<Box<dyn Policy>> {
    if let Some(baseline) = baseline::baseline(name) {
        return Ok(baseline);
    }
    if !Path::new(name).is_dir() {
        return Err(Error::Run {
            path: name.into(),
            what: "neither a run directory nor a baseline".to_string(),
            hint: Some(format!("baselines are {}", baseline::NAMES.join(", "))),
        });
    }
    Ok(Box::new(Learned::open(Path::new(name), &Device::Cpu)?))
}

/// The frames that no policy was trained on, as the report tells of them.
fn holdout(dataset: &open::Dataset) -> Result<Holdout> {
    if dataset.val.is_empty() {
        return Err(Error::Dataset {
            path: dataset.path.clone(),
            what: "no frames are held out: the only episode is too short".to_string(),
            hint: Some("ingest more logs".to_string()),
        });
    }
    let time_block = dataset.holdout.is_time_block;
    Ok(Holdout {
        kind: if time_block { HoldoutKind::TimeBlock } else { HoldoutKind::Episodes },
        how: dataset.holdout.how.clone(),
        weak: time_block,
        frames: dataset.val.len() as u64,
        episodes: dataset.val.episodes as u64,
    })
}

fn evaluate_offline(policies: &[String], data: &Path, out: &Path, jobs: usize) -> Result<Outcome> {
    store::refuse_existing(out)?;
    let threads = rayon::ThreadPoolBuilder::new().num_threads(jobs).build_global();
    threads.map_err(|error| Error::Config {
        key: "--jobs".to_string(),
        what: error.to_string(),
        hint: None,
    })?;
    let mut names: Vec<&str> = policies.iter().map(String::as_str).collect();
    let missing = ["constant-velocity", "stand-still"].into_iter().filter(|n| !names.contains(n));
    names.extend(missing.collect::<Vec<_>>());
    let mut policies = names.into_iter().map(open_policy).collect::<Result<Vec<_>>>()?;
    let dataset = open::Dataset::open(data)?;
    let holdout = holdout(&dataset)?;
    let bar = cli::progress(holdout.frames, "frames", "evaluating");
    let frames = dataset.frames(&dataset.val).inspect(|_| bar.inc(1));
    let errors = evaluate(&mut policies, frames)?;
    bar.finish_and_clear();
    let report =
        offline::summary::summarise(Dataset::of(data)?, holdout, &errors, Bootstrap::default());
    store::write(out, &report, &errors)?;
    cli::print(&render::markdown(&report))?;
    let all = report.evaluated.frames == report.holdout.frames;
    Ok(if all { Outcome::Done } else { Outcome::DoneWithLoss })
}

/// `NAME=P1,P2,...`
fn group(text: &str) -> Result<Group, String> {
    let (name, policies) = text.split_once('=').ok_or("no `=` in it")?;
    let policies = policies.split(',').map(str::to_string).collect();
    Ok(Group { name: name.to_string(), policies })
}

/// What directories hold.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Offline,
    Driven,
}

/// What all of the directories hold.
fn kind(directories: &[PathBuf]) -> Result<Kind> {
    let refuse = |path: &Path, what: &str, hint: &str| {
        Err(Error::Report { path: path.into(), what: what.into(), hint: Some(hint.into()) })
    };
    let mut found = None;
    for directory in directories {
        let holds = |name: &str| directory.join(name).is_file();
        let kind = match (holds("report.json"), holds(results::FILE)) {
            (true, false) => Kind::Offline,
            (false, true) => Kind::Driven,
            (true, true) => {
                let hint = "move one of them to a directory of its own";
                return refuse(directory, "both report.json and episodes.parquet are here", hint);
            }
            (false, false) => {
                let hint = "`pmp-eval offline --policy P --data DATASET --out DIR` makes a \
                            report, `pmp-eval drive` drives episodes";
                let what = "no report can be read: neither report.json nor episodes.parquet";
                return refuse(directory, what, hint);
            }
        };
        if found.is_some_and(|other| other != kind) {
            let hint = "one table holds one kind: make one table for each";
            return refuse(directory, "an offline report and driven episodes", hint);
        }
        found = Some(kind);
    }
    Ok(found.unwrap_or(Kind::Driven))
}

fn table(args: &Table) -> Result<Outcome> {
    match kind(&args.directories)? {
        Kind::Driven => driven_table(args),
        Kind::Offline if args.reference.is_some() || !args.groups.is_empty() => {
            Err(Error::Config {
                key: "--reference, --group".to_string(),
                what: "not for offline reports".to_string(),
                hint: Some("they are for directories that `pmp-eval drive` wrote".to_string()),
            })
        }
        Kind::Offline => offline_table(args),
    }
}

fn offline_table(args: &Table) -> Result<Outcome> {
    let read = |directory: &PathBuf| Ok((directory.clone(), store::read(directory)?));
    let report = Report::merge(args.directories.iter().map(read).collect::<Result<_>>()?)?;
    cli::print(&match args.format {
        Format::Md => render::markdown(&report),
        Format::Csv => render::csv(&report),
        Format::Tex => render::latex(&report),
        Format::Json => store::json(&report)?,
    })?;
    Ok(Outcome::Done)
}

fn driven_table(args: &Table) -> Result<Outcome> {
    let paper = args.reference.map(|Reference::Paper| Paper::table()).transpose()?;
    let table = match (&paper, args.directories.is_empty()) {
        (Some(paper), true) => summary::of_paper(paper),
        _ => {
            let rows = table::read(&args.directories)?;
            summary::of_episodes(&rows, &args.groups, Bootstrap::default(), paper.as_ref())?
        }
    };
    cli::print(&match args.format {
        Format::Md => markdown::markdown(&table),
        Format::Csv => csv::csv(&table),
        Format::Tex => latex::latex(&table),
        Format::Json => table::json(&table)?,
    })?;
    Ok(Outcome::Done)
}

fn main() -> ExitCode {
    cli::main(|| match Args::parse().command {
        Command::Offline { policies, data, out, jobs } => {
            evaluate_offline(&policies, &data, &out, jobs)
        }
        Command::Table(args) => table(&args),
    })
}
