//! `pmp-stats check DATASET`: what would hurt a training run.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use pmp::{
    cli::{self, Outcome},
    error::{Error, Result},
    stats::check::{
        catalogue,
        finding::{self, Level},
        glimpse::{DEFAULT_SAMPLE, Sample},
        page, screen,
        verdict::{self, Asked},
    },
};

/// Find what would hurt a training run: a verdict with stable codes
///
/// Holds the manifest against the files, times against the grid, velocity against poses, labels
/// against what came, actions against motion, and looks at a sample of pictures and sensor
/// returns. A manifest or shard that is missing is a finding, too.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Check {
    /// Dataset made by pmp-ingest
    #[arg(required_unless_present = "list")]
    dataset: Option<PathBuf>,

    /// Print one JSON object; its fields are described in schemas/check.v1.json
    #[arg(long)]
    json: bool,

    /// Print annotations for GitHub's runners
    #[arg(long, conflicts_with = "json")]
    github: bool,

    /// Leave a check out, by code or name; may be given several times
    #[arg(long, value_name = "CODE", value_parser = catalogue::find)]
    ignore: Vec<&'static finding::Check>,

    /// Look at the pictures and sensor returns of all frames, and compute checksums
    #[arg(long)]
    decode: bool,

    /// Look at the pictures and sensor returns of so many frames, spread evenly; 0 for none
    #[arg(long, value_name = "N", default_value_t = DEFAULT_SAMPLE, conflicts_with = "decode")]
    sample: u64,

    /// Exit with 1 where there is a finding of this level or worse
    #[arg(long, value_name = "LEVEL", default_value = "error")]
    fail_on: FailOn,

    /// List all checks instead
    #[arg(long)]
    list: bool,

    /// With --list: as the page docs/checks.md
    #[arg(long, requires = "list", conflicts_with_all = ["json", "github"])]
    markdown: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum FailOn {
    Error,
    Warning,
    Note,
}

const EXAMPLES: &str = "\
Examples:
  pmp-stats check data                             findings with reasons and remedies
  pmp-stats check data --decode                    every picture, every byte
  pmp-stats check data --ignore C06 --ignore no-rain
  pmp-stats check data --json | jq '.findings[] | select(.level == \"error\")'
  pmp-stats check data --github --fail-on warning  as a step of a workflow

Exit codes: 0 nothing at the level of --fail-on; 1 something there, or the folder does not exist; 2 misused";

pub(crate) fn run(check: &Check) -> Result<Outcome> {
    if check.list {
        let text = match (check.json, check.markdown) {
            (true, _) => verdict::catalogue_json(),
            (_, true) => page::markdown(),
            _ => screen::list().to_string(),
        };
        cli::print(&text)?;
        return Ok(Outcome::Done);
    }
    let asked = Asked {
        ignored: check.ignore.clone(),
        sample: if check.decode { Sample::All } else { Sample::Spread(check.sample) },
        checksums: check.decode,
    };
    let dataset = check.dataset.as_deref().ok_or_else(|| Error::Config {
        key: "DATASET".into(),
        what: "is missing".into(),
        hint: None,
    })?;
    let verdict = verdict::check(dataset, &asked)?;
    cli::print(&match (check.json, check.github) {
        (true, _) => verdict.json(),
        (_, true) => verdict.github().to_string(),
        _ => verdict.screen().to_string(),
    })?;
    let level = match check.fail_on {
        FailOn::Error => Level::Error,
        FailOn::Warning => Level::Warning,
        FailOn::Note => Level::Note,
    };
    Ok(if verdict.has(level) { Outcome::Rejected } else { Outcome::Done })
}
