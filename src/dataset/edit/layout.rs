//! Which files a new dataset gets, and what lies in each.
//!
//! A file of which all row groups are wanted, on one side, stays as it is, unless it is small.
//! What is left of other files, and small ones, are put together as an ingest puts them, in the
//! order of the episodes. So an edit of a few logs touches a few files, and a hundred small datasets
//! put together are not a hundred small files.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use crate::dataset::{
    compaction::{PREFIX, Part, SMALL_ROWS},
    edit::source::Chosen,
    shard::{ROWS_PER_SHARD, ShardRecord},
    split::Split,
};

/// A shard of a log that was chosen.
#[derive(Clone, Debug)]
pub struct Piece<'s> {
    /// Index of the log among those that were chosen, and of the shard in its record.
    pub log: usize,
    pub shard: usize,
    /// As its source's manifest has it.
    pub record: &'s ShardRecord,
    pub source: &'s Path,
    split: Split,
    /// Of a file that is its own.
    own_name: String,
}

impl Piece<'_> {
    fn file(&self) -> PathBuf {
        self.source.join(&self.record.path)
    }

    /// What to copy of it.
    pub fn part(&self) -> Part {
        Part::of(self.source, self.record)
    }
}

/// A file of the new dataset.
#[derive(Clone, Debug)]
pub struct Laid<'s> {
    /// Relative to the dataset.
    pub path: String,
    pub pieces: Vec<Piece<'s>>,
    /// It is a file of a source, byte for byte.
    pub is_whole: bool,
}

/// The files of a dataset of some logs, which are sorted by episode.
pub fn lay<'s>(chosen: &'s [Chosen<'s>]) -> Vec<Laid<'s>> {
    let mut all_of_file: BTreeMap<PathBuf, usize> = BTreeMap::new();
    let mut seen: Vec<&Path> = Vec::new();
    for source in chosen.iter().map(|chosen| chosen.source) {
        if !seen.contains(&source.path.as_path()) {
            seen.push(&source.path);
            for shard in source.manifest.logs.iter().flat_map(|log| &log.shards) {
                *all_of_file.entry(source.path.join(&shard.path)).or_default() += 1;
            }
        }
    }
    let mut of_file: BTreeMap<PathBuf, Vec<Piece>> = BTreeMap::new();
    for piece in pieces(chosen) {
        of_file.entry(piece.file()).or_default().push(piece);
    }
    let is_whole = |pieces: &[Piece]| {
        let first_groups = pieces.iter().map(|piece| piece.record.groups.map(|[first, _]| first));
        let all = pieces.first().and_then(|piece| all_of_file.get(&piece.file()));
        all == Some(&pieces.len())
            && pieces.iter().all(|piece| piece.file() == pieces[0].file())
            && pieces.iter().all(|piece| piece.split == pieces[0].split)
            && first_groups.is_sorted()
    };
    let mut laid: Vec<Vec<Piece>> = Vec::new();
    let mut loose: BTreeMap<Split, Vec<Piece>> = BTreeMap::new();
    for pieces in of_file.into_values() {
        let rows: u64 = pieces.iter().map(|piece| piece.record.rows).sum();
        let is_small = rows > 0 && rows < SMALL_ROWS;
        match is_whole(&pieces) && !is_small {
            true => laid.push(pieces),
            false => pieces.into_iter().for_each(|piece| {
                loose.entry(piece.split).or_default().push(piece);
            }),
        }
    }
    for mut pieces in loose.into_values() {
        pieces.sort_by_key(|piece| (piece.log, piece.shard));
        laid.extend(packed(pieces));
    }
    laid.sort_by_key(|pieces| pieces.first().map(|piece| (piece.split, piece.log, piece.shard)));
    let mut several = BTreeMap::new();
    let file = |pieces: Vec<Piece<'s>>| {
        let split = pieces[0].split;
        let name = match pieces.as_slice() {
            [piece] => piece.own_name.clone(),
            _ => {
                let number = several.entry(split).or_insert(0);
                *number += 1;
                format!("{PREFIX}{:05}", *number - 1)
            }
        };
        let path = format!("frames/split={}/{name}.parquet", split.name());
        Laid { path, is_whole: is_whole(&pieces), pieces }
    };
    laid.into_iter().map(file).collect()
}

/// All shards of the logs, in their order.
fn pieces<'s>(chosen: &'s [Chosen<'s>]) -> Vec<Piece<'s>> {
    let mut pieces = Vec::new();
    for (log, Chosen { source, log: record }) in chosen.iter().enumerate() {
        let mut shard = 0;
        for (episode, own) in record.episodes.iter().zip(record.shards_by_episode()) {
            for (number, of_episode) in own.iter().enumerate() {
                pieces.push(Piece {
                    log,
                    shard,
                    record: of_episode,
                    source: &source.path,
                    split: record.split,
                    own_name: format!("{}-{number:05}", episode.id),
                });
                shard += 1;
            }
        }
    }
    pieces
}

/// Pieces put together in their order, as many in a file as are not more than a shard has.
fn packed(pieces: Vec<Piece>) -> Vec<Vec<Piece>> {
    let mut files: Vec<Vec<Piece>> = Vec::new();
    let mut rows = 0;
    for piece in pieces {
        rows += piece.record.rows;
        match files.last_mut() {
            Some(file) if rows <= ROWS_PER_SHARD as u64 => file.push(piece),
            _ => {
                rows = piece.record.rows;
                files.push(vec![piece]);
            }
        }
    }
    files
}
