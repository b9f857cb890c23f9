//! Recorded drives: whole files, the binary that makes them, and what is in them.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use assert_cmd::Command;
use pmp::{
    error::Error,
    log::{
        encode::{CompressedImage, Header},
        writer::{ChunkCompression, LogOptions, LogWriter},
    },
    sim::record::{Drive, RecordConfig, record, record_all},
};
use tempfile::tempdir;

fn config(out: &Path, jobs: usize) -> RecordConfig {
    let out = out.to_path_buf();
    RecordConfig { out, seed: 5, episodes: 3, seconds: 1.5, jobs, log: LogOptions::default() }
}

fn picture() -> CompressedImage {
    let header = Header { stamp_ns: 1_000, frame_id: "camera".into() };
    CompressedImage { header, format: "jpeg".into(), data: vec![1, 2, 3] }
}

fn names(folder: &Path) -> Vec<PathBuf> {
    fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect()
}

#[test]
fn same_seed_gives_the_same_bytes_whatever_the_number_of_jobs() {
    let (one, four) = (tempdir().unwrap(), tempdir().unwrap());
    let first = record_all(&config(one.path(), 1), &|| ()).unwrap();
    let second = record_all(&config(four.path(), 4), &|| ()).unwrap();
    assert_eq!(first.len(), 3);
    let bytes = |paths: &[PathBuf]| paths.iter().map(|p| fs::read(p).unwrap()).collect::<Vec<_>>();
    let (first, second) = (bytes(&first), bytes(&second));
    assert!(first == second, "logs differ with the number of jobs");
    assert_ne!(first[0], first[1], "episodes are different drives");
}

#[test]
fn recorded_log_has_every_topic_at_its_rate_and_arrivals_behind_their_stamps() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    let drive = Drive { seed: 1, episode: 0, seconds: 4.0 };
    record(&drive, &path, LogOptions::default(), &|| ()).unwrap();
    let bytes = fs::read(&path).unwrap();
    let mut counts = BTreeMap::new();
    let (mut stamps, mut last_log_time) = (Vec::new(), 0);
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        *counts.entry(message.channel.topic.clone()).or_insert(0_u32) += 1;
        assert!(message.log_time >= last_log_time, "written in order of arrival");
        last_log_time = message.log_time;
        if message.channel.topic != "/tf" && message.channel.topic != "/tf_static" {
            // Every other message starts with its header: seconds and nanoseconds.
            let word = |i: usize| u32::from_le_bytes(message.data[i..i + 4].try_into().unwrap());
            let stamp = u64::from(word(4)) * 1_000_000_000 + u64::from(word(8));
            let behind_ms = (message.log_time - stamp) as f64 / 1e6;
            assert!((0.9..90.0).contains(&behind_ms), "{}: {behind_ms}", message.channel.topic);
            stamps.push(stamp);
        }
    }
    assert!(!stamps.is_sorted(), "arrivals of different sensors are out of stamp order");
    let rates = [
        ("/camera/front/camera_info", 20),
        ("/camera/front/image/compressed", 20),
        ("/imu", 100),
        ("/lidar/points", 10),
        ("/odom", 50),
        ("/radar/front", 13),
        ("/tf", 50),
        ("/vehicle/control", 20),
        ("/vehicle/status", 20),
    ];
    for (topic, rate_hz) in rates {
        let (count, wanted) = (counts[topic], 4 * rate_hz);
        assert!(count.abs_diff(wanted) <= 1, "{topic}: {count} messages in 4 s");
    }
    assert_eq!(counts["/tf_static"], 1);
    assert_eq!(counts.len(), rates.len() + 1, "{counts:?}");
}

#[test]
fn log_says_what_the_drive_was_like() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    record(&Drive { seed: 1, episode: 0, seconds: 0.1 }, &path, LogOptions::default(), &|| ())
        .unwrap();
    let bytes = fs::read(&path).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let index = summary
        .metadata_indexes
        .iter()
        .find(|index| index.name == pmp::log::CONDITIONS_RECORD)
        .unwrap();
    let record = mcap::read::metadata(&bytes, index).unwrap();
    let words: Vec<_> = record.metadata.iter().map(|(k, v)| format!("{k}={v}")).collect();
    assert_eq!(
        words,
        [
            "applied_control=/vehicle/status",
            "illumination=daytime",
            "town=PlainRoad",
            "traffic=few",
            "weather=clear"
        ]
    );
}

#[test]
fn every_chunk_compression_reads_back() {
    for compression in [ChunkCompression::Zstd, ChunkCompression::Lz4, ChunkCompression::None] {
        let folder = tempdir().unwrap();
        let path = folder.path().join("log.mcap");
        let options = LogOptions { compression, chunk_bytes: 100, ..LogOptions::default() };
        let mut log = LogWriter::create(&path, options).unwrap();
        for i in 0..20 {
            log.write("/camera", &picture(), i * 50).unwrap();
        }
        log.finish().unwrap();
        let bytes = fs::read(&path).unwrap();
        let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
        assert!(summary.chunk_indexes.len() > 3, "{compression:?}");
        assert_eq!(mcap::MessageStream::new(&bytes).unwrap().filter_map(Result::ok).count(), 20);
    }
}

#[test]
fn writer_refuses_to_overwrite_a_log() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    fs::write(&path, "mine").unwrap();
    let refused = LogWriter::create(&path, LogOptions::default()).err().unwrap();
    assert!(matches!(refused, Error::Exists { .. }), "{refused}");
    assert_eq!(fs::read(&path).unwrap(), b"mine");
}

#[test]
fn topic_that_changes_its_type_is_refused() {
    let folder = tempdir().unwrap();
    let mut log = LogWriter::create(&folder.path().join("l.mcap"), LogOptions::default()).unwrap();
    log.write("/camera", &picture(), 0).unwrap();
    let scan = pmp::log::encode::RadarScan { header: picture().header, returns: vec![] };
    let refused = log.write("/camera", &scan, 1).unwrap_err().to_string();
    assert!(refused.contains("/camera cannot carry radar_msgs/msg/RadarScan too"), "{refused}");
}

#[test]
fn log_that_was_never_finished_leaves_nothing_that_looks_whole() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    let mut log = LogWriter::create(&path, LogOptions::default()).unwrap();
    log.write("/camera", &picture(), 0).unwrap();
    // What a kill at this moment would leave behind.
    let left = names(folder.path());
    assert!(left.iter().all(|p| p.extension().unwrap() == "unfinished"), "{left:?}");
    assert!(mcap::Summary::read(&fs::read(&left[0]).unwrap()).is_err());
    drop(log);
    assert!(names(folder.path()).is_empty(), "an abandoned log is cleared away");
}

#[test]
fn binary_prints_the_paths_and_exits_1_with_a_hint_when_they_are_there_already() {
    let folder = tempdir().unwrap();
    let out = folder.path().join("logs");
    let run = || {
        let mut command = Command::cargo_bin("pmp-sim").unwrap();
        command.args(["record", "--episodes", "1", "--seconds", "0.2", "--seed", "9", "--out"]);
        command.arg(&out).output().unwrap()
    };
    let first = run();
    let path = out.join("plain-road-9-0.mcap");
    assert_eq!(first.status.code(), Some(0));
    assert_eq!(String::from_utf8(first.stdout).unwrap(), format!("{}\n", path.display()));
    let second = run();
    assert_eq!(second.status.code(), Some(1));
    assert!(second.stdout.is_empty(), "talk does not belong on stdout");
    let stderr = String::from_utf8(second.stderr).unwrap();
    assert!(stderr.contains("error: will not overwrite"), "{stderr}");
    assert!(stderr.contains("hint: choose another --seed or --out"), "{stderr}");
}

#[test]
fn drive_of_no_length_is_refused_with_the_range_that_works() {
    let folder = tempdir().unwrap();
    let out = Command::cargo_bin("pmp-sim")
        .unwrap()
        .args(["record", "--seconds", "0", "--out"])
        .arg(folder.path())
        .output()
        .unwrap();
    assert_eq!(out.status.code(), Some(1));
    assert!(String::from_utf8(out.stderr).unwrap().contains("hint: give 0.01 to 3600 s"));
}

#[test]
fn unknown_flag_exits_2() {
    let out = Command::cargo_bin("pmp-sim").unwrap().args(["record", "--town", "x"]).output();
    assert_eq!(out.unwrap().status.code(), Some(2));
}
