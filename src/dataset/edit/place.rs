//! A new dataset written: `edit.json`, its files, the records, and `manifest.json` last.

use std::{
    collections::BTreeSet,
    fs, io,
    path::{Path, PathBuf},
    sync::Mutex,
};

use rayon::prelude::*;

use crate::{
    atomic::{self, AtomicFile, sha256_of_file},
    claim::claim,
    dataset::{
        card::write_card,
        claim::MARKER,
        compaction::{Part, copy_groups, remove_leftovers},
        edit::{
            conflicts::differing,
            layout::{Laid, lay},
            source::Chosen,
        },
        episodes::write_episodes,
        manifest::{EDIT, Edit, FailedLog, IngestConfig, LogRecord, Manifest},
        shard::ShardRecord,
    },
    error::{Error, Result},
};

/// How files that stay as they are come into the new dataset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Placing {
    /// Each dataset has its own bytes: whatever happens to the one, the other is what it was.
    #[default]
    Copy,
    /// Two names of one file: at once and for nothing, but who writes into the one changes the other.
    Link,
}

/// What a new dataset is to be.
#[derive(Debug)]
pub struct Plan<'s> {
    pub edit: Edit,
    pub config: IngestConfig,
    pub logs: Vec<Chosen<'s>>,
    pub failed: Vec<FailedLog>,
}

/// What was made.
#[derive(Clone, Debug, PartialEq)]
pub struct Made {
    pub manifest: Manifest,
    /// Files that are those of a source.
    pub files_kept: usize,
    /// Files written anew.
    pub files_written: usize,
}

impl Plan<'_> {
    /// Write the dataset into a folder that is empty, or in which the same was begun.
    ///
    /// # Errors
    ///
    /// If the folder has something else or lies in a source, another process is at work there, a
    /// source's file is not what its manifest says, or the disk refuses.
    pub fn write(mut self, out: &Path, placing: Placing) -> Result<Made> {
        let refuse = |what: &str, hint: &str| {
            let (path, what, hint) = (out.to_path_buf(), what.to_string(), Some(hint.to_string()));
            Err(Error::Dataset { path, what, hint })
        };
        if self.logs.iter().any(|chosen| lies_in(out, &chosen.source.path)) {
            let hint = "choose another --out: a dataset is never changed";
            return refuse("a folder in a dataset that is read", hint);
        }
        if !out.join(EDIT).exists() && !is_empty(out)? {
            let hint = "choose another --out: a dataset is never changed";
            return refuse("a folder that is not empty", hint);
        }
        let differing = |a: &Edit, b: &Edit| {
            let mut keys = Vec::new();
            let value = |edit| serde_json::to_value(edit).unwrap_or_default();
            differing(&value(a), &value(b), "", &mut keys);
            keys
        };
        let _claim = claim(&out.join(EDIT), &self.edit, "dataset", differing)?;
        self.logs.sort_by(|a, b| a.log.episode.cmp(&b.log.episode));
        let files = lay(&self.logs);
        let files_kept = files.iter().filter(|file| file.is_whole).count();
        let files_written = files.len() - files_kept;
        if Manifest::path(out).exists() {
            let manifest = Manifest::read(out)?;
            return Ok(Made { manifest, files_kept, files_written });
        }
        check_sources(&files)?;
        let placed = files.par_iter().map(|file| file.place(out, placing));
        let placed: Vec<Vec<ShardRecord>> = placed.collect::<Result<_>>()?;
        let mut logs: Vec<LogRecord> = self.logs.iter().map(|chosen| chosen.log.clone()).collect();
        for (file, shards) in files.iter().zip(placed) {
            for (piece, shard) in file.pieces.iter().zip(shards) {
                logs[piece.log].shards[piece.shard] = shard;
            }
        }
        let manifest =
            Manifest { edit: Some(self.edit), ..Manifest::new(self.config, logs, self.failed) };
        for log in &manifest.logs {
            atomic::write_json(&out.join("logs").join(format!("{}.json", log.episode)), log)?;
        }
        write_episodes(&out.join("episodes.parquet"), &manifest.logs)?;
        atomic::write_json(&out.join(MARKER), &manifest.config)?;
        remove_leftovers(out, &manifest.logs)?;
        write_card(out, &manifest)?;
        atomic::write_json(&Manifest::path(out), &manifest)?;
        Ok(Made { manifest, files_kept, files_written })
    }
}

/// That every file which is taken apart is what its manifest says; those that stay whole are
/// checked as they are copied.
fn check_sources(files: &[Laid]) -> Result<()> {
    let apart = files.iter().filter(|file| !file.is_whole).flat_map(|file| &file.pieces);
    let seen = Mutex::new(BTreeSet::new());
    apart.collect::<Vec<_>>().par_iter().try_for_each(|piece| {
        let path = piece.source.join(&piece.record.path);
        let is_new = seen.lock().map_or(true, |mut seen| seen.insert(path.clone()));
        if is_new && sha256_of_file(&path)? != piece.record.sha256 {
            return Err(not_as_recorded(path));
        }
        Ok(())
    })
}

impl Laid<'_> {
    /// Write the file; gives the new records of its pieces.
    fn place(&self, out: &Path, placing: Placing) -> Result<Vec<ShardRecord>> {
        let path = out.join(&self.path);
        let first = self.pieces[0].record;
        if self.is_whole {
            bring(&self.pieces[0].source.join(&first.path), &path, &first.sha256, placing)?;
            let moved =
                |record: &ShardRecord| ShardRecord { path: self.path.clone(), ..record.clone() };
            return Ok(self.pieces.iter().map(|piece| moved(piece.record)).collect());
        }
        let parts: Vec<Part> = self.pieces.iter().map(|piece| piece.part()).collect();
        let (committed, groups) = copy_groups(&path, &parts)?;
        let is_several = self.pieces.len() > 1;
        let record = |record: &ShardRecord, groups: std::ops::Range<usize>| ShardRecord {
            path: self.path.clone(),
            rows: record.rows,
            bytes: committed.bytes,
            sha256: committed.sha256.clone(),
            groups: is_several.then_some([groups.start, groups.len()]),
        };
        let pairs = self.pieces.iter().zip(groups);
        Ok(pairs.map(|(piece, groups)| record(piece.record, groups)).collect())
    }
}

/// Bring a file with a known checksum to its place, unless it is there.
fn bring(from: &Path, to: &Path, sha256: &str, placing: Placing) -> Result<()> {
    if to.exists() && sha256_of_file(to)? == sha256 {
        return Ok(());
    }
    match placing {
        Placing::Copy => {
            let mut source = fs::File::open(from).map_err(Error::io("open", from))?;
            let mut copy = AtomicFile::create(to)?;
            io::copy(&mut source, &mut copy).map_err(Error::io("copy", from))?;
            if copy.commit()?.sha256 != sha256 {
                fs::remove_file(to).map_err(Error::io("remove", to))?;
                return Err(not_as_recorded(from.to_path_buf()));
            }
        }
        Placing::Link => {
            if sha256_of_file(from)? != sha256 {
                return Err(not_as_recorded(from.to_path_buf()));
            }
            let folder = to.parent().unwrap_or(to);
            fs::create_dir_all(folder).map_err(Error::io("create", folder))?;
            fs::hard_link(from, to).map_err(|error| Error::Config {
                key: "--link".into(),
                what: format!("cannot link {}: {error}", from.display()),
                hint: Some("without --link the files are copied".into()),
            })?;
        }
    }
    Ok(())
}

fn not_as_recorded(path: PathBuf) -> Error {
    let what = "a shard is not what its manifest says (SHA-256)".to_string();
    let hint = Some("copy the dataset again, or ingest the logs again".to_string());
    Error::Dataset { path, what, hint }
}

/// Whether a folder is, or would be, another one or below it.
fn lies_in(folder: &Path, other: &Path) -> bool {
    let Ok(other) = other.canonicalize() else { return false };
    let there = folder.ancestors().find_map(|above| match above.as_os_str().is_empty() {
        true => Path::new(".").canonicalize().ok(),
        false => above.canonicalize().ok(),
    });
    there.is_some_and(|there| there.starts_with(&other))
}

fn is_empty(folder: &Path) -> Result<bool> {
    match fs::read_dir(folder) {
        Ok(mut entries) => Ok(entries.next().is_none()),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(true),
        Err(error) => Err(Error::io("read", folder)(error)),
    }
}
