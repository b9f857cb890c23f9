//! Many short logs in few files, with the frames that each gives alone.
#![allow(clippy::unwrap_used)]

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
};

use pmp::{dataset::manifest::Manifest, frame::Frame};

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
