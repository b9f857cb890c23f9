//! Logs in, dataset out: the job behind `pmp-ingest`.
//!
//! ```text
//! DATASET/ingest.json                     the configuration, written first
//! DATASET/frames/split=*/EPISODE-*.parquet   the shards of a log ...
//! DATASET/logs/EPISODE.json               ... and then its record: the log is committed
//! DATASET/episodes.parquet, manifest.json put together from the records, last
//! ```
//!
//! Killed at any moment and started again, it skips the logs that are committed and makes the
//! others anew; every file's bytes are a function of the log and the configuration alone.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use rayon::prelude::*;

use crate::{
    atomic::{self, UNFINISHED, file_name, sha256_of_file},
    dataset::{
        account,
        drive::Drive,
        episode::Episode,
        episodes::write_episodes,
        manifest::{FailedLog, IngestConfig, LogRecord, Manifest, ShardRecord},
        record::{Parts, Source},
    },
    error::{Error, Result},
    log::recording::Recording,
};

/// What an ingest tells while it runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// A log was scanned and has so many ticks to make.
    Opened { ticks: u64 },
    /// So many ticks were made.
    Made { ticks: u64 },
}

/// Files among the arguments: a folder stands for all `.mcap` files in it and below it.
///
/// # Errors
///
/// [`Error::Io`] if a path does not exist, [`Error::Config`] if there is no log at all.
pub fn find_logs(paths: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let mut logs = Vec::new();
    for path in paths {
        let metadata = fs::metadata(path).map_err(Error::io("find", path))?;
        if metadata.is_dir() {
            collect(path, &mut logs)?;
        } else {
            logs.push(path.clone());
        }
    }
    logs.sort();
    logs.dedup();
    if logs.is_empty() {
        return Err(Error::Config {
            key: "LOG".into(),
            what: "no .mcap file in the folders given".into(),
            hint: Some("give MCAP files, or folders that hold some".into()),
        });
    }
    Ok(logs)
}

fn collect(folder: &Path, logs: &mut Vec<PathBuf>) -> Result<()> {
    for entry in fs::read_dir(folder).map_err(Error::io("read", folder))? {
        let path = entry.map_err(Error::io("read", folder))?.path();
        if path.is_dir() {
            collect(&path, logs)?;
        } else if path.extension().is_some_and(|extension| extension == "mcap") {
            logs.push(path);
        }
    }
    Ok(())
}

/// Ingest logs into a dataset, on as many threads as the current rayon pool has.
///
/// A log that fails does not stop the others; it is named in the manifest.
///
/// # Errors
///
/// If the output folder is something else or another dataset, if the disk refuses, or if every
/// log fails (then with the first one's error).
pub fn ingest(
    logs: &[PathBuf],
    out: &Path,
    config: &IngestConfig,
    on: &(dyn Fn(Event) + Sync),
) -> Result<Manifest> {
    let finished = prepare(out, config)?;
    let hashes: Vec<Result<String>> = logs.par_iter().map(|log| sha256_of_file(log)).collect();
    let mut jobs: Vec<Source> = Vec::new();
    let mut failed = Vec::new();
    let mut first_error = None;
    let mut fail = |log: &Path, error: Error| {
        // The manifest is the same on any machine, wherever its logs lie.
        let text = error.to_string().replace(&*log.to_string_lossy(), &file_name(log));
        failed.push(FailedLog { source_log: file_name(log), error: text });
        first_error.get_or_insert(error);
    };
    let mut seen: BTreeMap<String, &PathBuf> = BTreeMap::new();
    for (log, hash) in logs.iter().zip(hashes) {
        match hash {
            Err(error) => fail(log, error),
            Ok(sha256) => match seen.get(&sha256) {
                Some(other) => {
                    let what = format!("the same bytes as {}", file_name(other));
                    let (path, hint) = (log.clone(), Some("name each log once".to_string()));
                    fail(log, Error::Log { path, offset: 0, what, hint });
                }
                None => {
                    seen.insert(sha256.clone(), log);
                    jobs.push(Source::new(log.clone(), sha256));
                }
            },
        }
    }
    if let Some(finished) = finished {
        return same_logs(finished, &jobs, out);
    }

    // Either the logs keep all threads busy or the blocks of one log do, never both: a thread
    // that waits for its blocks would start another log and hold both in memory.
    let by_log = jobs.len() >= rayon::current_num_threads();
    let records: Vec<Result<LogRecord>> = if by_log {
        jobs.par_iter().map(|job| job.ingest(out, config, 1, on)).collect()
    } else {
        let blocks = 2 * rayon::current_num_threads();
        jobs.iter().map(|job| job.ingest(out, config, blocks, on)).collect()
    };
    let mut committed = Vec::new();
    for (job, record) in jobs.iter().zip(records) {
        match record {
            Ok(record) => committed.push(record),
            // The disk is the same for all logs: what it refuses once is no matter of one log.
            Err(error @ Error::Io { .. }) if fs::metadata(&job.path).is_ok() => return Err(error),
            Err(error) => {
                job.discard(out, &job.episode)?;
                fail(&job.path, error);
            }
        }
    }
    if committed.is_empty() {
        // Nothing that looks like a dataset stays behind.
        clean_up(out)?;
        let nothing = || Error::Config { key: "LOG".into(), what: "no log".into(), hint: None };
        return Err(first_error.unwrap_or_else(nothing));
    }
    let manifest = Manifest::new(config.clone(), committed, failed);
    write_episodes(&out.join("episodes.parquet"), &manifest.logs)?;
    atomic::write_json(&Manifest::path(out), &manifest)?;
    Ok(manifest)
}

impl Source {
    /// Commit the log, or find that it is committed.
    fn ingest(
        &self,
        out: &Path,
        config: &IngestConfig,
        blocks_at_once: usize,
        on: &(dyn Fn(Event) + Sync),
    ) -> Result<LogRecord> {
        let record_path = out.join("logs").join(format!("{}.json", self.episode));
        if record_path.exists() {
            let record: LogRecord = atomic::read_json(&record_path)?;
            // The same bytes under another name have another record.
            let is_own = record.source_log == file_name(&self.path);
            if is_own && record.shards.iter().all(|shard| is_whole(out, shard)) {
                return Ok(record);
            }
        }
        let mut parts = Parts::default();
        for recording in Recording::scan(&self.path, &config.profile.clock)? {
            parts.scanned(&recording);
            let lost = account::without_frames(&recording);
            let id = parts.next_id(self);
            let write = || {
                let drive = Drive::new(recording, &config.profile, config.rate_hz)?;
                on(Event::Opened { ticks: drive.grid.ticks.len() as u64 });
                let on = |ticks| on(Event::Made { ticks });
                Episode::write(&drive, &id, self.split, out, blocks_at_once, &on)
            };
            match write() {
                Ok(episode) => parts.made(episode),
                Err(error @ Error::Io { .. }) => return Err(error),
                Err(error) => {
                    self.discard(out, &id)?;
                    parts.failed(error, lost);
                }
            }
        }
        let record = parts.record(self)?;
        atomic::write_json(&record_path, &record)?;
        Ok(record)
    }

    /// Remove what was written of an episode that failed, or of a log by the id of its first:
    /// readers of the folder find committed frames only.
    fn discard(&self, out: &Path, id: &str) -> Result<()> {
        let folder = out.join("frames").join(format!("split={}", self.split.name()));
        let Ok(entries) = fs::read_dir(&folder) else { return Ok(()) };
        for entry in entries {
            let path = entry.map_err(Error::io("read", &folder))?.path();
            if file_name(&path).starts_with(&format!("{id}-")) {
                fs::remove_file(&path).map_err(Error::io("remove", &path))?;
            }
        }
        Ok(())
    }
}

/// Make the output folder ready; the manifest, if the dataset is finished already.
fn prepare(out: &Path, config: &IngestConfig) -> Result<Option<Manifest>> {
    let marker = out.join("ingest.json");
    let fail = |what: &str, hint: &str| {
        let (path, what, hint) = (out.to_path_buf(), what.to_string(), Some(hint.to_string()));
        Err(Error::Dataset { path, what, hint })
    };
    if marker.exists() {
        let found: IngestConfig = atomic::read_json(&marker)?;
        if found != *config {
            return fail(
                "a dataset made with another configuration",
                "choose another --out: a dataset is never changed",
            );
        }
        if Manifest::path(out).exists() {
            return Manifest::read(out).map(Some);
        }
        remove_unfinished(out)?;
        return Ok(None);
    }
    let is_empty = match fs::read_dir(out) {
        Ok(mut entries) => entries.next().is_none(),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => true,
        Err(error) => return Err(Error::io("read", out)(error)),
    };
    if !is_empty {
        return fail("a folder that is not empty and no dataset", "choose another --out");
    }
    atomic::write_json(&marker, config)?;
    Ok(None)
}

/// A finished dataset is answered with itself, if it was made from these logs.
fn same_logs(finished: Manifest, jobs: &[Source], out: &Path) -> Result<Manifest> {
    let has: Vec<&str> = finished.logs.iter().map(|log| log.episode.as_str()).collect();
    let failed: Vec<&str> = finished.failed.iter().map(|log| log.source_log.as_str()).collect();
    let new = jobs.iter().find(|job| {
        !has.contains(&job.episode.as_str()) && !failed.contains(&file_name(&job.path).as_str())
    });
    if let Some(job) = new {
        let what = format!("a finished dataset, without {}", job.path.display());
        let hint = Some("choose another --out: a dataset is never changed".to_string());
        return Err(Error::Dataset { path: out.to_path_buf(), what, hint });
    }
    if let Some(shard) =
        finished.logs.iter().flat_map(|log| &log.shards).find(|shard| !is_whole(out, shard))
    {
        let what = format!("a dataset whose shard {} is missing or damaged", shard.path);
        let hint = Some("remove the dataset and ingest the logs again".to_string());
        return Err(Error::Dataset { path: out.to_path_buf(), what, hint });
    }
    Ok(finished)
}

fn is_whole(out: &Path, shard: &ShardRecord) -> bool {
    let path = out.join(&shard.path);
    fs::metadata(&path).is_ok_and(|metadata| metadata.len() == shard.bytes)
        && sha256_of_file(&path).is_ok_and(|sha256| sha256 == shard.sha256)
}

/// What a killed process was writing.
fn remove_unfinished(folder: &Path) -> Result<()> {
    for entry in fs::read_dir(folder).map_err(Error::io("read", folder))? {
        let path = entry.map_err(Error::io("read", folder))?.path();
        if path.is_dir() {
            remove_unfinished(&path)?;
        } else if path.extension().is_some_and(|extension| extension == UNFINISHED) {
            fs::remove_file(&path).map_err(Error::io("remove", &path))?;
        }
    }
    Ok(())
}

/// Undo [`prepare`] where nothing came of any log.
fn clean_up(out: &Path) -> Result<()> {
    remove_unfinished(out)?;
    let marker = out.join("ingest.json");
    fs::remove_file(&marker).map_err(Error::io("remove", &marker))?;
    for folder in ["frames/split=train", "frames/split=val", "frames", "logs", ""] {
        // Only empty folders go; what somebody else put there stays.
        let _ = fs::remove_dir(out.join(folder));
    }
    Ok(())
}
