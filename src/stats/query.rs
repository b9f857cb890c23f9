//! Questions to the shards and to `episodes.parquet`, asked through polars.
//!
//! Only scalar columns and the velocity are read: that a frame has lidar or radar is known from its
//! skew, which is null exactly where they are.

use std::{collections::BTreeMap, iter, path::Path};

use polars::prelude::{
    DataFrame, DataType, Expr, Field, IntoLazy as _, LazyFrame, PolarsResult, QuantileMethod,
    Schema, col, len, lit, when,
};

use crate::{
    dataset::{
        manifest::{LogRecord, Manifest},
        open,
        split::Split,
    },
    drops::Reason,
    error::{Error, Result},
    frame::{Command, Conditions, FUTURE_STEPS, RouteSource},
    stats::{
        frames,
        summary::{
            Combination, Dataset, Distribution, Group, Groups, Holdout, LeftOut, Loss, Part,
            Quantiles, Shares, Signals, Skew, Skews, Splits, Summary, VERSION,
        },
    },
};

/// Columns whose values are summarised; the last four are skews in milliseconds.
const VALUES: [&str; 8] = [
    "speed",
    "steer",
    "throttle",
    "brake",
    "image_skew",
    "lidar_skew",
    "radar_skew",
    "control_skew",
];

/// Summarise a dataset.
///
/// # Errors
///
/// [`Error::Dataset`] if the folder is no dataset, an unfinished one, or does not hold what its
/// manifest says; [`Error::Query`] if a file in it is damaged.
pub fn summarise(dataset: &Path) -> Result<Summary> {
    let manifest = Manifest::read(dataset)?;
    let rows = read_frames(dataset, &manifest)?;
    let all = Answers::of(rows.clone()).map_err(Error::query(dataset))?;
    if all.frames != manifest.frames {
        let what =
            format!("the shards hold {} frames, the manifest says {}", all.frames, manifest.frames);
        return Err(frames::broken(dataset, what));
    }
    let of_split = |split: Split| -> Result<Option<Part>> {
        let rows = rows.clone().filter(col("split").eq(lit(split.name())));
        let answers = Answers::of(rows).map_err(Error::query(dataset))?;
        Ok(part(&manifest, &answers, |log| log.split == split))
    };
    let name = dataset.canonicalize().map_err(Error::io("find", dataset))?;
    let name = name.file_name().map_or("dataset".into(), |name| name.to_string_lossy());
    Ok(Summary {
        version: VERSION,
        dataset: Dataset {
            name: name.into_owned(),
            identity: manifest.identity(),
            written_by: manifest.written_by.clone(),
            rate_hz: manifest.config.rate_hz,
        },
        splits: Splits {
            train: of_split(Split::Train)?,
            val: of_split(Split::Val)?,
            all: part(&manifest, &all, |_| true),
        },
        signals: Signals {
            speed_mps: all.distribution("speed"),
            steer: all.distribution("steer"),
            throttle: all.distribution("throttle"),
            brake: all.distribution("brake"),
        },
        skews: Skews {
            image: all.skew("image_skew"),
            lidar: all.skew("lidar_skew"),
            radar: all.skew("radar_skew"),
            control: all.skew("control_skew"),
        },
        groups: groups(dataset, rows)?,
        coverage: coverage(&manifest),
        holdout: holdout(dataset)?,
        left_out: left_out(&manifest),
    })
}

/// The columns that are asked about, one row a frame; every value as f64, null where absent.
fn read_frames(dataset: &Path, manifest: &Manifest) -> Result<LazyFrame> {
    let number = |name: &str| col(name).cast(DataType::Float64);
    let mut columns = vec![col("command"), col("route_source")];
    columns.push(col("future_len").eq(lit(FUTURE_STEPS as u32)).alias("full_future"));
    columns.push(frames::speed_mps().alias(VALUES[0]));
    columns.extend(VALUES[1..4].iter().map(|name| number(name)));
    columns.extend(VALUES[4..].iter().map(|name| frames::skew_ms(name)));
    let table = frames::select(dataset, manifest, &columns)?;
    Ok(table.unwrap_or_else(no_frames).lazy())
}

/// The table of no shard at all.
fn no_frames() -> DataFrame {
    let words = ["split", "command", "route_source"].map(|name| (name, DataType::String));
    let numbers = VALUES.map(|name| (name, DataType::Float64));
    let flag = ("full_future", DataType::Boolean);
    let fields = words.into_iter().chain([flag]).chain(numbers);
    let schema: Schema =
        fields.map(|(name, data_type)| Field::new(name.into(), data_type)).collect();
    DataFrame::empty_with_schema(&schema)
}

/// What was answered about some rows.
struct Answers {
    frames: u64,
    with_full_future: u64,
    /// By the names of [`VALUES`].
    values: BTreeMap<&'static str, Answer>,
}

/// What was answered about one column of values.
struct Answer {
    /// How many are not null.
    count: u64,
    mean: Option<f64>,
    /// At [`Quantiles::LEVELS`]; of the absolute values for skews.
    quantiles: [Option<f64>; 7],
}

impl Answers {
    fn of(rows: LazyFrame) -> PolarsResult<Answers> {
        let level_name = |name: &str, level: usize| format!("{name} {level}");
        let mut questions = vec![
            len().cast(DataType::Int64).alias("frames"),
            col("full_future").cast(DataType::Int64).sum().alias("full_future"),
        ];
        for name in VALUES {
            questions.push(col(name).count().cast(DataType::Int64).alias(format!("{name} count")));
            questions.push(col(name).mean().alias(format!("{name} mean")));
            let value = if name.ends_with("skew") { absolute(col(name)) } else { col(name) };
            for (level, share) in Quantiles::LEVELS.into_iter().enumerate() {
                let quantile = value.clone().quantile(lit(share), QuantileMethod::Linear);
                questions.push(quantile.alias(level_name(name, level)));
            }
        }
        let answer = rows.select(questions).collect()?;
        let count = |name: &str| -> PolarsResult<u64> {
            Ok(answer.column(name)?.i64()?.get(0).unwrap_or_default() as u64)
        };
        let number =
            |name: &str| -> PolarsResult<Option<f64>> { Ok(answer.column(name)?.f64()?.get(0)) };
        let mut values = BTreeMap::new();
        for name in VALUES {
            let mut quantiles = [None; 7];
            for (level, quantile) in quantiles.iter_mut().enumerate() {
                *quantile = number(&level_name(name, level))?;
            }
            let mean = number(&format!("{name} mean"))?;
            let count = count(&format!("{name} count"))?;
            values.insert(name, Answer { count, mean, quantiles });
        }
        let with_full_future = count("full_future")?;
        Ok(Answers { frames: count("frames")?, with_full_future, values })
    }

    fn count(&self, name: &str) -> u64 {
        self.values[name].count
    }

    fn distribution(&self, name: &str) -> Option<Distribution> {
        let Answer { count, mean, quantiles } = &self.values[name];
        let values: Vec<f64> = quantiles.iter().flatten().copied().collect();
        let quantiles = Quantiles::new(values.try_into().ok()?);
        Some(Distribution { frames: *count, mean: (*mean)?, quantiles })
    }

    fn skew(&self, name: &str) -> Option<Skew> {
        let Distribution { frames, mean, quantiles } = self.distribution(name)?;
        Some(Skew { frames, signed_mean_ms: mean, absolute_ms: quantiles })
    }
}

fn absolute(value: Expr) -> Expr {
    when(value.clone().lt(lit(0.0))).then(-value.clone()).otherwise(value)
}

/// The amounts of the logs that `belongs` picks; `None` if there are none.
fn part(
    manifest: &Manifest,
    answers: &Answers,
    belongs: impl Fn(&LogRecord) -> bool,
) -> Option<Part> {
    let logs: Vec<&LogRecord> = manifest.logs.iter().filter(|log| belongs(log)).collect();
    if logs.is_empty() {
        return None;
    }
    let frames = answers.frames;
    let of_frames = |count: u64| count as f64 / frames as f64;
    let shares = Shares {
        lidar: of_frames(answers.count("lidar_skew")),
        radar: of_frames(answers.count("radar_skew")),
        steer: of_frames(answers.count("steer")),
        throttle: of_frames(answers.count("throttle")),
        brake: of_frames(answers.count("brake")),
        full_future: of_frames(answers.with_full_future),
    };
    Some(Part {
        episodes: logs.iter().map(|log| log.episodes.len() as u64).sum(),
        frames,
        hours: frames as f64 / manifest.config.rate_hz / 3600.0,
        distance_km: logs.iter().map(|log| log.distance_m).sum::<f64>() / 1000.0,
        mean_speed_mps: answers.distribution("speed").map(|speed| speed.mean),
        frames_with_full_future: answers.with_full_future,
        shares: (frames > 0).then_some(shares),
    })
}

fn groups(dataset: &Path, rows: LazyFrame) -> Result<Groups> {
    let path = dataset.join("episodes.parquet");
    if !path.is_file() {
        return Err(frames::broken(&path, "the table of episodes is missing".to_string()));
    }
    let episodes = frames::scan(iter::once(path.clone())).map_err(Error::query(&path))?;
    let listed = |column: &str, names: &[&str]| -> Result<Vec<Group>> {
        let mut counts = count_by(rows.clone(), column, len()).map_err(Error::query(dataset))?;
        let known = names.iter().map(|name| Group {
            frames: counts.remove(&Some((*name).to_string())).unwrap_or_default(),
            name: Some((*name).to_string()),
        });
        Ok(known.collect())
    };
    let occurring = |column: &str| -> Result<Vec<Group>> {
        let counts = count_by(episodes.clone(), column, col("frames").sum());
        let counts = counts.map_err(Error::query(&path))?.into_iter();
        let mut groups: Vec<Group> = counts
            .map(|(name, frames)| Group { name, frames })
            .filter(|group| group.frames > 0)
            .collect();
        // Stable, so names of the same count stay in their order.
        groups.sort_by_key(|group| (group.name.is_none(), std::cmp::Reverse(group.frames)));
        Ok(groups)
    };
    let sources = [RouteSource::Planned, RouteSource::Driven];
    Ok(Groups {
        command: listed("command", &Command::ALL.map(Command::name))?,
        route_source: listed("route_source", &sources.map(RouteSource::name))?,
        town: occurring("town")?,
        weather: occurring("weather")?,
        illumination: occurring("illumination")?,
        traffic: occurring("traffic")?,
    })
}

/// Conditions together, in the order of their words.
fn coverage(manifest: &Manifest) -> Vec<Combination> {
    let mut cells: BTreeMap<[Option<String>; 4], [u64; 2]> = BTreeMap::new();
    for log in &manifest.logs {
        let Conditions { town, weather, illumination, traffic } = log.conditions.clone();
        let [episodes, frames] = cells.entry([town, weather, illumination, traffic]).or_default();
        *episodes += log.episodes.len() as u64;
        *frames += log.frames;
    }
    let cell = |(words, [episodes, frames]): ([Option<String>; 4], [u64; 2])| {
        let [town, weather, illumination, traffic] = words;
        Combination { town, weather, illumination, traffic, episodes, frames }
    };
    cells.into_iter().map(cell).collect()
}

/// What `count` gives for each word of a column; null is a word, too.
fn count_by(
    rows: LazyFrame,
    column: &str,
    count: Expr,
) -> PolarsResult<BTreeMap<Option<String>, u64>> {
    let count = count.cast(DataType::Int64).alias("count");
    let table = rows.group_by([col(column)]).agg([count]).collect()?;
    let words = table.column(column)?.str()?;
    let counts = table.column("count")?.i64()?;
    let pairs = words.iter().zip(counts.iter());
    let entry = |(word, count): (Option<&str>, Option<i64>)| {
        (word.map(str::to_string), count.unwrap_or_default() as u64)
    };
    Ok(pairs.map(entry).collect())
}

fn holdout(dataset: &Path) -> Result<Holdout> {
    let opened = open::Dataset::open(dataset)?;
    Ok(Holdout {
        train_frames: opened.train.len() as u64,
        val_frames: opened.val.len() as u64,
        how: opened.holdout.how,
        is_time_block: opened.holdout.is_time_block,
    })
}

fn left_out(manifest: &Manifest) -> LeftOut {
    let ticks = |reason: Reason| manifest.logs.iter().map(|log| log.drops.count(reason)).sum();
    let undecodable = manifest.logs.iter().flat_map(|log| log.undecodable.values());
    let loss = |source_log: &String, what: &String| Loss {
        source_log: source_log.clone(),
        what: what.clone(),
    };
    LeftOut {
        ticks: Reason::ALL.map(|reason| (reason.name().to_string(), ticks(reason))).into(),
        damaged_parts: manifest.logs.iter().map(|log| log.damage.len() as u64).sum(),
        damaged_logs: manifest.logs.iter().filter(|log| !log.damage.is_empty()).count() as u64,
        undecodable_messages: undecodable.map(|(count, _)| count).sum(),
        sensors: manifest
            .logs
            .iter()
            .flat_map(|log| log.left_out.iter().map(|what| loss(&log.source_log, what)))
            .collect(),
        failed_logs: manifest.failed.iter().map(|log| loss(&log.source_log, &log.error)).collect(),
    }
}
