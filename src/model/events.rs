//! The curves of a run for TensorBoard: `metrics.jsonl` again, in TensorBoard's records.
//!
//! A record is its length (u64, little-endian), the length's masked CRC-32C, a protobuf `Event`
//! and its masked CRC-32C (TensorFlow, `tfrecord` and `event.proto`). An event has a wall time;
//! ours is its step in seconds, so that the same training writes the same bytes.

use std::{
    fs::File,
    io::Write as _,
    path::{Path, PathBuf},
};

use prost::Message;
use serde_json::Value;

use crate::error::{Error, Result};

/// TensorBoard looks for `tfevents` in names.
const NAME: &str = "events.out.tfevents.0.pmp";

/// The file, open for appending.
#[derive(Debug)]
pub struct EventFile {
    path: PathBuf,
    file: File,
}

/// `tensorflow.Event`, as much of it as is written here.
#[derive(Clone, PartialEq, Message)]
struct Event {
    #[prost(double, tag = "1")]
    wall_time: f64,
    #[prost(int64, tag = "2")]
    step: i64,
    #[prost(string, optional, tag = "3")]
    file_version: Option<String>,
    #[prost(message, optional, tag = "5")]
    summary: Option<Summary>,
}

/// `tensorflow.Summary`.
#[derive(Clone, PartialEq, Message)]
struct Summary {
    #[prost(message, repeated, tag = "1")]
    value: Vec<SummaryValue>,
}

/// `tensorflow.Summary.Value` of a scalar.
#[derive(Clone, PartialEq, Message)]
struct SummaryValue {
    #[prost(string, tag = "1")]
    tag: String,
    #[prost(float, tag = "2")]
    simple_value: f32,
}

impl EventFile {
    /// Write the file of a run directory anew, with the lines of `metrics.jsonl` so far.
    ///
    /// # Errors
    ///
    /// [`Error::Io`]; [`Error::Json`] for a line that is none.
    pub fn create(dir: &Path, metrics: &[u8]) -> Result<Self> {
        let path = dir.join(NAME);
        let file = File::create(&path).map_err(Error::io("create", &path))?;
        let mut events = Self { path, file };
        let version = Some("brain.Event:2".to_string());
        events.write(&Event { file_version: version, ..Event::default() })?;
        for line in metrics.split(|b| *b == b'\n').filter(|line| !line.is_empty()) {
            events.append(line)?;
        }
        Ok(events)
    }

    /// Append a line of `metrics.jsonl`: every number as `SPLIT/KEY`.
    ///
    /// # Errors
    ///
    /// [`Error::Io`]; [`Error::Json`] for a line that is none.
    pub fn append(&mut self, line: &[u8]) -> Result<()> {
        let line: Value = serde_json::from_slice(line).map_err(Error::json(&self.path))?;
        let step = line["step"].as_i64().unwrap_or(0);
        let split = line["split"].as_str().unwrap_or("run").to_string();
        let fields = line.as_object().into_iter().flatten().filter(|(key, _)| *key != "step");
        let value = fields.filter_map(|(key, value)| {
            let simple_value = value.as_f64()? as f32;
            Some(SummaryValue { tag: format!("{split}/{key}"), simple_value })
        });
        let summary = Some(Summary { value: value.collect() });
        self.write(&Event { wall_time: step as f64, step, summary, file_version: None })
    }

    fn write(&mut self, event: &Event) -> Result<()> {
        let (data, mut record) = (event.encode_to_vec(), vec![]);
        let length = (data.len() as u64).to_le_bytes();
        for part in [&length[..], &data] {
            record.extend_from_slice(part);
            record.extend_from_slice(&masked_crc(part).to_le_bytes());
        }
        self.file.write_all(&record).map_err(Error::io("write", &self.path))
    }
}

/// CRC-32C, rotated and moved, as TensorFlow stores it.
fn masked_crc(data: &[u8]) -> u32 {
    crc32c::crc32c(data).rotate_right(15).wrapping_add(0xa282_ead8)
}
