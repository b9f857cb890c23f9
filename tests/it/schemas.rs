//! The schema files against what the code writes: names, order, types, nullability.
#![allow(clippy::unwrap_used)]

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::Path,
};

use arrow::datatypes::{DataType, TimeUnit};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use pmp::{
    closed_loop::{results, row::EpisodeRow},
    dataset::{
        account::{LeftOut, TopicAccount},
        columns::{self, SCHEMA_VERSION, VERSION_KEY},
        drive::Calibration,
        episodes::write_episodes,
        manifest::{
            Change, Edit, EpisodeRecord, FailedLog, IngestConfig, LogRecord, Manifest, Origin,
        },
        shard::ShardRecord,
        skew::{SensorSkew, Skews},
        split::Split,
    },
    drops::{Drops, Reason},
    eval::table,
    frame::Conditions,
    log::{
        clock::Clock,
        conventions::{EgoRule, RadarRule, Side, Sign, World},
        mapping::{Mapping, PoseSource},
        profile::Profile,
        reader::Damage,
        topics::{Names, Topics},
    },
    projection::{Camera, Crop, Distortion},
};
use serde_json::Value;

fn schema_file(name: &str) -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("schemas").join(name);
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// A type as the schema files write it.
fn type_text(data_type: &DataType) -> String {
    match data_type {
        DataType::Utf8 => "string".into(),
        DataType::Binary => "binary".into(),
        DataType::Boolean => "bool".into(),
        DataType::UInt8 => "u8".into(),
        DataType::UInt32 => "u32".into(),
        DataType::UInt64 => "u64".into(),
        DataType::Int32 => "i32".into(),
        DataType::Float16 => "f16".into(),
        DataType::Float32 => "f32".into(),
        DataType::Float64 => "f64".into(),
        DataType::Timestamp(TimeUnit::Nanosecond, Some(zone)) => format!("timestamp[ns, {zone}]"),
        DataType::Struct(fields) => {
            let mark = |is_nullable| if is_nullable { "?" } else { "" };
            let field = |field: &std::sync::Arc<arrow::datatypes::Field>| {
                let name = type_text(field.data_type());
                format!("{}: {name}{}", field.name(), mark(field.is_nullable()))
            };
            format!("struct<{}>", fields.iter().map(field).collect::<Vec<_>>().join(", "))
        }
        DataType::List(item) => {
            assert!(!item.is_nullable(), "items of lists are never null");
            format!("list<{}>", type_text(item.data_type()))
        }
        DataType::FixedSizeList(item, len) => {
            assert!(!item.is_nullable(), "items of lists are never null");
            format!("fixed_size_list<{}>[{len}]", type_text(item.data_type()))
        }
        other => panic!("the schema files have no name for {other}"),
    }
}

fn written_columns(schema: &arrow::datatypes::Schema) -> Vec<(String, String, bool)> {
    let column = |field: &std::sync::Arc<arrow::datatypes::Field>| {
        (field.name().clone(), type_text(field.data_type()), field.is_nullable())
    };
    schema.fields().iter().map(column).collect()
}

/// Columns as a schema file lists them; each must say what it means and in which unit.
fn listed_columns(columns: &Value) -> Vec<(String, String, bool)> {
    let column = |column: &Value| {
        let name = column["name"].as_str().unwrap().to_string();
        assert!(column["meaning"].as_str().is_some_and(|m| !m.is_empty()), "{name} means nothing");
        assert!(column.get("unit").is_some(), "{name} has no unit, not even null");
        let type_name = column["type"].as_str().unwrap().to_string();
        (name, type_name, column["nullable"].as_bool().unwrap())
    };
    columns.as_array().unwrap().iter().map(column).collect()
}

/// A dataset of one log in which every optional field is there.
fn manifest() -> Manifest {
    let text = |text: &str| Some(text.to_string());
    let conditions = Conditions {
        town: text("Town01"),
        weather: text("clear"),
        illumination: text("daytime"),
        traffic: text("empty"),
    };
    let mut profile = Profile { conditions: conditions.clone(), ..Profile::default() };
    let named = |name: &str| Some(Names::from(name));
    profile.topics = Topics {
        camera: named("/camera"),
        camera_info: named("/info"),
        lidar: named("/lidar"),
        radar: named("/radar"),
        odometry: named("/odom"),
        pose: named("/pose"),
        velocity: named("/velocity"),
        imu: named("/imu"),
        gnss: named("/gnss"),
        control: named("/control"),
        pedals: named("/pedals"),
        route: named("/route"),
        ignore: vec!["/other".into()],
    };
    profile.clock.topics = BTreeMap::from([("/camera".into(), Clock::Log)]);
    profile.clock.offset_s = BTreeMap::from([("/gps".into(), -66.14)]);
    profile.rig = text("kitti");
    profile.ego = EgoRule { world: Some(World::LeftHanded), base: text("car") };
    profile.radar = RadarRule { azimuth: Some(Side::Right), closing_speed: Some(Sign::Positive) };
    profile.camera.crop = Some(Crop { x: 1, y: 2, width: 3, height: 4 });
    profile.control.steering_lock_rad = Some(0.6);
    let mut drops = Drops::default();
    for reason in Reason::ALL {
        drops.add(reason, 7, text("why"));
    }
    let mapping = Mapping {
        rig: text("kitti"),
        camera: text("/camera"),
        camera_info: text("/info"),
        lidar: text("/lidar"),
        radar: text("/radar"),
        pose: Some(PoseSource::Topic("/odom".into())),
        velocity: text("/velocity"),
        control: text("/control"),
        pedals: text("/pedals"),
        route: text("/route"),
        weather: text("/weather"),
        town: text("/world"),
        situation: text("/situation"),
        notes: vec!["a note".into()],
    };
    let mut camera = Camera::from_fov(600, 250, 1.5);
    camera.distortion = Distortion::PlumbBob([0.1, 0.2, 0.3, 0.4, 0.5]);
    let calibration = Calibration { camera: Some(camera) };
    let account = TopicAccount {
        topic: "/camera".into(),
        type_name: "sensor_msgs/msg/Image".into(),
        used_as: text("camera"),
        read: 3,
        used: 2,
        left_out: BTreeMap::from([(LeftOut::NotNearest, 1)]),
    };
    let skew = SensorSkew { frames: 3, median_ms: 1.5, p95_ms: 2.5, largest_ms: 3.5 };
    let log = LogRecord {
        episode: "ep-1".into(),
        split: Split::Train,
        source_log: "a.mcap".into(),
        source_bytes: 1,
        source_sha256: "00".into(),
        messages: 2,
        conditions,
        mapping: mapping.clone(),
        calibration: calibration.clone(),
        frames: 3,
        frames_with_full_future: 4,
        start_ns: 5,
        duration_s: 6.5,
        distance_m: 7.5,
        drops: drops.clone(),
        damage: vec![Damage { offset: 8, what: "damage".into() }],
        undecodable: BTreeMap::from([("/odom".into(), (9, "why".into()))]),
        out_of_order: BTreeMap::from([("/odom".into(), 10)]),
        left_out: vec!["left out".into()],
        notes: vec!["a note".into()],
        shards: vec![ShardRecord {
            path: "a".into(),
            rows: 3,
            bytes: 11,
            sha256: "00".into(),
            groups: Some([0, 1]),
        }],
        clock_jumps: BTreeMap::from([("/camera".into(), 1)]),
        topics: vec![account.clone()],
        skews: Skews {
            image: Some(skew),
            lidar: Some(skew),
            radar: Some(skew),
            control: Some(skew),
        },
        episodes: vec![EpisodeRecord {
            id: "ep-1".into(),
            frames: 3,
            frames_with_full_future: 4,
            start_ns: 5,
            duration_s: 6.5,
            distance_m: 7.5,
            drops,
            mapping: mapping.clone(),
            calibration,
            topics: vec![account],
            shards: 1,
        }],
    };
    let transform = PoseSource::Transform("base_link".into());
    let transform = Mapping { pose: Some(transform), ..mapping.clone() };
    let integrated = PoseSource::Integrated { speed: "/speed".into(), yaw_rate: "/imu".into() };
    let integrated = Mapping { pose: Some(integrated), ..mapping.clone() };
    let gnss = PoseSource::Gnss {
        fix: "/fix".into(),
        heading: "/imu".into(),
        speed: Some("/speed".into()),
    };
    let gnss = Mapping { pose: Some(gnss), ..mapping };
    let other = LogRecord { episode: "ep-2".into(), mapping: transform, ..log.clone() };
    let third = LogRecord { episode: "ep-3".into(), mapping: integrated, ..log.clone() };
    let fourth = LogRecord { episode: "ep-4".into(), mapping: gnss, ..log.clone() };
    let failed = vec![FailedLog { source_log: "b.mcap".into(), error: "why".into() }];
    let config = IngestConfig::new(profile, 10.0).unwrap();
    let edits = edits(&config);
    let manifest = Manifest::new(config, vec![log, other, third, fourth], failed);
    Manifest { edit: edits.into_iter().next(), ..manifest }
}

/// Edits of every kind.
fn edits(config: &IngestConfig) -> Vec<Edit> {
    let origin = Origin {
        identity: "00".into(),
        written_by: "pmp".into(),
        frames: 1,
        config: config.clone(),
        edit: None,
    };
    let merge = Edit { change: Change::Merge, of: vec![origin.clone()] };
    let of = vec![Origin { edit: Some(Box::new(merge.clone())), ..origin }];
    let drop = Change::Drop { episodes: vec!["ep-1".into()] };
    let resplit = Change::Resplit { rule: "--by-hash".into(), moved: vec!["ep-1".into()] };
    let made = |change| Edit { change, of: of.clone() };
    vec![made(drop), made(resplit), merge]
}

/// The fields that a schema file lists for a JSON file: path to type.
fn listed_fields(fields: &Value) -> BTreeMap<String, String> {
    let field = |field: &Value| {
        let path = field["path"].as_str().unwrap().to_string();
        assert!(field["meaning"].as_str().is_some_and(|m| !m.is_empty()), "{path} means nothing");
        (path, field["type"].as_str().unwrap().to_string())
    };
    fields.as_array().unwrap().iter().map(field).collect()
}

/// Every field of a value as path and type. Maps are known by their `*` in `listed`, and what is
/// listed as `object` is not looked into.
fn written_fields(
    value: &Value,
    path: &str,
    listed: &BTreeMap<String, String>,
    found: &mut BTreeMap<String, BTreeSet<&'static str>>,
) {
    let mut leaf = |name| {
        found.entry(path.to_string()).or_default().insert(name);
    };
    match value {
        _ if listed.get(path).is_some_and(|name| name == "object") => leaf("object"),
        Value::Object(fields) => {
            let any_key = format!("{path}.*");
            let is_map = listed.keys().any(|path| path.starts_with(&any_key));
            for (key, value) in fields {
                let key = if is_map { "*" } else { key };
                let path = if path.is_empty() { key.into() } else { format!("{path}.{key}") };
                written_fields(value, &path, listed, found);
            }
        }
        Value::Array(items) => {
            for item in items {
                written_fields(item, &format!("{path}[]"), listed, found);
            }
        }
        Value::Null => leaf("null"),
        Value::Bool(_) => leaf("boolean"),
        Value::String(_) => leaf("string"),
        Value::Number(number) if number.is_f64() => leaf("number"),
        Value::Number(_) => leaf("integer"),
    }
}

#[track_caller]
fn same_fields(values: &[Value], listed: &Value) {
    let listed = listed_fields(listed);
    let mut found = BTreeMap::new();
    for value in values {
        written_fields(value, "", &listed, &mut found);
    }
    let names = |keys: Vec<&String>| keys.into_iter().cloned().collect::<Vec<_>>();
    assert_eq!(names(found.keys().collect()), names(listed.keys().collect()));
    for (path, types) in found {
        let allowed: BTreeSet<&str> = listed[&path].split(" or ").collect();
        assert!(types.is_subset(&allowed), "{path} is {types:?}, listed as {allowed:?}");
    }
}

#[test]
fn frame_columns_are_those_of_the_schema_file() {
    let written = columns::schema();
    assert_eq!(written_columns(&written), listed_columns(&schema_file("frame.v1.json")["columns"]));
    assert_eq!(SCHEMA_VERSION, 1, "a new version needs a new file, frame.v2.json");
    assert_eq!(written.metadata()[VERSION_KEY], "1");
}

#[test]
fn json_files_have_the_fields_of_the_schema_file() {
    let listed = schema_file("manifest.v1.json");
    let manifest = manifest();
    same_fields(&[serde_json::to_value(&manifest).unwrap()], &listed["manifest.json"]);
    let logs: Vec<Value> =
        manifest.logs.iter().map(|log| serde_json::to_value(log).unwrap()).collect();
    same_fields(&logs, &listed["logs/*.json"]);
    let edits: Vec<Value> =
        edits(&manifest.config).iter().map(|edit| serde_json::to_value(edit).unwrap()).collect();
    same_fields(&edits, &listed["edit.json"]);
    let mut config = manifest.config.clone();
    let one = serde_json::to_value(&config).unwrap();
    config.profile.topics.camera = Some(Names::Several(vec!["/a".into(), "/b".into()]));
    same_fields(&[one, serde_json::to_value(&config).unwrap()], &listed["ingest.json"]);
}

#[test]
fn json_files_read_back_as_what_was_written() {
    let manifest = manifest();
    let text = serde_json::to_string(&manifest).unwrap();
    assert_eq!(serde_json::from_str::<Manifest>(&text).unwrap(), manifest);
}

#[test]
fn episode_columns_are_those_of_the_schema_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("episodes.parquet");
    write_episodes(&path, &manifest().logs).unwrap();
    let file = fs::File::open(&path).unwrap();
    let reader = ParquetRecordBatchReaderBuilder::try_new(file).unwrap();
    let listed = listed_columns(&schema_file("manifest.v1.json")["episodes.parquet"]);
    assert_eq!(written_columns(reader.schema()), listed);
}

#[test]
fn driven_episode_columns_are_those_of_the_schema_file_and_of_a_row() {
    let listed = listed_columns(&schema_file("episodes.v1.json")["columns"]);
    assert_eq!(results::SCHEMA_VERSION, 1, "a new version needs a new file, episodes.v2.json");
    let row = EpisodeRow::default();
    let nullable: Vec<(&str, bool)> =
        listed.iter().map(|(name, _, nullable)| (name.as_str(), *nullable)).collect();
    // Text keeps the order of the fields, a map does not.
    let text = serde_json::to_string(&row).unwrap();
    let null = |pair: &str| {
        let (name, value) = pair.split_once(':').unwrap();
        (name.trim_matches('"').to_string(), value == "null")
    };
    let of_row: Vec<_> = text.trim_matches(['{', '}']).split(',').map(null).collect();
    let of_row: Vec<(&str, bool)> = of_row.iter().map(|(n, null)| (n.as_str(), *null)).collect();
    assert_eq!(of_row, nullable);

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(results::FILE);
    results::write(&path, &[row]).unwrap();
    let reader = ParquetRecordBatchReaderBuilder::try_new(fs::File::open(&path).unwrap()).unwrap();
    assert_eq!(written_columns(reader.schema()), listed);
    assert_eq!(reader.schema().metadata()[results::VERSION_KEY], "1");
}

#[test]
fn a_closed_loop_table_has_the_fields_of_the_schema_file() {
    let values = crate::tables::of_every_kind().map(|table| serde_json::to_value(table).unwrap());
    same_fields(&values, &schema_file("table.v1.json")["fields"]);
    assert_eq!(table::report::VERSION, 1, "a new version needs a new file, table.v2.json");
}
