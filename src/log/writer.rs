//! Messages in, an MCAP file out: what a recorder would have left.
//!
//! The file grows under a temporary name beside its own and takes that when it is finished, so a
//! drive that was cut off never looks whole. No wall clock and no thread count gets into the
//! bytes: the same messages and options give the same file.

use std::{
    collections::BTreeMap,
    fs::{self, File},
    io::BufWriter,
    path::{Path, PathBuf},
};

use mcap::{
    McapError, WriteOptions,
    records::{MessageHeader, Metadata},
};

use crate::{
    atomic::{sync_folder, unfinished_name},
    error::{Error, Result},
    log::encode::{Endian, Message},
};

/// How chunks are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ChunkCompression {
    #[default]
    Zstd,
    Lz4,
    None,
}

/// How a log is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogOptions {
    pub compression: ChunkCompression,
    /// Bytes of messages after which a chunk is closed, before compression.
    pub chunk_bytes: u64,
    pub endian: Endian,
    /// What MCAP calls the profile: `ros2`, or nothing where messages are no ROS messages.
    pub profile: &'static str,
}

impl Default for LogOptions {
    fn default() -> Self {
        LogOptions {
            compression: ChunkCompression::Zstd,
            // About one second of a drive with camera and lidar: a reader holds one or two.
            chunk_bytes: 2 * 1024 * 1024,
            endian: Endian::Little,
            profile: "ros2",
        }
    }
}

/// A log being written.
pub struct LogWriter {
    path: PathBuf,
    temporary: PathBuf,
    endian: Endian,
    mcap: mcap::Writer<BufWriter<File>>,
    topics: BTreeMap<String, Topic>,
    finished: bool,
}

struct Topic {
    channel: u16,
    schema: &'static str,
    written: u32,
}

impl LogWriter {
    /// Start the log `path`; its directory must exist.
    ///
    /// # Errors
    ///
    /// [`Error::Exists`] if `path` exists, [`Error::Io`] if the file cannot be made.
    pub fn create(path: &Path, options: LogOptions) -> Result<Self> {
        refuse_existing(path)?;
        let temporary = unfinished_name(path);
        let file = File::create(&temporary).map_err(Error::io("create", &temporary))?;
        let mcap = WriteOptions::new()
            .profile(options.profile)
            .library(concat!("pmp/", env!("CARGO_PKG_VERSION")))
            .compression(match options.compression {
                ChunkCompression::Zstd => Some(mcap::Compression::Zstd),
                ChunkCompression::Lz4 => Some(mcap::Compression::Lz4),
                ChunkCompression::None => None,
            })
            // Half the time of zstd's usual level for an eighth more bytes: most of a log are pictures
            // and noise.
            .compression_level(1)
            // The default is one per core, and the bytes could depend on it.
            .compression_threads(0)
            .chunk_size(Some(options.chunk_bytes))
            .create(BufWriter::new(file))
            .map_err(|e| mcap_error(&temporary, e))?;
        let path = path.to_path_buf();
        let (topics, endian) = (BTreeMap::new(), options.endian);
        Ok(LogWriter { path, temporary, endian, mcap, topics, finished: false })
    }

    /// Append one message; `log_time_ns` is when the recorder got it, since the Unix epoch.
    ///
    /// # Errors
    ///
    /// [`Error::Log`] if the topic carried another type before; [`Error::Io`] if the file cannot
    /// be written.
    pub fn write(&mut self, topic: &str, message: &dyn Message, log_time_ns: i64) -> Result<()> {
        if !self.topics.contains_key(topic) {
            let added = self.add_topic(topic, message)?;
            self.topics.insert(topic.to_owned(), added);
        }
        let Some(known) = self.topics.get_mut(topic).filter(|t| t.schema == message.schema())
        else {
            return Err(self.refused(format!("{topic} cannot carry {} too", message.schema())));
        };
        let log_time = log_time_ns.max(0) as u64;
        let header = MessageHeader {
            channel_id: known.channel,
            sequence: known.written,
            log_time,
            publish_time: log_time,
        };
        known.written += 1;
        self.mcap
            .write_to_known_channel(&header, &message.encode(self.endian))
            .map_err(|e| mcap_error(&self.temporary, e))
    }

    /// Append a metadata record: facts about the whole log.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the file cannot be written.
    pub fn write_metadata(&mut self, name: &str, values: &BTreeMap<String, String>) -> Result<()> {
        let record = Metadata { name: name.to_owned(), metadata: values.clone() };
        self.mcap.write_metadata(&record).map_err(|e| mcap_error(&self.temporary, e))
    }

    /// Write what ends the file and give it its name.
    ///
    /// # Errors
    ///
    /// [`Error::Exists`] if the name was taken meanwhile, [`Error::Io`] if the file cannot be
    /// written.
    pub fn finish(mut self) -> Result<()> {
        self.mcap.finish().map_err(|e| mcap_error(&self.temporary, e))?;
        refuse_existing(&self.path)?;
        // What has its name must be whole even after a loss of power.
        let sync = File::open(&self.temporary).and_then(|file| file.sync_all());
        sync.map_err(Error::io("flush", &self.temporary))?;
        fs::rename(&self.temporary, &self.path).map_err(Error::io("rename", &self.temporary))?;
        self.finished = true;
        self.path.parent().map_or(Ok(()), sync_folder)
    }

    fn add_topic(&mut self, topic: &str, message: &dyn Message) -> Result<Topic> {
        let schema = message.schema();
        let definition = message
            .definition()
            .ok_or_else(|| self.refused(format!("no definition of {schema} for {topic}")))?;
        let encoding = definition.message_encoding;
        let channel = self
            .mcap
            .add_schema(schema, definition.schema_encoding, &definition.data)
            .and_then(|id| self.mcap.add_channel(id, topic, encoding, &BTreeMap::new()))
            .map_err(|e| mcap_error(&self.temporary, e))?;
        Ok(Topic { channel, schema, written: 0 })
    }

    fn refused(&self, what: String) -> Error {
        Error::Log { path: self.path.clone(), offset: 0, what, hint: None }
    }
}

impl Drop for LogWriter {
    fn drop(&mut self) {
        if !self.finished {
            // Nobody is left to tell if it fails, and the name alone says that it is no log.
            let _ = fs::remove_file(&self.temporary);
        }
    }
}

fn refuse_existing(path: &Path) -> Result<()> {
    if path.exists() {
        return Err(Error::Exists {
            path: path.to_path_buf(),
            hint: "move it away, or write to another directory".into(),
        });
    }
    Ok(())
}

fn mcap_error(path: &Path, error: McapError) -> Error {
    let source = match error {
        McapError::Io(source) => source,
        other => std::io::Error::other(other),
    };
    Error::Io { action: "write", path: path.to_path_buf(), source }
}
