//! `pmp-eval table`: reports in, one table out.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use pmp::{
    cli::{self, Outcome},
    error::Result,
    eval::offline::{render, report::Report, store},
};

/// Print one table of one or more reports of the same dataset and frames
#[derive(Args)]
#[command(after_help = crate::AFTER)]
pub(crate) struct Table {
    /// Directories that `pmp-eval offline` wrote
    #[arg(value_name = "DIR", required = true)]
    reports: Vec<PathBuf>,
    /// What to print
    #[arg(long, value_name = "FORMAT", default_value = "md")]
    format: Format,
}

#[derive(Clone, Copy, ValueEnum)]
enum Format {
    Md,
    Csv,
    Tex,
    Json,
}

pub(crate) fn run(args: &Table) -> Result<Outcome> {
    let read = |directory: &PathBuf| Ok((directory.clone(), store::read(directory)?));
    let report = Report::merge(args.reports.iter().map(read).collect::<Result<_>>()?)?;
    cli::print(&match args.format {
        Format::Md => render::markdown(&report),
        Format::Csv => render::csv(&report),
        Format::Tex => render::latex(&report),
        Format::Json => store::json(&report)?,
    })?;
    Ok(Outcome::Done)
}
