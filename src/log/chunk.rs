//! Chunks of an MCAP file: the header, the bytes inside, and the records in those.

use std::io::{self, Read};

use mcap::records::ChunkHeader;

/// Opcode and length before every record's body.
pub const RECORD_HEADER_BYTES: u64 = 9;

/// Largest claim for which memory is taken at once; beyond it the buffer grows with what comes.
const MOST_AT_ONCE: usize = 32 << 20;

/// Header of a chunk record and its length; `None` if it is cut or no text is text.
pub fn chunk_header(body: &[u8]) -> Option<(ChunkHeader, usize)> {
    // start, end and size (8 each), checksum (4), then the compression's name with its length.
    let name_len = u32::from_le_bytes(body.get(28..32)?.try_into().ok()?) as usize;
    let name = body.get(32..32usize.checked_add(name_len)?)?;
    let header_bytes = 32 + name_len + 8;
    let header = ChunkHeader {
        message_start_time: le_u64(body.get(0..8)?),
        message_end_time: le_u64(body.get(8..16)?),
        uncompressed_size: le_u64(body.get(16..24)?),
        uncompressed_crc: u32::from_le_bytes(body.get(24..28)?.try_into().ok()?),
        compression: String::from_utf8(name.to_vec()).ok()?,
        compressed_size: le_u64(body.get(header_bytes - 8..header_bytes)?),
    };
    Some((header, header_bytes))
}

/// Decompresses chunk after chunk into a buffer that it keeps: a fresh megabyte for every chunk
/// would cost more in page faults than the decompression does in arithmetic.
#[derive(Default)]
pub struct Decompressor {
    zstd: Option<zstd::bulk::Decompressor<'static>>,
    data: Vec<u8>,
}

impl Decompressor {
    /// The bytes inside a chunk.
    ///
    /// # Errors
    ///
    /// A sentence, if the compression is not known, or the chunk does not hold exactly the bytes
    /// that its header claims. The claim bounds the memory that is taken; the caller bounds it.
    pub fn decompress<'b>(
        &'b mut self,
        header: &ChunkHeader,
        stored: &'b [u8],
    ) -> Result<&'b [u8], String> {
        let expected = header.uncompressed_size as usize;
        let data = match header.compression.as_str() {
            "" => stored,
            "zstd" if expected > MOST_AT_ONCE => {
                self.data.clear();
                zstd::Decoder::with_buffer(stored)
                    .and_then(|decoder| read_at_most(decoder, expected, &mut self.data))
                    .map_err(|error| error.to_string())?;
                &self.data
            }
            "zstd" => {
                self.data.clear();
                self.data.reserve(expected);
                let zstd = match self.zstd.take() {
                    Some(zstd) => zstd,
                    None => zstd::bulk::Decompressor::new().map_err(|error| error.to_string())?,
                };
                let read = self.zstd.insert(zstd).decompress_to_buffer(stored, &mut self.data);
                read.map_err(|error| error.to_string())?;
                &self.data
            }
            "lz4" => {
                self.data.clear();
                lz4::Decoder::new(stored)
                    .and_then(|decoder| read_at_most(decoder, expected, &mut self.data))
                    .map_err(|error| error.to_string())?;
                &self.data
            }
            other => return Err(format!("unknown compression `{other}`")),
        };
        match data.len() == expected {
            true => Ok(data),
            false => Err(format!("it holds {} bytes and claims {expected}", data.len())),
        }
    }

    /// What the last chunk held; an uncompressed one lies in `stored` itself.
    pub fn last<'b>(&'b self, header: &ChunkHeader, stored: &'b [u8]) -> &'b [u8] {
        if header.compression.is_empty() { stored } else { &self.data }
    }
}

/// Read all, or one byte more than is expected: enough to know that it is too much.
fn read_at_most(decoder: impl Read, expected: usize, data: &mut Vec<u8>) -> io::Result<usize> {
    decoder.take(expected as u64 + 1).read_to_end(data)
}

/// Records of a decompressed chunk or of the summary, as far as they are whole.
pub struct Records<'a> {
    data: &'a [u8],
    at: usize,
}

/// A record, not yet parsed.
pub struct RawRecord<'a> {
    pub opcode: u8,
    pub body: &'a [u8],
    /// Where the body starts.
    pub start: usize,
}

impl<'a> Records<'a> {
    pub fn new(data: &'a [u8]) -> Self {
        Records { data, at: 0 }
    }
}

impl<'a> Iterator for Records<'a> {
    type Item = RawRecord<'a>;

    fn next(&mut self) -> Option<Self::Item> {
        let start = self.at + RECORD_HEADER_BYTES as usize;
        let header = self.data.get(self.at..start)?;
        let len = usize::try_from(le_u64(&header[1..])).ok()?;
        let body = self.data.get(start..start.checked_add(len)?)?;
        self.at = start + len;
        Some(RawRecord { opcode: header[0], body, start })
    }
}

/// The little-endian number in the first eight bytes.
pub fn le_u64(bytes: &[u8]) -> u64 {
    bytes.iter().take(8).rev().fold(0, |value, byte| value << 8 | u64::from(*byte))
}
