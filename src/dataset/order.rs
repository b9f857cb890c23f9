//! Which frames at which step: a pure function of the seed and the step.
//!
//! Row groups are shuffled, cut into windows, and the frames of each window are shuffled, so that
//! a batch mixes frames from many places while only one window is in memory. Every epoch has
//! another order.

use rand::{SeedableRng as _, seq::SliceRandom as _};
use rand_chacha::ChaCha8Rng;

/// A frame: row group of a part, and which of its frames.
pub type Position = (u32, u32);

/// The order of training frames.
#[derive(Clone, Debug)]
pub struct Order {
    /// Frames of each row group.
    group_frames: Vec<u32>,
    seed: u64,
    batch_size: usize,
    window_groups: usize,
    /// The epoch that `positions` is of.
    epoch: Option<u64>,
    positions: Vec<Position>,
}

impl Order {
    /// An order over row groups of so many frames each; not all of them 0.
    pub fn new(
        group_frames: Vec<u32>,
        seed: u64,
        batch_size: usize,
        window_groups: usize,
    ) -> Order {
        Order { group_frames, seed, batch_size, window_groups, epoch: None, positions: Vec::new() }
    }

    /// Steps until every frame was seen. What does not fill a batch waits for the next epoch,
    /// where it falls elsewhere; fewer frames than a batch make a batch of them all.
    pub fn steps_per_epoch(&self) -> u64 {
        let frames: u64 = self.group_frames.iter().map(|frames| u64::from(*frames)).sum();
        (frames / self.batch_size as u64).max(1)
    }

    /// The frames of the batch at a step, from 0.
    pub fn batch(&mut self, step: u64) -> &[Position] {
        let (epoch, within) = (step / self.steps_per_epoch(), step % self.steps_per_epoch());
        if self.epoch != Some(epoch) {
            self.positions = self.shuffled(epoch);
            self.epoch = Some(epoch);
        }
        let start = within as usize * self.batch_size;
        &self.positions[start..(start + self.batch_size).min(self.positions.len())]
    }

    fn shuffled(&self, epoch: u64) -> Vec<Position> {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        // A stream of its own for each epoch: no epoch depends on how the one before was drawn.
        rng.set_stream(epoch);
        let mut groups: Vec<u32> = (0..self.group_frames.len() as u32).collect();
        groups.shuffle(&mut rng);
        let mut positions = Vec::new();
        for window in groups.chunks(self.window_groups) {
            let start = positions.len();
            for group in window {
                positions.extend((0..self.group_frames[*group as usize]).map(|row| (*group, row)));
            }
            positions[start..].shuffle(&mut rng);
        }
        positions
    }
}
