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
    atomic::{self, UNFINISHED, sha256_of_file},
    dataset::{
        align::Tick,
        compaction::{compact, remove_leftovers},
        drive::Drive,
        manifest::{FailedLog, IngestConfig, LogRecord, Manifest, write_episodes},
        shard::{ROWS_PER_GROUP, ROWS_PER_SHARD, ShardRecord, ShardWriter},
        split::Split,
    },
    drops::Drops,
    error::{Error, Result},
    frame::{FUTURE_STEPS, Frame},
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
            Ok(sha256) => match seen.get(&sha256) {
                Some(other) => {
                    let what = format!("the same bytes as {}", file_name(other));
                    let (path, hint) = (log.clone(), Some("name each log once".to_string()));
                    fail(log, Error::Log { path, offset: 0, what, hint });
                }
                None => {
                    seen.insert(sha256.clone(), log);
                    jobs.push(Job { log: log.clone(), episode: episode_id(&sha256), sha256 });
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
        jobs.par_iter().map(|job| job.run(out, config, 1, on)).collect()
    } else {
        let blocks = 2 * rayon::current_num_threads();
        jobs.iter().map(|job| job.run(out, config, blocks, on)).collect()
    };
    let mut committed = Vec::new();
    for (job, record) in jobs.iter().zip(records) {
        match record {
            Ok(record) => committed.push(record),
            // The disk is the same for all logs: what it refuses once is no matter of one log.
            Err(error @ Error::Io { .. }) if fs::metadata(&job.log).is_ok() => return Err(error),
            Err(error) => {
                job.discard(out)?;
                fail(&job.log, error);
            }
        }
    }
    if committed.is_empty() {
        // Nothing that looks like a dataset stays behind.
        clean_up(out)?;
        let nothing = || Error::Config { key: "LOG".into(), what: "no log".into(), hint: None };
        return Err(first_error.unwrap_or_else(nothing));
    }
    compact(out, &mut committed)?;
    let manifest = Manifest::new(config.clone(), committed, failed);
    write_episodes(&out.join("episodes.parquet"), &manifest.logs)?;
    atomic::write_json(&Manifest::path(out), &manifest)?;
    remove_leftovers(out, &manifest.logs)?;
    Ok(manifest)
}

/// A log to ingest.
struct Job {
    log: PathBuf,
    episode: String,
    sha256: String,
}

impl Job {
    /// Commit the log, or find that it is committed.
    fn run(
        &self,
        out: &Path,
        config: &IngestConfig,
        blocks_at_once: usize,
        on: &(dyn Fn(Event) + Sync),
    ) -> Result<LogRecord> {
        let record_path = out.join("logs").join(format!("{}.json", self.episode));
        if record_path.exists() {
            let record: LogRecord = atomic::read_json(&record_path)?;
            if record.shards.iter().all(|shard| is_whole(out, shard)) {
                return Ok(record);
            }
        }
        let drive = Drive::open(&self.log, &config.profile, config.rate_hz)?;
        on(Event::Opened { ticks: drive.grid.ticks.len() as u64 });
        let made = self.write_shards(&drive, out, blocks_at_once, on)?;
        if made.frames == 0 {
            let what = format!("no frame: {} ticks were left out", made.drops.total());
            let reasons: Vec<_> =
                made.drops.iter().map(|(r, d)| format!("{} {}", d.count, r.name())).collect();
            let hint = format!("by reason: {}", reasons.join(", "));
            return Err(Error::Mapping { path: self.log.clone(), what, hint });
        }
        let recording = &drive.recording;
        let mut undecodable = made.damaged;
        for topic in recording.topics.values().filter(|topic| topic.undecodable.0 > 0) {
            let (count, why) = topic.undecodable.clone();
            let entry = undecodable.entry(topic.name.clone()).or_default();
            *entry = (entry.0 + count, why.unwrap_or_default());
        }
        let out_of_order = recording.topics.values().filter(|topic| topic.out_of_order > 0);
        let record = LogRecord {
            episode: self.episode.clone(),
            split: Split::of(&self.episode),
            source_log: file_name(&self.log),
            source_bytes: recording.log.size_bytes,
            source_sha256: self.sha256.clone(),
            messages: recording.log.message_count(),
            conditions: drive.conditions.clone(),
            mapping: drive.mapping.clone(),
            calibration: drive.calibration(),
            frames: made.frames,
            frames_with_full_future: made.frames_with_full_future,
            start_ns: drive.grid.start_ns,
            duration_s: made.span_ns.map_or(0.0, |(first, last)| (last - first) as f64 * 1e-9),
            distance_m: drive.distance_m(),
            drops: made.drops,
            damage: recording.log.damage.clone(),
            undecodable,
            out_of_order: out_of_order.map(|t| (t.name.clone(), t.out_of_order)).collect(),
            left_out: drive.left_out.clone(),
            notes: drive.notes.clone(),
            shards: made.shards,
        };
        atomic::write_json(&record_path, &record)?;
        Ok(record)
    }

    /// Remove what a failed log had written: readers of the folder find committed frames only.
    fn discard(&self, out: &Path) -> Result<()> {
        let split = Split::of(&self.episode).name();
        let folder = out.join("frames").join(format!("split={split}"));
        let Ok(entries) = fs::read_dir(&folder) else { return Ok(()) };
        for entry in entries {
            let path = entry.map_err(Error::io("read", &folder))?.path();
            if file_name(&path).starts_with(&format!("{}-", self.episode)) {
                fs::remove_file(&path).map_err(Error::io("remove", &path))?;
            }
        }
        Ok(())
    }

    fn write_shards(
        &self,
        drive: &Drive,
        out: &Path,
        blocks_at_once: usize,
        on: &(dyn Fn(Event) + Sync),
    ) -> Result<MadeFrames> {
        let split = Split::of(&self.episode).name();
        let mut made = MadeFrames { drops: drive.grid.drops.clone(), ..MadeFrames::default() };
        for ticks in drive.grid.ticks.chunks(ROWS_PER_SHARD) {
            let shard = made.shards.len();
            let path = format!("frames/split={split}/{}-{shard:05}.parquet", self.episode);
            let mut writer = ShardWriter::create(&out.join(&path))?;
            let blocks: Vec<&[Tick]> = ticks.chunks(ROWS_PER_GROUP).collect();
            for wave in blocks.chunks(blocks_at_once) {
                let outcomes: Vec<_> = match wave {
                    [block] => vec![drive.frames(block)],
                    wave => wave.par_iter().map(|block| drive.frames(block)).collect(),
                };
                for outcome in outcomes {
                    let outcome = outcome?;
                    on(Event::Made { ticks: outcome.len() as u64 });
                    let mut frames = Vec::with_capacity(outcome.len());
                    for tick in outcome {
                        made.note_damage(tick.damaged);
                        match tick.frame {
                            Ok(frame) => frames.push(*frame),
                            Err((reason, at_ns, why)) => made.drops.add(reason, at_ns, Some(why)),
                        }
                    }
                    if !frames.is_empty() {
                        made.note_frames(&frames);
                        writer.write(&self.episode, &frames)?;
                    }
                }
            }
            let rows = writer.rows() as u64;
            let committed = writer.finish()?;
            let (bytes, sha256) = (committed.bytes, committed.sha256);
            made.shards.push(ShardRecord { path, rows, bytes, sha256, groups: None });
        }
        Ok(made)
    }
}

/// What came of the ticks of a log.
#[derive(Default)]
struct MadeFrames {
    frames: u64,
    frames_with_full_future: u64,
    span_ns: Option<(i64, i64)>,
    drops: Drops,
    damaged: BTreeMap<String, (u64, String)>,
    shards: Vec<ShardRecord>,
}

impl MadeFrames {
    fn note_frames(&mut self, frames: &[Frame]) {
        let full = frames.iter().filter(|frame| usize::from(frame.future.len) == FUTURE_STEPS);
        self.frames += frames.len() as u64;
        self.frames_with_full_future += full.count() as u64;
        if let (Some(first), Some(last)) = (frames.first(), frames.last()) {
            let from = self.span_ns.map_or(first.stamp_ns, |(from, _)| from);
            self.span_ns = Some((from, last.stamp_ns));
        }
    }

    fn note_damage(&mut self, damaged: Vec<(String, String)>) {
        for (topic, why) in damaged {
            self.damaged.entry(topic).or_insert((0, why)).0 += 1;
        }
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
fn same_logs(finished: Manifest, jobs: &[Job], out: &Path) -> Result<Manifest> {
    let has: Vec<&str> = finished.logs.iter().map(|log| log.episode.as_str()).collect();
    let failed: Vec<&str> = finished.failed.iter().map(|log| log.source_log.as_str()).collect();
    let new = jobs.iter().find(|job| {
        !has.contains(&job.episode.as_str()) && !failed.contains(&file_name(&job.log).as_str())
    });
    if let Some(job) = new {
        let what = format!("a finished dataset, without {}", job.log.display());
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

/// The same for the same bytes on any machine.
fn episode_id(sha256: &str) -> String {
    format!("ep-{}", &sha256[..16])
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}
