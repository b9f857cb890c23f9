//! Batches from a dataset: shards read, pictures decoded, samples kept, batches made ahead.

use std::{
    collections::BTreeMap,
    sync::{
        Arc,
        mpsc::{Receiver, sync_channel},
    },
};

use candle_core::Device;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{
    dataset::{
        augment::{AugmentConfig, Disturbance},
        balance::Balance,
        batch::{Batch, Batches},
        open::{Dataset, GroupRows, Row},
        order::{Order, Position},
        sample::{InputSize, Sample},
        split::Split,
        traits::Traits,
    },
    error::{Error, Result},
    frame::Frame,
};

/// Memory for prepared samples, bytes. A dataset that fits is decoded once.
const CACHE_BYTES: usize = 1 << 30;

/// Row groups that are shuffled together, at most: 2048 frames.
const WINDOW_GROUPS: usize = 32;

/// Batches made ahead of the training.
const AHEAD: usize = 4;

/// Frames in a validation batch.
pub const VALIDATION_BATCH: usize = 64;

/// `episode/frame`, and what is there.
type Named = (String, Sample);

/// Row groups of one side, as samples, as many as fit the memory.
struct Groups {
    dataset: Arc<Dataset>,
    groups: Vec<GroupRows>,
    size: Option<InputSize>,
    /// Samples by group, with the time of their last use.
    cache: BTreeMap<u32, (u64, Arc<Vec<Named>>)>,
    cache_groups: usize,
    uses: u64,
}

impl Groups {
    fn new(dataset: Arc<Dataset>, side: Split, size: Option<InputSize>) -> Groups {
        let part = match side {
            Split::Train => &dataset.train,
            Split::Val => &dataset.val,
        };
        let groups = part.groups.clone();
        let rows = groups.iter().map(|group| group.rows.len()).max().unwrap_or(1);
        let cache_groups = (CACHE_BYTES / (rows * sample_bytes(size))).max(2);
        Groups { dataset, groups, size, cache: BTreeMap::new(), cache_groups, uses: 0 }
    }

    fn samples(&mut self, group: u32) -> Result<Arc<Vec<Named>>> {
        self.uses += 1;
        if let Some((last_use, samples)) = self.cache.get_mut(&group) {
            *last_use = self.uses;
            return Ok(samples.clone());
        }
        let rows = &self.groups[group as usize];
        let frames = self.dataset.group(rows)?;
        let sample = |(row, (episode, frame)): (&Row, &(String, Frame))| {
            let mut sample = Sample::new(frame, self.size)?;
            sample.motion_len = sample.motion_len.min(usize::from(row.undisturbed_steps));
            Ok((format!("{episode}/{}", frame.index), sample))
        };
        let samples: Vec<Named> =
            rows.rows.par_iter().zip(&frames).map(sample).collect::<Result<_>>()?;
        if self.cache.len() >= self.cache_groups {
            let oldest = self.cache.iter().min_by_key(|(_, (last_use, _))| *last_use);
            if let Some(oldest) = oldest.map(|(group, _)| *group) {
                self.cache.remove(&oldest);
            }
        }
        let samples = Arc::new(samples);
        self.cache.insert(group, (self.uses, samples.clone()));
        Ok(samples)
    }

    fn batch(
        &mut self,
        positions: &[Position],
        disturbance: &(dyn Fn(u64) -> Disturbance + Sync),
        device: &Device,
    ) -> Result<Batch> {
        let mut groups: BTreeMap<u32, Arc<Vec<Named>>> = BTreeMap::new();
        for (group, _) in positions {
            if !groups.contains_key(group) {
                groups.insert(*group, self.samples(*group)?);
            }
        }
        let at = |(group, row): &Position| &groups[group][*row as usize];
        let samples: Vec<&Sample> = positions.iter().map(|p| &at(p).1).collect();
        let names = positions.iter().map(|p| at(p).0.clone()).collect();
        Batch::stack(&samples, names, disturbance, device)
    }
}

/// Bytes that a prepared sample takes, about.
fn sample_bytes(size: Option<InputSize>) -> usize {
    let pixels = size.map_or(0, |size| size.height * size.width);
    // RGB in bytes, and returns on some twentieth of the pixels, on all of a small picture.
    size_of::<Sample>() + pixels * 3 + pixels.min(7500) * (4 + 4 * 2)
}

/// How frames are drawn and what is done to them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct SamplingConfig {
    /// 0 shows every frame as often as any other, 1 the kinds of moments as evenly as it goes.
    pub balance: f64,
    pub augment: AugmentConfig,
}

/// Shuffled batches of the training side, made ahead on a thread of their own.
pub struct TrainBatches {
    dataset: Arc<Dataset>,
    size: Option<InputSize>,
    order: Order,
    seed: u64,
    augment: AugmentConfig,
    device: Device,
    /// The step that comes next, and where from.
    ahead: Option<(u64, Receiver<Result<Batch>>)>,
    /// How often kinds of frames are shown.
    pub balance: Balance,
}

impl TrainBatches {
    /// Batches of `batch_size` frames in the order of `seed`, with pictures of `size`.
    ///
    /// # Errors
    ///
    /// [`Error::Dataset`] if there is no frame to train on.
    pub fn new(
        dataset: Arc<Dataset>,
        size: Option<InputSize>,
        batch_size: usize,
        seed: u64,
        sampling: &SamplingConfig,
        device: &Device,
    ) -> Result<TrainBatches> {
        if dataset.train.is_empty() {
            return Err(Error::Dataset {
                path: dataset.path.clone(),
                what: "no frame to train on".to_string(),
                hint: Some("ingest more logs, or longer ones".to_string()),
            });
        }
        let groups = dataset.train.groups.iter();
        let traits: Vec<Vec<Traits>> =
            groups.map(|group| group.rows.iter().map(|row| row.traits).collect()).collect();
        let mut frames = vec![0; Traits::COUNT];
        traits.iter().flatten().for_each(|traits| frames[traits.index()] += 1);
        let balance = Balance::new(&frames, sampling.balance);
        let groups = Groups::new(dataset.clone(), Split::Train, size);
        // Half of what fits, so that a window stays in memory while the next one comes.
        let window_groups = (groups.cache_groups / 2).clamp(1, WINDOW_GROUPS);
        let traits = Arc::new(traits);
        let order = Order::new(traits, balance.clone(), seed, batch_size, window_groups);
        let (augment, device) = (sampling.augment, device.clone());
        Ok(TrainBatches { dataset, size, order, seed, augment, device, ahead: None, balance })
    }

    /// Steps until every frame was seen.
    pub fn steps_per_epoch(&self) -> u64 {
        self.order.steps_per_epoch()
    }

    fn start(&self, first: u64) -> Receiver<Result<Batch>> {
        let (send, receive) = sync_channel(AHEAD);
        let mut groups = Groups::new(self.dataset.clone(), Split::Train, self.size);
        let (mut order, device) = (self.order.clone(), self.device.clone());
        let (augment, seed) = (self.augment, self.seed);
        std::thread::spawn(move || {
            for step in first.. {
                let disturbance = |row| augment.disturbance(seed, step, row);
                let batch = groups.batch(&order.batch(step), &disturbance, &device);
                // A batch that nobody wants any more ends the thread.
                if send.send(batch).is_err() {
                    return;
                }
            }
        });
        receive
    }
}

impl Batches for TrainBatches {
    fn batch(&mut self, step: u64) -> Result<Batch> {
        let receive = match self.ahead.take() {
            Some((next, receive)) if next == step => receive,
            _ => self.start(step),
        };
        let batch = receive.recv().unwrap_or_else(|_closed| {
            let what = "the thread that makes batches stopped".to_string();
            Err(Error::Dataset { path: self.dataset.path.clone(), what, hint: None })
        });
        self.ahead = Some((step + 1, receive));
        batch
    }
}

/// All frames of the validation side in order, [`VALIDATION_BATCH`] at a time.
pub struct ValidationBatches {
    groups: Groups,
    positions: Vec<Position>,
    device: Device,
}

impl ValidationBatches {
    pub fn new(dataset: Arc<Dataset>, size: Option<InputSize>, device: &Device) -> Self {
        let groups = Groups::new(dataset, Split::Val, size);
        let positions = (0..).zip(&groups.groups);
        let positions = positions
            .flat_map(|(group, rows)| (0..rows.rows.len() as u32).map(move |row| (group, row)));
        let positions = positions.collect();
        ValidationBatches { groups, positions, device: device.clone() }
    }

    /// Batches that there are.
    pub fn count(&self) -> u64 {
        self.positions.len().div_ceil(VALIDATION_BATCH) as u64
    }
}

impl Batches for ValidationBatches {
    fn batch(&mut self, step: u64) -> Result<Batch> {
        let start = step as usize * VALIDATION_BATCH;
        let end = (start + VALIDATION_BATCH).min(self.positions.len());
        let positions = self.positions[start.min(end)..end].to_vec();
        self.groups.batch(&positions, &|_row| Disturbance::none(), &self.device)
    }
}
