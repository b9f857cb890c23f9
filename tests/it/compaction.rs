//! Many short logs in few files, with the frames that each gives alone.
#![allow(clippy::unwrap_used)]

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
};

use parquet::{
    basic::{Compression, Encoding},
    file::reader::{FileReader, SerializedFileReader},
};
use pmp::{
    atomic::Committed,
    dataset::{
        manifest::Manifest,
        shard::{ROWS_PER_GROUP, ShardReader, ShardRecord, ShardWriter},
    },
    frame::{Frame, LidarPixels},
};

use crate::{
    fixtures::DriveLog,
    ingest::{frames, into, same_trees, text},
};

/// Logs of half a second, each another drive.
fn short_logs(folder: &Path, count: usize) -> Vec<PathBuf> {
    let log =
        |i| DriveLog { seconds: 0.5, speed_mps: 3.0 + 0.01 * i as f64, ..DriveLog::default() };
    (0..count).map(|i| log(i).write(folder, &format!("short-{i:03}.mcap"))).collect()
}

fn by_episode(dataset: &Path) -> BTreeMap<String, Vec<Frame>> {
    let mut episodes: BTreeMap<String, Vec<Frame>> = BTreeMap::new();
    for (episode, frame) in frames(dataset) {
        episodes.entry(episode).or_default().push(frame);
    }
    episodes
}

#[test]
fn many_short_logs_lie_in_one_file_a_split_and_read_as_each_alone() {
    let folder = tempfile::tempdir().unwrap();
    let logs = short_logs(folder.path(), 30);
    let dataset = folder.path().join("all");
    let given: Vec<&Path> = logs.iter().map(PathBuf::as_path).collect();
    let said = into(&dataset, &given);
    assert_eq!(said.code, 0, "{}", said.err);

    let manifest = Manifest::read(&dataset).unwrap();
    let named: BTreeSet<&str> =
        manifest.logs.iter().flat_map(|log| &log.shards).map(|s| s.path.as_str()).collect();
    let both =
        ["frames/split=train/several-00000.parquet", "frames/split=val/several-00000.parquet"];
    assert_eq!(named.iter().copied().collect::<Vec<_>>(), both);
    for split in ["train", "val"] {
        let files = fs::read_dir(dataset.join(format!("frames/split={split}"))).unwrap();
        assert_eq!(files.count(), 1, "{split}");
    }

    let together = by_episode(&dataset);
    assert_eq!(together.len(), 30);
    for log in [&logs[0], &logs[17]] {
        let alone = folder.path().join(format!("{}-alone", log.file_stem().unwrap().display()));
        assert_eq!(into(&alone, &[log]).code, 0);
        for (episode, frames) in by_episode(&alone) {
            assert_eq!(together[&episode], frames);
        }
    }
}

#[test]
fn what_a_kill_leaves_of_the_small_files_goes_with_the_next_run() {
    let folder = tempfile::tempdir().unwrap();
    let logs = short_logs(folder.path(), 12);
    let given: Vec<&Path> = logs.iter().map(PathBuf::as_path).collect();
    let (whole, killed) = (folder.path().join("whole"), folder.path().join("killed"));
    for dataset in [&whole, &killed] {
        assert_eq!(into(dataset, &given).code, 0);
    }
    // As after a kill between the manifest and the removal of a small file.
    let alone = folder.path().join("alone");
    assert_eq!(into(&alone, &given[..1]).code, 0);
    let shard = &Manifest::read(&alone).unwrap().logs[0].shards[0];
    fs::copy(alone.join(&shard.path), killed.join(&shard.path)).unwrap();
    assert_eq!(into(&killed, &given).code, 0);
    same_trees(&whole, &killed);
    // As after a kill before the manifest, when other logs had been committed than now: the logs
    // are made again, since their own files are gone.
    fs::remove_file(Manifest::path(&killed)).unwrap();
    let stale = killed.join("frames/split=train/several-00007.parquet");
    fs::write(&stale, b"left by another attempt").unwrap();
    assert_eq!(into(&killed, &given).code, 0, "{}", text(&killed));
    same_trees(&whole, &killed);
}

#[test]
fn lists_of_half_floats_are_read_back_whatever_is_missing() {
    let folder = tempfile::tempdir().unwrap();
    let log = DriveLog { seconds: 8.0, ..DriveLog::default() }.write(folder.path(), "drive.mcap");
    let dataset = folder.path().join("data");
    assert_eq!(into(&dataset, &[&log]).code, 0);
    let mut written: Vec<Frame> = frames(&dataset).into_iter().map(|(_, frame)| frame).collect();
    for (at, frame) in written.iter_mut().enumerate() {
        match at % 5 {
            0 => frame.lidar = None,
            1 => frame.lidar = Some(LidarPixels::default()),
            2 => frame.radar = None,
            3 => frame.radar.as_mut().unwrap().speed_mps = None,
            _ => {}
        }
    }
    for first in [0, 1, 4] {
        let part = &written[first..];
        let path = format!("frames/split=train/{first}.parquet");
        let mut shard = ShardWriter::create(&dataset.join(&path)).unwrap();
        shard.write("ep", part).unwrap();
        let rows = shard.rows() as u64;
        let Committed { bytes, sha256 } = shard.finish().unwrap();
        let record = ShardRecord { path: path.clone(), rows, bytes, sha256, groups: None };
        let reader = ShardReader::open(&dataset, &record).unwrap();
        let read: Vec<Frame> = (0..part.len().div_ceil(ROWS_PER_GROUP))
            .flat_map(|group| reader.frames(group).unwrap())
            .map(|(_, frame)| frame)
            .collect();
        assert!(read == part);

        let file = fs::File::open(dataset.join(&path)).unwrap();
        let footer = SerializedFileReader::new(file).unwrap();
        let group = footer.metadata().row_group(0);
        let of = |name: &str| {
            let column = group.columns().iter().find(|c| c.column_path().parts()[0] == name);
            let column = column.unwrap();
            (column.encodings().collect::<Vec<_>>(), column.compression())
        };
        for name in ["lidar_pixel", "radar_pixel"] {
            assert!(of(name).0.contains(&Encoding::DELTA_BINARY_PACKED), "{:?}", of(name));
        }
        // DuckDB reads half floats of no other encoding.
        for name in ["lidar_x", "radar_speed"] {
            assert!(of(name).0.contains(&Encoding::PLAIN), "{:?}", of(name));
            assert!(matches!(of(name).1, Compression::ZSTD(_)), "{:?}", of(name));
        }
        assert_eq!(of("image").1, Compression::UNCOMPRESSED);
    }
}
