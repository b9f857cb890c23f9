//! Shards: frames as Parquet files, written whole or not at all.
//!
//! 64 rows a row group (about 4.7 MB with lidar), so that shuffled reading by group touches
//! little; pictures stored as they are, since JPEG does not compress again; lidar and radar as
//! delta-coded pixels and half floats under zstd.

use std::{fs::File, ops::Range, path::Path};

use arrow::array::RecordBatch;
use parquet::{
    arrow::{
        ArrowWriter, ProjectionMask,
        arrow_reader::{ArrowReaderMetadata, ParquetRecordBatchReaderBuilder},
        arrow_writer::{ArrowRowGroupWriterFactory, compute_leaves},
    },
    basic::{Compression, Encoding, ZstdLevel},
    file::{
        properties::{EnabledStatistics, WriterProperties},
        writer::SerializedFileWriter,
    },
    schema::types::ColumnPath,
};

use serde::{Deserialize, Serialize};

use crate::{
    atomic::{AtomicFile, Committed},
    dataset::{
        columns::{self, Columns, SCHEMA_VERSION, VERSION_KEY},
        halves,
        traits::Traits,
    },
    error::{Error, Result},
    frame::{Frame, Skew},
};

/// Frames in a row group.
pub const ROWS_PER_GROUP: usize = 64;

/// Rows that are handed to the encoder in one piece; between two it may begin a new page, which it
/// does after 1 MB.
const ROWS_AT_ONCE: usize = 16;

const ZSTD_LEVEL: i32 = 1;

/// Frames in a shard: about 150 MB with lidar.
pub const ROWS_PER_SHARD: usize = 2048;

/// A shard, as committed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ShardRecord {
    /// Relative to the dataset.
    pub path: String,
    /// Frames of this log in the file.
    pub rows: u64,
    /// Of the file.
    pub bytes: u64,
    /// SHA-256 of the file, lower-case hexadecimal.
    pub sha256: String,
    /// First row group and number of row groups, where the file holds shards of other logs too.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub groups: Option<[usize; 2]>,
}

/// A shard being written.
pub struct ShardWriter {
    path: std::path::PathBuf,
    writer: SerializedFileWriter<AtomicFile>,
    encoders: ArrowRowGroupWriterFactory,
    rows: usize,
}

impl ShardWriter {
    /// Begin a shard.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the file cannot be made.
    pub fn create(path: &Path) -> Result<ShardWriter> {
        let file = AtomicFile::create(path)?;
        let writer = ArrowWriter::try_new(file, columns::schema(), Some(properties()));
        let (writer, encoders) =
            writer.and_then(ArrowWriter::into_serialized_writer).map_err(Error::parquet(path))?;
        Ok(ShardWriter { path: path.to_path_buf(), writer, encoders, rows: 0 })
    }

    /// Append frames as row groups of their own.
    ///
    /// # Errors
    ///
    /// If the disk refuses.
    pub fn write(&mut self, episode: &str, frames: &[Frame]) -> Result<()> {
        for group in frames.chunks(ROWS_PER_GROUP) {
            self.write_group(episode, group).map_err(Error::parquet(&self.path))?;
        }
        self.rows += frames.len();
        Ok(())
    }

    fn write_group(&mut self, episode: &str, frames: &[Frame]) -> parquet::errors::Result<()> {
        let columns = self.writer.schema_descr().columns().to_vec();
        let schema = columns::schema();
        // Every field has one column.
        let halves = |at: usize| {
            let named = columns::HALVES.iter().find(|(name, _)| name == schema.field(at).name());
            named.map(|(_, pick)| pick)
        };
        let number = self.writer.flushed_row_groups().len();
        let mut encoders = self.encoders.create_column_writers(number)?;
        for few in frames.chunks(ROWS_AT_ONCE) {
            let batch = columns::to_columns(episode, few)?;
            for (at, encoder) in encoders.iter_mut().enumerate() {
                if halves(at).is_none() {
                    let leaves = compute_leaves(schema.field(at), batch.column(at))?;
                    leaves.iter().try_for_each(|leaf| encoder.write(leaf))?;
                }
            }
        }
        let mut group = self.writer.next_row_group()?;
        for (at, encoder) in encoders.into_iter().enumerate() {
            match halves(at) {
                Some(pick) => {
                    let lists: Vec<_> = frames.iter().map(pick).collect();
                    let (bytes, close) =
                        halves::column_chunk(columns[at].clone(), &lists, ZSTD_LEVEL)?;
                    group.append_column(&bytes, close)?;
                }
                None => encoder.close()?.append_to_row_group(&mut group)?,
            }
        }
        group.close()?;
        Ok(())
    }

    /// Frames so far.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Write the footer and give the shard its name.
    ///
    /// # Errors
    ///
    /// If the disk refuses.
    pub fn finish(self) -> Result<Committed> {
        let file = self.writer.into_inner().map_err(Error::parquet(&self.path))?;
        file.commit()
    }
}

/// How frames are encoded in a shard.
pub fn properties() -> WriterProperties {
    let zstd = Compression::ZSTD(ZstdLevel::try_new(ZSTD_LEVEL).unwrap_or_default());
    let item = |column: &str| {
        ColumnPath::new(vec![column.to_string(), "list".to_string(), "item".to_string()])
    };
    let mut properties = WriterProperties::builder()
        // Fixed, so that the same frames give the same bytes.
        .set_created_by(concat!("pmp ", env!("CARGO_PKG_VERSION")).to_string())
        // What zstd saves of a column of 64 numbers is less than setting it up costs whoever
        // reads them; of a frame it would be 1 %.
        .set_compression(Compression::UNCOMPRESSED)
        .set_dictionary_enabled(false)
        .set_statistics_enabled(EnabledStatistics::None)
        // A group has a page or a few of each column.
        .set_offset_index_disabled(true)
        .set_max_row_group_row_count(Some(ROWS_PER_GROUP));
    for column in ["frame", "stamp"] {
        let path = ColumnPath::from(column);
        properties = properties.set_column_statistics_enabled(path, EnabledStatistics::Chunk);
    }
    for column in
        ["episode", "route_source", "command", "town", "weather", "illumination", "traffic"]
    {
        properties = properties.set_column_dictionary_enabled(ColumnPath::from(column), true);
    }
    for column in ["lidar_pixel", "radar_pixel"] {
        properties = properties
            .set_column_encoding(item(column), Encoding::DELTA_BINARY_PACKED)
            .set_column_compression(item(column), zstd);
    }
    properties.build()
}

/// Where on the grid a row is, and what kind of moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RowTick {
    pub index: u32,
    pub perturbed: bool,
    pub traits: Traits,
}

/// The columns that a [`RowTick`] is of.
const TICK_COLUMNS: [&str; 7] =
    ["frame", "perturbed", "steer", "throttle", "brake", "command", "velocity"];

fn row_ticks(batch: &RecordBatch) -> Result<Vec<RowTick>, String> {
    let columns = Columns::of(batch);
    let tick = |row: usize| {
        Ok(RowTick {
            index: columns.index(row)?,
            perturbed: columns.perturbed(row)?,
            traits: Traits::new(
                columns.action(row)?,
                columns.command(row)?,
                columns.velocity_mps(row)?,
            ),
        })
    };
    (0..batch.num_rows()).map(tick).collect()
}

const SKEW_COLUMNS: [&str; 4] = ["image_skew", "lidar_skew", "radar_skew", "control_skew"];

fn row_skews(batch: &RecordBatch) -> Result<Vec<Skew>, String> {
    let columns = Columns::of(batch);
    (0..batch.num_rows()).map(|row| columns.skew(row)).collect()
}

fn row_actions(batch: &RecordBatch) -> Result<Vec<[Option<f32>; 3]>, String> {
    let columns = Columns::of(batch);
    (0..batch.num_rows()).map(|row| columns.action(row)).collect()
}

/// A shard to read from.
#[derive(Debug)]
pub struct ShardReader {
    path: std::path::PathBuf,
    metadata: ArrowReaderMetadata,
    /// Row groups of the file that are this shard's.
    groups: Range<usize>,
}

impl ShardReader {
    /// Open a shard of a dataset and read its footer.
    ///
    /// # Errors
    ///
    /// [`Error::Dataset`] if the file is missing, has not the row groups of the record, or was written under another version of the schema;
    /// [`Error::Parquet`] if it is damaged.
    pub fn open(dataset: &Path, record: &ShardRecord) -> Result<ShardReader> {
        let path = &dataset.join(&record.path);
        let fail = |what: &str, hint: &str| {
            let (path, what, hint) = (path.clone(), what.to_string(), Some(hint.to_string()));
            Error::Dataset { path, what, hint }
        };
        if !path.exists() {
            let what = "a shard that the manifest names is missing";
            return Err(fail(what, "copy the dataset again, or ingest the logs again"));
        }
        let file = File::open(path).map_err(Error::io("open", path))?;
        let metadata =
            ArrowReaderMetadata::load(&file, Default::default()).map_err(Error::parquet(path))?;
        let found = metadata.schema().metadata().get(VERSION_KEY).cloned();
        if found.as_deref() != Some(SCHEMA_VERSION.to_string().as_str()) {
            let found = found.unwrap_or_else(|| "none".to_string());
            let what = format!("frame schema version {found}, this build reads {SCHEMA_VERSION}");
            return Err(fail(&what, "ingest the logs again: the manifest names them"));
        }
        let in_file = metadata.metadata().num_row_groups();
        let [first, count] = record.groups.unwrap_or([0, in_file]);
        let groups = first..first.saturating_add(count);
        if groups.end > in_file {
            let what = format!("{in_file} row groups, where the manifest names {groups:?}");
            return Err(fail(&what, "copy the dataset again, or ingest the logs again"));
        }
        Ok(ShardReader { path: path.clone(), metadata, groups })
    }

    /// Where on the grid every row is, by row group.
    ///
    /// # Errors
    ///
    /// [`Error::Parquet`] if the shard is damaged.
    pub fn ticks(&self) -> Result<Vec<Vec<RowTick>>> {
        let schema = self.metadata.parquet_schema();
        let columns = ProjectionMask::columns(schema, TICK_COLUMNS);
        let groups = 0..self.groups.len();
        groups.map(|group| self.read(group, columns.clone(), &row_ticks)).collect()
    }

    /// Sample time minus grid time of every row.
    ///
    /// # Errors
    ///
    /// [`Error::Parquet`] if the shard is damaged.
    pub fn skews(&self) -> Result<Vec<Skew>> {
        let columns = ProjectionMask::columns(self.metadata.parquet_schema(), SKEW_COLUMNS);
        let groups = 0..self.groups.len();
        let skews = groups.map(|group| self.read(group, columns.clone(), &row_skews));
        Ok(skews.collect::<Result<Vec<_>>>()?.concat())
    }

    /// Row groups.
    pub fn group_count(&self) -> usize {
        self.groups.len()
    }

    /// Steer, throttle, brake of every row.
    ///
    /// # Errors
    ///
    /// [`Error::Parquet`] if the shard is damaged.
    pub fn actions(&self) -> Result<Vec<[Option<f32>; 3]>> {
        let columns = ["steer", "throttle", "brake"];
        let columns = ProjectionMask::columns(self.metadata.parquet_schema(), columns);
        let groups = 0..self.groups.len();
        let actions = groups.map(|group| self.read(group, columns.clone(), &row_actions));
        Ok(actions.collect::<Result<Vec<_>>>()?.concat())
    }

    /// The frames of a row group (0 is the first of this shard), each with its episode.
    ///
    /// # Errors
    ///
    /// [`Error::Parquet`] or [`Error::Dataset`] if the shard is damaged.
    pub fn frames(&self, group: usize) -> Result<Vec<(String, Frame)>> {
        self.read(group, ProjectionMask::all(), &columns::to_frames)
    }

    fn read<T>(
        &self,
        group: usize,
        columns: ProjectionMask,
        convert: &dyn Fn(&RecordBatch) -> Result<Vec<T>, String>,
    ) -> Result<Vec<T>> {
        // Opened anew each time: clones of one file share their position, which threads must not.
        let file = File::open(&self.path).map_err(Error::io("open", &self.path))?;
        let reader =
            ParquetRecordBatchReaderBuilder::new_with_metadata(file, self.metadata.clone())
                .with_projection(columns)
                .with_row_groups(vec![self.groups.start + group])
                .with_batch_size(ROWS_PER_GROUP)
                .build()
                .map_err(Error::parquet(&self.path))?;
        let mut rows = Vec::new();
        for batch in reader {
            let batch = batch.map_err(Error::arrow(&self.path))?;
            let some = convert(&batch);
            let path = || self.path.clone();
            rows.extend(some.map_err(|what| Error::Dataset { path: path(), what, hint: None })?);
        }
        Ok(rows)
    }
}
