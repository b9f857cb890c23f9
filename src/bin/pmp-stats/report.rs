//! `pmp-stats DATASET`: what is in a dataset.

use std::path::PathBuf;

use clap::Args;
use pmp::{
    cli::{self, Outcome},
    error::Result,
    stats::query,
};

#[derive(Args)]
pub(crate) struct Report {
    /// Dataset made by pmp-ingest
    pub(crate) dataset: PathBuf,

    /// Print one JSON object; its fields are described in schemas/stats.v1.json
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(report: &Report) -> Result<Outcome> {
    let summary = query::summarise(&report.dataset)?;
    cli::print(&if report.json { summary.json() } else { summary.screen().to_string() })?;
    Ok(Outcome::Done)
}
