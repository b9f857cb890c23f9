//! Tables on disk, beside the `episodes.parquet` that they are made of.

use std::path::{Path, PathBuf};

use crate::{
    atomic,
    closed_loop::{results, row::EpisodeRow},
    error::{Error, Result},
    eval::{
        statistics::Bootstrap,
        table::{csv, episodes, latex, markdown, report::Table, summary},
    },
};

/// Write `table.md`, `table.csv` and `table.tex` of the rows of a directory's `episodes.parquet`;
/// tables that are there are replaced, as they can be made again.
///
/// # Errors
///
/// As [`merge`](episodes::merge); [`Error::Io`] if a file cannot be written.
pub fn write(directory: &Path, rows: &[EpisodeRow]) -> Result<()> {
    let rows = episodes::merge(vec![(directory.join(results::FILE), rows.to_vec())])?;
    let table = summary::of_episodes(&rows, &[], Bootstrap::default(), None)?;
    let texts = [
        ("table.md", markdown::markdown(&table)),
        ("table.csv", csv::csv(&table)),
        ("table.tex", latex::latex(&table)),
    ];
    for (name, text) in texts {
        atomic::write(&directory.join(name), text.as_bytes())?;
    }
    Ok(())
}

/// The rows of the directories' `episodes.parquet`, put together.
///
/// # Errors
///
/// As [`results::read`] and [`merge`](episodes::merge).
pub fn read(directories: &[PathBuf]) -> Result<Vec<EpisodeRow>> {
    let read = |directory: &PathBuf| {
        let path = directory.join(results::FILE);
        results::read(&path).map(|rows| (path, rows))
    };
    episodes::merge(directories.iter().map(read).collect::<Result<_>>()?)
}

/// A table as JSON; what is missing is `null`.
///
/// # Errors
///
/// [`Error::Json`] if it cannot be written, which only a bug can bring about.
pub fn json(table: &Table) -> Result<String> {
    let text = serde_json::to_string_pretty(table).map_err(Error::json("table.json"))?;
    Ok(text + "\n")
}
