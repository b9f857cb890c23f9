//! `pmp-stats merge`, `drop` and `resplit`: datasets made of datasets.

use std::path::PathBuf;

use clap::Args;
use pmp::{
    cli::{self, Outcome},
    dataset::{
        edit::{
            drop::drop,
            merge::merge,
            place::{Placing, Plan},
            resplit::{Rule, resplit},
            source::Source,
        },
        split::Split,
    },
    error::Result,
};

#[derive(Args)]
pub(crate) struct Merge {
    /// Datasets made by pmp-ingest or by an edit
    #[arg(required = true, num_args = 1..)]
    datasets: Vec<PathBuf>,

    #[command(flatten)]
    to: To,

    /// Put them together although their profiles or cameras differ
    #[arg(long)]
    mixed: bool,
}

#[derive(Args)]
pub(crate) struct Drop {
    /// Dataset made by pmp-ingest or by an edit
    dataset: PathBuf,

    #[command(flatten)]
    to: To,

    /// Leave out the episode with this id
    #[arg(long, value_name = "ID", num_args = 1.., required_unless_present = "log")]
    episode: Vec<String>,

    /// Leave out all episodes of the log file with this name
    #[arg(long, value_name = "NAME", num_args = 1..)]
    log: Vec<String>,
}

#[derive(Args)]
pub(crate) struct Resplit {
    /// Dataset made by pmp-ingest or by an edit
    dataset: PathBuf,

    #[command(flatten)]
    to: To,

    #[command(flatten)]
    rule: Sides,
}

/// Where a dataset goes.
#[derive(Args)]
struct To {
    /// Folder for the new dataset
    #[arg(long, value_name = "NEW")]
    out: PathBuf,

    /// Link files that stay as they are instead of copying them: no space, but whoever writes into
    /// such a file changes both datasets
    #[arg(long)]
    link: bool,
}

/// Which episodes judge.
#[derive(Args)]
#[group(required = true, multiple = false)]
struct Sides {
    /// This share of the logs judges, spread over all conditions
    #[arg(long, value_name = "SHARE")]
    val_share: Option<f64>,

    /// The logs with these episodes judge
    #[arg(long, value_name = "ID", num_args = 1..)]
    val: Vec<String>,

    /// The logs whose files have these names judge
    #[arg(long, value_name = "NAME", num_args = 1..)]
    val_log: Vec<String>,

    /// The logs of these towns judge
    #[arg(long, value_name = "TOWN", num_args = 1..)]
    val_town: Vec<String>,

    /// As an ingest splits: by a hash of the id, one log in eight judges
    #[arg(long)]
    by_hash: bool,
}

pub(crate) fn run_merge(merge_: &Merge) -> Result<Outcome> {
    let open = |path: &PathBuf| Source::open(path);
    let sources = merge_.datasets.iter().map(open).collect::<Result<Vec<_>>>()?;
    write(merge(&sources, merge_.mixed)?, &merge_.to)
}

pub(crate) fn run_drop(drop_: &Drop) -> Result<Outcome> {
    let source = Source::open(&drop_.dataset)?;
    write(drop(&source, &drop_.episode, &drop_.log)?, &drop_.to)
}

pub(crate) fn run_resplit(resplit_: &Resplit) -> Result<Outcome> {
    let source = Source::open(&resplit_.dataset)?;
    let sides = &resplit_.rule;
    let rule = match (sides.val_share, sides.by_hash) {
        (Some(share), _) => Rule::Share(share),
        (None, true) => Rule::Hash,
        _ if !sides.val.is_empty() => Rule::Episodes(sides.val.clone()),
        _ if !sides.val_log.is_empty() => Rule::Logs(sides.val_log.clone()),
        _ => Rule::Towns(sides.val_town.clone()),
    };
    write(resplit(&source, &rule)?, &resplit_.to)
}

fn write(plan: Plan, to: &To) -> Result<Outcome> {
    let placing = if to.link { Placing::Link } else { Placing::Copy };
    let made = plan.write(&to.out, placing)?;
    let logs = &made.manifest.logs;
    let episodes = |side: Split| -> usize {
        logs.iter().filter(|log| log.split == side).map(|log| log.episodes.len()).sum()
    };
    eprintln!(
        "{}: {} frames, {} episodes to train, {} to judge; files: {} as they were, {} written anew",
        to.out.display(),
        made.manifest.frames,
        episodes(Split::Train),
        episodes(Split::Val),
        made.files_kept,
        made.files_written
    );
    cli::print(&format!("{}\n", made.manifest.identity()))?;
    Ok(Outcome::Done)
}
