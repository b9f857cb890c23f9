//! How often frames are shown: rare kinds of moments more often than they are.
//!
//! A frame counts by its rarest trait: its weight is the largest, over the traits, of (even share
//! / share of its kind) to the power of the strength, at most 10, so that no single moment is
//! learned by heart. Then weights are brought to a mean of 1: an epoch stays as long as it is.

use std::fmt::Write as _;

use crate::dataset::traits::{Trait, Traits};

/// Largest weight before weights are brought to a mean of 1.
const MAX_WEIGHT: f64 = 10.0;

/// The weight of every kind of frame, and what it makes of the data.
#[derive(Clone, Debug, PartialEq)]
pub struct Balance {
    /// By [`Traits::index`].
    weights: Vec<f64>,
    frames: Vec<u64>,
}

impl Balance {
    /// Weights for frames of which there are so many of each kind, by [`Traits::index`]; `strength`
    /// 0 shows all alike, 1 shows the kinds of a trait alike as far as possible.
    pub fn new(frames: &[u64], strength: f64) -> Self {
        let frames: Vec<u64> = frames.to_vec();
        let all = frames.iter().sum::<u64>() as f64;
        let factor = |traits: Traits, which: Trait| {
            let of_kind = count(&frames, which, traits.kind(which)) as f64;
            let kinds = (0..which.kinds().len()).filter(|kind| count(&frames, which, *kind) > 0);
            (all / (kinds.count() as f64 * of_kind)).powf(strength)
        };
        let weight = |traits: Traits| match frames[traits.index()] {
            0 => 0.0,
            _ => Trait::ALL.map(|which| factor(traits, which)).into_iter().fold(0.0, f64::max),
        };
        let mut weights: Vec<f64> =
            Traits::all().map(|traits| weight(traits).min(MAX_WEIGHT)).collect();
        let sum: f64 = weights.iter().zip(&frames).map(|(w, n)| w * *n as f64).sum();
        if sum > 0.0 && strength > 0.0 {
            weights.iter_mut().for_each(|weight| *weight *= all / sum);
        } else {
            weights.fill(1.0);
        }
        Self { weights, frames }
    }

    /// How often a frame of such traits is shown in an epoch, in the mean.
    pub fn weight(&self, traits: Traits) -> f64 {
        self.weights[traits.index()]
    }

    /// The share of each kind in the data and in what is shown.
    pub fn shares(&self, which: Trait) -> Vec<[f64; 2]> {
        let all = self.frames.iter().sum::<u64>().max(1) as f64;
        let shown = |kind: usize| -> f64 {
            let of_kind = Traits::all().filter(|traits| traits.kind(which) == kind);
            of_kind.map(|t| self.weights[t.index()] * self.frames[t.index()] as f64).sum()
        };
        let share = |kind| [count(&self.frames, which, kind) as f64 / all, shown(kind) / all];
        (0..which.kinds().len()).map(share).collect()
    }

    /// Before and after, as lines of text.
    pub fn table(&self) -> String {
        let mut text = String::from("share of frames            in the data     shown\n");
        for which in Trait::ALL {
            for (kind, [before, after]) in which.kinds().iter().zip(self.shares(which)) {
                let name = format!("{} {kind}", which.name());
                let (before, after) = (before * 100.0, after * 100.0);
                let _ = writeln!(text, "  {name:<26} {before:>6.2} %  {after:>6.2} %");
            }
        }
        text
    }
}

/// Frames of a kind.
fn count(frames: &[u64], which: Trait, kind: usize) -> u64 {
    let of_kind = Traits::all().filter(|traits| traits.kind(which) == kind);
    of_kind.map(|traits| frames[traits.index()]).sum()
}
