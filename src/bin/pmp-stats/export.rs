//! `pmp-stats export`: a dataset in the layout of other readers.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use pmp::{cli::Outcome, error::Result, lerobot};

#[derive(Args)]
pub(crate) struct Export {
    /// Dataset made by pmp-ingest or by an edit
    dataset: PathBuf,

    /// Whose layout
    #[arg(long, value_enum)]
    format: Format,

    /// Folder for what is written
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

#[derive(Clone, Copy, ValueEnum)]
enum Format {
    /// LeRobot v3.0, pictures embedded; an episode ends where frames are missing
    Lerobot,
}

pub(crate) fn run(export: &Export) -> Result<Outcome> {
    let counts = match export.format {
        Format::Lerobot => lerobot::export::export(&export.dataset, &export.out)?,
    };
    let cut = match counts.episodes == counts.drives {
        true => String::new(),
        false => format!(", cut from {} where frames are missing", counts.drives),
    };
    let (frames, episodes) = (counts.frames, counts.episodes);
    eprintln!("{}: {frames} frames in {episodes} episodes{cut}", export.out.display());
    if counts.without_action == 0 {
        return Ok(Outcome::Done);
    }
    eprintln!(
        "left out: {} frames whose action lacks a channel that others have",
        counts.without_action
    );
    Ok(Outcome::DoneWithLoss)
}
