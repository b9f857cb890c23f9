//! Frames worth a look: one of every sky in the dataset, or some where the skies are not known.

use std::collections::BTreeSet;

use std::path::Path;

use crate::{
    dataset::{
        manifest::{LogRecord, Manifest},
        shard::{ShardReader, ShardRecord},
    },
    error::Result,
    frame::{Conditions, Frame},
};

/// Moments that are looked at, at most: four illuminations of four weathers.
const MOST: usize = 16;

/// Moments that are looked at, at least, where there are as many episodes.
const LEAST: usize = 6;

/// Levels of traffic, from the one that shows most.
const TRAFFIC: [&str; 4] = ["dense", "regular", "few", "empty"];

/// A frame with what is known of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Moment {
    pub episode: String,
    pub conditions: Conditions,
    /// Size of the stored picture, pixels.
    pub width: usize,
    pub height: usize,
    pub frame: Frame,
}

/// One episode of the dataset that has frames.
struct Candidate<'m> {
    log: &'m LogRecord,
    episode: &'m str,
    shards: &'m [ShardRecord],
}

/// Of each weather and illumination a moment in the densest traffic there is, from as many towns as
/// can be; then of further episodes, evenly, up to six. From the middle row group of an
/// episode, the frame with most radar returns.
///
/// # Errors
///
/// If a shard is missing or damaged.
pub fn moments(dataset: &Path, manifest: &Manifest) -> Result<Vec<Moment>> {
    let candidates = candidates(manifest);
    let mut skies: BTreeSet<[Option<&String>; 2]> = candidates.iter().map(sky).collect();
    let mut towns: Vec<Option<&String>> = Vec::new();
    let mut chosen: Vec<usize> = Vec::new();
    while let Some(wanted) = skies.pop_first() {
        let of_sky = (0..candidates.len()).filter(|i| sky(&candidates[*i]) == wanted);
        let rank = |i: &usize| {
            let Conditions { town, traffic, .. } = &candidates[*i].log.conditions;
            let shown = towns.iter().filter(|seen| **seen == town.as_ref()).count();
            let traffic = traffic.as_deref();
            let level = TRAFFIC.iter().position(|name| Some(*name) == traffic);
            (level.unwrap_or(TRAFFIC.len()), shown)
        };
        if let Some(best) = of_sky.min_by_key(rank) {
            towns.push(candidates[best].log.conditions.town.as_ref());
            chosen.push(best);
        }
    }
    chosen.truncate(MOST);
    let others: Vec<usize> = (0..candidates.len()).filter(|i| !chosen.contains(i)).collect();
    let lacking = LEAST.saturating_sub(chosen.len()).min(others.len());
    chosen.extend((0..lacking).map(|i| others[i * others.len() / lacking]));
    let moment = |i: usize| moment(dataset, manifest, &candidates[i]);
    chosen.into_iter().map(moment).filter_map(Result::transpose).collect()
}

fn sky<'m>(candidate: &Candidate<'m>) -> [Option<&'m String>; 2] {
    let Conditions { weather, illumination, .. } = &candidate.log.conditions;
    [illumination.as_ref(), weather.as_ref()]
}

fn candidates(manifest: &Manifest) -> Vec<Candidate<'_>> {
    let of_log = |log| {
        LogRecord::shards_by_episode(log)
            .zip(&log.episodes)
            .map(move |(shards, episode)| Candidate { log, episode: &episode.id, shards })
    };
    let all = manifest.logs.iter().flat_map(of_log);
    all.filter(|candidate| !candidate.shards.is_empty()).collect()
}

fn moment(
    dataset: &Path,
    manifest: &Manifest,
    candidate: &Candidate<'_>,
) -> Result<Option<Moment>> {
    let shard = ShardReader::open(dataset, &candidate.shards[candidate.shards.len() / 2])?;
    let frames = shard.frames(shard.ticks()?.len() / 2)?;
    let returns = |frame: &Frame| frame.radar.as_ref().map_or(0, |radar| radar.pixel.len());
    let own = frames.into_iter().filter(|(episode, _)| episode == candidate.episode);
    // The first of those that have as many.
    let best = own
        .map(|(_, frame)| frame)
        .reduce(|best, frame| if returns(&frame) > returns(&best) { frame } else { best });
    let camera = &manifest.config.profile.camera;
    Ok(best.map(|frame| Moment {
        episode: candidate.episode.to_string(),
        conditions: candidate.log.conditions.clone(),
        width: camera.width,
        height: camera.height,
        frame,
    }))
}
