//! The statistics of a dataset: numbers against hand-computed ones, the schema, and the command.
#![allow(clippy::unwrap_used)]

use std::{
    collections::BTreeMap,
    fs,
    path::Path,
    process::{Command as Process, Output},
};

use pmp::{
    dataset::{
        drive::Calibration,
        episodes::write_episodes,
        manifest::{EpisodeRecord, FailedLog, IngestConfig, LogRecord, Manifest},
        shard::ShardRecord,
        shard::ShardWriter,
        skew::Skews,
        split::Split,
    },
    drops::{Drops, Reason},
    frame::{Command, Conditions, Frame, LidarPixels, RadarPixels, RouteSource, Skew},
    log::{mapping::Mapping, profile::Profile, reader::Damage},
    stats::{
        query::summarise,
        summary::{Quantiles, Summary},
    },
};
use proptest::prelude::*;
use serde_json::Value;

use crate::evaluation::accelerating;

const NOTHING: &str = "–";

/// One log of a dataset made by hand.
pub(crate) struct Drive {
    pub(crate) split: Split,
    pub(crate) frames: Vec<Frame>,
    pub(crate) distance_m: f64,
    pub(crate) conditions: Conditions,
}

pub(crate) fn drive(split: Split, frames: Vec<Frame>) -> Drive {
    Drive { split, frames, distance_m: 1500.0, conditions: Conditions::default() }
}

/// Write shards, episodes and manifest as an ingest does; `change` the records before.
pub(crate) fn write(
    root: &Path,
    drives: &[Drive],
    change: impl Fn(&mut Vec<LogRecord>),
) -> Manifest {
    let record = |(number, drive): (usize, &Drive)| {
        let episode = format!("ep-{number}");
        let split = drive.split.name();
        let path = format!("frames/split={split}/{episode}-00000.parquet");
        fs::create_dir_all(root.join(&path).parent().unwrap()).unwrap();
        let mut shard = ShardWriter::create(&root.join(&path)).unwrap();
        for frames in drive.frames.chunks(64) {
            shard.write(&episode, frames).unwrap();
        }
        shard.finish().unwrap();
        let bytes = fs::metadata(root.join(&path)).unwrap().len();
        let rows = drive.frames.len() as u64;
        LogRecord {
            episode,
            split: drive.split,
            source_log: format!("{number}.mcap"),
            source_bytes: 0,
            source_sha256: String::new(),
            messages: 0,
            conditions: drive.conditions.clone(),
            mapping: Mapping::default(),
            calibration: Calibration { camera: None },
            frames: rows,
            frames_with_full_future: 0,
            start_ns: 0,
            duration_s: 0.0,
            distance_m: drive.distance_m,
            drops: Drops::default(),
            damage: Vec::new(),
            undecodable: BTreeMap::new(),
            out_of_order: BTreeMap::new(),
            left_out: Vec::new(),
            notes: Vec::new(),
            shards: vec![ShardRecord {
                path,
                rows,
                bytes,
                sha256: format!("{number}"),
                groups: None,
            }],
            clock_jumps: BTreeMap::new(),
            topics: Vec::new(),
            skews: Skews::default(),
            episodes: vec![EpisodeRecord {
                id: format!("ep-{number}"),
                frames: rows,
                frames_with_full_future: 0,
                start_ns: 0,
                duration_s: 0.0,
                distance_m: drive.distance_m,
                drops: Drops::default(),
                mapping: Mapping::default(),
                calibration: Calibration { camera: None },
                topics: Vec::new(),
                shards: 1,
            }],
        }
    };
    let mut logs: Vec<LogRecord> = drives.iter().enumerate().map(record).collect();
    change(&mut logs);
    write_episodes(&root.join("episodes.parquet"), &logs).unwrap();
    let config = IngestConfig::new(Profile::default(), 10.0).unwrap();
    let manifest = Manifest::new(config, logs, Vec::new());
    write_manifest(root, &manifest);
    manifest
}

fn write_manifest(root: &Path, manifest: &Manifest) {
    fs::write(Manifest::path(root), serde_json::to_string(manifest).unwrap()).unwrap();
}

/// Summary of drives made by hand.
fn summary(drives: &[Drive]) -> Summary {
    let root = tempfile::tempdir().unwrap();
    write(root.path(), drives, |_| ());
    summarise(root.path()).unwrap()
}

pub(crate) fn pmp_stats(arguments: &[&str]) -> Output {
    Process::new(assert_cmd::cargo::cargo_bin!("pmp-stats")).args(arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

/// Frames at 1, 2, ... m/s.
fn faster_and_faster(count: u32) -> Vec<Frame> {
    (0..count).map(|i| accelerating(i, f64::from(i + 1), 0.0)).collect()
}

/// Two drives in train and one in val, with something of everything.
fn varied() -> Vec<Drive> {
    let mut first = drive(Split::Train, faster_and_faster(3));
    first.conditions.town = Some("Town01".into());
    first.frames[0].command = Command::Left;
    first.frames[1].route.source = RouteSource::Planned;
    first.frames[2].future.len = 29;
    for (i, (image, lidar)) in [(-2, Some(30)), (4, None), (-5, Some(-10))].into_iter().enumerate()
    {
        let frame = &mut first.frames[i];
        frame.lidar = lidar.map(|_| LidarPixels::default());
        frame.skew = Skew {
            image_ns: image * 1_000_000,
            lidar_ns: lidar.map(|ms| ms * 1_000_000),
            ..Skew::default()
        };
    }
    let mut second = drive(Split::Train, faster_and_faster(1));
    second.conditions.town = Some("Town02".into());
    second.frames[0].velocity_mps = [-3.0, 4.0];
    let mut third = drive(Split::Val, faster_and_faster(4));
    third.distance_m = 250.0;
    third.frames[3].radar = Some(RadarPixels::default());
    third.frames[3].skew.radar_ns = Some(0);
    third.frames[3].action.steer = None;
    vec![first, second, third]
}

#[test]
fn amounts_are_those_counted_by_hand() {
    let splits = summary(&varied()).splits;
    let (train, val, all) = (splits.train.unwrap(), splits.val.unwrap(), splits.all.unwrap());
    assert_eq!((train.episodes, val.episodes, all.episodes), (2, 1, 3));
    assert_eq!((train.frames, val.frames, all.frames), (4, 4, 8));
    assert_eq!((train.distance_km, val.distance_km, all.distance_km), (3.0, 0.25, 3.25));
    assert_eq!(all.hours, 8.0 / 36_000.0);
    // 1, 2, 3 and the hypotenuse of 3 and 4; then 1, 2, 3, 4.
    assert_eq!(train.mean_speed_mps, Some(2.75));
    assert_eq!(val.mean_speed_mps, Some(2.5));
    assert_eq!((train.frames_with_full_future, all.frames_with_full_future), (3, 7));
    let (train, val, all) = (train.shares.unwrap(), val.shares.unwrap(), all.shares.unwrap());
    assert_eq!((train.lidar, val.lidar, all.lidar), (0.5, 0.0, 0.25));
    assert_eq!((train.radar, val.radar, all.radar), (0.0, 0.25, 0.125));
    assert_eq!((train.steer, val.steer), (1.0, 0.75));
    assert_eq!((all.throttle, all.brake, all.full_future), (1.0, 0.0, 0.875));
}

#[test]
fn skew_has_a_signed_mean_and_absolute_quantiles_in_milliseconds() {
    let skews = summary(&varied()).skews;
    let lidar = skews.lidar.unwrap();
    assert_eq!((lidar.frames, lidar.signed_mean_ms), (2, 10.0));
    assert_eq!((lidar.absolute_ms.min, lidar.absolute_ms.max), (10.0, 30.0));
    assert_eq!((lidar.absolute_ms.p25, lidar.absolute_ms.p50), (15.0, 20.0));
    let image = skews.image.unwrap();
    assert_eq!((image.frames, image.signed_mean_ms), (8, -0.375));
    assert_eq!((image.absolute_ms.p50, image.absolute_ms.max), (0.0, 5.0));
    assert!(skews.control.is_none(), "no frame has a control sample");
}

#[test]
fn frames_are_grouped_by_word_and_the_unknown_come_last() {
    let summary = summary(&varied());
    let groups = |groups: &[pmp::stats::summary::Group]| -> Vec<(String, u64)> {
        let name = |name: &Option<String>| name.clone().unwrap_or("unknown".into());
        groups.iter().map(|group| (name(&group.name), group.frames)).collect()
    };
    let of = |pairs: &[(&str, u64)]| -> Vec<(String, u64)> {
        pairs.iter().map(|(name, frames)| ((*name).to_string(), *frames)).collect()
    };
    let command = of(&[("follow", 7), ("left", 1), ("right", 0), ("straight", 0)]);
    assert_eq!(groups(&summary.groups.command), command);
    assert_eq!(groups(&summary.groups.route_source), of(&[("planned", 1), ("driven", 7)]));
    let town = of(&[("Town01", 3), ("Town02", 1), ("unknown", 4)]);
    assert_eq!(groups(&summary.groups.town), town);
    assert_eq!(groups(&summary.groups.traffic), of(&[("unknown", 8)]));
}

#[test]
fn what_was_left_out_is_summed_over_the_logs() {
    let root = tempfile::tempdir().unwrap();
    let mut manifest = write(root.path(), &varied(), |logs| {
        logs[0].drops.add(Reason::ImageGap, 5, None);
        logs[2].drops.add(Reason::ImageGap, 7, None);
        logs[1].damage = vec![Damage { offset: 3, what: "cut off".into() }; 2];
        logs[1].undecodable.insert("/points".into(), (4, "too short".into()));
        logs[2].left_out.push("lidar /points: the camera has no calibration".into());
    });
    manifest.failed =
        vec![FailedLog { source_log: "empty.mcap".into(), error: "no messages".into() }];
    write_manifest(root.path(), &manifest);
    let summary = summarise(root.path()).unwrap();
    let left_out = &summary.left_out;
    assert_eq!(left_out.ticks["image_gap"], 2);
    assert_eq!(left_out.ticks.len(), Reason::ALL.len());
    assert_eq!((left_out.damaged_parts, left_out.damaged_logs), (2, 1));
    assert_eq!(left_out.undecodable_messages, 4);
    assert_eq!(left_out.failed_logs[0].source_log, "empty.mcap");
    let screen = summary.screen().to_string();
    assert!(screen.contains("2  ticks: image_gap"), "{screen}");
    assert!(screen.contains("  empty.mcap: no messages"), "{screen}");
    assert!(screen.contains("  2.mcap: lidar /points: the camera has no calib"), "{screen}");
}

#[test]
fn split_that_does_not_exist_is_null_and_one_without_frames_is_counted_as_empty() {
    let only_val = summary(&[drive(Split::Val, faster_and_faster(2))]);
    assert!(only_val.splits.train.is_none());
    assert_eq!(only_val.splits.val, only_val.splits.all);

    let empty =
        summary(&[drive(Split::Train, Vec::new()), drive(Split::Val, faster_and_faster(2))]);
    let train = empty.splits.train.unwrap();
    assert_eq!((train.episodes, train.frames, train.mean_speed_mps), (1, 0, None));
    assert!(train.shares.is_none());
    assert_eq!(empty.splits.val.unwrap().frames, 2);

    let nothing = summary(&[]);
    assert!(nothing.splits.all.is_none() && nothing.signals.speed_mps.is_none());
    let screen = nothing.screen().to_string();
    let train = screen.lines().find(|line| line.starts_with("train")).unwrap();
    assert_eq!(
        train.split_whitespace().collect::<Vec<_>>(),
        ["train", "–", "–", "–", "–", "–", "–"]
    );
    assert!(!screen.lines().any(|line| line.contains("NaN")), "{screen}");
}

#[test]
fn screen_fits_in_100_columns_and_shows_what_is_absent_as_a_dash() {
    let mut drives = varied();
    drives[0].conditions.town = Some("a town with quite a long name, longer than a column".into());
    for line in summary(&drives).screen().to_string().lines() {
        assert!(line.chars().count() <= 100, "{line}");
        assert_eq!(line, line.trim_end(), "nothing hangs over");
        if line.starts_with("brake") || line.starts_with("control") {
            assert_eq!(line.matches(NOTHING).count(), 8, "{line}");
        }
    }
}

/// Type 7 of Hyndman and Fan, by sorting.
fn slow_quantile(values: &[f64], level: f64) -> f64 {
    let mut values = values.to_vec();
    values.sort_by(f64::total_cmp);
    let place = level * (values.len() - 1) as f64;
    let (below, above) = (values[place.floor() as usize], values[place.ceil() as usize]);
    below + (above - below) * (place - place.floor())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn quantiles_are_those_of_a_sort_over_all_shards(
        drives in prop::collection::vec(prop::collection::vec((-30.0f32..30.0, -1.0f32..1.0), 0..70), 1..4)
    ) {
        let frame = |i: usize, speed: f32, steer: f32| {
            let mut frame = accelerating(i as u32, f64::from(speed), 0.0);
            frame.action.steer = (steer > -0.5).then_some(steer);
            frame
        };
        let made: Vec<Drive> = drives
            .iter()
            .enumerate()
            .map(|(number, values)| {
                let frames = values.iter().enumerate().map(|(i, (v, s))| frame(i, *v, *s));
                drive(Split::ALL[number % 2], frames.collect())
            })
            .collect();
        let signals = summary(&made).signals;
        let frames = || made.iter().flat_map(|drive| &drive.frames);
        let speeds = frames().map(|frame| f64::from(frame.velocity_mps[0].abs())).collect();
        let steers = frames().filter_map(|frame| frame.action.steer.map(f64::from)).collect();
        let cases: [(_, Vec<f64>); 2] = [(signals.speed_mps, speeds), (signals.steer, steers)];
        for (found, values) in cases {
            prop_assert_eq!(found.is_none(), values.is_empty());
            let Some(found) = found else { continue };
            prop_assert_eq!(found.frames, values.len() as u64);
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            prop_assert!((found.mean - mean).abs() < 1e-9);
            for (level, value) in Quantiles::LEVELS.into_iter().zip(found.quantiles.values()) {
                prop_assert!((value - slow_quantile(&values, level)).abs() < 1e-9);
            }
        }
    }
}

/// Paths of all fields, in their order; elements of a list share theirs.
fn fields(value: &Value, path: &str, found: &mut Vec<String>) {
    let mut add = |path: String| {
        if !found.contains(&path) {
            found.push(path);
        }
    };
    match value {
        Value::Object(object) => {
            if path.starts_with("splits.") && path.matches('.').count() == 1
                || path.ends_with(".shares")
                || (path.starts_with("signals.") || path.starts_with("skews."))
                    && path.matches('.').count() == 1
            {
                add(path.to_string());
            }
            for (key, value) in object {
                let dot = if path.is_empty() { "" } else { "." };
                fields(value, &format!("{path}{dot}{key}"), found);
            }
        }
        Value::Array(list) => {
            list.iter().for_each(|value| fields(value, &format!("{path}[]"), found));
        }
        _ => add(path.to_string()),
    }
}

#[test]
fn schema_lists_every_field_of_the_json_with_its_meaning() {
    let root = tempfile::tempdir().unwrap();
    let mut drives = varied();
    for frame in drives.iter_mut().flat_map(|drive| &mut drive.frames) {
        frame.action.brake = Some(0.0);
        frame.skew.control_ns = Some(1);
    }
    let mut manifest = write(root.path(), &drives, |logs| logs[0].left_out.push("radar".into()));
    manifest.failed = vec![FailedLog { source_log: "a.mcap".into(), error: "empty".into() }];
    write_manifest(root.path(), &manifest);
    let json: Value = serde_json::from_str(&summarise(root.path()).unwrap().json()).unwrap();
    let mut found = Vec::new();
    fields(&json, "", &mut found);

    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("schemas/stats.v1.json");
    let schema: Value = serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap();
    let mut listed = Vec::new();
    for field in schema["fields"].as_array().unwrap() {
        assert!(field["meaning"].is_string() && field["type"].is_string(), "{field}");
        listed.push(field["path"].as_str().unwrap().to_string());
    }
    found.sort();
    listed.sort();
    assert_eq!(found, listed);
}

#[test]
fn command_prints_data_on_stdout_and_nothing_on_stderr() {
    let root = tempfile::tempdir().unwrap();
    // Characters that a glob would understand, and a folder that looks like a partition.
    let dataset = root.path().join("split=val").join("command=left").join("my [data]*");
    write(&dataset, &varied(), |_| ());
    let dataset_text = dataset.to_str().unwrap();
    let screen = pmp_stats(&[dataset_text]);
    assert_eq!((screen.status.code(), text(&screen.stderr)), (Some(0), ""));
    let summary = summarise(&dataset).unwrap();
    assert_eq!(text(&screen.stdout), summary.screen().to_string());
    let json = pmp_stats(&[dataset_text, "--json"]);
    assert_eq!((json.status.code(), text(&json.stderr)), (Some(0), ""));
    assert_eq!(text(&json.stdout), summary.json(), "the same every time");
    assert_eq!(serde_json::from_slice::<Summary>(&json.stdout).unwrap(), summary);
    assert!(text(&json.stdout).starts_with("{\n  \"version\": 1,\n  \"dataset\""));
}

#[test]
fn folder_that_is_no_whole_dataset_exits_1_and_says_what_to_do() {
    let root = tempfile::tempdir().unwrap();
    let dataset = root.path().to_str().unwrap();
    let refused = |what: &str| {
        let output = pmp_stats(&[dataset]);
        assert_eq!((output.status.code(), text(&output.stdout)), (Some(1), ""));
        let stderr = text(&output.stderr);
        assert!(stderr.starts_with("error: ") && stderr.contains(what), "{stderr}");
        assert!(stderr.contains("\nhint: "), "{stderr}");
    };
    refused("make one with `pmp-ingest --out DATASET LOG...`");
    fs::write(root.path().join("ingest.json"), "{}").unwrap();
    refused("give the same `pmp-ingest` command again to finish it");

    let manifest = write(root.path(), &varied(), |_| ());
    let claims_more = Manifest { frames: manifest.frames + 1, ..manifest };
    write_manifest(root.path(), &claims_more);
    refused("the shards hold 8 frames, the manifest says 9");
    let shard = root.path().join(&claims_more.logs[2].shards[0].path);
    fs::write(&shard, "PAR1").unwrap();
    refused("a shard is not as long as it was");
    fs::remove_file(&shard).unwrap();
    refused("a shard cannot be read");
}
