//! What is said of a dataset, as data: the object that `pmp-stats --json` prints.
//!
//! Every field with its unit and meaning is in `schemas/stats.v1.json`; a test holds this file
//! against it. `None` is `null`: there is nothing the number could be of. A zero was counted.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// Version of the fields.
pub const VERSION: u32 = 1;

/// A dataset in numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    pub version: u32,
    pub dataset: Dataset,
    pub splits: Splits,
    pub holdout: Holdout,
    pub signals: Signals,
    pub skews: Skews,
    pub groups: Groups,
    pub coverage: Vec<Combination>,
    pub left_out: LeftOut,
}

/// Which dataset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Dataset {
    /// Name of its folder.
    pub name: String,
    /// A hash over all shards.
    pub identity: String,
    pub written_by: String,
    pub rate_hz: f64,
}

/// Which frames `pmp-train` learns from and `pmp-eval` judges with: the splits, or where they leave
/// a side empty, what stands in for them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Holdout {
    pub train_frames: u64,
    pub val_frames: u64,
    /// How those that judge were set apart, one sentence.
    pub how: String,
    /// They are a stretch of an episode that is trained on too: weak evidence.
    pub is_time_block: bool,
}

/// Amounts by split; a split without episodes is `None`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Splits {
    pub train: Option<Part>,
    pub val: Option<Part>,
    pub all: Option<Part>,
}

impl Splits {
    /// With their names, in the order of the table.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, Option<&Part>)> {
        [("train", self.train.as_ref()), ("val", self.val.as_ref()), ("all", self.all.as_ref())]
            .into_iter()
    }
}

/// How much there is in a split, and which share of its frames has what.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Part {
    pub episodes: u64,
    pub frames: u64,
    /// Frames divided by the rate.
    pub hours: f64,
    /// Driven from the first to the last frame of each episode.
    pub distance_km: f64,
    /// Mean over frames of the planar speed; `None` without frames, as are the shares.
    pub mean_speed_mps: Option<f64>,
    /// Frames with all 30 steps of future.
    pub frames_with_full_future: u64,
    pub shares: Option<Shares>,
}

/// Shares of frames in 0 ... 1 whose value is not null.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shares {
    pub lidar: f64,
    pub radar: f64,
    pub steer: f64,
    pub throttle: f64,
    pub brake: f64,
    pub full_future: f64,
}

/// Values over all frames that have them; `None` where no frame has.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Signals {
    /// Planar speed, m/s, never negative.
    pub speed_mps: Option<Distribution>,
    /// In [-1, 1], positive = right.
    pub steer: Option<Distribution>,
    /// In [0, 1].
    pub throttle: Option<Distribution>,
    /// In [0, 1].
    pub brake: Option<Distribution>,
}

/// Values of one signal.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Distribution {
    /// Frames that have a value.
    pub frames: u64,
    pub mean: f64,
    pub quantiles: Quantiles,
}

/// Sample time minus frame time over all frames that have a sample; `None` where no frame has.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Skews {
    pub image: Option<Skew>,
    pub lidar: Option<Skew>,
    pub radar: Option<Skew>,
    pub control: Option<Skew>,
}

/// Skew of one sensor, in milliseconds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Skew {
    /// Frames that have a sample.
    pub frames: u64,
    /// Positive where the samples come after their frames.
    pub signed_mean_ms: f64,
    /// Of the absolute values.
    pub absolute_ms: Quantiles,
}

/// Quantiles, linear between the two nearest values (Hyndman and Fan's type 7).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quantiles {
    pub min: f64,
    pub p05: f64,
    pub p25: f64,
    pub p50: f64,
    pub p75: f64,
    pub p95: f64,
    pub max: f64,
}

impl Quantiles {
    /// Which share of the values lies below each, in the order of the fields.
    pub const LEVELS: [f64; 7] = [0.0, 0.05, 0.25, 0.5, 0.75, 0.95, 1.0];

    /// From the values at [`Quantiles::LEVELS`].
    pub fn new([min, p05, p25, p50, p75, p95, max]: [f64; 7]) -> Quantiles {
        Quantiles { min, p05, p25, p50, p75, p95, max }
    }

    /// The values at [`Quantiles::LEVELS`].
    pub fn values(&self) -> [f64; 7] {
        [self.min, self.p05, self.p25, self.p50, self.p75, self.p95, self.max]
    }
}

/// All frames, counted by what they are. Commands and sources are all listed, with the count 0
/// where there is none; of conditions only those that occur, most frequent first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Groups {
    pub command: Vec<Group>,
    pub route_source: Vec<Group>,
    pub town: Vec<Group>,
    pub weather: Vec<Group>,
    pub illumination: Vec<Group>,
    pub traffic: Vec<Group>,
}

/// Frames that have a word in common.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Group {
    /// `None` where it is not known, which is listed last.
    pub name: Option<String>,
    pub frames: u64,
}

/// Episodes under the same conditions; only combinations that occur are listed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Combination {
    pub town: Option<String>,
    pub weather: Option<String>,
    pub illumination: Option<String>,
    pub traffic: Option<String>,
    pub episodes: u64,
    pub frames: u64,
}

/// What the logs had and the dataset has not.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeftOut {
    /// Ticks that did not become frames, by reason; every reason is there.
    pub ticks: BTreeMap<String, u64>,
    /// Parts of files that could not be read.
    pub damaged_parts: u64,
    /// Logs with such parts.
    pub damaged_logs: u64,
    /// Messages that could not be decoded.
    pub undecodable_messages: u64,
    /// Sensors that a log has and its frames have not.
    pub sensors: Vec<Loss>,
    /// Logs that gave nothing.
    pub failed_logs: Vec<Loss>,
}

/// What was lost of which log, in words.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Loss {
    /// Name of the file, without its folder.
    pub source_log: String,
    pub what: String,
}

impl Summary {
    /// One JSON object; the keys are always there, in this order.
    pub fn json(&self) -> String {
        let text = serde_json::to_string_pretty(self);
        text.expect("names are strings and numbers are numbers") + "\n"
    }
}
