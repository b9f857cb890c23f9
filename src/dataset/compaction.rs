//! Small shards put together: a thousand short logs are not a thousand small files.
//!
//! Logs commit alone, each into shards of its own. When all are committed and before the manifest
//! is written, shards of less than half the usual size are copied together, row group by row
//! group as they lie in their files, so nothing is decoded and every row group stays one log's.

use std::{
    fs::{self, File},
    ops::Range,
    path::{Path, PathBuf},
};

use parquet::{
    column::writer::ColumnCloseResult,
    file::{
        properties::WriterPropertiesBuilder,
        reader::{FileReader, SerializedFileReader},
        writer::SerializedFileWriter,
    },
};

use crate::{
    atomic::{AtomicFile, Committed},
    dataset::{
        manifest::LogRecord,
        shard::{ROWS_PER_SHARD, ShardRecord, properties},
        split::Split,
    },
    error::{Error, Result},
};

/// Shards with fewer rows are put together with others.
pub const SMALL_ROWS: u64 = ROWS_PER_SHARD as u64 / 2;

/// First part of the names of files that hold the shards of several logs.
pub const PREFIX: &str = "several-";

/// Put small shards of each split together, in the order of the episodes, and let the records
/// name the files that then hold them. The small files stay until [`remove_leftovers`].
///
/// # Errors
///
/// If the disk refuses, or a shard has become unreadable.
pub fn compact(dataset: &Path, logs: &mut [LogRecord]) -> Result<()> {
    remove_earlier_attempts(dataset)?;
    logs.sort_by(|a, b| a.episode.cmp(&b.episode));
    for split in Split::ALL {
        let of_split = logs.iter_mut().filter(|log| log.split == split);
        let mut small: Vec<&mut ShardRecord> = of_split
            .flat_map(|log| &mut log.shards)
            .filter(|shard| shard.rows > 0 && shard.rows < SMALL_ROWS)
            .collect();
        let mut number = 0;
        while small.len() > 1 {
            let mut rows = 0;
            let mut fits = |shard: &&mut ShardRecord| {
                rows += shard.rows;
                rows <= ROWS_PER_SHARD as u64
            };
            // Two small ones always fit.
            let count = small.iter().take_while(|shard| fits(shard)).count();
            let rest = small.split_off(count);
            let path = format!("frames/split={}/{PREFIX}{number:05}.parquet", split.name());
            if small.len() > 1 {
                merge(dataset, &path, &mut small)?;
                number += 1;
            }
            small = rest;
        }
    }
    Ok(())
}

/// Remove the shards that no record names any more: what they held was put together.
///
/// # Errors
///
/// If the disk refuses.
pub fn remove_leftovers(dataset: &Path, logs: &[LogRecord]) -> Result<()> {
    for_each_shard(dataset, |path, name| {
        let is_named = logs.iter().flat_map(|log| &log.shards).any(|shard| shard.path == name);
        if is_named { Ok(()) } else { fs::remove_file(path).map_err(Error::io("remove", path)) }
    })
}

fn remove_earlier_attempts(dataset: &Path) -> Result<()> {
    for_each_shard(dataset, |path, name| {
        let file = name.rsplit('/').next().unwrap_or(name);
        if file.starts_with(PREFIX) {
            fs::remove_file(path).map_err(Error::io("remove", path))?;
        }
        Ok(())
    })
}

/// Every Parquet file below `frames/`, with its path as records name it.
fn for_each_shard(dataset: &Path, mut on: impl FnMut(&Path, &str) -> Result<()>) -> Result<()> {
    for split in Split::ALL {
        let folder = format!("frames/split={}", split.name());
        let Ok(entries) = fs::read_dir(dataset.join(&folder)) else { continue };
        for entry in entries {
            let path = entry.map_err(Error::io("read", dataset))?.path();
            let file = path.file_name().unwrap_or_default().to_string_lossy();
            if file.ends_with(".parquet") {
                on(&path, &format!("{folder}/{file}"))?;
            }
        }
    }
    Ok(())
}

fn merge(dataset: &Path, name: &str, shards: &mut [&mut ShardRecord]) -> Result<()> {
    let parts: Vec<Part> = shards.iter().map(|shard| Part::of(dataset, shard)).collect();
    let (committed, groups) = copy_groups(&dataset.join(name), &parts)?;
    for (shard, groups) in shards.iter_mut().zip(groups) {
        shard.path = name.to_string();
        shard.bytes = committed.bytes;
        shard.sha256.clone_from(&committed.sha256);
        shard.groups = Some([groups.start, groups.len()]);
    }
    Ok(())
}

/// Row groups of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    pub path: PathBuf,
    /// `None` is all.
    pub groups: Option<Range<usize>>,
}

impl Part {
    /// The row groups of a shard of a dataset.
    pub fn of(dataset: &Path, shard: &ShardRecord) -> Part {
        let groups = shard.groups.map(|[first, count]| first..first.saturating_add(count));
        Part { path: dataset.join(&shard.path), groups }
    }

    fn open(&self) -> Result<(File, SerializedFileReader<File>)> {
        let file = File::open(&self.path).map_err(Error::io("open", &self.path))?;
        let reader = file.try_clone().map_err(Error::io("open", &self.path))?;
        let reader = SerializedFileReader::new(reader).map_err(Error::parquet(&self.path))?;
        Ok((file, reader))
    }
}

/// Write one shard of the row groups of others, byte for byte as they lie there, in their order;
/// gives the row groups that each part became. The first part says what the footer says.
///
/// # Errors
///
/// If the disk refuses, there is no part, or a file has not the row groups.
pub fn copy_groups(path: &Path, parts: &[Part]) -> Result<(Committed, Vec<Range<usize>>)> {
    let damaged = |path: &Path, what: &str| Error::Dataset {
        path: path.to_path_buf(),
        what: what.to_string(),
        hint: Some("copy the dataset again, or ingest the logs again".to_string()),
    };
    let first = parts.first().ok_or_else(|| damaged(path, "a shard of nothing"))?;
    let (_, first) = first.open()?;
    let first = first.metadata().file_metadata();
    let properties = WriterPropertiesBuilder::from(properties())
        .set_key_value_metadata(first.key_value_metadata().cloned())
        .build();
    let schema = first.schema_descr().root_schema_ptr();
    let mut writer =
        SerializedFileWriter::new(AtomicFile::create(path)?, schema, properties.into())
            .map_err(Error::parquet(path))?;
    let mut ranges = Vec::with_capacity(parts.len());
    for part in parts {
        let (file, reader) = part.open()?;
        let all = reader.metadata().row_groups();
        let groups = match &part.groups {
            None => all,
            Some(range) => all
                .get(range.clone())
                .ok_or_else(|| damaged(&part.path, "fewer row groups than the manifest names"))?,
        };
        let first_group = writer.flushed_row_groups().len();
        ranges.push(first_group..first_group + groups.len());
        for group in groups {
            let mut copy = writer.next_row_group().map_err(Error::parquet(path))?;
            for column in group.columns() {
                let closed = ColumnCloseResult {
                    bytes_written: column.compressed_size() as u64,
                    rows_written: group.num_rows() as u64,
                    metadata: column.clone(),
                    bloom_filter: None,
                    column_index: None,
                    offset_index: None,
                };
                copy.append_column(&file, closed).map_err(Error::parquet(path))?;
            }
            copy.close().map_err(Error::parquet(path))?;
        }
    }
    Ok((writer.into_inner().map_err(Error::parquet(path))?.commit()?, ranges))
}
