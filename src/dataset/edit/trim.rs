//! The record of a log of which some episodes are left out: its sums are made anew.

use std::collections::BTreeSet;

use crate::{
    dataset::{
        account::TopicAccount,
        edit::source::Source,
        manifest::{EpisodeRecord, LogRecord},
        shard::{ShardReader, ShardRecord},
        skew::Skews,
    },
    drops::Drops,
    error::Result,
};

/// A log without the episodes that `dropped` names; `None` if nothing is left of it. What is said of
/// its file (name, messages, damage) stays, and so does its own id, after its first episode.
///
/// # Errors
///
/// If its shards cannot be read: the skews of the frames that stay are counted anew.
pub fn without(
    source: &Source,
    log: &LogRecord,
    dropped: &BTreeSet<String>,
) -> Result<Option<LogRecord>> {
    let mut left = log.clone();
    let pairs = log.episodes.iter().zip(log.shards_by_episode());
    let (gone, stay): (Vec<_>, Vec<_>) =
        pairs.partition(|(episode, _)| dropped.contains(&episode.id));
    if gone.is_empty() {
        return Ok(Some(left));
    }
    let Some((first, _)) = stay.first() else { return Ok(None) };
    left.mapping = first.mapping.clone();
    left.calibration = first.calibration.clone();
    left.start_ns = first.start_ns;
    let count = |pick: fn(&EpisodeRecord) -> u64| stay.iter().map(|(e, _)| pick(e)).sum();
    let sum = |pick: fn(&EpisodeRecord) -> f64| stay.iter().map(|(e, _)| pick(e)).sum();
    left.frames = count(|episode| episode.frames);
    left.frames_with_full_future = count(|episode| episode.frames_with_full_future);
    left.duration_s = sum(|episode| episode.duration_s);
    left.distance_m = sum(|episode| episode.distance_m);
    left.drops = Drops::default();
    stay.iter().for_each(|(episode, _)| left.drops.extend(&episode.drops));
    for (episode, _) in &gone {
        take_away(&mut left.topics, &episode.topics);
    }
    left.topics.retain(|topic| topic.read > 0);
    let shards: Vec<ShardRecord> = stay.iter().flat_map(|(_, own)| own.iter().cloned()).collect();
    left.skews = skews(source, &shards)?;
    left.shards = shards;
    left.episodes = stay.into_iter().map(|(episode, _)| episode.clone()).collect();
    Ok(Some(left))
}

/// Take the messages of an episode out of a log's account. What is of no episode stays.
fn take_away(topics: &mut [TopicAccount], episode: &[TopicAccount]) {
    for gone in episode {
        let Some(topic) = topics.iter_mut().find(|topic| topic.topic == gone.topic) else {
            continue;
        };
        topic.read = topic.read.saturating_sub(gone.read);
        topic.used = topic.used.saturating_sub(gone.used);
        for (why, count) in &gone.left_out {
            if let Some(left) = topic.left_out.get_mut(why) {
                *left = left.saturating_sub(*count);
            }
        }
        topic.left_out.retain(|_, count| *count > 0);
    }
}

fn skews(source: &Source, shards: &[ShardRecord]) -> Result<Skews> {
    let mut skews = Vec::new();
    for shard in shards {
        skews.extend(ShardReader::open(&source.path, shard)?.skews()?);
    }
    Ok(Skews::of(&skews))
}
