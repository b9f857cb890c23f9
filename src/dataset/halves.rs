//! Lists of half floats as Parquet bytes.
//!
//! The parquet crate makes a counted piece of shared memory of every half float on its way into a
//! file, and a frame has twenty thousand. Here a column of a row group is one page, written as the
//! format has it (<https://parquet.apache.org/docs/file-format/data-pages/>): the repetition and
//! definition levels, then the values, under zstd. With their bytes split they would take
//! less, a twentieth of a dataset, and DuckDB 2.0 does not read that.

use half::f16;
use parquet::{
    basic::{Compression, Encoding},
    column::{
        page::{CompressedPage, Page, PageWriter},
        writer::ColumnCloseResult,
    },
    errors::{ParquetError, Result},
    file::{
        metadata::ColumnChunkMetaData,
        writer::{SerializedPageWriter, TrackedWrite},
    },
    schema::types::ColumnDescPtr,
};
use prost::bytes::Bytes;

/// Definition levels: no list, a list without values, a value.
const NO_LIST: u8 = 0;
const NO_VALUE: u8 = 1;
const VALUE: u8 = 2;

/// A column chunk of nullable lists of half floats, and what the footer says of it; a list per row.
///
/// # Errors
///
/// If the format has no room for so many.
pub fn column_chunk(
    column: ColumnDescPtr,
    lists: &[Option<&[f16]>],
    zstd_level: i32,
) -> Result<(Bytes, ColumnCloseResult)> {
    let (mut repetition, mut definition) = (Levels::default(), Levels::default());
    for list in lists {
        let len = list.map_or(0, <[f16]>::len);
        repetition.push(0, 1);
        repetition.push(1, len.saturating_sub(1));
        match list {
            None => definition.push(NO_LIST, 1),
            Some([]) => definition.push(NO_VALUE, 1),
            Some(_) => definition.push(VALUE, len),
        }
    }
    let num_values = repetition.count();
    let mut body = Vec::new();
    repetition.write(&mut body);
    definition.write(&mut body);
    for list in lists.iter().flatten() {
        let from = body.len();
        body.resize(from + 2 * list.len(), 0);
        for (value, bytes) in list.iter().zip(body[from..].as_chunks_mut().0) {
            *bytes = value.to_le_bytes();
        }
    }
    let compressed = zstd::bulk::compress(&body, zstd_level)
        .map_err(|error| ParquetError::External(Box::new(error)))?;
    let page = Page::DataPage {
        buf: compressed.into(),
        num_values: u32::try_from(num_values)?,
        encoding: Encoding::PLAIN,
        def_level_encoding: Encoding::RLE,
        rep_level_encoding: Encoding::RLE,
        statistics: None,
    };
    let mut bytes = TrackedWrite::new(Vec::new());
    let page = CompressedPage::new(page, body.len());
    let written = SerializedPageWriter::new(&mut bytes).write_page(page)?;
    let bytes = Bytes::from(bytes.into_inner()?);
    let zstd = parquet::basic::ZstdLevel::try_new(zstd_level)?;
    let metadata = ColumnChunkMetaData::builder(column)
        .set_encodings(vec![Encoding::PLAIN, Encoding::RLE])
        .set_compression(Compression::ZSTD(zstd))
        .set_num_values(num_values as i64)
        .set_total_compressed_size(written.compressed_size as i64)
        .set_total_uncompressed_size(written.uncompressed_size as i64)
        .set_data_page_offset(0)
        .build()?;
    let close = ColumnCloseResult {
        bytes_written: written.bytes_written,
        rows_written: lists.len() as u64,
        metadata,
        bloom_filter: None,
        column_index: None,
        offset_index: None,
    };
    Ok((bytes, close))
}

/// Levels in runs of equal ones.
#[derive(Default)]
struct Levels(Vec<(u8, usize)>);

impl Levels {
    fn push(&mut self, level: u8, count: usize) {
        match self.0.last_mut() {
            Some((last, so_far)) if *last == level => *so_far += count,
            _ if count > 0 => self.0.push((level, count)),
            _ => {}
        }
    }

    fn count(&self) -> usize {
        self.0.iter().map(|(_, count)| count).sum()
    }

    /// Their length, then runs of the RLE encoding: twice the count as LEB128, and the level.
    fn write(&self, into: &mut Vec<u8>) {
        let mut runs = Vec::new();
        for (level, count) in &self.0 {
            let mut rest = count << 1;
            while rest >= 0x80 {
                runs.push(rest as u8 | 0x80);
                rest >>= 7;
            }
            runs.extend([rest as u8, *level]);
        }
        into.extend((runs.len() as u32).to_le_bytes());
        into.extend(runs);
    }
}
