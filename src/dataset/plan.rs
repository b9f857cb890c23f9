//! Which of the given logs are the work of this process, told apart by their bytes.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
};

use rayon::prelude::*;

use crate::{
    atomic,
    dataset::{
        ingest_event::{Event, Step},
        logs::GivenLog,
        manifest::{FailedLog, LogRecord, Manifest},
    },
    error::{Error, Result},
};

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
    pub fn of(self, logs: &[GivenLog]) -> Vec<GivenLog> {
        logs.iter().skip(self.number - 1).step_by(self.of).cloned().collect()
    }
}

/// A log to commit; its bytes may be known only when it has been read.
pub struct Job {
    /// Its place in the list of logs, for those who watch.
    pub number: usize,
    pub log: GivenLog,
    pub sha256: Option<String>,
}

/// The work, and what failed already.
#[derive(Default)]
pub struct Plan {
    pub jobs: Vec<Job>,
    pub failed: Vec<FailedLog>,
    pub first_error: Option<Error>,
}

impl Plan {
    /// Hash the logs that could be known, and leave out those that are given twice.
    ///
    /// # Errors
    ///
    /// If the records of committed logs cannot be read, or a store refuses.
    pub fn new(logs: &[GivenLog], out: &Path, on: &(dyn Fn(Event) + Sync)) -> Result<Plan> {
        let is_finished = Manifest::path(out).exists();
        let ambiguous = sizes_that_may_be_known(logs, out)?;
        Plan::hashing(logs, &|log| is_finished || ambiguous.contains(&log.bytes), on)
    }

    /// As [`Plan::new`]; these logs have to be told apart before they are read.
    ///
    /// # Errors
    ///
    /// If a store refuses.
    pub fn hashing(
        logs: &[GivenLog],
        is_needed: &(dyn Fn(&GivenLog) -> bool + Sync),
        on: &(dyn Fn(Event) + Sync),
    ) -> Result<Plan> {
        let hash = |(number, log): (usize, &GivenLog)| {
            if !is_needed(log) {
                return Ok(Ok(None));
            }
            on(Event::OfLog { number, step: Step::Hashing });
            let hash = log.sha256();
            on(Event::OfLog { number, step: Step::Hashed });
            match hash {
                Err(error @ Error::Remote { .. }) => Err(error),
                hash => Ok(hash.map(Some)),
            }
        };
        let hashes: Vec<Result<Option<String>>> =
            logs.par_iter().enumerate().map(hash).collect::<Result<_>>()?;
        let mut plan = Plan::default();
        let mut seen: BTreeMap<String, &GivenLog> = BTreeMap::new();
        for (number, (log, hash)) in logs.iter().zip(hashes).enumerate() {
            let error = match hash {
                Err(error) => error,
                Ok(sha256) => match sha256.as_ref().and_then(|sha256| seen.get(sha256)) {
                    Some(other) => {
                        let what = format!("the same bytes as {}", other.name());
                        let hint = Some("name each log once".to_string());
                        Error::Log { path: log.path.clone(), offset: 0, what, hint }
                    }
                    None => {
                        if let Some(sha256) = &sha256 {
                            seen.insert(sha256.clone(), log);
                        }
                        plan.jobs.push(Job { number, log: log.clone(), sha256 });
                        continue;
                    }
                },
            };
            plan.fail(log, error);
            on(Event::OfLog { number, step: Step::Ended });
        }
        Ok(plan)
    }

    /// Tell that all work was done before.
    pub fn tell_done(&self, on: &(dyn Fn(Event) + Sync)) {
        for job in &self.jobs {
            on(Event::OfLog { number: job.number, step: Step::Ended });
        }
    }

    /// Note that a log gave nothing.
    pub fn fail(&mut self, log: &GivenLog, error: Error) {
        // The manifest is the same on any machine, wherever its logs lie.
        let text = error.to_string().replace(&*log.path.to_string_lossy(), &log.name());
        self.failed.push(FailedLog { source_log: log.name(), error: text });
        self.first_error.get_or_insert(error);
    }
}

/// Sizes of logs whose bytes have to be told apart before they are read: of those that are
/// committed, and of those that are given twice. All others are hashed while they are read.
fn sizes_that_may_be_known(logs: &[GivenLog], out: &Path) -> Result<BTreeSet<u64>> {
    let (mut seen, mut twice) = (BTreeSet::new(), BTreeSet::new());
    for log in logs {
        if !seen.insert(log.bytes) {
            twice.insert(log.bytes);
        }
    }
    let records = out.join("logs");
    let Ok(entries) = fs::read_dir(&records) else { return Ok(twice) };
    for entry in entries {
        let path: PathBuf = entry.map_err(Error::io("read", &records))?.path();
        if path.extension().is_some_and(|extension| extension == "json") {
            let record: LogRecord = atomic::read_json(&path)?;
            twice.insert(record.source_bytes);
        }
    }
    Ok(twice)
}
