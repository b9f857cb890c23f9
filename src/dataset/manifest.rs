//! What a dataset says of itself: `manifest.json`, and one record a log.
//!
//! A log commits alone: first its shards, then its record under `logs/`. The manifest is put
//! together from the records and written last, so its presence means that the dataset is whole.
//! Fields with their meaning are in `schemas/manifest.v1.json`.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};

use crate::{
    atomic,
    dataset::{
        account::{LeftOut, TopicAccount},
        drive::Calibration,
        shard::ShardRecord,
        skew::Skews,
        split::Split,
    },
    drops::Drops,
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

/// An episode of a log. A log has several where its clocks jump back.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EpisodeRecord {
    pub id: String,
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
    pub mapping: Mapping,
    pub calibration: Calibration,
    /// What became of its messages, by topic.
    pub topics: Vec<TopicAccount>,
    /// How many of the log's shards are its own; they lie there in the order of the episodes.
    pub shards: usize,
}

/// A log, as committed: what is said once, and the sums over its episodes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LogRecord {
    /// Id of the first episode.
    pub episode: String,
    /// The same for all episodes of a log: they are one drive.
    pub split: Split,
    /// Name of the file, without its folder.
    pub source_log: String,
    pub source_bytes: u64,
    pub source_sha256: String,
    pub messages: u64,
    pub conditions: Conditions,
    /// Of the first episode, as the calibration and the start.
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
    /// Messages that could not be decoded, by topic: how many, and where and why the first.
    pub undecodable: BTreeMap<String, (u64, String)>,
    /// Messages that came after one with a later stamp, by topic; they were put in order.
    pub out_of_order: BTreeMap<String, u64>,
    /// Sensors that the log has and the frames have not, and why.
    pub left_out: Vec<String>,
    /// What was assumed, chosen or found.
    pub notes: Vec<String>,
    /// Of all episodes.
    pub shards: Vec<ShardRecord>,
    /// How often its clock jumped back and began another episode, by topic.
    pub clock_jumps: BTreeMap<String, u64>,
    /// What became of all its messages, by topic.
    pub topics: Vec<TopicAccount>,
    /// Over all frames.
    pub skews: Skews,
    pub episodes: Vec<EpisodeRecord>,
}

impl LogRecord {
    /// The shards of each episode in turn.
    pub fn shards_by_episode(&self) -> impl Iterator<Item = &[ShardRecord]> {
        let mut rest = self.shards.as_slice();
        self.episodes.iter().map(move |episode| {
            let (own, others) = rest.split_at(episode.shards.min(rest.len()));
            rest = others;
            own
        })
    }

    /// Whether anything of the log did not make it into the dataset, but for what was not needed.
    pub fn has_loss(&self) -> bool {
        let lacks_stamps = |topic: &TopicAccount| topic.left_out.contains_key(&LeftOut::NoStamp);
        self.drops.total() > 0
            || self.topics.iter().any(lacks_stamps)
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

/// How a dataset was made of others; written first, as `edit.json`, and kept in the manifest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Edit {
    #[serde(flatten)]
    pub change: Change,
    /// What it was made of, ascending by identity.
    pub of: Vec<Origin>,
}

/// What an edit did.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum Change {
    /// Put several datasets together.
    Merge,
    /// Left out these episodes, ascending.
    Drop { episodes: Vec<String> },
    /// Moved logs, by the id of their first episode, to the other side by a rule.
    Resplit { rule: String, moved: Vec<String> },
}

/// A dataset that another was made of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Origin {
    pub identity: String,
    pub written_by: String,
    pub frames: u64,
    pub config: IngestConfig,
    /// Where it was made of others itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub edit: Option<Box<Edit>>,
}

/// Name of the file that says so while a dataset is made of others, and after.
pub const EDIT: &str = "edit.json";

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
    /// Where it was made of other datasets and not of logs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub edit: Option<Edit>,
}

impl Manifest {
    /// The manifest of some logs.
    pub fn new(config: IngestConfig, mut logs: Vec<LogRecord>, failed: Vec<FailedLog>) -> Manifest {
        logs.sort_by(|a, b| a.episode.cmp(&b.episode));
        let frames = logs.iter().map(|log| log.frames).sum();
        let written_by = concat!("pmp ", env!("CARGO_PKG_VERSION")).to_string();
        Manifest { version: DATASET_VERSION, written_by, config, logs, failed, frames, edit: None }
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
            let has = |name: &str| dataset.join(name).exists();
            let (what, hint) = match (has(EDIT), has("ingest.json")) {
                (true, _) => (
                    "an unfinished dataset",
                    "give the same `pmp-stats` command again to finish it, or remove the folder",
                ),
                (false, true) => (
                    "an unfinished dataset",
                    "give the same `pmp-ingest` command again to finish it",
                ),
                (false, false) => (
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

    /// A short name for exactly this data: a hash over all shards, and over the side of each log
    /// that is not on the side where the hash of its id puts it.
    pub fn identity(&self) -> String {
        use sha2::{Digest, Sha256};
        let mut hasher = Sha256::new();
        for log in &self.logs {
            for shard in &log.shards {
                hasher.update(shard.sha256.as_bytes());
            }
            if log.split != Split::of(&log.episode) {
                hasher.update(log.split.name().as_bytes());
            }
        }
        crate::atomic::hex(&hasher.finalize())[..16].to_string()
    }
}
