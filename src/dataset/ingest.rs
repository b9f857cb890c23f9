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
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
};

use rayon::prelude::*;

use crate::{
    atomic::{self, file_name, sha256_of_file},
    dataset::{
        account,
        claim::Claim,
        compaction::{compact, remove_leftovers},
        drive::Drive,
        episode::Episode,
        episodes::write_episodes,
        manifest::{FailedLog, IngestConfig, LogRecord, Manifest},
        record::{Parts, Source},
        shard::ShardRecord,
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
/// A log that fails does not stop the others; it is named in the manifest. A `share` commits its
/// logs and writes no manifest: that is left to a run without share, which finds them committed.
///
/// # Errors
///
/// If the output folder is something else or another dataset, if another process is at work there,
/// if the disk refuses, or if every log fails (then with the first one's error).
pub fn ingest(
    logs: &[PathBuf],
    out: &Path,
    config: &IngestConfig,
    share: Option<Share>,
    on: &(dyn Fn(Event) + Sync),
) -> Result<Manifest> {
    let claim = Claim::new(out, config, share.is_some())?;
    let logs: Vec<PathBuf> = match share {
        Some(share) => share.of(logs),
        None => logs.to_vec(),
    };
    let hashes: Vec<Result<Option<String>>> = match share.is_some() || Manifest::path(out).exists()
    {
        true => logs.par_iter().map(|log| sha256_of_file(log).map(Some)).collect(),
        false => {
            let ambiguous = sizes_that_may_be_known(&logs, out)?;
            let hash = |log: &PathBuf| {
                let bytes = fs::metadata(log).map_err(Error::io("find", log))?.len();
                let is_needed = ambiguous.contains(&bytes);
                is_needed.then(|| sha256_of_file(log)).transpose()
            };
            logs.par_iter().map(hash).collect()
        }
    };
    let mut jobs: Vec<Job> = Vec::new();
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
            Ok(None) => jobs.push(Job { path: log.clone(), source: None }),
            Ok(Some(sha256)) => match seen.get(&sha256) {
                Some(other) => {
                    let what = format!("the same bytes as {}", file_name(other));
                    let (path, hint) = (log.clone(), Some("name each log once".to_string()));
                    fail(log, Error::Log { path, offset: 0, what, hint });
                }
                None => {
                    seen.insert(sha256.clone(), log);
                    let source = Some(Source::new(log.clone(), sha256));
                    jobs.push(Job { path: log.clone(), source });
                }
            },
        }
    }
    if Manifest::path(out).exists() {
        return same_logs(Manifest::read(out)?, &jobs, out);
    }

    // Either the logs keep all threads busy or the blocks of one log do, never both: a thread
    // that waits for its blocks would start another log and hold both in memory.
    let by_log = jobs.len() >= rayon::current_num_threads();
    let records: Vec<Result<LogRecord>> = if by_log {
        jobs.par_iter().map(|job| job.commit(&claim, config, 1, on)).collect()
    } else {
        let blocks = 2 * rayon::current_num_threads();
        jobs.iter().map(|job| job.commit(&claim, config, blocks, on)).collect()
    };
    let mut committed = Vec::new();
    for (job, record) in jobs.iter().zip(records) {
        match record {
            Ok(record) => committed.push(record),
            // The disk is the same for all logs: what it refuses once is no matter of one log.
            Err(error @ Error::Io { .. }) if fs::metadata(&job.path).is_ok() => return Err(error),
            Err(error) => fail(&job.path, error),
        }
    }
    let has_nothing_to_do = jobs.is_empty() && failed.is_empty() && share.is_some();
    if committed.is_empty() && !has_nothing_to_do {
        claim.abandon()?;
        let nothing = || Error::Config { key: "LOG".into(), what: "no log".into(), hint: None };
        return Err(first_error.unwrap_or_else(nothing));
    }
    if share.is_some() {
        return Ok(Manifest::new(config.clone(), committed, failed));
    }
    compact(out, &mut committed)?;
    let manifest = Manifest::new(config.clone(), committed, failed);
    write_episodes(&out.join("episodes.parquet"), &manifest.logs)?;
    atomic::write_json(&Manifest::path(out), &manifest)?;
    remove_leftovers(out, &manifest.logs)?;
    Ok(manifest)
}

/// One of several parts of the work, for a process of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Share {
    /// From 1.
    pub number: usize,
    pub of: usize,
}

impl Share {
    /// `i/n`, as the flag `--shard` has it.
    ///
    /// # Errors
    ///
    /// A sentence that says what is wrong.
    pub fn parse(text: &str) -> Result<Share, String> {
        let numbers = text.split_once('/');
        let numbers = numbers.and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match numbers {
            Some((number, of)) if (1..=of).contains(&number) => Ok(Share { number, of }),
            _ => Err("it is i/n with 1 <= i <= n, as in 2/8".to_string()),
        }
    }

    /// Its logs, by their place in the list of all: every process is given the same list.
    fn of(self, logs: &[PathBuf]) -> Vec<PathBuf> {
        logs.iter().skip(self.number - 1).step_by(self.of).cloned().collect()
    }
}

/// Sizes of logs whose bytes have to be told apart before they are read: of those that are
/// committed, and of those that are given twice. All others are hashed while they are read.
fn sizes_that_may_be_known(logs: &[PathBuf], out: &Path) -> Result<BTreeSet<u64>> {
    let (mut seen, mut twice) = (BTreeSet::new(), BTreeSet::new());
    for log in logs {
        let bytes = fs::metadata(log).map_or(0, |metadata| metadata.len());
        if !seen.insert(bytes) {
            twice.insert(bytes);
        }
    }
    let records = out.join("logs");
    let Ok(entries) = fs::read_dir(&records) else { return Ok(twice) };
    for entry in entries {
        let path = entry.map_err(Error::io("read", &records))?.path();
        if path.extension().is_some_and(|extension| extension == "json") {
            let record: LogRecord = atomic::read_json(&path)?;
            twice.insert(record.source_bytes);
        }
    }
    Ok(twice)
}

/// A log to commit; its bytes may be known only when it has been read.
struct Job {
    path: PathBuf,
    source: Option<Source>,
}

impl Job {
    /// Commit the log, or find that it is committed.
    fn commit(
        &self,
        claim: &Claim,
        config: &IngestConfig,
        blocks_at_once: usize,
        on: &(dyn Fn(Event) + Sync),
    ) -> Result<LogRecord> {
        let scan = || Recording::scan(&self.path, &config.profile.clock);
        match &self.source {
            Some(source) => {
                let held = claim.hold(&source.episode)?;
                let record = match source.committed(claim)? {
                    Some(record) => Ok(record),
                    None => scan().and_then(|recordings| {
                        source.ingest(recordings, claim, config, blocks_at_once, on)
                    }),
                };
                held.release()?;
                record
            }
            None => {
                let recordings = scan()?;
                let source = Source::new(self.path.clone(), recordings[0].log.sha256.clone());
                source.ingest(recordings, claim, config, blocks_at_once, on)
            }
        }
    }
}

impl Source {
    fn record_path(&self, out: &Path) -> PathBuf {
        out.join("logs").join(format!("{}.json", self.episode))
    }

    /// The record of the log, if it is committed.
    fn committed(&self, claim: &Claim) -> Result<Option<LogRecord>> {
        let out = &claim.out;
        let record_path = self.record_path(out);
        if record_path.exists() {
            let record: LogRecord = atomic::read_json(&record_path)?;
            // The same bytes under another name have another record; which one stays is for the
            // process to say that sees all names.
            let is_own = claim.is_share || record.source_log == file_name(&self.path);
            if is_own && record.shards.iter().all(|shard| is_whole(out, shard)) {
                return Ok(Some(record));
            }
        }
        Ok(None)
    }

    /// Make the frames of all parts of the log, and its record.
    fn ingest(
        &self,
        recordings: Vec<Recording>,
        claim: &Claim,
        config: &IngestConfig,
        blocks_at_once: usize,
        on: &(dyn Fn(Event) + Sync),
    ) -> Result<LogRecord> {
        let out = &claim.out;
        // What an attempt that was killed has left.
        self.discard(out, &self.episode)?;
        let mut parts = Parts::default();
        for recording in recordings {
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
        atomic::write_json(&self.record_path(out), &record)?;
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

/// A finished dataset is answered with itself, if it was made from these logs.
fn same_logs(finished: Manifest, jobs: &[Job], out: &Path) -> Result<Manifest> {
    let has: Vec<&str> = finished.logs.iter().map(|log| log.episode.as_str()).collect();
    let failed: Vec<&str> = finished.failed.iter().map(|log| log.source_log.as_str()).collect();
    let new = jobs.iter().find(|job| {
        let episode = job.source.as_ref().map(|source| source.episode.as_str());
        let is_in = episode.is_some_and(|episode| has.contains(&episode));
        !is_in && !failed.contains(&file_name(&job.path).as_str())
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
    // A process that was killed after it had written the manifest may have left some.
    remove_leftovers(out, &finished.logs)?;
    Ok(finished)
}

fn is_whole(out: &Path, shard: &ShardRecord) -> bool {
    let path = out.join(&shard.path);
    fs::metadata(&path).is_ok_and(|metadata| metadata.len() == shard.bytes)
        && sha256_of_file(&path).is_ok_and(|sha256| sha256 == shard.sha256)
}
