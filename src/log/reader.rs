//! MCAP bytes to messages: all that can be read is read, and what cannot is said.
//!
//! The file is walked record by record, so a damaged chunk costs that chunk and a truncated tail
//! costs the tail. Every chunk's checksum is checked before its messages are used. Messages are
//! handed on in file order together with their place, so that a second pass can fetch just the
//! pictures and clouds that frames need.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs::File,
    io::{BufReader, Read, Seek, SeekFrom},
    os::unix::fs::FileExt,
    path::{Path, PathBuf},
    sync::Arc,
};

use mcap::records::{ChunkHeader, Record, op};

use crate::{
    error::{Error, Result},
    log::{
        chunk::{Decompressor, RECORD_HEADER_BYTES, Records, chunk_header, le_u64},
        clock::instant_ns,
        hashed::HashedFile,
    },
};

/// Longest record that is read, compressed or not. A chunk of 512 MiB is a hundred times what
/// recorders write; a length beyond it is damage or an attack.
pub const MAX_RECORD_BYTES: u64 = 512 << 20;

/// Messages outside chunks are fetched in pieces of this size.
const PLAIN_SEGMENT_BYTES: u64 = 4 << 20;

/// What is given by mistake: first bytes, name, what to do.
const FOREIGN: [(&[u8], &str, &str); 5] = [
    (b"#ROSBAG", "a ROS 1 bag", "convert it with `mcap convert in.bag out.mcap`"),
    (b"SQLite", "an SQLite database (rosbag2)", "convert it with `mcap convert in.db3 out.mcap`"),
    (b"\x1f\x8b", "a gzip file", "unpack it with `gunzip`"),
    (b"PK", "a zip archive", "unpack it with `unzip`"),
    (b"\x28\xb5\x2f\xfd", "a zstd file", "unpack it with `unzstd`"),
];

/// How far a scan has come is told no more often than this.
const TELL_EVERY_BYTES: u64 = 1 << 20;

const MESSAGE_HEADER_BYTES: usize = 22;

/// The definition of a message type, as the log carries it.
#[derive(Debug, PartialEq, Eq)]
pub struct SchemaRecord {
    /// For example `nav_msgs/msg/Odometry`.
    pub name: String,
    /// For example `ros2msg`.
    pub encoding: String,
    pub data: Vec<u8>,
}

/// A topic of the log.
#[derive(Debug, PartialEq, Eq)]
pub struct Channel {
    pub id: u16,
    pub topic: String,
    /// For example `cdr`.
    pub message_encoding: String,
    /// `None` for messages without a definition (schema id 0).
    pub schema: Option<Arc<SchemaRecord>>,
}

/// Where a message lies in the file: fetch it again with a [`SegmentReader`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place {
    pub segment: u32,
    /// Byte range of the message's data within the segment.
    pub start: u32,
    pub len: u32,
}

/// One message, as scanned.
#[derive(Debug)]
pub struct Message<'a> {
    pub channel: &'a Arc<Channel>,
    /// When it was recorded, ns since the Unix epoch.
    pub log_time_ns: i64,
    /// When it was sent, ns since the Unix epoch.
    pub publish_time_ns: i64,
    pub data: &'a [u8],
    pub place: Place,
}

/// A part of the file that could not be read.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Damage {
    /// Byte offset in the file.
    pub offset: u64,
    pub what: String,
}

/// Sees a log while it is scanned.
pub trait Visitor {
    /// The next message that could be read.
    fn message(&mut self, message: &Message) -> Result<()>;

    /// All messages of a chunk have been seen: those whose place is in segment `chunk`, and whose
    /// data lies in `data` as their places say.
    fn chunk(&mut self, log: &Log, chunk: u32, data: &[u8]) -> Result<()>;
}

/// Sees messages alone.
struct Messages<'f>(&'f mut dyn FnMut(&Message) -> Result<()>);

impl Visitor for Messages<'_> {
    fn message(&mut self, message: &Message) -> Result<()> {
        (self.0)(message)
    }

    fn chunk(&mut self, _log: &Log, _chunk: u32, _data: &[u8]) -> Result<()> {
        Ok(())
    }
}

/// A run of messages that is read and decompressed at once.
#[derive(Clone, Debug)]
enum Segment {
    Chunk { data_offset: u64, stored_bytes: u64, header: ChunkHeader },
    Plain { offset: u64, len: u64 },
}

/// A scanned log.
#[derive(Debug)]
pub struct Log {
    pub path: PathBuf,
    pub size_bytes: u64,
    /// SHA-256 of the file, lower-case hexadecimal.
    pub sha256: String,
    pub channels: BTreeMap<u16, Arc<Channel>>,
    /// Messages a channel, by channel id.
    pub counts: BTreeMap<u16, u64>,
    /// Metadata records: name to keys and values, the first of each name.
    pub metadata: BTreeMap<String, BTreeMap<String, String>>,
    pub damage: Vec<Damage>,
    file: File,
    segments: Vec<Segment>,
}

impl Log {
    /// Walk the file once, handing every readable message to `on_message` in file order.
    ///
    /// Damage inside the file is collected in [`Log::damage`], it is not an error.
    ///
    /// # Errors
    ///
    /// If the file cannot be opened or read, is empty, or does not begin as an MCAP file does;
    /// and whatever `on_message` returns.
    pub fn scan(path: &Path, on_message: &mut dyn FnMut(&Message) -> Result<()>) -> Result<Log> {
        Log::visit(path, &|_| (), &mut Messages(on_message))
    }

    /// The same; `on_bytes` hears how many bytes it has gone through so far.
    ///
    /// # Errors
    ///
    /// As [`Log::scan`].
    pub fn visit(path: &Path, on_bytes: &dyn Fn(u64), visitor: &mut dyn Visitor) -> Result<Log> {
        let file = File::open(path).map_err(Error::io("open", path))?;
        let size_bytes = file.metadata().map_err(Error::io("examine", path))?.len();
        let mut log = Log {
            path: path.to_path_buf(),
            size_bytes,
            sha256: String::new(),
            channels: BTreeMap::new(),
            counts: BTreeMap::new(),
            metadata: BTreeMap::new(),
            damage: Vec::new(),
            file,
            segments: Vec::new(),
        };
        log.check_magic()?;
        let chunks = BTreeSet::new();
        Walk { schemas: BTreeMap::new(), chunks, on_bytes, visitor }.run(&mut log)?;
        Ok(log)
    }

    /// A log as far as it has been scanned: its messages can be fetched while the scan goes on.
    ///
    /// # Errors
    ///
    /// If the system has no more handles for files.
    pub fn so_far(&self) -> Result<Log> {
        Ok(Log {
            path: self.path.clone(),
            size_bytes: self.size_bytes,
            sha256: String::new(),
            channels: self.channels.clone(),
            counts: self.counts.clone(),
            metadata: self.metadata.clone(),
            damage: Vec::new(),
            file: self.file.try_clone().map_err(Error::io("open", &self.path))?,
            segments: self.segments.clone(),
        })
    }

    /// Messages that could be read.
    pub fn message_count(&self) -> u64 {
        self.counts.values().sum()
    }

    /// Whether there is a channel of this topic, with or without messages.
    pub fn has_topic(&self, topic: &str) -> bool {
        self.channels.values().any(|channel| channel.topic == topic)
    }

    /// Where in the file a message lies, or the chunk that holds it.
    pub fn offset_of(&self, place: Place) -> u64 {
        match &self.segments[place.segment as usize] {
            Segment::Chunk { data_offset, .. } => *data_offset,
            Segment::Plain { offset, .. } => offset + u64::from(place.start),
        }
    }

    fn read_at(&self, offset: u64, len: u64) -> Result<Vec<u8>> {
        let mut bytes = vec![0; len as usize];
        self.file.read_exact_at(&mut bytes, offset).map_err(Error::io("read", &self.path))?;
        Ok(bytes)
    }

    fn check_magic(&self) -> Result<()> {
        let fail = |what: &str, hint: &str| {
            let (path, what, hint) = (self.path.clone(), what.to_string(), Some(hint.to_string()));
            Err(Error::Log { path, offset: 0, what, hint })
        };
        if self.size_bytes == 0 {
            return fail("the file is empty", "was the recorder stopped before it wrote anything?");
        }
        let head = self.read_at(0, self.size_bytes.min(mcap::MAGIC.len() as u64))?;
        if head == mcap::MAGIC {
            return Ok(());
        }
        let what = "this is not an MCAP file: its first bytes are not the MCAP magic";
        match FOREIGN.iter().find(|(magic, ..)| head.starts_with(magic)) {
            Some((_, name, hint)) => fail(&format!("{what} but those of {name}"), hint),
            None => {
                fail(what, "rosbag2 .db3 and ROS 1 .bag files can be converted with `mcap convert`")
            }
        }
    }

    /// Offsets of all chunks according to the summary at the end of the file, ascending.
    ///
    /// Empty where there is no usable summary: it only serves to find a way past damage.
    fn indexed_chunk_offsets(&self) -> Vec<u64> {
        let footer_bytes = RECORD_HEADER_BYTES + 20;
        let tail = footer_bytes + mcap::MAGIC.len() as u64;
        let Some(footer_at) = self.size_bytes.checked_sub(tail) else { return Vec::new() };
        let Ok(footer) = self.read_at(footer_at, footer_bytes) else { return Vec::new() };
        let body = &footer[RECORD_HEADER_BYTES as usize..];
        let summary_start = match mcap::parse_record(footer[0], body) {
            Ok(Record::Footer(footer)) => footer.summary_start,
            _ => return Vec::new(),
        };
        let len = footer_at.saturating_sub(summary_start);
        if summary_start == 0 || len > MAX_RECORD_BYTES {
            return Vec::new();
        }
        let Ok(summary) = self.read_at(summary_start, len) else { return Vec::new() };
        let mut offsets: Vec<u64> = Records::new(&summary)
            .filter(|record| record.opcode == op::CHUNK_INDEX)
            .filter_map(|record| match mcap::parse_record(record.opcode, record.body) {
                Ok(Record::ChunkIndex(index)) => Some(index.chunk_start_offset),
                _ => None,
            })
            .collect();
        offsets.sort_unstable();
        offsets
    }
}

/// One pass over the file.
struct Walk<'f> {
    schemas: BTreeMap<u16, Arc<SchemaRecord>>,
    /// Where chunks were met, readable or not.
    chunks: BTreeSet<u64>,
    on_bytes: &'f dyn Fn(u64),
    visitor: &'f mut dyn Visitor,
}

impl Walk<'_> {
    fn run(mut self, log: &mut Log) -> Result<()> {
        let path = log.path.clone();
        let file = log.file.try_clone().map_err(Error::io("open", &path))?;
        // Small, so that chunks are read past it, straight to where they are wanted.
        let mut reader = BufReader::with_capacity(1 << 14, HashedFile::new(file));
        self.records(log, &mut reader)?;
        log.sha256 = reader.into_inner().finish().map_err(Error::io("read", &path))?;
        (self.on_bytes)(log.size_bytes);
        Ok(())
    }

    fn records(&mut self, log: &mut Log, reader: &mut BufReader<HashedFile>) -> Result<()> {
        let path = log.path.clone();
        let mut offset = mcap::MAGIC.len() as u64;
        reader.seek(SeekFrom::Start(offset)).map_err(Error::io("read", &path))?;
        let mut body = Vec::new();
        let mut decompressor = Decompressor::default();
        let mut told = 0;

        loop {
            if offset >= told + TELL_EVERY_BYTES {
                told = offset;
                (self.on_bytes)(offset);
            }
            let left = log.size_bytes - offset;
            let mut header = [0; RECORD_HEADER_BYTES as usize];
            if left < RECORD_HEADER_BYTES {
                log.damaged(offset, "the file is cut off: it ends without a footer");
                return Ok(());
            }
            reader.read_exact(&mut header).map_err(Error::io("read", &path))?;
            let (opcode, len) = (header[0], le_u64(&header[1..]));
            let whole = len <= left - RECORD_HEADER_BYTES;
            let known = (op::HEADER..=op::DATA_END).contains(&opcode) || opcode >= 0x80;
            if !(known && whole && len <= MAX_RECORD_BYTES) {
                let cut = known && !whole;
                let next = log.indexed_chunk_offsets().into_iter().find(|at| *at > offset);
                match next.filter(|at| *at < log.size_bytes) {
                    Some(next) => {
                        let what = format!("unreadable record; reading goes on at byte {next}");
                        log.damaged(offset, &what);
                        self.chunks.insert(offset);
                        offset = next;
                        reader.seek(SeekFrom::Start(offset)).map_err(Error::io("read", &path))?;
                        continue;
                    }
                    // What is left of a cut chunk cannot be held against its checksum.
                    None if cut && opcode == op::CHUNK => {
                        log.damaged(offset, "the file is cut off in this chunk, which is left out");
                    }
                    None if cut => log.damaged(offset, "the file is cut off in this record"),
                    None => log.damaged(offset, "unreadable record; nothing after it was read"),
                }
                return Ok(());
            }

            match opcode {
                op::SCHEMA | op::CHANNEL | op::MESSAGE | op::CHUNK | op::METADATA => {
                    body.resize(len as usize, 0);
                    reader.read_exact(&mut body).map_err(Error::io("read", &path))?;
                }
                _ => reader.seek_relative(len as i64).map_err(Error::io("read", &path))?,
            }
            match opcode {
                op::CHUNK => {
                    self.chunks.insert(offset);
                    self.chunk(log, offset, &body, &mut decompressor)?;
                }
                op::MESSAGE => {
                    let place = log.place_plain(offset, RECORD_HEADER_BYTES + len);
                    self.record(log, opcode, &body, place)?;
                }
                op::SCHEMA | op::CHANNEL | op::METADATA => {
                    self.record(log, opcode, &body, (0, 0))?;
                }
                op::DATA_END | op::FOOTER => match self.chunk_not_met(log, offset) {
                    Some(next) => {
                        let what = format!("the data ends early; reading goes on at byte {next}");
                        log.damaged(offset, &what);
                        offset = next;
                        reader.seek(SeekFrom::Start(offset)).map_err(Error::io("read", &path))?;
                        continue;
                    }
                    None => return Ok(()),
                },
                _ => {}
            }
            offset += RECORD_HEADER_BYTES + len;
        }
    }

    /// At the end of the data: report the chunks that the summary names and that were passed by,
    /// taken for something else; and the first that lies beyond the end.
    fn chunk_not_met(&mut self, log: &mut Log, end: u64) -> Option<u64> {
        let offsets = log.indexed_chunk_offsets();
        for at in offsets.iter().filter(|at| **at <= end) {
            if self.chunks.insert(*at) {
                log.damaged(*at, "the index names a chunk here, and there is none to be read");
            }
        }
        offsets.into_iter().find(|at| *at > end && *at < log.size_bytes)
    }

    fn chunk(
        &mut self,
        log: &mut Log,
        offset: u64,
        body: &[u8],
        decompressor: &mut Decompressor,
    ) -> Result<()> {
        let Some((header, header_bytes)) = chunk_header(body) else {
            log.damaged(offset, "chunk with an unreadable header");
            return Ok(());
        };
        if header.uncompressed_size > MAX_RECORD_BYTES {
            let what = format!("chunk that claims {} bytes", header.uncompressed_size);
            log.damaged(offset, &what);
            return Ok(());
        }
        let stored_bytes = header.compressed_size;
        let Some(stored) = body[header_bytes..].get(..stored_bytes as usize) else {
            log.damaged(offset, "chunk that claims more bytes than it has");
            return Ok(());
        };
        let data = match decompressor.decompress(&header, stored) {
            Ok(data) => data,
            Err(why) => {
                log.damaged(offset, &format!("chunk that does not decompress ({why}), left out"));
                return Ok(());
            }
        };
        if header.uncompressed_crc != 0 && crc32fast::hash(data) != header.uncompressed_crc {
            log.damaged(offset, "chunk whose checksum does not match, left out");
            return Ok(());
        }
        let segment = log.segments.len() as u32;
        let data_offset = offset + RECORD_HEADER_BYTES + header_bytes as u64;
        log.segments.push(Segment::Chunk { data_offset, stored_bytes, header });
        let mut read = 0;
        for record in Records::new(data) {
            read = record.start + record.body.len();
            self.record(log, record.opcode, record.body, (segment, record.start as u32))?;
        }
        if read != data.len() {
            log.damaged(offset, "chunk whose records do not fill it");
        }
        self.visitor.chunk(log, segment, data)
    }

    /// A record that tells something about the log; `place` is (segment, start of the body).
    fn record(&mut self, log: &mut Log, opcode: u8, body: &[u8], place: (u32, u32)) -> Result<()> {
        match mcap::parse_record(opcode, body) {
            Ok(Record::Schema { header, data }) => {
                let schema = SchemaRecord {
                    name: header.name,
                    encoding: header.encoding,
                    data: data.into_owned(),
                };
                self.schemas.entry(header.id).or_insert_with(|| Arc::new(schema));
            }
            Ok(Record::Channel(channel)) => {
                let schema = self.schemas.get(&channel.schema_id).cloned();
                log.channels.entry(channel.id).or_insert_with(|| {
                    Arc::new(Channel {
                        id: channel.id,
                        topic: channel.topic,
                        message_encoding: channel.message_encoding,
                        schema,
                    })
                });
            }
            Ok(Record::Message { header, data }) => {
                let Some(channel) = log.channels.get(&header.channel_id) else {
                    log.damaged(0, &format!("message of unknown channel {}", header.channel_id));
                    return Ok(());
                };
                *log.counts.entry(header.channel_id).or_default() += 1;
                let place = Place {
                    segment: place.0,
                    start: place.1 + MESSAGE_HEADER_BYTES as u32,
                    len: data.len() as u32,
                };
                self.visitor.message(&Message {
                    channel,
                    log_time_ns: instant_ns(header.log_time),
                    publish_time_ns: instant_ns(header.publish_time),
                    data: &data,
                    place,
                })?;
            }
            Ok(Record::Metadata(metadata)) => {
                log.metadata.entry(metadata.name).or_insert(metadata.metadata);
            }
            Ok(_) => {}
            Err(error) => log.damaged(0, &format!("record with opcode {opcode:#04x}: {error}")),
        }
        Ok(())
    }
}

impl Log {
    fn damaged(&mut self, offset: u64, what: &str) {
        /// More than this says nothing more, and a hostile file must not fill the memory.
        const MOST: usize = 1000;
        if self.damage.len() < MOST {
            self.damage.push(Damage { offset, what: what.to_string() });
        }
    }

    /// The place of a message record outside chunks: (segment, start of the body).
    fn place_plain(&mut self, offset: u64, record_bytes: u64) -> (u32, u32) {
        let fits = match self.segments.last() {
            Some(Segment::Plain { offset: from, len }) => {
                from + len == offset && len + record_bytes <= PLAIN_SEGMENT_BYTES
            }
            _ => false,
        };
        if !fits {
            self.segments.push(Segment::Plain { offset, len: 0 });
        }
        let index = self.segments.len() - 1;
        let Segment::Plain { len, .. } = &mut self.segments[index] else {
            unreachable!("a plain segment was just made sure of")
        };
        let start = *len + RECORD_HEADER_BYTES;
        *len += record_bytes;
        (index as u32, start as u32)
    }
}

/// Fetches messages of a scanned log again; a segment is read and decompressed once for all the
/// messages of it that are asked for in a row.
pub struct SegmentReader<'l> {
    log: &'l Log,
    current: Option<u32>,
    stored: Vec<u8>,
    decompressor: Decompressor,
}

impl<'l> SegmentReader<'l> {
    pub fn new(log: &'l Log) -> Self {
        let (stored, decompressor) = (Vec::new(), Decompressor::default());
        SegmentReader { log, current: None, stored, decompressor }
    }

    /// The data of a message.
    ///
    /// # Errors
    ///
    /// If the file has changed or become unreadable since the scan.
    pub fn message(&mut self, place: &Place) -> Result<&[u8]> {
        let log = self.log;
        let (offset, stored_bytes, header) = match &log.segments[place.segment as usize] {
            Segment::Plain { offset, len } => (*offset, *len, None),
            Segment::Chunk { data_offset, stored_bytes, header } => {
                (*data_offset, *stored_bytes, Some(header))
            }
        };
        let changed = |what: String| {
            let hint = Some("was it changed while it was read? ingest it again".to_string());
            Error::Log { path: log.path.clone(), offset, what, hint }
        };
        let is_new = self.current.replace(place.segment) != Some(place.segment);
        if is_new {
            self.stored.resize(stored_bytes as usize, 0);
            let read = log.file.read_exact_at(&mut self.stored, offset);
            read.map_err(Error::io("read", &log.path))?;
        }
        let segment = match header {
            Some(header) if is_new => {
                self.decompressor.decompress(header, &self.stored).map_err(changed)?
            }
            Some(header) => self.decompressor.last(header, &self.stored),
            None => &self.stored,
        };
        let range = place.start as usize..(place.start + place.len) as usize;
        segment.get(range).ok_or_else(|| changed("a message that is not there any more".into()))
    }
}
