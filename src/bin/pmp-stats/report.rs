//! `pmp-stats DATASET`: what is in a dataset.

use std::path::PathBuf;

use clap::Args;
use pmp::{
    atomic,
    cli::{self, Outcome},
    error::{Error, Result},
    stats::{html, query},
};

#[derive(Args)]
pub(crate) struct Report {
    /// Dataset made by pmp-ingest
    dataset: PathBuf,

    /// Print one JSON object; its fields are described in schemas/stats.v1.json
    #[arg(long)]
    json: bool,

    /// Also write a page to look at: coverage, pictures with lidar and radar, values, ways, gaps
    ///
    /// One file without scripts, readable without a network, in the dark and on a phone. What
    /// stands there already is not overwritten without --force.
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,

    /// Overwrite the page
    #[arg(long, requires = "html")]
    force: bool,
}

pub(crate) fn run(report: &Report) -> Result<Outcome> {
    if let Some(path) = report.html.as_deref().filter(|path| path.exists() && !report.force) {
        return Err(Error::Config {
            key: "--html".into(),
            what: format!("{} is there already", path.display()),
            hint: Some("--force overwrites it".to_string()),
        });
    }
    let summary = query::summarise(&report.dataset)?;
    if let Some(path) = &report.html {
        let page = html::page::page_of(&report.dataset, &summary)?;
        atomic::write(path, page.as_bytes())?;
        eprintln!("page: {}", path.display());
    }
    cli::print(&if report.json { summary.json() } else { summary.screen().to_string() })?;
    Ok(Outcome::Done)
}
