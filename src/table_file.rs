//! One Parquet file of a few columns, written whole or not at all.
//!
//! The same columns give the same bytes: the writer's name is fixed, and so is the compression.
//! Frames are written by `dataset::shard`, which lays them out for shuffled reading.

use std::path::Path;

use arrow::{array::RecordBatch, datatypes::SchemaRef};
use parquet::{
    arrow::ArrowWriter,
    basic::{Compression, ZstdLevel},
    file::{metadata::KeyValue, properties::WriterProperties},
};

use crate::{
    atomic::{AtomicFile, Committed},
    error::{Error, Result},
};

/// Write batches of one schema, each a row group or a few; `metadata` goes into the footer.
///
/// # Errors
///
/// [`Error::Io`] if the disk refuses, [`Error::Parquet`] if a batch is of another schema, and the
/// error of a batch that could not be made.
pub fn write_batches(
    path: &Path,
    schema: SchemaRef,
    batches: impl IntoIterator<Item = Result<RecordBatch>>,
    metadata: &[(&str, String)],
) -> Result<Committed> {
    let pair = |(key, value): &(&str, String)| KeyValue::new((*key).to_string(), value.clone());
    let metadata: Vec<KeyValue> = metadata.iter().map(pair).collect();
    let properties = WriterProperties::builder()
        .set_created_by(concat!("pmp ", env!("CARGO_PKG_VERSION")).to_string())
        .set_key_value_metadata((!metadata.is_empty()).then_some(metadata))
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .build();
    let mut writer = ArrowWriter::try_new(AtomicFile::create(path)?, schema, Some(properties))
        .map_err(Error::parquet(path))?;
    for batch in batches {
        writer.write(&batch?).map_err(Error::parquet(path))?;
    }
    writer.into_inner().map_err(Error::parquet(path))?.commit()
}
