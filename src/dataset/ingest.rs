//! Logs in, dataset out: the job behind `pmp-ingest`.
//!
//! ```text
//! DATASET/ingest.json                     the configuration, written first
//! DATASET/frames/split=*/EPISODE-*.parquet   the shards of a log ...
//! DATASET/logs/EPISODE.json               ... and then its record: the log is committed
//! DATASET/episodes.parquet, README.md, manifest.json   put together from the records, last
//! ```
//!
//! Killed at any moment and started again, it skips the logs that are committed and makes the
//! others anew; every file's bytes are a function of the log and the configuration alone.

use std::{
    cell::Cell,
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use rayon::prelude::*;

use crate::{
    atomic::{self, file_name, sha256_of_file},
    dataset::{
        account,
        ahead::Ahead,
        card::write_card,
        claim::Claim,
        compaction::{compact, remove_leftovers},
        drive::Drive,
        episode::Episode,
        episodes::write_episodes,
        ingest_event::{Event, Step},
        logs::{GivenLog, LocalLog},
        manifest::{IngestConfig, LogRecord, Manifest},
        plan::{Job, Plan, Share},
        record::{Parts, Source},
        shard::ShardRecord,
        stock::Stock,
    },
    error::{Error, Result},
    log::{recording::Recording, scan::Scanned},
};

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
    logs: &[GivenLog],
    out: &Path,
    config: &IngestConfig,
    share: Option<Share>,
    on: &(dyn Fn(Event) + Sync),
) -> Result<Manifest> {
    let claim = Claim::new(out, config, share.is_some())?;
    let logs = share.map_or_else(|| logs.to_vec(), |share| share.of(logs));
    on(Event::Begun { logs: &logs });
    let mut plan = Plan::new(&logs, out, on)?;
    if Manifest::path(out).exists() {
        let finished = Manifest::read(out)?;
        check_logs(&finished, &plan, out)?;
        check_shards(&finished, out, &|shard| is_whole(out, shard))?;
        // A process that was killed after it had written the manifest may have left some.
        remove_leftovers(out, &finished.logs)?;
        plan.tell_done(on);
        return Ok(finished);
    }

    // Either the logs keep all threads busy or the blocks of one log do, never both: a thread
    // that waits for its blocks would start another log and hold both in memory.
    let by_log = plan.jobs.len() >= rayon::current_num_threads();
    let blocks = if by_log { 1 } else { 2 * rayon::current_num_threads() };
    let commit = |job: &Job| {
        let record = job.commit(&claim, config, blocks, &|step| {
            on(Event::OfLog { number: job.number, step });
        });
        match record {
            // The disk and the network are the same for all logs: what they refuse once is no
            // matter of one log.
            Err(error @ Error::Io { .. }) if job.log.is_there() => Err(error),
            Err(error @ Error::Remote { .. }) => Err(error),
            record => Ok(record),
        }
    };
    let jobs = std::mem::take(&mut plan.jobs);
    let records: Vec<Result<LogRecord>> = if by_log {
        jobs.par_iter().map(commit).collect::<Result<_>>()?
    } else {
        jobs.iter().map(commit).collect::<Result<_>>()?
    };
    let mut committed = Vec::new();
    for (job, record) in jobs.iter().zip(records) {
        match record {
            Ok(record) => committed.push(record),
            Err(error) => plan.fail(&job.log, error),
        }
    }
    let has_nothing_to_do = jobs.is_empty() && plan.failed.is_empty() && share.is_some();
    if committed.is_empty() && !has_nothing_to_do {
        claim.abandon()?;
        let nothing = || Error::Config { key: "LOG".into(), what: "no log".into(), hint: None };
        return Err(plan.first_error.unwrap_or_else(nothing));
    }
    if share.is_some() {
        return Ok(Manifest::new(config.clone(), committed, plan.failed));
    }
    compact(out, &mut committed)?;
    let manifest = Manifest::new(config.clone(), committed, plan.failed);
    write_episodes(&out.join("episodes.parquet"), &manifest.logs)?;
    write_card(out, &manifest)?;
    atomic::write_json(&Manifest::path(out), &manifest)?;
    remove_leftovers(out, &manifest.logs)?;
    Ok(manifest)
}

impl Job {
    /// Commit the log, or find that it is committed.
    fn commit(
        &self,
        claim: &Claim,
        config: &IngestConfig,
        blocks_at_once: usize,
        on: &(dyn Fn(Step) + Sync),
    ) -> Result<LogRecord> {
        on(Step::Started);
        let record = self.commit_telling(claim, config, blocks_at_once, on);
        on(Step::Ended);
        record
    }

    fn commit_telling(
        &self,
        claim: &Claim,
        config: &IngestConfig,
        blocks_at_once: usize,
        on: &(dyn Fn(Step) + Sync),
    ) -> Result<LogRecord> {
        let mut local = None;
        let mut sha256 = self.sha256.clone();
        // Another share may be given the same bytes under another name.
        if claim.is_share && sha256.is_none() {
            let fetched = self.fetch(on)?;
            on(Step::Hashing);
            sha256 = Some(sha256_of_file(fetched.path())?);
            on(Step::Hashed);
            local = Some(fetched);
        }
        let known = sha256.map(|sha256| Source::new(self.log.path.clone(), sha256));
        let held = known.as_ref().map(|source| claim.hold(&source.episode)).transpose()?;
        let committed = known.as_ref().map(|source| source.committed(claim)).transpose()?;
        let record = match committed.flatten() {
            Some(record) => Ok(record),
            None => local.map_or_else(|| self.fetch(on), Ok).and_then(|local| {
                ingest_file(&local, claim, config, blocks_at_once, on)
                    .map_err(|error| local.own(error))
            }),
        };
        held.map_or(Ok(()), |held| held.release())?;
        if let Ok(record) = &record {
            self.log.remember(&record.source_sha256)?;
        }
        record
    }

    fn fetch(&self, on: &(dyn Fn(Step) + Sync)) -> Result<LocalLog> {
        let copied = Cell::new(0);
        self.log.fetch(&|bytes| {
            copied.set(copied.get() + bytes);
            on(Step::Copied { bytes: copied.get() });
        })
    }
}

/// Make the frames of a file, and its record.
fn ingest_file(
    local: &LocalLog,
    claim: &Claim,
    config: &IngestConfig,
    blocks_at_once: usize,
    on: &(dyn Fn(Step) + Sync),
) -> Result<LogRecord> {
    let on_bytes = |bytes| on(Step::Read { bytes });
    // Enough for all threads, where they are not at work on other logs.
    let at_once = if blocks_at_once == 1 { 1 } else { 4 * blocks_at_once };
    let mut ahead = Ahead::new(&config.profile, config.rate_hz, &claim.out, at_once)?;
    let mut on_chunk = |scanned: &Scanned, chunk, data: &[u8]| ahead.chunk(scanned, chunk, data);
    let clock = &config.profile.clock;
    let recordings = Recording::scan_followed(local.path(), clock, &on_bytes, &mut on_chunk)?;
    let stock = Arc::new(ahead.finish()?);
    let source = Source::new(local.path().to_path_buf(), recordings[0].log.sha256.clone());
    source.ingest(recordings, &stock, claim, config, blocks_at_once, on)
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
        stock: &Arc<Stock>,
        claim: &Claim,
        config: &IngestConfig,
        blocks_at_once: usize,
        on: &(dyn Fn(Step) + Sync),
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
                let mut drive = Drive::new(recording, &config.profile, config.rate_hz)?;
                drive.stock = stock.clone();
                on(Step::Opened { ticks: drive.grid.ticks.len() as u64 });
                let on = |ticks, frames| on(Step::Made { ticks, frames });
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

/// That a finished dataset, which lies at `place`, was made from these logs.
///
/// # Errors
///
/// [`Error::Dataset`] if one of them is not in it.
pub fn check_logs(finished: &Manifest, plan: &Plan, place: &Path) -> Result<()> {
    let has: Vec<&str> = finished.logs.iter().map(|log| log.source_sha256.as_str()).collect();
    let failed: Vec<&str> = finished.failed.iter().map(|log| log.source_log.as_str()).collect();
    let new = plan.jobs.iter().find(|job| {
        let is_in = job.sha256.as_ref().is_some_and(|sha256| has.contains(&sha256.as_str()));
        !is_in && !failed.contains(&job.log.name().as_str())
    });
    let Some(job) = new else { return Ok(()) };
    let what = format!("a finished dataset, without {}", job.log.path.display());
    let hint = Some("choose another --out: a dataset is never changed".to_string());
    Err(Error::Dataset { path: place.to_path_buf(), what, hint })
}

/// That a finished dataset, which lies at `place`, has all its shards.
///
/// # Errors
///
/// [`Error::Dataset`] if one of them is not whole.
pub fn check_shards(
    finished: &Manifest,
    place: &Path,
    is_whole: &dyn Fn(&ShardRecord) -> bool,
) -> Result<()> {
    let mut shards = finished.logs.iter().flat_map(|log| &log.shards);
    let Some(shard) = shards.find(|shard| !is_whole(shard)) else { return Ok(()) };
    let what = format!("a dataset whose shard {} is missing or damaged", shard.path);
    let hint = Some("remove the dataset and ingest the logs again".to_string());
    Err(Error::Dataset { path: place.to_path_buf(), what, hint })
}

fn is_whole(out: &Path, shard: &ShardRecord) -> bool {
    let path = out.join(&shard.path);
    fs::metadata(&path).is_ok_and(|metadata| metadata.len() == shard.bytes)
        && sha256_of_file(&path).is_ok_and(|sha256| sha256 == shard.sha256)
}
