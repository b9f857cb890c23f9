//! One episode of a log: its frames made and written, and what became of everything else.

use std::{collections::BTreeMap, path::Path};

use rayon::prelude::*;

use crate::{
    dataset::{
        account::{self, Fates},
        align::Tick,
        drive::Drive,
        manifest::EpisodeRecord,
        shard::{ROWS_PER_GROUP, ROWS_PER_SHARD, ShardRecord, ShardWriter},
        split::Split,
    },
    drops::Drops,
    error::{Error, Result},
    frame::{Conditions, FUTURE_STEPS, Frame, Skew},
    log::recording::Recording,
};

/// An episode, as written, with what its log's record says for all of them together.
pub struct Episode {
    pub record: EpisodeRecord,
    pub shards: Vec<ShardRecord>,
    pub conditions: Conditions,
    /// Of every frame.
    pub skews: Vec<Skew>,
    /// Samples that ticks asked for and that could not be decoded, by topic: how many, and why
    /// the first.
    pub damaged: BTreeMap<String, (u64, String)>,
    pub left_out: Vec<String>,
    pub notes: Vec<String>,
}

impl Episode {
    /// Write the shards of a drive into a dataset, `blocks_at_once` row groups in memory; `on`
    /// hears of the ticks that were made, and of the frames that came of them.
    ///
    /// # Errors
    ///
    /// If the log cannot be read any more, the disk refuses, or there is no frame at all.
    pub fn write(
        drive: &Drive,
        id: &str,
        split: Split,
        out: &Path,
        blocks_at_once: usize,
        on: &dyn Fn(u64, u64),
    ) -> Result<Episode> {
        let mut made = MadeFrames {
            drops: drive.grid.drops.clone(),
            fates: Fates::of_dropped_ticks(drive),
            ..MadeFrames::default()
        };
        for ticks in drive.grid.ticks.chunks(ROWS_PER_SHARD) {
            let path =
                format!("frames/split={}/{id}-{:05}.parquet", split.name(), made.shards.len());
            let mut writer = ShardWriter::create(&out.join(&path))?;
            let blocks: Vec<&[Tick]> = ticks.chunks(ROWS_PER_GROUP).collect();
            for wave in blocks.chunks(blocks_at_once) {
                let outcomes: Vec<_> = match wave {
                    [block] => vec![drive.frames(block)],
                    wave => wave.par_iter().map(|block| drive.frames(block)).collect(),
                };
                for (block, outcome) in wave.iter().zip(outcomes) {
                    let mut frames = Vec::with_capacity(block.len());
                    for (tick, outcome) in block.iter().zip(outcome?) {
                        made.fates.take(drive, tick, &outcome);
                        made.note_damage(outcome.damaged);
                        match outcome.frame {
                            Ok(frame) => frames.push(*frame),
                            Err((reason, at_ns, why)) => made.drops.add(reason, at_ns, Some(why)),
                        }
                    }
                    on(block.len() as u64, frames.len() as u64);
                    if !frames.is_empty() {
                        made.note_frames(&frames);
                        writer.write(id, &frames)?;
                    }
                }
            }
            let rows = writer.rows() as u64;
            let committed = writer.finish()?;
            let (bytes, sha256) = (committed.bytes, committed.sha256);
            made.shards.push(ShardRecord { path, rows, bytes, sha256, groups: None });
        }
        if made.skews.is_empty() {
            return Err(no_frame(&drive.recording, &made.drops));
        }
        made.episode(drive, id)
    }
}

fn no_frame(recording: &Recording, drops: &Drops) -> Error {
    let what = format!("no frame: {} ticks were left out", drops.total());
    let reasons: Vec<_> = drops.iter().map(|(r, d)| format!("{} {}", d.count, r.name())).collect();
    let hint = format!("by reason: {}", reasons.join(", "));
    Error::Mapping { path: recording.log.path.clone(), what, hint }
}

/// What came of the ticks of a drive.
#[derive(Default)]
struct MadeFrames {
    frames_with_full_future: u64,
    span_ns: Option<(i64, i64)>,
    drops: Drops,
    fates: Fates,
    skews: Vec<Skew>,
    damaged: BTreeMap<String, (u64, String)>,
    shards: Vec<ShardRecord>,
}

impl MadeFrames {
    fn note_frames(&mut self, frames: &[Frame]) {
        let full = frames.iter().filter(|frame| usize::from(frame.future.len) == FUTURE_STEPS);
        self.frames_with_full_future += full.count() as u64;
        self.skews.extend(frames.iter().map(|frame| frame.skew));
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

    fn episode(self, drive: &Drive, id: &str) -> Result<Episode> {
        Ok(Episode {
            record: EpisodeRecord {
                id: id.to_string(),
                frames: self.skews.len() as u64,
                frames_with_full_future: self.frames_with_full_future,
                start_ns: drive.grid.start_ns,
                duration_s: self.span_ns.map_or(0.0, |(first, last)| (last - first) as f64 * 1e-9),
                distance_m: drive.distance_m(),
                drops: self.drops,
                mapping: drive.mapping.clone(),
                calibration: drive.calibration(),
                topics: account::of_drive(drive, &self.fates),
                shards: self.shards.len(),
            },
            shards: self.shards,
            conditions: drive.conditions.clone(),
            skews: self.skews,
            damaged: self.damaged,
            left_out: drive.left_out.clone(),
            notes: drive.notes.clone(),
        })
    }
}
