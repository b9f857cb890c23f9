//! What is read of an episode: its columns as plain arrays, in the order of the rows.
//!
//! By the Parquet crate's Arrow reader rather than by polars: READING_NOTE

use std::{fs::File, path::Path};

use arrow::{
    array::{Array, ArrowPrimitiveType, AsArray, RecordBatch},
    datatypes::{
        DataType, Float32Type, Float64Type, Int32Type, TimestampNanosecondType, UInt8Type,
        UInt32Type,
    },
};
use parquet::arrow::{
    ProjectionMask,
    arrow_reader::{ArrowReaderMetadata, ParquetRecordBatchReaderBuilder},
};
use rayon::prelude::*;

use crate::{
    dataset::{
        columns::{self, SCHEMA_VERSION, VERSION_KEY},
        shard::{ROWS_PER_SHARD, ShardRecord},
        split::Split,
    },
    frame::{Command, FUTURE_STEPS, ROUTE_POINTS, RouteSource},
    stats::check::finding::{Check, Finding, Level, Needs, Place},
};

pub static SHARD_MISSING: Check = Check {
    code: "S03",
    name: "shard-missing",
    level: Level::Error,
    needs: Needs::Records,
    what: "a shard that the manifest names does not exist",
    why: "a training stops when it comes to it, and counts and shares are wrong",
    remedy: "copy the dataset again, or ingest the logs again",
};

pub static SHARD_UNREADABLE: Check = Check {
    code: "S05",
    name: "shard-unreadable",
    level: Level::Error,
    needs: Needs::Columns,
    what: "a shard's footer or one of its columns cannot be read",
    why: "a training stops when it comes to it, perhaps after hours",
    remedy: "copy the dataset again, or ingest the logs again",
};

pub static SHARD_SCHEMA: Check = Check {
    code: "S06",
    name: "shard-schema",
    level: Level::Error,
    needs: Needs::Columns,
    what: "a shard has another schema version, lacks a column, or has one of another type or with nulls where none may be",
    why: "readers take columns by name and type; what they do not find they cannot train on",
    remedy: "ingest the logs again; if you edited the shard, write the types of schemas/frame.v1.json",
};

pub static SHARD_ROWS: Check = Check {
    code: "S07",
    name: "shard-rows",
    level: Level::Error,
    needs: Needs::Records,
    what: "a shard has other rows, or fewer row groups, than its record says",
    why: "frames are missing or are there twice, and samplers that go by the record miss their rows",
    remedy: "copy the dataset again, or ingest the logs again",
};

/// The columns that are read; pictures and sensor returns are not among them.
const COLUMNS: [&str; 26] = [
    "episode",
    "frame",
    "stamp",
    "velocity",
    "yaw",
    "position",
    "steer",
    "throttle",
    "brake",
    "route",
    "route_len",
    "route_source",
    "command",
    "future_speed",
    "future_yaw",
    "future_xy",
    "future_len",
    "image_skew",
    "lidar_skew",
    "radar_skew",
    "control_skew",
    "town",
    "weather",
    "illumination",
    "traffic",
    "perturbed",
];

/// Sensors of the skew columns, in the order of [`Track::skew_ns`].
pub const SENSORS: [&str; 4] = ["image", "lidar", "radar", "control"];

/// Channels of the action, in the order of [`Track::action`].
pub const CHANNELS: [&str; 3] = ["steer", "throttle", "brake"];

/// Columns of conditions, in the order of [`Track::conditions`].
pub const CONDITIONS: [&str; 4] = ["town", "weather", "illumination", "traffic"];

/// One episode. Every array has one entry a row, or as many as it says.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Track {
    pub episode: String,
    /// Rows whose `episode` is another: how many, and the first of them.
    pub foreign: Option<(u64, String)>,
    pub frame: Vec<u32>,
    pub stamp_ns: Vec<i64>,
    /// Ego frame, m/s; two a row.
    pub velocity_mps: Vec<f32>,
    pub yaw_rad: Vec<f64>,
    /// World frame, m; three a row.
    pub position_m: Vec<f64>,
    /// Steer, throttle, brake.
    pub action: [Vec<Option<f32>>; 3],
    /// x, y of [`ROUTE_POINTS`] a row, m.
    pub route_m: Vec<f32>,
    pub route_len: Vec<u8>,
    pub is_planned: Vec<bool>,
    /// `None` for a word that is no command.
    pub command: Vec<Option<Command>>,
    /// [`FUTURE_STEPS`] a row.
    pub future_speed_mps: Vec<f32>,
    pub future_yaw_rad: Vec<f32>,
    /// x, y of [`FUTURE_STEPS`] a row, m.
    pub future_xy_m: Vec<f32>,
    pub future_len: Vec<u8>,
    /// Image, lidar, radar, control.
    pub skew_ns: [Vec<Option<i32>>; 4],
    /// Town, weather, illumination, traffic.
    pub conditions: [Words; 4],
    pub perturbed: Vec<bool>,
}

/// A column of few different words.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Words {
    /// In the order in which they come; `None` is null.
    pub known: Vec<Option<String>>,
    /// Which of them each row has.
    pub rows: Vec<u8>,
}

impl Words {
    fn push(&mut self, word: Option<&str>) {
        // Nearly always that of the row before.
        let last = self.rows.last().copied().unwrap_or_default();
        if self.known.get(usize::from(last)).is_some_and(|known| known.as_deref() == word) {
            return self.rows.push(last);
        }
        let at = self.known.iter().position(|known| known.as_deref() == word);
        let at = at.unwrap_or_else(|| {
            self.known.push(word.map(str::to_string));
            self.known.len() - 1
        });
        // What does not fit counts as the last that does.
        self.rows.push(u8::try_from(at).unwrap_or(u8::MAX));
    }

    fn append(&mut self, other: &Words) {
        for row in &other.rows {
            self.push(other.known.get(usize::from(*row)).and_then(Option::as_deref));
        }
    }
}

impl Track {
    /// Rows.
    pub fn len(&self) -> usize {
        self.frame.len()
    }

    pub fn is_empty(&self) -> bool {
        self.frame.is_empty()
    }

    /// Waypoints of a row, x and y in turn.
    pub fn route_of(&self, row: usize) -> &[f32] {
        &self.route_m[2 * ROUTE_POINTS * row..][..2 * ROUTE_POINTS]
    }

    pub fn position_of(&self, row: usize) -> [f64; 3] {
        std::array::from_fn(|axis| self.position_m[3 * row + axis])
    }

    pub fn velocity_of(&self, row: usize) -> [f32; 2] {
        [self.velocity_mps[2 * row], self.velocity_mps[2 * row + 1]]
    }

    /// Read an episode: what can be read of its shards, and what was wrong with them.
    pub fn read(
        dataset: &Path,
        episode: &str,
        split: Split,
        shards: &[ShardRecord],
    ) -> (Track, Vec<Finding>) {
        let read = |shard: &ShardRecord| {
            let mut track = Track { episode: episode.to_string(), ..Track::default() };
            let finding = read_shard(dataset, split, shard, &mut track).err();
            (track, finding)
        };
        let mut parts: Vec<_> = shards.par_iter().map(read).collect();
        let findings = parts.iter_mut().filter_map(|(_, finding)| finding.take()).map(|b| *b);
        let findings = findings.collect();
        let mut parts = parts.into_iter().map(|(track, _)| track);
        let mut whole = parts
            .next()
            .unwrap_or_else(|| Track { episode: episode.to_string(), ..Track::default() });
        parts.for_each(|part| whole.append(&part));
        (whole, findings)
    }

    fn append(&mut self, other: &Track) {
        if let Some((count, example)) = &other.foreign {
            let foreign = self.foreign.get_or_insert((0, example.clone()));
            foreign.0 += count;
        }
        self.frame.extend(&other.frame);
        self.stamp_ns.extend(&other.stamp_ns);
        self.velocity_mps.extend(&other.velocity_mps);
        self.yaw_rad.extend(&other.yaw_rad);
        self.position_m.extend(&other.position_m);
        self.route_m.extend(&other.route_m);
        self.route_len.extend(&other.route_len);
        self.is_planned.extend(&other.is_planned);
        self.command.extend(&other.command);
        self.future_speed_mps.extend(&other.future_speed_mps);
        self.future_yaw_rad.extend(&other.future_yaw_rad);
        self.future_xy_m.extend(&other.future_xy_m);
        self.future_len.extend(&other.future_len);
        self.perturbed.extend(&other.perturbed);
        self.action.iter_mut().zip(&other.action).for_each(|(to, from)| to.extend(from));
        self.skew_ns.iter_mut().zip(&other.skew_ns).for_each(|(to, from)| to.extend(from));
        self.conditions.iter_mut().zip(&other.conditions).for_each(|(to, from)| to.append(from));
    }

    /// Add the rows of a batch, whose columns have their types.
    fn add(&mut self, batch: &RecordBatch) -> Result<(), String> {
        let rows = Rows(batch);
        rows.words("episode", |word| {
            if word != Some(self.episode.as_str()) {
                let word = word.unwrap_or_default();
                self.foreign.get_or_insert_with(|| (0, word.to_string())).0 += 1;
            }
        })?;
        rows.numbers::<UInt32Type>("frame", &mut self.frame)?;
        rows.numbers::<TimestampNanosecondType>("stamp", &mut self.stamp_ns)?;
        rows.lists::<Float32Type>("velocity", 2, &mut self.velocity_mps)?;
        rows.numbers::<Float64Type>("yaw", &mut self.yaw_rad)?;
        rows.lists::<Float64Type>("position", 3, &mut self.position_m)?;
        for (name, channel) in CHANNELS.iter().zip(&mut self.action) {
            rows.optional::<Float32Type>(name, channel)?;
        }
        rows.lists::<Float32Type>("route", 2 * ROUTE_POINTS, &mut self.route_m)?;
        rows.numbers::<UInt8Type>("route_len", &mut self.route_len)?;
        let planned = RouteSource::Planned.name();
        rows.words("route_source", |word| self.is_planned.push(word == Some(planned)))?;
        rows.words("command", |word| self.command.push(word.and_then(Command::from_name)))?;
        rows.lists::<Float32Type>("future_speed", FUTURE_STEPS, &mut self.future_speed_mps)?;
        rows.lists::<Float32Type>("future_yaw", FUTURE_STEPS, &mut self.future_yaw_rad)?;
        rows.lists::<Float32Type>("future_xy", 2 * FUTURE_STEPS, &mut self.future_xy_m)?;
        rows.numbers::<UInt8Type>("future_len", &mut self.future_len)?;
        for (sensor, skews) in SENSORS.iter().zip(&mut self.skew_ns) {
            rows.optional::<Int32Type>(&format!("{sensor}_skew"), skews)?;
        }
        for (name, words) in CONDITIONS.iter().zip(&mut self.conditions) {
            rows.words(name, |word| words.push(word))?;
        }
        let perturbed = rows.column("perturbed")?.as_boolean_opt().ok_or("perturbed is no bool")?;
        self.perturbed.extend(perturbed.values());
        Ok(())
    }
}

/// The columns of a batch; an error is a sentence about the column.
struct Rows<'b>(&'b RecordBatch);

impl Rows<'_> {
    fn column(&self, name: &str) -> Result<&dyn Array, String> {
        let column = self.0.column_by_name(name).ok_or(format!("no column `{name}`"))?;
        Ok(column.as_ref())
    }

    fn required(&self, name: &str) -> Result<&dyn Array, String> {
        let column = self.column(name)?;
        match column.null_count() {
            0 => Ok(column),
            nulls => Err(format!("column `{name}` has {nulls} nulls")),
        }
    }

    fn numbers<T: ArrowPrimitiveType>(
        &self,
        name: &str,
        to: &mut Vec<T::Native>,
    ) -> Result<(), String> {
        let column = self.required(name)?.as_primitive_opt::<T>().ok_or(wrong(name))?;
        to.extend_from_slice(column.values());
        Ok(())
    }

    fn optional<T: ArrowPrimitiveType>(
        &self,
        name: &str,
        to: &mut Vec<Option<T::Native>>,
    ) -> Result<(), String> {
        let column = self.column(name)?.as_primitive_opt::<T>().ok_or(wrong(name))?;
        match column.null_count() {
            0 => to.extend(column.values().iter().copied().map(Some)),
            _ => to.extend(column.iter()),
        }
        Ok(())
    }

    /// Lists of `len`.
    fn lists<T: ArrowPrimitiveType>(
        &self,
        name: &str,
        len: usize,
        to: &mut Vec<T::Native>,
    ) -> Result<(), String> {
        let lists = self.required(name)?.as_fixed_size_list_opt().ok_or(wrong(name))?;
        let values = lists.values().as_primitive_opt::<T>().ok_or(wrong(name))?;
        if values.null_count() > 0 || values.len() != len * lists.len() {
            return Err(wrong(name));
        }
        to.extend_from_slice(values.values());
        Ok(())
    }

    fn words(&self, name: &str, mut each: impl FnMut(Option<&str>)) -> Result<(), String> {
        let column = self.column(name)?.as_string_opt::<i32>().ok_or(wrong(name))?;
        column.iter().for_each(&mut each);
        Ok(())
    }
}

fn wrong(name: &str) -> String {
    format!("column `{name}` has another type")
}

/// Read the rows of a shard that are the record's.
fn read_shard(
    dataset: &Path,
    split: Split,
    shard: &ShardRecord,
    track: &mut Track,
) -> Result<(), Box<Finding>> {
    let ShardRecord { path, rows, groups, .. } = shard;
    let found = |check: &'static Check, sentence: String| {
        Box::new(check.found(Place::file(path), None, sentence))
    };
    let unreadable = |why: String| found(&SHARD_UNREADABLE, format!("{path}: {why}"));
    let file_path = dataset.join(path);
    if !file_path.is_file() {
        let sentence = format!("{path} ({} split) does not exist", split.name());
        return Err(found(&SHARD_MISSING, sentence));
    }
    let file = File::open(&file_path).map_err(|error| unreadable(error.to_string()))?;
    let metadata = ArrowReaderMetadata::load(&file, Default::default())
        .map_err(|error| unreadable(error.to_string()))?;
    if let Some(what) = schema_fault(&metadata) {
        return Err(found(&SHARD_SCHEMA, format!("{path}: {what}")));
    }
    let in_file = metadata.metadata().row_groups();
    let [first, count] = groups.unwrap_or([0, in_file.len()]);
    let groups = first..first.saturating_add(count);
    if groups.end > in_file.len() {
        let sentence = format!("{path} has {} row groups, not {groups:?}", in_file.len());
        return Err(found(&SHARD_ROWS, sentence));
    }
    let held: i64 = in_file[groups.clone()].iter().map(|group| group.num_rows()).sum();
    let read = || -> Result<(), String> {
        let columns = ProjectionMask::columns(metadata.parquet_schema(), COLUMNS);
        let reader = ParquetRecordBatchReaderBuilder::new_with_metadata(file, metadata.clone())
            .with_projection(columns)
            .with_row_groups(groups.collect())
            .with_batch_size(ROWS_PER_SHARD)
            .build()
            .map_err(|error| error.to_string())?;
        for batch in reader {
            track.add(&batch.map_err(|error| error.to_string())?)?;
        }
        Ok(())
    };
    if let Err(why) = read() {
        // Arrays of different lengths are of no use.
        *track = Track { episode: track.episode.clone(), ..Track::default() };
        return Err(match why.starts_with("column `") {
            true => found(&SHARD_SCHEMA, format!("{path}: {why}")),
            false => unreadable(why),
        });
    }
    if held as u64 != *rows {
        let sentence = format!("{path} has {held} rows, its record says {rows}");
        return Err(found(&SHARD_ROWS, sentence));
    }
    Ok(())
}

/// What is wrong with a shard's columns, if anything.
fn schema_fault(metadata: &ArrowReaderMetadata) -> Option<String> {
    let found = metadata.schema();
    let version = found.metadata().get(VERSION_KEY).map_or("none", String::as_str);
    if version != SCHEMA_VERSION.to_string() {
        return Some(format!("frame schema version {version}, this build reads {SCHEMA_VERSION}"));
    }
    let wanted = columns::schema();
    wanted.fields().iter().find_map(|wanted| {
        let name = wanted.name();
        match found.field_with_name(name) {
            Err(_) => Some(format!("no column `{name}`")),
            Ok(field) if !same_type(field.data_type(), wanted.data_type()) => Some(format!(
                "column `{name}` is {}, not {}",
                field.data_type(),
                wanted.data_type()
            )),
            Ok(_) => None,
        }
    })
}

/// Whether values are of one type; what the items of lists are called does not matter.
fn same_type(a: &DataType, b: &DataType) -> bool {
    match (a, b) {
        (DataType::List(a), DataType::List(b)) => same_type(a.data_type(), b.data_type()),
        (DataType::FixedSizeList(a, n), DataType::FixedSizeList(b, m)) => {
            n == m && same_type(a.data_type(), b.data_type())
        }
        (a, b) => a == b,
    }
}
