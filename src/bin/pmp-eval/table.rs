//! `pmp-eval table`: reports or driven episodes in, one table out.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use pmp::{
    cli::{self, Outcome},
    closed_loop::results,
    error::{Error, Result},
    eval::{
        offline::{render, report::Report, store},
        statistics::Bootstrap,
        table::{self, csv, episodes::Group, latex, markdown, paper::Paper, summary},
    },
};

/// Print one table of what was evaluated: reports of the same dataset and frames, or driven
/// episodes of the same suite
#[derive(Args)]
#[command(after_help = crate::AFTER)]
pub(crate) struct Table {
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
enum Format {
    Md,
    Csv,
    Tex,
    Json,
}

#[derive(Clone, Copy, ValueEnum)]
enum Reference {
    Paper,
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

pub(crate) fn run(args: &Table) -> Result<Outcome> {
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
