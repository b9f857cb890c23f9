//! The record of a log, put together from what became of its parts.

use std::{collections::BTreeMap, path::PathBuf, sync::Arc};

use crate::{
    atomic::file_name,
    dataset::{
        account::{self, TopicAccount},
        episode::Episode,
        manifest::{EpisodeRecord, LogRecord},
        skew::Skews,
        split::Split,
    },
    drops::Drops,
    error::{Error, Result},
    frame::Skew,
    log::{reader::Log, recording::Recording},
};

/// A log to ingest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Source {
    pub path: PathBuf,
    /// SHA-256 of its bytes, lower-case hexadecimal.
    pub sha256: String,
    /// Id of its first episode: the same for the same bytes on any machine.
    pub episode: String,
    pub split: Split,
}

impl Source {
    /// A log by its bytes.
    pub fn new(path: PathBuf, sha256: String) -> Source {
        let episode = format!("ep-{}", &sha256[..16]);
        Source { path, split: Split::of(&episode), sha256, episode }
    }
}

/// The parts of a log, as far as they were made.
#[derive(Default)]
pub struct Parts {
    log: Option<Arc<Log>>,
    episodes: Vec<Episode>,
    /// The error of each part that gave no frame, with its number in the log from 1.
    failed: Vec<(usize, Error)>,
    /// Accounts of those.
    without_frames: Vec<TopicAccount>,
    undecodable: BTreeMap<String, (u64, String)>,
    out_of_order: BTreeMap<String, u64>,
    clock_jumps: BTreeMap<String, u64>,
    count: usize,
}

impl Parts {
    /// Id of the next episode.
    pub fn next_id(&self, source: &Source) -> String {
        match self.episodes.len() {
            0 => source.episode.clone(),
            earlier => format!("{}-{}", source.episode, earlier + 1),
        }
    }

    /// Note what holds for a part of the log whatever becomes of it.
    pub fn scanned(&mut self, recording: &Recording) {
        self.count += 1;
        self.log = Some(recording.log.clone());
        for topic in &recording.jumped {
            *self.clock_jumps.entry(topic.clone()).or_default() += 1;
        }
        for topic in recording.topics.values() {
            let (count, why) = &topic.undecodable;
            if *count > 0 {
                let at = topic.first_undecodable.map(|place| recording.log.offset_of(place));
                let why =
                    format!("{}; at byte {}", why.as_deref().unwrap_or_default(), at.unwrap_or(0));
                self.undecodable.entry(topic.name.clone()).or_insert((0, why)).0 += count;
            }
            if topic.out_of_order > 0 {
                *self.out_of_order.entry(topic.name.clone()).or_default() += topic.out_of_order;
            }
        }
    }

    /// The part became an episode.
    pub fn made(&mut self, episode: Episode) {
        self.episodes.push(episode);
    }

    /// The part gave no frame.
    pub fn failed(&mut self, error: Error, messages: Vec<TopicAccount>) {
        self.failed.push((self.count, error));
        self.without_frames.extend(messages);
    }

    /// The record of the whole log.
    ///
    /// # Errors
    ///
    /// The first part's error where none gave a frame.
    pub fn record(mut self, source: &Source) -> Result<LogRecord> {
        let Some((log, first)) = self.log.take().zip(self.episodes.first()) else {
            let nothing = "no part of the log was read".to_string();
            let error = self.failed.into_iter().next().map(|(_, error)| error);
            let path = source.path.clone();
            let nothing = Error::Log { path, offset: 0, what: nothing, hint: None };
            return Err(error.unwrap_or(nothing));
        };
        let records = || self.episodes.iter().map(|episode| &episode.record);
        let mut drops = Drops::default();
        records().for_each(|episode| drops.extend(&episode.drops));
        let accounts = records().flat_map(|episode| &episode.topics);
        let topics = account::sum(accounts.chain(&self.without_frames));
        let skews: Vec<Skew> =
            self.episodes.iter().flat_map(|episode| episode.skews.iter().copied()).collect();
        let count = |pick: fn(&EpisodeRecord) -> u64| records().map(pick).sum();
        let sum = |pick: fn(&EpisodeRecord) -> f64| records().map(pick).sum();
        let (first_record, conditions) = (first.record.clone(), first.conditions.clone());
        let failed = self.failed.iter().map(|(number, error)| {
            let error = error.to_string().replace(&*source.path.to_string_lossy(), "it");
            format!("part {number} of {} of the log: {error}", self.count)
        });
        let left_out = self.episodes.iter().flat_map(|e| e.left_out.iter().cloned());
        let left_out = once_each(left_out.chain(failed));
        let notes = once_each(self.episodes.iter().flat_map(|e| e.notes.iter().cloned()));
        Ok(LogRecord {
            episode: source.episode.clone(),
            split: source.split,
            source_log: file_name(&source.path),
            source_bytes: log.size_bytes,
            source_sha256: source.sha256.clone(),
            messages: log.message_count(),
            conditions,
            mapping: first_record.mapping,
            calibration: first_record.calibration,
            frames: count(|episode| episode.frames),
            frames_with_full_future: count(|episode| episode.frames_with_full_future),
            start_ns: first_record.start_ns,
            duration_s: sum(|episode| episode.duration_s),
            distance_m: sum(|episode| episode.distance_m),
            drops,
            damage: log.damage.clone(),
            undecodable: all_undecodable(self.undecodable, &self.episodes),
            out_of_order: self.out_of_order,
            left_out,
            notes,
            shards: self.episodes.iter().flat_map(|e| e.shards.iter().cloned()).collect(),
            clock_jumps: self.clock_jumps,
            topics,
            skews: Skews::of(&skews),
            episodes: self.episodes.into_iter().map(|episode| episode.record).collect(),
        })
    }
}

/// What the first pass could not decode, and what the second could not.
fn all_undecodable(
    mut undecodable: BTreeMap<String, (u64, String)>,
    episodes: &[Episode],
) -> BTreeMap<String, (u64, String)> {
    for (topic, (count, why)) in episodes.iter().flat_map(|episode| &episode.damaged) {
        undecodable.entry(topic.clone()).or_insert((0, why.clone())).0 += count;
    }
    undecodable
}

fn once_each(sentences: impl Iterator<Item = String>) -> Vec<String> {
    let mut once: Vec<String> = Vec::new();
    for sentence in sentences {
        if !once.contains(&sentence) {
            once.push(sentence);
        }
    }
    once
}
