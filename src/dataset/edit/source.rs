//! A dataset that others are made of.

use std::path::{Path, PathBuf};

use crate::{
    dataset::{
        manifest::{Change, Edit, LogRecord, Manifest, Origin},
        split::Split,
    },
    error::Result,
};

/// A whole dataset, only read.
#[derive(Clone, Debug)]
pub struct Source {
    pub path: PathBuf,
    pub manifest: Manifest,
}

/// A log of a source, as it is to be in a new dataset.
#[derive(Clone, Debug)]
pub struct Chosen<'s> {
    pub source: &'s Source,
    /// Its shards still name files of the source.
    pub log: LogRecord,
}

impl Source {
    /// Open a dataset.
    ///
    /// # Errors
    ///
    /// If the folder is no finished dataset.
    pub fn open(path: &Path) -> Result<Source> {
        Ok(Source { path: path.to_path_buf(), manifest: Manifest::read(path)? })
    }

    /// Its logs, each on a side.
    pub fn choose(&self, side_of: impl Fn(&LogRecord) -> Split) -> Vec<Chosen<'_>> {
        let chosen = |log: &LogRecord| Chosen {
            source: self,
            log: LogRecord { split: side_of(log), ..log.clone() },
        };
        self.manifest.logs.iter().map(chosen).collect()
    }

    /// How a manifest names it.
    fn origin(&self) -> Origin {
        Origin {
            identity: self.manifest.identity(),
            written_by: self.manifest.written_by.clone(),
            frames: self.manifest.frames,
            config: self.manifest.config.clone(),
            edit: self.manifest.edit.clone().map(Box::new),
        }
    }
}

/// What becomes of some datasets, as their successor says it; the same whatever their order.
pub fn edit_of(change: Change, sources: &[&Source]) -> Edit {
    let mut of: Vec<Origin> = sources.iter().map(|source| source.origin()).collect();
    of.sort_by(|a, b| a.identity.cmp(&b.identity));
    Edit { change, of }
}
