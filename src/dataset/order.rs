//! Which frames at which step: a pure function of the seed and the step.
//!
//! Row groups are shuffled and cut into windows; from each window as many frames are drawn as
//! their weights add up to, and shuffled. So a batch mixes frames from many places while only one
//! window is in memory, and what a step costs does not depend on how many frames there are. Every
//! epoch has another order. With equal weights each frame comes once an epoch.

use std::{ops::Range, sync::Arc};

use rand::{RngExt as _, SeedableRng as _, seq::SliceRandom as _};
use rand_chacha::ChaCha8Rng;

use crate::dataset::{balance::Balance, traits::Traits};

/// A frame: row group of a part, and which of its frames.
pub type Position = (u32, u32);

/// The order of training frames.
#[derive(Clone, Debug)]
pub struct Order {
    /// Of the frames of each row group.
    traits: Arc<Vec<Vec<Traits>>>,
    balance: Balance,
    frames: u64,
    seed: u64,
    batch_size: u64,
    window_groups: usize,
    epoch: Option<Epoch>,
    /// The windows that the last batch lay in.
    windows: Vec<Window>,
}

/// The row groups of an epoch.
#[derive(Clone, Debug)]
struct Epoch {
    number: u64,
    groups: Vec<u32>,
    /// Sum of the weights before each window.
    before: Vec<f64>,
    /// Draw `k` of the epoch is the frame at which the running sum of the weights passes this + k.
    offset: f64,
}

/// The draws of one window, shuffled.
#[derive(Clone, Debug)]
struct Window {
    draws: Range<u64>,
    positions: Vec<Position>,
}

impl Order {
    /// An order over row groups of frames with such traits; not all of them empty.
    pub fn new(
        traits: Arc<Vec<Vec<Traits>>>,
        balance: Balance,
        seed: u64,
        batch_size: usize,
        window_groups: usize,
    ) -> Order {
        let frames = traits.iter().map(|group| group.len() as u64).sum();
        let (batch_size, windows) = (batch_size as u64, vec![]);
        Order { traits, balance, frames, seed, batch_size, window_groups, epoch: None, windows }
    }

    /// Steps until as many frames were shown as there are. What does not fill a batch waits for
    /// the next epoch, where it falls elsewhere; fewer frames than a batch make a batch of them
    /// all.
    pub fn steps_per_epoch(&self) -> u64 {
        (self.frames / self.batch_size).max(1)
    }

    /// The frames of the batch at a step, from 0.
    pub fn batch(&mut self, step: u64) -> Vec<Position> {
        let (number, within) = (step / self.steps_per_epoch(), step % self.steps_per_epoch());
        let epoch = match self.epoch.take() {
            Some(epoch) if epoch.number == number => epoch,
            _ => {
                self.windows.clear();
                self.start(number)
            }
        };
        let first = within * self.batch_size;
        let last = (first + self.batch_size).min(self.frames);
        let mut windows = vec![];
        let mut batch = vec![];
        let mut draw = first;
        while draw < last {
            let known = self.windows.iter().find(|window| window.draws.contains(&draw));
            let window = match known {
                Some(window) => window.clone(),
                None => self.window(&epoch, draw),
            };
            let end = last.min(window.draws.end);
            let [from, to] = [draw, end].map(|draw| (draw - window.draws.start) as usize);
            batch.extend_from_slice(&window.positions[from..to]);
            windows.push(window);
            draw = end;
        }
        (self.epoch, self.windows) = (Some(epoch), windows);
        batch
    }

    fn start(&self, number: u64) -> Epoch {
        let mut rng = self.stream(number, 0);
        let mut groups: Vec<u32> = (0..self.traits.len() as u32).collect();
        groups.shuffle(&mut rng);
        let mut sum = 0.0;
        let mut before = vec![];
        for window in groups.chunks(self.window_groups) {
            before.push(sum);
            sum += window.iter().map(|group| self.weight_of_group(*group)).sum::<f64>();
        }
        Epoch { number, groups, before, offset: rng.random() }
    }

    /// The window that a draw lies in.
    fn window(&self, epoch: &Epoch, draw: u64) -> Window {
        let first_draw = |before: f64| (before - epoch.offset).ceil().max(0.0) as u64;
        let number = epoch.before[1..].partition_point(|before| first_draw(*before) <= draw);
        let end = epoch.before.get(number + 1).map_or(self.frames, |before| first_draw(*before));
        let draws = first_draw(epoch.before[number])..end;

        let groups = epoch.groups.chunks(self.window_groups).nth(number).unwrap_or_default();
        let frames = groups.iter().flat_map(|group| {
            let traits = &self.traits[*group as usize];
            (0..).zip(traits).map(|(row, traits)| ((*group, row), self.balance.weight(*traits)))
        });
        let frames: Vec<(Position, f64)> = frames.collect();
        let (mut at, mut passed) = (0, epoch.before[number]);
        let mut positions = Vec::with_capacity(frames.len());
        for draw in draws.clone() {
            let threshold = epoch.offset + draw as f64;
            // Rounding may leave the last draw just behind the last frame: it is that frame.
            while at + 1 < frames.len() && passed + frames[at].1 <= threshold {
                passed += frames[at].1;
                at += 1;
            }
            positions.push(frames[at].0);
        }
        positions.shuffle(&mut self.stream(epoch.number, 1 + number as u64));
        Window { draws, positions }
    }

    fn weight_of_group(&self, group: u32) -> f64 {
        let traits = &self.traits[group as usize];
        traits.iter().map(|traits| self.balance.weight(*traits)).sum()
    }

    /// Random numbers of an epoch's own: none depends on how those before it were drawn.
    fn stream(&self, epoch: u64, window: u64) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(epoch << 32 | window);
        rng
    }
}
