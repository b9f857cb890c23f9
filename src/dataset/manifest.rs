//! What a dataset says of itself: `manifest.json`, one record a log, `episodes.parquet`.
//!
//! A log commits alone: first its shards, then its record under `logs/`. The manifest is put
//! together from the records and written last, so its presence means that the dataset is whole.
//! Fields with their meaning are in `schemas/manifest.v1.json`.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::Arc,
};

use arrow::{
    array::{ArrayRef, Float64Array, RecordBatch, StringArray, UInt32Array, UInt64Array},
    datatypes::{DataType, Field, Schema},
};
use parquet::{
    arrow::ArrowWriter,
    basic::{Compression, ZstdLevel},
    file::properties::WriterProperties,
};
use serde::{Deserialize, Serialize};

use crate::{
    atomic::{self, AtomicFile},
    dataset::{drive::Calibration, shard::ShardRecord, split::Split},
    drops::{Drops, Reason},
    error::{Error, Result},
    frame::Conditions,
    log::{mapping::Mapping, profile::Profile, reader::Damage},
};

/// Version of the dataset layout.
pub const DATASET_VERSION: u32 = 1;

/// What decides the content of a dataset besides the logs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct IngestConfig {
    pub dataset_version: u32,
    pub rate_hz: f64,
    pub profile: Profile,
}

impl IngestConfig {
    /// A configuration for this build's dataset version.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] if the rate is not between 1 and 50 Hz.
    pub fn new(profile: Profile, rate_hz: f64) -> Result<IngestConfig> {
        if !(1.0..=50.0).contains(&rate_hz) {
            return Err(Error::Config {
                key: "--rate".into(),
                what: format!("{rate_hz} is not between 1 and 50 Hz"),
                hint: None,
            });
        }
        Ok(IngestConfig { dataset_version: DATASET_VERSION, rate_hz, profile })
    }
}

/// A log, as committed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LogRecord {
    pub episode: String,
    pub split: Split,
    /// Name of the file, without its folder.
    pub source_log: String,
    pub source_bytes: u64,
    pub source_sha256: String,
    pub messages: u64,
    pub conditions: Conditions,
    pub mapping: Mapping,
    pub calibration: Calibration,
    pub frames: u64,
    /// Frames with all 30 steps of future.
    pub frames_with_full_future: u64,
    /// Stamp of tick 0, ns since the Unix epoch.
    pub start_ns: i64,
    /// From the first to the last frame.
    pub duration_s: f64,
    pub distance_m: f64,
    /// Ticks left out, by reason.
    pub drops: Drops,
    /// Parts of the file that could not be read.
    pub damage: Vec<Damage>,
    /// Messages that could not be decoded, by topic: how many, and why the first.
    pub undecodable: BTreeMap<String, (u64, String)>,
    /// Messages that came after one with a later stamp, by topic; they were put in order.
    pub out_of_order: BTreeMap<String, u64>,
    /// Sensors that the log has and the frames have not, and why.
    pub left_out: Vec<String>,
    /// What was assumed, chosen or found.
    pub notes: Vec<String>,
    pub shards: Vec<ShardRecord>,
}

impl LogRecord {
    /// Whether anything of the log did not make it into the dataset.
    pub fn has_loss(&self) -> bool {
        self.drops.total() > 0
            || !self.damage.is_empty()
            || !self.undecodable.is_empty()
            || !self.left_out.is_empty()
    }
}

/// A log that gave nothing.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FailedLog {
    pub source_log: String,
    pub error: String,
}

/// `manifest.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    pub version: u32,
    /// Version of pmp that wrote it.
    pub written_by: String,
    pub config: IngestConfig,
    /// By episode.
    pub logs: Vec<LogRecord>,
    pub failed: Vec<FailedLog>,
    pub frames: u64,
}

impl Manifest {
    /// The manifest of some logs.
    pub fn new(config: IngestConfig, mut logs: Vec<LogRecord>, failed: Vec<FailedLog>) -> Manifest {
        logs.sort_by(|a, b| a.episode.cmp(&b.episode));
        let frames = logs.iter().map(|log| log.frames).sum();
        let written_by = concat!("pmp ", env!("CARGO_PKG_VERSION")).to_string();
        Manifest { version: DATASET_VERSION, written_by, config, logs, failed, frames }
    }

    /// Where the manifest of a dataset is.
    pub fn path(dataset: &Path) -> PathBuf {
        dataset.join("manifest.json")
    }

    /// Read the manifest of a dataset.
    ///
    /// # Errors
    ///
    /// [`Error::Dataset`] if the folder is no dataset, is unfinished, or is of another version.
    pub fn read(dataset: &Path) -> Result<Manifest> {
        let path = Manifest::path(dataset);
        if !path.exists() {
            let (what, hint) = match dataset.join("ingest.json").exists() {
                true => (
                    "an unfinished dataset",
                    "give the same `pmp-ingest` command again to finish it",
                ),
                false => (
                    "not a dataset: it has no manifest.json",
                    "make one with `pmp-ingest --out DATASET LOG...`",
                ),
            };
            let (path, what, hint) =
                (dataset.to_path_buf(), what.to_string(), Some(hint.to_string()));
            return Err(Error::Dataset { path, what, hint });
        }
        let manifest: Manifest = atomic::read_json(&path)?;
        if manifest.version != DATASET_VERSION {
            let what =
                format!("dataset version {}, this build reads {DATASET_VERSION}", manifest.version);
            let hint = Some("ingest the logs again".to_string());
            return Err(Error::Dataset { path, what, hint });
        }
        Ok(manifest)
    }

    /// A short name for exactly this data: a hash over all shards.
    pub fn identity(&self) -> String {
        use sha2::{Digest, Sha256};
        let mut hasher = Sha256::new();
        for shard in self.logs.iter().flat_map(|log| &log.shards) {
            hasher.update(shard.sha256.as_bytes());
        }
        crate::atomic::hex(&hasher.finalize())[..16].to_string()
    }
}

/// Write `episodes.parquet`: one row an episode.
///
/// # Errors
///
/// If the disk refuses.
pub fn write_episodes(path: &Path, logs: &[LogRecord]) -> Result<()> {
    let text = |pick: &dyn Fn(&LogRecord) -> Option<String>| -> ArrayRef {
        Arc::new(logs.iter().map(pick).collect::<StringArray>())
    };
    let float = |pick: fn(&LogRecord) -> f64| -> ArrayRef {
        Arc::new(logs.iter().map(pick).map(Some).collect::<Float64Array>())
    };
    let mut columns: Vec<(String, ArrayRef)> = vec![
        ("id".into(), text(&|log| Some(log.episode.clone()))),
        ("source_log".into(), text(&|log| Some(log.source_log.clone()))),
        ("split".into(), text(&|log| Some(log.split.name().to_string()))),
        ("town".into(), text(&|log| log.conditions.town.clone())),
        ("weather".into(), text(&|log| log.conditions.weather.clone())),
        ("illumination".into(), text(&|log| log.conditions.illumination.clone())),
        ("traffic".into(), text(&|log| log.conditions.traffic.clone())),
        (
            "frames".into(),
            Arc::new(logs.iter().map(|log| Some(log.frames as u32)).collect::<UInt32Array>()),
        ),
        ("duration_s".into(), float(|log| log.duration_s)),
        ("distance_m".into(), float(|log| log.distance_m)),
    ];
    for reason in Reason::ALL {
        let counts = logs.iter().map(|log| Some(log.drops.count(reason)));
        columns.push((
            format!("dropped_{}", reason.name()),
            Arc::new(counts.collect::<UInt64Array>()),
        ));
    }
    let nullable = ["town", "weather", "illumination", "traffic"];
    let fields: Vec<Field> = columns
        .iter()
        .map(|(name, column)| {
            let data_type: DataType = column.data_type().clone();
            Field::new(name, data_type, nullable.contains(&name.as_str()))
        })
        .collect();
    let schema = Arc::new(Schema::new(fields));
    let columns = columns.into_iter().map(|(_, column)| column).collect();
    let batch = RecordBatch::try_new(schema.clone(), columns).map_err(Error::arrow(path))?;
    let properties = WriterProperties::builder()
        .set_created_by(concat!("pmp ", env!("CARGO_PKG_VERSION")).to_string())
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .build();
    let mut writer = ArrowWriter::try_new(AtomicFile::create(path)?, schema, Some(properties))
        .map_err(Error::parquet(path))?;
    writer.write(&batch).map_err(Error::parquet(path))?;
    writer.into_inner().map_err(Error::parquet(path))?.commit()?;
    Ok(())
}
