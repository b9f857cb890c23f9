//! A finished dataset, opened: which of its frames train, which judge, and how to get them.

use std::path::{Path, PathBuf};

use crate::{
    dataset::{
        manifest::{LogRecord, Manifest},
        shard::{RowTick, ShardReader, ShardRecord},
        split::Split,
        traits::Traits,
    },
    error::Result,
    frame::{FUTURE_STEPS, Frame},
};

/// Of a lone episode, the last one in so many frames judges.
const TIME_BLOCK_ONE_IN: u32 = 3;

/// Ticks between the last frame that trains and the first that judges: as long as the future
/// that a frame knows, so that no label of the one lies within the other.
const GUARD_TICKS: u32 = FUTURE_STEPS as u32;

/// How the frames that judge were set apart.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Holdout {
    /// One sentence.
    pub how: String,
    /// A stretch of an episode that was also trained on: good numbers say little of other drives.
    pub is_time_block: bool,
}

/// Those rows of one row group that belong to a part, ascending.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GroupRows {
    /// Index in [`Dataset::shards`].
    pub shard: usize,
    /// Row group in the shard.
    pub group: usize,
    pub rows: Vec<Row>,
}

/// A row of a row group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Row {
    /// Index in the group.
    pub index: u32,
    /// Steps of future before the driving is disturbed on purpose: what comes after is not what
    /// the driver wanted.
    pub undisturbed_steps: u8,
    pub traits: Traits,
}

/// The frames of one side.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Part {
    pub groups: Vec<GroupRows>,
    pub episodes: usize,
}

impl Part {
    /// Frames in it.
    pub fn len(&self) -> usize {
        self.groups.iter().map(|group| group.rows.len()).sum()
    }

    pub fn is_empty(&self) -> bool {
        self.groups.is_empty()
    }
}

/// A dataset that is whole.
#[derive(Debug)]
pub struct Dataset {
    pub path: PathBuf,
    pub manifest: Manifest,
    pub shards: Vec<ShardReader>,
    pub train: Part,
    pub val: Part,
    pub holdout: Holdout,
}

impl Dataset {
    /// Open a dataset and set apart the frames that judge.
    ///
    /// Episodes are on the side that their record says. Where that leaves a side empty, the log
    /// whose episodes have the smallest ids judges; those of a lone log are cut in time: the last
    /// third judges, and the 3 s before it belong to neither side.
    ///
    /// # Errors
    ///
    /// If the folder is no finished dataset, or a shard is missing or damaged.
    pub fn open(path: &Path) -> Result<Dataset> {
        let manifest = Manifest::read(path)?;
        let logs = manifest.logs.clone();
        let sides: Vec<Split> = manifest.logs.iter().map(|log| log.split).collect();
        let has = |split| sides.contains(&split);
        let mut dataset = Dataset {
            path: path.to_path_buf(),
            manifest,
            shards: Vec::new(),
            train: Part::default(),
            val: Part::default(),
            holdout: Holdout {
                how: match logs.iter().all(|log| log.split == Split::of(&log.episode)) {
                    true => "episodes, by a hash of their id, 7 : 1".to_string(),
                    false => "episodes, on the sides that the manifest says".to_string(),
                },
                is_time_block: false,
            },
        };
        if let [log] = logs.as_slice() {
            dataset.cut_in_time(log)?;
        } else {
            if !(has(Split::Train) && has(Split::Val)) {
                dataset.holdout.how =
                    "the episode with the smallest id, since the hash left a side empty".into();
            }
            for (index, log) in logs.iter().enumerate() {
                // Logs are sorted by episode.
                let side = match has(Split::Train) && has(Split::Val) {
                    true => log.split,
                    false if index == 0 => Split::Val,
                    false => Split::Train,
                };
                for shards in log.shards_by_episode() {
                    dataset.add(shards, |_| Some(side))?;
                }
                dataset.part(side).episodes += log.episodes.len();
            }
        }
        Ok(dataset)
    }

    /// The frames of a part in order, each with its episode, one row group in memory at a time.
    pub fn frames<'d>(
        &'d self,
        part: &'d Part,
    ) -> impl Iterator<Item = Result<(String, Frame)>> + 'd {
        part.groups.iter().flat_map(move |group| {
            let (frames, error) = match self.group(group) {
                Ok(frames) => (frames, None),
                Err(error) => (Vec::new(), Some(Err(error))),
            };
            frames.into_iter().map(Ok).chain(error)
        })
    }

    /// The frames of one row group that belong to a part.
    ///
    /// # Errors
    ///
    /// If the shard is damaged.
    pub fn group(&self, group: &GroupRows) -> Result<Vec<(String, Frame)>> {
        let frames = self.shards[group.shard].frames(group.group)?;
        let mut wanted = group.rows.iter().peekable();
        let mut row = 0;
        Ok(frames
            .into_iter()
            .filter(|_| {
                let is_wanted = wanted.next_if(|next| next.index == row).is_some();
                row += 1;
                is_wanted
            })
            .collect())
    }

    fn part(&mut self, side: Split) -> &mut Part {
        match side {
            Split::Train => &mut self.train,
            Split::Val => &mut self.val,
        }
    }

    fn cut_in_time(&mut self, log: &LogRecord) -> Result<()> {
        self.holdout = Holdout {
            how: format!(
                "the last third of the only episode, {} s apart from what was trained on",
                f64::from(GUARD_TICKS) * 0.1
            ),
            is_time_block: true,
        };
        for shards in log.shards_by_episode() {
            let mut last_tick = 0;
            for record in shards {
                let reader = ShardReader::open(&self.path, record)?;
                let last = reader.ticks()?.into_iter().flatten().map(|tick| tick.index).max();
                last_tick = last_tick.max(last.unwrap_or(0));
            }
            let first_val = last_tick + 1 - (last_tick + 1) / TIME_BLOCK_ONE_IN;
            self.add(shards, |tick| match tick {
                tick if tick >= first_val => Some(Split::Val),
                tick if tick + GUARD_TICKS < first_val => Some(Split::Train),
                _ => None,
            })?;
        }
        self.train.episodes = log.episodes.len();
        self.val.episodes = log.episodes.len();
        Ok(())
    }

    /// Open an episode's shards and deal their rows out by tick.
    fn add(
        &mut self,
        shards: &[ShardRecord],
        side_of: impl Fn(u32) -> Option<Split>,
    ) -> Result<()> {
        let mut ticks: Vec<Vec<Vec<RowTick>>> = Vec::new();
        let first_shard = self.shards.len();
        for record in shards {
            let reader = ShardReader::open(&self.path, record)?;
            ticks.push(reader.ticks()?);
            self.shards.push(reader);
        }
        let all = ticks.iter().flatten().flatten();
        let perturbed: Vec<u32> = all.filter(|tick| tick.perturbed).map(|t| t.index).collect();
        for (shard, groups) in (first_shard..).zip(&ticks) {
            for (group, ticks) in groups.iter().enumerate() {
                for side in Split::ALL {
                    let rows = (0..).zip(ticks).filter(|(_, t)| side_of(t.index) == Some(side));
                    let rows = rows.map(|(index, tick)| Row {
                        index,
                        undisturbed_steps: steps_until(&perturbed, tick.index),
                        traits: tick.traits,
                    });
                    let rows: Vec<Row> = rows.collect();
                    if !rows.is_empty() {
                        self.part(side).groups.push(GroupRows { shard, group, rows });
                    }
                }
            }
        }
        Ok(())
    }
}

/// Steps from a tick to the first of the disturbed ones (ascending), at most a whole future.
fn steps_until(perturbed: &[u32], tick: u32) -> u8 {
    let next = perturbed.partition_point(|index| *index < tick);
    let steps = perturbed.get(next).map_or(GUARD_TICKS, |index| index - tick);
    steps.min(GUARD_TICKS) as u8
}
