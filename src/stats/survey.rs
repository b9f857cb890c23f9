//! What the page draws of all frames: how often values are, where the car went, what is missing.

use std::path::Path;

use polars::prelude::{Column, DataFrame, DataType, PolarsResult, col, lit};

use crate::{
    chart::scale::Axis,
    dataset::manifest::Manifest,
    error::{Error, Result},
    frame::{Conditions, FUTURE_STEPS},
    stats::frames,
};

/// Parts of an axis that frames are counted in.
const PARTS: usize = 40;

/// Marks on such an axis.
const MARKS: u32 = 4;

/// What is counted: column, words for people, and the ends of the axis where they are fixed.
const COUNTED: [(&str, &str, Option<[f64; 2]>); 10] = [
    ("speed", "speed (m/s)", None),
    ("steer", "steer (positive = right)", Some([-1.0, 1.0])),
    ("throttle", "throttle", Some([0.0, 1.0])),
    ("brake", "brake", Some([0.0, 1.0])),
    ("way_3s", "distance from now to 3 s ahead (m)", None),
    ("turn_3s", "change of heading in 3 s (rad)", None),
    ("image_skew", "image skew (ms)", None),
    ("lidar_skew", "lidar skew (ms)", None),
    ("radar_skew", "radar skew (ms)", None),
    ("control_skew", "control skew (ms)", None),
];

/// All frames of a dataset, in brief.
#[derive(Clone, Debug, PartialEq)]
pub struct Survey {
    /// One for each quantity that any frame has.
    pub distributions: Vec<Distribution>,
    /// In the order of the manifest.
    pub drives: Vec<Drive>,
}

/// How often a quantity is where.
#[derive(Clone, Debug, PartialEq)]
pub struct Distribution {
    /// Stable name.
    pub key: &'static str,
    /// Words and unit.
    pub axis: Axis,
    /// Frames in equal parts of the axis; both ends belong to it.
    pub counts: Vec<u64>,
    /// Frames without a value.
    pub missing: u64,
}

/// Where an episode went, and which of its ticks are frames.
#[derive(Clone, Debug, PartialEq)]
pub struct Drive {
    pub episode: String,
    pub source_log: String,
    pub conditions: Conditions,
    /// Ticks of the frames, ascending.
    pub ticks: Vec<u32>,
    /// World frame, x and y, one a frame.
    pub places_m: Vec<[f64; 2]>,
}

impl Survey {
    /// Survey a dataset.
    ///
    /// # Errors
    ///
    /// As [`frames::select`].
    pub fn of(dataset: &Path, manifest: &Manifest) -> Result<Survey> {
        let last = (2 * FUTURE_STEPS - 2) as i32;
        let at =
            |name: &str, index: i32| col(name).arr().get(lit(index), false).cast(DataType::Float64);
        let ahead = |value: polars::prelude::Expr| {
            let is_whole = col("future_len").eq(lit(FUTURE_STEPS as u32));
            polars::prelude::when(is_whole).then(value).otherwise(lit(f64::NAN))
        };
        let (x, y) = (at("future_xy", last), at("future_xy", last + 1));
        let mut columns = vec![
            col("episode"),
            col("frame").cast(DataType::Int64),
            at("position", 0).alias("x"),
            at("position", 1).alias("y"),
            frames::speed_mps().alias("speed"),
            ahead((x.clone() * x + y.clone() * y).sqrt()).alias("way_3s"),
            ahead(at("future_yaw", FUTURE_STEPS as i32 - 1)).alias("turn_3s"),
        ];
        columns.extend(["steer", "throttle", "brake"].map(|c| col(c).cast(DataType::Float64)));
        let skews = ["image_skew", "lidar_skew", "radar_skew", "control_skew"];
        columns.extend(skews.map(frames::skew_ms));
        let Some(table) = frames::select(dataset, manifest, &columns)? else {
            return Ok(Survey { distributions: Vec::new(), drives: Vec::new() });
        };
        let survey = || -> PolarsResult<Survey> {
            let mut distributions = Vec::new();
            for (key, words, ends) in COUNTED {
                distributions.extend(distribution(table.column(key)?, key, words, ends)?);
            }
            Ok(Survey { distributions, drives: drives(&table, manifest)? })
        };
        survey().map_err(Error::query(dataset))
    }
}

/// `None` if no frame has a value.
fn distribution(
    column: &Column,
    key: &'static str,
    words: &str,
    ends: Option<[f64; 2]>,
) -> PolarsResult<Option<Distribution>> {
    let values: Vec<f64> =
        column.f64()?.iter().flatten().filter(|value| value.is_finite()).collect();
    if values.is_empty() {
        return Ok(None);
    }
    let [low, high] = ends.unwrap_or_else(|| {
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if key == "speed" || key == "way_3s" { [0.0, high] } else { [low, high] }
    });
    let axis = Axis::around(words, low, high, MARKS);
    let mut counts = vec![0; PARTS];
    for value in &values {
        let part = axis.share(*value) * PARTS as f64;
        counts[(part.max(0.0) as usize).min(PARTS - 1)] += 1;
    }
    let missing = (column.len() - values.len()) as u64;
    Ok(Some(Distribution { key, axis, counts, missing }))
}

/// The rows of each episode are together, in the order of ticks.
fn drives(table: &DataFrame, manifest: &Manifest) -> PolarsResult<Vec<Drive>> {
    let mut drives: Vec<Drive> = manifest
        .logs
        .iter()
        .flat_map(|log| log.episodes.iter().map(move |episode| (log, episode)))
        .map(|(log, episode)| Drive {
            episode: episode.id.clone(),
            source_log: log.source_log.clone(),
            conditions: log.conditions.clone(),
            ticks: Vec::new(),
            places_m: Vec::new(),
        })
        .collect();
    let index: std::collections::BTreeMap<String, usize> =
        drives.iter().enumerate().map(|(i, drive)| (drive.episode.clone(), i)).collect();
    let ids = table.column("episode")?.str()?;
    let ticks = table.column("frame")?.i64()?;
    let (x, y) = (table.column("x")?.f64()?, table.column("y")?.f64()?);
    let mut current: Option<(&str, usize)> = None;
    for (((id, tick), x), y) in ids.iter().zip(ticks.iter()).zip(x.iter()).zip(y.iter()) {
        let (Some(id), Some(tick), Some(x), Some(y)) = (id, tick, x, y) else { continue };
        let drive = match current {
            Some((same, drive)) if same == id => drive,
            _ => match index.get(id) {
                Some(drive) => *drive,
                None => continue,
            },
        };
        current = Some((id, drive));
        drives[drive].ticks.push(tick as u32);
        drives[drive].places_m.push([x, y]);
    }
    Ok(drives)
}
