//! The one error of the library: what went wrong, where, and what to do about it.
//!
//! Fields are data, the text is made here, advice is kept apart from the statement so that
//! [`crate::cli`] can print it on its own line. Bad *data* inside a good file is not an error:
//! it is counted in [`crate::drops`].

use std::{
    io::ErrorKind,
    path::{Path, PathBuf},
};

/// Result of the library.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// What went wrong.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused a file operation.
    #[error("cannot {action} {}: {source}", path.display())]
    Io { action: &'static str, path: PathBuf, source: std::io::Error },

    /// An output that is there already; nothing is overwritten without being asked.
    #[error("will not overwrite {}", path.display())]
    Exists { path: PathBuf, hint: String },

    /// An object store refused, or could not be reached.
    #[error("cannot {action} {url}: {why}")]
    Remote { action: &'static str, url: String, why: String, hint: String },

    /// A log file that cannot be used at all.
    #[error("{what} (byte {offset}) in {}", path.display())]
    Log { path: PathBuf, offset: u64, what: String, hint: Option<String> },

    /// A map or route file, or an element of it, that cannot be used; lines count from 1.
    #[error("{what} (<{element}>, line {line}) in {}", path.display())]
    Map { path: PathBuf, line: u32, element: String, what: String, hint: Option<String> },

    /// A message definition that cannot be understood.
    #[error("message definition of {schema}, line {line}: {what}")]
    Definition { schema: String, line: usize, what: String },

    /// A message whose bytes do not follow its definition.
    #[error("cannot decode {schema} at byte {offset} of the message: {what}")]
    Decode { schema: String, offset: usize, what: String },

    /// A log whose topics cannot be mapped to the signals that frames need.
    #[error("{what} in {}", path.display())]
    Mapping { path: PathBuf, what: String, hint: String },

    /// A dataset directory or file that is not what it should be.
    #[error("{what}: {}", path.display())]
    Dataset { path: PathBuf, what: String, hint: Option<String> },

    /// A training run directory or file that is not what it should be.
    #[error("{what}: {}", path.display())]
    Run { path: PathBuf, what: String, hint: Option<String> },

    /// A configuration value that makes no sense.
    #[error("{key}: {what}")]
    Config { key: String, what: String, hint: Option<String> },

    /// A picture of a frame, or what lies on it, that cannot be used.
    #[error("picture of frame {frame}: {what}")]
    Picture { frame: u32, what: String },

    /// A training whose numbers are no numbers any more.
    #[error("training diverged at step {step}: {term} is not finite{}", listed(frames))]
    Diverged { step: u64, term: String, frames: Vec<String> },

    /// A tensor operation failed: shapes, types or the device.
    #[cfg(feature = "learning")]
    #[error(transparent)]
    Tensor(#[from] candle_core::Error),

    /// A policy that could not plan, or planned what is no motion.
    #[error("policy `{policy}`, episode {episode}, frame {frame}: {what}")]
    Policy { policy: String, episode: String, frame: u32, what: String, hint: Option<String> },

    /// An evaluation directory or file that is not what it should be.
    #[error("{what}: {}", path.display())]
    Report { path: PathBuf, what: String, hint: Option<String> },

    /// Arrow refused a column or a batch.
    #[error("columns of {}: {source}", path.display())]
    Arrow { path: PathBuf, source: arrow::error::ArrowError },

    /// Parquet refused a file.
    #[error("parquet file {}: {source}", path.display())]
    Parquet { path: PathBuf, source: parquet::errors::ParquetError },

    /// A query over the dataset failed.
    #[cfg(feature = "reports")]
    #[error("query over {}: {source}", path.display())]
    Query { path: PathBuf, source: polars::error::PolarsError },

    /// A JSON file does not have the fields it should have.
    #[error("JSON file {}: {source}", path.display())]
    Json { path: PathBuf, source: serde_json::Error },
}

impl Error {
    /// For `map_err` on file operations: `fs::read(p).map_err(Error::io("read", p))`.
    pub fn io(action: &'static str, path: impl AsRef<Path>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.as_ref().to_path_buf();
        move |source| Error::Io { action, path, source }
    }

    /// For `map_err` on Arrow calls; `path` is the file that the columns belong to.
    pub fn arrow(path: impl AsRef<Path>) -> impl FnOnce(arrow::error::ArrowError) -> Self {
        let path = path.as_ref().to_path_buf();
        move |source| Error::Arrow { path, source }
    }

    /// For `map_err` on Parquet calls.
    pub fn parquet(path: impl AsRef<Path>) -> impl FnOnce(parquet::errors::ParquetError) -> Self {
        let path = path.as_ref().to_path_buf();
        move |source| Error::Parquet { path, source }
    }

    /// For `map_err` on polars calls.
    #[cfg(feature = "reports")]
    pub fn query(path: impl AsRef<Path>) -> impl FnOnce(polars::error::PolarsError) -> Self {
        let path = path.as_ref().to_path_buf();
        move |source| Error::Query { path, source }
    }

    /// For `map_err` on serde_json calls.
    pub fn json(path: impl AsRef<Path>) -> impl FnOnce(serde_json::Error) -> Self {
        let path = path.as_ref().to_path_buf();
        move |source| Error::Json { path, source }
    }

    /// The same, of a file that a person knows by another name than that of the copy which was read.
    pub fn of_original(self, copy: &Path, original: &Path) -> Error {
        let named = |path: PathBuf| if path == copy { original.to_path_buf() } else { path };
        match self {
            Error::Log { path, offset, what, hint } => {
                Error::Log { path: named(path), offset, what, hint }
            }
            Error::Mapping { path, what, hint } => Error::Mapping { path: named(path), what, hint },
            other => other,
        }
    }

    /// The same, of a training that worked on these frames.
    pub fn of_frames(self, names: &[String]) -> Error {
        match self {
            Error::Diverged { step, term, .. } => {
                Error::Diverged { step, term, frames: names.to_vec() }
            }
            other => other,
        }
    }

    /// What the person at the keyboard can do about it, where there is something to do.
    pub fn hint(&self) -> Option<String> {
        match self {
            Error::Log { hint, .. }
            | Error::Map { hint, .. }
            | Error::Dataset { hint, .. }
            | Error::Run { hint, .. }
            | Error::Policy { hint, .. }
            | Error::Report { hint, .. }
            | Error::Config { hint, .. } => hint.clone(),
            Error::Mapping { hint, .. }
            | Error::Exists { hint, .. }
            | Error::Remote { hint, .. } => Some(hint.clone()),
            Error::Io { source, .. } if source.kind() == ErrorKind::StorageFull => Some(
                "free some space, or choose a folder on another disk; the same command then goes on"
                    .into(),
            ),
            Error::Definition { schema, .. } => Some(format!(
                "the log carries a definition of {schema} that pmp cannot read; \
                 `pmp-ingest inspect LOG` shows which topics use it"
            )),
            Error::Diverged { .. } => Some(
                "train anew with a lower `lr` or `clip_norm`; if it diverges at the same step, \
                 look for wild values in the data with `pmp-stats check`"
                    .into(),
            ),
            _ => None,
        }
    }
}

/// `; frames a/1, a/2 and 3 more`, or nothing.
fn listed(frames: &[String]) -> String {
    const SHOWN: usize = 8;
    let more = match frames.len().saturating_sub(SHOWN) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    match frames {
        [] => String::new(),
        _ => format!("; frames {}{more}", frames[..SHOWN.min(frames.len())].join(", ")),
    }
}
